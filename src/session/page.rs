//! report.html: made from the run folder and nothing else, now or years later.

use std::cell::Cell;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::agreement::{is_of_an_earlier_version, with_record};
use super::energetics::{Without, first_line, known};
use super::origin::Origin;
use gusset_motion::metrics::energy::Model;
use gusset_quantity::catalog::phase::Phase;
use gusset_record::filed::filed;
use gusset_record::summary::Status;
use gusset_record::{
    BEFORE, COMMITS, Column, End, Events, FolderError, MissingEnd, Run, RunFolder, Summary, atomic,
};
use gusset_view::report::{
    BLOCK, Digest, Earlier, IdentifiedAxis, Source, effect, followed, hero_svg, identified,
    missing_metrics, render, tracking_metrics, without_disp,
};
use gusset_view::{Flaws, ResolvedTest, RunView, TestFile};

/// Its name in the run folder.
const PAGE: &str = "report.html";

/// Why there is no report.
#[derive(Debug, Error)]
pub enum PageError {
    /// The run folder cannot be read.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file of it cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
}

/// Content of a run folder's page.
#[derive(Debug)]
pub struct Page {
    /// The file.
    pub path: PathBuf,
    /// Identified stiffness and lag of each axis; none for a test with a structure.
    pub identified: Vec<IdentifiedAxis>,
    /// How each axis followed its target, in words.
    pub followed: Vec<String>,
    /// Missing parts of the record, in words.
    pub damaged: Vec<String>,
    /// One of that is a damaged row.
    pub has_damaged_rows: bool,
    /// Keys of the summary that the rows and events contradict, in words.
    pub contradicted: Vec<String>,
    /// The summary is of an earlier version.
    pub is_of_an_earlier_version: bool,
}

/// Writes report.html into a run folder, finished or not.
///
/// # Errors
/// [`PageError`].
pub fn write_report(folder: &Path) -> Result<Page, PageError> {
    let run = read(folder)?;
    let path = write(&folder.join(PAGE), &render(&run))?;
    Ok(page(path, &run))
}

/// Writes report.html into the folder of a run or a served test that has just ended, and the tracking metrics into its summary,
/// which is written again.
///
/// # Errors
/// [`PageError`]; the summary is then the one that was written before.
pub fn conclude(folder: &RunFolder, summary: &mut Summary) -> Result<Page, PageError> {
    if !folder.is_there() {
        return Err(FolderError::Lost(folder.path().join(PAGE)).into());
    }
    let mut run = read(folder.path())?;
    summary.metrics = Some(tracking_metrics(&run));
    summary.metrics_missing = missing_metrics(&run);
    summary.falsified = effect(&run);
    folder.write_summary(summary)?;
    // As a later report reads it.
    run.summary = Some(summary.clone());
    folder.write(PAGE, render(&run).as_bytes())?;
    Ok(page(folder.path().join(PAGE), &run))
}

fn page(path: PathBuf, run: &RunView) -> Page {
    Page {
        path,
        identified: identified(run),
        followed: followed(run),
        damaged: run.flaws.damaged.clone(),
        has_damaged_rows: run.flaws.has_damaged_rows,
        contradicted: run.flaws.contradicted.clone(),
        is_of_an_earlier_version: is_of_an_earlier_version(run.events.iter()),
    }
}

/// The rows of a run folder, read from the file as often as needed.
struct OnDisk<'a> {
    run: &'a Run,
    path: PathBuf,
    step_s: Option<f64>,
    ticks_per_step: u64,
    earlier: Option<Earlier>,
    without_disp: Vec<u32>,
    /// How the rows ended where they ended.
    end: Cell<Option<RowsEnd>>,
    /// Exchanges of a served test that a later one of their step replaced.
    replaced: Cell<u64>,
}

/// How rows ended that were read from the first to the last.
#[derive(Debug, Clone, Copy)]
struct RowsEnd {
    end: Option<End>,
    /// Test time of the last one.
    time: Option<f64>,
    /// Rows that are missing before it.
    lost: u64,
}

