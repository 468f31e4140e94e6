//! The life of a test: `Connected → Ready → Stopped → Retired`. Each transition consumes the state before it.
//!
//! The life cycle owns the ports. The running engine borrows them for one transition, inside a panic boundary: a panic in any
//! maneuver ends the transition, moves nothing more, and leaves the ports here. So every specimen receives its last message,
//! once, however the test ended, and a panic in one of these messages does not keep it from the others.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use super::columns::Row;
use super::commanding::{Commanding, Exchanges};
use super::cycle::Engine;
use super::deadlines::Deadlines;
use super::end_positions::{Ends, Left};
use super::environment::Environment;
use super::journal::Journal;
use super::operator::{Control, Watch};
use super::pace::Pace;
use super::phase::Phase;
use super::place::Place;
use super::shutdown::Shutdown;
use super::startup::Startup;
use super::step_progress::StepProgress;
use super::stepping::Stepping;
use super::supervision::Supervision;
use super::test_judge::TestJudge;
use super::tick::Tick;
use super::{
    Ending, Experiment, Outcome, PaceOutcome, Peaks, Plan, Resumption, Settling, Side, Stop,
};
use crate::port::{Port, Poses};
use crate::record::{Column, Event, GridOf, Recorder};
use crate::rt::timing::Timing;
use crate::state::{StateError, TestState};
use crate::substructure::Retirement;
use crate::time::{Clock, SimClock};

/// Largest model whose states are kept.
const MOST_DOFS_OF_A_STATE: usize = 10_000;

/// Everything of a test besides its ports.
pub(super) struct Parts {
    pub plan: Plan,
    pub side: Side,
    pub settling: Option<Settling>,
    pub peaks: Peaks,
    pub progress: StepProgress,
    pub exchanges: Exchanges,
    pub judge: TestJudge,
    pub environment: Environment,
    pub ends: Ends,
    /// Largest |force| of each axis of each specimen in the test that this one continues.
    earlier_forces: Vec<Vec<f64>>,
}

/// Something to do on the loop's own thread just before the first and just after the last tick of the test: tests put a guard
/// there that counts system calls and allocations.
#[derive(Default)]
struct Watches {
    before_first_tick: Option<Watch>,
    after_last_tick: Option<Watch>,
}

/// The content of every state of the life cycle.
struct Test {
    ports: Vec<Port>,
    parts: Box<Parts>,
    watches: Watches,
    resume: Option<Resumption>,
    columns: Vec<Column>,
}

/// A test whose specimens are connected. Nothing has moved.
#[derive(Debug)]
pub struct Connected(Test);

/// A test whose specimens are armed and at their first targets. The next tick is the first of the test.
#[derive(Debug)]
pub struct Ready(Test);

/// A test that has ended. Its specimens hold their last commands.
#[derive(Debug)]
pub struct Stopped {
    test: Test,
    ending: Ending,
    fault: Option<String>,
}

/// A test whose specimens received their last message.
#[derive(Debug)]
pub struct Retired {
    /// The results of the test; none if the record of its end panicked.
    pub outcome: Option<Outcome>,
    /// The text of a panic of the program.
    pub fault: Option<String>,
    /// How far the platform of each specimen went; none where its axes are no actuators of one.
    pub poses: Vec<Option<Poses>>,
}

/// The end of a recorded test that was retraced.
#[derive(Debug)]
pub struct Retraced {
    /// How it ended.
    pub ending: Ending,
    /// The numerical side, the ports and the rest of its state; none if it ended before its first step.
    pub state: Option<(Side, Vec<Port>, Resumption)>,
}

impl Retired {
    /// The outcome of a test without physical specimens. A panic of the program continues as a panic.
    #[must_use]
    pub fn into_outcome(self) -> Outcome {
        match (self.outcome, self.fault) {
            (Some(outcome), None) => outcome,
            (_, fault) => resume_unwind(Box::new(fault.unwrap_or_default())),
        }
    }
}

impl std::fmt::Debug for Test {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Test")
            .field("ports", &self.ports)
            .finish_non_exhaustive()
    }
}

