//! Are the times of a table uniform, and what is their step?
//!
//! Printed times are rounded: a column is uniform if one line t₀ + i Δt passes every time within half a unit of its last
//! printed digit. Where the step itself is about that unit, a missing row would pass, too: there, steps that differ must
//! recur at equal distances, as rounding makes them.

use super::{Print, RawTable};
use crate::error::MotionError;
use crate::unit::TimeUnit;

/// A column of uniform times.
pub(super) struct Axis {
    /// First time in s.
    pub(super) first: f64,
    /// Step in s.
    pub(super) dt: f64,
    /// Uncertainty of the step in s, where few unequal printed times leave it open.
    pub(super) doubt: Option<f64>,
}

/// Share of a step that it may be off without a word.
const KNOWN: f64 = 1e-3;

/// Halvings of the interval in the search for the step: beyond the digits of a double.
const MOST_HALVINGS: usize = 60;

/// A column of times in its unit.
pub(super) struct Times<'a> {
    file: &'a str,
    table: &'a RawTable,
    unit: TimeUnit,
    times: Vec<f64>,
    rounding: Rounding,
}

impl<'a> Times<'a> {
    pub(super) fn of(file: &'a str, table: &'a RawTable, column: usize, unit: TimeUnit) -> Self {
        let times: Vec<f64> = table.column(column).collect();
        let print = table.prints.get(column).copied().unwrap_or_default();
        Self {
            file,
            table,
            unit,
            rounding: Rounding::of_column(print, &times),
            times,
        }
    }

    fn line(&self, row: usize) -> usize {
        self.table.lines.get(row).copied().unwrap_or(row + 1)
    }

    fn broken(&self, row: usize, wanted: f64, found: f64) -> MotionError {
        MotionError::NotUniform {
            file: self.file.into(),
            line: self.line(row),
            wanted: self.unit.to_seconds(wanted),
            found: self.unit.to_seconds(found),
        }
    }

    /// The first time that falls, or that does not rise.
    fn fall(&self, strictly: bool) -> Option<MotionError> {
        let fall = move |pair: &[f64]| pair[1] < pair[0] || (!strictly && pair[1] == pair[0]);
        let row = self.times.windows(2).position(fall)? + 1;
        Some(MotionError::NotRising {
            file: self.file.into(),
            line: self.line(row),
            before: self.unit.to_seconds(self.times[row - 1]),
            found: self.unit.to_seconds(self.times[row]),
        })
    }

