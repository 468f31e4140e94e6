//! Two recordings row by row: the same test time in both, number against number.
//!
//! Invariant: rows are ordered by their times. At equal times the end of a step is paired with the end of a step only. A tick
//! between two steps, where a test waits or slows down, is paired with such a tick only. Columns that depend on wall time are
//! never compared. Two missing values are equal; other values are equal only bit by bit.

use super::first::is_of_tick;
use super::row_filter::{BETWEEN, RUNNING, TRIPPED};
use super::table::{Table, Thinner};
use gusset_quantity::catalog::column::{
    self, ACCEL, DISP, FORCE, GROUND, Kind, MEASURED, SEQUENCE, TARGET, VEL,
};
use gusset_record::Column;

/// Columns of a server that the wall clock decided, although they repeat in a replay.
const BY_THE_CLOCK: [&Kind; 3] = [
    &column::BETWEEN,
    &column::ALLOWED,
    &column::ALLOWED_BY_CONTROLLER,
];
/// Columns that place a row in the test.
const BOOKKEEPING: [&str; 5] = ["step", "sub_tick", "state", "hold", "time"];
/// Rows that are handed on together.
const BLOCK: usize = 1024;
/// Columns of which pictures are made.
const MOST_DRAWN: usize = 60;
/// Times whose difference is at most this share of themselves, and of a second, are equal: steps may be 1e-9 apart.
const SAME: f64 = 2e-9;

/// The first number that is not the same.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstDifference {
    /// Step of the integration.
    pub step: u64,
    /// Test time in s.
    pub time: f64,
    /// Name of the column.
    pub column: String,
    /// Its value in the one and in the other run.
    pub values: (f64, f64),
}

/// How far one column is apart.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Apart {
    pub column: Column,
    /// Largest |difference|, and its time.
    pub largest: f64,
    pub at: f64,
    /// Root mean square of the difference, and largest |value| of the first run.
    pub rms: f64,
    pub size: f64,
    /// Step from which on it differs.
    pub first: Option<u64>,
}

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Matched {
    /// Rows of times that both have.
    pub rows: u64,
    /// Rows of times that only the one or only the other has.
    pub alone: (u64, u64),
    /// Columns that were compared.
    pub columns: usize,
    /// The first difference; `None` if all values are equal. Different counts of ticks and commands are reported only where
    /// nothing else differs.
    pub first: Option<FirstDifference>,
    /// True if nothing differs but that count.
    pub only_counts: bool,
    pub(super) apart: Vec<Apart>,
    /// `time`, and for some columns `a:<name>`, `b:<name>`, `d:<name>`, of rows that both have: those of the structure at the ends
    /// of steps, those of specimens at every tick.
    pub(super) tables: [Table; 2],
}

impl Matched {
    /// The table that holds the column of this name.
    pub(super) fn table_of(&self, name: &str) -> Option<&Table> {
        let name = format!("a:{name}");
        self.tables.iter().find(|table| table.get(&name).is_some())
    }
}

/// Columns that are drawn, side by side.
#[derive(Debug)]
struct Drawn {
    /// Which of the pairs.
    pairs: Vec<usize>,
    block: Vec<Vec<f64>>,
    thinner: Thinner,
}

#[derive(Debug, Clone)]
struct Pair {
    places: (usize, usize),
    /// It counts ticks and commands.
    counts: bool,
    /// It is of an equilibrium, which a tick that trips never has.
    is_output: bool,
    sum: f64,
    count: f64,
    apart: Apart,
}

/// Compares rows as they arrive.
#[derive(Debug)]
pub struct Matcher {
    key: [(usize, usize); 3],
    time: (usize, usize),
    pairs: Vec<Pair>,
    /// At the ends of steps, and at every tick.
    drawn: [Drawn; 2],
    rows: u64,
    alone: (u64, u64),
    /// The first difference, and the first of how ticks and commands were counted.
    first: [Option<FirstDifference>; 2],
}

/// Which row comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// Both are of one tick and were compared.
    Both,
    /// The first run's row has no counterpart.
    First,
    /// The second run's row has no counterpart.
    Second,
}

