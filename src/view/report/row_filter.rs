//! Which rows are physics: the ends of steps for the structure, every tick of the test for its specimens; and where some are
//! missing.
//!
//! Invariant: the end of a step is a row of state 3. Ticks are these rows, those between two steps (11, 12, 13), those of a hold
//! (6) and the one that tripped the running test (8). If that one is at the end of a step, its row holds the displacement there,
//! but no velocity and no acceleration: it counts among the ends of steps, but not as a step that was made. The startup has rows
//! of states 1, 2, 4, 5 and 10 and a trip before the first tick. The shutdown has those of state 7 and any other trip. A server
//! has no shutdown: in its record rows of state 8 are commands that were not passed on. Missing rows separate the rows before
//! them from those behind.

use super::source::Source;
use gusset_quantity::catalog::phase::{Part, Phase, Stage};
use gusset_record::{COMMITS, Column};

pub(super) const RUNNING: f64 = Phase::Running.code();
pub(super) const HOLDING: f64 = Phase::Holding.code();
const LEAVING: f64 = Phase::Leaving.code();
pub(super) const TRIPPED: f64 = Phase::Tripped.code();
pub(super) const BETWEEN: [f64; 3] = [
    Stage::Correct.code(),
    Stage::Predict.code(),
    Stage::SlowDown.code(),
];

/// Where rows are missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gap {
    /// Test time in the middle of it.
    pub time: f64,
    /// Rows that are missing, by the time that has passed.
    pub rows: u64,
}

/// Rows of a block that follow one another.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Stretch {
    /// Rows that are missing before them.
    pub gap: Option<Gap>,
    /// Their places in the block.
    pub rows: Vec<usize>,
}

impl Stretch {
    /// Those of the values of a block's column that belong to it.
    pub(crate) fn of(&self, column: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|&row| column[row]).collect()
    }
}

/// Rows that should come at even times.
#[derive(Debug, Clone, Copy, Default)]
struct Course {
    /// Step of the first row.
    first: Option<f64>,
    /// Time and step of the last.
    last: Option<(f64, f64)>,
    interval: Option<f64>,
    rows: u64,
    missing: u64,
    is_uneven: bool,
}

impl Course {
    /// Number of the last row's step, if it is known.
    fn step(&self) -> f64 {
        self.last.map_or(f64::NAN, |(_, step)| step)
    }

    /// Steps of the first and the last row, if they are known.
    fn range(&self) -> Option<(u64, u64)> {
        let (first, last) = (self.first?, self.step());
        (first >= 0.0 && last >= first).then_some((first as u64, last as u64))
    }

    /// Takes one more row; returns the gap before it. `step` is NaN where steps do not count it.
    fn follow(&mut self, time: f64, step: f64) -> Option<Gap> {
        self.rows += 1;
        self.first = self.first.or(Some(step));
        let (before, step_before) = self.last.replace((time, step))?;
        let apart = time - before;
        if self.interval.is_none() {
            self.interval = Some(apart).filter(|dt| *dt > 0.0 && dt.is_finite());
        }
        let is_even = self.interval.is_some_and(|dt| is_apart(apart, dt));
        self.is_uneven |= !is_even;
        let steps = (step - step_before).round();
        let missing = match self.interval {
            _ if steps.is_finite() => steps - 1.0,
            Some(dt) => (apart / dt).round() - 1.0,
            None => 0.0,
        };
        if missing < 1.0 || missing.is_nan() {
            return None;
        }
        let rows = missing as u64;
        self.missing = self.missing.saturating_add(rows);
        Some(Gap {
            time: before + 0.5 * apart,
            rows,
        })
    }
}

/// Share of an interval by which rows of an even grid may be off.
const EVEN: f64 = 1e-3;

/// True if a time is one interval after another.
pub(super) fn is_apart(apart: f64, dt: f64) -> bool {
    (apart - dt).abs() <= EVEN * dt
}

/// Sorts rows as they pass.
#[derive(Debug, Clone)]
pub(super) struct RowFilter {
    state: Option<usize>,
    step: Option<usize>,
    time: Option<usize>,
    ticks_per_step: f64,
    is_served: bool,
    is_on: bool,
    steps: Course,
    ticks: Course,
    /// Trips at the end of a step.
    cut_short: u64,
    before: u64,
    leaving: u64,
    kept_back: u64,
    /// Places of the rows of the startup, and of the shutdown, in the block that was sorted last.
    early: Vec<usize>,
    out: Vec<usize>,
}

