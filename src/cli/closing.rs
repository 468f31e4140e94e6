//! The closing summary of `run`: verdict, peaks, tracking, timing and files, in at most 20 lines.

use super::table::{Table, misses};
use gusset_motion::metrics::Tracking;
use gusset_proof::RecordedVerdict;
use gusset_quantity::units::{duration, number, quantity};
use gusset_record::rt::timing::Quantity;
use gusset_record::{Run, Summary};
use gusset_session::{self as session, Finished, Page, integration};
use gusset_setup::Facts;
use gusset_view::report::told;

/// Specimens or axes with their own row. The others are counted.
const MOST_ROWS: usize = 2;

/// Adds a row, in one line.
fn row(table: &mut Table, name: &str, text: &str) {
    let words: Vec<&str> = text.split_whitespace().collect();
    table.row(name, &words.join(" "));
}

/// Adds the first of these rows, and the number of the others.
fn first_rows(table: &mut Table, rows: impl ExactSizeIterator<Item = (String, String)>) {
    let others = rows.len().saturating_sub(MOST_ROWS);
    for (place, (name, mut text)) in rows.enumerate().take(MOST_ROWS) {
        if others > 0 && place + 1 == MOST_ROWS {
            text.push_str(&format!("; {others} more in the report"));
        }
        row(table, &name, &text);
    }
}

/// The closing summary of a test in at most 20 lines.
pub(super) fn closing(facts: &Facts, finished: &Finished, page: Option<&Page>) -> Table {
    let title = format!("{} — {}", facts.title, finished.cause.heading());
    let mut table = Table::new(&title);
    verdict(&mut table, facts, finished);
    peaks(&mut table, facts, finished);
    tracking(&mut table, &finished.summary, page);
    timing(&mut table, finished);
    files(&mut table, finished, page);
    table
}

fn verdict(table: &mut Table, facts: &Facts, finished: &Finished) {
    let summary = &finished.summary;
    if let Some(verdict) = &summary.verdict {
        row(table, "verdict", &in_words(verdict));
        if let Some(errors) = &verdict.errors {
            for (name, error) in errors.each() {
                row(table, &format!("error, {name}"), &error.words());
            }
            if let Some(text) = errors.of_modes().filter(|_| errors.take_damping()) {
                row(table, "damping", &text);
            }
        }
    }
    row(table, "ended", &summary.reason);
    let after = facts.resumed.as_ref().map(|(_, step)| *step);
    let clock = if finished.granted.is_some() {
        "real"
    } else {
        "simulated"
    };
    let text = format!(
        "{} in {} of wall time ({clock} clock, {} Hz)",
        tested(summary.steps, after, summary.dt),
        duration(summary.wall_seconds),
        number(summary.rate_hz)
    );
    row(table, "test", &text);
    if let Some(structure) = &facts.structure {
        row(table, "integrator", &integration::in_words(structure));
    }
}

/// The verdict on the stability of the test in one sentence.
fn in_words(verdict: &RecordedVerdict) -> String {
    if let Some(headline) = verdict.headline() {
        return headline;
    }
    match verdict.findings.as_slice() {
        [] => "no findings".to_owned(),
        [only] => format!("{}: {}", only.severity, only.text),
        [first, rest @ ..] => {
            let more = rest.len();
            format!("{}: {} (and {more} more)", first.severity, first.text)
        }
    }
}

/// Steps of this test and the test time that they took. `after` is the last step of the test that it continues.
fn tested(steps: u64, after: Option<u64>, dt: f64) -> String {
    let own = steps.saturating_sub(after.unwrap_or(0));
    let which = match after {
        Some(after) if own > 0 => format!("steps {} to {steps}", after + 1),
        Some(after) => format!("no step after step {after}, each"),
        None => format!("{steps} steps"),
    };
    format!("{which} of {}: {}", duration(dt), duration(own as f64 * dt))
}

/// The largest known value and its number from 1.
fn largest(values: impl Iterator<Item = Option<f64>>) -> Option<(usize, f64)> {
    let numbered = (1..).zip(values);
    let known = numbered.filter_map(|(number, value)| Some((number, value?)));
    known.max_by(|a, b| a.1.total_cmp(&b.1))
}

fn peaks(table: &mut Table, facts: &Facts, finished: &Finished) {
    let summary = &finished.summary;
    let floors = Run::open(finished.folder.path())
        .ok()
        .and_then(|run| session::floor_peaks(&run).ok());
    let accel = floors.and_then(|floors| floors.accel);
    let structure = facts.structure.as_ref();
    let place = |dof: usize| match structure {
        Some(structure) => structure.dof(dof - 1),
        None => format!("DOF {dof}"),
    };
    if let Some((storey, drift)) = floors.and_then(|floors| floors.drift) {
        let text = format!("{} in storey {storey}", quantity(drift, "m"));
        row(table, "peak storey drift", &text);
    }
    if let Some((dof, accel)) = accel {
        let text = format!("{} at {}, absolute", quantity(accel, "m/s²"), place(dof));
        row(table, "peak acceleration", &text);
    }
    let ground = structure.and_then(|structure| structure.peak_ground_accel);
    let against = match ground {
        Some(peak) if peak > 0.0 => ", relative to the ground",
        _ => "",
    };
    let rotations = structure.map_or(&[][..], |structure| &structure.rotations);
    let peak = &summary.peak;
    let relative = if accel.is_none() {
        &peak.acceleration[..]
    } else {
        &[]
    };
    for (is_rotation, name, unit, values) in [
        (false, "peak displacement", "m", &peak.displacement[..]),
        (false, "peak acceleration", "m/s²", relative),
        (true, "peak rotation", "rad", &peak.displacement[..]),
    ] {
        let of_kind = values.iter().enumerate();
        let of_kind =
            of_kind.map(|(dof, value)| value.filter(|_| rotations.contains(&dof) == is_rotation));
        if let Some((dof, value)) = largest(of_kind) {
            let against = if is_rotation { "" } else { against };
            let text = format!("{} at {}{against}", quantity(value, unit), place(dof));
            row(table, name, &text);
        }
    }
    forces(table, facts, summary);
}

