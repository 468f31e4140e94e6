//! The row is the truth: what a tick computed is one row of doubles, written once.
//!
//! Report, export and replay read rows; none has a private path. The loop sees only [`Recorder`]; where the
//! rows go (a ring to the writer thread, a vector in a test) is not its business.
//!
//! | file | holds |
//! |---|---|
//! | [`mod@ring`], [`memory`], [`image`] | where the loop leaves rows: a wait-free ring, a vector, a folder in memory |
//! | [`writer`] | the thread that drains the ring: rows to `samples.bin`, events to `events.jsonl` and the log |
//! | [`onlooker`] | who looks at the rows as they pass through the writer |
//! | [`layout`], [`journal`], [`append`] | the format of `samples.bin`; its reader; appending that survives a full disk |
//! | [`events`], [`note`], [`miss`] | lines of `events.jsonl`; events from outside the loop; the class of a miss |
//! | [`folder`], [`run`], [`summary`] | the run folder, written; read; `summary.json` |
//! | `missing`, `intact` | what the rows lack at their end; what others did to a file |
//! | [`export`] | CSV, NumPy, MATLAB, HDF5, a trace of the loop, a project folder |
//! | [`atomic`], [`utc`] | files that appear whole; calendar text |
//!
//! No clock is read here: whoever starts the writer says how ([`writer::Clocks`]).

pub mod append;
pub mod atomic;
pub mod events;
pub mod export;
pub mod folder;
pub mod image;
mod intact;
pub mod journal;
pub mod layout;
pub mod listing;
pub mod memory;
pub mod miss;
mod missing;
pub mod note;
pub mod onlooker;
pub mod ring;
pub mod run;
mod strides;
pub mod summary;
pub mod utc;
mod warned;
mod whereabouts;
pub mod writer;

pub use folder::{FolderError, RunFolder, make_free};
pub use image::FolderImage;
pub use intact::{Extent, Meddled, is_same_file};
pub use journal::{End, Journal, Row};
pub use layout::{COMMITS, Layout};
pub use memory::MemoryRecorder;
pub use miss::{MissClasses, SchedSample};
pub(crate) use miss::{ON_MISS, late_words};
pub use missing::{MissingEnd, ToldBy};
pub use note::{Note, NoteLevel, Position};
pub use onlooker::Onlooker;
pub use ring::{RingReader, RingRecorder, RingSize, WhenFull, ring};
pub use run::{EventLines, Events, Run, keeps_waiting};
pub use summary::Summary;
pub(crate) use warned::times;
pub use whereabouts::{Whereabouts, is_claimed};
pub use writer::{Progress, Recorded, Writer, WriterSettings};

use serde::{Deserialize, Serialize};

/// One column of the rows: fixed and named before the run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Name as the CSV export prints it, or a name of our own where the export has none.
    pub name: String,
    /// SI unit, "1" for a pure number.
    pub unit: String,
    /// One line of explanation.
    pub meaning: String,
    /// True if the value depends on wall time; all others are identical between clocks and repeats.
    pub timing: bool,
}

/// What happened, for the log. Small and `Copy`, so that the loop can send it without a thought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Tick on which it happened.
    pub tick: u64,
    /// Test time in s.
    pub time: f64,
    /// Nanoseconds of the loop's clock.
    pub clock_ns: u64,
    /// What it was.
    pub kind: EventKind,
}

