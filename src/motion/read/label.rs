//! The name of a column and the unit in it, however these are spelled.

use super::text::number;
use crate::unit::{TimeUnit, Unit, is_time_but_no_second};

/// The name of a column, and its unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Label {
    /// Spelling in the file.
    pub(super) name: String,
    /// The name without the unit.
    base: String,
    /// The text of the unit: what is in brackets, whatever it is, or a known unit behind the name.
    unit: Option<String>,
}

/// Names of a column of times, in lower case, letters only.
const TIME_NAMES: [&str; 7] = [
    "t",
    "time",
    "times",
    "elapsed",
    "elapsedtime",
    "testtime",
    "runtime",
];

/// Names of a column that counts the rows, in lower case, letters only.
const INDEX_NAMES: [&str; 7] = ["i", "n", "no", "nr", "index", "sample", "step"];

/// Units of time that are the whole name of a column of times.
const TIME_UNIT_NAMES: [&str; 8] = [
    "s",
    "sec",
    "secs",
    "seconds",
    "ms",
    "msec",
    "millisec",
    "milliseconds",
];

impl Label {
    /// Reads `Time [ms]`, `acc_g`, `Time, s`, `t/s`, `Acceleration in cm/s/s`.
    pub(super) fn of(name: &str) -> Self {
        let (base, unit) = parted(name);
        Self {
            name: name.to_owned(),
            base: base.to_owned(),
            unit: unit.map(str::to_owned),
        }
    }

    /// A name without a unit.
    pub(super) fn title(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            base: name.to_owned(),
            unit: None,
        }
    }

    /// This label with a unit from a row of units, where the name has none.
    pub(super) fn with_unit(mut self, unit: &str) -> Self {
        if self.unit.is_none() && unit.chars().any(|c| c.is_alphanumeric() || c == '%') {
            self.unit = Some(unit.to_owned());
        }
        self
    }

    pub(super) fn is_time(&self) -> bool {
        let plain = letters(&self.base);
        TIME_NAMES.contains(&plain.as_str())
            || (plain.is_empty() && self.time_unit().is_ok_and(|unit| unit.is_some()))
    }

    /// The unit of a column of times. None if the name states none; an error with the text of one that is unknown, or that
    /// is in the name in an unknown way.
    pub(super) fn time_unit(&self) -> Result<Option<TimeUnit>, &str> {
        let mut words = self.name.split(|c: char| !c.is_alphanumeric());
        match &self.unit {
            None if words.any(is_time_but_no_second) => Err(&self.name),
            None => Ok(None),
            Some(text) => TimeUnit::from_header(text).map(Some).ok_or(text),
        }
    }

    /// True if its unit is one of time but the second.
    pub(super) fn has_other_time_unit(&self) -> bool {
        matches!(self.time_unit(), Ok(Some(unit)) if unit != TimeUnit::SECOND)
    }

    /// The unit of a column of values. None if the name states none; an error with the text of one that is unknown.
    pub(super) fn value_unit(&self) -> Result<Option<Unit>, &str> {
        match &self.unit {
            None => Ok(None),
            Some(text) => Unit::from_header(text).map(Some).ok_or(text),
        }
    }

    /// True if it says something that a title does not: that it is a time, or a unit that is known.
    pub(super) fn is_clear(&self) -> bool {
        let is_unit = |text: &String| {
            TimeUnit::from_header(text).is_some() || Unit::from_header(text).is_some()
        };
        self.is_time() || self.unit.as_ref().is_some_and(is_unit)
    }

    /// True of the name of a column that counts the rows.
    pub(super) fn is_index(&self) -> bool {
        INDEX_NAMES.contains(&letters(&self.base).as_str())
    }
}

/// Letters and digits of a name, in lower case.
fn letters(name: &str) -> String {
    let plain = name.chars().filter(|c| c.is_alphanumeric());
    plain.flat_map(char::to_lowercase).collect()
}

