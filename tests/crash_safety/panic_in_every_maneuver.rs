//! A panic in any maneuver, at any call of a specimen: nothing moves after it, and every specimen receives its last
//! message exactly once.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use crate::common::engine::prepare;
use gusset_control::engine::{
    Connected, Control, Ending, Experiment, Notice, Operator, Phase, PhaseCell, Stop,
};
use gusset_control::port::{Pace, WiringCheck};
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_record::MemoryRecorder;

/// Every maneuver: wiring check, zeroing with confirmation, static load, ramp, warm-up, steps, hold and shutdown.
const TEST: &str = r#"title = "Two columns"
[time]
rate_hz = 200
duration_s = 1
clock = "simulated"
[structure]
initial_displacement_m = [0.01]
[structure.matrices]
mass = [[8e3]]
damping = [[12e3]]
stiffness = [[0]]
[structure.gravity]
influence = [-1]
[safety]
ramp_s = 0.2
zero_s = 0.05
confirm = true
at_end = "zero_displacement"
exit_speed_m_per_s = 0.05
[excitation.ground_acceleration.signal.sine]
amplitude = 1.0
frequency_hz = 5.0
[[specimen]]
name = "one"
rows = [[1]]
law.linear = { stiffness_n_per_m = 2e6 }
[[specimen]]
name = "two"
rows = [[1]]
law.linear = { stiffness_n_per_m = 2e6 }
"#;

/// The phases that a test passes through while its specimens are commanded.
const PHASES: [Phase; 8] = [
    Phase::Probing,
    Phase::Zeroing,
    Phase::Settling,
    Phase::Ramping,
    Phase::Armed,
    Phase::Running,
    Phase::Holding,
    Phase::Leaving,
];

/// A call of a specimen in which the panic happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Call {
    Issue,
    Collect,
    Accepted,
}

/// What both specimens share.
struct Shared {
    phase: PhaseCell,
    at: Option<(Phase, Call)>,
    has_panicked: AtomicBool,
    commands_after: AtomicUsize,
    seen: Mutex<Vec<Phase>>,
}

/// A specimen that panics in one call of one phase.
struct Panicking {
    inner: Box<dyn Substructure>,
    shared: Arc<Shared>,
    panics: bool,
    goodbyes: Arc<AtomicUsize>,
}

impl Panicking {
    fn at(&self, call: Call) {
        let phase = self.shared.phase.get();
        let mut seen = self.shared.seen.lock().unwrap();
        if !seen.contains(&phase) {
            seen.push(phase);
        }
        drop(seen);
        if self.panics && self.shared.at == Some((phase, call)) {
            self.shared.has_panicked.store(true, Ordering::SeqCst);
            panic!("a bug in {call:?} of {phase:?}");
        }
    }
}

impl Substructure for Panicking {
    fn axes(&self) -> usize {
        self.inner.axes()
    }
    fn coupling(&self) -> Coupling {
        self.inner.coupling()
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        if self.shared.has_panicked.load(Ordering::SeqCst) {
            self.shared.commands_after.fetch_add(1, Ordering::SeqCst);
        }
        self.at(Call::Issue);
        self.inner.issue(command)
    }
    fn collect(&mut self, at: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.at(Call::Collect);
        self.inner.collect(at, into)
    }
    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        self.at(Call::Accepted);
        self.inner.accepted(sequence)
    }
    fn retire(&mut self, how: Retirement) {
        self.goodbyes.fetch_add(1, Ordering::SeqCst);
        self.inner.retire(how);
    }
}

/// A simulated clock on which the operator confirms the readings, and holds the test for a while.
struct Attended {
    clock: SimClock,
    phase: PhaseCell,
    operator: crossbeam_channel::Sender<Operator>,
    notices: crossbeam_channel::Receiver<Notice>,
    ticks: AtomicUsize,
}

