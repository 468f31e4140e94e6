//! How well a measured displacement follows its target, in the numbers of the literature, each with its noise floor.
//!
//! The floor is the value for a specimen that follows perfectly with only the sensors' noise added. That noise is white
//! and as large as at rest. Numbers that noise makes larger are corrected by its share. Numbers that noise only scatters
//! are kept where they exceed twice their scatter. Otherwise they take the value of a perfect specimen (0, or 1 for a
//! ratio).

use serde::{Deserialize, Serialize};

use super::floor::Judged;
use super::fourier::{Evaluation, Spectrum, evaluate};
use super::response::{Denominator, bridged, lag, nrmse, peak};
use super::windows::Windows;

/// Samples that are correlated at most: a longer test is correlated around its largest target.
const LAG_WINDOW: usize = 100_000;
/// Largest delay in the search, in s of test time, and in samples at least and at most.
const LAG_S: f64 = 0.1;
const LAG_LEAST: usize = 25;
const LAG_MOST: usize = 800;

/// Sensor readings of an axis at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Number of readings.
    pub count: u64,
    /// Mean displacement, m.
    pub disp_mean_m: f64,
    /// Standard deviation of the displacement, m.
    pub disp_std_m: f64,
    /// Mean force, N.
    pub force_mean_n: f64,
    /// Standard deviation of the force, N.
    pub force_std_n: f64,
}

impl Noise {
    /// Noise of readings at rest; `None` with fewer than two. The standard deviation is that of a sample.
    #[must_use]
    pub fn of(disp: &[f64], force: &[f64]) -> Option<Self> {
        let both = disp.iter().zip(force);
        let both: Vec<_> = both
            .filter(|(d, f)| d.is_finite() && f.is_finite())
            .collect();
        let n = both.len() as f64;
        if both.len() < 2 {
            return None;
        }
        let disp_mean = both.iter().map(|p| p.0).sum::<f64>() / n;
        let force_mean = both.iter().map(|p| p.1).sum::<f64>() / n;
        let spread = |values: &mut dyn Iterator<Item = f64>| {
            (values.map(|v| v * v).sum::<f64>() / (n - 1.0)).sqrt()
        };
        Some(Self {
            count: both.len() as u64,
            disp_mean_m: disp_mean,
            disp_std_m: spread(&mut both.iter().map(|p| p.0 - disp_mean)),
            force_mean_n: force_mean,
            force_std_n: spread(&mut both.iter().map(|p| p.1 - force_mean)),
        })
    }
}

/// The frequency evaluation index, see [`Evaluation`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Index {
    /// Measured over target; 1 is perfect.
    pub amplitude: Judged,
    /// Negative: the measured displacement is behind.
    pub phase_rad: Judged,
    /// Positive: the measured displacement is behind.
    pub delay_s: Judged,
    /// Frequency that the others belong to.
    pub frequency_hz: f64,
}

/// How well one axis followed its target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tracking {
    /// Samples that were compared.
    pub samples: u64,
    /// Root mean square of measured − target over root mean square of the target.
    pub nrmse: Judged,
    /// Root mean square of measured − target over the range of the target, largest − smallest.
    pub nrmse_of_range: Judged,
    /// Largest |measured − target|.
    pub peak_error_m: Judged,
    /// Delay of the frequency evaluation index, or, without one, the lag; positive: the measured displacement is behind.
    pub delay_s: Option<Judged>,
    /// Amplitude of the frequency evaluation index, or, without one, the slope; less one.
    #[serde(default = "Judged::unknown")]
    pub amplitude_error: Judged,
    /// Lag of the largest cross-correlation, refined within a sample.
    pub lag_s: Option<Judged>,
    /// Frequency evaluation index.
    pub fei: Option<Index>,
    /// Tracking indicator of Mercan and Ricles at the end of the test; it falls while the measured displacement lags.
    pub tracking_indicator_m2: Judged,
    /// Slope of the synchronisation subspace: measured against target by least squares; 1 is perfect.
    pub slope: Judged,
    /// Energy error of Mosqueda, Stojadinović and Mahin, ∫ f d(measured − target); positive: the
    /// transfer system has added energy to the test, as a lag does.
    pub energy_error_j: Judged,
    /// The energy error over the input energy and the largest elastic strain energy of the test
    /// ([`super::falsified::Scale`]); null where there is no energy balance.
    pub energy_error_share: Option<Judged>,
    /// Phase and amplitude errors in moving windows (PAEI and FDB); null of a test that is too short.
    pub windows: Option<Windows>,
    /// Readings at rest, from which the floors follow; null if the test did not zero its sensors.
    pub noise: Option<Noise>,
}

