//! From a signal to numbers on the step grid: scaling, baseline, resampling, tail.
//!
//! The order is fixed: (1) SI units; (2) baseline removed by `detrend`; (3) ends tapered; (4) laid on the step grid; (5) scaled
//! to `target_peak` or `target_sa`; (6) times `scale_factor`; (7) zero after the end. Steps 2, 3 and 5 work on the samples of a
//! record over its whole length, so that the motion depends neither on the steps nor on the duration of a test. The steps may miss
//! the peak of the record. The peak of a closed form is that of the test.
//!
//! A displacement record shorter than the test stays where it ends: a table or an actuator cannot jump home.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, Short, all_finite, finite, inside, not_negative, positive};
use super::resample::central_difference;
use super::sampled::{Origin, Sampled};
use super::shapes::{check_taper, factor_of, taper};
use super::signal::{Signal, Source};
use super::stroke::Stroke;
use super::unit::{Quantity, Unit};
use super::{Files, Grid, Series, peak};
use crate::metrics::spectrum::response_spectrum;

/// Signal and its processing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Motion {
    /// Time history.
    pub signal: Signal,
    /// Processing of the time history. Default: none.
    #[serde(default)]
    pub processing: Processing,
    /// Time in s by which the whole motion starts later; zero before. Default: 0.
    #[serde(default)]
    pub delay_s: f64,
}

/// Processing of a signal. The order is: detrend, taper, resampling, target, scale factor, tail.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Processing {
    /// Polynomial that is fitted to all samples by least squares and subtracted from them.
    #[serde(default)]
    #[schemars(example = &"linear")]
    pub detrend: Detrend,
    /// Length of the half-cosine taper at each end of the samples.
    #[serde(default)]
    #[schemars(example = 0.5)]
    pub taper_s: f64,
    /// Target for the largest absolute value of the record, after `detrend` and `taper_s`. A closed
    /// form has its value at the steps of the test. The signal is scaled to it. Default: no scaling.
    pub target_peak: Option<Amount>,
    /// Target for the pseudo-spectral acceleration at one period, for an acceleration. The signal
    /// is scaled to it. Use it instead of `target_peak`. Default: no scaling.
    pub target_sa: Option<TargetSa>,
    /// Factor that multiplies the signal, after the scaling to a target.
    #[serde(default = "one")]
    #[schemars(example = 0.5)]
    pub scale_factor: f64,
    /// If true, the test may be longer than the record, without a warning.
    #[serde(default)]
    pub zero_tail: bool,
    /// Displacement from a record of acceleration, where a displacement is wanted. The unit and the targets
    /// are those of an acceleration. The motion begins and ends at rest at zero.
    pub displacement: Option<Stroke>,
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
            displacement: None,
        }
    }
}

/// Polynomial that is subtracted from the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Detrend {
    /// No polynomial.
    #[default]
    None,
    /// Constant.
    Mean,
    /// Straight line.
    Linear,
    /// Parabola.
    Quadratic,
}

/// Value with its unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Amount {
    /// Value.
    pub value: f64,
    /// Unit of the value.
    pub unit: Unit,
}

/// Pseudo-spectral acceleration at one period.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct TargetSa {
    /// Natural period.
    #[schemars(example = 0.8)]
    pub period_s: f64,
    /// Damping ratio, usually 0.05.
    #[schemars(example = 0.05)]
    pub damping_ratio: f64,
    /// Pseudo-spectral acceleration ω² S_d, in `unit`.
    #[schemars(example = 0.4)]
    pub value: f64,
    /// Unit of the value.
    #[schemars(example = &"g")]
    pub unit: Unit,
}

/// Largest share of a record that may be lost between the steps of a test.
const MOST_ALIASED: f64 = 0.2;

/// A value and, where it is known, its rate of change.
type Point = (f64, Option<f64>);