impl Matcher {
    /// For rows of these columns; `rows` is their approximate number. `None` if the runs have no columns of step, sub-tick,
    /// state and time, or nothing else, in common.
    #[must_use]
    pub fn new(first: &[Column], second: &[Column], rows: u64) -> Option<Self> {
        let at = |name: &str| {
            let place = |columns: &[Column]| columns.iter().position(|c| c.name == name);
            Some((place(first)?, place(second)?))
        };
        let key = [at("step")?, at("sub_tick")?, at("state")?];
        let time = at("time")?;
        let pairs = first.iter().enumerate().filter_map(|(i, column)| {
            let other = second.iter().position(|c| c.name == column.name)?;
            let by_the_clock = BY_THE_CLOCK.iter().any(|kind| kind.fits(&column.name));
            let is_compared =
                !column.timing && !by_the_clock && column.unit == second.get(other)?.unit;
            let apart = Apart {
                column: column.clone(),
                largest: 0.0,
                at: f64::NAN,
                rms: 0.0,
                size: 0.0,
                first: None,
            };
            is_compared.then_some(Pair {
                places: (i, other),
                counts: BOOKKEEPING.contains(&column.name.as_str()) || SEQUENCE.fits(&column.name),
                is_output: [VEL, ACCEL].iter().any(|kind| kind.fits(&column.name)),
                sum: 0.0,
                count: 0.0,
                apart,
            })
        });
        let pairs: Vec<Pair> = pairs.collect();
        let is_physics = |pair: &Pair| !BOOKKEEPING.contains(&pair.apart.column.name.as_str());
        if !pairs.iter().any(is_physics) {
            return None;
        }
        let is_drawn = |pair: &Pair| {
            let name = pair.apart.column.name.as_str();
            let kinds = [DISP, GROUND, TARGET, MEASURED, FORCE];
            kinds.iter().any(|kind| kind.fits(name))
        };
        let drawn: Vec<usize> = (0..pairs.len())
            .filter(|&i| is_drawn(&pairs[i]))
            .take(MOST_DRAWN)
            .collect();
        let (ticks, steps): (Vec<usize>, Vec<usize>) = drawn
            .into_iter()
            .partition(|&i| is_of_tick(&pairs[i].apart.column));
        let drawn = [steps, ticks].map(|of| Drawn::new(of, rows));
        Some(Self {
            key,
            time,
            pairs,
            drawn,
            rows: 0,
            alone: (0, 0),
            first: [None, None],
        })
    }

    /// True if this row is a tick of the running test, or the one that tripped it, of the first (or, with `second`, the second)
    /// run. `before` is the last such row, if there is one: a trip at its time has no separate tick.
    #[must_use]
    pub fn is_running(&self, row: &[f64], before: &[f64], second: bool) -> bool {
        let of = |row: &[f64], (a, b): (usize, usize)| row.get(if second { b } else { a }).copied();
        let (state, time) = (of(row, self.key[2]), of(row, self.time));
        let is_new =
            |time: f64| time >= 0.0 && of(before, self.time).is_none_or(|last| time > last);
        let is_of_test = |state: f64| {
            state == RUNNING
                || BETWEEN.contains(&state)
                || (state == TRIPPED && time.is_some_and(is_new))
        };
        state.is_some_and(is_of_test)
    }

    /// Compares a row of each run, if they are of one time; returns which of them to advance.
    pub fn take(&mut self, first: &[f64], second: &[f64]) -> Next {
        let next = self.next(first, second);
        match next {
            Next::First => self.alone.0 += 1,
            Next::Second => self.alone.1 += 1,
            Next::Both => self.compare(first, second),
        }
        next
    }

    /// Whether these rows belong together, or which of them is alone.
    fn next(&self, first: &[f64], second: &[f64]) -> Next {
        let (a, b) = (first[self.time.0], second[self.time.1]);
        let near = SAME * (1.0 + a.abs());
        if a < b - near {
            return Next::First;
        }
        if b < a - near {
            return Next::Second;
        }
        let (a, b) = (first[self.key[2].0], second[self.key[2].1]);
        match (BETWEEN.contains(&a), BETWEEN.contains(&b)) {
            (true, false) if b == RUNNING => Next::First,
            (false, true) if a == RUNNING => Next::Second,
            _ => Next::Both,
        }
    }

