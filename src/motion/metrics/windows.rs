//! Phase and amplitude errors over the course of a test, in moving windows: PAEI and FDB after Mirza Hessabi and Mercan.
//!
//! The published wording was not available; these are well-defined forms of those indices. Every window has the taper of Hann
//! and some periods of the target; windows in which the target hardly moves are skipped, and there are never more than a few
//! hundred.
//!
//! - **PAEI**, phase and amplitude error indices (2012), in the plane of measured y against target x, about the window's means: of
//!   the ellipse x = X cos θ, y = G X cos(θ + ψ) the second moments give the amplitude index G − 1 = √(S_yy/S_xx) − 1 and
//!   cos ψ = S_xy/√(S_xx S_yy), and the area that is swept, with the sense in which it is, gives sin ψ. Neither is in the other: a
//!   pure gain sweeps no area, a pure phase leaves the moments alike.
//! - **FDB**, frequency-domain-based indicators (2014): at the dominant frequency of the target in the window, the amplitude of
//!   the measured over that of the target, less one, and the phase between them.
//!
//! Phases are negative where the measured displacement is behind, as in the frequency evaluation index.

use nalgebra::ComplexField as _;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

use super::floor::Judged;

/// Periods of the target in a window, by its rms frequency over the whole test.
const PERIODS: f64 = 4.0;
/// Windows at most; and how many of them a sample is in, where there is room.
const MOST: usize = 512;
const OVERLAP: usize = 4;
/// Samples of a window at least.
const LEAST: usize = 32;
/// Share of the largest window's motion below which a window says nothing.
const MOVES: f64 = 0.05;

/// A number in all windows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Its median; the floor is the scatter of one window.
    pub p50: Judged,
    /// The farthest from zero, with its sign; the floor is the largest of as many scatters.
    pub worst: Judged,
}

/// Amplitude and phase error in all windows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Measured over target, less one.
    pub amplitude: Spread,
    /// Negative: the measured displacement is behind.
    pub phase_rad: Spread,
}

/// Both indicators over a test.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Windows {
    /// Length of a window in s.
    pub window_s: f64,
    /// Windows with enough motion.
    pub windows: u64,
    /// Phase and amplitude error indices.
    pub paei: Errors,
    /// Frequency-domain-based indicators.
    pub fdb: Errors,
}

/// The course of both indicators; not a number where a window says nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Histories {
    /// Samples from the beginning to the middle of each window.
    pub middle: Vec<usize>,
    /// PAEI: amplitude and phase.
    pub paei: [Vec<f64>; 2],
    /// FDB: amplitude and phase.
    pub fdb: [Vec<f64>; 2],
    /// Dominant frequency of each window, Hz.
    pub frequency_hz: Vec<f64>,
}

/// Result of one window: (amplitude, phase), each with the scatter due to noise of unit size.
#[derive(Debug, Clone, Copy)]
struct Look {
    values: [f64; 2],
    scatter: [f64; 2],
    /// Bias of the amplitude, per noise squared: noise adds to its moments.
    bias: f64,
}

/// Weights of a window's samples, and of the steps between them.
struct Taper {
    weights: Vec<f64>,
    steps: Vec<f64>,
    sum: f64,
    of_steps: f64,
}

impl Taper {
    fn new(length: usize) -> Self {
        let at = |place: f64| {
            let half = libm::sin(PI * place / length as f64);
            half * half
        };
        let weights: Vec<f64> = (0..length).map(|i| at(i as f64 + 0.5)).collect();
        let steps: Vec<f64> = (1..length).map(|i| at(i as f64)).collect();
        Self {
            sum: weights.iter().sum(),
            of_steps: steps.iter().sum(),
            weights,
            steps,
        }
    }

    fn mean(&self, values: &[f64]) -> f64 {
        let sum: f64 = values.iter().zip(&self.weights).map(|(v, w)| v * w).sum();
        sum / self.sum
    }

    /// Σ w a b / Σ w.
    fn moment(&self, a: &[f64], b: &[f64]) -> f64 {
        let each = a.iter().zip(b).zip(&self.weights);
        each.map(|((a, b), w)| w * a * b).sum::<f64>() / self.sum
    }

