//! Text: its characters, lines and words, and the numbers in them, with the place of everything that is not a number.
//!
//! Line ends may be LF, CR-LF, CR-CR-LF or a lone CR, also mixed. Knows nothing of tables and headers.

use std::borrow::Cow;
use std::ops::Range;

use crate::error::MotionError;

/// The text of a file. End-of-file marks of DOS and zero bytes that fill the last block are left out.
pub(super) fn decode<'a>(name: &str, bytes: &'a [u8]) -> Result<Cow<'a, str>, MotionError> {
    let text = characters(bytes);
    let is_fill = |c: char| matches!(c, '\0' | '\u{1a}');
    let is_end = |c: char| is_fill(c) || matches!(c, '\n' | '\r' | ' ');
    let body = text.trim_end_matches(is_end).len();
    let end = text[body..]
        .find(is_fill)
        .map_or(text.len(), |at| body + at);
    if let Some(at) = text[..end].find('\0') {
        return Err(MotionError::NotText {
            file: name.into(),
            line: lines(&text[..at]).count(),
        });
    }
    Ok(match text {
        Cow::Borrowed(text) => Cow::Borrowed(&text[..end]),
        Cow::Owned(mut text) => {
            text.truncate(end);
            Cow::Owned(text)
        }
    })
}

/// The characters of a file: UTF-8, UTF-16 with its mark in front, or Latin-1.
fn characters(bytes: &[u8]) -> Cow<'_, str> {
    if let [first @ (0xff | 0xfe), second @ (0xff | 0xfe), rest @ ..] = bytes
        && first != second
    {
        let read = if *first == 0xff {
            u16::from_le_bytes
        } else {
            u16::from_be_bytes
        };
        let units = rest.chunks_exact(2).map(|pair| read([pair[0], pair[1]]));
        let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        return Cow::Owned(text.collect());
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        // Latin-1: in it each byte is its character.
        Err(_) => Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect()),
    }
}

/// Lines with their numbers from 1, without their ends.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    const ENDS: [&str; 4] = ["\r\r\n", "\r\n", "\n", "\r"];
    let mut rest = Some(text);
    let all = std::iter::from_fn(move || {
        let text = rest?;
        let (line, tail) = text.split_at(text.find(['\n', '\r']).unwrap_or(text.len()));
        rest = ENDS.iter().find_map(|end| tail.strip_prefix(end));
        Some(line)
    });
    all.enumerate().map(|(i, line)| (i + 1, line))
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
                    advice: String::new(),
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

/// Refuses a comma within `part` of `line` that may be a decimal point: it has a digit to its right. A comma is accepted where
/// points in the parts that it separates show that it lies between two numbers.
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

/// A blank line or one that begins with a comment sign.
pub(super) fn is_comment(line: &str) -> bool {
    let line = line.trim_start();
    line.is_empty() || line.starts_with(['#', '%', '!'])
}

/// Fields of a line, trimmed, without their quotes, each with the byte at which it begins.
pub(super) fn fields(line: &str, separator: char) -> Vec<(usize, &str)> {
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
