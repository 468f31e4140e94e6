//! Units in which people keep motions, and the quantities they measure.
//!
//! Inside everything is SI. A unit stands beside the number it belongs to; nothing here guesses one.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Standard acceleration of gravity in m/s² (CGPM 1901): what `g` means here.
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// True of a header's word for the second.
#[must_use]
pub fn is_second(text: &str) -> bool {
    let plain = text.trim().trim_end_matches('.').to_ascii_lowercase();
    matches!(plain.as_str(), "s" | "sec" | "secs" | "second" | "seconds")
}

/// Units of time other than the second, as headers spell them.
const OTHER_TIMES: [&str; 31] = [
    "ms",
    "msec",
    "msecs",
    "millisec",
    "millisecs",
    "millisecond",
    "milliseconds",
    "us",
    "µs",
    "μs",
    "usec",
    "usecs",
    "microsecond",
    "microseconds",
    "ns",
    "nsec",
    "nsecs",
    "nanosecond",
    "nanoseconds",
    "min",
    "mins",
    "minute",
    "minutes",
    "h",
    "hr",
    "hrs",
    "hour",
    "hours",
    "d",
    "day",
    "days",
];

/// True of a header's word for another unit of time than the second.
#[must_use]
pub fn is_time_but_no_second(text: &str) -> bool {
    let plain = text.trim().trim_end_matches('.').to_lowercase();
    OTHER_TIMES.contains(&plain.as_str())
}

/// What a signal is of; the context gives it, and with it the SI unit.
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

/// A unit of acceleration, velocity, displacement or force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Unit {
    /// m/s².
    #[serde(rename = "m/s2", alias = "m/s^2", alias = "m/s²")]
    MetrePerSecond2,
    /// Standard gravity, 9.80665 m/s².
    #[serde(rename = "g")]
    Gravity,
    /// 0.01 m/s².
    #[serde(rename = "gal", alias = "Gal")]
    Gal,
    /// 0.01 m/s².
    #[serde(rename = "cm/s2", alias = "cm/s^2", alias = "cm/s²")]
    CentimetrePerSecond2,
    /// 0.001 m/s².
    #[serde(rename = "mm/s2", alias = "mm/s^2", alias = "mm/s²")]
    MillimetrePerSecond2,
    /// 0.0254 m/s².
    #[serde(rename = "in/s2", alias = "in/s^2", alias = "in/s²")]
    InchPerSecond2,
    /// 0.3048 m/s².
    #[serde(rename = "ft/s2", alias = "ft/s^2", alias = "ft/s²")]
    FootPerSecond2,
    /// m/s.
    #[serde(rename = "m/s")]
    MetrePerSecond,
    /// 0.01 m/s.
    #[serde(rename = "cm/s")]
    CentimetrePerSecond,
    /// 0.001 m/s.
    #[serde(rename = "mm/s")]
    MillimetrePerSecond,
    /// 0.0254 m/s.
    #[serde(rename = "in/s")]
    InchPerSecond,
    /// m.
    #[serde(rename = "m")]
    Metre,
    /// 0.01 m.
    #[serde(rename = "cm")]
    Centimetre,
    /// 0.001 m.
    #[serde(rename = "mm")]
    Millimetre,
    /// 0.0254 m.
    #[serde(rename = "in")]
    Inch,
    /// 0.3048 m.
    #[serde(rename = "ft")]
    Foot,
    /// N.
    #[serde(rename = "N")]
    Newton,
    /// 1000 N.
    #[serde(rename = "kN")]
    Kilonewton,
    /// 4.4482216152605 N.
    #[serde(rename = "lbf")]
    PoundForce,
    /// 4448.2216152605 N.
    #[serde(rename = "kip")]
    Kip,
}

impl Unit {
    /// What it measures.
    #[must_use]
    pub const fn quantity(self) -> Quantity {
        match self {
            Self::MetrePerSecond2
            | Self::Gravity
            | Self::Gal
            | Self::CentimetrePerSecond2
            | Self::MillimetrePerSecond2
            | Self::InchPerSecond2
            | Self::FootPerSecond2 => Quantity::Acceleration,
            Self::MetrePerSecond
            | Self::CentimetrePerSecond
            | Self::MillimetrePerSecond
            | Self::InchPerSecond => Quantity::Velocity,
            Self::Metre | Self::Centimetre | Self::Millimetre | Self::Inch | Self::Foot => {
                Quantity::Displacement
            }
            Self::Newton | Self::Kilonewton | Self::PoundForce | Self::Kip => Quantity::Force,
        }
    }

