//! Pictures and numbers of the report.

use super::measure::Measure;
use gusset_view::report::{Curve, Curves, Look, Scale};

/// Width and height of a picture.
const SIZE: (f64, f64) = (640.0, 420.0);

/// A picture of the page.
pub(super) fn picture(
    title: &str,
    across: Scale<'_>,
    up: Scale<'_>,
    curves: &[Curve<'_>],
) -> String {
    let chart = Curves {
        title,
        across,
        up,
        curves,
        logarithmic: false,
        square: false,
    };
    figure(&chart.svg(SIZE.0, SIZE.1, true))
}

/// A picture in its frame.
pub(super) fn figure(svg: &str) -> String {
    format!("<figure>{svg}</figure>\n")
}

pub(super) const fn curve<'a>(name: &'a str, x: &'a [f64], y: &'a [f64], look: Look) -> Curve<'a> {
    Curve { name, x, y, look }
}

/// The axis of a measure.
pub(super) fn of(measure: &Measure) -> Scale<'_> {
    scale(&measure.meaning, &measure.unit)
}

pub(super) fn scale<'a>(words: &'a str, unit: &'a str) -> Scale<'a> {
    let unit = if unit.is_empty() { "1" } else { unit };
    Scale {
        words,
        unit,
        range: None,
    }
}

/// Words with the unit of their numbers.
pub(super) fn headed(words: &str, unit: &str) -> String {
    match unit {
        "" | "1" => words.to_owned(),
        unit => format!("{words} ({unit})"),
    }
}

/// Four significant digits.
pub(super) fn short(value: f64) -> String {
    if !value.is_finite() {
        return if value.is_nan() {
            "–".to_owned()
        } else {
            "∞".to_owned()
        };
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = 3 - value.abs().log10().floor() as i32;
    if (0..=7).contains(&digits) {
        format!("{value:.*}", digits as usize)
    } else {
        format!("{value:.3e}")
    }
}
