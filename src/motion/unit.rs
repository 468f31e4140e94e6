//! Units in which people keep motions, and the quantities they measure.
//!
//! All internal values are in SI units. A unit is a key beside its number, and is never guessed.

use Quantity::{Acceleration, Displacement, Force, Velocity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Standard acceleration of gravity in m/s² (CGPM 1901): what `g` means here.
pub const STANDARD_GRAVITY: f64 = 9.806_65;
/// Short name of [`STANDARD_GRAVITY`] for the table of units.
const G: f64 = STANDARD_GRAVITY;

/// A unit of time as headers spell it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TimeUnit {
    /// Seconds in `parts` of this unit.
    seconds: f64,
    /// See `seconds`: dividing by a thousand rounds once, multiplying by 0.001 twice.
    parts: f64,
}

/// Spellings of a unit of time, its seconds, and in how many of it.
const TIMES: [(&str, f64, f64); 7] = [
    ("s sec secs second seconds", 1.0, 1.0),
    (
        "ms msec msecs millisec millisecs millisecond milliseconds",
        1.0,
        1e3,
    ),
    ("us µs μs usec usecs microsecond microseconds", 1.0, 1e6),
    ("ns nsec nsecs nanosecond nanoseconds", 1.0, 1e9),
    ("min mins minute minutes", 60.0, 1.0),
    ("h hr hrs hour hours", 3600.0, 1.0),
    ("d day days", 86_400.0, 1.0),
];

impl TimeUnit {
    /// The second.
    pub const SECOND: Self = Self {
        seconds: 1.0,
        parts: 1.0,
    };

    /// Reads `s`, `msec`, `Minutes`, with or without brackets.
    #[must_use]
    pub(crate) fn from_header(text: &str) -> Option<Self> {
        let plain = without_brackets(text).to_lowercase();
        let plain = plain.strip_prefix("in ").unwrap_or(&plain).trim_start();
        TIMES
            .iter()
            .find(|(spellings, ..)| spellings.split(' ').any(|one| one == plain))
            .map(|&(_, seconds, parts)| Self { seconds, parts })
    }

    /// True of a unit shorter than the second.
    #[must_use]
    pub(crate) const fn is_fraction(self) -> bool {
        self.parts > 1.0
    }

    /// Converts a time from this unit to s.
    #[must_use]
    pub(crate) fn to_seconds(self, time: f64) -> f64 {
        time * self.seconds / self.parts
    }

    /// Converts a time from s to this unit.
    #[must_use]
    pub(crate) fn of_seconds(self, seconds: f64) -> f64 {
        seconds * self.parts / self.seconds
    }
}

/// The text without blanks, brackets, quotes and a full stop around it.
fn without_brackets(text: &str) -> &str {
    let is_around = |c: char| c.is_whitespace() || "()[]{}<>\"'.:,;".contains(c);
    text.trim_matches(is_around)
}

/// True of a header's word for another unit of time than the second.
#[must_use]
pub(crate) fn is_time_but_no_second(text: &str) -> bool {
    TimeUnit::from_header(text).is_some_and(|unit| unit != TimeUnit::SECOND)
}

/// Quantity of a signal. Its place in the file determines it, and its SI unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// m/s².
    Acceleration,
    /// m/s.
    Velocity,
    /// m.
    Displacement,
    /// N.
    Force,
}

/// Every unit in the order of [`Unit`]: its spelling in a test file, its quantity, and SI units in one of it.
const UNITS: [(Unit, &str, Quantity, f64); 23] = [
    (Unit::MetrePerSecond2, "m/s2", Acceleration, 1.0),
    (Unit::Gravity, "g", Acceleration, G),
    (Unit::MilliGravity, "mg", Acceleration, G / 1000.0),
    (Unit::PercentGravity, "%g", Acceleration, G / 100.0),
    (Unit::TenthGravity, "g/10", Acceleration, G / 10.0),
    (Unit::Gal, "gal", Acceleration, 0.01),
    (Unit::CentimetrePerSecond2, "cm/s2", Acceleration, 0.01),
    (Unit::MillimetrePerSecond2, "mm/s2", Acceleration, 0.001),
    (Unit::InchPerSecond2, "in/s2", Acceleration, 0.0254),
    (Unit::FootPerSecond2, "ft/s2", Acceleration, 0.3048),
    (Unit::MetrePerSecond, "m/s", Velocity, 1.0),
    (Unit::CentimetrePerSecond, "cm/s", Velocity, 0.01),
    (Unit::MillimetrePerSecond, "mm/s", Velocity, 0.001),
    (Unit::InchPerSecond, "in/s", Velocity, 0.0254),
    (Unit::Metre, "m", Displacement, 1.0),
    (Unit::Centimetre, "cm", Displacement, 0.01),
    (Unit::Millimetre, "mm", Displacement, 0.001),
    (Unit::Inch, "in", Displacement, 0.0254),
    (Unit::Foot, "ft", Displacement, 0.3048),
    (Unit::Newton, "N", Force, 1.0),
    (Unit::Kilonewton, "kN", Force, 1000.0),
    (Unit::PoundForce, "lbf", Force, 4.448_221_615_260_5),
    (Unit::Kip, "kip", Force, 4_448.221_615_260_5),
];

