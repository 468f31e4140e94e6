//! From samples at one step to values at another, and their rates of change.
//!
//! * `linear`: straight lines between samples; exact at the samples. It keeps the peaks of a finer grid and folds what
//!   lies above the Nyquist frequency of a coarser one.
//! * `band_limited`: a sinc of half-width 32 samples under Nuttall's window (1981, four terms, continuous first
//!   derivative), its sum normalised to one. A sine up to 0.85 of the Nyquist frequency of the samples comes back to
//!   1e-5 of its amplitude A away from the ends of the record (1e-6 up to a half), and its derivative, which is that of
//!   the same kernel, to 1e-5 of A π / dt. Where the new grid is coarser than the samples the kernel is stretched, so
//!   that what the grid cannot carry is removed rather than folded.
//!
//! Outside the samples a signal is zero. Nothing here runs during a test.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Grid;

/// Interpolation between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Resample {
    /// Straight lines between samples.
    #[default]
    Linear,
    /// Windowed sinc interpolation, which preserves the spectrum.
    BandLimited,
}

/// Half-width of the kernel in samples.
pub(super) const HALF_WIDTH: f64 = 32.0;

/// Nuttall's four-term window with continuous first derivative, −93 dB, falling by 18 dB an octave.
const WINDOW: [f64; 4] = [0.355_768, 0.487_396, 0.144_232, 0.012_604];

/// Samples `values` at 0, `dt`, 2 `dt` … (s) laid on `grid`: `grid.steps() + 1` values, zero outside the samples.
#[must_use]
pub fn resample(values: &[f64], dt: f64, grid: Grid, method: Resample) -> Vec<f64> {
    let last = values.len().saturating_sub(1) as f64;
    let kernel = Kernel::new(dt, grid.dt());
    grid.times()
        .map(|time| {
            let at = snapped(time / dt);
            if values.is_empty() || at > last {
                0.0
            } else {
                match method {
                    Resample::Linear => linear(values, at),
                    Resample::BandLimited => kernel.value_and_slope(values, at).0,
                }
            }
        })
        .collect()
}

/// Rate of change of values `dt` apart by central differences, (x₊ − x₋) / 2 dt, and by (−3, 4, −1) / 2 dt at the
/// ends: of second order throughout.
#[must_use]
pub fn central_difference(values: &[f64], dt: f64) -> Vec<f64> {
    match values {
        [] => Vec::new(),
        [_] => vec![0.0],
        [a, b] => vec![(b - a) / dt; 2],
        _ => {
            let n = values.len();
            let mut rates = Vec::with_capacity(n);
            rates.push((4.0 * values[1] - 3.0 * values[0] - values[2]) / (2.0 * dt));
            rates.extend(values.windows(3).map(|w| (w[2] - w[0]) / (2.0 * dt)));
            rates.push((3.0 * values[n - 1] - 4.0 * values[n - 2] + values[n - 3]) / (2.0 * dt));
            rates
        }
    }
}

/// A position in samples, put on the sample if rounding alone keeps it off.
pub(super) fn snapped(at: f64) -> f64 {
    let whole = at.round();
    if (at - whole).abs() <= 1e-9 + 4.0 * f64::EPSILON * whole.abs() {
        whole
    } else {
        at
    }
}

/// Straight line between the neighbours of position `at`, which lies inside the samples.
pub(super) fn linear(values: &[f64], at: f64) -> f64 {
    let below = at.floor();
    let index = below as usize;
    let fraction = at - below;
    let left = values.get(index).copied().unwrap_or(0.0);
    if fraction == 0.0 {
        return left;
    }
    let right = values.get(index + 1).copied().unwrap_or(0.0);
    left + fraction * (right - left)
}

/// The windowed sinc, stretched by 1 / `cutoff`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kernel {
    /// Share of the samples' band that passes, (0, 1].
    cutoff: f64,
}

impl Kernel {
    /// For samples `from` seconds apart that go to a grid of `to` seconds.
    pub(super) fn new(from: f64, to: f64) -> Self {
        Self {
            // Equal steps up to rounding pass everything.
            cutoff: if from >= to * (1.0 - 1e-9) {
                1.0
            } else {
                from / to
            },
        }
    }

    /// For a signal without frequencies above the band of the grid: sampled without a filter.
    pub(super) const fn without_filter() -> Self {
        Self { cutoff: 1.0 }
    }

