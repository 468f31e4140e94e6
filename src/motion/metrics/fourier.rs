//! Spectra of whole records: Fourier amplitudes, and the frequency evaluation index of two of them.
//!
//! The transform is taken over all of a record at once, without a window: a test begins and ends at rest, or its
//! spectrum shows the jump. A length with large prime factors is cut by a few samples, so that the transform stays
//! fast. Missing samples are held at the last value.

use nalgebra::ComplexField as _;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

use super::response::filled;

/// The one-sided transform of a record: `Σ y[n] e^{−iωn}` for 0 … half the sampling rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Distance of two lines in Hz.
    pub spacing_hz: f64,
    /// The lines, the one at frequency 0 first.
    lines: Vec<Complex64>,
    dt: f64,
}

/// Largest number of samples, at most `most`, that has no prime factor above 7.
fn quick_length(most: usize) -> usize {
    let is_smooth = |mut n: usize| {
        for prime in [2, 3, 5, 7] {
            while n.is_multiple_of(prime) {
                n /= prime;
            }
        }
        n == 1
    };
    (1..=most).rev().find(|n| is_smooth(*n)).unwrap_or(0)
}

impl Spectrum {
    /// Transform of `values` sampled every `dt` s, without their mean. `None` with fewer than eight samples or without a
    /// finite one.
    #[must_use]
    pub fn of(values: &[f64], dt: f64) -> Option<Self> {
        let length = quick_length(values.len());
        if length < 8 || !(dt > 0.0 && dt.is_finite()) {
            return None;
        }
        let mut input = filled(values)?;
        input.truncate(length);
        let mean = input.iter().sum::<f64>() / length as f64;
        input.iter_mut().for_each(|v| *v -= mean);
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let mut lines = plan.make_output_vec();
        plan.process(&mut input, &mut lines).ok()?;
        let is_finite = lines.iter().all(|line| line.norm_sqr().is_finite());
        is_finite.then_some(Self {
            spacing_hz: 1.0 / (length as f64 * dt),
            lines,
            dt,
        })
    }

    /// Fourier amplitudes |Y|·Δt in units of the record times s, from the first line above 0 Hz: (frequency in Hz, amplitude).
    pub(crate) fn amplitudes(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let lines = self.lines.iter().enumerate().skip(1);
        lines.map(|(j, line)| (j as f64 * self.spacing_hz, line.modulus() * self.dt))
    }

    /// Which of `bins` equal parts of a logarithmic frequency axis a line is in.
    fn bin_of(&self, line: usize, bins: usize) -> usize {
        let place = libm::log(line as f64) / libm::log(self.lines.len() as f64) * bins as f64;
        (place as usize).min(bins.max(1) - 1)
    }

    /// The largest amplitude in each of `bins` equal parts of a logarithmic frequency axis; empty parts are left out. No
    /// peak is lost.
    #[must_use]
    pub fn envelope(&self, bins: usize) -> Vec<(f64, f64)> {
        let mut best: Vec<Option<(f64, f64)>> = vec![None; bins.max(1)];
        for (line, (frequency, amplitude)) in (1..).zip(self.amplitudes()) {
            let cell = self.bin_of(line, bins);
            if best[cell].is_none_or(|(_, top)| amplitude > top) {
                best[cell] = Some((frequency, amplitude));
            }
        }
        best.into_iter().flatten().collect()
    }
}

/// The frequency evaluation index of Guo, Chen, Xu and Sanchez (2014), l = 2: FEI = Σ (Y_m/Y_c) |Y_c|² / Σ |Y_c|².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evaluation {
    /// |FEI|: measured over command.
    pub amplitude: f64,
    /// Phase of FEI in rad; negative where the measured one is behind.
    pub phase: f64,
    /// Σ f |Y_c|² / Σ |Y_c|² in Hz: the frequency that the other three belong to.
    pub frequency_hz: f64,
    /// −phase / (2π f) in s.
    pub delay: f64,
}

