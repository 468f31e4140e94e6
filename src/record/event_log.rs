//! The events on their way to `events.jsonl` and the log.
//!
//! A miss carries its `class` and the evidence for it ([`super::miss`]). It waits for the next sample of the scheduler's counters,
//! at most 0.2 s. Later events wait behind it, so that the order is kept.

use std::collections::{HashMap, VecDeque};

use crossbeam_channel::Receiver;

use super::TimedEvent;
use super::append::{Appender, Flushed, Store, Unit};
use super::events::{Event, EventLine};
use super::miss::{MissClasses, SampleWindow, classify};
use super::note::{Note, Position};
use super::warned::Warned;
use crate::rt::sampler::SchedSample;
use gusset_quantity::catalog::event::Severity;

/// One moment as the writer's two clocks show it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Moment {
    /// CLOCK_MONOTONIC in ns: the loop's clock, when that is real.
    pub monotonic_ns: u64,
    /// UTC in ns since 1970.
    pub utc_ns: u64,
}

/// Bytes of lines that may wait for a failing file.
const BOUND: usize = 1 << 20;
/// Events that may wait for a sample; beyond, they go without.
const QUEUE: usize = 16_384;
/// Longest wait of a miss for the sample after it.
const HOLD_NS: u64 = 200_000_000;

/// Lines of the log for one kind of frequent event; `events.jsonl` has all of them.
const LOUD: u32 = 5;

enum Entry {
    Loop(TimedEvent),
    Note(Note, Position),
}

struct Held {
    entry: Entry,
    wall_ns: u64,
    clock_ns: u64,
    seen_ns: u64,
}

/// The events on their way into the file.
pub(super) struct EventLog<S> {
    pub lines: Appender<S>,
    queue: VecDeque<Held>,
    window: SampleWindow,
    sampler: Option<Receiver<SchedSample>>,
    real_clock: bool,
    tick_ns: u64,
    specimens: Vec<String>,
    /// Deadline misses so far by class.
    pub classes: MissClasses,
    warned: Warned,
    /// Frequent events so far, by name.
    logged: HashMap<&'static str, u32>,
    /// Lines made so far, lost ones included.
    pub taken: u64,
    /// Lines that found no room.
    pub lost: u64,
    scratch: Vec<u8>,
}

/// Facts of the test that the log needs.
#[derive(Debug, Default)]
pub(super) struct EventContext {
    pub sampler: Option<Receiver<SchedSample>>,
    pub real_clock: bool,
    pub tick_ns: u64,
    pub specimens: Vec<String>,
}

impl<S: Store> EventLog<S> {
    pub(crate) fn new(store: S, context: EventContext) -> Self {
        Self {
            lines: Appender::new(store, Unit::Line, BOUND),
            queue: VecDeque::new(),
            window: SampleWindow::default(),
            sampler: context.sampler,
            real_clock: context.real_clock,
            tick_ns: context.tick_ns,
            specimens: context.specimens,
            classes: MissClasses::default(),
            warned: Warned::default(),
            logged: HashMap::new(),
            taken: 0,
            lost: 0,
            scratch: Vec::with_capacity(512),
        }
    }

    /// Takes an event of the loop.
    pub(crate) fn event(&mut self, event: TimedEvent, now: Moment) {
        // Under the real clock the event is older than its arrival here, by as much as the clock says.
        let age = if self.real_clock {
            now.monotonic_ns.saturating_sub(event.clock_ns)
        } else {
            0
        };
        self.queue.push_back(Held {
            wall_ns: now.utc_ns.saturating_sub(age),
            clock_ns: event.clock_ns,
            seen_ns: now.monotonic_ns,
            entry: Entry::Loop(event),
        });
    }

    /// Takes a note, of the test at `position` unless it knows better; the simulated clock is not known here, so its `clock_ns`
    /// is null then.
    pub(crate) fn note(&mut self, note: Note, position: Position, now: Moment) {
        let (position, clock_ns) = note.made.unwrap_or((position, now.monotonic_ns));
        let age = now.monotonic_ns.saturating_sub(clock_ns);
        self.queue.push_back(Held {
            wall_ns: now.utc_ns.saturating_sub(age),
            clock_ns,
            seen_ns: now.monotonic_ns,
            entry: Entry::Note(note, position),
        });
    }

