//! One specimen, row by row: in which ticks it was commanded and has answered.
//!
//! The rows contain the values that its limits judge, so nothing is computed again here. A row without an answer changes no
//! measured value.

use super::axis::{AxisTap, Told};
use super::board::SpecimenView;
use super::subject::{WatchedSpecimen, at};
use gusset_quantity::catalog::phase::Part;
use gusset_quantity::substructure::Status;

/// Values that belong to all specimens of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowHead {
    /// Number of the row, with the lost ones.
    pub sequence: u64,
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
}

impl SpecimenTap {
    pub(crate) fn new(specimen: &WatchedSpecimen) -> Self {
        Self {
            axes: specimen.axes.iter().map(AxisTap::new).collect(),
            view: SpecimenView::default(),
            sequence: None,
            newest: f64::NAN,
            in_test: false,
        }
    }

    pub(crate) fn row(&mut self, head: RowHead, row: &[f64], specimen: &WatchedSpecimen) {
        let part = Part::of(head.state).unwrap_or(Part::Startup);
        let in_test = match part {
            Part::Test => true,
            Part::Trip => self.in_test,
            Part::Startup | Part::Shutdown => false,
        };
        let begins = in_test && !self.in_test;
        let follows = self.sequence.map(|last| last + 1) == Some(head.sequence);
        let status = at(row, specimen.status);
        // Flags below 2²⁴ are whole numbers in every float.
        let status = Status(if status >= 0.0 { status as u32 } else { 0 });
        let newest = at(row, specimen.newest);
        let is_silent = [Status::STALE, Status::LOST, Status::OWED]
            .into_iter()
            .any(|flag| status.has(flag));
        // A specimen with one command per step answers each once. The first answer of the test equals the one before it.
        let answers = follows && !begins && newest != self.newest;
        let by_steps = in_test && specimen.per_step;
        let exchanges = at(row, specimen.exchanges) as u64;
        let told = Told {
            is_told: exchanges != self.view.exchanges,
            is_fresh: !is_silent && (!by_steps || answers),
            is_silent,
        };
        (self.sequence, self.newest, self.in_test) = (Some(head.sequence), newest, in_test);
        self.view = SpecimenView {
            status: status.0,
            exchanges,
            stale: at(row, specimen.stale) as u64,
        };
        for (tap, axis) in self.axes.iter_mut().zip(&specimen.axes) {
            tap.begin(row, axis, head.state, part);
            tap.row(row, axis, told);
        }
    }
}