impl Motion {
    /// A signal with nothing done to it.
    #[must_use]
    pub fn plain(signal: Signal) -> Self {
        Self {
            signal,
            processing: Processing::default(),
            delay_s: 0.0,
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
        let (points, mut series) = self.points(quantity, grid, files)?;
        series.values = points.into_iter().map(|(value, _)| value).collect();
        // They are collected in the memory of the points, which is three times as large.
        series.values.shrink_to_fit();
        Ok(series)
    }

    /// Values and rates of change on `grid`. The rate is that of the formula where there is one, that of the kernel
    /// for band-limited samples, and a central difference on the grid for samples joined by straight lines.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub(crate) fn evaluate_with_rate(
        &self,
        quantity: Quantity,
        grid: Grid,
        files: &Files<'_>,
    ) -> Result<(Series, Vec<f64>), MotionError> {
        let (points, mut series) = self.points(quantity, grid, files)?;
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
        series.values = values;
        Ok((series, rates))
    }

    /// The signal with its delay, baseline and tapers, before it is scaled.
    fn source(
        &self,
        quantity: Quantity,
        files: &Files<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Source, MotionError> {
        let delay = not_negative("delay_s", self.delay_s)?;
        let mut source = self.signal.source(quantity, files, warnings)?;
        match &mut source {
            Source::Curve(curve) => {
                self.processing.only_scales()?;
                curve.delay(delay);
            }
            Source::Sampled(samples) => {
                let (first, last) = samples.inner();
                self.processing.remove_trend(samples, first, last);
                self.processing.taper(samples)?;
                samples.delay(delay);
            }
        }
        Ok(source)
    }

    /// The accelerations before they are scaled: the samples of a record, or the points of a closed form on `grid`.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub(crate) fn accelerogram(
        &self,
        grid: Grid,
        files: &Files<'_>,
    ) -> Result<Accelerogram, MotionError> {
        Ok(
            match self.source(Quantity::Acceleration, files, &mut Vec::new())? {
                Source::Curve(curve) => Accelerogram {
                    values: grid.times().map(|t| (curve.at)(t).0).collect(),
                    dt: grid.dt(),
                    start: 0.0,
                },
                Source::Sampled(samples) => {
                    let (values, dt) = samples.itself()?;
                    let start = samples.first_inner_time();
                    Accelerogram { values, dt, start }
                }
            },
        )
    }

    /// Value and, where it is known, rate at every point of the grid, and what else a [`Series`] holds.
    fn points(
        &self,
        quantity: Quantity,
        grid: Grid,
        files: &Files<'_>,
    ) -> Result<(Vec<Point>, Series), MotionError> {
        if let Some(stroke) = self.processing.displacement {
            if quantity != Quantity::Displacement {
                return Err(MotionError::NotApplicable {
                    key: "displacement",
                    what: "anything but a displacement",
                });
            }
            return self.travelled(stroke, grid, files);
        }
        let mut series = Series::default();
        let (warnings, doubts) = (&mut series.warnings, &mut series.doubts);
        let scale_factor = finite("scale_factor", self.processing.scale_factor)?;
        let points = match self.source(quantity, files, warnings)? {
            Source::Curve(curve) => {
                let points: Vec<(f64, f64)> = grid.times().map(|t| (curve.at)(t)).collect();
                let values = || Ok((points.iter().map(|p| p.0).collect(), grid.dt()));
                let target = self.processing.target(quantity, values)?;
                let scale = scale_factor * target;
                above_nyquist(curve.top_hz, grid, doubts);
                curve.cut_warning(grid.duration(), warnings);
                let points = points
                    .into_iter()
                    .map(|(v, r)| (scale * v, Some(scale * r)))
                    .collect();
                finite_points(points)?
            }
            Source::Sampled(mut samples) => {
                let holds = quantity == Quantity::Displacement;
                let itself = || samples.itself();
                let scale = scale_factor * self.processing.target(quantity, itself)?;
                samples.values.iter_mut().for_each(|v| *v *= scale);
                if let Some(record) = &samples.record {
                    // A target makes the unit of the record irrelevant.
                    if self.processing.target_peak.is_none() && self.processing.target_sa.is_none()
                    {
                        record.doubt_peak(record.peak, "of the record", warnings);
                    }
                    if scale.abs() != 1.0 {
                        record.doubt_peak(peak(&samples.values), "after scaling", warnings);
                    }
                }
                if let Origin::Synthetic { top_hz } = samples.origin {
                    above_nyquist(Some(top_hz), grid, doubts);
                }
                if !self.processing.zero_tail {
                    samples.tail_warning(grid, holds, warnings);
                }
                samples.cut_peak(grid, doubts);
                let points = finite_points(samples.on(grid, holds))?;
                if let Some((text, share)) = samples.coarse(grid, &points) {
                    let told = if share > MOST_ALIASED {
                        doubts
                    } else {
                        warnings
                    };
                    told.push(text);
                }
                series.record = samples.record;
                points
            }
        };
        Ok((points, series))
    }
}

