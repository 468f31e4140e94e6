//! Quantities and times as people read them: four significant digits, an SI prefix and a unit.
//!
//! Full precision belongs in files and in `--json`.

use crate::catalog::limit::Limit;

/// Significant digits of a number for people.
const DIGITS: usize = 4;
/// Significant digits of a position that an operator may write into a file.
const POSITION_DIGITS: usize = 7;
/// Most significant digits: those of a double.
const MOST_DIGITS: usize = 17;

/// Digits of a sensor reading that an operator confirms, whatever its noise.
const DIGITS_OF_READING: i32 = 6;
/// Digits of the noise of a reading.
const DIGITS_OF_NOISE: i32 = 2;
/// Ratio of two quantities beyond which one prefix does not fit both.
const ONE_PREFIX: f64 = 1e6;

/// Units that no prefix goes with.
const COUNTS: [&str; 6] = ["", "1", "×", "%", "ticks", "steps"];

/// Units that a prefix goes with.
const PREFIXED: [&str; 9] = ["m", "N", "s", "Hz", "J", "m/s", "m/s²", "m/s2", "rad"];

/// The units of an axis: metres and newtons in one of them, and their symbols.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisUnits {
    /// Metres in one unit of displacement.
    pub metres: f64,
    /// Newtons in one unit of force.
    pub newtons: f64,
    /// Symbol of the unit of displacement.
    pub disp: &'static str,
    /// Symbol of the unit of force.
    pub force: &'static str,
}

impl AxisUnits {
    /// Metres and newtons.
    pub const SI: AxisUnits = AxisUnits {
        metres: 1.0,
        newtons: 1.0,
        disp: "m",
        force: "N",
    };
}

/// A prefix that leaves one to three digits before the point.
fn prefix(size: f64) -> (f64, &'static str) {
    let prefixes = [
        (1e9, "G"),
        (1e6, "M"),
        (1e3, "k"),
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "µ"),
        (1e-9, "n"),
    ];
    // Half of the last digit below a prefix is already written with it: 999.96 is 1 k.
    let rounded = size * (1.0 + 5e-5);
    prefixes
        .into_iter()
        .find(|(factor, _)| rounded >= *factor)
        .unwrap_or((1e-9, "n"))
}

/// A number rounded to `digits` significant digits, without trailing zeros. Very large and small numbers get a power of ten.
fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let scientific = format!("{value:.*e}", digits - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let short = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    if !(-4..7).contains(&exponent) {
        return format!("{}e{exponent}", short(mantissa));
    }
    let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
    short(&format!("{value:.decimals$}"))
}

/// A number with four significant digits: `0.9766`.
#[must_use]
pub fn number(value: f64) -> String {
    significant(value, DIGITS)
}

/// A quantity with four significant digits and a prefix: `37.5 mm`.
#[must_use]
pub fn quantity(value: f64, unit: &str) -> String {
    with_digits(value, unit, prefix(value.abs()), DIGITS)
}

/// A quantity in the unit of an axis. Only an SI unit gets a prefix: `37.5 mm` of 0.0375 m, `37.5 mm` of 37.5 mm.
#[must_use]
pub fn in_axis_unit(value: f64, unit: &str) -> String {
    with_digits(value, unit, prefix_of_unit(value, unit), DIGITS)
}

/// A place of an axis like [`in_axis_unit`], with seven significant digits: an operator may have to write it into a file.
#[must_use]
pub fn position(value: f64, unit: &str) -> String {
    with_digits(value, unit, prefix_of_unit(value, unit), POSITION_DIGITS)
}

fn prefix_of_unit(value: f64, unit: &str) -> (f64, &'static str) {
    if PREFIXED.contains(&unit) {
        prefix(value.abs())
    } else {
        (1.0, "")
    }
}

/// A quantity in the unit of an axis that shows its direction: `+37.5 mm`.
#[must_use]
pub fn signed_in_axis_unit(value: f64, unit: &str) -> String {
    let sign = if value > 0.0 { "+" } else { "" };
    format!("{sign}{}", in_axis_unit(value, unit))
}

/// Two quantities that are compared, with as many digits as show which of them is larger. They share a prefix unless one of
/// them is more than a million times the other.
#[must_use]
pub fn compared(value: f64, bound: f64, unit: &str) -> [String; 2] {
    let [small, large] = {
        let [value, bound] = [value, bound].map(f64::abs);
        [value.min(bound), value.max(bound)]
    };
    if small > 0.0 && large.is_finite() && large > ONE_PREFIX * small {
        return [value, bound].map(|number| quantity(number, unit));
    }
    let prefix = match bound == 0.0 || !bound.is_finite() {
        true => prefix(if large.is_finite() { large } else { small }),
        false => prefix(bound.abs()),
    };
    let both = |digits| [value, bound].map(|number| with_digits(number, unit, prefix, digits));
    (DIGITS..=MOST_DIGITS)
        .map(both)
        .find(|[value, bound]| value != bound)
        .unwrap_or_else(|| both(DIGITS))
}

