//! The loop. One step is one function (`step`), the same under the real and the simulated clock.
//!
//! An [`Experiment`] is plain data that can be sent to the loop's thread, which makes the [`Engine`] of it in place:
//! memory is touched by the thread that uses it, on the processor that it is pinned to. The engine knows
//! neither files nor threads nor what stands behind a port.

mod after;
mod audit;
mod before;
mod checks;
mod columns;
mod direction;
mod intake;
mod misses;
mod numerical;
mod operator;
mod peaks;
mod phase;
mod port_columns;
mod ready;
mod resume;
mod ride;
mod run;
mod settle;
mod step;
mod stop;
mod telling;
mod test_hit;
mod tick;
mod verdicts;
mod waiting;

pub use after::{Left, Unfinished};
pub use audit::StepAudit;
pub use before::{InitialForce, Opening};
pub use checks::{TestLimits, kept_limits};
pub use intake::Intake;
pub use numerical::{Numerical, Side};
pub use operator::{Control, Notice, Operator, OperatorCommands, Watch};
pub use peaks::Peaks;
pub use phase::{Glimpse, Phase, PhaseCell};
pub use resume::{EarlierPeaks, Place, Resumption};
pub use ride::Pacing;
pub use settle::Settling;
pub use stop::{Ending, Stop};
pub use test_hit::TestHit;
pub use tick::Tick;
pub use waiting::Gaps;

pub use crate::catalog::phase::{GIVEN_UP, NOT_AWAITED};

use crate::control::{LinkCount, Port, Poses};
use crate::record::{Column, Recorder};
use crate::rt::timing::{TickStamps, Timing};
use crate::state::TestState;
use crate::substructure::Holder;
use crate::time::{Clock, Nanos, Ratio, Schedule, SimClock};
use operator::Asked;

/// What to do about a tick that starts, or leaves the next one to start, a period or more late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnMiss {
    /// Move the grid by whole ticks: the specimen sees slower time, never a burst of commands.
    Stretch,
    /// Keep the grid and run the missed steps back to back; beyond `at_most` of them the grid is moved.
    CatchUp {
        /// Ticks that may run back to back.
        at_most: u64,
    },
    /// End the test in an orderly way.
    Stop,
}

/// Bounds of what the loop puts up with.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// What to do about a tick that starts a period or more late.
    pub on_miss: OnMiss,
    /// Whether a stale force is moved along the estimate k̂ (true) or held (false).
    pub extrapolate_stale: bool,
    /// Stale measurements in a row after which the test stops.
    pub stale_in_a_row: u64,
    /// How long a lockstep partner is waited for, in ns.
    pub reply_timeout_ns: u64,
    /// Ticks before t = 0 in which the specimens hold the first command.
    pub warmup_ticks: u64,
    /// |displacement| in m beyond which the response counts as diverged.
    pub divergence: f64,
    /// What belongs to no specimen alone.
    pub test: TestLimits,
}

/// Everything a test needs, as plain data.
#[derive(Debug)]
pub struct Experiment {
    /// Step Δt of test time.
    pub dt: f64,
    /// Period of the tick grid in s of wall time, exact.
    pub period: Ratio,
    /// Number of steps; rows 0 … steps.
    pub steps: u64,
    /// The numerical side.
    pub side: Side,
    /// How the specimens come to where the test begins.
    pub opening: Opening,
    /// Static load before t = 0.
    pub settling: Option<Settling>,
    /// One port per specimen.
    pub ports: Vec<Port>,
    /// DOFs to record, from 0.
    pub record_dofs: Vec<usize>,
    /// DOFs that are rotations, from 0: their columns are in rad.
    pub rotations: Vec<usize>,
    /// Bounds of what the loop puts up with.
    pub limits: Limits,
    /// How steps and ticks belong together.
    pub pacing: Pacing,
    /// Where an interrupted test stood that this one goes on with.
    pub resume: Option<Resumption>,
}

