//! From a signal to numbers on the step grid: scaling, baseline, resampling, tail.
//!
//! The order is fixed: (1) SI units; (2) baseline removed by `detrend`; (3) ends tapered; (4) scaled to `target_peak` or
//! `target_sa`; (5) times `scale_factor`; (6) laid on the step grid; (7) zero after the end. Steps 2 to 5 work on the
//! samples of a record over its whole length, however long the test, so that the motion depends neither on Δt nor
//! on the duration; a closed form has no samples, and its peak is read on the step grid.
//!
//! A displacement record shorter than the test stays where it ends: a table or an actuator cannot jump home.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, finite, inside, positive};
use super::resample::central_difference;
use super::sampled::{Origin, Sampled};
use super::shapes::{factor, taper};
use super::signal::{Signal, Source};
use super::spectrum::{peak, peak_disp};
use super::unit::{Quantity, Unit};
use super::{Files, Grid, Series};

/// A signal and what is done to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Motion {
    /// What it is.
    pub signal: Signal,
    /// Scaling, baseline and tail; nothing if absent.
    #[serde(default)]
    pub processing: Processing,
}

/// What is done to a signal, in this order: detrend, taper, target, scale factor, resampling, tail.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Processing {
    /// Least-squares polynomial taken from the samples over their whole length; `none` if absent.
    #[serde(default)]
    pub detrend: Detrend,
    /// Half a cosine of this length in s at both ends of the samples; 0 if absent.
    #[serde(default)]
    pub taper_s: f64,
    /// Scales so that the largest absolute value is this.
    pub target_peak: Option<Amount>,
    /// Scales an acceleration so that its pseudo-spectral acceleration at one period is this; not with `target_peak`.
    pub target_sa: Option<TargetSa>,
    /// Multiplies the result, after a target; 1 if absent.
    #[serde(default = "one")]
    pub scale_factor: f64,
    /// The test is meant to outlast the record: no warning; false if absent.
    #[serde(default)]
    pub zero_tail: bool,
}

const fn one() -> f64 {
    1.0
}

impl Default for Processing {
    fn default() -> Self {
        Self {
            detrend: Detrend::None,
            taper_s: 0.0,
            target_peak: None,
            target_sa: None,
            scale_factor: 1.0,
            zero_tail: false,
        }
    }
}

/// A polynomial in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Detrend {
    /// None.
    #[default]
    None,
    /// A constant.
    Mean,
    /// A straight line.
    Linear,
    /// A parabola.
    Quadratic,
}

/// A number with its unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Amount {
    /// How many.
    pub value: f64,
    /// Of what.
    pub unit: Unit,
}

/// A pseudo-spectral acceleration at one period.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct TargetSa {
    /// Natural period in s.
    pub period_s: f64,
    /// Damping ratio, 0.05 as a rule.
    pub damping_ratio: f64,
    /// ω² Sd.
    pub value: f64,
    /// Its unit.
    pub unit: Unit,
}

/// A base that moves: displacement and velocity on the step grid.
#[derive(Debug, Clone, PartialEq)]
pub struct BaseMotion {
    /// In m, steps + 1 values.
    pub disp: Vec<f64>,
    /// In m/s, steps + 1 values.
    pub vel: Vec<f64>,
    /// Warnings in plain words.
    pub warnings: Vec<String>,
}

impl Motion {
    /// A signal with nothing done to it.
    #[must_use]
    pub fn plain(signal: Signal) -> Self {
        Self {
            signal,
            processing: Processing::default(),
        }
    }

