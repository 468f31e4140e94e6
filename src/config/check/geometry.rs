//! `[specimen.geometry]`: a valid geometry that fits the coordinates of the specimen.

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::specimen::SpecimenTable;
use gusset_actuator::geometry::{Geometry, GeometryError};

/// The loading unit of one specimen; `seen` is the number of rows of B, if they are given.
pub(super) fn check_geometry(
    specimen: &SpecimenTable,
    seen: Option<usize>,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let Some(spec) = &specimen.geometry else {
        return;
    };
    let here = at.key("geometry");
    let geometry = match spec.build(1.0) {
        Ok(geometry) => geometry,
        Err(error) => {
            let form = if spec.matrix.is_some() {
                "matrix"
            } else if spec.plane.is_some() {
                "plane"
            } else {
                "space"
            };
            findings.push(refusal(&error, form, &here));
            return;
        }
    };
    if let Some(seen) = seen
        && seen != geometry.coordinates().len()
    {
        let keys: Vec<&str> = geometry.coordinates().iter().map(|c| c.key()).collect();
        let rows = if specimen.storey.is_some() {
            "storey"
        } else {
            "rows"
        };
        findings.push(
            Finding::error(
                at.key(rows),
                format!(
                    "the platform has {} driven coordinates ({}), but `{rows}` gives {seen}",
                    keys.len(),
                    keys.join(", ")
                ),
            )
            .at_key()
            .label("one row of B per coordinate")
            .help("`coordinates` in [specimen.geometry] names the coordinates of the rows; all others stay at zero"),
        );
    }
    if specimen.mass_in_force_kg != 0.0 {
        findings.push(
            Finding::error(
                at.key("mass_in_force_kg"),
                "`mass_in_force_kg` cannot describe the inertia of a platform in the forces of a loading unit",
            )
            .at_key()
            .label("not with `geometry`"),
        );
    }
    let probe = specimen.link.as_ref().and_then(|link| link.probe_m);
    if probe.is_some() && is_redundant(&geometry) {
        findings.push(
            Finding::error(
                at.key("link").key("probe_m"),
                "a single actuator cannot move alone if there are more actuators than coordinates",
            )
            .at_key()
            .label("it would push against the others"),
        );
    }
}

fn is_redundant(geometry: &Geometry) -> bool {
    geometry.actuators() > geometry.coordinates().len()
}

/// An invalid geometry, at its place.
fn refusal(error: &GeometryError, form: &str, here: &KeyPath) -> Finding {
    let text = error.to_string();
    match error {
        GeometryError::Forms { .. } => Finding::error(here.clone(), text)
            .help("`plane` and `space` list the pins of the actuators; `matrix` is any transformation"),
        GeometryError::Fault(_) => Finding::error(here.key(form), text)
            .at_key()
            .label("the actuators cannot hold the platform")
            .help("the lines of action are linearly dependent: move a pin, or drive fewer `coordinates`"),
        GeometryError::Unsaid { key, .. } => Finding::error(here.key(key), text)
            .at_key()
            .label("`coordinates` is missing")
            .help("for example coordinates = [\"ux\", \"rz\"]"),
        GeometryError::Row { row, .. } => {
            Finding::error(here.key("matrix").index(row.saturating_sub(1)), text)
                .label("one number per coordinate")
        }
        GeometryError::NoLength { actuator }
        | GeometryError::Length { actuator, .. }
        | GeometryError::NotFinite { actuator, .. } => {
            let pins = here.key(form).index(actuator.saturating_sub(1));
            Finding::error(pins.key(error.key()), text)
        }
        GeometryError::Count { .. }
        | GeometryError::Coordinates { .. }
        | GeometryError::ExactMatrix => Finding::error(here.key(error.key()), text),
    }
}
