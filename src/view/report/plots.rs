//! Histories that can be zoomed: a picture for paper and for readers without a script, and the same numbers for the script.
//!
//! The numbers stand in the page as base64 of little-endian floats in a block that no browser executes. Single precision:
//! seven digits are more than any picture shows; time, which needs more, is its start and its step, or double precision.

use std::fmt::Write as _;

use serde_json::json;

use super::axis::extent;
use super::canvas::{Ink, Skin, picture};
use super::charts::Area;
use super::lines::{Reduce, TimeChart};
use super::text::scaled;

/// Steps of time that differ by less than this share of a step are even.
const EVEN: f64 = 0.02;

/// Width of a history over the whole page, and of one of two side by side, in display units.
pub(super) const WHOLE: f64 = 1040.0;
pub(super) const HALF: f64 = 510.0;

/// A history of this size; `label` is what a screen reader says.
pub(super) fn history((width, height): (f64, f64), label: &str, chart: &TimeChart<'_>) -> String {
    let svg = picture(width, height, Skin::Page, label, |canvas| {
        chart.draw(canvas, Area::whole(width, height));
    });
    let data = data(height, label, chart);
    format!("<figure class=\"history\">{svg}{data}</figure>\n")
}

/// A history without numbers for the script: it cannot be zoomed, and is small.
pub(super) fn still(label: &str, chart: &TimeChart<'_>) -> String {
    let svg = picture(WHOLE, 200.0, Skin::Page, label, |canvas| {
        chart.draw(canvas, Area::whole(WHOLE, 200.0));
    });
    format!("<figure>{svg}</figure>\n")
}

fn data(height: f64, label: &str, chart: &TimeChart<'_>) -> String {
    let Some(first) = chart.lines.first() else {
        return String::new();
    };
    let shared = chart.lines.iter().all(|line| std::ptr::eq(line.x, first.x));
    let is_log = chart.reduce == Reduce::Highest;
    let values = || chart.lines.iter().flat_map(|line| line.y.iter().copied());
    let (Some((lo, hi)), true) = (extent(values()), shared && first.x.len() > 1) else {
        return String::new();
    };
    let unit = if is_log {
        super::text::Scaled {
            factor: 1e-6,
            unit: "µs".to_owned(),
        }
    } else {
        scaled(lo.abs().max(hi.abs()), chart.up.unit)
    };
    let axis = match (is_log, unit.unit.as_str()) {
        (true, _) => format!("{} (µs)", chart.up.words),
        (false, "") => chart.up.words.to_owned(),
        (false, unit) => format!("{} ({unit})", chart.up.words),
    };
    let series = chart.lines.iter().map(|line| {
        json!({
            "name": if line.name.is_empty() { chart.up.words } else { line.name },
            "ink": variable(line.ink),
            "width": line.width,
            "y": floats(line.y.iter().map(|y| if is_log && *y <= 0.0 { f64::NAN } else { y / unit.factor })),
        })
    });
    let n = first.x.len();
    let step = (first.x[n - 1] - first.x[0]) / (n - 1) as f64;
    let is_even = |(i, t): (usize, &f64)| (t - (first.x[0] + i as f64 * step)).abs() <= EVEN * step;
    let time = if step > 0.0 && first.x.iter().enumerate().all(is_even) {
        json!({ "start": first.x[0], "step": step, "count": n })
    } else {
        json!({ "values": doubles(first.x) })
    };
    let data = json!({
        "title": chart.title,
        "label": label,
        "axis": axis,
        "height": height,
        "log": is_log,
        "time": time,
        "series": series.collect::<Vec<_>>(),
        "marks": chart.marks.iter().filter(|t| t.is_finite()).collect::<Vec<_>>(),
    });
    format!(
        "<script type=\"application/json\">{}</script>",
        harmless(&data.to_string())
    )
}

/// JSON that stands in a page: nothing in it can end the block.
fn harmless(json: &str) -> String {
    json.replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026")
}

/// The style sheet's name of a colour.
fn variable(ink: Ink) -> String {
    match ink {
        Ink::Text => "--text".to_owned(),
        Ink::Soft => "--soft".to_owned(),
        Ink::Grid => "--grid".to_owned(),
        Ink::Frame => "--frame".to_owned(),
        Ink::Alarm => "--alarm".to_owned(),
        Ink::Series(i) => format!("--s{}", i % 6),
    }
}

fn floats(values: impl Iterator<Item = f64>) -> String {
    let bytes: Vec<u8> = values.flat_map(|v| (v as f32).to_le_bytes()).collect();
    base64(&bytes)
}

fn doubles(values: &[f64]) -> String {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    base64(&bytes)
}

/// RFC 4648, with padding.
pub(super) fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let at = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let word = at(0) << 16 | at(1) << 8 | at(2);
        for i in 0..4 {
            let digit = (word >> (18 - 6 * i)) & 63;
            out.push(if i <= chunk.len() {
                char::from(ALPHABET[digit as usize])
            } else {
                '='
            });
        }
    }
    out
}

/// A note on what the pictures of a long test show; nothing for a test of which every row is drawn.
pub(super) fn note_on_extremes(every: usize) -> String {
    let mut out = String::new();
    if every > 1 {
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "<p class=\"note\">The histories show the smallest and the largest of every {every} rows: no peak is missing. The \
             samples hold them all.</p>"
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::charts::Quantity;
    use super::super::lines::Line;
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        // RFC 4648, section 10.
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn a_name_cannot_end_the_block_of_numbers() {
        let (x, y) = ([0.0, 1.0, 2.0], [1.0, f64::NAN, 3.0]);
        let lines = [Line {
            name: "</script><script>alert(1)</script>",
            x: &x,
            y: &y,
            ink: Ink::Series(7),
            width: 1.0,
        }];
        let chart = TimeChart::history(
            "<!--",
            Quantity {
                words: "displacement",
                unit: "m",
            },
            &lines,
        );
        let page = history((WHOLE, 200.0), "a & b", &chart);
        assert_eq!(page.matches("<script").count(), 1);
        assert_eq!(page.matches("</script>").count(), 1);
        assert!(
            !page.contains("<!--") && page.contains("\"--s1\"") && page.contains("\"step\":1.0")
        );
    }
}
