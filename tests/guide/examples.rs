//! Examples of keys: the first value in the shipped files, else one of the schema, else one of the list here.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::schema::{Schema, in_toml, parsed};

/// A longer example does not fit into its line.
const LONGEST: usize = 100;

/// Values by owner and key.
pub struct Examples {
    values: BTreeMap<(String, String), String>,
}

impl Examples {
    /// From the TOML files below these folders, each by the schema that it fits.
    pub fn new(schemas: &[(&str, Schema)], folders: &[PathBuf]) -> Self {
        let mut values = BTreeMap::new();
        for path in folders.iter().flat_map(|folder| toml_files(folder)) {
            let Ok(file) = parsed(&fs::read_to_string(&path).unwrap()) else {
                continue;
            };
            let fits = |schema: &Schema| schema.unknown(&file).is_empty();
            let Some((_, schema)) = schemas.iter().find(|(_, schema)| fits(schema)) else {
                continue;
            };
            for one in schema.uses(&file) {
                let text = in_toml(one.value);
                if text.chars().count() <= LONGEST {
                    let place = (one.owner, one.key.to_owned());
                    values.entry(place).or_insert(text);
                }
            }
        }
        Self { values }
    }

    /// The example of a key.
    pub fn of(&self, owner: &str, key: &str, node: &Value) -> Option<String> {
        let place = (owner.to_owned(), key.to_owned());
        let shipped = self.values.get(&place).cloned();
        let given = || {
            let examples = node.get("examples").and_then(Value::as_array);
            examples.and_then(|examples| examples.first()).map(in_toml)
        };
        shipped.or_else(given).or_else(|| listed(owner, key))
    }

    /// Those of these keys that have no example.
    pub fn missing(&self, keys: &[(String, String, &Value)]) -> BTreeSet<String> {
        let without = keys
            .iter()
            .filter(|(owner, key, node)| self.of(owner, key, node).is_none());
        without
            .map(|(owner, key, _)| format!("{owner}.{key}"))
            .collect()
    }
}

/// Every TOML file below a folder, sorted.
pub fn toml_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut files = Vec::new();
    let mut entries: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files.extend(toml_files(&path));
        } else if path.extension().is_some_and(|end| end == "toml") {
            files.push(path);
        }
    }
    files
}

/// Keys that no shipped file has.
const LISTED: &[(&str, &str, &str)] = &[
    (
        "CoupledSpec",
        "stiffness_n_per_m",
        "[[1.0e6, -4.0e5], [-4.0e5, 1.0e6]]",
    ),
    ("Fault", "axis", "1"),
    (
        "MatricesSpec",
        "damping",
        "[[4.0e3, -1.0e3], [-1.0e3, 2.0e3]]",
    ),
    (
        "MatricesSpec",
        "stiffness",
        "[[2.0e6, -1.0e6], [-1.0e6, 1.0e6]]",
    ),
];

fn listed(owner: &str, key: &str) -> Option<String> {
    let found = LISTED
        .iter()
        .find(|(of, name, _)| *of == owner && *name == key);
    found.map(|(_, _, value)| (*value).to_owned())
}
