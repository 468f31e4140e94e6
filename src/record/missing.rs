//! Rows missing at the end of a record: all rows may be whole, but too few.
//!
//! The summary states how far the test went. Without a summary, the events do: the writer brings a row to its file before the
//! events of its tick. So a kill leaves no event that is more than one step ahead of the last row.

use super::events::{Event, EventLine};
use super::run::Run;
use super::summary::Summary;

/// The rows end before the test did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MissingEnd {
    /// Source that shows that the test went further.
    pub told_by: ToldBy,
    /// How far it went at least: test time, s.
    pub until_s: f64,
    /// Test time of the last row, s; none without a row.
    pub ends_s: Option<f64>,
    /// Steps that are missing at least; of rows that could not be written, rows.
    pub missing: u64,
}

/// Source that shows that a test went further than its rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToldBy {
    /// The summary, with this number of steps.
    Summary(u64),
    /// Without one, an event of a later step.
    Events,
    /// Without a summary, while test time was held: the writer, which had taken rows that the file lacks.
    Writer,
}

impl MissingEnd {
    /// The missing end of a run whose last row has this test time. `None` if nothing is missing, or if that cannot be known: a
    /// served specimen counts commands and no steps. Without a summary the last row of the file counts.
    #[must_use]
    pub fn of(run: &Run, ends_s: Option<f64>) -> Option<Self> {
        if run.layout().is_served() {
            return None;
        }
        match run.summary() {
            Some(summary) => Self::of_test(summary, ends_s),
            None => Self::of_unfinished(run),
        }
    }

    fn of_test(summary: &Summary, ends_s: Option<f64>) -> Option<Self> {
        let until_s = summary.steps as f64 * summary.dt;
        let is_there = ends_s.map_or(summary.steps == 0, |ends| {
            ends + 0.5 * summary.dt >= until_s
        });
        let left = ends_s.map_or(f64::INFINITY, |ends| (until_s - ends) / summary.dt);
        (!is_there).then_some(Self {
            told_by: ToldBy::Summary(summary.steps),
            until_s,
            ends_s,
            // The step at t = 0 is one more.
            missing: (left.round() as u64).min(summary.steps + 1),
        })
    }

    fn of_unfinished(run: &Run) -> Option<Self> {
        // Before the rows: the test may still be running.
        let mut told = Told::default();
        for event in run.event_lines().ok()? {
            told.take(event.ok()?.as_ref());
        }
        let last = run.last_row().ok()?;
        if last.is_none() && run.rows_made().ok()? > 0 {
            // The reader of the rows reports the damage.
            return None;
        }
        let place = run.layout().index_of("time")?;
        let last = last.and_then(|(number, row)| Some((number, *row.get(place)?)));
        told.missing(last)
    }

    /// The missing end of a run, by the last whole row of its file; none if nothing is missing, or if that cannot be known.
    #[must_use]
    pub fn of_run(run: &Run) -> Option<Self> {
        let place = run.layout().index_of("time")?;
        let last = run.last_row().ok()?;
        let time = match &last {
            Some((_, row)) => Some(*row.get(place)?),
            None => None,
        };
        Self::of(run, time)
    }
}

/// The end of a test according to its events, which are read one after the other.
#[derive(Debug, Default)]
struct Told {
    /// Test time of the first phase, s. A resumed test begins there, which the rows of its startup do not show.
    begins_s: Option<f64>,
    /// Test time and tick of the latest event.
    latest: Option<(f64, f64)>,
    /// The note on unwritten rows with the most rows: its test time, and the rows that the writer had taken.
    unwritten: Option<(f64, u64)>,
}

impl Told {
    fn take(&mut self, line: Option<&EventLine>) {
        let Some(line) = line else {
            return;
        };
        let (time, taken) = (line.time, line.tick);
        if matches!(line.event, Event::Phase { .. }) && self.begins_s.is_none() {
            self.begins_s = Some(time.unwrap_or(0.0));
        }
        if let (Some(time), Some(tick)) = (time, taken.map(|tick| tick as f64))
            && time / tick > 0.0
            && self.latest.is_none_or(|(latest, _)| time >= latest)
        {
            self.latest = Some((time, tick));
        }
        // Notes of the writer carry the number of the last row that it took.
        let is_unwritten = matches!(
            line.event,
            Event::WriteFailed { .. } | Event::RowsLost { .. }
        );
        if let (true, Some(time), Some(taken)) = (is_unwritten, time, taken) {
            let before = self.unwritten.filter(|(_, rows)| *rows > taken + 1);
            self.unwritten = before.or(Some((time, taken + 1)));
        }
    }

    /// `last`: number and test time of the last row.
    fn missing(&self, last: Option<(u64, f64)>) -> Option<MissingEnd> {
        let ends_s = last.map(|(_, time)| time);
        let begins = self.begins_s.unwrap_or(0.0);
        let ends = ends_s.map_or(begins, |ends| ends.max(begins));
        let later = self.latest.and_then(|(time, tick)| {
            let missing = ((time - ends) / (time / tick)).round();
            (missing > 1.0).then_some((time, missing as u64))
        });
        let rows = last.map_or(0, |(number, _)| number + 1);
        let unwritten = self.unwritten.and_then(|(time, taken)| {
            let missing = taken.saturating_sub(rows);
            (missing > 0).then_some((time, missing))
        });
        let (told_by, (until_s, missing)) = match later {
            Some(later) => (ToldBy::Events, later),
            None => (ToldBy::Writer, unwritten?),
        };
        Some(MissingEnd {
            told_by,
            until_s,
            ends_s,
            missing,
        })
    }
}

