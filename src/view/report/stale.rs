//! Rows without a measurement of a specimen: its answer was overdue, and the loop continued with the last one or with an
//! estimate. `status_<s>` marks them.
//!
//! Invariant: such a row is no point of a picture, no peak and no sample of a metric. Values that the loop computed from it,
//! equilibrium and the energies, stay unchanged.

use std::borrow::Cow;

use super::row_filter::Stretch;
use gusset_quantity::catalog::column::{self, Kind};
use gusset_quantity::substructure::Status;
use gusset_record::Column;

/// Kinds of columns that are of a measurement.
const MEASURED: [Kind; 6] = [
    column::MEASURED,
    column::FORCE,
    column::RAW_DISP,
    column::RAW_FORCE,
    column::MEASURED_POSE,
    column::POSE_FORCE,
];

/// One specimen: its number from 1, and the places of its status and its measured values in a block.
struct Watched {
    specimen: u32,
    status: usize,
    measured: Vec<usize>,
    count: u64,
}

/// Finds rows without a measurement.
pub(super) struct Stale {
    specimens: Vec<Watched>,
}

/// Name of the column with the state of a specimen's measurement.
pub(super) fn status_of(specimen: u32) -> String {
    column::STATUS.of_specimen(specimen)
}

/// The specimen that a column of a measurement belongs to.
fn measured_of(name: &str) -> Option<u32> {
    MEASURED.iter().find_map(|kind| kind.specimen_in(name))
}

fn is_stale(status: f64) -> bool {
    Status(status as u32).has(Status::STALE)
}

impl Stale {
    /// For blocks of these columns.
    pub(crate) fn new(columns: &[Column]) -> Self {
        let places = || columns.iter().enumerate();
        let specimens = places().filter_map(|(status, of)| {
            let specimen = column::STATUS.specimen_in(&of.name)?;
            let measured = places().filter(|(_, c)| measured_of(&c.name) == Some(specimen));
            Some(Watched {
                specimen,
                status,
                measured: measured.map(|(place, _)| place).collect(),
                count: 0,
            })
        });
        Self {
            specimens: specimens.collect(),
        }
    }

    /// The block with NaN where nothing was measured.
    pub(crate) fn left_out<'a>(&self, block: &'a [Vec<f64>]) -> Cow<'a, [Vec<f64>]> {
        let mut out = Cow::Borrowed(block);
        for of in &self.specimens {
            let rows = block[of.status].iter().enumerate();
            for (row, _) in rows.filter(|(_, status)| is_stale(**status)) {
                for &place in &of.measured {
                    out.to_mut()[place][row] = f64::NAN;
                }
            }
        }
        out
    }

    /// Counts those among ticks of the test.
    pub fn count(&mut self, ticks: &Stretch, block: &[Vec<f64>]) {
        for of in &mut self.specimens {
            let status = &block[of.status];
            let found = ticks.rows.iter().filter(|&&row| is_stale(status[row]));
            of.count += found.count() as u64;
        }
    }

    /// Specimens with stale rows, and their number.
    pub(crate) fn found(&self) -> Vec<(u32, u64)> {
        let found = self.specimens.iter().filter(|of| of.count > 0);
        found.map(|of| (of.specimen, of.count)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::hybrid;
    use super::super::text::count;
    use super::super::{RunView, render, tracking_metrics};
    use super::*;

    fn place(run: &RunView, name: &str) -> usize {
        run.columns.iter().position(|c| c.name == name).unwrap()
    }

    /// A test whose specimen follows to the last bit, and the same with four overdue answers at the peak of the force: the
    /// measured displacement was held, the force estimated too large. With the row of the first of them.
    fn without_answers() -> (RunView, RunView, usize) {
        let whole = hybrid(4.0, 0);
        let mut run = whole.clone();
        let [meas, force, status] =
            ["meas_1_1", "force_1_1", "status_1"].map(|name| place(&run, name));
        let peak = gusset_motion::metrics::peak(&run.data[force]).unwrap();
        let from = peak.index - 1;
        for row in from..from + 4 {
            run.data[meas][row] = run.data[meas][from - 1];
            run.data[force][row] = 1.2 * peak.value;
            run.data[status][row] = f64::from(Status::STALE.0);
        }
        (whole, run, from)
    }

    #[test]
    fn estimate_is_not_a_peak_or_a_sample() {
        let (whole, run, from) = without_answers();
        let digest = run.digested();
        assert_eq!(digest.stale, [(1, 4)]);
        let axis = &digest.axes[0];
        let force = &whole.data[place(&whole, "force_1_1")];
        let answered = force.iter().enumerate();
        let answered = answered.filter(|(row, _)| !(from..from + 4).contains(row));
        let largest = answered.map(|(_, f)| f.abs()).fold(0.0, f64::max);
        assert_eq!(axis.peak_force.unwrap().abs(), largest);
        let tracking = axis.tracking.as_ref().unwrap();
        assert_eq!(tracking.samples, force.len() as u64 - 4);
        assert_eq!(
            (tracking.nrmse.value, tracking.peak_error_m.value),
            (0.0, 0.0)
        );
        assert_eq!(tracking.energy_error_j.value, 0.0);
        assert_eq!(tracking.delay_s.unwrap().value, 0.0);
        assert!((tracking.fei.unwrap().amplitude.value - 1.0).abs() < 1e-12);
        for points in [&axis.hysteresis, &axis.subspace] {
            assert_eq!(points.0.iter().filter(|x| x.is_nan()).count(), 1);
        }
        for (kind, all) in [("meas", 4), ("force", 4), ("error", 4), ("target", 0)] {
            let drawn = digest.ticks.get(&axis.axis.column(kind)).unwrap();
            let gaps = drawn.iter().filter(|v| v.is_nan()).count();
            assert_eq!(gaps, all, "{kind}");
        }
        // Straight across four of 4096 samples.
        let energy = whole.digested().axes[0].absorbed.unwrap();
        assert!((axis.absorbed.unwrap() / energy - 1.0).abs() < 1e-2);
        let summary = serde_json::to_string(&tracking_metrics(&run)).unwrap();
        assert!(summary.contains("\"value\":0.0"), "{summary}");
    }

    #[test]
    fn page_counts_samples_that_are_estimates() {
        let (whole, run, _) = without_answers();
        let told = format!("bottom column 4 of {}", count(4096));
        assert!(render(&run).contains(&told));
        assert!(!render(&whole).contains("estimates, because no reply came"));
    }

    #[test]
    fn nothing_is_copied_without_stale_rows() {
        let names = [
            "status_1",
            "meas_1_1",
            "status_2",
            "pose_force_2_1",
            "target_2_1",
        ];
        let stale = Stale::new(&super::super::synthetic::columns(&names));
        let mut block = vec![vec![8.0, 8.0]; names.len()];
        assert!(matches!(stale.left_out(&block), Cow::Borrowed(_)));
        block[2][1] = f64::from(Status::STALE.0 | 8);
        let found = stale.left_out(&block);
        let gaps = found.iter().map(|column| column[1].is_nan());
        assert_eq!(gaps.collect::<Vec<_>>(), [false, false, false, true, false]);
    }
}