/// Counts of sorted rows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Passed {
    /// Steps that were made, by their ends.
    pub steps: u64,
    /// Ends of steps: these, and a trip at the end of a step.
    pub ends: u64,
    /// Ticks of the test, these among them.
    pub ticks: u64,
    /// Rows before the test, and of the shutdown.
    pub before: u64,
    pub leaving: u64,
    /// Commands that a server did not pass on.
    pub kept_back: u64,
    /// Steps and ticks that are missing between the first and the last.
    pub missing_steps: u64,
    pub missing_ticks: u64,
    /// Numbers of the first and the last end of a step, where they are known.
    pub range: Option<(u64, u64)>,
    /// Test time from step to step in s, as known or as between the first two.
    pub step_s: Option<f64>,
    /// True if all steps are this far from the next.
    pub is_even: bool,
}

impl RowFilter {
    /// For blocks with state, step and time at these places; without a state all rows are ends of steps.
    fn new(places: [Option<usize>; 3], step_s: Option<f64>, ticks_per_step: u64) -> Self {
        let [state, step, time] = places;
        let ticks_per_step = ticks_per_step.max(1) as f64;
        let interval = step_s.filter(|dt| *dt > 0.0 && dt.is_finite());
        Self {
            state,
            step,
            time,
            ticks_per_step,
            is_served: false,
            is_on: false,
            steps: Course {
                interval,
                ..Course::default()
            },
            ticks: Course {
                interval: interval.map(|dt| dt / ticks_per_step),
                ..Course::default()
            },
            cut_short: 0,
            before: 0,
            leaving: 0,
            kept_back: 0,
            early: Vec::new(),
            out: Vec::new(),
        }
    }

    /// For blocks of these columns of `source`.
    pub(crate) fn of(source: &dyn Source, columns: &[Column]) -> Self {
        let at = |name: &str| columns.iter().position(|column| column.name == name);
        let is_served = source.columns().iter().any(|column| column.name == COMMITS);
        // A server numbers exchanges; the steps are those of its controller.
        let step = if is_served { COMMITS } else { "step" };
        let places = ["state", step, "time"].map(at);
        Self {
            is_served,
            ..Self::new(places, source.step_s(), source.ticks_per_step())
        }
    }

    /// The ends of steps, and the ticks, of the next block.
    pub(crate) fn sort(&mut self, block: &[Vec<f64>]) -> [Vec<Stretch>; 2] {
        let mut found = [vec![Stretch::default()], vec![Stretch::default()]];
        self.early.clear();
        self.out.clear();
        let at = |place: Option<usize>, row: usize, none: f64| {
            place.map_or(none, |place| block[place][row])
        };
        for row in 0..block.first().map_or(0, Vec::len) {
            let state = at(self.state, row, RUNNING);
            let (time, step) = (at(self.time, row, f64::NAN), at(self.step, row, f64::NAN));
            if self.is_served && state == TRIPPED {
                self.kept_back += 1;
                continue;
            }
            let is_trip = state == TRIPPED && self.is_on;
            let cuts_short = is_trip && step > self.steps.step();
            let is_step = state == RUNNING || cuts_short;
            let is_tick = is_step || is_trip || state == HOLDING || BETWEEN.contains(&state);
            self.is_on = is_tick && !is_trip;
            let is_startup = Part::of(state) == Some(Part::Startup);
            if is_startup || (state == TRIPPED && self.ticks.rows == 0) {
                self.early.push(row);
                self.before += 1;
            } else if state == LEAVING || (state == TRIPPED && !is_tick) {
                self.out.push(row);
                self.leaving += 1;
            }
            self.cut_short += u64::from(cuts_short);
            if is_step {
                let gap = self.steps.follow(time, step);
                put(&mut found[0], gap, row);
                if self.ticks.interval.is_none() {
                    self.ticks.interval = self.steps.interval.map(|dt| dt / self.ticks_per_step);
                }
            }
            if is_tick {
                let gap = self.ticks.follow(time, f64::NAN);
                put(&mut found[1], gap, row);
            }
        }
        found
    }

    /// Places of the rows of the startup, and of the shutdown, in the block that was sorted last.
    pub(crate) fn ways(&self) -> [&[usize]; 2] {
        [&self.early, &self.out]
    }

    /// Counts so far.
    pub(crate) fn passed(&self) -> Passed {
        Passed {
            steps: self.steps.rows - self.cut_short,
            ends: self.steps.rows,
            ticks: self.ticks.rows,
            before: self.before,
            leaving: self.leaving,
            kept_back: self.kept_back,
            range: self.steps.range(),
            missing_steps: self.steps.missing,
            missing_ticks: self.ticks.missing,
            step_s: self.steps.interval,
            is_even: !self.steps.is_uneven,
        }
    }
}

