//! Gain and delay over frequency.
//!
//! A bin is a group of neighbouring lines. In it the response, once the coarse delay is taken out, is a straight line
//! over frequency by least squares. The line gives the value at the middle of the bin; its residual is noise and gives
//! the coherence. A delay is the unwrapped phase over ω; the coarse delay decides how many turns the phase has made.

use nalgebra::ComplexField as _;
use rustfft::FftPlanner;
use serde::Serialize;

use super::TRUSTED;
use super::lines::{C64, Lines};

/// Fewest lines in a bin, and most bins.
const LINES: usize = 8;
const BINS: usize = 48;
/// Bins on either side that the noise of one is averaged over.
const NEIGHBOURS: usize = 3;
/// Longest lead and lag in the search, in s.
const LEAD_S: f64 = 0.1;
const LAG_S: f64 = 1.0;
/// Noise of a line never counts as less than this part of the measured signal: roundoff is no proof.
const ROUNDOFF: f64 = 1e-12;

/// The response at one frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Frequency.
    pub hz: f64,
    /// Measured over commanded amplitude.
    pub gain: f64,
    /// Its standard error.
    pub gain_std: f64,
    /// Unwrapped phase lag over ω, in s.
    pub delay_s: f64,
    /// Its standard error.
    pub delay_std_s: f64,
    /// Share of the measured power that the command explains, from 0 to 1.
    pub coherence: f64,
    /// Whether the coherence is high enough to use the point.
    pub trusted: bool,
}

/// Some neighbouring lines.
pub(super) struct Bin {
    omega: f64,
    lines: std::ops::Range<usize>,
    /// Response at ω without the coarse delay.
    pub value: C64,
    /// Variance of its real part.
    variance: f64,
    /// Mean square of the residual, per line.
    noise: f64,
    /// Mean square of the measured signal.
    power: f64,
    coherence: f64,
}

impl Lines {
    /// e^{iωτ} for each line.
    fn lead(&self, seconds: f64) -> impl Iterator<Item = C64> {
        self.omega.iter().map(move |omega| {
            let (sine, cosine) = libm::sincos(omega * seconds);
            C64::new(cosine, sine)
        })
    }
}

/// Delay in s to within a sample, and 1 or −1: where the phases of all lines agree best.
pub(super) fn coarse_delay(lines: &Lines) -> (f64, f64) {
    let n = lines.samples;
    let mut agreement = vec![C64::new(0.0, 0.0); n];
    let first = lines.omega.first().copied().unwrap_or(0.0);
    let at = (first * n as f64 * lines.dt / (2.0 * std::f64::consts::PI)).round() as usize;
    let pairs = lines.command.iter().zip(&lines.measured);
    for (slot, (u, y)) in agreement.iter_mut().skip(at).zip(pairs) {
        let product = y * u.conj();
        let size = product.modulus();
        if size > 0.0 {
            *slot = product / size;
        }
    }
    FftPlanner::<f64>::new()
        .plan_fft_inverse(n)
        .process(&mut agreement);
    let samples = |seconds: f64| ((seconds / lines.dt).ceil() as usize).min(n / 4);
    let lags = (0..=samples(LAG_S)).map(|i| (i, i as f64));
    let leads = (1..=samples(LEAD_S)).map(|i| (n - i, -(i as f64)));
    let mut best = (0.0, 0.0, 1.0);
    for (place, shift) in lags.chain(leads) {
        let value = agreement.get(place).map_or(0.0, |c| c.re);
        if value.abs() > best.0 {
            best = (value.abs(), shift, value.signum());
        }
    }
    (best.1 * lines.dt, best.2)
}

/// The bins of the band.
pub(super) fn bins(lines: &Lines, coarse: f64) -> Vec<Bin> {
    let m = lines.omega.len();
    let count = (m / LINES).clamp(1, BINS);
    let lead: Vec<C64> = lines.lead(coarse).collect();
    let edge = |bin: usize| bin * m / count;
    (0..count)
        .filter_map(|bin| in_bin(lines, &lead, edge(bin)..edge(bin + 1)))
        .collect()
}

