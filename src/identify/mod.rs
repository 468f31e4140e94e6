//! What a specimen and its actuator are, from one recorded motion: numbers in, numbers out.
//!
//! A [`Record`] begins and ends at rest, so that the ratio of two whole transforms is the frequency response without any
//! window: noise that is white in time stays white and independent from line to line, and standard errors mean what
//! they say. The command is known exactly; only what is measured carries noise.
//!
//! | file | holds |
//! |---|---|
//! | `lines` | the transforms, and the lines of the band |
//! | `frequency` | gain and delay over frequency with their coherence; the coarse delay and the sign |
//! | `model`, `fit` | delay, first and second order as [`crate::transfer`] samples them; their least squares |
//! | `inverse` | what a compensator begins with |
//! | `specimen` | stiffness and damping from force and displacement |
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

use serde::Serialize;
use thiserror::Error;

pub use drive::{Course, CourseError, Demand, Shape};
pub use fit::{Fit, Found};
pub use frequency::Point;
pub use inverse::Inverse;
pub use model::{Model, Parameter};
pub use specimen::SpecimenFit;

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

/// Root mean square of what is measured while nothing moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Noise {
    /// Displacement, m.
    pub disp_m: f64,
    /// Force, N.
    pub force_n: f64,
    /// Samples that it was taken from.
    pub samples: usize,
}

/// Why nothing can be said of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum IdentifyError {
    /// Columns of different lengths, or an interval that is none.
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
        /// Which column.
        column: &'static str,
        /// Which sample, from 1.
        index: usize,
        /// What was found.
        found: f64,
    },
    /// The command stood still.
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
        "the measured force falls as the displacement grows: {stiffness:.4e} N/m; the sign of the load cell is wrong, or the \
         specimen is unstable"
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
    /// Delay in s that fits the whole band best; its spread holds both the error and how much the delay changes in the band.
    pub delay: Estimate,
    /// Gain, likewise.
    pub gain: Estimate,
    /// Coefficients that undo the actuator.
    pub inverse: Option<Inverse>,
    /// What resists.
    pub specimen: Option<SpecimenFit>,
    /// What is measured at rest.
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
    let (coarse, sign) = frequency::coarse_delay(&lines);
    let bins = frequency::bins(&lines, coarse);
    let coherence = frequency::mean_coherence(&bins);
    if !(coherence >= LEAST_COHERENCE) {
        return Err(IdentifyError::DoesNotFollow { coherence });
    }
    if sign < 0.0 {
        let gain = -bins.first().map_or(0.0, |bin| bin.value.norm());
        return Err(IdentifyError::Reversed { gain });
    }
    let points = frequency::points(&bins, coarse);
    let deviations = frequency::deviations(&bins, lines.command.len());
    let mut models = fit::fit_all(&lines, &deviations, &points, coarse);
    let (delay, gain) = over_band(&points, &models, coarse);
    let inverse = inverse::invert(&points, record.dt);
    models.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
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

/// Delay and gain of the whole band, with the error of the fit and what changes within the band.
fn over_band(points: &[Point], models: &[Fit], coarse: f64) -> (Estimate, Estimate) {
    let pure = models.iter().find(|fit| fit.model == Model::Delay);
    let read = |name: &str, otherwise: f64| {
        pure.and_then(|fit| fit.parameter(name))
            .unwrap_or(Estimate {
                value: otherwise,
                std: 0.0,
            })
    };
    let (delay, gain) = (read("delay_s", coarse), read("gain", 1.0));
    let mut sums = [0.0; 4];
    for point in points.iter().filter(|point| point.trusted) {
        let weight = point.hz * point.hz;
        let off = point.delay_s - delay.value;
        sums[0] += weight;
        sums[1] += weight * (off * off - point.delay_std_s * point.delay_std_s);
        let off = point.gain - gain.value;
        sums[2] += 1.0;
        sums[3] += off * off - point.gain_std * point.gain_std;
    }
    let spread = |estimate: Estimate, sum: f64, weights: f64| {
        let changes = if weights > 0.0 {
            (sum / weights).max(0.0)
        } else {
            0.0
        };
        Estimate {
            value: estimate.value,
            std: (estimate.std * estimate.std + changes).sqrt(),
        }
    };
    (
        spread(delay, sums[1], sums[0]),
        spread(gain, sums[3], sums[2]),
    )
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