/// Kinds of events that the loop itself reports.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EventKind {
    /// The first command is about to leave.
    Started,
    /// The grid of ticks begins: rows count their wall time (`release_s`) from this edge on.
    Grid {
        /// What happens on it.
        of: GridOf,
        /// Its first edge, ns of the loop's clock.
        first_edge_ns: u64,
    },
    /// The loop has ended and every specimen is retired.
    Ended,
    /// A deadline was missed by this many nanoseconds; the grid was moved by `stretched` ticks.
    Miss {
        /// Size of the miss.
        late_ns: u64,
        /// Whole ticks by which the grid was moved (0: the next edge stood).
        stretched: u64,
        /// What is known at once about the cause; the writer refines it.
        cause: MissCause,
    },
    /// Outside of the ticks of the test no command left for this long, and so many ticks had none.
    Gap {
        /// How late the next one is.
        late_ns: u64,
        /// Ticks without a command.
        ticks: u64,
    },
    /// The measurement of specimen `port` was stale: its sequence number was `age` commands old.
    Stale {
        /// Specimen, from 0.
        port: u32,
        /// Age in commands.
        age: u64,
    },
    /// An answer of specimen `port` that was stale or late and never came by itself stood in the history of a later one.
    Recovered {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// Commands from the one that it answers to the newest one.
        age: u64,
        /// The force that belongs to it, N: what the equilibrium of its step would have had.
        force: f64,
    },
    /// The link of specimen `port` failed.
    Link {
        /// Specimen, from 0.
        port: u32,
        /// Why.
        fault: crate::substructure::LinkFault,
    },
    /// Specimen `port` did not answer the last words.
    Unacknowledged {
        /// Specimen, from 0.
        port: u32,
    },
    /// The interlock of specimen `port` is open.
    Interlock {
        /// Specimen, from 0.
        port: u32,
    },
    /// A sensor or actuator of specimen `port` is at the end of its range.
    Saturated {
        /// Specimen, from 0.
        port: u32,
    },
    /// Specimen `port` says that it holds by its own watchdog.
    Holds {
        /// Specimen, from 0.
        port: u32,
    },
    /// It goes on saying so, although commands come.
    HoldsOn {
        /// Specimen, from 0.
        port: u32,
    },
    /// The simulated actuator of specimen `port` did not come to terms with what it moves.
    Unsettled {
        /// Specimen, from 0.
        port: u32,
        /// Ticks in which it did not, so far.
        ticks: u64,
    },
    /// The row of this tick found the queue full and is lost.
    RowLost,
    /// A displacement or force ceased to be finite or ran beyond the divergence bound; DOF from 0.
    Diverged {
        /// Degree of freedom, from 0.
        dof: u32,
    },
    /// The operator asked for an end.
    StopRequested,
    /// The operator asked for a hold.
    HoldRequested,
    /// The operator let a test that was held, or was to be held, go on.
    ContinueRequested,
    /// A continue named an earlier hold and was dropped: the latest hold remains.
    ContinueDropped {
        /// The hold that he named.
        hold: u32,
        /// The latest hold.
        latest: u32,
    },
    /// What the sensors read before anything moves was confirmed.
    Confirmed,
    /// Where an axis of a specimen stands when a test is gone on with.
    Stands {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// What it reads, where it was left and how far off it may be, in its own unit.
        values: [f64; 3],
    },
    /// A specimen of a test that is gone on with does not stand where it was left.
    Moved {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// Where it stands, where it was left and how far off it may be, in its own unit.
        values: [f64; 3],
    },
    /// Specimen `port` is about to be moved a little and back, to see which way round it is wired.
    Probing {
        /// Specimen, from 0.
        port: u32,
    },
    /// What such a motion found.
    Direction {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// Change of the measured displacement, m.
        disp: f64,
        /// Change of the measured force, N.
        force: f64,
    },
    /// Nothing showed which way round an axis of specimen `port` is wired.
    DirectionUnknown {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
    },
    /// A load cell reads another force than before the interruption of its test.
    ForceChanged {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// The expected reading: the last one, moved elastically to where the axis is found, in its own unit.
        left: f64,
        /// What it reads now.
        found: f64,
        /// How far it may differ, in its own unit.
        within: f64,
        /// True if the difference is taken for drift of its zero.
        is_taken: bool,
    },
    /// Specimen `port` is wired the wrong way round, or does not answer as it must.
    Misfit {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// In one word.
        what: &'static str,
    },
    /// A pose that the actuators of specimen `port` cannot take, or strokes without a pose.
    Geometry {
        /// Specimen, from 0.
        port: u32,
        /// Actuator, from 0, where it is one alone.
        actuator: Option<u32>,
        /// In one word.
        what: &'static str,
    },
    /// The pace of the commands changed between two targets.
    Pace {
        /// From here.
        from: &'static str,
        /// To here.
        to: &'static str,
        /// Share of the step that was made.
        share: f64,
    },
    /// The state of the test after this step, as one number.
    Checkpoint {
        /// Of its bits.
        digest: u64,
    },
    /// The test's life went on.
    Phase {
        /// From here.
        from: &'static str,
        /// To here.
        to: &'static str,
        /// Why: `done`, `operator`, or what stopped it.
        cause: &'static str,
        /// The specimen, from 0, that this came from, if from one.
        port: Option<u32>,
    },
    /// Whether the warm-up kept its ticks, by the last half of them: the test begins, or does not.
    Readiness {
        /// It does.
        go: bool,
        /// Ticks that were judged.
        ticks: u64,
        /// Those that missed their deadline.
        missed: u64,
        /// The most of them in a row.
        in_a_row: u64,
        /// What a tick took on the average.
        mean_ns: u64,
        /// What the longest took.
        longest_ns: u64,
    },
    /// A limit of specimen `port` was reached.
    Limit {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// Of what: the key of the test file.
        quantity: &'static str,
        /// Whether it ends the test.
        trip: bool,
        /// What was found, SI.
        value: f64,
        /// What is allowed, SI.
        bound: f64,
    },
    /// A limit of the test as a whole was reached.
    TestLimit {
        /// Of what: the key of the test file.
        quantity: &'static str,
        /// Whether it ends the test.
        trip: bool,
        /// What was found.
        value: f64,
        /// What is allowed.
        bound: f64,
        /// Specimen and axis, from 0, that have the most of it, where that can be said.
        worst: Option<(u32, u32)>,
    },
    /// An axis bears a force before the test moves it.
    InitialForce {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// Reference of the allowed force: `yield_force_n`, `measured_force_n`, or `noise` if neither is known.
        of: &'static str,
        /// The force that its displacement does not explain, N at the specimen.
        force: f64,
        /// The allowed force, N at the specimen.
        most: f64,
    },
    /// What was read of one axis of specimen `port` while zeroing.
    Zeroed {
        /// Specimen, from 0.
        port: u32,
        /// Axis, from 0.
        axis: u32,
        /// Mean displacement, mean force, and their noise (rms), in the axis' own units; no number of too few readings to know it.
        values: [f64; 4],
    },
}

