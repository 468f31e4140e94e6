//! The computed side: histories, drifts, spectra and peaks of the recorded DOFs.

use std::borrow::Cow;

use serde_json::Value;

use super::RunData;
use super::canvas::Ink;
use super::charts::Quantity;
use super::columns::{MOST_DOFS, MOST_LINES, TAIL, drift, spread};
use super::curves::{Curve, Curves, Scale};
use super::html::{note, paragraph, table};
use super::lines::{Line, TimeChart};
use super::metrics;
use super::outcome;
use super::plots::{history, note_on_extremes};
use super::rows::Rows;
use super::text::{NOTHING, quantity};

/// Response histories and peaks; none for a test without a structure.
pub(super) fn response(run: &RunData, rows: &Rows<'_>) -> Option<String> {
    let dofs = rows.dofs();
    if dofs.is_empty() {
        return None;
    }
    if rows.running() == 0 {
        return Some(rows.section(
            "Response of the structure",
            &paragraph(
                "No row was recorded while the test was running, so there is no response to show.",
            ),
        ));
    }
    let Some(time) = rows.get("time") else {
        return Some(rows.section(
            "Response of the structure",
            &paragraph("The rows have no time column, so no history can be drawn."),
        ));
    };
    let shown = spread(dofs, MOST_LINES);
    let against = measured_against(rows);
    let mut markup = String::new();
    for (letter, name, words) in [
        ("x", "Displacement", "displacement"),
        ("v", "Velocity", "velocity"),
        ("a", "Acceleration", "acceleration"),
    ] {
        let title = &format!("{name}{against}");
        let series: Vec<(usize, String, Cow<'_, [f64]>)> = shown
            .iter()
            .enumerate()
            .filter_map(|(i, dof)| {
                Some((
                    i,
                    format!("DOF {dof}"),
                    rows.filled(&format!("{letter}{dof}"))?,
                ))
            })
            .collect();
        let unit_of = |name: &str| rows.unit(&column(letter, name));
        for unit in units(series.iter().map(|(_, name, _)| unit_of(name))) {
            // The largest lies at the bottom, so that the smaller ones are seen.
            let mut lines: Vec<_> = series
                .iter()
                .filter(|(_, name, _)| unit_of(name) == unit)
                .map(|(i, name, y)| Line {
                    name,
                    x: &time,
                    y,
                    ink: Ink::Series(*i as u8),
                    width: 1.2,
                })
                .collect();
            lines.sort_by(|a, b| {
                let size = |line: &Line<'_>| metrics::peak(line.y).map_or(0.0, |p| p.value.abs());
                size(b).total_cmp(&size(a))
            });
            let chart = TimeChart::history(title, Quantity { words, unit }, &lines);
            markup += &history(240.0, &format!("{name} over test time"), &chart);
        }
    }
    markup += &drifts(rows, &time);
    if shown.len() < dofs.len() {
        markup += &note(&format!(
            "The pictures show {} of {} recorded DOFs; the samples hold them all.",
            shown.len(),
            dofs.len()
        ));
    }
    Some(rows.section(
        "Response of the structure",
        &(markup
            + &note_on_extremes(rows.digest().every)
            + &spectra(rows)
            + &peaks(run, rows, dofs)),
    ))
}

/// What displacements, velocities and accelerations are measured against, as a title goes on; nothing where the ground rests.
fn measured_against(rows: &Rows<'_>) -> &'static str {
    let shakes = rows.marks("ground").peak.is_some_and(|p| p.value != 0.0);
    match rows.unit("ground") {
        // Coordinates are absolute where the base is displaced.
        "m" => ", absolute",
        _ if shakes => ", relative to the ground",
        _ => "",
    }
}

/// The column of a DOF as a picture names it.
fn column(letter: &str, name: &str) -> String {
    format!("{letter}{}", name.trim_start_matches("DOF "))
}

/// Each unit once: displacements and rotations do not share an axis of a picture.
fn units<'a>(all: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    all.fold(Vec::new(), |mut units, unit| {
        if !units.contains(&unit) {
            units.push(unit);
        }
        units
    })
}

