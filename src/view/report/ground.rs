//! The section on the ground motion.

use maud::{Markup, html};

use super::chart::{Chart, HALF, Ink, Look, Scale};
use super::digest::Digest;
use super::html::{beside, definitions, details, note, section};
use super::response::{amplitudes, trips};
use super::rows::History;
use super::shaking::{RATIO, Shaking};
use super::table::{Mark, Thinner};
use super::text::{number, quantity};
use super::{RunView, metrics};

/// The ground at the steps before the first of the rows, if it is known: times, values, and the largest of them.
fn before(rows: &Digest, column: usize) -> ((Vec<f64>, Vec<f64>), Option<Mark>) {
    let ground = rows.ground_before(column);
    let step = rows.passed.step_s.unwrap_or(f64::NAN);
    let time: Vec<f64> = (0..ground.len()).map(|k| k as f64 * step).collect();
    let peak = metrics::peak(ground).map(|peak| Mark {
        time: peak.index as f64 * step,
        value: peak.value,
    });
    let mut thinner = Thinner::new(ground.len() as u64, 2, Some(0));
    thinner.take(&[&time, ground]);
    let (own, values) = thinner.finish().pop().unwrap_or_default();
    (
        if own.is_empty() {
            (time, values)
        } else {
            (own, values)
        },
        peak,
    )
}

/// Ground motion, if there was one: of the whole test, also where its first steps are in another folder. Each column has a chart.
pub(super) fn ground(run: &RunView, rows: &Digest) -> Option<Markup> {
    let columns = rows.grounds.iter().enumerate();
    let all = columns.filter_map(|(place, column)| component(run, rows, place, column));
    let all: Vec<(Markup, bool)> = all.collect();
    let is_whole = all.iter().any(|(_, is_whole)| *is_whole);
    if all.is_empty() {
        return None;
    }
    let markup = html! {
        @if is_whole { (note("Values of the whole test. Steps recorded in another folder use the motion of the test file.")) }
        @for (part, _) in &all { (part) }
    };
    Some(match is_whole {
        true => section("Ground motion", markup),
        false => rows.section("Ground motion", markup),
    })
}

/// The motion in one column, if there is one, and whether it is that of the whole test.
fn component(run: &RunView, rows: &Digest, place: usize, column: &str) -> Option<(Markup, bool)> {
    let History {
        time,
        values: ground,
    } = rows.history(column)?;
    let ((time_before, ground_before), peak) = before(rows, place);
    let is_whole = !ground_before.is_empty();
    let (time, ground) = (
        [&time_before, time].concat(),
        [&ground_before, ground].concat(),
    );
    let peaks = peak.into_iter().chain(rows.marks(column).peak);
    // The first of equals.
    let peak = peaks.reduce(|first, then| {
        if then.value.abs() > first.value.abs() {
            then
        } else {
            first
        }
    });
    let peak = peak.filter(|peak| peak.value != 0.0)?;
    let is_base = rows.unit(column) == "m";
    let (words, unit, name) = match is_base {
        true => ("displacement", "m", "Largest base displacement"),
        false => ("acceleration", "m/s^2", "Peak ground acceleration"),
    };
    let which = match column.strip_prefix("ground_") {
        Some(component) => format!(", {component}"),
        None => String::new(),
    };
    let chart = Chart::history(format!("Ground motion{which}"), Scale::new(words, unit))
        .labelled(format!("Ground motion{which} over test time"))
        .with("", time, ground, Look::Line)
        .inked(Ink::Series(3))
        .marks(trips(run))
        .sized(super::chart::WHOLE, 170.0);
    let largest = quantity(peak.value.abs(), unit);
    let in_g = format!(" ({} g)", number(peak.value.abs() / 9.806_65, 3));
    let in_g = if is_base { "" } else { &in_g };
    let mut facts = vec![(
        name.to_owned(),
        format!("{largest}{in_g} at {}", rows.moment(peak.time)),
    )];
    let mut shaking = rows.shaking.iter();
    let shaking = shaking.find(|(own, _)| own == column).map(|(_, one)| one);
    facts.extend(shaking.into_iter().flat_map(measures));
    let spectra = shaking.map(spectra).unwrap_or_default();
    let markup = html! {
        (chart.figure())
        (beside("columns", definitions(&facts)))
        (details("Spectra of the ground motion", spectra))
    };
    Some((markup, is_whole))
}

fn measures(shaking: &Shaking) -> Vec<(String, String)> {
    let Some(found) = shaking.intensity else {
        return Vec::new();
    };
    let until = found.significant_from + found.significant_duration;
    [
        ("Arias intensity", quantity(found.arias, "m/s")),
        (
            "Significant duration D5–95",
            format!(
                "{}, from {} to {} of the record",
                quantity(found.significant_duration, "s"),
                quantity(found.significant_from, "s"),
                quantity(until, "s")
            ),
        ),
        (
            "Cumulative absolute velocity",
            quantity(found.cumulative_velocity, "m/s"),
        ),
    ]
    .map(|(name, text)| (name.to_owned(), text))
    .into()
}

fn spectra(shaking: &Shaking) -> Markup {
    let (x, y): (Vec<f64>, Vec<f64>) = shaking
        .spectrum
        .iter()
        .map(|o| (o.period, o.pseudo_accel))
        .unzip();
    let title = format!("Response spectrum, {} % damping", number(100.0 * RATIO, 1));
    let (across, up) = (
        Scale::new("natural period", "s").log(),
        Scale::new("pseudo-acceleration", "m/s^2").log(),
    );
    let response = Chart::new(title, across, up).with("", x, y, Look::Line);
    let unit = if shaking.intensity.is_some() {
        "m/s"
    } else {
        "m s"
    };
    let motion = std::iter::once((String::new(), shaking.amplitudes.as_slice()));
    let figures = html! {
        @if !response.is_empty() { (response.figure()) }
        (amplitudes("Fourier amplitude", "amplitude", unit, motion, (HALF, 320.0)))
    };
    html! {
        (beside("grid", figures))
        (note(
            "Response spectrum: exact for a record that is linear between its samples (Nigam and Jennings 1969). Arias intensity: \
             π/(2g) ∫ a² dt; D5–95 is the time from 5 % to 95 % of it. Fourier amplitude: |∫ a e^(−iωt) dt| over the whole \
             test, the largest of each part of the logarithmic axis."
        ))
    }
}