fn put(stretches: &mut Vec<Stretch>, gap: Option<Gap>, row: usize) {
    match (gap, stretches.last_mut()) {
        (None, Some(stretch)) => stretch.rows.push(row),
        _ => stretches.push(Stretch {
            gap,
            rows: vec![row],
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Step, sub-tick's time and state of rows, sorted in blocks of `block`.
    fn sorted(
        rows: &[(f64, f64, f64)],
        step_s: Option<f64>,
        ticks: u64,
        block: usize,
    ) -> (Vec<Gap>, Vec<f64>, Vec<Gap>, Vec<f64>, Passed) {
        let mut row_filter = RowFilter::new([Some(0), Some(1), Some(2)], step_s, ticks);
        let (mut gaps, mut times) = ([vec![], vec![]], [vec![], vec![]]);
        for part in rows.chunks(block) {
            let column = |of: fn(&(f64, f64, f64)) -> f64| part.iter().map(of).collect();
            let block: Vec<Vec<f64>> = vec![column(|r| r.2), column(|r| r.0), column(|r| r.1)];
            for (kind, stretches) in row_filter.sort(&block).iter().enumerate() {
                for stretch in stretches {
                    gaps[kind].extend(stretch.gap);
                    times[kind].extend(stretch.of(&block[2]));
                }
            }
        }
        let ([a, c], [b, d]) = (gaps, times);
        (a, b, c, d, row_filter.passed())
    }

    #[test]
    fn ticks_are_separated_from_step_ends() {
        let rows = [
            (0.0, 0.0, Phase::Zeroing.code()),
            (0.0, 0.0, TRIPPED),
            (0.0, 0.0, RUNNING),
            (0.0, 0.5, 11.0),
            (1.0, 1.0, RUNNING),
            (1.0, 1.2, 13.0),
            (1.0, 1.2, HOLDING),
            (1.0, 1.7, 11.0),
            (2.0, 2.0, RUNNING),
            (2.0, 2.5, TRIPPED),
            (2.0, 2.5, TRIPPED),
            (2.0, 2.5, 7.0),
        ];
        for block in [1, 5, 100] {
            let (gaps, steps, missing, ticks, passed) = sorted(&rows, Some(1.0), 2, block);
            assert_eq!(steps, [0.0, 1.0, 2.0]);
            assert_eq!(ticks, [0.0, 0.5, 1.0, 1.2, 1.2, 1.7, 2.0, 2.5]);
            assert!(gaps.is_empty() && missing.is_empty());
            assert!(passed.is_even && passed.missing_ticks == 0);
            // The zeroing and a trip before the test; the repeated trip and the shutdown.
            assert_eq!((passed.before, passed.leaving), (2, 2));
        }
    }

    #[test]
    fn trip_at_a_step_end_is_no_step() {
        let running = [(0.0, 0.0, RUNNING), (1.0, 1.0, RUNNING)];
        for (trip, ends) in [
            ((2.0, 2.0, TRIPPED), vec![0.0, 1.0, 2.0]),
            // Between two steps; and one whose row only repeats earlier values.
            ((1.0, 1.5, TRIPPED), vec![0.0, 1.0]),
            ((1.0, 1.0, TRIPPED), vec![0.0, 1.0]),
        ] {
            let out = [(1.0, 1.0, LEAVING), (1.0, 1.0, TRIPPED)];
            let rows = [running.as_slice(), &[trip], &out].concat();
            let (gaps, steps, _, ticks, passed) = sorted(&rows, Some(1.0), 2, 100);
            assert_eq!(steps, ends);
            assert_eq!((ticks.len(), passed.steps, passed.leaving), (3, 2, 2));
            assert!(gaps.is_empty() && passed.is_even);
        }
    }

    #[test]
    fn missing_steps_are_counted() {
        let running = |step: f64| (step, 0.25 * step, RUNNING);
        let rows: Vec<_> = (0..10)
            .filter(|k| !(4..7).contains(k))
            .map(|k| running(f64::from(k)))
            .collect();
        // As the interval is known, and as the first two rows show it.
        for step_s in [Some(0.25), None] {
            let (gaps, steps, missing, _, passed) = sorted(&rows, step_s, 1, 3);
            let gap = Gap {
                time: 0.25 * 5.0,
                rows: 3,
            };
            assert_eq!((gaps, missing), (vec![gap], vec![gap]));
            assert_eq!(steps.len(), 7);
            assert_eq!((passed.missing_steps, passed.missing_ticks), (3, 3));
            assert_eq!(passed.range, Some((0, 9)));
            assert_eq!((passed.step_s, passed.is_even), (Some(0.25), false));
        }
        // A tick between two steps is missing, and no step.
        let rows = [
            (0.0, 0.0, RUNNING),
            (0.0, 0.25, 11.0),
            (0.0, 0.75, 11.0),
            (1.0, 1.0, RUNNING),
        ];
        let (gaps, _, missing, _, passed) = sorted(&rows, Some(1.0), 4, 100);
        assert_eq!((gaps.len(), missing.len(), passed.missing_ticks), (0, 1, 1));
        assert!(passed.is_even);
    }
}
