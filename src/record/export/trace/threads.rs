//! The lines of all threads but the loop's, from `threads.bin`.

use std::collections::BTreeMap;
use std::io::Read;

use serde_json::{Value, json};

use super::{EVENTS, OTHERS, instant, slice};
use crate::record::FolderError;
use crate::record::export::Notice;
use crate::record::run::Run;
use crate::record::summary::ClockKind;
use crate::record::threads::{Stamp, ThreadEnd, ThreadReader, ThreadRecord};

/// Name of the loop's thread, which leaves no stamps.
const LOOPS_NAME: &str = "gusset-loop";

/// Why only the loop is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnlyLoop {
    /// The run had no part in the time of the wall.
    Simulated,
    /// There is no such file.
    NotRecorded,
    /// The system does not let it be read.
    Unreadable(std::io::ErrorKind),
    /// Nothing says when the grid began.
    Unplaced,
}

impl std::fmt::Display for OnlyLoop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Simulated => write!(
                f,
                "the run was on the simulated clock, on which the wall time of other threads means nothing"
            ),
            Self::NotRecorded => write!(f, "the run has no threads.bin"),
            Self::Unreadable(kind) => write!(f, "threads.bin cannot be read: {kind}"),
            Self::Unplaced => write!(
                f,
                "nothing in events.jsonl says when the ticks began on the clock of the threads"
            ),
        }
    }
}

/// What other threads did round the window.
#[derive(Default)]
pub(super) struct Threads {
    /// Number in the file → name and number in /proc.
    named: BTreeMap<u8, (String, u32)>,
    /// In order of their begin, the outer before the inner.
    stamps: Vec<Stamp>,
    /// When, and how many.
    lost: Vec<(u64, u64)>,
    missing: Option<OnlyLoop>,
    end: Option<ThreadEnd>,
    origin_us: f64,
}

impl Threads {
    /// Those whose stamps reach into `reach`, µs from zero, which was at `origin_us` on the clock.
    pub fn read(run: &Run, origin_us: Option<f64>, reach: (f64, f64)) -> Self {
        let without = |missing| Self {
            missing: Some(missing),
            ..Self::default()
        };
        let simulated = run.summary().map(|summary| summary.clock) == Some(ClockKind::Simulated);
        let reader = match run.threads() {
            _ if simulated => return without(OnlyLoop::Simulated),
            Ok(Some(reader)) => reader,
            Ok(None) => return without(OnlyLoop::NotRecorded),
            Err(error) => return without(OnlyLoop::Unreadable(kind_of(&error))),
        };
        let mut threads = Self {
            origin_us: origin_us.unwrap_or_default(),
            missing: origin_us.is_none().then_some(OnlyLoop::Unplaced),
            ..Self::default()
        };
        if let Err(error) = threads.take(reader, reach) {
            threads.missing = Some(OnlyLoop::Unreadable(error.kind()));
        }
        if threads.missing.is_some() {
            threads.stamps.clear();
        }
        threads
            .stamps
            .sort_by_key(|stamp| (stamp.begin_ns, std::cmp::Reverse(stamp.duration_ns)));
        threads
    }

    fn take(
        &mut self,
        mut reader: ThreadReader<impl Read>,
        (from, to): (f64, f64),
    ) -> std::io::Result<()> {
        // What took too long for one record stands in several, one right behind the other.
        let mut latest: BTreeMap<u8, Stamp> = BTreeMap::new();
        while let Some(record) = reader.next_record()? {
            match record {
                ThreadRecord::Name { thread, name, id } => {
                    self.named.insert(thread, (name, id));
                }
                ThreadRecord::Lost { at_ns, stamps } => self.lost.push((at_ns, stamps)),
                ThreadRecord::Stamp(stamp) => {
                    let before = latest.insert(stamp.thread, stamp);
                    let goes_on = before.filter(|before| {
                        before.what == stamp.what
                            && before.duration_ns >= u64::from(u32::MAX)
                            && before.begin_ns + before.duration_ns == stamp.begin_ns
                    });
                    match goes_on {
                        Some(before) => {
                            let whole = Stamp {
                                duration_ns: before.duration_ns + stamp.duration_ns,
                                ..before
                            };
                            latest.insert(stamp.thread, whole);
                        }
                        None => self.keep(before, (from, to)),
                    }
                }
            }
        }
        for stamp in latest.into_values() {
            self.keep(Some(stamp), (from, to));
        }
        self.end = reader.end();
        Ok(())
    }

