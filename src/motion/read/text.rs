//! Tables in text: lines into rows of numbers, with the place of everything that is not a number.
//!
//! Line ends may be LF, CR-LF, CR-CR-LF or a lone CR throughout. A header is one line whose first field is not
//! a number (CSV), or words before the first number (blank-separated text); anything else that is not a number is
//! an error. Does not know about time.

use std::borrow::Cow;
use std::ops::Range;

use super::{MOST_COLUMNS, MOST_VALUES, Print, RawTable};
use crate::motion::error::MotionError;

/// How fields are told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layout {
    /// By one of `,` `;` tab, the first of which that the first line holds (`;` before tab before `,`).
    Separated,
    /// By blanks, commas or semicolons.
    Blank,
    /// As `Blank`, every number a row of its own.
    Running,
}

/// Lines of words before the first number that blank-separated text may have.
const MOST_HEADER_LINES: usize = 50;

/// The text of a file: UTF-8, other bytes replaced (they are in titles; a number they touch is refused later).
pub(super) fn decode<'a>(name: &str, bytes: &'a [u8]) -> Result<Cow<'a, str>, MotionError> {
    if let Some(at) = bytes.iter().position(|&b| b == 0) {
        let line = 1 + bytes[..at].iter().filter(|&&b| b == b'\n').count();
        return Err(MotionError::NotText {
            file: name.into(),
            line,
        });
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    // The end-of-file mark of DOS, on old records.
    let bytes = bytes.strip_suffix(b"\x1a").unwrap_or(bytes);
    Ok(String::from_utf8_lossy(bytes))
}

/// Lines with their numbers from 1, without their ends.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    text.split(end)
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim_end_matches('\r')))
}

/// Reads one number in the spellings of people and of Fortran (`.5`, `5.`, `1.0D-03`); may be NaN or infinite.
pub(super) fn number(field: &str) -> Option<f64> {
    if let Ok(value) = field.parse() {
        return Some(value);
    }
    if field.contains(['d', 'D']) {
        return field.replace(['d', 'D'], "e").parse().ok();
    }
    None
}

/// The finite number in `field`, which begins at byte `start` of `line`.
pub(super) fn finite_number(
    file: &str,
    line_number: usize,
    line: &str,
    start: usize,
    field: &str,
) -> Result<f64, MotionError> {
    match number(field) {
        Some(value) if value.is_finite() => Ok(value),
        found => {
            let column = line.get(..start).map_or(0, |s| s.chars().count()) + 1;
            let (file, word) = (file.to_owned(), shorten(field));
            Err(match found {
                Some(_) => MotionError::NotFinite {
                    file,
                    line: line_number,
                    column,
                    found: word,
                },
                None => MotionError::NotANumber {
                    file,
                    line: line_number,
                    column,
                    found: word,
                },
            })
        }
    }
}

/// At most forty characters of `text`, for a message.
pub(super) fn shorten(text: &str) -> String {
    shorten_to(text, 40)
}

/// At most `most` characters of `text`.
pub(super) fn shorten_to(text: &str, most: usize) -> String {
    let mut short: String = text.chars().take(most).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}

/// Words of `line` between blanks, commas and semicolons, each with the byte at which it begins.
pub(super) fn words(line: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_gap = |c: char| c.is_whitespace() || c == ',' || c == ';';
    line.split(is_gap).filter(|w| !w.is_empty()).map(|word| {
        // Both are slices of the same string.
        let start = word.as_ptr() as usize - line.as_ptr() as usize;
        (start, word)
    })
}

/// Refuses a comma within `part` of `line` that may stand for a decimal point: with a digit right of it, unless points in what
/// it parts show that it stands between two numbers.
pub(super) fn refuse_decimal_comma(
    file: &str,
    line_number: usize,
    line: &str,
    part: Range<usize>,
) -> Result<(), MotionError> {
    let Some((at, found)) = line.get(part.clone()).and_then(decimal_comma) else {
        return Ok(());
    };
    let before = line.get(..part.start + at).unwrap_or("");
    Err(MotionError::DecimalComma {
        file: file.to_owned(),
        line: line_number,
        column: before.chars().count() + 1,
        found: shorten(found),
    })
}

