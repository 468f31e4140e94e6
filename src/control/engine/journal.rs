//! The record of a test as the loop writes it: rows and events, and how many were lost.
//!
//! Nothing here waits. A full queue loses a row or an event, which is counted.

use super::columns::Row;
use super::operator::OperatorCommands;
use gusset_record::{Recorder, TimedEvent, WarmUpRows};

/// Ticks of a warm-up whose rows can be held back until it is known whether they matter.
const MOST_HELD_BACK: u64 = 10_000;

/// How far the rows cover what was commanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Covered {
    /// Every command that left has a row.
    All,
    /// Commands have left since the last row.
    ButTheLast,
}

/// The row that is being made, and the recorder that takes it.
pub(super) struct Journal {
    /// The row of the current tick.
    pub row: Row,
    recorder: Box<dyn Recorder>,
    /// Numbers in a row.
    width: usize,
    covered: Covered,
    /// The tick that tripped has a row.
    has_trip: bool,
    /// Rows of the warm-up, until the first of the test is made.
    held_back: Vec<f64>,
    rows_lost: u64,
    events_lost: u64,
}

impl Journal {
    /// A record without rows. `width` is the number of columns.
    pub(crate) fn new(row: Row, width: usize, recorder: Box<dyn Recorder>) -> Self {
        Self {
            row,
            recorder,
            width: width.max(1),
            covered: Covered::All,
            has_trip: false,
            held_back: Vec::new(),
            rows_lost: 0,
            events_lost: 0,
        }
    }

    /// A command leaves. Real-time: yes.
    #[inline]
    pub(crate) const fn command_left(&mut self) {
        self.covered = Covered::ButTheLast;
    }

    /// True if commands have left since the last row.
    pub(crate) fn lacks_commands(&self) -> bool {
        self.covered == Covered::ButTheLast
    }

    /// The row that follows is that of a trip.
    pub(crate) const fn note_trip(&mut self) {
        self.has_trip = true;
    }

    /// True if the tick that tripped has a row.
    pub(crate) const fn has_trip(&self) -> bool {
        self.has_trip
    }

    /// Hands the finished row over; false if it was lost. Real-time: yes.
    #[inline]
    pub(crate) fn keep_row(&mut self) -> bool {
        self.covered = Covered::All;
        let is_kept = self.recorder.row(self.row.values());
        self.row.commands = OperatorCommands::default();
        self.rows_lost += u64::from(!is_kept);
        is_kept
    }

    /// The row, and the recorder that takes states.
    pub(crate) fn row_and_recorder(&mut self) -> (&mut Row, &mut dyn Recorder) {
        (&mut self.row, self.recorder.as_mut())
    }

    /// Hands an event over. Real-time: yes.
    #[inline]
    pub(crate) fn event(&mut self, event: TimedEvent) {
        self.events_lost += u64::from(!self.recorder.event(event));
    }

    /// Begins a warm-up: returns which of its rows are kept, and makes room for rows that are held back.
    pub(crate) fn begin_warm_up(&mut self, ticks: u64) -> WarmUpRows {
        let rows = match self.recorder.warm_up() {
            WarmUpRows::IfTheyMatter if ticks > MOST_HELD_BACK => WarmUpRows::AsTheyCome,
            rows => rows,
        };
        if rows == WarmUpRows::IfTheyMatter {
            let ticks = usize::try_from(ticks).unwrap_or(0);
            self.held_back = Vec::with_capacity(ticks * self.width);
        }
        rows
    }

    /// Holds the finished row of a warm-up tick back. Real-time: yes.
    pub(crate) fn hold_row_back(&mut self) {
        // Within its capacity.
        self.held_back.extend_from_slice(self.row.values());
        self.row.commands = OperatorCommands::default();
        self.covered = Covered::All;
    }

    /// The rows of the warm-up matter: the operator spoke in it, or the test ends before its first row. Real-time: yes.
    pub(crate) fn keep_warm_up(&mut self) {
        for row in self.held_back.chunks_exact(self.width) {
            self.rows_lost += u64::from(!self.recorder.row(row));
        }
        self.held_back.clear();
    }

    /// The test has a row: those of the warm-up do not matter. Real-time: yes.
    #[inline]
    pub(crate) fn drop_warm_up(&mut self) {
        self.held_back.clear();
    }

    /// Rows and events that were lost.
    pub(crate) const fn lost(&self) -> (u64, u64) {
        (self.rows_lost, self.events_lost)
    }
}
