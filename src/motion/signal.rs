//! What a motion can be: a file, numbers in the test file, a closed form, or a seeded random motion.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, all_finite, not_negative, positive};
use super::noise::{BandLimitedNoise, KanaiTajimi};
use super::paths::{Cyclic, RampAndHold, Step};
use super::read::{Column, ReadOptions, RecordFormat, parse_record};
use super::resample::Resample;
use super::sampled::{Origin, Sampled};
use super::shapes::{Constant, Curve, Ricker, Sine, Sweep, factor};
use super::unit::{Quantity, Unit};
use super::{Files, RecordFacts};

/// A function of time. Where it stands decides what it is of (an acceleration, a displacement, a force); numbers
/// are in the key `unit` of each, or in the SI unit of that quantity if `unit` is absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Signal {
    /// A record from a file.
    File(FileSignal),
    /// Numbers in the test file itself.
    Values(Values),
    /// A sine.
    Sine(Sine),
    /// A sine of moving frequency.
    Sweep(Sweep),
    /// Noise between two frequencies.
    BandLimitedNoise(BandLimitedNoise),
    /// A synthetic earthquake.
    KanaiTajimi(KanaiTajimi),
    /// A step.
    Step(Step),
    /// Ramps with rests between them.
    RampAndHold(RampAndHold),
    /// Cycles of given amplitudes.
    Cyclic(Cyclic),
    /// A pulse.
    Ricker(Ricker),
    /// The same value throughout.
    Constant(Constant),
}

/// A record from a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct FileSignal {
    /// Where the file is, relative to the test file.
    pub path: String,
    /// Its format; the ending of its name and its first lines tell if absent.
    pub format: Option<RecordFormat>,
    /// Its column of values or its component (`N-S`, `Channel 3`), by name or by number from 1, where there are several.
    pub column: Option<Column>,
    /// Its column of times; one named `t` or `time`, or the first of a table without names, if absent. Times in ms, min or
    /// another unit that the header states are converted.
    pub time_column: Option<Column>,
    /// Lines of a table in text that are skipped before anything is read; 0 if absent.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub skip_rows: usize,
    /// Its time step in s; what the file says if absent. Overrules the file, with a warning, even where
    /// its times are not uniform.
    pub dt_s: Option<f64>,
    /// Unit of its numbers; what the file states if absent, and an error if it states none. Overrules the file.
    pub unit: Option<Unit>,
    /// `linear` (the default) or `band_limited`.
    #[serde(default)]
    pub resample: Resample,
    /// Test time in s at which the record begins; 0 if absent.
    #[serde(default)]
    pub start_s: f64,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Numbers in the test file itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Values {
    /// The numbers, in `unit`, or in the SI unit of the quantity.
    pub values: Vec<f64>,
    /// Their distance in s.
    pub dt_s: f64,
    /// Their unit; SI if absent.
    pub unit: Option<Unit>,
    /// `linear` (the default) or `band_limited`.
    #[serde(default)]
    pub resample: Resample,
    /// Test time in s of the first number; 0 if absent.
    #[serde(default)]
    pub start_s: f64,
}

/// A signal made ready to be evaluated, in SI units.
pub(super) enum Source {
    /// In closed form.
    Curve(Curve),
    /// In samples.
    Sampled(Sampled),
}

impl Signal {
    /// Path of the file that the signal reads, if it reads one.
    #[must_use]
    pub fn path(&self) -> Option<&str> {
        if let Self::File(file) = self {
            Some(&file.path)
        } else {
            None
        }
    }

    /// The path of the file, to be changed: `resolved.toml` points to the copy in the run folder.
    pub fn path_mut(&mut self) -> Option<&mut String> {
        if let Self::File(file) = self {
            Some(&mut file.path)
        } else {
            None
        }
    }

