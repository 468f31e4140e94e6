//! Elastic response spectra.
//!
//! The oscillator ü + 2ζω u̇ + ω² u = −a(t) is carried exactly along an acceleration that runs in straight lines between its
//! samples (Nigam & Jennings 1969), here in the form "free vibration about the particular solution", which loses no digits when
//! the step is a small part of the period. Peaks lie between the samples: short periods are carried at 20 points a period or
//! more, and where the velocity changes sign between two points the peak is that of the cubic through both displacements and
//! velocities, (2π/20)⁴/384 = 2.5e-5 of the swing from the true one. A point where the motion merely lingers may hide 6e-4 of
//! it. The free vibration after the last sample is in closed form. Nothing here runs during a test.

use std::f64::consts::TAU;

/// Periods that are computed side by side.
pub(super) const LANES: usize = 8;
/// Least points a period.
pub(super) const POINTS: f64 = 20.0;
/// Most points from sample to sample: a period below dt/50 follows the ground as if rigid, and more show nothing new.
pub(super) const MOST_POINTS: f64 = 1000.0;
/// A turn whose ends are below this share of the largest so far cannot exceed it.
pub(super) const NEAR: f64 = 0.9;

/// One number for each of the oscillators.
pub(super) type Lane = [f64; LANES];

/// One oscillator's largest response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ordinate {
    /// Natural period in s.
    pub period: f64,
    /// Largest |displacement| relative to the ground, m.
    pub disp: f64,
    /// Pseudo-acceleration ω²·disp, m/s².
    pub pseudo_accel: f64,
}

/// Largest responses of oscillators of these `periods` (s) and this damping `ratio` (0 … below 1) to `accel` (m/s²) sampled
/// every `dt` s, from rest; the oscillators ring on after the record. A missing sample counts as zero. Empty without data, or
/// for a step, a period or a ratio outside its domain.
#[must_use]
pub fn response_spectrum(accel: &[f64], dt: f64, periods: &[f64], ratio: f64) -> Vec<Ordinate> {
    let is_possible = dt > 0.0 && dt.is_finite() && (0.0..1.0).contains(&ratio);
    if !is_possible || accel.is_empty() || !periods.iter().all(|p| *p > 0.0 && p.is_finite()) {
        return Vec::new();
    }
    // Nothing comes after the last motion but free vibration.
    let moving = accel.iter().rposition(|a| *a != 0.0 && a.is_finite());
    let moving = moving.map_or(0, |last| (last + 2).min(accel.len()));
    let mut found = Vec::with_capacity(periods.len());
    for group in periods.chunks(LANES) {
        let shortest = group.iter().copied().fold(f64::INFINITY, f64::min);
        let points = (POINTS * dt / shortest).ceil().clamp(1.0, MOST_POINTS);
        let omega: Lane = std::array::from_fn(|i| TAU / group.get(i).copied().unwrap_or(shortest));
        let bank = Bank::new(&omega, ratio, dt / points);
        let top = bank.largest(&accel[..moving], points);
        for (period, disp) in group.iter().zip(top) {
            let omega = TAU / period;
            found.push(Ordinate {
                period: *period,
                disp,
                pseudo_accel: omega * omega * disp,
            });
        }
    }
    found
}

/// `count` periods from `shortest` to `longest` s, evenly on a logarithmic axis.
#[must_use]
pub fn periods(shortest: f64, longest: f64, count: usize) -> Vec<f64> {
    let ratio = longest / shortest;
    let place = |i: usize| i as f64 / count.saturating_sub(1).max(1) as f64;
    (0..count)
        .map(|i| shortest * libm::pow(ratio, place(i)))
        .collect()
}

/// Oscillators that take steps of one length.
pub(super) struct Bank {
    pub(super) ratio: f64,
    pub(super) step: f64,
    pub(super) omega: Lane,
    /// Free vibration over one step: (u, u̇) at its end from (u, u̇) at its start.
    uu: Lane,
    uv: Lane,
    vu: Lane,
    vv: Lane,
    /// 1/ω² and 2ζ/ω.
    softness: Lane,
    lean: Lane,
}

/// Displacements and velocities.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    pub(super) disp: Lane,
    pub(super) vel: Lane,
}

impl Motion {
    /// At rest.
    pub(super) const fn rest() -> Self {
        Self {
            disp: [0.0; LANES],
            vel: [0.0; LANES],
        }
    }
}

