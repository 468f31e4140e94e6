//! The table of limits: what would have ended the test, how it was judged and who watched it; and what the specimens do at
//! either end of a test.

use serde_json::Value;

use super::RunData;
use super::html::{beside, note, paragraph, table};
use super::outcome;
use super::text::{NOTHING, exact, number, quantity};
use crate::catalog::limit::Limit;

/// The limits of the run, as markup; nothing where the summary has none.
pub(super) fn limits(run: &RunData) -> String {
    let Some(limits) = outcome::at(run, "limits").filter(|l| l.is_object()) else {
        return String::new();
    };
    let list = |value: Option<&Value>| value.and_then(Value::as_array).cloned().unwrap_or_default();
    let word = |value: &Value, key: &str| {
        value
            .get(key)
            .and_then(Value::as_str)
            .unwrap_or_default()
            .to_owned()
    };
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut unlimited = Vec::new();
    for specimen in list(limits.get("specimens")) {
        let name = word(&specimen, "name");
        let axes = list(specimen.get("axes"));
        for (axis, of_axis) in axes.iter().enumerate() {
            let who = if axes.len() > 1 {
                format!("{name}, axis {}", axis + 1)
            } else {
                name.clone()
            };
            let of_axis = of_axis.as_array().cloned().unwrap_or_default();
            if of_axis.is_empty() {
                unlimited.push(who);
                continue;
            }
            rows.extend(of_axis.iter().map(|limit| row(&who, limit)));
        }
    }
    rows.extend(
        list(limits.get("test"))
            .iter()
            .map(|limit| row("the test", limit)),
    );
    let mut markup = "<h3>Limits</h3>\n".to_owned();
    if rows.is_empty() {
        markup += &paragraph("The test had no limits but those that are always there.");
    } else {
        let heading = [
            "of",
            "limit",
            "warned of beyond",
            "tripped beyond",
            "kept by the specimen's end too",
            "judged",
        ];
        markup += &beside("limits", &table(&heading, &rows));
    }
    if !unlimited.is_empty() {
        markup += &note(&format!("Without limits: {}.", unlimited.join(", ")));
    }
    let always: Vec<_> = list(limits.get("always"))
        .iter()
        .filter_map(|v| Some(v.as_str()?.to_owned()))
        .collect();
    if !always.is_empty() {
        markup += &note(&format!("Always: {}.", always.join("; ")));
    }
    for (what, key) in [
        ("Unlimited", "unlimited"),
        ("Startup", "way_in"),
        ("A late tick", "on_miss"),
        ("On a trip", "on_trip"),
        ("At the end", "at_end"),
    ] {
        let found = word(limits, key);
        if !found.is_empty() {
            markup += &note(&format!("{what}: {}.", one_line(&found)));
        }
    }
    markup + &of_specimens(&list(limits.get("specimens")))
}

/// A text of several lines as a sentence.
fn one_line(text: &str) -> String {
    text.lines().map(str::trim).collect::<Vec<_>>().join(" ")
}

/// What belongs to specimens beside the sizes; of those that are alike once.
fn of_specimens(specimens: &[Value]) -> String {
    let mut told: Vec<(String, Vec<&str>)> = Vec::new();
    for specimen in specimens {
        let word = |key: &str| specimen.get(key).and_then(Value::as_str);
        let parts = [
            ("limits checked by", "checked_by"),
            ("stale answers:", "stale"),
            ("watchdog:", "watchdog"),
            ("direction:", "direction"),
            ("ends of its range:", "ends"),
        ];
        let parts = parts
            .into_iter()
            // The star stands for a column of this table.
            .filter_map(|(what, key)| Some(format!("{what} {}", word(key)?.replace(" (*)", ""))));
        let safe = specimen.get("safe_disp_m").and_then(Value::as_array);
        let safe = safe.map(|list| {
            let each = list.iter().filter_map(Value::as_f64);
            let each: Vec<_> = each.map(|disp| exact(disp, "m")).collect();
            format!("safe displacement: {}", each.join(", "))
        });
        let text = parts.chain(safe).collect::<Vec<_>>().join("; ");
        let name = word("name").unwrap_or(NOTHING);
        match told.iter_mut().find(|(known, _)| *known == text) {
            _ if text.is_empty() => {}
            Some((_, names)) => names.push(name),
            None => told.push((text, vec![name])),
        }
    }
    told.iter()
        .map(|(text, names)| note(&format!("{}: {}.", names.join(", "), one_line(text))))
        .collect()
}

