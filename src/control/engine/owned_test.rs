//! Everything that a test owns on the loop's thread, and the panic boundary in which the engine runs.

use gusset_numerics::frame::Members;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::columns::Row;
use super::commanding::Exchanges;
use super::cycle::Engine;
use super::deadlines::Deadlines;
use super::end_positions::{EndPosition, Ends};
use super::environment::Environment;
use super::journal::Journal;
use super::operator::{Client, Control, Watch};
use super::pace::Pace;
use super::phase::Phase;
use super::place::Place;
use super::step_progress::{Pacing, StepProgress};
use super::supervision::Supervision;
use super::test_judge::TestJudge;
use super::tick::Tick;
use super::{
    Ending, Experiment, FollowedClock, Outcome, PaceOutcome, Peaks, Plan, Resumption, Side,
    StaticLoad, Stop,
};
use crate::port::Port;
use gusset_quantity::state::{Stateful, TestState};
use gusset_quantity::time::{Clock, Ratio};
use gusset_record::rt::timing::Timing;
use gusset_record::{Column, Event, Recorder};

/// Largest model whose states are kept.
const MOST_DOFS_OF_A_STATE: usize = 10_000;

/// Everything of a test besides its ports.
pub(super) struct Parts {
    pub plan: Plan,
    pub side: Side,
    pub settling: Option<StaticLoad>,
    pub peaks: Peaks,
    pub progress: StepProgress,
    pub exchanges: Exchanges,
    pub judge: TestJudge,
    pub environment: Environment,
    pub ends: Ends,
    /// Largest |force| of each axis of each specimen in the test that this one continues.
    earlier_forces: Vec<Vec<f64>>,
}

impl Parts {
    /// A test of steps without degrees of freedom, at its beginning.
    pub(crate) fn new(
        plan: Plan,
        side: Side,
        ports: &[Port],
        (clock, period): (Box<dyn Clock>, Ratio),
        (timing, journal): (Timing, Journal),
    ) -> Self {
        let limits = &plan.limits;
        let per_step = ports.iter().any(|port| port.path().is_per_step());
        Self {
            side,
            settling: None,
            peaks: Peaks::zeros(0),
            progress: StepProgress::new(Pacing::default()),
            exchanges: Exchanges::new(),
            judge: TestJudge::new(limits.test.clone()),
            environment: Environment {
                pace: Pace::new(clock, period, limits.on_miss),
                deadlines: Deadlines::new(timing, &limits.test, per_step),
                supervision: Supervision::new(Control::unattended()),
                journal,
                place: Place::start(plan.dt),
            },
            ends: Ends::new(ports.len()),
            earlier_forces: Vec::new(),
            plan,
        }
    }

    /// The running engine.
    pub(crate) fn engine<'a>(
        &'a mut self,
        ports: &'a mut [Port],
        client: Option<&'a mut Client<'a>>,
    ) -> Engine<'a> {
        Engine {
            plan: &self.plan,
            ports,
            side: &mut self.side,
            settling: &mut self.settling,
            peaks: &mut self.peaks,
            progress: &mut self.progress,
            exchanges: &mut self.exchanges,
            judge: &mut self.judge,
            environment: &mut self.environment,
            ends: &mut self.ends,
            client,
        }
    }
}

/// Something to do on the loop's own thread just before the first and just after the last tick of the test: tests put a guard
/// there that counts system calls and allocations.
#[derive(Default)]
pub(super) struct Watches {
    pub before_first_tick: Option<Watch>,
    pub after_last_tick: Option<Watch>,
}

/// The content of every state of the life cycle.
pub(super) struct Test {
    pub ports: Vec<Port>,
    pub parts: Box<Parts>,
    pub watches: Watches,
    pub resume: Option<Resumption>,
    pub columns: Vec<Column>,
}

impl std::fmt::Debug for Test {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Test")
            .field("ports", &self.ports)
            .finish_non_exhaustive()
    }
}