/// The index of `measured` against `command`; none without motion or where the lengths differ.
#[must_use]
pub fn evaluate(command: &Spectrum, measured: &Spectrum) -> Option<Evaluation> {
    if command.lines.len() != measured.lines.len() {
        return None;
    }
    let (mut sum, mut power, mut moment) = (Complex64::ZERO, 0.0, 0.0);
    let pairs = command.lines.iter().zip(&measured.lines);
    for (j, (c, m)) in pairs.enumerate().skip(1) {
        sum += m * c.conj();
        power += c.norm_sqr();
        moment += j as f64 * command.spacing_hz * c.norm_sqr();
    }
    let index = sum / power;
    let frequency_hz = moment / power;
    let phase = libm::atan2(index.im, index.re);
    let delay = -phase / (2.0 * std::f64::consts::PI * frequency_hz);
    (power > 0.0 && delay.is_finite() && index.modulus().is_finite()).then(|| Evaluation {
        amplitude: index.modulus(),
        phase,
        frequency_hz,
        delay,
    })
}

/// One point of the frequency response of an actuator: gain and phase of the measured over the command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Hz.
    pub frequency_hz: f64,
    /// Measured over command.
    pub gain: f64,
    /// In rad; negative where the measured one is behind.
    pub phase: f64,
}

/// Share of the command's largest amplitude below which a line counts for nothing.
const HEARD: f64 = 0.01;

