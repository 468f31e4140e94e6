//! The lines before a table: names of its columns, their units, and units in running text.

use super::label::Label;
use super::text::{fields, is_comment, number, words};
use crate::motion::unit::{TimeUnit, Unit};

/// A line before the first row of numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeaderLine<'a> {
    /// From 1.
    pub(super) number: usize,
    pub(super) text: &'a str,
}

impl<'a> HeaderLine<'a> {
    pub(super) fn is_comment(&self) -> bool {
        is_comment(self.text)
    }

    /// The line without its comment sign.
    fn content(&self) -> &'a str {
        self.text
            .trim_start()
            .trim_start_matches(['#', '%', '!'])
            .trim()
    }
}

/// Most words of a name; a line with more is a title.
const MOST_WORDS: usize = 4;

/// The header of a table.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Header {
    /// One for each column, or none.
    pub(super) labels: Vec<Label>,
    /// The names come from a remark or stand between blanks: words of a title may pass for them.
    pub(super) is_loose: bool,
    /// Lines that gave the names and the units.
    pub(super) used: usize,
    /// The one unit that the running text states.
    pub(super) unit: Option<Unit>,
    /// A line that states another unit of time than the second in running text.
    pub(super) other_time: Option<String>,
}

impl Header {
    /// The column of times, from 0: the first that is called one, best one whose unit is known.
    pub(super) fn time(&self) -> Option<usize> {
        let is_known = |label: &Label| label.is_time() && label.time_unit().is_ok();
        let known = self.labels.iter().position(is_known);
        known.or_else(|| self.labels.iter().position(Label::is_time))
    }

    /// Reads the lines before a table with this number of columns.
    pub(super) fn read<'a>(lines: &[HeaderLine<'a>], columns: usize, between: char) -> Self {
        let mut header = Self {
            unit: unit_in_text(lines),
            ..Self::default()
        };
        let mut names_at = lines.len();
        for (at, line) in lines.iter().enumerate().rev() {
            let Some(names) = cells(line.content(), columns, between) else {
                if line.is_comment() {
                    continue;
                }
                break;
            };
            let before = at.checked_sub(1).and_then(|above| lines.get(above));
            let above = before.and_then(|line| cells(line.content(), columns, between));
            let (labels, used) = match above {
                Some(above) if is_row_of_units(&names) && !is_row_of_units(&above) => {
                    let both = above.iter().zip(&names);
                    let both = both.map(|(name, unit)| Label::of(name).with_unit(bare(unit)));
                    (both.collect::<Vec<_>>(), 2)
                }
                _ => (names.iter().map(|name| Label::of(name)).collect(), 1),
            };
            // A title is no name: of its words only those that stand where a unit does count.
            let is_title = columns == 1 && names[0].split_whitespace().count() > MOST_WORDS;
            let labels: Vec<Label> = match is_title {
                true => names.iter().map(|name| Label::title(name)).collect(),
                false => labels,
            };
            if line.is_comment() && !labels.iter().any(Label::is_informative) {
                continue;
            }
            header.is_loose = line.is_comment() || between == ' ';
            header.labels = labels;
            header.used = used;
            names_at = at;
            break;
        }
        let is_text = |(at, line): (usize, &HeaderLine<'a>)| (at != names_at).then_some(*line);
        let text = lines.iter().enumerate().filter_map(is_text);
        header.other_time = other_time_in_text(text);
        header
    }
}

fn bare(unit: &str) -> &str {
    unit.trim().trim_matches(['(', ')', '[', ']', '{', '}'])
}

/// True if each cell is a unit or empty, and one at least is a unit.
fn is_row_of_units(cells: &[&str]) -> bool {
    let is_unit =
        |cell: &&str| TimeUnit::from_header(cell).is_some() || Unit::from_header(cell).is_some();
    let is_bracket = |cell: &&str| cell.starts_with(['(', '[']) && cell.ends_with([')', ']']);
    let is_empty = |cell: &&str| !cell.chars().any(char::is_alphanumeric);
    cells.iter().any(is_unit)
        && cells
            .iter()
            .all(|cell| is_unit(cell) || is_bracket(cell) || is_empty(cell))
}

/// The line in as many cells as there are columns, by the first way of parting it that gives them.
pub(super) fn cells<'a>(line: &'a str, columns: usize, between: char) -> Option<Vec<&'a str>> {
    if columns == 1 {
        return Some(vec![line.trim().trim_matches('"')]);
    }
    let by = |separator: char| {
        let line = line.trim_end();
        let line = line.strip_suffix(separator).unwrap_or(line);
        let found = fields(line, separator);
        found.into_iter().map(|(_, cell)| cell).collect::<Vec<_>>()
    };
    let ways: [&dyn Fn() -> Vec<&'a str>; 6] = [
        &|| match between {
            ' ' => by('\t'),
            other => by(other),
        },
        &|| between_blanks(line),
        &|| behind_brackets(line),
        &|| wide_gaps(line),
        &|| by(','),
        &|| by(';'),
    ];
    // Names with the same sign between them as the numbers are as many as these.
    let is_parted_alike = between != ' ' && by(between).len() > 1;
    let count = if is_parted_alike { 1 } else { ways.len() };
    ways.iter()
        .take(count)
        .map(|way| way())
        .find(|cells| cells.len() == columns)
}

