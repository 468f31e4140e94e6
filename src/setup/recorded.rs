//! The DOFs whose motion is recorded, and those that are rotations.

use super::specimens::Specimens;
use super::{Refused, Site, path};
use gusset_config::{DispUnit, DofChoice, Finding};

/// Largest model whose DOFs are all recorded by default.
const RECORD_ALL: usize = 64;

pub(super) fn record_dofs(
    site: &mut Site<'_>,
    dofs: usize,
    specimens: &Specimens,
) -> Result<Vec<usize>, Refused> {
    let all = (0..dofs).collect::<Vec<_>>();
    match &site.loaded.file.record.dofs {
        Some(DofChoice::All) => Ok(all),
        Some(DofChoice::Listed(listed)) => {
            let at = path("record").key("dofs");
            let dofs = site.dofs_of_file(dofs);
            if let Some((index, dof)) = listed
                .iter()
                .enumerate()
                .find(|(_, dof)| !(1..=dofs).contains(*dof))
            {
                let text = format!("DOF {dof} does not exist: the structure has {dofs}");
                return site.refuse(Finding::error(at.index(index), text));
            }
            let listed: Vec<usize> = listed.iter().map(|dof| dof - 1).collect();
            Ok(in_structure(site, listed))
        }
        None if dofs <= RECORD_ALL => Ok(all),
        None => {
            let mut some = specimens.dofs();
            let last = site
                .reduced
                .as_ref()
                .map_or(dofs, |one| one.reduction.kept().len());
            some.extend([0, last.max(1) - 1]);
            some.sort_unstable();
            some.dedup();
            Ok(some)
        }
    }
}

/// DOFs that are rotations, from 0, ascending.
pub(super) fn rotations(site: &mut Site<'_>, dofs: usize) -> Result<Vec<usize>, Refused> {
    let dofs = site.dofs_of_file(dofs);
    let Some(table) = &site.loaded.file.structure else {
        return Ok(Vec::new());
    };
    if let Some(frame) = &table.frame
        && table.rotations.is_empty()
    {
        let places = frame.places();
        let dofs = places.iter().enumerate();
        let turns = dofs.filter(|(_, (_, direction))| direction.turns());
        let turns: Vec<usize> = turns.map(|(dof, _)| dof).collect();
        refuse_lengths(site, &turns)?;
        return Ok(in_structure(site, turns));
    }
    let at = path("structure").key("rotations");
    let given = &table.rotations;
    if !given.is_empty() && table.matrices.is_none() {
        let text = "only a structure of `matrices` has rotations: every DOF of a shear building and of a chain is a translation, and a frame knows its own";
        return site.refuse(Finding::error(at, text));
    }
    for (index, dof) in given.iter().enumerate() {
        let text = if !(1..=dofs).contains(dof) {
            format!("DOF {dof} does not exist: the structure has {dofs}, counted from 1")
        } else if given.iter().take(index).any(|before| before == dof) {
            format!("DOF {dof} is listed twice")
        } else {
            continue;
        };
        return site.refuse(Finding::error(at.index(index), text));
    }
    let mut rotations: Vec<usize> = given.iter().map(|dof| dof - 1).collect();
    rotations.sort_unstable();
    refuse_lengths(site, &rotations)?;
    Ok(in_structure(site, rotations))
}

/// DOFs of the file, from 0, in the numbers of the structure; without those that a reduction does not keep.
fn in_structure(site: &Site<'_>, dofs: Vec<usize>) -> Vec<usize> {
    match &site.reduced {
        Some(one) => one.of_model(&dofs),
        None => dofs,
    }
}

/// Refuses a unit other than m for the displacement of an axis that is a rotation: it is in rad, and no unit of length converts it.
fn refuse_lengths(site: &mut Site<'_>, rotations: &[usize]) -> Result<(), Refused> {
    // A row with a lever arm is a length.
    let turns = |row: &[f64]| {
        let mut entries = row.iter().enumerate().filter(|(_, entry)| **entry != 0.0);
        let turns = |(dof, entry): (usize, &f64)| entry.abs() == 1.0 && rotations.contains(&dof);
        row.iter().any(|entry| *entry != 0.0) && entries.all(turns)
    };
    let found = site.loaded.file.specimen.iter().enumerate();
    let found = found.filter(|(_, table)| table.geometry.is_none());
    let found = found.into_iter().find_map(|(specimen, table)| {
        let mut axes = table.axis.iter().zip(table.rows.as_ref()?).enumerate();
        let (axis, (gear, _)) =
            axes.find(|(_, (gear, row))| gear.unit_disp != DispUnit::Metre && turns(row))?;
        Some((specimen, axis, gear.unit_disp.row().symbol))
    });
    let Some((specimen, axis, unit)) = found else {
        return Ok(());
    };
    let at = path("specimen").index(specimen).key("axis").index(axis);
    let text = format!(
        "axis {} is a rotation, because its row has only DOFs of `structure.rotations`: its displacement is in rad, and `unit_disp = \"{unit}\"` would \
         convert it as a length. Remove `unit_disp` for this axis; its moment is in `unit_force` times m",
        axis + 1
    );
    site.refuse(Finding::error(at.key("unit_disp"), text))
}
