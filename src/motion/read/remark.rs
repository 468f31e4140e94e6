//! Units in running text: words of a header that belong to no column.

use super::label::Label;
use super::text::{number, words};
use crate::unit::{TimeUnit, Unit, is_time_but_no_second};

/// Words that name the quantity of a unit in running text.
const QUANTITIES: [&str; 10] = [
    "acc",
    "vel",
    "disp",
    "force",
    "load",
    "unit",
    "amplitude",
    "ground",
    "motion",
    "stroke",
];

/// The unit that a line of running text states: in brackets, or after `in` or `unit`. The outer `None` means that it
/// is not clear: the line states two units, or one with a number beside it.
pub(super) fn unit_in_text(line: &str) -> Option<Option<Unit>> {
    let text = line.to_lowercase();
    if !QUANTITIES.iter().any(|word| text.contains(word)) {
        return Some(None);
    }
    let mut units = Vec::new();
    for word in marked_words(&text).filter(|word| word.is_marked) {
        if let Some(unit) = Unit::from_header(word.text) {
            if word.is_behind_number || word.is_before_factor {
                return None;
            }
            units.push(unit);
        }
    }
    let Some(first) = units.first().copied() else {
        return Some(None);
    };
    let is_one = units.iter().all(|unit| first.is_same_as(*unit));
    is_one.then_some(Some(first))
}

/// True if a line names another unit of time than the second, not as the unit of a number: `5 min`.
pub(super) fn has_other_time(line: &str) -> bool {
    marked_words(line).any(|word| {
        let is_other = word.is_marked && is_time_but_no_second(word.text);
        let mut parts = word.text.split(|c: char| !c.is_alphanumeric());
        !word.is_behind_number
            && (is_other || parts.any(|part| is_plain_other_time(part, word.is_before_factor)))
    })
}

/// True for a word that is clearly a unit of time other than the second, at any place. `Ms`, `US` and `h` are not.
fn is_plain_other_time(word: &str, is_before_number: bool) -> bool {
    let lower = word.to_lowercase();
    // `tms`, `TimeMsec`.
    if lower.starts_with('t') {
        let label = Label::of(word);
        return label.is_time() && label.has_other_time_unit();
    }
    let is_short = word.chars().count() <= 3;
    let is_other = TimeUnit::from_header(word).is_some_and(|unit| {
        // `Minute: 33` and `min -0.5` state no unit.
        unit != TimeUnit::SECOND && (unit.is_fraction() || !is_before_number)
    });
    is_other
        && word.chars().count() > 1
        && !["us", "ns"].contains(&word)
        && !(is_short && lower != word)
}

/// A word of running text.
struct Word<'a> {
    text: &'a str,
    /// It is in brackets, or at the usual place of a unit.
    is_marked: bool,
    /// A number precedes it: `5 min`.
    is_behind_number: bool,
    /// A number or a sign of multiplication follows.
    is_before_factor: bool,
}

/// The words of a line with their neighbours.
fn marked_words(line: &str) -> impl Iterator<Item = Word<'_>> {
    let (mut is_next_marked, mut is_behind_number) = (false, false);
    words(line).map(move |(start, text)| {
        let is_bracket =
            text.starts_with(['(', '[']) && text.trim_end_matches('.').ends_with([')', ']']);
        // `5-min`.
        let is_compound = text
            .split_once('-')
            .is_some_and(|(first, _)| number(first).is_some());
        let rest = &line[start + text.len()..];
        let word = Word {
            text,
            is_marked: is_next_marked || is_bracket,
            is_behind_number: is_behind_number || is_compound,
            is_before_factor: is_factor(rest.trim_start()),
        };
        is_behind_number = number(text).is_some();
        // `unit = g`: the sign counts as a word. `Units: s, g`: a unit may follow a unit.
        if text.chars().any(char::is_alphanumeric) {
            let is_unit =
                || TimeUnit::from_header(text).is_some() || Unit::from_header(text).is_some();
            let plain = text.trim_matches([':', '=', '(']).to_lowercase();
            let is_mark = ["in", "unit", "units", "time", "t", "times"].contains(&plain.as_str());
            is_next_marked = is_mark || (is_next_marked && (plain == "of" || is_unit()));
        }
        word
    })
}

/// True of text that begins with a number, or with a sign of multiplication.
fn is_factor(text: &str) -> bool {
    let rest = text.trim_start_matches(|c: char| c.is_whitespace() || "(:=+-.".contains(c));
    let is_cross = rest == "x" || rest.starts_with("x ");
    is_cross || rest.starts_with(|c: char| c.is_ascii_digit() || "*×·/".contains(c))
}