    /// The ellipse of y against x, both about their means.
    fn ellipse(&self, x: &[f64], y: &[f64]) -> Option<Look> {
        let (xx, xy, yy) = (self.moment(x, x), self.moment(x, y), self.moment(y, y));
        let sine = self.sine_of_step(x, xx);
        if !(xx > 0.0 && yy > 0.0 && sine > 0.0) {
            return None;
        }
        let gain = (yy / xx).sqrt();
        let (mut swept, mut before, mut square) = (0.0, 0.0, 0.0);
        for (i, w) in self.steps.iter().enumerate() {
            swept += w * (x[i] * y[i + 1] - x[i + 1] * y[i]);
            // Factor of y[i] in the sum: from the step before, and from this one.
            let place: f64 = before - w * x[i + 1];
            square += place * place;
            before = w * x[i];
        }
        // Twice the area that a quarter of a period behind would sweep in a step.
        let quadrature = 2.0 * xx * sine;
        let behind = swept / (self.of_steps * gain * quadrature);
        let phase = libm::atan2(-behind, xy / (xx * gain));
        let weighted = x.iter().zip(&self.weights).map(|(x, w)| w * w * x * x);
        Some(Look {
            values: [gain - 1.0, phase],
            scatter: [
                weighted.sum::<f64>().sqrt() / (self.sum * xx),
                square.sqrt() / (self.of_steps * quadrature),
            ],
            bias: 0.5 / xx,
        })
    }

    /// sin ω Δt of the rms frequency.
    fn sine_of_step(&self, x: &[f64], xx: f64) -> f64 {
        let steps = x.windows(2).zip(&self.steps);
        let square: f64 = steps.map(|(x, w)| w * (x[1] - x[0]) * (x[1] - x[0])).sum();
        let half = (square / self.of_steps / (4.0 * xx)).min(1.0).sqrt();
        2.0 * half * (1.0 - half * half).sqrt()
    }

    /// Amplitude and phase at `omega` (rad per sample).
    fn at_frequency(&self, x: &[f64], y: &[f64], omega: f64) -> Option<Look> {
        let (sine, cosine) = libm::sincos(-omega);
        let step = Complex64::new(cosine, sine);
        let mut turn = Complex64::new(1.0, 0.0);
        let (mut c, mut m) = (Complex64::default(), Complex64::default());
        for ((x, y), w) in x.iter().zip(y).zip(&self.weights) {
            c += turn * (w * x);
            m += turn * (w * y);
            turn *= step;
        }
        let ratio = m / c;
        if !(c.modulus() > 0.0 && ratio.modulus().is_finite()) {
            return None;
        }
        let square: f64 = self.weights.iter().map(|w| w * w).sum();
        let scatter = (0.5 * square).sqrt() / c.modulus();
        Some(Look {
            values: [ratio.modulus() - 1.0, libm::atan2(ratio.im, ratio.re)],
            scatter: [scatter; 2],
            bias: 0.0,
        })
    }
}

/// The transform that finds the dominant frequency of a window.
struct Finder {
    plan: std::sync::Arc<dyn realfft::RealToComplex<f64>>,
    input: Vec<f64>,
    lines: Vec<Complex64>,
}

impl Finder {
    fn new(length: usize) -> Self {
        // Twice as long, so that the peak is broad.
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward((2 * length).next_power_of_two());
        Self {
            input: plan.make_input_vec(),
            lines: plan.make_output_vec(),
            plan,
        }
    }

    /// rad per sample; the parabola goes through the logarithms.
    fn dominant(&mut self, x: &[f64], taper: &Taper) -> Option<f64> {
        self.input.fill(0.0);
        for (to, (x, w)) in self.input.iter_mut().zip(x.iter().zip(&taper.weights)) {
            *to = x * w;
        }
        self.plan.process(&mut self.input, &mut self.lines).ok()?;
        let sizes = self.lines.iter().map(|line| line.norm_sqr()).enumerate();
        let (peak, size) = sizes.skip(1).max_by(|a, b| a.1.total_cmp(&b.1))?;
        if !(size > 0.0 && size.is_finite()) {
            return None;
        }
        let log = |at: usize| {
            let size = self.lines.get(at).map_or(0.0, |line| line.norm_sqr());
            libm::log(size.max(f64::MIN_POSITIVE))
        };
        let (left, middle, right) = (log(peak - 1), log(peak), log(peak + 1));
        let bend = left - 2.0 * middle + right;
        let off = if bend < 0.0 {
            (0.5 * (left - right) / bend).clamp(-0.5, 0.5)
        } else {
            0.0
        };
        Some(TAU * (peak as f64 + off) / self.input.len() as f64)
    }
}

