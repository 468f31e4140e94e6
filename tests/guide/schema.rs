//! A JSON Schema as the tests of the guide walk it: which tables and keys there are, and which a TOML text uses.

use serde_json::{Map, Value};

/// The schema of one kind of file.
pub struct Schema {
    root: Value,
}

/// A key that a file uses.
pub struct Use<'a> {
    /// The table that owns the key: the name of its definition, or its path where it has none.
    pub owner: String,
    /// The key.
    pub key: &'a str,
    /// Its value.
    pub value: &'a Value,
    /// False if the schema has no such key.
    pub is_known: bool,
    /// Dotted path in the file.
    pub path: String,
}

impl Schema {
    pub fn new(text: &str) -> Self {
        let mut root: Value = serde_json::from_str(text).unwrap();
        // Alternatives at the top say which keys a file needs, and have no keys themselves.
        root.as_object_mut().unwrap().remove("anyOf");
        Self { root }
    }

    /// The schema without the keys that files of another kind have at their top.
    pub fn without_keys_of(mut self, other: &Self) -> Self {
        let keys = self.root["properties"].as_object_mut().unwrap();
        keys.retain(|key, _| other.root["properties"].get(key).is_none());
        self
    }

    pub fn root(&self) -> &Value {
        &self.root
    }

    /// The definition that a node refers to, and its name.
    pub fn resolve<'a>(&'a self, node: &'a Value) -> (&'a Value, Option<&'a str>) {
        match node.get("$ref").and_then(Value::as_str) {
            Some(reference) => {
                let name = reference.rsplit('/').next().unwrap();
                (&self.root["$defs"][name], Some(name))
            }
            None => (node, None),
        }
    }

    /// Every key that `value` uses, in the order of the file.
    pub fn uses<'a>(&self, value: &'a Value) -> Vec<Use<'a>> {
        let mut found = Vec::new();
        self.walk(&self.root, "", value, "", &mut found);
        found
    }

    /// Paths of keys that the schema does not have.
    pub fn unknown(&self, value: &Value) -> Vec<String> {
        let uses = self.uses(value).into_iter();
        uses.filter(|one| !one.is_known)
            .map(|one| one.path)
            .collect()
    }

    fn walk<'a>(
        &self,
        node: &Value,
        owner: &str,
        value: &'a Value,
        path: &str,
        found: &mut Vec<Use<'a>>,
    ) {
        let (definition, name) = self.resolve(node);
        let owner = name.unwrap_or(owner);
        match value {
            // A fragment may show one table of a list.
            Value::Object(_) if definition.get("items").is_some() => {
                self.walk(&definition["items"], owner, value, path, found);
            }
            Value::Object(keys) => match choices(definition) {
                Some(choices) => {
                    // The choice that knows most of the keys.
                    let tried = choices.iter().map(|choice| {
                        let mut uses = Vec::new();
                        self.walk(choice, owner, value, path, &mut uses);
                        uses
                    });
                    let best = tried.min_by_key(|uses| uses.iter().filter(|u| !u.is_known).count());
                    found.extend(best.unwrap_or_default());
                }
                None => self.walk_table(definition, owner, keys, path, found),
            },
            Value::Array(items) => {
                let list = choices(definition).map_or(Some(definition), |choices| {
                    let lists = |choice: &&Value| choice.get("items").is_some();
                    choices.iter().find(lists)
                });
                let item = list.and_then(|list| list.get("items"));
                if let Some(item) = item {
                    for value in items {
                        self.walk(item, owner, value, path, found);
                    }
                }
            }
            _ => {}
        }
    }

    fn walk_table<'a>(
        &self,
        table: &Value,
        owner: &str,
        keys: &'a Map<String, Value>,
        path: &str,
        found: &mut Vec<Use<'a>>,
    ) {
        let own = table.get("properties").and_then(Value::as_object);
        let any = table
            .get("additionalProperties")
            .filter(|any| any.is_object());
        for (key, value) in keys {
            let node = own.and_then(|own| own.get(key)).or(any);
            let path = joined(path, key);
            found.push(Use {
                owner: owner.to_owned(),
                key,
                value,
                is_known: node.is_some(),
                path: path.clone(),
            });
            if let Some(node) = node {
                self.walk(node, &joined(owner, key), value, &path, found);
            }
        }
    }
}

/// The table of a node that takes one table or a list of them.
pub fn one_of_list(node: &Value) -> Option<&Value> {
    let [one, list] = choices(node)?.as_slice() else {
        return None;
    };
    (list.get("items") == Some(one)).then_some(one)
}

/// The choices of a node that has some.
pub fn choices(node: &Value) -> Option<&Vec<Value>> {
    let choices = node.get("oneOf").or_else(|| node.get("anyOf"));
    choices.and_then(Value::as_array)
}

pub fn joined(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_owned()
    } else {
        format!("{path}.{key}")
    }
}

/// A TOML text as JSON.
pub fn parsed(text: &str) -> Result<Value, String> {
    let value: toml::Value = toml::from_str(text).map_err(|error| error.to_string())?;
    Ok(as_json(value))
}

fn as_json(value: toml::Value) -> Value {
    match value {
        toml::Value::Table(keys) => {
            Value::Object(keys.into_iter().map(|(key, v)| (key, as_json(v))).collect())
        }
        toml::Value::Array(items) => items.into_iter().map(as_json).collect(),
        toml::Value::Integer(number) => number.into(),
        // JSON has no infinity: a word replaces it.
        toml::Value::Float(number) if !number.is_finite() => Value::String(number.to_string()),
        toml::Value::Float(number) => number.into(),
        toml::Value::Boolean(is) => is.into(),
        toml::Value::String(text) => text.into(),
        toml::Value::Datetime(time) => time.to_string().into(),
    }
}

/// A value in one line of TOML.
pub fn in_toml(value: &Value) -> String {
    match value {
        Value::Object(keys) => {
            let pairs = keys.iter().map(|(key, value)| {
                let is_bare =
                    !key.is_empty() && key.chars().all(|c| c.is_alphanumeric() || "_-".contains(c));
                let key = if is_bare {
                    key.clone()
                } else {
                    format!("{key:?}")
                };
                format!("{key} = {}", in_toml(value))
            });
            let pairs: Vec<String> = pairs.collect();
            if pairs.is_empty() {
                "{}".to_owned()
            } else {
                format!("{{ {} }}", pairs.join(", "))
            }
        }
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(in_toml).collect();
            format!("[{}]", items.join(", "))
        }
        Value::String(text) if text == "inf" || text == "-inf" => text.clone(),
        other => other.to_string(),
    }
}
