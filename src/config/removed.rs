//! Removed keys: the finding for a file that still has one, and the files that may have one.
//!
//! In a test file a removed key is refused, and the finding names what to use instead. The `resolved.toml` of a run folder
//! holds the defaults of the version that wrote it: there a removed key is passed over at the default that it had. At
//! another value the file means what this version cannot do, and the finding names the last version that could.

use std::path::Path;

use super::Finding;
use super::document::{Datum, KeyPath, Node};

/// A key that was removed.
struct RemovedKey {
    /// Its table, and its name there.
    table: &'static str,
    key: &'static str,
    /// True of the value that it had by default.
    is_default: fn(&Datum) -> bool,
    /// The last version that knew it.
    last: &'static str,
    instead: &'static str,
}

const REMOVED: [RemovedKey; 1] = [RemovedKey {
    table: "timing",
    key: "catch_up_remote",
    is_default: |datum| matches!(datum, Datum::Boolean(false)),
    last: "0.1.0",
    instead: "set `on_miss = \"stretch\"`: `on_miss = \"catch_up\"` with a specimen behind a link is always refused",
}];

impl RemovedKey {
    fn path(&self) -> KeyPath {
        KeyPath::root().key(self.table).key(self.key)
    }
}

/// True for the resolved configuration of a run folder.
pub(super) fn is_resolved(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == "resolved.toml")
}

/// Takes the removed keys at their defaults out of the resolved configuration of a run folder. Any other file stays unchanged.
pub(super) fn pass_over(path: &Path, root: &mut Node) {
    if !is_resolved(path) {
        return;
    }
    for removed in &REMOVED {
        let at = removed.path();
        let by_default = |node: &Node| (removed.is_default)(&node.datum);
        if root.find(&at).is_some_and(by_default) {
            root.remove(removed.table, removed.key);
        }
    }
}

/// The finding for an unknown key that was removed; none for other keys.
pub(super) fn finding(path: &KeyPath) -> Option<Finding> {
    let removed = REMOVED.iter().find(|removed| removed.path() == *path)?;
    let RemovedKey {
        table, key, last, ..
    } = removed;
    Some(
        Finding::error(path.clone(), format!("`{table}.{key}` was removed"))
            .at_key()
            .label(format!("known up to version {last}"))
            .help(removed.instead),
    )
}
