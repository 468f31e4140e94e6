//! What shook the ground: peak, Arias intensity, significant duration, and the response spectrum.
//!
//! A record counts as piecewise linear between its samples. The response spectrum is that of Nigam and Jennings (1969):
//! exact for such a record, whatever the step. Every integral here is exact for it too.

/// Standard gravity in m/s², in the definition of the Arias intensity.
const GRAVITY: f64 = 9.806_65;
/// Periods that are computed side by side.
const LANES: usize = 8;

/// Intensity of a ground motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intensity {
    /// Largest |acceleration| in m/s².
    pub peak: f64,
    /// Its sample.
    pub at: usize,
    /// Arias intensity π/(2g) ∫ a² dt in m/s.
    pub arias: f64,
    /// From 5 % to 95 % of it, in s.
    pub significant_duration: f64,
    /// When 5 % of it are reached, in s from the first sample.
    pub significant_from: f64,
    /// Cumulative absolute velocity ∫ |a| dt in m/s, by the trapezoidal rule.
    pub cumulative_velocity: f64,
}

/// Intensity of `accel` (m/s²) sampled every `dt` s; none without motion.
#[must_use]
pub fn intensity(accel: &[f64], dt: f64) -> Option<Intensity> {
    let peak = super::peak(accel).filter(|p| p.value != 0.0)?;
    if !(dt > 0.0 && dt.is_finite()) {
        return None;
    }
    // ∫ a² over a step along which a is linear.
    let square = |pair: &[f64]| {
        let part = dt / 3.0 * (pair[0] * pair[0] + pair[0] * pair[1] + pair[1] * pair[1]);
        if part.is_finite() { part } else { 0.0 }
    };
    let total: f64 = accel.windows(2).map(square).sum();
    let reached = |share: f64| {
        let (mut sum, wanted) = (0.0, share * total);
        for (i, pair) in accel.windows(2).enumerate() {
            let part = square(pair);
            if sum + part >= wanted && part > 0.0 {
                return (i as f64 + (wanted - sum) / part) * dt;
            }
            sum += part;
        }
        accel.len() as f64 * dt
    };
    let (from, to) = (reached(0.05), reached(0.95));
    let swept = accel
        .windows(2)
        .map(|pair| 0.5 * dt * (pair[0].abs() + pair[1].abs()));
    (total > 0.0 && total.is_finite()).then(|| Intensity {
        peak: peak.value.abs(),
        at: peak.index,
        arias: std::f64::consts::PI / (2.0 * GRAVITY) * total,
        significant_duration: to - from,
        significant_from: from,
        cumulative_velocity: swept.filter(|part| part.is_finite()).sum(),
    })
}

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

/// Coefficients of one step of an oscillator under a load that is linear over it.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// [u; v] ← a·[u; v] + b·[p0; p1], p = −ground acceleration.
    a: [[f64; 2]; 2],
    b: [[f64; 2]; 2],
}

impl Step {
    fn new(omega: f64, ratio: f64, dt: f64) -> Self {
        let damped = omega * (1.0 - ratio * ratio).sqrt();
        let decay = libm::exp(-ratio * omega * dt);
        let (sin, cos) = (libm::sin(damped * dt), libm::cos(damped * dt));
        let (s, k) = (ratio * omega / damped, omega * omega);
        let a = [
            [decay * (cos + s * sin), decay * sin / damped],
            [-decay * k / damped * sin, decay * (cos - s * sin)],
        ];
        // A load p0 + (p1 − p0) t/dt has the particular solution α + β t with β = slope/k and
        // α = p0/k − 2ζω slope/k²; the free part starts at what is left of u and v.
        let column = |p0: f64, p1: f64| {
            let slope = (p1 - p0) / dt;
            let beta = slope / k;
            let alpha = p0 / k - 2.0 * ratio * omega * slope / (k * k);
            let (u, v) = (-alpha, -beta);
            [
                alpha + beta * dt + a[0][0] * u + a[0][1] * v,
                beta + a[1][0] * u + a[1][1] * v,
            ]
        };
        let (first, second) = (column(1.0, 0.0), column(0.0, 1.0));
        Self {
            a,
            b: [[first[0], second[0]], [first[1], second[1]]],
        }
    }
}