/// A value, the expected value and the allowed difference, with as many digits as show whether the difference is allowed.
/// The difference of the numbers shown is right to a tenth, and values that differ by more than rounding differ as shown.
#[must_use]
pub fn compared_within(found: f64, expected: f64, within: f64) -> [String; 3] {
    /// Share of the larger value below which a difference is rounding.
    const ROUNDING: f64 = 1e-12;
    /// Share of the difference, or of the allowed one, by which the difference as shown may be wrong.
    const CLOSE: f64 = 0.1;
    let difference = (found - expected).abs();
    let differ = difference > ROUNDING * found.abs().max(expected.abs());
    let each = |digits| [found, expected, within].map(|value| significant(value, digits));
    let tells = |texts: &[String; 3]| {
        let [found, expected, shown_within] = texts
            .each_ref()
            .map(|text| text.parse::<f64>().unwrap_or(f64::NAN));
        let shown = (found - expected).abs();
        let close = (shown - difference).abs() <= CLOSE * difference.max(within);
        (shown <= shown_within) == (difference <= within)
            && (close || !difference.is_finite())
            && (!differ || texts[0] != texts[1])
    };
    (DIGITS..=MOST_DIGITS)
        .map(each)
        .find(tells)
        .unwrap_or_else(|| each(MOST_DIGITS))
}

/// A sensor reading and its noise. The noise has two digits. The reading has the digits that the noise resolves, and at least six.
#[must_use]
pub fn reading(value: f64, noise: Option<f64>) -> [String; 2] {
    let place = |size: f64| libm::log10(size.abs()).floor() as i32;
    let resolved = match noise {
        Some(noise) if value.abs() > 0.0 && noise > 0.0 => {
            place(value) - place(noise) + DIGITS_OF_NOISE
        }
        _ => DIGITS_OF_READING,
    };
    let digits = resolved.clamp(DIGITS_OF_READING, MOST_DIGITS as i32);
    let noise = noise.map_or_else(String::new, |noise| {
        significant(noise, DIGITS_OF_NOISE as usize)
    });
    [significant(value, digits as usize), noise]
}

fn with_digits(value: f64, unit: &str, prefix: (f64, &str), digits: usize) -> String {
    let (factor, prefix) = if value == 0.0 || !value.is_finite() || COUNTS.contains(&unit) {
        (1.0, "")
    } else {
        prefix
    };
    let text = significant(value / factor, digits);
    match unit {
        "" | "1" => text,
        unit => format!("{text} {prefix}{unit}"),
    }
}

/// The unit of a key of the test file: that of its limit, or the unit at its end. Empty for a key without a unit.
#[must_use]
pub fn unit_of_key(key: &str) -> &'static str {
    if let Some(limit) = Limit::of_key(key) {
        return limit.shown_unit();
    }
    let ends = [
        ("_m_per_s2", "m/s²"),
        ("_m_per_s", "m/s"),
        ("_n_per_s", "N/s"),
        ("_n_per_m", "N/m"),
        ("_m", "m"),
        ("_n", "N"),
        ("_s", "s"),
        ("_hz", "Hz"),
    ];
    let found = ends.into_iter().find(|(end, _)| key.ends_with(end));
    found.map_or("", |(_, unit)| unit)
}

/// Units by the end of a key, the longest first.
const UNITS: [(&str, &str); 26] = [
    ("_per_sqrt_m", "1/√m"),
    ("_rad_per_s", "rad/s"),
    ("_n_s_per_m", "N s/m"),
    ("_n_per_m3", "N/m³"),
    ("_m2_per_s3", "m²/s³"),
    ("_m_per_s2", "m/s²"),
    ("_n_per_m", "N/m"),
    ("_n_per_s", "N/s"),
    ("_m_per_s", "m/s"),
    ("_per_s2", "1/s²"),
    ("_per_s", "1/s"),
    ("_m2_s", "m² s"),
    ("_n2_s", "N² s"),
    ("_per_m2", "1/m²"),
    ("_ticks", "ticks"),
    ("_rad", "rad"),
    ("_ppm", "ppm"),
    ("_hz", "Hz"),
    ("_kg", "kg"),
    ("_us", "µs"),
    ("_kb", "kB"),
    ("_m", "m"),
    ("_s", "s"),
    ("_n", "N"),
    ("_j", "J"),
    ("_w", "W"),
];

