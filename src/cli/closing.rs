//! The closing summary of `run`: verdict, peaks, tracking, timing and files, in at most 20 lines or in full.

use super::table::{Table, misses};
use gusset_config::word;
use gusset_motion::metrics::Tracking;
use gusset_proof::RecordedVerdict;
use gusset_quantity::units::{duration, number, quantity};
use gusset_record::rt::timing::Quantity;
use gusset_record::{Run, Summary};
use gusset_session::{self as session, Finished, Page, integration};
use gusset_setup::{Facts, StructureFacts};
use gusset_view::report::told;

/// Specimens or axes with their own row in the short form. The others have one row together.
const MOST_ROWS: usize = 2;

/// One row: its name and its text. The short form leaves out rows that are not `short`.
struct Row {
    name: String,
    text: String,
    short: bool,
}

/// A section of the summary with its rows.
struct Section(&'static str, Vec<Row>);

impl Section {
    fn short(&mut self, name: &str, text: impl Into<String>) {
        self.add(name, text, true);
    }

    /// The short form has the first of these rows, and the number of the others.
    fn add_all(&mut self, rows: impl ExactSizeIterator<Item = (String, String)>) {
        let others = rows.len().saturating_sub(MOST_ROWS);
        for (place, (name, mut text)) in rows.enumerate() {
            if others > 0 && place + 1 == MOST_ROWS {
                text.push_str(&format!("; {others} more with `--status full`"));
            }
            self.add(&name, text, place < MOST_ROWS);
        }
    }

    fn add(&mut self, name: &str, text: impl Into<String>, short: bool) {
        self.1.push(Row {
            name: name.to_owned(),
            text: text.into(),
            short,
        });
    }
}

/// The closing summary of a test, in full or in at most 20 lines.
pub(super) fn closing(
    facts: &Facts,
    finished: &Finished,
    page: Option<&Page>,
    in_full: bool,
) -> Table {
    let title = format!("{} — {}", facts.title, finished.cause.heading());
    let mut table = Table::new(&title);
    let sections = [
        verdict(facts, finished),
        peaks(facts, finished),
        tracking(&finished.summary, page),
        timing(finished),
        files(finished, page),
    ];
    for Section(heading, rows) in sections {
        if in_full && !rows.is_empty() {
            table.line(heading);
        }
        for row in rows.into_iter().filter(|row| in_full || row.short) {
            let text = if in_full {
                row.text
            } else {
                in_one_line(&row.text)
            };
            table.row(&row.name, &text);
        }
    }
    table
}

/// A text in one line.
fn in_one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn verdict(facts: &Facts, finished: &Finished) -> Section {
    let summary = &finished.summary;
    let mut section = Section("Verdict", Vec::new());
    if let Some(verdict) = &summary.verdict {
        section.short("verdict", in_words(verdict));
        for finding in &verdict.findings {
            section.add(&finding.severity, finding.text.clone(), false);
        }
    }
    if let Some(errors) = summary
        .verdict
        .as_ref()
        .and_then(|verdict| verdict.errors.as_ref())
    {
        for (name, error) in errors.each() {
            section.short(&format!("error, {name}"), error.words());
        }
        if let Some(text) = errors.of_modes() {
            section.add("damping", text, errors.take_damping());
        }
    }
    section.short("ended", summary.reason.clone());
    let after = facts.resumed.as_ref().map(|(_, step)| *step);
    let clock = if finished.granted.is_some() {
        "real"
    } else {
        "simulated"
    };
    section.short(
        "test",
        format!(
            "{} in {} of wall time ({clock} clock, {} Hz)",
            tested(summary.steps, after, summary.dt),
            duration(summary.wall_seconds),
            number(summary.rate_hz)
        ),
    );
    if let Some(structure) = &facts.structure {
        let (name, text) = method(structure);
        section.short(name, text);
    }
    section
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

fn method(structure: &StructureFacts) -> (&'static str, String) {
    let limit = integration::brief(structure);
    match structure.lambda {
        None => {
            let name = word(&structure.method);
            ("method", format!("{name} ({limit})"))
        }
        Some(lambda) => {
            let how = if structure.lambda_by_number {
                "by number"
            } else {
                "automatic"
            };
            ("lambda", format!("{lambda} ({how}; {limit})"))
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

fn peaks(facts: &Facts, finished: &Finished) -> Section {
    let summary = &finished.summary;
    let mut section = Section("Peaks", Vec::new());
    let floors = Run::open(finished.folder.path())
        .ok()
        .and_then(|run| session::floor_peaks(&run).ok());
    let accel = floors.and_then(|floors| floors.accel);
    if let Some((storey, drift)) = floors.and_then(|floors| floors.drift) {
        let text = format!("{} in storey {storey}", quantity(drift, "m"));
        section.short("peak storey drift", text);
    }
    if let Some((dof, accel)) = accel {
        let text = format!("{} at DOF {dof}, absolute", quantity(accel, "m/s²"));
        section.short("peak acceleration", text);
    }
    let structure = facts.structure.as_ref();
    let ground = structure.and_then(|structure| structure.peak_ground_accel);
    let against = match ground {
        Some(peak) if peak > 0.0 => ", relative to the ground",
        _ => "",
    };
    let rotations = structure.map_or(&[][..], |structure| &structure.rotations);
    let peak = &summary.peak;
    for (is_rotation, name, unit, values, short) in [
        (false, "peak displacement", "m", &peak.displacement, true),
        (false, "peak velocity", "m/s", &peak.velocity, false),
        (
            false,
            if accel.is_some() {
                "relative acceleration"
            } else {
                "peak acceleration"
            },
            "m/s²",
            &peak.acceleration,
            accel.is_none(),
        ),
        (true, "peak rotation", "rad", &peak.displacement, true),
        (
            true,
            "peak angular velocity",
            "rad/s",
            &peak.velocity,
            false,
        ),
        (
            true,
            "peak angular accel.",
            "rad/s²",
            &peak.acceleration,
            false,
        ),
    ] {
        let of_kind = values.iter().enumerate();
        let of_kind =
            of_kind.map(|(dof, value)| value.filter(|_| rotations.contains(&dof) == is_rotation));
        if let Some((dof, value)) = largest(of_kind) {
            let against = if is_rotation { "" } else { against };
            let text = format!("{} at DOF {dof}{against}", quantity(value, unit));
            section.add(name, text, short);
        }
    }
    forces(&mut section, facts, summary);
    section
}

/// The peak force of each specimen. The short form has the largest ones.
fn forces(section: &mut Section, facts: &Facts, summary: &Summary) {
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
    section.add_all(found.into_iter().map(|(_, name, text)| (name, text)));
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

fn tracking(summary: &Summary, page: Option<&Page>) -> Section {
    let mut section = Section("Tracking", Vec::new());
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
    // The short form has the axes that followed worst.
    axes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let axes = axes.into_iter();
    section.add_all(axes.map(|(_, name, text)| (format!("tracking, {name}"), text)));
    let missing = summary.metrics_missing.iter();
    section.add_all(missing.map(|text| ("not known".to_owned(), text.clone())));
    for (place, axis) in page.iter().flat_map(|page| &page.identified).enumerate() {
        let unknown = || "unknown".to_owned();
        let stiffness = axis.stiffness.as_ref();
        let text = format!(
            "stiffness {}, lag {}",
            stiffness.map_or_else(unknown, |k| told(k, |k| quantity(k, "N/m"))),
            axis.lag.map_or_else(unknown, duration)
        );
        section.add(
            &format!("identified, {}", axis.name),
            text,
            place < MOST_ROWS,
        );
    }
    section
}

fn timing(finished: &Finished) -> Section {
    let mut section = Section("Timing", Vec::new());
    let Some(granted) = &finished.granted else {
        return section;
    };
    let summary = &finished.summary;
    for quantity in Quantity::ALL {
        let timing = summary.timing.as_ref();
        let found = timing.map(|timing| timing.percentiles(quantity));
        let Some(found) = found.filter(|found| found.count > 0) else {
            continue;
        };
        let [p50, p99, p999, max] =
            [found.p50, found.p99, found.p99_9, found.max].map(|us| duration(1e-6 * us));
        let text = format!("p50 {p50}, p99 {p99}, p99.9 {p999}, max {max}");
        let name = quantity.key().replace('_', " ");
        section.add(&name, text, quantity == Quantity::WakeupLateness);
    }
    section.short("deadline misses", misses(summary));
    let missing = session::missing(granted);
    for text in &missing {
        section.add("not granted", text.clone(), missing.len() == 1);
    }
    if missing.len() > 1 {
        let text = format!(
            "{} real-time conditions; see `gusset doctor`",
            missing.len()
        );
        section.short("not granted", text);
    }
    section
}

fn files(finished: &Finished, page: Option<&Page>) -> Section {
    let mut section = Section("Files", Vec::new());
    if finished.summary.rows_lost > 0 {
        section.short("ROWS LOST", finished.summary.rows_lost.to_string());
    }
    if let Some(page) = page {
        section.short("report", page.path.display().to_string());
    }
    let data = finished.folder.path().display();
    if finished.folder.is_there() {
        section.short("data", data.to_string());
    } else {
        section.short("DATA LOST", format!("{data} was deleted"));
    }
    section
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
