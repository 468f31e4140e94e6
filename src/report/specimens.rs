//! Sections on the measured side: hysteresis, and how well the specimen followed its target.

use serde_json::Value;

use super::RunData;
use super::canvas::Ink;
use super::charts::Quantity;
use super::columns::ERROR;
use super::courses::{errors, estimates};
use super::digest::WITHOUT_DISP;
use super::html::{beside, figure, note, paragraph, table};
use super::judged::{legend, table_of};
use super::lines::{Line, LoopChart, TimeChart};
use super::outcome;
use super::plots::history;
use super::response::{amplitudes, curve};
use super::rows::Rows;
use super::tested::{configuration, specimen_name};
use super::text::{NOTHING, count, number, quantity};
use super::tracked::Tracked;

/// Axes that are drawn; a table lists more.
const MOST_DRAWN: usize = 8;

/// The section on specimens; none if there are none.
pub(super) fn specimens(run: &RunData, rows: &Rows<'_>, axes: &[Tracked<'_>]) -> Option<String> {
    if axes.is_empty() {
        return None;
    }
    let heading = "Specimens";
    if rows.running() == 0 {
        return Some(rows.section(
            heading,
            &paragraph(
                "No row was recorded while the test was running, so there is no measurement to show.",
            ),
        ));
    }
    let time = rows.tick_time();
    let mut markup = unanswered(run, rows);
    for axis in axes.iter().take(MOST_DRAWN) {
        markup += &drawn(rows, &time, axis);
    }
    let all = rows.axes().len();
    if all > MOST_DRAWN {
        markup += &note(&format!(
            "The pictures show {MOST_DRAWN} of {all} axes; the samples hold them all."
        ));
    }
    Some(rows.section(heading, &(markup + &listed(axes) + &traffic(run))))
}

/// Which specimens did not answer in every tick, and what that means for the section; nothing where all did.
fn unanswered(run: &RunData, rows: &Rows<'_>) -> String {
    let digest = rows.digest();
    if digest.stale.is_empty() {
        return String::new();
    }
    let configuration = configuration(run);
    let told = digest.stale.iter().map(|(specimen, ticks)| {
        let name = specimen_name(configuration.as_ref(), *specimen);
        format!("{name} {} of {}", count(*ticks), count(digest.passed.ticks))
    });
    note(&format!(
        "Samples that are estimates, because no reply came: {}. The loop used the last reply, or extrapolated along the tangent. \
         Curves, peaks, lag, tracking metrics, stiffness and damping leave these samples out; absorbed energy is interpolated. \
         Equilibrium, the energy balance and the energy added by the transfer system use the values of the loop. Forces that \
         arrived later are among the events (recovered), and in no peak.",
        told.collect::<Vec<_>>().join(", ")
    ))
}

