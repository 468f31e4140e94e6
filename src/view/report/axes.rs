//! The part of a page about one axis of a specimen, computed from its columns while they are held whole.

use super::columns::SpecimenAxis;
use super::loop_line::Points;
use super::table::Table;
use gusset_motion::metrics::fourier::{Response, Spectrum, evaluate, response};
use gusset_motion::metrics::tracking::Noise;
use gusset_motion::metrics::windows::{self, Histories};
use gusset_motion::metrics::{self, Identified, Tracking};

/// Share of the largest displacement that counts as first loading.
pub(super) const FIRST_LOADING: f64 = 0.2;
/// Parts of a logarithmic frequency axis.
const BINS: usize = 420;
/// Samples of a close-up.
const CLOSE_UP: usize = 6000;

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AxisDigest {
    pub axis: SpecimenAxis,
    /// Interval of the samples that everything is made of that needs them at even times; none where they are not.
    pub dt: Option<f64>,
    pub tracking: Option<Tracking>,
    pub noise: Option<Noise>,
    /// Phase and amplitude errors over the test, and the times that they belong to.
    pub course: Option<(Vec<f64>, Histories)>,
    pub peak_disp: Option<f64>,
    pub peak_force: Option<f64>,
    pub absorbed: Option<f64>,
    /// Stiffness and damping of the whole test, and of the first loading.
    pub whole: Option<Identified>,
    pub initial: Option<Identified>,
    /// Force over measured displacement; measured over target.
    pub hysteresis: Points,
    pub subspace: Points,
    /// Time, target and measured around the largest target.
    pub close_up: [Vec<f64>; 3],
    /// Amplitude spectra of target, measured, and their difference: (Hz, m s).
    pub spectra: [Vec<(f64, f64)>; 3],
    /// Gain and phase of measured over target by frequency.
    pub response: Vec<Response>,
}

/// Amplitude spectrum as a page draws it.
pub(super) fn envelope(values: &[f64], dt: f64) -> Option<Vec<(f64, f64)>> {
    let is_still = metrics::peak(values).is_none_or(|peak| peak.value == 0.0);
    if is_still {
        return None;
    }
    Spectrum::of(values, dt).map(|spectrum| spectrum.envelope(BINS))
}

impl AxisDigest {
    /// The digest of `axis` from its columns in `held`, of which each entry is the mean of `every` ticks; they are `dt` apart if
    /// they are at even times. `noise` was read at rest.
    pub(crate) fn of(
        axis: SpecimenAxis,
        held: &Table,
        dt: Option<f64>,
        every: usize,
        noise: Option<Noise>,
    ) -> Self {
        let column = |name: &str| held.get(name).unwrap_or_default();
        let time = column("time");
        let [target, meas, force] =
            ["target", "meas", "force"].map(|kind| column(&axis.column(kind)));
        let (from, to) = close_up(time, target, meas);
        let mut found = Self {
            axis,
            dt,
            tracking: None,
            noise: noise.map(|noise| of_means(noise, every)),
            course: None,
            peak_disp: None,
            peak_force: None,
            absorbed: None,
            whole: None,
            initial: None,
            hysteresis: Points::default(),
            subspace: Points::default(),
            close_up: [time, target, meas].map(|v| short(v.get(from..to).unwrap_or_default())),
            spectra: Default::default(),
            response: Vec::new(),
        };
        if let Some(dt) = dt {
            found.follow(time, target, meas, force, dt);
        }
        found.noise = noise;
        if let Some(tracking) = &mut found.tracking {
            tracking.noise = noise;
        }
        found
    }

