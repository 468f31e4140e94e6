//! From an acceleration to a displacement that a table or a support can follow.
//!
//! Of all displacements d that begin and end at rest at zero, the one is taken that makes ∫ (d̈ − a)² dt + ω_c⁴ ∫ d² dt least. Away
//! from the ends it is the acceleration behind a high-pass with the gain f⁴/(f⁴ + f_c⁴) and no phase, that of a Butterworth
//! filter of second order forward and backward: half at the corner f_c. At the ends nothing is padded and nothing jumps.
//!
//! The condition is d̈ = a + ω_c² p with p̈ = −ω_c² d. Here a and p are straight lines between the samples, so d is a cubic on each
//! interval and the exact integral of the acceleration. Block elimination solves for d and p at all samples. The corner is the lowest
//! at which d stays within the stroke, found by steps of a quarter and then by bisection. Nothing here runs during a test.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, Short, positive};
use super::metrics::spectrum::{response_spectrum, turning_point};

/// Displacement from an acceleration, within a stroke.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Largest displacement from zero, in m of the motion. A high-pass keeps the displacement within it.
    #[schemars(example = 0.15)]
    pub stroke_m: f64,
}

/// How an acceleration became a displacement.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected {
    /// Corner frequency in Hz.
    pub corner_hz: f64,
    /// Largest displacement in m that is allowed.
    pub stroke: f64,
    /// Largest displacement in m, velocity in m/s, and acceleration in m/s².
    pub peaks: [f64; 3],
    /// Largest acceleration of the record in m/s², scaled.
    pub peak_before: f64,
    /// Natural period in s, and pseudo-spectral acceleration with 5 % damping before and after, in m/s².
    pub spectrum: Vec<[f64; 3]>,
}

/// Displacement, velocity and acceleration at equal times, the first and last at rest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Travel {
    dt: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    accel: Vec<f64>,
}