impl Bank {
    pub(super) fn new(omega: &Lane, ratio: f64, step: f64) -> Self {
        let root = (1.0 - ratio * ratio).sqrt();
        let decay = omega.map(|omega| libm::exp(-ratio * omega * step));
        let turn = omega.map(|omega| libm::sincos(omega * root * step));
        let lane = |entry: &dyn Fn(f64, f64, (f64, f64)) -> f64| -> Lane {
            std::array::from_fn(|i| entry(omega[i], decay[i], turn[i]))
        };
        Self {
            ratio,
            step,
            omega: *omega,
            uu: lane(&|_, decay, (sine, cosine)| decay * (cosine + ratio / root * sine)),
            uv: lane(&|omega, decay, (sine, _)| decay * sine / (omega * root)),
            vu: lane(&|omega, decay, (sine, _)| -decay * omega * sine / root),
            vv: lane(&|_, decay, (sine, cosine)| decay * (cosine - ratio / root * sine)),
            softness: omega.map(|omega| 1.0 / (omega * omega)),
            lean: omega.map(|omega| 2.0 * ratio / omega),
        }
    }

    /// Largest |displacement| of each during and after `accel`, each interval of which is `points` steps.
    fn largest(&self, accel: &[f64], points: f64) -> Lane {
        let load = |a: f64| if a.is_finite() { -a } else { 0.0 };
        let mut now = Motion::rest();
        let mut top = [0.0; LANES];
        for pair in accel.windows(2) {
            let (from, to) = (load(pair[0]), load(pair[1]));
            let change = (to - from) / points;
            for point in 0..points as usize {
                let before = now;
                self.advance(&mut now, from + change * point as f64, change / self.step);
                self.note(&before, &now, &mut top);
            }
        }
        for (i, top) in top.iter_mut().enumerate() {
            let first = first_turn([self.omega[i], self.ratio], now.disp[i], now.vel[i]);
            *top = top.max(first.abs());
        }
        top
    }

    /// One step under a load that starts at `from` and changes by `slope` a second.
    pub(super) fn advance(&self, now: &mut Motion, from: f64, slope: f64) {
        for i in 0..LANES {
            // Particular solution: a straight line.
            let rate = slope * self.softness[i];
            let start = from * self.softness[i] - self.lean[i] * rate;
            let (u, v) = (now.disp[i] - start, now.vel[i] - rate);
            now.disp[i] = self.uu[i] * u + self.uv[i] * v + start + rate * self.step;
            now.vel[i] = self.vu[i] * u + self.vv[i] * v + rate;
        }
    }

    /// Keeps the largest displacement within a step.
    fn note(&self, before: &Motion, now: &Motion, top: &mut Lane) {
        let mut turns = false;
        for (i, top) in top.iter_mut().enumerate() {
            let end = now.disp[i].abs();
            *top = top.max(end);
            let near = before.disp[i].abs().max(end) >= NEAR * *top;
            turns |= near & (before.vel[i] * now.vel[i] < 0.0);
        }
        if !turns {
            return;
        }
        for (i, top) in top.iter_mut().enumerate() {
            if before.vel[i] * now.vel[i] < 0.0 {
                let ends = [before.disp[i], now.disp[i]];
                let between = turning_point(ends, [before.vel[i], now.vel[i]], self.step);
                *top = top.max(between.abs());
            }
        }
    }
}

/// Displacement where the free vibration of an oscillator of this frequency and damping ratio first turns: no later swing is larger.
pub(super) fn first_turn([omega, ratio]: [f64; 2], disp: f64, vel: f64) -> f64 {
    let damped = omega * (1.0 - ratio * ratio).sqrt();
    // u̇ = e^{−ζωt}(v cos ω_d t − (ω² u + ζω v)/ω_d sin ω_d t).
    let angle = libm::atan2(vel * damped, omega * omega * disp + ratio * omega * vel);
    let angle = if angle < 0.0 {
        angle + std::f64::consts::PI
    } else {
        angle
    };
    let (sine, cosine) = libm::sincos(angle);
    let decay = libm::exp(-ratio * omega * angle / damped);
    decay * (disp * cosine + (vel + ratio * omega * disp) / damped * sine)
}

