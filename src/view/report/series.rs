//! The second reading of the rows: columns at even times, the loops of the axes, and the end of the test.
//!
//! Memory does not grow with the length of a test: of a long one the means of every few rows are kept, and a loop keeps the points
//! that its picture needs.

use std::io;

use super::columns::{MOST_DOFS, SpecimenAxis, TAIL, spread};
use super::digest::Digest;
use super::even::{Chosen, Evenness};
use super::first::Measured;
use super::loop_line::{Loop, Points};
use super::row_filter::{HOLDING, RUNNING, RowFilter, Stretch};
use super::source::Source;
use super::stale::{Stale, status_of};
use super::table::Table;
use gusset_record::{COMMITS, Column};

/// Numbers that are kept of all columns together, and entries of one column at most and at least.
const NUMBERS: usize = 1 << 23;
const LONGEST: usize = 1 << 19;
const SHORTEST: usize = 1 << 14;
/// Columns at even times: rows, or the means of every few of them.
#[derive(Debug)]
struct Series {
    columns: Vec<Column>,
    /// Their places in a block.
    places: Vec<usize>,
    every: usize,
    /// A row that a later one of its time replaces.
    pending: Vec<f64>,
    sums: Vec<f64>,
    filled: usize,
    held: Vec<Vec<f64>>,
}

impl Series {
    /// For about `rows` rows of the columns of a block that are named; `all` is the number of columns of all series.
    fn new(columns: &[Column], names: &[String], rows: u64, all: usize) -> Self {
        let place = |name: &String| columns.iter().position(|column| column.name == *name);
        let places: Vec<usize> = names.iter().filter_map(place).collect();
        let room = (NUMBERS / all.max(1)).clamp(SHORTEST, LONGEST);
        Self {
            columns: places.iter().map(|&at| columns[at].clone()).collect(),
            every: rows.div_ceil(room as u64).max(1) as usize,
            pending: Vec::new(),
            sums: vec![0.0; places.len()],
            filled: 0,
            held: vec![Vec::new(); places.len()],
            places,
        }
    }

    /// Takes a row; with `replaces` it replaces the one before.
    fn push(&mut self, block: &[Vec<f64>], row: usize, replaces: bool) {
        if !replaces {
            self.settle();
        }
        self.pending.clear();
        let values = self.places.iter().map(|&place| block[place][row]);
        self.pending.extend(values);
    }

    fn settle(&mut self) {
        if self.pending.is_empty() {
            return;
        }
        let sums = self.sums.iter_mut().zip(self.pending.drain(..));
        sums.for_each(|(sum, value)| *sum += value);
        self.filled += 1;
        if self.filled == self.every {
            for (to, sum) in self.held.iter_mut().zip(&mut self.sums) {
                to.push(std::mem::take(sum) / self.filled as f64);
            }
            self.filled = 0;
        }
    }

    /// Marks that rows are missing: nothing is known at this time. Rows that do not fill an entry before it are left out.
    fn gap(&mut self, time: f64) {
        self.settle();
        self.filled = 0;
        self.sums.fill(0.0);
        for (to, column) in self.held.iter_mut().zip(&self.columns) {
            to.push(if column.name == "time" {
                time
            } else {
                f64::NAN
            });
        }
    }

    fn finish(mut self) -> Table {
        self.settle();
        Table::new(self.columns.into_iter().zip(self.held).collect())
    }
}

/// Result of the second reading.
pub(super) struct Second {
    /// Ground and displacements at the ends of steps, and columns of the axes at even ticks; how many rows an entry is the mean of.
    pub(super) steps: (Table, usize),
    pub(super) ticks: (Table, usize),
    /// Interval of the rows that are in `ticks`; none where they are not at even times.
    pub(super) dt: Option<f64>,
    /// Force over measured displacement, and measured over target, of each axis.
    pub(super) loops: Vec<[Points; 2]>,
    /// Mean displacement of the last part of the test, by DOF.
    pub(super) residuals: Vec<(u32, f64)>,
}