impl Motion {
    /// [`Self::points`] of a displacement from an acceleration.
    fn travelled(
        &self,
        stroke: Stroke,
        grid: Grid,
        files: &Files<'_>,
    ) -> Result<(Vec<Point>, Series), MotionError> {
        let mut series = Series::default();
        let (warnings, doubts) = (&mut series.warnings, &mut series.doubts);
        let quantity = Quantity::Acceleration;
        let Source::Sampled(samples) = self.source(quantity, files, warnings)? else {
            return Err(MotionError::NotApplicable {
                key: "displacement",
                what: "a signal in closed form: it has no samples",
            });
        };
        let (values, dt) = samples.itself()?;
        let scale_factor = finite("scale_factor", self.processing.scale_factor)?;
        let target = self.processing.target(quantity, || samples.itself())?;
        let scaled: Vec<f64> = values.iter().map(|a| scale_factor * target * a).collect();
        all_finite("the scaled record", &scaled)?;
        let (travel, corrected) = stroke.travel(&scaled, dt)?;
        samples.cut_peak(grid, doubts);
        let start = samples.first_inner_time();
        let end = start + travel.span();
        if end > grid.duration() * (1.0 + 1e-9) {
            warnings.push(format!(
                "the test ends at {} s, before the motion comes to rest at {} s",
                Short(grid.duration()),
                Short(end)
            ));
        }
        series.record = samples.record;
        series.corrected = Some(corrected);
        let at = |time: f64| travel.at(time - start);
        let points = grid.times().map(at).map(|(d, v)| (d, Some(v)));
        Ok((points.collect(), series))
    }
}

/// Accelerations at equal steps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Accelerogram {
    /// In m/s².
    pub values: Vec<f64>,
    /// Their distance in s.
    pub dt: f64,
    /// Test time of the first of them in s.
    pub start: f64,
}

/// Finite numbers times finite factors may still run out of range.
fn finite_points(points: Vec<Point>) -> Result<Vec<Point>, MotionError> {
    let is_finite = |p: &Point| p.0.is_finite() && p.1.is_none_or(f64::is_finite);
    match points.iter().position(|p| !is_finite(p)) {
        None => Ok(points),
        Some(at) => Err(MotionError::EntryNotFinite {
            what: "the scaled motion",
            index: at + 1,
            found: points[at].0,
        }),
    }
}

