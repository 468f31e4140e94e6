//! What a ground motion does: elastic response spectra and measures of intensity.
//!
//! The oscillator ü + 2ζω u̇ + ω² u = −a(t) is carried exactly from sample to sample of an acceleration that runs in
//! straight lines between them (Nigam & Jennings 1969), here in the form "free vibration about the particular
//! solution", which loses no digits when the step is a small part of the period. Short periods are read at 40
//! points a period or more, so that no peak is missed by more than 0.31 % (1 − cos(π/40)); the free vibration after the
//! last sample is included. Nothing here runs during a test.

use std::f64::consts::PI;

use super::error::{MotionError, all_finite, inside, positive};
use super::unit::STANDARD_GRAVITY;

/// Elastic response spectrum of one damping ratio; all vectors have one entry per period.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Natural periods in s; 0 is a rigid oscillator.
    pub periods: Vec<f64>,
    /// Largest relative displacement Sd in m.
    pub disp: Vec<f64>,
    /// Pseudo-velocity ω Sd in m/s.
    pub pseudo_vel: Vec<f64>,
    /// Pseudo-acceleration ω² Sd in m/s²; the peak of the ground for period 0.
    pub pseudo_accel: Vec<f64>,
}

/// Measures of intensity of an acceleration in m/s².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intensity {
    /// Peak |a| in m/s².
    pub peak_accel: f64,
    /// Arias intensity π/2g ∫ a² dt in m/s.
    pub arias: f64,
    /// Cumulative absolute velocity ∫ |a| dt in m/s.
    pub cumulative_vel: f64,
    /// Time in s in which the Arias intensity grows from 5 to 95 %.
    pub significant_duration: f64,
}

/// Response spectrum of `accel` (m/s², samples `dt` s apart) at `periods` (s) for `damping_ratio` in [0, 1).
///
/// # Errors
/// [`MotionError::Parameter`] for a period, step or ratio outside its domain, [`MotionError::EntryNotFinite`].
pub fn response_spectrum(
    accel: &[f64],
    dt: f64,
    periods: &[f64],
    damping_ratio: f64,
) -> Result<Spectrum, MotionError> {
    let mut spectrum = Spectrum {
        periods: periods.to_vec(),
        disp: Vec::with_capacity(periods.len()),
        pseudo_vel: Vec::with_capacity(periods.len()),
        pseudo_accel: Vec::with_capacity(periods.len()),
    };
    for &period in periods {
        if period == 0.0 {
            spectrum.disp.push(0.0);
            spectrum.pseudo_vel.push(0.0);
            spectrum.pseudo_accel.push(peak(accel));
        } else {
            let disp = peak_disp(accel, dt, period, damping_ratio)?;
            let omega = 2.0 * PI / period;
            spectrum.disp.push(disp);
            spectrum.pseudo_vel.push(omega * disp);
            spectrum.pseudo_accel.push(omega * omega * disp);
        }
    }
    Ok(spectrum)
}

/// Largest relative displacement in m of the oscillator of `period` (s) under `accel` (m/s², `dt` s apart).
///
/// # Errors
/// [`MotionError::Parameter`], [`MotionError::EntryNotFinite`].
pub fn peak_disp(
    accel: &[f64],
    dt: f64,
    period: f64,
    damping_ratio: f64,
) -> Result<f64, MotionError> {
    positive("dt", dt)?;
    positive("period_s", period)?;
    inside(
        "damping_ratio",
        damping_ratio,
        (0.0..1.0).contains(&damping_ratio),
        "at least 0 and less than 1",
    )?;
    all_finite("accelerations", accel)?;

    // Points in every interval: 40 a period at least. A period below dt/25 follows the ground as if rigid; there more
    // points show nothing new.
    let points = (40.0 * dt / period).ceil().clamp(1.0, 1000.0);
    let mut oscillator = Oscillator::new(2.0 * PI / period, damping_ratio, dt / points);
    let mut largest = 0.0_f64;
    for pair in accel.windows(2) {
        let slope = (pair[1] - pair[0]) / points;
        for point in 0..points as usize {
            let from = pair[0] + slope * point as f64;
            largest = largest.max(oscillator.advance(from, slope).abs());
        }
    }
    // One period of free vibration: its first peak is the largest.
    let after = (period * points / dt).ceil().min(1e6) as usize;
    let mut free = Oscillator::new(
        2.0 * PI / period,
        damping_ratio,
        (dt / points).max(period * 1e-6),
    );
    (free.disp, free.vel) = (oscillator.disp, oscillator.vel);
    for _ in 0..after {
        largest = largest.max(free.advance(0.0, 0.0).abs());
    }
    Ok(largest)
}