impl Source for OnDisk<'_> {
    fn columns(&self) -> &[Column] {
        self.run.layout().columns()
    }

    fn rows(&self) -> u64 {
        let bytes = std::fs::metadata(&self.path).map_or(0, |file| file.len());
        bytes / self.run.layout().stride() as u64
    }

    fn step_s(&self) -> Option<f64> {
        self.step_s
    }

    fn ticks_per_step(&self) -> u64 {
        self.ticks_per_step
    }

    fn earlier(&self) -> Option<&Earlier> {
        self.earlier.as_ref()
    }

    fn without_disp(&self) -> &[u32] {
        &self.without_disp
    }

    fn read(&self, wanted: &[usize], take: &mut dyn FnMut(&[Vec<f64>])) -> io::Result<()> {
        let mut journal = self.run.journal().map_err(io::Error::other)?;
        let mut block: Vec<Vec<f64>> = vec![Vec::with_capacity(BLOCK); wanted.len()];
        let mut filled = 0;
        let place = |name: &str| self.run.layout().index_of(name);
        let (time_at, state_at, commits_at) = (place("time"), place("state"), place(COMMITS));
        let (mut time, mut step) = (None, None);
        let mut replaced = 0;
        while let Some(row) = journal.next_row()? {
            let at = |place: Option<usize>| row.values.get(place?).copied();
            time = at(time_at);
            // The last exchange of a step counts; the others are trials and repeated requests.
            let running = at(state_at).filter(|state| *state == Phase::Running.code());
            let next = running.and(at(commits_at)).zip(time);
            if next.is_some() && next == step {
                replaced += 1;
                filled -= 1;
                block.iter_mut().for_each(|column| {
                    let _ = column.pop();
                });
            } else if filled == BLOCK {
                take(&block);
                block.iter_mut().for_each(Vec::clear);
                filled = 0;
            }
            step = next;
            for (column, &place) in block.iter_mut().zip(wanted) {
                column.push(row.values.get(place).copied().unwrap_or(f64::NAN));
            }
            filled += 1;
        }
        self.replaced.set(replaced);
        if filled > 0 {
            take(&block);
        }
        self.end.set(Some(RowsEnd {
            end: journal.end(),
            time,
            lost: journal.lost(),
        }));
        Ok(())
    }
}

/// Writes the wide picture of a run to `path`.
///
/// # Errors
/// [`PageError`].
pub fn hero(folder: &Path, path: &Path) -> Result<PathBuf, PageError> {
    write(path, &hero_svg(&read(folder)?))
}

pub(super) fn write(path: &Path, text: &str) -> Result<PathBuf, PageError> {
    match atomic::write(path, text.as_bytes()) {
        Ok(()) => Ok(path.to_owned()),
        Err(source) => Err(PageError::File {
            path: path.to_owned(),
            source,
        }),
    }
}