impl Connected {
    /// Allocates everything that the loop will ever need.
    #[must_use]
    pub fn new(experiment: Experiment, clock: Box<dyn Clock>, recorder: Box<dyn Recorder>) -> Self {
        let ports = &experiment.ports;
        let names: Vec<&str> = ports.iter().map(|port| port.name()).collect();
        let remote = ports.iter().any(Port::is_remote);
        let timing = if clock.is_simulated() {
            Timing::untouched
        } else {
            Timing::new
        };
        let timing = timing(&names, remote, experiment.limits.warmup_ticks);
        Self(Test::new(timing, experiment, clock, recorder))
    }

    /// The replay of a recorded test, whose histograms stay empty.
    #[must_use]
    pub fn for_a_replay(experiment: Experiment, recorder: Box<dyn Recorder>) -> Self {
        let clock = Box::new(SimClock::new());
        Self(Test::new(Timing::counting(), experiment, clock, recorder))
    }

    /// Calls `before` on the loop's thread when the warm-up is over, and `after` when the last tick is over.
    #[must_use]
    pub fn watched(mut self, before: Option<Watch>, after: Option<Watch>) -> Self {
        self.0.watches = Watches {
            before_first_tick: before,
            after_last_tick: after,
        };
        self
    }

    /// Names, units and meanings of the columns of the rows.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.0.columns
    }

    /// Runs the test to its end, whatever the end is. Every specimen is retired on return.
    pub fn run(self, control: &Control) -> Retired {
        let stopped = match self.start(control) {
            Ok(ready) => ready.run(),
            Err(stopped) => *stopped,
        };
        stopped.shut_down().retire()
    }

    /// The startup.
    ///
    /// # Errors
    /// The test ended in it.
    pub fn start(self, control: &Control) -> Result<Ready, Box<Stopped>> {
        let Self(mut test) = self;
        test.attend(control);
        let resume = test.resume.take();
        match test.guarded(|engine, _| Startup::perform(resume, engine)) {
            Ok(Ok(())) => Ok(Ready(test)),
            Ok(Err(stop)) => Err(Box::new(Stopped {
                test,
                ending: Ending::Stopped(stop),
                fault: None,
            })),
            Err(fault) => Err(Box::new(Stopped::by_panic(test, fault))),
        }
    }

    /// Retraces a recorded test to the end of the recording. No specimen is retired.
    #[must_use]
    pub fn retrace(self, control: &Control) -> Retraced {
        let Self(mut test) = self;
        test.attend(control);
        test.ports.iter_mut().for_each(Port::follow_compensation);
        let resume = test.resume.take();
        let (mut engine, watches) = test.engine();
        let ending: Ending = Startup::perform(resume, &mut engine)
            .and_then(|()| run_steps(&mut engine, watches))
            .into();
        test.into_retraced(ending)
    }

    /// Retraces a recorded test from this state to the end of the recording, which begins with the row after it. No specimen is
    /// retired.
    ///
    /// # Errors
    /// The state does not belong to this test. Nothing was retraced.
    pub fn retrace_from(
        self,
        state: &TestState,
        control: &Control,
    ) -> Result<Retraced, StateError> {
        let Self(mut test) = self;
        test.attend(control);
        test.ports.iter_mut().for_each(Port::follow_compensation);
        let (mut engine, _) = test.engine();
        let mut last = Tick::before_start(0.0);
        state.restore(|visit| engine.state(&mut last).0.visit_state(visit))?;
        let mut steps = Stepping::after(last, engine.side);
        engine.environment.supervision.continue_running();
        engine.environment.pace.begin();
        let ending = perform_steps(&mut engine, &mut steps).into();
        Ok(test.into_retraced(ending))
    }
}

impl Ready {
    /// Runs the test from its first target to its last.
    #[must_use]
    pub fn run(self) -> Stopped {
        let Self(mut test) = self;
        match test.guarded(run_steps) {
            Ok(result) => Stopped {
                test,
                ending: result.into(),
                fault: None,
            },
            Err(fault) => Stopped::by_panic(test, fault),
        }
    }
}

