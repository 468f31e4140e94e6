//! The section on events: the timeline, and the list behind it.

use maud::{Markup, html};
use serde_json::Value;

use super::RunView;
use super::axis::Axis;
use super::chart::{Anchor, Area, Ink, LABEL, Lettering, WHOLE, fitted, page_picture};
use super::html::{details, note, paragraph, section, table_of};
use super::text::{NOTHING, count, plural, quantity, shortened, trimmed};
use gusset_quantity::catalog::event::Group;
use gusset_quantity::catalog::phase::Phase;
use gusset_record::{Event, EventLine, MOST_OF_A_KIND, utc};

/// Events that are listed one by one.
const MOST_EVENTS: usize = 200;

/// The section.
pub(super) fn events(run: &RunView) -> Markup {
    // Digests of checkpoints and of files, and the edge of a grid, are for programs.
    let told = run.events.iter().filter(|e| e.group() != Group::Silent);
    let told: Vec<&EventLine> = told.collect();
    let incomplete = incomplete(run);
    if told.is_empty() {
        return section(
            "Events",
            html! { (paragraph("No events were recorded.")) (incomplete) },
        );
    }
    let start = run.events.iter().find_map(loop_seconds).unwrap_or_default();
    let listed: Vec<_> = told
        .iter()
        .take(MOST_EVENTS)
        .map(|e| event(e, start))
        .collect();
    let heading = [
        "event",
        "tick",
        "test time",
        "loop's clock",
        "wall time (UTC)",
        "details",
    ];
    let more = told.len().saturating_sub(MOST_EVENTS) as u64;
    let list = html! {
        (table_of("events", &heading, &listed))
        (note(
            "Test time advances with the steps of the running test only. The clock of the loop, counted from the first event, \
             always advances."
        ))
        @if more > 0 {
            (note(&format!(
                "{} are in events.jsonl; the first {MOST_EVENTS} are listed.",
                plural(more, "further event", "further events")
            )))
        }
    };
    let title = plural(told.len() as u64, "event", "events");
    section(
        "Events",
        html! { (timeline(run)) (details(&title, list)) (incomplete) },
    )
}

