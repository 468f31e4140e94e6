//! What the run folder says of each axis that was driven.

use std::path::Path;

use anyhow::Context;
use serde_json::{Value, json};

use super::super::exit::{Exit, WithExit};
use super::course::{Driven, Plan, gear};
use crate::config::Loaded;
use crate::identify::{Identification, IdentifyError, Record, identify};
use crate::record::Run;

/// State of a row in which the test runs.
const RUNNING: f64 = 3.0;
/// Status flag of a measurement that is not of its tick.
const STALE: u32 = 262_144;
/// Points of a force–displacement loop that are kept for its picture.
const MOST_POINTS: usize = 4000;

/// What one axis is, or why that is not known.
pub(super) struct Axis {
    pub driven: Driven,
    pub found: Result<Identification, IdentifyError>,
    /// N/m of the structure per N/m of the specimen, and N s/m likewise.
    pub to_structure: (f64, f64),
    /// Measured displacement (m) and force (N) at the specimen, thinned.
    pub walk: (Vec<f64>, Vec<f64>),
    /// Rows whose measurement was not of their tick.
    pub stale: usize,
    /// Seconds from one sample to the next.
    pub tick: f64,
}

/// All axes.
pub(super) struct Outcome {
    pub axes: Vec<Axis>,
    pub band: (f64, f64),
    pub tick: f64,
    /// Ticks by which the grid was moved in wall time.
    pub stretched: f64,
}

impl Outcome {
    /// Reads a run folder and identifies.
    pub fn read(folder: &Path, plan: &Plan, driven: &Loaded) -> anyhow::Result<Self> {
        let run = Run::open(folder)?;
        let book = run.columns(&["state", "step", "stretched"])?;
        let [state, step, stretched] = book.as_slice() else {
            anyhow::bail!("the record lacks its own columns");
        };
        let first = state.iter().position(|s| *s == RUNNING);
        let last = state.iter().rposition(|s| *s == RUNNING);
        let (Some(first), Some(last)) = (first, last) else {
            return Err(broken("no row was recorded while the motion ran"));
        };
        if state[first..=last].iter().any(|s| *s != RUNNING) {
            return Err(broken("the motion was held on its way"));
        }
        let steps = step.get(first..=last).unwrap_or_default();
        if steps.windows(2).any(|pair| pair[1] != pair[0] + 1.0) {
            return Err(broken("rows of the motion were lost"));
        }
        let axes = plan.axes.iter().map(|one| {
            axis(&run, plan, driven, one, first..last + 1)
                .with_context(|| format!("specimen \"{}\" axis {}", one.name, one.axis + 1))
        });
        Ok(Self {
            axes: axes.collect::<anyhow::Result<_>>()?,
            band: (plan.band.from_hz, plan.band.to_hz),
            tick: plan.tick,
            stretched: stretched.last().copied().unwrap_or(0.0),
        })
    }

    /// The first thing that could not be found out, in words.
    pub fn first_error(&self) -> Option<String> {
        self.axes.iter().find_map(|axis| {
            let error = axis.found.as_ref().err()?;
            let Driven { name, axis, .. } = &axis.driven;
            Some(format!("specimen \"{name}\" axis {}: {error}", axis + 1))
        })
    }

    /// Everything, as one document.
    pub fn as_json(&self, folder: &Path) -> Value {
        let axes: Vec<Value> = self.axes.iter().map(Axis::as_json).collect();
        json!({
            "run": folder.display().to_string(),
            "band_hz": [self.band.0, self.band.1],
            "tick_s": self.tick,
            "stretched_ticks": self.stretched,
            "axes": axes,
        })
    }
}

fn broken(why: &str) -> anyhow::Error {
    let text = format!("{why}: nothing is identified from a broken record");
    WithExit(Exit::Stopped, text).into()
}

fn axis(
    run: &Run,
    plan: &Plan,
    driven: &Loaded,
    one: &Driven,
    running: std::ops::Range<usize>,
) -> anyhow::Result<Axis> {
    let table = driven.file.specimen.get(one.place);
    let table = table.context("the driven test lost a specimen")?;
    let units = table.units_of(one.axes);
    let (metres, newtons) = units
        .get(one.axis)
        .map_or((1.0, 1.0), |units| (units.metres, units.newtons));
    let (specimen, axis) = (one.place + 1, one.axis + 1);
    let column = |kind: &str| format!("{kind}_{specimen}_{axis}");
    let names = [
        column("cmd"),
        column("raw_disp"),
        column("raw_force"),
        format!("status_{specimen}"),
    ];
    let columns = run.columns(&names.each_ref().map(String::as_str))?;
    let from = running.start + (one.start - plan.rest) as usize;
    let to = (running.start + (one.start + plan.ticks + plan.rest) as usize + 1).min(running.end);
    let part = |index: usize, unit: f64| -> Vec<f64> {
        let all = columns.get(index).and_then(|values| values.get(from..to));
        all.unwrap_or_default().iter().map(|v| v * unit).collect()
    };
    let (command, measured, force) = (part(0, metres), part(1, metres), part(2, newtons));
    let is_stale = |status: &f64| (*status as u32) & STALE != 0;
    let stale = part(3, 1.0).iter().filter(|s| is_stale(s)).count();
    let record = Record {
        dt: plan.tick,
        command: &command,
        measured: &measured,
        force: &force,
        rest: [plan.rest as usize; 2],
    };
    let found = identify(&record, plan.band);
    let every = measured.len().div_ceil(MOST_POINTS).max(1);
    let thin = |values: &[f64]| values.iter().step_by(every).copied().collect();
    let (length, newton, time) = gear(table, one.axis);
    Ok(Axis {
        driven: one.clone(),
        found,
        to_structure: (newton / length, newton / length * time),
        walk: (thin(&measured), thin(&force)),
        stale,
        tick: plan.tick,
    })
}

impl Axis {
    fn as_json(&self) -> Value {
        let mut all = json!({
            "specimen": self.driven.name,
            "axis": self.driven.axis + 1,
            "amplitude_m": self.driven.amplitude,
            "stale_rows": self.stale,
        });
        let Some(object) = all.as_object_mut() else {
            return all;
        };
        match &self.found {
            Err(error) => {
                object.insert("error".into(), json!(error.to_string()));
            }
            Ok(found) => {
                let structure = found.specimen.map(|specimen| {
                    let (k, c) = self.to_structure;
                    json!({
                        "stiffness_n_per_m": k * specimen.stiffness.value,
                        "stiffness_std_n_per_m": k * specimen.stiffness.std,
                        "damping_n_s_per_m": c * specimen.damping.value,
                        "damping_std_n_s_per_m": c * specimen.damping.std,
                    })
                });
                object.insert("identification".into(), json!(found));
                object.insert("at_structure".into(), json!(structure));
            }
        }
        all
    }
}
