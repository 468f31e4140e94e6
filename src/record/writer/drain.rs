//! The work of the writer, turn by turn, with time as an argument: no thread and no clock.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use crossbeam_channel::Receiver;

use super::snapshots::{Kept, Snapshots};
use super::sync::SyncThread;
use super::{Progress, Recorded, WriterSettings, lock};
use crate::TimedEvent;
use crate::append::{Flushed, Store};
use crate::event_log::{EventContext, EventLog, Moment};
use crate::events::Event;
use crate::intact::Extent;
use crate::journal::JournalWriter;
use crate::note::{Note, Position};
use crate::onlooker::{Onlooker, Watched};
use crate::ring::RingReader;
use crate::rt::sampler::SchedSample;

/// Bytes of rows that are written without waiting for the time to do so.
pub(super) const CHUNK: usize = 256 << 10;
/// Events and notes taken in one turn.
const PER_TURN: usize = 8192;
/// Files that it writes.
const FILES: [&str; 2] = ["samples.bin", "events.jsonl"];
/// Pause between two shouts about lost rows.
const SHOUT_NS: u64 = 1_000_000_000;

/// The work of the thread, turn by turn, with time as an argument.
pub(super) struct Drain<S, E> {
    ring: RingReader,
    journal: JournalWriter<S>,
    events: EventLog<E>,
    notes: Receiver<Note>,
    settings: WriterSettings,
    pub(super) sync: Option<SyncThread>,
    pub(super) snapshots: Option<Snapshots>,
    pub(super) progress: Arc<Mutex<Progress>>,
    pub(super) onlooker: Watched,
    last_row: Vec<f64>,
    position: Position,
    lost_file: u64,
    flushed_ns: u64,
    pub(super) synced_ns: u64,
    synced_bytes: u64,
    shouted: Option<(u64, u64)>,
    meddled: [bool; FILES.len()],
    first_error: Option<String>,
}

impl<S: Store, E: Store> Drain<S, E> {
    pub(super) fn new(
        ring: RingReader,
        samples: S,
        events: E,
        sampler: Option<Receiver<SchedSample>>,
        notes: Receiver<Note>,
        settings: WriterSettings,
    ) -> Self {
        let columns = ring.columns();
        let context = EventContext {
            sampler,
            real_clock: settings.real_clock,
            tick_ns: settings.tick_ns,
            specimens: settings.specimens.clone(),
        };
        Self {
            journal: JournalWriter::new(samples, columns, settings.waiting_bytes.max(2 * CHUNK)),
            events: EventLog::new(events, context),
            ring,
            notes,
            settings,
            sync: None,
            snapshots: None,
            progress: Arc::default(),
            onlooker: Watched::default(),
            last_row: Vec::with_capacity(columns),
            position: Position::default(),
            lost_file: 0,
            flushed_ns: 0,
            synced_ns: 0,
            synced_bytes: 0,
            shouted: None,
            meddled: Default::default(),
            first_error: None,
        }
    }

    /// The event of a checkpoint gets the SHA-256 of its state.
    fn with_checksum(&mut self, mut event: TimedEvent) -> TimedEvent {
        if let (Event::Checkpoint { sha256, .. }, Some(snapshots)) =
            (&mut event.kind, &mut self.snapshots)
        {
            *sha256 = snapshots.checksum_of(event.tick);
        }
        event
    }

    /// Takes what waits and passes it on; true if the ring was so full that the next turn should follow at once.
    pub(super) fn turn(&mut self, now: Moment) -> bool {
        // Counted before the rows: those that were there before an event are then surely taken before it.
        let events = self.ring.events_waiting().min(PER_TURN);
        let waiting = self.ring.waiting();
        self.take_rows(waiting, now);
        // A note that was sent before an event precedes it: set-up is reported before the loop that it leads to.
        for note in self.notes.try_iter().take(PER_TURN) {
            self.events.note(note, self.position, now);
        }
        for _ in 0..events {
            let Some(event) = self.ring.event() else {
                break;
            };
            let event = self.with_checksum(event);
            let note = self.onlooker.show(|onlooker| onlooker.event(&event));
            self.events.event(event, now);
            if let Some(note) = note {
                self.events.note(note, self.position, now);
            }
        }
        let since = now.monotonic_ns.saturating_sub(self.flushed_ns);
        // An event reaches its file only after the rows that precede it. An event without them shows that they are
        // lost.
        let is_behind = self.events.is_waiting() && self.journal.file.waiting_units() > 0;
        if since >= nanos(self.settings.flush_every) || is_behind {
            self.flush_rows(now);
        }
        self.shout_losses(now, false);
        let flushed = self.events.turn(now);
        self.heed("events.jsonl", flushed, now);
        self.ask_for_sync(now);
        self.publish();
        self.show(now, |onlooker, progress| {
            onlooker.turn(now.monotonic_ns, progress);
        });
        waiting * 4 >= self.ring.capacity()
    }