/// The same for one line of a text in which blanks part as many numbers as are `wanted`: a comma need not part any there.
pub(super) fn refuse_decimal_comma_between_blanks(
    file: &str,
    bytes: &[u8],
    line_number: usize,
    wanted: usize,
) -> Result<(), MotionError> {
    let text = decode(file, bytes)?;
    let Some((_, line)) = lines(&text).find(|(number, _)| *number == line_number) else {
        return Ok(());
    };
    let is_list = wanted > 1 && line.split_whitespace().count() < 2;
    let is_parted_by_commas = line.contains(", ") || is_list;
    if is_parted_by_commas {
        return Ok(());
    }
    refuse_decimal_comma(file, line_number, line, 0..line.len())
}

/// The first such comma, and the number that it may be part of.
fn decimal_comma(text: &str) -> Option<(usize, &str)> {
    let is_gap = |c: char| c.is_whitespace() || c == ',' || c == ';';
    text.match_indices(',').find_map(|(at, _)| {
        let (left, right) = (text.get(..at)?, text.get(at + 1..)?);
        let left = left.rsplit(is_gap).next()?;
        let right = right.split(is_gap).next()?;
        let whole = right.bytes().take_while(u8::is_ascii_digit).count();
        // A group of thousands has three digits.
        let is_group = !left.is_empty() && !left.contains('.') && whole == 3;
        let is_apart = whole == 0 || (right.contains('.') && !is_group);
        if is_apart {
            return None;
        }
        Some((at, text.get(at - left.len()..at + 1 + right.len())?))
    })
}

/// Number of words in the first line that begins with a number, 0 if there is none.
pub(super) fn first_row_width(text: &str) -> usize {
    lines(text)
        .filter(|(_, line)| !is_comment(line))
        .find(|(_, line)| words(line).next().is_some_and(|(_, w)| number(w).is_some()))
        .map_or(0, |(_, line)| words(line).count())
}

/// Reads the whole of a text as a table.
pub(super) fn parse(name: &str, bytes: &[u8], layout: Layout) -> Result<RawTable, MotionError> {
    let text = decode(name, bytes)?;
    let mut builder = Builder::new(name);
    match layout {
        Layout::Separated => separated(&text, &mut builder)?,
        Layout::Blank | Layout::Running => blank(&text, layout, &mut builder)?,
    }
    builder.finish()
}

fn separated(text: &str, builder: &mut Builder<'_>) -> Result<(), MotionError> {
    let mut separator = None;
    for (line_number, line) in lines(text).filter(|(_, line)| !is_comment(line)) {
        let separator = *separator.get_or_insert_with(|| {
            let held = |c: &char| line.contains(*c);
            [';', '\t', ','].into_iter().find(held).unwrap_or(',')
        });
        let line = line.trim_end().strip_suffix(separator).unwrap_or(line);
        let fields = fields(line, separator);
        let decimal_comma = separator == ';';
        let plain = |field: &str| -> String {
            if decimal_comma {
                field.replace(',', ".")
            } else {
                field.to_owned()
            }
        };
        if builder.is_fresh()
            && fields
                .first()
                .is_some_and(|(_, f)| begins_like_a_word(&plain(f)))
        {
            builder.names = fields.iter().map(|(_, f)| (*f).to_owned()).collect();
            continue;
        }
        for (start, field) in fields {
            let field = plain(field);
            let value = finite_number(builder.file, line_number, line, start, &field)?;
            builder.push(value, &field);
        }
        builder.end_row(line_number)?;
    }
    Ok(())
}

fn blank(text: &str, layout: Layout, builder: &mut Builder<'_>) -> Result<(), MotionError> {
    let mut header_lines = 0;
    let mut last_header = "";
    for (line_number, line) in lines(text).filter(|(_, line)| !is_comment(line)) {
        let first = words(line).next().map_or("", |(_, w)| w);
        if builder.rows() == 0 && begins_like_a_word(first) && header_lines < MOST_HEADER_LINES {
            header_lines += 1;
            last_header = line;
            continue;
        }
        // Columns are counted; numbers that run on are not.
        if layout == Layout::Running {
            refuse_decimal_comma(builder.file, line_number, line, 0..line.len())?;
        }
        for (start, word) in words(line) {
            let value = finite_number(builder.file, line_number, line, start, word)?;
            builder.push(value, word);
            if layout == Layout::Running {
                builder.end_row(line_number)?;
            }
        }
        if layout == Layout::Blank {
            builder.end_row(line_number)?;
        }
    }
    if header_lines > 0 {
        builder.warnings.push(format!(
            "{}: the first {header_lines} line(s) without a number in front are taken as a header",
            builder.file
        ));
        let names: Vec<String> = words(last_header).map(|(_, w)| w.to_owned()).collect();
        if names.len() == builder.columns && layout == Layout::Blank {
            builder.names = names;
        }
    }
    Ok(())
}