impl Stopped {
    /// After a panic nothing more is moved.
    fn by_panic(test: Test, fault: String) -> Self {
        Self {
            test,
            ending: Ending::Stopped(Stop::Internal),
            fault: Some(fault),
        }
    }

    /// The shutdown: specimens are moved to where they are to be left, unless a panic has ended the test.
    #[must_use]
    pub fn shut_down(mut self) -> Self {
        if self.fault.is_none() {
            let ending = self.ending;
            let moved = (self.test).guarded(|engine, _| Shutdown::perform(ending, engine));
            match moved {
                Ok(ending) => self.ending = ending,
                Err(fault) => self.note_panic(fault),
            }
        }
        self
    }

    /// Every specimen receives its last message, and the record is closed.
    #[must_use]
    pub fn retire(mut self) -> Retired {
        self.send_last_messages();
        let ending = self.ending;
        let test = &mut self.test;
        let closed = catch_unwind(AssertUnwindSafe(|| test.close(ending)));
        Retired {
            outcome: closed.ok(),
            fault: self.fault,
            poses: self.test.ports.iter().map(Port::poses).collect(),
        }
    }

    fn note_panic(&mut self, fault: String) {
        self.ending = Ending::Stopped(Stop::Internal);
        match &mut self.fault {
            None => self.fault = Some(fault),
            Some(first) => {
                first.push_str("; retiring a specimen failed too: ");
                first.push_str(&fault);
            }
        }
    }

    fn send_last_messages(&mut self) {
        for index in 0..self.test.ports.len() {
            let how = if self.fault.is_some() {
                Retirement::Tripped
            } else {
                self.ending.cause().into()
            };
            let Some(port) = self.test.ports.get_mut(index) else {
                break;
            };
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| port.retire(how))) {
                self.note_panic(panic_text(panic.as_ref()));
            }
        }
    }
}

/// Runs the steps of the test, from its first tick to its last.
fn run_steps(engine: &mut Engine<'_>, watches: &mut Watches) -> Result<(), Stop> {
    engine.environment.enter(Phase::Running, Ending::Completed);
    engine.ports.iter_mut().for_each(Port::begin_compensation);
    engine.environment.report_now(Event::Started);
    let mut steps = Stepping::new(engine.side);
    if let Some(watch) = &mut watches.before_first_tick {
        watch();
    }
    engine.environment.pace.begin_test();
    engine.environment.report_grid(GridOf::Test);
    // A hold that was asked for before: nothing moves until the operator continues.
    if engine.environment.supervision.is_held() {
        engine.progress.stand();
    }
    let result = perform_steps(engine, &mut steps);
    if let Some(watch) = &mut watches.after_last_tick {
        watch();
    }
    result
}

fn perform_steps(engine: &mut Engine<'_>, steps: &mut Stepping) -> Result<(), Stop> {
    engine.exchanges.commanding = Commanding::EveryStep;
    let result = engine.perform(steps);
    engine.exchanges.commanding = Commanding::EveryTick;
    for port in &mut *engine.ports {
        port.is_told_by_steps(false);
    }
    engine.environment.deadlines.flush();
    result
}

impl Test {
    fn new(
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
        } = experiment;
        let (row, columns) = Row::new((&record_dofs, &rotations), &side, &ports);
        let dofs = match &side {
            Side::Structure(numerical) => numerical.structure.dofs(),
            Side::Prescribed(_) => 0,
        };
        let per_step = ports.iter().any(Port::is_per_step);
        let environment = Environment {
            pace: Pace::new(clock, period, limits.on_miss),
            deadlines: Deadlines::new(timing, &limits.test, per_step),
            supervision: Supervision::new(Control::unattended()),
            journal: Journal::new(row, columns.len(), recorder),
            place: Place::start(dt),
        };
        let earlier = resume.as_ref().map(|resume| resume.earlier.forces.clone());
        let parts = Parts {
            side,
            settling,
            peaks: Peaks::zeros(dofs),
            progress: StepProgress::new(pacing),
            exchanges: Exchanges::new(),
            judge: TestJudge::new(limits.test.clone()),
            environment,
            ends: Ends::new(ports.len()),
            earlier_forces: earlier.unwrap_or_default(),
            plan: Plan {
                dt,
                steps,
                opening,
                limits,
                checkpoint_ticks: pacing.checkpoint_ticks,
                keeps_state: dofs <= MOST_DOFS_OF_A_STATE,
            },
        };
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

