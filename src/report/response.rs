//! Sections on the computed side: ground motion and the response of the recorded DOFs.

use std::borrow::Cow;

use serde_json::Value;

use super::RunData;
use super::canvas::Ink;
use super::charts::Quantity;
use super::html::{figure, note, paragraph, section, table};
use super::lines::{Line, Reduce, TimeChart};
use super::metrics;
use super::outcome;
use super::rows::Rows;
use super::text::{NOTHING, quantity};

/// Lines that one picture can carry and still be read.
const MOST_LINES: usize = 4;
/// Rows of the table of peaks.
const MOST_ROWS: usize = 24;
/// Share of the test at its end over which the residual displacement is averaged.
const TAIL: usize = 50;

/// Ground motion, if there was one.
pub(super) fn ground(rows: &Rows<'_>) -> Option<String> {
    let time = rows.get("time")?;
    let ground = rows.filled("ground")?;
    let peak = metrics::peak(&ground).filter(|p| p.value != 0.0)?;
    let unit = match rows.unit("ground") {
        "1" => "m/s^2",
        unit => unit,
    };
    let name = if unit == "m" {
        "Largest base displacement"
    } else {
        "Peak ground acceleration"
    };
    let up = Quantity {
        words: if unit == "m" {
            "displacement"
        } else {
            "acceleration"
        },
        unit,
    };
    let lines = [Line {
        name: "",
        x: &time,
        y: &ground,
        ink: Ink::Series(3),
        width: 1.1,
    }];
    let chart = TimeChart {
        title: "Ground motion",
        up,
        lines: &lines,
        marks: &[],
        reduce: Reduce::Extremes,
        named_time: true,
    };
    let markup = figure(
        1040.0,
        220.0,
        "Ground motion over test time",
        |canvas, area| chart.draw(canvas, area),
    );
    let when = time
        .get(peak.index)
        .map_or_else(String::new, |t| format!(" at {}", quantity(*t, "s")));
    Some(section(
        "Ground motion",
        &(markup
            + &note(&format!(
                "{name}: {}{when}.",
                quantity(peak.value.abs(), unit)
            ))),
    ))
}

/// `most` entries of `list`, spread evenly, first and last among them.
fn spread(list: &[u32], most: usize) -> Vec<u32> {
    if list.len() <= most {
        return list.to_vec();
    }
    (0..most)
        .filter_map(|i| list.get(i * (list.len() - 1) / (most - 1)).copied())
        .collect()
}

/// Response histories and peaks; none for a test without a structure.
pub(super) fn response(rows: &Rows<'_>) -> Option<String> {
    let dofs = rows.dofs();
    if dofs.is_empty() {
        return None;
    }
    if rows.running() == 0 {
        return Some(section(
            "Response of the structure",
            &paragraph(
                "No row was recorded while the test was running, so there is no response to show.",
            ),
        ));
    }
    let Some(time) = rows.get("time") else {
        return Some(section(
            "Response of the structure",
            &paragraph("The rows have no time column, so no history can be drawn."),
        ));
    };
    let shown = spread(&dofs, MOST_LINES);
    let mut markup = String::new();
    for (letter, title, words) in [
        ("x", "Displacement", "displacement"),
        ("v", "Velocity", "velocity"),
        ("a", "Acceleration, relative to the ground", "acceleration"),
    ] {
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
        let Some((_, first, _)) = series.first() else {
            continue;
        };
        // The largest lies at the bottom, so that the smaller ones are seen.
        let mut lines: Vec<_> = series
            .iter()
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
        let unit = rows.unit(&format!("{letter}{}", first.trim_start_matches("DOF ")));
        let chart = TimeChart {
            title,
            up: Quantity { words, unit },
            lines: &lines,
            marks: &[],
            reduce: Reduce::Extremes,
            named_time: true,
        };
        markup += &figure(
            1040.0,
            240.0,
            &format!("{title} over test time"),
            |canvas, area| chart.draw(canvas, area),
        );
    }
    if shown.len() < dofs.len() {
        markup += &note(&format!(
            "The pictures show {} of {} recorded DOFs; the samples hold them all.",
            shown.len(),
            dofs.len()
        ));
    }
    Some(section(
        "Response of the structure",
        &(markup + &peaks(rows, &dofs, &time)),
    ))
}

fn peaks(rows: &Rows<'_>, dofs: &[u32], time: &[f64]) -> String {
    let listed = spread(dofs, MOST_ROWS);
    let mut lines = Vec::new();
    for dof in &listed {
        let mut line = vec![format!("DOF {dof}")];
        for letter in ["x", "v", "a"] {
            let name = format!("{letter}{dof}");
            let peak = rows.get(&name).and_then(|values| metrics::peak(&values));
            line.push(peak.map_or_else(
                || NOTHING.to_owned(),
                |p| quantity(p.value, rows.unit(&name)),
            ));
            if letter == "x" {
                let when = peak.and_then(|p| time.get(p.index));
                line.push(when.map_or_else(|| NOTHING.to_owned(), |t| quantity(*t, "s")));
            }
        }
        let name = format!("x{dof}");
        let left = rows
            .get(&name)
            .and_then(|values| metrics::residual(&values, values.len() / TAIL));
        line.push(left.map_or_else(|| NOTHING.to_owned(), |v| quantity(v, rows.unit(&name))));
        lines.push(line);
    }
    let mut markup = table(
        &[
            "",
            "peak displacement",
            "at",
            "peak velocity",
            "peak acceleration",
            "residual displacement",
        ],
        &lines,
    );
    let part = if listed.len() < dofs.len() {
        format!(" {} of {} DOFs are listed.", listed.len(), dofs.len())
    } else {
        String::new()
    };
    markup += &note(&format!(
        "Residual: mean of the last {} % of the recorded test.{part}",
        100 / TAIL
    ));
    markup
}

/// The displacement of largest magnitude, for the top of the page: DOF and value in m.
///
/// The summary's peaks cover DOFs that were not recorded; its magnitudes are without a sign.
pub(super) fn largest_displacement(run: &RunData, rows: &Rows<'_>) -> Option<(u32, f64)> {
    let recorded = rows
        .dofs()
        .into_iter()
        .filter_map(|dof| Some((dof, metrics::peak(&rows.get(&format!("x{dof}"))?)?.value)));
    let listed = outcome::at(run, "peak.displacement")
        .and_then(Value::as_array)
        .into_iter()
        .flatten();
    let listed = listed
        .zip(1..)
        .filter_map(|(value, dof)| Some((dof, value.as_f64()?)));
    recorded
        .chain(listed)
        .fold(None, |best: Option<(u32, f64)>, now| match best {
            Some(best) if best.1.abs() >= now.1.abs() => Some(best),
            _ => Some(now),
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_has_both_ends() {
        let list: Vec<u32> = (1..=100).collect();
        assert_eq!(spread(&list, 4), [1, 34, 67, 100]);
        assert_eq!(spread(&list[..3], 4), [1, 2, 3]);
    }
}
