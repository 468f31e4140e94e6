//! The section on events: the timeline, and the list behind it.

use serde_json::Value;

use super::RunView;
use super::html::{beside, details, note, paragraph, section, table};
use super::text::{NOTHING, count, plural, quantity, shortened, trimmed};
use super::timeline::loop_seconds;
use gusset_quantity::catalog::event::Group;
use gusset_record::{EventLine, MOST_OF_A_KIND};

/// Events that are listed one by one.
const MOST_EVENTS: usize = 200;

/// The table of events.
pub(super) fn events(run: &RunView, timeline: &str) -> String {
    let heading = "Events";
    // Digests of checkpoints and of files, and the edge of a grid, are for programs.
    let told = run.events.iter().filter(|e| e.group() != Group::Silent);
    let told: Vec<&EventLine> = told.collect();
    if told.is_empty() {
        return section(
            heading,
            &(paragraph("No events were recorded.") + &incomplete(run)),
        );
    }
    let start = run.events.iter().find_map(loop_seconds).unwrap_or_default();
    let listed = told.iter().take(MOST_EVENTS);
    let rows: Vec<_> = listed.map(|e| event(e, start)).collect();
    let mut markup = timeline.to_owned();
    let title = plural(told.len() as u64, "event", "events");
    let list = table(
        &[
            "event",
            "tick",
            "test time",
            "loop's clock",
            "wall time (UTC)",
            "details",
        ],
        &rows,
    ) + &note(
        "Test time advances with the steps of the running test only. The clock of the loop, counted from the first event, \
         always advances.",
    );
    let mut list = list;
    if let Some(more) = told.len().checked_sub(MOST_EVENTS).filter(|&n| n > 0) {
        list += &note(&format!(
            "{} are in events.jsonl; the first {MOST_EVENTS} are listed.",
            plural(more as u64, "further event", "further events")
        ));
    }
    markup += &details(&title, &beside("events", &list));
    markup += &incomplete(run);
    section(heading, &markup)
}

/// That events are not in this page.
fn incomplete(run: &RunView) -> String {
    let left_out = run.flaws.events_left_out.iter();
    let left_out = left_out.map(|(kind, more)| {
        let kind = if kind.is_empty() { "other" } else { kind };
        note(&format!(
            "This page uses the first {} events of the kind \u{201c}{}\u{201d}; events.jsonl has {} more.",
            count(MOST_OF_A_KIND),
            kind.replace('_', " "),
            count(*more)
        ))
    });
    left_out.collect::<String>() + &unreadable(run)
}

/// That lines of events.jsonl are damaged.
fn unreadable(run: &RunView) -> String {
    match run.flaws.unreadable_events {
        0 => String::new(),
        lines => note(&format!(
            "{} of events.jsonl CANNOT BE READ: this list can be incomplete.",
            plural(lines as u64, "line", "lines")
        )),
    }
}

/// A row of the table; `start` is the zero of the loop's clock, in s.
fn event(line: &EventLine, start: f64) -> Vec<String> {
    let plain = |value: &Value| match value {
        Value::String(text) => text.clone(),
        Value::Null => NOTHING.to_owned(),
        Value::Number(value) if value.is_f64() => trimmed(value.as_f64().unwrap_or(f64::NAN), 6),
        other => other.to_string(),
    };
    let known = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
    let clock = loop_seconds(line).map(|seconds| format!("{:.4}\u{a0}s", seconds - start));
    let details =
        line.fields().iter().map(
            |(key, value)| match (key.strip_suffix("_ns"), value.as_f64()) {
                (Some(key), Some(ns)) => {
                    format!("{} {}", key.replace('_', " "), quantity(ns * 1e-9, "s"))
                }
                _ => format!("{} {}", key.replace('_', " "), plain(value)),
            },
        );
    let details = details.collect::<Vec<_>>().join(", ");
    vec![
        match line.name() {
            "" => NOTHING.to_owned(),
            name => name.replace('_', " "),
        },
        known(line.tick.map(count)),
        known(line.time.map(|t| format!("{t:.4}\u{a0}s"))),
        known(clock),
        known(line.wall.as_deref().map(clock_time)),
        shortened(&details, 300),
    ]
}

/// RFC 3339 without date's "T" and "Z" and without digits below the microsecond.
fn clock_time(wall: &str) -> String {
    let text = wall.trim_end_matches('Z').replacen('T', " ", 1);
    match text.split_once('.') {
        Some((whole, fraction)) => {
            format!("{whole}.{}", fraction.chars().take(6).collect::<String>())
        }
        None => text,
    }
}
