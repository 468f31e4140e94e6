//! A motion that ends early: the wiring check and the motion of an identification return after a first signal, and every other
//! maneuver comes to rest. Nothing leaves the range already covered.

use std::sync::{Arc, Mutex};

use crate::common::engine::{Run, prepare, run_under};
use crate::common::spring::Spring;
use gusset_control::engine::{Control, Ending, Experiment, Operator, Phase, PhaseCell, Stop};
use gusset_control::port::limits::{AxisLimits, Bound, Range};
use gusset_control::port::{Axis, AxisSpec, Exit, Exits, Pace, PortSpec, WiringCheck};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::Nanos;
use gusset_quantity::time::SimClock;
use gusset_record::Event;

const PERIOD: f64 = 1e-3;
const STIFFNESS: f64 = 2e5;
/// 20 ticks each way, and holds of 16.
const PROBE: Pace = Pace {
    ramp: 20,
    hold: 16,
    period_ns: 1_000_000,
};
const AMPLITUDE: f64 = 1e-3;
/// Limit of acceleration of the motion of an identification, in m/s².
const ACCEL: f64 = 20.0;
/// Beyond the force of every motion here.
const TRIPS_N: f64 = 1e5;

/// Every maneuver of a structure: a wiring check, zeroing, a static load, a ramp, warm-up, steps, a hold, and a return move or an
/// unloading.
const STRUCTURE: &str = "timing.warmup_ticks = 3\nsafety.zero_s = 0.005\nsafety.ramp_s = 0.02\nsafety.ease_s = 0.005\n\
    [time]\nrate_hz = 1000\nduration_s = 0.06\n[integrator]\nlambda = 2\n\
    [structure]\ninitial_displacement_m = [0.002]\n[structure.shear_building]\nmass_kg = [2e3]\nstiffness_n_per_m = [3e5]\n\
    [excitation.ground_acceleration.signal.sine]\namplitude = 5\nfrequency_hz = 2\n";
const LOADED: &str = "timing.warmup_ticks = 3\nsafety.zero_s = 0.005\nsafety.ramp_s = 0.02\nsafety.ease_s = 0.005\n\
    [time]\nrate_hz = 1000\nduration_s = 0.02\n[integrator]\nlambda = 2\n\
    [structure]\nstatic_load_n = [500.0]\n[structure.shear_building]\nmass_kg = [2e3]\nstiffness_n_per_m = [3e5]\n\
    [excitation.ground_acceleration.signal.sine]\namplitude = 5\nfrequency_hz = 2\n";
/// The motion of an identification.
const DRIVE: &str = "timing.warmup_ticks = 3\nsafety.zero_s = 0.005\nsafety.ramp_s = 0.02\nsafety.ease_s = 0.005\n\
    [time]\nrate_hz = 1000\nduration_s = 0.3\n[[specimen]]\nname = \"rig\"\nlaw.linear = { stiffness_n_per_m = 2e5 }\n\
    [[excitation.prescribed_displacement]]\nspecimen = \"rig\"\nease_in_s = 0.05\n\
    signal.sine = { amplitude = 0.004, frequency_hz = 5 }\n";

#[derive(Clone, Copy)]
struct Kind {
    text: &'static str,
    exit: fn() -> Exit,
    probes: bool,
    retraces: bool,
    holds: bool,
}

const KINDS: [Kind; 4] = [
    Kind {
        text: STRUCTURE,
        exit: || Exit::ZeroDisp,
        probes: true,
        retraces: false,
        holds: true,
    },
    Kind {
        text: STRUCTURE,
        exit: || Exit::ZeroForce,
        probes: false,
        retraces: false,
        holds: false,
    },
    Kind {
        text: LOADED,
        exit: || Exit::Freeze,
        probes: false,
        retraces: false,
        holds: false,
    },
    Kind {
        text: DRIVE,
        exit: || Exit::Freeze,
        probes: true,
        retraces: true,
        holds: true,
    },
];

/// The operator's commands, each when the command with that number leaves.
type Says = Vec<(usize, Operator)>;

/// The run, its commands, and the phase in which each left.
struct Ended {
    run: Run,
    way: Vec<f64>,
    phases: Vec<Phase>,
}

/// A spring that reads a force that trips at one command.
struct Rig {
    spring: Spring,
    trips: Option<usize>,
    told: usize,
}

