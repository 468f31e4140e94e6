//! The frame of a test file: its degrees of freedom by name, the rows of specimens between its nodes, and the places of mistakes.

use super::facts::FrameFacts;
use super::{Refused, Site, path};
use gusset_config::{ClockChoice, DeformationTable, Finding, KeyPath};
use gusset_control::engine::Numerical;
use gusset_numerics::frame::{FrameError, FrameSpec, MemberUse, NodeLoadSpec};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::StructureSpec;
use gusset_quantity::units::{number, quantity};
use gusset_record::rt::os::monotonic_ns;

/// Rows of B of deformations between nodes.
pub(super) fn rows(
    site: &mut Site<'_>,
    at: &KeyPath,
    deformations: &[DeformationTable],
    spec: &StructureSpec,
) -> Result<Vec<Vec<(usize, f64)>>, Refused> {
    let at = at.key("deformations");
    let StructureSpec::Frame(frame) = spec else {
        let text = "only a frame has nodes: give `storey` or `rows` for this structure";
        return site.refuse(Finding::error(at, text).at_key());
    };
    let model = frame
        .model()
        .or_else(|error| site.refuse(Finding::error(place(site, &error), error.to_string())))?;
    let mut rows = Vec::with_capacity(deformations.len());
    for (index, deformation) in deformations.iter().enumerate() {
        let at = at.index(index);
        let mut row: Vec<(usize, f64)> = Vec::new();
        let ends = [
            ("node", Some(&deformation.node), 1.0),
            ("from", deformation.from.as_ref(), -1.0),
        ];
        for (key, node, sign) in ends {
            let Some(node) = node else { continue };
            let Some(motion) = model.motion(node, deformation.direction) else {
                let text = format!(
                    "there is no node \"{node}\"; the nodes are {}",
                    model.nodes().join(", ")
                );
                return site.refuse(Finding::error(at.key(key), text));
            };
            for &(dof, share) in motion {
                match row.iter_mut().find(|(known, _)| *known == dof) {
                    Some((_, entry)) => *entry += sign * share,
                    None => row.push((dof, sign * share)),
                }
            }
        }
        row.retain(|(_, entry)| *entry != 0.0);
        if row.is_empty() {
            let text = "this deformation is always zero: the ground or a constraint holds its ends";
            return site.refuse(Finding::error(at, text));
        }
        row.sort_unstable_by_key(|(dof, _)| *dof);
        rows.push(row);
    }
    Ok(rows)
}

/// Node and direction of each degree of freedom of a frame.
pub(super) fn places(site: &Site<'_>) -> Vec<String> {
    let table = site.loaded.file.structure.as_ref();
    let frame = table.and_then(|table| table.frame.as_ref());
    let places = frame.map(FrameSpec::places).unwrap_or_default();
    let each = places.iter();
    each.map(|(node, direction)| format!("{node} {}", direction.word()))
        .collect()
}

/// Whether no motion of the frame is without stiffness. Such a motion is refused, or warned of where a specimen may resist it. False
/// without a frame.
pub(super) fn are_held(site: &mut Site<'_>) -> Result<bool, Refused> {
    let table = site.loaded.file.structure.as_ref();
    let Some(frame) = table.and_then(|table| table.frame.as_ref()) else {
        return Ok(false);
    };
    let Some(error) = frame.model().ok().and_then(|model| model.loose()) else {
        return Ok(false);
    };
    let at = place(site, &error);
    if site.loaded.file.specimen.is_empty() {
        return site.refuse(Finding::error(at, error.to_string()));
    }
    let finding = Finding::warning(at, error.to_string());
    site.warnings.push(finding.label("unless a specimen does"));
    Ok(true)
}

