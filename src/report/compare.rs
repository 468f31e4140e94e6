//! The page of two runs: a rehearsal against the test, yesterday's against today's.

use serde_json::Value;

use super::RunData;
use super::canvas::Ink;
use super::charts::Quantity;
use super::curves::{Curves, Scale};
use super::html::{beside, note, paragraph, section, table};
use super::lines::{Line, Reduce, TimeChart};
use super::matched::Matched;
use super::metrics;
use super::outcome;
use super::page::zoomable;
use super::plots::history;
use super::response::curve;
use super::rows::Rows;
use super::specimens;
use super::tested::configuration;
use super::text::{NOTHING, count, escape, exact, number, plural, quantity};
use crate::metrics::tracking::Judged;

/// DOFs and axes that are drawn.
const MOST: usize = 4;
/// Rows of a table of differences.
const MOST_LISTED: usize = 60;

/// Two runs on one page: `matched` is what comes of their rows, or why they cannot be compared row by row. `names` are what
/// the runs are called.
#[must_use]
pub fn compare(
    first: &RunData,
    second: &RunData,
    names: (&str, &str),
    matched: &Result<Matched, String>,
) -> String {
    let title = format!("{} against {}", names.0, names.1);
    let mut body = format!(
        "<header>\n<p class=\"brand\">gusset · comparison of two runs</p>\n<h1>{}</h1>\n",
        escape(&title)
    );
    body += &banner(matched);
    body += "</header>\n<main>\n";
    body += &section(
        "The two runs",
        &(facts(first, second) + &settings(first, second)),
    );
    let (a, b) = (first.digested(), second.digested());
    let (rows_a, rows_b) = (Rows::new(&a), Rows::new(&b));
    body += &match matched {
        Ok(matched) => overlaid(matched),
        Err(_) => side_by_side(&rows_a, &rows_b),
    };
    body += &loops(first, &rows_a, &rows_b);
    body += &tracking(first, second, &rows_a, &rows_b);
    if let Ok(matched) = matched {
        body += &columns(matched);
    }
    body += "</main>\n";
    zoomable(&title, &body)
}

/// What came of the comparison in one sentence.
#[must_use]
pub fn verdict(matched: &Result<Matched, String>) -> String {
    match matched {
        Err(why) => format!("not compared row by row: {why}"),
        Ok(found) if found.rows == 0 => "the runs have no step in common".to_owned(),
        Ok(found) => match &found.first {
            None => format!(
                "the same to the last bit: {} of {}",
                plural(found.rows, "row", "rows"),
                plural(found.columns as u64, "column", "columns")
            ),
            Some(first) => format!(
                "they differ first at step {}, {} s, in {}: {:e} against {:e}",
                first.step, first.time, first.column, first.values.0, first.values.1
            ),
        },
    }
}