impl Clock for Attended {
    fn now(&self) -> Nanos {
        self.clock.now()
    }
    fn sleep_until(&self, at: Nanos) {
        while let Ok(notice) = self.notices.try_recv() {
            if notice == Notice::AwaitingConfirmation {
                self.operator.try_send(Operator::Confirm).unwrap();
            }
        }
        let glimpse = self.phase.glimpse();
        if matches!(glimpse.phase, Phase::Running | Phase::Holding) {
            match self.ticks.fetch_add(1, Ordering::Relaxed) {
                3 => self.operator.try_send(Operator::Hold).unwrap(),
                400 => self.operator.try_send(Operator::Continue).unwrap(),
                _ => {}
            }
        }
        self.clock.sleep_until(at);
    }
    fn is_simulated(&self) -> bool {
        true
    }
}

/// How a test ended in which the first specimen panics at a call of a phase: its ending, the goodbyes of both specimens,
/// the commands after the panic, and the phases that it came to.
fn run(at: Option<(Phase, Call)>) -> (Ending, bool, [usize; 2], usize, Vec<Phase>) {
    let mut experiment: Experiment = prepare(TEST).experiment;
    let (operator, requests) = crossbeam_channel::bounded(4);
    let (notices, told) = crossbeam_channel::bounded(16);
    let control = Control {
        notices,
        ..Control::from(requests)
    };
    let shared = Arc::new(Shared {
        phase: control.phase.clone(),
        at,
        has_panicked: AtomicBool::new(false),
        commands_after: AtomicUsize::new(0),
        seen: Mutex::default(),
    });
    let goodbyes = [(); 2].map(|()| Arc::new(AtomicUsize::new(0)));
    let ports = std::mem::take(&mut experiment.ports);
    experiment.ports = ports
        .into_iter()
        .zip(&goodbyes)
        .enumerate()
        .map(|(index, (mut port, goodbyes))| {
            *port.startup_mut().wiring_mut() = WiringCheck::Probe {
                amplitude: vec![1e-4],
                stiffness: vec![2e6],
                accepted: None,
                pace: Pace::of(0.05, 0.005),
                units: Vec::new(),
            };
            port.watched(|inner, _| {
                Box::new(Panicking {
                    inner,
                    shared: Arc::clone(&shared),
                    panics: index == 0,
                    goodbyes: Arc::clone(goodbyes),
                })
            })
        })
        .collect();
    let clock = Attended {
        clock: SimClock::new(),
        phase: control.phase.clone(),
        operator,
        notices: told,
        ticks: AtomicUsize::new(0),
    };
    let columns = experiment.columns().len();
    let recorder = MemoryRecorder::with_capacity(columns, 8192, 256);
    let retired = Connected::new(experiment, Box::new(clock), Box::new(recorder)).run(&control);
    let ending = retired.outcome.expect("the record of the end").ending;
    let seen = shared.seen.lock().unwrap().clone();
    (
        ending,
        retired.fault.is_some(),
        goodbyes.map(|count| count.load(Ordering::SeqCst)),
        shared.commands_after.load(Ordering::SeqCst),
        seen,
    )
}

#[test]
fn test_passes_through_every_maneuver() {
    let (ending, has_fault, goodbyes, _, seen) = run(None);
    assert_eq!((ending, has_fault), (Ending::Completed, false));
    assert_eq!(goodbyes, [1, 1]);
    for phase in PHASES {
        assert!(seen.contains(&phase), "{phase:?} is not in {seen:?}");
    }
}

#[test]
fn panic_in_any_maneuver_retires_everyone() {
    for phase in PHASES {
        for call in [Call::Issue, Call::Collect, Call::Accepted] {
            // Nothing is accepted where nothing has moved for the test.
            let accepts = !matches!(
                phase,
                Phase::Probing | Phase::Zeroing | Phase::Armed | Phase::Holding
            );
            if call == Call::Accepted && !accepts {
                continue;
            }
            let (ending, has_fault, goodbyes, after, _) = run(Some((phase, call)));
            assert_eq!(
                ending,
                Ending::Stopped(Stop::Internal),
                "{call:?} of {phase:?}"
            );
            assert!(has_fault, "{call:?} of {phase:?}");
            assert_eq!((goodbyes, after), ([1, 1], 0), "{call:?} of {phase:?}");
        }
    }
}