/// Sums over all samples.
#[derive(Default)]
struct Sums {
    n: f64,
    error: f64,
    square: f64,
    swept: f64,
    lo: f64,
    hi: f64,
    worst: f64,
    indicator: f64,
    energy: f64,
    forced: f64,
    slipped: f64,
    means: [f64; 2],
    cc: f64,
    cm: f64,
}

fn sums(target: &[f64], measured: &[f64], force: &[f64]) -> Sums {
    let mut s = Sums {
        lo: f64::INFINITY,
        hi: f64::NEG_INFINITY,
        ..Sums::default()
    };
    let mut before: Option<(f64, f64, f64)> = None;
    let all = target.iter().zip(measured);
    for (i, (&c, &m)) in all.enumerate() {
        if !(c.is_finite() && m.is_finite()) {
            before = None;
            continue;
        }
        let f = force.get(i).copied().unwrap_or(f64::NAN);
        s.n += 1.0;
        s.error += (m - c) * (m - c);
        s.square += c * c;
        s.lo = s.lo.min(c);
        s.hi = s.hi.max(c);
        s.worst = s.worst.max((m - c).abs());
        // Moments about the running means: offsets of metres do not eat motions of micrometres.
        let (dc, dm) = (c - s.means[0], m - s.means[1]);
        s.means[0] += dc / s.n;
        s.means[1] += dm / s.n;
        s.cc += dc * (c - s.means[0]);
        s.cm += dc * (m - s.means[1]);
        if let Some((c0, m0, f0)) = before {
            // ½ (A − TA) of one step, multiplied out.
            s.indicator += 0.5 * (m0 * c - m * c0);
            s.swept += (c - c0) * (c - c0);
            let slip = (m - c) - (m0 - c0);
            let work = 0.5 * (f + f0) * slip;
            if work.is_finite() {
                s.energy += work;
                s.forced += (f - f0) * (f - f0);
                s.slipped += slip * slip;
            }
        }
        before = Some((c, m, f));
    }
    s
}

impl Tracking {
    /// Tracking of `measured` (m) against `target` (m) with the `force` (N), sampled every `dt` s; `noise` was read at rest.
    /// `None` without motion of the target.
    #[must_use]
    pub fn of(
        target: &[f64],
        measured: &[f64],
        force: &[f64],
        dt: f64,
        noise: Option<Noise>,
    ) -> Option<Self> {
        let n = target.len().min(measured.len());
        let (target, measured) = (&target[..n], &measured[..n]);
        let spectra = Spectrum::of(target, dt).zip(Spectrum::of(measured, dt));
        let index = spectra.and_then(|(c, m)| evaluate(&c, &m));
        Self::with_index(target, measured, force, dt, noise, index)
    }

    /// Tracking with an index that is known already.
    #[must_use]
    pub fn with_index(
        target: &[f64],
        measured: &[f64],
        force: &[f64],
        dt: f64,
        noise: Option<Noise>,
        index: Option<Evaluation>,
    ) -> Option<Self> {
        let n = target.len().min(measured.len());
        let (target, measured) = (&target[..n], &measured[..n]);
        let s = sums(target, measured, force);
        let whole = nrmse(target, measured, Denominator::CommandRms)?;
        let ranged = nrmse(target, measured, Denominator::CommandRange)?;
        if !(s.cc > 0.0 && s.worst.is_finite() && s.indicator.is_finite()) {
            return None;
        }
        let noise_m = noise.map(|noise| noise.disp_std_m);
        let noise_n = noise.map(|noise| noise.force_std_n);
        // For a perfect specimen: an error of σ in every sample.
        let of_rms = noise_m.map(|sigma| sigma / (s.square / s.n).sqrt());
        let of_range = noise_m.map(|sigma| sigma / (s.hi - s.lo));
        // The largest of n normal deviates.
        let of_peak = noise_m.map(|sigma| sigma * (2.0 * libm::log(s.n.max(2.0))).sqrt());
        // Least squares of white noise on c, on ċ, on c's differences.
        let of_slope = noise_m.map(|sigma| sigma / s.cc.sqrt());
        let of_delay = noise_m.map(|sigma| sigma * dt / s.swept.sqrt());
        let of_indicator = noise_m.map(|sigma| sigma * s.swept.sqrt());
        let of_energy = noise_m.zip(noise_n).map(|(sigma_m, sigma_n)| {
            (sigma_m * sigma_m * s.forced + sigma_n * sigma_n * s.slipped).sqrt()
        });
        let lag = delay(target, &bridged(target, measured), dt);
        let lag = lag.map(|lag| Judged::scattered(lag, of_delay, 0.0));
        let slope = Judged::scattered(s.cm / s.cc, of_slope, 1.0);
        let index = index.map(|found| Index {
            amplitude: Judged::scattered(found.amplitude, of_slope, 1.0),
            phase_rad: Judged::scattered(found.phase, of_slope, 0.0),
            delay_s: Judged::scattered(found.delay, of_delay, 0.0),
            frequency_hz: found.frequency_hz,
        });
        Some(Self {
            samples: s.n as u64,
            nrmse: Judged::grown(whole, of_rms),
            nrmse_of_range: Judged::grown(ranged, of_range),
            peak_error_m: Judged::grown(s.worst, of_peak),
            delay_s: index.map(|index| index.delay_s).or(lag),
            amplitude_error: index.map_or(slope, |index| index.amplitude).less(1.0),
            lag_s: lag,
            fei: index,
            tracking_indicator_m2: Judged::scattered(s.indicator, of_indicator, 0.0),
            slope,
            energy_error_j: Judged::scattered(s.energy, of_energy, 0.0),
            energy_error_share: None,
            windows: None,
            noise,
        })
    }
}

