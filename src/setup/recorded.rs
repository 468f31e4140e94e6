//! The DOFs whose motion is recorded, and those that are rotations.

use super::specimens::Specimens;
use super::{Refused, Site, path};
use crate::config::{DofChoice, Finding};

/// Largest model whose DOFs are all recorded unless the test says otherwise.
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
            if let Some((index, dof)) = listed
                .iter()
                .enumerate()
                .find(|(_, dof)| !(1..=dofs).contains(*dof))
            {
                let text = format!("DOF {dof} does not exist: the structure has {dofs}");
                return site.refuse(Finding::error(at.index(index), text));
            }
            Ok(listed.iter().map(|dof| dof - 1).collect())
        }
        None if dofs <= RECORD_ALL => Ok(all),
        None => {
            let mut some = specimens.dofs();
            some.extend([0, dofs - 1]);
            some.sort_unstable();
            some.dedup();
            Ok(some)
        }
    }
}

/// DOFs that are rotations, from 0, ascending.
pub(super) fn rotations(site: &mut Site<'_>, dofs: usize) -> Result<Vec<usize>, Refused> {
    let Some(table) = &site.loaded.file.structure else {
        return Ok(Vec::new());
    };
    let at = path("structure").key("rotations");
    let given = &table.rotations;
    if !given.is_empty() && table.matrices.is_none() {
        let text = "only a structure of `matrices` has rotations: every DOF of a shear building and of a chain is a translation";
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
    Ok(rotations)
}