/// The unit that the name of a key carries, also of a value of a list: N/m for `stiffness_n_per_m[2]`. Empty for a name without
/// one.
#[must_use]
pub fn unit_in_name(key: &str) -> &'static str {
    let is_index = |c: char| c.is_ascii_digit() || matches!(c, '[' | ']' | '.');
    let end = key.trim_end_matches(is_index).len();
    // The digits of `_per_s2` belong to the name.
    let is_list = key[end..].starts_with(['[', '.']);
    let name = if is_list { &key[..end] } else { key };
    let unit = UNITS.iter().find(|(end, _)| name.ends_with(end));
    unit.map_or("", |(_, unit)| *unit)
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
    let largest = low.abs().max(high.abs());
    let (factor, prefix) = match largest.is_finite() && largest > 0.0 {
        true => prefix(largest),
        false => (1.0, ""),
    };
    let [low, high] = [low, high].map(|end| number(end / factor));
    if low == high {
        return format!("{low} {prefix}{unit}");
    }
    if low.strip_prefix('-') == Some(high.as_str()) {
        format!("±{high} {prefix}{unit}")
    } else {
        format!("{low} to {high} {prefix}{unit}")
    }
}

/// The frequency of a loop for people. A whole number keeps all digits, any other one has four.
#[must_use]
pub fn rate(hz: f64) -> String {
    if hz.fract() == 0.0 && hz < 1e7 {
        format!("{hz:.0} Hz")
    } else {
        format!("{} Hz", number(hz))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_four_digits_and_a_prefix() {
        assert_eq!(quantity(0.0375, "m"), "37.5 mm");
        assert_eq!(quantity(-123_456.0, "N"), "-123.5 kN");
        assert_eq!(quantity(-1.011_936_785_625_589_9e3, "m"), "-1.012 km");
        assert_eq!(quantity(0.999_98, "m"), "1 m");
        assert_eq!(quantity(0.0, "m"), "0 m");
        assert_eq!(quantity(-0.0, "m"), "0 m");
        assert_eq!(quantity(3e-12, "m"), "0.003 nm");
        assert_eq!(rate(1024.0), "1024 Hz");
        assert_eq!(rate(1000.0 / 3.0), "333.3 Hz");
        assert_eq!(quantity(f64::NAN, "m"), "NaN m");
        assert_eq!(quantity(1e300, "N"), "1e291 GN");
        assert_eq!(number(19.990_000_000_000_002), "19.99");
        assert_eq!(number(1.5e-9), "1.5e-9");
        assert_eq!(duration(20.0), "20 s");
        assert_eq!(duration(1.0 / 1024.0), "976.6 µs");
    }

    #[test]
    fn value_and_bound_show_their_difference() {
        let text = |value, bound, unit| compared(value, bound, unit).join(" > ");
        assert_eq!(text(-100_856.262, -100_000.0, "N"), "-100.9 kN > -100 kN");
        assert_eq!(text(100_001.0, 100_000.0, "N"), "100.001 kN > 100 kN");
        assert_eq!(text(1e-5 + 1e-18, 1e-5, "m"), "10.000000000001 µm > 10 µm");
        assert_eq!(text(f64::NAN, 1e-5, "m"), "NaN m > 10 µm");
        assert_eq!(text(3.0, 2.0, ""), "3 > 2");
        assert_eq!(text(0.5, 0.0, "m"), "500 mm > 0 m");
        assert_eq!(text(0.0, 0.5, "m"), "0 m > 500 mm");
        assert_eq!(text(f64::INFINITY, 5e-4, "m"), "inf m > 500 µm");
    }

    #[test]
    fn distant_values_have_separate_prefixes() {
        let text = |value, bound, unit| compared(value, bound, unit).join(", allowed ");
        assert_eq!(text(1e300, 4e5, "N"), "1e291 GN, allowed 400 kN");
        assert_eq!(text(-2.5e4, 1e-5, "m"), "-25 km, allowed 10 µm");
        assert_eq!(text(3e-5, 4e5, "N"), "30 µN, allowed 400 kN");
        assert_eq!(text(3e8, 4e5, "N"), "300000 kN, allowed 400 kN");
        assert_eq!(text(1e8, 2.0, "ticks"), "1e8 ticks, allowed 2 ticks");
    }

    #[test]
    fn tolerance_shows_whether_it_is_exceeded() {
        let text = |found, expected, within| compared_within(found, expected, within).join(" ");
        assert_eq!(text(12.5, 12.0, 0.03), "12.5 12 0.03");
        assert_eq!(text(-63_464.4, -63_412.2, 10.0), "-63464 -63412 10");
        assert_eq!(text(12.0301, 12.0, 0.03), "12.0301 12 0.03");
        assert_eq!(text(1234.56, 1234.52, 0.01), "1234.56 1234.52 0.01");
        // Within the tolerance, they differ nonetheless.
        assert_eq!(text(100.001, 100.0, 5.0), "100.001 100 5");
        // Rounding is no difference, unless nothing is allowed.
        assert_eq!(text(0.1 + 0.2, 0.3, 0.01), "0.3 0.3 0.01");
        assert_eq!(
            text(0.1 + 0.2, 0.3, 0.0),
            "0.30000000000000004 0.29999999999999999 0"
        );
        assert_eq!(text(1.0, 1.0, f64::INFINITY), "1 1 inf");
        assert_eq!(
            text(f64::NAN, 1.0, 0.5).split_once(' '),
            Some(("NaN", "1 0.5"))
        );
    }

    #[test]
    fn reading_has_the_digits_of_its_noise() {
        let text = |value, noise| reading(value, Some(noise)).join(" ± ");
        assert_eq!(text(123.456_789, 0.012_34), "123.457 ± 0.012");
        assert_eq!(text(123.456_789_4, 2.345e-5), "123.456789 ± 2.3e-5");
        assert_eq!(text(0.5, 0.0), "0.5 ± 0");
        assert_eq!(text(0.0, 0.001), "0 ± 0.001");
        assert_eq!(text(-63_464.371, 250.0), "-63464.4 ± 250");
        assert_eq!(text(1.0 / 3.0, 1e-300), "0.33333333333333331 ± 1e-300");
        assert_eq!(reading(1.0 / 3.0, None), ["0.333333", ""]);
    }

    #[test]
    fn quantity_keeps_the_unit_of_its_axis() {
        assert_eq!(in_axis_unit(5.000_000_000_000_001, "mm"), "5 mm");
        assert_eq!(in_axis_unit(0.05, "mm"), "0.05 mm");
        assert_eq!(in_axis_unit(0.05, "m"), "50 mm");
        assert_eq!(in_axis_unit(-7.5, "kN"), "-7.5 kN");
        assert_eq!(signed_in_axis_unit(5e-4, "m"), "+500 µm");
        assert_eq!(signed_in_axis_unit(-7.5e3, "N"), "-7.5 kN");
        assert_eq!(signed_in_axis_unit(0.0, "N"), "0 N");
        assert_eq!(position(0.100_041_400_000_1, "m"), "100.0414 mm");
        assert_eq!(position(5.000_000_000_000_001, "mm"), "5 mm");
    }

    #[test]
    fn key_of_a_test_file_ends_with_its_unit() {
        assert_eq!(unit_of_key("command_vel_m_per_s"), "m/s");
        assert_eq!(unit_of_key("measured_force_n"), "N");
        assert_eq!(unit_of_key("stuck_ticks"), "ticks");
        assert_eq!(unit_of_key("added_energy_j"), "J");
        assert_eq!(unit_of_key("command_accel_m_per_s2"), "m/s²");
        assert_eq!(unit_of_key("period_s"), "s");
    }

    #[test]
    fn both_ends_of_a_range_share_a_prefix() {
        assert_eq!(quantity_range(-0.15, 0.15, "m"), "±150 mm");
        assert_eq!(quantity_range(-29.83e-3, 8.5e-3, "m"), "-29.83 to 8.5 mm");
        assert_eq!(quantity_range(-9e-5, 0.0, "m"), "-90 to 0 µm");
        assert_eq!(quantity_range(0.0, 0.0, "N"), "0 N");
    }

    #[test]
    fn name_of_a_key_carries_its_unit() {
        for (key, unit) in [
            ("specimen.0.law.linear.stiffness_n_per_m", "N/m"),
            ("structure.shear_building.mass_kg[2]", "kg"),
            ("structure.shear_building.mass_kg.2", "kg"),
            ("transfer.leakage_per_s", "1/s"),
            ("transfer.valve_stiffness_per_s2", "1/s²"),
            ("damping_n_s_per_m", "N s/m"),
            ("compensation.ats.start[1]", ""),
            ("ratio", ""),
        ] {
            assert_eq!(unit_in_name(key), unit, "{key}");
        }
    }
}
