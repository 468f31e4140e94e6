//! Pictures of a comparison: histories and loops over the same axes; and how far each column is apart.

use super::RunView;
use super::axes::AxisDigest;
use super::canvas::Ink;
use super::charts::Quantity;
use super::html::{beside, details, figure, note, paragraph, section, table};
use super::lines::{Line, LoopChart, TimeChart};
use super::matched::Matched;
use super::metrics;
use super::plots::{WHOLE, history};
use super::rows::Rows;
use super::table::Table;
use super::text::{NOTHING, count, number, quantity};
use super::tracked;
use gusset_quantity::catalog::column::{DISP, FORCE, MEASURED};

/// DOFs and axes that are drawn.
const MOST: usize = 4;
/// Columns that are listed.
const MOST_LISTED: usize = 60;

/// Name and words of the columns that are drawn: displacements, then measured displacements and forces.
fn drawn(names: &[String]) -> Vec<(String, String)> {
    let dofs: Vec<u32> = names.iter().filter_map(|name| DISP.dof_in(name)).collect();
    let dofs = super::columns::spread(&dofs, MOST);
    let mut out: Vec<(String, String)> = dofs
        .iter()
        .map(|dof| (format!("x{dof}"), format!("Displacement of DOF {dof}")))
        .collect();
    for (kind, words) in [
        (MEASURED, "Measured displacement, specimen"),
        (FORCE, "Force, specimen"),
    ] {
        let axes = names.iter().filter_map(|name| {
            let (specimen, axis) = kind.axis_in(name)?;
            Some((name.clone(), format!("{words} {specimen}, axis {axis}")))
        });
        out.extend(axes.take(MOST));
    }
    out
}

/// Histories of rows that both runs have, with their difference.
pub(super) fn overlaid(matched: &Matched) -> String {
    if matched.rows < 2 {
        return paragraph("There is nothing to draw: the runs have no step in common.");
    }
    let tables = matched.tables.iter();
    let names: Vec<String> = tables
        .flat_map(Table::names)
        .filter_map(|n| n.strip_prefix("a:"))
        .map(str::to_owned)
        .collect();
    let mut markup = String::new();
    for (name, title) in drawn(&names) {
        let Some(table) = matched.table_of(&name) else {
            continue;
        };
        let column = |side: &str| table.get(&format!("{side}:{name}"));
        let (Some(a), Some(b), Some(d)) = (column("a"), column("b"), column("d")) else {
            continue;
        };
        let time = |side: &str| table.time_of(&format!("{side}:{name}")).unwrap_or_default();
        let words = if FORCE.fits(&name) {
            "force"
        } else {
            "displacement"
        };
        let up = |words| Quantity {
            words,
            unit: table.unit(&format!("a:{name}")),
        };
        let line = |name, side, y, ink, width| Line {
            name,
            x: time(side),
            y,
            ink: Ink::Series(ink),
            width,
        };
        let lines = [
            line("first", "a", a, 0, 1.6),
            line("second", "b", b, 1, 1.0),
        ];
        markup += &history(
            (WHOLE, 220.0),
            &format!("{title} of both runs"),
            &TimeChart::history(&title, up(words), &lines),
        );
        if metrics::peak(d).is_some_and(|peak| peak.value != 0.0) {
            let lines = [line("second − first", "d", d, 4, 1.1)];
            let title = format!("{title}: second − first");
            markup += &history(
                (WHOLE, 150.0),
                &title,
                &TimeChart::history(&title, up("difference"), &lines),
            );
        } else {
            markup += &note(&format!("{title}: no difference."));
        }
    }
    markup
}

