//! The key figures at the top of a page.

use maud::Markup;

use super::RunView;
use super::columns::Storey;
use super::digest::Digest;
use super::html;
use super::response;
use super::text::{count, lag_words, micros, percent, quantity};
use super::timing::Timing;
use super::tracked;

/// The largest displacement and the largest force: of the whole test, as far as the summary reports it. Without a
/// step they are those of the startup.
fn extremes(run: &RunView, rows: &Digest, axes: &[tracked::Tracked<'_>]) -> Vec<(String, String)> {
    let has_run = rows.passed.steps > 0
        || run
            .summary
            .as_ref()
            .is_some_and(|summary| summary.steps > 0);
    let peak = run.summary.as_ref().map(|summary| &summary.peak);
    let of = match (rows.part(), peak) {
        (None, _) => String::new(),
        (Some(_), Some(_)) => ", of the whole test".to_owned(),
        (Some(_), None) => of_steps(rows),
    };
    let mut tiles = Vec::new();
    if let Some((dof, value, unit)) = response::largest_displacement(run, rows) {
        let dof = super::tested::dof(run, dof);
        let words = if has_run {
            format!("largest displacement, {dof}{of}")
        } else {
            format!("displacement at the start, {dof}: no step was made")
        };
        tiles.push((quantity(value, unit), words));
    }
    if !has_run {
        let way_in = tracked::largest(axes, |axis| axis.way_in);
        tiles.extend(way_in.map(|(axis, force)| {
            let words = format!("largest force before the first step, {}", axis.force_of());
            (quantity(force, axis.force_unit), words)
        }));
    } else if let Some((axis, force)) = tracked::largest(axes, tracked::Tracked::largest_force) {
        let way_out = tracked::largest(axes, |axis| axis.way_out);
        let way_out = way_out.filter(|(_, later)| later.abs() > force.abs());
        let words = match way_out {
            None => format!("largest force, {}{of}", axis.force_of()),
            Some((other, later)) => format!(
                "largest force of the running test, {}{of}; {} during shutdown",
                axis.force_of(),
                quantity(later, other.force_unit)
            ),
        };
        tiles.push((quantity(force, axis.force_unit), words));
    }
    tiles
}

/// Which steps a number is of, where they are not all of the test.
fn of_steps(rows: &Digest) -> String {
    let steps = rows.steps().map(|steps| format!(", of {steps}"));
    steps.unwrap_or_default()
}

/// The numbers one looks for first.
pub(super) fn tiles(
    run: &RunView,
    rows: &Digest,
    axes: &[tracked::Tracked<'_>],
    timings: &[Timing],
) -> Markup {
    let mut tiles = extremes(run, rows, axes);
    tiles.extend(storeys(rows));
    tiles.extend(tracking(rows, axes));
    if !run.is_simulated() {
        let mut wakeup = timings.iter().filter(|t| t.percentiles.count > 0);
        let wakeup = wakeup.find(|t| t.key == "wakeup_lateness");
        let wakeup = wakeup.map(|timing| micros(timing.percentiles.p99));
        let misses = run.misses();
        tiles.extend(match (misses, wakeup) {
            (Some(misses), Some(p99)) => Some((
                count(misses),
                format!("deadline misses; wake-up lateness {p99} (p99)"),
            )),
            (Some(misses), None) => Some((count(misses), "deadline misses".to_owned())),
            (None, Some(p99)) => Some((p99, "wake-up lateness, p99".to_owned())),
            (None, None) => None,
        });
    }
    html::tiles(&tiles)
}

/// The largest drift and floor acceleration, where there are storeys.
fn storeys(rows: &Digest) -> Vec<(String, String)> {
    let kinds = [
        (Storey::Drift, "largest drift, storey"),
        (Storey::Floor, "largest absolute acceleration, floor"),
    ];
    let largest = |(kind, words): (Storey, &str)| {
        let columns = (1..).map(|storey| (storey, kind.column(storey)));
        let known = columns.take_while(|(_, name)| rows.get(name).is_some());
        let peaks =
            known.filter_map(|(storey, name)| Some((storey, rows.marks(&name).peak?.value)));
        let (storey, value) = peaks.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        let unit = rows.unit(&kind.column(storey));
        Some((quantity(value, unit), format!("{words} {storey}")))
    };
    kinds.into_iter().filter_map(largest).collect()
}

/// Delay and amplitude error of the axis with the largest, and the largest energy error.
fn tracking(rows: &Digest, axes: &[tracked::Tracked<'_>]) -> Vec<(String, String)> {
    let largest = |value: &dyn Fn(&tracked::Tracked<'_>) -> Option<f64>| {
        let measured = axes.iter().filter(|axis| !axis.is_ideal());
        let found = measured.filter_map(|axis| Some((axis, value(axis)?)));
        found.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    };
    let words = |what: &str, axis: &tracked::Tracked<'_>| {
        let most = if axes.len() > 1 { "largest " } else { "" };
        format!("{most}{what}, {}{}", axis.name, of_steps(rows))
    };
    let delay = largest(&|axis| axis.delay());
    let delay = delay.map(|(axis, delay)| (lag_words(delay), words("delay", axis)));
    let amplitude = largest(&|axis| axis.amplitude_error());
    let amplitude = amplitude.map(|(axis, share)| (percent(share), words("amplitude error", axis)));
    let energy = largest(&|axis| axis.digest.tracking.map(|t| t.energy_error_j.value));
    let energy =
        energy.and_then(|(axis, _)| Some((axis.energy_error()?, words("energy error", axis))));
    [delay, amplitude, energy].into_iter().flatten().collect()
}