/// That events are not in this page.
fn incomplete(run: &RunView) -> Markup {
    let left_out = run.flaws.events_left_out.iter().map(|(kind, more)| {
        let kind = if kind.is_empty() { "other" } else { kind };
        format!(
            "This page uses the first {} events of the kind \u{201c}{}\u{201d}; events.jsonl has {} more.",
            count(MOST_OF_A_KIND),
            kind.replace('_', " "),
            count(*more)
        )
    });
    let unreadable = run.flaws.unreadable_events as u64;
    html! {
        @for text in left_out { (note(&text)) }
        @if unreadable > 0 {
            (note(&format!(
                "{} of events.jsonl CANNOT BE READ: this list can be incomplete.",
                plural(unreadable, "line", "lines")
            )))
        }
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

/// The colour of a group of events.
const fn ink(group: Group) -> Ink {
    match group {
        Group::Misses => Ink::Alarm,
        Group::Answers => Ink::Series(1),
        Group::Limits => Ink::Series(4),
        Group::Operator => Ink::Series(0),
        Group::Other | Group::Silent => Ink::Series(5),
    }
}

/// The loop's own clock at an event, in s. It runs during a hold, too, when test time does not.
pub(super) fn loop_seconds(line: &EventLine) -> Option<f64> {
    Some(line.clock_ns? as f64 * 1e-9)
}

/// The timeline; nothing where fewer than two events have a time.
pub(super) fn timeline(run: &RunView) -> Markup {
    let is_simulated = run.is_simulated();
    let wall_ns = |line: &EventLine| utc::instant(line.wall.as_deref()?);
    let first = run.events.iter().find_map(wall_ns);
    // Before the loop starts neither clock runs.
    let has_time = |line: &&EventLine| line.time.is_some();
    let mut timed = run.events.iter().filter(has_time);
    let is_clocked = timed.all(|e| loop_seconds(e).is_some());
    let first_of_loop = run.events.iter().find_map(loop_seconds);
    let when = |event: &EventLine| -> Option<f64> {
        if is_simulated && is_clocked {
            Some(loop_seconds(event)? - first_of_loop?)
        } else if is_simulated {
            event.time
        } else {
            let since = i128::from(wall_ns(event)?) - i128::from(first?);
            Some(since as f64 * 1e-9)
        }
    };
    let placed: Vec<(f64, &EventLine)> = run
        .events
        .iter()
        .filter(|event| event.group() != Group::Silent)
        .filter_map(|event| Some((when(event).filter(|t| t.is_finite())?, event)))
        .collect();
    let end = run.events.iter().filter_map(when).fold(0.0, f64::max);
    let start = placed.iter().map(|p| p.0).fold(0.0, f64::min);
    if placed.len() < 2 || end <= start {
        return Markup::default();
    }
    let Some(axis) = Axis::exactly(start, end) else {
        return Markup::default();
    };
    let phases: Vec<(f64, Phase)> = placed
        .iter()
        .filter_map(|(t, line)| match line.event {
            Event::Phase { to, .. } => Some((*t, to)),
            _ => None,
        })
        .collect();
    let is_of = |group: Group, line: &EventLine| {
        line.group() == group && !matches!(line.event, Event::Phase { .. })
    };
    let used: Vec<Group> = Group::LISTED
        .into_iter()
        .filter(|&group| placed.iter().any(|(_, line)| is_of(group, line)))
        .collect();
    let words = if is_simulated && is_clocked {
        "clock of the loop since the first event"
    } else if is_simulated {
        "test time"
    } else {
        "wall time since the first event"
    };
    let height = 92.0 + 24.0 * used.len() as f64;
    let picture = page_picture(WHOLE, height, "Timeline of events", |canvas| {
        canvas.title(Area::whole(WHOLE, height), "Timeline", WHOLE);
        let (left, top, wide, bottom) = (190.0, 30.0, WHOLE - 204.0, height - 40.0);
        let across = |t: f64| left + wide * axis.place(t);
        let soft = Lettering::new(Ink::Soft);
        for tick in axis.ticks(9, 1.0) {
            let at = across(tick.at);
            canvas.line((at, top), (at, bottom), Ink::Grid, 1.0);
            canvas.text(
                &tick.label,
                (at, bottom + 13.0),
                soft.anchored(Anchor::Middle),
            );
        }
        canvas.line((left, bottom), (left + wide, bottom), Ink::Frame, 1.0);
        let name = format!("{words} (s)");
        canvas.text(
            &name,
            (left + wide / 2.0, bottom + 30.0),
            soft.anchored(Anchor::Middle),
        );
        canvas.text(
            "state",
            (left - 10.0, top + 11.0),
            soft.anchored(Anchor::Right),
        );
        for (i, (from, phase)) in phases.iter().enumerate() {
            let (x0, x1) = (
                across(*from),
                across(phases.get(i + 1).map_or(end, |next| next.0)),
            );
            let ink = match phase {
                Phase::Running => Ink::Series(2),
                Phase::Holding => Ink::Series(1),
                Phase::Tripped => Ink::Alarm,
                _ => Ink::Series(5),
            };
            let w = (x1 - x0).max(1.5);
            canvas.block(
                Area {
                    x: x0,
                    y: top + 2.0,
                    w,
                    h: 18.0,
                },
                ink,
                0.35,
            );
            let room = fitted(phase.word(), LABEL, x1 - x0 - 6.0);
            if room.chars().count() > 2 && x1 - x0 > 20.0 {
                canvas.text(&room, (x0 + 4.0, top + 11.0), Lettering::new(Ink::Text));
            }
        }
        for (row, &group) in used.iter().enumerate() {
            let y = top + 34.0 + 24.0 * row as f64;
            canvas.text(
                group.title(),
                (left - 10.0, y),
                soft.anchored(Anchor::Right),
            );
            let mut last = f64::NEG_INFINITY;
            for (t, _) in placed.iter().filter(|(_, line)| is_of(group, line)) {
                let x = across(*t);
                if x - last >= 0.7 {
                    canvas.line((x, y - 8.0), (x, y + 8.0), ink(group), 1.6);
                    last = x;
                }
            }
        }
    });
    html! { figure { (picture) } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn timeline_crosses_the_end_of_a_month() {
        let event = |second: &str, kind: &str| {
            EventLine::from(json!({"event": kind, "wall": second, "time": 0.0}))
        };
        let run = RunView {
            summary: Some(json!({"clock": "real"}).into()),
            events: vec![
                event("2026-11-30T23:59:58.250Z", "connected"),
                event("2026-12-01T00:00:10.500Z", "miss"),
            ],
            ..RunView::default()
        };
        let drawn = timeline(&run).0;
        assert!(
            drawn.contains(">12</text>") && !drawn.contains(">13</text>"),
            "{drawn}"
        );
    }

    #[test]
    fn timeline_shows_states_and_misses() {
        let mut run = RunView {
            summary: Some(json!({"clock": "simulated"}).into()),
            events: vec![
                json!({"event": "phase", "from": "armed", "to": "running", "time": 0.0}).into(),
            ],
            ..RunView::default()
        };
        assert!(timeline(&run).0.is_empty());
        run.events
            .push(json!({"event": "miss", "time": 3.0}).into());
        run.events
            .push(json!({"event": "ended", "time": 10.0}).into());
        let drawn = timeline(&run).0;
        for part in ["running", "deadline misses", "other", "test time (s)"] {
            assert!(drawn.contains(part), "{part}");
        }
        assert!(!drawn.contains("operator"));
        // After a trip test time stops, in older records at the end of the last step before the trip; the loop's clock
        // continues.
        let event = |time: f64, ns: u64, to: &str| {
            EventLine::from(
                json!({"event": "phase", "from": "armed", "to": to, "time": time, "clock_ns": ns}),
            )
        };
        run.events = vec![
            json!({"event": "connected"}).into(),
            json!({"event": "files", "time": null, "clock_ns": null}).into(),
            event(0.0, 1_000_000_000, "running"),
            json!({"event": "limit_trip", "time": 3.567, "clock_ns": 4_567_000_000u64}).into(),
            event(3.565, 4_567_000_000, "leaving"),
            event(3.565, 9_000_000_000, "safe"),
        ];
        let drawn = timeline(&run).0;
        assert!(
            drawn.contains("leaving")
                && drawn.contains("clock of the loop since the first event (s)")
        );
        let page = crate::report::render(&run);
        for cell in ["<td>3.5670\u{a0}s</td>", "<td>8.0000\u{a0}s</td>"] {
            assert!(page.contains(cell), "{cell}");
        }
    }
}