/// Reads the input of the page of the run in `folder`.
pub(super) fn read(folder: &Path) -> Result<RunView, PageError> {
    let run = Run::open(folder)?;
    let at = |name: &str| folder.join(name);
    let text = std::fs::read_to_string(at("resolved.toml")).unwrap_or_default();
    let read = TestFile::read(&at("resolved.toml"), text.clone());
    let unread = read.as_ref().err().map(ToString::to_string);
    let file = read.unwrap_or_default();
    let test = ResolvedTest { text, file };
    let name = || {
        folder
            .file_name()
            .map(|name| name.to_string_lossy().into_owned())
    };
    let recorded = run.summary().map(|summary| summary.dt);
    // One that cannot be read is for a replay to refuse.
    let origin = Origin::of(folder).ok().flatten();
    let step = origin.as_ref().map(|origin| origin.step);
    let known = known(folder, &test.file, run.layout().columns(), step);
    let earlier = origin.map(|origin| Earlier {
        folders: format!("{BEFORE}/"),
        step: origin.step,
        grounds: known.ground_before,
    });
    let (mut model, no_balance) = match known.balance {
        Ok(model) => (Some(model), None),
        Err(Without::Structure) => (None, None),
        Err(Without::Because(why)) => (None, Some(why)),
    };
    let told = run.events()?;
    let on_disk = OnDisk {
        path: at("samples.bin"),
        step_s: recorded.or_else(|| test.file.step_s()),
        ticks_per_step: test.file.ticks_per_step(),
        earlier,
        without_disp: without_disp(&told.events),
        end: Cell::new(None),
        replaced: Cell::new(0),
        run: &run,
    };
    let model = model.as_mut().map(|model| model as &mut dyn Model);
    let digest = Digest::of(&on_disk, &test.file, model);
    let digest = digest.map_err(|source| PageError::File {
        path: at("samples.bin"),
        source,
    })?;
    let is_without = run.summary().is_none() && run.summary_fault().is_none();
    let unfinished = is_without
        .then(|| "the run has no summary.json: it is still running or was killed".to_owned());
    let rows = on_disk.end.get();
    let mut damaged = rows.map_or_else(Vec::new, |rows| damages(&run, &told, rows));
    damaged.extend(unread.map(|why| format!("resolved.toml cannot be read: {}", first_line(&why))));
    let timing = run.timings().unwrap_or_else(|error| {
        damaged.push(error.to_string());
        None
    });
    let contradicted = with_record(&run, &test.text)?;
    let contradicted = contradicted.iter().map(ToString::to_string);
    Ok(RunView {
        title: Some(test.file.title.clone())
            .filter(|title| !title.is_empty())
            .or_else(name)
            .unwrap_or_else(|| "run".to_owned()),
        columns: run.layout().columns().to_vec(),
        data: Vec::new(),
        digest: Some(digest),
        replaced: on_disk.replaced.get(),
        no_balance,
        no_margin: known.no_margin,
        no_modes: known.modes.as_ref().err().cloned(),
        modes: known.modes.unwrap_or_default(),
        summary: run.summary().cloned(),
        filed: filed(&run),
        timing,
        events: told.events,
        flaws: Flaws {
            unfinished,
            damaged,
            has_damaged_rows: rows.is_some_and(|rows| rows.end.is_some_and(End::is_damage)),
            contradicted: contradicted.collect(),
            missing_rows: rows.map_or(0, |rows| rows.lost),
            unreadable_events: told.unreadable,
            events_left_out: told.left_out,
        },
        test,
    })
}

/// Missing parts of a record, in words. The summary reports rows that were lost during recording.
fn damages(run: &Run, told: &Events, rows: RowsEnd) -> Vec<String> {
    let ended = rows.end.filter(|end| *end != End::Clean);
    let never_there = run.summary().map_or(0, |summary| summary.rows_lost);
    let at_the_end = never_there.saturating_sub(rows.lost);
    let missing =
        MissingEnd::of(run, rows.time).filter(|end| ended.is_some() || end.missing > at_the_end);
    let cut = run.summary().is_some() && rows.lost > never_there;
    let cut = cut.then(|| {
        format!(
            "{} rows are missing between the others, though no more than {never_there} were lost while recording",
            rows.lost
        )
    });
    let summary = run.summary_fault().map(|fault| {
        format!("summary.json is DAMAGED ({fault}) and counts as missing: how the run ended is not known")
    });
    let ended = ended.map(|end| end.to_string());
    let missing = missing.map(|end| end.to_string());
    // A loop that broke down did not report its end.
    let ended_itself = run.summary().is_some_and(|s| s.status != Status::Failed);
    let events = if !told.is_there {
        Some("events.jsonl is not there: what happened is not told here")
    } else if ended_itself && !told.have_end() {
        Some("events.jsonl ends before the test did: the last of what happened is not told here")
    } else {
        None
    };
    let events = events.map(str::to_owned);
    [summary, ended, missing, cut, events]
        .into_iter()
        .flatten()
        .collect()
}