impl Substructure for Rig {
    fn axes(&self) -> usize {
        1
    }
    fn coupling(&self) -> Coupling {
        self.spring.coupling()
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.told += 1;
        self.spring.issue(command)
    }
    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        self.spring.is_answered(wait_ns)
    }
    fn collect(&mut self, at: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let freshness = self.spring.collect(at, into);
        if self.trips == Some(self.told - 1) {
            into.force[0] = 2.0 * TRIPS_N;
        }
        freshness
    }
    fn retire(&mut self, how: Retirement) {
        self.spring.retire(how);
    }
}

fn experiment(
    kind: Kind,
    trips: Option<usize>,
    mut hears: impl FnMut(f64) + Send + 'static,
) -> Experiment {
    let mut experiment = prepare(kind.text).experiment;
    let spring = Rig {
        spring: Spring::new(STIFFNESS, move |command| hears(command.disp[0])),
        trips,
        told: 0,
    };
    let mut port = match experiment.ports.first_mut() {
        Some(_) => experiment.ports.remove(0).watched(|_, _| Box::new(spring)),
        None => {
            let axis = Axis::plain(vec![(0, 1.0)]);
            let axes = vec![AxisSpec::new(axis, STIFFNESS)];
            let mut spec = PortSpec::new("rig", Box::new(spring), 1, axes);
            spec.exits = Exits {
                at_end: (kind.exit)(),
                on_trip: Exit::Freeze,
                speed: 0.05,
                comes_to_rest: false,
            };
            spec.build().unwrap()
        }
    };
    let mut limits = AxisLimits::NONE;
    limits.set(Limit::MeasuredForce, Range::trip([-TRIPS_N, TRIPS_N]));
    if kind.retraces {
        limits.set(Limit::CommandAccel, Bound::trip(ACCEL));
    }
    port.set_limits(PERIOD, |_| (limits, (1.0, 1.0)));
    if kind.probes {
        *port.startup_mut().wiring_mut() = WiringCheck::Probe {
            amplitude: vec![AMPLITUDE],
            stiffness: vec![STIFFNESS],
            accepted: None,
            pace: PROBE,
            units: Vec::new(),
        };
    }
    experiment.ports.push(port);
    experiment.retraces = kind.retraces;
    experiment
}

/// Runs a test in which the operator gives these commands, each when the command with that number leaves.
fn ended(kind: Kind, says: Says) -> Ended {
    ended_or_tripped(kind, says, None)
}

fn ended_or_tripped(kind: Kind, says: Says, trips: Option<usize>) -> Ended {
    let (ask, requests) = crossbeam_channel::bounded(16);
    let cell = PhaseCell::default();
    let told: Arc<Mutex<Vec<(f64, Phase)>>> = Arc::default();
    let (hears, at) = (Arc::clone(&told), cell.clone());
    let holds: Says = if kind.holds {
        vec![(250, Operator::Hold), (270, Operator::Continue)]
    } else {
        Vec::new()
    };
    let experiment = experiment(kind, trips, move |disp| {
        let mut told = hears.lock().unwrap();
        for (_, word) in says
            .iter()
            .chain(&holds)
            .filter(|(place, _)| *place == told.len())
        {
            word.say_into(&ask).unwrap();
        }
        told.push((disp, at.get()));
    });
    let control = Control {
        phase: cell,
        ..Control::from(requests)
    };
    let run = run_under(experiment, SimClock::new(), &control);
    let (way, phases) = told.lock().unwrap().iter().copied().unzip();
    Ended { run, way, phases }
}

fn bits(way: &[f64]) -> Vec<u64> {
    way.iter().map(|disp| disp.to_bits()).collect()
}

fn retraced(run: &Run) -> Option<&str> {
    run.events.iter().find_map(|event| match &event.kind {
        Event::Retraced { what, .. } => Some(&**what),
        _ => None,
    })
}

/// The commands of a way back stay where it was passed, and end at the start.
fn goes_back(ended: &Ended, at: usize, start: f64) {
    let (passed, back) = ended.way.split_at(at + 1);
    let least = passed.iter().fold(f64::INFINITY, |m, d| m.min(*d));
    let most = passed.iter().fold(f64::NEG_INFINITY, |m, d| m.max(*d));
    assert_eq!(
        back.last().map(|disp| disp.to_bits()),
        Some(start.to_bits()),
        "{at}"
    );
    assert_eq!(retraced(&ended.run), Some("complete"), "{at}");
    // A brake at 18 m/s² stops 0.19 m/s in 1 mm.
    let slack = 1.1e-3;
    for disp in back {
        assert!(
            (least - slack..=most + slack).contains(disp),
            "{at}: {disp}"
        );
    }
}

