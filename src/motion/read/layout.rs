//! The one model of a table in text: lines of a header, then rows of numbers with something between them.
//!
//! The first line that is all numbers begins the table, and decides the separator of its fields: a semicolon, a comma, a
//! tab, or blanks. Every later line must be a row of as many numbers. A line above the table that begins like a row must
//! be above the names: otherwise it may be a row with a typing error. Times have no special role here.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use super::RawTable;
use super::header::{HeaderLine, begins_like_a_number, cells, is_rule, stated_separator};
use super::rows::{Delimiter, Rows, Settings, pointed};
use super::text::{decode, finite_number, is_comment, lines, number};
use crate::error::MotionError;

/// Most lines of a header that are read: the last before the table.
const MOST_HEADER_LINES: usize = 100;

/// Reads the whole of a text as a table.
pub(super) fn parse(
    name: &str,
    bytes: &[u8],
    settings: &Settings,
) -> Result<RawTable, MotionError> {
    let text = decode(name, bytes)?;
    let mut head = Head::default();
    let mut rows: Option<Rows<'_>> = None;
    let filled = lines(&text)
        .skip(settings.skip_rows)
        .filter(|(_, line)| !line.trim().is_empty());
    for (line_number, line) in filled {
        if let Some(rows) = &mut rows {
            if !is_comment(line) {
                rows.read(line_number, line)?;
            }
            continue;
        }
        if let ControlFlow::Break(delimiter) = head.take(line_number, line, settings) {
            let mut begun = Rows::new(name, delimiter, line);
            head.refuse_slips(&begun)?;
            begun.read(line_number, line)?;
            rows = Some(begun);
        }
    }
    if let Some(line) = head.other_time {
        head.lines.push_front(line);
    }
    match rows {
        Some(rows) => rows.into_table(head.lines.make_contiguous(), head.worded, settings),
        None => Err(head.without_rows(name, settings)),
    }
}

/// The lines before the table.
#[derive(Default)]
struct Head<'t> {
    /// The last of them.
    lines: VecDeque<HeaderLine<'t>>,
    /// How many of all are no comments.
    worded: usize,
    separator: Option<char>,
    /// The first line that begins like a row.
    first_slip: Option<HeaderLine<'t>>,
    /// The first such line behind the last line of words.
    last_slip: Option<HeaderLine<'t>>,
    /// The first line with another unit of time than the second that `lines` no longer holds.
    other_time: Option<HeaderLine<'t>>,
}

impl<'t> Head<'t> {
    /// Takes a line of the header; breaks at the first line of the table.
    fn take(
        &mut self,
        number: usize,
        text: &'t str,
        settings: &Settings,
    ) -> ControlFlow<Delimiter> {
        if let (true, Some(separator)) = (self.lines.is_empty(), stated_separator(text)) {
            self.separator = Some(separator);
            return ControlFlow::Continue(());
        }
        if is_rule(text) {
            return ControlFlow::Continue(());
        }
        let line = HeaderLine { number, text };
        if !is_comment(text) {
            if let Some(delimiter) = Delimiter::of(text, self.separator, settings) {
                return ControlFlow::Break(delimiter);
            }
            self.worded += 1;
            if begins_like_a_row(text) {
                self.first_slip.get_or_insert(line);
                self.last_slip.get_or_insert(line);
            } else {
                self.last_slip = None;
            }
        }
        if self.lines.len() == MOST_HEADER_LINES {
            let dropped = self.lines.pop_front().filter(HeaderLine::has_other_time);
            self.other_time = self.other_time.or(dropped);
        }
        self.lines.push_back(line);
        ControlFlow::Continue(())
    }

