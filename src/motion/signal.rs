//! Kinds of motion: a file, numbers in the test file, a closed form, or a random motion with a seed.

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

/// Time history. Its place determines the quantity: an acceleration, a displacement or a force.
/// Numbers have the `unit` of the signal, or the SI unit of the quantity if `unit` is absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Signal {
    /// Record from a file.
    File(FileSignal),
    /// Numbers in the test file itself.
    Values(Values),
    /// Sine wave.
    Sine(Sine),
    /// Sine wave whose frequency changes from one value to another.
    Sweep(Sweep),
    /// Random noise between two frequencies.
    BandLimitedNoise(BandLimitedNoise),
    /// Synthetic earthquake (Kanai–Tajimi).
    KanaiTajimi(KanaiTajimi),
    /// Step from zero to a constant value.
    Step(Step),
    /// Ramps between levels, with a rest at each level.
    RampAndHold(RampAndHold),
    /// Cycles with given amplitudes.
    Cyclic(Cyclic),
    /// Ricker pulse.
    Ricker(Ricker),
    /// Constant value.
    Constant(Constant),
}

/// Record from a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct FileSignal {
    /// File that contains the record, relative to the test file.
    #[schemars(example = &"el-centro.at2")]
    pub path: String,
    /// Format of the file. Default: determined from the file name and the first lines.
    #[schemars(example = &"peer")]
    pub format: Option<RecordFormat>,
    /// Column or component with the values, by name or by number from 1. Required if the file has
    /// several columns of values.
    #[schemars(example = serde_json::json!({"name": "N-S"}))]
    pub column: Option<Column>,
    /// Column with the times. A unit in the header, such as ms or min, is converted to s. Default:
    /// a column named `t` or `time`, or the first column of a table without names.
    #[schemars(example = serde_json::json!({"number": 1}))]
    pub time_column: Option<Column>,
    /// Number of lines to skip at the start of a text table. Default: 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    #[schemars(example = 2)]
    pub skip_rows: usize,
    /// Time step of the record. It overrides the time step of the file, with a warning. Default:
    /// the time step of the file.
    #[schemars(example = 0.005)]
    pub dt_s: Option<f64>,
    /// Unit of the numbers. It overrides the unit of the file. Default: the unit of the file; a
    /// file without a unit is refused.
    #[schemars(example = &"g")]
    pub unit: Option<Unit>,
    /// Interpolation between the samples of the record.
    #[serde(default)]
    #[schemars(example = &"band_limited")]
    pub resample: Resample,
    /// Test time at which the record begins.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub start_s: f64,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Numbers in the test file itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Values {
    /// Values at equal time steps, in `unit` or the SI unit of the quantity.
    #[schemars(example = [0.0, 0.5, 1.0, 0.5, 0.0])]
    pub values: Vec<f64>,
    /// Time step between the values.
    #[schemars(example = 0.01)]
    pub dt_s: f64,
    /// Unit of the values. Default: the SI unit of the quantity.
    #[schemars(example = &"mm")]
    pub unit: Option<Unit>,
    /// Interpolation between the values.
    #[serde(default)]
    #[schemars(example = &"band_limited")]
    pub resample: Resample,
    /// Test time of the first value.
    #[serde(default)]
    #[schemars(example = 1.0)]
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
