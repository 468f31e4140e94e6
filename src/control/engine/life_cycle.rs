//! The life of a test: `Connected → Ready → Stopped → Retired`. Each transition consumes the state before it.
//!
//! The life cycle owns the ports. The running engine borrows them for one transition, inside a panic boundary: a panic in any
//! maneuver ends the transition, moves nothing more, and leaves the ports here. So every connected specimen receives its last message,
//! once, however the test ended, and a panic in one of these messages does not keep it from the others.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use super::commanding::Commanding;
use super::cycle::Engine;
use super::operator::{Control, Watch};
use super::owned_test::{Parts, Test, Watches, panic_text};
use super::phase::Phase;
use super::shutdown::Shutdown;
use super::startup::Startup;
use super::stepping::Stepping;
use super::tick::Tick;
use super::{Ending, Experiment, Outcome, Resumption, Side, Stop};
use crate::port::{Port, Poses};
use gusset_quantity::state::{StateError, Stateful, TestState};
use gusset_quantity::substructure::Retirement;
use gusset_quantity::time::{Clock, SimClock};
use gusset_record::rt::timing::Timing;
use gusset_record::{Column, Event, GridOf, Recorder};

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
    ports: Vec<Port>,
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
    /// How far the platform of each specimen went; none where its axes are no actuators of one.
    #[must_use]
    pub fn poses(&self) -> Vec<Option<Poses>> {
        self.ports.iter().map(Port::poses).collect()
    }

    /// The outcome of a test without physical specimens. A panic of the program continues as a panic.
    #[must_use]
    pub fn into_outcome(self) -> Outcome {
        match (self.outcome, self.fault) {
            (Some(outcome), None) => outcome,
            (_, fault) => resume_unwind(Box::new(fault.unwrap_or_default())),
        }
    }
}

impl Connected {
    /// Allocates everything that the loop will ever need.
    #[must_use]
    pub fn new(experiment: Experiment, clock: Box<dyn Clock>, recorder: Box<dyn Recorder>) -> Self {
        let ports = &experiment.ports;
        let names: Vec<&str> = ports.iter().map(|port| port.name()).collect();
        let remote = ports.iter().any(|port| port.exchange().is_remote());
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
    pub fn for_a_replay(mut experiment: Experiment, recorder: Box<dyn Recorder>) -> Self {
        // The record says whether they went back.
        experiment.retraces = true;
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
            Ok(Err(stop)) => Err(Box::new(Stopped::by(test, Ending::Stopped(stop)))),
            Err(fault) => Err(Box::new(Stopped::by_fault(test, fault))),
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
        retraced(test, ending)
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
        Ok(retraced(test, ending))
    }
}

impl Ready {
    /// Runs the test from its first target to its last.
    #[must_use]
    pub fn run(self) -> Stopped {
        let Self(mut test) = self;
        match test.guarded(run_steps) {
            Ok(result) => Stopped::by(test, result.into()),
            Err(fault) => Stopped::by_fault(test, fault),
        }
    }
}

impl Stopped {
    /// A part of the loop that does not exist is as bad as a panic.
    fn by(test: Test, ending: Ending) -> Self {
        match ending {
            Ending::Stopped(stop @ Stop::NoSuchPart { .. }) => {
                Self::by_fault(test, stop.to_string())
            }
            _ => Self {
                test,
                ending,
                fault: None,
            },
        }
    }

    /// After a panic nothing more is moved.
    fn by_fault(test: Test, fault: String) -> Self {
        Self {
            test,
            ending: Ending::Stopped(Stop::Internal),
            fault: Some(fault),
        }
    }

    /// The shutdown: specimens are moved to where they are to be left, unless an internal fault has ended the test.
    #[must_use]
    fn shut_down(mut self) -> Self {
        if self.fault.is_none() {
            let ending = self.ending;
            let moved = (self.test).guarded(|engine, _| Shutdown::perform(ending, engine));
            match moved {
                Ok(Ending::Stopped(stop @ Stop::NoSuchPart { .. })) => {
                    self.note_panic(stop.to_string());
                }
                Ok(ending) => self.ending = ending,
                Err(fault) => self.note_panic(fault),
            }
        }
        self
    }

    /// The shutdown of a process that may be killed in it.
    #[cfg(feature = "test-doubles")]
    #[must_use]
    pub fn shut_down_alone(self) -> Self {
        self.shut_down()
    }

