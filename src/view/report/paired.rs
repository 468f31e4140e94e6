//! Key figures, tracking and timing of two runs side by side.

use super::RunView;
use super::following::lag_words;
use super::histogram::{self, words};
use super::html::{details, note, paragraph, section, table, tiles};
use super::matched::{Apart, Matched};
use super::response;
use super::rows::Rows;
use super::text::{NOTHING, count, micros, number, quantity};
use super::tracked::{self, Tracked};
use gusset_motion::metrics::Judged;
use gusset_quantity::catalog::column::{DISP, FORCE, Kind};

/// A heading and the value of each run.
type Row = Vec<String>;

fn percent(share: f64) -> String {
    format!("{}\u{a0}%", number(100.0 * share, 3))
}

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| NOTHING.to_owned())
}

fn row(what: impl Into<String>, first: Option<String>, second: Option<String>) -> Row {
    vec![what.into(), or_dash(first), or_dash(second)]
}

/// A row, unless neither run has a value.
fn known(what: &str, first: Option<String>, second: Option<String>) -> Option<Row> {
    (first.is_some() || second.is_some()).then(|| row(what, first, second))
}

/// Largest differences of displacement and force, and the largest values of both runs.
pub(super) fn key_figures(
    runs: (&RunView, &RunView),
    rows: (&Rows<'_>, &Rows<'_>),
    matched: &Result<Matched, String>,
) -> String {
    let mut shown = matched.as_ref().map_or_else(|_| Vec::new(), differences);
    let both = |a: Option<String>, b: Option<String>| {
        let (a, b) = (or_dash(a), or_dash(b));
        (a != NOTHING || b != NOTHING).then(|| format!("{a} | {b}"))
    };
    let peak = |run: &RunView, rows: &Rows<'_>| {
        let peak = response::largest_displacement(run, rows);
        peak.map(|(_, value, unit)| quantity(value.abs(), unit))
    };
    let force = |run: &RunView, rows: &Rows<'_>| {
        let axes = tracked::tracking(run, rows);
        let largest = tracked::largest(&axes, Tracked::largest_force);
        largest.map(|(_, (force, unit))| quantity(force.abs(), unit))
    };
    let misses = |run: &RunView| {
        let misses = run.progress().deadline_misses.filter(|_| !run.is_served());
        misses.filter(|_| !run.is_simulated()).map(count)
    };
    for (words, first, second) in [
        (
            "largest displacement, first | second",
            peak(runs.0, rows.0),
            peak(runs.1, rows.1),
        ),
        (
            "largest force, first | second",
            force(runs.0, rows.0),
            force(runs.1, rows.1),
        ),
        (
            "deadline misses, first | second",
            misses(runs.0),
            misses(runs.1),
        ),
    ] {
        shown.extend(both(first, second).map(|value| (value, words.to_owned())));
    }
    tiles(&shown)
}

/// The largest differences of displacement and force, and the number of rows they are of.
fn differences(matched: &Matched) -> Vec<(String, String)> {
    let largest = |kind: &Kind, words: &str| {
        let of_kind = |apart: &&Apart| kind.fits(&apart.column.name);
        let all = matched.apart.iter().filter(of_kind);
        let apart = all.max_by(|a, b| a.largest.total_cmp(&b.largest))?;
        let share = if apart.first.is_none() {
            ": none".to_owned()
        } else if apart.size > 0.0 {
            let share = percent(apart.largest / apart.size);
            format!(", {}: {share} of the largest value", apart.column.name)
        } else {
            format!(", {}", apart.column.name)
        };
        Some((
            quantity(apart.largest, &apart.column.unit),
            format!("largest difference of {words}{share}"),
        ))
    };
    let mut shown = Vec::new();
    if matched.rows > 0 {
        shown.extend(largest(&DISP, "displacement"));
        shown.extend(largest(&FORCE, "force"));
    }
    let columns = matched.columns;
    shown.push((
        count(matched.rows),
        format!("rows compared, {columns} columns each"),
    ));
    shown
}

/// Delay, amplitude error and energy error of the axes that both runs have; further indices are folded.
pub(super) fn tracking(first: &RunView, second: &RunView, a: &Rows<'_>, b: &Rows<'_>) -> String {
    let (firsts, seconds) = (tracked::tracking(first, a), tracked::tracking(second, b));
    let (mut plain, mut more) = (Vec::new(), Vec::new());
    for one in &firsts {
        let mut others = seconds.iter();
        let Some(other) = others.find(|other| other.digest.axis == one.digest.axis) else {
            continue;
        };
        plain.extend(figures(one, other));
        more.extend(indices(one, other));
    }
    if plain.is_empty() {
        return String::new();
    }
    let heading = ["", "first", "second"];
    let folded = if more.is_empty() {
        String::new()
    } else {
        let defined = "`gusset guide mathematics-errors` defines the indices.";
        details(
            "Tracking indices",
            &(table(&heading, &more) + &note(defined)),
        )
    };
    let says = "Measured against target. Delay: positive where the measured displacement is behind. Energy error: positive where \
        the actuator adds energy to the test.";
    section(
        "Tracking",
        &(table(&heading, &plain) + &note(says) + &folded),
    )
}

