//! What ends a test out of order, as the events of the loop tell it: a command that is refused never stands in a row.

use serde::Serialize;

use super::subject::Subject;
use crate::catalog::limit::Limit;
use crate::control::limits::{Hit, Level};
use crate::engine::{Phase, TestHit};
use crate::record::{Event, EventKind, ON_MISS, late_words};

/// One of the reasons for which a test has tripped.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trip {
    /// Specimen, from 0, where it is one's own.
    pub specimen: Option<usize>,
    /// Its axis, from 0.
    pub axis: Option<usize>,
    /// Key of the limit in the test file; of what is no limit the word of `events.jsonl`.
    pub limit: &'static str,
    /// What was found, SI.
    pub value: f64,
    /// What is allowed, SI.
    pub bound: f64,
    /// In words.
    pub words: String,
}

impl Trip {
    /// What an event tells of a trip. What has no event of its own is told by the phase.
    pub(super) fn of(event: &Event, subject: &Subject) -> Option<Self> {
        let name = |port: u32| {
            let specimen = subject.specimens.get(port as usize);
            specimen.map_or("", |specimen| specimen.name.as_str())
        };
        let of_port = |port: u32, limit, what: &str| Self {
            specimen: Some(port as usize),
            axis: None,
            limit,
            value: f64::NAN,
            bound: f64::NAN,
            words: format!("{}: {what}", name(port)),
        };
        let of_axis = |port, axis: u32, limit, what: &str| Self {
            axis: Some(axis as usize),
            words: format!("{}, axis {}: {what}", name(port), axis + 1),
            ..of_port(port, limit, "")
        };
        let of_test = |limit, words| Self {
            specimen: None,
            axis: None,
            limit,
            value: f64::NAN,
            bound: f64::NAN,
            words,
        };
        Some(match event.kind {
            EventKind::Limit {
                port,
                axis,
                quantity,
                trip: true,
                value,
                bound,
            } => Self {
                value,
                bound,
                words: hit_words(subject, [port, axis], quantity, [value, bound]),
                ..of_axis(port, axis, quantity, "")
            },
            EventKind::TestLimit {
                quantity,
                trip: true,
                value,
                bound,
                worst,
            } => Self {
                value,
                bound,
                ..of_test(quantity, test_words(quantity, value, bound, worst))
            },
            EventKind::Link { port, fault } => of_port(port, "link", &fault.to_string()),
            EventKind::Interlock { port } => of_port(
                port,
                "interlock",
                "it reports a trip, or its interlock or emergency stop is open",
            ),
            EventKind::Saturated { port } => of_port(
                port,
                "saturated",
                "it reports a sensor or actuator at the end of its range",
            ),
            EventKind::HoldsOn { port } => of_port(
                port,
                "specimen_holds_on",
                "it still reports that its own watchdog holds it",
            ),
            EventKind::Misfit { port, axis, what } => {
                of_axis(port, axis, "misfit", &format!("not armed: {what}"))
            }
            EventKind::Geometry { port, what, .. } => {
                of_port(port, "geometry", &format!("geometry: {what}"))
            }
            EventKind::Moved { port, axis, .. } => {
                of_axis(port, axis, "moved", "it has moved since the interruption")
            }
            EventKind::Diverged { dof } => of_test(
                "diverged",
                format!("the response of DOF {} diverged", dof + 1),
            ),
            EventKind::Readiness {
                go: false,
                ticks,
                missed,
                ..
            } => of_test(
                "no_go",
                format!("not ready: {missed} of {ticks} ticks of the warm-up were late"),
            ),
            EventKind::Phase {
                to, cause, port, ..
            } if to == Phase::Tripped.word() => match port {
                Some(port) => of_port(port, cause, &cause_words(cause)),
                None => of_test(cause, cause_words(cause)),
            },
            _ => return None,
        })
    }
}

/// What has no event of its own, in words.
fn cause_words(cause: &str) -> String {
    match cause {
        "stale" => "no fresh measurement for longer than is allowed".to_owned(),
        "late" => "deadlines were missed, and the test is to stop for that".to_owned(),
        "not_settled" => "the static load found no equilibrium".to_owned(),
        "not_at_rest" => "it did not come to rest under the static load".to_owned(),
        "does_not_follow" => "it has not followed its commands under the static load".to_owned(),
        other => other.replace('_', " "),
    }
}

/// A limit of an axis, in the words of the end of the test.
fn hit_words(
    subject: &Subject,
    [port, axis]: [u32; 2],
    quantity: &str,
    [value, bound]: [f64; 2],
) -> String {
    let (specimen, axis) = (subject.specimens.get(port as usize), axis as usize);
    let name = specimen.map_or("", |specimen| specimen.name.as_str());
    if !value.is_finite() {
        return format!("{name}: the next command is not a finite number; it was not sent");
    }
    let watched = specimen.and_then(|specimen| specimen.axes.get(axis));
    let mark = watched.and_then(|axis| axis.marks.iter().find(|mark| mark.key == quantity));
    match mark {
        Some(mark) => {
            let hit = Hit {
                axis,
                quantity: mark.quantity,
                level: Level::Trip,
                value,
                bound,
            };
            format!("{name}, {hit}")
        }
        None => format!(
            "{name}, axis {}: {quantity} {value}, allowed {bound}",
            axis + 1
        ),
    }
}

