//! Identification of a specimen and its actuator from one recorded motion: numbers in, numbers out.
//!
//! A [`Record`] begins and ends at rest, so that the ratio of two whole transforms is the frequency response without any
//! window: noise that is white in time stays white and independent from line to line, and standard errors mean what
//! they say. The command is known exactly; only what is measured carries noise.
//!
//! | file | holds |
//! |---|---|
//! | `lines` | the transforms, and the lines of the band |
//! | `frequency` | gain and delay over frequency with their coherence; the coarse delay and the sign |
//! | `model`, `fit` | delay, first and second order as `gusset_actuator::transfer` samples them; their least squares |
//! | `inverse` | what a compensator begins with |
//! | `specimen` | stiffness and damping from force and displacement, and what axes feel of each other |
//! | `drive` | the motion, and how far it may go |
//!
//! Invariant: every range check is written so that a number that is not finite fails it; nothing here panics or guesses where
//! nothing was measured. No clock, no files.

mod drive;
mod fit;
mod frequency;
mod inverse;
mod lines;
mod model;
mod specimen;

use nalgebra::ComplexField as _;
use serde::Serialize;
use thiserror::Error;

pub use drive::{Course, CourseError, Demand, Shape};
pub use fit::{Fit, Found};
pub use frequency::Point;
pub use inverse::Inverse;
pub use model::{Model, Parameter};
pub use specimen::{Felt, SpecimenFit};

use lines::Lines;

/// Mean coherence below which nothing follows the command.
const LEAST_COHERENCE: f64 = 0.5;
/// Coherence from which a point is trusted.
const TRUSTED: f64 = 0.8;

/// One axis while it was driven, SI at the specimen's own scale, evenly sampled, all columns of one length.
#[derive(Debug, Clone, Copy)]
pub struct Record<'a> {
    /// Interval in s.
    pub dt: f64,
    /// Displacement that was sent.
    pub command: &'a [f64],
    /// Displacement that was measured.
    pub measured: &'a [f64],
    /// Force that was measured.
    pub force: &'a [f64],
    /// Samples at the start in which everything rests, and at the end.
    pub rest: [usize; 2],
}

/// Frequencies that were excited, in Hz.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// Lowest.
    pub from_hz: f64,
    /// Highest.
    pub to_hz: f64,
}

/// A number and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// Root mean square of the measured signals while nothing moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Noise {
    /// Displacement, m.
    pub disp_m: f64,
    /// Force, N.
    pub force_n: f64,
    /// Samples that it was taken from.
    pub samples: usize,
}

/// Reason why the identification of an axis failed.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum IdentifyError {
    /// Columns of different lengths, or an interval that is not positive.
    #[error("the record is no record: {samples} samples, interval {dt} s")]
    NoRecord {
        /// Samples that all columns have.
        samples: usize,
        /// The interval.
        dt: f64,
    },
    /// Too few lines of the spectrum in the band.
    #[error(
        "the band from {from_hz} Hz to {to_hz} Hz holds {found} lines of the spectrum, {wanted} are needed: a longer motion or a \
         wider band"
    )]
    TooShort {
        /// Lower edge.
        from_hz: f64,
        /// Upper edge.
        to_hz: f64,
        /// Lines in it.
        found: usize,
        /// Lines that are needed.
        wanted: usize,
    },
    /// A number that is not finite.
    #[error("sample {index} of the {column} is {found}")]
    NotFinite {
        /// The column.
        column: &'static str,
        /// The sample, from 1.
        index: usize,
        /// The value found.
        found: f64,
    },
    /// The command did not move.
    #[error("the command did not move")]
    Still,
    /// The measured displacement has nothing to do with the command.
    #[error(
        "the measured displacement does not follow the command: mean coherence {coherence:.3}, wanted at least {LEAST_COHERENCE}"
    )]
    DoesNotFollow {
        /// Mean coherence over the band.
        coherence: f64,
    },
    /// It goes the other way.
    #[error(
        "the measured displacement goes the other way: gain {gain:.4}; the `sign` of the axis or the wiring of the sensor is wrong"
    )]
    Reversed {
        /// Gain of the slowest part.
        gain: f64,
    },
    /// The force falls where the displacement grows.
    #[error(
        "the measured force falls as the displacement grows: {}; the sign of the load cell is wrong, or the \
         specimen is unstable",
        gusset_quantity::units::quantity(*stiffness, "N/m")
    )]
    ForceReversed {
        /// Stiffness found.
        stiffness: f64,
    },
}

/// What one axis is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identification {
    /// Frequencies that it holds for.
    pub band: Band,
    /// Lines of the spectrum in the band.
    pub lines: usize,
    /// Measured over commanded displacement, over frequency.
    pub response: Vec<Point>,
    /// Mean coherence over the band.
    pub coherence: f64,
    /// All models that could be fitted, the best first.
    pub models: Vec<Fit>,
    /// Delay in s over the band, every octave alike; its spread holds both the error and how much the delay changes in the band.
    pub delay: Estimate,
    /// Gain, likewise.
    pub gain: Estimate,
    /// Coefficients that undo the actuator.
    pub inverse: Option<Inverse>,
    /// What resists.
    pub specimen: Option<SpecimenFit>,
    /// Measured signals at rest.
    pub noise: Noise,
}