fn above_nyquist(top_hz: Option<f64>, grid: Grid, doubts: &mut Vec<String>) {
    let nyquist = 0.5 / grid.dt();
    if let Some(top) = top_hz.filter(|f| *f > nyquist) {
        doubts.push(format!(
            "the signal contains frequencies up to {} Hz, but a step of {} s represents at most {} Hz: higher frequencies are aliased",
            Short(top),
            Short(grid.dt()),
            Short(nyquist)
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

    /// The factor that brings `values`, with their interval in s, to the target; 1 without one.
    fn target(
        &self,
        quantity: Quantity,
        values: impl FnOnce() -> Result<(Vec<f64>, f64), MotionError>,
    ) -> Result<f64, MotionError> {
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
                let wanted = positive("target_peak", target.value)?
                    * factor_of("target_peak", target.unit, quantity)?;
                ratio(wanted, peak(&values()?.0))
            }
            (None, Some(target)) => {
                if quantity != Quantity::Acceleration {
                    return Err(MotionError::NotApplicable {
                        key: "target_sa",
                        what: "anything but an acceleration",
                    });
                }
                let wanted = positive("target_sa", target.value)?
                    * factor_of("target_sa", target.unit, quantity)?;
                let period = positive("period_s", target.period_s)?;
                let damping = target.damping_ratio;
                let allowed = "at least 0 and less than 1";
                inside(
                    "damping_ratio",
                    damping,
                    (0.0..1.0).contains(&damping),
                    allowed,
                )?;
                let (values, dt) = values()?;
                all_finite("accelerations", &values)?;
                let found = response_spectrum(&values, dt, &[period], damping);
                ratio(
                    wanted,
                    found.first().map_or(0.0, |found| found.pseudo_accel),
                )
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
        let rise = check_taper(self.taper_s, duration)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        BandLimitedNoise, Constant, FileSignal, Resample, Sine, Step, Values, base_motion,
        central_difference,
    };
    use gusset_quantity::assert_is;

    fn no_files(_: &str) -> std::io::Result<Vec<u8>> {
        Err(std::io::ErrorKind::NotFound.into())
    }

    fn grid(dt: f64, steps: usize) -> Grid {
        Grid::new(dt, steps).unwrap()
    }

    fn values(values: &[f64]) -> Motion {
        Motion::plain(Signal::Values(Values {
            values: values.to_vec(),
            dt_s: 0.1,
            unit: None,
            resample: Resample::Linear,
            start_s: 0.0,
        }))
    }

    fn sine() -> Motion {
        Motion::plain(Signal::Sine(Sine {
            amplitude: 0.01,
            unit: None,
            frequency_hz: Some(2.0),
            angular_frequency_rad_per_s: None,
            phase_rad: 0.0,
            start_s: 0.0,
            cycles: None,
            duration_s: None,
            taper_s: 0.0,
        }))
    }

    fn file(path: &str) -> FileSignal {
        FileSignal {
            path: path.into(),
            format: None,
            column: None,
            time_column: None,
            skip_rows: 0,
            dt_s: None,
            unit: None,
            resample: Resample::Linear,
            start_s: 0.0,
        }
    }

    const AT2: &str = "PEER\nEVENT\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 4, DT= .1 SEC\n0.0 0.2 -0.4 0.1\n";

    fn evaluate(motion: &Motion, grid: Grid) -> Result<Series, MotionError> {
        motion.evaluate(Quantity::Acceleration, grid, &|path| match path {
            "a.AT2" => Ok(AT2.as_bytes().to_vec()),
            "a.csv" => Ok(b"t,a\n0,0\n0.1,1\n0.2,0\n".to_vec()),
            _ => no_files(path),
        })
    }

    #[test]
    fn short_record_is_padded_with_a_warning() {
        let motion = Motion::plain(Signal::File(file("a.AT2")));
        let series = evaluate(&motion, grid(0.05, 10)).unwrap();
        let g = 9.806_65;
        let expected = [0.0, 0.1, 0.2, -0.1, -0.4, -0.15, 0.1, 0.0, 0.0, 0.0, 0.0];
        for (found, wanted) in series.values.iter().zip(expected) {
            assert!((found - wanted * g).abs() < 1e-14, "{:?}", series.values);
        }
        let [warning] = series.warnings.as_slice() else {
            panic!("{:?}", series.warnings)
        };
        assert!(warning.contains("a.AT2"), "{warning}");
        assert!(
            warning.contains(" 0.3") && warning.contains(" 0.5 s"),
            "{warning}"
        );
        let mut quiet = motion.clone();
        quiet.processing.zero_tail = true;
        assert!(
            evaluate(&quiet, grid(0.05, 10))
                .unwrap()
                .warnings
                .is_empty()
        );
        assert!(
            evaluate(&motion, grid(0.05, 6))
                .unwrap()
                .warnings
                .is_empty()
        );
        // A test that ends before the peak is doubted, and so is a step that leaves out much of the record.
        let doubts = |dt, steps| evaluate(&motion, grid(dt, steps)).unwrap().doubts;
        assert!(doubts(0.05, 6).is_empty());
        assert!(doubts(0.05, 2)[0].contains("peak"));
        assert!(doubts(0.15, 2).last().unwrap().contains("band_limited"));
    }

    #[test]
    fn missing_files_and_units_are_named() {
        let refused = |file: FileSignal| {
            evaluate(&Motion::plain(Signal::File(file)), grid(0.1, 3))
                .err()
                .unwrap()
        };
        assert_is!(
            refused(file("gone.AT2"))
            => MotionError::Unreadable { file, .. } if file == "gone.AT2"
        );
        assert_is!(
            refused(file("a.csv"))
            => MotionError::UnitMissing { file, header, quantity: Quantity::Acceleration } if file == "a.csv" && header == "a"
        );
        let wrong = FileSignal {
            unit: Some(Unit::Millimetre),
            ..file("a.csv")
        };
        assert_is!(
            refused(wrong)
            => MotionError::UnitMismatch { unit: Unit::Millimetre, quantity: Quantity::Acceleration, .. }
        );
        let overruled = FileSignal {
            unit: Some(Unit::MetrePerSecond2),
            dt_s: Some(0.2),
            ..file("a.AT2")
        };
        let series = evaluate(&Motion::plain(Signal::File(overruled)), grid(0.1, 6)).unwrap();
        assert!((series.values[2] - 0.2).abs() < 1e-15);
        assert_eq!(series.warnings.len(), 2, "{:?}", series.warnings);
    }

    #[test]
    fn target_peak_precedes_the_factor() {
        let mut motion = values(&[0.0, 2.0, -4.0, 1.0]);
        motion.processing.target_peak = Some(Amount {
            value: 0.5,
            unit: Unit::Gravity,
        });
        motion.processing.scale_factor = -2.0;
        let series = evaluate(&motion, grid(0.1, 3)).unwrap();
        // −2 · 0.5 g for the sample of −4.
        assert!((series.values[2] - 9.806_65).abs() < 1e-14);
        // The whole record counts, not what the test sees of it.
        let short = evaluate(&motion, grid(0.1, 1)).unwrap();
        assert!((short.values[1] + 0.5 * 9.806_65).abs() < 1e-14);
        let silent = Motion {
            signal: values(&[0.0, 0.0]).signal,
            ..motion
        };
        assert!(matches!(
            evaluate(&silent, grid(0.1, 1)).unwrap_err(),
            MotionError::ZeroMotion { .. }
        ));
    }

    #[test]
    fn target_spectral_acceleration_is_met() {
        let samples: Vec<f64> = (0..400)
            .map(|i| libm::sin(0.13 * f64::from(i * i % 89)))
            .collect();
        let mut motion = values(&samples);
        motion.processing.target_sa = Some(TargetSa {
            period_s: 0.7,
            damping_ratio: 0.05,
            value: 0.4,
            unit: Unit::Gravity,
        });
        let series = evaluate(&motion, grid(0.1, 399)).unwrap();
        let sa = response_spectrum(&series.values, 0.1, &[0.7], 0.05);
        assert!((sa[0].pseudo_accel / (0.4 * 9.806_65) - 1.0).abs() < 1e-12);
        motion.processing.target_peak = Some(Amount {
            value: 1.0,
            unit: Unit::Gravity,
        });
        assert!(matches!(
            evaluate(&motion, grid(0.1, 1)).unwrap_err(),
            MotionError::AtMostOne { .. }
        ));
    }

    #[test]
    fn record_itself_meets_a_target() {
        let (amount, g) = (0.3, 9.806_65);
        let unit = Unit::Gravity;
        // The largest sample, 5, lies between two steps of most tests.
        let samples = [0.0, 2.0, 5.0, -3.0, 1.0, 0.0];
        for resample in [Resample::Linear, Resample::BandLimited] {
            let mut motion = values(&samples);
            if let Signal::Values(record) = &mut motion.signal {
                record.resample = resample;
            }
            let factor = |motion: &Motion, dt: f64, steps: usize| {
                let bare =
                    evaluate(&Motion::plain(motion.signal.clone()), grid(dt, steps)).unwrap();
                let scaled = evaluate(motion, grid(dt, steps)).unwrap();
                let place = bare
                    .values
                    .iter()
                    .position(|value| value.abs() > 0.5)
                    .unwrap();
                scaled.values[place] / bare.values[place]
            };
            for (dt, steps) in [
                (0.1, 5),
                (0.1, 2),
                (1.0 / 60.0, 30),
                (1.0 / 1024.0, 500),
                (0.15, 4),
            ] {
                motion.processing.target_peak = Some(Amount {
                    value: amount,
                    unit,
                });
                motion.processing.target_sa = None;
                let found = factor(&motion, dt, steps);
                assert!(
                    (found / (amount * g / 5.0) - 1.0).abs() < 1e-12,
                    "{dt}: {found}"
                );
                motion.processing.target_peak = None;
                motion.processing.target_sa = Some(TargetSa {
                    period_s: 0.7,
                    damping_ratio: 0.05,
                    value: amount,
                    unit,
                });
                let sa = response_spectrum(&samples, 0.1, &[0.7], 0.05)[0].pseudo_accel;
                let found = factor(&motion, dt, steps);
                assert!(
                    (found / (amount * g / sa) - 1.0).abs() < 1e-12,
                    "{dt}: {found}"
                );
            }
        }
    }

    #[test]
    fn synthetic_motion_size_ignores_the_rate() {
        let mut motion = Motion::plain(Signal::BandLimitedNoise(
            serde_json::from_value(serde_json::json!({
                "rms": 1.0, "from_hz": 0.5, "to_hz": 8.0, "duration_s": 20.0, "seed": 3
            }))
            .unwrap(),
        ));
        motion.processing.target_peak = Some(Amount {
            value: 2.0,
            unit: Unit::MetrePerSecond2,
        });
        let top = |rate: f64| {
            peak(
                &evaluate(&motion, grid(1.0 / rate, (20.0 * rate) as usize))
                    .unwrap()
                    .values,
            )
        };
        // Steps of a 2000th of a second miss a peak of 8 Hz by less than 1 − cos(π 8/2000).
        assert!((top(2000.0) / 2.0 - 1.0).abs() < 5e-3, "{}", top(2000.0));
        assert!(top(64.0) <= 2.0 * 1.005 && top(64.0) < top(2000.0) + 1e-9);
    }

    #[test]
    fn polynomial_is_removed_to_roundoff() {
        let n = 201;
        let s = |i: usize| 2.0 * i as f64 / (n - 1) as f64 - 1.0;
        for (detrend, order) in [
            (Detrend::Mean, 0),
            (Detrend::Linear, 1),
            (Detrend::Quadratic, 2),
        ] {
            let drift: Vec<f64> = (0..n)
                .map(|i| {
                    (0..=order)
                        .map(|p| (3.0 - f64::from(p)) * s(i).powi(p))
                        .sum()
                })
                .collect();
            let mut motion = values(&drift);
            motion.processing.detrend = detrend;
            let left = evaluate(&motion, grid(0.1, n - 1)).unwrap();
            assert!(
                peak(&left.values) < 1e-13,
                "{detrend:?} {}",
                peak(&left.values)
            );
        }
        // The third Legendre-like polynomial keeps its shape: s³ less its own line, (3/5) s up to 1/n².
        let mut motion = values(&(0..n).map(|i| s(i).powi(3)).collect::<Vec<_>>());
        motion.processing.detrend = Detrend::Quadratic;
        let left = evaluate(&motion, grid(0.1, n - 1)).unwrap();
        for (i, value) in left.values.iter().enumerate() {
            assert!((value - (s(i).powi(3) - 0.6 * s(i))).abs() < 0.02);
        }
        let inner: f64 = left.values.iter().enumerate().map(|(i, v)| v * s(i)).sum();
        assert!(inner.abs() < 1e-12);
    }

    #[test]
    fn taper_zeroes_the_ends_only() {
        let mut motion = values(&[1.0; 101]);
        motion.processing.taper_s = 2.0;
        let series = evaluate(&motion, grid(0.1, 100)).unwrap();
        assert_eq!((series.values[0], series.values[50]), (0.0, 1.0));
        assert!((series.values[10] - 0.5).abs() < 1e-12 && series.values[100].abs() < 1e-12);
        motion.processing.taper_s = 6.0;
        assert!(evaluate(&motion, grid(0.1, 100)).is_err());
    }

    #[test]
    fn closed_forms_refuse_sample_processing() {
        for (detrend, taper_s) in [(Detrend::Mean, 0.0), (Detrend::None, 0.1)] {
            let mut motion = sine();
            motion.processing.detrend = detrend;
            motion.processing.taper_s = taper_s;
            assert!(matches!(
                evaluate(&motion, grid(0.1, 1)).unwrap_err(),
                MotionError::NotApplicable { .. }
            ));
        }
        let mut motion = sine();
        motion.processing.scale_factor = f64::NAN;
        assert!(evaluate(&motion, grid(0.1, 1)).is_err());
    }

    #[test]
    fn frequency_beyond_the_step_is_reported() {
        assert!(evaluate(&sine(), grid(0.1, 4)).unwrap().doubts.is_empty());
        assert!(evaluate(&sine(), grid(0.3, 4)).unwrap().doubts[0].contains("aliased"));
    }

    #[test]
    fn base_velocity_of_closed_forms_is_exact() {
        let moved = base_motion(&sine(), grid(0.05, 40), &no_files, "the base").unwrap();
        let omega = 4.0 * std::f64::consts::PI;
        for (i, (d, v)) in moved.disp.iter().zip(&moved.vel).enumerate() {
            let t = 0.05 * i as f64;
            assert!((d - 0.01 * libm::sin(omega * t)).abs() < 1e-16);
            assert!((v - 0.01 * omega * libm::cos(omega * t)).abs() < 1e-14);
        }
        assert!(moved.warnings.is_empty());
    }

    #[test]
    fn noise_velocity_matches_its_noise() {
        let noise = Motion::plain(Signal::BandLimitedNoise(BandLimitedNoise {
            rms: 0.01,
            unit: None,
            from_hz: 0.5,
            to_hz: 5.0,
            duration_s: 20.0,
            seed: 5,
            start_s: 0.0,
            taper_s: 1.0,
        }));
        // A coarse step, where differences would be 40 % off, against differences at a step a hundred times finer.
        let coarse = base_motion(&noise, grid(0.05, 400), &no_files, "the base").unwrap();
        let fine = base_motion(&noise, grid(0.0005, 40_000), &no_files, "the base").unwrap();
        let differences = central_difference(&fine.disp, 0.0005);
        let top = peak(&differences);
        for (i, v) in coarse.vel.iter().enumerate() {
            // (ωh)²/6 = (2π · 5 · 0.0005)²/6 = 4e-5 of the velocity.
            assert!((v - differences[100 * i]).abs() < 1e-4 * top, "{i}");
        }
    }

    #[test]
    fn displacement_record_stays_at_its_end() {
        let record = values(&[0.0, 0.001, 0.003, 0.004]);
        let moved = base_motion(&record, grid(0.05, 10), &no_files, "the base").unwrap();
        assert_eq!(moved.disp[6..], [0.004; 5]);
        assert_eq!(moved.vel[8..], [0.0; 3]);
        // Central difference within a straight line.
        assert!((moved.vel[3] - 0.02).abs() < 1e-15);
        assert!(
            moved.warnings[0].contains("is held"),
            "{:?}",
            moved.warnings
        );
        assert_eq!(moved.warnings.len(), 1, "{:?}", moved.warnings);

        let jump = Motion::plain(Signal::Step(Step {
            amplitude: 0.01,
            unit: None,
            start_s: 0.2,
            rise_s: 0.0,
        }));
        let moved = base_motion(&jump, grid(0.01, 100), &no_files, "the base").unwrap();
        assert!(
            moved.warnings[0].contains("1.000e-2 m") && moved.warnings[0].contains("0.190000 s"),
            "{:?}",
            moved.warnings
        );
        let shifted = Motion::plain(Signal::Constant(Constant {
            value: 1.0,
            unit: Some(Unit::Millimetre),
        }));
        let moved = base_motion(&shifted, grid(0.01, 100), &no_files, "the base").unwrap();
        assert!(
            moved.warnings[0].contains(" 0.001 m"),
            "{:?}",
            moved.warnings
        );
    }

    #[test]
    fn motion_reads_as_in_the_test_file() {
        let text = r#"
            signal.file = { path = "el.AT2", resample = "band_limited", column = { number = 2 } }
            processing = { detrend = "linear", target_peak = { value = 0.3, unit = "g" } }
        "#;
        let motion: Motion = toml::from_str(text).unwrap();
        assert_eq!(motion.signal.path(), Some("el.AT2"));
        assert_eq!(motion.processing.scale_factor, 1.0);
        let again: Motion = toml::from_str(&toml::to_string(&motion).unwrap()).unwrap();
        assert_eq!(again, motion);
        for text in [
            "signal.sine = { amplitude = 1.0, frequency_hz = 1.0 }",
            "signal.sweep = { amplitude = 1, unit = \"mm\", from_hz = 1, to_hz = 2, duration_s = 3, kind = \"linear\" }",
            "signal.band_limited_noise = { rms = 1, from_hz = 0, to_hz = 2, duration_s = 3, seed = 1 }",
            "signal.kanai_tajimi = { ground_frequency_hz = 2.4, ground_damping_ratio = 0.6, envelope = \"none\", \
             duration_s = 3, seed = 1, peak = 0.3, unit = \"g\" }",
            "signal.kanai_tajimi = { ground_frequency_hz = 2.4, ground_damping_ratio = 0.6, duration_s = 3, seed = 1, \
             peak = 0.3, envelope.jennings_housner = { rise_s = 1, strong_s = 2, decay_per_s = 0.3 }, \
             clough_penzien = { angular_frequency_rad_per_s = 1.5, damping_ratio = 0.6 } }",
            "signal.step = { amplitude = 1 }",
            "signal.ramp_and_hold = { levels = [1, 0], speed = 2, hold_s = 1 }",
            "signal.cyclic = { amplitudes = [1], cycles_per_amplitude = 3, frequency_hz = 1 }",
            "signal.ricker = { amplitude = 1, frequency_hz = 2 }",
            "signal.constant = { value = 1 }",
            "signal.values = { values = [0, 1], dt_s = 0.1 }",
        ] {
            let motion: Motion = toml::from_str(text).unwrap();
            let quantity = if text.contains("\"mm\"") {
                Quantity::Displacement
            } else {
                Quantity::Acceleration
            };
            let series = motion
                .evaluate(quantity, grid(0.01, 100), &no_files)
                .unwrap();
            assert_eq!(series.values.len(), 101);
            let again: Motion = toml::from_str(&toml::to_string(&motion).unwrap()).unwrap();
            assert_eq!(again, motion);
        }
        assert!(
            toml::from_str::<Motion>(
                "signal.sine = { amplitude = 1, frequency_hz = 1, phse_rad = 2 }"
            )
            .is_err()
        );
        let schema = serde_json::to_string(&schemars::schema_for!(Motion)).unwrap();
        assert!(schema.contains("ground_damping_ratio") && schema.contains("m/s2"));
    }
}