    fn compare(&mut self, first: &[f64], second: &[f64]) {
        self.rows += 1;
        let step = first[self.key[0].0] as u64;
        let time = first[self.time.0];
        let states = [first[self.key[2].0], second[self.key[2].1]];
        let has_outputs = !states.contains(&TRIPPED);
        for pair in &mut self.pairs {
            if pair.is_output && !has_outputs {
                continue;
            }
            let (a, b) = (first[pair.places.0], second[pair.places.1]);
            let found = &mut self.first[usize::from(pair.counts)];
            pair.take(a, b, step, time, found);
        }
        let ends_step = states.contains(&RUNNING);
        for (drawn, is_due) in self.drawn.iter_mut().zip([ends_step, true]) {
            if is_due {
                drawn.take(&self.pairs, time, first, second);
            }
        }
    }

    /// The result, with rows that only one of the runs still has at its end.
    #[must_use]
    pub fn finish(self, left: (u64, u64)) -> Matched {
        let tables = self.drawn.map(|drawn| drawn.finish(&self.pairs));
        let apart: Vec<Apart> = self.pairs.into_iter().map(Pair::finish).collect();
        let [number, counted] = self.first;
        Matched {
            rows: self.rows,
            alone: (self.alone.0 + left.0, self.alone.1 + left.1),
            columns: apart.len(),
            only_counts: number.is_none() && counted.is_some(),
            first: number.or(counted),
            apart,
            tables,
        }
    }
}

impl Drawn {
    fn new(pairs: Vec<usize>, rows: u64) -> Self {
        let width = 1 + 3 * pairs.len();
        Self {
            pairs,
            block: vec![Vec::with_capacity(BLOCK); width],
            thinner: Thinner::new(rows, width, Some(0)),
        }
    }

    fn take(&mut self, pairs: &[Pair], time: f64, first: &[f64], second: &[f64]) {
        let values = self.pairs.iter().flat_map(|&i| {
            let (a, b) = pairs[i].places;
            [first[a], second[b], second[b] - first[a]]
        });
        let values = std::iter::once(time).chain(values);
        for (column, value) in self.block.iter_mut().zip(values) {
            column.push(value);
        }
        if self.block[0].len() == BLOCK {
            self.hand_on();
        }
    }

    fn hand_on(&mut self) {
        let slices: Vec<&[f64]> = self.block.iter().map(Vec::as_slice).collect();
        self.thinner.take(&slices);
        self.block.iter_mut().for_each(Vec::clear);
    }

    fn finish(mut self, pairs: &[Pair]) -> Table {
        self.hand_on();
        let column = |name: String, from: &Column| Column {
            name,
            ..from.clone()
        };
        let mut columns = vec![Column {
            name: "time".to_owned(),
            unit: "s".to_owned(),
            meaning: String::new(),
            timing: false,
        }];
        for &i in &self.pairs {
            let from = &pairs[i].apart.column;
            columns
                .extend(["a", "b", "d"].map(|side| column(format!("{side}:{}", from.name), from)));
        }
        self.thinner.table(columns)
    }
}