impl Test {
    /// Allocates everything that the loop will ever need.
    pub(crate) fn new(
        timing: Timing,
        experiment: Experiment,
        clock: Box<dyn Clock>,
        recorder: Box<dyn Recorder>,
    ) -> Self {
        let Experiment {
            dt,
            period,
            steps,
            side,
            opening,
            settling,
            ports,
            record_dofs,
            rotations,
            limits,
            pacing,
            resume,
            retraces,
            followed,
        } = experiment;
        let clock = match followed {
            Some(FollowedClock(over)) if !clock.is_simulated() => over(clock),
            _ => clock,
        };
        let (row, columns) = Row::new((&record_dofs, &rotations), &side, &ports);
        let dofs = match &side {
            Side::Structure(numerical) => numerical.structure.dofs(),
            Side::Prescribed(_) | Side::Received(_) => 0,
        };
        let plan = Plan {
            dt,
            steps,
            opening,
            limits,
            checkpoint_ticks: pacing.checkpoint_ticks,
            keeps_state: dofs <= MOST_DOFS_OF_A_STATE,
        };
        let journal = Journal::new(row, columns.len(), recorder);
        let mut parts = Parts::new(plan, side, &ports, (clock, period), (timing, journal));
        parts.settling = settling;
        parts.peaks = Peaks::zeros(dofs);
        parts.progress = StepProgress::new(pacing);
        parts.environment.supervision.set_retraces(retraces);
        if let Some(resume) = &resume {
            parts.earlier_forces.clone_from(&resume.earlier.forces);
        }
        let mut test = Self {
            ports,
            parts: Box::new(parts),
            watches: Watches::default(),
            resume,
            columns,
        };
        test.allocate_states();
        test
    }

    /// Puts the operator in place.
    pub(crate) fn attend(&mut self, control: &Control) {
        let supervision = &mut self.parts.environment.supervision;
        supervision.attend(control.clone());
    }

    /// Makes room for the states of checkpoints.
    fn allocate_states(&mut self) {
        let plan = &self.parts.plan;
        if !plan.keeps_state || plan.checkpoint_ticks == u64::MAX {
            return;
        }
        let (mut engine, _) = self.engine();
        let mut last = Tick::before_start(0.0);
        let (mut state, recorder) = engine.state(&mut last);
        let room = TestState::with_room(|visit| state.visit_state(visit));
        recorder.allocate_states(&room);
    }

    /// The running engine.
    pub(crate) fn engine(&mut self) -> (Engine<'_>, &mut Watches) {
        let engine = self.parts.engine(&mut self.ports, None);
        (engine, &mut self.watches)
    }

