//! The writer thread: rows from the ring to `samples.bin`, events to `events.jsonl` and the log, progress to the observer.
//!
//! * It polls the ring every 2 ms; only [`Writer::finish`] wakes it.
//! * What it has goes to the system at least every 20 ms, so a kill −9 costs the rows of the last 25 ms or so.
//! * Rows go before the events that came with them: an event that is ahead of the last row shows that rows are lost
//!   ([`super::MissingEnd`]).
//! * A second thread brings the files to the disk every 0.9 s, so that a sync that takes long holds up nothing but the
//!   next sync; with the time of flush and sync a power cut costs about the last second. A write may still be held up
//!   by the file system while it syncs; the ring covers that with four seconds ([`super::RingSize::for_rate`]).
//! * The state of a checkpoint gets its SHA-256 here. A third thread writes it (`state.bin`), because a sync may take long.
//! * Changes that others make to its files while it writes them are reported once for each file, at a sync.
//! * A file that refuses (disk full) does not end the test: rows wait in bounded memory and are offered again every
//!   100 ms. Rows without room are counted and reported. The file holds whole rows at all times.
//!
//! It does not pin itself: a thread inherits the processors of the one that spawns it. It reads no clock but the
//! two that it is given, and none of its decisions touches the loop.

mod drain;
mod snapshots;
mod sync;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender};
use thiserror::Error;

use drain::Drain;
use snapshots::Snapshots;
use sync::SyncThread;

pub use super::onlooker::Progress;

use super::append::Store;
use super::checkpoint::StateFolder;
use super::event_log::Moment;
use super::intact::Extent;
use super::miss::MissClasses;
use super::note::Note;
use super::onlooker::{Onlooker, Watched};
use super::ring::RingReader;
use crate::rt::pin_away;
use crate::rt::sampler::SchedSample;

/// The clocks that the writer reads.
#[derive(Debug, Clone, Copy)]
pub struct Clocks {
    /// CLOCK_MONOTONIC in ns, whatever clock the test runs on.
    pub monotonic_ns: fn() -> u64,
    /// UTC in ns since 1970.
    pub utc_ns: fn() -> u64,
}

impl Clocks {
    fn now(self) -> Moment {
        Moment {
            monotonic_ns: (self.monotonic_ns)(),
            utc_ns: (self.utc_ns)(),
        }
    }
}

/// How the writer works and what it must know of the test. The defaults are those of the module's text.
#[derive(Debug, Clone)]
pub struct WriterSettings {
    /// Pause between two looks at the ring.
    pub period: Duration,
    /// Longest time that a row waits before it is handed to the system.
    pub flush_every: Duration,
    /// Time between two syncs to disk.
    pub sync_every: Duration,
    /// Bytes of rows that may wait for a file that refuses.
    pub waiting_bytes: usize,
    /// True if the events' `clock_ns` is CLOCK_MONOTONIC; false under the simulated clock.
    pub real_clock: bool,
    /// Period of a tick in ns, for the window round a miss.
    pub tick_ns: u64,
    /// Place of the column `step` in a row, for the tick of notes: the loop counts the ticks of its events so.
    pub step_column: Option<usize>,
    /// Place of the column `time` in a row, for the test time of notes.
    pub time_column: Option<usize>,
    /// Names of the specimens in order, for the events.
    pub specimens: Vec<String>,
    /// Where states are kept; none keeps no state.
    pub states: Option<StateFolder>,
    /// The processor that its threads leave to the loop.
    pub away_from: Option<usize>,
}

impl Default for WriterSettings {
    fn default() -> Self {
        Self {
            period: Duration::from_millis(2),
            flush_every: Duration::from_millis(20),
            sync_every: Duration::from_millis(900),
            waiting_bytes: 8 << 20,
            real_clock: true,
            tick_ns: 0,
            step_column: None,
            time_column: None,
            specimens: Vec::new(),
            states: None,
            away_from: None,
        }
    }
}

/// Keeps the calling thread off a processor, if one is given.
fn leave(cpu: Option<usize>) {
    if let Some(cpu) = cpu {
        // With one processor there is no other.
        let _ = pin_away(cpu);
    }
}

/// Outcome of a run's recording.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Rows in the file.
    pub rows_written: u64,
    /// Rows lost because the ring was full.
    pub rows_lost_queue: u64,
    /// Rows lost because the file refused them.
    pub rows_lost_file: u64,
    /// States written to the run folder.
    pub states_written: u64,
    /// States of checkpoints that were not kept: no buffer was free, or the folder refused.
    pub states_skipped: u64,
    /// Lines in `events.jsonl`.
    pub events_written: u64,
    /// Events lost to a full ring, a full queue or a file that refused.
    pub events_lost: u64,
    /// Deadline misses by class, as far as their events arrived.
    pub misses: MissClasses,
    /// Limits that were warned of, in sentences, as far as their events arrived.
    pub warned: Vec<String>,
    /// Syncs to disk that failed.
    pub sync_failures: u64,
    /// The first error of a file, if there was one.
    pub first_error: Option<String>,
    /// Its files as it left them.
    pub files: Vec<(&'static str, Extent)>,
    /// Changes that others made to the record while it was written, in sentences, as far as they were found.
    pub damaged: Vec<String>,
}

