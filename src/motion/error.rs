//! Why a motion cannot be read, generated or laid on the grid.
//!
//! Every variant carries what was wanted and what was found; those about a file name it and, where there is one,
//! the line and the column (from 1). In a `.npy` file "line" is the row.

use std::fmt;

use thiserror::Error;

use super::unit::{Quantity, Unit};
pub(super) use gusset_quantity::domain::{OutOfDomain, finite, inside, not_negative, positive};
use gusset_quantity::npy::NpyError;

/// A number in a message: six significant digits at most, as a plain decimal if that is short.
#[derive(Debug, Clone, Copy)]
pub(super) struct Short(pub(super) f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rounded = format!("{:.5e}", self.0).parse().unwrap_or(self.0);
        let is_plain = rounded == 0.0 || (1e-3..1e5).contains(&f64::abs(rounded));
        if is_plain || !rounded.is_finite() {
            write!(f, "{rounded}")
        } else {
            write!(f, "{rounded:e}")
        }
    }
}

/// A motion that cannot be used, and why.
#[derive(Debug, Error)]
pub enum MotionError {
    /// The bytes of the file could not be had.
    #[error("{file}: cannot be read: {source}")]
    Unreadable {
        /// Name of the file, as the test file spells it.
        file: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// No bytes, or no numbers among them.
    #[error("{file}: holds no numbers")]
    Empty {
        /// Name of the file.
        file: String,
    },
    /// More than we are prepared to hold.
    #[error("{file}: {found} {what}, but at most {limit} are read")]
    TooLarge {
        /// Name of the file.
        file: String,
        /// Bytes, values or columns.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A zero byte in what should be text.
    #[error(
        "{file}:{line}: wanted text, found a zero byte (is it a binary file, or UTF-16 without its mark?)"
    )]
    NotText {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
    },
    /// A word in place of a number.
    #[error(
        "{file}:{line}:{column}: wanted a number, found {}{advice}",
        word(found)
    )]
    NotANumber {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column of the first character, from 1.
        column: usize,
        /// The word.
        found: String,
        /// How else to read the file, in brackets; empty where no other way is likely.
        advice: String,
    },
    /// NaN, an infinity, or a number beyond the range of a double.
    #[error("{file}:{line}:{column}: wanted a finite number, found {found}")]
    NotFinite {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column of the first character, from 1.
        column: usize,
        /// The word.
        found: String,
    },
    /// A comma where a decimal point is expected: as a gap it would make two numbers of one.
    #[error(
        "{file}:{line}:{column}: wanted a decimal point, found a comma inside a number (a decimal comma?): {found:?}"
    )]
    DecimalComma {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column of the comma, from 1.
        column: usize,
        /// The number with its comma.
        found: String,
    },
    /// A header without a required entry.
    #[error("{file}:{line}: wanted {wanted}, found {found:?}")]
    Header {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The text expected.
        wanted: &'static str,
        /// The line, or the part of it that is wrong.
        found: String,
    },
    /// A header that announces another number of values than follow.
    #[error(
        "{file}: the header announces NPTS = {announced} values, the file holds {found}: {}",
        if found < announced {
            "it ends too early (correct NPTS if it is whole)"
        } else {
            "too many (correct NPTS if they belong to it)"
        }
    )]
    Count {
        /// Name of the file.
        file: String,
        /// The number that the header announces.
        announced: usize,
        /// How many there are.
        found: usize,
    },
    /// A header of a native record that announces another number of values than the file has.
    #[error(
        "{file}:{line}: {key} announces {announced} values, the file holds {found}: {}",
        if found < announced { "it ends too early" } else { "too many" }
    )]
    PointCount {
        /// Name of the file.
        file: String,
        /// Line after which the count is known, from 1.
        line: usize,
        /// What announces the count, as the header calls it.
        key: &'static str,
        /// The count of the header.
        announced: usize,
        /// How many there are.
        found: usize,
    },
    /// A header whose duration contradicts the count of values and their step.
    #[error(
        "{file}:{line}: {key} states {} s, but {points} values at intervals of {} s last {} s: \
         correct the header, or set dt_s",
        Short(*stated), Short(*dt), Short(*points as f64 * dt)
    )]
    Duration {
        /// Name of the file.
        file: String,
        /// Line that states the duration, from 1.
        line: usize,
        /// What states it, as the header calls it.
        key: &'static str,
        /// The duration of the header, in s.
        stated: f64,
        /// How many values there are.
        points: usize,
        /// Their step in s.
        dt: f64,
    },
    /// A native record in a variant that is not read.
    #[error("{file}: this {format} file cannot be used: {reason}")]
    UnsupportedRecord {
        /// Name of the file.
        file: String,
        /// The format that was recognised.
        format: &'static str,
        /// Why it is not read, or what to do.
        reason: &'static str,
    },
    /// A `.npy` file that is not understood.
    #[error("{file}: {source}")]
    Npy {
        /// Name of the file.
        file: String,
        /// The error.
        source: NpyError,
    },
    /// Neither the file nor the test file says the time step.
    #[error(
        "{file}: no time step: give dt_s, or time_column, or a file with a time column or a header that states it"
    )]
    StepMissing {
        /// Name of the file.
        file: String,
    },
    /// Times that fall or repeat.
    #[error("{file}:{line}: times must rise from row to row, found {} s after {} s", Short(*found), Short(*before))]
    NotRising {
        /// Name of the file.
        file: String,
        /// The line that is not later than the row before it.
        line: usize,
        /// Time of the row before.
        before: f64,
        /// Time of this one.
        found: f64,
    },
    /// Times that are not equally spaced.
    #[error(
        "{file}:{line}: the time step is not uniform: wanted {} s, found {} s",
        Short(*wanted), Short(*found)
    )]
    NotUniform {
        /// Name of the file.
        file: String,
        /// The line that breaks the grid.
        line: usize,
        /// The step of the other lines, or the time that this one should have.
        wanted: f64,
        /// What this line has.
        found: f64,
    },
    /// A row with another number of fields than the rows before.
    #[error("{file}:{line}: wanted {wanted} columns, found {found}")]
    Ragged {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Columns of the first row.
        wanted: usize,
        /// Columns of this row.
        found: usize,
    },
    /// Times in a unit that is not known, or not clearly theirs.
    #[error(
        "{file}{}: the unit of its times is not clear from its header {column:?}: give its time step in s as dt_s",
        line.map_or_else(String::new, |line| format!(":{line}"))
    )]
    TimeUnit {
        /// Name of the file.
        file: String,
        /// The line of the header, from 1, if it is no name of a column.
        line: Option<usize>,
        /// The name of the column of times, or the line of the header.
        column: String,
    },
    /// A column that the file does not have.
    #[error("{file}: no column {wanted}: it has {available}")]
    ColumnUnknown {
        /// Name of the file.
        file: String,
        /// The name or number requested.
        wanted: String,
        /// The columns that exist.
        available: String,
    },
    /// Two columns have the requested name.
    #[error(
        "{file}: columns {} and {} are both called {column:?}: choose one by column = {{ number = {} }}",
        numbers[0], numbers[1], numbers[0]
    )]
    ColumnTwice {
        /// Name of the file.
        file: String,
        /// The name requested.
        column: String,
        /// The first two columns with this name, from 1.
        numbers: [usize; 2],
    },
    /// One column is chosen for the times and for the values.
    #[error("{file}: column {number} is chosen for the times and for the values")]
    ColumnForBoth {
        /// Name of the file.
        file: String,
        /// From 1.
        number: usize,
    },
    /// Several columns could be meant.
    #[error(
        "{file}: which column? choose one with column = {{ name = \"…\" }} or {{ number = 1 }}: it has {available}"
    )]
    ColumnChoice {
        /// Name of the file.
        file: String,
        /// The columns that exist.
        available: String,
    },
    /// The unit is neither in the file nor in the test file.
    #[error(
        "{file}: does not state its unit{}: set its `unit` (with `gusset benchmark`: `--unit`): {}",
        if header.is_empty() {
            String::new()
        } else {
            format!(" in its header {header:?}")
        },
        quantity.spellings()
    )]
    UnitMissing {
        /// Name of the file.
        file: String,
        /// Name of the values in the header; empty without one.
        header: String,
        /// The quantity that the signal measures.
        quantity: Quantity,
    },
    /// A unit of something else.
    #[error("unit {unit} does not measure {quantity}")]
    UnitMismatch {
        /// The key whose unit it is, where it is not the signal's own unit.
        key: Option<&'static str>,
        /// The unit found.
        unit: Unit,
        /// The quantity to be measured.
        quantity: Quantity,
    },
    /// A signal or a processing step that has no meaning here.
    #[error("{key} does not apply to {what}")]
    NotApplicable {
        /// The key, as the test file spells it.
        key: &'static str,
        /// The signal or processing step that it was applied to.
        what: &'static str,
    },
    /// Components, or a target spectrum, to which no common factor exists.
    #[error("{why}")]
    Scaling {
        /// The key, as the test file spells it.
        key: &'static str,
        /// Why, with the name of the file.
        why: String,
    },
    /// A number outside its domain.
    #[error(transparent)]
    Parameter(#[from] OutOfDomain),
    /// Keys of which exactly one must be given.
    #[error("give exactly one of {names}: {found} are given")]
    ExactlyOne {
        /// The keys.
        names: &'static str,
        /// How many of them are there.
        found: usize,
    },
    /// Keys that exclude each other.
    #[error("give at most one of {names}: {found} are given")]
    AtMostOne {
        /// The keys.
        names: &'static str,
        /// How many of them are there.
        found: usize,
    },
    /// No frequency line of the realisation falls into the band.
    #[error(
        "the band from {} to {} Hz holds no multiple of 1/duration = {} Hz: \
         widen the band or lengthen the noise",
        Short(*from_hz), Short(*to_hz), Short(*line_hz)
    )]
    EmptyBand {
        /// Lower edge.
        from_hz: f64,
        /// Upper edge.
        to_hz: f64,
        /// Distance of the lines.
        line_hz: f64,
    },
    /// A motion that is zero throughout cannot be scaled to a peak.
    #[error("the motion is zero throughout and cannot be scaled to {}", Short(*wanted))]
    ZeroMotion {
        /// The peak requested, in SI units.
        wanted: f64,
    },
    /// A vector of the wrong length.
    #[error("{what}: wanted {wanted} entries, found {found}")]
    Length {
        /// The vector.
        what: &'static str,
        /// Entries needed.
        wanted: usize,
        /// Entries given.
        found: usize,
    },
    /// A degree of freedom that does not exist (from 1, as users count).
    #[error("{what}: degree of freedom {found} does not exist: there are {dofs}")]
    NoSuchDof {
        /// Key that names it.
        what: &'static str,
        /// The number named.
        found: usize,
        /// How many there are.
        dofs: usize,
    },
    /// An entry that is NaN or infinite.
    #[error("{what}: entry {index} is {found}, but must be finite")]
    EntryNotFinite {
        /// The vector.
        what: &'static str,
        /// Entry, from 1.
        index: usize,
        /// The value found.
        found: f64,
    },
}