    /// Computes the results that need rows at even times, `dt` s apart.
    fn follow(&mut self, time: &[f64], target: &[f64], meas: &[f64], force: &[f64], dt: f64) {
        let n = target.len().min(meas.len());
        let of = |values: &[f64]| Spectrum::of(values, dt);
        let whole = metrics::bridged(target, meas);
        let (c, m) = (of(&target[..n]), of(&whole[..n]));
        let index = c.as_ref().zip(m.as_ref()).and_then(|(c, m)| evaluate(c, m));
        self.tracking = Tracking::with_index(target, meas, force, dt, self.noise, index);
        if let Some(tracking) = &mut self.tracking {
            let sigma = self.noise.map(|noise| noise.disp_std_m);
            let found = windows::look(target, &whole, dt, sigma);
            tracking.windows = found.as_ref().map(|(windows, _)| *windows);
            self.course = found.map(|(_, histories)| {
                let middle = histories.middle.iter();
                let at = middle.map(|row| time.get(*row).copied().unwrap_or(f64::NAN));
                (at.collect(), histories)
            });
        }
        let is_moving =
            |s: &Option<Spectrum>| s.as_ref().map(|s| s.envelope(BINS)).unwrap_or_default();
        self.spectra[0] = is_moving(&c);
        self.spectra[1] = is_moving(&m);
        let both = c.as_ref().zip(m.as_ref());
        self.response = both.map_or_else(Vec::new, |(c, m)| response(c, m, BINS));
        drop((c, m));
        let error: Vec<f64> = whole.iter().zip(target).map(|(m, c)| m - c).collect();
        self.spectra[2] = envelope(&error, dt).unwrap_or_default();
        // The target as late as the measured displacement is: where the first loading ends is no matter of noise, either.
        let late = metrics::delayed(target, self.lag().unwrap_or(0.0) / dt);
        let first = metrics::loading(&late, FIRST_LOADING);
        self.whole = metrics::identify(&late, meas, force, dt);
        self.initial = metrics::identify(&late[..first], meas, force, dt);
    }

    /// Removes results that would compare the command with the target, or take the command for a measurement. The loop
    /// stays: it is of the force over the command.
    pub(crate) fn forget_measured_disp(&mut self) {
        (self.tracking, self.course, self.peak_disp, self.absorbed) = (None, None, None, None);
        (self.whole, self.initial) = (None, None);
        self.subspace = Points::default();
        self.close_up[2].clear();
        let [_, measured, difference] = &mut self.spectra;
        measured.clear();
        difference.clear();
        self.response.clear();
    }

    /// Lag of measured behind target in s.
    pub(crate) fn lag(&self) -> Option<f64> {
        self.tracking.as_ref()?.lag_s.map(|lag| lag.value)
    }

    /// True if there is a loop to be drawn.
    pub(crate) fn is_drawable(&self) -> bool {
        !self.hysteresis.0.is_empty()
    }
}

/// Noise of a mean of several readings.
fn of_means(noise: Noise, readings: usize) -> Noise {
    let less = (readings as f64).sqrt();
    Noise {
        disp_std_m: noise.disp_std_m / less,
        force_std_n: noise.force_std_n / less,
        ..noise
    }
}

/// Every n-th sample of a series that is too long for a close-up: a slow test is smooth.
fn short(values: &[f64]) -> Vec<f64> {
    values
        .iter()
        .step_by(values.len().div_ceil(CLOSE_UP).max(1))
        .copied()
        .collect()
}

/// Samples around the largest command: about one of its swings, so that a lag can be seen.
fn close_up(time: &[f64], cmd: &[f64], meas: &[f64]) -> (usize, usize) {
    let n = time.len().min(cmd.len()).min(meas.len());
    let peak = metrics::peak(&cmd[..n]);
    let middle = peak.map_or(n / 2, |p| p.index);
    // Noise about zero is not a swing: only a motion beyond a tenth of the peak on both sides counts.
    let bound = 0.1 * peak.map_or(0.0, |p| p.value.abs());
    let (mut crossings, mut side, mut span) = (0, None, None);
    for (i, &c) in cmd[..n].iter().enumerate().filter(|(_, c)| c.abs() > bound) {
        crossings += usize::from(side.is_some_and(|before| before != (c > 0.0)));
        side = Some(c > 0.0);
        span = Some(span.map_or((i, i), |(first, _)| (first, i)));
    }
    let active = span.map_or(n, |(first, last)| last - first + 1);
    // One swing is two crossings; never less than 40 samples, never more than a quarter of the test.
    let length = (2 * active / (crossings + 1)).clamp(40.min(n), (n / 4).max(40.min(n)));
    let from = middle.saturating_sub(length / 2).min(n - length);
    (from, from + length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn close_up_is_around_the_peak() {
        let time: Vec<f64> = (0..1000).map(f64::from).collect();
        let mut cmd: Vec<f64> = time.iter().map(|t| libm::sin(t / 10.0)).collect();
        cmd[990] = 5.0;
        let (from, to) = close_up(&time, &cmd, &cmd);
        assert!(from < 990 && to > 990 && to <= 1000 && to - from >= 40);
        assert_eq!(close_up(&[], &[], &[]), (0, 0));
        assert_eq!(close_up(&time[..3], &cmd[..3], &cmd[..3]), (0, 3));
    }
}