    /// The motion on `grid` in the SI unit of `quantity`; `files` hands over the bytes of a file.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn evaluate(
        &self,
        quantity: Quantity,
        grid: Grid,
        files: &Files<'_>,
    ) -> Result<Series, MotionError> {
        let mut warnings = Vec::new();
        let points = self.points(quantity, grid, files, &mut warnings)?;
        Ok(Series {
            values: points.into_iter().map(|(value, _)| value).collect(),
            warnings,
        })
    }

    /// Values and rates of change on `grid`. The rate is that of the formula where there is one, that of the kernel
    /// for band-limited samples, and a central difference on the grid for samples joined by straight lines.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn evaluate_with_rate(
        &self,
        quantity: Quantity,
        grid: Grid,
        files: &Files<'_>,
    ) -> Result<(Series, Vec<f64>), MotionError> {
        let mut warnings = Vec::new();
        let points = self.points(quantity, grid, files, &mut warnings)?;
        let (values, rates): (Vec<f64>, Vec<Option<f64>>) = points.into_iter().unzip();
        let differences = if rates.iter().all(Option::is_some) {
            Vec::new()
        } else {
            central_difference(&values, grid.dt())
        };
        let rates = rates
            .iter()
            .enumerate()
            .map(|(i, rate)| rate.or(differences.get(i).copied()).unwrap_or(0.0))
            .collect();
        Ok((Series { values, warnings }, rates))
    }

    /// Value and, where it is known, rate at every point of the grid.
    fn points(
        &self,
        quantity: Quantity,
        grid: Grid,
        files: &Files<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<(f64, Option<f64>)>, MotionError> {
        let scale_factor = finite("scale_factor", self.processing.scale_factor)?;
        match self.signal.source(quantity, files, warnings)? {
            Source::Curve(curve) => {
                self.processing.only_scales()?;
                let points: Vec<(f64, f64)> = grid.times().map(|t| (curve.at)(t)).collect();
                let values: Vec<f64> = points.iter().map(|p| p.0).collect();
                let scale = scale_factor * self.processing.target(quantity, &values, grid.dt())?;
                above_nyquist(curve.top_hz, grid, warnings);
                finite_points(
                    points
                        .into_iter()
                        .map(|(v, r)| (scale * v, Some(scale * r)))
                        .collect(),
                )
            }
            Source::Sampled(mut samples) => {
                let (first, last) = samples.inner();
                self.processing.remove_trend(&mut samples, first, last);
                self.processing.taper(&mut samples)?;
                let whole = samples.values.get(first..=last).unwrap_or(&samples.values);
                let scale = scale_factor * self.processing.target(quantity, whole, samples.dt)?;
                samples.values.iter_mut().for_each(|v| *v *= scale);
                if let Origin::Synthetic { top_hz } = samples.origin {
                    above_nyquist(Some(top_hz), grid, warnings);
                }
                let holds = quantity == Quantity::Displacement;
                if !self.processing.zero_tail {
                    samples.tail_warning(grid, holds, warnings);
                }
                samples.coarse_warning(grid, warnings);
                finite_points(samples.on(grid, holds))
            }
        }
    }
}

/// Finite numbers times finite factors may still run out of range.
fn finite_points(points: Vec<(f64, Option<f64>)>) -> Result<Vec<(f64, Option<f64>)>, MotionError> {
    let is_finite = |p: &(f64, Option<f64>)| p.0.is_finite() && p.1.is_none_or(f64::is_finite);
    match points.iter().position(|p| !is_finite(p)) {
        None => Ok(points),
        Some(at) => Err(MotionError::EntryNotFinite {
            what: "the scaled motion",
            index: at + 1,
            found: points[at].0,
        }),
    }
}

/// Displacement and velocity of a base on `grid`. See [`Motion::evaluate_with_rate`] for the velocity. A jump is a
/// warning.
///
/// # Errors
/// See [`MotionError`].
pub fn base_motion(
    motion: &Motion,
    grid: Grid,
    files: &Files<'_>,
) -> Result<BaseMotion, MotionError> {
    let (series, vel) = motion.evaluate_with_rate(Quantity::Displacement, grid, files)?;
    let mut warnings = series.warnings;
    if let Some(jump) = jump(&series.values, grid.dt()) {
        warnings.push(format!("the base {jump}"));
    }
    if let Some(start) = series.values.first().filter(|d| **d != 0.0) {
        warnings.push(format!("the base starts at {start} m, not at rest at zero"));
    }
    Ok(BaseMotion {
        disp: series.values,
        vel,
        warnings,
    })
}

/// Words for the first step in which a displacement moves five times as far as in any of the four steps on either
/// side: a jump, which no actuator follows.
pub(super) fn jump(disp: &[f64], dt: f64) -> Option<String> {
    let moves: Vec<f64> = disp.windows(2).map(|d| d[1] - d[0]).collect();
    let top = peak(disp);
    let place = (0..moves.len()).find(|&i| {
        let before = moves.get(i.saturating_sub(4)..i).unwrap_or(&[]);
        let after = moves.get(i + 1..(i + 5).min(moves.len())).unwrap_or(&[]);
        moves.len() > 1 && moves[i].abs() > 5.0 * peak(before).max(peak(after)) + 1e-9 * top
    })?;
    Some(format!(
        "jumps by {:.3e} m between {:.6} s and {:.6} s",
        moves[place],
        place as f64 * dt,
        (place + 1) as f64 * dt
    ))
}

