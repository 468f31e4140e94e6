//! How well the specimens followed their targets: three plain figures, histories, and the indices of the literature.

use super::canvas::Ink;
use super::charts::Quantity;
use super::columns::ERROR;
use super::courses::{errors, estimates};
use super::digest::{Digest, NOT_MEASURED};
use super::html::{beside, details, figure, note, table};
use super::indices::table_of;
use super::lines::{Line, LoopChart, TimeChart};
use super::plots::{HALF, WHOLE, history};
use super::response::{amplitudes, curve};
use super::rows::Rows;
use super::specimens::MOST_DRAWN;
use super::text::{NOTHING, number, quantity};
use super::tracked::Tracked;

/// The section on tracking; `effect` is the effect of the errors on the test. `None` without a specimen that moved.
pub(super) fn tracking(rows: &Rows<'_>, axes: &[Tracked<'_>], effect: &str) -> Option<String> {
    if axes.is_empty() || rows.running() == 0 {
        return None;
    }
    let mut markup = figures(rows.digest(), axes);
    let drawn = axes.iter().filter(|axis| axis.digest.is_drawable());
    let (ideal, others): (Vec<_>, Vec<_>) =
        drawn.take(MOST_DRAWN).partition(|axis| axis.is_ideal());
    if !ideal.is_empty() {
        let names: Vec<_> = ideal.iter().map(|axis| axis.name.as_str()).collect();
        markup += &note(&format!(
            "No displacement is measured: the specimen is computed without an actuator, at its target in every sample ({}).",
            names.join(", ")
        ));
    }
    for axis in others {
        if axes.len() > 1 {
            markup += &format!("<h3>{}</h3>\n", super::text::escape(&axis.name));
        }
        markup += &if rows.digest().measures_disp(axis.digest.axis) {
            followed(rows, axis)
        } else {
            of_forces_only(rows, axis)
        };
    }
    Some(rows.section("Tracking", &(markup + effect)))
}

/// Delay, amplitude error and energy error of every axis.
fn figures(digest: &Digest, axes: &[Tracked<'_>]) -> String {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
    let percent = |share: f64| format!("{}\u{a0}%", number(100.0 * share, 3));
    let row = |axis: &Tracked<'_>| {
        if axis.is_ideal() || !digest.measures_disp(axis.digest.axis) {
            let unknown = std::iter::repeat_n(NOT_MEASURED.to_owned(), 4);
            return std::iter::once(axis.name.clone()).chain(unknown).collect();
        }
        let tracking = axis.digest.tracking.as_ref();
        vec![
            axis.name.clone(),
            or_dash(axis.delay().map(lag_words)),
            or_dash(axis.amplitude_error().map(percent)),
            or_dash(axis.energy_error()),
            or_dash(tracking.map(|t| quantity(t.peak_error_m.value, axis.disp_unit))),
        ]
    };
    let rows: Vec<_> = axes.iter().map(row).collect();
    let heading = [
        "",
        "delay",
        "amplitude error",
        "energy error",
        "largest error",
    ];
    table(&heading, &rows)
        + &note(
            "Measured against target. Delay: positive where the measured displacement is behind. Energy error: positive where the \
             actuator adds energy to the test; in brackets, its share of the energy of the test.",
        )
}

/// Pictures of an axis that did not follow exactly.
fn followed(rows: &Rows<'_>, axis: &Tracked<'_>) -> String {
    let digest = axis.digest;
    let column = |kind: &str| rows.history(&digest.axis.column(kind));
    let (target, meas) = (column("target"), column("meas"));
    let target = target
        .iter()
        .map(|of| of.line("target", Ink::Series(0), 1.6));
    let meas = meas
        .iter()
        .map(|of| of.line("measured", Ink::Series(1), 1.0));
    let lines: Vec<_> = target.chain(meas).collect();
    let chart = TimeChart::history("Target and measured", axis.disp("displacement"), &lines);
    let label = axis.label("target and measured displacement over test time");
    let mut markup = history((WHOLE, 200.0), &label, &chart);
    markup += &beside("grid", &(error(rows, axis) + &close_up(axis)));
    if rows.digest().broken().any(|broken| broken == digest.axis) {
        markup += &note(if rows.passed().missing_ticks > 0 {
            "Rows are missing in the record: lag, tracking metrics, frequency content and absorbed energy of this axis are left out. \
             Peaks are those of the rows that are there."
        } else {
            "No row is missing, but the rows are not at even times: lag, tracking metrics and frequency content of this axis are \
             left out."
        });
    }
    let more = table_of(digest, axis)
        + &beside("grid", &(subspace(axis) + &content(axis)))
        + &errors(axis)
        + &estimates(rows, axis);
    markup + &details(&format!("Tracking indices of {}", axis.name), &more)
}

