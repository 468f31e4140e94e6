//! Columns and values of the table, each with its kind.

use std::borrow::Cow;

use serde::Serialize;

use gusset_config::Scalar;

/// A column of the table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct TableColumn {
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
pub(crate) enum CellKind {
    /// Integers of 64 bits.
    Integer,
    /// Floating-point numbers of 64 bits.
    Number,
    /// Texts.
    Text,
}

/// One value of the table.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    Missing,
    Integer(i64),
    Number(f64),
    Text(String),
}

impl Cell {
    /// A number; one that does not exist is missing.
    pub(crate) fn number(value: f64) -> Self {
        if value.is_nan() {
            Self::Missing
        } else {
            Self::Number(value)
        }
    }

    pub(crate) fn count(value: u64) -> Self {
        // A campaign has at most 1e8 tasks.
        Self::Integer(i64::try_from(value).unwrap_or(i64::MAX))
    }

    /// A value of an axis in a column of kind `kind`.
    pub(crate) fn of(value: &Scalar, kind: CellKind) -> Self {
        match (kind, value) {
            (CellKind::Integer, Scalar::Whole(value)) => Self::Integer(*value),
            (CellKind::Number, Scalar::Whole(value)) => Self::Number(*value as f64),
            (CellKind::Number, Scalar::Real(value)) => Self::number(*value),
            (_, Scalar::Text(value)) => Self::Text(value.clone()),
            (_, value) => Self::Text(value.toml()),
        }
    }

    /// The value as CSV: the shortest text that reads back as the same number, nothing for a missing value.
    pub(crate) fn csv(&self) -> String {
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
pub(super) fn quoted(text: &str) -> String {
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