/// A name and the unit with it.
fn parted(name: &str) -> (&str, Option<&str>) {
    if let Some((base, unit)) = in_brackets(name) {
        return (base, Some(unit));
    }
    let plain = letters(name);
    if TIME_UNIT_NAMES.contains(&plain.as_str()) {
        return ("", Some(name));
    }
    let ends = name
        .char_indices()
        .filter(|(_, c)| c.is_whitespace() || ",/_:;-".contains(*c));
    for (at, sign) in ends {
        let (base, rest) = (&name[..at], name[at + sign.len_utf8()..].trim());
        let is_unit = TimeUnit::from_header(rest).is_some()
            || (is_plain_unit(rest) && Unit::from_header(rest).is_some());
        // In `cm/s` the second belongs to a unit, not to a name.
        // In `PGA 0.35 g` it is the unit of that number.
        if is_unit && ends_with_number(base) {
            return (name, Some(name));
        }
        if is_unit && letters(base).chars().any(char::is_alphabetic) && !is_unit_word(base) {
            return (base.trim_end_matches([' ', ',', ':', '_', '-']), Some(rest));
        }
    }
    // `TimeSec`, `tms`.
    for start in ["time", "t"] {
        let split = name.is_char_boundary(start.len()) && name.len() > start.len();
        if split && name[..start.len()].eq_ignore_ascii_case(start) {
            let (base, rest) = name.split_at(start.len());
            let is_short = TIME_UNIT_NAMES.contains(&rest.to_lowercase().as_str());
            if is_short {
                return (base, Some(rest));
            }
        }
    }
    if Unit::from_header(name).is_some() {
        return ("", Some(name));
    }
    (name, None)
}

fn ends_with_number(base: &str) -> bool {
    let last = base.trim().rsplit([' ', '\t', '=', ':']).next();
    last.is_some_and(|word| number(word).is_some())
}

/// A single `N` behind a name means north as often as newton: only brackets make a unit of it.
fn is_plain_unit(text: &str) -> bool {
    !text.eq_ignore_ascii_case("n")
}

fn is_unit_word(base: &str) -> bool {
    Unit::from_header(base).is_some()
}

/// The text before the last pair of brackets, and what is in it.
fn in_brackets(name: &str) -> Option<(&str, &str)> {
    let start = name.rfind(['(', '[', '{'])?;
    let inner = name.get(start + 1..)?;
    let (inner, _) = inner.split_once([')', ']', '}'])?;
    Some((name.get(..start)?.trim_end(), inner.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_separate_from_their_units() {
        for (name, time) in [
            ("Time [ms]", "ms"),
            ("time_ms", "ms"),
            ("Time, s", "s"),
            ("t/s", "s"),
            ("TIME(SEC)", "s"),
            ("Time in ms", "ms"),
            ("Time_Seconds", "s"),
            ("TimeSec", "s"),
            ("tms", "ms"),
            ("msec", "ms"),
            ("Elapsed Time (min)", "min"),
            ("t [µs]", "us"),
            ("Time: s", "s"),
        ] {
            let label = Label::of(name);
            assert!(label.is_time(), "{name}");
            let unit = TimeUnit::from_header(time);
            assert_eq!(label.time_unit().unwrap(), unit, "{name}");
        }
        for (name, unit) in [
            ("acc [g]", Unit::Gravity),
            ("acc_g", Unit::Gravity),
            ("Acceleration in cm/s/s", Unit::CentimetrePerSecond2),
            ("acc cm/s2", Unit::CentimetrePerSecond2),
            ("a/(m/s2)", Unit::MetrePerSecond2),
            ("Disp, mm", Unit::Millimetre),
            ("CM/S**2", Unit::CentimetrePerSecond2),
            ("force (N)", Unit::Newton),
            ("a (% g)", Unit::PercentGravity),
        ] {
            let label = Label::of(name);
            assert_eq!(label.value_unit(), Ok(Some(unit)), "{name}");
            assert!(!label.is_time(), "{name}");
        }
        for name in [
            "at", "t_end", "acc_N", "north", "Acc X", "time_end", "state",
        ] {
            let label = Label::of(name);
            let found = (label.value_unit(), label.is_time());
            assert_eq!(found, (Ok(None), false), "{name}");
        }
        assert_eq!(Label::of("time (samples)").time_unit(), Err("samples"));
    }
}