impl Quantity {
    /// Its SI unit.
    #[must_use]
    pub const fn si_unit(self) -> &'static str {
        match self {
            Self::Acceleration => "m/s²",
            Self::Velocity => "m/s",
            Self::Displacement => "m",
            Self::Force => "N",
        }
    }

    /// The units of it as the test file spells them, with commas between.
    #[must_use]
    pub fn spellings(self) -> String {
        let units = UNITS.iter().filter(|(_, _, quantity, _)| *quantity == self);
        units.map(|unit| unit.1).collect::<Vec<_>>().join(", ")
    }
}

impl std::fmt::Display for Quantity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Acceleration => "an acceleration",
            Self::Velocity => "a velocity",
            Self::Displacement => "a displacement",
            Self::Force => "a force",
        })
    }
}

/// Unit of acceleration, velocity, displacement or force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Unit {
    /// Metre per second squared.
    #[serde(rename = "m/s2", alias = "m/s^2", alias = "m/s²")]
    MetrePerSecond2,
    /// Standard gravity, 9.80665 m/s².
    #[serde(rename = "g")]
    Gravity,
    /// 0.001 of standard gravity.
    #[serde(rename = "mg", alias = "milli-g")]
    MilliGravity,
    /// 0.01 of standard gravity.
    #[serde(rename = "%g")]
    PercentGravity,
    /// 0.1 of standard gravity.
    #[serde(rename = "g/10", alias = "G/10")]
    TenthGravity,
    /// Gal, 0.01 m/s².
    #[serde(rename = "gal", alias = "Gal")]
    Gal,
    /// Centimetre per second squared.
    #[serde(rename = "cm/s2", alias = "cm/s^2", alias = "cm/s²")]
    CentimetrePerSecond2,
    /// Millimetre per second squared.
    #[serde(rename = "mm/s2", alias = "mm/s^2", alias = "mm/s²")]
    MillimetrePerSecond2,
    /// Inch per second squared, 0.0254 m/s².
    #[serde(rename = "in/s2", alias = "in/s^2", alias = "in/s²")]
    InchPerSecond2,
    /// Foot per second squared, 0.3048 m/s².
    #[serde(rename = "ft/s2", alias = "ft/s^2", alias = "ft/s²")]
    FootPerSecond2,
    /// Metre per second.
    #[serde(rename = "m/s")]
    MetrePerSecond,
    /// Centimetre per second.
    #[serde(rename = "cm/s")]
    CentimetrePerSecond,
    /// Millimetre per second.
    #[serde(rename = "mm/s")]
    MillimetrePerSecond,
    /// Inch per second, 0.0254 m/s.
    #[serde(rename = "in/s")]
    InchPerSecond,
    /// Metre.
    #[serde(rename = "m")]
    Metre,
    /// Centimetre.
    #[serde(rename = "cm")]
    Centimetre,
    /// Millimetre.
    #[serde(rename = "mm")]
    Millimetre,
    /// Inch, 0.0254 m.
    #[serde(rename = "in")]
    Inch,
    /// Foot, 0.3048 m.
    #[serde(rename = "ft")]
    Foot,
    /// Newton.
    #[serde(rename = "N")]
    Newton,
    /// Kilonewton.
    #[serde(rename = "kN")]
    Kilonewton,
    /// Pound-force, 4.4482216152605 N.
    #[serde(rename = "lbf")]
    PoundForce,
    /// Kip (1000 lbf), 4448.2216152605 N.
    #[serde(rename = "kip")]
    Kip,
}

impl Unit {
    /// Quantity of this unit.
    #[must_use]
    pub const fn quantity(self) -> Quantity {
        UNITS[self as usize].2
    }

    /// SI units in one of this.
    #[must_use]
    pub const fn to_si(self) -> f64 {
        UNITS[self as usize].3
    }

    /// True of two spellings of one unit: `gal` is `cm/s2`.
    #[must_use]
    pub(crate) fn is_same_as(self, other: Self) -> bool {
        self.quantity() == other.quantity() && self.to_si() == other.to_si()
    }