/// Words, with a unit in brackets kept to the name before it.
fn between_blanks(line: &str) -> Vec<&str> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    let is_bracket = |word: &str| word.starts_with(['(', '[', '{']);
    for (start, word) in words(line) {
        let end = start + word.len();
        match found.last_mut() {
            Some((from, to)) if is_bracket(word) && !is_bracket(&line[*from..*to]) => *to = end,
            _ => found.push((start, end)),
        }
    }
    found
        .into_iter()
        .map(|(from, to)| &line[from..to])
        .collect()
}

/// Parts that end with a bracket: `Acc X (g) Acc Y (g)`.
fn behind_brackets(line: &str) -> Vec<&str> {
    let parts = line.split_inclusive([')', ']', '}']);
    let trimmed = parts.map(|part| part.trim_matches(|c: char| c.is_whitespace() || c == ','));
    trimmed.filter(|part| !part.is_empty()).collect()
}

/// Parts between two and more blanks.
fn wide_gaps(line: &str) -> Vec<&str> {
    let parts = line.split("  ").map(str::trim);
    parts.filter(|part| !part.is_empty()).collect()
}

/// Words that say what a unit in running text belongs to.
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

/// The unit that running text states: in brackets, after `in`, or a word such as `cm/s2` and `gal`. None if it states two.
fn unit_in_text(lines: &[HeaderLine<'_>]) -> Option<Unit> {
    let mut found: Option<Unit> = None;
    for line in lines {
        let line = line.content().to_lowercase();
        if !QUANTITIES.iter().any(|word| line.contains(word)) {
            continue;
        }
        for (word, is_marked) in marked_words(&line) {
            let is_long = word.contains('/') || word.contains("gal");
            let Some(unit) = Unit::from_header(word).filter(|_| is_long || is_marked) else {
                continue;
            };
            match found {
                Some(other) if other.to_si() != unit.to_si() => return None,
                Some(_) => {}
                None => found = Some(unit),
            }
        }
    }
    found
}

/// The line in which running text gives times in another unit than the second.
fn other_time_in_text<'a>(lines: impl Iterator<Item = HeaderLine<'a>>) -> Option<String> {
    let is_other = |line: &str| {
        marked_words(line).any(|(word, is_marked)| {
            is_marked && TimeUnit::from_header(word).is_some_and(|unit| unit != TimeUnit::SECOND)
        })
    };
    let mut lines = lines.map(|line| line.content());
    let found = lines.find(|line| is_other(&line.to_lowercase()));
    found.map(str::to_owned)
}

/// Words of a line in lower case, and whether each is in brackets or stands where a unit does.
fn marked_words(line: &str) -> impl Iterator<Item = (&str, bool)> {
    let mut is_next_marked = false;
    words(line).map(move |(_, word)| {
        let is_marked = is_next_marked || word.starts_with(['(', '[']);
        // `unit = g`: the sign counts as a word. `Units: s, g`: a unit may follow a unit.
        if word.chars().any(char::is_alphanumeric) {
            let is_unit =
                || TimeUnit::from_header(word).is_some() || Unit::from_header(word).is_some();
            is_next_marked = matches!(
                word.trim_matches([':', '=', '(']),
                "in" | "unit" | "units" | "of" | "time" | "t" | "times"
            ) || (is_next_marked && is_unit());
        }
        (word, is_marked)
    })
}

/// Dashes and the like that underline a title, and separators with nothing between them.
pub(super) fn is_rule(line: &str) -> bool {
    line.chars()
        .all(|c| c.is_whitespace() || "-=_+|~,;".contains(c))
}

/// The separator that a first line `sep=;` of a spreadsheet states; a tab is a blank.
pub(super) fn stated_separator(line: &str) -> Option<char> {
    let rest = line.trim().trim_matches('"').strip_prefix("sep=")?;
    let mut signs = rest.chars();
    match (signs.next(), signs.next()) {
        (Some('\t'), None) => Some(' '),
        (Some(sign @ (',' | ';')), None) => Some(sign),
        _ => None,
    }
}

/// A number, one with a slip in it, or the stars of one that did not fit its field: it must be reported, not skipped.
pub(super) fn begins_like_a_number(field: &str) -> bool {
    let digits = field.trim_start_matches(['+', '-', '.']);
    let is_overflow = !field.is_empty() && field.bytes().all(|byte| byte == b'*');
    number(field).is_some() || digits.starts_with(|c: char| c.is_ascii_digit()) || is_overflow
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_line_is_parted_into_as_many_names_as_there_are_columns() {
        for (line, columns, between, wanted) in [
            ("Time [min]  Disp [mm]", 2, ' ', ["Time [min]", "Disp [mm]"]),
            ("time [ms], acc [g]", 2, ' ', ["time [ms]", "acc [g]"]),
            ("Time, s  Acc, g", 2, ' ', ["Time, s", "Acc, g"]),
            (
                "Test time (s) Acc X (g)",
                2,
                ' ',
                ["Test time (s)", "Acc X (g)"],
            ),
            ("(s) (g)", 2, ' ', ["(s)", "(g)"]),
            ("Time [s]\tAcc X", 2, ' ', ["Time [s]", "Acc X"]),
            ("\"time, s\", acc ,", 2, ',', ["time, s", "acc"]),
        ] {
            assert_eq!(cells(line, columns, between).unwrap(), wanted, "{line}");
        }
        assert_eq!(cells("El Centro 1940", 2, ' '), None);
    }
}
