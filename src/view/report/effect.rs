//! Effect of actuator tracking errors of a test as a whole: the damping of its modes, and its energy.

use maud::{Markup, html};

use super::RunView;
use super::digest::{Digest, MISSING};
use super::html::{details, note, table_without};
use super::text::{NOTHING, percent, plural, quantity};
use super::tracked::Tracked;
use super::tracking::MARGIN;
use gusset_motion::metrics::Judged;
use gusset_motion::metrics::falsified::{Falsified, Margin, together};

/// Modes that are listed; the summary has them all.
const MOST_MODES: usize = 12;

/// Time in which the loop's estimate of a lag forgets, s of test time (see the columns `lag`).
const FORGETS_S: f64 = 2.0;

/// The smallest margin of every axis that has a column of it.
fn margins(run: &RunView, digest: &Digest) -> Vec<Margin> {
    let rows = digest;
    let measured = digest.axes.iter();
    let measured = measured.filter(|axis| digest.measures_disp(axis.axis));
    let watched = measured.filter_map(|axis| {
        let name = axis.axis.column(MARGIN);
        rows.get(&name)?;
        let smallest = rows.marks(&name).least;
        // The floor is that of a fit over the whole test; weights that fade as e^(−t/T) count 2 T of samples.
        let whole = axis
            .tracking
            .as_ref()
            .and_then(|t| Some((t.samples, t.delay_s?.floor?)));
        let floor = whole.zip(axis.dt).map(|((samples, floor), dt)| {
            floor * (samples as f64 * dt / (2.0 * FORGETS_S)).max(1.0).sqrt()
        });
        Some(Margin {
            specimen: run.test.file.specimen_name(axis.axis.specimen),
            axis: axis.axis.axis,
            smallest_s: smallest.map(|mark| mark.value),
            at_s: smallest.map(|mark| mark.time),
            floor_s: floor,
        })
    });
    watched.collect()
}

/// The effect of tracking errors on a test with a structure and specimens that moved; none otherwise.
fn found(run: &RunView, digest: &Digest) -> Option<Falsified> {
    let tracked = || {
        let axes = digest.axes.iter();
        axes.filter_map(|axis| Some((axis.axis, axis.tracking.as_ref()?)))
    };
    let broken: Vec<_> = digest.broken().collect();
    if digest.dofs.is_empty() || (tracked().next().is_none() && broken.is_empty()) {
        return None;
    }
    let errors: Vec<Judged> = tracked().map(|(_, t)| t.energy_error_j).collect();
    let delays: Vec<_> = tracked()
        .filter_map(|(axis, t)| Some((axis.specimen, axis.axis, t.delay_s?)))
        .collect();
    let error = together(&errors);
    let scale = digest.scale;
    let modes: Vec<_> = run
        .modes
        .iter()
        .filter_map(|mode| mode.falsified(&delays))
        .collect();
    let mut missing = Vec::new();
    if !broken.is_empty() {
        missing.push(format!("energy_error_j, modes: {MISSING}"));
    }
    if digest.all_axes.len() > tracked().count() {
        let rest = digest.all_axes.len() - tracked().count();
        missing.push(format!(
            "{} that did not move or {} not judged",
            plural(rest as u64, "axis", "axes"),
            if rest == 1 { "is" } else { "are" }
        ));
    }
    if scale.is_none() {
        let why = run.no_balance.as_deref();
        let why = match digest.passed.missing_steps {
            0 => why.unwrap_or("not every DOF and axis is recorded"),
            _ => MISSING,
        };
        missing.push(format!("energy_error_share: no energy balance, {why}"));
    }
    if modes.is_empty() && broken.is_empty() {
        let why = run.no_modes.as_deref();
        let why = why.unwrap_or("no delay is known");
        missing.push(format!("modes: {why}"));
    }
    let delay_margins = margins(run, digest);
    if delay_margins.is_empty() {
        let why = run.no_margin.as_deref();
        let why = why.unwrap_or("it was not recorded");
        missing.push(format!("delay_margins: {why}"));
    }
    Some(Falsified {
        delay_margins,
        energy_error_j: error,
        energy_error_share: error
            .zip(scale)
            .and_then(|(error, scale)| scale.share(error)),
        energy_scale: scale,
        modes,
        missing,
    })
}

/// The effect of tracking errors on the test as a whole, for `summary.json`; none for a test without a structure.
#[must_use]
pub fn effect(run: &RunView) -> Option<Falsified> {
    found(run, &run.digested())
}

/// The missing values, by the page's names of their summary keys.
fn in_words(missing: &[String]) -> String {
    const NAMES: [(&str, &str); 3] = [
        ("energy_error_j", "energy error"),
        ("energy_error_share", "energy error as a share"),
        ("delay_margins", "margins to critical delays"),
    ];
    let name = |text: &String| {
        let found = NAMES.iter().find(|(key, _)| {
            let rest = text.strip_prefix(key);
            rest.is_some_and(|rest| rest.starts_with([':', ',']))
        });
        found.map_or_else(|| text.clone(), |(key, name)| text.replacen(key, name, 1))
    };
    missing.iter().map(name).collect::<Vec<_>>().join("; ")
}

fn or_dash(value: Option<f64>, write: impl Fn(f64) -> String) -> String {
    value.map_or_else(|| NOTHING.to_owned(), write)
}

