//! The section on the ground motion.

use super::canvas::Ink;
use super::charts::Quantity;
use super::curves::{Curves, Scale};
use super::html::{beside, definitions, details, note, section};
use super::lines::{Line, TimeChart};
use super::metrics;
use super::plots::{WHOLE, history};
use super::response::{amplitudes, curve};
use super::rows::{History, Rows};
use super::shaking::{RATIO, Shaking};
use super::table::{Mark, Thinner};
use super::text::{number, quantity};

/// The ground at the steps before the first of the rows, if it is known: times, values, and the largest of them.
fn before(rows: &Rows<'_>) -> ((Vec<f64>, Vec<f64>), Option<Mark>) {
    let ground = rows.digest().ground_before();
    let step = rows.passed().step_s.unwrap_or(f64::NAN);
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

/// Ground motion, if there was one: of the whole test, also where its first steps are in another folder.
pub(super) fn ground(rows: &Rows<'_>) -> Option<String> {
    let History {
        time,
        values: ground,
    } = rows.history("ground")?;
    let ((time_before, ground_before), peak) = before(rows);
    let is_whole = !ground_before.is_empty();
    let (time, ground) = (
        [&time_before, &*time].concat(),
        [&ground_before, &*ground].concat(),
    );
    let peaks = peak.into_iter().chain(rows.marks("ground").peak);
    let peak = peaks.reduce(|first, then| {
        if then.value.abs() > first.value.abs() {
            then
        } else {
            first
        }
    });
    let peak = peak.filter(|peak| peak.value != 0.0)?;
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
    let mut markup = history((WHOLE, 170.0), "Ground motion over test time", &chart);
    let when = format!(" at {}", rows.moment(peak.time));
    let largest = quantity(peak.value.abs(), unit);
    let in_g = format!(" ({} g)", number(peak.value.abs() / 9.806_65, 3));
    let in_g = if is_base { "" } else { &in_g };
    let mut facts = vec![(name.to_owned(), format!("{largest}{in_g}{when}"))];
    if let Some(shaking) = &rows.digest().shaking {
        facts.extend(measures(shaking));
        markup += &beside("columns", &definitions(&facts));
        markup += &details("Spectra of the ground motion", &pictures(shaking));
    } else {
        markup += &beside("columns", &definitions(&facts));
    }
    let heading = "Ground motion";
    if !is_whole {
        return Some(rows.section(heading, &markup));
    }
    let whole = "Values of the whole test. Steps recorded in another folder use the motion of the test file.";
    Some(section(heading, &(note(whole) + &markup)))
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
    beside("grid", &figures)
        + &note(
            "Response spectrum: exact for a record that is linear between its samples (Nigam and Jennings 1969). Arias intensity: \
             π/(2g) ∫ a² dt; D5–95 is the time from 5 % to 95 % of it. Fourier amplitude: |∫ a e^(−iωt) dt| over the whole \
             test, the largest of each part of the logarithmic axis.",
        )
}
