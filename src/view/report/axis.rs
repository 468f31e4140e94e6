//! One axis of a chart: its range, the place of a value on it, and the places of its ticks.
//!
//! Invariant: `lo < hi`, both finite, and for a logarithmic axis both positive; so [`Axis::place`] never
//! divides by zero. Numbers too large to take differences of are treated like NaN: they are gaps.

use super::text::{fixed, number};

/// Digits of a logarithmic axis that have a label: the first row that gives enough of them.
const NAMED: [&[i32]; 4] = [
    &[1],
    &[1, 2, 5],
    &[1, 2, 3, 4, 5, 6, 8],
    &[1, 2, 3, 4, 5, 6, 7, 8, 9],
];
/// So few labels are too few to read an axis by.
const FEWEST: usize = 3;

/// Most decimals of a small number on an axis.
const DECIMALS: i32 = 6;

/// Numbers beyond this are not drawn: a diverged test reaches them, and their differences overflow.
const LARGEST: f64 = 1e290;

/// True if `value` can be drawn.
pub(super) fn is_drawable(value: f64) -> bool {
    value.abs() < LARGEST
}

/// A linear or logarithmic range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    lo: f64,
    hi: f64,
    log: bool,
}

/// One tick mark.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    /// Value in the units of the axis.
    pub at: f64,
    /// Text; empty for a minor tick.
    pub label: String,
}

impl Axis {
    /// From `lo` to `hi` and no further; none if there is nothing to show.
    pub(crate) fn exactly(lo: f64, hi: f64) -> Option<Self> {
        if !(is_drawable(lo) && is_drawable(hi) && lo <= hi) {
            return None;
        }
        let size = lo.abs().max(hi.abs());
        // Ticks closer than a billionth of the numbers themselves could not be labelled.
        if hi - lo > 1e-9 * size {
            return Some(Self { lo, hi, log: false });
        }
        let pad = if size > 0.0 { 0.05 * size } else { 1.0 };
        Some(Self {
            lo: lo - pad,
            hi: hi + pad,
            log: false,
        })
    }

    /// Over all drawable `values`, with a little air at both ends.
    pub(crate) fn around(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (lo, hi) = extent(values)?;
        let Self { lo, hi, log } = Self::exactly(lo, hi)?;
        let air = 0.06 * (hi - lo);
        Some(Self {
            lo: lo - air,
            hi: hi + air,
            log,
        })
    }

    /// A logarithmic axis from `lo` to `hi`.
    pub(crate) fn logarithmic(lo: f64, hi: f64) -> Option<Self> {
        (lo > 0.0 && hi < LARGEST && lo < hi).then_some(Self { lo, hi, log: true })
    }

    /// A logarithmic axis over all positive `values`, with a little air.
    pub(crate) fn logarithmic_around(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (lo, hi) = extent(values.filter(|&v| v > 0.0))?;
        Self::logarithmic(lo / 1.5, hi * 2.0)
    }

    /// Lower end.
    pub(crate) const fn lo(&self) -> f64 {
        self.lo
    }

    /// Upper end.
    pub(crate) const fn hi(&self) -> f64 {
        self.hi
    }

    /// Relative place of `value`: 0 at the lower end, 1 at the upper; outside at most ten lengths away.
    pub(crate) fn share(&self, value: f64) -> f64 {
        let share = if self.log {
            let (lo, hi) = (libm::log10(self.lo), libm::log10(self.hi));
            (libm::log10(value.max(1e-300)) - lo) / (hi - lo)
        } else {
            (value - self.lo) / (self.hi - self.lo)
        };
        share.clamp(-10.0, 10.0)
    }

    /// As [`Self::share`]; values outside stop at the end.
    pub(crate) fn place(&self, value: f64) -> f64 {
        self.share(value).clamp(0.0, 1.0)
    }

    /// True if `value` lies on the axis.
    pub(crate) fn holds(&self, value: f64) -> bool {
        value >= self.lo && value <= self.hi
    }

    /// About `about` ticks at 1, 2 or 5 times a power of ten, labelled in units of `factor`.
    pub(crate) fn ticks(&self, about: usize, factor: f64) -> Vec<Tick> {
        let (lo, hi) = (self.lo / factor, self.hi / factor);
        let step = round_step((hi - lo) / about.max(1) as f64);
        let exponent = libm::floor(libm::log10(step) + 1e-9) as i32;
        let largest = libm::floor(libm::log10(lo.abs().max(hi.abs()))) as i32;
        // Digits enough to distinguish one tick from the next; long rows of zeros are written as powers.
        let label = |at: f64| {
            if exponent >= -DECIMALS || largest >= 0 {
                fixed(at, (-exponent).clamp(0, 12) as usize)
            } else if at.abs() < 0.5 * step {
                "0".to_owned()
            } else {
                number(at, (largest - exponent).max(0) as usize + 1)
            }
        };
        let first = (lo / step).ceil();
        (0..4 * about.max(1))
            .map(|k| (first + k as f64) * step)
            .take_while(|at| *at <= hi + 1e-4 * (hi - lo))
            .map(|at| Tick {
                at: at * factor,
                label: label(at),
            })
            .collect()
    }

