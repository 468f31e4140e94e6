//! The second reading of the rows: columns at even times, the loops of the axes, and the end of the test.
//!
//! Memory does not grow with the length of a test: of a long one the means of every few rows are kept, and a loop keeps the points
//! that its picture needs.

use std::io;

use super::axis::is_drawable;
use super::columns::{MOST_DOFS, SpecimenAxis, TAIL, spread};
use super::digest::Digest;
use super::first::Measured;
use super::row_filter::{HOLDING, RUNNING, RowFilter, Stretch, TRIPPED, is_apart};
use super::source::Source;
use super::stale::{Stale, status_of};
use super::table::Table;
use super::thin;
use gusset_record::{COMMITS, Column};

/// Numbers that are kept of all columns together, and entries of one column at most and at least.
const NUMBERS: usize = 1 << 23;
const LONGEST: usize = 1 << 19;
const SHORTEST: usize = 1 << 14;
/// Points of the largest picture that a loop is drawn in, and how far an omitted point may lie from the line.
pub(super) const WIDTH: f64 = 480.0;
const TOLERANCE: f64 = 0.12;
/// Points beyond which the tolerance is doubled, up to a pixel: a noisy loop must not make a page of megabytes.
const POINTS: usize = 5_000;
/// Points of a loop that are kept at most before they are thinned.
const WAITING: usize = 1 << 15;

/// Points of a picture: x and y, NaN where the line is broken.
pub(super) type Points = (Vec<f64>, Vec<f64>);

/// Ticks that a column at even times is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Chosen {
    All,
    /// All but those of a hold.
    Unheld,
    /// The ends of steps, where the test slowed down.
    Steps,
}

/// Smallest and largest time from one row to the next.
#[derive(Debug, Clone, Copy)]
struct Apart {
    last: f64,
    least: f64,
    most: f64,
    is_known: bool,
}

impl Apart {
    const NONE: Self = Self {
        last: f64::NAN,
        least: f64::INFINITY,
        most: f64::NEG_INFINITY,
        is_known: true,
    };

    fn take(&mut self, time: f64, is_first: bool) {
        let apart = time - self.last;
        self.last = time;
        if !is_first {
            self.is_known &= !apart.is_nan();
            (self.least, self.most) = (self.least.min(apart), self.most.max(apart));
        }
    }

    fn is_even(&self, dt: f64) -> bool {
        let has_none = self.most < self.least;
        self.is_known && (has_none || (is_apart(self.least, dt) && is_apart(self.most, dt)))
    }
}

/// Which ticks are at even times. Of several rows at one time, which a waiting controller makes, only the last counts.
#[derive(Debug)]
pub(super) struct Evenness {
    /// Of all ticks, of those outside a hold, and of the ends of steps.
    apart: [Apart; 3],
    counts: [u64; 3],
    /// Time and state of the last tick.
    last: Option<(f64, f64)>,
    /// The last row only records a trip: its time is not after that of the row before it.
    repeats: bool,
}

impl Evenness {
    pub(crate) const fn new() -> Self {
        Self {
            apart: [Apart::NONE; 3],
            counts: [0; 3],
            last: None,
            repeats: false,
        }
    }

    /// Takes the next tick; the state of missing rows is not a number.
    pub(crate) fn take(&mut self, time: f64, state: f64) {
        self.put(0, time);
        let before = self.last.replace((time, state));
        self.repeats = state == TRIPPED && before.is_some_and(|(before, _)| time <= before);
        if let Some((time, state)) = before {
            self.settle(time, state);
        }
    }

    fn settle(&mut self, time: f64, state: f64) {
        if state != HOLDING {
            self.put(1, time);
        }
        if state == RUNNING && time != self.apart[2].last {
            self.put(2, time);
        }
    }

    fn put(&mut self, which: usize, time: f64) {
        self.apart[which].take(time, self.counts[which] == 0);
        self.counts[which] += 1;
    }

    /// The ticks at even times, their number and their interval; `None` where some of them are missing.
    fn chosen(&mut self, digest: &Digest, has_state: bool) -> Option<(Chosen, f64)> {
        let step_s = digest.passed.step_s?;
        let tick_s = step_s / digest.ticks_per_step.max(1) as f64;
        if let Some((time, state)) = self.last.take_if(|_| !self.repeats) {
            self.settle(time, state);
        }
        let kinds = [
            (Chosen::All, tick_s),
            (Chosen::Unheld, tick_s),
            (Chosen::Steps, step_s),
        ];
        let mut even = kinds.into_iter().zip(self.apart);
        let found = even.find(|((_, dt), apart)| apart.is_even(*dt));
        let found = found.map(|(found, _)| found);
        found.filter(|(kind, _)| has_state || *kind == Chosen::All)
    }
}

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

