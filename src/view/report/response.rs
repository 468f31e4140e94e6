//! The response: histories of the structure, storeys, loops of the specimens, spectra and peaks.

use maud::{Markup, html};

use super::chart::{Chart, Ink, Look, Scale, WHOLE};
use super::columns::{MOST_DOFS, MOST_LINES, Storey, TAIL, spread};
use super::digest::{Digest, WITHOUT_DISP};
use super::frame_shape;
use super::html::{beside, details, note, paragraph, table};
use super::member_loops;
use super::tested::dof as dof_in_words;
use super::text::{count, or_dash, quantity};
use super::tracked::Tracked;
use super::{RunView, limits, metrics};
use gusset_quantity::catalog::ending::Status;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::catalog::phase::Phase;
use gusset_record::summary::LinkCounts;
use gusset_record::{Event, EventLine};

/// Axes that are drawn; a table lists more.
pub(super) const MOST_DRAWN: usize = 8;
/// Trips that are marked in a history.
const MOST_TRIPS: usize = 3;

/// The section; `None` for a test without a structure and without specimens.
pub(super) fn response(run: &RunView, rows: &Digest, axes: &[Tracked<'_>]) -> Option<Markup> {
    let dofs = &rows.dofs;
    let frame = frame_shape::figure(run, rows).unwrap_or_default();
    if dofs.is_empty() && axes.is_empty() && frame.0.is_empty() {
        return None;
    }
    let what = if dofs.is_empty() {
        "measurement"
    } else {
        "response"
    };
    let says = if rows.passed.steps == 0 {
        format!("No row was recorded while the test was running, so there is no {what} to show.")
    } else if rows.get("time").is_none() {
        "The rows have no time column, so no history can be drawn.".to_owned()
    } else {
        String::new()
    };
    if !says.is_empty() && (rows.passed.steps == 0 || !dofs.is_empty()) {
        let markup = html! { (paragraph(&says)) (beside("grid", frame)) };
        return Some(rows.section("Response", markup));
    }
    let shown = spread(dofs, MOST_LINES);
    let loops = loops(run, rows, axes);
    let more = html! {
        (of_dofs(run, rows, &shown, ("v", "Velocity", "velocity")))
        (of_dofs(run, rows, &shown, ("a", "Acceleration", "acceleration")))
        (spectra(rows))
    };
    let markup = html! {
        (of_dofs(run, rows, &shown, ("x", "Displacement", "displacement")))
        (beside("grid", html! { (frame) (loops) (member_loops::figures(run, rows)) (storeys(run, rows)) }))
        @if loops.0.is_empty() && dofs.is_empty() { (paragraph("Nothing was measured.")) }
        (poses(run, rows))
        (storey_peaks(rows))
        @if shown.len() < dofs.len() {
            (note(&format!("The charts show {} of {} recorded DOFs; the samples hold them all.", shown.len(), dofs.len())))
        }
        @if !dofs.is_empty() { (peaks(run, rows, dofs)) }
        (specimens(run, rows, axes))
        (details("Velocities, accelerations and frequency content of all DOFs", more))
        (note_on_histories(rows))
    };
    Some(rows.section("Response", markup))
}

/// Each trip of the running test: its cause and its time.
pub(super) fn trips(run: &RunView) -> Vec<(String, f64, Ink)> {
    let trip = |line: &EventLine| match &line.event {
        Event::Phase {
            to: Phase::Tripped,
            cause,
            ..
        } => {
            let words = Limit::of_key(cause)
                .map_or_else(|| cause.replace('_', " "), |limit| limit.words().to_owned());
            Some((format!("trip: {words}"), line.time?, Ink::Alarm))
        }
        _ => None,
    };
    run.events
        .iter()
        .filter_map(trip)
        .take(MOST_TRIPS)
        .collect()
}

/// A history of columns under their names; empty where none has a number.
pub(super) fn history<'a>(
    run: &RunView,
    rows: &'a Digest,
    title: String,
    up: Scale<'a>,
    columns: impl IntoIterator<Item = (String, String)>,
) -> Chart<'a> {
    let found = columns
        .into_iter()
        .filter_map(|(name, column)| Some((name, rows.history(&column)?)));
    let label = format!("{title} over test time");
    let scale = run
        .test
        .file
        .time
        .as_ref()
        .map_or(1.0, |time| time.scale.0.value());
    let chart = Chart::history(title, up).labelled(label).slower(scale);
    let chart = chart.marks(trips(run));
    found.fold(chart, |chart, (name, of)| {
        chart.with(name, of.time, of.values, Look::Line)
    })
}

