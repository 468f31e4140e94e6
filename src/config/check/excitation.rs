//! `[excitation]`: the loads and motions of the test, against the parts that they could move.

use std::collections::BTreeMap;

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::excitation::{ExcitationTable, PrescribedPlace};
use crate::schema::TestFile;
use crate::suggest::{listed, nearest};
use gusset_numerics::model::End;

/// The whole of `[excitation]`.
pub(super) fn check_excitation(file: &TestFile, findings: &mut Findings) {
    let at = KeyPath::root().key("excitation");
    let excitation = &file.excitation;
    if let (Some(_), Some(_)) = (
        &excitation.ground_acceleration,
        &excitation.base_displacement,
    ) {
        findings.push(
            Finding::error(at.key("base_displacement"), "both a ground acceleration and a base displacement are given")
                .label("absolute coordinates")
                .beside(at.key("ground_acceleration"), "relative coordinates")
                .help("a ground acceleration needs relative coordinates and a base displacement absolute ones: give only one \
                 of them"),
        );
    }
    check_frames(file, findings);
    for (index, force) in excitation.nodal_force.iter().enumerate() {
        let at = at.key("nodal_force").index(index);
        let why = "the factors distribute the force over the DOFs";
        findings.exactly_one(&at, &["dofs", "pattern"], why);
        if let Some(dofs) = &force.dofs {
            findings.dofs(&at.key("dofs"), dofs);
        }
    }
    if file.structure.is_some() {
        check_motionless(file, findings);
        if !excitation.prescribed_displacement.is_empty() {
            findings.push(
                Finding::error(at.key("prescribed_displacement"), "a prescribed displacement and a structure are both given")
                    .label("the displacement is prescribed here")
                    .beside(KeyPath::root().key("structure"), "and computed here")
                    .help("the specimen can follow only one of them: remove the structure, or use `base_displacement`"),
            );
        }
    } else {
        check_prescribed(file, &at, findings);
    }
}

/// Parts that are tied to the inertial frame, or measured in it, where the coordinates are others.
fn check_frames(file: &TestFile, findings: &mut Findings) {
    let root = KeyPath::root();
    let at = root.key("excitation");
    if file.excitation.ground_acceleration.is_some()
        && let Some(structure) = &file.structure
    {
        let mut fixed = Vec::new();
        for (index, element) in structure.element.iter().enumerate() {
            for (key, end) in [("from", element.from), ("to", element.to)] {
                if end == End::Fixed {
                    let element = root.key("structure").key("element").index(index);
                    fixed.push((
                        element.key(key),
                        "an element is connected to the inertial frame",
                    ));
                }
            }
        }
        if let Some(chain) = &structure.chain
            && chain.absolute_damper.is_some()
        {
            let chain = root.key("structure").key("chain");
            fixed.push((
                chain.key("absolute_damper"),
                "absolute dampers are connected to the inertial frame",
            ));
        }
        for (place, headline) in fixed {
            findings.push(
                Finding::error(place, format!("{headline}, but the coordinates move with the ground"))
                    .label("its absolute motion is unknown")
                    .beside(at.key("ground_acceleration"), "relative coordinates")
                    .help("use `base_displacement`, which has absolute coordinates; \"ground\" then follows the base"),
            );
        }
    }
    if file.excitation.base_displacement.is_some() {
        for (index, specimen) in file.specimen.iter().enumerate() {
            if specimen.mass_in_force_kg > 0.0 {
                let place = root.key("specimen").index(index).key("mass_in_force_kg");
                findings.push(
                    Finding::error(
                        place,
                        "the measured force contains the inertia of the relative motion only",
                    )
                    .label("the acceleration of the base is missing")
                    .beside(at.key("base_displacement"), "absolute coordinates")
                    .help("use `ground_acceleration`, which also acts on the mass of the specimen"),
                );
            }
        }
    }
}

/// A structure without any motion is probably a mistake.
fn check_motionless(file: &TestFile, findings: &mut Findings) {
    let Some(structure) = &file.structure else {
        return;
    };
    let still = file.excitation == ExcitationTable::default()
        && structure.initial_displacement_m.is_none()
        && structure.initial_velocity_m_per_s.is_none()
        && !structure.has_static_load();
    if still {
        findings.push(
            Finding::warning(
                KeyPath::root().key("structure"),
                "nothing moves the structure",
            )
            .label("no excitation, no initial state, no static load")
            .help("give an `[excitation]`, or an `initial_displacement_m` for free vibration"),
        );
    }
}

