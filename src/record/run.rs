//! A run folder read: finished or not, on any machine, from the folder alone.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use serde::de::{DeserializeOwned, Error as _};
use serde_json::{Map, Value};

use super::checkpoint::{Checkpoint, CheckpointFault, STATE_FILES, StateFaults};
use super::checksum::Checksum;
use super::events::{Event, EventLine};
use super::folder::{AFTER, FILES, FolderError, at};
use super::journal::Journal;
use super::layout::Layout;
use super::origin::Origin;
use super::rt::timing::Timings;
use super::summary::Summary;
use gusset_quantity::work::Work;

/// Bytes of the longest line of `events.jsonl` that is read.
const LONGEST_LINE: u64 = 1 << 20;
/// Characters of a damaged line that an error shows.
const MOST_SHOWN: usize = 80;
/// Events of one kind that [`Run::events`] holds: more than a reader looks at.
pub const MOST_OF_A_KIND: u64 = 10_000;

/// A recorded run, finished or not.
#[derive(Debug, Clone)]
pub struct Run {
    path: PathBuf,
    layout: Layout,
    summary: Option<Summary>,
    summary_fault: Option<String>,
}

/// The lines of `events.jsonl`, in bounded memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Events {
    /// The events, in order: the first [`MOST_OF_A_KIND`] of each kind.
    pub events: Vec<EventLine>,
    /// Number of further events by kind. Events of another version are of one kind, without a name.
    pub left_out: BTreeMap<&'static str, u64>,
    /// Lines that could not be read; one at the end is normal after a kill.
    pub unreadable: usize,
    /// The last line is one of those, and was never finished.
    pub is_torn: bool,
    /// There is a file of them: every run has one from its beginning on.
    pub is_there: bool,
}

impl Events {
    /// The lines as JSON, in order.
    #[cfg(any(test, feature = "test-doubles"))]
    #[must_use]
    pub fn to_json(&self) -> Vec<serde_json::Value> {
        let lines = self.events.iter();
        lines.map(|line| line.to_map().into()).collect()
    }

    /// The loop said that it was over.
    #[must_use]
    pub fn have_end(&self) -> bool {
        let mut lines = self.events.iter().rev();
        lines.any(|line| line.event == Event::Ended)
    }
}

impl Run {
    /// Opens a run folder for reading.
    ///
    /// # Errors
    /// [`FolderError`] says whether there is nothing, something else, or a damaged run.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let owned = || path.to_owned();
        if !path.exists() {
            return Err(FolderError::Missing(owned()));
        }
        if !path.is_dir() {
            return Err(FolderError::NotAFolder(owned()));
        }
        if fs::read_dir(path).map_err(at(path))?.next().is_none() {
            return Err(FolderError::Empty(owned()));
        }
        for name in FILES.into_iter().chain(AFTER) {
            let file = path.join(name);
            if keeps_waiting(&file) {
                return Err(FolderError::NotAFile(file));
            }
        }
        let layout_path = path.join("samples.json");
        let Some(text) = if_there(&layout_path, fs::read_to_string(&layout_path))? else {
            return Err(if path.join("test.toml").exists() {
                FolderError::NoSamples(owned())
            } else {
                FolderError::Foreign(owned())
            });
        };
        let layout = Layout::from_json(&text).map_err(|source| FolderError::Layout {
            path: layout_path,
            source,
        })?;
        let summary_path = path.join("summary.json");
        let (summary, summary_fault) = match read_json(&summary_path) {
            Ok(summary) => (summary, None),
            Err(FolderError::Damaged { source, .. }) => (None, Some(source.to_string())),
            Err(error) => return Err(error),
        };
        Ok(Self {
            path: owned(),
            layout,
            summary,
            summary_fault,
        })
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The columns of its rows.
    #[must_use]
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Its summary; `None` if the run is unfinished: still running, or killed; or if it cannot be read.
    #[must_use]
    pub const fn summary(&self) -> Option<&Summary> {
        self.summary.as_ref()
    }

    /// `[about]` of the test; none without one, or if the file cannot be read. It is in the summary, and in `resolved.toml` of a run
    /// without a summary.
    #[must_use]
    pub fn about(&self) -> Option<Value> {
        let Some(summary) = &self.summary else {
            let text = fs::read_to_string(self.path.join("resolved.toml")).ok()?;
            let table: toml::Table = text.parse().ok()?;
            let about = serde_json::to_value(table.get("about")?).ok()?;
            return about
                .as_object()
                .is_some_and(|about| !about.is_empty())
                .then_some(about);
        };
        summary.about.clone()
    }

    /// The time, machine, folder and program of the run; none in an older folder. They are in the summary, and in the event `files` of
    /// a run without a summary.
    #[must_use]
    pub fn origin(&self) -> Option<Origin> {
        let Some(summary) = &self.summary else {
            let lines = self.event_lines().ok()?;
            let mut files = lines.filter_map(|line| match line.ok()??.event {
                Event::Files { origin, .. } => Some(origin),
                _ => None,
            });
            return files.next()?.map(|origin| *origin);
        };
        summary.origin.clone()
    }

