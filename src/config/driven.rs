//! A test in which nothing is computed: the specimens of a file follow a prescribed motion, at the ticks at which the file's
//! test would command them.
//!
//! Keys for a hybrid test are omitted: the structure and its loads, compensation, and limits of lag, gain, added energy
//! and tangents. Keys that protect a specimen stay.

use super::document::KeyPath;
use super::limit_table::LimitsSpec;
use super::value::RateValue;
use super::{
    AxisTable, CertificateTable, ConfigError, ExcitationTable, Finding, IntegratorTable, Loaded,
    PrescribedPlace, PrescribedTable, TestFile, Time, TimeTable, parse,
};
use gusset_actuator::compensation::CompensationSpec;
use gusset_motion::Motion;
use gusset_quantity::catalog::limit::{CheckedBy, Limit};
use gusset_quantity::time::Ratio;

/// The motion of one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Specimen, from 0, in the order of the file.
    pub specimen: usize,
    /// Axis, from 0: an actuator where the specimen has a loading unit.
    pub axis: usize,
    /// Deformation or stroke in m, at the structure's scale.
    pub motion: Motion,
}

impl Loaded {
    /// This test's specimens, as many as `drives` names, driven for `ticks` ticks of the controller; all others and every
    /// compensation are omitted.
    #[must_use]
    pub fn driven(&self, title: &str, drives: &[Drive], ticks: u64) -> TestFile {
        let rate = self.time.period.inverse();
        let of = |index: usize| drives.iter().any(|drive| drive.specimen == index);
        let all = self.file.specimen.iter().enumerate();
        let named = |drive: &Drive| {
            let table = self.file.specimen.get(drive.specimen);
            table.map_or_else(String::new, |table| table.name.clone())
        };
        let place = |drive: &Drive| {
            let table = self.file.specimen.get(drive.specimen);
            match table.and_then(|table| table.geometry.as_ref()) {
                Some(_) => PrescribedPlace::Actuators,
                None => PrescribedPlace::Platform,
            }
        };
        let mut file = self.file.clone();
        file.title = title.to_owned();
        file.time = TimeTable {
            step_s: None,
            rate_hz: Some(RateValue(rate)),
            duration_s: ticks as f64 * self.time.period.value(),
            ticks_per_step: 1,
            clock: self.time.clock,
            scale: RateValue(Ratio::ONE),
            ..self.file.time.clone()
        };
        file.structure = None;
        file.integrator = IntegratorTable::default();
        file.excitation = ExcitationTable {
            prescribed_displacement: drives
                .iter()
                .map(|drive| PrescribedTable {
                    specimen: named(drive),
                    axis: drive.axis + 1,
                    at: place(drive),
                    signal: drive.motion.signal.clone(),
                    processing: drive.motion.processing.clone(),
                    ease_in_s: 0.0,
                    ease_out_s: 0.0,
                })
                .collect(),
            ..ExcitationTable::default()
        };
        file.specimen = all
            .filter(|(index, _)| of(*index))
            .map(|(_, table)| {
                let mut table = table.clone();
                let axes = table.axes();
                (table.storey, table.rows, table.deformations) = (None, None, None);
                // Nothing else gives their number.
                if table.axes() < axes {
                    table.axis.resize(axes, AxisTable::default());
                }
                table.compensation = None::<CompensationSpec>;
                // It loads the structure.
                table.mass_in_force_kg = 0.0;
                table.drill = None;
                let axis = table.axis.iter_mut().map(|axis| &mut axis.limits);
                for limits in axis.chain([&mut table.limits]).flatten() {
                    *limits = protecting(limits);
                }
                table
            })
            .collect();
        file.certificate = CertificateTable::default();
        file.uncertainty = Vec::new();
        file.safety.divergence_m = None;
        file.safety.accept_unstable = None;
        file.safety.accept_trip = None;
        file.safety.accept_speed = None;
        file.safety.accept_error = None;
        file.safety.stability_used = None;
        file.safety.delay_used = None;
        file.safety.step_audit = None;
        file.safety.static_unbalance = None;
        file.safety.added_energy_share = None;
        file.record.dofs = None;
        file
    }

    /// A test file made from this one, read as if it were beside it; `said` is its first line. Its findings have the name of
    /// this file with "driven", because its lines are others.
    ///
    /// # Errors
    /// [`ConfigError`], as for any other test file.
    pub fn beside(&self, said: &str, file: &TestFile) -> Result<Loaded, ConfigError> {
        match toml::to_string(file) {
            Ok(text) => {
                let mut name = self.path.file_name().unwrap_or_default().to_owned();
                name.push(" (driven)");
                let path = self.path.with_file_name(name);
                parse(&path, format!("# {said}\n\n{text}"), &[])
            }
            Err(error) => {
                let text = format!("the configuration cannot be written as TOML: {error}");
                Err(self.refuse([Finding::error(KeyPath::root(), text)]))
            }
        }
    }
}

/// The limits that a specimen needs in every test: those that a gateway checks too.
fn protecting(limits: &LimitsSpec) -> LimitsSpec {
    let mut kept = *limits;
    for limit in Limit::OF_AXIS {
        if limit.row().checked_by == CheckedBy::Controller {
            kept.set(limit, None);
        }
    }
    kept
}

impl Time {
    /// Seconds from one tick to the next.
    #[must_use]
    pub fn tick(&self) -> f64 {
        self.period.value()
    }
}