impl std::fmt::Display for MissingEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            until_s, missing, ..
        } = self;
        match self.told_by {
            ToldBy::Summary(steps) => {
                write!(f, "the summary has {steps} steps, {until_s} s, but ")?;
            }
            ToldBy::Events => write!(f, "there are events up to {until_s} s, but ")?,
            ToldBy::Writer => write!(
                f,
                "there are events of {missing} rows more that could not be written, up to {until_s} s, and "
            )?,
        }
        match self.ends_s {
            Some(ends) => write!(f, "the rows end at {ends} s"),
            None => write!(f, "there is no row"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summary::tests::example;
    use serde_json::{Value, json};

    #[test]
    fn rows_ending_a_step_early_are_reported() {
        let summary = Summary {
            steps: 100,
            dt: 0.01,
            ..example()
        };
        let missing = |ends| MissingEnd::of_test(&summary, ends).map(|end| end.missing);
        assert_eq!(missing(Some(1.0)), None);
        assert_eq!(missing(Some(1.2)), None, "it was left slowly");
        assert_eq!(missing(Some(0.99)), Some(1));
        assert_eq!(missing(Some(0.25)), Some(75));
        assert_eq!(missing(None), Some(101));
        let words = MissingEnd::of_test(&summary, Some(0.25))
            .unwrap()
            .to_string();
        assert!(
            words.contains("100 steps") && words.contains("0.25 s"),
            "{words}"
        );
        let nothing = Summary {
            steps: 0,
            ..summary
        };
        assert_eq!(
            MissingEnd::of_test(&nothing, None),
            None,
            "nothing was moved"
        );
    }

    fn of_events(told: &[EventLine], last: Option<(u64, f64)>) -> Option<MissingEnd> {
        let mut all = Told::default();
        told.iter().for_each(|event| all.take(Some(event)));
        all.missing(last)
    }

    /// A line of this name with the fields of every event that is needed here.
    fn line(tick: Value, time: Value, name: &str) -> EventLine {
        EventLine::from(json!({
            "tick": tick, "time": time, "event": name, "from": "armed", "to": "running", "cause": "done", "digest": "0", "error": "full",
            "file": "samples.bin", "rows_lost": 1, "text": "a warning", "limit": "delay_used"
        }))
    }

    fn loop_event(step: u64, name: &str) -> EventLine {
        line(json!(step), json!(step as f64 * 0.01), name)
    }

    #[test]
    fn events_ahead_of_rows_show_missing_rows() {
        let begins = loop_event(0, "phase");
        let missing = |more: &[EventLine], last| {
            let told: Vec<EventLine> = [&begins].into_iter().chain(more).cloned().collect();
            of_events(&told, last)
        };
        let at = |step: u64| Some((step + 20, step as f64 * 0.01));
        let told = [loop_event(99, "checkpoint"), loop_event(101, "ended")];
        assert_eq!(missing(&[], None), None);
        assert_eq!(missing(&told, at(101)), None);
        // An event of a tick is made before its row.
        assert_eq!(missing(&told, at(100)), None);
        let found = missing(&told, at(90)).unwrap();
        assert_eq!((found.told_by, found.missing), (ToldBy::Events, 11));
        let words = found.to_string();
        assert!(
            words.contains("1.01 s") && words.contains("0.9 s"),
            "{words}"
        );
        assert_eq!(missing(&told, None).unwrap().missing, 101);
        // Lines without a time or a tick of a test prove nothing.
        let mute = [
            line(Value::Null, Value::Null, "files"),
            line(json!(0), json!(0.0), "grid"),
            EventLine::from(json!({"event": "torn"})),
        ];
        assert_eq!(missing(&mute, at(0)), None);
    }

    #[test]
    fn unwritten_rows_in_a_hold_are_reported() {
        let held = |row: u64, name: &str| line(json!(row), json!(3.0), name);
        let failed = [held(700, "write_failed"), held(900, "rows_lost")];
        let missing = |last| of_events(&failed, Some((last, 3.0)));
        let found = missing(650).unwrap();
        assert_eq!((found.told_by, found.missing), (ToldBy::Writer, 250));
        assert!(found.to_string().contains("250 rows more"), "{found}");
        assert_eq!(missing(900), None, "what was lost lies between rows");
        let other = [held(900, "warning")];
        assert_eq!(of_events(&other, Some((650, 3.0))), None);
    }

    #[test]
    fn resumed_test_misses_nothing_at_startup() {
        let told = [
            loop_event(300, "phase"),
            loop_event(300, "started"),
            loop_event(301, "limit_warning"),
        ];
        for last in [None, Some((12, 0.0)), Some((40, 3.0))] {
            assert_eq!(of_events(&told, last), None);
        }
        let later = [&told[..], &[loop_event(302, "ended")]].concat();
        assert!(of_events(&later, Some((12, 0.0))).is_some());
    }
}
