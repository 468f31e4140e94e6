//! The page of two runs: a rehearsal against the test, yesterday's against today's.

use serde_json::Value;

use super::RunData;
use super::html::{beside, note, paragraph, section, table};
use super::matched::Matched;
use super::outcome;
use super::overlays::{columns, loops, overlaid, side_by_side, tracking};
use super::page::zoomable;
use super::rows::Rows;
use super::tested::configuration;
use super::text::{NOTHING, count, escape, exact, plural};

/// Rows of a table of settings.
const MOST_LISTED: usize = 60;

/// Two runs on one page: `matched` is what comes of their rows, or why they cannot be compared row by row. `names` are what
/// the runs are called.
#[must_use]
pub fn compare(
    first: &RunData,
    second: &RunData,
    names: (&str, &str),
    matched: &Result<Matched, String>,
) -> String {
    let title = format!("{} against {}", names.0, names.1);
    let mut body = format!(
        "<header>\n<p class=\"brand\">gusset · comparison of two runs</p>\n<h1>{}</h1>\n",
        escape(&title)
    );
    body += &banner(matched, &damages(first, second));
    body += "</header>\n<main>\n";
    body += &section(
        "The two runs",
        &(facts(first, second) + &settings(first, second)),
    );
    let (a, b) = (first.digested(), second.digested());
    let (rows_a, rows_b) = (Rows::new(&a), Rows::new(&b));
    body += &match matched {
        Ok(matched) => overlaid(matched),
        Err(_) => side_by_side(&rows_a, &rows_b),
    };
    body += &loops(first, &rows_a, &rows_b);
    body += &tracking(first, second, &rows_a, &rows_b);
    if let Ok(matched) = matched {
        body += &columns(matched);
    }
    body += "</main>\n";
    zoomable(&title, &body)
}

/// What came of the comparison in one sentence.
#[must_use]
pub fn verdict(matched: &Result<Matched, String>) -> String {
    match matched {
        Err(why) => format!("not compared row by row: {why}"),
        Ok(found) if found.rows == 0 => "the runs have no step in common".to_owned(),
        Ok(found) => match &found.first {
            None => {
                let same = format!(
                    "the same to the last bit: {} of {}",
                    plural(found.rows, "row", "rows"),
                    plural(found.columns as u64, "column", "columns")
                );
                alone(found).map_or_else(|| same.clone(), |more| format!("{same}; but {more}"))
            }
            Some(first) => format!(
                "they differ first at step {}, {}, in {}: {:e} against {:e}",
                first.step,
                exact(first.time, "s"),
                first.column,
                first.values.0,
                first.values.1
            ),
        },
    }
}

/// Rows that only one of the runs has, in words.
fn alone(found: &Matched) -> Option<String> {
    let (first, second) = found.alone;
    (found.alone != (0, 0)).then(|| {
        format!(
            "{} of the first run and {} of the second have no counterpart",
            plural(first, "row", "rows"),
            count(second)
        )
    })
}

/// What of each run's record is not there, in words; each sentence says of which run.
#[must_use]
pub fn damages(first: &RunData, second: &RunData) -> Vec<String> {
    let of = |run: &RunData, which: &str| {
        let what = run.unfinished.iter().chain(&run.damaged);
        what.map(|what| format!("{which} run: {what}"))
            .collect::<Vec<_>>()
    };
    [of(first, "first"), of(second, "second")].concat()
}

