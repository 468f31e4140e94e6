//! Pictures and numbers of the report.

use super::measure::Measure;
use crate::view::report::{Curve, Curves, Scale};

/// Size of a picture.
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
    format!("<figure>{}</figure>\n", chart.svg(SIZE.0, SIZE.1, true))
}

pub(super) fn of(measure: &Measure) -> Scale<'_> {
    scale(&measure.name, &measure.unit)
}

pub(super) fn scale<'a>(words: &'a str, unit: &'a str) -> Scale<'a> {
    let unit = if unit.is_empty() { "1" } else { unit };
    Scale {
        words,
        unit,
        range: None,
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
