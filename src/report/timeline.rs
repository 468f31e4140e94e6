//! Events as a timeline: what state the test was in, and what happened when.

use serde_json::Value;

use super::RunData;
use super::axis::Axis;
use super::canvas::{Anchor, Ink, Lettering, fitted};
use super::charts::{Area, LABEL, Quantity, linear, title};
use super::html::figure;
use super::outcome;
use crate::catalog::phase::Phase;
use crate::record::utc;

/// Rows of the timeline: words, names of the events in it, colour.
const KINDS: [(&str, &[&str], Ink); 5] = [
    ("deadline misses", &["miss", "gap", "no_go"], Ink::Alarm),
    (
        "stale, late or lost answers",
        &[
            "stale",
            "recovered",
            "link",
            "unacknowledged",
            "last_words",
            "interlock",
            "saturated",
            "specimen_holds",
            "specimen_holds_on",
        ],
        Ink::Series(1),
    ),
    (
        "limits and warnings",
        &[
            "warning",
            "limit_warning",
            "trip",
            "limit_trip",
            "diverged",
            "row_lost",
            "rows_lost",
            "record_damaged",
            "not_granted",
            "misfit",
            "moved",
            "unsettled",
            "initial_force",
            "faults",
            "client_without_commits",
            "client_reset",
        ],
        Ink::Series(4),
    ),
    (
        "operator",
        &[
            "stop_requested",
            "hold_requested",
            "continue_requested",
            "continue_dropped",
            "confirmed",
        ],
        Ink::Series(0),
    ),
    ("other", &[], Ink::Series(5)),
];
/// Events that say nothing to a reader of a timeline.
pub(super) const SILENT: [&str; 3] = ["checkpoint", "files", "grid"];

/// The loop's own clock at an event, in s; it goes on where test time stands still.
pub(super) fn loop_seconds(event: &Value) -> Option<f64> {
    Some(event.get("clock_ns")?.as_f64()? * 1e-9)
}

fn name(event: &Value) -> &str {
    event
        .get("event")
        .or_else(|| event.get("kind"))
        .and_then(Value::as_str)
        .unwrap_or("")
}