    fn worded(&self) -> impl DoubleEndedIterator<Item = &HeaderLine<'t>> {
        self.lines.iter().filter(|line| !line.is_comment())
    }

    /// Refuses a line that may be a row with a slip in it and would else pass for a line of words: one with as many
    /// fields as a row, one below the names, or one directly above the table.
    fn refuse_slips(&self, rows: &Rows<'_>) -> Result<(), MotionError> {
        let is_as_wide = |line: &&HeaderLine<'_>| {
            let cells = rows.delimiter.cells(line.text);
            // Stars are numbers that did not fit their fields.
            let begins = || cells.first().is_some_and(|(_, c)| begins_like_a_number(c));
            cells.len() == rows.width && (begins() || begins_like_a_row(line.text))
        };
        let is_names = |line: &&HeaderLine<'_>| {
            !begins_like_a_row(line.text)
                && cells(line.text.trim(), rows.width, rows.delimiter.sign()).is_some()
        };
        let names = self.worded().rev().find(is_names);
        let is_below = |line: &&HeaderLine<'_>| {
            names.is_some_and(|names| line.number > names.number) && begins_like_a_row(line.text)
        };
        let slips = [
            self.worded().find(is_as_wide),
            self.worded().find(is_below),
            self.last_slip.as_ref(),
        ];
        let first = slips.into_iter().flatten().min_by_key(|line| line.number);
        first.map_or(Ok(()), |line| Err(slip(rows, line)))
    }

    /// Reason for the missing table: the first line that begins like a row has something else in it.
    fn without_rows(&self, name: &str, settings: &Settings) -> MotionError {
        let empty = MotionError::Empty { file: name.into() };
        let Some(line) = self.last_slip.or(self.first_slip) else {
            return empty;
        };
        let delimiter = Delimiter::likely(line.text, self.separator, settings);
        let mut rows = Rows::new(name, delimiter, line.text);
        let error = rows.read(line.number, line.text).err();
        error.unwrap_or(empty)
    }
}

/// True of a line that begins with a number, or has an empty first field and a number in another.
fn begins_like_a_row(line: &str) -> bool {
    let is_gap = |c: char| c.is_whitespace() || c == ',' || c == ';';
    let mut fields = line.trim().split(is_gap).map(|f| f.trim_matches('"'));
    let first = fields.next().unwrap_or("");
    let is_empty = !first.chars().any(char::is_alphanumeric);
    let has_digit = line.bytes().any(|byte| byte.is_ascii_digit());
    has_digit && (begins_like_a_number(first) || (is_empty && fields.any(|f| number(f).is_some())))
}