    pub(super) fn source(
        &self,
        quantity: Quantity,
        files: &Files<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Source, MotionError> {
        Ok(match self {
            Self::File(file) => Source::Sampled(file.sampled(quantity, files, warnings)?),
            Self::Values(values) => Source::Sampled(values.sampled(quantity)?),
            Self::BandLimitedNoise(noise) => Source::Sampled(noise.sampled(quantity)?),
            Self::KanaiTajimi(quake) => Source::Sampled(quake.sampled(quantity)?),
            Self::Sine(shape) => Source::Curve(shape.curve(quantity)?),
            Self::Sweep(shape) => Source::Curve(shape.curve(quantity)?),
            Self::Step(shape) => Source::Curve(shape.curve(quantity)?),
            Self::RampAndHold(shape) => Source::Curve(shape.curve(quantity)?),
            Self::Cyclic(shape) => Source::Curve(shape.curve(quantity)?),
            Self::Ricker(shape) => Source::Curve(shape.curve(quantity)?),
            Self::Constant(shape) => Source::Curve(shape.curve(quantity)?),
        })
    }
}

impl FileSignal {
    fn sampled(
        &self,
        quantity: Quantity,
        files: &Files<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Sampled, MotionError> {
        let start = not_negative("start_s", self.start_s)?;
        let bytes = files(&self.path).map_err(|source| MotionError::Unreadable {
            file: self.path.clone(),
            source,
        })?;
        let options = ReadOptions {
            format: self.format,
            dt: self.dt_s,
            column: self.column.clone(),
            time_column: self.time_column.clone(),
            skip_rows: self.skip_rows,
        };
        let record = parse_record(&self.path, &bytes, &options)?;
        warnings.extend(record.warnings.iter().cloned());
        if let (Some(given), Some(stated)) = (self.unit, record.unit)
            && given != stated
        {
            warnings.push(format!(
                "{}: the file says its unit is {stated}, unit = \"{given}\" overrules it",
                self.path
            ));
        }
        if let (None, Some(stated), Some(line)) = (self.unit, record.unit, record.source.unit_line)
        {
            warnings.push(format!(
                "{}:{line}: the unit {stated} in this line of the header is taken as that of its values: `unit` overrules it",
                self.path
            ));
        }
        let unit = self.unit.or(record.unit);
        let unit = unit.ok_or_else(|| MotionError::UnitMissing {
            file: self.path.clone(),
            header: match &record.source.unknown_unit {
                Some(unit) => unit.clone(),
                None => record.title.clone(),
            },
            quantity,
        })?;
        let to_si = factor(Some(unit), quantity)?;
        let values: Vec<f64> = record.values.iter().map(|v| v * to_si).collect();
        let facts = RecordFacts::of(&self.path, &record, unit, quantity, &values);
        facts.doubt_values(&record.values, warnings);
        let samples = record_samples(self.path.clone(), values, record.dt, start, self.resample)?;
        Ok(Sampled {
            record: Some(facts),
            ..samples
        })
    }
}

impl Values {
    fn sampled(&self, quantity: Quantity) -> Result<Sampled, MotionError> {
        let start = not_negative("start_s", self.start_s)?;
        let dt = positive("dt_s", self.dt_s)?;
        if self.values.is_empty() {
            return Err(MotionError::Length {
                what: "values",
                wanted: 1,
                found: 0,
            });
        }
        let to_si = factor(self.unit, quantity)?;
        let values = self.values.iter().map(|v| v * to_si).collect();
        record_samples("values".into(), values, dt, start, self.resample)
    }
}

fn record_samples(
    name: String,
    values: Vec<f64>,
    dt: f64,
    start: f64,
    resample: Resample,
) -> Result<Sampled, MotionError> {
    all_finite("the record in SI units", &values)?;
    let duration = values.len().saturating_sub(1) as f64 * dt;
    Ok(Sampled {
        dt,
        first_time: start,
        span: (start, start + duration),
        values,
        resample,
        origin: Origin::Record(name),
        record: None,
    })
}