/// The histories of one quantity of the DOFs, one chart per unit.
fn of_dofs(
    run: &RunView,
    rows: &Digest,
    shown: &[u32],
    (letter, name, words): (&str, &str, &str),
) -> Markup {
    let column = |dof: &u32| format!("{letter}{dof}");
    let title = format!("{name}{}", measured_against(rows));
    let drawn = units(shown.iter().map(|dof| rows.unit(&column(dof))))
        .into_iter()
        .map(|unit| {
            let own = shown.iter().filter(|dof| rows.unit(&column(dof)) == unit);
            let own = own.map(|dof| (dof_in_words(run, *dof), column(dof)));
            history(run, rows, title.clone(), Scale::new(words, unit), own)
        });
    html! { @for chart in drawn.filter(|chart| !chart.is_empty()) { (chart.figure()) } }
}

/// The reference of displacements, velocities and accelerations, to be added to a title. Empty where the ground rests.
fn measured_against(rows: &Digest) -> &'static str {
    let moves = |name: &String| rows.marks(name).peak.is_some_and(|p| p.value != 0.0);
    let shakes = rows.grounds.iter().any(moves);
    match rows.unit("ground") {
        // Coordinates are absolute where the base is displaced.
        "m" => ", absolute",
        _ if shakes => ", relative to the ground",
        _ => "",
    }
}

/// Each unit once: displacements and rotations do not share an axis of a chart.
fn units<'a>(all: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    all.fold(Vec::new(), |mut units, unit| {
        if !units.contains(&unit) {
            units.push(unit);
        }
        units
    })
}

/// Storeys that have the column.
fn numbers(rows: &Digest, kind: Storey) -> Vec<u32> {
    let has = |storey: &u32| rows.filled(&kind.column(*storey as usize)).is_some();
    (1..).take_while(has).collect()
}

/// Floor acceleration, drift and shear over time, and the profile of the largest drifts.
fn storeys(run: &RunView, rows: &Digest) -> Markup {
    let kinds = [
        (
            Storey::Floor,
            "Absolute floor acceleration",
            "acceleration",
            "floor",
        ),
        (Storey::Drift, "Storey drift", "drift", "storey"),
        (Storey::Shear, "Storey shear", "shear force", "storey"),
    ];
    let drawn = kinds.map(|(kind, title, words, place)| {
        let columns = spread(&numbers(rows, kind), MOST_LINES).into_iter();
        let columns = columns.map(|n| (format!("{place} {n}"), kind.column(n as usize)));
        history(
            run,
            rows,
            title.to_owned(),
            Scale::new(words, rows.unit(&kind.column(1))),
            columns,
        )
        .half(290.0)
    });
    html! {
        @for chart in drawn.iter().filter(|chart| !chart.is_empty()) { (chart.figure()) }
        (profile(rows))
    }
}

/// The largest drift of each storey to either side, over the height; only of several storeys.
fn profile(rows: &Digest) -> Markup {
    let storeys = numbers(rows, Storey::Drift);
    if storeys.len() < 2 {
        return Markup::default();
    }
    let heights: Vec<f64> = storeys.iter().map(|n| f64::from(*n)).collect();
    let most = |of: fn(f64, f64) -> f64| -> Vec<f64> {
        let of_storey = |n: &u32| {
            rows.get(&Storey::Drift.column(*n as usize))
                .unwrap_or_default()
        };
        let values = storeys.iter().map(of_storey);
        values
            .map(|values| {
                values
                    .iter()
                    .copied()
                    .filter(|v| v.is_finite())
                    .fold(0.0, of)
            })
            .collect()
    };
    let across = Scale::new("largest drift", rows.unit(&Storey::Drift.column(1)));
    let up = Scale::new("storey", "").within(Some((0.5, storeys.len() as f64 + 0.5)));
    let chart = Chart::new("Drift profile: largest drift to either side", across, up)
        .with("negative", most(f64::min), heights.clone(), Look::Strong)
        .with("positive", most(f64::max), heights, Look::Strong);
    chart.half(290.0).figure()
}

