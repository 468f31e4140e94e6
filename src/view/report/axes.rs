//! The part of a page about one axis of a specimen, computed from its columns while they are held whole.

use std::borrow::Cow;

use super::axis::is_drawable;
use super::columns::SpecimenAxis;
use super::row_filter::{HOLDING, RUNNING, TRIPPED, is_even};
use super::table::Table;
use super::thin;
use gusset_motion::metrics::fourier::{Spectrum, evaluate};
use gusset_motion::metrics::tracking::Noise;
use gusset_motion::metrics::windows::{self, Histories};
use gusset_motion::metrics::{self, Identified, Peak, Tracking};

/// Share of the largest displacement that counts as first loading.
pub(super) const FIRST_LOADING: f64 = 0.2;
/// Parts of a logarithmic frequency axis.
const BINS: usize = 420;
/// Points of the largest picture that a loop is drawn in, and how far an omitted point may lie from the line.
const WIDTH: f64 = 480.0;
const TOLERANCE: f64 = 0.12;
/// Points beyond which the tolerance is doubled, up to a pixel: a noisy loop must not make a page of megabytes.
const POINTS: usize = 5_000;
/// Samples of a close-up.
const CLOSE_UP: usize = 6000;

/// Points of a picture: x and y, NaN where the line is broken.
pub(super) type Points = (Vec<f64>, Vec<f64>);

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AxisDigest {
    pub axis: SpecimenAxis,
    /// Interval of the rows that everything is made of that needs them at even times; none where they are not.
    pub dt: Option<f64>,
    pub tracking: Option<Tracking>,
    pub noise: Option<Noise>,
    /// Phase and amplitude errors over the test, and the times that they belong to.
    pub course: Option<(Vec<f64>, Histories)>,
    pub peak_disp: Option<Peak>,
    pub peak_force: Option<Peak>,
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
}

/// How far steps and ticks are apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub step_s: Option<f64>,
    pub ticks_per_step: u64,
    /// True if no tick is missing.
    pub is_whole: bool,
}

/// Rows at even times.
enum Even {
    All,
    Some(Vec<usize>),
}

impl Even {
    fn of<'a>(&self, values: &'a [f64]) -> Cow<'a, [f64]> {
        match self {
            Even::All => Cow::Borrowed(values),
            Even::Some(rows) => rows
                .iter()
                .filter_map(|&row| values.get(row).copied())
                .collect(),
        }
    }
}

impl Grid {
    /// Rows at even times and their interval. These are all ticks except those of a hold, or the ends of steps where the test
    /// slowed down. Of several rows at one time, which a waiting controller makes, only the last counts. `None` where some of
    /// these are missing. A last row that only records a trip at the same time does not count.
    fn rows(&self, held: &Table, time: &[f64]) -> Option<(Even, f64)> {
        let step_s = self.step_s?;
        let tick_s = step_s / self.ticks_per_step.max(1) as f64;
        if is_even(time, tick_s) {
            return Some((Even::All, tick_s));
        }
        let state = held.get("state")?;
        let ticks = if repeats(state, time) {
            state.len() - 1
        } else {
            state.len()
        };
        let those = |wanted: &dyn Fn(f64) -> bool| {
            let all = state.iter().take(ticks).enumerate();
            let rows = all.filter(|(_, s)| wanted(**s)).map(|(row, _)| row);
            rows.collect::<Vec<usize>>()
        };
        let at = |rows: Vec<usize>, dt: f64| {
            let times: Vec<f64> = rows
                .iter()
                .filter_map(|&row| time.get(row).copied())
                .collect();
            is_even(&times, dt).then_some((Even::Some(rows), dt))
        };
        // Missing rows are replaced by one without a state: it is kept, and its time is not even.
        at(those(&|state| state != HOLDING), tick_s).or_else(|| {
            let mut rows = those(&|state| state == RUNNING);
            rows.dedup_by(|later, kept| {
                let is_one = time.get(*later) == time.get(*kept);
                if is_one {
                    *kept = *later;
                }
                is_one
            });
            at(rows, step_s)
        })
    }
}

