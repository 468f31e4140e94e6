//! Values that were found and values that are allowed, in the words of TOML.

use serde::de::{Expected, Unexpected};

use super::echo::{number, quoted};
use super::suggest::listed;

/// Describes a found value.
pub(crate) fn found_in_words(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(value) => format!("`{value}`"),
        Unexpected::Unsigned(value) => format!("{value}"),
        Unexpected::Signed(value) => format!("{value}"),
        // With its point, where that is all that is wrong with it.
        Unexpected::Float(value) => match number(value) {
            text if text.contains(['.', 'e', 'n', 'N']) => text,
            text => format!("{text}.0"),
        },
        Unexpected::Str(text) => format!("the text {}", quoted(text)),
        Unexpected::Seq => "an array".to_owned(),
        Unexpected::Map => "a table".to_owned(),
        Unexpected::Other(words) => words.to_owned(),
        other => other.to_string(),
    }
}

/// serde names Rust's types; the reader of a test file knows TOML's.
pub(crate) fn wanted_in_words(found: Option<Unexpected<'_>>, wanted: &dyn Expected) -> String {
    let name = wanted.to_string();
    if let Some(range) = found.and_then(|found| range_in_words(found, &name)) {
        return range;
    }
    let words = match name.as_str() {
        "f32" | "f64" if found.is_some_and(overflows) => "a finite number",
        "f32" | "f64" => "a number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, zero or greater",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "a nonzero usize" | "a nonzero u32" | "a nonzero u64" => "a whole number, one or greater",
        "a string" | "string" | "path string" => "a text in quotes",
        "a boolean" => "`true` or `false`",
        "a sequence" => "an array",
        "a map" => "a table",
        _ if name.starts_with("struct ") => "a table",
        _ if name.starts_with("enum ") => "one of its names",
        _ => return name,
    };
    words.to_owned()
}

/// Help for an array that has twice the elements that it should have.
pub(crate) const SPLIT_NUMBERS: &str =
    "a comma starts the next element; a decimal number has a point, as in `0.5`";

/// Help for a number with a comma.
pub(crate) const NO_COMMA: &str = "a decimal number has a point; thousands have no separator";

/// The numbers that a number with commas can mean: with a decimal point, and without separators of thousands.
pub(crate) fn comma_readings(number: &str) -> Vec<String> {
    let mut readings = Vec::new();
    if number.matches(',').count() == 1 {
        readings.push(number.replace(',', "."));
    }
    let mut groups = number.trim_start_matches(['+', '-']).split(',');
    let is_number = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    let first = groups.next().unwrap_or_default();
    let begins = (1..=3).contains(&first.len()) && is_number(first) && !first.starts_with('0');
    if begins && groups.all(|group| group.len() == 3 && is_number(group)) {
        readings.push(number.replace(',', ""));
    }
    readings
}

/// Help for a text that was found in place of a number: the number without quotes and with a decimal point.
pub(crate) fn number_in_quotes(found: Unexpected<'_>, wanted: &dyn Expected) -> Option<String> {
    let Unexpected::Str(text) = found else {
        return None;
    };
    if !wanted_in_words(Some(found), wanted).contains("number") {
        return None;
    }
    let number = text.trim();
    let is_number =
        |text: &str| text.parse::<f64>().is_ok() && text.contains(|c: char| c.is_ascii_digit());
    if is_number(number) {
        return Some(format!("write the number without quotes: `{number}`"));
    }
    if !number.contains(',') {
        return None;
    }
    let readings = comma_readings(number);
    let all_are = !readings.is_empty() && readings.iter().all(|reading| is_number(reading));
    all_are.then(|| {
        let readings = listed(&readings, "or");
        format!("a decimal number has a point and no quotes: {readings}")
    })
}

/// True for a number that is too large for a float, such as 1e999.
fn overflows(found: Unexpected<'_>) -> bool {
    matches!(found, Unexpected::Other(text) if text.parse().is_ok_and(f64::is_infinite))
}

/// Range of a whole number, where the found number is outside it: too large, negative or with a point.
fn range_in_words(found: Unexpected<'_>, wanted: &str) -> Option<String> {
    // Larger ones than an i64 cannot be written in TOML.
    const MOST: u64 = i64::MAX.unsigned_abs();
    let beyond = match found {
        Unexpected::Signed(_) | Unexpected::Unsigned(_) | Unexpected::Float(_) => true,
        Unexpected::Other(text) => text.starts_with(|c: char| c.is_ascii_digit() || c == '-'),
        _ => false,
    };
    let (least, most) = match wanted {
        _ if !beyond => return None,
        "u8" => (0, u8::MAX.into()),
        "u16" => (0, u16::MAX.into()),
        "u32" => (0, u32::MAX.into()),
        "u64" | "usize" => (0, MOST),
        "a nonzero u32" => (1, u32::MAX.into()),
        "a nonzero usize" | "a nonzero u64" => (1, MOST),
        _ => return None,
    };
    Some(format!("a whole number from {least} to {most}"))
}