/// The frequency response in each of `bins` equal parts of a logarithmic frequency axis, Σ Y_m Ȳ_c / Σ |Y_c|² over the lines at
/// which the command has more than a hundredth of its largest amplitude. Parts without such a line are left out.
#[must_use]
pub fn response(command: &Spectrum, measured: &Spectrum, bins: usize) -> Vec<Response> {
    let largest = command
        .lines
        .iter()
        .skip(1)
        .map(|c| c.norm_sqr())
        .fold(0.0, f64::max);
    let mut sums = vec![(Complex64::ZERO, 0.0, 0.0); bins.max(1)];
    let pairs = command
        .lines
        .iter()
        .zip(&measured.lines)
        .enumerate()
        .skip(1);
    for (j, (c, m)) in pairs.filter(|(_, (c, _))| c.norm_sqr() > HEARD * HEARD * largest) {
        let (sum, power, moment) = &mut sums[command.bin_of(j, bins)];
        *sum += m * c.conj();
        *power += c.norm_sqr();
        *moment += j as f64 * command.spacing_hz * c.norm_sqr();
    }
    let heard = sums.into_iter().filter(|(_, power, _)| *power > 0.0);
    let found = heard.map(|(sum, power, moment)| Response {
        frequency_hz: moment / power,
        gain: sum.modulus() / power,
        phase: libm::atan2(sum.im, sum.re),
    });
    found.filter(|found| found.gain.is_finite()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sampled(n: usize, dt: f64, f: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..n).map(|i| f(i as f64 * dt)).collect()
    }

    #[test]
    fn lengths_are_cut_to_a_fast_length() {
        assert_eq!(quick_length(1), 1);
        assert_eq!(quick_length(1021), 1008);
        assert_eq!(quick_length(8192), 8192);
        assert_eq!(quick_length(0), 0);
    }

    #[test]
    fn sine_line_has_half_amplitude_times_time() {
        // Over whole cycles |Σ a sin| = a n/2, so |Y| dt = a T / 2; every other line is roundoff.
        let (dt, a) = (1.0 / 512.0, 0.03);
        let wave = sampled(4096, dt, |t| 5.0 + a * libm::sin(TAU * 4.0 * t));
        let spectrum = Spectrum::of(&wave, dt).unwrap();
        let top = spectrum.envelope(200).into_iter();
        let top = top.max_by(|p, q| p.1.total_cmp(&q.1)).unwrap();
        assert!((top.0 - 4.0).abs() < 1e-12);
        assert!((top.1 / (a * 8.0 / 2.0) - 1.0).abs() < 1e-10, "{top:?}");
        let rest: f64 = spectrum
            .amplitudes()
            .filter(|p| p.0 != 4.0)
            .map(|p| p.1)
            .sum();
        assert!(rest < 1e-9 * top.1);
    }

    #[test]
    fn response_has_gain_and_phase_where_the_command_moves() {
        // 0.9 at 2 Hz and 0.5 at 8 Hz, both 3.1 ms late.
        let dt = 1.0 / 1024.0;
        let wave = |gains: [f64; 2], late: f64| {
            let at = |t: f64, hz: f64| libm::sin(TAU * hz * (t - late));
            let all = sampled(8192, dt, |t| gains[0] * at(t, 2.0) + gains[1] * at(t, 8.0));
            Spectrum::of(&all, dt).unwrap()
        };
        let found = response(&wave([1.0, 0.3], 0.0), &wave([0.9, 0.15], 3.1e-3), 200);
        assert_eq!(found.len(), 2, "{found:?}");
        for (one, (hz, gain)) in found.iter().zip([(2.0, 0.9), (8.0, 0.5)]) {
            assert!((one.frequency_hz - hz).abs() < 1e-9 && (one.gain - gain).abs() < 1e-9);
            assert!((one.phase + TAU * hz * 3.1e-3).abs() < 1e-9, "{one:?}");
        }
    }

    #[test]
    fn index_finds_gain_and_delay() {
        // Gain 0.95, delay 3.1 ms, 2 Hz.
        let dt = 1.0 / 1024.0;
        let omega = TAU * 2.0;
        let command = sampled(8192, dt, |t| libm::sin(omega * t));
        let measured = sampled(8192, dt, |t| 0.95 * libm::sin(omega * (t - 3.1e-3)));
        let of = |v: &[f64]| Spectrum::of(v, dt).unwrap();
        let found = evaluate(&of(&command), &of(&measured)).unwrap();
        assert!((found.amplitude - 0.95).abs() < 1e-9, "{found:?}");
        assert!((found.frequency_hz - 2.0).abs() < 1e-9);
        assert!((found.delay - 3.1e-3).abs() < 1e-10);
        assert!((found.phase + omega * 3.1e-3).abs() < 1e-9);
        let ahead = evaluate(&of(&measured), &of(&command)).unwrap();
        assert!((ahead.delay + 3.1e-3).abs() < 1e-10, "a lead is negative");
    }

    #[test]
    fn index_of_a_band_has_the_whole_delay() {
        // Eight sines on lines of the transform, all delayed by 5 ms: each has the phase −ω τ. The mean phasor has the mean
        // phase up to third order in the spread of ωτ (below 0.1 rad): 1e-4 of τ.
        let dt = 1.0 / 1024.0;
        let band = |t: f64| -> f64 {
            (8..16)
                .map(|k| libm::sin(TAU * f64::from(k) / 8.0 * t + f64::from(k * k)))
                .sum()
        };
        let command = sampled(8192, dt, band);
        let measured = sampled(8192, dt, |t| band(t - 5e-3));
        let of = |v: &[f64]| Spectrum::of(v, dt).unwrap();
        let found = evaluate(&of(&command), &of(&measured)).unwrap();
        assert!((found.delay / 5e-3 - 1.0).abs() < 1e-3, "{found:?}");
        assert!((found.frequency_hz - 11.5 / 8.0).abs() < 1e-9);
    }

    #[test]
    fn no_motion_has_no_spectrum_and_no_index() {
        assert_eq!(Spectrum::of(&[], 0.1), None);
        assert_eq!(Spectrum::of(&[f64::NAN; 64], 0.1), None);
        assert_eq!(Spectrum::of(&[1.0; 64], 0.0), None);
        assert_eq!(
            Spectrum::of(
                &[1e200, -1e200, 1e200, -1e200, 1e200, -1e200, 0.0, 1e200],
                1.0
            ),
            None
        );
        let still = Spectrum::of(&[1.0; 64], 0.1).unwrap();
        assert_eq!(evaluate(&still, &still), None);
        let longer = Spectrum::of(&[1.0; 128], 0.1).unwrap();
        assert_eq!(evaluate(&still, &longer), None);
    }
}
