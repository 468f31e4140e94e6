//! The configuration reference: every table and key of the files, from their JSON Schema.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;

use serde_json::Value;

use super::examples::Examples;
use super::schema::{Schema, choices, in_toml, joined, one_of_list};
use super::values::{
    FEW, described, description_of, indented, linked, list_words, one_of, range, unit,
    word_choices, words_of,
};

/// A table with fewer keys than this, all of them plain values, is shown within the keys that use it.
const SMALL: usize = 3;
/// Placeholder for a name of the user in a path.
const NAME: &str = "NAME";
/// Deeper tables are not in the table of contents.
const DEEPEST: usize = 2;

/// A table of the reference, or the choices of a key.
struct Section<'a> {
    /// Dotted path of the table.
    path: String,
    /// True for `[[path]]`.
    is_list: bool,
    node: &'a Value,
    /// Name of the definition, or the path where it has none.
    owner: String,
    /// Further paths with the same keys.
    also: Vec<String>,
}

/// The reference of one kind of file.
pub struct Reference<'a> {
    schema: &'a Schema,
    sections: Vec<Section<'a>>,
    /// Tables that are shown within their keys.
    small: Vec<&'a str>,
}

impl<'a> Reference<'a> {
    pub fn new(schema: &'a Schema) -> Self {
        let mut reference = Self {
            schema,
            sections: Vec::new(),
            small: Vec::new(),
        };
        reference.small = reference.small_tables();
        reference.collect();
        reference
    }

