//! Lines of a native record: header text, fixed-width numbers of Fortran, and blocks of values with a known count.

use std::iter::Peekable;

use crate::error::MotionError;
use crate::read::peer::read_numbers;
use crate::read::text::{lines, number, shorten};
use crate::read::{MOST_COLUMNS, MOST_VALUES};
use crate::unit::Unit;

/// Where a block of values ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BlockEnd {
    /// At the next line of text, or at the end of the file.
    Text,
    /// At the announced count: the next block follows without a line of text.
    Count,
}

/// A file read line by line.
pub(super) struct Lines<'a> {
    pub(super) file: &'a str,
    rest: Peekable<Box<dyn Iterator<Item = (usize, &'a str)> + 'a>>,
    /// Number of the line read last.
    pub(super) at: usize,
    /// Values read so far.
    total: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(file: &'a str, text: &'a str) -> Self {
        let all: Box<dyn Iterator<Item = (usize, &'a str)> + 'a> = Box::new(lines(text));
        Self {
            file,
            rest: all.peekable(),
            at: 0,
            total: 0,
        }
    }

    /// The next line that is not blank.
    pub(super) fn peek(&mut self) -> Option<&'a str> {
        while self
            .rest
            .next_if(|(_, line)| line.trim().is_empty())
            .is_some()
        {}
        self.rest.peek().map(|(_, line)| *line)
    }

    /// Takes the next line, blank or not.
    pub(super) fn next(&mut self) -> Option<&'a str> {
        let (at, line) = self.rest.next()?;
        self.at = at;
        Some(line)
    }

    /// Takes the next line, which must exist.
    pub(super) fn expect(&mut self, wanted: &'static str) -> Result<&'a str, MotionError> {
        match self.next() {
            Some(line) => Ok(line),
            None => Err(self.refuse(wanted, "the end of the file")),
        }
    }

    /// The line read last is not what a header must have there.
    pub(super) fn refuse(&self, wanted: &'static str, found: &str) -> MotionError {
        MotionError::Header {
            file: self.file.into(),
            line: self.at.max(1),
            wanted,
            found: shorten(found.trim()),
        }
    }

    /// A variant of the format that is not read.
    pub(super) fn unsupported(&self, format: &'static str, reason: &'static str) -> MotionError {
        MotionError::UnsupportedRecord {
            file: self.file.into(),
            format,
            reason,
        }
    }

    /// The header and the file disagree on a count.
    pub(super) fn count(&self, key: &'static str, announced: usize, found: usize) -> MotionError {
        MotionError::PointCount {
            file: self.file.into(),
            line: self.at.max(1),
            key,
            announced,
            found,
        }
    }

    /// A whole number of points out of a header.
    pub(super) fn points(&self, found: f64, wanted: &'static str) -> Result<usize, MotionError> {
        let is_count = found >= 1.0 && found.fract() == 0.0;
        if !is_count {
            return Err(self.refuse(wanted, &found.to_string()));
        }
        if found > MOST_VALUES as f64 {
            return Err(self.too_many(found as usize));
        }
        Ok(found as usize)
    }

    /// Exactly `count` numbers of a header in fields of `width` characters, which may touch.
    pub(super) fn header_numbers(
        &mut self,
        count: usize,
        width: usize,
        wanted: &'static str,
    ) -> Result<Vec<f64>, MotionError> {
        let mut numbers = Vec::new();
        while numbers.len() < count {
            let line = self.expect(wanted)?;
            if line.trim().is_empty() {
                continue;
            }
            let fields = fixed_fields(line, width).or_else(|| separate(line));
            numbers.extend(fields.ok_or_else(|| self.refuse(wanted, line))?);
        }
        if numbers.len() > count {
            return Err(self.refuse(wanted, "more numbers"));
        }
        Ok(numbers)
    }

    /// A block of exactly `announced` values, in fields of `width` characters where they touch.
    pub(super) fn values(
        &mut self,
        announced: usize,
        key: &'static str,
        width: Option<usize>,
        end: BlockEnd,
    ) -> Result<Vec<f64>, MotionError> {
        let mut values = Vec::new();
        while let Some(line) = self.peek() {
            let is_full = end == BlockEnd::Count && values.len() >= announced;
            if is_full || is_text(line) {
                break;
            }
            self.next();
            self.numbers_of(line, width, &mut values)?;
            self.limit(values.len())?;
        }
        if values.len() != announced {
            return Err(self.count(key, announced, values.len()));
        }
        self.total += values.len();
        Ok(values)
    }

    /// All rows up to the next line of text, by columns: each row has `columns` numbers.
    pub(super) fn rows(
        &mut self,
        columns: usize,
        width: Option<usize>,
    ) -> Result<Vec<Vec<f64>>, MotionError> {
        if columns > MOST_COLUMNS {
            return Err(MotionError::TooLarge {
                file: self.file.into(),
                what: "columns",
                found: columns,
                limit: MOST_COLUMNS,
            });
        }
        let mut table = vec![Vec::new(); columns];
        let mut row = Vec::new();
        let mut rows = 0;
        while let Some(line) = self.peek() {
            if is_text(line) {
                break;
            }
            self.next();
            row.clear();
            self.numbers_of(line, width, &mut row)?;
            if row.len() != columns {
                return Err(MotionError::Ragged {
                    file: self.file.into(),
                    line: self.at,
                    wanted: columns,
                    found: row.len(),
                });
            }
            for (column, value) in table.iter_mut().zip(&row) {
                column.push(*value);
            }
            rows += 1;
            self.limit(rows * columns)?;
        }
        Ok(table)
    }

    /// Appends the numbers of one line.
    fn numbers_of(
        &self,
        line: &str,
        width: Option<usize>,
        values: &mut Vec<f64>,
    ) -> Result<(), MotionError> {
        // Numbers with gaps need no width. The width parts numbers that touch.
        let split = separate(line).or_else(|| width.and_then(|width| fixed_fields(line, width)));
        match split {
            Some(numbers) => values.extend(numbers),
            None => read_numbers(self.file, self.at, line, values)?,
        }
        Ok(())
    }

    fn limit(&self, found: usize) -> Result<(), MotionError> {
        if self.total + found > MOST_VALUES {
            return Err(self.too_many(self.total + found));
        }
        Ok(())
    }

    fn too_many(&self, found: usize) -> MotionError {
        MotionError::TooLarge {
            file: self.file.into(),
            what: "values",
            found,
            limit: MOST_VALUES,
        }
    }
}

