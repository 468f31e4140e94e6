//! `[excitation]`: the loads and motions of the test, against the parts that they could move.

use std::collections::BTreeMap;

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::excitation::{ExcitationTable, PrescribedPlace, SupportMotionTable};
use crate::ground::{GroundComponent, GroundDirection};
use crate::schema::TestFile;
use crate::specimen::SpecimenTable;
use crate::suggest::{listed, nearest};
use gusset_motion::Quantity;
use gusset_numerics::frame::Direction;
use gusset_numerics::model::End;

/// The whole of `[excitation]`.
pub(super) fn check_excitation(file: &TestFile, findings: &mut Findings) {
    let at = KeyPath::root().key("excitation");
    let excitation = &file.excitation;
    if !excitation.ground_acceleration.is_empty() && excitation.base_displacement.is_some() {
        findings.push(
            Finding::error(at.key("base_displacement"), "both a ground acceleration and a base displacement are given")
                .label("absolute coordinates")
                .beside(at.key("ground_acceleration"), "relative coordinates")
                .help("a ground acceleration needs relative coordinates and a base displacement absolute ones: give only one \
                 of them"),
        );
    }
    check_frames(file, findings);
    check_components(file, findings);
    check_scaling(file, findings);
    check_supports(file, findings);
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

/// Directions and influence vectors of the components of the ground acceleration, and the angle in plan.
fn check_components(file: &TestFile, findings: &mut Findings) {
    let at = KeyPath::root().key("excitation");
    let Some(structure) = &file.structure else {
        return;
    };
    let frame = structure.frame.as_ref();
    let lacks = |direction: GroundDirection| {
        frame.is_some_and(|frame| !frame.directions().contains(&direction.of_frame()))
    };
    let is_plane_frame = lacks(GroundDirection::Z);
    let grounds = &file.excitation.ground_acceleration;
    let all = grounds.all();
    for (index, component) in all.iter().enumerate() {
        let at = grounds.place(&at, index);
        let finding = match (component.direction, &component.influence) {
            (None, None) if all.len() > 1 => {
                let text = format!("`{at}` has neither `direction` nor `influence`");
                Finding::error(at, text).label("one of several components")
            }
            (Some(direction), None) if frame.is_none() => {
                let text = format!(
                    "the direction {} of this structure is not known",
                    direction.word()
                );
                Finding::error(at.key("direction"), text).label("`influence` is missing")
            }
            (Some(direction), None) if lacks(direction) => {
                let text = format!("a plane frame has no direction {}", direction.word());
                Finding::error(at.key("direction"), text).label("allowed: \"x\", and \"y\" upwards")
            }
            _ => continue,
        };
        findings.push(finding.help(
            "a frame knows the influence vector of `direction`; other structures need `influence`, one number for each DOF",
        ));
    }
    for (index, component) in all.iter().enumerate() {
        let is_other = |other: &GroundComponent| {
            other.direction == component.direction && other.influence != component.influence
        };
        if component.direction.is_some() && all[..index].iter().any(is_other) {
            let at = grounds.place(&at, index);
            let headline =
                format!("`{at}` has the direction of another component, but another `influence`");
            let help = "leave out `direction` of both, or give both the same `influence`";
            findings.push(Finding::error(at, headline).help(help));
        }
    }
    if file.excitation.incident_angle_deg.is_none() {
        return;
    }
    if file
        .excitation
        .incident_angle_deg
        .is_some_and(|angle| !(-360.0..=360.0).contains(&angle))
    {
        let headline = "`excitation.incident_angle_deg` must be from -360 to 360";
        findings.push(Finding::error(at.key("incident_angle_deg"), headline));
    }
    let count = |wanted| {
        let has = |one: &&GroundComponent| one.direction == Some(wanted);
        all.iter().filter(has).count()
    };
    let found = [GroundDirection::X, GroundDirection::Y, GroundDirection::Z].map(count);
    let is_pair = matches!(found, [1, 1, _]) && found.iter().sum::<usize>() == all.len();
    if is_plane_frame || !is_pair {
        let label = match is_plane_frame {
            true => "y of a plane frame is vertical".to_owned(),
            false => format!(
                "found {} in x, {} in y, {} others",
                found[0],
                found[1],
                all.len() - found[0] - found[1]
            ),
        };
        let headline = "`excitation.incident_angle_deg` needs one component with direction x and one with direction y";
        let finding = Finding::error(at.key("incident_angle_deg"), headline).label(label);
        findings.push(finding.help("one more component with direction z is allowed"));
    }
}

/// One factor for all components.
fn check_scaling(file: &TestFile, findings: &mut Findings) {
    let at = KeyPath::root().key("excitation");
    let (Some(scaling), Some(structure)) = (&file.excitation.scaling, &file.structure) else {
        return;
    };
    let grounds = &file.excitation.ground_acceleration;
    let frame = structure.frame.as_ref();
    let found = grounds
        .horizontal(frame.is_some_and(|frame| frame.dimension == 2))
        .len();
    if found != 2 {
        let headline =
            "`excitation.scaling` needs two horizontal components of the ground acceleration";
        let finding = Finding::error(at.key("scaling"), headline).label(format!("found {found}"));
        findings.push(finding.help(
            "scale a single component with `target_peak` or `target_sa` of its `processing`; y of a plane frame is vertical",
        ));
    }
    for index in 0..grounds.all().len() {
        let at = grounds.place(&at, index).key("processing");
        for key in findings.given(&at, "target_peak target_sa") {
            let headline = format!("`{key}` and `excitation.scaling` both scale this component");
            findings.push(
                Finding::error(key, headline)
                    .at_key()
                    .help("remove it: `scaling` gives all components one factor, and `scale_factor` an additional one"),
            );
        }
    }
    let at = at.key("scaling");
    let is_value = scaling.period_s.is_some() && scaling.value.is_some();
    let is_any_value = scaling.period_s.is_some() || scaling.value.is_some();
    if is_any_value == scaling.spectrum_file.is_some() || (is_any_value && !is_value) {
        let headline =
            "`excitation.scaling` needs either `period_s` and `value`, or `spectrum_file`";
        findings.push(Finding::error(at.clone(), headline));
    }
    if scaling.spectrum_file.is_none() && scaling.periods_s.is_some() {
        let headline = "`periods_s` needs `spectrum_file`: a value has one `period_s`";
        findings.push(Finding::error(at.key("periods_s"), headline).at_key());
    }
    if scaling.unit.quantity() != Quantity::Acceleration {
        let headline = format!("`{}` must be a unit of acceleration", at.key("unit"));
        let finding = Finding::error(at.key("unit"), headline);
        let finding = finding.label(format!("found {}", scaling.unit));
        findings.push(finding.help(format!("allowed: {}", Quantity::Acceleration.spellings())));
    }
}

/// Moving supports belong to a frame in absolute coordinates, whose specimens are between its nodes.
fn check_supports(file: &TestFile, findings: &mut Findings) {
    let root = KeyPath::root();
    let at = root.key("excitation");
    let all = &file.excitation.support_motion;
    let Some(structure) = file.structure.as_ref().filter(|_| !all.is_empty()) else {
        return;
    };
    let of_supports = at.key("support_motion").index(0);
    if structure.frame.is_none() {
        let headline =
            "`excitation.support_motion` needs a `[structure.frame]`: only a frame has supports";
        findings.push(Finding::error(of_supports.clone(), headline));
        return;
    }
    for key in findings.given(&at, "ground_acceleration base_displacement") {
        let headline = format!("`{key}` and `excitation.support_motion` both move the ground");
        let finding = Finding::error(key, headline).at_key();
        findings.push(
            finding
                .beside(of_supports.clone(), "absolute coordinates")
                .help("give only one of them: a support that moves with all others needs its own `support_motion`"),
        );
    }
    if file.safety.added_energy_share.is_some() {
        let at = root.key("safety").key("added_energy_share");
        let headline = "`safety.added_energy_share` does not count the energy that moving supports put into the structure";
        let finding = Finding::error(at, headline).at_key();
        findings.push(
            finding.help("remove the limit, or move all supports alike with `base_displacement`"),
        );
    }
    for (index, element) in structure.element.iter().enumerate() {
        for (key, end) in [("from", element.from), ("to", element.to)] {
            if end == End::Ground {
                let at = root.key("structure").key("element").index(index).key(key);
                let headline = "the supports move, so \"ground\" has no single motion";
                let finding = Finding::error(at, headline).beside(of_supports.clone(), "moves");
                findings.push(finding.help("\"fixed\" is a point at rest"));
            }
        }
    }
    for (index, table) in all.iter().enumerate() {
        let at = at.key("support_motion").index(index);
        findings.exactly_one(&at, &["node", "nodes"], "they name the supports that move");
        let direction = table.direction.of_frame();
        if !(structure.frame.as_ref()).is_some_and(|frame| frame.directions().contains(&direction))
        {
            let headline = format!("a plane frame has no direction {}", table.direction.word());
            let finding = Finding::error(at.key("direction"), headline);
            findings.push(finding.label("allowed: \"x\", and \"y\" upwards"));
        }
    }
    for (index, specimen) in file.specimen.iter().enumerate() {
        let at = root.key("specimen").index(index);
        check_specimen_of_supports(specimen, all, &at, findings);
    }
}

/// The deformation of a specimen must not depend on a moving support.
fn check_specimen_of_supports(
    specimen: &SpecimenTable,
    all: &[SupportMotionTable],
    at: &KeyPath,
    findings: &mut Findings,
) {
    let moves = |direction: Direction| {
        let of_direction = all.iter();
        of_direction.filter(move |one| one.direction.of_frame() == direction)
    };
    let Some(deformations) = &specimen.deformations else {
        let headline = "the supports move, so the specimen needs `deformations`: `rows` do not say from where they count";
        findings.push(Finding::error(at.clone(), headline).label("`deformations` is missing"));
        return;
    };
    if specimen.mass_in_force_kg > 0.0 {
        let at = at.key("mass_in_force_kg");
        let headline = "the measured force contains the inertia of the relative motion only";
        findings.push(Finding::error(at, headline).label("the supports move"));
    }
    for (index, deformation) in deformations.iter().enumerate() {
        let at = at.key("deformations").index(index);
        let Some(from) = &deformation.from else {
            if moves(deformation.direction).next().is_some() {
                let headline = format!("`{at}` counts from the ground, but the supports move");
                let finding = Finding::error(at, headline).label("`from` is missing");
                findings.push(finding.help("name the other end of the specimen with `from`"));
            }
            continue;
        };
        for (key, node) in [("node", &deformation.node), ("from", from)] {
            if moves(deformation.direction).any(|one| one.named().any(|name| name == node)) {
                let headline = format!(
                    "`{}` is the moving support \"{node}\": a specimen cannot be there",
                    at.key(key)
                );
                let finding = Finding::error(at.key(key), headline);
                findings.push(
                    finding.help(
                        "use an elastic member between the support and a node of the specimen",
                    ),
                );
            }
        }
    }
}

/// Parts that are tied to the inertial frame, or measured in it, where the coordinates are others.
fn check_frames(file: &TestFile, findings: &mut Findings) {
    let root = KeyPath::root();
    let at = root.key("excitation");
    if !file.excitation.ground_acceleration.is_empty()
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
    let loads = "ground_acceleration incident_angle_deg scaling base_displacement support_motion nodal_force nodal_table";
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
