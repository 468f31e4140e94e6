//! `resolved.toml` of a recorded run as its report reads it: the tables of a test, or those of a file of `gusset serve`.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bus_spec::OnBuses;
use super::excitation::ExcitationTable;
use super::schema::{IntegratorTable, StructureTable};
use super::specimen::{SpecimenTable, link_specimens};
use super::timetable::TimeTable;
use super::{ConfigError, Purpose, judge, open};
use gusset_quantity::time::Ratio;

/// Tables of a recorded test or of a server that a report describes. The other tables of the file are not read.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RecordedFile {
    /// Name of the test; empty if it has none.
    pub title: String,
    /// Integration step, duration and clock; none for a server.
    pub time: Option<TimeTable>,
    /// Numerical substructure; none for a server, and for a prescribed displacement.
    pub structure: Option<StructureTable>,
    /// Time integration.
    pub integrator: IntegratorTable,
    /// Ground motion, forces or prescribed displacements.
    pub excitation: ExcitationTable,
    /// The specimens.
    pub specimen: Vec<SpecimenTable>,
}

impl OnBuses for RecordedFile {
    fn link_specimens(&mut self) {
        link_specimens(&BTreeMap::new(), &mut self.specimen);
    }
}

impl RecordedFile {
    /// Reads the text of the `resolved.toml` at `path`. Old names of keys count, and removed keys are ignored at any value.
    ///
    /// # Errors
    /// [`ConfigError`]: the text is no TOML, or a value does not fit its key.
    pub fn read(path: &Path, text: String) -> Result<Self, ConfigError> {
        let opened = open(Purpose::View, path, text, &[])?;
        let (file, findings) = judge(&opened.root, |_: &Self| Vec::new());
        let refused = opened.locator.diagnose_all(findings);
        match file {
            Some(file) if refused.0.is_empty() => Ok(file),
            _ => Err(ConfigError::Invalid(refused)),
        }
    }

    /// Test time of a step in s.
    #[must_use]
    pub fn step_s(&self) -> Option<f64> {
        let time = self.time.as_ref()?;
        let rate = || Some(time.rate_hz?.0.inverse());
        let step = time.step_s.map(|step| step.0).or_else(rate);
        step.map(Ratio::value)
    }

    /// Ticks in a step.
    #[must_use]
    pub fn ticks_per_step(&self) -> u64 {
        let ticks = self.time.as_ref().map_or(1, |time| time.ticks_per_step);
        u64::from(ticks).max(1)
    }

    /// Specimen with a number from 1.
    #[must_use]
    pub fn specimen(&self, number: u32) -> Option<&SpecimenTable> {
        self.specimen.get(number.checked_sub(1)? as usize)
    }

    /// Name of the specimen with a number from 1.
    #[must_use]
    pub fn specimen_name(&self, number: u32) -> String {
        let name = self.specimen(number).map(|table| table.name.clone());
        let name = name.filter(|name| !name.trim().is_empty());
        name.unwrap_or_else(|| format!("specimen {number}"))
    }
}

/// A choice as the test file spells it; of one with parameters the name alone.
#[must_use]
pub fn word(choice: &impl Serialize) -> String {
    match serde_json::to_value(choice) {
        Ok(serde_json::Value::String(name)) => name,
        Ok(serde_json::Value::Object(table)) => table.into_iter().map(|(name, _)| name).collect(),
        _ => String::new(),
    }
}