/// The frame under the static load of its degrees of freedom. A member that yields under it is warned of.
pub(super) fn facts(
    site: &mut Site<'_>,
    load: Option<&[f64]>,
    specimens: &SymMatrix,
) -> Result<Option<FrameFacts>, Refused> {
    let table = site.loaded.file.structure.as_ref();
    let Some(frame) = table.and_then(|table| table.frame.as_ref()) else {
        return Ok(None);
    };
    let found = frame.model().and_then(|model| {
        let none = vec![0.0; model.dofs.len()];
        let load = load.unwrap_or(&none);
        // The stiffness of specimens is at the degrees of freedom of the structure, which may be a reduced one.
        let beside = site.reduced.is_none().then_some(specimens);
        let members = frame.members_under(load, beside)?;
        Ok((model, members, load.to_vec()))
    });
    let (model, members, load) = found
        .or_else(|error| site.refuse(Finding::error(place(site, &error), error.to_string())))?;
    let down = |force: f64| (-force).max(0.0);
    let up = frame.upwards();
    let upwards = |load: &NodeLoadSpec| load.each()[up as usize].1;
    // The loads at nodes that are held vertically are in no degree of freedom.
    let others = model.dofs.iter().zip(load.iter().zip(&model.load));
    let others = others.filter(|((_, direction), _)| *direction == up);
    let weight = frame
        .load
        .iter()
        .map(|load| down(upwards(load)))
        .sum::<f64>()
        + others.map(|(_, (all, own))| down(all - own)).sum::<f64>();
    let yields = |(_, member): &(usize, &MemberUse)| member.utilisation > Some(1.0);
    let yielding = members.iter().enumerate().filter(yields);
    let worst = yielding.clone().max_by(|(_, a), (_, b)| {
        let [a, b] = [a, b].map(|member| member.utilisation.unwrap_or(0.0));
        a.total_cmp(&b)
    });
    if let Some((index, member)) = worst {
        let text = format!(
            "{} yields under the static loads, before the test: its utilisation is {}",
            member.name,
            number(member.utilisation.unwrap_or(0.0))
        );
        let at = path("structure").key("frame").key("member").index(index);
        let mut finding = Finding::warning(at, text)
            .help("the utilisation is the elastic strain over the yield strain, or moment over yield moment");
        if let more @ 1.. = yielding.count() - 1 {
            finding = finding.label(format!("and {more} more members yield"));
        }
        site.warnings.push(finding);
    }
    Ok(Some(FrameFacts {
        mass: frame.node.iter().map(|node| node.mass_kg).sum(),
        weight,
        members,
        share_of_tick: None,
    }))
}

/// Largest share of a tick that the members of a frame may take.
const MOST_OF_TICK: f64 = 0.6;

/// Time that a step takes in the worst case, measured now, in ticks; none for a frame of elastic members, and for a trial.
pub(super) fn share_of_tick(
    site: &mut Site<'_>,
    numerical: &mut Numerical,
) -> Result<Option<f64>, Refused> {
    if site.trial.is_some() || !numerical.structure.has_members() {
        return Ok(None);
    }
    let time = site.loaded.time;
    let Some(ns) = numerical.worst_step(time.step.value(), &mut monotonic_ns) else {
        return Ok(None);
    };
    // The ticks of a step share the work.
    let (took, step) = (ns as f64 * 1e-9, time.step.value());
    let share = took / step;
    if share > MOST_OF_TICK && time.clock == ClockChoice::Real {
        let text = format!(
            "the members of the frame take up to {} for a step of {}, which is {:.0} % of each tick; at most {:.0} % leave time for the rest",
            quantity(took, "s"),
            quantity(step, "s"),
            100.0 * share,
            100.0 * MOST_OF_TICK
        );
        let help =
            "use fewer members, `points` or `layers`, a lower rate, or `clock = \"simulated\"`";
        return site.refuse(Finding::error(path("structure").key("frame"), text).help(help));
    }
    Ok(Some(share))
}

/// Place in the file of a mistake of a frame.
pub(super) fn place(site: &Site<'_>, error: &FrameError) -> KeyPath {
    let at = path("structure").key("frame");
    let beneath = |at: &KeyPath, key: &str| site.loaded.locator.beneath(at, key);
    match error {
        FrameError::Value {
            at: (list, index),
            key,
            ..
        } => at.key(list).index(*index).key(key),
        FrameError::Coordinates {
            at: (list, index),
            key,
            ..
        }
        | FrameError::NotInPlane {
            at: (list, index),
            key,
            ..
        } => at.key(list).index(*index).key(key),
        FrameError::Dimension(_) => at.key("dimension"),
        FrameError::Section { section, key, .. }
        | FrameError::NeededInSpace { section, key }
        | FrameError::NoMaterial { section, key, .. } => {
            beneath(&at.key("section").key(section), key)
        }
        FrameError::OneMaterial { section, .. } => at.key("section").key(section),
        FrameError::Material { material, source } => {
            beneath(&at.key("material").key(material), source.name)
        }
        FrameError::Law {
            at: (list, None),
            name,
            source,
        } => beneath(&at.key(list).key(name), source.key()),
        FrameError::Law {
            at: (list, Some(index)),
            source,
            ..
        } => beneath(&at.key(list).index(*index).key("law"), source.key()),
        FrameError::NotAHinge { name } => at.key("hinge").key(name),
        FrameError::SameName { index, .. } => at.key("node").index(*index).key("name"),
        FrameError::NoNode {
            at: (list, index), ..
        } => at.key(list).index(*index),
        FrameError::NoSection { index, .. } => at.key("member").index(*index).key("section"),
        FrameError::NoHinge {
            at: (list, index),
            key,
            ..
        }
        | FrameError::Unfit {
            at: (list, index),
            key,
            ..
        } => at.key(list).index(*index).key(key),
        FrameError::SnapBack { index, key, .. } => at.key("member").index(*index).key(key),
        FrameError::Constrained { index, .. } => at.key("constraint").index(*index),
        FrameError::Empty | FrameError::Loose { .. } | FrameError::Buckles { .. } => at,
    }
}