    /// Every specimen receives its last message, and the record is closed.
    #[must_use]
    pub fn retire(mut self) -> Retired {
        self.await_release();
        self.send_last_messages();
        let ending = self.ending;
        let test = &mut self.test;
        let closed = catch_unwind(AssertUnwindSafe(|| test.close(ending)));
        Retired {
            outcome: closed.ok(),
            fault: self.fault,
            ports: self.test.ports,
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

    /// The message of the last of all messages: how the test ended.
    fn retirement(&self) -> Retirement {
        if self.fault.is_some() {
            Retirement::Tripped
        } else {
            self.ending.cause().into()
        }
    }

    /// Every specimen comes to rest. Where a drive holds one with torque, the operator says when it is unloaded: no other request,
    /// and no time limit, removes the torque.
    fn await_release(&mut self) {
        let how = self.retirement();
        let mut holds = false;
        let mut ports = std::mem::take(&mut self.test.ports);
        for port in &mut ports {
            match catch_unwind(AssertUnwindSafe(|| port.exchange_mut().settle(how))) {
                Ok(by_torque) => holds |= by_torque,
                Err(panic) => self.note_panic(panic_text(panic.as_ref())),
            }
        }
        self.test.ports = ports;
        let supervision = &mut self.test.parts.environment.supervision;
        if holds {
            supervision.await_release();
        }
    }

    fn send_last_messages(&mut self) {
        let mut ports = std::mem::take(&mut self.test.ports);
        for port in &mut ports {
            let how = self.retirement();
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| port.exchange_mut().retire(how))) {
                self.note_panic(panic_text(panic.as_ref()));
            }
        }
        self.test.ports = ports;
    }
}

/// Runs the steps of the test, from its first tick to its last.
fn run_steps(engine: &mut Engine<'_>, watches: &mut Watches) -> Result<(), Stop> {
    engine.environment.enter(Phase::Running, Ending::Completed);
    engine.ports.iter_mut().for_each(Port::begin_compensation);
    engine.environment.report_now(Event::Started);
    if engine.environment.supervision.retraces() {
        engine.ports.iter_mut().for_each(Port::begin_retraceable);
    }
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
        port.guard_mut().is_told_by_steps(false);
    }
    engine.environment.deadlines.flush();
    result
}

/// The state that a retraced test came to.
fn retraced(test: Test, ending: Ending) -> Retraced {
    let Parts {
        side,
        environment,
        progress,
        exchanges,
        peaks,
        ..
    } = *test.parts;
    let numbers = (exchanges.sequence(), environment.place.steps_done());
    let phase = environment.supervision.phase();
    let state = Resumption::of(phase, progress, numbers, peaks);
    Retraced {
        ending,
        state: state.map(|resumption| (side, test.ports, resumption)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Limits, OnMiss, Pacing, StartupSettings, TestLimits};
    use crate::port::{Axis, AxisSpec, PortSpec};
    use gusset_quantity::substructure::{Command, Freshness, LinkFault, Measurement, Substructure};
    use gusset_quantity::time::{Nanos, Ratio};
    use gusset_record::MemoryRecorder;
    use std::sync::{Arc, Mutex};

    /// Commands that came, and the last message.
    type Log = Arc<Mutex<(u32, Option<Retirement>)>>;

    /// A specimen that writes down what comes.
    struct Rig(Log);

    impl Substructure for Rig {
        fn axes(&self) -> usize {
            1
        }
        fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
            self.0.lock().unwrap().0 += 1;
            Ok(())
        }
        fn collect(&mut self, _: Nanos, _: &mut Measurement) -> Result<Freshness, LinkFault> {
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, how: Retirement) {
            self.0.lock().unwrap().1 = Some(how);
        }
    }

    fn experiment(log: &Log) -> Experiment {
        let axes = vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 1e5)];
        let rig = Box::new(Rig(Arc::clone(log)));
        Experiment {
            dt: 0.01,
            period: Ratio::new(1, 100).unwrap(),
            steps: 10,
            side: Side::Prescribed(vec![None]),
            opening: StartupSettings::default(),
            settling: None,
            ports: vec![PortSpec::new("rig", rig, 1, axes).build().unwrap()],
            record_dofs: Vec::new(),
            rotations: Vec::new(),
            limits: Limits {
                on_miss: OnMiss::Stretch,
                extrapolate_stale: false,
                stale_in_a_row: 0,
                reply_timeout_ns: 1_000_000,
                warmup_ticks: 0,
                divergence: f64::INFINITY,
                test: TestLimits::NONE,
            },
            pacing: Pacing::default(),
            resume: None,
            retraces: false,
            followed: None,
        }
    }

    #[test]
    fn a_part_that_is_not_there_ends_the_test() {
        let log = Log::default();
        let recorder = MemoryRecorder::with_capacity(64, 64, 64);
        let clock = Box::new(SimClock::new());
        let Connected(mut test) = Connected::new(experiment(&log), clock, Box::new(recorder));
        let Ok(Ok(())) = test.guarded(|engine, _| Startup::perform(None, engine)) else {
            panic!("the startup is complete")
        };
        let commands = log.lock().unwrap().0;
        let part = "specimen";
        let found = test.guarded(|engine, _| {
            let stamps = &mut Default::default();
            engine.collect_from(7, &Tick::before_start(0.0), stamps, true)
        });
        let stop = Stop::NoSuchPart { part, index: 7 };
        assert_eq!(found, Ok(Err(stop)));
        let stopped = Stopped::by(test, Ending::Stopped(stop));
        let retired = stopped.shut_down().retire();
        // Nothing more is moved, and the specimen is held.
        let (after, last) = *log.lock().unwrap();
        assert_eq!((after, last), (commands, Some(Retirement::Tripped)));
        assert!(retired.fault.unwrap().contains("specimen 8"));
        let ending = retired.outcome.unwrap().ending;
        assert_eq!(ending, Ending::Stopped(Stop::Internal));
    }
}
