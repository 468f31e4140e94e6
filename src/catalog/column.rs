//! The columns of a row: name, unit, meaning.