fn figures(one: &Tracked<'_>, other: &Tracked<'_>) -> Vec<Row> {
    let named = |what: &str| format!("{}: {what}", one.name);
    let energy = |axis: &Tracked<'_>| {
        let tracking = axis.digest.tracking.as_ref()?;
        let share = tracking
            .energy_error_share
            .map(|share| format!(" ({})", percent(share.value)));
        let error = quantity(tracking.energy_error_j.value, axis.work_unit());
        Some(error + &share.unwrap_or_default())
    };
    let largest = |axis: &Tracked<'_>| {
        let tracking = axis.digest.tracking.as_ref()?;
        Some(quantity(tracking.peak_error_m.value, axis.disp_unit))
    };
    let delay = |axis: &Tracked<'_>| axis.delay().map(lag_words);
    let amplitude = |axis: &Tracked<'_>| axis.amplitude_error().map(percent);
    [
        known(&named("delay"), delay(one), delay(other)),
        known(&named("amplitude error"), amplitude(one), amplitude(other)),
        known(&named("energy error"), energy(one), energy(other)),
        known(&named("largest error"), largest(one), largest(other)),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn indices(one: &Tracked<'_>, other: &Tracked<'_>) -> Vec<Row> {
    let (Some(t), Some(u)) = (&one.digest.tracking, &other.digest.tracking) else {
        return Vec::new();
    };
    let show = |judged: Option<Judged>, write: &dyn Fn(f64) -> String| {
        judged.map(|judged| match judged.corrected {
            Some(corrected) => format!("{} (corrected {})", write(judged.value), write(corrected)),
            None => write(judged.value),
        })
    };
    let mut rows = Vec::new();
    let mut push =
        |what: &str, a: Option<Judged>, b: Option<Judged>, write: &dyn Fn(f64) -> String| {
            let what = format!("{}: {what}", one.name);
            rows.extend(known(&what, show(a, write), show(b, write)));
        };
    let plain = |v: f64| number(v, 4);
    push(
        "NRMSE, by the root mean square of the target",
        Some(t.nrmse),
        Some(u.nrmse),
        &percent,
    );
    push(
        "delay by cross-correlation",
        t.delay_s,
        u.delay_s,
        &lag_words,
    );
    push(
        "FEI amplitude",
        t.fei.map(|f| f.amplitude),
        u.fei.map(|f| f.amplitude),
        &plain,
    );
    push(
        "FEI delay",
        t.fei.map(|f| f.delay_s),
        u.fei.map(|f| f.delay_s),
        &lag_words,
    );
    rows
}

/// Deadline misses and percentiles of both runs.
pub(super) fn timing(first: &RunView, second: &RunView) -> String {
    let heading = "Timing";
    if first.is_simulated() && second.is_simulated() {
        let says =
            "No timing: both runs used the simulated clock, on which no deadline can be missed.";
        return section(heading, &paragraph(says));
    }
    let timings = [first, second].map(|run| {
        let is_real = !run.is_simulated();
        histogram::read(run.timings())
            .into_iter()
            .filter(|timing| is_real && timing.percentiles.count > 0)
            .collect::<Vec<_>>()
    });
    let misses = |run: &RunView| {
        let misses = run.progress().deadline_misses.filter(|_| !run.is_served());
        misses.filter(|_| !run.is_simulated()).map(count)
    };
    let mut rows: Vec<Row> = known("deadline misses", misses(first), misses(second))
        .into_iter()
        .collect();
    let mut keys: Vec<&str> = Vec::new();
    for timing in timings.iter().flatten() {
        if timing.key != "miss" && !keys.contains(&timing.key.as_str()) {
            keys.push(&timing.key);
        }
    }
    for key in keys {
        let [a, b] = [0, 1].map(|run: usize| {
            let timing = timings[run].iter().find(|timing| timing.key == key);
            timing.map(|timing| timing.percentiles)
        });
        let name = words(key).0;
        rows.extend(known(
            &format!("{name}, p99"),
            a.map(|a| micros(a.p99)),
            b.map(|b| micros(b.p99)),
        ));
        rows.extend(known(
            &format!("{name}, largest"),
            a.map(|a| micros(a.max)),
            b.map(|b| micros(b.max)),
        ));
    }
    if rows.is_empty() {
        return section(
            heading,
            &paragraph("No timing was recorded for these runs."),
        );
    }
    section(heading, &table(&["", "first", "second"], &rows))
}
