//! Motions of the specimens of a test without a structure, on the step grid: deformations of their axes, coordinates of their
//! platforms, or strokes of the actuators, which are converted to coordinates.

use super::excitation::grid;
use super::histories::{keep, motion, with_files};
use super::specimens::Specimens;
use super::{Refused, Site, path};
use gusset_actuator::geometry::{Fault, Geometry, MOST};
use gusset_config::{Finding, KeyPath, PrescribedPlace, PrescribedTable};
use gusset_motion::{Grid, Prescribed, PrescribedSpec};

/// The histories of one specimen.
struct Moved<'a> {
    name: String,
    geometry: Option<&'a Geometry>,
    /// One for each axis, or for each coordinate of the platform.
    own: Vec<Option<Prescribed>>,
    /// One for each actuator, and the place of the first of them.
    strokes: Vec<Option<Prescribed>>,
    first: Option<KeyPath>,
}

/// Given deformations of every axis of every specimen, in order; an axis without a motion holds zero.
pub(super) fn prescribed(
    site: &mut Site<'_>,
    specimens: &Specimens,
) -> Result<Vec<Option<Prescribed>>, Refused> {
    let grid = grid(site)?;
    let all = specimens.axes().zip(specimens.geometries());
    let mut all: Vec<Moved<'_>> = all
        .map(|((name, axes), geometry)| Moved {
            name: name.to_owned(),
            geometry,
            own: vec![None; axes],
            strokes: vec![None; geometry.map_or(axes, Geometry::actuators)],
            first: None,
        })
        .collect();
    let tables = site.loaded.file.excitation.prescribed_displacement.iter();
    for (index, table) in tables.enumerate() {
        let at = path("excitation")
            .key("prescribed_displacement")
            .index(index);
        let Some(moved) = all.iter_mut().find(|moved| moved.name == table.specimen) else {
            let text = format!("this file has no specimen \"{}\"", table.specimen);
            return site.refuse(Finding::error(at.key("specimen"), text));
        };
        one(site, &at, table, grid, moved)?;
    }
    let mut histories = Vec::new();
    for moved in all {
        match (moved.first, moved.geometry) {
            (Some(at), Some(geometry)) => {
                match coordinates(geometry, &moved.strokes, grid.points()) {
                    Ok(found) => histories.extend(found.into_iter().map(Some)),
                    Err(fault) => {
                        let text = format!("specimen \"{}\": {fault}", moved.name);
                        let finding = Finding::error(at, text);
                        return site.refuse(finding.label("these strokes cause it"));
                    }
                }
            }
            _ => histories.extend(moved.own),
        }
    }
    Ok(histories)
}

/// One table of the file.
fn one(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &PrescribedTable,
    grid: Grid,
    moved: &mut Moved<'_>,
) -> Result<(), Refused> {
    let is_stroke = table.at == PrescribedPlace::Actuators && moved.geometry.is_some();
    let (slots, what, one) = match (is_stroke, moved.geometry) {
        (true, Some(geometry)) => {
            let (actuators, width) = (geometry.actuators(), geometry.coordinates().len());
            if actuators > width {
                let text = format!(
                    "{actuators} actuators hold {width} coordinates of specimen \"{}\": a single actuator cannot move alone",
                    table.specimen
                );
                return site.refuse(Finding::error(at.key("at"), text));
            }
            moved.first.get_or_insert(at.clone());
            (&mut moved.strokes, "actuators", "actuator")
        }
        (_, Some(_)) => (&mut moved.own, "coordinates", "coordinate"),
        (_, None) => (&mut moved.own, "axes", "axis"),
    };
    let count = slots.len();
    let slot = table
        .axis
        .checked_sub(1)
        .and_then(|axis| slots.get_mut(axis));
    let Some(slot) = slot else {
        let text = format!("specimen \"{}\" has {count} {what}", table.specimen);
        return site.refuse(Finding::error(at.key("axis"), text));
    };
    let spec = PrescribedSpec {
        axes: vec![motion(&table.signal, &table.processing)],
        ease_in_s: table.ease_in_s,
        ease_out_s: table.ease_out_s,
    };
    let called = |_| format!("{one} {}", table.axis);
    let history = with_files(site, at, &table.signal, |files| {
        spec.evaluate_named(grid, files, called)
    })?;
    let name = &table.specimen;
    let texts = history.warnings.iter();
    let texts = texts.map(|text| format!("specimen \"{name}\": {text}"));
    let told = [texts.collect(), Vec::new()];
    let records = history.records.iter().cloned();
    keep(site, at, &table.signal, told, records);
    let corrected = history.corrected.iter();
    let corrected = corrected.map(|one| (at.to_string(), one.clone()));
    site.corrected.extend(corrected);
    *slot = Some(history);
    Ok(())
}

/// The coordinates in which the actuators have these strokes, step by step from the reference pose; an actuator without a
/// history keeps its length. As many actuators as coordinates.
fn coordinates(
    geometry: &Geometry,
    strokes: &[Option<Prescribed>],
    points: usize,
) -> Result<Vec<Prescribed>, Fault> {
    let width = geometry.coordinates().len();
    let column = || Vec::with_capacity(points);
    let mut disp: Vec<Vec<f64>> = (0..width).map(|_| column()).collect();
    let mut vel = disp.clone();
    let mut placed = geometry.reference();
    for step in 0..points {
        let (mut wanted, mut speeds, mut rates) = ([0.0; MOST], [0.0; MOST], [0.0; MOST]);
        for (history, (wanted, speed)) in strokes.iter().zip(wanted.iter_mut().zip(&mut speeds)) {
            if let Some((&[disp], &[vel])) = history.as_ref().map(|history| history.at(step)) {
                (*wanted, *speed) = (disp, vel);
            }
        }
        geometry.find(&wanted, &mut placed)?;
        geometry.pose_rates(&placed, &speeds, &mut rates);
        for (column, value) in disp.iter_mut().zip(placed.pose()) {
            column.push(*value);
        }
        for (column, value) in vel.iter_mut().zip(&rates) {
            column.push(*value);
        }
    }
    let each = disp.into_iter().zip(vel);
    Ok(each
        .map(|(disp, vel)| Prescribed::of_axis(disp, vel))
        .collect())
}
