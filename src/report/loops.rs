//! Sections on the loop itself: timing histograms, lateness over test time, and what happened.

use serde_json::Value;

use super::RunData;
use super::bars::HistogramChart;
use super::canvas::Ink;
use super::charts::Quantity;
use super::histogram::{self, Timing, words};
use super::html::{beside, figure, note, paragraph, section, table};
use super::lines::{Line, Reduce, TimeChart};
use super::outcome;
use super::plots::history;
use super::rows::Rows;
use super::text::{NOTHING, count, micros, plural, quantity, shortened, trimmed};
use super::timeline::{SILENT, loop_seconds};
use crate::catalog::column;

/// Events that are listed one by one.
const MOST_EVENTS: usize = 200;
/// Histograms that are drawn.
const MOST_HISTOGRAMS: usize = 12;

/// Timing quantities of the run: from `timing.json`, else from the summary.
pub(super) fn timings(run: &RunData) -> Vec<Timing> {
    let own = run.timing.as_ref().map(histogram::read).unwrap_or_default();
    if own.is_empty() {
        outcome::at(run, "timing")
            .map(histogram::read)
            .unwrap_or_default()
    } else {
        own
    }
}

/// Histograms, their percentiles and lateness over test time.
pub(super) fn timing(run: &RunData, rows: &Rows<'_>, timings: &[Timing]) -> String {
    let heading = "Timing";
    if outcome::text(run, "clock") == Some("simulated") {
        return section(
            heading,
            &paragraph(
                "This run used the simulated clock, on which nothing is ever late; there is no timing to show.",
            ),
        );
    }
    let mut markup = String::new();
    if timings.iter().all(|t| t.percentiles.count == 0) {
        markup += &paragraph("No timing was recorded for this run.");
    } else {
        markup += &percentiles(timings);
        let period = period_us(run);
        let drawn: Vec<_> = timings
            .iter()
            .filter(|t| t.percentiles.count > 0 && !t.histogram.is_empty())
            .take(MOST_HISTOGRAMS)
            .collect();
        let mut figures = String::new();
        for (i, timing) in drawn.iter().enumerate() {
            figures += &drawn_histogram(timing, period, i);
        }
        if drawn.is_empty() {
            markup += &note(
                "The counts behind these percentiles were not kept, so no histogram is drawn.",
            );
        } else {
            markup += &beside("grid", &figures);
        }
    }
    rows.section(
        heading,
        &(markup + &over_time(run, rows) + &worst(run, rows)),
    )
}

/// The ticks that took longest, with what is known of each.
fn worst(run: &RunData, rows: &Rows<'_>) -> String {
    let miss_at = |step: f64| {
        let near = run.events.iter().filter(|e| outcome::is_miss(e));
        near.filter_map(|e| Some((e.get("tick")?.as_f64()? - step, e)))
            .find(|(apart, _)| apart.abs() <= 1.0)
    };
    let show = |s: f64| {
        if s.is_finite() {
            micros(s * 1e6)
        } else {
            NOTHING.to_owned()
        }
    };
    let listed = rows.digest().worst.iter().map(|tick| {
        let miss = miss_at(tick.step).map(|(_, miss)| miss);
        let word = |key: &str| {
            miss.and_then(|m| m.get(key)?.as_str())
                .map(|w| w.replace('_', " "))
        };
        let number = |key: &str| miss.and_then(|m| m.get(key)?.as_u64());
        let mut context = Vec::new();
        if miss.is_some() {
            context.push(format!(
                "missed: {}",
                word("class").unwrap_or_else(|| "class not known".to_owned())
            ));
        }
        if let Some(steal) = number("steal_ms").filter(|n| *n > 0) {
            context.push(format!("{steal} ms of steal around it"));
        }
        if let Some(switches) = number("involuntary_switches").filter(|n| *n > 0) {
            context.push(plural(
                switches,
                "involuntary switch",
                "involuntary switches",
            ));
        }
        if let Some(faults) = number("minor_faults").filter(|n| *n > 0) {
            context.push(plural(faults, "page fault", "page faults"));
        }
        if tick.stretched > 0.0 {
            context.push(format!(
                "grid moved by {} so far",
                plural(tick.stretched as u64, "tick", "ticks")
            ));
        }
        vec![
            count(tick.step as u64),
            format!("{:.4}\u{a0}s", tick.time),
            show(tick.total),
            show(tick.wakeup),
            show(tick.sent - tick.wakeup),
            show(tick.round_trip),
            show(tick.compute),
            context.join(", "),
        ]
    });
    let listed: Vec<_> = listed.collect();
    if listed.is_empty() {
        return String::new();
    }
    let heading = [
        "step",
        "test time",
        "edge to next command ready",
        "wake-up",
        "send",
        "round trip",
        "compute",
        "context",
    ];
    let steal = run
        .events
        .iter()
        .filter(|e| outcome::is_miss(e))
        .filter_map(|e| e.get("steal_ms")?.as_u64());
    let steal: u64 = steal.sum();
    let steal = match (run.events.iter().any(outcome::is_miss), steal) {
        (false, _) => "No deadline was missed, so no steal was counted around one.".to_owned(),
        (true, ms) => format!(
            "Steal counted around misses, time that the hypervisor withheld: {ms} ms in all."
        ),
    };
    format!("<h3>The {} ticks that took longest</h3>\n", listed.len())
        + &beside("worst", &table(&heading, &listed))
        + &note(&steal)
}

