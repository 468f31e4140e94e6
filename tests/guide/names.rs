//! Whether the lists of the guide have every name that the program has.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use gusset::catalog::column::{Kind, TEST};
use gusset::catalog::limit::Limit;
use serde_json::Value;

use super::events::{SERVER_EVENTS, TEST_EVENTS};
use super::limits::FURTHER_LIMITS;
use super::pages::{root, schemas};

/// Names that only one of two sets has.
fn differences(kind: &str, program: &BTreeSet<String>, listed: &BTreeSet<String>) -> Vec<String> {
    let missing = program
        .difference(listed)
        .map(|name| format!("{kind} `{name}` is not listed in tests/guide/"));
    let surplus = listed
        .difference(program)
        .map(|name| format!("{kind} `{name}` is listed, but the program has none"));
    missing.chain(surplus).collect()
}

fn set<'a>(names: impl Iterator<Item = &'a str>) -> BTreeSet<String> {
    names.map(str::to_owned).collect()
}

pub fn limits() -> Vec<String> {
    let mut wrong = Vec::new();
    let schemas = schemas();
    let test = schemas[0].1.root();
    for [key, _, _, _, table] in FURTHER_LIMITS {
        let owner = if table == "safety" {
            "SafetyTable"
        } else {
            "LinkSpec"
        };
        if test["$defs"][owner]["properties"].get(key).is_none() {
            wrong.push(format!("limit `{key}`: [{table}] has no such key"));
        }
    }
    wrong
}

/// Source files below `src/`, without their tests.
fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_test = path.file_stem().is_some_and(|name| name == "tests");
        if path.is_dir() && !is_test {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|end| end == "rs") && !is_test {
            let text = fs::read_to_string(&path).unwrap();
            let code = text
                .split("#[cfg(test)]\nmod tests")
                .next()
                .unwrap()
                .to_owned();
            found.push((path, code));
        }
    }
    found
}

/// The text in quotes at the beginning, after blanks.
fn quoted(text: &str) -> Option<&str> {
    text.trim_start().strip_prefix('"')?.split('"').next()
}

/// The kinds of events in the source text: names of the loop's events, and the name of every note.
fn kinds() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (path, code) in sources(&root().join("src")) {
        let mut add = |name: Option<&str>| {
            found.extend(
                name.filter(|name| name.chars().all(|c| c.is_ascii_lowercase() || c == '_'))
                    .map(str::to_owned),
            );
        };
        for start in [
            "NoteLevel::Info",
            "NoteLevel::Warning",
            "NoteLevel::Error",
            "Note::new(level",
        ] {
            for (at, _) in code.match_indices(start) {
                add(code[at + start.len()..].strip_prefix(',').and_then(quoted));
            }
        }
        for start in ["warn_once(", "log.warn("] {
            for (at, _) in code.match_indices(start) {
                add(quoted(&code[at + start.len()..]));
            }
        }
        let is_names = path.ends_with("record/events/names.rs");
        if is_names || path.ends_with("link/openfresco/remarks.rs") {
            let part = if is_names {
                code.split("fn fault_name").next()
            } else {
                code.split("fn event")
                    .nth(1)
                    .and_then(|rest| rest.split("\n    }").next())
            };
            let part = part.unwrap_or_default();
            for start in ["=> ", "=> {\n"] {
                for (at, _) in part.match_indices(start) {
                    add(quoted(&part[at + start.len()..]));
                }
            }
        }
    }
    found
}

pub fn events() -> Vec<String> {
    let listed = set(TEST_EVENTS.iter().chain(SERVER_EVENTS).map(|row| row[0]));
    differences("event", &kinds(), &listed)
}

/// Columns of a run that the catalogue does not have, or has with another unit.
pub fn columns_of(layout: &str) -> Vec<String> {
    let layout: Value = serde_json::from_str(layout).unwrap();
    let mut wrong = Vec::new();
    for column in layout["columns"].as_array().unwrap() {
        let name = column["name"].as_str().unwrap();
        let unit = column["unit"].as_str().unwrap();
        if Limit::OF_TEST.iter().any(|quantity| quantity.key() == name) {
            continue;
        }
        let mut kinds = TEST.iter().filter(|kind| kind.fits(name)).peekable();
        if kinds.peek().is_none() {
            wrong.push(format!("column `{name}` is not in the catalogue"));
        }
        // A kind that has the unit of the axis or of a parameter says so in words.
        let fits = |kind: &Kind| {
            let named = ["specimen unit", "of the parameter", "of the limit"].contains(&kind.unit);
            named || kind.unit.split(" or ").any(|one| one == unit)
        };
        if !kinds.any(fits) {
            wrong.push(format!("column `{name}`: its unit is {unit}"));
        }
    }
    wrong
}
