//! Motions of single supports of a frame.
//!
//! The frame is in absolute coordinates. A support that moves by x_s loads the degrees of freedom with −K_fs x_s, K_fs being the column
//! of the stiffness beside them. The damping acts on the motion against the static one: with R = −K⁻¹ K_fs the load is C R v_s. If
//! all supports move alike, K R = K ι, and the test is that of a ground acceleration.

use super::histories::{added, keep, motion, warn_of_nothing, with_files};
use super::{Refused, Site, path};
use gusset_config::Finding;
use gusset_motion::{Excitation, Grid, LoadTerm, base_motion};
use gusset_numerics::linalg::{Spd, SymMatrix};
use gusset_numerics::model::Structure;

/// Adds the loads of the supports. `stiffness` is that of the structure and its specimens at the start.
pub(super) fn supports(
    site: &mut Site<'_>,
    structure: &Structure,
    stiffness: &SymMatrix,
    grid: Grid,
    mut excitation: Excitation,
) -> Result<Excitation, Refused> {
    let tables = &site.loaded.file.excitation.support_motion;
    let frame = site.loaded.file.structure.as_ref();
    let frame = frame.and_then(|table| table.frame.as_ref());
    let (Some(frame), false) = (frame, tables.is_empty()) else {
        return Ok(excitation);
    };
    let mut factor = Spd::factor(stiffness).or_else(|_| {
        let text = "the structure with its specimens has no stiffness against a motion, so its supports cannot move";
        site.refuse(Finding::error(path("excitation").key("support_motion"), text))
    })?;
    for (index, table) in tables.iter().enumerate() {
        let at = path("excitation").key("support_motion").index(index);
        let n = structure.dofs();
        let mut column = vec![0.0; n];
        for name in table.named() {
            let direction = table.direction.of_frame();
            let own = frame.support_column(name, direction).or_else(|error| {
                let at = at.key(if table.node.is_some() {
                    "node"
                } else {
                    "nodes"
                });
                let text = format!("`{at}` cannot move: {error}");
                site.refuse(Finding::error(at, text))
            })?;
            column
                .iter_mut()
                .zip(own)
                .for_each(|(sum, one)| *sum += one);
        }
        let history = motion(&table.signal, &table.processing);
        let moved = with_files(site, &at, &table.signal, |files| {
            base_motion(&history, grid, files, "the support")
        })?;
        let told = [moved.warnings, moved.doubts];
        keep(site, &at, &table.signal, told, moved.record);
        let corrected = moved.corrected.map(|one| (at.to_string(), one));
        site.corrected.extend(corrected);
        warn_of_nothing(site, at.clone(), [&column, &moved.disp]);
        let mut shape: Vec<f64> = column.iter().map(|k| -k).collect();
        factor.solve_in_place(&mut shape);
        let against = shape.iter().map(|r| -r).collect::<Vec<f64>>();
        let mut damped = vec![0.0; n];
        structure.damping().subtract_product(&against, &mut damped);
        let elastic = LoadTerm {
            pattern: column.iter().map(|k| -k).collect(),
            series: moved.disp,
        };
        let viscous = LoadTerm {
            pattern: damped,
            series: moved.vel,
        };
        excitation = added(site, &at, || excitation.with_support([elastic, viscous]))?;
    }
    Ok(excitation)
}
