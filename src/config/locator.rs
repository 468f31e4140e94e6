//! Place of each path of a test file: a line of the file, or the argument that overrides it.

use std::sync::Arc;

use super::ConfigError;
use super::diagnose::{Diagnostic, Diagnostics, Finding, Part, Place, Source};
use super::document::{Datum, KeyPath, Node, Segment};
use super::echo::plain;
use super::overrides::Override;

/// Keys of the table that a file of a frame fills.
pub(super) const FRAME: [&str; 2] = ["structure", "frame"];

/// The path of that table.
pub(super) fn frame() -> KeyPath {
    FRAME.iter().fold(KeyPath::root(), |at, key| at.key(key))
}

/// Finds the place of each path of a test file.
#[derive(Debug, Clone)]
pub struct Locator {
    file: Arc<Source>,
    root: Node,
    overrides: Vec<Override>,
    /// The file that `structure.frame.file` names.
    pub(super) frame_file: Option<Arc<Source>>,
    /// Paths of entries that the file calls by an old name: today's path, and the one that the user wrote.
    written: Vec<(String, String)>,
}

impl Locator {
    pub(crate) const fn new(file: Arc<Source>, root: Node) -> Self {
        Self {
            file,
            root,
            overrides: Vec::new(),
            frame_file: None,
            written: Vec::new(),
        }
    }

    /// The entries of `structure.frame` are those of `table`, a part of `source`.
    pub(super) fn include(&mut self, source: Arc<Source>, table: &Node) {
        self.root.replace(&frame(), table);
        self.frame_file = Some(source);
    }

    /// Places of these overrides. Messages name the entries in `written` as the user wrote them: today's path, and the
    /// written one.
    pub(crate) fn add(&mut self, overrides: Vec<Override>, written: Vec<(String, String)>) {
        self.overrides.extend(overrides);
        self.written.extend(written);
    }

    /// A text with the paths that the user wrote.
    #[must_use]
    pub fn as_written(&self, text: &str) -> String {
        let mut text = self.on_bus(plain(text));
        for (now, written) in &self.written {
            // A note on the old name has both.
            if !text.contains(written.as_str()) {
                text = text.replace(now.as_str(), written);
            }
        }
        text
    }

    /// A text that names keys of a link by their table `bus`, where the specimen is on a bus.
    fn on_bus(&self, mut text: String) -> String {
        let specimen = KeyPath::root().key("specimen");
        let count = match self.root.find(&specimen).map(|node| &node.datum) {
            Some(Datum::Array(all)) => all.len(),
            _ => 0,
        };
        let tables = (0..count).map(|index| specimen.index(index).key("link"));
        let (on_bus, others): (Vec<_>, Vec<_>) =
            tables.partition(|link| self.of_bus(link).is_some());
        for link in &on_bus {
            // Keys with another place come first.
            let keys = ["address", "watchdog_s", "max_stale"].map(|key| link.key(key));
            for from in keys.iter().chain([link]) {
                if let Some(to) = self.of_bus(from) {
                    text = text.replace(&from.to_string(), &to.to_string());
                }
            }
        }
        if !on_bus.is_empty()
            && !others.iter().any(|link| self.holds(link))
            && !text.contains("[specimen.bus]")
        {
            text = text.replace("[specimen.link]", "[specimen.bus]");
        }
        text
    }

    /// The key of a specimen on a bus for a key of its link; none for another path, and for a specimen with its own link.
    fn of_bus(&self, path: &KeyPath) -> Option<KeyPath> {
        let [first, Segment::Index(index), link, keys @ ..] = path.segments() else {
            return None;
        };
        let is =
            |segment: &Segment, key: &str| matches!(segment, Segment::Key(name) if name == key);
        let table = KeyPath::root().key("specimen").index(*index);
        if !is(first, "specimen")
            || !is(link, "link")
            || self.holds(&table.key("link"))
            || !self.holds(&table.key("bus"))
        {
            return None;
        }
        let own = table.key("bus");
        let name = self.root.find(&own.key("bus")).map(|node| &node.datum);
        let of_bus = |key: &str| match name {
            Some(Datum::Text(name)) => KeyPath::root().key("bus").key(name).key(key),
            _ => own.clone(),
        };
        Some(match keys {
            [key] if is(key, "address") => own.key("bus"),
            [key] if is(key, "watchdog_s") => of_bus("watchdog_s"),
            [key] if is(key, "max_stale") => of_bus("stale_ticks"),
            keys => own.segments().iter().chain(keys).cloned().collect(),
        })
    }

