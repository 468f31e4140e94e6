//! Components of the ground acceleration: scaled together, turned in plan, and applied along their influence vectors.

use super::histories::{added, ground_load, series, sized, warn_of_nothing};
use super::specimens::Specimens;
use super::{Refused, Site, path};
use gusset_config::{Finding, GroundComponent, GroundDirection, KeyPath};
use gusset_motion::{Excitation, Grid, LoadTerm, Motion, MotionError, Quantity, Scaled};
use gusset_numerics::model::Structure;

/// Adds the components of the ground acceleration.
pub(super) fn ground(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    grid: Grid,
    mut excitation: Excitation,
) -> Result<Excitation, Refused> {
    let table = &site.loaded.file.excitation;
    let (at, grounds) = (path("excitation"), &table.ground_acceleration);
    let scaled = scaled(site, grid)?;
    let factor = scaled.as_ref().map_or(1.0, |scaled| scaled.factor);
    site.scaled = scaled;
    let mut accels = Vec::new();
    let (mut patterns, mut influences) = (Vec::new(), Vec::new());
    for (index, component) in grounds.all().iter().enumerate() {
        let at = grounds.place(&at, index);
        let iota = influence(site, &at, component, structure)?;
        let mut motion = component.motion();
        motion.processing.scale_factor *= factor;
        let accel = series(site, &at, &motion, Quantity::Acceleration, grid)?;
        let pattern = ground_load(site, structure, specimens, &iota);
        influences.push(iota);
        warn_of_nothing(site, at, [&pattern, &accel]);
        accels.push(accel);
        patterns.push(pattern);
    }
    if let Some(degrees) = table.incident_angle_deg {
        let along = |wanted| {
            let mut all = grounds.all().iter();
            all.position(|one| one.direction == Some(wanted))
        };
        if let (Some(x), Some(y)) = (along(GroundDirection::X), along(GroundDirection::Y)) {
            turn(&mut accels, [x, y], degrees);
        }
    }
    let mut tracks = Vec::new();
    for track in grounds.tracks() {
        // All components of a column have one influence vector.
        let iota = track.components.first().map(|index| &influences[*index]);
        if let (Some(reduced), Some(iota)) = (&mut site.reduced, iota) {
            reduced.grounds.push((track.suffix.clone(), iota.clone()));
        }
        let own = track.components.iter();
        let sum = own.clone().fold(None, |sum: Option<Vec<f64>>, index| {
            let next = &accels[*index];
            Some(match sum {
                None => next.clone(),
                Some(sum) => sum.iter().zip(next).map(|(a, b)| a + b).collect(),
            })
        });
        tracks.push((track.suffix, sum.unwrap_or_default()));
    }
    for (index, (series, pattern)) in accels.into_iter().zip(patterns).enumerate() {
        let at = grounds.place(&at, index);
        let term = LoadTerm { pattern, series };
        excitation = added(site, &at, || excitation.with_term(term))?;
    }
    for (suffix, accel) in tracks {
        excitation = added(site, &at, || excitation.with_ground(&suffix, accel))?;
    }
    Ok(excitation)
}

/// Turns two components from x to y.
fn turn(accels: &mut [Vec<f64>], [x, y]: [usize; 2], degrees: f64) {
    let (sine, cosine) = libm::sincos(degrees.to_radians());
    let both = accels[x].iter().zip(&accels[y]);
    let turned = both.map(|(x, y)| (x * cosine - y * sine, x * sine + y * cosine));
    let (along_x, along_y) = turned.unzip();
    (accels[x], accels[y]) = (along_x, along_y);
}

/// The influence vector of a component.
fn influence(
    site: &mut Site<'_>,
    at: &KeyPath,
    component: &GroundComponent,
    structure: &Structure,
) -> Result<Vec<f64>, Refused> {
    let table = site.loaded.file.structure.as_ref();
    let spec = table.and_then(|table| table.kind()).map(|(_, spec)| spec);
    let own = spec.as_ref().and_then(|spec| component.influence_in(spec));
    let n = site.dofs_of_file(structure.dofs());
    let given = spec.as_ref().and_then(|spec| spec.influence());
    let iota = own.or(given).unwrap_or_else(|| vec![1.0; n]);
    sized(site, &at.key("influence"), iota, n)
}

/// The factor of `[excitation.scaling]`; none without it.
fn scaled(site: &mut Site<'_>, grid: Grid) -> Result<Option<Scaled>, Refused> {
    let table = &site.loaded.file.excitation;
    let Some(scaling) = &table.scaling else {
        return Ok(None);
    };
    let (root, grounds) = (path("excitation"), &table.ground_acceleration);
    let frame = site.loaded.file.structure.as_ref();
    let frame = frame.and_then(|table| table.frame.as_ref());
    let pair = grounds.horizontal(frame.is_some_and(|frame| frame.dimension == 2));
    let all = grounds.all();
    let [first, second] = pair[..] else {
        return Ok(None);
    };
    let mut read = |at: KeyPath, file: Option<&str>| {
        let bytes = file.map(|file| site.read(at, file)).transpose()?;
        Ok(bytes.unwrap_or_default())
    };
    let of_component = |index: usize| {
        let at = grounds.place(&root, index).key("signal");
        (at, all[index].signal.path())
    };
    let (at, file) = of_component(first);
    let x = read(at, file)?;
    let (at, file) = of_component(second);
    let y = read(at, file)?;
    let at = root.key("scaling");
    let target = read(at.key("spectrum_file"), scaling.spectrum_file.as_deref())?;
    let motions: [Motion; 2] = [first, second].map(|index| all[index].motion());
    let found = scaling.of(
        motions.each_ref(),
        grid,
        [
            &|_: &str| Ok(x.clone()),
            &|_: &str| Ok(y.clone()),
            &|_: &str| Ok(target.clone()),
        ],
    );
    found.map(Some).or_else(|error| {
        let place = match &error {
            // The components themselves report what is wrong with their own files.
            MotionError::Scaling { key: "scaling", .. } => at.clone(),
            error => match error.key() {
                Some(key) => site.loaded.locator.beneath(&at, key),
                None => at.clone(),
            },
        };
        let mut finding = Finding::error(place, error.to_string());
        if let Some(help) = error.help() {
            finding = finding.help(help);
        }
        site.refuse(finding)
    })
}
