//! A user's mistake as a picture: file, line, caret, found value, allowed values, probable intention.
//!
//! A check that finds a mistake writes a [`Finding`]: a path into the test file and words. The [`Locator`](super::Locator) knows
//! the place of that path (a line of the file, or the `--set` argument that overrides it) and makes a [`Diagnostic`] of it, which
//! renders itself. Nothing here decides which values are mistakes.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{
    Annotation, AnnotationKind, Group, Level, Origin, Renderer, Snippet, Title,
};

use super::campaign_table::OWN;
use super::document::SyntaxError;
use super::echo::plain;
use super::mistake::{Kind, Mistake};
use super::suggest::{listed, nearest};
use super::words::{NO_COMMA, comma_readings};
use gusset_quantity::finding::KeyPath;
pub use gusset_quantity::finding::{Finding, Part, Severity};

impl From<Mistake> for Finding {
    fn from(mistake: Mistake) -> Self {
        let Mistake { path, kind } = mistake;
        let name = subject(&path);
        match kind {
            Kind::UnknownKey { allowed } => {
                let key = path.last_key().unwrap_or_default().to_owned();
                let table = path.parent().unwrap_or_default();
                let label = nearest(&key, &allowed).map_or_else(
                    || "not a key of this table".to_owned(),
                    |n| format!("did you mean `{n}`?"),
                );
                let is_of_study = table == KeyPath::root() && OWN.contains(&key.as_str());
                let help = if is_of_study {
                    "this file is a study of a campaign: `gusset campaign run` takes it".to_owned()
                } else {
                    format!("the keys here are {}", listed(&allowed, "and"))
                };
                Self::error(path, format!("unknown key `{key}` in {}", subject(&table)))
                    .at_key()
                    .label(label)
                    .help(help)
            }
            Kind::MissingKey { key } => {
                let label = format!("`{key}` is missing");
                Self::error(path, format!("missing key `{key}` in {name}")).label(label)
            }
            Kind::UnknownName { found, allowed } => {
                let label = nearest(&found, &allowed).map_or_else(
                    || "not one of the names".to_owned(),
                    |n| format!("did you mean `{n}`?"),
                );
                let table = match path.last_key() {
                    Some(key) if key == found => path.parent().unwrap_or_default(),
                    _ => path.clone(),
                };
                let is_key = path != table;
                let finding = Self::error(path, format!("{} cannot be `{found}`", subject(&table)))
                    .label(label)
                    .help(format!("allowed here: {}", listed(&allowed, "or")));
                if is_key { finding.at_key() } else { finding }
            }
            Kind::NotExactlyOne { found, allowed } => {
                let label = match found.as_slice() {
                    [] => "is empty".to_owned(),
                    some => format!("has {}", listed(some, "and")),
                };
                Self::error(
                    path,
                    format!(
                        "{name} must hold exactly one of {}",
                        listed(&allowed, "and")
                    ),
                )
                .label(label)
            }
            Kind::WrongType {
                found,
                wanted,
                hint,
            }
            | Kind::WrongValue {
                found,
                wanted,
                hint,
            } => Self {
                help: hint.into_iter().collect(),
                ..Self::error(path, format!("{name} must be {wanted}"))
                    .label(format!("found {found}"))
            },
            Kind::Other(message) => Self::error(path, format!("{name}: {message}")),
            Kind::Consequence => Self::error(path, format!("{name} cannot be read")),
        }
    }
}

/// A path as the subject of a sentence.
fn subject(path: &KeyPath) -> String {
    if path.segments().is_empty() {
        "this file".to_owned()
    } else {
        format!("`{path}`")
    }
}

/// A text that a diagnostic can point into.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Name as shown after the arrow.
    pub name: String,
    /// Its text.
    pub text: String,
}

/// A place in a source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Which text.
    pub source: Arc<Source>,
    /// Which of its bytes; absent where the whole is meant.
    pub span: Option<Range<usize>>,
}

/// A mistake with its place, ready to be shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostic {
    /// Whether it forbids the test.
    pub severity: Severity,
    /// Where it is, with a few words under the caret.
    pub place: (Place, String),
    /// A second place that it is about.
    pub beside: Option<(Place, String)>,
    /// One line: the mistake.
    pub headline: String,
    /// Allowed values, and remedies.
    pub help: Vec<String>,
}

impl Diagnostic {
    /// The picture, with colours of the terminal if `colour`.
    #[must_use]
    pub fn render(&self, colour: bool) -> String {
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let mut group = self.picture(level.primary_title(self.headline.as_str()));
        for help in &self.help {
            group = group.element(Level::HELP.message(help.as_str()));
        }
        let renderer = if colour {
            Renderer::styled()
        } else {
            Renderer::plain()
        };
        renderer.decor_style(DecorStyle::Ascii).render(&[group])
    }

    fn picture<'a>(&'a self, title: Title<'a>) -> Group<'a> {
        let (place, label) = &self.place;
        let Some(span) = place.span.clone() else {
            return title.element(Origin::path(place.source.name.as_str()));
        };
        let snippet = snippet(&place.source)
            .annotation(AnnotationKind::Primary.span(span).label(label.as_str()));
        let Some((other, words)) = &self.beside else {
            return title.element(snippet);
        };
        let Some(span) = other.span.clone() else {
            return title.element(snippet);
        };
        let annotation = AnnotationKind::Context.span(span).label(words.as_str());
        if other.source == place.source {
            title.element(snippet.annotation(annotation))
        } else {
            let second = self::snippet(&other.source).annotation(annotation);
            title.element(snippet).element(second)
        }
    }
}