/// Periods in s at which spectra before and after are compared.
const PERIODS: [f64; 7] = [0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Damping ratio of these spectra.
const RATIO: f64 = 0.05;
/// Lowest corner, in cycles of the record. The ends at rest decide alone what is lower.
const LEAST_CYCLES: f64 = 0.1;
/// Highest corner, in parts of the sampling frequency.
const MOST_CORNER: f64 = 0.05;
/// Factor from corner to corner until the displacement is within the stroke.
const STRIDE: f64 = 1.25;
/// Steps of the bisection.
const HALVINGS: u32 = 40;

impl Stroke {
    /// The displacement of an acceleration (m/s²) sampled every `dt` s, and what became of it.
    ///
    /// # Errors
    /// [`MotionError::Parameter`] for a stroke that no corner keeps.
    pub(crate) fn travel(self, accel: &[f64], dt: f64) -> Result<(Travel, Corrected), MotionError> {
        let stroke = positive("stroke_m", self.stroke_m)?;
        if accel.len() < 4 {
            return Err(MotionError::Length {
                what: "record of a displacement",
                wanted: 4,
                found: accel.len(),
            });
        }
        let least = LEAST_CYCLES / (dt * (accel.len() - 1) as f64);
        let most = MOST_CORNER / dt;
        let of = |corner: f64| Travel::behind(corner, accel, dt);
        let (mut corner, mut travel) = (least, of(least));
        let mut beyond = None;
        while travel.peak() > stroke {
            beyond = Some(corner);
            corner *= STRIDE;
            if corner > most {
                return Err(MotionError::Scaling {
                    key: "stroke_m",
                    why: format!(
                        "`stroke_m` is {} m: no corner frequency up to {} Hz keeps the motion within it",
                        Short(stroke),
                        Short(most)
                    ),
                });
            }
            travel = of(corner);
        }
        if let Some(mut beyond) = beyond {
            for _ in 0..HALVINGS {
                let middle = (beyond * corner).sqrt();
                let tried = of(middle);
                if tried.peak() > stroke {
                    beyond = middle;
                } else {
                    (corner, travel) = (middle, tried);
                }
            }
        }
        let largest = |values: &[f64]| values.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let span = dt * accel.len() as f64;
        let periods = PERIODS
            .into_iter()
            .filter(|period| (4.0 * dt..=span).contains(period));
        let periods: Vec<f64> = periods.collect();
        let [before, after] =
            [accel, &travel.accel[..]].map(|accel| response_spectrum(accel, dt, &periods, RATIO));
        let both = before.iter().zip(&after);
        let corrected = Corrected {
            corner_hz: corner,
            stroke,
            peaks: [travel.peak(), largest(&travel.vel), largest(&travel.accel)],
            peak_before: largest(accel),
            spectrum: both
                .map(|(before, after)| [before.period, before.pseudo_accel, after.pseudo_accel])
                .collect(),
        };
        Ok((travel, corrected))
    }
}

/// A matrix of one sample, by rows: of d and p.
type Block = [[f64; 2]; 2];

impl Travel {
    /// The displacement behind a high-pass with this corner in Hz.
    fn behind(corner: f64, accel: &[f64], dt: f64) -> Self {
        let omega = std::f64::consts::TAU * corner;
        let kept = residual(omega, accel, dt);
        let each = accel.iter().zip(&kept);
        let accel: Vec<f64> = each.map(|(a, p)| a + omega * omega * p).collect();
        let (mut vel, mut disp) = (vec![0.0], vec![0.0]);
        for two in accel.windows(2) {
            let (v, d) = (vel[vel.len() - 1], disp[disp.len() - 1]);
            vel.push(v + 0.5 * dt * (two[0] + two[1]));
            disp.push(d + dt * v + dt * dt / 6.0 * (2.0 * two[0] + two[1]));
        }
        let mut travel = Self {
            dt,
            disp,
            vel,
            accel,
        };
        travel.close();
        travel
    }

    /// Removes what rounding left of displacement and velocity at the end, by the cubic with zeros at the start.
    fn close(&mut self) {
        let last = self.disp.len() - 1;
        let (span, d, v) = (self.dt * last as f64, self.disp[last], self.vel[last]);
        let (square, cubic) = (3.0 * d - span * v, span * v - 2.0 * d);
        for i in 0..=last {
            let s = i as f64 / last as f64;
            self.disp[i] -= s * s * (square + cubic * s);
            self.vel[i] -= s * (2.0 * square + 3.0 * cubic * s) / span;
            self.accel[i] -= (2.0 * square + 6.0 * cubic * s) / (span * span);
        }
    }

    /// Largest |displacement| in m, between the samples too.
    fn peak(&self) -> f64 {
        let pairs = self.disp.windows(2).zip(self.vel.windows(2));
        pairs.fold(0.0, |most: f64, (disp, vel)| {
            let turn = if vel[0] * vel[1] < 0.0 {
                turning_point([disp[0], disp[1]], [vel[0], vel[1]], self.dt).abs()
            } else {
                0.0
            };
            most.max(disp[1].abs()).max(turn)
        })
    }

    /// Length in s.
    pub(crate) fn span(&self) -> f64 {
        self.dt * (self.disp.len() - 1) as f64
    }

    /// Displacement and velocity at a time from the first sample; at rest outside.
    pub(crate) fn at(&self, time: f64) -> (f64, f64) {
        let place = super::resample::snapped(time / self.dt);
        let last = self.disp.len() - 1;
        if !(0.0..last as f64).contains(&place) {
            return (0.0, 0.0);
        }
        let i = place as usize;
        let t = (place - i as f64) * self.dt;
        let (a, slope) = (self.accel[i], (self.accel[i + 1] - self.accel[i]) / self.dt);
        let vel = self.vel[i] + t * (a + 0.5 * slope * t);
        let disp = self.disp[i] + t * (self.vel[i] + t * (0.5 * a + slope * t / 6.0));
        (disp, vel)
    }
}

/// p at all samples.
fn residual(omega: f64, accel: &[f64], dt: f64) -> Vec<f64> {
    let last = accel.len() - 1;
    let k = omega * omega * dt * dt / 6.0;
    let h = dt * dt / 6.0;
    // Blocks beside the diagonal: within, and of the ends, where d = 0 and the motion leaves rest.
    let side: Block = [[1.0, -k], [k, 1.0]];
    let inner: Block = [[-2.0, -4.0 * k], [4.0 * k, -2.0]];
    let end: Block = [[1.0, 0.0], [-1.0, -2.0 * k]];
    let beside_end: Block = [[0.0, 0.0], [1.0, -k]];
    let load = |i: usize| match i {
        0 => [0.0, h * (2.0 * accel[0] + accel[1])],
        _ if i == last => [0.0, h * (2.0 * accel[last] + accel[last - 1])],
        _ => [h * (accel[i - 1] + 4.0 * accel[i] + accel[i + 1]), 0.0],
    };
    // Elimination from the start: y_i = given_i − ahead_i y_{i+1}.
    let mut given: Vec<[f64; 2]> = Vec::with_capacity(accel.len());
    let mut ahead: Vec<Block> = Vec::with_capacity(accel.len());
    for i in 0..=last {
        let (mut own, mut right) = (inner, load(i));
        if i == 0 || i == last {
            own = end;
        }
        if i > 0 {
            let left = if i == last { beside_end } else { side };
            let product = times(&left, &ahead[i - 1]);
            let known = applied(&left, given[i - 1]);
            for row in 0..2 {
                right[row] -= known[row];
                for column in 0..2 {
                    own[row][column] -= product[row][column];
                }
            }
        }
        let inverse = inverted(&own);
        given.push(applied(&inverse, right));
        ahead.push(match i {
            0 => times(&inverse, &beside_end),
            _ => times(&inverse, &side),
        });
    }
    let mut found = vec![0.0; accel.len()];
    let mut next = [0.0; 2];
    for i in (0..=last).rev() {
        let mut own = given[i];
        if i < last {
            let of_next = applied(&ahead[i], next);
            own = [own[0] - of_next[0], own[1] - of_next[1]];
        }
        (found[i], next) = (own[1], own);
    }
    found
}

fn times(a: &Block, b: &Block) -> Block {
    let entry = |i: usize, j: usize| a[i][0] * b[0][j] + a[i][1] * b[1][j];
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

fn applied(a: &Block, x: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|i| a[i][0] * x[0] + a[i][1] * x[1])
}

fn inverted(a: &Block) -> Block {
    let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    [
        [a[1][1] / det, -a[0][1] / det],
        [-a[1][0] / det, a[0][0] / det],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn peak(values: &[f64]) -> f64 {
        values.iter().fold(0.0, |most: f64, v| most.max(v.abs()))
    }

    /// A packet of sines about the middle of 40 s, with an offset.
    fn packet(hz: f64, offset: f64) -> Vec<f64> {
        let at = |i: u32| {
            let t = 0.005 * f64::from(i) - 20.0;
            libm::exp(-t * t / 18.0) * libm::sin(TAU * hz * t) + offset
        };
        (0..=8000).map(at).collect()
    }

    #[test]
    fn sine_has_the_gain_of_the_high_pass() {
        // A narrow packet in the middle: gain f⁴/(f⁴ + f_c⁴), no phase; its bandwidth of 0.05 Hz changes the gain by less.
        for (hz, corner) in [(1.0, 0.5), (1.0, 1.0), (0.5, 1.0)] {
            let accel = packet(hz, 0.0);
            let travel = Travel::behind(corner, &accel, 0.005);
            let gain = 1.0 / (1.0 + f64::powi(corner / hz, 4));
            let both = || accel.iter().zip(&travel.accel);
            let inner: f64 = both().map(|(a, b)| a * b).sum();
            let square: f64 = accel.iter().map(|a| a * a).sum();
            assert!((inner / square - gain).abs() < 0.01, "{hz} {corner}");
            let off = both().map(|(a, b)| (b - gain * a).abs());
            assert!(off.fold(0.0, f64::max) < 0.12, "{hz} {corner}");
        }
    }

    #[test]
    fn travel_is_the_minimum() {
        // ∫ (d̈ − a)² + ω⁴ ∫ d² grows for any other displacement with the same ends: its first variation vanishes. The bumps
        // s²(1 − s)² sin ks are such changes.
        let accel = packet(0.2, 0.1);
        let (dt, corner) = (0.005, 0.1);
        let travel = Travel::behind(corner, &accel, dt);
        let omega = TAU * corner;
        let n = travel.disp.len() - 1;
        let mut shares = Vec::new();
        for k in [3.0, 20.0, 40.0, 50.0] {
            let bump = |s: f64| s * s * (1.0 - s) * (1.0 - s) * libm::sin(k * s);
            let ds = 1.0 / n as f64;
            let (mut sums, mut size) = ([0.0; 2], 0.0);
            let kept = travel.accel.iter().zip(&accel).zip(&travel.disp);
            for (i, ((kept, accel), disp)) in kept.enumerate().take(n).skip(1) {
                let s = i as f64 * ds;
                let curve = (bump(s + ds) - 2.0 * bump(s) + bump(s - ds)) / (dt * dt);
                let parts = [(kept - accel) * curve, omega.powi(4) * disp * bump(s)];
                sums = [sums[0] + parts[0], sums[1] + parts[1]];
                size += parts[0].abs() + parts[1].abs();
            }
            assert!(
                (sums[0] + sums[1]).abs() < 1e-4 * size,
                "{k} {sums:?} {size}"
            );
            shares.push(sums[0].abs() / size);
        }
        // Some bumps are like the motion: both parts are large, and cancel.
        assert!(shares.iter().any(|share| *share > 0.1), "{shares:?}");
    }

    #[test]
    fn motion_is_at_rest_at_both_ends() {
        for corner in [0.0025, 0.1, 2.0] {
            let travel = Travel::behind(corner, &packet(0.7, 0.2), 0.005);
            let top = peak(&travel.disp);
            let last = travel.disp.len() - 1;
            for (values, top) in [(&travel.disp, top), (&travel.vel, peak(&travel.vel))] {
                assert_eq!(values[0], 0.0);
                assert!(
                    values[last].abs() < 1e-12 * top,
                    "{corner} {}",
                    values[last]
                );
            }
            // The velocity is the rate of the displacement, and its rate the acceleration.
            let h = 1e-4;
            for place in [3.0012, 17.5, 20.0033] {
                let at = |t: f64| travel.at(t);
                let rate = (at(place + h).0 - at(place - h).0) / (2.0 * h);
                assert!(
                    (rate - at(place).1).abs() < 1e-6 * peak(&travel.vel),
                    "{corner}"
                );
            }
            assert_eq!(travel.at(-1e-3), (0.0, 0.0));
            assert_eq!(travel.at(40.1), (0.0, 0.0));
        }
    }

    #[test]
    fn what_rounding_leaves_is_small() {
        // Without `close`, the exact integral of the corrected acceleration ends at rest: to 1e-6 of the peak at the lowest corner.
        for corner in [0.0025, 0.02, 0.5] {
            let accel = packet(0.7, 0.2);
            let omega = TAU * corner;
            let p = residual(omega, &accel, 0.005);
            let (mut d, mut v, mut top) = (0.0, 0.0, 0.0_f64);
            let kept: Vec<f64> = accel
                .iter()
                .zip(&p)
                .map(|(a, p)| a + omega * omega * p)
                .collect();
            for two in kept.windows(2) {
                d += 0.005 * v + 0.005 * 0.005 / 6.0 * (2.0 * two[0] + two[1]);
                v += 0.0025 * (two[0] + two[1]);
                top = top.max(d.abs());
            }
            assert!(
                d.abs() < 1e-6 * top && v.abs() < 1e-6 * top,
                "{corner}: {d:e} {v:e} {top}"
            );
        }
    }

    #[test]
    fn lowest_corner_keeps_the_stroke() {
        let accel = packet(0.3, 0.05);
        let mut before = 0.0;
        for stroke_m in [0.2, 0.1, 0.02] {
            let (travel, corrected) = Stroke { stroke_m }.travel(&accel, 0.005).unwrap();
            assert!(travel.peak() <= stroke_m && travel.peak() > 0.999 * stroke_m);
            assert_eq!(corrected.peaks[0], travel.peak());
            assert!(corrected.corner_hz > before, "{corrected:?}");
            before = corrected.corner_hz;
            // Long periods lose more than short ones.
            let share = |[_, sa, after]: &[f64; 3]| after / sa;
            let shares: Vec<f64> = corrected.spectrum.iter().map(share).collect();
            assert!(shares[6] < shares[2], "{shares:?}");
        }
        // A large stroke leaves the lowest corner.
        let (_, corrected) = Stroke { stroke_m: 1e3 }.travel(&accel, 0.005).unwrap();
        assert!((corrected.corner_hz - 0.0025).abs() < 1e-12);
        let refused = Stroke { stroke_m: 1e-9 }.travel(&accel, 0.005);
        let refused = refused.map(|_| ()).unwrap_err();
        assert_eq!(refused.key(), Some("stroke_m"));
    }
}