/// After a stop the commands lose their speed within the limit of acceleration, and no later than that.
fn brakes(way: &[f64], at: usize) {
    let most = ACCEL * PERIOD * PERIOD;
    let step = |k: usize| way[k] - way.get(k.wrapping_sub(1)).unwrap_or(&way[k]);
    let ticks = (step(at).abs() / (0.9 * most)).ceil().max(1.0);
    assert_eq!(way.len() - at, ticks as usize, "{at}");
    let last = step(way.len() - 1);
    assert!(last.abs() <= most, "{at}: {last}");
    for k in at + 1..way.len() {
        let change = step(k) - step(k - 1);
        assert!(change.abs() <= most, "{at}: {change}");
        assert!(change * step(at) <= 0.0, "{at}: it goes faster");
    }
}

/// Every maneuver at every tick, or at a part of them: a first signal, two of them, a stop and a trip.
#[test]
fn each_maneuver_ends_at_each_tick() {
    let mut seen = Vec::new();
    for kind in KINDS {
        let whole = ended(kind, Vec::new());
        assert_eq!(whole.run.outcome.ending, Ending::Completed);
        for at in 0..whole.way.len() {
            let phase = whole.phases[at];
            if !seen.contains(&phase) {
                seen.push(phase);
            }
            let is_drive = kind.retraces && matches!(phase, Phase::Running | Phase::Holding);
            if phase != Phase::Probing && at % 3 != 0 {
                continue;
            }
            let stopped = ended(kind, vec![(at, Operator::Stop)]);
            let first = ended(kind, vec![(at, Operator::Interrupt)]);
            assert_eq!(bits(&stopped.way[..=at]), bits(&whole.way[..=at]));
            assert_eq!(retraced(&stopped.run), None);
            let is_last = at + 1 == whole.way.len();
            if !is_last && phase != Phase::Leaving {
                let by_operator = Ending::Stopped(Stop::Operator);
                assert_eq!(stopped.run.outcome.ending, by_operator, "{phase:?} {at}");
                assert_eq!(first.run.outcome.ending, by_operator, "{phase:?} {at}");
            }
            if (phase == Phase::Probing || is_drive) && (kind.exit)() == Exit::Freeze {
                brakes(&stopped.way, at);
            }
            let tripped = ended_or_tripped(kind, vec![(at, Operator::Interrupt)], Some(at));
            if phase != Phase::Zeroing && phase != Phase::Armed {
                assert_eq!(
                    bits(&tripped.way),
                    bits(&whole.way[..=at]),
                    "{phase:?} {at}: a trip"
                );
                assert_eq!(retraced(&tripped.run), None);
            }
            let moved = if is_drive {
                let begins = whole
                    .phases
                    .iter()
                    .position(|phase| *phase == Phase::Running);
                Some(whole.way[begins.unwrap() - 1])
            } else {
                (phase == Phase::Probing).then_some(whole.way[0])
            };
            let Some(start) = moved.filter(|start| *start != whole.way[at] && !is_last) else {
                if moved.is_none() {
                    assert_eq!(bits(&first.way), bits(&stopped.way), "{phase:?} {at}");
                    assert_eq!(retraced(&first.run), None);
                }
                continue;
            };
            goes_back(&first, at, start);
            // A second one ends the return.
            let freezes = at + 12;
            let twice = ended(
                kind,
                vec![(at, Operator::Interrupt), (freezes, Operator::Interrupt)],
            );
            if freezes + 1 < first.way.len() {
                let way = bits(&twice.way);
                assert_eq!(way[..=freezes], bits(&first.way[..=freezes]), "{at}");
                if kind.retraces {
                    brakes(&twice.way, freezes);
                } else {
                    assert_eq!(way.len(), freezes + 1, "{at}");
                }
                assert_eq!(retraced(&twice.run), Some("incomplete"));
            }
        }
    }
    for phase in [
        Phase::Probing,
        Phase::Zeroing,
        Phase::Settling,
        Phase::Ramping,
        Phase::Armed,
        Phase::Running,
        Phase::Holding,
        Phase::Leaving,
    ] {
        assert!(seen.contains(&phase), "{phase:?} was not ended");
    }
}