/// The loop with all its buffers.
pub struct Engine {
    dt: f64,
    period: Ratio,
    steps: u64,
    side: Side,
    opening: Opening,
    settling: Option<Settling>,
    ports: Vec<Port>,
    /// The tick that tripped has a row.
    trip_is_recorded: bool,
    /// Commands have left since the last row was made.
    sent_since_row: bool,
    /// The operator ended the test: what trips after that does so on the way out.
    operator_stopped: bool,
    phase: Phase,
    /// The farthest tick that was exchanged.
    at: Tick,
    /// Where the phase is left for others to see.
    pub phase_cell: PhaseCell,
    hold_wanted: bool,
    /// Number of the latest hold, from 1.
    hold_number: u32,
    /// The tick at hand moves nothing.
    still: bool,
    /// The operator said before this tick that the test may go on.
    goes_on: bool,
    /// The operator is asked to confirm what was read.
    unconfirmed: bool,
    /// What the operator asked for and was not looked at yet.
    asked: Asked,
    /// Rows of the warm-up, until the first of the test is made.
    held_back: Vec<f64>,
    /// Recordings say nothing: they have no row of the warm-up.
    unanswered: bool,
    limits: Limits,
    clock: Box<dyn Clock>,
    recorder: Box<dyn Recorder>,
    row: columns::Row,
    columns: Vec<Column>,
    schedule: Schedule,
    timing: Timing,
    peaks: Peaks,
    /// Largest |force| of each axis of each specimen in the test that this one goes on with.
    earlier_forces: Vec<Vec<f64>>,
    resume: Option<Resumption>,
    /// Where the commands are between two targets.
    ride: ride::Ride,
    /// True from the first tick of the test to its last.
    riding: bool,
    checkpoint_ticks: u64,
    /// For the digest of a checkpoint.
    memory: TestState,
    edge: u64,
    sequence: u64,
    clock_now: Nanos,
    first_edge: Nanos,
    unrecorded: Option<TickStamps>,
    steps_done: u64,
    misses: u64,
    misses_in_a_row: u64,
    gaps: Gaps,
    miss_window: misses::MissWindow,
    test_warned: u32,
    rows_lost: u64,
    events_lost: u64,
    retired: usize,
    /// Where each specimen was left.
    left: Vec<Left>,
    /// Specimens that did not answer the last words.
    unheard: Vec<usize>,
    /// Those that were still waited for when the operator ended the test before they were armed.
    unarmed: Vec<usize>,
    unfinished: Option<Unfinished>,
    /// Called on the loop's thread when the warm-up is over.
    pub before_first_tick: Option<Watch>,
    /// Called on the loop's thread when the last tick is over.
    pub after_last_tick: Option<Watch>,
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine")
            .field("steps", &self.steps)
            .field("ports", &self.ports)
            .finish()
    }
}

/// What a test leaves behind, besides its rows and events.
#[derive(Debug)]
pub struct Outcome {
    /// How it ended.
    pub ending: Ending,
    /// What stopped the specimens on their way out, if anything did.
    pub unfinished: Option<Unfinished>,
    /// Where each specimen was left.
    pub left: Vec<Left>,
    /// Specimens, from 0, that should have answered the last words, and did not.
    pub unheard: Vec<usize>,
    /// Specimens, from 0, whose own ends were getting them ready when the operator ended the test.
    pub unarmed: Vec<usize>,
    /// Who holds each specimen if commands stay away.
    pub holders: Vec<Holder>,
    /// Last step whose row was made.
    pub steps: u64,
    /// Peaks over all DOFs.
    pub peaks: Peaks,
    /// Peaks and counts of each specimen: name, largest |force| per axis of answers that came in time, exchanges.
    pub ports: Vec<(String, Vec<f64>, LinkCount)>,
    /// Largest |force| of each specimen before the test, one per axis.
    pub forces_on_the_way_in: Vec<Vec<f64>>,
    /// Histograms of every timing quantity.
    pub timing: Timing,
    /// Deadline misses.
    pub misses: u64,
    /// Whole ticks by which the grid was moved.
    pub stretched: u64,
    /// Where no command left, outside of the ticks of the test.
    pub gaps: Gaps,
    /// Rows that found the queue full.
    pub rows_lost: u64,
    /// Events that found the queue full.
    pub events_lost: u64,
    /// From the first edge of the test to the end of its last tick.
    pub wall_ns: u64,
    /// What the links say about their faults: specimen (from 0) and words.
    pub complaints: Vec<(usize, String)>,
    /// What specimens answered to the last words beyond a plain goodbye: the same.
    pub last_words: Vec<(usize, String)>,
}

impl Experiment {
    /// Names, units and meanings of the columns that this experiment will record.
    #[must_use]
    pub fn columns(&self) -> Vec<Column> {
        columns::Row::new(
            (&self.record_dofs, &self.rotations),
            &self.side,
            &self.ports,
        )
        .1
    }
}

impl Engine {
    /// Allocates everything that the loop will ever need.
    #[must_use]
    pub fn new(experiment: Experiment, clock: Box<dyn Clock>, recorder: Box<dyn Recorder>) -> Self {
        let ports = &experiment.ports;
        let names: Vec<&str> = ports.iter().map(|port| port.name.as_str()).collect();
        let remote = ports.iter().any(Port::is_remote);
        let timing = if clock.is_simulated() {
            Timing::untouched
        } else {
            Timing::new
        };
        let timing = timing(&names, remote, experiment.limits.warmup_ticks);
        Self::timed_by(timing, experiment, clock, recorder)
    }

