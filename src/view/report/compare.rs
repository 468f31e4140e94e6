//! The page of two runs: a rehearsal against the test, yesterday's against today's.

use std::collections::HashMap;

use serde_json::Value;

use super::RunView;
use super::html::{self, beside, note, section, table};
use super::matched::Matched;
use super::overlays::{columns, loops, overlaid, side_by_side};
use super::page::{HINT, zoomable};
use super::paired::{key_figures, timing, tracking};
use super::rows::Rows;
use super::tested::clock_word;
use super::text::{NOTHING, count, escape, exact, number, plural, quantity, shortened};
use gusset_proof::RecordedVerdict;

/// A smaller number is shown without a prefix.
const SMALLEST_PREFIXED: f64 = 1e-12;
/// Rows of a table of settings, and characters of a value in it.
const MOST_LISTED: usize = 60;
const MOST_SHOWN: usize = 120;

/// Two runs on one page: `matched` is the result for their rows, or why they cannot be compared row by row. `names` are the
/// names of the runs.
#[must_use]
pub fn compare(
    first: &RunView,
    second: &RunView,
    names: (&str, &str),
    matched: &Result<Matched, String>,
) -> String {
    let title = format!("{} against {}", names.0, names.1);
    let mut body = format!(
        "<header>\n<p class=\"brand\">gusset · comparison of two runs</p>\n<h1>{}</h1>\n",
        escape(&title)
    );
    let (a, b) = (first.digested(), second.digested());
    let (rows_a, rows_b) = (Rows::new(&a), Rows::new(&b));
    let mut verdicts = [first, second].into_iter().filter_map(verdict_of);
    let is_unstable = verdicts.any(|verdict| verdict.unstable);
    let (damages, doubts) = (damages(first, second), doubts(first, second));
    body += &banner(matched, &damages, &doubts, is_unstable);
    body += &key_figures((first, second), (&rows_a, &rows_b), matched);
    body += "</header>\n<main>\n";
    body += HINT;
    let histories = match matched {
        Ok(matched) => overlaid(matched),
        Err(_) => side_by_side(&rows_a, &rows_b),
    };
    let loops = loops(first, &rows_a, &rows_b);
    body += &section("Response", &(histories + &loops));
    body += &tracking(first, second, &rows_a, &rows_b);
    body += &timing(first, second);
    body += &section("Model", &(facts(first, second) + &settings(first, second)));
    if let Ok(matched) = matched {
        body += &columns(matched);
    }
    body += "</main>\n";
    zoomable(&title, &body)
}

/// Result of the comparison in one sentence.
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
                "{}they differ first at step {}, {}, in {}: {:e} against {:e}",
                if found.only_counts {
                    "every number of structure and specimens is the same, only the count of ticks, holds and commands is not: "
                } else {
                    ""
                },
                first.step,
                exact(first.time, "s"),
                first.column,
                first.values.0,
                first.values.1
            ),
        },
    }
}

