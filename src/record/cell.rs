//! Columns and values of a table that is written, each with its kind.

use std::borrow::Cow;

use serde::Serialize;

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TableColumn {
    /// Name, as in the first line of the table.
    pub name: String,
    /// SI unit, "1" for a pure number, "" for a text or where it is not known.
    pub unit: String,
    /// Kind of its values.
    #[serde(rename = "type")]
    pub kind: CellKind,
    /// One line of explanation.
    pub meaning: String,
}

/// Kind of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CellKind {
    /// Integers of 64 bits.
    Integer,
    /// Floating-point numbers of 64 bits.
    Number,
    /// Texts.
    Text,
}

/// One value of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// No value.
    Missing,
    /// An integer.
    Integer(i64),
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

impl Cell {
    /// A number; one that does not exist is missing.
    #[must_use]
    pub fn number(value: f64) -> Self {
        if value.is_nan() {
            Self::Missing
        } else {
            Self::Number(value)
        }
    }

    /// A count, which stays far below the largest integer.
    #[must_use]
    pub fn count(value: u64) -> Self {
        Self::Integer(i64::try_from(value).unwrap_or(i64::MAX))
    }

    /// The value as CSV: the shortest text that reads back as the same number, nothing for a missing value.
    #[must_use]
    pub fn csv(&self) -> String {
        match self {
            Self::Missing => String::new(),
            Self::Integer(value) => value.to_string(),
            Self::Number(value) => format!("{value:?}"),
            Self::Text(text) => quoted(&inert(text)),
        }
    }
}

/// A text that a spreadsheet does not run. One that begins as a formula does gets an apostrophe, and so does one with an
/// apostrophe: a reader removes the first apostrophe of each text.
fn inert(text: &str) -> Cow<'_, str> {
    match text.starts_with(['=', '+', '-', '@', '\t', '\r', '\'']) {
        true => Cow::Owned(format!("'{text}")),
        false => Cow::Borrowed(text),
    }
}

/// A text as CSV.
#[must_use]
pub fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_not_a_spreadsheet_formula() {
        let csv = |text: &str| Cell::Text(text.to_owned()).csv();
        for (text, written) in [
            ("=1+2", "'=1+2"),
            ("+1", "'+1"),
            ("-1", "'-1"),
            ("@a", "'@a"),
            ("'a", "''a"),
            ("\t=a", "'\t=a"),
            ("=a,\"b\"", "\"'=a,\"\"b\"\"\""),
            ("a=b", "a=b"),
            ("", ""),
        ] {
            assert_eq!(csv(text), written);
        }
        // Numbers stay numbers.
        assert_eq!(Cell::Integer(-1).csv(), "-1");
        assert_eq!(Cell::Number(-0.5).csv(), "-0.5");
    }
}