/// Histories of runs that share no grid: over the same axes, without a difference.
pub(super) fn side_by_side(a: &Rows<'_>, b: &Rows<'_>) -> String {
    if a.get("time").is_none() || b.get("time").is_none() {
        return paragraph("One of the runs has no column of time.");
    }
    let names = a.names();
    let mut markup = String::new();
    for (name, title) in drawn(&names) {
        let (Some(first), Some(second)) = (a.history(&name), b.history(&name)) else {
            continue;
        };
        let lines = [
            first.line("first", Ink::Series(0), 1.6),
            second.line("second", Ink::Series(1), 1.0),
        ];
        let words = if FORCE.fits(&name) {
            "force"
        } else {
            "displacement"
        };
        let up = Quantity {
            words,
            unit: a.unit(&name),
        };
        let chart = TimeChart::history(&title, up, &lines);
        markup += &history((WHOLE, 220.0), &format!("{title} of both runs"), &chart);
    }
    if markup.is_empty() {
        markup = paragraph("The runs have no recorded displacement or force in common.");
    }
    markup
}

/// Hysteresis of the axes that both runs have, over the same axes.
pub(super) fn loops<'a>(first: &RunView, a: &Rows<'a>, b: &Rows<'a>) -> String {
    let names = tracked::tracking(first, a);
    let mut figures = String::new();
    for (axis, name) in a.digest().axes.iter().zip(&names).take(MOST) {
        let Some(other) = b.digest().axes.iter().find(|other| other.axis == axis.axis) else {
            continue;
        };
        if !(axis.is_drawable() && other.is_drawable()) {
            continue;
        }
        let title = format!("Hysteresis of {}", name.name);
        let line = |name, of: &'a AxisDigest, ink, width| Line {
            name,
            x: &of.hysteresis.0,
            y: &of.hysteresis.1,
            ink: Ink::Series(ink),
            width,
        };
        let picture = LoopChart {
            title: &title,
            across: Quantity {
                words: "measured displacement",
                unit: name.disp_unit,
            },
            up: Quantity {
                words: "force",
                unit: name.force_unit,
            },
            lines: &[line("first", axis, 0, 1.6), line("second", other, 1, 1.0)],
        };
        figures += &figure(
            510.0,
            400.0,
            &format!("{title} of both runs"),
            |canvas, area| picture.draw(canvas, area),
        );
    }
    if figures.is_empty() {
        return String::new();
    }
    beside("grid", &figures)
}

/// How far each column is apart.
pub(super) fn columns(matched: &Matched) -> String {
    let mut apart: Vec<_> = matched
        .apart
        .iter()
        .filter(|apart| apart.first.is_some())
        .collect();
    if apart.is_empty() {
        return section("Differences by column", &paragraph("No column differs."));
    }
    apart.sort_by_key(|apart| apart.first);
    let rows: Vec<_> = apart
        .iter()
        .take(MOST_LISTED)
        .map(|apart| {
            let unit = apart.column.unit.as_str();
            let share = if apart.size > 0.0 {
                format!("{}\u{a0}%", number(100.0 * apart.largest / apart.size, 2))
            } else {
                NOTHING.to_owned()
            };
            vec![
                apart.column.name.clone(),
                apart.first.map_or_else(|| NOTHING.to_owned(), count),
                quantity(apart.largest, unit),
                if apart.at.is_finite() {
                    format!("{:.4}\u{a0}s", apart.at)
                } else {
                    NOTHING.to_owned()
                },
                share,
                quantity(apart.rms, unit),
            ]
        })
        .collect();
    let heading = [
        "column",
        "from step",
        "largest difference",
        "at",
        "of the largest value",
        "root mean square",
    ];
    let mut markup = table(&heading, &rows);
    if apart.len() > MOST_LISTED {
        markup += &note(&format!(
            "{} of {} columns that differ are listed.",
            MOST_LISTED,
            apart.len()
        ));
    }
    let largest = apart
        .iter()
        .filter(|apart| apart.size > 0.0)
        .map(|apart| (apart, apart.largest / apart.size))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let most = largest.map_or_else(String::new, |(apart, share)| {
        format!(
            " The largest difference is {}\u{a0}% of the largest value, in {}.",
            number(100.0 * share, 2),
            apart.column.name
        )
    });
    let says = format!(
        "{} of {} columns differ.{most}",
        apart.len(),
        matched.columns
    );
    let folded = details("Every column that differs", &markup);
    section("Differences by column", &(paragraph(&says) + &folded))
}
