//! Numbers and words for readers. Markup escapes them by its type; [`printable`] spells what a browser would obey or hide.

use std::borrow::Cow;

use gusset_quantity::text::is_hidden;

/// Text for a number that does not exist.
pub(super) const NOTHING: &str = "–";

/// A page or a picture with hidden characters spelled: its markup holds none, so they come from a user's text.
pub(super) fn printable(text: &str) -> Cow<'_, str> {
    if text.chars().all(is_shown) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if is_shown(c) {
            out.push(c);
        } else {
            out.extend(c.escape_unicode());
        }
    }
    Cow::Owned(out)
}

/// False for characters that a browser would obey or hide, and for those that XML 1.0 forbids even when escaped.
fn is_shown(c: char) -> bool {
    matches!(c, '\t' | '\n' | '\r') || !(is_hidden(c) || matches!(c, '\u{fffe}' | '\u{ffff}'))
}

/// The first `most` characters, with an ellipsis where something was cut.
pub(super) fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let mut out: String = text.chars().take(most.saturating_sub(1)).collect();
    out.push('…');
    out
}

/// A unit with its decimal prefix, and the divisor of a number in the plain unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scaled {
    /// Divisor.
    pub factor: f64,
    /// Unit with prefix; empty for a pure number.
    pub unit: String,
}

/// The prefix that brings `magnitude` (in `unit`) into 1 … 1000, where the unit takes one.
pub(super) fn scaled(magnitude: f64, unit: &str) -> Scaled {
    let plain = spelled(unit);
    let magnitude = magnitude.abs();
    let takes = ["m", "N", "s", "J", "rad", "W", "V", "A", "Pa", "Hz"]
        .iter()
        .any(|base| {
            plain
                .strip_prefix(base)
                .is_some_and(|rest| !rest.starts_with(char::is_alphanumeric))
        });
    if !(takes && magnitude > 0.0 && magnitude.is_finite()) {
        return Scaled {
            factor: 1.0,
            unit: plain,
        };
    }
    // Kilometres and kiloseconds are hard to read; a speed of 0.3 m/s is read more easily than 300 mm/s.
    let up = !plain.starts_with(['m', 's', 'r']);
    let smallest_plain = if plain.starts_with("m/") { 0.01 } else { 1.0 };
    let (factor, prefix) = match magnitude {
        v if v >= 1e9 && up => (1e9, "G"),
        v if v >= 1e6 && up => (1e6, "M"),
        v if v >= 1e3 && up => (1e3, "k"),
        v if v >= smallest_plain => (1.0, ""),
        v if v >= 1e-3 => (1e-3, "m"),
        v if v >= 1e-6 => (1e-6, "µ"),
        _ => (1e-9, "n"),
    };
    Scaled {
        factor,
        unit: format!("{prefix}{plain}"),
    }
}

/// A unit as printed: "N s/m" with its dot, squares raised, nothing for a pure number.
fn spelled(unit: &str) -> String {
    match unit {
        "1" | "-" => String::new(),
        other => other
            .replace("^2", "²")
            .replace("s2", "s²")
            .replace("N s", "N·s")
            .replace("N m", "N·m"),
    }
}

/// `value` with `digits` significant digits, thousands apart, a true minus sign; a dash if it does not exist.
pub(super) fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NOTHING.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = libm::floor(libm::log10(value.abs())) as i32;
    if !(-5..9).contains(&exponent) {
        let text = format!("{:.*e}", digits.saturating_sub(1), value);
        return text.replace('-', "−");
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    with_sign_and_groups(&format!("{value:.decimals$}"))
}

/// `value` with a fixed number of decimals, as on an axis.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    with_sign_and_groups(if is_zero {
        text.trim_start_matches('-')
    } else {
        &text
    })
}

/// A count with its thousands apart.
pub fn count(value: u64) -> String {
    with_sign_and_groups(&value.to_string())
}

fn with_sign_and_groups(text: &str) -> String {
    let (sign, digits) = text
        .strip_prefix('-')
        .map_or(("", text), |rest| ("−", rest));
    let (whole, rest) = digits.split_at(digits.find('.').unwrap_or(digits.len()));
    let mut out = String::from(sign);
    for (i, c) in whole.chars().enumerate() {
        // Four digits are readable without a space; five and more are not.
        if i > 0 && whole.len() > 4 && (whole.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(c);
    }
    out.push_str(rest);
    out
}

/// `value` in `unit` with the prefix that suits it: "12.3 mm".
pub(super) fn quantity(value: f64, unit: &str) -> String {
    if !value.is_finite() {
        return NOTHING.to_owned();
    }
    let Scaled { factor, unit } = scaled(value, unit);
    if unit.is_empty() {
        number(value, 3)
    } else {
        format!("{}\u{a0}{unit}", number(value / factor, 3))
    }
}

/// `value` in `unit` with all its given digits, for numbers that were chosen and not measured: "976.5625 µs".
pub(super) fn exact(value: f64, unit: &str) -> String {
    let Scaled { factor, unit } = scaled(value, unit);
    format!("{}\u{a0}{unit}", trimmed(value / factor, 9))
}

/// A test time in s with enough digits to distinguish its tick from the next, `tick_s` later; those of [`exact`] where that is
/// not known.
pub(super) fn moment(time: f64, tick_s: Option<f64>) -> String {
    let ticks = tick_s.map(|tick| (time / tick).abs());
    let digits = ticks.filter(|ticks| *ticks >= 1.0 && ticks.is_finite());
    let digits = digits.map_or(9, |ticks| libm::log10(ticks) as usize + 2);
    format!("{}\u{a0}s", trimmed(time, digits))
}

/// `value` with `digits` significant digits at most: no zeros at its end.
pub(super) fn trimmed(value: f64, digits: usize) -> String {
    let text = number(value, digits);
    let (text, power) = text.split_at(text.find('e').unwrap_or(text.len()));
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        text
    };
    format!("{text}{power}")
}

