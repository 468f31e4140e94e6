//! Reasons of a trip, from the events of the loop: a refused command is in no row.

use serde::Serialize;

use super::subject::Subject;
use gusset_control::engine::{Phase, TestHit, Worst};
use gusset_control::port::limits::{Hit, Level};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::limit::Limit;
use gusset_record::{Event, EventLine, LimitReached, ON_MISS, TimedEvent, Word, late_words};

/// One of the reasons for which a test has tripped.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trip {
    /// Specimen, from 0, where it is one's own.
    pub specimen: Option<usize>,
    /// Its axis, from 0.
    pub axis: Option<usize>,
    /// Key of the limit in the test file, or the word of `events.jsonl` if it is not a limit.
    pub limit: Word,
    /// The value that was found, SI.
    pub value: f64,
    /// The allowed value, SI.
    pub bound: f64,
    /// In words.
    pub words: String,
}

impl Trip {
    /// The trip that an event reports. A trip without an event follows from the phase.
    pub(super) fn of(event: &TimedEvent, subject: &Subject) -> Option<Self> {
        let names: Vec<String> = subject.specimens.iter().map(|s| s.name.clone()).collect();
        let line = EventLine::of_loop(event, &names);
        let place = |key: &str| {
            let number = line.fields().get(key)?.as_u64()?;
            usize::try_from(number).ok()?.checked_sub(1)
        };
        let (limit, words, [value, bound]) = match &event.kind {
            Event::LimitTrip(reached) => {
                let numbers = [reached.value, reached.bound];
                (reached.limit.clone(), limit_words(&names, reached), numbers)
            }
            Event::Phase {
                to: Phase::Tripped,
                cause,
                ..
            } => {
                let specimen = place("specimen").and_then(|place| names.get(place));
                let of = specimen.map_or_else(String::new, |name| format!("{name}: "));
                let words = format!("{of}{}", Cause::of_word(cause)?.sentence());
                (cause.clone(), words, [f64::NAN; 2])
            }
            kind => (kind.trip_row()?.name.into(), line.sentence(), [f64::NAN; 2]),
        };
        let is_of_test = matches!(&event.kind, Event::LimitTrip(reached) if reached.is_of_test());
        Some(Self {
            specimen: place("specimen").filter(|_| !is_of_test),
            axis: place("axis").filter(|_| !is_of_test),
            limit,
            value,
            bound,
            words,
        })
    }
}

/// A limit in the words of the end of the test.
fn limit_words(names: &[String], reached: &LimitReached) -> String {
    let LimitReached {
        limit: key,
        value,
        bound,
        ..
    } = reached;
    let (value, bound) = (*value, *bound);
    let index = |index: Option<u32>| index.and_then(|index| usize::try_from(index).ok());
    let place = index(reached.port).zip(index(reached.axis));
    if key == ON_MISS {
        return late_words(value, bound);
    }
    let Some(limit) = Limit::of_key(key) else {
        return format!("{key}: {value}, allowed {bound}");
    };
    match place.filter(|_| !reached.is_of_test()) {
        Some((port, axis)) => {
            let name = names.get(port).map_or("", String::as_str);
            if !value.is_finite() {
                return if limit.is_of_command() {
                    format!("{name}: the next command is not a finite number; it was not sent")
                } else {
                    format!("{name}: the {} is not a finite number", limit.row().words)
                };
            }
            let hit = Hit {
                axis,
                quantity: limit,
                level: Level::Trip,
                value,
                bound,
            };
            format!("{name}, {hit}")
        }
        None => TestHit {
            quantity: limit,
            value,
            bound,
            worst: place.map(|(port, axis)| Worst::Axis(port, axis)),
            in_warm_up: false,
        }
        .to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::live::{About, Board, Tap, metrics};
    use gusset_control::engine::PhaseCell;
    use gusset_record::{Onlooker, Progress};

    /// The board after these events.
    fn seen(kinds: &[Event]) -> Arc<Board> {
        let text = include_str!("../../../config/frame-bouc-wen.toml").replace(
            "name = \"ground-storey\"",
            "name = \"ground-storey\"\nlimits = { command_disp_m = { trip = [-0.1, 0.1] } }",
        );
        let loaded = gusset_config::parse(Path::new("test.toml"), text, &[]).unwrap();
        let experiment = gusset_setup::build(&loaded).unwrap().experiment;
        let about = About {
            real_clock: true,
            ..About::default()
        };
        let subject = Subject::new(&experiment, about);
        let board = Arc::new(Board::new(subject, PhaseCell::default(), None));
        let (_, notes) = crossbeam_channel::bounded(1);
        let mut tap = Tap::new(Arc::clone(&board), notes);
        for kind in kinds {
            tap.event(&TimedEvent {
                tick: 7,
                time: 0.0,
                clock_ns: 0,
                kind: kind.clone(),
            });
        }
        tap.finish(1, &Progress::default());
        board
    }

    const TRIPPED: Event = tripped("stale", Some(0));
    const LEAVING: Event = Event::Phase {
        from: Phase::Tripped,
        to: Phase::Leaving,
        cause: Word::Borrowed("stale"),
        port: Some(0),
    };

    const fn tripped(cause: &'static str, port: Option<u32>) -> Event {
        Event::Phase {
            from: Phase::Running,
            to: Phase::Tripped,
            cause: Word::Borrowed(cause),
            port,
        }
    }

    #[test]
    fn refused_command_is_a_trip() {
        let refused = Event::LimitTrip(LimitReached {
            port: Some(0),
            axis: Some(0),
            limit: "command_disp_m".into(),
            value: -0.12,
            bound: -0.1,
        });
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
    fn late_tick_is_reported_with_its_key() {
        let late = Event::LimitTrip(LimitReached {
            port: None,
            axis: None,
            limit: ON_MISS.into(),
            value: 0.0206,
            bound: 1.0 / 1024.0,
        });
        let words = seen(&[late]).latest().trips[0].words.clone();
        for part in ["20.6 ms", "976.6 µs", "`timing.on_miss"] {
            assert!(words.contains(part), "no {part:?} in {words}");
        }
    }

    #[test]
    fn trip_without_an_event_uses_the_phase() {
        let stale = || Event::Stale { port: 0, age: 4 };
        let of = |kinds: &[Event]| {
            let trips = seen(kinds).latest().trips.clone();
            trips.into_iter().map(|trip| trip.limit).collect::<Vec<_>>()
        };
        assert_eq!(of(&[stale(), TRIPPED, LEAVING]), ["stale"]);
        assert_eq!(of(&[stale(), tripped("late", None)]), ["late"]);
        let interlock = || Event::Interlock { port: 0 };
        assert_eq!(
            of(&[interlock(), tripped("interlock", Some(0))]),
            ["interlock"]
        );
        // A second trip during shutdown, with a separate event and without.
        assert_eq!(
            of(&[interlock(), tripped("interlock", Some(0)), LEAVING, TRIPPED]),
            ["interlock", "stale"]
        );
        assert_eq!(
            of(&[TRIPPED, LEAVING, interlock(), TRIPPED]),
            ["stale", "interlock"]
        );
        assert!(of(&[stale(), Event::StopRequested, LEAVING]).is_empty());
        let board = seen(&[LEAVING]);
        assert!(!metrics(&board, 1, 0).contains("gusset_tripped{"));
    }
}