/// The peak force of each specimen, the largest ones first.
fn forces(table: &mut Table, facts: &Facts, summary: &Summary) {
    let mut found = Vec::new();
    for (name, forces) in &summary.peak.force {
        // Without a step, the largest force is one of the startup.
        let before = summary.force_on_the_way_in.get(name);
        let before = before.filter(|_| summary.steps == 0);
        let each = [Some(forces), before].into_iter().flatten();
        let each = each.filter_map(|forces| largest(forces.iter().copied()));
        let Some((axis, value)) = each.max_by(|a, b| a.1.total_cmp(&b.1)) else {
            continue;
        };
        let when = match before {
            Some(_) => "peak force before the first step",
            None => "peak force",
        };
        let axis = match forces.len() {
            1 => String::new(),
            _ => format!(" on axis {axis}"),
        };
        let scale = if facts.scaled.contains(name) {
            " as the structure sees it"
        } else {
            ""
        };
        let text = format!("{}{axis}{scale}", quantity(value, "N"));
        found.push((value, format!("{when}, {name}"), text));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let rows = found.into_iter().map(|(_, name, text)| (name, text));
    first_rows(table, rows);
}

/// How an axis followed its target, in words.
fn tracked(axis: &Tracking) -> String {
    if axis.peak_error_m.value == 0.0 {
        return "not measured: computed without an actuator".to_owned();
    }
    let percent = |share: f64| format!("{} %", number(100.0 * share));
    let share = axis.energy_error_share;
    let share = share.map_or_else(String::new, |share| format!(" ({})", percent(share.value)));
    let energy = quantity(axis.energy_error_j.value, "J");
    let largest = quantity(axis.peak_error_m.value, "m");
    let parts = [
        axis.delay_s
            .map(|delay| format!("delay {}", duration(delay.value))),
        Some(format!(
            "amplitude error {}",
            percent(axis.amplitude_error.value)
        )),
        Some(format!("energy error {energy}{share}")),
        Some(format!("largest error {largest}")),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

fn tracking(table: &mut Table, summary: &Summary, page: Option<&Page>) {
    let mut axes = Vec::new();
    for (specimen, of_specimen) in summary.metrics.iter().flat_map(|metrics| &metrics.0) {
        let one = of_specimen.len() == 1;
        for (number, axis) in (1..).zip(of_specimen) {
            let Some(axis) = axis else { continue };
            let name = match one {
                true => specimen.clone(),
                false => format!("{specimen} axis {number}"),
            };
            axes.push((axis.nrmse.value, name, tracked(axis)));
        }
    }
    // Those that followed worst.
    axes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let axes = axes.into_iter();
    first_rows(
        table,
        axes.map(|(_, name, text)| (format!("tracking, {name}"), text)),
    );
    let missing = summary.metrics_missing.iter();
    first_rows(
        table,
        missing.map(|text| ("not known".to_owned(), text.clone())),
    );
    let identified = page.map_or(&[][..], |page| &page.identified);
    first_rows(
        table,
        identified.iter().map(|axis| {
            let unknown = || "unknown".to_owned();
            let stiffness = axis.stiffness.as_ref();
            let text = format!(
                "stiffness {}, lag {}",
                stiffness.map_or_else(unknown, |k| told(k, |k| quantity(k, "N/m"))),
                axis.lag.map_or_else(unknown, duration)
            );
            (format!("identified, {}", axis.name), text)
        }),
    );
}

fn timing(table: &mut Table, finished: &Finished) {
    let Some(granted) = &finished.granted else {
        return;
    };
    let summary = &finished.summary;
    let quantity = Quantity::WakeupLateness;
    let timing = summary.timing.as_ref();
    let found = timing.map(|timing| timing.percentiles(quantity));
    if let Some(found) = found.filter(|found| found.count > 0) {
        let [p50, p99, p999, max] =
            [found.p50, found.p99, found.p99_9, found.max].map(|us| duration(1e-6 * us));
        let text = format!("p50 {p50}, p99 {p99}, p99.9 {p999}, max {max}");
        row(table, &quantity.key().replace('_', " "), &text);
    }
    row(table, "deadline misses", &misses(summary));
    match session::missing(granted).as_slice() {
        [] => {}
        [one] => row(table, "not granted", one),
        several => {
            let text = format!(
                "{} real-time conditions; see `gusset doctor`",
                several.len()
            );
            row(table, "not granted", &text);
        }
    }
}

fn files(table: &mut Table, finished: &Finished, page: Option<&Page>) {
    if finished.summary.rows_lost > 0 {
        row(table, "ROWS LOST", &finished.summary.rows_lost.to_string());
    }
    if let Some(page) = page {
        row(table, "report", &page.path.display().to_string());
    }
    let data = finished.folder.path().display();
    if finished.folder.is_there() {
        row(table, "data", &data.to_string());
    } else {
        row(table, "DATA LOST", &format!("{data} was deleted"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resume_claims_only_steps_made_there() {
        let dt = 1.0 / 256.0;
        assert_eq!(tested(5120, None, dt), "5120 steps of 3.906 ms: 20 s");
        let own = "steps 1870 to 5120 of 3.906 ms: 12.699 s";
        assert_eq!(tested(5120, Some(1869), dt), own);
        assert_eq!(
            tested(7, Some(7), dt),
            "no step after step 7, each of 3.906 ms: 0 s"
        );
    }
}