    /// SI units in one of this.
    #[must_use]
    pub const fn to_si(self) -> f64 {
        match self {
            Self::MetrePerSecond2 | Self::MetrePerSecond | Self::Metre | Self::Newton => 1.0,
            Self::Gravity => STANDARD_GRAVITY,
            Self::Gal
            | Self::CentimetrePerSecond2
            | Self::CentimetrePerSecond
            | Self::Centimetre => 0.01,
            Self::MillimetrePerSecond2 | Self::MillimetrePerSecond | Self::Millimetre => 0.001,
            Self::InchPerSecond2 | Self::InchPerSecond | Self::Inch => 0.0254,
            Self::FootPerSecond2 | Self::Foot => 0.3048,
            Self::Kilonewton => 1000.0,
            Self::PoundForce => 4.448_221_615_260_5,
            Self::Kip => 4_448.221_615_260_5,
        }
    }

    /// The spelling of the test file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::MetrePerSecond2 => "m/s2",
            Self::Gravity => "g",
            Self::Gal => "gal",
            Self::CentimetrePerSecond2 => "cm/s2",
            Self::MillimetrePerSecond2 => "mm/s2",
            Self::InchPerSecond2 => "in/s2",
            Self::FootPerSecond2 => "ft/s2",
            Self::MetrePerSecond => "m/s",
            Self::CentimetrePerSecond => "cm/s",
            Self::MillimetrePerSecond => "mm/s",
            Self::InchPerSecond => "in/s",
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Inch => "in",
            Self::Foot => "ft",
            Self::Newton => "N",
            Self::Kilonewton => "kN",
            Self::PoundForce => "lbf",
            Self::Kip => "kip",
        }
    }

    /// Reads the many spellings of headers: `G`, `CM/S**2`, `cm/sec/sec`, `[m/s^2]`, `Gal`, `CM/SEC`.
    #[must_use]
    pub fn from_header(text: &str) -> Option<Self> {
        let plain: String = text
            .trim()
            .trim_end_matches(['.', ':'])
            .trim_matches(['(', ')', '[', ']', '"', '\''])
            .to_ascii_lowercase()
            .replace("sec", "s")
            .replace(['^', '*'], "")
            .replace('²', "2")
            .replace("/s/s", "/s2");
        let unit = match plain.as_str() {
            "m/s2" | "m/ss" => Self::MetrePerSecond2,
            "g" | "g's" | "gs" => Self::Gravity,
            "gal" | "gals" => Self::Gal,
            "cm/s2" | "cm/ss" => Self::CentimetrePerSecond2,
            "mm/s2" | "mm/ss" => Self::MillimetrePerSecond2,
            "in/s2" | "in/ss" => Self::InchPerSecond2,
            "ft/s2" | "ft/ss" => Self::FootPerSecond2,
            "m/s" => Self::MetrePerSecond,
            "cm/s" => Self::CentimetrePerSecond,
            "mm/s" => Self::MillimetrePerSecond,
            "in/s" => Self::InchPerSecond,
            "m" => Self::Metre,
            "cm" => Self::Centimetre,
            "mm" => Self::Millimetre,
            "in" => Self::Inch,
            "ft" => Self::Foot,
            "n" => Self::Newton,
            "kn" => Self::Kilonewton,
            "lbf" => Self::PoundForce,
            "kip" => Self::Kip,
            _ => return None,
        };
        Some(unit)
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

    const ALL: [Unit; 20] = [
        Unit::MetrePerSecond2,
        Unit::Gravity,
        Unit::Gal,
        Unit::CentimetrePerSecond2,
        Unit::MillimetrePerSecond2,
        Unit::InchPerSecond2,
        Unit::FootPerSecond2,
        Unit::MetrePerSecond,
        Unit::CentimetrePerSecond,
        Unit::MillimetrePerSecond,
        Unit::InchPerSecond,
        Unit::Metre,
        Unit::Centimetre,
        Unit::Millimetre,
        Unit::Inch,
        Unit::Foot,
        Unit::Newton,
        Unit::Kilonewton,
        Unit::PoundForce,
        Unit::Kip,
    ];

    #[test]
    fn the_name_of_a_unit_is_how_the_test_file_and_a_header_spell_it() {
        for unit in ALL {
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
        ] {
            assert_eq!(Unit::from_header(text), Some(unit), "{text}");
        }
        assert_eq!(Unit::from_header("furlong"), None);
    }

    #[test]
    fn a_kip_is_a_thousand_pounds_and_a_pound_is_its_mass_under_standard_gravity() {
        let pound = 0.453_592_37 * STANDARD_GRAVITY;
        // Both constants are exact decimals; the product rounds once.
        assert!((Unit::PoundForce.to_si() - pound).abs() <= f64::EPSILON * pound);
        assert!((Unit::Kip.to_si() / 1000.0 - pound).abs() <= 2.0 * f64::EPSILON * pound);
    }
}