/// Delay of `measured` behind `target` in s by correlation, see [`lag`].
#[must_use]
pub fn delay(target: &[f64], measured: &[f64], dt: f64) -> Option<f64> {
    if !(dt > 0.0 && dt.is_finite()) {
        return None;
    }
    let most = ((LAG_S / dt) as usize).clamp(LAG_LEAST, LAG_MOST);
    let n = target.len().min(measured.len());
    let middle = peak(&target[..n]).map_or(n / 2, |peak| peak.index);
    let from = middle
        .saturating_sub(LAG_WINDOW / 2)
        .min(n.saturating_sub(LAG_WINDOW));
    let to = (from + LAG_WINDOW).min(n);
    let found = lag(&target[from..to], &measured[from..to], most)?;
    Some(found * dt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use std::f64::consts::TAU;

    const DT: f64 = 1.0 / 1024.0;

    fn sampled(n: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..n).map(|i| f(i as f64 * DT)).collect()
    }

    /// Normal deviates by the sum of twelve uniform ones.
    fn noise(n: usize, sigma: f64, seed: u64) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
        let mut one = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        (0..n).map(|_| sigma * one()).collect()
    }

    /// Gain 0.95, delay 3.1 ms, 2 Hz, 8 s.
    fn example() -> (Vec<f64>, Vec<f64>) {
        let omega = TAU * 2.0;
        (
            sampled(8193, |t| libm::sin(omega * t)),
            sampled(8193, |t| 0.95 * libm::sin(omega * (t - 3.1e-3))),
        )
    }

    #[test]
    fn gain_and_delay_show_in_every_number() {
        let (c, m) = example();
        // Whole cycles are 8192 intervals; the first sample is that of the last again.
        let found = Tracking::of(&c[..8192], &m[..8192], &[], DT, None).unwrap();
        assert!(
            (found.nrmse.value - 0.062_78).abs() < 1e-5,
            "{:?}",
            found.nrmse
        );
        let index = found.fei.unwrap();
        assert!((index.amplitude.value - 0.95).abs() < 1e-9);
        assert!((index.delay_s.value - 3.1e-3).abs() < 1e-9);
        assert!((found.lag_s.unwrap().value - 3.1e-3).abs() < 1e-9 * DT);
        assert!((found.slope.value - 0.95 * libm::cos(TAU * 2.0 * 3.1e-3)).abs() < 1e-6);
        assert_eq!(found.nrmse.floor, None);
    }

    #[test]
    fn indicator_falls_with_a_lag() {
        // −½ ω G X² sin(ωτ) a second, over 8 s: −1.8597; the chord of a step loses (ω dt)²/6 = 2.5e-5 of it.
        let (c, m) = example();
        let found = Tracking::of(&c, &m, &[], DT, None).unwrap();
        let omega = TAU * 2.0;
        let exact = -0.5 * omega * 0.95 * libm::sin(omega * 3.1e-3) * 8.0;
        assert!((exact + 1.8597).abs() < 1e-4);
        let value = found.tracking_indicator_m2.value;
        assert!((value / exact - 1.0).abs() < 5e-5, "{value} {exact}");
        let lead = Tracking::of(&m, &c, &[], DT, None).unwrap();
        assert!(
            lead.tracking_indicator_m2.value > 0.0,
            "a lead makes it rise"
        );
    }

    #[test]
    fn lag_energy_is_the_area_between_loops() {
        // f = k m, m = X sin ω(t − τ), c = X sin ωt over whole cycles: ∮ f dm = 0 and ∮ f dc = π k X² sin(−ωτ)·(−1)…: with
        // ∫ sin(ωt − φ) cos ωt dωt = −π sin φ, the error −∮ f dc = +π k X² sin φ a cycle.
        let (k, omega, x, tau) = (2e5, TAU * 2.0, 0.01, 4e-3);
        let c = sampled(4097, |t| x * libm::sin(omega * t));
        let m = sampled(4097, |t| x * libm::sin(omega * (t - tau)));
        let f: Vec<f64> = m.iter().map(|m| k * m).collect();
        let found = Tracking::of(&c, &m, &f, DT, None).unwrap();
        let exact = 8.0 * TAU / 2.0 * k * x * x * libm::sin(omega * tau);
        assert!(
            (found.energy_error_j.value / exact - 1.0).abs() < 1e-4,
            "{found:?} {exact}"
        );
    }

    #[test]
    fn perfect_noisy_specimen_shows_floors_only() {
        let sigma = 2e-5;
        let c = sampled(20_000, |t| {
            0.01 * libm::sin(TAU * 1.3 * t) * libm::sin(0.1 * t)
        });
        let noisy: Vec<f64> = c
            .iter()
            .zip(noise(c.len(), sigma, 3))
            .map(|(c, w)| c + w)
            .collect();
        let force: Vec<f64> = c
            .iter()
            .zip(noise(c.len(), 5.0, 4))
            .map(|(c, w)| 1e6 * c + w)
            .collect();
        let rest = Noise::of(&noise(2000, sigma, 5), &noise(2000, 5.0, 6)).unwrap();
        // The standard deviation of 2000 deviates is known to 1/√4000 = 1.6 %.
        assert!((rest.disp_std_m / sigma - 1.0).abs() < 0.05);
        let found = Tracking::of(&c, &noisy, &force, DT, Some(rest)).unwrap();
        let floor = found.nrmse.floor.unwrap();
        assert!((found.nrmse.value / floor - 1.0).abs() < 0.05, "{found:?}");
        assert!(found.nrmse.corrected.unwrap() < 0.33 * floor);
        // The largest of 20 000: √(2 ln n) is an upper estimate, 4.45 σ against 3.9 … 4.6.
        assert!((found.peak_error_m.value / found.peak_error_m.floor.unwrap() - 0.95).abs() < 0.15);
        for (name, judged, perfect) in [
            ("slope", found.slope, 1.0),
            ("indicator", found.tracking_indicator_m2, 0.0),
            ("amplitude", found.fei.unwrap().amplitude, 1.0),
            ("phase", found.fei.unwrap().phase_rad, 0.0),
            ("energy", found.energy_error_j, 0.0),
        ] {
            let floor = judged.floor.unwrap();
            assert!(
                (judged.value - perfect).abs() < 3.5 * floor,
                "{name}: {judged:?}"
            );
            // Without noise the remainder would be far below its scatter.
            assert!(
                (judged.value - perfect).abs() > 1e-3 * floor,
                "{name}: {judged:?}"
            );
        }
    }

    #[test]
    fn error_above_the_noise_is_found() {
        let (c, m) = example();
        let clean = Tracking::of(&c, &m, &[], DT, None).unwrap();
        let sigma = 0.05;
        let noisy: Vec<f64> = m
            .iter()
            .zip(noise(m.len(), sigma, 9))
            .map(|(m, w)| m + w)
            .collect();
        let rest = Noise::of(&noise(4000, sigma, 10), &[0.0; 4000]);
        let found = Tracking::of(&c, &noisy, &[], DT, rest).unwrap();
        assert!(found.nrmse.value > 1.4 * clean.nrmse.value);
        let corrected = found.nrmse.corrected.unwrap();
        assert!(
            (corrected / clean.nrmse.value - 1.0).abs() < 0.05,
            "{found:?}"
        );
        let delay = found.fei.unwrap().delay_s;
        assert!((delay.corrected.unwrap() - 3.1e-3).abs() < 4.0 * delay.floor.unwrap());
    }

    #[test]
    fn no_motion_is_not_judged_gaps_are_skipped() {
        assert_eq!(Tracking::of(&[1.0; 99], &[1.0; 99], &[], DT, None), None);
        assert_eq!(Tracking::of(&[], &[], &[], DT, None), None);
        assert_eq!(Noise::of(&[1.0], &[1.0]), None);
        let (mut c, m) = example();
        c[100] = f64::NAN;
        let found = Tracking::of(&c, &m, &[], DT, None).unwrap();
        assert_eq!(found.samples, 8192);
        assert!((found.nrmse.value - 0.0628).abs() < 1e-4);
    }

    #[test]
    fn long_test_is_searched_at_its_largest() {
        let n = 300_000;
        let burst = |t: f64| libm::exp(-(t - 250.0) * (t - 250.0)) * libm::sin(TAU * 3.0 * t);
        let c = sampled(n, burst);
        let m = sampled(n, |t| burst(t - 0.02));
        assert!((delay(&c, &m, DT).unwrap() - 0.02).abs() < 1e-2 * DT);
    }
}
