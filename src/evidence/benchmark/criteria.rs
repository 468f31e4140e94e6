//! J1 … J9 as the benchmark's released code computes them.

use gusset_motion::metrics::tracking::delay;

/// Results of a run, one value per tick, in m.
#[derive(Debug, Clone, Default)]
pub struct Histories {
    /// Measured displacement of the interface.
    pub measured: Vec<f64>,
    /// Floors of the numerical side; the first is the target.
    pub floors: [Vec<f64>; 3],
}

/// The criteria of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// J1 in ms, J2 … J9 in per cent.
    pub j: [f64; 9],
    /// Delay of the interface behind its target in ms, by the report's own metric, which finds a lead (below zero) as well; not a
    /// number where it finds none. J1 is never below zero nor beyond its `LAGS`.
    pub delay_ms: f64,
}

/// Lags that J1 looks at.
const LAGS: usize = 50;

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

/// Sample standard deviation.
fn deviation(values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let n = values.len() as f64;
    let mean = mean(values.clone());
    let squares: f64 = values.map(|v| (v - mean) * (v - mean)).sum();
    (squares / (n - 1.0)).sqrt()
}

fn peak(values: impl Iterator<Item = f64>) -> f64 {
    values.map(f64::abs).fold(0.0, f64::max)
}

/// Correlation of a with b over their common length.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len()) as f64;
    let (mut sa, mut sb, mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        sa += x;
        sb += y;
        aa += x * x;
        bb += y * y;
        ab += x * y;
    }
    (ab - sa * sb / n) / ((aa - sa * sa / n) * (bb - sb * sb / n)).sqrt()
}

/// Standard and largest deviation of `a` from `b`, over those of `b`, in per cent.
fn errors(a: &[f64], b: &[f64]) -> [f64; 2] {
    let difference = a.iter().zip(b).map(|(a, b)| a - b);
    let own = b.iter().copied();
    [
        100.0 * deviation(difference.clone()) / deviation(own.clone()),
        100.0 * peak(difference) / peak(own),
    ]
}

impl Criteria {
    /// From a run, the reference, and the tick in s.
    #[must_use]
    pub(crate) fn of(run: &Histories, reference: &[Vec<f64>; 3], dt: f64) -> Self {
        let [first, second, third] = &run.floors;
        let [r1, r2, r3] = reference;
        let measured = &run.measured;
        let lags: Vec<f64> = (0..LAGS)
            .map(|lag| correlation(measured.get(lag..).unwrap_or_default(), first))
            .collect();
        let largest = lags.iter().enumerate().fold(
            0,
            |best, (k, value)| if *value > lags[best] { k } else { best },
        );
        let [j2, j3] = errors(measured, first);
        let [j4, j5] = errors(measured, r1);
        let [j6, j8] = errors(second, r2);
        let [j7, j9] = errors(third, r3);
        Self {
            j: [largest as f64 * dt * 1e3, j2, j3, j4, j5, j6, j7, j8, j9],
            delay_ms: delay(first, measured, dt).map_or(f64::NAN, |delay| delay * 1e3),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_late_copy_has_known_criteria() {
        let dt = 1.0 / 4096.0;
        let sine = |lag: f64| -> Vec<f64> {
            let at = |k: i32| libm::sin(12.0 * (f64::from(k) - lag) * dt);
            (0..40_960).map(at).collect()
        };
        let reference = [sine(0.0), sine(0.0), sine(0.0)];
        let run = Histories {
            measured: sine(12.4).iter().map(|v| 0.95 * v).collect(),
            floors: [sine(0.0), sine(3.0), sine(0.0)],
        };
        let found = Criteria::of(&run, &reference, dt);
        assert_eq!(found.j[0], 12.0 / 4.096);
        assert!(
            (found.delay_ms - 12.4 / 4.096).abs() < 0.02,
            "{}",
            found.delay_ms
        );
        // |0.95 e^{−iφ} − 1| with φ = 12·12.4 Δt.
        let phase = 12.0 * 12.4 * dt;
        let wanted = 100.0 * (1.0 + 0.95 * 0.95 - 1.9 * libm::cos(phase)).sqrt();
        assert!((found.j[1] - wanted).abs() < 0.05 && (found.j[2] - wanted).abs() < 0.05);
        assert_eq!(found.j[1..3], found.j[3..5]);
        let delay = |lag: f64| {
            let measured = sine(lag);
            let floors = [sine(0.0), sine(0.0), sine(0.0)];
            let found = Criteria::of(&Histories { measured, floors }, &reference, dt);
            (found.j[0], found.delay_ms)
        };
        // A lead, and more of a lag than J1 looks at.
        for (lag, j1) in [(-7.5, 0.0), (80.25, 49.0)] {
            let (first, ms) = delay(lag);
            assert_eq!(first, j1 / 4.096);
            assert!((ms - lag / 4.096).abs() < 0.02, "{ms}");
        }
        assert!(delay(0.3 / dt).1.is_nan(), "beyond what is looked for");
        let second = 100.0 * 2.0 * libm::sin(12.0 * 3.0 * dt / 2.0);
        assert!((found.j[5] - second).abs() < 0.01 && (found.j[7] - second).abs() < 0.01);
        assert_eq!((found.j[6], found.j[8]), (0.0, 0.0));
    }
}
