//! A test file as a tree whose every node knows where it stands in the text.
//!
//! Values are found by [`KeyPath`] (`specimen[1].storey`), so that a check anywhere in the program can point at the
//! line it speaks of without carrying positions through its data. Entries keep the order of the file.

use std::fmt;
use std::ops::Range;

use toml::de::{DeTable, DeValue};

/// One step of a [`KeyPath`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Segment {
    /// A key of a table.
    Key(String),
    /// An element of an array, from 0.
    Index(usize),
}

/// Where a value stands: `structure.shear_building.mass_kg[2]`. Indices count from 0.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct KeyPath(Vec<Segment>);

/// Why a text is not a dotted path, and which of its bytes say so.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PathError {
    /// What is wrong.
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

    /// True if `other` is this path or stands above it.
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
pub(crate) fn parse_segments(text: &str) -> Result<Vec<(Segment, Range<usize>)>, PathError> {
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

/// A value with its place in the text.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// Bytes of the key that names it; of the value for an array element and the root.
    pub key: Range<usize>,
    /// Bytes of the value; of the header for a `[table]`.
    pub span: Range<usize>,
    /// The value itself.
    pub datum: Datum,
}

/// What a [`Node`] holds.
#[derive(Debug, Clone)]
pub(crate) enum Datum {
    Text(String),
    Integer(i64),
    /// An integer or float beyond 64 bits, as written.
    TooLarge(String),
    Float(f64),
    Boolean(bool),
    Date(String),
    Array(Vec<Node>),
    Table(Vec<(String, Node)>),
}

/// A mistake in the grammar of the text.
#[derive(Debug, Clone)]
pub(crate) struct SyntaxError {
    pub message: String,
    pub span: Range<usize>,
}

impl Node {
    /// The tree of a TOML document, or all that is wrong with its grammar, in the order of the text.
    pub(crate) fn parse(text: &str) -> Result<Self, Vec<SyntaxError>> {
        let (root, errors) = DeTable::parse_recoverable(text);
        if errors.is_empty() {
            return Ok(table(root.into_inner(), 0..0, 0..0));
        }
        let mut errors: Vec<_> = errors
            .iter()
            .map(|e| SyntaxError {
                message: e.message().to_owned(),
                span: e.span().unwrap_or(0..0),
            })
            .collect();
        errors.sort_by_key(|e| e.span.start);
        Err(errors)
    }

    /// The node at `path`, if there is one.
    pub(crate) fn find(&self, path: &KeyPath) -> Option<&Self> {
        path.segments().iter().try_fold(self, Self::child)
    }

    /// Calls `visit` for this node and each table below it, parents first.
    pub(crate) fn each_table(
        &mut self,
        path: &KeyPath,
        visit: &mut impl FnMut(&KeyPath, &mut Self),
    ) {
        if matches!(self.datum, Datum::Table(_)) {
            visit(path, self);
        }
        match &mut self.datum {
            Datum::Table(entries) => {
                for (key, node) in entries {
                    node.each_table(&path.key(key), visit);
                }
            }
            // An array of numbers holds no table.
            Datum::Array(elements)
                if elements.iter().any(|e| matches!(e.datum, Datum::Table(_))) =>
            {
                for (index, element) in elements.iter_mut().enumerate() {
                    element.each_table(&path.index(index), visit);
                }
            }
            _ => {}
        }
    }

    /// Takes the entry at `keys` out of this table, and each table that this empties.
    pub(crate) fn take(&mut self, keys: &[&str]) -> Option<Self> {
        let Datum::Table(entries) = &mut self.datum else {
            return None;
        };
        let (first, rest) = keys.split_first()?;
        let at = entries.iter().position(|(key, _)| key == first)?;
        if rest.is_empty() {
            return Some(entries.remove(at).1);
        }
        let taken = entries.get_mut(at)?.1.take(rest)?;
        if matches!(&entries.get(at)?.1.datum, Datum::Table(left) if left.is_empty()) {
            entries.remove(at);
        }
        Some(taken)
    }

    /// Puts `node` at `keys` of this table. Tables that are created have the place of `node`.
    pub(crate) fn put(&mut self, keys: &[&str], node: Self) {
        let (Datum::Table(entries), Some((first, rest))) = (&mut self.datum, keys.split_first())
        else {
            return;
        };
        if rest.is_empty() {
            entries.push(((*first).to_owned(), node));
            return;
        }
        if !entries.iter().any(|(key, _)| key == first) {
            let table = Self {
                datum: Datum::Table(Vec::new()),
                ..node.clone()
            };
            entries.push(((*first).to_owned(), table));
        }
        if let Some((_, table)) = entries.iter_mut().find(|(key, _)| key == first) {
            table.put(rest, node);
        }
    }

    /// True if a value is at `keys` of this table, or a value in place of one of its tables.
    pub(crate) fn is_taken(&self, keys: &[&str]) -> bool {
        let Some((first, rest)) = keys.split_first() else {
            return true;
        };
        match &self.datum {
            Datum::Table(entries) => {
                let mut found = entries.iter().filter(|(key, _)| key == first);
                found.any(|(_, node)| node.is_taken(rest))
            }
            _ => true,
        }
    }

