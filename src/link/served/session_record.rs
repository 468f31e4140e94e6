//! The run folder of a controller's test: one row per exchange, events, a summary.
//!
//! The format is that of every run folder ([`gusset_record`]), so `gusset export` and `gusset report` read it, finished or
//! not: after a kill −9 the rows of the last moments are missing, and nothing else.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crossbeam_channel::Sender;

use super::identity::Identity;
use super::session_summary::summary_of;
use super::{Controller, Trip};
use gusset_control::engine::ReceivedTest;
use gusset_control::port::ReceivedPort;
use gusset_quantity::catalog::ending::{Cause, Status as Ended};
use gusset_quantity::catalog::event::{Remark, Severity};
use gusset_quantity::substructure::LinkStats;
use gusset_record::Summary;
use gusset_record::origin::Origin;
use gusset_record::rt::os;
use gusset_record::rt::wall::Wall;
use gusset_record::summary::RecordedVerdict;
use gusset_record::writer::Clocks;
use gusset_record::{
    Column, Event, FolderError, Layout, Note, Position, Recorder, RingRecorder, RingSize,
    RunFolder, TripValue, WhenFull, Writer, WriterSettings, ring,
};

/// Settings of a server's record.
#[derive(Debug, Clone)]
pub struct RecordSettings {
    /// Folder of all tests; each gets a subfolder: `test-0001`, `test-0002`, …
    pub root: PathBuf,
    /// The file that is served, byte for byte.
    pub file: Vec<u8>,
    /// The complete configuration.
    pub resolved: String,
    /// Other files that were read: name and bytes.
    pub inputs: Vec<(PathBuf, Vec<u8>)>,
    /// `[about]` of the file.
    pub about: Option<serde_json::Value>,
    /// Seconds of rows that the queue to the writer holds.
    pub queue_s: f64,
    /// A lost row makes the test a failed one.
    pub required: bool,
    /// Reasons of the user for findings that would refuse the gateway, by key.
    pub accepted: BTreeMap<String, String>,
    /// The verdict on a gateway.
    pub verdict: Option<RecordedVerdict>,
    /// Receives each test at its end.
    pub ended: Option<Sender<Option<EndedTest>>>,
}

/// Number of columns of the rows, and where they go.
pub(super) type RowSink = (usize, Box<dyn Recorder>);

/// The folder of a test that has ended, and its summary.
pub type EndedTest = (RunFolder, Summary);

/// Exchanges per second that the queue is made for where the protocol does not announce a rate.
const USUAL_RATE_HZ: f64 = 1000.0;
/// Highest number of a folder.
const MOST_FOLDERS: u32 = 999_999;

/// A test that is being recorded.
pub(super) struct SessionRecord {
    folder: RunFolder,
    name: String,
    writer: Writer,
    rate_hz: Option<f64>,
    began: Wall,
    /// Warnings of the summary.
    warnings: Vec<String>,
    /// Accepted findings: key and reason.
    accepted: BTreeMap<String, String>,
    /// Position of the newest exchange.
    position: Position,
    began_ns: u64,
    required: bool,
    verdict: Option<RecordedVerdict>,
    about: Option<serde_json::Value>,
    ended: Option<Sender<Option<EndedTest>>>,
}

impl SessionRecord {
    /// The folder, with everything that is known before the test; the number of its columns, and where its rows go. Touches the disk, and starts two threads.
    pub(crate) fn open(
        settings: &RecordSettings,
        (identity, port): (&Identity, &ReceivedPort),
        controller: &Controller,
        (pace_hz, away_from): (Option<f64>, Option<usize>),
    ) -> Result<(Self, RowSink), String> {
        let mut folder = next_folder(&settings.root)?;
        let announced = controller.rate;
        let announced = announced.map(|(above, below)| above as f64 / below as f64);
        let rate_hz = pace_hz.or(announced.filter(|rate| rate.is_finite()));
        let (name, columns) = (identity.name.as_str(), identity.columns(port));
        let made = Self::make(settings, &mut folder, (name, columns), rate_hz, away_from);
        let (writer, recorder, layout) = match made {
            Ok(made) => made,
            Err(text) => {
                folder.abandon();
                return Err(text);
            }
        };
        let log = Self {
            name: name.to_owned(),
            writer,
            rate_hz,
            began: Wall::now(),
            warnings: Vec::new(),
            position: Position::default(),
            began_ns: os::monotonic_ns(),
            required: settings.required,
            accepted: settings.accepted.clone(),
            verdict: settings.verdict.clone(),
            about: settings.about.clone(),
            ended: settings.ended.clone(),
            folder,
        };
        let files = log
            .folder
            .files_event(&settings.file, &settings.resolved, &layout);
        log.note(files.into());
        log.note(
            Event::Controller {
                peer: controller.peer.to_string(),
                test: controller.test.clone(),
                software: controller.software.clone(),
            }
            .into(),
        );
        Ok((log, (layout.columns().len(), Box::new(recorder))))
    }

