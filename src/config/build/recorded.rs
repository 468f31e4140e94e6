//! The DOFs whose motion is recorded.

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
