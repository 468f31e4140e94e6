//! Results for each driven axis, from the run folder.

use std::path::Path;

use serde_json::{Value, json};

use super::IdentificationError as Error;
use super::plan::{Driven, Plan, gear};
use gusset_config::Loaded;
use gusset_control::engine::Phase;
use gusset_motion::identify::{Felt, Identification, IdentifyError, Record, felt, identify};
use gusset_quantity::catalog::column;
use gusset_quantity::substructure::Status;
use gusset_record::Run;

/// State of a row in which the test runs.
const RUNNING: f64 = Phase::Running.code();
/// Points of a force–displacement loop that are kept for its picture.
const MOST_POINTS: usize = 4000;

/// Properties of one axis, or why they are not known.
#[derive(Debug)]
pub struct Axis {
    /// The axis and its motion.
    pub driven: Driven,
    /// The identified properties.
    pub found: Result<Identification, IdentifyError>,
    /// Forces of every other axis of the specimen while it was held, by its number from 0; axes without a force are
    /// absent.
    pub felt: Vec<(usize, Felt)>,
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
#[derive(Debug)]
pub struct Outcome {
    /// In the order of their motions.
    pub axes: Vec<Axis>,
    /// Lowest and highest frequency in Hz.
    pub band: (f64, f64),
    /// Period of the controller in s.
    pub tick: f64,
    /// Ticks by which the grid was moved in wall time.
    pub stretched: f64,
}

impl Outcome {
    /// Reads a run folder and identifies.
    ///
    /// # Errors
    /// The record cannot be read, or has gaps.
    pub fn read(folder: &Path, plan: &Plan, driven: &Loaded) -> Result<Self, Error> {
        let run = Run::open(folder)?;
        let book =
            run.columns(&[column::STATE, column::STEP, column::STRETCHED].map(|kind| kind.name()))?;
        let [state, step, stretched] = book.as_slice() else {
            return Err(Error::Broken("the record lacks its own columns"));
        };
        let first = state.iter().position(|s| *s == RUNNING);
        let last = state.iter().rposition(|s| *s == RUNNING);
        let (Some(first), Some(last)) = (first, last) else {
            return Err(Error::Broken("no row was recorded while the motion ran"));
        };
        if state[first..=last].iter().any(|s| *s != RUNNING) {
            return Err(Error::Broken("the motion was held on its way"));
        }
        let steps = step.get(first..=last).unwrap_or_default();
        if steps.windows(2).any(|pair| pair[1] != pair[0] + 1.0) {
            return Err(Error::Broken("rows of the motion were lost"));
        }
        let axes = plan.axes.iter();
        let axes = axes.map(|one| axis(&run, plan, driven, one, first..last + 1));
        Ok(Self {
            axes: axes.collect::<Result<_, _>>()?,
            band: (plan.band.from_hz, plan.band.to_hz),
            tick: plan.tick,
            stretched: stretched.last().copied().unwrap_or(0.0),
        })
    }

    /// The first thing that could not be found out, in words.
    #[must_use]
    pub fn first_error(&self) -> Option<String> {
        self.axes.iter().find_map(|axis| {
            let error = axis.found.as_ref().err()?;
            Some(format!("{}: {error}", axis.driven.words()))
        })
    }

    /// Everything, as one document.
    #[must_use]
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

fn axis(
    run: &Run,
    plan: &Plan,
    driven: &Loaded,
    one: &Driven,
    running: std::ops::Range<usize>,
) -> Result<Axis, Error> {
    let table = driven.file.specimen.get(one.place);
    let lost = Error::Broken("the driven test lost a specimen");
    let table = table.ok_or(lost)?;
    let units = table.units_of(one.axes);
    let unit = |axis: usize| {
        units
            .get(axis)
            .map_or((1.0, 1.0), |u| (u.metres, u.newtons))
    };
    let (metres, newtons) = unit(one.axis);
    let specimen = one.place + 1;
    let of_axis = |kind: &column::Kind, axis: usize| kind.of_axis(specimen, axis + 1);
    let others = (0..one.axes).filter(|axis| *axis != one.axis);
    let others: Vec<usize> = others.collect();
    let mut names = vec![
        of_axis(&column::COMMAND, one.axis),
        of_axis(&column::RAW_DISP, one.axis),
        of_axis(&column::RAW_FORCE, one.axis),
        column::STATUS.of_specimen(specimen),
    ];
    names.extend(others.iter().map(|axis| of_axis(&column::RAW_FORCE, *axis)));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let columns = run.columns(&names).map_err(|source| Error::Axis {
        axis: one.words(),
        source,
    })?;
    let from = running.start + (one.start - plan.rest) as usize;
    let to = (running.start + (one.start + plan.ticks + plan.rest) as usize + 1).min(running.end);
    let part = |index: usize, unit: f64| -> Vec<f64> {
        let all = columns.get(index).and_then(|values| values.get(from..to));
        all.unwrap_or_default().iter().map(|v| v * unit).collect()
    };
    let (command, measured, force) = (part(0, metres), part(1, metres), part(2, newtons));
    let is_stale = |status: &f64| Status(*status as u32).has(Status::STALE);
    let stale = part(3, 1.0).iter().filter(|s| is_stale(s)).count();
    let record = Record {
        dt: plan.tick,
        command: &command,
        measured: &measured,
        force: &force,
        rest: [plan.rest as usize; 2],
    };
    let found = identify(&record, plan.band);
    let mut all_felt = Vec::new();
    if let Ok(found) = &found {
        for (index, other) in others.iter().enumerate() {
            let force = part(names.len() - others.len() + index, unit(*other).1);
            let held = Record {
                force: &force,
                ..record
            };
            // An error of another axis's sensors is reported with that axis.
            let of_it = felt(&held, plan.band, found).ok().flatten();
            all_felt.extend(of_it.map(|felt| (*other, felt)));
        }
    }
    let every = measured.len().div_ceil(MOST_POINTS).max(1);
    let thin = |values: &[f64]| values.iter().step_by(every).copied().collect();
    let (length, newton, time) = gear(table, one.axis);
    Ok(Axis {
        driven: one.clone(),
        found,
        felt: all_felt,
        to_structure: (newton / length, newton / length * time),
        walk: (thin(&measured), thin(&force)),
        stale,
        tick: plan.tick,
    })
}

impl Axis {
    /// k̂ of the axis itself in N/m at the specimen; 0 if it is unknown.
    #[must_use]
    pub(crate) fn own_stiffness(&self) -> f64 {
        let found = self.found.as_ref().ok();
        let specimen = found.and_then(|found| found.specimen.as_ref());
        specimen.map_or(0.0, |specimen| specimen.stiffness.value)
    }

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
                let felt = self.felt.iter().map(|(axis, felt)| {
                    json!({ "axis": axis + 1, "stiffness": felt.stiffness, "damping": felt.damping })
                });
                object.insert("felt_by".into(), felt.collect());
                object.insert("at_structure".into(), json!(structure));
            }
        }
        all
    }
}