/// Peak, Arias intensity, cumulative absolute velocity and D5–95 of `accel` (m/s², `dt` s apart), for the straight
/// lines between the samples. All zero for fewer than two samples, but for the peak.
#[must_use]
pub fn intensity(accel: &[f64], dt: f64) -> Intensity {
    // ∫ over one interval of (a + (b − a)s)² = (a² + ab + b²)/3.
    let energy = |a: f64, b: f64| dt * (a * a + a * b + b * b) / 3.0;
    let size = |a: f64, b: f64| {
        if a * b >= 0.0 {
            0.5 * dt * (a + b).abs()
        } else {
            0.5 * dt * (a * a + b * b) / (a - b).abs()
        }
    };
    let intervals = || accel.windows(2).map(|pair| (pair[0], pair[1]));
    let total: f64 = intervals().map(|(a, b)| energy(a, b)).sum();
    let reached = |share: f64| {
        let wanted = share * total;
        let mut sum = 0.0;
        for (i, (a, b)) in intervals().enumerate() {
            let gain = energy(a, b);
            if gain > 0.0 && sum + gain >= wanted {
                return dt * (i as f64 + (wanted - sum) / gain);
            }
            sum += gain;
        }
        0.0
    };
    Intensity {
        peak_accel: peak(accel),
        arias: PI / (2.0 * STANDARD_GRAVITY) * total,
        cumulative_vel: intervals().map(|(a, b)| size(a, b)).sum(),
        significant_duration: reached(0.95) - reached(0.05),
    }
}

/// Largest absolute value, 0 of nothing.
#[must_use]
pub fn peak(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, v| most.max(v.abs()))
}

/// An oscillator at rest, ready to take steps of one length.
struct Oscillator {
    omega: f64,
    damping_ratio: f64,
    step: f64,
    /// Free vibration over one step: (u, u̇) at its end from (u, u̇) at its start, by rows.
    free: [f64; 4],
    disp: f64,
    vel: f64,
}

impl Oscillator {
    fn new(omega: f64, damping_ratio: f64, step: f64) -> Self {
        let root = (1.0 - damping_ratio * damping_ratio).sqrt();
        let damped = omega * root;
        let decay = libm::exp(-damping_ratio * omega * step);
        let (sine, cosine) = libm::sincos(damped * step);
        let ratio = damping_ratio / root;
        Self {
            omega,
            damping_ratio,
            step,
            free: [
                decay * (cosine + ratio * sine),
                decay * sine / damped,
                -decay * omega * sine / root,
                decay * (cosine - ratio * sine),
            ],
            disp: 0.0,
            vel: 0.0,
        }
    }