    /// Why its summary, which is there, cannot be read. It counts as missing then.
    #[must_use]
    pub fn summary_fault(&self) -> Option<&str> {
        self.summary_fault.as_deref()
    }

    /// The histograms of its loop; none if there is no `timing.json`: the run is unfinished, or the file was not written.
    ///
    /// # Errors
    /// [`FolderError::Damaged`], or the system refuses.
    pub fn timings(&self) -> Result<Option<Timings>, FolderError> {
        read_json(&self.path.join("timing.json"))
    }

    /// A reader of its rows from the first.
    ///
    /// # Errors
    /// The system refuses, or there is no `samples.bin`.
    pub fn journal(&self) -> Result<Journal<File>, FolderError> {
        let path = self.path.join("samples.bin");
        let file = File::open(&path).map_err(at(&path))?;
        let work = Work::begin("reading the record", self.places()?);
        Ok(Journal::new(file, self.layout.columns().len()).watched(work))
    }

    /// The last whole row of its file with its number, if it is sound; `None` if there is no such row. Earlier rows are not
    /// examined.
    ///
    /// # Errors
    /// The system refuses, or there is no `samples.bin`.
    pub fn last_row(&self) -> Result<Option<(u64, Vec<f64>)>, FolderError> {
        let path = self.path.join("samples.bin");
        let mut file = File::open(&path).map_err(at(&path))?;
        let stride = self.layout.stride() as u64;
        let Some(last) = self.places()?.checked_sub(1) else {
            return Ok(None);
        };
        file.seek(SeekFrom::Start(last * stride))
            .map_err(at(&path))?;
        // Its number suffices here: a reader of all rows counts the losses before it.
        let mut journal = Journal::new(file, self.layout.columns().len());
        let row = journal.next_row().map_err(at(&path))?;
        Ok(row.map(|row| (row.sequence, row.values.to_vec())))
    }

    /// Rows made according to the file, lost ones included: by the number of its last row, or, where that is damaged, by
    /// its length.
    ///
    /// # Errors
    /// The system refuses, or there is no `samples.bin`.
    pub fn rows_made(&self) -> Result<u64, FolderError> {
        match self.last_row()? {
            Some((number, _)) => Ok(number.saturating_add(1)),
            None => self.places(),
        }
    }

    /// Whole rows that its file has room for.
    ///
    /// # Errors
    /// The system refuses, or there is no `samples.bin`.
    pub fn places(&self) -> Result<u64, FolderError> {
        let path = self.path.join("samples.bin");
        let file = fs::metadata(&path).map_err(at(&path))?;
        Ok(file.len() / self.layout.stride() as u64)
    }

    /// The newest state from which the test can continue, and what is wrong with newer ones. Its event has the same SHA-256, all
    /// rows up to it are on record, and at least one row follows it before the row with number `end`.
    ///
    /// # Errors
    /// The system refuses the events or the rows.
    pub fn usable_state(&self, end: u64) -> Result<(Option<Checkpoint>, StateFaults), FolderError> {
        let (mut found, mut faults) = (Vec::new(), StateFaults::new());
        for name in STATE_FILES {
            match Checkpoint::read(&self.path.join(name)) {
                Ok(Some(state)) => found.push((name, state)),
                Ok(None) => {}
                Err(fault) => faults.push((name, fault)),
            }
        }
        if found.is_empty() {
            return Ok((None, faults));
        }
        let wanted: Vec<_> = found
            .iter()
            .map(|(_, (state, checksum))| (state.step, *checksum))
            .collect();
        let confirmed = self.confirmed(&wanted)?;
        let made = self.rows_made()?;
        for ((name, (state, _)), is_confirmed) in found.into_iter().zip(confirmed) {
            let (step, rows) = (state.step, state.rows);
            if !is_confirmed {
                faults.push((name, CheckpointFault::Unmatched { step }));
            } else if rows > made {
                faults.push((name, CheckpointFault::Ahead { rows, made }));
            } else if rows < made.min(end) {
                return Ok((Some(state), faults));
            }
        }
        Ok((None, faults))
    }

    /// Whether there is a checkpoint event of each step with this SHA-256. Its memory does not grow with the number of events.
    fn confirmed(&self, wanted: &[(u64, Checksum)]) -> Result<Vec<bool>, FolderError> {
        let mut confirmed = vec![false; wanted.len()];
        for line in self.event_lines()? {
            let of = line?.and_then(|line| match line.event {
                Event::Checkpoint { sha256, .. } => line.tick.zip(sha256),
                _ => None,
            });
            for (wanted, confirmed) in wanted.iter().zip(&mut confirmed) {
                *confirmed |= of == Some(*wanted);
            }
        }
        Ok(confirmed)
    }