impl Recorded {
    /// Counts `rows` rows that were in the file as lost, too.
    pub fn lose(&mut self, rows: u64, why: &str) {
        self.rows_written -= rows.min(self.rows_written);
        self.rows_lost_file += rows;
        if rows > 0 {
            self.first_error = Some(why.to_owned());
        }
    }

    /// The warning of a summary where rows are lost.
    #[must_use]
    pub fn loss(&self) -> Option<String> {
        let cause = self.first_error.as_deref();
        let cause = cause.unwrap_or("the queue was full");
        (self.rows_lost() > 0).then(|| format!("{} rows are LOST: {cause}", self.rows_lost()))
    }

    /// All rows lost: `rows_lost` of the summary.
    #[must_use]
    pub const fn rows_lost(&self) -> u64 {
        self.rows_lost_queue + self.rows_lost_file
    }
}

/// Reason why the writer is not running.
#[derive(Debug, Error)]
pub enum WriterError {
    /// The system gives no thread.
    #[error("cannot start the writer's thread: {0}")]
    Spawn(std::io::Error),
    /// The system gives no second handle of a file.
    #[error("cannot prepare the files for syncing: {0}")]
    Sync(std::io::Error),
    /// The thread died; the rows up to its last flush are in the file.
    #[error("the writer's thread died")]
    Died,
}

/// Notes that may wait for the writer.
const NOTES: usize = 1024;

/// A running writer. Dropping it ends it as [`Writer::finish`] does.
#[derive(Debug)]
pub struct Writer {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Recorded>>,
    progress: Arc<Mutex<Progress>>,
    notes: Sender<Note>,
    notes_lost: Arc<AtomicU64>,
}

impl Writer {
    /// Starts the writer on empty stores. `sampler` brings the scheduler's counters for the classes of misses. The last argument
    /// receives each row, if it is given.
    ///
    /// # Errors
    /// [`WriterError`] if the system gives no thread or no second handle.
    pub fn spawn<S, E>(
        ring: RingReader,
        samples: S,
        events: E,
        sampler: Option<Receiver<SchedSample>>,
        clocks: Clocks,
        settings: WriterSettings,
        onlooker: Option<Box<dyn Onlooker>>,
    ) -> Result<Self, WriterError>
    where
        S: Store + 'static,
        E: Store + 'static,
    {
        let mut ring = ring;
        let ends = settings.states.clone().zip(ring.take_states());
        let snapshots = ends.map(|(folder, ends)| Snapshots::spawn(ends, folder));
        let snapshots = snapshots.transpose().map_err(WriterError::Spawn)?;
        let (notes, notes_out) = crossbeam_channel::bounded(NOTES);
        let stop = Arc::new(AtomicBool::new(false));
        let progress = Arc::new(Mutex::new(Progress::default()));
        let syncers = [
            samples.syncer().map_err(WriterError::Sync)?,
            events.syncer().map_err(WriterError::Sync)?,
        ];
        let sync = SyncThread::spawn(syncers, settings.away_from).map_err(WriterError::Spawn)?;
        let (period, away_from) = (settings.period, settings.away_from);
        let stop_seen = Arc::clone(&stop);
        let mut drain = Drain::new(ring, samples, events, sampler, notes_out, settings);
        drain.progress = Arc::clone(&progress);
        (drain.sync, drain.snapshots) = (Some(sync), snapshots);
        drain.onlooker = Watched::by(onlooker);
        let work = move || {
            leave(away_from);
            loop {
                // Read before the turn: the rows that the loop left before the stop are then surely taken.
                let last = stop_seen.load(Ordering::Acquire);
                let busy = drain.turn(clocks.now());
                if last {
                    return drain.finish(clocks.now());
                }
                if !busy {
                    std::thread::park_timeout(period);
                }
            }
        };
        // The log subscriber of the caller receives the writer's messages too.
        let listener = tracing::dispatcher::get_default(Clone::clone);
        let thread = std::thread::Builder::new()
            .name("gusset-writer".to_owned())
            .spawn(move || tracing::dispatcher::with_default(&listener, work))
            .map_err(WriterError::Spawn)?;
        Ok(Self {
            stop,
            thread: Some(thread),
            progress,
            notes,
            notes_lost: Arc::default(),
        })
    }

    /// Leaves a note for `events.jsonl` and the log; never waits. A note that finds no room is counted as lost.
    pub fn note(&self, note: impl Into<Note>) {
        if self.notes.try_send(note.into()).is_err() {
            self.notes_lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Copies the progress. The loop has no part in this lock.
    pub fn progress(&self, into: &mut Progress) {
        into.clone_from(&lock(&self.progress));
    }

    /// Call after the loop has ended: writes and syncs everything and returns the outcome.
    ///
    /// # Errors
    /// [`WriterError::Died`] if the thread panicked.
    pub fn finish(mut self) -> Result<Recorded, WriterError> {
        let mut recorded = self.join().ok_or(WriterError::Died)?;
        recorded.events_lost += self.notes_lost.load(Ordering::Relaxed);
        Ok(recorded)
    }

    fn join(&mut self) -> Option<Recorded> {
        let thread = self.thread.take()?;
        self.stop.store(true, Ordering::Release);
        thread.thread().unpark();
        thread.join().ok()
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        let _nobody_asks = self.join();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