    fn keep(&mut self, stamp: Option<Stamp>, (from, to): (f64, f64)) {
        if let Some(stamp) = stamp {
            let begin = self.us(stamp.begin_ns);
            let end = begin + stamp.duration_ns as f64 / 1e3;
            if begin <= to && end >= from {
                self.stamps.push(stamp);
            }
        }
    }

    fn us(&self, ns: u64) -> f64 {
        ns as f64 / 1e3 - self.origin_us
    }

    /// Why only the loop is shown, if it is.
    pub const fn missing(&self) -> Option<OnlyLoop> {
        self.missing
    }

    /// What the loop's line is called.
    pub fn name_of_loop(&self) -> String {
        let mut named = self.named.values();
        let own = named.find(|(name, _)| name == LOOPS_NAME);
        own.map_or_else(
            || "loop".to_owned(),
            |(name, id)| format!("loop ({name} {id})"),
        )
    }

    /// The lines of the others, and what they are called.
    pub fn lines(&self) -> impl Iterator<Item = (u16, String)> {
        let shown = self.missing.is_none();
        let others = self
            .named
            .iter()
            .filter(move |(_, (name, _))| shown && name != LOOPS_NAME);
        others.map(|(number, (name, id))| (OTHERS + u16::from(*number), format!("{name} {id}")))
    }

    /// What a reader should know.
    pub fn notices(&self) -> Vec<Notice> {
        let end = self.end.filter(|end| *end != ThreadEnd::Clean);
        let lost: u64 = self.lost.iter().map(|(_, stamps)| stamps).sum();
        self.missing
            .map(Notice::OnlyLoop)
            .into_iter()
            .chain(end.map(Notice::Threads))
            .chain((lost > 0).then_some(Notice::StampsLost(lost)))
            .collect()
    }

    /// Slices and moments, each with its place.
    pub fn shown(&self) -> Vec<(f64, Value)> {
        let slices = self.stamps.iter().map(|stamp| {
            // Before the first edge there is no time on the grid.
            let (begin, end) = (
                self.us(stamp.begin_ns),
                self.us(stamp.begin_ns + stamp.duration_ns),
            );
            let (from, to) = (begin.max(0.0), end.max(0.0));
            let line = OTHERS + u16::from(stamp.thread);
            let slice = slice(line, "thread", stamp.what.word(), from, to, args(stamp));
            (from, slice)
        });
        let lost = self.lost.iter().filter(|_| self.missing.is_none());
        let lost = lost.map(|(at, stamps)| {
            let at = self.us(*at).max(0.0);
            let args = json!({ "stamps": stamps });
            (
                at,
                instant(EVENTS, "thread", "stamps of threads lost", at, &args),
            )
        });
        slices.chain(lost).collect()
    }
}

fn args(stamp: &Stamp) -> Value {
    let mut args = serde_json::Map::new();
    let unit = stamp.what.unit();
    if !unit.is_empty() {
        args.insert(unit.replace(' ', "_"), stamp.amount.into());
    }
    if stamp.pieces != 1 {
        args.insert("pieces".to_owned(), stamp.pieces.into());
    }
    if args.is_empty() {
        Value::Null
    } else {
        args.into()
    }
}

fn kind_of(error: &FolderError) -> std::io::ErrorKind {
    match error {
        FolderError::Io { source, .. } => source.kind(),
        _ => std::io::ErrorKind::Other,
    }
}
