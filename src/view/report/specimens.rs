//! The specimens: hysteresis, peaks and traffic.

use super::RunView;
use super::canvas::Ink;
use super::charts::Quantity;
use super::digest::WITHOUT_DISP;
use super::html::{beside, details, figure, note, paragraph, table};
use super::lines::{Line, LoopChart};
use super::plots::HALF;
use super::rows::Rows;
use super::text::{NOTHING, count, quantity};
use super::tracked::Tracked;
use gusset_record::summary::LinkCounts;

/// Axes that are drawn; a table lists more.
pub(super) const MOST_DRAWN: usize = 8;

/// Pictures of hysteresis, one per axis.
pub(super) fn loops(rows: &Rows<'_>, axes: &[Tracked<'_>]) -> String {
    if rows.running() == 0 {
        return String::new();
    }
    let drawable = axes.iter().filter(|axis| axis.digest.is_drawable());
    drawable
        .take(MOST_DRAWN)
        .map(|axis| hysteresis(rows, axis))
        .collect()
}

/// Response of a test of prescribed displacement: hysteresis only. `loops` are the pictures.
pub(super) fn response(
    run: &RunView,
    rows: &Rows<'_>,
    axes: &[Tracked<'_>],
    loops: &str,
) -> Option<String> {
    if axes.is_empty() || !rows.dofs().is_empty() {
        return None;
    }
    let markup = match loops {
        "" if rows.running() == 0 => paragraph(
            "No row was recorded while the test was running, so there is no measurement to show.",
        ),
        "" => paragraph("Nothing was measured."),
        loops => beside("grid", loops),
    };
    Some(rows.section("Response", &(markup + &peaks(run, rows, axes))))
}

/// Peaks and energy of every axis, losses on the link, and the end that the numbers belong to.
pub(super) fn peaks(run: &RunView, rows: &Rows<'_>, axes: &[Tracked<'_>]) -> String {
    if axes.is_empty() || rows.running() == 0 {
        return String::new();
    }
    let mut markup = unanswered(run, rows) + &listed(axes);
    let scaled = axes.iter().filter_map(|axis| Some((axis, axis.scale?)));
    for (axis, scale) in scaled {
        let text = format!(
            "{}, all as the structure sees it: {}.",
            axis.name,
            scale.words()
        );
        markup += &note(&text);
    }
    let without = axes
        .iter()
        .filter(|axis| !rows.digest().measures_disp(axis.digest.axis));
    for axis in without {
        markup += &note(&format!(
            "{}: {WITHOUT_DISP}. Lag, tracking metrics, stiffness, damping and absorbed energy are left out.",
            axis.name
        ));
    }
    let all = rows.axes().len();
    if all > MOST_DRAWN {
        markup += &note(&format!(
            "The pictures show {MOST_DRAWN} of {all} axes; the samples hold them all."
        ));
    }
    markup + &traffic(run)
}

/// The specimens that did not answer in every tick, and the consequences for the section; empty if all did.
fn unanswered(run: &RunView, rows: &Rows<'_>) -> String {
    let digest = rows.digest();
    if digest.stale.is_empty() {
        return String::new();
    }
    let told = digest.stale.iter().map(|(specimen, ticks)| {
        let name = run.test.file.specimen_name(*specimen);
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

/// The loop of force over the measured displacement, or over the command where none is measured.
fn hysteresis(rows: &Rows<'_>, axis: &Tracked<'_>) -> String {
    let is_measured = rows.digest().measures_disp(axis.digest.axis);
    let across = if is_measured {
        "measured displacement"
    } else {
        "command"
    };
    let (disp, force) = &axis.digest.hysteresis;
    let title = format!("Hysteresis of {}", axis.name);
    let label = axis.label(&format!("force against {across}"));
    let line = Line {
        name: "",
        x: disp,
        y: force,
        ink: Ink::Series(1),
        width: 1.3,
    };
    let chart = LoopChart {
        title: &title,
        across: axis.disp(across),
        up: Quantity {
            words: "force",
            unit: axis.force_unit,
        },
        lines: &[line],
    };
    figure(HALF, 326.0, &label, |canvas, area| chart.draw(canvas, area))
}

fn listed(axes: &[Tracked<'_>]) -> String {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
    let force = |found: Option<(f64, &str)>| or_dash(found.map(|(f, unit)| quantity(f, unit)));
    let has_way_out = axes.iter().any(|axis| axis.way_out.is_some());
    let row = |axis: &Tracked<'_>| {
        let work = axis.work_unit();
        let peak = axis
            .digest
            .peak_disp
            .map(|p| quantity(p.value, axis.disp_unit));
        let mut row = vec![
            axis.name.clone(),
            or_dash(peak),
            force(axis.peak_force()),
            or_dash(axis.digest.absorbed.map(|e| quantity(e, work))),
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
    ];
    if has_way_out {
        heading.push("peak force during shutdown");
    }
    table(&heading, &rows)
        + &note(
            "Absorbed energy: ∮ force d(measured displacement), dissipated and stored at the end.",
        )
}

/// Traffic on the links, by specimen; empty where nothing was counted.
fn traffic(run: &RunView) -> String {
    let links = run.summary.iter().flat_map(|summary| &summary.link);
    let row = |(name, link): (&String, &LinkCounts)| {
        let counts = [link.sent, link.received, link.late, link.lost, link.corrupt];
        counts.iter().any(|n| *n > 0).then(|| {
            let counts = counts.into_iter().map(count);
            std::iter::once(name.clone()).chain(counts).collect()
        })
    };
    let rows: Vec<Vec<String>> = links.filter_map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    let links = run.summary.iter().flat_map(|summary| summary.link.values());
    let has_losses = links
        .into_iter()
        .any(|link| link.late + link.lost + link.corrupt > 0);
    let table = table(
        &[
            "commands and measurements",
            "sent",
            "received",
            "late",
            "lost",
            "corrupt",
        ],
        &rows,
    );
    if has_losses {
        table
    } else {
        details(
            "Commands and measurements: none late, lost or corrupt",
            &table,
        )
    }
}