impl Pair {
    fn take(&mut self, a: f64, b: f64, step: u64, time: f64, first: &mut Option<FirstDifference>) {
        if a.is_finite() {
            self.apart.size = self.apart.size.max(a.abs());
        }
        if a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()) {
            self.count += 1.0;
            return;
        }
        if self.apart.first.is_none() {
            self.apart.first = Some(step);
        }
        if first.is_none() {
            *first = Some(FirstDifference {
                step,
                time,
                column: self.apart.column.name.clone(),
                values: (a, b),
            });
        }
        let apart = (b - a).abs();
        if apart.is_finite() {
            self.count += 1.0;
            self.sum += apart * apart;
            if apart > self.apart.largest {
                (self.apart.largest, self.apart.at) = (apart, time);
            }
        }
    }

    fn finish(self) -> Apart {
        let rms = (self.sum / self.count.max(1.0)).sqrt();
        Apart { rms, ..self.apart }
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::columns;
    use super::*;

    const NAMES: [&str; 6] = ["step", "sub_tick", "state", "time", "x1", "compute_s"];

    fn row(step: f64, x: f64, compute: f64) -> [f64; 6] {
        [step, 0.0, 3.0, step * 0.01, x, compute]
    }

    fn matcher() -> Matcher {
        Matcher::new(&columns(&NAMES), &columns(&NAMES), 100).unwrap()
    }

    #[test]
    fn first_difference_is_named() {
        let mut m = matcher();
        for k in 0..50 {
            let x = f64::from(k);
            let other = if k < 30 { x } else { x + 0.5 };
            assert_eq!(m.take(&row(x, x, 1.0), &row(x, other, 2.0)), Next::Both);
        }
        let found = m.finish((0, 0));
        let first = found.first.unwrap();
        assert_eq!(
            (first.step, first.column.as_str(), first.values),
            (30, "x1", (30.0, 30.5))
        );
        let apart = found.apart.iter().find(|a| a.column.name == "x1").unwrap();
        assert_eq!(
            (apart.largest, apart.first, apart.size),
            (0.5, Some(30), 49.0)
        );
        // Twenty of fifty are 0.5 apart.
        assert!((apart.rms - f64::sqrt(0.25 * 20.0 / 50.0)).abs() < 1e-15);
        assert!(found.apart.iter().all(|a| a.column.name != "compute_s"));
        assert_eq!(found.tables[0].get("d:x1").unwrap()[49], 0.5);
    }

    #[test]
    fn one_bit_differs_and_two_gaps_do_not() {
        let mut m = matcher();
        m.take(&row(0.0, f64::NAN, 0.0), &row(0.0, -f64::NAN, 0.0));
        assert_eq!(m.first, [None, None]);
        m.take(
            &row(1.0, 1.0, 0.0),
            &row(1.0, f64::from_bits(1.0f64.to_bits() + 1), 0.0),
        );
        assert_eq!(m.first[0].as_ref().unwrap().step, 1);
        let mut m = matcher();
        m.take(&row(0.0, 1.0, 0.0), &row(0.0, f64::NAN, 0.0));
        assert_eq!(
            m.first[0].as_ref().unwrap().column,
            "x1",
            "a gap against a number is a difference"
        );
    }

    #[test]
    fn steps_missing_in_one_run_are_skipped() {
        let mut m = matcher();
        assert_eq!(
            m.take(&row(3.0, 0.0, 0.0), &row(5.0, 0.0, 0.0)),
            Next::First
        );
        assert_eq!(
            m.take(&row(5.0, 0.0, 0.0), &row(4.0, 0.0, 0.0)),
            Next::Second
        );
        assert_eq!(m.take(&row(5.0, 0.0, 0.0), &row(5.0, 0.0, 0.0)), Next::Both);
        let found = m.finish((2, 0));
        assert_eq!((found.rows, found.alone), (1, (3, 1)));
    }

    const OF_TICKS: [&str; 8] = [
        "step",
        "sub_tick",
        "state",
        "hold",
        "time",
        "x1",
        "force_1_1",
        "seq_1",
    ];

    /// Compares rows of two runs: step, tick in it, state and time, with the displacement of the last step, a force that follows
    /// the time, and the number of the command.
    fn matched(first: &[[f64; 4]], second: &[[f64; 4]]) -> Matched {
        let names = columns(&OF_TICKS);
        let mut m = Matcher::new(&names, &names, 100).unwrap();
        let rows = |of: &[[f64; 4]]| -> Vec<[f64; 8]> {
            let numbered = of.iter().enumerate();
            let row = |(number, &[step, tick, state, time]): (usize, &[f64; 4])| {
                let hold = f64::from(u8::from(state == 13.0));
                [
                    step,
                    tick,
                    state,
                    hold,
                    time,
                    step * step,
                    libm::sin(time),
                    number as f64,
                ]
            };
            numbered.map(row).collect()
        };
        let (first, second) = (rows(first), rows(second));
        let (mut i, mut j) = (0, 0);
        while i < first.len() && j < second.len() {
            let next = m.take(&first[i], &second[j]);
            i += usize::from(next != Next::Second);
            j += usize::from(next != Next::First);
        }
        m.finish(((first.len() - i) as u64, (second.len() - j) as u64))
    }

    /// Four steps of two ticks each, and in the second run a hold with its ramps in the third step.
    #[test]
    fn rows_match_by_time_despite_a_hold() {
        let straight: Vec<[f64; 4]> = (0..=8)
            .map(|k| {
                let (step, tick) = (f64::from(k / 2), f64::from(k % 2));
                let state = if tick == 0.0 { 3.0 } else { 11.0 };
                [step, tick, state, step + 0.5 * tick]
            })
            .collect();
        let mut held = straight.clone();
        let slow = [
            [2.0, 1.0, 13.0, 2.25],
            [2.0, 2.0, 13.0, 2.25],
            [2.0, 3.0, 13.0, 2.5],
            [2.0, 4.0, 13.0, 2.75],
            // It waits at its target.
            [2.0, 5.0, 13.0, 3.0],
        ];
        held.splice(5..6, slow);
        let found = matched(&straight, &held);
        assert_eq!((found.rows, found.alone), (9, (0, 4)));
        assert!(found.only_counts, "{:?}", found.first);
        let apart = |name: &str| found.apart.iter().find(|a| a.column.name == name).unwrap();
        assert_eq!(
            (apart("force_1_1").largest, apart("x1").largest),
            (0.0, 0.0)
        );
        assert_eq!(apart("seq_1").largest, 4.0);
        // Displacements where there is a new one, forces at every tick.
        let [steps, ticks] = &found.tables;
        assert_eq!(steps.get("time").unwrap(), [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(steps.get("a:x1").unwrap(), [0.0, 1.0, 4.0, 9.0, 16.0]);
        assert_eq!(ticks.get("a:force_1_1").unwrap().len(), 9);
        assert!(ticks.get("a:x1").is_none() && found.table_of("force_1_1") == Some(ticks));
        // The runs exchanged, and with a trip instead of a step.
        let back = matched(&held, &straight);
        assert_eq!((back.rows, back.alone), (9, (4, 0)));
        let mut tripped = straight[..7].to_vec();
        tripped[6][2] = TRIPPED;
        let found = matched(&straight, &tripped);
        assert_eq!((found.rows, found.alone), (7, (2, 0)));
        assert_eq!(found.first.unwrap().column, "state");
    }

    /// It has displacements, commands and measurements of its tick, and never an equilibrium.
    #[test]
    fn tripping_tick_may_lack_values() {
        const NAMES: [&str; 7] = ["step", "sub_tick", "state", "time", "x1", "v1", "a1"];
        let first = |state: f64, x: f64, [v, a]: [f64; 2]| {
            let mut m = Matcher::new(&columns(&NAMES), &columns(&NAMES), 9).unwrap();
            let went_on = [1.0, 0.0, RUNNING, 0.1, 1.0, 2.0, 3.0];
            m.take(&[1.0, 0.0, state, 0.1, x, v, a], &went_on);
            let found = m.finish((0, 0));
            (found.only_counts, found.first.map(|first| first.column))
        };
        let said = |only_counts: bool, column: &str| (only_counts, Some(column.to_owned()));
        let none = [f64::NAN; 2];
        assert_eq!(first(TRIPPED, 1.0, none), said(true, "state"));
        assert_eq!(first(TRIPPED, 1.5, none), said(false, "x1"));
        assert_eq!(first(RUNNING, 1.0, none), said(false, "v1"));
    }

    #[test]
    fn only_running_ticks_are_compared() {
        let m = matcher();
        let at = |state: f64, time: f64| [0.0, 0.0, state, time, 0.0, 0.0];
        let is_compared = |state: f64, time: f64| m.is_running(&at(state, time), &[], false);
        for state in [3.0, 11.0, 12.0, 13.0, 8.0] {
            assert!(is_compared(state, 0.5), "{state}");
        }
        for (state, time) in [(4.0, 0.0), (5.0, -1.0), (6.0, 1.0), (7.0, 1.0), (8.0, -1.0)] {
            assert!(!is_compared(state, time), "{state}");
        }
        // A trip whose row only repeats the last time, or an earlier one, as in older recordings.
        for (time, is_tick) in [(0.25, true), (0.2, false), (0.1, false)] {
            let found = m.is_running(&at(TRIPPED, time), &at(BETWEEN[0], 0.2), false);
            assert_eq!(found, is_tick, "{time}");
        }
    }

    #[test]
    fn unrelated_runs_are_not_matched() {
        assert!(
            Matcher::new(
                &columns(&NAMES),
                &columns(&["step", "sub_tick", "state", "time", "x2"]),
                9
            )
            .is_none()
        );
        assert!(Matcher::new(&columns(&NAMES), &columns(&["time", "x1"]), 9).is_none());
    }
}
