//! Histories that can be zoomed: a picture for paper and for readers without a script, and the same numbers for the script.
//!
//! The page holds the numbers as base64 of little-endian floats in a block that no browser executes. Single precision: seven
//! digits are more than any picture shows. Time needs more: it is counted in its interval, or in double precision.

use serde_json::{Value, json};

use super::axis::extent;
use super::canvas::{Ink, Skin, picture};
use super::charts::Area;
use super::html::note;
use super::lines::{Reduce, TimeChart};
use super::rows::Rows;
use super::text::{count, quantity, scaled};
use super::{metrics, thin};

/// Steps of time that differ by less than this share of a step are even.
const EVEN: f64 = 0.02;

/// Width of a history over the whole page, and of one of two side by side, in display units.
pub(super) const WHOLE: f64 = 1040.0;
pub(super) const HALF: f64 = 510.0;

/// A history of this size; `label` is the text for screen readers.
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

/// Largest share of a line's peak by which the embedded line may miss a row, at its time.
const EXACT: f64 = 1e-3;

fn data(height: f64, label: &str, chart: &TimeChart<'_>) -> String {
    let is_log = chart.reduce == Reduce::Highest;
    let values = || chart.lines.iter().flat_map(|line| line.y.iter().copied());
    let has_length = chart.lines.iter().any(|line| line.x.len() > 1);
    let Some((lo, hi)) = extent(values()).filter(|_| has_length) else {
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
        let peak = metrics::peak(line.y).map_or(0.0, |peak| peak.value.abs());
        let kept = thin::followed(line.x, line.y, EXACT * peak);
        let (x, y): (Vec<f64>, Vec<f64>) = kept.into_iter().unzip();
        json!({
            "name": if line.name.is_empty() { chart.up.words } else { line.name },
            "ink": variable(line.ink),
            "width": line.width,
            "time": times(&x),
            "y": floats(y.iter().map(|y| if is_log && *y <= 0.0 { f64::NAN } else { y / unit.factor })),
        })
    });
    let data = json!({
        "title": chart.title,
        "label": label,
        "axis": axis,
        "unit": unit.unit,
        "factor": unit.factor,
        "height": height,
        "log": is_log,
        "series": series.collect::<Vec<_>>(),
        "marks": chart.marks.iter().filter(|t| t.is_finite()).collect::<Vec<_>>(),
    });
    format!(
        "<script type=\"application/json\">{}</script>",
        harmless(&data.to_string())
    )
}

/// Times in rising order: start, interval and how many intervals each is after the one before it (base 128, the lower seven bits
/// first, the eighth bit set where more follow). Where they lie on no grid, in double precision.
fn times(x: &[f64]) -> Value {
    let doubles = || {
        let bytes: Vec<u8> = x.iter().flat_map(|v| v.to_le_bytes()).collect();
        json!({ "values": base64(&bytes) })
    };
    let (Some(&start), Some(&end)) = (x.first(), x.last()) else {
        return doubles();
    };
    let Some(step) = interval(x) else {
        return doubles();
    };
    let places: Vec<f64> = x.iter().map(|t| ((t - start) / step).round()).collect();
    let is_on_grid = |(t, place): (&f64, &f64)| (t - (start + place * step)).abs() <= EVEN * step;
    if !(end > start && x.iter().zip(&places).all(is_on_grid)) {
        return doubles();
    }
    let mut bytes = Vec::with_capacity(x.len());
    let mut before = 0.0;
    for place in places {
        let mut apart = (place - before) as u64;
        before = place;
        while apart >= 128 {
            bytes.push(apart as u8 | 128);
            apart >>= 7;
        }
        bytes.push(apart as u8);
    }
    json!({ "start": start, "step": step, "apart": base64(&bytes) })
}

/// The largest interval that all of these times are multiples of.
fn interval(x: &[f64]) -> Option<f64> {
    let span = x.last()? - x.first()?;
    let mut common = 0.0;
    for pair in x.windows(2) {
        let (mut a, mut b): (f64, f64) = (pair[1] - pair[0], common);
        while b > EVEN * a.max(b) && b > 0.0 {
            let times = (a / b).round();
            (a, b) = (b, (a - times * b).abs());
            if b <= 1e-3 * a {
                b = 0.0;
            }
        }
        common = a.max(0.0);
        // Not a grid, or one too fine to be coded.
        if common > 0.0 && span / common > 1e12 {
            return None;
        }
    }
    let steps = (span / common).round();
    (common > 0.0 && steps >= 1.0).then(|| span / steps)
}

/// JSON for a page: nothing in it can end the block.
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

/// A note on the rows that the histories show.
pub(super) fn note_on_histories(rows: &Rows<'_>) -> String {
    let every = rows.digest().every;
    if every <= 1 {
        return note(
            "A zoomed history differs from the recorded rows by at most 0.1 % of its largest value, at their times.",
        );
    }
    let ticks = rows.digest().ticks_per_step.max(1) as f64;
    let apart = rows.passed().step_s.map(|step| step / ticks * every as f64);
    let apart = apart.map_or_else(String::new, |apart| format!(" ({})", quantity(apart, "s")));
    note(&format!(
        "The histories of this long test show the smallest and the largest of every {} rows{apart}, each at its time: no peak is \
         missing. The samples hold every row.",
        count(every as u64)
    ))
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
