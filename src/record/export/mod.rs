//! A run in the forms that other programs read.
//!
//! | format | rows | columns | holds |
//! |---|---|---|---|
//! | [`Format::Csv`] | steps, or all ticks | those of a CSV | text, 17 significant digits |
//! | [`Format::Npz`], [`Format::Mat`], [`Format::Mat73`], [`Format::Hdf5`], [`Format::Parquet`], [`Format::Mcap`] | the same | the same, then all others of the log | the bits of the log, units and meanings beside them |
//! | [`Format::Trace`] | all ticks | those of the timing | what the loop did when |
//! | [`Format::DesignSafe`] | the same, and a copy of the log | those of a CSV, and all | a folder in the shape of a hybrid-simulation project |
//!
//! `plan` chooses the rows and columns; each format is one small writer. An export appears whole or not at all. From an
//! unfinished or damaged run it takes the sound part. Its memory does not grow with the run (but for one column of it, where a
//! format has columns). `metadata` has the pairs that describe the run. Libraries write [`Format::Mat73`] and
//! [`Format::Hdf5`], Parquet and MCAP; they need the features `hdf5`, `parquet` and `mcap`. [`Notice`]s hold
//! what the caller should report beside it. The log itself is never touched.

mod columns;
mod csv;
mod designsafe;
#[cfg(feature = "hdf5")]
mod hdf5;
mod mat;
#[cfg(feature = "hdf5")]
mod mat73;
mod mat_content;
#[cfg(feature = "mcap")]
mod mcap;
mod npz;
#[cfg(feature = "parquet")]
mod parquet;
mod plan;
mod trace;

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::filed::filed;
use super::folder::FolderError;
use super::journal::{End, Journal};
use super::missing::MissingEnd;
use super::run::{MOST_OF_A_KIND, Run};

use plan::Plan;
pub use plan::{Choice, Rows, Sum};

/// A form that other programs read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values.
    Csv,
    /// A NumPy archive of one array per column.
    Npz,
    /// A MATLAB file of one vector per column: level 5 up to 2 GB, else 7.3.
    Mat,
    /// A MATLAB file of version 7.3 with one vector per column.
    Mat73,
    /// An HDF5 file of one dataset per column.
    Hdf5,
    /// An Apache Parquet file.
    Parquet,
    /// An MCAP file with a channel per group of columns, and the events.
    Mcap,
    /// The timeline of the loop in the trace-event format.
    Trace,
    /// A folder in the shape of a DesignSafe hybrid-simulation project.
    DesignSafe,
}

/// Additions to the recorded columns of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Extra {
    /// Sums of recorded columns. A trace has none.
    pub sums: Vec<Sum>,
    /// Whether a CSV has a comment line with the units.
    pub units_line: bool,
}

impl Default for Extra {
    fn default() -> Self {
        Self {
            sums: Vec::new(),
            units_line: true,
        }
    }
}

/// Reason why an export failed.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The samples have no such column.
    #[error("the samples have no column {0:?}, which an export needs")]
    NoColumn(&'static str),
    /// A sum needs a column that was not recorded.
    #[error(
        "column {name} needs {needs}, which was not recorded: [record] dofs says which DOFs a test records"
    )]
    NotRecorded {
        /// The sum.
        name: String,
        /// The column that it needs.
        needs: String,
    },
    /// A trace is of the edges of a loop, and the samples know none.
    #[error(
        "there is no loop to draw a timeline of: the samples have no column {0:?}, as those of a served test have none"
    )]
    NoTimeline(&'static str),
    /// The run folder cannot be read.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The samples cannot be read.
    #[error("cannot read the samples: {0}")]
    Read(io::Error),
    /// The file cannot be written.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// There is something where the folder is to be.
    #[error("{} exists already", .0.display())]
    Occupied(PathBuf),
    /// The window of time is empty.
    #[error(
        "the window from {from} s to {to} s is empty: the second time must not be below the first"
    )]
    Window {
        /// Its begin in s of test time.
        from: f64,
        /// Its end in s of test time.
        to: f64,
    },
    /// One column does not fit into memory.
    #[error(
        "one column takes {bytes} bytes, which is more memory than there is: choose a window of time, or csv, which takes a row at a time"
    )]
    Memory {
        /// Bytes of every column.
        bytes: u64,
    },
    /// The program was built without what writes the format.
    #[error(
        "this program was built without the feature {feature:?}, which writes {format}: choose csv or npz, or build it with `--features {feature}`"
    )]
    Feature {
        /// The format.
        format: &'static str,
        /// The feature that writes it.
        feature: &'static str,
    },
    /// A whole run is too much for a trace.
    #[error(
        "{ticks} ticks are too many for a trace without a window, which takes {limit}: the samples reach from {first} s to {last} s of test time, choose a part of it"
    )]
    LongTrace {
        /// Ticks that there are.
        ticks: u64,
        /// Ticks that are taken unasked.
        limit: u64,
        /// Test time of the first row in s.
        first: f64,
        /// Test time of the last row in s.
        last: f64,
    },
}