/// Reads the rows again: `measured` and `evenness` are results of the first reading, `spectra` the DOFs whose displacement is kept.
pub(super) fn second(
    source: &dyn Source,
    digest: &Digest,
    measured: &[Measured],
    mut evenness: Evenness,
    spectra: &[u32],
) -> io::Result<Second> {
    let of_axis = |axis: SpecimenAxis| ["target", "meas", "force"].map(|kind| axis.column(kind));
    let disp = |dof: &u32| format!("x{dof}");
    let listed = spread(&digest.dofs, MOST_DOFS);
    let tick_names = measured.iter().flat_map(|one| of_axis(one.axis));
    let tick_names: Vec<String> = std::iter::once("time".to_owned())
        .chain(tick_names)
        .collect();
    let step_names = spectra
        .iter()
        .map(disp)
        .chain(digest.grounds.iter().cloned());
    let step_names: Vec<String> = step_names.collect();
    let mut names: Vec<String> = ["state", "step", COMMITS].map(str::to_owned).into();
    names.extend(measured.iter().map(|one| status_of(one.axis.specimen)));
    names.extend(tick_names.iter().chain(&step_names).cloned());
    names.extend(listed.iter().map(disp));
    let all = source.columns();
    let wanted = (0..all.len()).filter(|&place| names.contains(&all[place].name));
    let wanted: Vec<usize> = wanted.collect();
    let columns: Vec<Column> = wanted.iter().map(|&place| all[place].clone()).collect();
    let at = |name: &str| columns.iter().position(|column| column.name == name);
    let (state_at, time_at) = (at("state"), at("time"));
    let chosen = digest
        .passed
        .step_s
        .and_then(|step_s| evenness.chosen(step_s, digest.ticks_per_step, state_at.is_some()));
    let kind = chosen.map_or(Chosen::All, |(kind, _)| kind);
    let (step_rows, tick_rows) = (digest.passed.ends, digest.passed.ticks);
    let rows = if kind == Chosen::Steps {
        step_rows
    } else {
        tick_rows
    };
    let width = tick_names.len() + step_names.len();
    let mut ticks = Series::new(&columns, &tick_names, rows, width);
    let mut steps = Series::new(&columns, &step_names, step_rows, width);
    let mut loops: Vec<[Loop; 2]> = measured.iter().map(Measured::loops).collect();
    let places = measured
        .iter()
        .map(|one| of_axis(one.axis).map(|name| at(&name)));
    let places: Vec<[Option<usize>; 3]> = places.collect();
    let tail = step_rows.saturating_sub((digest.passed.steps / TAIL as u64).max(1));
    let residuals = listed
        .iter()
        .filter_map(|dof| Some((*dof, at(&disp(dof))?, (0.0, 0.0))));
    let mut residuals: Vec<(u32, usize, (f64, f64))> = residuals.collect();
    let mut filter = RowFilter::of(source, &columns);
    let stale = Stale::new(&columns);
    let (mut step, mut tick, mut time) = (0, 0, f64::NAN);
    source.read(&wanted, &mut |block| {
        let known = &*stale.left_out(block);
        let [ends, all] = filter.sort(block);
        for &row in ends.iter().flat_map(|stretch: &Stretch| &stretch.rows) {
            steps.push(block, row, false);
            for (_, place, (sum, count)) in residuals.iter_mut().filter(|_| step >= tail) {
                let value = block[*place][row];
                if value.is_finite() {
                    (*sum, *count) = (*sum + value, *count + 1.0);
                }
            }
            step += 1;
        }
        for stretch in &all {
            if let Some(gap) = stretch.gap.filter(|_| kind == Chosen::All) {
                ticks.gap(gap.time);
            }
            if stretch.gap.is_some() {
                let both = loops.iter_mut().flatten();
                both.for_each(|line| line.take(f64::NAN, f64::NAN));
            }
            for &row in &stretch.rows {
                for (lines, places) in loops.iter_mut().zip(&places) {
                    let value = |place: Option<usize>| place.map_or(f64::NAN, |at| known[at][row]);
                    let [target, meas, force] = places.map(value);
                    lines[0].take(meas, force);
                    lines[1].take(target, meas);
                }
                tick += 1;
                let state = state_at.map_or(RUNNING, |place| block[place][row]);
                let is_chosen = match kind {
                    Chosen::All => true,
                    Chosen::Unheld => state != HOLDING && !(evenness.repeats && tick == tick_rows),
                    Chosen::Steps => state == RUNNING,
                };
                if is_chosen {
                    let now = time_at.map_or(f64::NAN, |place| block[place][row]);
                    ticks.push(known, row, kind == Chosen::Steps && now == time);
                    time = now;
                }
            }
        }
    })?;
    let means = residuals
        .into_iter()
        .filter(|(.., (_, count))| *count > 0.0);
    let finished = loops.into_iter().map(|lines| lines.map(Loop::finish));
    let (of_steps, of_ticks) = (steps.every, ticks.every);
    Ok(Second {
        steps: (steps.finish(), of_steps),
        ticks: (ticks.finish(), of_ticks),
        dt: chosen.map(|(_, dt)| dt * of_ticks as f64),
        loops: finished.collect(),
        residuals: means
            .map(|(dof, _, (sum, count))| (dof, sum / count))
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{RATE, columns};
    use super::*;
    use crate::RunView;

    #[test]
    fn long_test_is_judged_by_means() {
        let n = 2 * LONGEST + 100;
        let motion = |t: f64| 0.01 * libm::sin(6.0 * t) * libm::sin(1e-3 * t);
        let at = |row: usize| row as f64 / RATE;
        let column = |of: &dyn Fn(usize) -> f64| (0..n).map(of).collect::<Vec<f64>>();
        let mut meas = column(&|row| 0.95 * motion(at(row) - 3.1e-3));
        meas[70_001] += 0.02;
        let run = RunView {
            columns: columns(&[
                "step",
                "state",
                "time",
                "target_1_1",
                "meas_1_1",
                "force_1_1",
            ]),
            data: vec![
                column(&|row| row as f64),
                column(&|_| RUNNING),
                column(&at),
                column(&|row| motion(at(row))),
                meas.clone(),
                column(&|row| 1e6 * motion(at(row) - 3.1e-3)),
            ],
            ..RunView::default()
        };
        let digest = run.digested();
        assert_eq!((digest.means_of, digest.axes.len()), (3, 1));
        let tracking = digest.axes[0].tracking.unwrap();
        assert_eq!(tracking.samples, n as u64 / 3);
        assert!(
            (tracking.delay_s.unwrap().value / 3.1e-3 - 1.0).abs() < 3e-3,
            "{tracking:?}"
        );
        assert!((tracking.amplitude_error.value + 0.05).abs() < 1e-3);
        // Of every row, not of the means.
        let error = meas[70_001] - motion(at(70_001));
        assert!((tracking.peak_error_m.value - error).abs() < 1e-12);
        assert_eq!(digest.axes[0].peak_disp, Some(meas[70_001]));
        assert!(digest.axes[0].hysteresis.0.len() < 1 << 15);
    }
}
