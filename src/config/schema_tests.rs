//! Descriptions and examples of all keys, in the schemas of all files.

use serde_json::Value;

use super::*;
use crate::fault_script::Script;
use schemars::transform::Transform;

/// Most words of a sentence.
const LONGEST_SENTENCE: usize = 25;
/// Most sentences in the description of a key.
const MOST_SENTENCES: usize = 5;

fn schemas() -> [Value; 3] {
    let schemas = [
        schemars::schema_for!(TestFile),
        schemars::schema_for!(ServeFile),
        schemars::schema_for!(Script),
    ];
    schemas.map(|mut schema| {
        ForToml.transform(&mut schema);
        schema.to_value()
    })
}

/// Visits each object of a schema with its path.
fn visit(node: &Value, path: &str, see: &mut impl FnMut(&str, &Value)) {
    match node {
        Value::Object(keys) => {
            see(path, node);
            for (key, inner) in keys.iter().filter(|(key, _)| *key != "examples") {
                visit(inner, &format!("{path}/{key}"), see);
            }
        }
        Value::Array(items) => items.iter().for_each(|inner| visit(inner, path, see)),
        _ => {}
    }
}

fn sentences(text: &str) -> Vec<&str> {
    let ends = [". ", "? ", ".\n", "`\n"];
    let mut found = vec![text];
    for end in ends {
        found = found.iter().flat_map(|part| part.split(end)).collect();
    }
    found
}

#[test]
fn descriptions_are_short_sentences() {
    let mut faults = Vec::new();
    for schema in schemas() {
        visit(&schema, "", &mut |path, node| {
            let Some(text) = node.get("description").and_then(Value::as_str) else {
                return;
            };
            let sentences = sentences(text);
            let longest = sentences.iter().map(|one| one.split_whitespace().count());
            let longest = longest.max().unwrap_or(0);
            // A type may explain its equations in a second paragraph.
            let is_long = path.contains("/properties/") && sentences.len() > MOST_SENTENCES;
            if longest > LONGEST_SENTENCE || is_long || text.contains("```") {
                faults.push(format!("{path}: {text}"));
            }
        });
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// True if a value fits a node of the schema with this root.
fn fits(root: &Value, node: &Value, value: &Value) -> bool {
    let place = node.get("$ref").and_then(Value::as_str);
    let named = place.map(|place| root.pointer(&place[1..]).unwrap());
    let choices = ["oneOf", "anyOf"].iter().find_map(|key| node.get(*key));
    let numbers = |key: &str| node.get(key).and_then(Value::as_f64);
    let within = |found: f64| {
        numbers("minimum").is_none_or(|least| found >= least)
            && numbers("maximum").is_none_or(|most| found <= most)
            && numbers("exclusiveMinimum").is_none_or(|least| found > least)
    };
    let of_type = match node.get("type").and_then(Value::as_str) {
        Some("string") => value.is_string(),
        Some("boolean") => value.is_boolean(),
        Some("integer") => value.is_u64() || value.is_i64(),
        Some("number") => value.is_number(),
        Some("array") => value.as_array().is_some_and(|all| {
            let length = all.len() as f64;
            numbers("minItems").is_none_or(|least| length >= least)
                && numbers("maxItems").is_none_or(|most| length <= most)
                && all.iter().all(|one| fits(root, &node["items"], one))
        }),
        Some("object") => fits_table(root, node, value),
        _ => true,
    };
    of_type
        && value.as_f64().is_none_or(within)
        && named.is_none_or(|named| fits(root, named, value))
        && node.get("const").is_none_or(|word| word == value)
        && node
            .get("enum")
            .and_then(Value::as_array)
            .is_none_or(|words| words.contains(value))
        && choices.is_none_or(|all| {
            all.as_array()
                .unwrap()
                .iter()
                .any(|one| fits(root, one, value))
        })
}

fn fits_table(root: &Value, node: &Value, value: &Value) -> bool {
    let Some(table) = value.as_object() else {
        return false;
    };
    let required = node.get("required").and_then(Value::as_array);
    let has = |key: &Value| key.as_str().is_some_and(|key| table.contains_key(key));
    let known = |(key, inner): (&String, &Value)| match node["properties"].get(key) {
        Some(own) => fits(root, own, inner),
        None => {
            let others = &node["additionalProperties"];
            *others != Value::Bool(false) && fits(root, others, inner)
        }
    };
    required.is_none_or(|keys| keys.iter().all(has)) && table.iter().all(known)
}

#[test]
fn examples_fit_their_keys() {
    let (mut count, mut faults) = (0, Vec::new());
    for schema in schemas() {
        visit(&schema, "", &mut |path, node| {
            let examples = node.get("examples").and_then(Value::as_array);
            for example in examples.into_iter().flatten() {
                count += 1;
                if !fits(&schema, node, example) {
                    faults.push(format!("{path}: {example}"));
                }
            }
        });
    }
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(count > 200, "{count} examples");
    let [test, ..] = schemas();
    let step = &test["$defs"]["TimeTable"]["properties"]["step_s"];
    assert!(!fits(&test, step, &serde_json::json!(-1)));
    assert!(!fits(&test, step, &serde_json::json!([1])));
    let limits = &test["$defs"]["LimitsSpec"];
    assert!(fits(
        &test,
        limits,
        &serde_json::json!({"force_step_n": {"trip": 7}})
    ));
    assert!(!fits(
        &test,
        limits,
        &serde_json::json!({"force_step": {"trip": 7}})
    ));
}
