//! The lines before a table: names of its columns, their units, and units in running text.

use super::label::Label;
use super::remark::{has_other_time, unit_in_text};
use super::text::{fields, is_comment, number, words};
use crate::unit::{TimeUnit, Unit};

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

    /// True if it holds a word for another unit of time than the second.
    pub(super) fn has_other_time(&self) -> bool {
        has_other_time(self.content())
    }

    /// The line without its comment sign; tabs at its ends part empty cells.
    fn content(&self) -> &'a str {
        let is_sign = |c: char| c == ' ' || (self.is_comment() && "#%!".contains(c));
        self.text.trim_start_matches(is_sign).trim_end_matches(' ')
    }

    /// What follows `units:` at its beginning.
    fn units(&self) -> Option<&'a str> {
        let (word, rest) = self.content().split_once(':')?;
        word.trim().eq_ignore_ascii_case("units").then_some(rest)
    }

    fn cells(&self, columns: usize, between: char) -> Option<Vec<&'a str>> {
        cells(self.content(), columns, between)
    }
}

/// Most words of a name; a line with more is a title.
const MOST_WORDS: usize = 4;

/// The header of a table.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Header {
    /// One for each column, or none.
    pub(super) labels: Vec<Label>,
    /// The labels may be words of a title: a column is found by them, but they state neither times nor units.
    pub(super) may_be_title: bool,
    /// Lines that gave the names and the units.
    pub(super) used: usize,
    /// The one unit that the running text states, and its line.
    unit: Option<(usize, Unit)>,
    /// The first line with another unit of time than the second in it that is not the unit of the column of times.
    pub(super) other_time: Option<(usize, String)>,
}

impl Header {
    /// The column of times, from 0: the first that is called one, best one whose unit is known.
    pub(super) fn time(&self) -> Option<usize> {
        if self.may_be_title {
            return None;
        }
        let is_known = |label: &Label| label.is_time() && label.time_unit().is_ok();
        let known = self.labels.iter().position(is_known);
        known.or_else(|| self.labels.iter().position(Label::is_time))
    }

    /// The label of a column, if it is surely one.
    pub(super) fn label(&self, column: usize) -> Option<&Label> {
        self.labels.get(column).filter(|_| !self.may_be_title)
    }

    /// The unit of a column of values, and the line of running text if that states it. It does so only for a single column
    /// whose label has no unit, not even one that is not understood.
    pub(super) fn unit_of(&self, column: usize, is_only: bool) -> Option<(Unit, Option<usize>)> {
        match self.label(column).map_or(Ok(None), Label::value_unit) {
            Ok(Some(unit)) => Some((unit, None)),
            Ok(None) if is_only => self.unit.map(|(line, unit)| (unit, Some(line))),
            _ => None,
        }
    }

    /// Any unit that the header states for a column.
    pub(super) fn any_unit_of(&self, column: usize) -> Option<Unit> {
        let label = self.labels.get(column)?;
        let text = || self.unit.map(|(_, unit)| unit);
        label.value_unit().ok().flatten().or_else(text)
    }