fn drawn(rows: &Rows<'_>, time: &[f64], axis: &Tracked<'_>) -> String {
    let mut markup = format!("<h3>{}</h3>\n", super::text::escape(&axis.name));
    if let Some(scale) = axis.scale {
        markup += &note(&format!(
            "All of it as the structure sees it: {}.",
            scale.words()
        ));
    }
    let digest = axis.digest;
    if !digest.is_drawable() {
        return markup + &paragraph("Nothing was measured on this axis.");
    }
    if !rows.digest().measures_disp(digest.axis) {
        return markup + &of_forces_only(rows, time, axis);
    }
    let column = |kind: &str| rows.get(&digest.axis.column(kind)).unwrap_or_default();
    let subspace = LoopChart {
        title: "Synchronisation subspace: measured against target",
        across: axis.disp("target"),
        up: axis.disp("measured"),
        lines: &[line("", &digest.subspace.0, &digest.subspace.1, 2, 1.3)],
    };
    let figures = hysteresis(axis, "measured displacement")
        + &figure(
            500.0,
            400.0,
            &axis.label("measured against target displacement"),
            |canvas, area| subspace.draw(canvas, area),
        );
    markup += &beside("pair", &figures);
    let (target, meas) = (column("target"), column("meas"));
    let lines = [
        line("target", time, &target, 0, 1.6),
        line("measured", time, &meas, 1, 1.0),
    ];
    markup += &history(
        240.0,
        &axis.label("target and measured displacement over test time"),
        &TimeChart::history("Target and measured", axis.disp("displacement"), &lines),
    );
    markup += &error(rows, time, axis);
    let [near_time, near_target, near_meas] = &digest.close_up;
    let lines = [
        line("target", near_time, near_target, 0, 2.2),
        line("measured", near_time, near_meas, 1, 1.3),
    ];
    let zoom = TimeChart::history(
        "Around the largest target",
        axis.disp("displacement"),
        &lines,
    );
    let figures = figure(
        510.0,
        290.0,
        &axis.label("target and measured around the largest target"),
        |canvas, area| zoom.draw(canvas, area),
    ) + &content(axis);
    markup += &beside("pair", &figures);
    markup += &errors(axis);
    markup += &estimates(rows, time, axis);
    if rows.digest().broken().any(|broken| broken == digest.axis) {
        markup += &note(if rows.passed().missing_ticks > 0 {
            "Rows are missing in the record: lag, tracking metrics, frequency content and absorbed energy of this axis are left out. \
             Peaks are those of the rows that are there."
        } else {
            "No row is missing, but the rows are not at even times: lag, tracking metrics and frequency content of this axis are \
             left out."
        });
    }
    markup + &table_of(&axis.name, digest, axis.disp_unit, axis.force_unit)
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

/// The loop of force over a displacement, which is `across` in words.
fn hysteresis(axis: &Tracked<'_>, across: &str) -> String {
    let (disp, force) = &axis.digest.hysteresis;
    let chart = LoopChart {
        title: &format!("Force against {across}"),
        across: axis.disp(across),
        up: Quantity {
            words: "force",
            unit: axis.force_unit,
        },
        lines: &[line("", disp, force, 1, 1.3)],
    };
    let label = axis.label(&format!("force against {across}"));
    figure(500.0, 400.0, &label, |canvas, area| {
        chart.draw(canvas, area)
    })
}

/// Pictures of an axis whose link answers with forces only. Its record repeats the command as the measured displacement.
fn of_forces_only(rows: &Rows<'_>, time: &[f64], axis: &Tracked<'_>) -> String {
    let column = |kind: &str| rows.get(&axis.digest.axis.column(kind)).unwrap_or_default();
    let (target, command) = (column("target"), column("meas"));
    let lines = [
        line("target", time, &target, 0, 1.6),
        line("command", time, &command, 3, 1.0),
    ];
    let chart = TimeChart::history("Target and command", axis.disp("displacement"), &lines);
    note(&format!(
        "Of this axis {WITHOUT_DISP}: how it followed is not known. Lag, tracking metrics, stiffness, damping and absorbed energy are \
         left out."
    )) + &beside("pair", &hysteresis(axis, "command"))
        + &history(
            240.0,
            &axis.label("target and command over test time"),
            &chart,
        )
}

/// Measured less target.
fn error(rows: &Rows<'_>, time: &[f64], axis: &Tracked<'_>) -> String {
    let error = rows
        .get(&axis.digest.axis.column(ERROR))
        .unwrap_or_default();
    if crate::metrics::peak(&error).is_some_and(|peak| peak.value == 0.0) {
        return note("No tracking error: the measured displacement is the target to the last bit.");
    }
    let lines = [Line {
        name: "measured − target",
        x: time,
        y: &error,
        ink: Ink::Series(4),
        width: 1.1,
    }];
    let chart = TimeChart::history(
        "Tracking error: measured − target",
        Quantity {
            words: "error",
            unit: axis.disp_unit,
        },
        &lines,
    );
    history(180.0, &axis.label("tracking error over test time"), &chart)
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
    format!("<figure>{}</figure>\n", picture.svg(510.0, 290.0, true))
}

fn listed(axes: &[Tracked<'_>]) -> String {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
    let force = |found: Option<(f64, &str)>| or_dash(found.map(|(f, unit)| quantity(f, unit)));
    let has_way_out = axes.iter().any(|axis| axis.way_out.is_some());
    let row = |axis: &Tracked<'_>| {
        let work = if axis.disp_unit.starts_with("rad") {
            "N m"
        } else {
            "J"
        };
        let digest = axis.digest;
        let tracking = digest.tracking.as_ref();
        let mut row = vec![
            axis.name.clone(),
            or_dash(digest.peak_disp.map(|p| quantity(p.value, axis.disp_unit))),
            force(axis.peak_force()),
            or_dash(digest.absorbed.map(|e| quantity(e, work))),
            or_dash(axis.lag().map(lag_words)),
            or_dash(tracking.map(|t| format!("{} %", number(100.0 * t.nrmse.value, 3)))),
            or_dash(tracking.map(|t| quantity(t.peak_error_m.value, axis.disp_unit))),
        ];
        if has_way_out {
            row.push(force(axis.force_on_the_way_out()));
        }
        row
    };
    let rows: Vec<_> = axes.iter().map(row).collect();
    let mut heading = vec![
        "",
        "peak measured displacement",
        "peak force",
        "absorbed energy",
        "lag",
        "NRMSE",
        "largest error",
    ];
    if has_way_out {
        heading.push("peak force during shutdown");
    }
    table(&heading, &rows)
        + &note(
            "Absorbed energy: ∮ force d(measured displacement), dissipated and what is stored at the end. Lag: measured behind \
             target in test time, by cross-correlation; positive means later. \
             NRMSE: root mean square of measured − target over root mean square of the target.",
        )
        + &legend()
}

/// What went over the links, by specimen; nothing where nothing was counted.
fn traffic(run: &RunData) -> String {
    let keys = ["sent", "received", "late", "lost", "corrupt"];
    let links = outcome::at(run, "link")
        .and_then(Value::as_object)
        .into_iter()
        .flatten();
    let row = |(name, counts): (&String, &Value)| {
        let counts: Option<Vec<u64>> = keys.iter().map(|key| counts.get(key)?.as_u64()).collect();
        let counts = counts.filter(|c| c.iter().any(|n| *n > 0))?;
        Some(
            std::iter::once(name.clone())
                .chain(counts.into_iter().map(count))
                .collect(),
        )
    };
    let rows: Vec<Vec<String>> = links.filter_map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    table(
        &[
            "commands and measurements",
            "sent",
            "received",
            "late",
            "lost",
            "corrupt",
        ],
        &rows,
    )
}

/// A lag in words.
pub(super) fn lag_words(lag: f64) -> String {
    // A nanosecond is far below what a parabola through samples can tell from zero.
    if lag.abs() < 1e-9 {
        "0\u{a0}s".to_owned()
    } else {
        quantity(lag, "s")
    }
}
