//! A test file as a tree whose every node knows its place in the text.
//!
//! Values are found by [`KeyPath`] (`specimen[1].storey`), so that a check anywhere in the program can point at the
//! line it speaks of without carrying positions through its data. Entries keep the order of the file.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

pub(crate) use gusset_quantity::finding::parse_segments;
pub use gusset_quantity::finding::{KeyPath, PathError, Segment};

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

/// Content of a [`Node`].
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

impl Datum {
    const fn in_words(&self) -> &'static str {
        match self {
            Self::Text(_) => "a string",
            Self::Integer(_) => "an integer",
            Self::TooLarge(_) => "a number",
            Self::Float(_) => "a float",
            Self::Boolean(_) => "a boolean",
            Self::Date(_) => "a date",
            Self::Array(_) => "an array",
            Self::Table(_) => "a table",
        }
    }
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
        if self.is_table() {
            visit(path, self);
        }
        match &mut self.datum {
            Datum::Table(entries) => {
                for (key, node) in entries {
                    node.each_table(&path.key(key), visit);
                }
            }
            // An array of numbers holds no table.
            Datum::Array(elements) if elements.iter().any(Self::is_table) => {
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

    /// Puts `value` at `path` below this node, which messages call `name`. Missing tables are created, and an element just
    /// behind the end of an array.
    ///
    /// # Errors
    /// The number of remaining segments where the path could not be followed, and why not.
    pub(crate) fn set(
        &mut self,
        name: &str,
        path: &[(Segment, Range<usize>)],
        value: &Self,
    ) -> Result<(), (usize, String)> {
        let Some(((segment, _), deeper)) = path.split_first() else {
            // It keeps its place in the order of the file.
            let key = self.key.clone();
            *self = Self {
                key,
                ..value.clone()
            };
            return Ok(());
        };
        match (&mut self.datum, segment) {
            (Datum::Table(entries), Segment::Key(key)) => {
                if let Some((_, entry)) = entries.iter_mut().find(|(own, _)| own == key) {
                    return entry.set(key, deeper, value);
                }
                entries.push((key.clone(), value.beneath(deeper)?));
                Ok(())
            }
            (Datum::Array(elements), Segment::Index(index)) => {
                let length = elements.len();
                let of_tables = elements.first().is_some_and(Self::is_table);
                let element = format!("{name}[{index}]");
                if *index > length {
                    let why = format!(
                        "`{name}` has {length} elements; {index} is beyond the end (indices count from 0)"
                    );
                    return Err((path.len(), why));
                }
                if of_tables && deeper.is_empty() && !value.is_table() {
                    let why =
                        format!("`{element}` is a table, which a single value cannot replace");
                    return Err((path.len(), why));
                }
                match elements.get_mut(*index) {
                    Some(old) => return old.set(&element, deeper, value),
                    None => elements.push(value.beneath(deeper)?),
                }
                Ok(())
            }
            (datum, segment) => {
                let found = datum.in_words();
                let why = match segment {
                    Segment::Key(key) => format!("`{name}` is {found}; it has no key `{key}`"),
                    Segment::Index(index) => {
                        format!("`{name}` is {found}; it has no element {index}")
                    }
                };
                Err((path.len(), why))
            }
        }
    }

    /// Puts `value` at `path` below this node, if that can be followed.
    pub(crate) fn replace(&mut self, path: &KeyPath, value: &Self) {
        let segments = path.segments().iter();
        let segments: Vec<_> = segments.map(|one| (one.clone(), 0..0)).collect();
        drop(self.set("", &segments, value));
    }

    /// The tables and arrays along `path` with this value at its end.
    fn beneath(&self, path: &[(Segment, Range<usize>)]) -> Result<Self, (usize, String)> {
        let Some(((segment, _), deeper)) = path.split_first() else {
            return Ok(self.clone());
        };
        let datum = match segment {
            Segment::Key(key) => Datum::Table(vec![(key.clone(), self.beneath(deeper)?)]),
            Segment::Index(0) => Datum::Array(vec![self.beneath(deeper)?]),
            Segment::Index(index) => {
                let why =
                    format!("there is no array here yet; its first element is 0, not {index}");
                return Err((path.len(), why));
            }
        };
        let (key, span) = (self.key.clone(), self.span.clone());
        Ok(Self { key, span, datum })
    }

    const fn is_table(&self) -> bool {
        matches!(self.datum, Datum::Table(_))
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
    fn large_numbers_are_kept_as_written() {
        let root = Node::parse("a = 99999999999999999999\nb = 1e999\nc = -inf\n").unwrap();
        let datum = |key: &str| root.find(&KeyPath::root().key(key)).unwrap().datum.clone();
        assert!(matches!(datum("a"), Datum::TooLarge(_)));
        assert!(matches!(datum("b"), Datum::TooLarge(_)));
        assert!(matches!(datum("c"), Datum::Float(v) if v == f64::NEG_INFINITY));
    }
}
