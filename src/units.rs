//! Quantities and times as people read them: a value, an SI prefix and a unit.

/// A quantity with a prefix that leaves one to three digits before the point: `37.5000 mm`.
#[must_use]
pub fn quantity(value: f64, unit: &str) -> String {
    let size = value.abs();
    if !value.is_finite() || size == 0.0 {
        return format!("{value} {unit}");
    }
    let prefixes = [
        (1e9, "G"),
        (1e6, "M"),
        (1e3, "k"),
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "µ"),
        (1e-9, "n"),
    ];
    let (factor, prefix) = prefixes
        .into_iter()
        .find(|(factor, _)| size >= *factor)
        .unwrap_or((1e-9, "n"));
    format!("{:.4} {prefix}{unit}", value / factor)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_one_to_three_digits_before_the_point() {
        assert_eq!(quantity(0.0375, "m"), "37.5000 mm");
        assert_eq!(quantity(-123_456.0, "N"), "-123.4560 kN");
        assert_eq!(quantity(0.0, "m"), "0 m");
        assert_eq!(quantity(f64::NAN, "m"), "NaN m");
        assert_eq!(duration(20.0), "20 s");
        assert_eq!(duration(1.0 / 1024.0), "976.5625 µs");
    }
}