/// A blank line or one that begins with a comment sign.
fn is_comment(line: &str) -> bool {
    let line = line.trim_start();
    line.is_empty() || line.starts_with(['#', '%', '!'])
}

/// Not a number, and not a number with a slip in it either: that must be reported, not skipped.
fn begins_like_a_word(field: &str) -> bool {
    number(field).is_none()
        && !field.starts_with(|c: char| c.is_ascii_digit() || "+-.*".contains(c))
}

/// Fields of a line, trimmed, without their quotes, each with the byte at which it begins.
fn fields(line: &str, separator: char) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let (mut start, mut quoted) = (0, false);
    let ends = line
        .char_indices()
        .filter(|&(_, c)| {
            if c == '"' {
                quoted = !quoted;
            }
            c == separator && !quoted
        })
        .map(|(i, _)| i)
        .chain(std::iter::once(line.len()));
    for end in ends {
        let raw = &line[start..end];
        let field = raw.trim_start();
        let offset = start + raw.len() - field.len();
        let field = field.trim_end();
        let inner = field
            .strip_prefix('"')
            .and_then(|f| f.strip_suffix('"'))
            .unwrap_or(field);
        found.push((offset, inner.trim()));
        // Separators are one byte long.
        start = end + 1;
    }
    found
}

/// Collects rows of equal width.
struct Builder<'a> {
    file: &'a str,
    names: Vec<String>,
    columns: usize,
    values: Vec<f64>,
    lines: Vec<usize>,
    prints: Vec<Print>,
    warnings: Vec<String>,
    /// Fields of the row so far.
    pending: usize,
}

impl<'a> Builder<'a> {
    fn new(file: &'a str) -> Self {
        Self {
            file,
            names: Vec::new(),
            columns: 0,
            values: Vec::new(),
            lines: Vec::new(),
            prints: Vec::new(),
            warnings: Vec::new(),
            pending: 0,
        }
    }

    fn rows(&self) -> usize {
        self.lines.len()
    }

    fn is_fresh(&self) -> bool {
        self.lines.is_empty() && self.names.is_empty()
    }

    fn push(&mut self, value: f64, field: &str) {
        let print = fineness(field);
        match self.prints.get_mut(self.pending) {
            Some(p) => {
                p.decimals = p.decimals.max(print.decimals);
                p.digits = p.digits.max(print.digits);
            }
            None => self.prints.push(print),
        }
        self.values.push(value);
        self.pending += 1;
    }

    fn end_row(&mut self, line: usize) -> Result<(), MotionError> {
        let found = std::mem::take(&mut self.pending);
        let too_large = |what, found, limit| MotionError::TooLarge {
            file: self.file.into(),
            what,
            found,
            limit,
        };
        if found > MOST_COLUMNS {
            return Err(too_large("columns", found, MOST_COLUMNS));
        }
        if self.values.len() > MOST_VALUES {
            return Err(too_large("values", self.values.len(), MOST_VALUES));
        }
        let wanted = match (self.rows(), self.names.len()) {
            (0, 0) => found,
            (0, named) => named,
            _ => self.columns,
        };
        if found != wanted {
            return Err(MotionError::Ragged {
                file: self.file.into(),
                line,
                wanted,
                found,
            });
        }
        self.columns = wanted;
        self.lines.push(line);
        Ok(())
    }

    fn finish(self) -> Result<RawTable, MotionError> {
        if self.values.is_empty() {
            return Err(MotionError::Empty {
                file: self.file.into(),
            });
        }
        Ok(RawTable {
            names: self.names,
            columns: self.columns,
            values: self.values,
            lines: self.lines,
            prints: self.prints,
            warnings: self.warnings,
        })
    }
}

