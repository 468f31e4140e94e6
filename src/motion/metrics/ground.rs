//! What shook the ground: peak, Arias intensity, significant duration, cumulative absolute velocity.
//!
//! A record counts as piecewise linear between its samples, and every integral here is exact for it.

/// Standard gravity in m/s², in the definition of the Arias intensity.
const GRAVITY: f64 = 9.806_65;

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
    /// Cumulative absolute velocity ∫ |a| dt in m/s.
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
    // A line that crosses zero leaves a triangle on either side.
    let swept = accel.windows(2).map(|pair| {
        let (a, b) = (pair[0], pair[1]);
        if a * b >= 0.0 {
            0.5 * dt * (a + b).abs()
        } else {
            0.5 * dt * (a * a + b * b) / (a - b).abs()
        }
    });
    (total > 0.0 && total.is_finite()).then(|| Intensity {
        peak: peak.value.abs(),
        at: peak.index,
        arias: std::f64::consts::PI / (2.0 * GRAVITY) * total,
        significant_duration: to - from,
        significant_from: from,
        cumulative_velocity: swept.filter(|part| part.is_finite()).sum(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    #[test]
    fn sine_has_uniform_arias_and_duration() {
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
    }

    #[test]
    fn simple_shapes_have_exact_intensities() {
        // 2 m/s² for 10 s: ∫a² = 40, ∫|a| = 20, 5 to 95 % in 9 s.
        let found = intensity(&[2.0; 101], 0.1).unwrap();
        assert!((found.arias - PI / (2.0 * GRAVITY) * 40.0).abs() < 1e-12);
        assert!((found.cumulative_velocity - 20.0).abs() < 1e-12);
        assert!((found.significant_duration - 9.0).abs() < 1e-12);
        // From −1 to 1 in 2 s: ∫a² = 2/3, ∫|a| = 1.
        let found = intensity(&[-1.0, 1.0], 2.0).unwrap();
        assert!((found.arias - PI / (2.0 * GRAVITY) * 2.0 / 3.0).abs() < 1e-15);
        assert!((found.cumulative_velocity - 1.0).abs() < 1e-15);
    }
}