fn in_bin(lines: &Lines, lead: &[C64], range: std::ops::Range<usize>) -> Option<Bin> {
    let omega = lines.omega.get(range.clone())?;
    let command = lines.command.get(range.clone())?;
    let measured = lines.measured.get(range.clone())?;
    let lead = lead.get(range.clone())?;
    // Power-weighted mean frequency of the command, so that value and slope are uncorrelated.
    let weights: f64 = command.iter().map(C64::norm_sqr).sum();
    let moment: f64 = command
        .iter()
        .zip(omega)
        .map(|(u, w)| u.norm_sqr() * w)
        .sum();
    let is_driven = weights > 0.0;
    if !is_driven {
        return None;
    }
    let middle = moment / weights;
    let (mut straight, mut slope, mut square) = (C64::new(0.0, 0.0), C64::new(0.0, 0.0), 0.0);
    for (((u, y), w), lead) in command.iter().zip(measured).zip(omega).zip(lead) {
        let product = y * lead * u.conj();
        straight += product;
        slope += product * (w - middle);
        square += u.norm_sqr() * (w - middle) * (w - middle);
    }
    let value = straight / weights;
    let slope = if square > 0.0 {
        slope / square
    } else {
        C64::new(0.0, 0.0)
    };
    let (mut left, mut power) = (0.0, 0.0);
    for (((u, y), w), lead) in command.iter().zip(measured).zip(omega).zip(lead) {
        let found = y * lead;
        left += (found - (value + slope * (w - middle)) * u).norm_sqr();
        power += found.norm_sqr();
    }
    let count = omega.len() as f64;
    let noise = left / (count - 2.0);
    let power = power / count;
    Some(Bin {
        omega: middle,
        lines: range,
        value,
        variance: 0.5 * noise / weights,
        noise,
        power,
        coherence: if power > 0.0 {
            (1.0 - noise / power).clamp(0.0, 1.0)
        } else {
            0.0
        },
    })
}

/// Mean coherence over the band.
pub(super) fn mean_coherence(bins: &[Bin]) -> f64 {
    bins.iter().map(|bin| bin.coherence).sum::<f64>() / bins.len().max(1) as f64
}

/// Gain and delay of each bin.
pub(super) fn points(bins: &[Bin], coarse: f64) -> Vec<Point> {
    use std::f64::consts::PI;
    let mut before = 0.0;
    bins.iter()
        .map(|bin| {
            let trusted = bin.coherence >= TRUSTED;
            let raw = libm::atan2(bin.value.im, bin.value.re);
            let turns = ((before - raw) / (2.0 * PI)).round();
            let phase = raw + 2.0 * PI * turns;
            // A noisy bin must not add a turn to the phase of the others.
            if trusted {
                before = phase;
            }
            let gain = bin.value.modulus();
            let std = bin.variance.sqrt();
            Point {
                hz: bin.omega / (2.0 * PI),
                gain,
                gain_std: std,
                delay_s: coarse - phase / bin.omega,
                delay_std_s: if gain > 0.0 {
                    std / (gain * bin.omega)
                } else {
                    f64::MAX
                },
                coherence: bin.coherence,
                trusted,
            }
        })
        .collect()
}

/// Standard deviation of the noise of each of `lines` lines, from the bins around it.
pub(super) fn deviations(bins: &[Bin], lines: usize) -> Vec<f64> {
    let mut all = vec![1.0; lines];
    for (index, bin) in bins.iter().enumerate() {
        let from = index.saturating_sub(NEIGHBOURS);
        let to = (index + NEIGHBOURS + 1).min(bins.len());
        let around = bins.get(from..to).unwrap_or_default();
        let freedom = |bin: &Bin| bin.lines.len() as f64 - 2.0;
        let sum: f64 = around.iter().map(|bin| bin.noise * freedom(bin)).sum();
        let count: f64 = around.iter().map(freedom).sum();
        let variance = (sum / count).max(ROUNDOFF * ROUNDOFF * bin.power);
        if let Some(slots) = all.get_mut(bin.lines.clone())
            && variance > 0.0
        {
            slots.fill(variance.sqrt());
        }
    }
    all
}