/// Digits after the point and significant digits of a printed number.
fn fineness(field: &str) -> Print {
    let (mantissa, exponent) = field
        .split_once(['e', 'E', 'd', 'D'])
        .map_or((field, 0), |(m, e)| (m, e.parse().unwrap_or(0)));
    let count = |text: &str| text.bytes().filter(u8::is_ascii_digit).count() as i32;
    let after = mantissa
        .split_once('.')
        .map_or(0, |(_, after)| count(after));
    let leading_zeros = mantissa
        .bytes()
        .filter(|b| *b != b'.' && *b != b'-' && *b != b'+')
        .take_while(|b| *b == b'0')
        .count() as i32;
    Print {
        decimals: after.saturating_sub(exponent),
        digits: count(mantissa) - leading_zeros,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn csv(text: &str) -> Result<RawTable, MotionError> {
        parse("a.csv", text.as_bytes(), Layout::Separated)
    }

    #[test]
    fn every_kind_of_line_end_is_one_line_end() {
        for end in ["\n", "\r\n", "\r\r\n", "\r"] {
            let text = format!("1{end}2{end}3{end}");
            let table = parse("a.txt", text.as_bytes(), Layout::Blank).unwrap();
            assert_eq!(table.values, [1.0, 2.0, 3.0], "{end:?}");
            assert_eq!(table.lines, [1, 2, 3], "{end:?}");
        }
    }

    #[test]
    fn marks_at_the_ends_of_a_file_are_no_text() {
        let table = parse("a.txt", b"\xef\xbb\xbf1\r\n2\r\n\x1a", Layout::Blank).unwrap();
        assert_eq!(table.values, [1.0, 2.0]);
        assert!(parse("a.txt", b"1\n\x1a2\n", Layout::Blank).is_err());
    }

    #[test]
    fn a_header_quotes_comments_and_a_last_comma_are_understood() {
        let table = csv("# made by hand\n\"time, s\", acc \n\n0,1,\n0.5 , \"2\"\n").unwrap();
        assert_eq!(table.names, ["time, s", "acc"]);
        assert_eq!(table.values, [0.0, 1.0, 0.5, 2.0]);
        assert_eq!(table.lines, [4, 5]);
    }

    #[test]
    fn decimal_commas_are_read_where_semicolons_separate() {
        let table = csv("t;a\n0,00;1,5\n0,01;-2,5\n").unwrap();
        assert_eq!(table.values, [0.0, 1.5, 0.01, -2.5]);
    }

    #[test]
    fn what_is_not_a_number_is_shown_with_line_and_column() {
        let message = |text: &str| csv(text).unwrap_err().to_string();
        assert_eq!(
            message("t,a\n0,1\n0.1, 1.x\n"),
            "a.csv:3:6: wanted a number, found \"1.x\""
        );
        assert_eq!(
            message("t,a\n0,1\n0.1,\n"),
            "a.csv:3: wanted 2 columns, found 1"
        );
        assert_eq!(
            message("t,a\n0,NaN\n"),
            "a.csv:2:3: wanted a finite number, found NaN"
        );
        assert_eq!(
            message("t,a\n-inf,0\n"),
            "a.csv:2:1: wanted a finite number, found -inf"
        );
        assert_eq!(
            message("1,2\n3,1e999\n"),
            "a.csv:2:3: wanted a finite number, found 1e999"
        );
        // A slip in the first row is not a header.
        assert_eq!(
            message("0.1x,2\n"),
            "a.csv:1:1: wanted a number, found \"0.1x\""
        );
        assert_eq!(
            message("1,2\n1,2,3\n"),
            "a.csv:2: wanted 2 columns, found 3"
        );
    }

    #[test]
    fn a_binary_file_is_not_mistaken_for_text() {
        let error = parse("a.txt", b"1\n2\x00\n", Layout::Blank).unwrap_err();
        assert!(matches!(error, MotionError::NotText { line: 2, .. }));
    }

    #[test]
    fn fineness_counts_the_digits_that_were_printed() {
        for (text, decimals, digits) in [
            ("0.010", 3, 2),
            ("12.5", 1, 3),
            (".1297983E-02", 9, 7),
            ("1e3", -3, 1),
            ("-7", 0, 1),
        ] {
            let print = fineness(text);
            assert_eq!((print.decimals, print.digits), (decimals, digits), "{text}");
        }
    }
}