    /// The step, or the line that breaks it.
    pub(super) fn uniform(&self) -> Result<Axis, MotionError> {
        let times = &self.times;
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Err(MotionError::Empty {
                file: self.file.into(),
            });
        };
        if times.len() < 2 {
            return Err(MotionError::StepMissing {
                file: self.file.into(),
            });
        }
        // Print may make later times equal, never earlier.
        if let Some(error) = self.fall(true) {
            return Err(error);
        }
        let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut sorted = steps.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted[sorted.len() / 2];
        self.without_gaps(&steps, median)?;
        let intervals = (times.len() - 1) as f64;
        let mean = (last - first) / intervals;
        if mean == 0.0
            && let Some(error) = self.fall(false)
        {
            return Err(error);
        }
        if !(mean > 0.0 && mean.is_finite()) {
            return Err(self.broken(1, mean, steps[0]));
        }
        let slack = (self.rounding.of(first) + self.rounding.of(last)) / intervals;
        let dt = self
            .step(mean, slack)
            .ok_or_else(|| self.worst(&steps, median, mean))?;
        let is_odd = |step: &f64| {
            (step - median).abs() > 2.0 * self.rounding.by_digits(last) + KNOWN * median
        };
        // Where print repeats times, a missing row may hide in it.
        let repeats = self.rounding.of(last) >= mean;
        let is_doubtful = (slack > KNOWN * mean || repeats) && steps.iter().any(is_odd);
        Ok(Axis {
            first: self.unit.to_seconds(first),
            dt,
            doubt: is_doubtful.then(|| self.unit.to_seconds(slack)),
        })
    }

    /// Refuses a step that a missing or a doubled row makes.
    fn without_gaps(&self, steps: &[f64], median: f64) -> Result<(), MotionError> {
        // Rounding moves a step of two printed units and more by half of itself at most.
        let share = 0.6 * median.abs();
        let odd: Vec<usize> = (1..)
            .zip(steps.iter().zip(self.times.windows(2)))
            .filter(|(_, (step, pair))| {
                let slack = self.rounding.by_digits(pair[0]) + self.rounding.by_digits(pair[1]);
                (*step - median).abs() > slack + share.max(KNOWN * median.abs())
            })
            .map(|(row, _)| row)
            .collect();
        // The median names the one line that is off, where the mean would blame them all.
        let mostly_equal = 4 * odd.len() <= steps.len();
        match odd.first() {
            Some(&row) if mostly_equal && !recurs(&odd) => {
                Err(self.broken(row, median, steps[row - 1]))
            }
            _ => Ok(()),
        }
    }

    /// The step in s that a person meant: a whole rate or a short decimal if one passes all times, else any that does.
    fn step(&self, mean: f64, slack: f64) -> Option<f64> {
        let passes = |step: &f64| self.passes(step, mean).is_ok();
        // Times that need no rounding to be uniform have the step that is printed.
        let exact = self.exactness();
        let (_, off) = self.departure(self.times[0], mean);
        let slack = if off <= exact {
            exact / (self.times.len() - 1) as f64
        } else {
            slack
        };
        let near = |step: f64| {
            let (seconds, tolerance) = (self.unit.to_seconds(step), self.unit.to_seconds(slack));
            plain(seconds, tolerance).find(|dt| passes(&self.unit.of_seconds(*dt)))
        };
        near(mean).or_else(|| {
            let step = self.bisected(mean, slack)?;
            near(step).or_else(|| Some(self.unit.to_seconds(step)))
        })
    }

    /// Some step that passes all times, at most `slack` from their mean step.
    fn bisected(&self, mean: f64, slack: f64) -> Option<f64> {
        let (mut low, mut high) = (mean - slack, mean + slack);
        for _ in 0..MOST_HALVINGS {
            let step = 0.5 * (low + high);
            match self.passes(&step, mean) {
                Ok(()) => return Some(step),
                Err(Side::TooLong) => high = step,
                Err(Side::TooShort) => low = step,
            }
        }
        None
    }

    /// Rounding error of a time held as a double, including the arithmetic of this module.
    fn exactness(&self) -> f64 {
        let ends = [self.times.first(), self.times.last()];
        let largest = ends
            .into_iter()
            .flatten()
            .fold(0.0, |m: f64, t| m.max(t.abs()));
        4.0 * f64::EPSILON * largest
    }

    /// True of a step with which one line passes all times; else on which side of it a better one is.
    fn passes(&self, step: &f64, mean: f64) -> Result<(), Side> {
        // Where the line may begin: the latest of all earliest, the earliest of all latest, and whose they are.
        let (mut low, mut high) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
        for (row, time) in self.times.iter().enumerate() {
            let slack = self.rounding.of(*time) + KNOWN * mean;
            let start = time - step * row as f64;
            if start - slack > low.0 {
                low = (start - slack, row);
            }
            if start + slack < high.0 {
                high = (start + slack, row);
            }
        }
        match low.0 <= high.0 {
            true => Ok(()),
            // The line must rise more slowly to pass above an early row and below a late one.
            false if low.1 < high.1 => Err(Side::TooLong),
            false => Err(Side::TooShort),
        }
    }

    /// The line that departs most visibly from uniform times.
    fn worst(&self, steps: &[f64], median: f64, mean: f64) -> MotionError {
        let first = self.times[0];
        let is_jump = |row: &usize| {
            let slack = self.rounding.of(self.times[*row]) + self.rounding.of(self.times[row - 1]);
            (steps[row - 1] - median).abs() > 2.0 * (slack + KNOWN * mean)
        };
        if let Some(row) = (1..self.times.len()).find(is_jump) {
            return self.broken(row, median, steps[row - 1]);
        }
        let (row, _) = self.departure(first, mean);
        self.broken(row, first + mean * row as f64, self.times[row])
    }

    /// The row that departs most from a line, and by how much.
    fn departure(&self, first: f64, step: f64) -> (usize, f64) {
        let off = |(row, time): (usize, &f64)| (row, (time - first - step * row as f64).abs());
        let all = self.times.iter().enumerate().map(off);
        all.fold(
            (0, 0.0),
            |most, one| if one.1 > most.1 { one } else { most },
        )
    }

    /// The line whose time departs most from the step `dt` in s, and by how many seconds.
    pub(super) fn departure_from(&self, dt: f64) -> (usize, f64) {
        let first = self.times.first().copied().unwrap_or(0.0);
        let (row, off) = self.departure(first, self.unit.of_seconds(dt));
        (self.line(row), self.unit.to_seconds(off))
    }
}