    fn make(
        settings: &RecordSettings,
        folder: &mut RunFolder,
        (name, columns): (&str, Vec<Column>),
        rate_hz: Option<f64>,
        away_from: Option<usize>,
    ) -> Result<(Writer, RingRecorder, Layout), String> {
        let words = |error: FolderError| error.to_string();
        let kept = folder.keep(&settings.file, &settings.resolved, &settings.inputs);
        kept.map_err(words)?;
        let layout = Layout::new(columns).map_err(|error| error.to_string())?;
        let samples = folder.open_samples(&layout).map_err(words)?;
        let events = folder.open_events().map_err(words)?;
        let width = layout.columns().len();
        let rate = rate_hz.unwrap_or(USUAL_RATE_HZ);
        let size = RingSize::for_rate(width, rate, settings.queue_s);
        let (recorder, reader) =
            ring(width, size, WhenFull::Drop).map_err(|error| error.to_string())?;
        let clocks = Clocks {
            monotonic_ns: os::monotonic_ns,
            utc_ns: || Wall::now().0,
        };
        let writer = WriterSettings {
            step_column: layout.index_of("step"),
            time_column: layout.index_of("time"),
            specimens: vec![name.to_owned()],
            away_from,
            ..WriterSettings::default()
        };
        let writer = Writer::spawn(reader, samples, events, None, clocks, writer, None);
        let writer = writer.map_err(|error| error.to_string())?;
        Ok((writer, recorder, layout))
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// This exchange begins, whose command is of that test time. Real-time: yes.
    pub(crate) const fn begins(&mut self, exchange: u64, time: f64) {
        self.position = Position {
            tick: Some(exchange),
            time: Some(time),
        };
    }

    /// Something that is no exchange, at the newest one.
    pub(crate) fn note(&self, note: Note) {
        self.writer
            .note(note.made_at(self.position, os::monotonic_ns()));
    }

    /// Adds a warning to the summary.
    pub(crate) fn warn(&mut self, event: Remark, text: &str) {
        self.note(Event::said(event, text).into());
        self.list_warning(text);
    }

    /// Adds a warning to the summary that has an event already.
    pub(crate) fn list_warning(&mut self, text: &str) {
        self.warnings.push(text.to_owned());
    }

    /// True if the summary already contains this warning.
    pub(crate) fn has_warned(&self, text: &str) -> bool {
        self.warnings.iter().any(|warning| warning == text)
    }

    /// The user's reason to accept a wiring fault.
    pub(crate) fn accept_wiring(&mut self, reason: &str) {
        let key = "accept_wiring".to_owned();
        self.accepted.insert(key, reason.to_owned());
    }

    /// The specimen holds from here on.
    pub(crate) fn tripped(&self, trip: Trip, text: &str) {
        let limit = match trip {
            Trip::Limit(hit) | Trip::TooFast { hit, .. } => Some(TripValue {
                axis: hit.axis as u32,
                unit: hit.quantity.unit().into(),
                value: hit.value,
                bound: hit.bound,
            }),
            _ => None,
        };
        self.note(
            Event::Trip {
                text: text.to_owned(),
                what: trip.name().into(),
                code: trip.code(),
                limit,
            }
            .into(),
        );
    }

    /// Writes the record of a test with this many commits, and commands that left late. The program's log reports a file that cannot be
    /// written.
    pub(crate) fn close(
        self,
        cause: Cause,
        text: &str,
        stats: &LinkStats,
        (commits, missed_edges): (u64, u64),
        test: &mut ReceivedTest,
    ) {
        let severity = match cause.status() {
            Ended::Completed | Ended::Interrupted => Severity::Info,
            Ended::Stopped | Ended::Failed => Severity::Error,
        };
        self.note(Note::new(Event::said(Remark::Ended, text)).at(severity));
        let Self {
            folder,
            name,
            writer,
            rate_hz,
            began,
            warnings,
            accepted,
            began_ns,
            required,
            verdict,
            about,
            ended,
            ..
        } = self;
        let timing = test.take_timing();
        let wall_seconds = os::monotonic_ns().saturating_sub(began_ns) as f64 * 1e-9;
        let recorded = writer.finish().unwrap_or_default();
        let cause = match cause {
            Cause::Done if required && recorded.rows_lost() > 0 => Cause::RecordDamaged,
            cause => cause,
        };
        let summary = Summary {
            status: cause.status(),
            cause: Some(cause.word().to_owned()),
            reason: text.to_owned(),
            wall_seconds,
            timing: Some(timing.summarised()),
            rows_lost: recorded.rows_lost(),
            inputs: folder.inputs().to_vec(),
            warnings: warnings.into_iter().chain(recorded.loss()).collect(),
            accepted,
            verdict,
            about,
            origin: Some(Origin::new(began, folder.path())),
            steps: commits,
            deadline_misses: missed_edges,
            ..summary_of(&test.counts(), &name, stats, (rate_hz, began))
        };
        for result in [
            folder.write_timing(&timing.with_bins()),
            folder.write_summary(&summary),
        ] {
            if let Err(error) = result {
                tracing::error!("not written: {error}");
            }
        }
        if recorded.rows_lost() > 0 {
            tracing::error!("{} ROWS ARE LOST", recorded.rows_lost());
        }
        if let Some(ended) = ended {
            // The receiver of reports has closed; the record is whole.
            let _ = ended.send(Some((folder, summary)));
        }
    }
}

/// Tests that may begin within [`NEW_S`]: one that begins and ends tests all the time must not fill the disk with folders.
const MOST_NEW: u32 = 30;
const NEW_S: u64 = 30;

/// The folder after the last one in `root`. Two servers may share a root.
fn next_folder(root: &Path) -> Result<RunFolder, String> {
    let number = |name: &str| name.strip_prefix("test-")?.parse::<u32>().ok();
    let last = std::fs::read_dir(root).map_or(0, |entries| {
        let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        names.filter_map(|name| number(&name)).max().unwrap_or(0)
    });
    let mut next = last.saturating_add(1);
    let earlier = next
        .checked_sub(MOST_NEW)
        .map(|number| path_of(root, number));
    if earlier.is_some_and(|folder| is_new(&folder)) {
        return Err(format!(
            "{MOST_NEW} tests began within the last {NEW_S} s, and each has a folder in {}: wait a moment, or serve without \
             `--out`",
            root.display()
        ));
    }
    loop {
        match RunFolder::create(&path_of(root, next)) {
            Err(FolderError::Occupied { .. }) if next < MOST_FOLDERS => next += 1,
            other => return other.map_err(|error| error.to_string()),
        }
    }
}

fn path_of(root: &Path, number: u32) -> PathBuf {
    root.join(format!("test-{number:04}"))
}

/// True for a folder that was made within [`NEW_S`]. Later additions do not make it new.
fn is_new(folder: &Path) -> bool {
    let Ok(found) = folder.metadata() else {
        return false;
    };
    let made = [found.created(), found.modified()].into_iter().flatten();
    let age = made
        .min()
        .map(|made| Wall::now().system_time().duration_since(made));
    // One of the future was made before the clock was set.
    matches!(age, Some(Ok(age)) if age.as_secs() < NEW_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rapid_tests_are_refused_folders() {
        let root = tempfile::tempdir().unwrap();
        for number in 1..=MOST_NEW {
            let made = next_folder(root.path()).unwrap();
            assert_eq!(made.path(), path_of(root.path(), number));
        }
        assert!(next_folder(root.path()).is_err());
        // As if that one had been made a while ago.
        let earlier = std::fs::File::open(path_of(root.path(), 1)).unwrap();
        let ago = std::time::Duration::from_secs(NEW_S + 1);
        let then = Wall::now().system_time() - ago;
        earlier.set_modified(then).unwrap();
        assert!(next_folder(root.path()).is_ok());
    }
}