/// True if the last row is that of a trip for which no tick was made: its time is not after that of the row before it.
fn repeats(state: &[f64], time: &[f64]) -> bool {
    let times = time
        .last_chunk()
        .is_some_and(|[before, last]| last <= before);
    times && state.last() == Some(&TRIPPED)
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
    /// The digest of `axis` from its columns in `held`, which are of every tick; `noise` was read at rest.
    pub(crate) fn of(
        axis: SpecimenAxis,
        held: &Table,
        time: &[f64],
        grid: Grid,
        noise: Option<Noise>,
    ) -> Self {
        let column = |kind: &str| held.get(&axis.column(kind)).unwrap_or_default();
        let (target, meas, force) = (column("target"), column("meas"), column("force"));
        let mut found = Self {
            axis,
            dt: None,
            tracking: None,
            noise,
            course: None,
            peak_disp: metrics::peak(meas),
            peak_force: metrics::peak(force),
            absorbed: None,
            whole: None,
            initial: None,
            hysteresis: drawn(meas, force),
            subspace: drawn(target, meas),
            close_up: Default::default(),
            spectra: Default::default(),
        };
        let (from, to) = close_up(time, target, meas);
        found.close_up = [time, target, meas].map(|v| short(v.get(from..to).unwrap_or_default()));
        found.absorbed = grid.is_whole.then(|| absorbed(meas, force)).flatten();
        if let Some((rows, dt)) = grid.rows(held, time) {
            let [time, target, meas, force] = [time, target, meas, force].map(|v| rows.of(v));
            found.dt = Some(dt);
            found.follow(&time, &target, &meas, &force, dt);
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
    }

    /// Lag of measured behind target in s.
    pub(crate) fn lag(&self) -> Option<f64> {
        self.tracking.as_ref()?.lag_s.map(|lag| lag.value)
    }

    /// Amplitude of measured over that of target by frequency, where the target has a hundredth of its largest amplitude.
    pub(crate) fn gain(&self) -> Vec<(f64, f64)> {
        let [target, measured, _] = &self.spectra;
        let most = target.iter().map(|point| point.1).fold(0.0, f64::max);
        let both = target
            .iter()
            .zip(measured)
            .filter(|(c, _)| c.1 > 0.01 * most);
        both.map(|(c, m)| (c.0, m.1 / c.1))
            .filter(|(hz, gain)| *hz > 0.0 && gain.is_finite())
            .collect()
    }

    /// True if there is a loop to be drawn.
    pub(crate) fn is_drawable(&self) -> bool {
        !self.hysteresis.0.is_empty()
    }
}

/// Energy into the specimen, straight across missing measurements.
fn absorbed(meas: &[f64], force: &[f64]) -> Option<f64> {
    let known = meas.iter().zip(force);
    let known = known.filter(|(d, f)| d.is_finite() && f.is_finite());
    let (disp, force): (Vec<f64>, Vec<f64>) = known.unzip();
    metrics::absorbed_energy(&disp, &force)
}

/// Every n-th sample of a series that is too long for a close-up: a slow test is smooth.
fn short(values: &[f64]) -> Vec<f64> {
    values
        .iter()
        .step_by(values.len().div_ceil(CLOSE_UP).max(1))
        .copied()
        .collect()
}

/// The line through all points, without points whose omission is invisible.
fn drawn(x: &[f64], y: &[f64]) -> Points {
    let pairs = || x.iter().copied().zip(y.iter().copied());
    let drawable = || pairs().filter(|(x, y)| is_drawable(*x) && is_drawable(*y));
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (v.min(lo), v.max(hi))
        });
        if hi > lo { (hi - lo) / WIDTH } else { 1.0 }
    };
    let per_x = range(&mut drawable().map(|p| p.0));
    let per_y = range(&mut drawable().map(|p| p.1));
    let mut last: Option<(f64, f64)> = None;
    let mut near: Vec<(f64, f64)> = Vec::new();
    for (x, y) in pairs() {
        let at = (x / per_x, y / per_y);
        if !(is_drawable(x) && is_drawable(y)) {
            if last.take().is_some() {
                near.push((f64::NAN, f64::NAN));
            }
            continue;
        }
        // Half of the later tolerance.
        let moved =
            |last: (f64, f64)| (at.0 - last.0).abs().max((at.1 - last.1).abs()) > 0.5 * TOLERANCE;
        if last.is_none_or(moved) {
            near.push(at);
            last = Some(at);
        }
    }
    let mut tolerance = TOLERANCE;
    let runs = loop {
        let runs = thin::within(near.iter().copied(), tolerance);
        if tolerance >= 0.9 || runs.iter().map(Vec::len).sum::<usize>() <= POINTS {
            break runs;
        }
        tolerance *= 2.0;
    };
    let mut out: Points = Default::default();
    for run in runs {
        if !out.0.is_empty() {
            out.0.push(f64::NAN);
            out.1.push(f64::NAN);
        }
        for (x, y) in run {
            out.0.push(x * per_x);
            out.1.push(y * per_y);
        }
    }
    out
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

    #[test]
    fn noisy_loop_is_drawn_with_few_points() {
        let n = 400_000;
        let x: Vec<f64> = (0..n).map(|i| libm::sin(i as f64 * 1e-2)).collect();
        let y: Vec<f64> = (0..n)
            .map(|i| libm::cos(i as f64 * 1.7e-2) * (1.0 + 0.1 * libm::sin(i as f64)))
            .collect();
        let (dx, dy) = drawn(&x, &y);
        assert!(dx.len() == dy.len() && dx.len() < 200_000, "{}", dx.len());
        let top = |v: &[f64]| v.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert!((top(&dx) - top(&x)).abs() < 2.0 * 1.0 / WIDTH * 2.0);
        assert!((top(&dy) - top(&y)).abs() < 2.0 * 1.1 / WIDTH * 2.0);
        let gap = drawn(&[0.0, 1.0, f64::NAN, 2.0, 3.0], &[0.0; 5]);
        assert_eq!(gap.0.iter().filter(|v| v.is_nan()).count(), 1);
        assert_eq!(drawn(&[], &[]), Points::default());
    }
}