fn above_nyquist(top_hz: Option<f64>, grid: Grid, warnings: &mut Vec<String>) {
    let nyquist = 0.5 / grid.dt();
    if let Some(top) = top_hz.filter(|f| *f > nyquist) {
        warnings.push(format!(
            "the signal reaches {top} Hz, but a step of {} s carries {nyquist} Hz: what lies above is folded down",
            grid.dt()
        ));
    }
}

impl Processing {
    /// A closed form has no samples to correct.
    fn only_scales(&self) -> Result<(), MotionError> {
        let what = "a signal in closed form: it has no samples";
        if self.detrend != Detrend::None {
            return Err(MotionError::NotApplicable {
                key: "detrend",
                what,
            });
        }
        if self.taper_s != 0.0 {
            return Err(MotionError::NotApplicable {
                key: "taper_s",
                what,
            });
        }
        Ok(())
    }

    /// The factor that brings `values` to the target; 1 without one.
    fn target(&self, quantity: Quantity, values: &[f64], dt: f64) -> Result<f64, MotionError> {
        let ratio = |wanted: f64, found: f64| {
            if found > 0.0 {
                Ok(wanted / found)
            } else {
                Err(MotionError::ZeroMotion { wanted })
            }
        };
        match (self.target_peak, self.target_sa) {
            (None, None) => Ok(1.0),
            (Some(_), Some(_)) => Err(MotionError::AtMostOne {
                names: "target_peak, target_sa",
                found: 2,
            }),
            (Some(target), None) => {
                let wanted =
                    positive("target_peak", target.value)? * factor(Some(target.unit), quantity)?;
                ratio(wanted, peak(values))
            }
            (None, Some(target)) => {
                if quantity != Quantity::Acceleration {
                    return Err(MotionError::NotApplicable {
                        key: "target_sa",
                        what: "anything but an acceleration",
                    });
                }
                let wanted =
                    positive("target_sa", target.value)? * factor(Some(target.unit), quantity)?;
                let disp = peak_disp(values, dt, target.period_s, target.damping_ratio)?;
                let omega = 2.0 * std::f64::consts::PI / target.period_s;
                ratio(wanted, omega * omega * disp)
            }
        }
    }

    /// Takes the least-squares polynomial of samples first..=last from all samples.
    fn remove_trend(&self, samples: &mut Sampled, first: usize, last: usize) {
        let terms = match self.detrend {
            Detrend::None => 0,
            Detrend::Mean => 1,
            Detrend::Linear => 2,
            Detrend::Quadratic => 3,
        };
        let n = (last + 1).saturating_sub(first);
        // Polynomials that are orthogonal on n equal points from −1 to 1: 1, s, s² − mean of s².
        let at = |i: usize| {
            if n > 1 {
                2.0 * (i as f64 - first as f64) / (n - 1) as f64 - 1.0
            } else {
                0.0
            }
        };
        let mean_square = (first..=last).map(|i| at(i) * at(i)).sum::<f64>() / n.max(1) as f64;
        let basis = |term: usize, i: usize| match term {
            0 => 1.0,
            1 => at(i),
            _ => at(i) * at(i) - mean_square,
        };
        for term in 0..terms {
            let inner = || (first..=last).zip(samples.values.get(first..=last).unwrap_or(&[]));
            let projection: f64 = inner().map(|(i, v)| v * basis(term, i)).sum();
            let norm: f64 = inner().map(|(i, _)| basis(term, i) * basis(term, i)).sum();
            // Fewer points than terms leave nothing to fit.
            if norm > 0.0 {
                let share = projection / norm;
                for (i, value) in samples.values.iter_mut().enumerate() {
                    *value -= share * basis(term, i);
                }
            }
        }
    }

    fn taper(&self, samples: &mut Sampled) -> Result<(), MotionError> {
        let duration = samples.span.1 - samples.span.0;
        let rise = self.taper_s;
        let fits = rise >= 0.0 && 2.0 * rise <= duration;
        inside(
            "taper_s",
            rise,
            fits,
            "at least zero and at most half the duration",
        )?;
        if rise > 0.0 {
            let offset = samples.first_time - samples.span.0;
            let dt = samples.dt;
            for (i, value) in samples.values.iter_mut().enumerate() {
                let time = offset + i as f64 * dt;
                // Beyond the span the window is that of the nearest end: zero.
                *value *= taper(time.clamp(0.0, duration), duration, rise).0;
            }
        }
        Ok(())
    }
}