    /// The last turn: nothing waits for anything any more.
    pub(super) fn finish(mut self, now: Moment) -> Recorded {
        self.turn(now);
        let flushed = self.journal.file.flush_at_once(now.monotonic_ns);
        self.heed("samples.bin", flushed, now);
        self.lost_file += self.journal.file.waiting_units();
        self.shout_losses(now, true);
        self.publish();
        self.show(now, |onlooker, progress| {
            onlooker.finish(now.monotonic_ns, progress);
        });
        let flushed = self.events.finish(now);
        self.heed("events.jsonl", flushed, now);
        let snapshots = self.snapshots.take();
        let states = snapshots.map_or_else(Kept::default, Snapshots::finish);
        self.first_error = self.first_error.take().or(states.first_error);
        let sync = self.sync.take();
        let sync_failures = sync.map_or(0, |sync| sync.finish());
        self.publish();
        let unwritten = self.events.lines.waiting_units();
        let extents = FILES.into_iter().zip(self.extents());
        let extents = extents.filter_map(|(file, extent)| Some((file, extent?)));
        Recorded {
            rows_written: self.journal.rows(),
            rows_lost_queue: self.ring.lost().rows(),
            rows_lost_file: self.lost_file,
            states_written: states.written,
            states_skipped: self.ring.states_skipped() + states.refused,
            events_written: self.events.taken - self.events.lost - unwritten,
            events_lost: self.events.lost + unwritten + self.ring.lost().events(),
            misses: self.events.classes,
            warned: self.events.warned(),
            sync_failures,
            first_error: self.first_error,
            files: extents.collect(),
            damaged: Vec::new(),
        }
    }

    fn take_rows(&mut self, count: usize, now: Moment) {
        for _ in 0..count {
            let Some((sequence, row)) = self.ring.row() else {
                break;
            };
            if let Some(note) = self.onlooker.show(|onlooker| onlooker.row(sequence, row)) {
                self.events.note(note, self.position, now);
            }
            self.lost_file += u64::from(!self.journal.row(sequence, row));
            self.last_row.clear();
            self.last_row.extend_from_slice(row);
            let at = |place: Option<usize>| place.and_then(|place| row.get(place)).copied();
            self.position = Position {
                tick: at(self.settings.step_column)
                    .filter(|step| *step >= 0.0)
                    .map(|step| step as u64),
                time: at(self.settings.time_column),
            };
            if self.journal.file.waiting() >= CHUNK {
                self.flush_rows(now);
            }
        }
    }

    fn flush_rows(&mut self, now: Moment) {
        self.flushed_ns = now.monotonic_ns;
        let flushed = self.journal.file.flush(now.monotonic_ns);
        self.heed("samples.bin", flushed, now);
    }

    fn heed(&mut self, file: &'static str, flushed: Flushed, now: Moment) {
        let event = match flushed {
            Flushed::Clean | Flushed::Failing => return,
            Flushed::Failed(error) => {
                let text = format!("{file}: {error}");
                self.first_error.get_or_insert(text);
                Event::WriteFailed {
                    error: error.to_string(),
                    file: file.into(),
                    rows_lost: self.rows_lost(),
                }
            }
            Flushed::Recovered => Event::WriteRecovered {
                file: file.into(),
                rows_lost: self.rows_lost(),
            },
        };
        self.events.note(event.into(), self.position, now);
    }

    pub(super) fn rows_lost(&self) -> u64 {
        self.ring.lost().rows() + self.lost_file
    }

    /// Reports lost rows: at once the first time, then once a second while the loss continues, and at the end.
    fn shout_losses(&mut self, now: Moment, at_once: bool) {
        let lost = self.rows_lost();
        let due = match self.shouted {
            None => lost > 0,
            Some((told, at)) => {
                lost > told && (at_once || now.monotonic_ns.saturating_sub(at) >= SHOUT_NS)
            }
        };
        if due {
            self.shouted = Some((lost, now.monotonic_ns));
            let event = Event::RowsLost {
                rows_lost: lost,
                to_full_queue: self.ring.lost().rows(),
                to_file_error: self.lost_file,
            };
            self.events.note(event.into(), self.position, now);
        }
    }

    fn extents(&self) -> [Option<Extent>; FILES.len()] {
        [self.journal.file.extent(), self.events.lines.extent()]
    }

    /// Says what others did to the files, once of each.
    fn look_over(&mut self, now: Moment) {
        let each = FILES.into_iter().zip(self.extents());
        for ((file, extent), told) in each.zip(&mut self.meddled) {
            let meddled = extent.and_then(|extent| extent.meddled());
            if let Some(meddled) = meddled.filter(|_| !*told) {
                *told = true;
                let event = Event::RecordDamaged {
                    file: file.into(),
                    text: format!("{file} {meddled}"),
                };
                self.events.note(event.into(), self.position, now);
            }
        }
    }

    fn ask_for_sync(&mut self, now: Moment) {
        let bytes = self.journal.file.length + self.events.lines.length;
        let since = now.monotonic_ns.saturating_sub(self.synced_ns);
        if bytes != self.synced_bytes && since >= nanos(self.settings.sync_every) {
            self.look_over(now);
            if let Some(sync) = &self.sync {
                sync.ask();
            }
            (self.synced_ns, self.synced_bytes) = (now.monotonic_ns, bytes);
        }
    }

    /// Shows the progress of the run to the observer, and takes its notes.
    fn show(&mut self, now: Moment, look: impl FnOnce(&mut dyn Onlooker, &Progress)) {
        if !self.onlooker.is_watched() {
            return;
        }
        let mut notes = Vec::new();
        let seen = {
            let progress = lock(&self.progress);
            self.onlooker.show(|onlooker| {
                look(onlooker, &progress);
                notes.extend(std::iter::from_fn(|| onlooker.note()).take(PER_TURN));
            })
        };
        for note in notes.into_iter().chain(seen) {
            self.events.note(note, self.position, now);
        }
    }

    fn publish(&self) {
        let mut progress = lock(&self.progress);
        progress.last_row.clone_from(&self.last_row);
        progress.rows_written = self.journal.rows();
        progress.rows_lost = self.rows_lost();
        progress.events = self.events.taken;
        progress.misses = self.events.classes;
    }
}

fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