/// Storey drifts, where storeys are known.
fn drifts(rows: &Rows<'_>, time: &[f64]) -> String {
    let all: Vec<u32> = (1..)
        .take_while(|&storey| rows.get(&drift(storey)).is_some())
        .map(|storey| storey as u32)
        .collect();
    let series: Vec<_> = spread(&all, MOST_LINES)
        .into_iter()
        .filter_map(|storey| {
            Some((
                format!("storey {storey}"),
                rows.filled(&drift(storey as usize))?,
            ))
        })
        .collect();
    let lines: Vec<_> = series
        .iter()
        .enumerate()
        .map(|(i, (name, y))| Line {
            name,
            x: time,
            y,
            ink: Ink::Series(i as u8),
            width: 1.2,
        })
        .collect();
    if lines.is_empty() {
        return String::new();
    }
    let unit = rows.unit(&drift(1));
    let chart = TimeChart::history(
        "Storey drift: displacement against the storey below",
        Quantity {
            words: "drift",
            unit,
        },
        &lines,
    );
    let peaks = all.iter().filter_map(|&storey| {
        let values = rows.get(&drift(storey as usize))?;
        Some((storey, metrics::peak(&values)?.value))
    });
    let peaks: Vec<(u32, f64)> = peaks.collect();
    let words =
        |&(storey, value): &(u32, f64)| format!("storey {storey} {}", quantity(value, unit));
    let largest = peaks.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let rest = match peaks.len().saturating_sub(MOST_DOFS) {
        0 => String::new(),
        rest => format!(
            "; {rest} more storeys are not listed. The largest of all: {}",
            largest.map(words).unwrap_or_default()
        ),
    };
    let peaks: Vec<_> = peaks.iter().take(MOST_DOFS).map(words).collect();
    history(240.0, "Storey drifts over test time", &chart)
        + &note(&format!("Largest drifts: {}{rest}.", peaks.join(", ")))
}

/// Fourier amplitudes of the displacements.
fn spectra(rows: &Rows<'_>) -> String {
    let split: Vec<(String, Vec<f64>, Vec<f64>)> = rows
        .digest()
        .spectra
        .iter()
        .map(|(dof, points)| {
            let (x, y) = points.iter().copied().unzip();
            (format!("DOF {dof}"), x, y)
        })
        .collect();
    let unit_of = |name: &str| rows.unit(&column("x", name));
    let mut figures = String::new();
    for unit in units(split.iter().map(|(name, ..)| unit_of(name))) {
        let own = split.iter().filter(|(name, ..)| unit_of(name) == unit);
        let curves: Vec<_> = own.map(|(name, x, y)| curve(name, x, y)).collect();
        let title = "Frequency content of the displacements: Fourier amplitude";
        let seconds = format!("{unit} s");
        let picture = amplitudes(title, "amplitude", &seconds, &curves);
        figures += &format!(
            "<figure class=\"broad\">{}</figure>\n",
            picture.svg(1040.0, 300.0, true)
        );
    }
    figures
}

/// A curve by name.
pub(super) const fn curve<'a>(name: &'a str, x: &'a [f64], y: &'a [f64]) -> Curve<'a> {
    Curve {
        name,
        x,
        y,
        dots: false,
        reference: false,
    }
}

/// Fourier amplitudes over frequency, six decades of them.
pub(super) fn amplitudes<'a>(
    title: &'a str,
    words: &'a str,
    unit: &'a str,
    curves: &'a [Curve<'a>],
) -> Curves<'a> {
    Curves {
        title,
        across: Scale {
            words: "frequency",
            unit: "Hz",
            range: None,
        },
        up: Scale {
            words,
            unit,
            range: decades(curves.iter().map(|curve| curve.y)),
        },
        curves,
        logarithmic: true,
        square: false,
    }
}