impl Identification {
    /// The model that explains the measurements with the fewest parameters.
    #[must_use]
    pub fn best(&self) -> Option<&Fit> {
        self.models.first()
    }
}

/// Identifies one axis.
///
/// # Errors
/// [`IdentifyError`]: nothing moved, nothing followed, or too little is known. A force that goes the wrong way is
/// [`IdentifyError::ForceReversed`].
pub fn identify(record: &Record<'_>, band: Band) -> Result<Identification, IdentifyError> {
    let lines = Lines::of(record, band)?;
    let noise = noise(record);
    if lines.is_dead() {
        return Err(IdentifyError::DoesNotFollow { coherence: 0.0 });
    }
    let (coarse, sign) = frequency::coarse_delay(&lines);
    let bins = frequency::bins(&lines, coarse);
    let coherence = frequency::mean_coherence(&bins);
    let follows = coherence >= LEAST_COHERENCE;
    if !follows {
        return Err(IdentifyError::DoesNotFollow { coherence });
    }
    if sign < 0.0 {
        let gain = -bins.first().map_or(0.0, |bin| bin.value.modulus());
        return Err(IdentifyError::Reversed { gain });
    }
    let points = frequency::points(&bins, coarse);
    let deviations = frequency::deviations(&bins, lines.command.len());
    let mut models = fit::fit_all(&lines, &deviations, &points, coarse);
    let inverse = inverse::invert(&points, record.dt);
    models.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    prefer_the_simplest(&mut models);
    let (delay, gain) = over_band(&points, models.first(), record.dt);
    let specimen = specimen::fit(&lines, models.first(), noise.force_n)?;
    Ok(Identification {
        band,
        lines: lines.command.len(),
        response: points,
        coherence,
        models,
        delay,
        gain,
        inverse,
        specimen,
        noise,
    })
}

/// Force of another, held axis due to the motion of this one. `record` is that of the moving axis, with the force of the held
/// one instead, and `found` is the identification of the moving axis. `None` if there is nothing beyond noise.
///
/// # Errors
/// [`IdentifyError`], as for the axis that moves.
pub fn felt(
    record: &Record<'_>,
    band: Band,
    found: &Identification,
) -> Result<Option<Felt>, IdentifyError> {
    let lines = Lines::of(record, band)?;
    Ok(specimen::felt(&lines, found.best()))
}

/// Difference of the criterion from which on a further parameter counts as proven (Kass & Raftery 1995: strong evidence).
const STRONG: f64 = 6.0;

/// Puts the model with the fewest parameters first that nothing else is proven to be better than.
fn prefer_the_simplest(models: &mut [Fit]) {
    let least = models.first().map_or(0.0, |best| best.criterion);
    let as_good = models
        .iter()
        .enumerate()
        .filter(|(_, fit)| fit.criterion - least < STRONG);
    let simplest = as_good.min_by_key(|(_, fit)| fit.parameters.len());
    if let Some((place, _)) = simplest {
        models[..=place].rotate_right(1);
    }
}

/// Delay and gain of the whole band, every octave alike, as the best model has them at the points that are trusted: a structure
/// moves most where it is slow. The spread holds the error and what changes within the band.
fn over_band(points: &[Point], best: Option<&Fit>, dt: f64) -> (Estimate, Estimate) {
    let mut means = [(0.0, 0.0); 2];
    let mut weights = 0.0;
    let mut known = [0.0; 2];
    for point in points.iter().filter(|point| point.trusted) {
        let weight = 1.0 / point.hz;
        let pair = match best {
            Some(fit) => [
                fit.delay(point.hz, dt),
                fit.response(point.hz, dt).modulus(),
            ],
            None => [point.delay_s, point.gain],
        };
        weights += weight;
        for ((mean, value), (known, std)) in means
            .iter_mut()
            .zip(pair)
            .zip(known.iter_mut().zip([point.delay_std_s, point.gain_std]))
        {
            // West 1979: mean and sum of squares in one pass.
            let off = value - mean.0;
            mean.0 += off * weight / weights;
            mean.1 += weight * off * (value - mean.0);
            *known += 1.0 / (std * std);
        }
    }
    let estimate = |(value, square): (f64, f64), known: f64| {
        let changes = if weights > 0.0 { square / weights } else { 0.0 };
        let error = if known > 0.0 { 1.0 / known } else { 0.0 };
        Estimate {
            value,
            std: (changes + error).sqrt(),
        }
    };
    (estimate(means[0], known[0]), estimate(means[1], known[1]))
}

/// Root mean square about the mean of each rest; of the last one only the second half, when the actuator has arrived.
fn noise(record: &Record<'_>) -> Noise {
    let n = record.command.len();
    let first = 0..record.rest[0].min(n);
    let last = n - (record.rest[1] / 2).min(n)..n;
    let rms = |column: &[f64]| {
        let (mut sum, mut count) = (0.0, 0_usize);
        for range in [first.clone(), last.clone()] {
            let part = column.get(range).unwrap_or_default();
            if part.len() < 2 {
                continue;
            }
            let mean = part.iter().sum::<f64>() / part.len() as f64;
            sum += part.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>();
            // The mean took one degree of freedom.
            count += part.len() - 1;
        }
        if count > 0 {
            (sum / count as f64).sqrt()
        } else {
            0.0
        }
    };
    Noise {
        disp_m: rms(record.measured),
        force_n: rms(record.force),
        samples: first.len() + last.len(),
    }
}
