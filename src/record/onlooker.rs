//! Observers of the rows on their way from the ring to the file: a live page, a status line.
//!
//! The writer shows each row and continues. An observer that is slow would delay it, so an observer must not wait: it
//! takes what it needs and leaves the rest to its own thread. One that panics is removed, and the recording continues
//! without it. The loop does not know of it.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::TimedEvent;
use super::events::Event;
use super::miss::MissClasses;
use super::note::Note;
use gusset_quantity::catalog::event::Remark;

/// Progress of a run, as the writer last saw it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Progress {
    /// The latest row; empty before the first.
    pub last_row: Vec<f64>,
    /// Rows in the file.
    pub rows_written: u64,
    /// Rows lost so far, to a full queue or a full disk.
    pub rows_lost: u64,
    /// Events so far.
    pub events: u64,
    /// Deadline misses so far, by class.
    pub misses: MissClasses,
}

/// Looks at the rows of a running test, on the writer's thread. Nothing here may wait.
pub trait Onlooker: Send {
    /// One row that is about to be written; `sequence` counts the lost ones, too.
    fn row(&mut self, sequence: u64, row: &[f64]);

    /// One event of the loop, after the rows that precede it.
    fn event(&mut self, _event: &TimedEvent) {}

    /// The end of a turn of the writer, every few milliseconds; `now_ns` is its monotonic clock.
    fn turn(&mut self, now_ns: u64, progress: &Progress);

    /// The observer's next note for the list of events.
    fn note(&mut self) -> Option<Note> {
        None
    }

    /// Nothing follows.
    fn finish(&mut self, now_ns: u64, progress: &Progress);
}

/// An observer, or none, as after a panic.
#[derive(Default)]
pub(super) struct Watched(Option<Box<dyn Onlooker>>);

impl Watched {
    pub(crate) fn by(onlooker: Option<Box<dyn Onlooker>>) -> Self {
        Self(onlooker)
    }

    pub(crate) const fn is_watched(&self) -> bool {
        self.0.is_some()
    }

    /// Lets it look; a note if that was the last time.
    pub(crate) fn show(&mut self, look: impl FnOnce(&mut dyn Onlooker)) -> Option<Note> {
        let onlooker = self.0.as_deref_mut()?;
        if catch_unwind(AssertUnwindSafe(|| look(onlooker))).is_ok() {
            return None;
        }
        self.0 = None;
        let text = "internal error: what shows the running test has failed; the test and its recording go on";
        Some(Event::said(Remark::InternalError, text).into())
    }
}
