//! `--set KEY=VALUE`: one key of the test file, replaced or added from the command line.
//!
//! The key is a dotted path whose indices count from 0 (`specimen[0].storey` or `specimen.0.storey`). The value is TOML;
//! any other value is a bare text, so that `--set time.clock=simulated` needs no quotes. An error in an overridden value
//! points into the argument. No override may undo another.

use std::ops::Range;
use std::sync::Arc;

use super::diagnose::{Diagnostic, Part, Place, Severity, Source, decimal_comma};
use super::document::{Datum, KeyPath, Node, Segment, SyntaxError, parse_segments};
use super::echo::plain;
use super::words::{NO_COMMA, comma_readings};

/// Text before the argument in messages.
const FLAG: &str = "--set ";

/// One parsed `--set` argument.
#[derive(Debug, Clone)]
pub struct Override {
    source: Arc<Source>,
    segments: Vec<(Segment, Range<usize>)>,
    value_span: Range<usize>,
    /// The value as a tree in the argument's text.
    value: Node,
}

impl Override {
    /// Reads `KEY=VALUE`.
    ///
    /// # Errors
    /// A diagnostic that points into the argument: no `=`, a broken path, an empty value, or broken TOML.
    pub(crate) fn parse(argument: &str) -> Result<Self, Box<Diagnostic>> {
        let source = Arc::new(Source {
            name: "command line".to_owned(),
            text: format!("{FLAG}{argument}"),
        });
        let refuse = |headline: &str, label: &str, span: Range<usize>, help: &str| {
            refusal(&source, span, headline, label, Some(help))
        };
        let Some((key, text)) = argument.split_once('=') else {
            return Err(refuse(
                "an override has no value",
                "expected KEY=VALUE",
                FLAG.len()..FLAG.len() + argument.len(),
                "for example --set time.rate_hz=1024",
            ));
        };
        let shift = |r: Range<usize>| r.start + FLAG.len()..r.end + FLAG.len();
        let segments = parse_segments(key)
            .map_err(|e| {
                refuse(
                    "an override has a broken key",
                    e.message,
                    shift(e.span),
                    "a key is a dotted path, like specimen[0].storey",
                )
            })?
            .into_iter()
            .map(|(segment, span)| (segment, shift(span)))
            .collect();
        let start = FLAG.len() + key.len() + 1 + (text.len() - text.trim_start().len());
        let text = text.trim();
        let value_span = start..start + text.len();
        if text.is_empty() {
            return Err(refuse(
                "an override has no value",
                "the value after `=` is missing",
                value_span,
                "an empty text is written KEY='\"\"'",
            ));
        }
        let value = match value_of(text) {
            Ok(value) => value.shifted(0, start),
            Err(error) if text.starts_with(['{', '[', '"', '\'']) => {
                let message = error.message.lines().next().unwrap_or_default();
                if let Some(number) = decimal_comma(text, error.span.start) {
                    let span = start + number.start..start + number.end;
                    let readings = comma_readings(&text[number]).join(" or ");
                    return Err(refuse(
                        "a number in the value of an override has a comma",
                        &format!("write {readings}"),
                        span,
                        NO_COMMA,
                    ));
                }
                return Err(refuse(
                    "the value of an override is not valid TOML",
                    message,
                    value_span,
                    "text with brackets or quotes inside is itself quoted",
                ));
            }
            Err(_) => Node {
                key: value_span.clone(),
                span: value_span.clone(),
                datum: Datum::Text(text.to_owned()),
            },
        };
        Ok(Self {
            source,
            segments,
            value_span,
            value,
        })
    }

    /// The path that is overridden.
    #[must_use]
    pub(crate) fn path(&self) -> KeyPath {
        self.segments.iter().map(|(s, _)| s.clone()).collect()
    }

    /// Overrides `path` instead: the new name of the argument's key.
    pub(super) fn moved_to(&mut self, path: &KeyPath) {
        let last = self.segments.last().map_or(0..0, |(_, span)| span.clone());
        let named = self.segments.clone();
        let place = |segment: &Segment| {
            let own = named.iter().find(|(other, _)| other == segment);
            own.map_or(last.clone(), |(_, span)| span.clone())
        };
        let segments = path.segments().iter();
        self.segments = segments.map(|s| (s.clone(), place(s))).collect();
    }

