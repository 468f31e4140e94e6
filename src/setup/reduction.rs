//! The reduction of a structure: which DOFs are kept, and the matrices of the reduced model.

use std::collections::BTreeSet;

use super::reduced::Reduced;
use super::specimens::Specimens;
use super::{Refused, Site, path};
use gusset_config::{DofChoice, Finding, KeptDof, KeptNode, KeyPath, ReduceTable};
use gusset_numerics::frame::FrameModel;
use gusset_numerics::model::{BuildError, ElementSpec, End, Linear, ModelError, StructureSpec};
use gusset_reduction::{Reduction, ReductionError};

/// Reduces the matrices of a structure. Its elements and specimens get the numbers of the reduced one.
pub(super) fn reduced(
    site: &mut Site<'_>,
    reduce: &ReduceTable,
    spec: &StructureSpec,
    mut linear: Linear,
    elements: &mut [ElementSpec],
    specimens: &mut Specimens,
) -> Result<Result<Linear, BuildError>, Refused> {
    let at = path("structure").key("reduce");
    let frame = match spec {
        StructureSpec::Frame(frame) => match frame.model() {
            Ok(model) => Some((frame, model)),
            Err(error) => return Ok(Err(error.into())),
        },
        StructureSpec::Matrices(_) => None,
        StructureSpec::ShearBuilding(_) | StructureSpec::Chain(_) => {
            let text = "only a structure of `matrices` or a `frame` can be reduced";
            return site.refuse(Finding::error(at, text).at_key().label("remove this table"));
        }
    };
    let n = linear.mass.n();
    for (what, found) in [
        ("stiffness", linear.stiffness.n()),
        ("damping", linear.damping.n()),
        ("influence", linear.influence.len()),
    ] {
        if found != n {
            let expected = n;
            let error = ModelError::Size {
                what,
                expected,
                found,
            };
            return Ok(Err(error.into()));
        }
    }
    refuse_loads(site)?;
    let mut kept = BTreeSet::new();
    for (index, one) in reduce.keep.iter().enumerate() {
        let model = frame.as_ref().map(|(_, model)| model);
        match named(one, model, n) {
            Ok(dofs) => kept.extend(dofs),
            Err(text) => return site.refuse(Finding::error(at.key("keep").index(index), text)),
        }
    }
    let named = kept.len();
    kept.extend(linear.members.dofs());
    if let Some((spec, model)) = &frame {
        let bent = spec.member.iter().filter(|member| member.p_delta);
        for node in bent.flat_map(|member| &member.nodes) {
            let motions = spec
                .directions()
                .iter()
                .filter_map(|one| model.motion(node, *one));
            kept.extend(motions.flatten().map(|(dof, _)| *dof));
        }
    }
    for (index, element) in elements.iter().enumerate() {
        for end in [element.from, element.to] {
            let End::Dof(dof) = end else { continue };
            if dof >= n {
                let element = element.name.clone();
                let element = element.unwrap_or_else(|| format!("element {}", index + 1));
                let error = ModelError::NoSuchDof {
                    element,
                    dof,
                    dofs: n,
                };
                return Ok(Err(error.into()));
            }
            kept.insert(dof);
        }
    }
    kept.extend(specimens.touched());
    let file = &site.loaded.file;
    if let Some(table) = &file.structure {
        let initial = [
            &table.initial_displacement_m,
            &table.initial_velocity_m_per_s,
        ];
        let moved = initial
            .into_iter()
            .flatten()
            .flat_map(|one| one.iter().enumerate());
        kept.extend(
            moved
                .filter(|(_, value)| **value != 0.0)
                .map(|(dof, _)| dof),
        );
    }
    if let Some(DofChoice::Listed(listed)) = &file.record.dofs {
        kept.extend(listed.iter().filter_map(|dof| dof.checked_sub(1)));
    }
    // A number that does not exist is refused where it stands.
    let kept: Vec<usize> = kept.into_iter().filter(|dof| *dof < n).collect();
    let keep = kept.iter().map(|&dof| match &frame {
        Some((_, model)) => {
            let (node, direction) = model.dofs[dof].clone();
            KeptDof::Node(KeptNode { node, direction })
        }
        None => KeptDof::Number(dof + 1),
    });
    let keep: Vec<KeptDof> = keep.collect();
    let mass = linear.mass.plus(1.0, &specimens.mass(n));
    let made = Reduction::new(mass, linear.stiffness, kept, reduce.modes);
    let reduction = made.or_else(|error| {
        let place = match &error {
            ReductionError::Modes { .. } | ReductionError::NotConverged(_) => at.key("modes"),
            _ => at.clone(),
        };
        let mut finding = Finding::error(place, error.to_string());
        if let (ReductionError::Loose(failure) | ReductionError::Mass(failure), Some((_, model))) =
            (&error, &frame)
        {
            let (node, direction) = &model.dofs[failure.dof];
            let text = format!("DOF {} is {node} {}", failure.dof + 1, direction.word());
            finding = finding.label(text);
        }
        site.refuse(finding)
    })?;
    [linear.mass, linear.stiffness] = reduction.reduced().clone();
    linear.damping = reduction.project(&linear.damping);
    linear.influence = reduction.motion(&linear.influence);
    linear.damped = linear
        .damped
        .map(|both| both.map(|one| reduction.project(&one)));
    // All of these are kept.
    let new = |dof: usize| reduction.place(dof).unwrap_or(usize::MAX);
    linear.members.renumber(new);
    for element in elements {
        for end in [&mut element.from, &mut element.to] {
            if let End::Dof(dof) = end {
                *dof = new(*dof);
            }
        }
    }
    specimens.renumber(new);
    site.reduced = Some(Reduced {
        reduction,
        named,
        keep,
        grounds: Vec::new(),
    });
    Ok(Ok(linear))
}