    /// The spelling of the test file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        UNITS[self as usize].1
    }

    /// Reads the many spellings of headers: `G`, `CM/S**2`, `cm/sec/sec`, `[m/s^2]`, `Gal`, `m s-2`, `units of g`.
    #[must_use]
    pub(crate) fn from_header(text: &str) -> Option<Self> {
        let plain = without_brackets(text).to_lowercase();
        let plain = ["in ", "units of ", "unit of "]
            .iter()
            .fold(plain.as_str(), |rest, word| {
                rest.strip_prefix(word).unwrap_or(rest)
            });
        let plain: String = plain
            .replace("seconds", "s")
            .replace("second", "s")
            .replace("sec", "s")
            .replace("s⁻²", "/s2")
            .replace("s⁻¹", "/s")
            .replace("s^-2", "/s2")
            .replace("s-2", "/s2")
            .replace("s^-1", "/s")
            .replace("s-1", "/s")
            .replace('²', "2")
            .replace("/s/s", "/s2")
            .chars()
            .filter(|c| !c.is_whitespace() && !"^*·.".contains(*c))
            .collect();
        let (length, rate) = match plain.split_once('/') {
            Some((length, rate)) => (length, Some(rate)),
            None => (plain.as_str(), None),
        };
        let word = match length {
            "meter" | "meters" | "metre" | "metres" => "m",
            "centimeters" | "centimetres" => "cm",
            "millimeters" | "millimetres" => "mm",
            "inch" | "inches" => "in",
            "foot" | "feet" => "ft",
            "kine" | "kines" => "cm/s",
            "g's" | "gs" => "g",
            "milli-g" | "millig" | "milli-gs" => "mg",
            "percentg" => "%g",
            "gals" => "gal",
            "n" | "newton" | "newtons" => "N",
            "kn" | "kilonewton" | "kilonewtons" => "kN",
            "kips" => "kip",
            other => other,
        };
        let spelling = match rate {
            None => word.to_owned(),
            Some("ss") => format!("{word}/s2"),
            Some(rate) => format!("{word}/{rate}"),
        };
        let known = UNITS.iter().find(|(_, name, ..)| *name == spelling);
        known.map(|(unit, ..)| *unit)
    }
}

impl std::fmt::Display for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_names_match_test_files_and_headers() {
        for (unit, ..) in UNITS {
            assert_eq!(UNITS[unit as usize].0, unit);
            let quoted = format!("\"{}\"", unit.name());
            assert_eq!(serde_json::to_string(&unit).unwrap(), quoted);
            assert_eq!(serde_json::from_str::<Unit>(&quoted).unwrap(), unit);
            assert_eq!(Unit::from_header(unit.name()), Some(unit));
        }
    }

    #[test]
    fn spellings_of_headers_are_understood() {
        for (text, unit) in [
            ("G.", Unit::Gravity),
            ("CM/S**2", Unit::CentimetrePerSecond2),
            ("cm/sec/sec", Unit::CentimetrePerSecond2),
            ("CM/SEC", Unit::CentimetrePerSecond),
            ("[m/s^2]", Unit::MetrePerSecond2),
            ("(gal)", Unit::Gal),
            ("CM", Unit::Centimetre),
            ("m/sec^2", Unit::MetrePerSecond2),
            ("m s-2", Unit::MetrePerSecond2),
            ("m·s⁻²", Unit::MetrePerSecond2),
            ("G/10", Unit::TenthGravity),
            ("g/10", Unit::TenthGravity),
            ("%g", Unit::PercentGravity),
            ("% g", Unit::PercentGravity),
            ("milli-g", Unit::MilliGravity),
            ("in units of g", Unit::Gravity),
            ("inches", Unit::Inch),
        ] {
            assert_eq!(Unit::from_header(text), Some(unit), "{text}");
        }
        for text in ["furlong", "", "s", "m/min", "mm/m", "g/100"] {
            assert_eq!(Unit::from_header(text), None, "{text}");
        }
    }

    #[test]
    fn time_units_convert_with_one_rounding() {
        for (text, found, seconds) in [
            ("(ms)", 10.0, 0.01),
            ("Msec", 5.0, 0.005),
            ("[min]", 2.0, 120.0),
            ("µs", 500.0, 0.0005),
            ("s", 0.3, 0.3),
            ("hours", 1.0, 3600.0),
        ] {
            let unit = TimeUnit::from_header(text).unwrap();
            assert_eq!(unit.to_seconds(found), seconds, "{text}");
        }
        assert_eq!(TimeUnit::from_header("samples"), None);
    }

    #[test]
    fn kip_is_1000_pounds_force() {
        let pound = 0.453_592_37 * STANDARD_GRAVITY;
        // Both constants are exact decimals; the product rounds once.
        assert!((Unit::PoundForce.to_si() - pound).abs() <= f64::EPSILON * pound);
        assert!((Unit::Kip.to_si() / 1000.0 - pound).abs() <= 2.0 * f64::EPSILON * pound);
    }
}