    /// Reads the lines before a table with this number of columns. In a file that is `named`, words parted by the same sign as
    /// the numbers are names.
    pub(super) fn read(
        lines: &[HeaderLine<'_>],
        columns: usize,
        between: char,
        named: bool,
    ) -> Self {
        let names = Names::find(lines, columns, between, named).unwrap_or_default();
        let is_certain = names.is_certain;
        let text = lines
            .iter()
            .filter(|line| !is_certain || !names.lines.contains(&line.number));
        let unit = only_unit(text.clone());
        let mut header = Self {
            used: names.lines.len(),
            may_be_title: !is_certain,
            labels: names.labels,
            unit,
            other_time: None,
        };
        let time = header.time();
        let others = (0..).zip(&header.labels).filter(|(i, _)| Some(*i) != time);
        let is_beside = is_certain && others.map(|(_, label)| label).any(has_other_time_beside);
        let beside = lines
            .iter()
            .find(|line| is_beside && names.lines.contains(&line.number));
        let found = text.clone().find(|line| line.has_other_time()).or(beside);
        header.other_time = found.map(|line| (line.number, line.content().to_owned()));
        header
    }
}

/// True if the unit of a label, or a word in its name, is a unit of time but the second.
fn has_other_time_beside(label: &Label) -> bool {
    has_other_time(&label.name) || label.has_other_time_unit()
}

/// The labels of the columns, and where they come from.
#[derive(Default)]
struct Names {
    labels: Vec<Label>,
    /// Numbers of the lines that give names and units.
    lines: Vec<usize>,
    /// They are surely no words of a title.
    is_certain: bool,
}

impl Names {
    /// The last line of words, if it surely has names; else the last comment that has; else the words, which may be a title.
    fn find(lines: &[HeaderLine<'_>], columns: usize, between: char, named: bool) -> Option<Self> {
        let at_line = |at| Self::at(lines, at, columns, between, named);
        let last = lines.iter().rposition(|line| !line.is_comment());
        let words = last.and_then(at_line);
        if words.as_ref().is_some_and(|names| names.is_certain) {
            return words;
        }
        let comments = (0..lines.len()).rev().filter(|at| lines[*at].is_comment());
        let mut certain = comments
            .filter_map(at_line)
            .filter(|names| names.is_certain);
        certain.next().or(words)
    }

    /// The names in a line, with the units of a row beside it.
    fn at(
        lines: &[HeaderLine<'_>],
        at: usize,
        columns: usize,
        between: char,
        named: bool,
    ) -> Option<Self> {
        let line = &lines[at];
        if line.units().is_some() {
            return None;
        }
        let found = line.cells(columns, between)?;
        let above = at.checked_sub(1).map(|above| &lines[above]);
        let above = above.and_then(|line| Some((line, line.cells(columns, between)?)));
        if let Some((above, names)) = above
            && is_row_of_units(&found)
            && !is_row_of_units(&names)
        {
            let labels = names.iter().map(|name| Label::of(name));
            return Some(Self {
                labels: with_units(labels, &found),
                lines: vec![above.number, line.number],
                is_certain: true,
            });
        }
        // A title is no name.
        let is_title = columns == 1 && found[0].split_whitespace().count() > MOST_WORDS;
        let read = if is_title { Label::title } else { Label::of };
        let labels: Vec<Label> = found.iter().map(|name| read(name)).collect();
        let below = lines[at + 1..].iter().filter(|line| line.is_comment());
        let mut rows = below.filter_map(|row| {
            let labels = with_row_of_units(&labels, row, between)?;
            Some((row.number, labels))
        });
        if let (false, Some((units_at, labels))) = (line.is_comment(), rows.next()) {
            return Some(Self {
                labels,
                lines: vec![line.number, units_at],
                is_certain: true,
            });
        }
        let is_named = columns == 1 || (named && between != ' ') || labels[0].is_index();
        // Either of two columns may be the times; in a longer line the last word is more likely the end of a title.
        let has_time = columns == 2 && !line.is_comment() && labels.iter().any(Label::is_time);
        Some(Self {
            is_certain: !is_title
                && (labels[0].is_time()
                    || has_time
                    || labels.iter().all(Label::is_clear)
                    || (is_named && !line.is_comment())),
            labels,
            lines: vec![line.number],
        })
    }
}

/// The unit that running text states, and its line; none unless it is clear.
fn only_unit<'l>(lines: impl Iterator<Item = &'l HeaderLine<'l>>) -> Option<(usize, Unit)> {
    let mut found: Option<(usize, Unit)> = None;
    for line in lines {
        match (unit_in_text(line.content())?, found) {
            (Some(unit), Some((_, other))) if !unit.is_same_as(other) => return None,
            (Some(unit), None) => found = Some((line.number, unit)),
            _ => {}
        }
    }
    found
}

fn with_units(labels: impl Iterator<Item = Label>, units: &[&str]) -> Vec<Label> {
    let both = labels.zip(units);
    both.map(|(label, unit)| label.with_unit(bare(unit)))
        .collect()
}

/// The labels with the units of a comment: a row of units, or `units: time s, acc g` with each name before its unit.
fn with_row_of_units(labels: &[Label], row: &HeaderLine<'_>, between: char) -> Option<Vec<Label>> {
    let rest = row.units();
    if let Some(pairs) = rest {
        let pairs = fields(pairs, between);
        let unit = |label: &Label| {
            let mut units = pairs.iter().filter_map(|(_, pair)| {
                let unit = pair.strip_prefix(label.name.as_str())?;
                (unit.is_empty() || unit.starts_with(' ')).then_some(unit.trim())
            });
            units.next()
        };
        if let Some(units) = labels.iter().map(unit).collect::<Option<Vec<&str>>>() {
            return Some(with_units(labels.iter().cloned(), &units));
        }
    }
    let units = cells(rest.unwrap_or(row.content()), labels.len(), between)?;
    let is_row = labels.len() > 1 && is_row_of_units(&units);
    is_row.then(|| with_units(labels.iter().cloned(), &units))
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

/// Splits the line into as many cells as there are columns, by the first separator that gives them.
pub(super) fn cells<'a>(line: &'a str, columns: usize, between: char) -> Option<Vec<&'a str>> {
    if columns == 1 {
        return Some(vec![line.trim().trim_matches('"')]);
    }
    let by = |separator: char| {
        let all = fields(line, separator).into_iter().map(|(_, cell)| cell);
        let mut all: Vec<&str> = all.collect();
        // One sign more than there are columns parts nothing.
        if all.len() == columns + 1 && all.last() == Some(&"") {
            all.pop();
        }
        all
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
    use crate::error::MotionError;
    use crate::read::{Column, ReadOptions, parse_record, parse_table};

    #[test]
    fn header_splits_into_one_name_per_column() {
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

    fn options(dt: Option<f64>, column: Option<Column>) -> ReadOptions {
        ReadOptions {
            dt,
            column,
            ..ReadOptions::default()
        }
    }

    fn named(name: &str) -> Option<Column> {
        Some(Column::Name(name.to_owned()))
    }

    /// Three rows 10 apart behind this header, with this sign between two numbers.
    fn file(header: &str, sign: &str) -> String {
        let rows = ["0", "10", "20"].map(|time| format!("{time}{sign}0.5\n"));
        format!("{header}\n{}", rows.concat())
    }

    #[test]
    fn milliseconds_are_read_or_refused() {
        let long = "recorded with time in ms\n".to_owned() + &"remark\n".repeat(150) + "t a";
        for (header, sign, is_read) in [
            ("Time_ms acc\n# unit g", " ", true),
            ("Time_ms,acc\n# filtered, in g", ",", true),
            ("tms,acc\n# filtered, acc in g", ",", true),
            ("Time,Acc\nms,", ",", true),
            ("Time;Acc\nms;", ";", true),
            ("Time\tAcc\nms\t", "\t", true),
            ("Time,Acc\n# ms,g", ",", true),
            ("Time Acc\n ms", " ", false),
            ("ms,g\nTime,Acc", ",", false),
            ("ms g\nTime Acc", " ", false),
            ("Time_ms,Acc_g\nnote", ",", false),
            ("Time_ms;Acc_g\nRemark", ";", false),
            ("Time_ms Acc_g\ncalibrated by NN on site", " ", false),
            ("X_Unit_Label\tms\nX_Value\tAcc", "\t", false),
            ("xunit = ms\nt a", " ", false),
            ("# col1: ms\n# col2: g", " ", false),
            ("# column 1: ms\n# column 2: g", " ", false),
            ("Time,msec Acc", ",", false),
            ("ms | g", " ", false),
            ("Time_ms vs Acc_g", " ", false),
            ("# Time step: ms", " ", false),
            ("TIME MSEC ACC", " ", false),
            (&long, " ", false),
        ] {
            for name in ["a.txt", "a.csv"] {
                let text = file(header, sign);
                let read = |dt| parse_record(name, text.as_bytes(), &options(dt, None));
                match read(None) {
                    Ok(record) => {
                        assert!(is_read, "{header:?} in {name}: dt = {}", record.dt);
                        assert_eq!(record.dt, 0.01, "{header:?} in {name}");
                    }
                    Err(MotionError::TimeUnit { .. }) => assert!(!is_read, "{header:?} in {name}"),
                    Err(error) => panic!("{header:?} in {name}: {error}"),
                }
                let given = read(Some(0.01)).unwrap_or_else(|error| panic!("{header:?}: {error}"));
                assert_eq!((given.dt, given.values.len()), (0.01, 3), "{header:?}");
            }
        }
        let error = parse_record(
            "a.txt",
            file(&long, " ").as_bytes(),
            &ReadOptions::default(),
        );
        assert!(matches!(
            error.unwrap_err(),
            MotionError::TimeUnit { line: Some(1), .. }
        ));
    }

    #[test]
    fn other_words_do_not_refuse_a_file() {
        for header in [
            "# Ms 6.9",
            "# an earthquake of Ms 6.9",
            "# Biloxi, MS",
            "# station d, channel h",
            "# 5 min after the shock",
            "# a 5-min window",
            "# dt 10 ms",
            "# Hour: 12 Minute: 33",
            "# max 0.5 min -0.5",
            "# times in s, rate 100 per s",
            "# recorded for us by NN",
        ] {
            let text = file(&format!("{header}\nt a"), " ");
            let read = parse_record("a.txt", text.as_bytes(), &ReadOptions::default());
            let read = read.unwrap_or_else(|error| panic!("{header}: {error}"));
            assert_eq!(read.dt, 10.0, "{header}");
        }
    }

    #[test]
    fn value_unit_comes_from_label_or_column() {
        let g = Some(Unit::Gravity);
        for (header, columns, unit, line) in [
            ("Time (s) Acc (0.01 m/s2)", 2, None, None),
            ("Time (s) Acc [10^-2 m/s2]", 2, None, None),
            ("Time (s) Acc [1/100 m/s2]", 2, None, None),
            (
                "# acceleration in g\n# Time (s) Acc (counts)",
                2,
                None,
                None,
            ),
            (
                "Ground motion, sensor range (g)\nTime (s) Acc (V)",
                2,
                None,
                None,
            ),
            ("# acc unit: 9.81 m/s2", 2, None, None),
            ("# acceleration in 0.1 m/s2", 2, None, None),
            ("# acceleration in cm/s2 x 100", 2, None, None),
            ("# acceleration (cm/s2) * 100", 2, None, None),
            ("# acc: 1 unit = 0.5 cm/s2", 2, None, None),
            (
                "# ground motion PGA = 341.7 cm/s/s at 2.12 sec",
                2,
                None,
                None,
            ),
            ("# ground motion, PGA = 341 gal", 2, None, None),
            ("PGA 0.35 g", 1, None, None),
            ("PGA = 341 gal", 1, None, None),
            ("acc 0.01 m/s2", 1, None, None),
            ("Acc (0.01 m/s2)", 1, None, None),
            ("Acc (g)", 1, g, None),
            ("acc_1 g", 1, g, None),
            ("# ground acceleration in g\nt acc", 2, g, Some(1)),
            ("# first\n# acceleration (g)", 2, g, Some(2)),
            ("# acceleration unit = g\nt acc", 2, g, Some(1)),
            ("t acc\n# units: s, g", 2, g, None),
            ("# Units: s, g", 2, g, Some(1)),
            ("# acceleration in gal (cm/s2)", 2, Some(Unit::Gal), Some(1)),
            ("# displacement in m and acc in m/s2", 2, None, None),
        ] {
            let row = ["0.5", "0.1 0.5"][columns - 1];
            let rows = [row.to_owned(), row.replace("0.1", "0.2")];
            let text = format!("{header}\n{}\n{}\n", rows[0], rows[1]);
            let dt = (columns == 1).then_some(0.1);
            let read = parse_record("a.txt", text.as_bytes(), &options(dt, None));
            let read = read.unwrap_or_else(|error| panic!("{header}: {error}"));
            let found = (read.unit, read.source.unit_line);
            assert_eq!(found, (unit, line), "{header}");
        }
        let text = "# ground acceleration in g\nt disp acc\n0 1 2\n1 3 4\n";
        let read = parse_record("a.txt", text.as_bytes(), &options(None, named("disp")));
        assert_eq!(read.unwrap().unit, None);
    }

    #[test]
    fn comment_does_not_replace_names() {
        for (text, name, unit, values) in [
            (
                "time,x1,ground\n# units: time s,x1 ,ground m/s^2\n0,1,2\n0.01,3,4\n",
                "ground",
                Some(Unit::MetrePerSecond2),
                [2.0, 4.0],
            ),
            (
                "time,acc\n# measured 1/2/2020, in g\n0,1\n0.01,2\n",
                "acc",
                None,
                [1.0, 2.0],
            ),
        ] {
            let read = parse_record("a.csv", text.as_bytes(), &options(None, named(name)));
            let read = read.unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!((read.dt, read.unit), (0.01, unit), "{text}");
            assert_eq!(read.values, values, "{text}");
        }
        let text = "F1,F2,F3\n# made 2020, by me, in kN\n1,2,3\n4,5,6\n";
        let table = parse_table("a.csv", text.as_bytes()).unwrap();
        assert_eq!(table.names, ["F1", "F2", "F3"]);
    }

    #[test]
    fn other_named_column_is_not_the_times() {
        for (name, text) in [
            ("a.txt", "Period(s) Sa(g)\n0.0 1\n0.1 2\n"),
            ("a.txt", "Sample Acc(g)\n0 1\n1 2\n"),
            ("a.txt", "No. acc\n0 1\n1 2\n"),
            ("a.csv", "Frequency,acc\n0,1\n1,2\n"),
        ] {
            let second = options(None, Some(Column::Number(2)));
            let error = parse_record(name, text.as_bytes(), &second).unwrap_err();
            assert!(
                matches!(error, MotionError::StepMissing { .. }),
                "{text}: {error}"
            );
        }
        let by_name = "X acc\n0 1\n1 2\n";
        let error = parse_record("a.txt", by_name.as_bytes(), &options(None, named("acc")));
        assert!(matches!(
            error.unwrap_err(),
            MotionError::StepMissing { .. }
        ));
    }

    #[test]
    fn whole_numbers_as_times_are_reported() {
        let third = Some(Column::Number(3));
        for (text, is_told) in [
            ("0 0.00 0.1\n1 0.01 0.2\n2 0.02 0.3\n", true),
            ("1 0.00 0.1\n2 0.01 0.2\n3 0.02 0.3\n", true),
            ("0.0 0.00 0.1\n0.5 0.01 0.2\n1.0 0.02 0.3\n", false),
            ("t b c\n0 0.00 0.1\n1 0.01 0.2\n2 0.02 0.3\n", false),
        ] {
            let read = parse_record("a.txt", text.as_bytes(), &options(None, third.clone()));
            let warnings = read.unwrap().warnings;
            let is_found = warnings.iter().any(|text| text.contains("time_column"));
            assert_eq!(is_found, is_told, "{text}: {warnings:?}");
        }
        let indexed = "Index Time Acc\n0 0.00 0.1\n1 0.01 0.2\n2 0.02 0.3\n";
        let read = parse_record("a.txt", indexed.as_bytes(), &options(None, third));
        assert_eq!(read.unwrap().dt, 0.01);
    }

    #[test]
    fn words_of_a_title_name_no_column() {
        for header in ["Response history time", "# Kobe 0.5 g", "Kobe 0.5 g"] {
            let text = format!("{header}\n0.00 1 5\n0.01 2 3\n0.02 3 9\n");
            let third = Some(Column::Number(3));
            let read = parse_record("a.txt", text.as_bytes(), &options(None, third));
            let read = read.unwrap_or_else(|error| panic!("{header}: {error}"));
            assert_eq!((read.dt, read.unit), (0.01, None), "{header}");
            assert_eq!(read.values, [5.0, 3.0, 9.0], "{header}");
        }
        let turned = "Acc Time\n5 0.00\n3 0.01\n9 0.02\n";
        let read = parse_record("a.txt", turned.as_bytes(), &ReadOptions::default());
        assert_eq!(read.unwrap().dt, 0.01);
        // A name that the user gives is one.
        let text = "X Y Z\n1 2 3\n4 5 6\n";
        let read = parse_record("a.txt", text.as_bytes(), &options(Some(0.1), named("Y")));
        assert_eq!(read.unwrap().values, [2.0, 5.0]);
    }
}