/// The line of a loop while its points pass, without points whose omission is invisible.
#[derive(Debug)]
pub(super) struct Loop {
    /// A unit of the picture.
    per: (f64, f64),
    tolerance: f64,
    last: Option<(f64, f64)>,
    near: Vec<(f64, f64)>,
}

impl Loop {
    /// For values within these ranges.
    pub(crate) fn new(x: Option<(f64, f64)>, y: Option<(f64, f64)>) -> Self {
        let per = |range: Option<(f64, f64)>| {
            let range = range.filter(|(lo, hi)| hi > lo);
            range.map_or(1.0, |(lo, hi)| (hi - lo) / WIDTH)
        };
        Self {
            per: (per(x), per(y)),
            tolerance: TOLERANCE,
            last: None,
            near: Vec::new(),
        }
    }

    pub(crate) fn take(&mut self, x: f64, y: f64) {
        if !(is_drawable(x) && is_drawable(y)) {
            if self.last.take().is_some() {
                self.near.push((f64::NAN, f64::NAN));
            }
            return;
        }
        let at = (x / self.per.0, y / self.per.1);
        // Half of the later tolerance.
        let least = 0.5 * self.tolerance;
        let is_far = |last: (f64, f64)| (at.0 - last.0).abs().max((at.1 - last.1).abs()) > least;
        if self.last.is_none_or(is_far) {
            self.near.push(at);
            self.last = Some(at);
            if self.near.len() >= WAITING {
                self.thin(WAITING / 4, f64::INFINITY);
            }
        }
    }

    /// Drops points near the line, until few are left or the tolerance is as large as it may be.
    fn thin(&mut self, few: usize, largest: f64) {
        loop {
            let runs = thin::within(self.near.iter().copied(), self.tolerance);
            let kept: usize = runs.iter().map(Vec::len).sum();
            if self.tolerance >= largest || kept <= few {
                let breaks = std::iter::repeat((f64::NAN, f64::NAN));
                let runs = runs.into_iter().zip(breaks).enumerate();
                let lines = runs.map(|(place, (mut run, gap))| {
                    if place > 0 {
                        run.insert(0, gap);
                    }
                    run
                });
                self.near = lines.flatten().collect();
                return;
            }
            self.tolerance *= 2.0;
        }
    }

    /// The line.
    pub(crate) fn finish(mut self) -> Points {
        self.thin(POINTS, 0.9);
        let (x, y) = self.per;
        self.near.iter().map(|at| (at.0 * x, at.1 * y)).unzip()
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
    let step_names = spectra.iter().map(disp).chain(["ground".to_owned()]);
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
    let chosen = evenness.chosen(digest, state_at.is_some());
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

    fn drawn(x: &[f64], y: &[f64]) -> Points {
        let range = |values: &[f64]| super::super::axis::extent(values.iter().copied());
        let mut line = Loop::new(range(x), range(y));
        x.iter().zip(y).for_each(|(x, y)| line.take(*x, *y));
        line.finish()
    }

    #[test]
    fn noisy_loop_is_drawn_with_few_points() {
        let n = 400_000;
        let x: Vec<f64> = (0..n).map(|i| libm::sin(i as f64 * 1e-2)).collect();
        let y: Vec<f64> = (0..n)
            .map(|i| libm::cos(i as f64 * 1.7e-2) * (1.0 + 0.1 * libm::sin(i as f64)))
            .collect();
        let (dx, dy) = drawn(&x, &y);
        assert!(dx.len() == dy.len() && dx.len() < WAITING, "{}", dx.len());
        let top = |v: &[f64]| v.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert!((top(&dx) - top(&x)).abs() < 2.0 * 1.0 / WIDTH * 2.0);
        assert!((top(&dy) - top(&y)).abs() < 2.0 * 1.1 / WIDTH * 2.0);
        let gap = drawn(&[0.0, 1.0, f64::NAN, 2.0, 3.0], &[0.0; 5]);
        assert_eq!(gap.0.iter().filter(|v| v.is_nan()).count(), 1);
        assert_eq!(drawn(&[], &[]), Points::default());
    }

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
        assert!(digest.axes[0].hysteresis.0.len() < WAITING);
    }
}