/// The timeline; nothing where fewer than two events have a time.
pub(super) fn timeline(run: &RunData) -> String {
    let is_simulated = outcome::text(run, "clock") == Some("simulated");
    let wall_ns = |event: &Value| utc::instant(event.get("wall")?.as_str()?);
    let first = run.events.iter().find_map(wall_ns);
    // Before there is a loop neither clock goes.
    let has_time = |event: &&Value| event.get("time").is_some_and(|time| !time.is_null());
    let mut timed = run.events.iter().filter(has_time);
    let is_clocked = timed.all(|e| loop_seconds(e).is_some());
    let first_of_loop = run.events.iter().find_map(loop_seconds);
    let when = |event: &Value| -> Option<f64> {
        if is_simulated && is_clocked {
            Some(loop_seconds(event)? - first_of_loop?)
        } else if is_simulated {
            event.get("time")?.as_f64()
        } else {
            let since = i128::from(wall_ns(event)?) - i128::from(first?);
            Some(since as f64 * 1e-9)
        }
    };
    let placed: Vec<(f64, &Value)> = run
        .events
        .iter()
        .filter(|event| !SILENT.contains(&name(event)))
        .filter_map(|event| Some((when(event).filter(|t| t.is_finite())?, event)))
        .collect();
    let end = run.events.iter().filter_map(when).fold(0.0, f64::max);
    let start = placed.iter().map(|p| p.0).fold(0.0, f64::min);
    if placed.len() < 2 || end <= start {
        return String::new();
    }
    let Some(axis) = Axis::exactly(start, end) else {
        return String::new();
    };
    let phases: Vec<(f64, &str)> = placed
        .iter()
        .filter(|(_, event)| name(event) == "phase")
        .filter_map(|(t, event)| Some((*t, event.get("to")?.as_str()?)))
        .collect();
    let of_kind = |i: usize, event: &Value| {
        let at = KINDS
            .iter()
            .position(|(_, names, _)| names.contains(&name(event)));
        at.unwrap_or(KINDS.len() - 1) == i && name(event) != "phase"
    };
    let used: Vec<usize> = (0..KINDS.len())
        .filter(|&i| placed.iter().any(|(_, event)| of_kind(i, event)))
        .collect();
    let height = 92.0 + 24.0 * used.len() as f64;
    let words = if is_simulated && is_clocked {
        "clock of the loop since the first event"
    } else if is_simulated {
        "test time"
    } else {
        "wall time since the first event"
    };
    figure(1040.0, height, "Timeline of events", |canvas, area| {
        title(canvas, area, "Timeline", area.w);
        let left = 190.0;
        let inner = Area {
            x: left,
            y: 30.0,
            w: area.w - left - 14.0,
            h: height - 30.0 - 40.0,
        };
        let across = |t: f64| inner.x + inner.w * axis.place(t);
        let scaled = linear(&axis, Quantity { words, unit: "s" }, 9, false);
        let soft = Lettering::new(LABEL, Ink::Soft);
        let bottom = inner.y + inner.h;
        for tick in &scaled.ticks {
            let at = across(tick.at);
            canvas.line((at, inner.y), (at, bottom), Ink::Grid, 1.0);
            canvas.text(
                &tick.label,
                (at, bottom + 13.0),
                soft.anchored(Anchor::Middle),
            );
        }
        canvas.line(
            (inner.x, bottom),
            (inner.x + inner.w, bottom),
            Ink::Frame,
            1.0,
        );
        canvas.text(
            &scaled.name,
            (inner.x + inner.w / 2.0, bottom + 30.0),
            soft.anchored(Anchor::Middle),
        );
        canvas.text(
            "state",
            (left - 10.0, inner.y + 11.0),
            soft.anchored(Anchor::Right),
        );
        for (i, (from, phase)) in phases.iter().enumerate() {
            let to = phases.get(i + 1).map_or(end, |next| next.0);
            let (x0, x1) = (across(*from), across(to));
            let ink = match *phase {
                word if word == Phase::Running.word() => Ink::Series(2),
                word if word == Phase::Holding.word() => Ink::Series(1),
                word if word == Phase::Tripped.word() => Ink::Alarm,
                _ => Ink::Series(5),
            };
            canvas.block(
                (x0, inner.y + 2.0),
                (x1.max(x0 + 1.5), inner.y + 20.0),
                ink,
                0.35,
            );
            let room = fitted(phase, LABEL, x1 - x0 - 6.0);
            if room.chars().count() > 2 && x1 - x0 > 20.0 {
                canvas.text(
                    &room,
                    (x0 + 4.0, inner.y + 11.0),
                    Lettering::new(LABEL, Ink::Text),
                );
            }
        }
        for (row, &i) in used.iter().enumerate() {
            let y = inner.y + 34.0 + 24.0 * row as f64;
            let (words, _, ink) = KINDS[i];
            canvas.text(words, (left - 10.0, y), soft.anchored(Anchor::Right));
            let mut last = f64::NEG_INFINITY;
            for (t, _) in placed.iter().filter(|(_, event)| of_kind(i, event)) {
                let x = across(*t);
                if x - last >= 0.7 {
                    canvas.line((x, y - 8.0), (x, y + 8.0), ink, 1.6);
                    last = x;
                }
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_real_test_over_the_end_of_a_month_takes_its_few_seconds() {
        let event = |second: &str, kind: &str| json!({"event": kind, "wall": second, "time": 0.0});
        let run = RunData {
            summary: Some(json!({"clock": "real"})),
            events: vec![
                event("2026-11-30T23:59:58.250Z", "connected"),
                event("2026-12-01T00:00:10.500Z", "miss"),
            ],
            ..RunData::default()
        };
        let drawn = timeline(&run);
        let words: Vec<&str> = drawn
            .lines()
            .filter(|line| !line.starts_with('<'))
            .collect();
        assert!(words.contains(&"12") && !words.contains(&"13"), "{words:?}");
    }

    #[test]
    fn states_and_misses_stand_in_the_timeline_and_one_event_is_none() {
        let mut run = RunData {
            summary: Some(json!({"clock": "simulated"})),
            events: vec![json!({"event": "phase", "to": "running", "time": 0.0})],
            ..RunData::default()
        };
        assert!(timeline(&run).is_empty());
        run.events.push(json!({"event": "miss", "time": 3.0}));
        run.events.push(json!({"event": "ended", "time": 10.0}));
        let drawn = timeline(&run);
        for part in ["running", "deadline misses", "other", "test time (s)"] {
            assert!(drawn.contains(part), "{part}");
        }
        assert!(!drawn.contains("operator"));
        // After a trip test time stands, in older records where the last step ended, before the trip; the loop's clock goes on.
        let event = |time: f64, ns: u64, to: &str| json!({"event": "phase", "to": to, "time": time, "clock_ns": ns});
        run.events = vec![
            json!({"event": "connected"}),
            json!({"event": "files", "time": null, "clock_ns": null}),
            event(0.0, 1_000_000_000, "running"),
            json!({"event": "limit_trip", "time": 3.567, "clock_ns": 4_567_000_000u64}),
            event(3.565, 4_567_000_000, "leaving"),
            event(3.565, 9_000_000_000, "safe"),
        ];
        let drawn = timeline(&run);
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