    /// Lets the engine run inside the panic boundary; a panic comes back in words.
    pub(crate) fn guarded<R>(
        &mut self,
        work: impl FnOnce(&mut Engine<'_>, &mut Watches) -> R,
    ) -> Result<R, String> {
        let (mut engine, watches) = self.engine();
        let work = AssertUnwindSafe(|| work(&mut engine, watches));
        catch_unwind(work).map_err(|panic| panic_text(panic.as_ref()))
    }

    /// The record of the end, after the last messages.
    pub(crate) fn close(&mut self, ending: Ending) -> Outcome {
        self.note_unheard();
        let environment = &mut self.parts.environment;
        let is_leaving = environment.supervision.phase() == Phase::Leaving;
        let of_last_phase = match ending {
            Ending::Stopped(Stop::Internal) => ending,
            // The shutdown is complete, whatever had ended the test.
            _ if is_leaving && self.parts.ends.unfinished.is_none() => Ending::Completed,
            _ if is_leaving => Ending::Stopped(Stop::Operator),
            _ => ending,
        };
        environment.enter(Phase::Safe, of_last_phase);
        environment.deadlines.flush();
        environment.report_now(Event::Ended);
        self.outcome(ending)
    }

    /// A specimen that did not answer the last message is reported. Where its last reply was not to its last command, its position
    /// is unknown.
    fn note_unheard(&mut self) {
        let Parts {
            ends, environment, ..
        } = &mut *self.parts;
        let mut unheard = Vec::new();
        for (index, (port, left)) in self.ports.iter().zip(&mut ends.left).enumerate() {
            if port.exchange().lacks_acknowledgement() && !port.exchange().state().is_gone() {
                unheard.push(index);
                if port.exchange().stale_in_a_row() > 0 || port.exchange().state().owes() {
                    *left = EndPosition::Lost;
                }
                environment.report_now(Event::Unacknowledged { port: index as u32 });
            }
        }
        ends.unheard = unheard;
        // Without an answer to the last message, the owed reply would have been the last one.
        for (port, left) in self.ports.iter().zip(&mut ends.left) {
            if port.exchange().needs_no_acknowledgement()
                && port.feedback().is_left_owing()
                && !port.exchange().state().is_gone()
            {
                *left = EndPosition::Lost;
            }
        }
    }

    /// The report of each specimen, by its number from 0.
    fn said(&self, words: impl Fn(&Port) -> Option<String>) -> Vec<(usize, String)> {
        let ports = self.ports.iter().enumerate();
        ports
            .filter_map(|(index, port)| words(port).map(|text| (index, text)))
            .collect()
    }

    /// A list from the members of a frame; an empty one of another test.
    fn of_members<T>(&self, of: impl FnOnce(&Members) -> Vec<T>) -> Vec<T> {
        match &self.parts.side {
            Side::Structure(numerical) => of(numerical.structure.members()),
            Side::Prescribed(_) | Side::Received(_) => Vec::new(),
        }
    }

    /// Largest |force| per axis of each specimen, over the whole test. A shutdown knows its own only: what tripped the test before
    /// is no force that it may come to again.
    fn peak_forces(&self) -> impl Iterator<Item = Vec<f64>> {
        let before = self.parts.earlier_forces.iter().map(Vec::as_slice);
        let before = before.chain(std::iter::repeat(&[][..]));
        self.ports.iter().zip(before).map(|(port, before)| {
            let before = before.iter().copied().chain(std::iter::repeat(0.0));
            let each = port.feedback().peak().iter().zip(before);
            each.map(|(own, before)| own.max(before)).collect()
        })
    }

    fn outcome(&mut self, ending: Ending) -> Outcome {
        let timing = self.parts.environment.deadlines.take_timing();
        let Environment {
            pace,
            deadlines,
            journal,
            place,
            ..
        } = &self.parts.environment;
        let (rows_lost, events_lost) = journal.lost();
        let ends = &self.parts.ends;
        let reasons = self.ports.iter().filter(|_| ends.wiring_is_accepted);
        let mut reasons = reasons.filter_map(|port| port.startup().wiring().accepted());
        Outcome {
            accepted_wiring: reasons.next().map(str::to_owned),
            ending,
            unfinished: ends.unfinished,
            left: ends.left.clone(),
            last_commands: (self.ports.iter())
                .map(|port| {
                    if port.exchange().has_begun() {
                        port.path().sent().to_vec()
                    } else {
                        Vec::new()
                    }
                })
                .collect(),
            unheard: ends.unheard.clone(),
            unarmed: ends.unarmed.clone(),
            holders: self.ports.iter().map(Port::left_to).collect(),
            steps: place.steps_done(),
            peaks: self.parts.peaks.clone(),
            demands: self.of_members(|members| {
                let demands = members.demands();
                demands
                    .map(|(name, demand)| (name.to_owned(), demand))
                    .collect()
            }),
            beyond_declared: self.of_members(|members| {
                let beyond = members.beyond_declared();
                beyond.map(|(name, both)| (name.to_owned(), both)).collect()
            }),
            ports: (self.ports.iter().zip(self.peak_forces()))
                .map(|(port, forces)| {
                    (port.name().to_owned(), forces, port.exchange().full_count())
                })
                .collect(),
            forces_on_the_way_in: (self.ports.iter())
                .map(|port| port.feedback().peak_at_startup().to_vec())
                .collect(),
            pace: PaceOutcome {
                timing,
                misses: deadlines.total(),
                stretched: pace.stretched(),
                gaps: deadlines.gaps(),
                wall_ns: pace.now().since(pace.first_edge()),
            },
            rows_lost,
            events_lost,
            complaints: self.said(|port| port.exchange().complaint()),
            last_words: self.said(|port| port.exchange().last_words()),
        }
    }
}

/// The text of a panic.
pub(super) fn panic_text(panic: &(dyn Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "without a message".to_owned())
}