    /// One step under a ground acceleration that runs from `from` to `from + change`; the displacement at its end.
    fn advance(&mut self, from: f64, change: f64) -> f64 {
        // Particular solution of ü + 2ζω u̇ + ω² u = −(from + change τ/step): a straight line.
        let stiffness = self.omega * self.omega;
        let rate = -change / (self.step * stiffness);
        let start = -from / stiffness - 2.0 * self.damping_ratio * rate / self.omega;
        let (u, v) = (self.disp - start, self.vel - rate);
        let [uu, uv, vu, vv] = self.free;
        self.disp = uu * u + uv * v + start + rate * self.step;
        self.vel = vu * u + vv * v + rate;
        self.disp
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sudden_constant_acceleration_overshoots_as_theory_says() {
        // u = −(a/ω²)(1 − e^{−ζωt}(cos ω_d t + ζ/√(1−ζ²) sin ω_d t)); its peak is (a/ω²)(1 + e^{−ζπ/√(1−ζ²)}).
        for damping in [0.0_f64, 0.02, 0.05, 0.2] {
            for (period, dt) in [(0.5_f64, 0.005_f64), (0.05, 0.02), (2.0, 0.001)] {
                let accel = vec![3.0; (4.0 * period / dt) as usize + 200];
                let omega = 2.0 * PI / period;
                let overshoot = (-damping * PI / (1.0 - damping * damping).sqrt()).exp();
                let exact = 3.0 / (omega * omega) * (1.0 + overshoot);
                let found = peak_disp(&accel, dt, period, damping).unwrap();
                // Read at 40 points a period or more: the peak is missed by half a point at most, 1 − cos(π/40) = 0.31 %
                // of the swing, and never exceeded. When the ground stops, the free vibration has at most the
                // swing about zero that it had about the shifted position, 2a/ω².
                assert!(found <= exact * (1.0 + 1e-9), "{found} {exact}");
                assert!(found >= exact * (1.0 - 0.0031), "{found} {exact}");
            }
        }
    }

    #[test]
    fn a_sine_at_resonance_builds_up_as_theory_says() {
        // Undamped, from rest, −a sin ωt on the mass: u = −(a/2ω²)(sin ωt − ωt cos ωt). After whole cycles the ground
        // stops with u = (a/2ω²) ωT, u̇ = 0: the free vibration keeps this amplitude.
        let (period, cycles, a) = (0.8_f64, 10.0_f64, 2.0_f64);
        let omega = 2.0 * PI / period;
        for points in [50.0_f64, 400.0] {
            let dt = period / points;
            let n = (cycles * points) as usize;
            let accel: Vec<f64> = (0..=n).map(|i| a * (omega * dt * i as f64).sin()).collect();
            let found = peak_disp(&accel, dt, period, 0.0).unwrap();
            let exact = a / (2.0 * omega * omega) * omega * cycles * period;
            // Chords of a sine have its fundamental reduced by (ωdt)²/12; the peak is read at a sample.
            let chord = (omega * dt).powi(2) / 12.0;
            assert!(
                (found / exact - 1.0).abs() < 1.1 * chord,
                "{found} {exact} {chord:e}"
            );
        }
    }

    #[test]
    fn a_damped_oscillator_under_a_long_sine_reaches_the_dynamic_magnification() {
        let (dt, omega_g, damping) = (0.002_f64, 5.0_f64, 0.1_f64);
        let accel: Vec<f64> = (0..60_000)
            .map(|i| (omega_g * dt * f64::from(i)).sin())
            .collect();
        // A stiff oscillator, ratio r = ω_g/ω = 0.25: starts without notable overshoot of the transient.
        let omega = 20.0_f64;
        let r = omega_g / omega;
        let exact =
            1.0 / (omega * omega) / ((1.0 - r * r).powi(2) + (2.0 * damping * r).powi(2)).sqrt();
        let steady = &accel[..];
        let mut oscillator = Oscillator::new(omega, damping, dt);
        let mut largest = 0.0_f64;
        for (i, pair) in steady.windows(2).enumerate() {
            let u = oscillator.advance(pair[0], pair[1] - pair[0]);
            // e^{−ζω·20 s} = e^{−40}: the transient is gone.
            if i > 10_000 {
                largest = largest.max(u.abs());
            }
        }
        // Chords: (ω_g dt)²/12 = 8e-6; sampling of the peak: (ω_g dt)²/8 = 1.3e-5.
        assert!((largest / exact - 1.0).abs() < 2.5e-5, "{largest} {exact}");
    }

    #[test]
    fn tiny_steps_lose_no_digits() {
        // The same straight-line ground at steps 1 and 1/4096 of it: Nigam and Jennings' own coefficients lose
        // (ω dt)³ of the digits here, (1.5e-4)³ = 4e-12.
        let coarse = [0.0, 1.0, -0.5, 2.0, 0.0, -1.0, 0.3, 0.0];
        let m = 4096;
        let fine: Vec<f64> = (0..=7 * m)
            .map(|i| super::super::resample::linear(&coarse, i as f64 / m as f64))
            .collect();
        let read = |accel: &[f64], dt: f64| {
            let points = (accel.len() - 1) / 7;
            let mut oscillator = Oscillator::new(0.6, 0.05, dt);
            let mut at_ends = Vec::new();
            for (i, pair) in accel.windows(2).enumerate() {
                let u = oscillator.advance(pair[0], pair[1] - pair[0]);
                if (i + 1) % points == 0 {
                    at_ends.push(u);
                }
            }
            at_ends
        };
        for (a, b) in read(&coarse, 1.0).iter().zip(read(&fine, 1.0 / m as f64)) {
            // 28672 steps, each to 1e-16 of the particular solution 2/ω² = 5.6 and its rate, summed at worst.
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn a_spectrum_starts_at_the_peak_and_ends_at_the_displacement_of_the_ground() {
        // One full sine of acceleration: the ground moves by a/ω (t − sin ωt/ω), 2πa/ω² at its end.
        let (a, omega, dt) = (1.0_f64, 2.0 * PI, 0.005);
        let accel: Vec<f64> = (0..=200)
            .map(|i| a * (omega * dt * f64::from(i)).sin())
            .collect();
        let spectrum = response_spectrum(&accel, dt, &[0.0, 0.02, 1.0], 0.05).unwrap();
        assert!((spectrum.pseudo_accel[0] - 1.0).abs() < 1e-12);
        // r = 1/50: magnification 1 + r² = 1.0004, transient 2r damped: a few percent at most.
        assert!((spectrum.pseudo_accel[1] - 1.0).abs() < 0.03);
        assert!((spectrum.pseudo_vel[2] - omega * spectrum.disp[2]).abs() < 1e-12);
        for (period, damping) in [
            (-1.0, 0.05),
            (f64::NAN, 0.05),
            (1.0, 1.0),
            (1.0, -0.1),
            (1.0, f64::NAN),
        ] {
            assert!(response_spectrum(&accel, dt, &[period], damping).is_err());
        }
        assert!(peak_disp(&[f64::NAN], dt, 1.0, 0.05).is_err());
    }

    #[test]
    fn intensities_of_a_rectangle_and_a_triangle_are_exact() {
        // 2 m/s² for 10 s: ∫a² = 40, CAV 20, 5 to 95 % in 9 s.
        let measured = intensity(&[2.0; 101], 0.1);
        assert!((measured.arias - PI / (2.0 * STANDARD_GRAVITY) * 40.0).abs() < 1e-12);
        assert!((measured.cumulative_vel - 20.0).abs() < 1e-12);
        assert!((measured.significant_duration - 9.0).abs() < 1e-12);
        // From −1 to 1 in 2 s: ∫a² = 2/3, ∫|a| = 1.
        let measured = intensity(&[-1.0, 1.0], 2.0);
        assert!((measured.arias - PI / (2.0 * STANDARD_GRAVITY) * 2.0 / 3.0).abs() < 1e-15);
        assert!((measured.cumulative_vel - 1.0).abs() < 1e-15);
        let nothing = intensity(&[], 0.1);
        assert_eq!(
            (nothing.peak_accel, nothing.significant_duration),
            (0.0, 0.0)
        );
        assert_eq!(intensity(&[0.0; 9], 0.1).significant_duration, 0.0);
    }
}