impl ExportError {
    fn write(path: &Path) -> impl Fn(io::Error) -> Self + Copy + '_ {
        |source| Self::Write {
            path: path.to_owned(),
            source,
        }
    }
}

/// Notice for a reader of the export.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// Number of events that the export lacks, because there are too many of their kind.
    EventsLeftOut(u64),
    /// The run has no summary: it is still running or was killed.
    Unfinished,
    /// The run has a summary that cannot be read.
    SummaryDamaged,
    /// This number of rows never reached the file.
    RowsLost(u64),
    /// The samples end in the middle of a row or in damage.
    Ended(End),
    /// The samples end with a whole row, but before the test did.
    MissingEnd(MissingEnd),
    /// Nothing was recorded, or nothing of it is in the window.
    Empty,
    /// An archive asks for these keys of `[about]`, which the test file does not have.
    Unfiled(String),
    /// These columns, which every export has, were not recorded: there is nothing in them.
    NotRecorded(String),
}

impl Notice {
    /// The notice about a missing summary; `None` if the run has one.
    #[must_use]
    pub fn without_summary(run: &Run) -> Option<Self> {
        let missing = match run.summary_fault() {
            Some(_) => Self::SummaryDamaged,
            None => Self::Unfinished,
        };
        run.summary().is_none().then_some(missing)
    }
}

impl std::fmt::Display for Notice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unfinished => write!(
                f,
                "the run is unfinished (no summary.json): it is still running or was killed"
            ),
            Self::SummaryDamaged => write!(
                f,
                "summary.json is DAMAGED and counts as missing: how the run ended, and whether all of it is here, is not known"
            ),
            Self::RowsLost(rows) => {
                write!(f, "{rows} rows were lost while recording and are missing")
            }
            Self::Ended(end) => write!(f, "{end}"),
            Self::MissingEnd(end) => write!(f, "the samples are cut short: {end}"),
            Self::EventsLeftOut(events) => write!(
                f,
                "the export lacks {events} events of `events.jsonl`: it has the first {MOST_OF_A_KIND} of each kind"
            ),
            Self::Unfiled(keys) => write!(
                f,
                "an archive asks for {keys}: write it into [about] of the test file before the test, or into project.json and designsafe.json"
            ),
            Self::Empty => write!(f, "there is no row to export: the file has columns only"),
            Self::NotRecorded(columns) => write!(
                f,
                "samples.json has no {columns}: nothing is exported as that"
            ),
        }
    }
}

/// Outcome of an export.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// Rows written, the header not counted.
    pub rows: u64,
    /// Notices for a reader.
    pub notices: Vec<Notice>,
    /// The version of the file, where a format has several.
    pub version: Option<&'static str>,
}

impl Exported {
    /// True if a row of the record is damaged: the export has the rows before it.
    #[must_use]
    pub fn is_of_damaged_rows(&self) -> bool {
        let is_damage = |notice: &Notice| matches!(notice, Notice::Ended(end) if end.is_damage());
        self.notices.iter().any(is_damage)
    }

