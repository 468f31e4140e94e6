//! From the tree of a test file to its structs, finding as many mistakes as can be found.
//!
//! This serde deserializer replaces the parser's for three reasons. A mistake comes back as data (key, found value,
//! allowed values) and not as a sentence. It knows its path. After a mistake it continues without the invalid value, so
//! that one run reports them all. An error that only follows from an earlier one is not reported. Tables are never read
//! from arrays, which serde would allow.

use serde::de::DeserializeOwned;

use super::diagnose::MOST_SHOWN;
use super::document::{KeyPath, Node};
use super::mistake::{Kind, Mistake};
use super::reader::{Fault, Reader};
use super::suggest;

/// Outcome of [`read`].
#[derive(Debug)]
pub(crate) struct Reading<T> {
    /// The value, without the entries that are wrong; absent if it cannot be made without them.
    pub value: Option<T>,
    /// All that is wrong.
    pub mistakes: Vec<Mistake>,
}

/// Reads `T` from the tree. A value counts only if there are no mistakes.
pub(crate) fn read<T: DeserializeOwned>(root: &Node) -> Reading<T> {
    let mut session = Session::default();
    loop {
        let reader = Reader {
            node: root,
            path: KeyPath::root(),
            skip: &session.skip,
        };
        let error = match T::deserialize(reader) {
            Ok(value) => {
                return Reading {
                    value: Some(value),
                    mistakes: session.mistakes,
                };
            }
            Err(error) => error,
        };
        let Fault {
            kind,
            path,
            at_variant,
        } = *error.0;
        let path = path.unwrap_or_default();
        // An enum's table cannot do without its only entry: leave out the whole.
        let skip = if at_variant {
            path.parent().unwrap_or_default()
        } else {
            path.clone()
        };
        let mistake = Mistake { path, kind };
        if !session.explains(&mistake) {
            session.mistakes.push(mistake);
        }
        // Each pass omits one more path; the root, or a path twice, means that no further pass helps. The bound keeps a
        // long array of wrong values from costing its square.
        let enough = session.mistakes.len() > MOST_SHOWN;
        if enough || skip.segments().is_empty() || session.skip.contains(&skip) {
            return Reading {
                value: None,
                mistakes: session.mistakes,
            };
        }
        session.skip.push(skip);
    }
}

/// Findings of earlier passes.
#[derive(Debug, Default)]
struct Session {
    mistakes: Vec<Mistake>,
    skip: Vec<KeyPath>,
}

impl Session {
    fn explains(&self, mistake: &Mistake) -> bool {
        match &mistake.kind {
            Kind::Consequence => true,
            Kind::MissingKey { key } => {
                let missing = mistake.path.key(key);
                let misspelt = |known: &Mistake| {
                    matches!(&known.kind, Kind::UnknownKey { allowed }
                        if known.path.parent().as_ref() == Some(&mistake.path)
                            && suggest::nearest(known.path.last_key().unwrap_or(""), allowed) == Some(*key))
                };
                self.skip.contains(&missing) || self.mistakes.iter().any(misspelt)
            }
            Kind::Other(_) | Kind::WrongValue { .. } | Kind::NotExactlyOne { .. } => self
                .skip
                .iter()
                .any(|s| *s != mistake.path && s.starts_with(&mistake.path)),
            Kind::UnknownKey { .. } | Kind::UnknownName { .. } | Kind::WrongType { .. } => false,
        }
    }
}