/// The error of a line of the header, read as a row.
fn slip(rows: &Rows<'_>, line: &HeaderLine<'_>) -> MotionError {
    let cells = rows.delimiter.cells(line.text);
    let found = cells.len();
    let error = cells.into_iter().find_map(|(start, cell)| {
        finite_number(rows.file, line.number, line.text, start, &pointed(cell)).err()
    });
    error.map_or_else(
        || MotionError::Ragged {
            file: rows.file.into(),
            line: line.number,
            wanted: rows.width,
            found,
        },
        |error| {
            let line = line.number;
            error.advised(format_args!(
                "if the line belongs to a header: skip_rows = {line}"
            ))
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::assert_is;

    const ANY: Settings = Settings {
        skip_rows: 0,
        columns: None,
        reading_order: false,
        separated: false,
        named: true,
        counted: true,
    };

    fn read(text: &str) -> Result<RawTable, MotionError> {
        parse("a.csv", text.as_bytes(), &ANY)
    }

    fn names(table: &RawTable) -> Vec<&str> {
        table
            .header
            .labels
            .iter()
            .map(|l| l.name.as_str())
            .collect()
    }

    #[test]
    fn every_kind_of_line_end_is_one_line_end() {
        for end in ["\n", "\r\n", "\r\r\n", "\r"] {
            let text = format!("1{end}2{end}3{end}");
            let table = read(&text).unwrap();
            assert_eq!(table.values, [1.0, 2.0, 3.0], "{end:?}");
            assert_eq!(table.lines, [1, 2, 3], "{end:?}");
        }
    }

    #[test]
    fn marks_at_the_ends_of_a_file_are_no_text() {
        for bytes in [
            &b"\xef\xbb\xbf1\r\n2\r\n\x1a"[..],
            b"1\n2\n\x1a\x1a\x1a",
            b"1\n2\n\x1a\r\n\0\0\0\0",
            b"\xff\xfe1\0\n\x002\0\n\0",
            b"\xfe\xff\x001\0\n\x002\0\n",
            b"\xff\xfe1\0\n\x002\0\n\0\x1a\0",
            b"\xfe\xff\x001\0\n\x002\0\n\0\x1a\0\0",
            b"1\r2\n",
            b"1\r2\r\n\x1a",
        ] {
            let table = parse("a.txt", bytes, &ANY).unwrap();
            assert_eq!(table.values, [1.0, 2.0], "{bytes:?}");
        }
        assert!(parse("a.txt", b"1\n\x1a2\n", &ANY).is_err());
    }

    #[test]
    fn quotes_comments_and_last_comma_are_read() {
        let table = read("# made by hand\n\"time, s\", acc \n\n0,1,\n0.5 , \"2\"\n").unwrap();
        assert_eq!(names(&table), ["time, s", "acc"]);
        assert_eq!(table.values, [0.0, 1.0, 0.5, 2.0]);
        assert_eq!(table.lines, [4, 5]);
        assert!(table.warnings.is_empty(), "{:?}", table.warnings);
    }

    #[test]
    fn long_header_with_row_of_units_is_read() {
        let mut text: String = (0..300).map(|i| format!("remark number {i}\n")).collect();
        text.push_str("------------\nTime  Acc\n(s)  (cm/s^2)\n0 1\n0.1 2\n");
        let table = read(&text).unwrap();
        assert_eq!(names(&table), ["Time", "Acc"]);
        assert_eq!((table.columns, table.lines[0]), (2, 304));
        let unit = table.header.labels[1].value_unit().unwrap().unwrap();
        assert_eq!(unit.name(), "cm/s2");
        let table = read("Logger;7\n\nTime;Ch1;Ch2\ns;g;g\n0;1;2\n1;3;4\n").unwrap();
        assert_eq!(names(&table), ["Time", "Ch1", "Ch2"]);
        assert_eq!(
            table.header.labels[2].value_unit().unwrap().unwrap().name(),
            "g"
        );
    }

    #[test]
    fn header_lines_may_begin_without_numbers() {
        for header in [
            ",time,acc\n",
            "-- made by -- hand\n.,time,acc\n",
            "* * *\nx,time,acc\n",
            "1940 El Centro\ni,time,acc\n",
            "i,time,acc\n,,\n",
            "i  time  acc\n",
        ] {
            let table = read(&format!("{header}0,0.0,1\n1,0.1,2\n")).unwrap();
            assert_eq!(table.header.time(), Some(1), "{header:?}");
            assert_eq!(table.values.len(), 6);
        }
    }

    #[test]
    fn remark_names_the_columns_if_clear() {
        let table = read("# by hand\n# time [ms], acc [g]\n0 1\n10 2\n").unwrap();
        assert_eq!(names(&table), ["time [ms]", "acc [g]"]);
        let table = read("# by hand\n0 1\n10 2\n").unwrap();
        assert!(names(&table).is_empty());
    }

    #[test]
    fn skipped_lines_are_ignored() {
        let text = "1940 05\n5 x\nt,a\n0,1\n1,2\n";
        let skip = Settings {
            skip_rows: 2,
            ..ANY
        };
        let table = parse("a.csv", text.as_bytes(), &skip).unwrap();
        assert_eq!((table.values.len(), table.lines[0]), (4, 4));
        assert!(read(text).is_err());
        let all = Settings {
            skip_rows: 9,
            ..ANY
        };
        let error = parse("a.csv", text.as_bytes(), &all).unwrap_err();
        assert!(matches!(error, MotionError::Empty { .. }));
    }

    #[test]
    fn unambiguous_decimal_commas_are_read() {
        for text in [
            "t;a\n0,00;1,5\n0,01;-2,5\n",
            "sep=;\nt;a\n0,00;1,5\n0,01;-2,5\n",
            "t a\n0,00 1,5\n0,01 -2,5\n",
            "t\ta\n0,00\t1,5\n0,01\t-2,5\n",
            "0 1,5\n0,01 -2,5\n",
        ] {
            let table = read(text).unwrap();
            assert_eq!(table.values, [0.0, 1.5, 0.01, -2.5], "{text:?}");
        }
        for (text, line, column) in [
            // Thousands as well as decimals.
            ("1,000 2,500\n2,000 3,500\n", 1, 2),
            // Points and commas.
            ("0.5 1\n0,6 2\n", 2, 2),
            ("0,5 1\n0.6 2\n", 1, 2),
            ("0.01;1,5\n", 1, 7),
        ] {
            match read(text).unwrap_err() {
                MotionError::DecimalComma {
                    line: l, column: c, ..
                } => assert_eq!((l, c), (line, column), "{text:?}"),
                other => panic!("{text:?}: {other}"),
            }
        }
        // A time below one shows what the commas are.
        let table = read("0,005 1,250\n1,005 1,500\n").unwrap();
        assert_eq!(table.values, [0.005, 1.25, 1.005, 1.5]);
    }

    #[test]
    fn first_line_may_give_count_and_step() {
        for (text, columns, dt) in [
            ("3 0.01\n1\n2\n3\n", 1, Some(0.01)),
            ("title\n6 0.01\n1 2 3 4\n5 6\n", 1, Some(0.01)),
            ("4 0.01\n0.1 0.2\n0.3 0.4\n", 1, Some(0.01)),
            ("3 0.1\n0.0 5\n0.1 6\n0.2 7\n", 2, Some(0.1)),
            // Times from 4 s on.
            ("4 0.01\n5 0.2\n6 0.4\n", 2, None),
        ] {
            let table = read(text).unwrap();
            assert_eq!((table.columns, table.stated_dt), (columns, dt), "{text:?}");
        }
        match read("4 0.01\n1\n2\n3\n").unwrap_err() {
            MotionError::Count {
                announced, found, ..
            } => assert_eq!((announced, found), (4, 3)),
            other => panic!("{other}"),
        }
    }

    #[test]
    fn bad_number_is_shown_with_line_and_column() {
        let refused = |text: &str| read(text).unwrap_err();
        assert_is!(
            refused("t,a\n0,1\n0.1, 1.x\n")
            => MotionError::NotANumber { line: 3, column: 6, found, .. } if found == "1.x"
        );
        assert_is!(
            refused("t,a\n0,1\n0.1,\n")
            => MotionError::Ragged { line: 3, wanted: 2, found: 1, .. }
        );
        assert_is!(
            refused("t,a\n0,NaN\n")
            => MotionError::NotFinite { line: 2, column: 3, found, .. } if found == "NaN"
        );
        assert_is!(
            refused("t,a\n-inf,0\n")
            => MotionError::NotFinite { line: 2, column: 1, found, .. } if found == "-inf"
        );
        assert_is!(
            refused("1,2\n3,1e999\n")
            => MotionError::NotFinite { line: 2, column: 3, found, .. } if found == "1e999"
        );
        assert_is!(
            refused("0.1x,2\n")
            => MotionError::NotANumber { line: 1, column: 1, found, .. } if found == "0.1x"
        );
        // A slip in the first row is not a header.
        for text in ["0.1x,2\n1,2\n", "0.1x\n1\n"] {
            let error = read(text).unwrap_err();
            let MotionError::NotANumber {
                line: 1,
                column: 1,
                found,
                advice,
                ..
            } = error
            else {
                panic!("{text:?}: {error}");
            };
            assert_eq!(found, "0.1x");
            assert!(advice.ends_with("skip_rows = 1)"), "{advice}");
        }
        // Nor is a row with a gap, or with a number that did not fit its field.
        for text in [
            "t,a\n,1\n0.1,2\n",
            "t a\n- 1\n0.1 2\n",
            "t a\n*** 1\n0.1 2\n",
            "t a\n*** ***\n0.1 2\n",
            "t,a\n***,***\n0.1,2\n",
        ] {
            let error = read(text).unwrap_err();
            let is_told = error.to_string().ends_with("skip_rows = 2)");
            assert!(is_told, "{text:?}: {error}");
        }
        assert_is!(
            refused("1,2\n1,2,3\n")
            => MotionError::Ragged { line: 2, wanted: 2, found: 3, .. }
        );
        assert_is!(
            refused("a,b,c\n1,2\n")
            => MotionError::Ragged { line: 2, wanted: 3, found: 2, .. }
        );
    }

    /// Kind, line and width or word of the error of a text.
    fn refusal(text: &str) -> (&'static str, usize, String) {
        match read(text).map(|table| table.values.len()).unwrap_err() {
            MotionError::NotANumber {
                line,
                found,
                advice,
                ..
            } => {
                let kind = if advice.is_empty() { "number" } else { "row" };
                (kind, line, found)
            }
            MotionError::Ragged {
                line,
                wanted,
                found,
                ..
            } => ("columns", line, format!("{found} of {wanted}")),
            MotionError::Count {
                announced, found, ..
            } => ("count", 0, format!("{found} of {announced}")),
            other => panic!("{text:?}: {other}"),
        }
    }

    fn repeated(count: usize, row: impl Fn(usize) -> String) -> String {
        (0..count).map(row).collect()
    }

    #[test]
    fn mistyped_row_is_refused_not_a_header() {
        let rows = "0.01 0.02\n0.02 0.03\n0.03 0.01\n";
        let remarks = |count| repeated(count, |i| format!("0.00 {i} # zeroing\n"));
        for (text, wanted) in [
            (format!("0.00 0.0 start\n{rows}"), ("row", 1, "start")),
            (format!("{}{rows}", remarks(60)), ("row", 1, "#")),
            (format!("t a\n{}{rows}", remarks(250)), ("row", 2, "#")),
            (
                format!("t a\n0.00 0.0 start\nsecond part of it\n{rows}"),
                ("row", 2, "start"),
            ),
            (
                "0 0 0 start\n0 0 0 start\n0 0 0 start\n1 2 3\n4 5 6\n".into(),
                ("row", 1, "start"),
            ),
            (
                "1940 El Centro NS\n0.01 0.02\n0.02 0.03\n".into(),
                ("row", 1, "El"),
            ),
            (
                "Time;Acc\n2024-01-01 10:00\n0;1\n1;2\n".into(),
                ("row", 2, "2024-01-01 10:00"),
            ),
            (
                "t;a\n0,00;\n0,01;0,5\n0,02;0,6\n".into(),
                ("columns", 2, "1 of 2"),
            ),
        ] {
            let (kind, line, found) = refusal(&text);
            assert_eq!((kind, line, found.as_str()), wanted, "{text:.60}");
        }
        for text in [
            "1940 El Centro\nTime Acc\n0 1\n1 2\n",
            "Logger;7\n2024-01-01 10:00\nTime;Acc\ns;g\n0;1\n1;2\n",
        ] {
            assert_eq!(read(text).unwrap().values, [0.0, 1.0, 1.0, 2.0], "{text}");
        }
    }

    #[test]
    fn empty_cell_between_tabs_keeps_its_place() {
        for (text, wanted) in [
            ("0.0\t\t5\n0.1\t6\t\n0.2\t\t7\n", ("row", 1, "")),
            ("t\ta\t\tb\n0.0\t1\t\t5\n0.1\t2\t\t6\n", ("number", 2, "")),
            ("1\t\t2\t3\n1\t2\t\t3\n", ("number", 1, "")),
            ("1\t2\t3\n1\t\t3\n", ("number", 2, "")),
            ("1\t2\t3\n\t2\t3\n", ("number", 2, "")),
            ("1\t2\t3\n1\t2\t\n", ("columns", 2, "2 of 3")),
            ("1 2\t3\n1 2\t3\n", ("number", 1, "1 2")),
        ] {
            let (kind, line, found) = refusal(text);
            assert_eq!((kind, line, found.as_str()), wanted, "{text:?}");
        }
        for text in [
            "t\ta\n0\t1\n1\t2\n",
            "t\ta\t\n0\t1\t\n1\t2\t\n",
            "sep=\t\nt a\n 0\t 1\n 1\t 2\n",
            "\t0 1\n\t1 2\n",
        ] {
            let table = read(text).unwrap();
            assert_eq!(
                (table.columns, table.values),
                (2, vec![0.0, 1.0, 1.0, 2.0]),
                "{text:?}"
            );
        }
    }

    #[test]
    fn file_without_rows_names_its_bad_line() {
        for (row, wanted) in [
            ("2024-01-01 00:00:01,0.5\n", "2024-01-01 00:00:01"),
            ("0.01|0.5\n", "0.01|0.5"),
            ("0.01 0.5 ok\n", "ok"),
            ("0,01;0,5;;\n", ""),
            (",0.01,0.5\n", ""),
            ("0.01\t0.5\t \tok\n", ""),
        ] {
            for (end, line) in [("", 2), ("end of data\n", 2)] {
                let text = format!("t a\n{}{end}", row.repeat(150));
                let wanted = ("number", line, wanted.to_owned());
                assert_eq!(refusal(&text), wanted, "{row}");
            }
        }
        let missing = repeated(120, |i| format!("{i}.0,#N/A\n"));
        let wanted = ("row", 2, "#N/A".to_owned());
        assert_eq!(refusal(&format!("t,a\n{missing}120.0,0.5\n")), wanted);
    }

    #[test]
    fn first_differing_row_is_reported() {
        let eight = repeated(19, |i| {
            let count = if i == 18 { 6 } else { 8 };
            format!("{}\n", " 0.5".repeat(count))
        });
        let columns = |line, found: &str| ("columns", line, found.to_owned());
        for (text, wanted) in [
            ("t,a\n0.0,\n0.01,0.02\n", columns(2, "1 of 2")),
            ("t;a\n0,0;\n0,01;0,02\n", columns(2, "1 of 2")),
            ("150\n0.00 0.1\n0.01 0.2\n0.02 0.3\n", columns(1, "1 of 2")),
            ("0,0;\n0,01;0,02\n0,02;0,02\n", columns(1, "1 of 2")),
            ("0 1\n1 2 3\n", columns(2, "3 of 2")),
            (
                &format!("151 0.01\n{eight}"),
                ("count", 0, "150 of 151".to_owned()),
            ),
        ] {
            assert_eq!(refusal(text), wanted, "{text:.60}");
        }
    }

    #[test]
    fn binary_file_is_not_read_as_text() {
        let error = parse("a.txt", b"1\n2\x003\n", &ANY).unwrap_err();
        assert!(matches!(error, MotionError::NotText { line: 2, .. }));
    }
}
