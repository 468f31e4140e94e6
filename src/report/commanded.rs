//! An axis whose link answers with forces only: its pictures show the command under that name.

use super::canvas::Ink;
use super::charts::Quantity;
use super::digest::WITHOUT_DISP;
use super::html::{beside, figure, note};
use super::lines::{Line, LoopChart, TimeChart};
use super::plots::history;
use super::rows::Rows;
use super::specimens::Tracked;

/// Force against command, and both over time; nothing that a measured displacement would be needed for.
pub(super) fn of_forces_only(rows: &Rows<'_>, time: &[f64], axis: &Tracked<'_>) -> String {
    let digest = axis.digest;
    let column = |kind: &str| rows.get(&digest.axis.column(kind)).unwrap_or_default();
    let label = |what: &str| format!("{}: {what}", axis.name);
    let disp = |words| Quantity {
        words,
        unit: axis.disp_unit,
    };
    let line = |name, x, y, ink, width| Line {
        name,
        x,
        y,
        ink: Ink::Series(ink),
        width,
    };
    let hysteresis = LoopChart {
        title: "Force against command",
        across: disp("command"),
        up: Quantity {
            words: "force",
            unit: axis.force_unit,
        },
        lines: &[line("", &digest.hysteresis.0, &digest.hysteresis.1, 1, 1.3)],
    };
    let figures = figure(
        500.0,
        400.0,
        &label("force against command"),
        |canvas, area| {
            hysteresis.draw(canvas, area);
        },
    );
    // The record repeats the command as what was measured.
    let (target, command) = (column("target"), column("meas"));
    let lines = [
        line("target", time, &target, 0, 1.6),
        line("command", time, &command, 3, 1.0),
    ];
    let chart = TimeChart::history("Target and command", disp("displacement"), &lines);
    note(&format!(
        "Of this axis {WITHOUT_DISP}: how it followed is not known. Lag, tracking metrics, stiffness, damping and absorbed energy are \
         left out."
    )) + &beside("pair", &figures)
        + &history(240.0, &label("target and command over test time"), &chart)
}
