//! A finding: what is wrong, or worth knowing, at one key of a test file.
//!
//! A [`KeyPath`] names the key. A [`Finding`] adds the severity, a headline, advice and numbers. Both are plain values: a
//! proof of stability reports a finding without any knowledge of files. The module `config` finds the line of the key and
//! draws the diagnostic. This module imports no other module.

use std::fmt;
use std::ops::Range;

/// One step of a [`KeyPath`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Segment {
    /// A key of a table.
    Key(String),
    /// An element of an array, from 0.
    Index(usize),
}

/// Place of a value: `structure.shear_building.mass_kg[2]`. Indices count from 0.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct KeyPath(Vec<Segment>);

/// Why a text is not a dotted path, and the bytes of the mistake.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PathError {
    /// The mistake in words.
    pub message: &'static str,
    /// Where in the text.
    pub span: Range<usize>,
}

impl KeyPath {
    /// The whole document.
    #[must_use]
    pub const fn root() -> Self {
        Self(Vec::new())
    }

    /// This path, one key deeper.
    #[must_use]
    pub fn key(&self, key: &str) -> Self {
        self.deeper(Segment::Key(key.to_owned()))
    }

    /// This path, one array element deeper.
    #[must_use]
    pub fn index(&self, index: usize) -> Self {
        self.deeper(Segment::Index(index))
    }

    /// This path, several keys deeper: `dotted` is `misses.window_s`.
    #[must_use]
    pub fn under(&self, dotted: &str) -> Self {
        let keys = dotted.split('.');
        keys.fold(self.clone(), |at, key| at.key(key))
    }

    fn deeper(&self, segment: Segment) -> Self {
        let mut segments = self.0.clone();
        segments.push(segment);
        Self(segments)
    }

    /// The path of the table or array that holds this one; the root has none.
    #[must_use]
    pub fn parent(&self) -> Option<Self> {
        let (_, above) = self.0.split_last()?;
        Some(Self(above.to_vec()))
    }

    /// True if `other` is this path or contains it.
    #[must_use]
    pub fn starts_with(&self, other: &Self) -> bool {
        self.0.starts_with(&other.0)
    }

    /// The steps from the root.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.0
    }

    /// The path with `[*]` in place of each index: `specimen[*].limits`.
    #[must_use]
    pub fn shape(&self) -> String {
        let mut shape = String::new();
        for segment in &self.0 {
            match segment {
                Segment::Index(_) => shape.push_str("[*]"),
                Segment::Key(key) if shape.is_empty() => shape.push_str(key),
                Segment::Key(key) => {
                    shape.push('.');
                    shape.push_str(key);
                }
            }
        }
        shape
    }

    /// The last key of the path, if it ends in one.
    #[must_use]
    pub fn last_key(&self) -> Option<&str> {
        match self.0.last() {
            Some(Segment::Key(key)) => Some(key),
            _ => None,
        }
    }

    /// Reads `specimen[1].storey` or `specimen.1.storey`; a key with a dot in it is quoted.
    ///
    /// # Errors
    /// [`PathError`] where a key is empty or a bracket is wrong.
    pub fn parse(text: &str) -> Result<Self, PathError> {
        let segments = parse_segments(text)?;
        Ok(Self(segments.into_iter().map(|(s, _)| s).collect()))
    }
}

impl FromIterator<Segment> for KeyPath {
    fn from_iter<I: IntoIterator<Item = Segment>>(segments: I) -> Self {
        Self(segments.into_iter().collect())
    }
}