    /// True if anything is to be turned into lines.
    pub(crate) fn is_waiting(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Turns what is ripe into lines and writes them.
    pub(crate) fn turn(&mut self, now: Moment) -> Flushed {
        self.take_samples();
        while self
            .queue
            .front()
            .is_some_and(|held| self.is_ripe(held, now))
        {
            self.release_one();
        }
        self.lines.flush(now.monotonic_ns)
    }

    /// Turns everything into lines and writes them. A last attempt that fails loses what waits.
    pub(crate) fn finish(&mut self, now: Moment) -> Flushed {
        self.take_samples();
        while self.release_one() {}
        self.lines.flush_at_once(now.monotonic_ns)
    }

    fn take_samples(&mut self) {
        if let Some(sampler) = &self.sampler {
            for sample in sampler.try_iter() {
                self.window.push(sample);
            }
        }
    }

    fn is_ripe(&self, held: &Held, now: Moment) -> bool {
        let waits = matches!(
            held.entry,
            Entry::Loop(TimedEvent {
                kind: Event::Miss { .. },
                ..
            })
        ) && self.sampler.is_some();
        !waits
            || self.window.reaches(held.clock_ns)
            || now.monotonic_ns.saturating_sub(held.seen_ns) >= HOLD_NS
            || self.queue.len() > QUEUE
    }

    fn release_one(&mut self) -> bool {
        let Some(held) = self.queue.pop_front() else {
            return false;
        };
        let (event, position, clock_ns, severity) = match held.entry {
            Entry::Loop(event) => {
                let position = (Some(event.tick), Some(event.time));
                let kind = self.classified(event.kind, held.clock_ns);
                (kind, position, Some(held.clock_ns), None)
            }
            Entry::Note(note, Position { tick, time }) => {
                let clock_ns = self.real_clock.then_some(held.clock_ns);
                let severity = note.severity;
                (note.event, (tick, time), clock_ns, severity)
            }
        };
        let line = EventLine::new(event, position, held.wall_ns, clock_ns, &self.specimens);
        self.warned.count(&line);
        self.show(&line, severity.unwrap_or_else(|| line.severity()));
        let line = line.to_map();
        self.scratch.clear();
        // Writing a map of plain values to memory cannot fail; a line without its end would be dropped.
        let made = serde_json::to_writer(&mut self.scratch, &line).is_ok();
        self.scratch.push(b'\n');
        let bytes = &self.scratch;
        let kept = made
            && self
                .lines
                .offer(bytes.len(), |out| out.extend_from_slice(bytes));
        self.taken += 1;
        self.lost += u64::from(!kept);
        true
    }

    /// A miss with its class by the counters of the system; every other event unchanged.
    fn classified(&mut self, event: Event, clock_ns: u64) -> Event {
        let Event::Miss {
            class,
            late_ns,
            stretched,
            ..
        } = event
        else {
            return event;
        };
        // The miss began at the latest one tick before its deadline: in the tick that ended late.
        let from = clock_ns.saturating_sub(late_ns.saturating_add(self.tick_ns));
        let evidence = self.window.evidence(from, clock_ns);
        let class = classify(class, evidence, late_ns);
        self.classes.count(class);
        Event::Miss {
            class,
            late_ns,
            stretched,
            evidence,
        }
    }

    /// Writes the sentence of an event to the log, with the test time once the test runs. Of a frequent event only the first few
    /// are shown.
    fn show(&mut self, line: &EventLine, severity: Severity) {
        if let Some(row) = line.row().filter(|row| row.is_frequent) {
            let count = self.logged.entry(row.name).or_default();
            *count = count.saturating_add(1);
            if *count == LOUD + 1 {
                tracing::warn!(
                    "no more events \"{}\" are shown; events.jsonl of a run folder has all of them",
                    row.name.replace('_', " ")
                );
            }
            if *count > LOUD {
                return;
            }
        }
        let sentence = line.sentence();
        if sentence.is_empty() {
            return;
        }
        let at = match line.time {
            Some(time) if time.is_finite() && time != 0.0 => format!("t = {time:.4} s: "),
            _ => String::new(),
        };
        match severity {
            Severity::Debug => tracing::debug!("{at}{sentence}"),
            Severity::Info => tracing::info!("{at}{sentence}"),
            Severity::Warning => tracing::warn!("{at}{sentence}"),
            Severity::Error => tracing::error!("{at}{sentence}"),
        }
    }

    /// Limits that were warned of so far, in sentences.
    pub(crate) fn warned(&self) -> Vec<String> {
        self.warned.sentences(&self.specimens)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MissCause;
    use gusset_quantity::substructure::LinkFault;
    use serde_json::{Value, json};

    const SECOND: u64 = 1_000_000_000;

    fn moment(monotonic_ns: u64) -> Moment {
        Moment {
            monotonic_ns,
            utc_ns: 1_772_366_400 * SECOND + monotonic_ns,
        }
    }

    fn event(tick: u64, clock_ns: u64, kind: Event) -> TimedEvent {
        TimedEvent {
            tick,
            time: tick as f64 / 1024.0,
            clock_ns,
            kind,
        }
    }

    const MISS: Event = Event::Miss {
        class: MissCause::TakenAway,
        late_ns: 5_000_000,
        stretched: 2,
        evidence: None,
    };

    fn context(sampler: Option<Receiver<SchedSample>>) -> EventContext {
        EventContext {
            sampler,
            real_clock: true,
            tick_ns: 1_000_000,
            specimens: vec!["brace".to_owned()],
        }
    }

    fn lines(log: &EventLog<Vec<u8>>) -> Vec<Value> {
        let text = std::str::from_utf8(&log.lines.store).unwrap();
        text.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    }

    #[test]
    fn every_kind_is_one_line_with_common_keys() {
        let mut log = EventLog::new(Vec::new(), context(None));
        let kinds = [
            Event::Started,
            Event::Ended,
            MISS,
            Event::Stale { port: 0, age: 3 },
            Event::Recovered {
                port: 0,
                axis: 1,
                age: 3,
                force: 2.5,
            },
            Event::link_lost(1, LinkFault::Timeout),
            Event::RowLost,
            Event::Diverged { dof: 4 },
            Event::StopRequested,
        ];
        for (k, kind) in kinds.into_iter().enumerate() {
            log.event(event(1024 * k as u64, 7, kind), moment(SECOND + 7));
        }
        log.turn(moment(SECOND + 7));
        let lines = lines(&log);
        let names: Vec<_> = lines.iter().map(|l| l["event"].as_str().unwrap()).collect();
        assert_eq!(
            names,
            [
                "started",
                "ended",
                "miss",
                "stale",
                "recovered",
                "link",
                "row_lost",
                "diverged",
                "stop_requested"
            ]
        );
        for (k, line) in lines.iter().enumerate() {
            assert_eq!(line["tick"], 1024 * k);
            assert_eq!(line["time"], k as f64);
            // A second old when it arrived: that second is taken off.
            assert_eq!(line["wall"], "2026-03-01T12:00:00.000000007Z");
            assert_eq!(line["clock_ns"], 7);
        }
        assert_eq!(lines[2]["class"], "unknown");
        assert_eq!(
            (&lines[2]["late_ns"], &lines[2]["stretched"]),
            (&5_000_000.into(), &2.into())
        );
        assert_eq!(
            (&lines[3]["specimen"], &lines[3]["name"], &lines[3]["age"]),
            (&1.into(), &"brace".into(), &3.into())
        );
        assert_eq!(
            (&lines[4]["axis"], &lines[4]["force"]),
            (&2.into(), &2.5.into())
        );
        assert_eq!(
            (&lines[5]["specimen"], &lines[5]["fault"]),
            (&2.into(), &"timeout".into())
        );
        assert_eq!(lines[7]["dof"], 5);
    }

    #[test]
    fn miss_waits_for_the_sample_after_it() {
        let (send, sampler) = crossbeam_channel::unbounded();
        let mut log = EventLog::new(Vec::new(), context(Some(sampler)));
        let at = 50_000_000;
        let sample = |clock_ns, involuntary_switches, steal_ticks| SchedSample {
            clock_ns,
            involuntary_switches,
            steal_ticks,
            ..SchedSample::default()
        };
        send.send(sample(at - 9_000_000, 3, 10)).unwrap();
        log.event(event(1, at, MISS), moment(at + 1));
        log.event(event(2, at + 2, Event::Started), moment(at + 2));
        log.turn(moment(at + 3));
        assert_eq!(lines(&log).len(), 0);
        send.send(sample(at + 1_000_000, 4, 12)).unwrap();
        log.turn(moment(at + 1_000_001));
        let lines = lines(&log);
        assert_eq!(lines.len(), 2);
        assert_eq!(
            (&lines[0]["event"], &lines[0]["class"]),
            (&"miss".into(), &"preempted".into())
        );
        assert_eq!(
            (&lines[0]["steal_ms"], &lines[0]["involuntary_switches"]),
            (&20.into(), &1.into())
        );
        assert_eq!(lines[1]["event"], "started");
        assert_eq!((log.classes.preempted, log.classes.total()), (1, 1));
    }

    #[test]
    fn silent_sampler_delays_a_miss_by_200_ms() {
        let (_send, sampler) = crossbeam_channel::unbounded();
        let mut log = EventLog::new(Vec::new(), context(Some(sampler)));
        log.event(event(1, 5, MISS), moment(10));
        log.turn(moment(10 + HOLD_NS - 1));
        assert_eq!(lines(&log).len(), 0);
        log.turn(moment(10 + HOLD_NS));
        assert_eq!(lines(&log)[0]["class"], "unknown");
        assert_eq!(lines(&log)[0].get("steal_ms"), None);
        // At the end nothing waits.
        log.event(event(2, 5 + HOLD_NS, MISS), moment(11 + HOLD_NS));
        log.finish(moment(11 + HOLD_NS));
        assert_eq!(lines(&log).len(), 2);
    }

    #[test]
    fn note_cannot_forge_the_keys_of_its_line() {
        let mut log = EventLog::new(Vec::new(), context(None));
        let fields = json!({"asked": "fifo 80\n", "tick": 99});
        let note = Note::new(Event::Other {
            event: "realtime_refused".to_owned(),
            fields: fields.as_object().unwrap().clone(),
        });
        let position = Position {
            tick: Some(7),
            time: Some(f64::NAN),
        };
        log.note(note, position, moment(1));
        log.turn(moment(2));
        let lines = lines(&log);
        assert_eq!(
            (&lines[0]["tick"], &lines[0]["time"]),
            (&7.into(), &Value::Null)
        );
        assert_eq!(
            (&lines[0]["event"], &lines[0]["asked"]),
            (&"realtime_refused".into(), &"fifo 80\n".into())
        );
    }
}
