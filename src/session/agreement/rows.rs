//! The rows of a run show its end, its steps and its largest magnitudes.

use std::collections::BTreeMap;

use crate::catalog::column::{FORCE, STATUS};
use crate::catalog::phase::{GIVEN_UP, Phase};
use crate::record::summary::Peak;
use crate::record::{FolderError, Run};
use crate::session::tape::{is_a_trip, is_under_way};
use crate::substructure::Status as LinkStatus;

/// Findings in the rows of a run.
#[derive(Debug, Default)]
pub(super) struct Rows {
    /// A limit, a fault or the clock ended the test in one of them.
    pub tripped: bool,
    /// The last step that has a row.
    pub steps: Option<u64>,
    /// Largest magnitudes of the DOFs and specimens that were recorded.
    pub peak: Peak,
    /// Largest magnitudes in all rows, with those of stale measurements.
    pub most: Peak,
    /// None of them is missing or damaged.
    pub are_whole: bool,
}

impl Rows {
    pub fn of(run: &Run, table: &toml::Table) -> Result<Self, FolderError> {
        let at = |name: &str| run.layout().index_of(name).unwrap_or(usize::MAX);
        let (state, step) = (at("state"), at("step"));
        let names = specimens(table);
        let places = Places::of(run, names.len());
        let mut found = Self::default();
        let mut forces = vec![Vec::new(); names.len()];
        let mut most = forces.clone();
        let mut is_in_test = false;
        let mut journal = run.journal()?;
        let path = run.path().join("samples.bin");
        let io = |source| FolderError::Io {
            path: path.clone(),
            source,
        };
        while let Some(row) = journal.next_row().map_err(io)? {
            let value = |place: usize| row.values.get(place).copied().unwrap_or(f64::NAN);
            let state = value(state);
            found.tripped |= state == Phase::Tripped.code() || state == GIVEN_UP;
            if state == Phase::Running.code() {
                found.steps = Some(value(step) as u64);
            }
            if !is_a_trip(state) {
                is_in_test = is_under_way(state);
            }
            if is_in_test {
                places.raise(value, &mut found.peak, &mut forces, true);
            }
            places.raise(value, &mut found.most, &mut most, false);
        }
        found.are_whole = journal.end() == Some(crate::record::End::Clean) && journal.lost() == 0;
        found.most.force = names.iter().cloned().zip(most).collect::<BTreeMap<_, _>>();
        found.peak.force = names.into_iter().zip(forces).collect::<BTreeMap<_, _>>();
        Ok(found)
    }
}

/// Names of the specimens, in order.
fn specimens(table: &toml::Table) -> Vec<String> {
    let all = table.get("specimen").and_then(toml::Value::as_array);
    let name = |specimen: &toml::Value| Some(specimen.get("name")?.as_str()?.to_owned());
    all.into_iter().flatten().filter_map(name).collect()
}

/// Places of the columns whose largest magnitudes the summary has.
struct Places {
    /// Displacements, velocities and accelerations: DOF from 0, and place.
    structure: [Vec<(usize, usize)>; 3],
    /// Of each specimen: its status, and the force of each axis.
    specimens: Vec<(usize, Vec<usize>)>,
}

impl Places {
    fn of(run: &Run, specimens: usize) -> Self {
        let layout = run.layout();
        let forces = |number: usize| {
            let axes = (1..).map(|axis| layout.index_of(&FORCE.of_axis(number, axis)));
            axes.map_while(|place| place).collect()
        };
        let status = |number: usize| layout.index_of(&STATUS.of_specimen(number));
        Self {
            structure: ['x', 'v', 'a'].map(|letter| crate::session::borne::places(run, letter)),
            specimens: (1..=specimens)
                .map(|number| (status(number).unwrap_or(usize::MAX), forces(number)))
                .collect(),
        }
    }

    fn raise(
        &self,
        value: impl Fn(usize) -> f64,
        peak: &mut Peak,
        forces: &mut [Vec<Option<f64>>],
        only_fresh: bool,
    ) {
        let [disp, vel, accel] = &self.structure;
        for (peaks, places) in [
            (&mut peak.displacement, disp),
            (&mut peak.velocity, vel),
            (&mut peak.acceleration, accel),
        ] {
            for (dof, place) in places {
                crate::session::borne::raise(peaks, *dof, value(*place));
            }
        }
        for (peaks, (status, places)) in forces.iter_mut().zip(&self.specimens) {
            // A stale measurement was not taken in this tick.
            if only_fresh && LinkStatus(value(*status) as u32).has(LinkStatus::STALE) {
                continue;
            }
            for (axis, place) in places.iter().enumerate() {
                crate::session::borne::raise(peaks, axis, value(*place));
            }
        }
    }
}