/// One of the lines of an axis.
fn line<'a>(name: &'a str, x: &'a [f64], y: &'a [f64], ink: u8, width: f64) -> Line<'a> {
    Line {
        name,
        x,
        y,
        ink: Ink::Series(ink),
        width,
    }
}

/// Target and measured around the largest target.
fn close_up(axis: &Tracked<'_>) -> String {
    let [time, target, meas] = &axis.digest.close_up;
    let lines = [
        line("target", time, target, 0, 2.2),
        line("measured", time, meas, 1, 1.3),
    ];
    let zoom = TimeChart::history(
        "Around the largest target",
        axis.disp("displacement"),
        &lines,
    );
    let label = axis.label("target and measured around the largest target");
    figure(HALF, 290.0, &label, |canvas, area| zoom.draw(canvas, area))
}

fn subspace(axis: &Tracked<'_>) -> String {
    let (target, meas) = &axis.digest.subspace;
    let chart = LoopChart {
        title: "Synchronisation subspace: measured against target",
        across: axis.disp("target"),
        up: axis.disp("measured"),
        lines: &[line("", target, meas, 2, 1.3)],
    };
    let label = axis.label("measured against target displacement");
    figure(HALF, 300.0, &label, |canvas, area| chart.draw(canvas, area))
}

/// Pictures of an axis whose link answers with forces only. Its record repeats the command as the measured displacement.
fn of_forces_only(rows: &Rows<'_>, axis: &Tracked<'_>) -> String {
    let column = |kind: &str| rows.history(&axis.digest.axis.column(kind));
    let (target, command) = (column("target"), column("meas"));
    let target = target
        .iter()
        .map(|of| of.line("target", Ink::Series(0), 1.6));
    let command = command
        .iter()
        .map(|of| of.line("command", Ink::Series(3), 1.0));
    let lines: Vec<_> = target.chain(command).collect();
    let chart = TimeChart::history("Target and command", axis.disp("displacement"), &lines);
    let label = axis.label("target and command over test time");
    history((WHOLE, 200.0), &label, &chart)
}

/// Measured less target.
fn error(rows: &Rows<'_>, axis: &Tracked<'_>) -> String {
    let error = rows.history(&axis.digest.axis.column(ERROR));
    let lines = error
        .iter()
        .map(|of| of.line("measured − target", Ink::Series(4), 1.1));
    let lines: Vec<_> = lines.collect();
    let up = Quantity {
        words: "error",
        unit: axis.disp_unit,
    };
    let chart = TimeChart::history("Tracking error", up, &lines);
    history(
        (HALF, 280.0),
        &axis.label("tracking error over test time"),
        &chart,
    )
}

/// Frequency content of target, measured and their difference.
fn content(axis: &Tracked<'_>) -> String {
    let names = ["target", "measured", "measured − target"];
    let split: Vec<(&str, Vec<f64>, Vec<f64>)> = names
        .iter()
        .zip(&axis.digest.spectra)
        .map(|(name, points)| {
            let (x, y) = points.iter().copied().unzip();
            (*name, x, y)
        })
        .filter(|(_, x, _): &(_, Vec<f64>, _)| !x.is_empty())
        .collect();
    let curves: Vec<_> = split.iter().map(|(name, x, y)| curve(name, x, y)).collect();
    if curves.is_empty() {
        return String::new();
    }
    let unit = format!("{} s", axis.disp_unit);
    let picture = amplitudes("Frequency content", "Fourier amplitude", &unit, &curves);
    format!("<figure>{}</figure>\n", picture.svg(HALF, 300.0, true))
}

/// A lag in words.
pub(super) fn lag_words(lag: f64) -> String {
    // A nanosecond is far below the resolution of a parabola through samples.
    if lag.abs() < 1e-9 {
        "0\u{a0}s".to_owned()
    } else {
        quantity(lag, "s")
    }
}