    /// Definitions of small tables with plain values that several keys use.
    fn small_tables(&self) -> Vec<&'a str> {
        let root = self.schema.root();
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        count_references(root, &mut counts);
        let definitions = root["$defs"].as_object().unwrap();
        let is_small = |node: &Value| {
            let keys = node.get("properties").and_then(Value::as_object);
            keys.is_some_and(|keys| {
                keys.len() < SMALL && keys.values().all(|key| !self.is_deep(key))
            })
        };
        let is_plain_choice = |node: &Value| {
            choices(node).is_some_and(|all| {
                all.iter()
                    .all(|one| one.get("properties").is_none() || is_small(one))
            })
        };
        let named = definitions.iter().filter(|(name, node)| {
            let several = counts.get(name.as_str()).is_some_and(|count| *count > 1);
            several && (is_small(node) || (self.is_deep(node) && is_plain_choice(node)))
        });
        named.map(|(name, _)| name.as_str()).collect()
    }

    /// True of a table, of a list of tables, and of choices with a table.
    fn is_deep(&self, node: &Value) -> bool {
        let (node, _) = self.schema.resolve(node);
        node.get("properties").is_some()
            || node.get("items").is_some_and(|item| self.is_deep(item))
            || choices(node).is_some_and(|all| all.iter().any(|one| self.is_deep(one)))
            || named_tables(node).is_some_and(|table| self.is_deep(table))
            || is_empty_table(node)
    }

    /// Finds the place of every table: the shortest path, and the further ones.
    fn collect(&mut self) {
        let schema = self.schema;
        let mut open: VecDeque<(String, String, bool, &'a Value)> = VecDeque::new();
        open.push_back((String::new(), String::new(), false, schema.root()));
        while let Some((path, unnamed, is_list, node)) = open.pop_front() {
            let (definition, name) = schema.resolve(node);
            if name.is_some_and(|name| self.small.contains(&name)) {
                continue;
            }
            let owner = name.map_or(unnamed, str::to_owned);
            if let Some(known) = self.sections.iter_mut().find(|known| known.owner == owner) {
                known.also.push(bracketed(&path, is_list));
                continue;
            }
            for (key, child) in keys_of(definition) {
                let child = one_of_list(child).unwrap_or(child);
                let (resolved, _) = schema.resolve(child);
                let path = joined(&path, key);
                let unnamed = joined(&owner, key);
                if let Some(table) = named_tables(resolved) {
                    open.push_back((joined(&path, NAME), unnamed, false, table));
                    continue;
                }
                if let Some(item) = resolved.get("items").filter(|item| self.is_deep(item)) {
                    open.push_back((path, unnamed, true, item));
                } else if self.is_deep(child) {
                    open.push_back((path, unnamed, false, child));
                }
            }
            self.sections.push(Section {
                path,
                is_list,
                node: definition,
                owner,
                also: Vec::new(),
            });
        }
        // Each table follows the table that contains it, in the order of the keys.
        let mut order: Vec<String> = Vec::new();
        self.descend("", &mut order);
        let place = |section: &Section<'_>| order.iter().position(|path| *path == section.path);
        self.sections.sort_by_key(place);
    }

    fn descend(&self, path: &str, order: &mut Vec<String>) {
        order.push(path.to_owned());
        let section = self.sections.iter().find(|section| section.path == path);
        for (key, _) in section.map_or_else(Vec::new, |section| keys_of(section.node)) {
            let below = joined(path, key);
            for below in [joined(&below, NAME), below] {
                if self.sections.iter().any(|section| section.path == below) {
                    self.descend(&below, order);
                }
            }
        }
    }

    /// Every key with a plain value: its owner, its name and its node.
    pub fn plain_keys(&self) -> Vec<(String, String, &'a Value)> {
        let mut found = Vec::new();
        for section in &self.sections {
            for (key, node) in keys_of(section.node) {
                if self.is_plain(node) {
                    found.push((section.owner.clone(), key.to_owned(), node));
                }
            }
        }
        found
    }

    /// True for a key without an own section.
    fn is_plain(&self, node: &Value) -> bool {
        let (_, name) = self.schema.resolve(node);
        !self.is_deep(node) || name.is_some_and(|name| self.small.contains(&name))
    }

    /// The owners of all sections, with their headings.
    pub fn headings(&self) -> BTreeMap<String, String> {
        let named = self
            .sections
            .iter()
            .filter(|section| !section.path.is_empty());
        named
            .map(|section| {
                (
                    section.owner.clone(),
                    bracketed(&section.path, section.is_list),
                )
            })
            .collect()
    }

    /// The sections that are not among those already written, as a table of contents.
    pub fn contents(&self, written: &BTreeMap<String, String>, text: &mut String) {
        for section in &self.sections {
            let depth = section.path.replace(".NAME", "").matches('.').count();
            if section.path.is_empty() || depth > DEEPEST || written.contains_key(&section.owner) {
                continue;
            }
            let heading = bracketed(&section.path, section.is_list);
            let indent = "  ".repeat(depth + 1);
            let _ = writeln!(text, "{indent}- {}", linked(&heading));
        }
    }

    /// The sections that are not among those already written.
    pub fn write(
        &self,
        top: &str,
        written: &BTreeMap<String, String>,
        examples: &Examples,
        text: &mut String,
    ) {
        let mut headings = self.headings();
        headings.extend(written.clone());
        for section in &self.sections {
            if written.contains_key(&section.owner) {
                continue;
            }
            if section.path.is_empty() {
                let _ = writeln!(text, "\n## {top}\n");
            } else {
                let heading = bracketed(&section.path, section.is_list);
                let _ = writeln!(text, "\n## `{heading}`\n");
            }
            let description = described(section.node);
            if !description.is_empty() {
                let _ = writeln!(text, "{description}\n");
            }
            if !section.also.is_empty() {
                let also: Vec<String> = section
                    .also
                    .iter()
                    .map(|path| format!("`{path}`"))
                    .collect();
                let _ = writeln!(text, "Also: {}.\n", also.join(", "));
            }
            let words = word_choices(section.node);
            if !words.is_empty() {
                let _ = writeln!(text, "A word is allowed instead of the table:\n");
                list_words(&words, "", text);
                let _ = writeln!(text);
            }
            for (key, node) in keys_of(section.node) {
                if self.is_plain(node) {
                    self.entry(section, key, node, examples, text);
                } else {
                    self.table_entry(section, key, node, &headings, text);
                }
            }
        }
    }

    /// A key whose value is a table with an own section.
    fn table_entry(
        &self,
        section: &Section<'_>,
        key: &str,
        node: &Value,
        headings: &BTreeMap<String, String>,
        text: &mut String,
    ) {
        let one = one_of_list(node);
        let is_either = one.is_some();
        let (resolved, name) = self.schema.resolve(one.unwrap_or(node));
        let named = named_tables(resolved);
        let path = joined(&section.path, key);
        let path = named.map_or(path.clone(), |_| joined(&path, NAME));
        let item = resolved.get("items");
        let (of_item, item_name) =
            (item.or(named)).map_or((resolved, name), |item| self.schema.resolve(item));
        let owner = item_name.map_or_else(|| joined(&section.owner, key), str::to_owned);
        let own = bracketed(&path, item.is_some());
        let kind = match item {
            None if is_either => "table or list of tables",
            Some(_) => "list of tables",
            None if named.is_some() => "tables with names",
            None if word_choices(of_item).is_empty() => "table",
            None => "table or word",
        };
        let needed = if is_required(section.node, key) {
            "required"
        } else {
            "optional"
        };
        let _ = writeln!(text, "- **`{key}`** · {kind} · {needed}\n");
        if let Some(description) = description_of(node, resolved) {
            let _ = writeln!(text, "{}\n", indented(&description));
        }
        match headings.get(&owner) {
            Some(heading) if *heading == own => {
                let _ = writeln!(text, "  Keys: {}\n", linked(heading));
            }
            Some(heading) => {
                let _ = writeln!(
                    text,
                    "  Example: `{own}`, with the keys of {}\n",
                    linked(heading)
                );
            }
            None => {
                let _ = writeln!(text, "  Example: `{key} = {{}}`\n");
            }
        }
    }

    /// A key with a plain value.
    fn entry(
        &self,
        section: &Section<'_>,
        key: &str,
        node: &Value,
        examples: &Examples,
        text: &mut String,
    ) {
        let mut parts = vec![format!("- **`{key}`**")];
        let kind = self.kind(node);
        let is_word = kind.starts_with("`\"") || kind.starts_with("one of the words");
        parts.extend(unit(key).filter(|_| !is_word).map(str::to_owned));
        parts.push(kind);
        parts.push(if is_required(section.node, key) {
            "required".to_owned()
        } else {
            match node.get("default") {
                Some(value) => format!("default `{}`", in_toml(value)),
                None => "optional".to_owned(),
            }
        });
        let _ = writeln!(text, "{}\n", parts.join(" · "));
        let (resolved, _) = self.schema.resolve(node);
        if let Some(description) = description_of(node, resolved) {
            let _ = writeln!(text, "{}\n", indented(&description));
        }
        let words = word_choices(resolved);
        if words.len() > FEW || words.iter().any(|(_, says)| !says.is_empty()) {
            list_words(&words, "  ", text);
            let _ = writeln!(text);
        } else if self.is_deep(node) {
            self.list_keys(resolved, text);
        }
        if let Some(value) = examples.of(&section.owner, key, node) {
            let _ = writeln!(text, "  Example: `{key} = {value}`\n");
        }
    }

    /// The keys of a small table, below the key of the table.
    fn list_keys(&self, table: &Value, text: &mut String) {
        for (key, node) in keys_of(table) {
            let says = described(node).replace("\n\n", " ");
            let _ = writeln!(text, "  - `{key}` ({}): {says}", self.kind(node));
        }
        let _ = writeln!(text);
    }

    /// The kind of value that a key takes, in words.
    fn kind(&self, node: &Value) -> String {
        let (resolved, name) = self.schema.resolve(node);
        if name.is_some_and(|name| self.small.contains(&name)) {
            return self.small_kind(resolved);
        }
        if let Some(all) = choices(resolved) {
            let words = word_choices(resolved);
            // An alternative may hold several words.
            if all.iter().all(|one| !words_of(one).is_empty()) {
                return one_of(&words);
            }
            let mut kinds: Vec<String> = Vec::new();
            for one in all.iter().filter(|one| words_of(one).is_empty()) {
                let kind = self.kind(one);
                if !kinds.contains(&kind) {
                    kinds.push(kind);
                }
            }
            kinds.extend(words.iter().map(|(word, _)| format!("`\"{word}\"`")));
            return kinds.join(" or ");
        }
        let words = words_of(resolved);
        if !words.is_empty() {
            return one_of(&words);
        }
        if let Some(values) = resolved.get("enum").and_then(Value::as_array) {
            let values: Vec<String> = values.iter().map(|value| format!("`{value}`")).collect();
            return values.join(" or ");
        }
        match resolved.get("type").and_then(Value::as_str) {
            Some("boolean") => "`true` or `false`".to_owned(),
            Some("integer") => format!("whole number{}", range(resolved)),
            Some("number") => format!("number{}", range(resolved)),
            Some("string") => "text".to_owned(),
            Some("array") => self.list_kind(resolved),
            _ => "table".to_owned(),
        }
    }

    fn list_kind(&self, node: &Value) -> String {
        let Some(item) = node.get("items") else {
            return "list".to_owned();
        };
        if self.is_deep(item) {
            return "tables".to_owned();
        }
        let length = match (node.get("minItems"), node.get("maxItems")) {
            (Some(least), Some(most)) if least == most => format!(" of {least}"),
            _ => String::new(),
        };
        let item = match self.kind(item).as_str() {
            "number" => " numbers".to_owned(),
            "whole number" => " whole numbers".to_owned(),
            "text" => " texts".to_owned(),
            kind if kind.starts_with("list") => " rows of numbers".to_owned(),
            kind => format!(" values: {kind}"),
        };
        match length.as_str() {
            "" => format!("list of{item}"),
            length => format!("list{length}{item}"),
        }
    }

    fn small_kind(&self, node: &Value) -> String {
        let of_table = |table: &Value| {
            let keys: Vec<String> = keys_of(table)
                .iter()
                .map(|(key, _)| format!("`{key}`"))
                .collect();
            format!("table with {}", keys.join(", "))
        };
        match choices(node) {
            None => of_table(node),
            Some(all) => {
                let kinds = all.iter().map(|one| match one.get("properties") {
                    Some(_) => of_table(one),
                    None => self.kind(one),
                });
                kinds.collect::<Vec<_>>().join(" or ")
            }
        }
    }
}