    /// Value at position `at` (in samples) and slope per sample.
    pub(super) fn value_and_slope(self, values: &[f64], at: f64) -> (f64, f64) {
        let reach = HALF_WIDTH / self.cutoff;
        let first = (at - reach).ceil();
        let taps = ((at + reach).floor() - first) as usize + 1;
        // Distance from the first tap; each further tap lies one sample nearer, then beyond.
        let start = at - first;
        let mut carrier = Rotation::new(PI * self.cutoff, start);
        let mut window = Rotation::new(PI * self.cutoff / HALF_WIDTH, start);
        let (mut sum, mut slope_sum) = (0.0, 0.0);
        let (mut weight, mut slope_weight) = (0.0, 0.0);
        for tap in 0..taps {
            let distance = start - tap as f64;
            let (h, slope) = self.tap(distance, carrier.at(tap), window.at(tap));
            weight += h;
            slope_weight += slope;
            let index = first + tap as f64;
            if index >= 0.0
                && let Some(value) = values.get(index as usize)
            {
                sum += h * value;
                slope_sum += slope * value;
            }
        }
        // On a sample all other weights are zero but for rounding.
        let is_sample = self.cutoff == 1.0 && at.fract() == 0.0 && at >= 0.0;
        let sample = values.get(at as usize).filter(|_| is_sample).copied();
        let value = sample.unwrap_or(sum / weight);
        (value, (slope_sum - value * slope_weight) / weight)
    }

    /// Weight of a sample at `distance` and its derivative by the distance.
    fn tap(self, distance: f64, carrier: (f64, f64), window: (f64, f64)) -> (f64, f64) {
        let z = self.cutoff * distance;
        let (sinc, sinc_slope) = if z.abs() < 1e-4 {
            // Series: sinc z = 1 − (πz)²/6, the next term is below 1e-15.
            (1.0 - PI * PI * z * z / 6.0, -PI * PI * z / 3.0)
        } else {
            let (sine, cosine) = if z.abs() < 1.0 {
                libm::sincos(PI * z)
            } else {
                carrier
            };
            let sinc = sine / (PI * z);
            (sinc, (cosine - sinc) / z)
        };
        let (s1, c1) = window;
        let (s2, c2) = (2.0 * s1 * c1, 2.0 * c1 * c1 - 1.0);
        let (s3, c3) = (s1 * (4.0 * c1 * c1 - 1.0), c1 * (4.0 * c1 * c1 - 3.0));
        let w = WINDOW[0] + WINDOW[1] * c1 + WINDOW[2] * c2 + WINDOW[3] * c3;
        let w_slope = -PI * self.cutoff / HALF_WIDTH
            * (WINDOW[1] * s1 + 2.0 * WINDOW[2] * s2 + 3.0 * WINDOW[3] * s3);
        (sinc * w, self.cutoff * sinc_slope * w + sinc * w_slope)
    }
}

/// Sine and cosine of `rate · (start − tap)` for tap = 0, 1, 2 …, by rotation, set right every 64 taps.
struct Rotation {
    rate: f64,
    start: f64,
    turn: (f64, f64),
    now: (f64, f64),
}

impl Rotation {
    fn new(rate: f64, start: f64) -> Self {
        Self {
            rate,
            start,
            turn: libm::sincos(rate),
            now: (0.0, 1.0),
        }
    }