/// What happens on a grid of ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GridOf {
    /// It is tried which way round the specimens are wired.
    Directions,
    /// Everything else before t = 0, or before an interrupted test goes on.
    Opening,
    /// The test.
    Test,
}

impl GridOf {
    /// As `events.jsonl` has it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Directions => "directions",
            Self::Opening => "opening",
            Self::Test => "test",
        }
    }
}

/// Class of a deadline miss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MissCause {
    /// The thread was switched away against its will.
    Preempted,
    /// The clock jumped without a switch: hypervisor or interrupt.
    TakenAway,
    /// The specimen's reply came late.
    LateReply,
    /// Long compute or a full queue: our own fault.
    Ours,
}

/// When the rows of the warm-up are handed over. It is no part of a test, and nothing of it is kept as long as nothing
/// is asked in it and nothing goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WarmUpRows {
    /// Afterwards, if they matter.
    IfTheyMatter,
    /// Tick by tick: they are compared with recorded ones.
    AsTheyCome,
    /// Not at all: they are compared with a recording in which they did not matter.
    Never,
}

/// Where the loop leaves rows and events. Never blocks under the real clock. Real-time: yes.
pub trait Recorder: Send {
    /// Takes one row; false if it had to be dropped.
    fn row(&mut self, row: &[f64]) -> bool;

    /// Takes one event; false if it had to be dropped.
    fn event(&mut self, event: Event) -> bool;

    /// When it wants the rows of the warm-up, which begins now.
    fn warm_up(&mut self) -> WarmUpRows {
        WarmUpRows::IfTheyMatter
    }
}