fn period_us(run: &RunData) -> Option<f64> {
    let rate = outcome::number(run, "rate_hz").filter(|r| *r > 0.0 && r.is_finite())?;
    Some(1e6 / rate)
}

fn drawn_histogram(timing: &Timing, period_us: Option<f64>, i: usize) -> String {
    let (title, _) = words(&timing.key);
    let is_miss = timing.key == "miss";
    // A slack has no deadline, and a miss lies beyond it by definition.
    let deadline_us = if is_miss || timing.key == "slack" {
        None
    } else {
        period_us
    };
    let reached = timing
        .percentiles
        .max
        .zip(deadline_us)
        .is_some_and(|(max, deadline)| max > 0.05 * deadline);
    let chart = HistogramChart {
        title: &title,
        histogram: &timing.histogram,
        percentiles: &timing.percentiles,
        deadline_us: deadline_us.filter(|_| reached),
        ink: if is_miss {
            Ink::Alarm
        } else {
            Ink::Series([2, 0, 1, 3][i % 4])
        },
    };
    figure(
        510.0,
        300.0,
        &format!("Histogram of {title}"),
        |canvas, area| chart.draw(canvas, area),
    )
}

fn percentiles(timings: &[Timing]) -> String {
    let show = |v: Option<f64>| v.map_or_else(|| NOTHING.to_owned(), micros);
    let rows = timings.iter().map(|timing| {
        let (title, meaning) = words(&timing.key);
        let p = &timing.percentiles;
        let name = if meaning.is_empty() {
            title
        } else {
            format!("{title}: {meaning}")
        };
        let mut row = vec![name, count(p.count)];
        row.extend([p.min, p.p50, p.p90, p.p99, p.p99_9, p.max].map(show));
        row
    });
    table(
        &["", "count", "min", "p50", "p90", "p99", "p99.9", "max"],
        &rows.collect::<Vec<_>>(),
    )
}

fn over_time(run: &RunData, rows: &Rows<'_>) -> String {
    let time = rows.tick_time();
    let named = [
        (column::WAKEUP.name(), "wake-up lateness"),
        (column::ROUND_TRIP.name(), "round trip"),
        (column::COMPUTE.name(), "compute"),
        ("tick_time_s", "tick time"),
    ];
    let mut series = Vec::new();
    for (i, (column, name)) in named.into_iter().enumerate() {
        let is_positive = |values: &[f64]| values.iter().any(|v| *v > 0.0);
        if let Some(values) = rows.filled(column).filter(|values| is_positive(values)) {
            series.push((name, values, Ink::Series([2, 1, 0, 3][i])));
        }
    }
    if series.is_empty() {
        return String::new();
    }
    let lines: Vec<_> = series
        .iter()
        .map(|(name, y, ink)| Line {
            name,
            x: &time,
            y,
            ink: *ink,
            width: 1.1,
        })
        .collect();
    let when = |event: &Value| event.get("time").and_then(Value::as_f64);
    let mut marks: Vec<f64> = run
        .events
        .iter()
        .filter(|e| outcome::is_miss(e))
        .filter_map(when)
        .collect();
    marks.sort_by(f64::total_cmp);
    let up = Quantity {
        words: "time, logarithmic",
        unit: "s",
    };
    let title = "Over test time: the highest value in each column of the picture";
    let chart = TimeChart {
        title,
        up,
        lines: &lines,
        marks: &marks,
        reduce: Reduce::Highest,
        named_time: true,
    };
    let mut markup = history(280.0, "Lateness over test time", &chart);
    if !marks.is_empty() {
        markup += &note("Red strokes at the top mark deadline misses.");
    }
    markup
}