    /// After `journal` has been read to its end, or to the last row that was wanted.
    fn new(run: &Run, rows: u64, journal: &Journal<impl io::Read>) -> Self {
        let unfinished = Notice::without_summary(run);
        // Rows lost at the very end leave no gap in the file; the summary knows of them.
        let lost = run.summary().map_or(0, |s| s.rows_lost).max(journal.lost());
        let lost = (lost > 0).then_some(Notice::RowsLost(lost));
        let ended = journal
            .end()
            .filter(|end| *end != End::Clean)
            .map(Notice::Ended);
        let missing = MissingEnd::of_run(run).map(Notice::MissingEnd);
        Self {
            rows,
            notices: [unfinished, lost, ended, missing]
                .into_iter()
                .flatten()
                .collect(),
            version: None,
        }
    }

    /// Names the version that was written.
    fn written_as(mut self, version: &'static str) -> Self {
        self.version = Some(version);
        self
    }

    /// Adds the notices about a table.
    fn of_table(mut self, plan: &Plan) -> Self {
        if self.rows == 0 {
            self.notices.push(Notice::Empty);
        }
        let nothing = plan.not_recorded();
        if !nothing.is_empty() {
            self.notices.push(Notice::NotRecorded(nothing.join(", ")));
        }
        self
    }
}

/// Writes a run to `out`, replacing a file that is there; a folder ([`Format::DesignSafe`]) must be new. A trace has all
/// ticks of the window, whatever rows are chosen.
///
/// # Errors
/// [`ExportError`]; `out` is then unchanged.
pub fn export(
    run: &Run,
    format: Format,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    choice.check()?;
    match format {
        Format::Csv => csv::export(run, choice, extra, out),
        Format::Npz => npz::export(run, choice, extra, out),
        Format::Mat => mat::export(run, choice, extra, out),
        #[cfg(feature = "hdf5")]
        Format::Mat73 => mat73::export(run, choice, extra, out),
        #[cfg(feature = "hdf5")]
        Format::Hdf5 => hdf5::export(run, choice, extra, out),
        #[cfg(not(feature = "hdf5"))]
        Format::Mat73 => Err(without(".mat 7.3", "hdf5")),
        #[cfg(not(feature = "hdf5"))]
        Format::Hdf5 => Err(without("HDF5", "hdf5")),
        #[cfg(feature = "parquet")]
        Format::Parquet => parquet::export(run, choice, extra, out),
        #[cfg(not(feature = "parquet"))]
        Format::Parquet => Err(without("Parquet", "parquet")),
        #[cfg(feature = "mcap")]
        Format::Mcap => mcap::export(run, choice, extra, out),
        #[cfg(not(feature = "mcap"))]
        Format::Mcap => Err(without("MCAP", "mcap")),
        Format::Trace => trace::export(run, choice, out),
        Format::DesignSafe => designsafe::export(run, choice, extra, out),
    }
}

#[cfg(not(all(feature = "hdf5", feature = "parquet", feature = "mcap")))]
const fn without(format: &'static str, feature: &'static str) -> ExportError {
    ExportError::Feature { format, feature }
}

/// Metadata of a run, by key: every format with metadata has these pairs.
fn metadata(run: &Run) -> Vec<(&'static str, String)> {
    let written_by = concat!("Gusset ", env!("CARGO_PKG_VERSION"));
    let mut pairs = vec![
        ("format", "gusset-run".to_owned()),
        ("written_by", written_by.to_owned()),
    ];
    for (key, name) in [
        ("summary", "summary.json"),
        ("test", "test.toml"),
        ("resolved", "resolved.toml"),
    ] {
        // A run by hand, or one that is not over, lacks some; bytes that are no text cannot be carried.
        if let Ok(text) = std::fs::read_to_string(run.path().join(name)) {
            pairs.push((key, text));
        }
    }
    pairs.extend(filed(run));
    pairs
}

#[cfg(test)]
mod tests;
