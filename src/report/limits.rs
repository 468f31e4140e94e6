//! The table of limits: what would have ended the test, who watched it, and how close the test came where that is known.

use serde_json::Value;

use super::RunData;
use super::html::{beside, note, paragraph, table};
use super::outcome;
use super::text::{NOTHING, escape, exact, number, quantity};

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
        ];
        markup += &beside("limits", &table(&heading, &rows));
    }
    if !unlimited.is_empty() {
        markup += &note(&format!(
            "Without limits of their own: {}.",
            unlimited.join(", ")
        ));
    }
    let always: Vec<_> = list(limits.get("always"))
        .iter()
        .filter_map(|v| Some(v.as_str()?.to_owned()))
        .collect();
    if !always.is_empty() {
        markup += &note(&format!("Always: {}.", always.join("; ")));
    }
    let on_trip = word(limits, "on_trip");
    if !on_trip.is_empty() {
        markup += &format!("<p class=\"note\">On a trip: {}.</p>\n", escape(&on_trip));
    }
    markup
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
    ]
}

/// A key of a limit in words: `command_disp_m` is the commanded displacement; units stand beside the sizes.
fn words(key: &str) -> String {
    let units = [
        "_m_per_s2",
        "_m_per_s",
        "_n_s_per_m",
        "_n_per_m",
        "_n_per_s",
        "_share",
        "_m",
        "_n",
        "_s",
        "_j",
    ];
    let bare = units.iter().find_map(|unit| key.strip_suffix(unit));
    let word = |word: &str| match word {
        "disp" => "displacement".to_owned(),
        "vel" => "velocity".to_owned(),
        "accel" => "acceleration".to_owned(),
        other => other.to_owned(),
    };
    let words: Vec<String> = bare.unwrap_or(key).split('_').map(word).collect();
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::words;

    #[test]
    fn keys_are_told_in_words_without_their_units() {
        assert_eq!(words("command_disp_m"), "command displacement");
        assert_eq!(words("measured_force_n"), "measured force");
        assert_eq!(words("command_accel_m_per_s2"), "command acceleration");
        assert_eq!(words("following_error_m"), "following error");
        assert_eq!(words("stuck"), "stuck");
    }
}