/// The verdict for readers of the page: the size of the first difference in place of two numbers with all digits.
fn found_in_words(found: &Matched) -> String {
    let Some(first) = &found.first else {
        return verdict(&Ok(found.clone()));
    };
    let column = found.apart.iter().find(|a| a.column.name == first.column);
    let unit = column.map_or("1", |apart| apart.column.unit.as_str());
    let only = if found.only_counts {
        "every number of structure and specimens is equal; only the count of ticks, holds and commands differs. "
    } else {
        ""
    };
    let apart = (first.values.1 - first.values.0).abs();
    let by = match apart {
        apart if !apart.is_finite() => String::new(),
        // No prefix reaches so far down.
        apart if apart < SMALLEST_PREFIXED && unit != "1" => {
            format!(" by {}\u{a0}{unit}", number(apart, 3))
        }
        apart => format!(" by {}", quantity(apart, unit)),
    };
    format!(
        "{only}the first difference is at step {} ({}): {} differs{by}",
        count(first.step),
        quantity(first.time, "s"),
        first.column
    )
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

/// Missing parts of each run's record, in words; each sentence names its run.
#[must_use]
pub fn damages(first: &RunView, second: &RunView) -> Vec<String> {
    let of = |run: &RunView, which: &str| {
        let what = run.flaws.unfinished.iter().chain(&run.flaws.damaged);
        what.map(|what| format!("{which} run: {what}"))
            .collect::<Vec<_>>()
    };
    [of(first, "first"), of(second, "second")].concat()
}

/// Findings of the verdict on each run, in words; an unstable loop comes first.
#[must_use]
pub fn doubts(first: &RunView, second: &RunView) -> Vec<String> {
    let of = |run: &RunView, which: &str| {
        let judged = verdict_of(run)?;
        let found = plural(judged.findings.len() as u64, "finding", "findings");
        let found = match (judged.headline(), judged.findings.is_empty()) {
            (Some(unstable), _) => unstable,
            (None, false) => format!("{found} of the verdict: see its own report"),
            (None, true) => return None,
        };
        Some((judged.unstable, format!("{which} run: {found}")))
    };
    let both = [of(first, "first"), of(second, "second")];
    let mut both: Vec<_> = both.into_iter().flatten().collect();
    both.sort_by_key(|(is_unstable, _)| !is_unstable);
    both.into_iter().map(|(_, text)| text).collect()
}

fn verdict_of(run: &RunView) -> Option<&RecordedVerdict> {
    run.summary.as_ref()?.verdict.as_ref()
}

fn banner(
    matched: &Result<Matched, String>,
    damages: &[String],
    doubts: &[String],
    is_unstable: bool,
) -> String {
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
                None if is_whole => ("good", "Both runs are identical to the last bit"),
                None => (
                    "warning",
                    "Both runs are identical where both have data, but data is missing",
                ),
                Some(_) => ("warning", "The runs differ"),
            };
            let mut more = vec![format!("{}.", capital(&found_in_words(found)))];
            if found.first.is_some() {
                more.extend(alone(found).map(|text| format!("{text}.")));
            }
            more.push(
                "The comparison takes all ticks of the running tests that both runs have at the same test time. It leaves out columns that depend on wall time."
                    .to_owned(),
            );
            (class, headline, more)
        }
    };
    let class = match class {
        _ if is_unstable => "bad",
        "good" if !doubts.is_empty() => "warning",
        class => class,
    };
    let headline = if is_unstable {
        format!("{headline}; a LOOP IS UNSTABLE")
    } else {
        headline.to_owned()
    };
    let told = damages.iter().chain(doubts);
    more.extend(told.map(|text| format!("{}.", capital(text.trim_end_matches('.')))));
    html::banner(class, &headline, &more)
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