/// Samples of a window: some periods of the target's rms frequency; none of a target that does not move.
fn length_of(target: &[f64]) -> Option<usize> {
    let n = target.len();
    let finite = || target.iter().filter(|v| v.is_finite());
    let mean = finite().sum::<f64>() / finite().count() as f64;
    let square: f64 = finite().map(|v| (v - mean) * (v - mean)).sum();
    let steps = target.windows(2).map(|v| v[1] - v[0]);
    let swept: f64 = steps
        .filter(|step| step.is_finite())
        .map(|step| step * step)
        .sum();
    let half = (swept / (4.0 * square)).min(1.0).sqrt();
    let omega = 2.0 * libm::asin(half);
    if !(omega > 0.0 && n >= LEAST) {
        return None;
    }
    Some(((PERIODS * TAU / omega).round() as usize).clamp(LEAST, n))
}

/// Both indicators of `measured` against `target`, sampled every `dt` s, with noise of `sigma` on the measured. None without
/// motion, or of fewer than 32 samples.
#[must_use]
pub fn look(
    target: &[f64],
    measured: &[f64],
    dt: f64,
    sigma: Option<f64>,
) -> Option<(Windows, Histories)> {
    let n = target.len().min(measured.len());
    let (target, measured) = (&target[..n], &measured[..n]);
    let length = length_of(target)?;
    let hop = (length / OVERLAP)
        .max((n - length).div_ceil(MOST - 1))
        .max(1);
    let taper = Taper::new(length);
    let mut finder = Finder::new(length);
    let starts: Vec<usize> = (0..=n - length).step_by(hop).collect();
    let about_mean = |values: &[f64]| {
        let mean = taper.mean(values);
        values.iter().map(|v| v - mean).collect::<Vec<f64>>()
    };
    let motion = |start: usize| {
        let x = about_mean(&target[start..start + length]);
        taper.moment(&x, &x)
    };
    // Missing samples make a window that is not a number, which no comparison lets in.
    let motions: Vec<f64> = starts.iter().map(|start| motion(*start)).collect();
    let least = MOVES * MOVES * motions.iter().copied().fold(0.0, f64::max);
    let mut histories = Histories::default();
    let mut looks: [Vec<Look>; 2] = Default::default();
    for (start, motion) in starts.into_iter().zip(motions) {
        let range = start..start + length;
        let found = (motion > least).then(|| {
            let (x, y) = (
                about_mean(&target[range.clone()]),
                about_mean(&measured[range.clone()]),
            );
            let omega = finder.dominant(&x, &taper)?;
            let (ellipse, line) = (taper.ellipse(&x, &y)?, taper.at_frequency(&x, &y, omega)?);
            Some((ellipse, line, omega))
        });
        let found = found.flatten();
        histories.middle.push(start + length / 2);
        let none = [f64::NAN; 2];
        let (paei, fdb, omega) = found.map_or((none, none, f64::NAN), |(ellipse, line, omega)| {
            (ellipse.values, line.values, omega)
        });
        for place in 0..2 {
            histories.paei[place].push(paei[place]);
            histories.fdb[place].push(fdb[place]);
        }
        histories.frequency_hz.push(omega / (TAU * dt));
        if let Some((ellipse, line, _)) = found {
            looks[0].push(ellipse);
            looks[1].push(line);
        }
    }
    let [paei, fdb] = &looks;
    let windows = Windows {
        window_s: length as f64 * dt,
        windows: paei.len() as u64,
        paei: errors(paei, sigma)?,
        fdb: errors(fdb, sigma)?,
    };
    Some((windows, histories))
}

