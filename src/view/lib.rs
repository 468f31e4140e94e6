//! A recorded run as people look at it.
//!
//! [`RunView`] holds the files of a run folder as typed values: summary, resolved test, timing, events and a digest of the rows. Each
//! file is read once, with the type that wrote it (`gusset_record`, `gusset_config`).
//! [`report`] makes pages and pictures of it. [`live`] shows a test that is still running.
//!
//! | file | holds |
//! |---|---|
//! | `report` | the pages: one run, several runs, and the pieces of all other pages |
//! | `live` | a running test: live page, status, metrics; reads rows during recording, not `RunView` |
//!
//! This member has no access to a loop: it reads records, or passing rows. It moves nothing. Begin reading with [`report`].

#[cfg(feature = "monitor")]
mod assets;
pub mod live;
pub mod report;

pub use gusset_config::RecordedFile as TestFile;

use std::collections::BTreeMap;

use gusset_motion::metrics::falsified::Mode;
use gusset_record::rt::timing::Timings;
use gusset_record::summary::ClockKind;
use gusset_record::{Column, EventLine, Summary};
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

/// `resolved.toml`: its text and its tables.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ResolvedTest {
    /// The text.
    pub text: String,
    /// Its tables; all empty where it cannot be read.
    pub file: TestFile,
}

#[cfg(test)]
impl<T: Into<String>> From<T> for ResolvedTest {
    fn from(text: T) -> Self {
        let text = text.into();
        let path = std::path::Path::new("resolved.toml");
        let file = TestFile::read(path, text.clone()).unwrap_or_else(|error| panic!("{error}"));
        Self { text, file }
    }
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
    /// Exchanges of a served test that a later one of their step replaced; the digest leaves these out.
    pub replaced: u64,
    /// Reason for a missing energy balance.
    pub no_balance: Option<String>,
    /// Modes of the structure with the effect of delays on their damping; empty without a structure.
    pub modes: Vec<Mode>,
    /// Why the modes are not known, if they are not.
    pub no_modes: Option<String>,
    /// Why no margin to a critical delay was watched, if none was.
    pub no_margin: Option<String>,
    /// `summary.json`, if there is one.
    pub summary: Option<Summary>,
    /// Who tested what, when, where and by which program.
    pub filed: Vec<(&'static str, String)>,
    /// `timing.json`, if there is one.
    pub timing: Option<Timings>,
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
    pub(crate) fn timings(&self) -> Option<&Timings> {
        let summarised = || self.summary.as_ref()?.timing.as_ref();
        self.timing.as_ref().or_else(summarised)
    }

    /// True of a run on the simulated clock.
    #[must_use]
    pub(crate) fn is_simulated(&self) -> bool {
        let summary = self.summary.as_ref();
        summary.is_some_and(|summary| summary.clock == ClockKind::Simulated)
    }

    /// True for a server's record of its controller's commands.
    #[must_use]
    pub(crate) fn is_served(&self) -> bool {
        let role = self.summary.as_ref().map(|summary| &summary.realtime.role);
        role.is_some_and(Option::is_some)
    }

    /// Deadline misses; none of a server, which has no deadlines: its controller's record has its own.
    #[must_use]
    pub(crate) fn misses(&self) -> Option<u64> {
        let summary = self.summary.as_ref().filter(|_| !self.is_served());
        Some(summary?.deadline_misses)
    }
}