    /// The place of `path`: an argument of the command line if it overrides it, else the file; the nearest entry above
    /// it where it does not exist.
    #[must_use]
    pub fn locate(&self, path: &KeyPath, part: Part) -> Place {
        if let Some(path) = self.of_bus(path) {
            return self.locate(&path, part);
        }
        let overriding = self.overrides.iter().rev();
        if let Some(place) = overriding.clone().find_map(|o| o.place_under(path, part)) {
            return place;
        }
        if let Some(node) = self.root.find(path)
            && !path.segments().is_empty()
        {
            return self.in_file(path, part, node);
        }
        if let Some(place) = overriding.clone().find_map(|o| o.place_above(path)) {
            return place;
        }
        match path.parent() {
            Some(parent) => self.locate(&parent, Part::Value),
            None => Place {
                source: Arc::clone(&self.file),
                span: None,
            },
        }
    }

    /// True if an override sets `path` itself.
    #[must_use]
    pub(crate) fn overrides(&self, path: &KeyPath) -> bool {
        self.overrides.iter().any(|o| o.path().starts_with(path))
    }

    /// True if the file or an override sets `path` itself.
    #[must_use]
    pub fn holds(&self, path: &KeyPath) -> bool {
        self.root.find(path).is_some() || self.overrides(path)
    }

    /// The path of the first entry named `key` at or below `path`: where a lower layer names only its parameter.
    #[must_use]
    pub fn beneath(&self, path: &KeyPath, key: &str) -> KeyPath {
        let mut found: Option<KeyPath> = None;
        if let Some(node) = self.root.find(path) {
            node.walk(path, &mut |at, _| {
                let nearer = |known: &KeyPath| at.segments().len() < known.segments().len();
                if at.last_key() == Some(key) && found.as_ref().is_none_or(nearer) {
                    found = Some(at.clone());
                }
            });
        }
        found
            .or_else(|| {
                let mut paths = self.overrides.iter().rev().map(Override::path);
                paths.find(|p| p.starts_with(path) && p.last_key() == Some(key))
            })
            .unwrap_or_else(|| path.clone())
    }

    /// Findings with their places.
    #[must_use]
    pub fn diagnose_all(&self, findings: impl IntoIterator<Item = Finding>) -> Diagnostics {
        let findings = findings.into_iter();
        Diagnostics(findings.map(|finding| self.diagnose(finding)).collect())
    }

    /// A finding with its places.
    #[must_use]
    pub fn diagnose(&self, finding: Finding) -> Diagnostic {
        Diagnostic {
            severity: finding.severity,
            place: (
                self.locate(&finding.path, finding.part),
                plain(&finding.label),
            ),
            beside: finding
                .beside
                .map(|(path, label)| (self.locate(&path, Part::Value), plain(&label))),
            headline: self.as_written(&finding.headline),
            help: finding
                .help
                .iter()
                .map(|help| self.as_written(help))
                .collect(),
        }
    }

    /// A file that is refused for this finding.
    #[must_use]
    pub fn refusal(&self, finding: Finding) -> ConfigError {
        ConfigError::Invalid(Diagnostics(vec![self.diagnose(finding)]))
    }

    fn in_file(&self, path: &KeyPath, part: Part, node: &Node) -> Place {
        let frame = frame();
        let other = self.frame_file.as_ref().filter(|_| {
            let names_it = *path == frame.key("file") || (*path == frame && part == Part::Key);
            path.starts_with(&frame) && !names_it
        });
        let span = match part {
            Part::Key => node.key.clone(),
            Part::Value => node.span.clone(),
        };
        Place {
            // All of the frame is all of its file.
            span: (other.is_none() || *path != frame).then_some(span),
            source: Arc::clone(other.unwrap_or(&self.file)),
        }
    }
}
