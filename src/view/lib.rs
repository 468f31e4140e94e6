//! A recorded run as people look at it.
//!
//! [`RunView`] holds the files of a run folder as typed values: summary, resolved test, timing, events and a digest of the rows. Each
//! file is read once. Every field may be absent, and unknown fields are ignored: folders of earlier versions can be read.
//! [`report`] makes pages and pictures of it. [`live`] shows a test that is still running.
//!
//! | file | holds |
//! |---|---|
//! | `lenient` | fields of a file that keep their default where they cannot be read |
//! | `summary`, `limits`, `timing`, `test_file` | `summary.json`, its limits, `timing.json`, `resolved.toml` |
//! | `report` | the pages: one run, two runs, and the pieces of all other pages |
//! | `live` | a running test: live page, status, metrics; reads rows during recording, not `RunView` |
//!
//! This member has no access to a loop: it reads records, or passing rows. It moves nothing. Begin reading with [`report`].

mod assets;
mod lenient;
mod limits;
pub mod live;
pub mod report;
mod summary;
mod test_file;
mod timing;

pub use limits::{LimitView, LimitsView, SpecimenLimitsView};
pub use summary::{Feature, Progress, Realtime, Remarks, SummaryView};
pub use test_file::{
    AxisTable, Excitation, Matrices, NumberOrWord, Processing, ResolvedTest, Similitude,
    SpecimenTable, Structure, TestFile, Variant,
};
pub use timing::{Percentiles, TimingEntry, Timings};

use std::collections::BTreeMap;

use gusset_motion::metrics::falsified::Mode;
use gusset_record::{Column, EventLine};
use report::Digest;

/// Missing or wrong parts of a run's record, in words.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flaws {
    /// Why the folder counts as unfinished, if it does.
    pub unfinished: Option<String>,
    /// Rows that are damaged or missing. Empty for a complete record.
    pub damaged: Vec<String>,
    /// A row is damaged, and the rows after it are not read.
    pub has_damaged_rows: bool,
    /// Keys of the summary that the rows and events contradict, and a run that names itself as an ancestor.
    pub contradicted: Vec<String>,
    /// Rows that are missing between the others.
    pub missing_rows: u64,
    /// Lines of `events.jsonl` that cannot be read.
    pub unreadable_events: usize,
    /// Number of events by kind that are in `events.jsonl` only, because there are too many of their kind.
    pub events_left_out: BTreeMap<&'static str, u64>,
}

/// A step of a served test with several exchanges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trials {
    /// Test time of the step.
    pub time_s: f64,
    /// Exchanges that a later one of the step replaced.
    pub replaced: u64,
}

/// A recorded run: the files of its folder, each read once.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunView {
    /// Title of the test, as the user wrote it.
    pub title: String,
    /// The columns of the rows.
    pub columns: Vec<Column>,
    /// One vector per column, all rows in order; an absent value is NaN. Empty where `digest` is given.
    pub data: Vec<Vec<f64>>,
    /// Digest of rows that are not held in memory.
    pub digest: Option<Digest>,
    /// Steps of a served test with exchanges beside the last one; the digest leaves these out.
    pub trials: Vec<Trials>,
    /// Reason for a missing energy balance.
    pub no_balance: Option<String>,
    /// Modes of the structure with the effect of delays on their damping; empty without a structure.
    pub modes: Vec<Mode>,
    /// Why the modes are not known, if they are not.
    pub no_modes: Option<String>,
    /// Why no margin to a critical delay was watched, if none was.
    pub no_margin: Option<String>,
    /// `summary.json`, if there is one.
    pub summary: Option<SummaryView>,
    /// `timing.json`, or the percentiles of the summary.
    pub timing: Timings,
    /// The lines of `events.jsonl`.
    pub events: Vec<EventLine>,
    /// Missing or contradictory parts of the record.
    pub flaws: Flaws,
    /// `resolved.toml`.
    pub test: ResolvedTest,
}

impl RunView {
    /// Timing from `timing.json`, else from the summary.
    #[must_use]
    pub(crate) fn timings(&self) -> &Timings {
        match &self.summary {
            Some(summary) if self.timing.0.is_empty() => &summary.timing,
            _ => &self.timing,
        }
    }

    /// True of a run on the simulated clock.
    #[must_use]
    pub(crate) fn is_simulated(&self) -> bool {
        self.summary.as_ref().is_some_and(SummaryView::is_simulated)
    }

    /// True for a server's record of its controller's commands.
    #[must_use]
    pub(crate) fn is_served(&self) -> bool {
        let role = self.summary.as_ref().map(|summary| &summary.realtime.role);
        role.is_some_and(Option::is_some)
    }

    /// Counts of the run; all absent without a summary.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let progress = self.summary.as_ref().map(|summary| summary.progress);
        progress.unwrap_or_default()
    }
}