    /// Ticks of a logarithmic axis: decades labelled by `label` (digit and exponent), the numbers between them unlabelled. Where
    /// that would leave fewer than three labels, 2 and 5 have one, too, and in the end every digit.
    pub(crate) fn decades(&self, label: impl Fn(i32, i32) -> String) -> Vec<Tick> {
        let first = libm::floor(libm::log10(self.lo)) as i32;
        let last = libm::ceil(libm::log10(self.hi)) as i32;
        let every = ((last - first) / 9).max(0) + 1;
        let mut ticks = Vec::new();
        for decade in first..=last.min(first + 600) {
            for digit in 1..10 {
                let at = f64::from(digit) * libm::pow(10.0, f64::from(decade));
                if self.holds(at) {
                    ticks.push((digit, decade, at));
                }
            }
        }
        let named = |(digit, decade, _): &(i32, i32, f64), digits: &[i32]| {
            digits.contains(digit) && (decade - first) % every == 0
        };
        let enough = |digits: &&&[i32]| ticks.iter().filter(|t| named(t, digits)).count() >= FEWEST;
        let digits = NAMED.iter().find(enough).unwrap_or(&NAMED[NAMED.len() - 1]);
        let made = ticks.iter().map(|tick| Tick {
            at: tick.2,
            label: if named(tick, digits) {
                label(tick.0, tick.1)
            } else {
                String::new()
            },
        });
        made.collect()
    }
}

/// Smallest and largest drawable value.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .filter(|&v| is_drawable(v))
        .fold(None, |found, v| match found {
            None => Some((v, v)),
            Some((lo, hi)) => Some((v.min(lo), v.max(hi))),
        })
}

/// "100", "0.02", and powers where zeros would have to be counted.
pub(super) fn decade(digit: i32, exponent: i32) -> String {
    if (-3..=4).contains(&exponent) {
        let decimals = usize::try_from(-exponent).unwrap_or(0);
        let value = f64::from(digit) * libm::pow(10.0, f64::from(exponent));
        return fixed(value, decimals);
    }
    let raised = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        // The others follow each other.
        digit => char::from_u32(0x2070 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    };
    let exponent: String = exponent.to_string().chars().map(raised).collect();
    match digit {
        1 => format!("10{exponent}"),
        digit => format!("{digit}·10{exponent}"),
    }
}

fn round_step(raw: f64) -> f64 {
    if !(raw > 0.0 && raw.is_finite()) {
        return 1.0;
    }
    let decade = libm::pow(10.0, libm::floor(libm::log10(raw)));
    let digit = match raw / decade {
        d if d <= 1.5 => 1.0,
        d if d <= 3.2 => 2.0,
        d if d <= 7.5 => 5.0,
        _ => 10.0,
    };
    let step = digit * decade;
    if step > 0.0 && step.is_finite() {
        step
    } else {
        raw
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn axis_ticks_are_round_numbers() {
        let axis = Axis::exactly(-0.013, 0.021).unwrap();
        let labels: Vec<_> = axis.ticks(4, 1e-3).into_iter().map(|t| t.label).collect();
        assert_eq!(labels, ["−10", "0", "10", "20"]);
        let axis = Axis::exactly(0.0, 0.9).unwrap();
        let labels: Vec<_> = axis.ticks(4, 1.0).into_iter().map(|t| t.label).collect();
        assert_eq!(labels, ["0.0", "0.2", "0.4", "0.6", "0.8"]);
        // Numbers that would be a row of zeros are written as powers.
        let axis = Axis::exactly(0.0, 4e-13).unwrap();
        let labels: Vec<_> = axis.ticks(4, 1.0).into_iter().map(|t| t.label).collect();
        assert_eq!(labels, ["0", "1e−13", "2e−13", "3e−13", "4e−13"]);
        // A record of whole seconds ends one sample before the last of them.
        let axis = Axis::exactly(0.0, 39.999).unwrap();
        assert_eq!(axis.ticks(4, 1.0).last().unwrap().label, "40");
    }

    #[test]
    fn constant_data_still_have_a_range() {
        let axis = Axis::around([3.0, 3.0].into_iter()).unwrap();
        assert!(axis.lo() < 3.0 && axis.hi() > 3.0);
        assert!(Axis::around([0.0].into_iter()).is_some());
        assert_eq!(Axis::around([f64::NAN, f64::INFINITY].into_iter()), None);
        assert_eq!(Axis::logarithmic_around([0.0, -1.0].into_iter()), None);
    }

    #[test]
    fn long_decades_are_powers() {
        assert_eq!(
            [-12, -3, 0, 4, 5].map(|e| decade(1, e)),
            ["10⁻¹²", "0.001", "1", "10\u{202f}000", "10⁵"]
        );
        assert_eq!(decade(2, 0), "2");
    }

    #[test]
    fn short_log_axis_has_enough_labels() {
        let labels = |lo: f64, hi: f64| -> Vec<String> {
            let ticks = Axis::logarithmic(lo, hi).unwrap().decades(decade);
            let named = ticks.into_iter().filter(|t| !t.label.is_empty());
            named.map(|t| t.label).collect()
        };
        // Two decades have three ends, one and a half have not.
        assert_eq!(labels(1.0, 100.0), ["1", "10", "100"]);
        assert_eq!(labels(0.7, 60.0), ["1", "2", "5", "10", "20", "50"]);
        assert_eq!(labels(1.5, 8.0), ["2", "3", "4", "5", "6", "8"]);
        assert_eq!(labels(40.0, 150.0), ["40", "50", "60", "80", "100"]);
        assert_eq!(labels(55.0, 95.0), ["60", "70", "80", "90"]);
    }

    proptest! {
        #[test]
        fn every_axis_has_few_ticks_in_range(a in -1e200f64..1e200, b in -1e200f64..1e200, about in 2usize..9) {
            let axis = Axis::around([a, b].into_iter()).unwrap();
            let ticks = axis.ticks(about, 1.0);
            prop_assert!(ticks.len() <= 4 * about);
            for tick in ticks {
                prop_assert!((-1e-6..=1.000_2).contains(&((tick.at - axis.lo()) / (axis.hi() - axis.lo()))));
            }
        }
    }
}