fn snippet(source: &Source) -> Snippet<'_, Annotation<'_>> {
    Snippet::source(source.text.as_str()).path(source.name.as_str())
}

/// A screen or two: after that many mistakes a file is better mended first.
pub(crate) const MOST_SHOWN: usize = 20;

/// All that is wrong with a test file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Diagnostics(pub Vec<Diagnostic>);

impl Diagnostics {
    /// The pictures, one after another.
    #[must_use]
    pub fn render(&self, colour: bool) -> String {
        let shown = self.0.iter().take(MOST_SHOWN);
        let mut pictures: Vec<_> = shown.map(|d| d.render(colour)).collect();
        if self.0.len() > MOST_SHOWN {
            pictures.push(format!("and {} more mistakes", self.0.len() - MOST_SHOWN));
        }
        pictures.join("\n\n")
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

/// Grammar mistakes as diagnostics. Beyond the first few they are mostly echoes.
pub(crate) fn syntax(source: &Arc<Source>, errors: Vec<SyntaxError>) -> Vec<Diagnostic> {
    /// Recovery after a broken line guesses; the first guesses are good.
    const SHOWN: usize = 3;
    let mut last_line = None;
    let mut diagnostics = Vec::new();
    for error in errors {
        let line = source.text[..error.span.start.min(source.text.len())]
            .matches('\n')
            .count();
        if last_line != Some(line) {
            last_line = Some(line);
            diagnostics.push(match decimal_comma(&source.text, error.span.start) {
                Some(span) => with_comma(source, span),
                None => broken(source, error.message, error.span),
            });
        }
    }
    diagnostics.truncate(SHOWN);
    diagnostics
}

/// The number with a decimal comma that the grammar mistake at byte `at` is about, if there is one.
///
/// `0,01` is never valid after `=`. In an array it is two elements, and only the zero that leads the second is a mistake.
pub(crate) fn decimal_comma(text: &str, at: usize) -> Option<Range<usize>> {
    let at = at.min(text.len());
    let begin = text.get(..at)?.rfind('\n').map_or(0, |newline| newline + 1);
    let end = text.get(at..)?.find('\n').map_or(text.len(), |n| at + n);
    let line = &text.as_bytes()[begin..end];
    let is_part = |byte: u8| byte.is_ascii_digit() || b"+-.eE_".contains(&byte);
    for comma in (1..line.len()).filter(|index| line[*index] == b',') {
        let first = line[..comma].iter().rposition(|byte| !is_part(*byte));
        let first = first.map_or(0, |before| before + 1);
        let after = line[comma + 1..].iter().position(|byte| !is_part(*byte));
        let last = after.map_or(line.len(), |count| comma + 1 + count);
        let digits =
            line[comma - 1].is_ascii_digit() && line.get(comma + 1).is_some_and(u8::is_ascii_digit);
        let before = line[..first].trim_ascii_end().last();
        let split = before == Some(&b'=') || begin + comma + 1 == at || begin + comma + 2 == at;
        if digits && split && !line[..first].contains(&b'#') {
            let all = with_groups(line, first..last);
            let number = line.get(all.clone()).map(String::from_utf8_lossy);
            let is_one = number.is_some_and(|number| !comma_readings(&number).is_empty());
            let found = if is_one { all } else { first..last };
            return Some(begin + found.start..begin + found.end);
        }
    }
    None
}

/// The number at `found`, which has a comma, with the groups of three digits before and after it.
fn with_groups(line: &[u8], found: Range<usize>) -> Range<usize> {
    let Range { mut start, mut end } = found;
    let digits_from = |at: usize| {
        line[at..]
            .iter()
            .take_while(|byte| byte.is_ascii_digit())
            .count()
    };
    while line.get(end) == Some(&b',') && digits_from(end + 1) == 3 {
        end += 4;
    }
    while start > 1 && line[start - 1] == b',' && digits_from(start) == 3 {
        let before = line[..start - 1].iter().rev();
        let count = before.take_while(|byte| byte.is_ascii_digit()).count();
        if count == 0 {
            break;
        }
        start -= count + 1;
    }
    start..end
}

fn with_comma(source: &Arc<Source>, span: Range<usize>) -> Diagnostic {
    let readings = comma_readings(&source.text[span.clone()]);
    let comma = match readings.as_slice() {
        [only] if only.contains('.') => "a decimal comma",
        _ => "a comma",
    };
    let before = source.text[..span.start].trim_end().trim_end_matches('=');
    let key = before.trim_end().rsplit([' ', '\n', '{', ',', '\t']).next();
    let key =
        key.filter(|key| !key.is_empty() && source.text[..span.start].trim_end().ends_with('='));
    let place = Place {
        source: Arc::clone(source),
        span: Some(span),
    };
    let subject = key.map_or_else(|| "a number".to_owned(), |key| format!("`{key}`"));
    Diagnostic {
        severity: Severity::Error,
        place: (place, plain(&format!("write {}", readings.join(" or ")))),
        beside: None,
        headline: plain(&format!("{subject} has {comma}")),
        help: vec![NO_COMMA.to_owned()],
    }
}

fn broken(source: &Arc<Source>, message: String, span: Range<usize>) -> Diagnostic {
    let place = Place {
        source: Arc::clone(source),
        span: Some(span),
    };
    Diagnostic {
        severity: Severity::Error,
        place: (place, plain(&message)),
        beside: None,
        headline: "the file is not valid TOML".to_owned(),
        help: Vec::new(),
    }
}