/// True if a line has a word that is no number: without a digit, or with another character in front.
pub(super) fn is_text(line: &str) -> bool {
    line.split_whitespace().any(|word| {
        let is_value = word.starts_with(|c: char| c.is_ascii_digit() || "+-.,".contains(c))
            && word.contains(|c: char| c.is_ascii_digit());
        let is_overflow = word.bytes().all(|b| b == b'*');
        let is_special = number(word).is_some();
        !(is_value || is_overflow || is_special)
    })
}

/// True of the line that ends a channel on tapes of the 1970s and in files after them.
pub(super) fn ends_channel(line: &str) -> bool {
    line.starts_with("/&")
}

/// The numbers of a line with gaps between them; `None` if a word is not a finite number.
fn separate(line: &str) -> Option<Vec<f64>> {
    line.split_whitespace().map(finite).collect()
}

/// The numbers of a line of equal fields; `None` if a field is not a finite number.
fn fixed_fields(line: &str, width: usize) -> Option<Vec<f64>> {
    let line = line.trim_end();
    if !line.is_ascii() || width == 0 {
        return None;
    }
    line.as_bytes()
        .chunks(width)
        .map(|field| finite(std::str::from_utf8(field).ok()?.trim()))
        .collect()
}

fn finite(word: &str) -> Option<f64> {
    number(word).filter(|value| value.is_finite())
}

/// The number at the start of `text`, whatever follows it: `200Hz`, `.005 SEC`.
pub(super) fn leading_number(text: &str) -> Option<f64> {
    let text = text.trim_start();
    let end = text
        .find(|c: char| !(c.is_ascii_digit() || "+-.eEdD".contains(c)))
        .unwrap_or(text.len())
        .min(40);
    (1..=end).rev().find_map(|end| finite(text.get(..end)?))
}

/// The number behind `key`, whatever the case, and behind blanks, `=` or `:`.
pub(super) fn number_after(line: &str, key: &str) -> Option<f64> {
    let at = line.to_ascii_uppercase().find(&key.to_ascii_uppercase())? + key.len();
    let gap = |c: char| c.is_whitespace() || c == '=' || c == ':';
    leading_number(line.get(at..)?.trim_start_matches(gap))
}

/// The width of the fields of a Fortran format: 10 for `(8f10.6)`, 8 for `(10I8)`.
pub(super) fn field_width(format: &str) -> Option<usize> {
    let upper = format.to_ascii_uppercase();
    let (_, inner) = upper.split_once('(')?;
    let (inner, _) = inner.split_once(')')?;
    let at = inner.find(['I', 'F', 'E', 'G', 'D'])?;
    let digits = inner
        .get(at + 1..)?
        .split(|c: char| !c.is_ascii_digit())
        .next()?;
    digits.parse().ok().filter(|width| (1..=80).contains(width))
}

/// A unit in the spelling of a header, and the factor of the values where no unit has that size: `g/10`, `mg`.
pub(super) fn unit_and_factor(word: &str) -> Option<(Unit, f64)> {
    let word = word.trim_matches(|c: char| "().,;:[]".contains(c));
    match word.to_ascii_lowercase().as_str() {
        "g/10" => Some((Unit::Gravity, 0.1)),
        "mg" => Some((Unit::Gravity, 1e-3)),
        _ => Unit::from_header(word).map(|unit| (unit, 1.0)),
    }
}

/// The step of a column of times that must be uniform. The first row is on line `first`.
pub(super) fn uniform_step(file: &str, times: &[f64], first: usize) -> Result<f64, MotionError> {
    let (Some(start), Some(end)) = (times.first(), times.last()) else {
        return Err(MotionError::Empty { file: file.into() });
    };
    if times.len() < 2 {
        return Err(MotionError::StepMissing { file: file.into() });
    }
    let dt = (end - start) / (times.len() - 1) as f64;
    // A missing row moves a time by half a step or more. Print moves it by less than a third.
    let broken = times.iter().enumerate().find_map(|(row, &found)| {
        let wanted = start + row as f64 * dt;
        let is_uniform = dt > 0.0 && (found - wanted).abs() < dt / 3.0;
        (!is_uniform).then_some((row, wanted, found))
    });
    match broken {
        None => Ok(dt),
        Some((row, wanted, found)) => Err(MotionError::NotUniform {
            file: file.into(),
            line: first + row,
            wanted,
            found,
        }),
    }
}