    fn at(&mut self, tap: usize) -> (f64, f64) {
        let (sine, cosine) = self.now;
        let (turn_sine, turn_cosine) = self.turn;
        self.now = if tap.is_multiple_of(64) {
            libm::sincos(self.rate * (self.start - tap as f64))
        } else {
            (
                sine * turn_cosine - cosine * turn_sine,
                cosine * turn_cosine + sine * turn_sine,
            )
        };
        self.now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(dt: f64, steps: usize) -> Grid {
        Grid::new(dt, steps).unwrap()
    }

    #[test]
    fn linear_resampling_is_exact_at_samples() {
        let values = [0.0, 1.0, -3.0, 0.5, 2.0];
        // 0.02 / 0.005 = 4 up to rounding: every fourth value is a sample, to the bit.
        let fine = resample(&values, 0.02, grid(0.005, 16), Resample::Linear);
        for (i, value) in values.iter().enumerate() {
            assert_eq!(fine[4 * i], *value);
        }
        // Two roundings of numbers below 3.
        assert!((fine[6] - (-1.0)).abs() < 1e-14, "{}", fine[6]);
        assert!((fine[5] - 0.0).abs() < 1e-14, "{}", fine[5]);
    }

    #[test]
    fn samples_match_to_the_bit_at_odd_steps() {
        let values: Vec<f64> = (0..5000).map(|i| f64::from(i * i % 97)).collect();
        for method in [Resample::Linear, Resample::BandLimited] {
            let fine = resample(&values[..300], 0.01, grid(0.001, 2990), method);
            for i in 0..300 {
                // The kernel is zero at other samples up to sin(πk) ≈ k·1e-16, times 64 values of 97.
                assert!((fine[10 * i] - values[i]).abs() < 1e-11, "{method:?} {i}");
            }
        }
        let fine = resample(&values, 0.01, grid(0.001, 49_990), Resample::Linear);
        assert!(values.iter().enumerate().all(|(i, v)| fine[10 * i] == *v));
    }

    #[test]
    fn beyond_the_samples_there_is_nothing() {
        for method in [Resample::Linear, Resample::BandLimited] {
            let long = resample(&[1.0; 11], 0.1, grid(0.05, 40), method);
            assert!(long[..=20].iter().all(|v| v.abs() > 0.4));
            assert!(long[21..].iter().all(|v| *v == 0.0));
            assert!(
                resample(&[], 0.1, grid(0.05, 4), method)
                    .iter()
                    .all(|v| *v == 0.0)
            );
        }
    }

    /// Largest errors of value and slope against a sine of `share` of the Nyquist frequency, away from the ends.
    fn errors(share: f64, cutoff: f64) -> (f64, f64) {
        let omega = PI * share;
        let values: Vec<f64> = (0..600)
            .map(|i| libm::sin(omega * f64::from(i) + 0.3))
            .collect();
        let kernel = Kernel { cutoff };
        let margin = HALF_WIDTH / cutoff + 1.0;
        let mut worst = (0.0_f64, 0.0_f64);
        let mut at = margin;
        while at < 599.0 - margin {
            let (value, slope) = kernel.value_and_slope(&values, at);
            worst.0 = worst.0.max((value - libm::sin(omega * at + 0.3)).abs());
            worst.1 = worst
                .1
                .max((slope / omega - libm::cos(omega * at + 0.3)).abs());
            at += 0.137;
        }
        worst
    }

    #[test]
    fn sine_below_nyquist_keeps_its_slope() {
        // The window's side lobes lie at −93 dB = 2.2e-5 of its sum; a share of them leaks. The slope is measured in what
        // a sine at the Nyquist frequency has, π per sample.
        for share in [0.001, 0.01, 0.1, 0.25, 0.5, 0.75, 0.8, 0.85] {
            let (value, slope) = errors(share, 1.0);
            assert!(value < 1e-5, "{share}: {value:e}");
            assert!(slope * share < 1e-5, "{share}: {slope:e}");
            // Up to a half, where our own synthetic motions live, the far side lobes are all that is left.
            if share <= 0.5 {
                assert!(value < 1e-6 && slope * share < 1e-6, "{share}: {value:e}");
            }
        }
        // The claim ends where the transition band begins.
        assert!(errors(0.95, 1.0).0 > 1e-3);
    }

    #[test]
    fn coarse_grid_loses_high_frequencies() {
        // Four samples to a step: frequencies below 0.85 / 4 of the samples' Nyquist frequency stay. Frequencies above
        // (2 − 0.85) / 4 would be folded and are removed.
        let cutoff = 0.25;
        assert!(errors(0.85 * cutoff, cutoff).0 < 1e-5);
        let omega = PI * 1.15 * cutoff;
        let values: Vec<f64> = (0..2000).map(|i| libm::sin(omega * f64::from(i))).collect();
        let kernel = Kernel::new(0.005, 0.02);
        for step in 40..450 {
            let (value, _) = kernel.value_and_slope(&values, 4.0 * f64::from(step));
            assert!(value.abs() < 1e-5, "{value:e}");
        }
    }

    #[test]
    fn central_differences_suit_a_parabola() {
        let (a, b, c, dt) = (0.3, -2.0, 5.0, 0.01);
        let x = |t: f64| a + b * t + c * t * t;
        let values: Vec<f64> = (0..30).map(|i| x(f64::from(i) * dt)).collect();
        for (i, rate) in central_difference(&values, dt).iter().enumerate() {
            let exact = b + 2.0 * c * i as f64 * dt;
            // Values below 1, each to 1e-16, over 2 dt.
            assert!((rate - exact).abs() < 1e-13, "{i}: {rate} {exact}");
        }
        assert_eq!(central_difference(&[1.0], 0.1), [0.0]);
        assert_eq!(central_difference(&[1.0, 2.0], 0.5), [2.0, 2.0]);
    }
}
