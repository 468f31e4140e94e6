//! The section on what shook the ground.

use super::canvas::Ink;
use super::charts::Quantity;
use super::curves::{Curves, Scale};
use super::html::{beside, definitions, note, section};
use super::lines::{Line, TimeChart};
use super::metrics;
use super::plots::history;
use super::response::{amplitudes, curve};
use super::rows::Rows;
use super::shaking::{RATIO, Shaking};
use super::text::{number, quantity};

/// Ground motion, if there was one.
pub(super) fn ground(rows: &Rows<'_>) -> Option<String> {
    let time = rows.get("time")?;
    let ground = rows.filled("ground")?;
    let peak = metrics::peak(&ground).filter(|p| p.value != 0.0)?;
    let is_base = rows.unit("ground") == "m";
    let (words, unit, name) = if is_base {
        ("displacement", "m", "Largest base displacement")
    } else {
        ("acceleration", "m/s^2", "Peak ground acceleration")
    };
    let lines = [Line {
        name: "",
        x: &time,
        y: &ground,
        ink: Ink::Series(3),
        width: 1.1,
    }];
    let chart = TimeChart::history("Ground motion", Quantity { words, unit }, &lines);
    let mut markup = history(220.0, "Ground motion over test time", &chart);
    let when = time
        .get(peak.index)
        .map_or_else(String::new, |t| format!(" at {}", quantity(*t, "s")));
    let largest = quantity(peak.value.abs(), unit);
    let in_g = format!(" ({} g)", number(peak.value.abs() / 9.806_65, 3));
    let in_g = if is_base { "" } else { &in_g };
    let mut facts = vec![(name.to_owned(), format!("{largest}{in_g}{when}"))];
    if let Some(shaking) = &rows.digest().shaking {
        facts.extend(measures(shaking));
        markup += &definitions(&facts);
        markup += &pictures(shaking);
    } else {
        markup += &definitions(&facts);
    }
    Some(section("Ground motion", &markup))
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

fn pictures(shaking: &Shaking) -> String {
    let mut figures = String::new();
    let across = |words, unit| Scale {
        words,
        unit,
        range: None,
    };
    if !shaking.spectrum.is_empty() {
        let x: Vec<f64> = shaking.spectrum.iter().map(|o| o.period).collect();
        let y: Vec<f64> = shaking.spectrum.iter().map(|o| o.pseudo_accel).collect();
        let title = format!("Response spectrum, {} % damping", number(100.0 * RATIO, 1));
        let picture = Curves {
            title: &title,
            across: across("natural period", "s"),
            up: across("pseudo-acceleration", "m/s^2"),
            curves: &[curve("", &x, &y)],
            logarithmic: true,
            square: false,
        };
        figures += &format!("<figure>{}</figure>\n", picture.svg(510.0, 320.0, true));
    }
    let (x, y): (Vec<f64>, Vec<f64>) = shaking.amplitudes.iter().copied().unzip();
    let unit = if shaking.intensity.is_some() {
        "m/s"
    } else {
        "m s"
    };
    if !x.is_empty() {
        let curves = [curve("", &x, &y)];
        let picture = amplitudes("Fourier amplitude", "amplitude", unit, &curves);
        figures += &format!("<figure>{}</figure>\n", picture.svg(510.0, 320.0, true));
    }
    beside("pair", &figures)
        + &note(
            "Response spectrum: exact for a record that is linear between its samples (Nigam and Jennings 1969). Arias intensity: \
             π/(2g) ∫ a² dt; D5–95 is the time from 5 % to 95 % of it. Fourier amplitude: |∫ a e^(−iωt) dt| over the whole \
             test, the largest of each part of the logarithmic axis.",
        )
}