/// A limit of the test as a whole, in the words of its end.
fn test_words(key: &str, value: f64, bound: f64, worst: Option<(u32, u32)>) -> String {
    if key == ON_MISS {
        return late_words(value, bound);
    }
    let mut all = Limit::OF_TEST.into_iter();
    match all.find(|quantity| quantity.key() == key) {
        Some(quantity) => TestHit {
            quantity,
            value,
            bound,
            worst: worst.map(|(port, axis)| (port as usize, axis as usize)),
            in_warm_up: false,
        }
        .to_string(),
        None => format!("{key}: {value}, allowed {bound}"),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::engine::PhaseCell;
    use crate::monitor::{About, Board, Tap, metrics};
    use crate::record::{Onlooker, Progress};

    /// What is on the board after these events.
    fn seen(kinds: &[EventKind]) -> Arc<Board> {
        let text = include_str!("../../config/frame-bouc-wen.toml").replace(
            "name = \"ground-storey\"",
            "name = \"ground-storey\"\nlimits = { command_disp_m = { trip = [-0.1, 0.1] } }",
        );
        let loaded = crate::config::parse(Path::new("test.toml"), text, &[]).unwrap();
        let experiment = crate::setup::build(&loaded).unwrap().experiment;
        let about = About {
            real_clock: true,
            ..About::default()
        };
        let subject = Subject::new(&experiment, about);
        let board = Arc::new(Board::new(subject, PhaseCell::default(), None));
        let (_, notes) = crossbeam_channel::bounded(1);
        let mut tap = Tap::new(Arc::clone(&board), notes);
        for kind in kinds {
            tap.event(&Event {
                tick: 7,
                time: 0.0,
                clock_ns: 0,
                kind: *kind,
            });
        }
        tap.finish(1, &Progress::default());
        board
    }

    const TRIPPED: EventKind = tripped("stale", Some(0));
    const LEAVING: EventKind = EventKind::Phase {
        from: "tripped",
        to: "leaving",
        cause: "stale",
        port: Some(0),
    };

    const fn tripped(cause: &'static str, port: Option<u32>) -> EventKind {
        EventKind::Phase {
            from: "running",
            to: "tripped",
            cause,
            port,
        }
    }

    #[test]
    fn a_command_that_was_refused_is_a_trip_although_it_stands_in_no_row() {
        let refused = EventKind::Limit {
            port: 0,
            axis: 0,
            quantity: "command_disp_m",
            trip: true,
            value: -0.12,
            bound: -0.1,
        };
        let board = seen(&[refused, TRIPPED, LEAVING]);
        let trips = &board.latest().trips;
        assert_eq!(trips.len(), 1, "{trips:?}");
        assert_eq!((trips[0].specimen, trips[0].axis), (Some(0), Some(0)));
        let words = &trips[0].words;
        assert!(
            words.starts_with("ground-storey, axis 1: commanded displacement -120 mm"),
            "{words}"
        );
        let text = metrics(&board, 1, 0);
        let labels = "{specimen=\"ground-storey\",axis=\"1\",limit=\"command_disp_m\"}";
        assert!(
            text.contains(&format!("\ngusset_tripped{labels} 1.0\n")),
            "{text}"
        );
        let worst = format!("\ngusset_limit_used_worst_ratio{labels} 1.2");
        assert!(text.contains(&worst), "{text}");
    }

    #[test]
    fn a_tick_late_by_a_period_is_told_with_units_and_its_key() {
        let late = EventKind::TestLimit {
            quantity: ON_MISS,
            trip: true,
            value: 0.0206,
            bound: 1.0 / 1024.0,
            worst: None,
        };
        let words = seen(&[late]).latest().trips[0].words.clone();
        for part in ["20.6 ms", "976.6 µs", "`timing.on_miss"] {
            assert!(words.contains(part), "no {part:?} in {words}");
        }
    }

    #[test]
    fn what_has_no_event_of_its_own_is_told_by_the_phase_and_an_orderly_end_by_nothing() {
        let stale = EventKind::Stale { port: 0, age: 4 };
        let of = |kinds: &[EventKind]| {
            let trips = seen(kinds).latest().trips.clone();
            trips.into_iter().map(|trip| trip.limit).collect::<Vec<_>>()
        };
        assert_eq!(of(&[stale, TRIPPED, LEAVING]), ["stale"]);
        assert_eq!(of(&[stale, tripped("late", None)]), ["late"]);
        let interlock = EventKind::Interlock { port: 0 };
        assert_eq!(
            of(&[interlock, tripped("interlock", Some(0))]),
            ["interlock"]
        );
        // A second one on the way out, with an event of its own and without.
        assert_eq!(
            of(&[interlock, tripped("interlock", Some(0)), LEAVING, TRIPPED]),
            ["interlock", "stale"]
        );
        assert_eq!(
            of(&[TRIPPED, LEAVING, interlock, TRIPPED]),
            ["stale", "interlock"]
        );
        assert!(of(&[stale, EventKind::StopRequested, LEAVING]).is_empty());
        let board = seen(&[LEAVING]);
        assert!(!metrics(&board, 1, 0).contains("gusset_tripped{"));
    }
}