fn errors(looks: &[Look], sigma: Option<f64>) -> Option<Errors> {
    let spread = |place: usize| {
        let floor = |look: &Look| {
            let bias = if place == 0 { look.bias } else { 0.0 };
            sigma.map(|sigma| libm::hypot(sigma * look.scatter[place], sigma * sigma * bias))
        };
        let values = looks.iter().map(|look| look.values[place]);
        let floors: Option<Vec<f64>> = looks.iter().map(floor).collect();
        let worst = looks
            .iter()
            .max_by(|a, b| a.values[place].abs().total_cmp(&b.values[place].abs()))?;
        let largest = (2.0 * libm::log(looks.len() as f64)).max(1.0).sqrt();
        let of_worst = floor(worst).map(|floor| floor * largest);
        Some(Spread {
            p50: Judged::scattered(median(values.collect())?, floors.and_then(median), 0.0),
            worst: Judged::scattered(worst.values[place], of_worst, 0.0),
        })
    };
    Some(Errors {
        amplitude: spread(0)?,
        phase_rad: spread(1)?,
    })
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    let (low, high) = (values.get(n.checked_sub(1)? / 2)?, values.get(n / 2)?);
    Some(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};

    const DT: f64 = 1.0 / 1024.0;

    fn sampled(n: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..n).map(|i| f(i as f64 * DT)).collect()
    }

    /// Gain and phase of a sine of 2 Hz about an offset.
    fn sine(gain: f64, phase: f64) -> (Windows, Histories) {
        let wave = |size: f64, phase: f64| {
            sampled(16 * 1024, move |t| size * libm::sin(TAU * 2.0 * t + phase))
        };
        let target: Vec<f64> = wave(0.01, 0.0).iter().map(|x| 0.3 + x).collect();
        look(&target, &wave(0.01 * gain, phase), DT, None).unwrap()
    }

    fn all(windows: &Windows) -> [[f64; 2]; 4] {
        let of = |spread: Spread| [spread.p50.value, spread.worst.value];
        [
            of(windows.paei.amplitude),
            of(windows.paei.phase_rad),
            of(windows.fdb.amplitude),
            of(windows.fdb.phase_rad),
        ]
    }

    #[test]
    fn gain_and_phase_are_separated_with_signs() {
        for (gain, phase) in [
            (0.93, -0.05),
            (1.08, 0.2),
            (1.0, -0.6),
            (0.5, 2.0),
            (1.0, -2.5),
        ] {
            let (windows, _) = sine(gain, phase);
            // Four periods and their taper: the window's ripple is below 1e-4 even where it is a sample off whole periods.
            assert!((windows.window_s - 2.0).abs() < 2.0 * DT, "{windows:?}");
            let [amplitude, angle, of_line, at_line] = all(&windows);
            for found in amplitude.into_iter().chain(of_line) {
                assert!(
                    (found - (gain - 1.0)).abs() < 2e-4,
                    "{gain} {phase}: {windows:?}"
                );
            }
            for found in angle.into_iter().chain(at_line) {
                assert!((found - phase).abs() < 2e-4, "{gain} {phase}: {windows:?}");
            }
        }
    }

    #[test]
    fn pure_gain_and_pure_phase_stay_apart() {
        // Three frequencies that beat, and a decay: no window holds whole periods.
        let motion = |t: f64| {
            libm::exp(-0.1 * t)
                * (libm::sin(TAU * 1.3 * t)
                    + 0.6 * libm::sin(TAU * 2.9 * t + 1.0)
                    + 0.2 * libm::sin(TAU * 7.7 * t))
        };
        let target = sampled(20_000, motion);
        let scaled: Vec<f64> = target.iter().map(|x| 0.8 * x).collect();
        let (windows, histories) = look(&target, &scaled, DT, None).unwrap();
        let [amplitude, angle, of_line, at_line] = all(&windows);
        for found in amplitude.into_iter().chain(of_line) {
            assert!((found + 0.2).abs() < 1e-12, "{windows:?}");
        }
        let phases = [&histories.paei[1], &histories.fdb[1]];
        for found in phases.into_iter().flatten().chain(&angle).chain(&at_line) {
            assert!(found.is_nan() || found.abs() < 1e-12, "{windows:?}");
        }
        // A delay of one sample turns each frequency by as much as it should, and scales none: what is left of amplitude is the
        // decay of that sample.
        let (windows, _) = look(&target[1..], &target[..target.len() - 1], DT, None).unwrap();
        let [amplitude, angle, of_line, at_line] = all(&windows);
        for found in [amplitude[0], of_line[0]] {
            assert!(found.abs() < 2e-4, "{windows:?}");
        }
        let lowest = -TAU * 1.3 * DT;
        assert!((at_line[0] / lowest - 1.0).abs() < 0.02, "{windows:?}");
        assert!(
            angle[0] < 0.9 * lowest && angle[0] > 3.0 * lowest,
            "{windows:?}"
        );
    }

    #[test]
    fn sweep_shows_its_delay_in_every_window() {
        // 1 to 6 Hz in 40 s, 5 ms behind.
        let wave = |t: f64| libm::sin(TAU * (t + 5.0 / 80.0 * t * t));
        let (target, measured) = (
            sampled(40_960, wave),
            sampled(40_960, |t| 0.9 * wave(t - 5e-3)),
        );
        let (windows, histories) = look(&target, &measured, DT, None).unwrap();
        let all = histories.middle.iter().zip(&histories.frequency_hz);
        for ((middle, frequency), phase) in all.zip(&histories.fdb[1]) {
            let hertz = 1.0 + *middle as f64 * DT / 8.0;
            // A window is as long for every frequency: below two periods in it the mirror image at −f leaks in.
            if hertz * windows.window_s < 2.0 {
                continue;
            }
            assert!(
                (frequency / hertz - 1.0).abs() < 0.05,
                "{frequency} {hertz}"
            );
            assert!(
                (phase / (-TAU * hertz * 5e-3) - 1.0).abs() < 0.05,
                "{phase} {hertz}"
            );
        }
        assert!((windows.fdb.amplitude.p50.value + 0.1).abs() < 2e-3);
        // The worst is at the highest frequency, the median in the middle.
        let worst = windows.paei.phase_rad.worst.value;
        assert!((worst / (-TAU * 6.0 * 5e-3) - 1.0).abs() < 0.1, "{worst}");
        let middle = windows.paei.phase_rad.p50.value;
        assert!(
            (middle / (-TAU * 3.5 * 5e-3) - 1.0).abs() < 0.05,
            "{middle}"
        );
    }

    #[test]
    fn noise_scatters_windows_by_their_floors() {
        let sigma = 3e-4;
        let target = sampled(200_000, |t| 0.01 * libm::sin(TAU * 2.0 * t));
        let mut rng = rand_pcg::Pcg64::seed_from_u64(7);
        let mut noise = || sigma * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
        let measured: Vec<f64> = target.iter().map(|x| x + noise()).collect();
        let (windows, histories) = look(&target, &measured, DT, Some(sigma)).unwrap();
        let rms = |values: &[f64]| {
            (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
        };
        for (values, spread) in [
            (&histories.paei[0], windows.paei.amplitude),
            (&histories.paei[1], windows.paei.phase_rad),
            (&histories.fdb[0], windows.fdb.amplitude),
            (&histories.fdb[1], windows.fdb.phase_rad),
        ] {
            let (found, floor) = (rms(values), spread.p50.floor.unwrap());
            // 387 windows, a quarter of them apart: known to about 7 %.
            assert!((found / floor - 1.0).abs() < 0.2, "{found} {floor}");
            let of_worst = spread.worst.floor.unwrap();
            assert!(spread.worst.value.abs() < 1.3 * of_worst && of_worst > 2.0 * floor);
            assert_eq!(
                (spread.p50.corrected, spread.worst.corrected),
                (Some(0.0), Some(0.0))
            );
        }
        let (windows, _) = look(&target, &measured, DT, None).unwrap();
        assert_eq!(windows.fdb.amplitude.p50.floor, None);
    }

    #[test]
    fn change_at_half_time_is_found_there() {
        let target = sampled(40_960, |t| {
            if t < 30.0 {
                0.01 * libm::sin(TAU * 2.0 * t)
            } else {
                0.0
            }
        });
        let measured: Vec<f64> = (0..target.len())
            .map(|i| target[i] * if i < 20 * 1024 { 1.0 } else { 0.7 })
            .collect();
        let (windows, histories) = look(&target, &measured, DT, None).unwrap();
        for (middle, amplitude) in histories.middle.iter().zip(&histories.paei[0]) {
            let t = *middle as f64 * DT;
            match t {
                _ if t < 18.5 => assert!(amplitude.abs() < 1e-12, "{t}: {amplitude}"),
                _ if t > 21.5 && t < 28.5 => assert!((amplitude + 0.3).abs() < 1e-12),
                _ if t > 31.5 => assert!(amplitude.is_nan(), "{t}: {amplitude}"),
                _ => {}
            }
        }
        assert!(windows.paei.amplitude.p50.value.abs() < 1e-9);
        assert!((windows.paei.amplitude.worst.value + 0.3).abs() < 1e-9);
        assert!((windows.windows as usize) < histories.middle.len());
    }

    #[test]
    fn number_of_windows_is_bounded() {
        let target = sampled(600_000, |t| libm::sin(TAU * 3.0 * t));
        let (_, histories) = look(&target, &target, DT, None).unwrap();
        let count = histories.middle.len();
        assert!(count > MOST / 2 && count <= MOST, "{count}");
        assert_eq!(look(&[0.0; 100], &[0.0; 100], DT, None), None);
        assert_eq!(
            look(&target[..LEAST - 1], &target[..LEAST - 1], DT, None),
            None
        );
        let mut torn = target[..20_000].to_vec();
        torn[9000] = f64::NAN;
        let (windows, histories) = look(&torn, &target[..20_000], DT, None).unwrap();
        assert!(histories.fdb[0].iter().any(|v| v.is_nan()) && windows.windows > 10);
    }
}
