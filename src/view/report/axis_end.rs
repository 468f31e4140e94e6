//! The end of each axis: the last that was recorded of it, and the largest force before and after the test.

use super::columns::SpecimenAxis;

/// Columns of raw measurements.
pub(super) const MEASURED: &str = "raw_disp";
pub(super) const FORCE: &str = "raw_force";

/// The end of one axis; unrecorded values are NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisEnd {
    pub axis: SpecimenAxis,
    /// Values of the last row that has them, in every state, in the specimen's units.
    pub command: f64,
    pub measured: f64,
    pub force: f64,
    /// Test time of the last row, s.
    pub time: f64,
    /// Force of largest magnitude in the startup and in the shutdown, at the structure, with its sign; none without a recorded row.
    pub on_the_way_in: Option<f64>,
    pub on_the_way_out: Option<f64>,
}

/// Follows the rows to their end.
pub(super) struct Ends {
    /// Places of command, measured displacement and force of every axis in a block, at its own end, and of the force as the
    /// structure sees it.
    places: Vec<[Option<usize>; 4]>,
    time: Option<usize>,
    ends: Vec<AxisEnd>,
}

impl Ends {
    /// For these axes; `place` gives the place of a column in a block.
    pub(crate) fn new(axes: &[SpecimenAxis], place: impl Fn(&str) -> Option<usize>) -> Self {
        let places = axes
            .iter()
            .map(|axis| ["cmd", MEASURED, FORCE, "force"].map(|kind| place(&axis.column(kind))));
        let end = |&axis: &SpecimenAxis| AxisEnd {
            axis,
            command: f64::NAN,
            measured: f64::NAN,
            force: f64::NAN,
            time: f64::NAN,
            on_the_way_in: None,
            on_the_way_out: None,
        };
        Self {
            places: places.collect(),
            time: place("time"),
            ends: axes.iter().map(end).collect(),
        }
    }

    /// Takes the next rows, with the places of those of the startup and of the shutdown.
    pub(crate) fn take(&mut self, block: &[Vec<f64>], ways: [&[usize]; 2]) {
        for (end, places) in self.ends.iter_mut().zip(&self.places) {
            let [command, measured, own, force] =
                places.map(|place| block.get(place?).map(Vec::as_slice));
            let time = self.time.and_then(|place| block.get(place));
            let kept = [
                &mut end.command,
                &mut end.measured,
                &mut end.force,
                &mut end.time,
            ];
            let columns = [command, measured, own, time.map(Vec::as_slice)];
            for (kept, column) in kept.into_iter().zip(columns) {
                let known = column.and_then(|all| all.iter().rfind(|v| !v.is_nan()));
                *kept = known.copied().unwrap_or(*kept);
            }
            let largest = [&mut end.on_the_way_in, &mut end.on_the_way_out];
            for (largest, rows) in largest.into_iter().zip(ways) {
                let forces = rows.iter().filter_map(|&row| force?.get(row).copied());
                *largest = largest
                    .iter()
                    .copied()
                    .chain(forces)
                    .filter(|force| force.is_finite())
                    .max_by(|a, b| a.abs().total_cmp(&b.abs()));
            }
        }
    }

    /// The ends.
    pub(crate) fn finish(self) -> Vec<AxisEnd> {
        self.ends
    }
}