impl fmt::Display for KeyPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, segment) in self.0.iter().enumerate() {
            match segment {
                Segment::Index(index) => write!(f, "[{index}]")?,
                Segment::Key(key) => {
                    if position > 0 {
                        f.write_str(".")?;
                    }
                    if key.is_empty() || key.contains(['.', '[', ']', '"', '=', ' ']) {
                        write!(f, "{key:?}")?;
                    } else {
                        f.write_str(key)?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// The segments of a dotted path, each with its bytes in `text`.
pub fn parse_segments(text: &str) -> Result<Vec<(Segment, Range<usize>)>, PathError> {
    let mut segments = Vec::new();
    let mut at = 0;
    let error = |message, span| Err(PathError { message, span });
    loop {
        let rest = &text[at..];
        let (segment, length) = if let Some(inner) = rest.strip_prefix('[') {
            let Some(end) = inner.find(']') else {
                return error("a `[` without its `]`", at..text.len());
            };
            let Ok(index) = inner[..end].trim().parse() else {
                return error("an index must be a whole number from 0", at..at + end + 2);
            };
            (Segment::Index(index), end + 2)
        } else if let Some(quote) = rest.chars().next().filter(|c| matches!(c, '"' | '\'')) {
            let Some(end) = rest[1..].find(quote) else {
                return error("a quote that does not end", at..text.len());
            };
            (Segment::Key(rest[1..=end].to_owned()), end + 2)
        } else {
            let end = rest.find(['.', '[']).unwrap_or(rest.len());
            let word = rest[..end].trim();
            if word.is_empty() {
                return error("a key is missing here", at..at + end);
            }
            let segment = word
                .parse()
                .map_or_else(|_| Segment::Key(word.to_owned()), Segment::Index);
            (segment, end)
        };
        segments.push((segment, at..at + length));
        at += length;
        match text[at..].chars().next() {
            None => return Ok(segments),
            Some('.') => at += 1,
            Some('[') => {}
            Some(other) => {
                return error("expected `.` or `[` here", at..at + other.len_utf8());
            }
        }
    }
}

/// Whether a diagnostic forbids the test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// The test is refused.
    Error,
    /// The test runs; the user should know.
    Warning,
}

/// The part of an entry that a finding points at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Its key.
    Key,
    /// Its value; the header of a `[table]`.
    Value,
}

/// A mistake at a path of the test file, in words.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Whether it forbids the test.
    pub severity: Severity,
    /// Where; the nearest entry above it that exists is shown.
    pub path: KeyPath,
    /// What of the entry is wrong.
    pub part: Part,
    /// One line: what is wrong.
    pub headline: String,
    /// A few words under the caret.
    pub label: String,
    /// Allowed values and advice.
    pub help: Vec<String>,
    /// A second place that the mistake is about, with a few words.
    pub beside: Option<(KeyPath, String)>,
    /// Numbers that it states, by name, SI: for programs that read a verdict.
    pub numbers: Vec<(&'static str, f64)>,
}

impl Finding {
    /// An error at the value of `path`.
    pub fn error(path: KeyPath, headline: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            path,
            part: Part::Value,
            headline: headline.into(),
            label: String::new(),
            help: Vec::new(),
            beside: None,
            numbers: Vec::new(),
        }
    }

    /// A warning at the value of `path`.
    pub fn warning(path: KeyPath, headline: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::error(path, headline)
        }
    }

    /// Points at the key.
    #[must_use]
    pub fn at_key(mut self) -> Self {
        self.part = Part::Key;
        self
    }

    /// Sets the words under the caret.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }

    /// Adds a line of help.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help.push(help.into());
        self
    }

    /// Adds a number in SI units.
    #[must_use]
    pub fn number(mut self, name: &'static str, value: f64) -> Self {
        self.numbers.push((name, value));
        self
    }

    /// Shows a second place.
    #[must_use]
    pub fn beside(mut self, path: KeyPath, label: impl Into<String>) -> Self {
        self.beside = Some((path, label.into()));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(text: &str) -> String {
        KeyPath::parse(text).unwrap().to_string()
    }

    #[test]
    fn both_spellings_of_an_index_are_one_path() {
        assert_eq!(round("specimen.1.storey"), "specimen[1].storey");
        assert_eq!(round("specimen[1].storey"), "specimen[1].storey");
        assert_eq!(round("a.'b.c'[0][2]"), "a.\"b.c\"[0][2]");
    }

    #[test]
    fn broken_path_names_the_break() {
        let span = |text| KeyPath::parse(text).unwrap_err().span;
        assert_eq!(span("a..b"), 2..2);
        assert_eq!(span("a[x].b"), 1..4);
        assert_eq!(span("a[1"), 1..3);
        assert_eq!(span("a[1]b"), 4..5);
        assert_eq!(span(""), 0..0);
    }
}