/// Where a step is wrong.
#[derive(Debug)]
enum Side {
    TooLong,
    TooShort,
}

/// True if the rows recur at distances that differ by two at most, at least three times. Half units are rounded to even
/// digits by some and up by others, so that each row may be off by one.
fn recurs(rows: &[usize]) -> bool {
    let gaps = || rows.windows(2).map(|pair| pair[1] - pair[0]);
    match (gaps().min(), gaps().max(), rows.first()) {
        (Some(least), Some(most), Some(first)) => {
            rows.len() >= 3 && most - least <= 2 && *first <= most + 1
        }
        _ => false,
    }
}

/// What rounding can have done to a time, in print or in single precision.
struct Rounding {
    print: Print,
    is_single: bool,
}

impl Rounding {
    fn of_column(print: Print, times: &[f64]) -> Self {
        let printed = Self {
            print,
            is_single: false,
        };
        let is_single = times.iter().all(|time| {
            let single = f64::from(*time as f32);
            (single - time).abs() <= printed.of(*time)
        });
        Self { print, is_single }
    }

    /// Half a unit of the last digit, or a whole one of single precision.
    fn of(&self, value: f64) -> f64 {
        let printed = (0.5 * power_of_ten(-self.print.decimals)).max(self.by_digits(value));
        if self.is_single {
            printed.max(value.abs() * f64::from(f32::EPSILON))
        } else {
            printed
        }
    }

    /// Half a unit of the last significant digit, where these and not the decimals limit the print; else 0.
    fn by_digits(&self, value: f64) -> f64 {
        let size = value.abs();
        if size == 0.0 {
            return 0.0;
        }
        let leading = libm::floor(libm::log10(size)) as i32;
        let unit = power_of_ten(leading + 1 - self.print.digits);
        if unit > 1.5 * power_of_ten(-self.print.decimals) {
            0.5 * unit
        } else {
            0.0
        }
    }
}

fn power_of_ten(power: i32) -> f64 {
    libm::pow(10.0, f64::from(power.clamp(-300, 300)))
}

/// The numbers a person may have meant by `dt`, known to ± `slack`: a whole rate, the shortest decimals, itself.
fn plain(dt: f64, slack: f64) -> impl Iterator<Item = f64> {
    let slack = slack.max(4.0 * f64::EPSILON * dt);
    let whole_rate = 1.0 / (1.0 / dt).round();
    let decimals =
        (0..12).filter_map(move |digits: usize| format!("{dt:.digits$e}").parse::<f64>().ok());
    std::iter::once(whole_rate)
        .chain(decimals)
        .filter(move |found| (found - dt).abs() <= slack)
        .chain([dt])
}