/// The degrees of freedom that an entry of `keep` names, or why it names none.
fn named(one: &KeptDof, model: Option<&FrameModel>, n: usize) -> Result<Vec<usize>, String> {
    match (one, model) {
        (KeptDof::Number(dof), None) if (1..=n).contains(dof) => Ok(vec![dof - 1]),
        (KeptDof::Number(dof), None) => Err(format!(
            "DOF {dof} does not exist: the structure has {n}, counted from 1"
        )),
        (KeptDof::Number(_), Some(_)) => {
            Err("a frame has no numbers here: give { node = \"…\", direction = \"…\" }".to_owned())
        }
        (KeptDof::Node(_), None) => {
            Err("`matrices` have no nodes: give the number of a DOF, from 1".to_owned())
        }
        (KeptDof::Node(KeptNode { node, direction }), Some(model)) => {
            match model.motion(node, *direction) {
                None => Err(format!(
                    "there is no node \"{node}\"; the nodes are {}",
                    model.nodes().join(", ")
                )),
                Some([]) => Err(format!(
                    "{node} does not move in direction {}: it is fixed",
                    direction.word()
                )),
                Some(terms) => Ok(terms.iter().map(|(dof, _)| *dof).collect()),
            }
        }
    }
}

/// Refuses loads whose effect on the interior is not known to the reduced structure.
fn refuse_loads(site: &mut Site<'_>) -> Result<(), Refused> {
    let (at, table): (KeyPath, _) = (path("excitation"), &site.loaded.file.excitation);
    for (key, is_given, instead) in [
        (
            "base_displacement",
            table.base_displacement.is_some(),
            "ground_acceleration",
        ),
        (
            "support_motion",
            !table.support_motion.is_empty(),
            "ground_acceleration",
        ),
        ("nodal_table", table.nodal_table.is_some(), "nodal_force"),
    ] {
        if is_given {
            let text = format!("`{key}` cannot load a structure with `reduce`");
            let finding = Finding::error(at.key(key), text).at_key();
            return site.refuse(finding.label(format!("use `{instead}`, or remove `reduce`")));
        }
    }
    Ok(())
}
