//! Descriptions, words, ranges and units of the reference.

use std::fmt::Write as _;

use serde_json::Value;

use super::schema::choices;

/// More words than this are shown as a list.
pub const FEW: usize = 4;

/// The description in paragraphs, without examples in Rust.
pub fn described(node: &Value) -> String {
    let text = node
        .get("description")
        .and_then(Value::as_str)
        .unwrap_or_default();
    let paragraphs = text.split("\n\n").filter(|part| !part.starts_with("```"));
    escaped(&paragraphs.collect::<Vec<_>>().join("\n\n"))
}

/// Prose in which brackets and stars outside of code are no Markdown.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    let mut in_code = false;
    for c in text.chars() {
        in_code ^= c == '`';
        if !in_code && "[]<>*".contains(c) {
            escaped.push('\\');
        }
        escaped.push(c);
    }
    escaped
}

/// The description of a key, or else that of its definition.
pub fn description_of(node: &Value, resolved: &Value) -> Option<String> {
    let own = described(node);
    let text = if own.is_empty() {
        described(resolved)
    } else {
        own
    };
    (!text.is_empty()).then_some(text)
}

/// A heading with a link to its section.
pub fn linked(heading: &str) -> String {
    format!("[`{heading}`](#{})", gusset::guide::anchor(heading))
}

/// Paragraphs below an item of a list.
pub fn indented(text: &str) -> String {
    let paragraphs: Vec<String> = text.split("\n\n").map(|part| format!("  {part}")).collect();
    paragraphs.join("\n\n")
}

/// The words of a node, each with its meaning.
pub fn words_of(node: &Value) -> Vec<(String, String)> {
    let says = described(node);
    if let Some(word) = node.get("const").and_then(Value::as_str) {
        return vec![(word.to_owned(), says)];
    }
    let words = node.get("enum").and_then(Value::as_array);
    let words = words.into_iter().flatten().filter_map(Value::as_str);
    words.map(|word| (word.to_owned(), String::new())).collect()
}

pub fn word_choices(node: &Value) -> Vec<(String, String)> {
    choices(node)
        .into_iter()
        .flatten()
        .flat_map(words_of)
        .collect()
}

pub fn one_of(words: &[(String, String)]) -> String {
    if words.len() > FEW {
        return "one of the words below".to_owned();
    }
    let words: Vec<String> = words
        .iter()
        .map(|(word, _)| format!("`\"{word}\"`"))
        .collect();
    words.join(" or ")
}

pub fn list_words(words: &[(String, String)], indent: &str, text: &mut String) {
    for (word, says) in words {
        let says = says.replace("\n\n", " ");
        let colon = if says.is_empty() { "" } else { ": " };
        let _ = writeln!(text, "{indent}- `\"{word}\"`{colon}{says}");
    }
}

/// The range of a number, in words. Bounds that only come from the kind of integer say nothing.
pub fn range(node: &Value) -> String {
    let bound = |key: &str| node.get(key).and_then(Value::as_f64);
    if let Some(above) = bound("exclusiveMinimum") {
        return format!(" greater than {above}");
    }
    let least = bound("minimum").filter(|least| *least >= 0.0);
    let most =
        bound("maximum").filter(|most| ![127.0, 255.0, 65535.0, 4294967295.0].contains(most));
    match (least, most) {
        (Some(least), Some(most)) => format!(", {least} to {most}"),
        (Some(least), None) if least > 0.0 => format!(", at least {least}"),
        (None, Some(most)) => format!(", at most {most}"),
        _ => String::new(),
    }
}

/// The unit that the name of a key carries.
pub fn unit(key: &str) -> Option<&'static str> {
    Some(gusset_quantity::units::unit_in_name(key)).filter(|unit| !unit.is_empty())
}