fn check_prescribed(file: &TestFile, at: &KeyPath, findings: &mut Findings) {
    let excitation = &file.excitation;
    let loads = "ground_acceleration base_displacement nodal_force nodal_table";
    for key in findings.given(at, loads) {
        let text = format!("`{key}` acts on a structure, and this test has no `[structure]`");
        let finding = Finding::error(key, text).label("nothing to act on");
        findings
            .push(finding.help(
                "without a `[structure]` only `prescribed_displacement` moves the specimens",
            ));
    }
    if !file.specimen.is_empty() && excitation.prescribed_displacement.is_empty() {
        findings.push(
            Finding::error(at.clone(), "without a structure the specimens need a prescribed displacement")
                .label("`prescribed_displacement` is missing")
                .help("give a `[[excitation.prescribed_displacement]]` with `specimen` and `signal`, or a `[structure]`"),
        );
    }
    let names: Vec<&str> = file.specimen.iter().map(|s| s.name.as_str()).collect();
    let mut driven: BTreeMap<(&str, usize), KeyPath> = BTreeMap::new();
    let mut places: BTreeMap<&str, (PrescribedPlace, KeyPath)> = BTreeMap::new();
    for (index, prescribed) in excitation.prescribed_displacement.iter().enumerate() {
        let at = at.key("prescribed_displacement").index(index);
        let name = prescribed.specimen.as_str();
        if !names.contains(&name) {
            let label = nearest(name, &names).map_or_else(
                || "no such specimen".to_owned(),
                |n| format!("did you mean `{n}`?"),
            );
            findings.push(
                Finding::error(
                    at.key("specimen"),
                    format!("this test has no specimen `{name}`"),
                )
                .label(label)
                .help(format!("the specimens are {}", listed(&names, "and"))),
            );
        }
        let mut named = file
            .specimen
            .iter()
            .filter(|specimen| specimen.name == name);
        if named
            .next()
            .is_some_and(|specimen| specimen.geometry.is_none())
        {
            let why =
                "only for a specimen with a `geometry`: without one, each axis is one deformation";
            findings.no_effect(&at, "at", why);
        }
        if prescribed.axis == 0 {
            findings.push(
                Finding::error(at.key("axis"), "axis 0 does not exist")
                    .label("axes are counted from 1"),
            );
        }
        let duration = file.time.duration_s;
        let easing = [
            ("ease_in_s", prescribed.ease_in_s),
            ("ease_out_s", prescribed.ease_out_s),
        ];
        for (key, value) in easing {
            if value.is_finite() && !(0.0..=duration).contains(&value) {
                let headline = format!("`{key}` must be inside the test, from 0 to {duration} s");
                let finding = Finding::error(at.key(key), headline);
                findings.push(finding.label(format!("found {value}")));
            }
        }
        match places.get(name) {
            Some((place, before)) if *place != prescribed.at => findings.push(
                Finding::error(
                    at.clone(),
                    format!("coordinates and actuators of specimen `{name}` are both prescribed"),
                )
                .label("again here")
                .beside(before.clone(), "first here")
                .help("they contradict: prescribe all with the same `at`"),
            ),
            _ => {
                places.insert(name, (prescribed.at, at.clone()));
            }
        }
        match driven.get(&(name, prescribed.axis)) {
            Some(before) => findings.push(
                Finding::error(
                    at.clone(),
                    format!(
                        "axis {} of specimen `{name}` is prescribed twice",
                        prescribed.axis
                    ),
                )
                .label("again here")
                .beside(before.clone(), "first here")
                .help("the axis can follow only one of them"),
            ),
            None => {
                driven.insert((name, prescribed.axis), at);
            }
        }
    }
    for (index, name) in names.iter().enumerate() {
        if !driven.is_empty() && !driven.keys().any(|(driven, _)| driven == name) {
            findings.push(
                Finding::warning(
                    KeyPath::root().key("specimen").index(index),
                    format!("specimen `{name}` has no prescribed displacement"),
                )
                .label("it is held at zero"),
            );
        }
    }
}
