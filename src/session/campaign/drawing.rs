//! Axes and numbers of the report.

use super::measure::Measure;
use gusset_view::report::{Chart, Scale};

/// A chart of the page.
pub(super) fn chart<'a>(title: String, across: Scale<'a>, up: Scale<'a>) -> Chart<'a> {
    Chart::new(title, across, up).sized(760.0, 400.0)
}

/// The axis of a measure.
pub(super) fn of(measure: &Measure) -> Scale<'_> {
    scale(&measure.meaning, &measure.unit)
}

pub(super) fn scale<'a>(words: &'a str, unit: &'a str) -> Scale<'a> {
    Scale::new(words, if unit.is_empty() { "1" } else { unit })
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
    let digits = 3 - libm::log10(value.abs()).floor() as i32;
    if (0..=7).contains(&digits) {
        format!("{value:.*}", digits as usize)
    } else {
        format!("{value:.3e}")
    }
}