/// A duration in µs with the prefix that suits it: "54 ns", "1.20 ms".
pub(super) fn micros(us: f64) -> String {
    if us == 0.0 {
        "0\u{a0}µs".to_owned()
    } else {
        quantity(us * 1e-6, "s")
    }
}

/// A share as "1.23 %".
pub(super) fn percent(share: f64) -> String {
    format!("{}\u{a0}%", number(100.0 * share, 3))
}

/// A lag; a nanosecond is far below the resolution of a fit through samples.
pub(super) fn lag_words(lag: f64) -> String {
    if lag.abs() < 1e-9 {
        "0\u{a0}s".to_owned()
    } else {
        quantity(lag, "s")
    }
}

/// A text, or a dash where it does not exist.
pub(super) fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| NOTHING.to_owned())
}

/// Equal texts once, each after the names that it belongs to: "a, b: text.".
pub(super) fn named_once(all: impl IntoIterator<Item = (String, String)>) -> Vec<String> {
    let mut told: Vec<(String, Vec<String>)> = Vec::new();
    for (name, text) in all {
        match told.iter_mut().find(|(known, _)| *known == text) {
            Some((_, names)) => names.push(name),
            None => told.push((text, vec![name])),
        }
    }
    let each = told.iter();
    each.map(|(text, names)| format!("{}: {text}.", names.join(", ")))
        .collect()
}

/// "1 tick", "2 ticks".
pub(super) fn plural(n: u64, one: &str, many: &str) -> String {
    format!("{}\u{a0}{}", count(n), if n == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_characters_are_spelled() {
        assert_eq!(
            printable("a\u{0}b\u{200b}c\u{202e}"),
            "a\\u{0}b\\u{200b}c\\u{202e}"
        );
        assert!(matches!(
            printable("12\u{a0}mm, 1\u{202f}000\n"),
            Cow::Borrowed(_)
        ));
    }

    #[test]
    fn quantities_carry_engineering_prefixes() {
        assert_eq!(quantity(0.0123, "m"), "12.3\u{a0}mm");
        assert_eq!(quantity(-45_600.0, "N"), "−45.6\u{a0}kN");
        assert_eq!(quantity(1.19e6, "N/m"), "1.19\u{a0}MN/m");
        assert_eq!(quantity(114.22, "N s/m"), "114\u{a0}N·s/m");
        assert_eq!(quantity(0.35, "m/s^2"), "0.350\u{a0}m/s²");
        assert_eq!(quantity(5.4e-8, "s"), "54.0\u{a0}ns");
        assert_eq!(quantity(1500.0, "m"), "1500\u{a0}m");
        assert_eq!(quantity(1500.0, "kg"), "1500\u{a0}kg");
        assert_eq!(quantity(f64::NAN, "m"), NOTHING);
        assert_eq!(quantity(0.0, "m"), "0\u{a0}m");
        assert_eq!(micros(977.0), "977\u{a0}µs");
    }

    #[test]
    fn a_moment_names_its_tick() {
        for (rate, tick, told) in [
            (200.0, 170_477.0, "852.385"),
            (4096.0, 409_579.0, "99.99487"),
            (4096.0, 10_485_760_001.0, "2\u{202f}560\u{202f}000.00024"),
            (500.0, 83.0, "0.166"),
            (200.0, 0.0, "0"),
        ] {
            let text = moment(tick / rate, Some(1.0 / rate));
            assert_eq!(text, format!("{told}\u{a0}s"));
            assert_ne!(text, moment((tick + 1.0) / rate, Some(1.0 / rate)));
        }
        assert_eq!(moment(852.385, None), "852.385\u{a0}s");
        assert_eq!(moment(f64::NAN, Some(0.1)), format!("{NOTHING}\u{a0}s"));
    }

    #[test]
    fn counts_and_axis_numbers_are_readable() {
        assert_eq!(count(40_960), "40\u{202f}960");
        assert_eq!(count(1024), "1024");
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(fixed(-2.5, 1), "−2.5");
        assert_eq!(number(1e-9, 3), "1.00e−9");
        assert_eq!(trimmed(1e-10, 6), "1e−10");
        assert_eq!(trimmed(-0.030_010, 6), "−0.03001");
        assert_eq!(trimmed(1500.0, 6), "1500");
        assert_eq!(exact(2.135_000_000_000_000_2, "s"), "2.135\u{a0}s");
        assert_eq!(shortened("abcdef", 4), "abc…");
        assert_eq!(plural(1, "tick", "ticks"), "1\u{a0}tick");
    }
}
