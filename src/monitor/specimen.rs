//! One specimen, row by row: in which ticks it was commanded and has answered.
//!
//! The values that its limits judge stand in the rows: nothing is computed again here. A row without an answer changes nothing
//! of what was measured.

use super::axis::{AxisTap, Told};
use super::board::SpecimenView;
use super::subject::{WatchedSpecimen, at};
use crate::catalog::phase::Part;
use crate::substructure::Status;

/// What belongs to all specimens of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowHead {
    /// Number of the row, with the lost ones.
    pub sequence: u64,
    /// The column `step`.
    pub step: f64,
    /// The column `state`.
    pub state: f64,
}

/// Past of a specimen.
#[derive(Debug)]
pub(super) struct SpecimenTap {
    pub axes: Vec<AxisTap>,
    pub view: SpecimenView,
    /// Number of the last row.
    sequence: Option<u64>,
    /// The column `seq` of the last row.
    newest: f64,
    in_test: bool,
    /// Of one that is commanded once a step: its answer is not here.
    owes: bool,
}

impl SpecimenTap {
    pub fn new(specimen: &WatchedSpecimen) -> Self {
        Self {
            axes: specimen.axes.iter().map(AxisTap::new).collect(),
            view: SpecimenView::default(),
            sequence: None,
            newest: f64::NAN,
            in_test: false,
            owes: false,
        }
    }

    pub fn row(&mut self, head: RowHead, row: &[f64], specimen: &WatchedSpecimen) {
        let part = Part::of(head.state).unwrap_or(Part::Startup);
        let in_test = match part {
            Part::Test => true,
            Part::Trip => self.in_test,
            Part::Startup | Part::Shutdown => false,
        };
        let begins = in_test && !self.in_test;
        let next = self.sequence.map(|last| last + 1);
        let follows = next == Some(head.sequence);
        let by_steps = in_test && specimen.per_step;
        if !follows || (begins && by_steps && head.step > 0.0) {
            self.owes = false;
        }
        let was_heard = is_heard(Status(self.view.status));
        let status = at(row, specimen.status);
        // Flags below 2²⁴ are whole numbers in every float.
        let status = Status(if status >= 0.0 { status as u32 } else { 0 });
        let is_stale = status.has(Status::STALE);
        let newest = at(row, specimen.newest);
        let is_silent = is_stale || !is_heard(status);
        // One that is commanded once a step gives each command one answer; the first of the test cannot be told from that before.
        let answers = follows && !begins && newest != self.newest && !is_silent;
        let is_fresh = !is_silent && (!by_steps || answers);
        let moves = self.axes.iter().zip(&specimen.axes);
        let moves = moves.fold(false, |moves, (tap, axis)| moves || tap.moves(row, axis));
        let starts = begins && head.step == 0.0;
        let is_told = was_heard
            && !status.has(Status::UNSENT)
            && (!by_steps || starts || moves || (answers && !self.owes));
        (self.sequence, self.newest, self.in_test) = (Some(head.sequence), newest, in_test);
        self.owes = by_steps && (self.owes || is_told) && !answers && !is_stale;
        self.view.status = status.0;
        self.view.exchanges += u64::from(is_told);
        self.view.stale += u64::from(is_told && is_stale);

        let told = Told {
            is_told,
            is_fresh,
            is_silent,
        };
        for (tap, axis) in self.axes.iter_mut().zip(&specimen.axes) {
            tap.begin(row, axis, head.state, part);
            tap.row(row, axis, told);
        }
    }
}

/// False of a specimen that is lost, or whose answer is not waited for: it is told nothing.
const fn is_heard(status: Status) -> bool {
    !status.has(Status::LOST) && !status.has(Status::OWED)
}