    /// Puts the value into the tree of the file.
    ///
    /// # Errors
    /// A diagnostic if the path leads through something that is no table or array, or beyond an array's end.
    pub(crate) fn apply(&self, root: &mut Node) -> Result<(), Box<Diagnostic>> {
        if let Some((Segment::Index(_), _)) = self.segments.first() {
            let headline = "the test file is a table, not an array";
            return Err(self.refuse(0, headline, "a key, not an index"));
        }
        root.set("", &self.segments, &self.value)
            .map_err(|(left, why)| {
                // `left` segments remained when it failed.
                self.refuse(self.segments.len() - left, &why, "no such entry")
            })
    }

    /// Complains of an override `before` this one that this one leaves without an effect: of its path, or below it.
    fn undoes(&self, before: &Self) -> Option<Box<Diagnostic>> {
        let undone = before.path();
        if !undone.starts_with(&self.path()) {
            return None;
        }
        let headline = format!("`{undone}` is overridden twice");
        let help = "remove one of them: the two values contradict";
        let place = self.argument();
        let mut diagnostic = refusal(&self.source, place, &headline, "again here", Some(help));
        diagnostic.beside = Some((before.place(before.argument()), "first here".to_owned()));
        Some(diagnostic)
    }

    /// Place of KEY=VALUE.
    fn argument(&self) -> Range<usize> {
        FLAG.len()..self.value_span.end
    }

    /// The place of `path` if this override sets it or a table that holds it.
    pub(crate) fn place_under(&self, path: &KeyPath, part: Part) -> Option<Place> {
        let mine = self.path();
        if !path.starts_with(&mine) {
            return None;
        }
        let deeper: KeyPath = path.segments()[mine.segments().len()..]
            .iter()
            .cloned()
            .collect();
        let span = if deeper.segments().is_empty() {
            match part {
                Part::Key => self.segments.last()?.1.clone(),
                Part::Value => self.value_span.clone(),
            }
        } else {
            match (self.value.find(&deeper), part) {
                (Some(node), Part::Key) => node.key.clone(),
                (Some(node), Part::Value) => node.span.clone(),
                (None, _) => self.value_span.clone(),
            }
        };
        Some(self.place(span))
    }

    /// The place of `path` if it is a table that this override's key passes through.
    pub(crate) fn place_above(&self, path: &KeyPath) -> Option<Place> {
        let depth = path.segments().len();
        if depth == 0 || !self.path().starts_with(path) {
            return None;
        }
        Some(self.place(self.segments.get(depth - 1)?.1.clone()))
    }

    fn place(&self, span: Range<usize>) -> Place {
        Place {
            source: Arc::clone(&self.source),
            span: Some(span),
        }
    }

    fn refuse(&self, segment: usize, headline: &str, label: &str) -> Box<Diagnostic> {
        let last = self.segments.len().saturating_sub(1);
        let span = self
            .segments
            .get(segment.min(last))
            .map_or(0..0, |(_, span)| span.clone());
        refusal(&self.source, span, headline, label, None)
    }
}

fn refusal(
    source: &Arc<Source>,
    span: Range<usize>,
    headline: &str,
    label: &str,
    help: Option<&str>,
) -> Box<Diagnostic> {
    let place = Place {
        source: Arc::clone(source),
        span: Some(span),
    };
    Box::new(Diagnostic {
        severity: Severity::Error,
        place: (place, plain(label)),
        beside: None,
        headline: plain(headline),
        help: help.map(plain).into_iter().collect(),
    })
}

/// A value of TOML as a tree, with its places in `text`.
fn value_of(text: &str) -> Result<Node, SyntaxError> {
    const KEY: &str = "v=";
    let failed = |message: &str, at: usize| SyntaxError {
        message: message.to_owned(),
        span: at..at,
    };
    let root = Node::parse(&format!("{KEY}{text}")).map_err(|errors| {
        let first = errors.first();
        first.map_or_else(
            || failed("", 0),
            |e| failed(&e.message, e.span.start.saturating_sub(KEY.len())),
        )
    })?;
    let value = root.find(&KeyPath::root().key("v"));
    let value = value.map(|value| value.clone().shifted(KEY.len(), 0));
    // Anything behind the value would be another line of a file.
    value
        .filter(|value| value.span.end == text.len())
        .ok_or_else(|| failed("more than one value", 0))
}