/// Value, noise floor and the difference.
fn cells(judged: &Judged, write: impl Fn(f64) -> String) -> [String; 3] {
    [
        write(judged.value),
        or_dash(judged.floor, &write),
        or_dash(judged.corrected, &write),
    ]
}

/// Damping that the delays added to each mode.
fn modes(found: &Falsified, axes: &[Tracked<'_>]) -> Markup {
    if found.modes.is_empty() {
        return Markup::default();
    }
    let listed = found.modes.iter().take(MOST_MODES).enumerate();
    let rows: Vec<Vec<String>> = listed
        .map(|(index, mode)| {
            let head = [
                format!("mode {}", index + 1),
                quantity(mode.frequency_hz, "Hz"),
                percent(mode.damping_ratio),
            ];
            let error = cells(&mode.damping_error, percent);
            head.into_iter().chain(error).collect()
        })
        .collect();
    let heading = [
        "",
        "frequency",
        "damping ratio",
        "added by the delays",
        "noise floor",
        "corrected",
    ];
    let delays = axes.iter().filter_map(|axis| {
        let delay = axis.digest.tracking.as_ref()?.delay_s?;
        Some(format!("{} {}", axis.name, quantity(delay.value, "s")))
    });
    let delays: Vec<_> = delays.take(8).collect();
    let mut words = format!(
        "Damping added by the delays ({}): Δζ ≈ −k τ/(2 ω m) of each mode. Negative: the test had too little damping.",
        delays.join(", ")
    );
    if found.modes.len() > MOST_MODES {
        words += &format!(
            " {MOST_MODES} of {} modes are listed; summary.json has them all.",
            found.modes.len()
        );
    }
    html! { (table_without(NOTHING, "", &heading, &rows)) (note(&words)) }
}

/// How far each axis was from the delay at which the test would have grown.
fn delay_margins(found: &Falsified, rows: &Digest) -> Markup {
    if found.delay_margins.is_empty() {
        return Markup::default();
    }
    let second = |v: f64| quantity(v, "s");
    let listed: Vec<Vec<String>> = found
        .delay_margins
        .iter()
        .map(|margin| {
            let name = if margin.axis == 1 {
                margin.specimen.clone()
            } else {
                format!("{}, axis {}", margin.specimen, margin.axis)
            };
            vec![
                name,
                or_dash(margin.smallest_s, second),
                or_dash(margin.at_s, |time| rows.moment(time)),
                or_dash(margin.floor_s, second),
            ]
        })
        .collect();
    let heading = ["", "smallest delay margin", "at", "noise floor"];
    let words = "Delay margin: critical delay less lag, as fitted over the last seconds of motion while the test ran; below zero \
                 the test is unstable. A dash: every delay was stable, or the motion was too small.";
    html! { (table_without(NOTHING, "", &heading, &listed)) (note(words)) }
}

/// The energy that the transfer systems added, by itself and against that of the test.
fn energy(found: &Falsified) -> Markup {
    let joule = |v: f64| quantity(v, "J");
    let row = |name: &str, cells: [String; 3]| {
        let name = std::iter::once(name.to_owned());
        name.chain(cells).collect::<Vec<_>>()
    };
    let error = found.energy_error_j;
    let error = error.map(|error| row("energy error of all axes", cells(&error, joule)));
    let share = found.energy_error_share;
    let share = share.map(|share| {
        row(
            "over input and largest strain energy",
            cells(&share, percent),
        )
    });
    let rows: Vec<_> = error.into_iter().chain(share).collect();
    if rows.is_empty() {
        return Markup::default();
    }
    let scale = found.energy_scale.map_or_else(String::new, |scale| {
        format!(
            " Largest input energy {}; largest strain energy ½ xᵀKx {}, K the stiffness of the structure and its specimens at rest.",
            joule(scale.input_energy_j),
            joule(scale.strain_energy_j)
        )
    });
    let words = format!(
        "Energy error: ∫ f d(measured − target), positive where the transfer systems added energy (Mosqueda et al. 2007).{scale}"
    );
    let heading = ["", "value", "noise floor", "corrected"];
    html! { (table_without(NOTHING, "", &heading, &rows)) (note(&words)) }
}

/// The part of a page; nothing for a test without a structure, without specimens or without any tracking error.
pub(super) fn effect_of_errors(run: &RunView, rows: &Digest, axes: &[Tracked<'_>]) -> Markup {
    let Some(found) = found(run, rows) else {
        return Markup::default();
    };
    if !axes.is_empty() && axes.iter().all(Tracked::is_ideal) {
        return Markup::default();
    }
    html! {
        h3 { "Effect of actuator tracking errors" }
        (modes(&found, axes))
        (delay_margins(&found, rows))
        (details("Energy error, and the energy that it is compared with", energy(&found)))
        @if !found.missing.is_empty() { (note(&format!("Unknown: {}.", in_words(&found.missing)))) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_does_not_name_keys_of_the_summary() {
        let missing = [
            "energy_error_j, modes: why",
            "energy_error_share: no balance",
            "delay_margins: too large",
            "2 axes that did not move",
        ];
        assert_eq!(
            in_words(&missing.map(str::to_owned)),
            "energy error, modes: why; energy error as a share: no balance; margins to critical delays: too large; \
             2 axes that did not move"
        );
    }
}
