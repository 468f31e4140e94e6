//! Quantities and times as people read them: a value, an SI prefix and a unit.

/// A quantity for people: four significant digits without trailing zeros, an SI prefix and the unit: `37.5 mm`.
#[must_use]
pub fn quantity(value: f64, unit: &str) -> String {
    let (factor, prefix) = prefix_of(value.abs());
    format!("{} {prefix}{unit}", digits(value / factor))
}

/// A time in s with a fitting unit.
#[must_use]
pub fn duration(seconds: f64) -> String {
    if seconds >= 1.0 || seconds == 0.0 {
        let text = format!("{seconds:.3}");
        format!("{} s", text.trim_end_matches('0').trim_end_matches('.'))
    } else {
        quantity(seconds, "s")
    }
}

/// A range for people, both ends with the prefix of the larger one: `-29.83 to 8.5 mm`, `±150 mm` where they are opposite.
#[must_use]
pub fn quantity_range(low: f64, high: f64, unit: &str) -> String {
    let (factor, prefix) = prefix_of(low.abs().max(high.abs()));
    let [low, high] = [low, high].map(|end| digits(end / factor));
    if low == high {
        return format!("{low} {prefix}{unit}");
    }
    if low.strip_prefix('-') == Some(high.as_str()) {
        format!("±{high} {prefix}{unit}")
    } else {
        format!("{low} to {high} {prefix}{unit}")
    }
}

/// The largest SI prefix, from nano to giga, that leaves at least one before the point. None for 0 and what is not finite.
fn prefix_of(size: f64) -> (f64, &'static str) {
    let prefixes = [
        (1e9, "G"),
        (1e6, "M"),
        (1e3, "k"),
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "µ"),
    ];
    if !size.is_finite() || size == 0.0 {
        return (1.0, "");
    }
    // What rounds up to the next prefix takes that one: 999.97 mm is 1 m.
    let found = prefixes
        .into_iter()
        .find(|(factor, _)| size >= 0.99995 * factor);
    found.unwrap_or((1e-9, "n"))
}

/// Four significant digits without trailing zeros.
#[must_use]
pub fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let magnitude = libm::floor(libm::log10(value.abs())) as i32;
    if !(-5..7).contains(&magnitude) {
        return format!("{value:.3e}");
    }
    let places = usize::try_from(3 - magnitude).unwrap_or(0);
    let text = format!("{value:.places$}");
    if text.contains('.') {
        let text = text.trim_end_matches('0').trim_end_matches('.');
        text.to_owned()
    } else {
        text
    }
}

/// The frequency of a loop for people. A whole number keeps all digits, any other one has four.
#[must_use]
pub fn rate(hz: f64) -> String {
    if hz.fract() == 0.0 && hz < 1e7 {
        format!("{hz:.0} Hz")
    } else {
        format!("{} Hz", digits(hz))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_keep_four_digits_and_no_trailing_zeros() {
        assert_eq!(quantity(0.0375, "m"), "37.5 mm");
        assert_eq!(quantity(-123_456.0, "N"), "-123.5 kN");
        assert_eq!(quantity(0.999_97, "m"), "1 m");
        assert_eq!(quantity(0.0, "m"), "0 m");
        assert_eq!(quantity(-0.0, "m"), "0 m");
        assert_eq!(quantity(f64::NAN, "m"), "NaN m");
        assert_eq!(quantity(3e-12, "m"), "0.003 nm");
        assert_eq!(duration(20.0), "20 s");
        assert_eq!(duration(12.699), "12.699 s");
        assert_eq!(duration(1.0 / 1024.0), "976.6 µs");
        assert_eq!(digits(1.0 / 3.0), "0.3333");
        assert_eq!(digits(20_480.0), "20480");
        assert_eq!(rate(1024.0), "1024 Hz");
        assert_eq!(rate(1000.0 / 3.0), "333.3 Hz");
    }

    #[test]
    fn both_ends_of_a_range_share_a_prefix() {
        assert_eq!(quantity_range(-0.15, 0.15, "m"), "±150 mm");
        assert_eq!(quantity_range(-29.83e-3, 8.5e-3, "m"), "-29.83 to 8.5 mm");
        assert_eq!(quantity_range(-9e-5, 0.0, "m"), "-90 to 0 µm");
        assert_eq!(quantity_range(0.0, 0.0, "N"), "0 N");
    }
}