fn banner(matched: &Result<Matched, String>) -> String {
    let (class, headline, more) = match matched {
        Err(why) => (
            "warning",
            "The runs cannot be compared row by row",
            vec![capital(why)],
        ),
        Ok(found) if found.rows == 0 => ("warning", "The runs have no step in common", Vec::new()),
        Ok(found) => {
            let (class, headline) = match &found.first {
                None => ("good", "The same to the last bit"),
                Some(_) => ("warning", "The runs differ"),
            };
            let mut more = vec![format!("{}.", capital(&verdict(matched)))];
            if found.alone != (0, 0) {
                more.push(format!(
                    "{} of the first run and {} of the second have no counterpart.",
                    plural(found.alone.0, "row", "rows"),
                    count(found.alone.1)
                ));
            }
            more.push("Compared were the rows in which both tests were running, number by number; columns that depend on wall time were not.".to_owned());
            (class, headline, more)
        }
    };
    let more: String = more.iter().map(|text| paragraph(text)).collect();
    format!("<div class=\"verdict {class}\">\n<p class=\"headline\">{headline}</p>\n{more}</div>\n")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

fn facts(first: &RunData, second: &RunData) -> String {
    let of = |run: &RunData| {
        let text = |key: &str| match outcome::at(run, key) {
            Some(Value::String(text)) => text.clone(),
            Some(Value::Null) | None => NOTHING.to_owned(),
            Some(other) => other.to_string(),
        };
        let dt = outcome::number(run, "dt");
        [
            run.title.clone(),
            text("status"),
            text("reason"),
            outcome::number(run, "steps").map_or_else(|| NOTHING.to_owned(), |n| count(n as u64)),
            dt.map_or_else(|| NOTHING.to_owned(), |dt| exact(dt, "s")),
            text("lambda"),
            text("clock"),
            text("deadline_misses"),
            text("version"),
        ]
    };
    let names = [
        "title",
        "status",
        "reason",
        "steps",
        "step",
        "λ",
        "clock",
        "deadline misses",
        "program",
    ];
    let rows = names.iter().zip(of(first).into_iter().zip(of(second)));
    let rows: Vec<_> = rows
        .map(|(name, (a, b))| vec![(*name).to_owned(), a, b])
        .collect();
    beside("plain", &table(&["", "first", "second"], &rows))
}

/// Keys of the configuration that are not alike.
fn settings(first: &RunData, second: &RunData) -> String {
    let (Some(a), Some(b)) = (configuration(first), configuration(second)) else {
        return note("The configurations cannot be compared: one of them cannot be read.");
    };
    let (mut left, mut right) = (Vec::new(), Vec::new());
    flat(&a, String::new(), &mut left);
    flat(&b, String::new(), &mut right);
    let value = |list: &[(String, String)], key: &str| {
        list.iter()
            .find(|(k, _)| k == key)
            .map_or_else(|| NOTHING.to_owned(), |(_, v)| v.clone())
    };
    let mut keys: Vec<&String> = left.iter().map(|(k, _)| k).collect();
    keys.extend(
        right
            .iter()
            .map(|(k, _)| k)
            .filter(|k| !left.iter().any(|(known, _)| known == *k)),
    );
    let rows: Vec<Vec<String>> = keys
        .into_iter()
        .map(|key| vec![key.clone(), value(&left, key), value(&right, key)])
        .filter(|row| row[1] != row[2])
        .take(MOST_LISTED)
        .collect();
    if rows.is_empty() {
        return note("The resolved configurations are alike.");
    }
    format!(
        "<h3>Settings that differ</h3>\n{}",
        beside("plain", &table(&["key", "first", "second"], &rows))
    )
}

fn flat(value: &Value, path: String, out: &mut Vec<(String, String)>) {
    let join = |key: &str| {
        if path.is_empty() {
            key.to_owned()
        } else {
            format!("{path}.{key}")
        }
    };
    match value {
        Value::Object(map) => map
            .iter()
            .for_each(|(key, value)| flat(value, join(key), out)),
        Value::Array(list) if list.iter().any(Value::is_object) => {
            for (i, value) in list.iter().enumerate() {
                flat(value, format!("{path}[{}]", i + 1), out);
            }
        }
        other => out.push((path, super::text::shortened(&other.to_string(), 120))),
    }
}

/// Name and words of the columns that are drawn: displacements, then measured displacements and forces.
fn drawn(names: &[String]) -> Vec<(String, String)> {
    let dofs: Vec<u32> = names
        .iter()
        .filter_map(|n| n.strip_prefix('x')?.parse().ok())
        .collect();
    let dofs = super::digest::spread(&dofs, MOST);
    let mut out: Vec<(String, String)> = dofs
        .iter()
        .map(|dof| (format!("x{dof}"), format!("Displacement of DOF {dof}")))
        .collect();
    for (kind, words) in [
        ("meas_", "Measured displacement, specimen"),
        ("force_", "Force, specimen"),
    ] {
        let axes = names.iter().filter(|n| n.starts_with(kind)).take(MOST);
        out.extend(axes.map(|name| {
            (
                name.clone(),
                format!("{words} {}", name[kind.len()..].replace('_', ", axis ")),
            )
        }));
    }
    out
}

fn overlaid(matched: &Matched) -> String {
    let heading = "Histories";
    let Some(time) = matched.table.get("time").filter(|time| time.len() > 1) else {
        return section(
            heading,
            &paragraph("There is nothing to draw: the runs have no step in common."),
        );
    };
    let names: Vec<String> = matched
        .table
        .names()
        .filter_map(|n| n.strip_prefix("a:"))
        .map(str::to_owned)
        .collect();
    let mut markup = String::new();
    for (name, title) in drawn(&names) {
        let column = |side: &str| matched.table.get(&format!("{side}:{name}"));
        let (Some(a), Some(b), Some(d)) = (column("a"), column("b"), column("d")) else {
            continue;
        };
        let words = if name.starts_with("force") {
            "force"
        } else {
            "displacement"
        };
        let up = |words| Quantity {
            words,
            unit: matched.table.unit(&format!("a:{name}")),
        };
        let line = |name, y, ink, width| Line {
            name,
            x: time,
            y,
            ink: Ink::Series(ink),
            width,
        };
        let chart = |title, up, lines| TimeChart {
            title,
            up,
            lines,
            marks: &[],
            reduce: Reduce::Extremes,
            named_time: true,
        };
        let lines = [line("first", a, 0, 1.6), line("second", b, 1, 1.0)];
        markup += &history(
            220.0,
            &format!("{title} of both runs"),
            &chart(title.as_str(), up(words), &lines),
        );
        if metrics::peak(d).is_some_and(|peak| peak.value != 0.0) {
            let lines = [line("second − first", d, 4, 1.1)];
            let title = format!("{title}: second − first");
            markup += &history(
                150.0,
                &title,
                &chart(title.as_str(), up("difference"), &lines),
            );
        } else {
            markup += &note(&format!("{title}: no difference."));
        }
    }
    section(heading, &markup)
}

/// Histories of runs that share no grid: over the same axes, without a difference.
fn side_by_side(a: &Rows<'_>, b: &Rows<'_>) -> String {
    let (Some(time_a), Some(time_b)) = (a.get("time"), b.get("time")) else {
        return section(
            "Histories",
            &paragraph("One of the runs has no column of time."),
        );
    };
    let names: Vec<String> = a.digest().table.names().map(str::to_owned).collect();
    let mut markup = String::new();
    for (name, title) in drawn(&names) {
        let (Some(first), Some(second)) = (a.filled(&name), b.filled(&name)) else {
            continue;
        };
        let lines = [
            Line {
                name: "first",
                x: &time_a,
                y: &first,
                ink: Ink::Series(0),
                width: 1.6,
            },
            Line {
                name: "second",
                x: &time_b,
                y: &second,
                ink: Ink::Series(1),
                width: 1.0,
            },
        ];
        let words = if name.starts_with("force") {
            "force"
        } else {
            "displacement"
        };
        let up = Quantity {
            words,
            unit: a.unit(&name),
        };
        let chart = TimeChart {
            title: &title,
            up,
            lines: &lines,
            marks: &[],
            reduce: Reduce::Extremes,
            named_time: true,
        };
        markup += &history(220.0, &format!("{title} of both runs"), &chart);
    }
    if markup.is_empty() {
        markup = paragraph("The runs have no recorded displacement or force in common.");
    }
    section("Histories", &markup)
}

/// Hysteresis of the axes that both runs have, over the same axes.
fn loops(first: &RunData, a: &Rows<'_>, b: &Rows<'_>) -> String {
    let configuration = configuration(first);
    let names = specimens::tracking(a, configuration.as_ref());
    let mut figures = String::new();
    for (axis, name) in a.digest().axes.iter().zip(&names).take(MOST) {
        let Some(other) = b.digest().axes.iter().find(|other| other.axis == axis.axis) else {
            continue;
        };
        if !(axis.is_drawable() && other.is_drawable()) {
            continue;
        }
        let title = format!("Hysteresis of {}", name.name);
        let picture = Curves {
            title: &title,
            across: Scale {
                words: "measured displacement",
                unit: a.unit(&axis.axis.column("meas")),
                range: None,
            },
            up: Scale {
                words: "force",
                unit: a.unit(&axis.axis.column("force")),
                range: None,
            },
            curves: &[
                curve("first", &axis.hysteresis.0, &axis.hysteresis.1),
                curve("second", &other.hysteresis.0, &other.hysteresis.1),
            ],
            logarithmic: false,
            square: false,
        };
        figures += &format!("<figure>{}</figure>\n", picture.svg(510.0, 400.0, true));
    }
    if figures.is_empty() {
        return String::new();
    }
    section("Hysteresis", &beside("grid", &figures))
}

fn tracking(first: &RunData, second: &RunData, a: &Rows<'_>, b: &Rows<'_>) -> String {
    let names = specimens::tracking(a, configuration(first).as_ref());
    let others = specimens::tracking(b, configuration(second).as_ref());
    let mut rows = Vec::new();
    for (axis, name) in a.digest().axes.iter().zip(&names) {
        let other = b
            .digest()
            .axes
            .iter()
            .zip(&others)
            .find(|(other, _)| other.axis == axis.axis);
        let Some((other, _)) = other else { continue };
        let (Some(t), Some(u)) = (&axis.tracking, &other.tracking) else {
            continue;
        };
        let mut row =
            |what: &str, a: Option<Judged>, b: Option<Judged>, write: &dyn Fn(f64) -> String| {
                let show = |j: Option<Judged>| {
                    j.map_or_else(
                        || NOTHING.to_owned(),
                        |j| match j.corrected {
                            Some(corrected) => {
                                format!("{} (corrected {})", write(j.value), write(corrected))
                            }
                            None => write(j.value),
                        },
                    )
                };
                rows.push(vec![format!("{}: {what}", name.name), show(a), show(b)]);
            };
        let percent = |v: f64| format!("{}\u{a0}%", number(100.0 * v, 3));
        let second = |v: f64| {
            if v.abs() < 1e-9 {
                "0\u{a0}s".to_owned()
            } else {
                quantity(v, "s")
            }
        };
        let plain = |v: f64| number(v, 4);
        row(
            "NRMSE, by the root mean square of the target",
            Some(t.nrmse),
            Some(u.nrmse),
            &percent,
        );
        row(
            "largest error",
            Some(t.peak_error_m),
            Some(u.peak_error_m),
            &|v| quantity(v, "m"),
        );
        row("delay by cross-correlation", t.delay_s, u.delay_s, &second);
        row(
            "FEI amplitude",
            t.fei.map(|f| f.amplitude),
            u.fei.map(|f| f.amplitude),
            &plain,
        );
        row(
            "FEI delay",
            t.fei.map(|f| f.delay_s),
            u.fei.map(|f| f.delay_s),
            &second,
        );
        row(
            "energy error",
            Some(t.energy_error_j),
            Some(u.energy_error_j),
            &|v| quantity(v, "J"),
        );
    }
    if rows.is_empty() {
        return String::new();
    }
    section("Tracking", &table(&["", "first", "second"], &rows))
}

fn columns(matched: &Matched) -> String {
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
    section("Differences by column", &markup)
}