    fn child(&self, segment: &Segment) -> Option<&Self> {
        match (&self.datum, segment) {
            (Datum::Table(entries), Segment::Key(key)) => {
                entries.iter().find(|(k, _)| k == key).map(|(_, node)| node)
            }
            (Datum::Array(elements), Segment::Index(index)) => elements.get(*index),
            _ => None,
        }
    }

    /// Calls `visit` for this node and every one below it, in the order of the file.
    pub(crate) fn walk(&self, path: &KeyPath, visit: &mut impl FnMut(&KeyPath, &Self)) {
        visit(path, self);
        match &self.datum {
            Datum::Array(elements) => {
                for (index, element) in elements.iter().enumerate() {
                    element.walk(&path.index(index), visit);
                }
            }
            Datum::Table(entries) => {
                for (key, node) in entries {
                    node.walk(&path.key(key), visit);
                }
            }
            _ => {}
        }
    }

    /// Moves every span by `offset` bytes: a tree parsed from a piece of a longer text.
    pub(crate) fn shifted(mut self, from: usize, to: usize) -> Self {
        let shift = |r: &Range<usize>| {
            (r.start + to).saturating_sub(from)..(r.end + to).saturating_sub(from)
        };
        self.key = shift(&self.key);
        self.span = shift(&self.span);
        self.datum = match self.datum {
            Datum::Array(elements) => {
                Datum::Array(elements.into_iter().map(|n| n.shifted(from, to)).collect())
            }
            Datum::Table(entries) => Datum::Table(
                entries
                    .into_iter()
                    .map(|(k, n)| (k, n.shifted(from, to)))
                    .collect(),
            ),
            other => other,
        };
        self
    }
}

fn table(entries: DeTable<'_>, key: Range<usize>, span: Range<usize>) -> Node {
    let mut children: Vec<_> = entries
        .into_iter()
        .map(|(name, value)| {
            let node = node(name.span(), value.span(), value.into_inner());
            (name.into_inner().into_owned(), node)
        })
        .collect();
    // The parser's table is sorted by name; a file is read from top to bottom.
    children.sort_by_key(|(_, node)| (node.key.start, node.key.end));
    Node {
        key,
        span,
        datum: Datum::Table(children),
    }
}

fn node(key: Range<usize>, span: Range<usize>, value: DeValue<'_>) -> Node {
    let datum = match value {
        DeValue::String(text) => Datum::Text(text.into_owned()),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
            .map_or_else(|_| Datum::TooLarge(integer.to_string()), Datum::Integer),
        DeValue::Float(float) => match float.as_str().parse::<f64>() {
            Ok(value)
                if value.is_finite() || !float.as_str().contains(|c: char| c.is_ascii_digit()) =>
            {
                Datum::Float(value)
            }
            _ => Datum::TooLarge(float.to_string()),
        },
        DeValue::Boolean(value) => Datum::Boolean(value),
        DeValue::Datetime(date) => Datum::Date(date.to_string()),
        DeValue::Array(array) => Datum::Array(
            array
                .into_iter()
                .map(|element| node(element.span(), element.span(), element.into_inner()))
                .collect(),
        ),
        DeValue::Table(entries) => return table(entries, key, span),
    };
    Node { key, span, datum }
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
    fn a_broken_path_says_where_it_is_broken() {
        let span = |text| KeyPath::parse(text).unwrap_err().span;
        assert_eq!(span("a..b"), 2..2);
        assert_eq!(span("a[x].b"), 1..4);
        assert_eq!(span("a[1"), 1..3);
        assert_eq!(span("a[1]b"), 4..5);
        assert_eq!(span(""), 0..0);
    }

    #[test]
    fn every_node_is_found_at_its_place() {
        let text =
            "title = 'x'\n[[specimen]]\nname = 'a'\n[[specimen]]\nlaw = { linear = { k = 1_0 } }\n";
        let root = Node::parse(text).unwrap();
        let at = |path: &str| {
            let node = root.find(&KeyPath::parse(path).unwrap()).unwrap();
            (&text[node.key.clone()], &text[node.span.clone()])
        };
        assert_eq!(at("title"), ("title", "'x'"));
        assert_eq!(at("specimen[0].name"), ("name", "'a'"));
        assert_eq!(at("specimen[1]").1, "[[specimen]]");
        assert_eq!(at("specimen[1].law.linear.k"), ("k", "1_0"));
        assert!(root.find(&KeyPath::parse("specimen[2]").unwrap()).is_none());
    }

    #[test]
    fn a_number_beyond_64_bits_is_kept_as_written_and_inf_is_a_number() {
        let root = Node::parse("a = 99999999999999999999\nb = 1e999\nc = -inf\n").unwrap();
        let datum = |key: &str| root.find(&KeyPath::root().key(key)).unwrap().datum.clone();
        assert!(matches!(datum("a"), Datum::TooLarge(_)));
        assert!(matches!(datum("b"), Datum::TooLarge(_)));
        assert!(matches!(datum("c"), Datum::Float(v) if v == f64::NEG_INFINITY));
    }
}
