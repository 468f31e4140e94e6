//! Help that the schema gives for a mistake: the table where a key belongs, and the brackets of a table's header.

use schemars::{JsonSchema, schema_for};
use serde_json::Value;

use super::Finding;
use super::document::{Datum, KeyPath, Node, Segment};
use super::mistake::{Kind, Mistake};
use super::suggest::nearest;

/// Most tables between the one that has the unknown key and the one that knows it.
const DEPTH: usize = 2;
/// References and alternatives in a row that are followed.
const MOST_HOPS: usize = 16;

/// Tables whose keys have another meaning outside of them: scale factors.
const OWN_MEANING: [&str; 1] = ["similitude"];
/// Keys of one table of which a file usually has one.
const EXCLUSIVE: [&[&str]; 3] = [
    &["law", "laws", "coupled", "bearing", "link", "bus"],
    &["transfer", "link", "bus"],
    &["shear_building", "matrices", "chain", "frame"],
];

/// The schema of one kind of file.
pub(super) struct Hints(Value);

impl Hints {
    /// The schema of `T`.
    pub(super) fn of<T: JsonSchema>() -> Self {
        Self(schema_for!(T).to_value())
    }

    /// True if the schema has a key at `path`.
    #[cfg(test)]
    pub(super) fn knows(&self, path: &KeyPath) -> bool {
        !self.nodes(path, true).is_empty()
    }

    /// The finding for `mistake`, with the help that the schema gives. `root` is the file.
    pub(super) fn explain(&self, mistake: Mistake, root: &Node) -> Finding {
        let path = mistake.path.clone();
        let known = match &mistake.kind {
            Kind::UnknownKey { allowed } => {
                let key = path.last_key().unwrap_or_default();
                let same_table = nearest(key, allowed).is_some();
                (!same_table).then(|| self.elsewhere(&path, root)).flatten()
            }
            _ => None,
        };
        let brackets = self.brackets(&mistake, root);
        let help = name_help(&mistake);
        let finding = Finding::from(mistake);
        match (known, brackets, help) {
            (Some(known), ..) => finding.label(table_of(&known)),
            (_, Some(help), _) => finding.help(help),
            (_, _, Some(help)) => finding.help(help),
            _ => finding,
        }
    }

    /// The path of the known key that has the name of the unknown key at `path`: below its table, or below a table that
    /// holds it. None if the nearest tables with such a key are several.
    fn elsewhere(&self, path: &KeyPath, root: &Node) -> Option<KeyPath> {
        let key = path.last_key()?;
        let mut table = path.parent()?;
        loop {
            let mut keys = Vec::new();
            for node in self.nodes(&table, false) {
                self.below(node, &table, DEPTH, &mut keys);
            }
            keys.retain(|known| {
                let name = known.last_key().unwrap_or_default();
                let is_named = name == key || name.starts_with(&format!("{key}_"));
                is_named && is_possible(known, &table, root)
            });
            keys.sort_by_cached_key(|known| (known.segments().len(), known.to_string()));
            keys.dedup();
            let length = keys.first().map(|known| known.segments().len());
            let is_near = |known: &KeyPath| Some(known.segments().len()) == length;
            match keys.as_slice() {
                [] => {}
                [_, second, ..] if is_near(second) => return None,
                [only, ..] => return Some(only.clone()),
            }
            table = table
                .parent()
                .filter(|table| !table.segments().is_empty())?;
        }
    }

    /// Help on the header of a table that must be repeated and is not, or the other way round.
    fn brackets(&self, mistake: &Mistake, root: &Node) -> Option<String> {
        let path = &mistake.path;
        let node = root.find(path)?;
        let Kind::WrongType { .. } = mistake.kind else {
            return None;
        };
        let header = without_indices(path);
        let is_table = |node: &Node| matches!(node.datum, Datum::Table(_));
        match &node.datum {
            Datum::Table(_) if self.is_array_of_tables(path) => Some(format!(
                "write `[[{header}]]` with two brackets: this table can occur more than once"
            )),
            Datum::Array(items) if !items.is_empty() && items.iter().all(is_table) => Some(
                format!("write `[{header}]` with one bracket: this table occurs only once"),
            ),
            _ => None,
        }
    }

    fn is_array_of_tables(&self, path: &KeyPath) -> bool {
        self.nodes(path, true).into_iter().any(|node| {
            let items = node
                .get("items")
                .map(|items| self.alternatives(items, true));
            items.is_some_and(|all| all.iter().any(|one| one.get("properties").is_some()))
        })
    }