/// Largest floor acceleration, drift and shear of each storey, the roof first.
fn storey_peaks(rows: &Digest) -> Markup {
    let all = numbers(rows, Storey::Drift);
    if all.is_empty() {
        return Markup::default();
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
        or_dash(
            rows.marks(&name)
                .peak
                .map(|p| quantity(p.value, rows.unit(&name))),
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
    html! {
        (table(&heading, &listed))
        @if listed.len() < all.len() { (note(&format!("{} of {} storeys are listed.", listed.len(), all.len()))) }
    }
}

/// Poses of loading units over time, target and measured, one chart per unit of measure.
fn poses(run: &RunView, rows: &Digest) -> Markup {
    let names = rows.names();
    let targets = names.iter().filter(|name| {
        name.strip_prefix("pose_")
            .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
    });
    let targets: Vec<&String> = targets.take(MOST_DRAWN).collect();
    let drawn = units(targets.iter().map(|name| rows.unit(name)))
        .into_iter()
        .map(|unit| {
            let own = targets.iter().filter(|name| rows.unit(name) == unit);
            let columns = own.flat_map(|name| {
                let coordinate = name["pose_".len()..].replace('_', ".");
                let measured = name.replacen("pose_", "pose_meas_", 1);
                [
                    (format!("target {coordinate}"), (*name).clone()),
                    (format!("measured {coordinate}"), measured),
                ]
            });
            history(
                run,
                rows,
                "Pose of the loading unit".to_owned(),
                Scale::new("pose", unit),
                columns,
            )
        });
    html! { @for chart in drawn.filter(|chart| !chart.is_empty()) { (chart.figure()) } }
}

/// Fourier amplitudes of the displacements.
fn spectra(rows: &Digest) -> Markup {
    let spectra = &rows.spectra;
    let unit_of = |dof: u32| rows.unit(&format!("x{dof}"));
    let drawn = units(spectra.iter().map(|(dof, _)| unit_of(*dof)))
        .into_iter()
        .map(|unit| {
            let own = spectra.iter().filter(|(dof, _)| unit_of(*dof) == unit);
            let own = own.map(|(dof, points)| (format!("DOF {dof}"), points.as_slice()));
            let title = "Frequency content of the displacements: Fourier amplitude";
            amplitudes(
                title,
                "amplitude",
                &format!("{unit} s"),
                own,
                (WHOLE, 260.0),
            )
        });
    html! { @for figure in drawn { (figure) } }
}

/// Fourier amplitudes over frequency; six decades below the largest, since smaller values are roundoff.
pub(super) fn amplitudes<'a>(
    title: &str,
    words: &str,
    unit: &str,
    curves: impl Iterator<Item = (String, &'a [(f64, f64)])>,
    (width, height): (f64, f64),
) -> Markup {
    let curves: Vec<_> = curves.filter(|(_, points)| !points.is_empty()).collect();
    let all = curves
        .iter()
        .flat_map(|(_, points)| points.iter().map(|p| p.1));
    let top = all.filter(|v| v.is_finite()).fold(0.0, f64::max);
    if top <= 0.0 {
        return Markup::default();
    }
    let range = (top > 1e-280 && top < 1e280).then_some((top * 1e-6, top * 2.0));
    let chart = Chart::new(
        title,
        Scale::new("frequency", "Hz").log(),
        Scale::new(words, unit).log().within(range),
    );
    let chart = curves.into_iter().fold(chart, |chart, (name, points)| {
        let (x, y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
        chart.with(name, x, y, Look::Line)
    });
    chart.sized(width, height).figure()
}

fn peaks(run: &RunView, rows: &Digest, dofs: &[u32]) -> Markup {
    // A test that was stopped in motion has no residual displacement.
    let ending = run.summary.as_ref().map(|summary| summary.status);
    let is_completed = ending == Some(Status::Completed);
    let listed = spread(dofs, MOST_DOFS);
    let line = |dof: &u32| {
        let peak = |letter: &str| {
            let name = format!("{letter}{dof}");
            rows.marks(&name).peak.map(|p| (p, rows.unit(&name)))
        };
        let value = |letter: &str| or_dash(peak(letter).map(|(p, unit)| quantity(p.value, unit)));
        let time = or_dash(peak("x").map(|(p, _)| rows.moment(p.time)));
        let mut line = vec![
            dof_in_words(run, *dof),
            value("x"),
            time,
            value("v"),
            value("a"),
        ];
        if is_completed {
            let residual = rows.residuals.iter().find(|(of, _)| of == dof);
            let unit = rows.unit(&format!("x{dof}"));
            line.push(or_dash(residual.map(|(_, value)| quantity(*value, unit))));
        }
        line
    };
    let lines: Vec<_> = listed.iter().map(line).collect();
    let heading = [
        "",
        "peak displacement",
        "at",
        "peak velocity",
        "peak acceleration",
        "residual displacement",
    ];
    let heading = &heading[..if is_completed { 6 } else { 5 }];
    let residual = match is_completed {
        true => format!(
            "Residual: mean of the last {} % of the recorded test.",
            100 / TAIL
        ),
        false => "No residual displacement: the test did not come to its end.".to_owned(),
    };
    let against = match measured_against(rows) {
        "" => String::new(),
        against => format!(
            " Displacements, velocities and accelerations are{}.",
            against.trim_start_matches(',')
        ),
    };
    let part = match listed.len() < dofs.len() {
        true => format!(" {} of {} DOFs are listed.", listed.len(), dofs.len()),
        false => String::new(),
    };
    html! { (table(heading, &lines)) (note(&format!("{residual}{against}{part}"))) }
}

/// Loops of the force over the measured displacement, or over the command where none is measured.
fn loops(run: &RunView, rows: &Digest, axes: &[Tracked<'_>]) -> Markup {
    let drawn = axes
        .iter()
        .filter(|axis| axis.digest.is_drawable())
        .take(MOST_DRAWN);
    let hysteresis = |axis: &Tracked<'_>| {
        let across = match rows.measures_disp(axis.digest.axis) {
            true => "measured displacement",
            false => "command",
        };
        let (disp, force) = &axis.digest.hysteresis;
        Chart::new(
            format!("Hysteresis of {}", axis.name),
            Scale::new(across, axis.disp_unit),
            Scale::new("force", axis.force_unit),
        )
        .labelled(format!("{}: force against {across}", axis.name))
        .with("", disp, force, Look::Line)
        .inked(Ink::Series(1))
        .levels(limits::levels(run, rows, axis, &[Limit::MeasuredForce]))
        .figure()
    };
    html! { @for axis in drawn { (hysteresis(axis)) } }
}

/// Peaks and energy of every axis, losses on the link, and the end that the numbers belong to.
fn specimens(run: &RunView, rows: &Digest, axes: &[Tracked<'_>]) -> Markup {
    if axes.is_empty() {
        return Markup::default();
    }
    let all = rows.all_axes.len();
    let without = |axis: &&Tracked<'_>| !rows.measures_disp(axis.digest.axis);
    html! {
        (unanswered(run, rows))
        (listed(axes))
        @for (axis, scale) in axes.iter().filter_map(|axis| Some((axis, axis.scale?))) {
            (note(&format!("{}, all as the structure sees it: {}.", axis.name, scale.words())))
        }
        @for axis in axes.iter().filter(without) {
            (note(&format!("{}: {WITHOUT_DISP}. Lag, tracking metrics, stiffness, damping and absorbed energy are left out.", axis.name)))
        }
        @if all > MOST_DRAWN { (note(&format!("The charts show {MOST_DRAWN} of {all} axes; the samples hold them all."))) }
        (traffic(run))
    }
}

/// The specimens that did not answer in every tick, and the consequences for the section; empty if all did.
fn unanswered(run: &RunView, rows: &Digest) -> Markup {
    let digest = rows;
    if digest.stale.is_empty() {
        return Markup::default();
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

fn listed(axes: &[Tracked<'_>]) -> Markup {
    let has_way_out = axes.iter().any(|axis| axis.way_out.is_some());
    let row = |axis: &Tracked<'_>| {
        let peak = axis
            .digest
            .peak_disp
            .map(|disp| quantity(disp, axis.disp_unit));
        let force = |found: Option<f64>| or_dash(found.map(|f| quantity(f, axis.force_unit)));
        let absorbed = axis.digest.absorbed.map(|e| quantity(e, axis.work_unit()));
        let mut row = vec![
            axis.name.clone(),
            or_dash(peak),
            force(axis.digest.peak_force),
            or_dash(absorbed),
        ];
        if has_way_out {
            row.push(force(axis.way_out));
        }
        row
    };
    let rows: Vec<_> = axes.iter().map(row).collect();
    let heading = [
        "",
        "peak measured displacement",
        "peak force",
        "absorbed energy",
        "peak force during shutdown",
    ];
    html! {
        (table(&heading[..if has_way_out { 5 } else { 4 }], &rows))
        (note("Absorbed energy: ∮ force d(measured displacement), dissipated and stored at the end."))
    }
}

/// Traffic on the links, by specimen; empty where nothing was counted.
fn traffic(run: &RunView) -> Markup {
    let links = || run.summary.iter().flat_map(|summary| &summary.link);
    let row = |(name, link): (&String, &LinkCounts)| {
        let counts = [link.sent, link.received, link.late, link.lost, link.corrupt];
        let cells = std::iter::once(name.clone()).chain(counts.into_iter().map(count));
        counts.iter().any(|n| *n > 0).then(|| cells.collect())
    };
    let rows: Vec<Vec<String>> = links().filter_map(row).collect();
    if rows.is_empty() {
        return Markup::default();
    }
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
    match links().any(|(_, link)| link.late + link.lost + link.corrupt > 0) {
        true => table,
        false => details(
            "Commands and measurements: none late, lost or corrupt",
            table,
        ),
    }
}

/// A note on the rows that the histories show.
fn note_on_histories(rows: &Digest) -> Markup {
    let every = rows.every;
    if every <= 1 {
        return note(&format!(
            "A history differs from the recorded rows by at most 0.1 % of its largest value, at their times; one that would need \
             more than {} points shows the smallest and the largest value of every few rows.",
            count(super::thin::MOST as u64)
        ));
    }
    let ticks = rows.ticks_per_step.max(1) as f64;
    let apart = rows.passed.step_s.map(|step| step / ticks * every as f64);
    let apart = apart.map_or_else(String::new, |apart| format!(" ({})", quantity(apart, "s")));
    note(&format!(
        "The histories of this long test show the smallest and the largest of every {} rows{apart}, each at its time: no peak is \
         missing. The samples hold every row.",
        count(every as u64)
    ))
}

/// The displacement of largest magnitude, for the top of the page: DOF, value and its unit. An angle only where no DOF is a
/// translation: the two cannot be compared.
///
/// The summary's peaks cover DOFs that were not recorded; its magnitudes are without a sign.
pub(super) fn largest_displacement<'a>(
    run: &RunView,
    rows: &'a Digest,
) -> Option<(u32, f64, &'a str)> {
    let peak = run.summary.as_ref().map(|summary| &summary.peak);
    let recorded = rows.dofs.iter().copied().filter_map(|dof| {
        let name = format!("x{dof}");
        let peak = metrics::peak(rows.get(&name)?)?;
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