    /// The same for what has happened already: its histograms stay empty.
    #[must_use]
    pub fn for_a_replay(experiment: Experiment, recorder: Box<dyn Recorder>) -> Self {
        let clock = Box::new(SimClock::new());
        Self::timed_by(Timing::counting(), experiment, clock, recorder)
    }

    fn timed_by(
        timing: Timing,
        experiment: Experiment,
        clock: Box<dyn Clock>,
        recorder: Box<dyn Recorder>,
    ) -> Self {
        let Experiment {
            dt,
            period,
            steps,
            mut side,
            opening,
            settling,
            ports,
            record_dofs,
            rotations,
            limits,
            pacing,
            resume,
        } = experiment;
        let (row, columns) = columns::Row::new((&record_dofs, &rotations), &side, &ports);
        let dofs = match &side {
            Side::Structure(numerical) => numerical.structure.dofs(),
            Side::Prescribed(_) => 0,
        };
        // As much as a checkpoint will need.
        let memory = TestState::with_room(|visit| {
            if let Side::Structure(numerical) = &mut side {
                numerical.structure.visit_state(visit);
            }
        });
        let schedule = Schedule::new(Nanos(0), period);
        Self {
            dt,
            period,
            steps,
            side,
            settling,
            timing,
            resume,
            ride: ride::Ride::new(pacing),
            riding: false,
            checkpoint_ticks: pacing.checkpoint_ticks,
            memory,
            opening,
            trip_is_recorded: false,
            sent_since_row: false,
            operator_stopped: false,
            left: vec![Left::Stayed; ports.len()],
            unheard: Vec::new(),
            unarmed: Vec::new(),
            phase: Phase::Connected,
            at: Tick::before_start(0.0),
            phase_cell: PhaseCell::default(),
            hold_wanted: false,
            hold_number: 0,
            still: false,
            goes_on: false,
            unconfirmed: false,
            asked: Asked::default(),
            held_back: Vec::new(),
            unanswered: false,
            ports,
            miss_window: misses::MissWindow::new(&limits.test),
            test_warned: 0,
            limits,
            clock,
            recorder,
            row,
            columns,
            schedule,
            peaks: Peaks::zeros(dofs),
            earlier_forces: Vec::new(),
            edge: 0,
            sequence: 0,
            clock_now: Nanos(0),
            // No time has passed since an edge that is not there yet.
            first_edge: Nanos(u64::MAX),
            unrecorded: None,
            steps_done: 0,
            misses: 0,
            misses_in_a_row: 0,
            gaps: Gaps::default(),
            rows_lost: 0,
            events_lost: 0,
            retired: 0,
            unfinished: None,
            before_first_tick: None,
            after_last_tick: None,
        }
    }

    /// How far the platform of each specimen went; none where its axes are no actuators of one.
    #[must_use]
    pub fn poses(&self) -> Vec<Option<Poses>> {
        self.ports.iter().map(Port::poses).collect()
    }

    /// Names, units and meanings of the columns of the rows.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// What each specimen has to say there, by its number from 0.
    fn said(&self, words: impl Fn(&Port) -> Option<String>) -> Vec<(usize, String)> {
        let ports = self.ports.iter().enumerate();
        ports
            .filter_map(|(index, port)| words(port).map(|text| (index, text)))
            .collect()
    }

    fn outcome(&mut self, ending: Ending) -> Outcome {
        Outcome {
            ending,
            unfinished: self.unfinished,
            left: self.left.clone(),
            unheard: self.unheard.clone(),
            unarmed: self.unarmed.clone(),
            holders: self.ports.iter().map(Port::left_to).collect(),
            steps: self.steps_done,
            peaks: self.peaks.clone(),
            ports: (self.ports.iter().zip(self.peak_forces()))
                .map(|(port, forces)| (port.name.clone(), forces, port.link_count()))
                .collect(),
            forces_on_the_way_in: (self.ports.iter())
                .map(|port| port.force_on_the_way_in.clone())
                .collect(),
            // Megabytes, and nobody asks for them twice.
            timing: std::mem::replace(&mut self.timing, Timing::counting()),
            misses: self.misses,
            stretched: self.schedule.stretched(),
            gaps: self.gaps,
            rows_lost: self.rows_lost,
            events_lost: self.events_lost,
            wall_ns: self.clock_now.since(self.first_edge),
            complaints: self.said(Port::complaint),
            last_words: self.said(Port::last_words),
        }
    }
}
