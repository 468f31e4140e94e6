//! The digest of the rows for a page.
//!
//! Only rows of the running test are physics ([`super::row_filter`]). Of them only those with an answer of the specimen are
//! measurements ([`super::stale`]). Quantities that need steps at even times are absent where some steps are missing.

use super::axes::AxisDigest;
use super::axis_end::AxisEnd;
use super::columns::SpecimenAxis;
use super::farthest::Farthest;
use super::row_filter::Passed;
use super::shaking::Shaking;
use super::source::Earlier;
use super::table::Table;
use super::worst::Tick;
use gusset_motion::metrics::falsified::Scale;

/// Everything a page needs of the rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Digest {
    /// The farthest value from zero of each column that a limit of an axis is about, by its name.
    pub(super) largest: Vec<(String, f64)>,
    /// Columns at the ends of steps, and columns at every tick.
    pub(super) table: Table,
    pub(super) ticks: Table,
    /// Rows of all states.
    pub(super) recorded: u64,
    /// The part of the test in the rows, and its gaps.
    pub(super) passed: Passed,
    /// The part of the test in another folder; its ground motion is in `shaking`.
    pub(super) earlier: Option<Earlier>,
    /// Ticks in a step.
    pub(super) ticks_per_step: u64,
    /// True if steps are known by their numbers.
    pub(super) counted: bool,
    /// Interval of the steps in s; none where they are not at even times.
    pub(super) interval: Option<f64>,
    /// Rows that became two entries of a table; 1 if all are there.
    pub(super) every: usize,
    /// Ticks that are one sample of the tracking metrics: of a long test a sample is the mean of several.
    pub(super) means_of: usize,
    /// DOFs with a recorded displacement.
    pub(super) dofs: Vec<u32>,
    /// Axes with a recorded force.
    pub(super) all_axes: Vec<SpecimenAxis>,
    pub(super) axes: Vec<AxisDigest>,
    /// Specimens whose measured displacement is the command.
    pub(super) without_disp: Vec<u32>,
    /// Specimens of which some ticks of the test have no measurement, and how many.
    pub(super) stale: Vec<(u32, u64)>,
    /// The last values of every axis, and those of the shutdown.
    pub(super) ends: Vec<AxisEnd>,
    /// Columns of the ground motion.
    pub(super) grounds: Vec<String>,
    /// Facts about each ground that moves, with its column.
    pub(super) shaking: Vec<(String, Shaking)>,
    /// Amplitude spectra of displacements: DOF, (Hz, m s).
    pub(super) spectra: Vec<(u32, Vec<(f64, f64)>)>,
    /// Energies over time; empty where there is no model.
    pub(super) energy: Table,
    /// Scale of energy errors; `None` without a model.
    pub(super) scale: Option<Scale>,
    pub(super) worst: Vec<Tick>,
    /// The end of a step at which a node of a frame is farthest from its place.
    pub(super) farthest: Option<Farthest>,
    /// Mean displacement of the last part of the test, by DOF.
    pub(super) residuals: Vec<(u32, f64)>,
}

/// Why something is not there that needs rows at even times.
pub(super) const MISSING: &str = "rows are missing in the record, or not at even times";

/// Why there are no tracking metrics of a specimen whose answers hold forces only.
pub(super) const WITHOUT_DISP: &str =
    "the displacement is not measured, and the record repeats the command";

/// In place of a number of an axis whose displacement is not measured.
pub(super) const NOT_MEASURED: &str = "not measured";

impl Digest {
    /// False of an axis whose measured displacement is the command.
    pub(super) fn measures_disp(&self, axis: SpecimenAxis) -> bool {
        !self.without_disp.contains(&axis.specimen)
    }

    /// Axes with missing or uneven rows: no result that needs even times is possible.
    pub(super) fn broken(&self) -> impl Iterator<Item = SpecimenAxis> {
        let broken = self.axes.iter().filter(|axis| axis.dt.is_none());
        let is_timed = self.passed.step_s.is_some();
        broken.map(|axis| axis.axis).filter(move |_| is_timed)
    }

    /// Motion of the ground in a column, from 0, at the steps before the first of the rows; empty if there are no such steps, or it
    /// is unknown.
    pub(super) fn ground_before(&self, column: usize) -> &[f64] {
        let first = self.passed.range.map_or(0, |(first, _)| first);
        let known = self.earlier.as_ref().map(|earlier| &earlier.grounds);
        let known = known.and_then(|grounds| grounds.get(column));
        let whole = known.filter(|ground| ground.len() as u64 == first);
        whole.map_or(&[], Vec::as_slice)
    }
}
