//! The computed side: histories, storeys, spectra and peaks of the recorded DOFs.

use super::RunView;
use super::canvas::Ink;
use super::charts::Quantity;
use super::columns::{MOST_DOFS, MOST_LINES, Storey, TAIL, spread};
use super::curves::{Curve, Curves, Look, Scale};
use super::html::{beside, details, note, paragraph, table};
use super::lines::{Line, TimeChart};
use super::metrics;
use super::plots::{HALF, WHOLE, history, note_on_histories, still};
use super::rows::{History, Rows};
use super::text::{NOTHING, quantity};
use gusset_quantity::catalog::ending::Status;

/// Curves that share a picture: name, history and colour.
type Series<'a> = Vec<(String, History<'a>, Ink)>;

/// Response histories and peaks of a structure; `loops` are the pictures of hysteresis, `specimens` their peaks. `None` for a
/// test without a structure.
pub(super) fn response(
    run: &RunView,
    rows: &Rows<'_>,
    loops: &str,
    specimens: &str,
) -> Option<String> {
    let dofs = rows.dofs();
    if dofs.is_empty() {
        return None;
    }
    let heading = "Response";
    let nothing = |text: &str| Some(rows.section(heading, &paragraph(text)));
    if rows.running() == 0 {
        return nothing(
            "No row was recorded while the test was running, so there is no response to show.",
        );
    }
    if rows.get("time").is_none() {
        return nothing("The rows have no time column, so no history can be drawn.");
    }
    let shown = spread(dofs, MOST_LINES);
    let mut markup = of_dofs(rows, &shown, ("x", "Displacement", "displacement"), true);
    let figures = loops.to_owned() + &storeys(rows);
    if !figures.is_empty() {
        markup += &beside("grid", &figures);
    }
    markup += &storey_peaks(rows);
    if shown.len() < dofs.len() {
        markup += &note(&format!(
            "The pictures show {} of {} recorded DOFs; the samples hold them all.",
            shown.len(),
            dofs.len()
        ));
    }
    markup += &peaks(run, rows, dofs);
    markup += specimens;
    let more = of_dofs(rows, &shown, ("v", "Velocity", "velocity"), false)
        + &of_dofs(rows, &shown, ("a", "Acceleration", "acceleration"), false)
        + &spectra(rows);
    markup += &details(
        "Velocities, accelerations and frequency content of all DOFs",
        &more,
    );
    markup += &note_on_histories(rows);
    Some(rows.section(heading, &markup))
}

/// The histories of one quantity of the DOFs, one picture per unit; those that cannot be zoomed are smaller.
fn of_dofs(
    rows: &Rows<'_>,
    shown: &[u32],
    (letter, name, words): (&str, &str, &str),
    zooms: bool,
) -> String {
    let column = |dof: &u32| format!("{letter}{dof}");
    let title = format!("{name}{}", measured_against(rows));
    let label = format!("{name} over test time");
    let mut markup = String::new();
    for unit in units(shown.iter().map(|dof| rows.unit(&column(dof)))) {
        let own = shown
            .iter()
            .zip(0..)
            .filter(|(dof, _)| rows.unit(&column(dof)) == unit);
        let series = own.filter_map(|(dof, ink)| {
            let found = rows.history(&column(dof))?;
            Some((format!("DOF {dof}"), found, Ink::Series(ink)))
        });
        let series: Series<'_> = series.collect();
        let lines = lines(&series);
        if lines.is_empty() {
            continue;
        }
        let chart = TimeChart::history(&title, Quantity { words, unit }, &lines);
        markup += &if zooms {
            history((WHOLE, 230.0), &label, &chart)
        } else {
            still(&label, &chart)
        };
    }
    markup
}

fn lines<'a>(series: &'a Series<'_>) -> Vec<Line<'a>> {
    let line = |(name, of, ink): &'a (String, History<'_>, Ink)| of.line(name, *ink, 1.2);
    series.iter().map(line).collect()
}

