//! Events as a timeline: the states of the test, and the time of each event.

use super::RunView;
use super::axis::Axis;
use super::canvas::{Anchor, Ink, Lettering, fitted};
use super::charts::{Area, LABEL, Quantity, linear, title};
use super::html::figure;
use gusset_quantity::catalog::event::Group;
use gusset_quantity::catalog::phase::Phase;
use gusset_record::{Event, EventLine, utc};

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
pub(super) fn timeline(run: &RunView) -> String {
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
        return String::new();
    }
    let Some(axis) = Axis::exactly(start, end) else {
        return String::new();
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
            let ink = match phase {
                Phase::Running => Ink::Series(2),
                Phase::Holding => Ink::Series(1),
                Phase::Tripped => Ink::Alarm,
                _ => Ink::Series(5),
            };
            canvas.block(
                (x0, inner.y + 2.0),
                (x1.max(x0 + 1.5), inner.y + 20.0),
                ink,
                0.35,
            );
            let room = fitted(phase.word(), LABEL, x1 - x0 - 6.0);
            if room.chars().count() > 2 && x1 - x0 > 20.0 {
                canvas.text(
                    &room,
                    (x0 + 4.0, inner.y + 11.0),
                    Lettering::new(LABEL, Ink::Text),
                );
            }
        }
        for (row, &group) in used.iter().enumerate() {
            let y = inner.y + 34.0 + 24.0 * row as f64;
            let ink = ink(group);
            canvas.text(
                group.title(),
                (left - 10.0, y),
                soft.anchored(Anchor::Right),
            );
            let mut last = f64::NEG_INFINITY;
            for (t, _) in placed.iter().filter(|(_, line)| is_of(group, line)) {
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
        let drawn = timeline(&run);
        let words: Vec<&str> = drawn
            .lines()
            .filter(|line| !line.starts_with('<'))
            .collect();
        assert!(words.contains(&"12") && !words.contains(&"13"), "{words:?}");
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
        assert!(timeline(&run).is_empty());
        run.events
            .push(json!({"event": "miss", "time": 3.0}).into());
        run.events
            .push(json!({"event": "ended", "time": 10.0}).into());
        let drawn = timeline(&run);
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