impl MotionError {
    /// This error, with advice if it is about a word in place of a number.
    pub(super) fn advised(mut self, text: impl fmt::Display) -> Self {
        if let Self::NotANumber { advice, .. } = &mut self {
            *advice = format!(" ({text})");
        }
        self
    }

    /// Advice to the user that the message does not contain.
    #[must_use]
    pub const fn help(&self) -> Option<&'static str> {
        match self {
            Self::Ragged { .. } => Some(
                "`skip_rows` leaves out lines of a header; format = \"list\" reads numbers that run on from line to line",
            ),
            _ => None,
        }
    }

    /// The key of the test file that is wrong, if the error concerns one key.
    #[must_use]
    pub const fn key(&self) -> Option<&'static str> {
        match self {
            Self::Parameter(out) => Some(out.name),
            Self::NotApplicable { key, .. } | Self::Scaling { key, .. } => Some(key),
            Self::UnitMismatch { key, .. } => *key,
            Self::UnitMissing { .. } | Self::Unreadable { .. } => Some("path"),
            _ => None,
        }
    }
}

/// Every entry finite.
pub(super) fn all_finite(what: &'static str, values: &[f64]) -> Result<(), MotionError> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => Err(MotionError::EntryNotFinite {
            what,
            index: at + 1,
            found: values[at],
        }),
    }
}

/// A word of a file for a message; an empty cell by its name.
fn word(found: &str) -> String {
    if found.is_empty() {
        "an empty cell (each separator begins one, also each of two tabs)".to_owned()
    } else {
        format!("{found:?}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_messages_have_six_digits() {
        for (number, wanted) in [
            (19.990_000_000_000_002, "19.99"),
            (0.003_900_000_000_000_000_7, "0.0039"),
            (203.94, "203.94"),
            (0.0, "0"),
            (-1.0 / 3.0, "-0.333333"),
            (99_999.96, "1e5"),
            (1e-5, "1e-5"),
            (2.046_2e-4, "2.0462e-4"),
        ] {
            assert_eq!(Short(number).to_string(), wanted);
        }
    }
}