/// The reference of displacements, velocities and accelerations, to be added to a title. Empty where the ground rests.
fn measured_against(rows: &Rows<'_>) -> &'static str {
    let shakes = rows.marks("ground").peak.is_some_and(|p| p.value != 0.0);
    match rows.unit("ground") {
        // Coordinates are absolute where the base is displaced.
        "m" => ", absolute",
        _ if shakes => ", relative to the ground",
        _ => "",
    }
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

/// Floor acceleration, drift and shear, where there are storeys.
fn storeys(rows: &Rows<'_>) -> String {
    let of = |kind, title, words, place| of_storeys(rows, (kind, title, words), place);
    [
        of(
            Storey::Floor,
            "Absolute floor acceleration",
            "acceleration",
            "floor",
        ),
        of(Storey::Drift, "Storey drift", "drift", "storey"),
        of(Storey::Shear, "Storey shear", "shear force", "storey"),
    ]
    .concat()
}

/// Storeys that have the column.
fn numbers(rows: &Rows<'_>, kind: Storey) -> Vec<u32> {
    let has = |storey: &u32| rows.filled(&kind.column(*storey as usize)).is_some();
    (1..).take_while(has).collect()
}

fn of_storeys(rows: &Rows<'_>, (kind, title, words): (Storey, &str, &str), place: &str) -> String {
    let shown = spread(&numbers(rows, kind), MOST_LINES)
        .into_iter()
        .zip(0..);
    let series = shown.filter_map(|(storey, ink)| {
        let found = rows.history(&kind.column(storey as usize))?;
        Some((format!("{place} {storey}"), found, Ink::Series(ink)))
    });
    let series: Series<'_> = series.collect();
    let lines = lines(&series);
    if lines.is_empty() {
        return String::new();
    }
    let up = Quantity {
        words,
        unit: rows.unit(&kind.column(1)),
    };
    let chart = TimeChart::history(title, up, &lines);
    history((HALF, 290.0), &format!("{title} over test time"), &chart)
}

/// Largest floor acceleration, drift and shear of each storey, the roof first.
fn storey_peaks(rows: &Rows<'_>) -> String {
    let all = numbers(rows, Storey::Drift);
    if all.is_empty() {
        return String::new();
    }
    let kinds = [
        (Storey::Drift, "drift"),
        (Storey::Shear, "shear"),
        (Storey::Floor, "absolute floor acceleration"),
    ];
    let known = kinds
        .into_iter()
        .filter(|(kind, _)| !numbers(rows, *kind).is_empty());
    let (kinds, names): (Vec<_>, Vec<_>) = known.unzip();
    let peak = |kind: Storey, storey: u32| {
        let name = kind.column(storey as usize);
        let peak = rows.marks(&name).peak;
        peak.map_or_else(
            || NOTHING.to_owned(),
            |p| quantity(p.value, rows.unit(&name)),
        )
    };
    let row = |storey: u32| {
        let cells = kinds.iter().map(|kind| peak(*kind, storey));
        std::iter::once(format!("storey {storey}"))
            .chain(cells)
            .collect()
    };
    let listed: Vec<Vec<String>> = spread(&all, MOST_DOFS).into_iter().rev().map(row).collect();
    let heading: Vec<&str> = std::iter::once("largest").chain(names).collect();
    let rest = if listed.len() < all.len() {
        note(&format!(
            "{} of {} storeys are listed.",
            listed.len(),
            all.len()
        ))
    } else {
        String::new()
    };
    table(&heading, &listed) + &rest
}

/// Fourier amplitudes of the displacements.
fn spectra(rows: &Rows<'_>) -> String {
    let split: Vec<(String, &str, Vec<f64>, Vec<f64>)> = rows
        .digest()
        .spectra
        .iter()
        .map(|(dof, points)| {
            let (x, y) = points.iter().copied().unzip();
            (format!("DOF {dof}"), rows.unit(&format!("x{dof}")), x, y)
        })
        .collect();
    let mut figures = String::new();
    for unit in units(split.iter().map(|(_, unit, ..)| *unit)) {
        let own = split.iter().filter(|(_, of, ..)| *of == unit);
        let curves: Vec<_> = own.map(|(name, _, x, y)| curve(name, x, y)).collect();
        let title = "Frequency content of the displacements: Fourier amplitude";
        let seconds = format!("{unit} s");
        let picture = amplitudes(title, "amplitude", &seconds, &curves);
        figures += &format!(
            "<figure class=\"broad\">{}</figure>\n",
            picture.svg(WHOLE, 260.0, true)
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
        look: Look::Line,
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

/// Six decades below the largest amplitude; smaller values are roundoff.
fn decades<'a>(amplitudes: impl Iterator<Item = &'a [f64]>) -> Option<(f64, f64)> {
    let top = amplitudes
        .flatten()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    (top > 1e-280 && top < 1e280).then_some((top * 1e-6, top * 2.0))
}

fn peaks(run: &RunView, rows: &Rows<'_>, dofs: &[u32]) -> String {
    // A test that was stopped in motion has no residual displacement.
    let ending = run.summary.as_ref().map(|summary| summary.status);
    let is_completed = ending == Some(Status::Completed);
    let listed = spread(dofs, MOST_DOFS);
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
    let line = |dof: &u32| {
        let peak = |letter: &str| {
            let name = format!("{letter}{dof}");
            rows.marks(&name).peak.map(|p| (p, rows.unit(&name)))
        };
        let value = |letter: &str| or_dash(peak(letter).map(|(p, unit)| quantity(p.value, unit)));
        let time = or_dash(peak("x").map(|(p, _)| rows.moment(p.time)));
        let mut line = vec![
            format!("DOF {dof}"),
            value("x"),
            time,
            value("v"),
            value("a"),
        ];
        if is_completed {
            let residual = rows.digest().residuals.iter().find(|(of, _)| of == dof);
            let unit = rows.unit(&format!("x{dof}"));
            line.push(or_dash(residual.map(|(_, value)| quantity(*value, unit))));
        }
        line
    };
    let lines: Vec<_> = listed.iter().map(line).collect();
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
    table(&heading, &lines) + &note(&format!("{residual}{against}{part}"))
}

/// The displacement of largest magnitude, for the top of the page: DOF, value and its unit. An angle only where no DOF is a
/// translation: the two cannot be compared.
///
/// The summary's peaks cover DOFs that were not recorded; its magnitudes are without a sign.
pub(super) fn largest_displacement<'a>(
    run: &RunView,
    rows: &Rows<'a>,
) -> Option<(u32, f64, &'a str)> {
    let peak = run.summary.as_ref().map(|summary| &summary.peak);
    let recorded = rows.dofs().iter().copied().filter_map(|dof| {
        let name = format!("x{dof}");
        let peak = metrics::peak(&rows.get(&name)?)?;
        Some((dof, peak.value, rows.unit(&name)))
    });
    let listed = peak
        .into_iter()
        .flat_map(|peak| peak.displacement.iter().zip(1..));
    let turns = |dof: u32| peak.is_some_and(|peak| peak.rotations.contains(&(dof as usize)));
    let listed = listed.filter_map(|(value, dof)| {
        let unit = if turns(dof) {
            "rad"
        } else {
            rows.disp_unit(dof)
        };
        Some((dof, (*value)?, unit))
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
