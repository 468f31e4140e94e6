//! The sentence of an event for people: the template of its row in [`gusset_quantity::catalog::event`], filled from the fields of its line.
//!
//! Numbers are rounded and have their unit; numbers that are compared have as many digits as show which is larger. An event
//! without a row, or a line that lacks a field of the template, is shown by its name with all of its fields.

use serde_json::{Map, Value};

use crate::miss::{ON_MISS, late_words};
use gusset_quantity::catalog::event;
use gusset_quantity::units::{
    compared, compared_within, duration, in_axis_unit, number, reading, unit_of_key,
};

/// The sentence of the event of this name with these fields; empty if the event has none.
pub(super) fn of(name: &str, fields: &Map<String, Value>) -> String {
    let Some(row) = event::find(name) else {
        return plain(name, fields);
    };
    // A server says the details in words.
    if !row.sentence.contains("{text}")
        && let Some(text) = fields.get("text").and_then(Value::as_str)
    {
        return text.to_owned();
    }
    let real = |key: &str| fields.get(key).and_then(Value::as_f64);
    if let (Some(ON_MISS), Some(value), Some(bound)) = (
        fields.get("limit").and_then(Value::as_str),
        real("value"),
        real("bound"),
    ) {
        return format!("TRIP: {}", late_words(value, bound));
    }
    filled(row.sentence, fields).unwrap_or_else(|| plain(name, fields))
}

/// Name and fields of an event without a sentence.
fn plain(name: &str, fields: &Map<String, Value>) -> String {
    let words = |text: &str| text.replace('_', " ");
    let details: Vec<String> = fields
        .iter()
        .filter(|(_, value)| !value.is_object() && !value.is_array())
        .map(|(key, value)| {
            let name = words(key.strip_suffix("_ns").unwrap_or(key));
            format!("{name} {}", alone(key, value))
        })
        .collect();
    match details.as_slice() {
        [] => words(name),
        details => format!("{} ({})", words(name), details.join(", ")),
    }
}

/// A template with its fields; none if a field outside of brackets is missing.
fn filled(template: &str, fields: &Map<String, Value>) -> Option<String> {
    let mut text = String::new();
    let mut rest = template;
    while let Some(at) = rest.find(['[', '{']) {
        text.push_str(&rest[..at]);
        let is_optional = rest[at..].starts_with('[');
        let (open, close) = (at + 1, if is_optional { ']' } else { '}' });
        let length = rest[open..].find(close)?;
        let inner = &rest[open..open + length];
        if is_optional {
            text.push_str(&filled(inner, fields).unwrap_or_default());
        } else {
            text.push_str(&field(inner, fields)?);
        }
        rest = &rest[open + length + 1..];
    }
    text.push_str(rest);
    Some(text)
}

/// One field in words.
fn field(key: &str, fields: &Map<String, Value>) -> Option<String> {
    let word = |key: &str| fields.get(key).and_then(Value::as_str);
    // A number that is not finite is null in the file.
    let real = |key: &str| {
        let value = fields.get(key)?;
        Some(value.as_f64().unwrap_or(f64::NAN))
    };
    if let Some((key, choice)) = key.split_once('?') {
        let (yes, no) = choice.split_once('|')?;
        let chosen = if fields.get(key)?.as_bool()? { yes } else { no };
        return Some(chosen.to_owned());
    }
    let specimen = || match (word("name"), fields.get("specimen")) {
        (Some(name), _) => Some(format!("specimen \"{name}\"")),
        (None, Some(number)) => Some(format!("specimen {number}")),
        (None, None) => None,
    };
    let chosen = |texts: [String; 3], at: usize| texts.into_iter().nth(at);
    let place = |keys: &[&str]| keys.iter().position(|other| *other == key);
    match key {
        "specimen" => specimen(),
        "place" => match fields.get("axis") {
            Some(axis) => Some(format!("{}, axis {axis}", specimen()?)),
            None => specimen(),
        },
        "value" | "bound" => {
            let unit = word("unit").unwrap_or_else(|| unit_of_key(word("limit").unwrap_or("")));
            let both = compared(real("value")?, real("bound")?, unit);
            both.into_iter().nth(usize::from(key == "bound"))
        }
        "found" | "left" | "within" => {
            let all = compared_within(real("found")?, real("left")?, real("within")?);
            chosen(all, place(&["found", "left", "within"])?)
        }
        "force" | "most" if fields.contains_key("most") => {
            let both = compared(real("force")?, real("most")?, "N");
            both.into_iter().nth(usize::from(key == "most"))
        }
        "disp" | "force" => match real(&format!("{key}_noise_rms")) {
            Some(noise) => Some(chosen_reading(real(key)?, noise)),
            None => real(key).map(number),
        },
        "fault" => Some(
            match word("fault") {
                None => "could not be connected",
                Some("diverged") => "the computation failed",
                Some(_) => "the link is lost",
            }
            .to_owned(),
        ),
        "class" => word("class").map(|class| cause_words(class).to_owned()),
        "of" => word("of").map(|of| reference_words(of).to_owned()),
        "what" | "cause" => word(key).map(|word| word.replace('_', " ")),
        _ => fields.get(key).map(|value| alone(key, value)),
    }
}

fn chosen_reading(value: f64, noise: f64) -> String {
    let [value, _] = reading(value, Some(noise));
    value
}

/// A field that is compared with no other.
fn alone(key: &str, value: &Value) -> String {
    match (value, value.as_f64()) {
        (Value::String(text), _) => text.clone(),
        (_, Some(ns)) if key.ends_with("_ns") => duration(ns * 1e-9),
        (_, Some(real)) if value.is_f64() => in_axis_unit(real, unit_of_key(key)),
        (value, _) => value.to_string(),
    }
}

/// Class of a miss in words.
fn cause_words(class: &str) -> &str {
    match class {
        "preempted" => "preempted (another thread had the processor)",
        "taken_away" => "hypervisor (it had the processor)",
        "stopped" => "stopped (the process was stopped and continued)",
        "unknown" => "not known (the clock jumped)",
        "late_reply" => "late reply of a specimen",
        "ours" => "own (long computation, page fault or full queue)",
        other => other,
    }
}

/// Reference of the force that is allowed at the beginning, in words.
fn reference_words(of: &str) -> &'static str {
    match of {
        "yield_force_n" => "1 % of the yield force of its stand-in",
        "measured_force_n" => "1 % of its limit `measured_force_n`",
        _ => "the noise of its load cell; neither a yield force nor a limit is declared",
    }
}