fn row(who: &str, limit: &Value) -> Vec<String> {
    let unit = limit
        .get("unit")
        .and_then(Value::as_str)
        .unwrap_or_default();
    let key = limit.get("key").and_then(Value::as_str).unwrap_or_default();
    let sizes = |key: &str| {
        let values: Vec<f64> = limit
            .get(key)
            .and_then(Value::as_array)
            .map(|list| list.iter().filter_map(Value::as_f64).collect())
            .unwrap_or_default();
        let write = |v: f64| match unit {
            "" => number(v, 3),
            words if words.starts_with("in ") => format!("{} {words}", exact(v, "1").trim()),
            unit => quantity(v, unit),
        };
        match values[..] {
            [] => NOTHING.to_owned(),
            [size] => write(size),
            _ => values
                .iter()
                .map(|v| write(*v))
                .collect::<Vec<_>>()
                .join(" … "),
        }
    };
    let told = limit.get("also_at_the_specimen").and_then(Value::as_bool) == Some(true);
    vec![
        who.to_owned(),
        words(key),
        sizes("warn"),
        sizes("trip"),
        if told { "yes" } else { "no" }.to_owned(),
        limit
            .get("judged")
            .and_then(Value::as_str)
            .unwrap_or(NOTHING)
            .to_owned(),
    ]
}

/// A key of a limit in words. The table shows units with the values.
fn words(key: &str) -> String {
    match Limit::of_key(key) {
        Some(limit) => limit.words().to_owned(),
        None => key.strip_suffix("_m").unwrap_or(key).replace('_', " "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn how_a_limit_is_judged_and_what_is_done_at_either_end_stand_beside_the_sizes() {
        let miss = json!({"key": "max_total_misses", "unit": "in all", "warn": [50.0], "trip": [100.0],
            "judged": "not checked: the simulated clock misses no deadlines"});
        let following = json!({"key": "following_error_m", "unit": "m", "warn": [], "trip": [0.02],
            "judged": "at rest; in motion 0.02 s of it more"});
        let specimen = |name: &str| {
            json!({"name": name, "axes": [[following]], "safe_disp_m": [0.02], "watchdog": "after 0.25 s it holds",
                "stale": "the last force is held", "checked_by": "this loop, its server (*)"})
        };
        let run = RunData {
            summary: Some(json!({"limits": {
                "specimens": [specimen("a"), specimen("b")], "test": [miss],
                "way_in": "no sensor is read;\nthen a ramp", "at_end": "every specimen moves to its `safe_disp_m`",
                "on_trip": "every specimen holds", "on_miss": "the grid moves",
            }})),
            ..RunData::default()
        };
        let markup = limits(&run);
        for part in [
            "<th>judged</th>",
            "<td>at rest; in motion 0.02 s of it more</td>",
            "<td>not checked: the simulated clock misses no deadlines</td>",
            "Startup: no sensor is read; then a ramp.",
            "A late tick: the grid moves.",
            "On a trip: every specimen holds.",
            "At the end: every specimen moves to its `safe_disp_m`.",
            "a, b: limits checked by this loop, its server; stale answers: the last force is held; \
             watchdog: after 0.25 s it holds; safe displacement: 20\u{a0}mm.",
        ] {
            assert!(markup.contains(part), "{part} is missing in {markup}");
        }
    }

    #[test]
    fn keys_are_told_in_words_without_their_units() {
        assert_eq!(words("command_disp_m"), "commanded displacement");
        assert_eq!(words("following_error_m"), "following error");
        assert_eq!(words("max_total_misses"), "deadlines missed in total");
        assert_eq!(words("divergence_m"), "divergence");
    }
}