    /// The schemas that `path` can have. `variants`: also those of a choice by name.
    fn nodes(&self, path: &KeyPath, variants: bool) -> Vec<&Value> {
        let mut nodes = self.alternatives(&self.0, true);
        for (index, segment) in path.segments().iter().enumerate() {
            let variants = variants || index + 1 < path.segments().len();
            let children: Vec<&Value> = nodes
                .iter()
                .filter_map(|node| match segment {
                    Segment::Key(key) => {
                        let known = node.get("properties").and_then(|keys| keys.get(key));
                        // Tables with names of the user.
                        known.or_else(|| node.get("additionalProperties"))
                    }
                    Segment::Index(_) => node.get("items"),
                })
                .collect();
            nodes = children
                .into_iter()
                .flat_map(|node| self.alternatives(node, variants))
                .collect();
        }
        nodes
    }

    /// The schema itself and, behind references, those that it allows instead. `variants`: also those of a choice by name.
    fn alternatives<'a>(&'a self, node: &'a Value, variants: bool) -> Vec<&'a Value> {
        let mut found = vec![node];
        let mut next = 0;
        while next < found.len() && next < MOST_HOPS * MOST_HOPS {
            let node = found[next];
            next += 1;
            if let Some(name) = node.get("$ref").and_then(Value::as_str) {
                let pointer = name.trim_start_matches('#');
                found.extend(self.0.pointer(pointer));
            }
            let choices: &[&str] = if variants {
                &["anyOf", "allOf", "oneOf"]
            } else {
                &["anyOf", "allOf"]
            };
            for choice in choices {
                found.extend(
                    node.get(choice)
                        .and_then(Value::as_array)
                        .into_iter()
                        .flatten(),
                );
            }
        }
        found
    }

    /// The keys of the tables at and below `node`, which is the schema of `path`.
    fn below(&self, node: &Value, path: &KeyPath, depth: usize, keys: &mut Vec<KeyPath>) {
        for node in self.alternatives(node, false) {
            let properties = node.get("properties").and_then(Value::as_object);
            for (key, child) in properties.into_iter().flatten() {
                let at = path.key(key);
                if depth > 1 {
                    self.below(child, &at, depth - 1, keys);
                }
                keys.push(at);
            }
        }
    }
}

/// True if the file can have the key `known`, which is below `table`: nothing that it excludes is given.
fn is_possible(known: &KeyPath, table: &KeyPath, root: &Node) -> bool {
    let mut at = table.clone();
    known.segments()[table.segments().len()..]
        .iter()
        .all(|segment| {
            let Segment::Key(key) = segment else {
                return true;
            };
            let excludes = |group: &&&[&str]| group.contains(&key.as_str());
            let others = EXCLUSIVE.iter().filter(excludes).copied().flatten();
            let is_excluded = others
                .filter(|other| *other != key)
                .any(|other| root.find(&at.key(other)).is_some());
            at = at.key(key);
            !is_excluded && !OWN_MEANING.contains(&key.as_str())
        })
}

/// The table that has the key `known`, in words.
fn table_of(known: &KeyPath) -> String {
    let table = known.parent().unwrap_or_default();
    let header = without_indices(&table);
    let header = match table.segments().last() {
        Some(Segment::Index(_)) => format!("[[{header}]]"),
        _ => format!("[{header}]"),
    };
    let name = known.last_key().unwrap_or_default();
    format!("`{name}` is a key of {header}")
}

/// Help that only this name can have.
fn name_help(mistake: &Mistake) -> Option<&'static str> {
    let is_ethercat =
        matches!(&mistake.kind, Kind::UnknownName { found, .. } if found == "ethercat");
    if is_ethercat && mistake.path.last_key() == Some("protocol") {
        return Some(
            "an EtherCAT bus has the tables `[bus.NAME]` and `[specimen.bus]` in place of `[specimen.link]`",
        );
    }
    (mistake.path.to_string() == "integrator.method").then_some(
        "with a specimen: `gui`, `kr_alpha` or `mkr_alpha`; the implicit `newmark_average` and `newmark_linear` iterate \
         within a step, and each iteration would move the specimen",
    )
}

fn without_indices(path: &KeyPath) -> KeyPath {
    let keys = path.segments().iter();
    keys.filter(|segment| matches!(segment, Segment::Key(_)))
        .cloned()
        .collect()
}