fn banner(matched: &Result<Matched, String>, damages: &[String]) -> String {
    let (class, headline, mut more) = match matched {
        Err(why) => (
            "warning",
            "The runs cannot be compared row by row",
            vec![capital(why)],
        ),
        Ok(found) if found.rows == 0 => ("warning", "The runs have no step in common", Vec::new()),
        Ok(found) => {
            let is_whole = found.alone == (0, 0) && damages.is_empty();
            let (class, headline) = match &found.first {
                None if is_whole => ("good", "The same to the last bit"),
                None => (
                    "warning",
                    "The same as far as both go, but not all of both is there",
                ),
                Some(_) => ("warning", "The runs differ"),
            };
            let mut more = vec![format!("{}.", capital(&verdict(matched)))];
            if found.first.is_some() {
                more.extend(alone(found).map(|text| format!("{text}.")));
            }
            more.push(
                "Compared were all ticks of the running tests, number by number; columns that depend on wall time were not."
                    .to_owned(),
            );
            (class, headline, more)
        }
    };
    more.extend(damages.iter().map(|text| format!("{}.", capital(text))));
    let more: String = more.iter().map(|text| paragraph(text)).collect();
    format!("<div class=\"verdict {class}\">\n<p class=\"headline\">{headline}</p>\n{more}</div>\n")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

fn facts(first: &RunData, second: &RunData) -> String {
    let of = |run: &RunData| {
        let text = |key: &str| match outcome::at(run, key) {
            Some(Value::String(text)) => text.clone(),
            Some(Value::Null) | None => NOTHING.to_owned(),
            Some(other) => other.to_string(),
        };
        let dt = outcome::number(run, "dt");
        [
            run.title.clone(),
            text("status"),
            text("reason"),
            outcome::number(run, "steps").map_or_else(|| NOTHING.to_owned(), |n| count(n as u64)),
            dt.map_or_else(|| NOTHING.to_owned(), |dt| exact(dt, "s")),
            text("lambda"),
            text("clock"),
            text("deadline_misses"),
            text("version"),
        ]
    };
    let names = [
        "title",
        "status",
        "reason",
        "steps",
        "step",
        "λ",
        "clock",
        "deadline misses",
        "program",
    ];
    let rows = names.iter().zip(of(first).into_iter().zip(of(second)));
    let rows: Vec<_> = rows
        .map(|(name, (a, b))| vec![(*name).to_owned(), a, b])
        .collect();
    beside("plain", &table(&["", "first", "second"], &rows))
}

/// Keys of the configuration that are not alike.
fn settings(first: &RunData, second: &RunData) -> String {
    let (Some(a), Some(b)) = (configuration(first), configuration(second)) else {
        return note("The configurations cannot be compared: one of them cannot be read.");
    };
    let (mut left, mut right) = (Vec::new(), Vec::new());
    flat(&a, String::new(), &mut left);
    flat(&b, String::new(), &mut right);
    let value = |list: &[(String, String)], key: &str| {
        list.iter()
            .find(|(k, _)| k == key)
            .map_or_else(|| NOTHING.to_owned(), |(_, v)| v.clone())
    };
    let mut keys: Vec<&String> = left.iter().map(|(k, _)| k).collect();
    keys.extend(
        right
            .iter()
            .map(|(k, _)| k)
            .filter(|k| !left.iter().any(|(known, _)| known == *k)),
    );
    let rows: Vec<Vec<String>> = keys
        .into_iter()
        .map(|key| vec![key.clone(), value(&left, key), value(&right, key)])
        .filter(|row| row[1] != row[2])
        .take(MOST_LISTED)
        .collect();
    if rows.is_empty() {
        return note("The resolved configurations are alike.");
    }
    format!(
        "<h3>Settings that differ</h3>\n{}",
        beside("plain", &table(&["key", "first", "second"], &rows))
    )
}

fn flat(value: &Value, path: String, out: &mut Vec<(String, String)>) {
    let join = |key: &str| {
        if path.is_empty() {
            key.to_owned()
        } else {
            format!("{path}.{key}")
        }
    };
    match value {
        Value::Object(map) => map
            .iter()
            .for_each(|(key, value)| flat(value, join(key), out)),
        Value::Array(list) if list.iter().any(Value::is_object) => {
            for (i, value) in list.iter().enumerate() {
                // As `--set` and every message count them.
                flat(value, format!("{path}.{i}"), out);
            }
        }
        other => out.push((path, super::text::shortened(&other.to_string(), 120))),
    }
}

#[cfg(test)]
mod tests {
    use super::super::matched::Matcher;
    use super::super::synthetic::columns;
    use super::*;

    #[test]
    fn what_is_the_same_is_good_news_only_where_all_of_both_is_there() {
        let names = columns(&["step", "sub_tick", "state", "time", "x1"]);
        let found = |left: (u64, u64)| {
            let mut matcher = Matcher::new(&names, &names, 2).unwrap();
            let row = [0.0, 0.0, 3.0, 0.0, 1.0];
            matcher.take(&row, &row);
            Ok(matcher.finish(left))
        };
        let whole = RunData::default();
        let torn = RunData {
            damaged: vec!["row 7 of the samples is damaged".to_owned()],
            ..RunData::default()
        };
        let page = |second: &RunData, left| compare(&whole, second, ("a", "b"), &found(left));
        assert!(page(&whole, (0, 0)).contains("verdict good"));
        let short = page(&whole, (0, 9));
        assert!(short.contains("verdict warning") && !short.contains("verdict good"));
        assert!(short.contains("0\u{a0}rows of the first run and 9 of the second"));
        let damaged = page(&torn, (0, 0));
        assert!(!damaged.contains("verdict good"));
        assert!(damaged.contains("Second run: row 7 of the samples is damaged."));
        assert!(verdict(&found((0, 9))).contains("no counterpart"));
    }
}