/// Six decades below the largest amplitude: what lies lower is roundoff.
fn decades<'a>(amplitudes: impl Iterator<Item = &'a [f64]>) -> Option<(f64, f64)> {
    let top = amplitudes
        .flatten()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    (top > 1e-280 && top < 1e280).then_some((top * 1e-6, top * 2.0))
}

fn peaks(run: &RunData, rows: &Rows<'_>, dofs: &[u32]) -> String {
    // Of a test that was stopped in motion the last rows are no rest.
    let is_completed = outcome::text(run, "status") == Some("completed");
    let listed = spread(dofs, MOST_DOFS);
    let mut lines = Vec::new();
    for dof in &listed {
        let mut line = vec![format!("DOF {dof}")];
        for letter in ["x", "v", "a"] {
            let name = format!("{letter}{dof}");
            let peak = rows.marks(&name).peak;
            line.push(peak.map_or_else(
                || NOTHING.to_owned(),
                |p| quantity(p.value, rows.unit(&name)),
            ));
            if letter == "x" {
                line.push(peak.map_or_else(|| NOTHING.to_owned(), |p| rows.moment(p.time)));
            }
        }
        if !is_completed {
            lines.push(line);
            continue;
        }
        let name = format!("x{dof}");
        let left = rows.digest().residuals.iter().find(|(of, _)| of == dof);
        let left = left.map(|(_, value)| *value);
        line.push(left.map_or_else(|| NOTHING.to_owned(), |v| quantity(v, rows.unit(&name))));
        lines.push(line);
    }
    let mut heading = vec![
        "",
        "peak displacement",
        "at",
        "peak velocity",
        "peak acceleration",
    ];
    if is_completed {
        heading.push("residual displacement");
    }
    let markup = table(&heading, &lines);
    let part = if listed.len() < dofs.len() {
        format!(" {} of {} DOFs are listed.", listed.len(), dofs.len())
    } else {
        String::new()
    };
    let residual = if is_completed {
        format!(
            "Residual: mean of the last {} % of the recorded test.",
            100 / TAIL
        )
    } else {
        "No residual displacement: the test did not come to its end.".to_owned()
    };
    let against = match measured_against(rows) {
        "" => String::new(),
        against => format!(
            " Displacements, velocities and accelerations are{}.",
            against.trim_start_matches(',')
        ),
    };
    markup + &note(&format!("{residual}{against}{part}"))
}

/// The displacement of largest magnitude, for the top of the page: DOF, value and its unit. An angle only where no DOF is a
/// translation: the two cannot be compared.
///
/// The summary's peaks cover DOFs that were not recorded; its magnitudes are without a sign.
pub(super) fn largest_displacement<'a>(
    run: &RunData,
    rows: &Rows<'a>,
) -> Option<(u32, f64, &'a str)> {
    let list = |path| outcome::at(run, path).and_then(Value::as_array);
    let turning = list("peak.rotations").into_iter().flatten();
    let turning: Vec<u64> = turning.filter_map(Value::as_u64).collect();
    let recorded = rows.dofs().iter().copied().filter_map(|dof| {
        let name = format!("x{dof}");
        let peak = metrics::peak(&rows.get(&name)?)?;
        Some((dof, peak.value, rows.unit(&name)))
    });
    let listed = list("peak.displacement").into_iter().flatten().zip(1..);
    let listed = listed.filter_map(|(value, dof)| {
        let turns = turning.contains(&u64::from(dof));
        let unit = if turns { "rad" } else { rows.disp_unit(dof) };
        Some((dof, value.as_f64()?, unit))
    });
    let all: Vec<_> = recorded.chain(listed).collect();
    let lengths = all.iter().filter(|(_, _, unit)| *unit != "rad");
    let comparable: Vec<_> = match lengths.clone().next() {
        Some(_) => lengths.copied().collect(),
        None => all,
    };
    // The first of equals: a recorded one has its sign.
    let larger = |best: (u32, f64, &'a str), now: (u32, f64, &'a str)| {
        if now.1.abs() > best.1.abs() {
            now
        } else {
            best
        }
    };
    comparable.into_iter().reduce(larger)
}
