//! What all motions and loads share: their files, their values on the step grid, and their warnings.

use super::specimens::Specimens;
use super::{Refused, Site};
use gusset_config::{Finding, KeyPath};
use gusset_motion::{
    Excitation, Grid, Motion, MotionError, Processing, Quantity, RecordFacts, Signal,
};
use gusset_numerics::model::Structure;
use gusset_proof::Kind;

/// Runs `evaluate` on a motion whose table is at `at`, with its file read.
pub(super) fn with_files<T>(
    site: &mut Site<'_>,
    at: &KeyPath,
    signal: &Signal,
    evaluate: impl FnOnce(&gusset_motion::Files<'_>) -> Result<T, MotionError>,
) -> Result<T, Refused> {
    let mut bytes = None;
    let place = source(site, at, signal);
    if let Some(file) = signal.path() {
        bytes = Some(site.read(place.clone(), file)?);
    }
    let files = move |_: &str| {
        bytes
            .clone()
            .ok_or_else(|| std::io::Error::other("this file is not named in the test file"))
    };
    evaluate(&files).or_else(|error| {
        let place = match error.key() {
            Some(key) => site.loaded.locator.beneath(at, key),
            None => place,
        };
        let mut finding = Finding::error(place, error.to_string());
        if let Some(help) = error.help() {
            finding = finding.help(help);
        }
        site.refuse(finding)
    })
}

/// Source of a motion: the key that names its file, or the whole signal.
fn source(site: &Site<'_>, at: &KeyPath, signal: &Signal) -> KeyPath {
    let at = at.key("signal");
    match signal.path() {
        Some(_) => site.loaded.locator.beneath(&at, "path"),
        None => at,
    }
}

/// Keeps the warnings and the record of the motion whose table is at `at`, and the doubts about it for the verdict.
pub(super) fn keep(
    site: &mut Site<'_>,
    at: &KeyPath,
    signal: &Signal,
    [warnings, doubts]: [Vec<String>; 2],
    records: impl IntoIterator<Item = RecordFacts>,
) {
    let place = source(site, at, signal);
    let finding = |text: String| Finding::warning(place.clone(), text);
    site.warnings.extend(warnings.into_iter().map(finding));
    let doubts = doubts.into_iter().map(finding);
    site.doubts.extend(doubts.map(|doubt| (Kind::Error, doubt)));
    site.records.extend(records);
}

/// The values of the motion whose table is at `at`.
pub(super) fn series(
    site: &mut Site<'_>,
    at: &KeyPath,
    history: &Motion,
    quantity: Quantity,
    grid: Grid,
) -> Result<Vec<f64>, Refused> {
    let found = with_files(site, at, &history.signal, |files| {
        history.evaluate(quantity, grid, files)
    })?;
    let told = [found.warnings, found.doubts];
    keep(site, at, &history.signal, told, found.record);
    Ok(found.values)
}

/// Warns of a load at `at` whose numbers are all zero: it moves nothing.
pub(super) fn warn_of_nothing(site: &mut Site<'_>, at: KeyPath, values: [&[f64]; 2]) {
    let [place, history] = values.map(|values| values.iter().all(|value| *value == 0.0));
    if place || history {
        let label = if place {
            "has no effect: all its factors are zero"
        } else {
            "zero from the start to the end"
        };
        let headline = format!("`{at}` moves nothing");
        site.warnings
            .push(Finding::warning(at, headline).at_key().label(label));
    }
}

pub(super) fn motion(signal: &Signal, processing: &Processing) -> Motion {
    Motion {
        signal: signal.clone(),
        processing: processing.clone(),
        delay_s: 0.0,
    }
}

pub(super) fn added(
    site: &mut Site<'_>,
    at: &KeyPath,
    add: impl FnOnce() -> Result<Excitation, MotionError>,
) -> Result<Excitation, Refused> {
    add().or_else(|error| site.refuse(Finding::error(at.clone(), error.to_string())))
}

/// −M ι with the mass of the specimens whose inertia is inside the measured force: they load the structure although they
/// are not counted in M.
pub(super) fn ground_load(
    site: &Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    iota: &[f64],
) -> Vec<f64> {
    let n = structure.dofs();
    let (iota, mut load) = match &site.reduced {
        Some(one) => (one.reduction.motion(iota), one.reduction.ground_load(iota)),
        None => {
            let mut load = vec![0.0; n];
            structure.mass().subtract_product(iota, &mut load);
            (iota.to_vec(), load)
        }
    };
    specimens
        .mass_in_force(n)
        .subtract_product(&iota, &mut load);
    load
}

pub(super) fn sized(
    site: &mut Site<'_>,
    at: &KeyPath,
    values: Vec<f64>,
    n: usize,
) -> Result<Vec<f64>, Refused> {
    if values.len() == n {
        return Ok(values);
    }
    let text = format!("{} entries, but the structure has {n} DOFs", values.len());
    site.refuse(Finding::error(at.clone(), text))
}