/// The table of events.
pub(super) fn events(run: &RunData, timeline: &str) -> String {
    let heading = "Events";
    let told: Vec<&Value> = run.events.iter().filter(|e| !is_silent(e)).collect();
    if told.is_empty() {
        return section(
            heading,
            &(paragraph("No events were recorded.") + &unreadable(run)),
        );
    }
    let start = run.events.iter().find_map(loop_seconds).unwrap_or_default();
    let listed = told.iter().take(MOST_EVENTS);
    let rows: Vec<_> = listed.map(|e| event(e, start)).collect();
    let mut markup = timeline.to_owned();
    markup += &table(
        &[
            "event",
            "tick",
            "test time",
            "loop's clock",
            "wall time (UTC)",
            "details",
        ],
        &rows,
    );
    markup += &note(
        "Test time advances with the steps of the running test only. The clock of the loop, counted from the first event, \
         always advances.",
    );
    if let Some(more) = told.len().checked_sub(MOST_EVENTS).filter(|&n| n > 0) {
        markup += &note(&format!(
            "{} are in events.jsonl; the first {MOST_EVENTS} are listed.",
            plural(more as u64, "further event", "further events")
        ));
    }
    markup += &unreadable(run);
    section(heading, &beside("events", &markup))
}

/// That lines of events.jsonl are damaged.
fn unreadable(run: &RunData) -> String {
    match run.unreadable_events {
        0 => String::new(),
        lines => note(&format!(
            "{} of events.jsonl CANNOT BE READ: this list can be incomplete.",
            plural(lines as u64, "line", "lines")
        )),
    }
}

/// Digests of checkpoints and of files, and the edge of a grid, are for programs; they stand in events.jsonl.
fn is_silent(event: &Value) -> bool {
    let name = event.get("event").and_then(Value::as_str);
    name.is_some_and(|name| SILENT.contains(&name))
}

/// A row of the table; `start` is what the loop's clock is counted from, in s.
fn event(event: &Value, start: f64) -> Vec<String> {
    let Some(map) = event.as_object() else {
        return vec![
            shortened(&event.to_string(), 200),
            String::new(),
            String::new(),
            String::new(),
            String::new(),
            String::new(),
        ];
    };
    let plain = |value: &Value| match value {
        Value::String(text) => text.clone(),
        Value::Null => NOTHING.to_owned(),
        Value::Number(value) if value.is_f64() => trimmed(value.as_f64().unwrap_or(f64::NAN), 6),
        other => other.to_string(),
    };
    let clock = loop_seconds(event).map_or_else(
        || NOTHING.to_owned(),
        |seconds| format!("{:.4}\u{a0}s", seconds - start),
    );
    let name = map
        .get("event")
        .or_else(|| map.get("kind"))
        .map_or_else(|| NOTHING.to_owned(), plain);
    let tick = map
        .get("tick")
        .and_then(Value::as_u64)
        .map_or_else(|| NOTHING.to_owned(), count);
    let time = map
        .get("time")
        .and_then(Value::as_f64)
        .map_or_else(|| NOTHING.to_owned(), |t| format!("{t:.4}\u{a0}s"));
    let wall = map
        .get("wall")
        .map_or_else(|| NOTHING.to_owned(), |w| clock_time(&plain(w)));
    let known = ["event", "kind", "tick", "time", "wall", "clock_ns"];
    let details = map
        .iter()
        .filter(|(key, _)| !known.contains(&key.as_str()))
        .map(
            |(key, value)| match (key.strip_suffix("_ns"), value.as_f64()) {
                (Some(key), Some(ns)) => {
                    format!("{} {}", key.replace('_', " "), quantity(ns * 1e-9, "s"))
                }
                _ => format!("{} {}", key.replace('_', " "), plain(value)),
            },
        );
    let details = details.collect::<Vec<_>>().join(", ");
    vec![
        name.replace('_', " "),
        tick,
        time,
        clock,
        wall,
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