    fn attend(&mut self, control: &Control) {
        let supervision = &mut self.parts.environment.supervision;
        supervision.attend(control.clone());
    }

    fn into_retraced(self, ending: Ending) -> Retraced {
        let Parts {
            side,
            environment,
            progress,
            exchanges,
            peaks,
            ..
        } = *self.parts;
        let numbers = (exchanges.sequence(), environment.place.steps_done());
        let phase = environment.supervision.phase();
        let state = Resumption::of(phase, progress, numbers, peaks);
        Retraced {
            ending,
            state: state.map(|resumption| (side, self.ports, resumption)),
        }
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

    fn engine(&mut self) -> (Engine<'_>, &mut Watches) {
        let parts = &mut *self.parts;
        let engine = Engine {
            plan: &parts.plan,
            ports: &mut self.ports,
            side: &mut parts.side,
            settling: &mut parts.settling,
            peaks: &mut parts.peaks,
            progress: &mut parts.progress,
            exchanges: &mut parts.exchanges,
            judge: &mut parts.judge,
            environment: &mut parts.environment,
            ends: &mut parts.ends,
        };
        (engine, &mut self.watches)
    }

    /// Lets the engine run inside the panic boundary; a panic comes back in words.
    fn guarded<R>(
        &mut self,
        work: impl FnOnce(&mut Engine<'_>, &mut Watches) -> R,
    ) -> Result<R, String> {
        let (mut engine, watches) = self.engine();
        let work = AssertUnwindSafe(|| work(&mut engine, watches));
        catch_unwind(work).map_err(|panic| panic_text(panic.as_ref()))
    }

    /// The record of the end, after the last messages.
    fn close(&mut self, ending: Ending) -> Outcome {
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
            if port.lacks_acknowledgement() && !port.is_gone() {
                unheard.push(index);
                if port.stale_in_a_row() > 0 || port.owes() {
                    *left = Left::Lost;
                }
                environment.report_now(Event::Unacknowledged { port: index as u32 });
            }
        }
        ends.unheard = unheard;
        // Without an answer to the last message, the owed reply would have been the last one.
        for (port, left) in self.ports.iter().zip(&mut ends.left) {
            if port.needs_no_acknowledgement() && port.is_left_owing() && !port.is_gone() {
                *left = Left::Lost;
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

    /// Largest |force| per axis of each specimen, over the whole test. A shutdown knows its own only: what tripped the test before
    /// is no force that it may come to again.
    fn peak_forces(&self) -> impl Iterator<Item = Vec<f64>> {
        let before = self.parts.earlier_forces.iter().map(Vec::as_slice);
        let before = before.chain(std::iter::repeat(&[][..]));
        self.ports.iter().zip(before).map(|(port, before)| {
            let before = before.iter().copied().chain(std::iter::repeat(0.0));
            let each = port.peak_force().iter().zip(before);
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
        Outcome {
            ending,
            unfinished: ends.unfinished,
            left: ends.left.clone(),
            unheard: ends.unheard.clone(),
            unarmed: ends.unarmed.clone(),
            holders: self.ports.iter().map(Port::left_to).collect(),
            steps: place.steps_done(),
            peaks: self.parts.peaks.clone(),
            ports: (self.ports.iter().zip(self.peak_forces()))
                .map(|(port, forces)| (port.name().to_owned(), forces, port.link_count()))
                .collect(),
            forces_on_the_way_in: (self.ports.iter())
                .map(|port| port.force_at_startup().to_vec())
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
            complaints: self.said(Port::complaint),
            last_words: self.said(Port::last_words),
        }
    }
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "without a message".to_owned())
}
