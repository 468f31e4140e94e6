//! The row is the truth: what a tick computed is one row of doubles, written once.
//!
//! Report, export and replay read rows; none has a private path. The loop sees only [`Recorder`]; it does not know
//! where the rows go (a ring to the writer thread, a vector in a test).
//!
//! | file | holds |
//! |---|---|
//! | [`mod@ring`], `memory`, `image` | where the loop leaves rows: a wait-free ring, a vector, a folder in memory |
//! | [`writer`] | the thread that drains the ring: rows to `samples.bin`, events to `events.jsonl` and the log |
//! | [`onlooker`] | observers of the rows on their way through the writer |
//! | [`layout`], [`journal`], [`append`] | the format of `samples.bin`; its reader; appending that survives a full disk |
//! | [`events`], [`note`], [`miss`] | what happened and its line in `events.jsonl`; events from outside the loop; the class of a miss |
//! | `event_log` | events on their way into the file and the log |
//! | `checksum` | the SHA-256 of a file |
//! | [`checkpoint`], `buffers` | the state of the test in a file; buffers in which the loop hands it over |
//! | [`folder`], [`run`], [`summary`] | the run folder, written; read; `summary.json` |
//! | [`lasting`] | the lasting record of a physical specimen: its trip, and where a motion began |
//! | `missing`, `intact` | what the rows lack at their end; what others did to a file |
//! | [`export`] | CSV, NumPy, MATLAB, HDF5, a trace of the loop, a project folder |
//! | [`atomic`], [`utc`] | files that appear whole; calendar text |
//!
//! [`rt`] asks the operating system for what a real-time thread needs, holds the real clock, and has the only `unsafe` code. This
//! member does not know specimens or test files. Begin reading with [`layout`].
//!
//! No clock is read here: the caller that starts the writer passes the clocks ([`writer::Clocks`]).

pub mod append;
pub mod atomic;
mod buffers;
pub mod cell;
pub mod checkpoint;
mod checksum;
mod event_log;
pub mod events;
pub mod export;
pub mod filed;
pub mod folder;
#[cfg(any(test, feature = "test-doubles"))]
pub mod image;
mod in_order;
mod intact;
pub mod journal;
pub mod lasting;
pub mod layout;
mod limit_facts;
pub mod listing;
#[cfg(any(test, feature = "test-doubles"))]
pub mod memory;
pub mod miss;
mod missing;
pub mod note;
pub mod onlooker;
pub mod origin;
#[cfg(feature = "parquet")]
pub mod parquet;
pub mod ring;
pub mod rt;
pub mod run;
mod strides;
pub mod summary;
pub mod utc;
mod warned;
mod whereabouts;
pub mod writer;

pub use checkpoint::{Checkpoint, CheckpointFault, StateFaults, StateFolder};
pub use checksum::Checksum;
pub use events::{Event, EventLine, LimitReached, Ready, Standing, TripValue, WarmUp, Word};
pub use folder::{BEFORE, FolderError, RunFolder, make_free};
#[cfg(any(test, feature = "test-doubles"))]
pub use image::FolderImage;
pub use intact::{Extent, Meddled};
pub use journal::{End, Journal, Row};
pub use layout::{COMMITS, Layout};
#[cfg(any(test, feature = "test-doubles"))]
pub use memory::MemoryRecorder;
pub use miss::MissClasses;
pub use miss::{ON_MISS, late_words};
pub use missing::{MissingEnd, ToldBy};
pub use note::{Note, Position};
pub use onlooker::Onlooker;
pub use ring::{RingReader, RingRecorder, RingSize, WhenFull, ring};
pub use run::{EventLines, Events, MOST_OF_A_KIND, Run, keeps_waiting, read_json};
pub use summary::Summary;
pub use warned::times;
pub use whereabouts::{Whereabouts, is_claimed};
pub use writer::{Progress, Recorded, Writer, WriterSettings};

use serde::{Deserialize, Serialize};

use gusset_quantity::state::{StateError, TestState};

/// One column of the rows: fixed and named before the run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Name in the CSV export; a column that is not in it has its own name.
    pub name: String,
    /// SI unit, "1" for a pure number.
    pub unit: String,
    /// One line of explanation.
    pub meaning: String,
    /// True if the value depends on wall time; all others are identical between clocks and repeats.
    pub timing: bool,
}

/// An event of the loop with the moment at which it happened.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedEvent {
    /// Tick on which it happened.
    pub tick: u64,
    /// Test time in s.
    pub time: f64,
    /// Nanoseconds of the loop's clock.
    pub clock_ns: u64,
    /// Its kind.
    pub kind: Event,
}

/// Purpose of a grid of ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GridOf {
    /// The wiring check.
    Directions,
    /// Everything else before t = 0, or before an interrupted test continues.
    Opening,
    /// The test.
    Test,
}

/// Class of a deadline miss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MissCause {
    /// The thread was switched away against its will.
    Preempted,
    /// The clock jumped, and the hypervisor had the processor meanwhile.
    TakenAway,
    /// The specimen's reply came late.
    LateReply,
    /// Long compute or a full queue: our own fault.
    Ours,
    /// The process was stopped and continued.
    Stopped,
    /// The clock jumped, and nothing that is counted says why.
    Unknown,
}

impl MissCause {
    /// The class as files spell it.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::Preempted => "preempted",
            Self::TakenAway => "taken_away",
            Self::LateReply => "late_reply",
            Self::Ours => "ours",
            Self::Stopped => "stopped",
            Self::Unknown => "unknown",
        }
    }

    /// The class in a word or two.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Preempted => "preempted",
            Self::TakenAway => "hypervisor",
            Self::LateReply => "late reply",
            Self::Ours => "own",
            Self::Stopped => "stopped",
            Self::Unknown => "not known",
        }
    }
}

/// When the rows of the warm-up are passed on. It is not part of a test. Its rows are discarded unless the operator
/// requests something during it or a fault occurs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WarmUpRows {
    /// Afterwards, if they matter.
    IfTheyMatter,
    /// Tick by tick: they are compared with recorded ones.
    AsTheyCome,
    /// Never: they are compared with a recording in which they did not matter.
    Never,
}

/// Where the loop leaves rows and events. Never blocks under the real clock. Real-time: yes.
pub trait Recorder: Send {
    /// Takes one row; false if it had to be dropped.
    fn row(&mut self, row: &[f64]) -> bool;

    /// Takes one event; false if it had to be dropped.
    fn event(&mut self, event: TimedEvent) -> bool;

    /// Allocates buffers for states with the room of `room`. Called once, before the first row, where states are to be kept.
    fn allocate_states(&mut self, room: &TestState) {
        let _ = room;
    }

    /// Has `take` write the state after `step` into a buffer, if one is free. The row of the step was taken before, and the event of
    /// the checkpoint follows. False if no state was kept.
    fn state(
        &mut self,
        step: u64,
        take: &mut dyn FnMut(&mut TestState) -> Result<(), StateError>,
    ) -> bool {
        let _ = (step, take);
        false
    }

    /// When it wants the rows of the warm-up, which begins now.
    fn warm_up(&mut self) -> WarmUpRows {
        WarmUpRows::IfTheyMatter
    }
}
