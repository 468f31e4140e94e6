//! Ground motion of a benchmark: a record, or a motion made for it.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;

use crate::cli::tell;
use gusset_config::read_input;
use gusset_evidence::benchmark::{DURATION_S, RATE_HZ, synthetic};
use gusset_motion::{
    FileSignal, Grid, Motion, MotionError, Processing, Quantity, Resample, Signal, Unit,
};

#[derive(Debug, Args)]
pub struct GroundArgs {
    /// Ground acceleration from a file: .AT2, .csv, two columns, or the format of a strong-motion network [default: a synthetic
    /// earthquake].
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Unit of the record, if the file does not state it.
    #[arg(long, requires = "record")]
    unit: Option<String>,
    /// Time step of the record in s, if the file does not state it.
    #[arg(long, value_name = "S", requires = "record")]
    record_dt: Option<f64>,
    /// Factor on the record [default: 0.4].
    #[arg(long, requires = "record", value_parser = finite, allow_negative_numbers = true)]
    scale: Option<f64>,
}

/// Factor of a record that has none.
const SCALE: f64 = 0.4;

fn finite(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number".to_owned())?;
    value
        .is_finite()
        .then_some(value)
        .ok_or_else(|| "a finite number".to_owned())
}

impl GroundArgs {
    /// The record on the grid of the benchmark.
    pub fn history(&self, seed: u64) -> anyhow::Result<Vec<f64>> {
        let grid = Grid::new(1.0 / RATE_HZ, (DURATION_S * RATE_HZ) as usize)?;
        let motion = match &self.record {
            Some(path) => {
                let name = path
                    .to_str()
                    .context("the path of the record is no UTF-8")?;
                let unit = self.unit.as_deref().map(|unit| {
                    toml::Value::from(unit).try_into::<Unit>().map_err(|_| {
                        let allowed = Quantity::Acceleration.spellings();
                        anyhow::anyhow!("--unit {unit:?}: use one of {allowed}")
                    })
                });
                Motion {
                    signal: Signal::File(FileSignal {
                        path: name.to_owned(),
                        format: None,
                        column: None,
                        time_column: None,
                        skip_rows: 0,
                        dt_s: self.record_dt,
                        unit: unit.transpose()?,
                        resample: Resample::default(),
                        start_s: 0.0,
                    }),
                    processing: Processing {
                        scale_factor: self.scale.unwrap_or(SCALE),
                        zero_tail: true,
                        ..Processing::default()
                    },
                    delay_s: 0.0,
                }
            }
            None => synthetic(seed),
        };
        let files = |name: &str| read_input(Path::new(name));
        let series = motion
            .evaluate(Quantity::Acceleration, grid, &files)
            .map_err(|error| match error {
                // The key of a test file is an option here.
                MotionError::StepMissing { file } => anyhow::anyhow!(
                    "{file}: no time step: give --record-dt, or a file with a time column or a header that states it"
                ),
                other => other.into(),
            })?;
        for warning in &series.warnings {
            tell(format_args!("warning: {warning}"));
        }
        let peak = series.values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        anyhow::ensure!(
            peak > 0.0,
            "the record does not move the ground within {DURATION_S} s"
        );
        Ok(series.values)
    }
}