    /// Whole columns by name, in the requested order.
    ///
    /// # Errors
    /// [`FolderError::NoColumn`], or the system refuses.
    pub fn columns(&self, names: &[&str]) -> Result<Vec<Vec<f64>>, FolderError> {
        let find = |name: &&str| {
            let place = self.layout.index_of(name);
            place.ok_or_else(|| FolderError::NoColumn((*name).to_owned()))
        };
        let places = names.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let path = self.path.join("samples.bin");
        self.journal()?.columns(&places).map_err(at(&path))
    }

    /// Its events, the first ones of each kind; none if there is no file of them.
    ///
    /// # Errors
    /// The system refuses.
    pub fn events(&self) -> Result<Events, FolderError> {
        let mut lines = self.event_lines()?;
        let mut events = Vec::new();
        let mut counts: BTreeMap<&'static str, u64> = BTreeMap::new();
        for event in &mut lines {
            let Some(event) = event? else {
                continue;
            };
            let kind = event.row().map_or("", |row| row.name);
            let count = counts.entry(kind).or_default();
            *count += 1;
            if *count <= MOST_OF_A_KIND {
                events.push(event);
            }
        }
        let more = |(kind, count): (_, u64)| Some((kind, count.checked_sub(MOST_OF_A_KIND)?));
        let left_out = counts.into_iter().filter_map(more);
        Ok(Events {
            events,
            left_out: left_out.filter(|(_, count)| *count > 0).collect(),
            unreadable: lines.unreadable,
            is_torn: lines.is_torn,
            is_there: lines.is_there(),
        })
    }

    /// Its events one after the other, however many there are; none if there is no file of them.
    ///
    /// # Errors
    /// The system refuses.
    pub fn event_lines(&self) -> Result<EventLines, FolderError> {
        let path = self.path.join("events.jsonl");
        let file = if_there(&path, File::open(&path))?;
        Ok(EventLines {
            lines: file.map(BufReader::new),
            path,
            line: Vec::new(),
            unreadable: 0,
            is_torn: false,
        })
    }
}

/// Reads events one after the other.
#[derive(Debug)]
pub struct EventLines {
    lines: Option<BufReader<File>>,
    path: PathBuf,
    line: Vec<u8>,
    /// Lines so far that could not be read; one at the end is normal after a kill.
    pub unreadable: usize,
    /// The last line is one of those, and was never finished.
    pub is_torn: bool,
}

impl EventLines {
    /// There is a file of them: every run has one from its beginning on.
    #[must_use]
    pub(crate) const fn is_there(&self) -> bool {
        self.lines.is_some()
    }

    /// Reads the next line without its end; false after the last line. A line that is longer than any event is cut off.
    fn next_line(&mut self) -> io::Result<bool> {
        let Some(lines) = &mut self.lines else {
            return Ok(false);
        };
        self.line.clear();
        let mut piece = lines.take(LONGEST_LINE);
        let length = piece.read_until(b'\n', &mut self.line)?;
        if length == 0 {
            return Ok(false);
        }
        let is_whole = self.line.ends_with(b"\n");
        self.is_torn = !is_whole && (length as u64) < LONGEST_LINE;
        if is_whole {
            self.line.pop();
        } else {
            lines.skip_until(b'\n')?;
        }
        Ok(true)
    }
}

impl Iterator for EventLines {
    /// An event; none where a line cannot be read.
    type Item = Result<Option<EventLine>, FolderError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.next_line() {
                Ok(true) if self.line.is_empty() => {}
                Ok(true) => break,
                Ok(false) => return None,
                Err(error) => return Some(Err(at(&self.path)(error))),
            }
        }
        let line = serde_json::from_slice::<Map<String, Value>>(&self.line);
        let event = line.ok().map(EventLine::from);
        self.unreadable += usize::from(event.is_none());
        self.is_torn &= event.is_none();
        Some(Ok(event))
    }
}

/// True for a pipe or a device, which might block its reader for ever. False for a folder: reading it fails at once.
#[must_use]
pub fn keeps_waiting(path: &Path) -> bool {
    path.metadata()
        .is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// The content of a JSON file of a run; `None` if there is no such file.
///
/// # Errors
/// [`FolderError::Damaged`] with the line that does not fit, or the system refuses.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, FolderError> {
    let Some(text) = if_there(path, fs::read(path))? else {
        return Ok(None);
    };
    serde_json::from_slice(&text).map_err(|error| {
        let line = text
            .split(|byte| *byte == b'\n')
            .nth(error.line().saturating_sub(1));
        let line = String::from_utf8_lossy(line.unwrap_or_default());
        let start: String = line.trim().chars().take(MOST_SHOWN).collect();
        FolderError::Damaged {
            path: path.to_owned(),
            source: serde_json::Error::custom(format!("{error}: {start}")),
        }
    })
}

/// The content read; `None` if there is no such file.
fn if_there<T>(path: &Path, read: io::Result<T>) -> Result<Option<T>, FolderError> {
    match read {
        Ok(found) => Ok(Some(found)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(at(path)(error)),
    }
}