fn facts(first: &RunView, second: &RunView) -> String {
    let of = |run: &RunView| {
        let known = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
        let summary = run.summary.as_ref();
        let progress = run.progress();
        let misses = progress.deadline_misses.filter(|_| !run.is_served());
        [
            run.title.clone(),
            known(summary.map(|summary| summary.status.word().to_owned())),
            known(summary.map(|summary| summary.reason.clone())),
            known(progress.steps.map(count)),
            known(progress.dt.map(|dt| exact(dt, "s"))),
            known(summary.and_then(|summary| Some(summary.lambda?.0.to_string()))),
            known(summary.map(|summary| clock_word(summary.clock).to_owned())),
            known(misses.map(count)),
            known(summary.map(|summary| summary.version.clone())),
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
fn settings(first: &RunView, second: &RunView) -> String {
    let tree = |run: &RunView| toml::from_str::<Value>(&run.test.text).ok();
    let (Some(a), Some(b)) = (tree(first), tree(second)) else {
        return note("The configurations cannot be compared: one of them cannot be read.");
    };
    let (mut left, mut right) = (Vec::new(), Vec::new());
    flat(&a, String::new(), &mut left);
    flat(&b, String::new(), &mut right);
    let known =
        |list: &[(String, String)]| -> HashMap<String, String> { list.iter().cloned().collect() };
    let (of_left, of_right) = (known(&left), known(&right));
    let nothing = || NOTHING.to_owned();
    // Values that differ, and values that only one run has.
    let mut kinds: [Vec<Vec<String>>; 3] = Default::default();
    for (key, value) in left {
        match of_right.get(&key) {
            Some(other) if *other == value => {}
            Some(other) => {
                let [value, other] = around_difference(&value, other);
                kinds[0].push(vec![key, value, other]);
            }
            None => kinds[1].push(vec![key, shortened(&value, MOST_SHOWN), nothing()]),
        }
    }
    for (key, value) in right
        .into_iter()
        .filter(|(key, _)| !of_left.contains_key(key))
    {
        kinds[2].push(vec![key, nothing(), shortened(&value, MOST_SHOWN)]);
    }
    let all: usize = kinds.iter().map(Vec::len).sum();
    if all == 0 {
        return note("The resolved configurations are alike.");
    }
    let shares = shares(kinds.each_ref().map(Vec::len), MOST_LISTED);
    let listed = kinds.into_iter().zip(shares);
    let rows: Vec<Vec<String>> = listed
        .flat_map(|(rows, share)| rows.into_iter().take(share))
        .collect();
    let more = match all - rows.len() {
        0 => String::new(),
        more => note(&format!(
            "{} differ{}.",
            plural(more as u64, "more key", "more keys"),
            if more == 1 { "s" } else { "" }
        )),
    };
    format!(
        "<h3>Settings that differ</h3>\n{}{more}",
        beside("plain", &table(&["key", "first", "second"], &rows))
    )
}

/// How many of each list are shown where `room` are shown in all: one after the other has its turn, so that none crowds out another.
fn shares(lengths: [usize; 3], room: usize) -> [usize; 3] {
    let mut shares = [0; 3];
    let (mut left, mut is_over) = (room, false);
    while left > 0 && !is_over {
        is_over = true;
        for (share, length) in shares.iter_mut().zip(lengths) {
            if *share < length && left > 0 {
                (*share, left, is_over) = (*share + 1, left - 1, false);
            }
        }
    }
    shares
}

/// Two texts that are not alike, so short that a table has room for them, with the place at which they part.
fn around_difference(one: &str, other: &str) -> [String; 2] {
    let alike = one.chars().zip(other.chars()).take_while(|(a, b)| a == b);
    let before = alike.count().saturating_sub(MOST_SHOWN / 3);
    [one, other].map(|text| {
        if before == 0 || text.chars().count() <= MOST_SHOWN {
            return shortened(text, MOST_SHOWN);
        }
        let rest: String = text.chars().skip(before).collect();
        shortened(&format!("…{rest}"), MOST_SHOWN)
    })
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
        other => out.push((path, other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::super::matched::Matcher;
    use super::super::synthetic::columns;
    use super::*;
    use crate::Flaws;

    #[test]
    fn equal_runs_are_good_only_if_complete() {
        let names = columns(&["step", "sub_tick", "state", "time", "x1"]);
        let found = |left: (u64, u64)| {
            let mut matcher = Matcher::new(&names, &names, 2).unwrap();
            let row = [0.0, 0.0, 3.0, 0.0, 1.0];
            matcher.take(&row, &row);
            Ok(matcher.finish(left))
        };
        let whole = RunView::default();
        let torn = RunView {
            flaws: Flaws {
                damaged: vec!["row 7 of the samples is damaged".to_owned()],
                ..Flaws::default()
            },
            ..RunView::default()
        };
        let page = |second: &RunView, left| compare(&whole, second, ("a", "b"), &found(left));
        assert!(page(&whole, (0, 0)).contains("verdict good"));
        let short = page(&whole, (0, 9));
        assert!(short.contains("verdict warning") && !short.contains("verdict good"));
        assert!(short.contains("0\u{a0}rows of the first run and 9 of the second"));
        let damaged = page(&torn, (0, 0));
        assert!(!damaged.contains("verdict good"));
        assert!(damaged.contains("Second run: row 7 of the samples is damaged."));
        assert!(verdict(&found((0, 9))).contains("no counterpart"));
    }
    fn configured(resolved: String) -> RunView {
        let file = crate::TestFile::default();
        RunView {
            test: crate::ResolvedTest {
                text: resolved,
                file,
            },
            ..RunView::default()
        }
    }

    #[test]
    fn difference_far_along_a_list_is_found() {
        let listed = |last: f64| {
            let values: Vec<String> = (0..200).map(|i| format!("{i}.5")).collect();
            configured(format!("mass_kg = [{}, {last:?}]\n", values.join(", ")))
        };
        let alike = settings(&listed(7.25), &listed(7.25));
        assert!(alike.contains("are alike"), "{alike}");
        let page = settings(&listed(7.25), &listed(8.25));
        assert!(!page.contains("alike"), "{page}");
        for part in ["mass_kg", "…", "199.5,7.25]", "199.5,8.25]"] {
            assert!(page.contains(part), "{part} is missing in {page}");
        }
        // The list itself is not shown to where they part.
        assert!(!page.contains("100.5"), "{page}");
    }

    #[test]
    fn unlisted_differences_are_counted() {
        let keys = |name: &str, count: usize| -> String {
            (0..count).map(|i| format!("{name}{i:03} = 1\n")).collect()
        };
        let first = configured(keys("a", 100) + "both = 1\n");
        let second = configured(keys("b", 25) + "both = 2\n");
        let page = settings(&first, &second);
        let rows = page.matches("<tr>").count() - 1;
        assert_eq!(rows, MOST_LISTED);
        for key in ["both", "a033", "b024"] {
            assert!(page.contains(&format!("<td>{key}</td>")), "{key}");
        }
        assert!(page.contains("66\u{a0}more keys differ."), "{page}");
        assert_eq!(shares([3, 100, 0], 60), [3, 57, 0]);
        assert_eq!(shares([1, 2, 0], 60), [1, 2, 0]);
    }
}
