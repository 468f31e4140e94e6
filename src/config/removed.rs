//! Removed keys: the finding for a file that still has one, and the files that may have one.
//!
//! A test file with a removed key is refused, and the finding names the replacement. The `resolved.toml` of a run
//! folder holds the defaults of the version that wrote it. There a removed key is ignored at its former default. At any
//! other value, this version cannot run the same test. The finding names the last version that can.

use std::path::Path;

use super::document::{Datum, KeyPath, Node};
use super::{Finding, Purpose};

/// A key that was removed.
struct RemovedKey {
    /// The tables that contained it, as [`KeyPath::shape`] writes them.
    tables: &'static [&'static str],
    key: &'static str,
    /// Its default, as a number of Rust is written; none for a key without one.
    default: Option<&'static str>,
    /// The last version that knew it.
    last: &'static str,
    /// Replacement.
    instead: &'static str,
}

const LIMITS: &[&str] = &["specimen[*].limits", "specimen[*].axis[*].limits"];

const ONE_LAMBDA: &str = "set one `lambda` for all elements and modes";

const REMOVED: &[RemovedKey] = &[
    RemovedKey {
        tables: &["integrator"],
        key: "lambda_of_element",
        default: None,
        last: "0.2.0",
        instead: ONE_LAMBDA,
    },
    RemovedKey {
        tables: &["integrator"],
        key: "lambda_of_mode",
        default: None,
        last: "0.2.0",
        instead: ONE_LAMBDA,
    },
    RemovedKey {
        tables: &["timing"],
        key: "catch_up_remote",
        default: Some("false"),
        last: "0.1.0",
        instead: "set `on_miss = \"stretch\"`: `on_miss = \"catch_up\"` with a specimen behind a link is always refused",
    },
    RemovedKey {
        tables: &["timing"],
        key: "prefault_stack_kb",
        default: Some("256"),
        last: "0.2.0",
        instead: "remove this key: Gusset always touches 256 kB of stack before the first tick",
    },
    RemovedKey {
        tables: &["specimen[*].transfer"],
        key: "tell_saturation",
        default: Some("true"),
        last: "0.2.0",
        instead: "remove this key: a simulated specimen always reports the end of a stroke, force or sensor range",
    },
    RemovedKey {
        tables: &["specimen[*].link.openfresco"],
        key: "udp_endian",
        default: Some("false"),
        last: "0.2.0",
        instead: "remove this key: use TCP with OpenFresco 2.7",
    },
    RemovedKey {
        tables: &["specimen[*].link"],
        key: "max_stale_s",
        default: None,
        last: "0.2.0",
        instead: "set `max_stale`, a number of measurements: divide the time by the time of one tick and round up",
    },
    RemovedKey {
        tables: &["specimen[*]"],
        key: "stand_in",
        default: None,
        last: "0.2.0",
        instead: "beside a `link`, give one `law`, `laws`, `coupled` or `bearing`: it is the stand-in for rehearsals",
    },
    RemovedKey {
        tables: &["specimen[*]"],
        key: "stand_in_transfer",
        default: None,
        last: "0.2.0",
        instead: "beside a `link`, give one `transfer`: it is that of the stand-in for rehearsals",
    },
    RemovedKey {
        tables: LIMITS,
        key: "alternating_m",
        default: Some("0"),
        last: "0.2.0",
        instead: "remove this key, or set `alternating_ticks` to a larger number of ticks",
    },
    RemovedKey {
        tables: LIMITS,
        key: "tangent_step_m",
        default: Some("0"),
        last: "0.2.0",
        instead: "remove this key: Gusset determines the step from the noise of the sensors",
    },
];

impl RemovedKey {
    fn was_default(&self, node: &Node) -> bool {
        let found = match node.datum {
            Datum::Boolean(value) => value.to_string(),
            Datum::Integer(value) => value.to_string(),
            Datum::Float(value) => value.to_string(),
            _ => return false,
        };
        self.default == Some(found.as_str())
    }
}

/// True for the resolved configuration of a run folder.
pub(super) fn is_resolved(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == "resolved.toml")
}

/// Takes the removed keys at their defaults out of the resolved configuration of a run folder, for a view at any value. Any
/// other file stays unchanged.
pub(super) fn pass_over(purpose: Purpose, path: &Path, root: &mut Node) {
    if !is_resolved(path) {
        return;
    }
    root.each_table(&KeyPath::root(), &mut |table, node| {
        let shape = table.shape();
        for removed in REMOVED {
            if !removed.tables.contains(&shape.as_str()) {
                continue;
            }
            let found = node.find(&KeyPath::root().key(removed.key));
            let passes = |found: &Node| purpose == Purpose::View || removed.was_default(found);
            if found.is_some_and(passes) {
                node.take(&[removed.key]);
            }
        }
    });
}

/// The finding for an unknown key that was removed; none for other keys.
pub(super) fn finding(path: &KeyPath) -> Option<Finding> {
    let table = path.parent()?.shape();
    let is_it = |removed: &&RemovedKey| {
        removed.tables.contains(&table.as_str()) && path.last_key() == Some(removed.key)
    };
    let removed = REMOVED.iter().find(is_it)?;
    Some(
        Finding::error(path.clone(), format!("`{path}` was removed"))
            .at_key()
            .label(format!("known up to version {}", removed.last))
            .help(removed.instead),
    )
}