fn count_references<'a>(node: &'a Value, counts: &mut BTreeMap<&'a str, usize>) {
    match node {
        Value::Object(keys) => {
            for (key, value) in keys {
                match value.as_str().filter(|_| key == "$ref") {
                    Some(reference) => {
                        let name = reference.rsplit('/').next().unwrap();
                        *counts.entry(name).or_default() += 1;
                    }
                    None => count_references(value, counts),
                }
            }
        }
        Value::Array(items) => items.iter().for_each(|item| count_references(item, counts)),
        _ => {}
    }
}

/// The keys of a table, or of all tables among its choices, in the order of the schema.
fn keys_of(node: &Value) -> Vec<(&str, &Value)> {
    let own = node.get("properties").and_then(Value::as_object);
    let mut keys: Vec<(&str, &Value)> = own
        .into_iter()
        .flatten()
        .map(|(key, node)| (key.as_str(), node))
        .collect();
    for choice in choices(node).into_iter().flatten() {
        let properties = choice.get("properties").and_then(Value::as_object);
        for (key, node) in properties.into_iter().flatten() {
            if !keys.iter().any(|(known, _)| known == key) {
                keys.push((key, node));
            }
        }
    }
    keys
}

/// The table of a node that holds tables with names of the user.
fn named_tables(node: &Value) -> Option<&Value> {
    node.get("additionalProperties")
        .filter(|any| any.is_object())
}

fn is_empty_table(node: &Value) -> bool {
    node.get("type").is_some_and(|kind| kind == "object")
        && node.get("properties").is_none()
        && node.get("additionalProperties") == Some(&Value::Bool(false))
}

fn is_required(table: &Value, key: &str) -> bool {
    let required = table.get("required").and_then(Value::as_array);
    required.is_some_and(|keys| keys.iter().any(|name| name == key))
}

fn bracketed(path: &str, is_list: bool) -> String {
    if is_list {
        format!("[[{path}]]")
    } else {
        format!("[{path}]")
    }
}