/// Displacement at the turning point of the cubic through these displacements and velocities at both ends of a step;
/// the velocities differ in sign.
pub(crate) fn turning_point([u0, u1]: [f64; 2], [v0, v1]: [f64; 2], step: f64) -> f64 {
    let (rise, fall, way) = (step * v0, step * v1, u1 - u0);
    // Its derivative a s² + b s + c, s from 0 to 1: of different signs at 0 and 1, so that one root lies between.
    let a = 3.0 * (rise + fall) - 6.0 * way;
    let b = 6.0 * way - 4.0 * rise - 2.0 * fall;
    let q = -0.5 * (b + (b * b - 4.0 * a * rise).max(0.0).sqrt().copysign(b));
    let inside = |s: &f64| (0.0..=1.0).contains(s);
    let Some(s) = [rise / q, q / a].into_iter().find(inside) else {
        return u0;
    };
    let (s2, s3) = (s * s, s * s * s);
    u0 + way * (3.0 * s2 - 2.0 * s3) + rise * (s - 2.0 * s2 + s3) + fall * (s3 - s2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn disp(accel: &[f64], dt: f64, period: f64, ratio: f64) -> f64 {
        response_spectrum(accel, dt, &[period], ratio)[0].disp
    }

    #[test]
    fn sudden_acceleration_overshoots() {
        // From rest under a constant load −a: u_max = a/ω² (1 + e^{−ζπ/√(1−ζ²)}), wherever it lies between the samples. When
        // the ground stops, the free vibration has at most the swing about zero that it had about the shifted position.
        for ratio in [0.0_f64, 0.02, 0.05, 0.3] {
            for (period, dt) in [(0.5, 0.005), (0.05, 0.02), (2.0, 0.001), (0.5, 0.1)] {
                let accel = vec![3.0; (4.0 * period / dt) as usize + 200];
                let omega = TAU / period;
                let overshoot = libm::exp(-ratio * PI / (1.0 - ratio * ratio).sqrt());
                let exact = 3.0 / (omega * omega) * (1.0 + overshoot);
                let found = disp(&accel, dt, period, ratio);
                // 2.5e-5 of the swing, which is half of that peak or less.
                assert!((found / exact - 1.0).abs() < 1.3e-5, "{found} {exact}");
            }
        }
    }

    #[test]
    fn free_vibration_keeps_its_amplitude() {
        // A triangle of 2 dt at T = 5 dt; undamped, from rest: after it u = −(1/ω)∫ a(τ) sin ω(t − τ) dτ has the amplitude
        // |∫ a e^{iωτ} dτ|/ω, and that of a triangle of height A is A (sin(ωdt/2)/(ωdt/2))² dt. Read at its samples, a fifth
        // of a period apart, 5 % of it would be missed.
        let (a, dt) = (4.0, 0.01);
        let period = 5.0 * dt;
        let half = TAU / 5.0 / 2.0;
        let exact = a * dt * (libm::sin(half) / half).powi(2) / (TAU / period);
        for rest in [0, 1, 40] {
            let mut accel = vec![0.0, 0.0, a, 0.0];
            accel.extend(vec![0.0; rest]);
            let found = disp(&accel, dt, period, 0.0);
            // In closed form, so to roundoff.
            assert!((found / exact - 1.0).abs() < 1e-13, "{found} {exact}");
        }
    }

    #[test]
    fn resonant_peak_is_exact_at_five_samples() {
        // ü + 2ζωu̇ + ω²u = −a sin ωt from rest: u = A/(2ζω²)[cos ωt − e^{−ζωt}(cos ω_d t + ζω/ω_d sin ω_d t)]. Chords of a
        // sine have its fundamental times (sin(ωdt/2)/(ωdt/2))², and harmonics 4, 6, 9 … whose parts of 1/16 and less in the
        // load are damped to 1/(16² − 1) and less.
        // Five samples see |cos| every π/5: with this phase they all miss the peak, by 1 − cos(π/10) = 5 %.
        let (period, ratio, a) = (1.0, 0.05, 1.5);
        for points in [5, 500] {
            let (omega, dt) = (TAU / period, period / f64::from(points));
            let accel: Vec<f64> = (0..=points * 60)
                .map(|i| a * libm::sin(omega * f64::from(i) * dt + PI / 10.0))
                .collect();
            let half = omega * dt / 2.0;
            let fundamental = a * (libm::sin(half) / half).powi(2);
            // After 60 cycles e^{−ζω·60 T} = 7e-9: the transient is gone.
            let exact = fundamental / (2.0 * ratio * omega * omega);
            let found = response_spectrum(&accel, dt, &[0.3, period, 2.0], ratio);
            // Harmonic 4 of the chords: 1/16 of the fundamental, through 1/15 where resonance has 1/(2ζ) = 10.
            let harmonics = if points == 5 {
                2.0 / 16.0 / 15.0 / 10.0
            } else {
                0.0
            };
            let error = found[1].disp / exact - 1.0;
            assert!(error.abs() < harmonics + 3e-5, "{points}: {error:e}");
            assert!((found[1].pseudo_accel / (omega * omega * found[1].disp) - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn swing_after_a_resonant_sine_is_exact() {
        // Undamped, from rest, −a sin ωt on the mass: after whole cycles the ground stops with u = (a/2ω²) ωT, u̇ = 0.
        let (period, cycles, a) = (0.8_f64, 10.0_f64, 2.0_f64);
        let omega = TAU / period;
        for points in [5.0_f64, 50.0, 400.0] {
            let dt = period / points;
            let n = (cycles * points) as usize;
            let accel: Vec<f64> = (0..=n)
                .map(|i| a * libm::sin(omega * dt * i as f64))
                .collect();
            let half = omega * dt / 2.0;
            let chords = (libm::sin(half) / half).powi(2);
            let exact = chords * a / (2.0 * omega * omega) * omega * cycles * period;
            let found = disp(&accel, dt, period, 0.0);
            // Harmonics 4 and 6 of chords at five points shift the peak by their own parts, as above; 1/(ωT cycles) of it.
            let harmonics = if points == 5.0 {
                2.0 / 16.0 / 15.0 / 31.0
            } else {
                0.0
            };
            let error = (found / exact - 1.0).abs();
            assert!(error < harmonics + 3e-5, "{points}: {found} {exact}");
        }
    }

    #[test]
    fn many_periods_side_by_side_are_each_alone() {
        let accel: Vec<f64> = (0..300)
            .map(|i| libm::sin(0.3 * f64::from(i * i % 97)))
            .collect();
        let wanted = periods(0.02, 4.0, 19);
        let together = response_spectrum(&accel, 0.01, &wanted, 0.05);
        for ordinate in together {
            let alone = disp(&accel, 0.01, ordinate.period, 0.05);
            // Others in the group decide how many points are passed: 2.5e-5 of the swing on either side.
            assert!(
                (ordinate.disp / alone - 1.0).abs() < 6e-5,
                "{ordinate:?} {alone}"
            );
        }
    }

    #[test]
    fn tiny_steps_lose_no_digits() {
        // One straight-line ground at steps 1 and 1/4096: Nigam and Jennings' own coefficients lose (ω dt)³ of the
        // digits here, (1.5e-4)³ = 4e-12.
        let coarse = [0.0, 1.0, -0.5, 2.0, 0.0, -1.0, 0.3, 0.0];
        let ends = |count: usize| {
            let bank = Bank::new(&[0.6; LANES], 0.05, 1.0 / count as f64);
            let mut now = Motion {
                disp: [0.0; LANES],
                vel: [0.0; LANES],
            };
            let mut found = Vec::new();
            for pair in coarse.windows(2) {
                let slope = pair[0] - pair[1];
                for part in 0..count {
                    let from = -pair[0] + slope * part as f64 / count as f64;
                    bank.advance(&mut now, from, slope);
                }
                found.push(now.disp[0]);
            }
            found
        };
        for (a, b) in ends(1).iter().zip(ends(4096)) {
            // 28672 steps, each to 1e-16 of the particular solution 2/ω² = 5.6 and its rate, summed at worst.
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn stiff_and_soft_limits_are_met() {
        let dt = 0.005;
        let accel: Vec<f64> = (0..4000)
            .map(|i| 3.0 * libm::sin(TAU * i as f64 * dt) * libm::sin(PI * i as f64 / 4000.0))
            .collect();
        let found = response_spectrum(&accel, dt, &[0.01, 200.0], 0.05);
        let peak = super::super::peak(&accel).unwrap().value.abs();
        assert!((found[0].pseudo_accel / peak - 1.0).abs() < 1e-3);
        assert!(found[1].pseudo_accel < 1e-3 * peak);
    }

    #[test]
    fn invalid_input_has_no_spectrum() {
        let gap = [0.0, 1.0, f64::NAN, 1.0, 0.0];
        assert!(disp(&gap, 0.1, 1.0, 0.05).is_finite());
        assert_eq!(disp(&[0.0; 4], 0.1, 1.0, 0.0), 0.0);
        assert!(response_spectrum(&[], 0.1, &[1.0], 0.05).is_empty());
        for (period, ratio) in [
            (0.0, 0.05),
            (-1.0, 0.05),
            (f64::NAN, 0.05),
            (1.0, 1.0),
            (1.0, -0.1),
        ] {
            assert!(response_spectrum(&gap, 0.1, &[period], ratio).is_empty());
        }
        let range = periods(0.02, 5.0, 3);
        assert!((range[1] - f64::sqrt(0.1)).abs() < 1e-12 && (range[2] - 5.0).abs() < 1e-12);
    }
}