/// Applies every override to the tree, in order. Returns the errors of the overrides.
pub(crate) fn apply_all(root: &mut Node, overrides: &[Override]) -> Vec<Diagnostic> {
    let each = overrides.iter().enumerate();
    each.filter_map(|(index, one)| {
        let twice = overrides[..index].iter().find_map(|o| one.undoes(o));
        twice.or_else(|| one.apply(root).err()).map(|d| *d)
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "title = 'x'\n\n[time]\nstep_s = 0.01\n\n[[specimen]]\nname = 'a'\nrows = [[1, 0], [0, 1]]\nlaw = { linear = { k = 1 } }\n";

    fn with(arguments: &[&str]) -> Result<Node, String> {
        let mut root = Node::parse(FILE).unwrap();
        for argument in arguments {
            Override::parse(argument)
                .and_then(|o| o.apply(&mut root))
                .map_err(|d| d.render(false))?;
        }
        Ok(root)
    }

    /// The value at `path` of `FILE` with these arguments.
    fn at(arguments: &[&str], path: &str) -> String {
        let root = with(arguments).unwrap();
        let node = root.find(&KeyPath::parse(path).unwrap()).unwrap();
        format!("{:?}", node.datum)
    }

    #[test]
    fn value_is_toml_or_bare_text() {
        assert_eq!(at(&["time.step_s=0.02"], "time.step_s"), "Float(0.02)");
        for (given, text) in [
            ("title=new name", "new name"),
            ("title='1'", "1"),
            ("title=1 # one", "1 # one"),
            ("title=1\nduration_s=3", "1\nduration_s=3"),
        ] {
            assert_eq!(at(&[given], "title"), format!("Text({text:?})"));
        }
    }

    #[test]
    fn path_crosses_tables_and_arrays() {
        let sets = ["specimen[0].rows.1[0]=7", "specimen.0.law.linear.k=5"];
        assert_eq!(at(&sets, "specimen[0].rows[1][0]"), "Integer(7)");
        assert_eq!(at(&sets, "specimen[0].rows[0][0]"), "Integer(1)");
        assert_eq!(at(&sets, "specimen[0].law.linear.k"), "Integer(5)");
    }

    #[test]
    fn missing_parts_are_created() {
        let sets = [
            "timing.priority=80",
            "specimen[1].name=b",
            "specimen[1].storey=2",
            "excitation.a.b=1",
            "specimen[0].law={bilinear={k=2}}",
            "specimen[0].more[0].x=1",
        ];
        for (path, value) in [
            ("timing.priority", "Integer(80)"),
            ("specimen[1].name", "Text(\"b\")"),
            ("specimen[1].storey", "Integer(2)"),
            ("excitation.a.b", "Integer(1)"),
            ("specimen[0].law.bilinear.k", "Integer(2)"),
            ("specimen[0].more[0].x", "Integer(1)"),
        ] {
            assert_eq!(at(&sets, path), value, "{path}");
        }
        let root = with(&sets).unwrap();
        let replaced = KeyPath::parse("specimen[0].law.linear").unwrap();
        assert!(root.find(&replaced).is_none());
    }

    #[test]
    fn dead_path_is_explained_in_the_argument() {
        let complaint = |argument: &str| with(&[argument]).unwrap_err();
        let text = complaint("specimen[3].name=z");
        assert!(text.contains("`specimen`"), "{text}");
        assert!(
            text.contains("--set specimen[3].name=z\n  |               ^^^"),
            "{text}"
        );
        assert!(complaint("title.x=1").contains("`x`"));
        assert!(complaint("specimen[1]=1").contains("a single value cannot replace"));
        assert!(complaint("excitation.a[1]=1").contains("its first element is 0, not 1"));
        assert!(complaint("time").contains("expected KEY=VALUE"));
        assert!(complaint("time.=1").contains("missing"));
        assert!(complaint("time.step_s=").contains("missing"));
        assert!(complaint("specimen[0].rows=[[1,").contains("TOML"));
    }
}
