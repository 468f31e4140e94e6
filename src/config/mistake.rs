//! A mistake in the shape of a file, as data: the requirement of the schema and the content of the file.

use super::document::KeyPath;

/// A mistake in the shape of the file: it differs from the requirement of the schema.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mistake {
    /// Where.
    pub path: KeyPath,
    /// Kind of the mistake.
    pub kind: Kind,
}

/// Kinds of [`Mistake`].
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    /// `path` ends in a key that its table does not have.
    UnknownKey { allowed: Vec<&'static str> },
    /// The table at `path` lacks this key.
    MissingKey { key: &'static str },
    /// `path` is, or ends in, a name that is not in the list.
    UnknownName {
        found: String,
        allowed: Vec<&'static str>,
    },
    /// The table at `path` must have exactly one of these keys.
    NotExactlyOne {
        found: Vec<String>,
        allowed: Vec<&'static str>,
    },
    /// The wrong kind of value. `hint`: the correction.
    WrongType {
        found: String,
        wanted: String,
        hint: Option<String>,
    },
    /// The right kind, the wrong value.
    WrongValue {
        found: String,
        wanted: String,
        hint: Option<String>,
    },
    /// Message of the reader of a type.
    Other(String),
    /// Follows from a mistake that is already noted.
    Consequence,
}