/// Largest responses of oscillators of these `periods` (s) and this damping `ratio` (0 … below 1) to `accel` (m/s²) sampled
/// every `dt` s, from rest; the oscillators ring on for half a period after the record. A missing sample counts as zero.
/// Empty without data, or for a step of zero.
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
        let mut steps = [Step::new(1.0, ratio, dt); LANES];
        let mut longest: f64 = 0.0;
        for (step, period) in steps.iter_mut().zip(group) {
            *step = Step::new(std::f64::consts::TAU / period, ratio, dt);
            longest = longest.max(*period);
        }
        let top = largest(
            &accel[..moving],
            &steps,
            (0.5 * longest / dt).ceil() as usize + 1,
        );
        for (period, disp) in group.iter().zip(top) {
            let omega = std::f64::consts::TAU / period;
            found.push(Ordinate {
                period: *period,
                disp,
                pseudo_accel: omega * omega * disp,
            });
        }
    }
    found
}

fn largest(accel: &[f64], steps: &[Step; LANES], after: usize) -> [f64; LANES] {
    let lane =
        |pick: &dyn Fn(&Step) -> f64| -> [f64; LANES] { std::array::from_fn(|i| pick(&steps[i])) };
    let (a00, a01) = (lane(&|s| s.a[0][0]), lane(&|s| s.a[0][1]));
    let (a10, a11) = (lane(&|s| s.a[1][0]), lane(&|s| s.a[1][1]));
    let (b00, b01) = (lane(&|s| s.b[0][0]), lane(&|s| s.b[0][1]));
    let (b10, b11) = (lane(&|s| s.b[1][0]), lane(&|s| s.b[1][1]));
    let (mut u, mut v, mut top) = ([0.0; LANES], [0.0; LANES], [0.0f64; LANES]);
    let load = |a: f64| if a.is_finite() { -a } else { 0.0 };
    let mut before = accel.first().map_or(0.0, |a| load(*a));
    let rest = std::iter::repeat_n(&0.0, after);
    for sample in accel.iter().skip(1).chain(rest) {
        let now = load(*sample);
        for i in 0..LANES {
            let next = a00[i] * u[i] + a01[i] * v[i] + b00[i] * before + b01[i] * now;
            v[i] = a10[i] * u[i] + a11[i] * v[i] + b10[i] * before + b11[i] * now;
            u[i] = next;
            top[i] = top[i].max(next.abs());
        }
        before = now;
    }
    top
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    #[test]
    fn a_step_of_ground_acceleration_gives_the_exact_overshoot_for_any_step() {
        // From rest under a constant load −a: u_max = a/ω² (1 + e^{−ζπ/√(1−ζ²)}), reached at half a damped period, which is a
        // sample if dt divides it. Exact up to rounding; coarse steps (4 a half period) too.
        for ratio in [0.0, 0.05, 0.3] {
            for samples in [4, 64] {
                let period = 0.8;
                let damped = period / f64::sqrt(1.0 - ratio * ratio);
                let dt = 0.5 * damped / f64::from(samples);
                let accel = vec![2.0; samples as usize + 1];
                let omega = TAU / period;
                let overshoot = 1.0 + libm::exp(-ratio * PI / f64::sqrt(1.0 - ratio * ratio));
                let exact = 2.0 / (omega * omega) * overshoot;
                // The record ends there; what follows is smaller as long as the load that held it is gone for the undamped too.
                let step = Step::new(omega, ratio, dt);
                let (mut u, mut v) = (0.0, 0.0);
                for _ in 0..samples {
                    let load = -2.0 * (step.b[0][0] + step.b[0][1]);
                    let next = step.a[0][0] * u + step.a[0][1] * v + load;
                    v = step.a[1][0] * u + step.a[1][1] * v - 2.0 * (step.b[1][0] + step.b[1][1]);
                    u = next;
                }
                assert!(
                    (-u / exact - 1.0).abs() < 1e-12,
                    "{ratio} {samples}: {u} {exact}"
                );
                let found = response_spectrum(&accel, dt, &[period], ratio);
                assert!(found[0].disp >= exact * (1.0 - 1e-12));
            }
        }
    }

    #[test]
    fn resonance_of_a_sine_has_its_exact_history() {
        // ü + 2ζωu̇ + ω²u = −A sin ωt from rest: u = A/(2ζω²)[cos ωt − e^{−ζωt}(cos ω_d t + ζω/ω_d sin ω_d t)]. The sine is
        // linear between samples: an error of (ω dt)²/12 of the load, 1.3e-5 at 500 samples a cycle.
        let (period, ratio, a) = (1.0, 0.05, 1.5);
        let (omega, dt) = (TAU / period, period / 500.0);
        let n = 500 * 12;
        let accel: Vec<f64> = (0..=n)
            .map(|i| a * libm::sin(omega * i as f64 * dt))
            .collect();
        let damped = omega * f64::sqrt(1.0 - ratio * ratio);
        let exact = |t: f64| {
            let decay = libm::exp(-ratio * omega * t);
            let free = libm::cos(damped * t) + ratio * omega / damped * libm::sin(damped * t);
            a / (2.0 * ratio * omega * omega) * (libm::cos(omega * t) - decay * free)
        };
        let top = (0..=n)
            .map(|i| exact(i as f64 * dt).abs())
            .fold(0.0, f64::max);
        let found = response_spectrum(&accel, dt, &[0.3, period, 2.0], ratio);
        assert!(
            (found[1].disp / top - 1.0).abs() < 5e-5,
            "{} {top}",
            found[1].disp
        );
        assert!((found[1].pseudo_accel / (omega * omega * found[1].disp) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_stiff_oscillator_feels_the_ground_and_a_soft_one_stays_behind() {
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
    fn arias_and_duration_of_a_sine_are_those_of_a_uniform_square() {
        // ∫ a² sin² over whole cycles = a² T/2, growing evenly: 5 … 95 % are 90 % of T up to a quarter cycle's ripple. The
        // chord loses (ω dt)²/6·… < 1e-4 at 200 samples a cycle.
        let (a, dt, n) = (2.0, 1.0 / 200.0, 200 * 40);
        let accel: Vec<f64> = (0..=n)
            .map(|i| a * libm::sin(TAU * i as f64 * dt))
            .collect();
        let found = intensity(&accel, dt).unwrap();
        let exact = PI / (2.0 * GRAVITY) * a * a * 40.0 / 2.0;
        assert!((found.arias / exact - 1.0).abs() < 2e-4, "{found:?}");
        assert!((found.significant_duration - 36.0).abs() < 0.17);
        assert!((found.significant_from - 2.0).abs() < 0.17);
        assert!((found.peak - a).abs() < 1e-12);
        // Mean of |sin| is 2/π.
        assert!((found.cumulative_velocity / (a * 40.0 * 2.0 / PI) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn silence_and_gaps_are_no_motion() {
        assert_eq!(intensity(&[0.0; 9], 0.1), None);
        assert_eq!(intensity(&[f64::NAN; 9], 0.1), None);
        assert_eq!(intensity(&[1.0; 9], 0.0), None);
        let gap = [0.0, 1.0, f64::NAN, 1.0, 0.0];
        assert!(intensity(&gap, 0.1).unwrap().arias.is_finite());
        assert!(
            response_spectrum(&gap, 0.1, &[1.0], 0.05)[0]
                .disp
                .is_finite()
        );
        assert!(response_spectrum(&[], 0.1, &[1.0], 0.05).is_empty());
        assert!(response_spectrum(&gap, 0.1, &[0.0], 0.05).is_empty());
        let range = periods(0.02, 5.0, 3);
        assert!((range[1] - f64::sqrt(0.1)).abs() < 1e-12 && (range[2] - 5.0).abs() < 1e-12);
    }
}
