//! The life of a test from the connection to the goodbye: zero, ramp, run, hold, return, retire. Nothing jumps, nothing is lost,
//! and the cause of the end is known.

use crate::common::test_file::TestFile;
use std::sync::{Arc, Mutex};

use crate::common::engine::{Run, prepare, run_on, run_under};
use crate::common::rig;
use crate::common::spring::Spring;
use gusset_control::engine::{Control, EndPosition, Ending, Experiment, Operator, Phase, Stop};
use gusset_control::port::limits::{AxisLimits, Bound, Hit, Range};
use gusset_control::port::{Axis, AxisSpec, Exit, Exits, PortSpec, Reference, UnloadFailure, Zero};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::Coupling;
use gusset_quantity::time::SimClock;
use gusset_record::{Event, Word};
use gusset_session::ending;

/// 1 kHz in wall and test time; one storey of 2 t on 3e5 N/m, beside the specimen.
const PERIOD: f64 = 1e-3;
const STIFFNESS: f64 = 2e5;

/// A test with one spring.
struct Lab {
    text: String,
    bias: [f64; 2],
    at: Box<dyn FnMut(u64) + Send>,
    limits: AxisLimits,
    exits: Exits,
    reference: Reference,
    offset: f64,
}

impl Lab {
    fn new(more: &str) -> Self {
        Self {
            text: format!(
                "{more}\n[time]\nrate_hz = 1000\nduration_s = 0.5\n[integrator]\nlambda = 2\n\
                 [structure.shear_building]\nmass_kg = [2e3]\nstiffness_n_per_m = [3e5]\n\
                 [excitation.ground_acceleration.signal.sine]\namplitude = 5\nfrequency_hz = 2\n"
            ),
            bias: [0.0; 2],
            at: Box::new(|_| {}),
            limits: AxisLimits::NONE,
            exits: Exits::default(),
            reference: Reference::default(),
            offset: 0.0,
        }
    }

    fn experiment(self) -> (Experiment, Arc<Mutex<Vec<f64>>>) {
        let mut experiment = prepare(&self.text).experiment;
        let way: Arc<Mutex<Vec<f64>>> = Arc::default();
        let (went, mut at) = (Arc::clone(&way), self.at);
        let mut spring = Spring::new(STIFFNESS, move |command| {
            went.lock().unwrap().push(command.disp[0]);
            at(command.sequence);
        });
        (spring.place, spring.bias) = (self.offset, self.bias);
        let mut axis = Axis::plain(vec![(0, 1.0)]);
        axis.disp_offset = self.offset;
        let axis = AxisSpec {
            limits: self.limits,
            reference: self.reference,
            ..AxisSpec::new(axis, STIFFNESS)
        };
        let mut spec = PortSpec::new("rig", Box::new(spring), 1, vec![axis]);
        (spec.tick, spec.exits) = (PERIOD, self.exits);
        experiment.ports.push(spec.build().unwrap());
        (experiment, way)
    }

    fn run(self) -> (Run, Vec<f64>) {
        let (experiment, way) = self.experiment();
        let run = run_on(experiment, SimClock::new());
        let way = way.lock().unwrap().clone();
        (run, way)
    }

    /// An operator gives each of these commands when the command with that number leaves.
    fn run_with_operator(mut self, says: &'static [(u64, Operator)]) -> (Run, Vec<f64>) {
        let (ask, requests) = crossbeam_channel::bounded(8);
        self.at = Box::new(move |sequence| {
            for (_, word) in says.iter().filter(|(at, _)| *at == sequence) {
                ask.send(*word).unwrap();
            }
        });
        let (experiment, way) = self.experiment();
        let run = run_under(experiment, SimClock::new(), &Control::from(requests));
        let way = way.lock().unwrap().clone();
        (run, way)
    }
}

const SHORT: &str = "timing.warmup_ticks = 3\nsafety.zero_s = 0.005\nsafety.ease_s = 0";

/// The phases that were entered, in order.
fn phases(run: &Run) -> Vec<&'static str> {
    let events = run.events.iter().filter_map(|event| match event.kind {
        Event::Phase { to, .. } => Some(to.word()),
        _ => None,
    });
    events.collect()
}

fn largest_step(way: &[f64]) -> f64 {
    let steps = way.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    steps.fold(0.0, f64::max)
}

#[test]
fn test_elsewhere_ramps_and_arms() {
    let lab = Lab::new(&format!(
        "{SHORT}\nstructure.initial_displacement_m = [0.02]"
    ));
    let (run, way) = lab.run();
    assert_eq!(
        phases(&run),
        ["zeroing", "ramping", "armed", "running", "safe"]
    );
    assert_eq!(run.outcome.ending, Ending::Completed);
    // 5 ticks of zeroing, 1 s of ramp, 3 of warm-up and the test.
    assert_eq!(way.len(), 5 + 1000 + 3 + 501);
    assert!(way[..5].iter().all(|disp| *disp == 0.0));
    let ramp = &way[4..1005];
    assert!(ramp.windows(2).all(|pair| pair[1] > pair[0]), "one way");
    // Half a cosine: at most π/2 times the average.
    let fastest = std::f64::consts::FRAC_PI_2 * 0.02 / 1000.0;
    assert!(largest_step(ramp) <= fastest * (1.0 + 1e-6));
    assert_eq!(ramp[1000], 0.02, "to the last bit");
    assert!(way[1005..1009].iter().all(|disp| *disp == 0.02));
}

#[test]
fn nothing_moves_before_a_test_from_rest() {
    let (run, way) = Lab::new(SHORT).run();
    assert_eq!(phases(&run), ["zeroing", "armed", "running", "safe"]);
    assert!(way[..9].iter().all(|disp| *disp == 0.0));
}

#[test]
fn ramp_keeps_half_the_velocity_limit() {
    let mut lab = Lab::new(&format!(
        "{SHORT}\nstructure.initial_displacement_m = [0.1]"
    ));
    lab.limits.set(
        Limit::CommandVel,
        Bound {
            warn: 0.1,
            trip: 20.0,
        },
    );
    let (_, way) = lab.run();
    let start = way.iter().position(|disp| *disp == 0.1).unwrap();
    let fastest = largest_step(&way[..=start]) / PERIOD;
    assert!(
        fastest <= 0.05 * (1.0 + 1e-6) && fastest > 0.049,
        "{fastest}"
    );
}

#[test]
fn hold_changes_only_the_wall_time() {
    let (plain, way) = Lab::new(SHORT).run();
    let says = &[(150, Operator::Hold), (400, Operator::Continue)];
    let (held, held_way) = Lab::new(SHORT).run_with_operator(says);
    assert_eq!(
        phases(&held)[3..],
        ["holding", "running", "safe"],
        "{:?}",
        phases(&held)
    );
    for column in ["x1", "v1", "a1", "force_1_1", "time", "cmd_1_1"] {
        assert_eq!(held.column(column), plain.column(column), "{column}");
    }
    // Requested with command 150 and accepted at the next edge, so that the current step finishes.
    assert_eq!(held_way.len(), way.len() + 250);
    assert!(
        held_way[151..=401]
            .iter()
            .all(|disp| *disp == held_way[151])
    );
    let state = held.all("state");
    let holding = state.iter().filter(|s| **s == Phase::Holding.code());
    assert_eq!(holding.count(), 250);
}

#[test]
fn an_operator_can_end_a_hold_for_good() {
    let says = &[(150, Operator::Hold), (300, Operator::Stop)];
    let (run, way) = Lab::new(SHORT).run_with_operator(says);
    assert_eq!(run.outcome.ending, Ending::Stopped(Stop::Operator));
    assert_eq!(phases(&run)[3..], ["holding", "safe"]);
    assert_eq!(way.len(), 301);
}

#[test]
fn a_command_beyond_a_limit_never_leaves() {
    let (free, way) = Lab::new(SHORT).run();
    let peak = way.iter().fold(0.0f64, |peak, disp| peak.max(disp.abs()));
    let mut lab = Lab::new(SHORT);
    let bound = 0.5 * peak;
    lab.limits.set(
        Limit::CommandDisp,
        Range {
            warn: [-0.4 * peak, 0.4 * peak],
            trip: [-bound, bound],
        },
    );
    let (run, way) = lab.run();
    assert!(way.iter().all(|disp| disp.abs() <= bound));
    let Ending::Stopped(Stop::Limit { port: 0, hit }) = run.outcome.ending else {
        panic!("{:?}", run.outcome.ending);
    };
    assert_eq!(hit.quantity, Limit::CommandDisp);
    // The very next step of the free run is the first beyond it.
    let steps = run.column("x1").len();
    let beyond = free.column("x1")[steps];
    assert!(beyond.abs() > bound && hit.value == beyond);
    assert_eq!(phases(&run)[2..], ["running", "tripped", "safe"]);
    let warned = run
        .events
        .iter()
        .any(|event| matches!(event.kind, Event::LimitWarning(_)));
    assert!(warned, "the warning came first");
}

#[test]
fn measured_limit_trips_in_its_tick() {
    let mut lab = Lab::new(SHORT);
    lab.limits.set(
        Limit::MeasuredForce,
        Range {
            trip: [-1500.0, 1500.0],
            ..Range::NONE
        },
    );
    let (run, _) = lab.run();
    let hit = limit_hit(&run);
    assert!(hit.value.abs() > 1500.0);
    // The measurement that tripped is kept.
    assert_eq!(run.all("state").last(), Some(&Phase::Tripped.code()));
    assert_eq!(run.all("force_1_1").last(), Some(&hit.value));
    let forces = run.column("force_1_1");
    assert!(forces.iter().all(|force| force.abs() <= 1500.0));
    assert_eq!(
        run.outcome.ports[0].1,
        [hit.value.abs()],
        "the peak is that of all ticks"
    );
}

/// Trips at 2 kN with this `on_trip`; returns the run and the commands after the trip.
fn after_a_trip(on_trip: Exit) -> (Run, Vec<f64>) {
    let mut lab = Lab::new(SHORT);
    lab.limits.set(
        Limit::MeasuredForce,
        Range {
            trip: [-2000.0, 2000.0],
            ..Range::NONE
        },
    );
    lab.exits = Exits {
        on_trip,
        at_end: Exit::Freeze,
        speed: 0.01,
        comes_to_rest: false,
    };
    // The return ramp must be able to carry the force that tripped.
    let (run, way) = lab.run();
    let begun = run.column("x1").len() + 5 + 3;
    (run, way[begun..].to_vec())
}

#[test]
fn trip_freezes_by_default() {
    let (run, way) = after_a_trip(Exit::Freeze);
    assert_eq!(phases(&run)[3..], ["tripped", "safe"]);
    assert_eq!(way.len(), 1, "the command whose answer tripped");
}

#[test]
fn drive_comes_to_rest_after_a_trip() {
    const ACCEL: f64 = 15.0;
    let mut ends = Vec::new();
    for comes_to_rest in [false, true] {
        let mut lab = Lab::new(SHORT);
        lab.limits
            .set(Limit::MeasuredForce, Range::trip([-2000.0, 2000.0]));
        lab.limits
            .set(Limit::CommandAccel, Range::trip([-ACCEL, ACCEL]));
        lab.exits.comes_to_rest = comes_to_rest;
        let (run, mut way) = lab.run();
        let words: &[&str] = match comes_to_rest {
            false => &["tripped", "safe"],
            true => &["tripped", "leaving", "safe"],
        };
        assert_eq!(phases(&run)[3..], *words);
        // It rests at its last command.
        way.push(way[way.len() - 1]);
        let stop = &way[way.len() - 12..];
        let accels = stop
            .windows(3)
            .map(|x| ((x[2] - x[1]) - (x[1] - x[0])).abs() / (PERIOD * PERIOD));
        ends.push(accels.fold(0.0, f64::max));
    }
    assert!(ends[0] > ACCEL, "{ends:?}");
    assert!(ends[1] <= ACCEL, "{ends:?}");
}

#[test]
fn return_ramps_are_slow_and_reach_the_goal() {
    for (exit, end) in [
        (Exit::ZeroForce, 0.0),
        (Exit::ZeroDisp, 0.0),
        (Exit::Safe(AtAxis(vec![0.003])), 0.003),
    ] {
        let (run, way) = after_a_trip(exit.clone());
        assert_eq!(phases(&run)[3..], ["tripped", "leaving", "safe"]);
        assert!(
            largest_step(&way) <= 0.01 * PERIOD * (1.0 + 1e-9),
            "{exit:?}"
        );
        let last = way[way.len() - 1];
        // A hundredth of the force that tripped, a little beyond 2 kN at 10 mm.
        let near = if exit == Exit::ZeroForce {
            1.05e-4
        } else {
            0.0
        };
        assert!((last - end).abs() <= near, "{exit:?}: {last}");
        assert!(matches!(
            run.outcome.ending,
            Ending::Stopped(Stop::Limit { .. })
        ));
    }
}

/// The tick of a trip is no completed step: its consequences are reported at that tick, and not before it.
#[test]
fn no_event_goes_back_in_test_time() {
    let (run, _) = after_a_trip(Exit::ZeroDisp);
    let is_trip = |kind: &Event| matches!(kind, Event::LimitTrip(_));
    let trip = run.events.iter().position(|event| is_trip(&event.kind));
    let follows = &run.events[trip.unwrap()..];
    let place = (run.outcome.steps + 1, follows[0].time);
    assert!(follows.len() >= 5, "tripped, leaving, safe and the end");
    assert!(
        follows
            .iter()
            .all(|event| (event.tick, event.time) == place)
    );
    let times: Vec<f64> = run.events.iter().map(|event| event.time).collect();
    assert!(times.is_sorted(), "{times:?}");
}

/// Ends at its last step and then returns to 0.3 m, which exceeds the limit where `bound` is smaller.
fn led_after_its_end(bound: f64) -> Lab {
    let mut lab = Lab::new(SHORT);
    lab.limits
        .set(Limit::CommandDisp, Range::trip([-bound, bound]));
    lab.exits = Exits {
        on_trip: Exit::Freeze,
        at_end: Exit::Safe(AtAxis(vec![0.3])),
        speed: 0.5,
        comes_to_rest: false,
    };
    lab
}

#[test]
fn trip_in_the_shutdown_counts_as_a_trip() {
    let (run, way) = led_after_its_end(0.5).run();
    assert_eq!(run.outcome.ending, Ending::Completed);
    assert_eq!(
        (way.last(), run.outcome.left.as_slice()),
        (Some(&0.3), &[EndPosition::Reached][..])
    );
    assert_eq!(ending(&run.outcome).0, Cause::Done);

    let (run, way) = led_after_its_end(0.2).run();
    let hit = limit_hit(&run);
    assert_eq!(hit.quantity, Limit::CommandDisp);
    assert!(way.iter().all(|disp| *disp <= 0.2), "frozen where it was");
    assert_eq!(phases(&run)[2..], ["running", "leaving", "tripped", "safe"]);
    assert_eq!(run.outcome.left, [EndPosition::NotReached(None)]);
    let unfinished = run.outcome.unfinished.unwrap();
    assert_eq!(unfinished.after, Ending::Completed);
    let (cause, reason) = ending(&run.outcome);
    assert_eq!(cause, Cause::Limit);
    assert!(
        reason.contains("commanded displacement") && reason.contains("the shutdown"),
        "{reason}"
    );
}

#[test]
fn operator_ends_the_shutdown_at_once() {
    // 5 of zeroing, 3 of warm-up, rows 0 to 500: the shutdown begins with number 509.
    let (run, way) = led_after_its_end(0.5).run_with_operator(&[(600, Operator::Stop)]);
    assert_eq!(run.outcome.ending, Ending::Stopped(Stop::Operator));
    assert_eq!(way.len(), 601);
    assert_eq!(run.outcome.left, [EndPosition::NotReached(None)]);
    let last: Vec<&Event> = run.events.iter().map(|event| &event.kind).collect();
    assert!(
        matches!(
            last[last.len() - 3..],
            [
                Event::StopRequested,
                Event::Phase {
                    from: Phase::Leaving,
                    to: Phase::Safe,
                    cause: Word::Borrowed("operator"),
                    ..
                },
                Event::Ended
            ]
        ),
        "{last:?}"
    );
    let (cause, reason) = ending(&run.outcome);
    assert_eq!(cause, Cause::Operator);
    assert!(reason.contains("the shutdown"), "{reason}");
}

#[test]
fn relative_zero_resets_position_and_force() {
    let (plain, _) = Lab::new(SHORT).run();
    let mut lab = Lab::new(SHORT);
    lab.bias = [0.004, 321.0];
    lab.offset = 0.05;
    lab.reference = Reference {
        disp: Zero::Relative,
        force: Zero::Relative,
    };
    let (run, way) = lab.run();
    assert_eq!(way[0], 0.05, "where it stands");
    for column in ["x1", "force_1_1", "meas_1_1"] {
        let (wanted, found) = (plain.column(column), run.column(column));
        let scale = wanted
            .iter()
            .fold(0.0f64, |max, value| max.max(value.abs()));
        for (wanted, found) in wanted.iter().zip(&found) {
            // Offsets of 0.05 m and 321 N cost digits: 1e-16 · 0.05 · 2e5 N.
            assert!((wanted - found).abs() <= 1e-8 * scale, "{column}");
        }
    }
    let reading = run.events.iter().find_map(|event| match event.kind {
        Event::Zeroed { disp, force, .. } => Some([disp, force]),
        _ => None,
    });
    let [disp, force] = reading.unwrap();
    assert!((disp - 0.054).abs() < 1e-15 && force == 321.0);
}

#[test]
fn unconfirmed_offsets_move_nothing() {
    let text = format!("{SHORT}\nsafety.confirm = true\nstructure.initial_displacement_m = [0.02]");
    let says = &[(300, Operator::Confirm)];
    let (run, way) = Lab::new(&text).run_with_operator(says);
    assert_eq!(run.outcome.ending, Ending::Completed);
    assert!(way[..=300].iter().all(|disp| *disp == 0.0));
    assert!(way[303] > 0.0);
    let (run, way) = Lab::new(&text).run_with_operator(&[(300, Operator::Stop)]);
    assert_eq!(run.outcome.ending, Ending::Stopped(Stop::Operator));
    assert!(way.iter().all(|disp| *disp == 0.0));
    assert_eq!(phases(&run), ["zeroing", "safe"]);
}

/// The operator's requests and confirmations, in their order.
fn said(run: &Run) -> Vec<&'static str> {
    let words = run.events.iter().filter_map(|event| match event.kind {
        Event::HoldRequested => Some("hold"),
        Event::ContinueRequested => Some("continue"),
        Event::ContinueDropped { .. } => Some("dropped"),
        Event::Zeroed { .. } => Some("read"),
        Event::Confirmed => Some("confirmed"),
        Event::Started => Some("started"),
        _ => None,
    });
    words.collect()
}

#[test]
fn confirm_and_continue_do_not_mix() {
    type Said = (&'static [(u64, Operator)], [&'static str; 5]);
    use Operator::{Confirm, Continue, Hold};
    let text = format!("{SHORT}\nsafety.confirm = true\nstructure.initial_displacement_m = [0.02]");
    let cases: [Said; 3] = [
        // Confirmed while somebody else holds it, and before the sensors are read.
        (
            &[(2, Hold), (3, Confirm), (20, Confirm), (300, Continue)],
            ["hold", "read", "confirmed", "continue", "started"],
        ),
        // No confirmation is pending yet, and the operator continues twice.
        (
            &[(0, Hold), (0, Continue), (0, Continue), (300, Confirm)],
            ["hold", "continue", "read", "confirmed", "started"],
        ),
        // Pending and held: repeated `continue` commands end the hold only.
        (
            &[
                (3, Hold),
                (20, Continue),
                (20, Continue),
                (21, Continue),
                (300, Confirm),
            ],
            ["hold", "read", "continue", "confirmed", "started"],
        ),
    ];
    for (says, words) in cases {
        let (run, way) = Lab::new(&text).run_with_operator(says);
        assert_eq!(run.outcome.ending, Ending::Completed);
        assert_eq!(said(&run), words, "{says:?}");
        assert!(way[..=300].iter().all(|disp| *disp == 0.0), "{says:?}");
        assert!(way[303] > 0.0, "{says:?}");
    }
    // The commands take effect one after the other, after the sensors have been read.
    let text = text.with("safety.zero_s = 0.001");
    let says = &[(0, Hold), (0, Continue), (0, Continue), (300, Confirm)];
    let (run, way) = Lab::new(&text).run_with_operator(says);
    let words = ["read", "hold", "continue", "confirmed", "started"];
    assert_eq!(said(&run), words);
    assert!(way[..=300].iter().all(|disp| *disp == 0.0));
}

#[test]
fn late_confirmation_ends_no_hold() {
    let text = format!("{SHORT}\nsafety.confirm = true");
    let says = &[
        (20, Operator::Confirm),
        (150, Operator::Hold),
        (200, Operator::Confirm),
        (400, Operator::Continue),
    ];
    let (run, way) = Lab::new(&text).run_with_operator(says);
    let words = ["read", "confirmed", "started", "hold", "continue"];
    assert_eq!(said(&run), words);
    assert!(way[152..=400].iter().all(|disp| *disp == way[152]));
    assert!(way[403] != way[400]);
    assert_eq!(run.outcome.ending, Ending::Completed);
}

/// It was on its way while the first hold ended and another one began.
#[test]
fn late_continue_ends_no_later_hold() {
    let says = &[
        (150, Operator::Hold),
        (200, Operator::EndHold(1)),
        (210, Operator::Hold),
        (300, Operator::EndHold(1)),
        (400, Operator::EndHold(2)),
    ];
    let (run, way) = Lab::new(SHORT).run_with_operator(says);
    let words = [
        "read", "started", "hold", "continue", "hold", "dropped", "continue",
    ];
    assert_eq!(said(&run), words);
    assert!(way[212..=400].iter().all(|disp| *disp == way[212]));
    assert!(way[403] != way[400]);
    let dropped = run.events.iter().find_map(|event| match event.kind {
        Event::ContinueDropped { hold, latest } => Some((hold, latest)),
        _ => None,
    });
    assert_eq!(dropped, Some((1, 2)));
    assert_eq!(run.outcome.ending, Ending::Completed);
}

#[test]
fn unknown_zero_prevents_the_return_move() {
    let text = format!("{SHORT}\nsafety.confirm = true");
    let mut lab = Lab::new(&text);
    lab.exits.at_end = Exit::ZeroDisp;
    lab.exits.speed = 0.01;
    lab.bias = [0.02, 0.0];
    lab.offset = 0.01;
    lab.reference.disp = Zero::Relative;
    let (run, way) = lab.run_with_operator(&[(3, Operator::Stop)]);
    assert!(way.iter().all(|disp| *disp == 0.01), "{way:?}");
    assert_eq!(phases(&run), ["zeroing", "safe"]);
    assert_eq!(run.outcome.left, [EndPosition::Stayed]);
    assert_eq!(ending(&run.outcome).0, Cause::Operator);
}

/// The shutdown begins at once from a test in motion, at 0.1 m/s and more: the stop alone is 100 m/s².
#[test]
fn shutdown_keeps_its_own_limits() {
    for exit in [
        Exit::ZeroDisp,
        Exit::ZeroForce,
        Exit::Safe(AtAxis(vec![0.01])),
    ] {
        let mut lab = Lab::new(SHORT);
        lab.limits
            .set(Limit::MeasuredForce, Range::trip([-2000.0, 2000.0]));
        lab.limits.set(Limit::CommandAccel, Bound::trip(12.0));
        lab.exits = Exits {
            on_trip: exit.clone(),
            at_end: Exit::Freeze,
            speed: 0.05,
            comes_to_rest: false,
        };
        let (run, way) = lab.run();
        assert_eq!(run.outcome.unfinished, None, "{exit:?}");
        assert_eq!(run.outcome.left, [EndPosition::Reached], "{exit:?}");
        let begun = run.column("x1").len() + 5 + 3;
        let mut way = way[begun - 1..].to_vec();
        way[0] = way[1];
        let last = way[way.len() - 1];
        way.push(last);
        let worst = way
            .windows(3)
            .map(|w| (w[2] - 2.0 * w[1] + w[0]).abs() / (PERIOD * PERIOD))
            .fold(0.0, f64::max);
        assert!(worst <= 6.0 * (1.0 + 1e-6), "{exit:?}: {worst} m/s2");
    }
}

/// Energy, tangents and lag are those of the test: the shutdown does not use its last target.
#[test]
fn nothing_is_estimated_in_the_shutdown() {
    let mut lab = Lab::new(SHORT);
    lab.limits.set(Limit::AddedEnergy, Bound::trip(1.0));
    lab.exits = Exits {
        on_trip: Exit::Freeze,
        at_end: Exit::Safe(AtAxis(vec![0.05])),
        speed: 0.05,
        comes_to_rest: false,
    };
    let (run, way) = lab.run();
    assert_eq!(run.outcome.ending, Ending::Completed);
    assert_eq!(way.last(), Some(&0.05));
    let energy = run.all("added_1_1");
    assert!(energy.iter().all(|energy| energy.abs() < 1e-9));
}

/// Two specimens along prescribed ways; `first` and `second` are added to their tables, `safety` to its own.
fn two_along(first: &str, second: &str, safety: &str) -> String {
    let specimen = |name: &str, more: &str| {
        format!(
            "[[specimen]]\nname = \"{name}\"\n{more}\n[[excitation.prescribed_displacement]]\nspecimen = \"{name}\"\n\
             ease_in_s = 0.5\nsignal.sine = {{ amplitude = 0.01, frequency_hz = 0.5 }}\n"
        )
    };
    format!(
        "[time]\nrate_hz = 100\nduration_s = 2\nclock = \"simulated\"\n[safety]\nexit_speed_m_per_s = 0.02\n{safety}\n{}{}",
        specimen("a", first),
        specimen("b", second)
    )
}

const ELASTIC: &str =
    "law.bilinear = { stiffness_n_per_m = 4e5, yield_force_n = 1e6, post_yield_ratio = 0.5 }";

/// A specimen with a pending command answers it even in the tick of another's trip: no specimen takes a new command before that.
#[test]
fn trip_of_one_specimen_keeps_other_links() {
    let limited = format!("{ELASTIC}\nlimits.measured_force_n = {{ trip = [-2e3, 2e3] }}");
    for (first, second) in [
        (limited.as_str(), ELASTIC),
        (ELASTIC, limited.as_str()),
        (limited.as_str(), limited.as_str()),
    ] {
        let run = crate::common::engine::run(&two_along(
            first,
            second,
            "on_trip = \"zero_displacement\"",
        ));
        assert!(matches!(
            run.outcome.ending,
            Ending::Stopped(Stop::Limit { .. })
        ));
        assert_eq!(run.outcome.unfinished, None);
        assert_eq!(run.outcome.left, [EndPosition::Reached; 2]);
        for column in ["cmd_1_1", "cmd_2_1"] {
            assert_eq!(run.all(column).last(), Some(&0.0), "{column}");
        }
    }
}

#[test]
fn zero_force_needs_a_stiffness() {
    let viscous = "law.linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 1e5 }";
    let text = two_along(ELASTIC, viscous, "at_end = \"zero_force\"");
    let read = gusset_config::parse(std::path::Path::new("test.toml"), text, &[]);
    let loaded = read.unwrap_or_else(|error| panic!("{error}"));
    let refused = gusset_setup::build(&loaded).unwrap_err().to_string();
    assert!(
        refused.contains("axis 1") && refused.contains("at_end"),
        "{refused}"
    );
}

/// The value that trips is recorded while zeroing and in the shutdown, too, as in the running test.
#[test]
fn tripping_value_is_always_in_a_row() {
    let mut lab = Lab::new(SHORT);
    lab.bias = [0.0, 3000.0];
    lab.limits
        .set(Limit::MeasuredForce, Range::trip([-2000.0, 2000.0]));
    let (zeroing, _) = lab.run();
    assert_eq!(phases(&zeroing), ["zeroing", "tripped", "safe"]);

    let mut lab = led_after_its_end(0.5);
    lab.limits
        .set(Limit::MeasuredForce, Range::trip([-5e4, 5e4]));
    let (leaving, _) = lab.run();
    assert_eq!(
        phases(&leaving)[3..],
        ["leaving", "tripped", "safe"],
        "{:?}",
        phases(&leaving)
    );
    for (run, bound) in [(zeroing, 2000.0), (leaving, 5e4)] {
        assert_eq!(run.all("state").last(), Some(&Phase::Tripped.code()));
        let force = run.all("raw_force_1_1");
        assert!(force.last().is_some_and(|force| *force > bound));
        let hit = limit_hit(&run);
        assert_eq!(force.last(), Some(&hit.value));
    }
}

/// An operator's stop is reported with its author when it arrives, before the return move.
#[test]
fn stop_is_reported_when_it_arrives() {
    let (run, _) = led_after_its_end(0.5).run_with_operator(&[(200, Operator::Stop)]);
    assert_eq!(run.outcome.ending, Ending::Stopped(Stop::Operator));
    assert_eq!(run.outcome.left, [EndPosition::Reached]);
    let place = |wanted: &dyn Fn(&Event) -> bool| {
        let mut events = run.events.iter();
        events.position(|event| wanted(&event.kind)).unwrap()
    };
    let heard = place(&|kind| *kind == Event::StopRequested);
    let left = place(&|kind| {
        matches!(
            kind,
            Event::Phase {
                to: Phase::Leaving,
                cause: Word::Borrowed("operator"),
                ..
            }
        )
    });
    let safe = place(&|kind| {
        matches!(
            kind,
            Event::Phase {
                to: Phase::Safe,
                cause: Word::Borrowed("done"),
                ..
            }
        )
    });
    assert_eq!((heard + 1, left + 1), (left, safe));
}

/// The limit that ended the test.
fn limit_hit(run: &Run) -> Hit {
    let Ending::Stopped(Stop::Limit { hit, .. }) = run.outcome.ending else {
        panic!("{:?}", run.outcome.ending);
    };
    hit
}

/// A load cell that reads this force instead of the true one from command 55 on, for this number of commands.
fn reads(force: f64, times: u64) -> impl FnMut(rig::Phase, u64) -> rig::Act + Send + 'static {
    move |phase, number| match phase {
        rig::Phase::Collect if number >= 55 && number - 55 < times => rig::Act::Force(force),
        _ => rig::Act::Serve,
    }
}

/// A rig that is pushed along for 60 steps, trips, and unloads; `act` gives its measurements. Returns every command from the last
/// of the test on, and the run.
fn led_to_zero_force(
    limits: AxisLimits,
    act: impl FnMut(rig::Phase, u64) -> rig::Act + Send + 'static,
) -> (Vec<f64>, Run) {
    led_to(Exit::ZeroForce, limits, act)
}

fn led_to(
    exit: Exit,
    limits: AxisLimits,
    act: impl FnMut(rig::Phase, u64) -> rig::Act + Send + 'static,
) -> (Vec<f64>, Run) {
    let log = rig::Log::default();
    let mut experiment = rig::two_floors(60, "timing.warmup_ticks = 0");
    experiment.limits.stale_in_a_row = 100;
    let axis = rig::storey(0);
    let mut spec = rig::spec(0, axis, Coupling::Sampled, &log, act);
    (spec.tick, spec.axes[0].limits) = (PERIOD, limits);
    spec.exits = Exits {
        on_trip: exit.clone(),
        at_end: exit,
        speed: 0.5,
        comes_to_rest: false,
    };
    experiment.ports.push(spec.build().unwrap());
    let run = run_on(experiment, SimClock::new());
    let leaving = Phase::Leaving.code();
    let commands = run.all("cmd_1_1").into_iter().zip(run.all("state"));
    let way = commands.filter(|(_, state)| *state == leaving);
    (way.map(|(disp, _)| disp).collect(), run)
}

/// The reply stays away for 48 ticks at any time of the return ramp: a loop that used the last force would pass beyond zero.
#[test]
fn unloading_pauses_while_answers_are_late() {
    let (whole, _) = led_to_zero_force(AxisLimits::NONE, |_, _| rig::Act::Serve);
    let from = whole[0];
    assert!(from.abs() > 1e-3, "{from}");
    // Command 61 is the first of the shutdown: its answer is the first that counts.
    for lost in [60, 61, 62, 80, 120] {
        let (way, run) = led_to_zero_force(AxisLimits::NONE, move |phase, number| match phase {
            rig::Phase::Collect if (lost..lost + 48).contains(&number) => rig::Act::Miss,
            _ => rig::Act::Serve,
        });
        assert_eq!(run.outcome.left, [EndPosition::Reached], "{lost}");
        assert!(
            way.iter().all(|disp| disp / from > 0.0),
            "{lost}: to the other side"
        );
        assert!(way[way.len() - 1].abs() <= 0.011 * from.abs(), "{lost}");
        let ticks = if lost == 60 { 47 } else { 48 };
        assert_eq!(way.len(), whole.len() + ticks, "{lost}");
    }
}

/// One false sample near zero, anywhere on the way, is not where the force is small.
#[test]
fn unloading_does_not_end_at_a_glitch() {
    let (whole, _) = led_to_zero_force(AxisLimits::NONE, |_, _| rig::Act::Serve);
    for at in [63, 80, 120] {
        let (way, run) = led_to_zero_force(AxisLimits::NONE, move |phase, number| match phase {
            rig::Phase::Collect if number == at => rig::Act::Force(0.0),
            _ => rig::Act::Serve,
        });
        assert_eq!(run.outcome.left, [EndPosition::Reached], "{at}");
        assert!(way[way.len() - 1].abs() <= 0.011 * whole[0].abs(), "{at}");
        // It rests for one tick, and what is small is counted in blocks of 50.
        let more = way.len().checked_sub(whole.len());
        assert!(more.is_some_and(|more| more <= 50), "{at}: {more:?}");
    }
}

/// One wrong sample of any size trips the test: the shutdown uses the measurements before and after it.
#[test]
fn tripping_sample_does_not_set_zero_force() {
    let bounded = AxisLimits::NONE.with(
        Limit::MeasuredForce,
        Range {
            trip: [-1e5, 1e5],
            ..Range::NONE
        },
    );
    let jumping = AxisLimits::NONE.with(Limit::ForceStep, Bound::trip(1e4));
    for limits in [bounded, jumping] {
        for glitch in [2e5, 1e7] {
            let (way, run) = led_to_zero_force(limits, reads(glitch, 1));
            let stopped = run.outcome.ending;
            assert!(matches!(stopped, Ending::Stopped(Stop::Limit { .. })));
            assert_eq!(run.outcome.left, [EndPosition::Reached]);
            let (from, last) = (way[0], way[way.len() - 1]);
            assert!(from.abs() > 1e-3 && last.abs() <= 0.011 * from.abs());
        }
    }
}

/// A load cell that stays wild: the return ramp is no longer than the largest allowed force would make it.
#[test]
fn wild_load_cell_stays_within_its_bound() {
    let limits = AxisLimits::NONE.with(
        Limit::MeasuredForce,
        Range {
            trip: [-1e4, 1e4],
            ..Range::NONE
        },
    );
    let (way, run) = led_to_zero_force(limits, reads(1e7, u64::MAX));
    let left = EndPosition::NotReached(Some(UnloadFailure::DoesNotFollow));
    assert_eq!(run.outcome.left, [left]);
    let far = way.iter().map(|disp| (disp - way[0]).abs());
    let far = far.fold(0.0, f64::max);
    // As far as k̂ gives, and the motion until the loop notices.
    assert!(far <= 2.0 * 1e4 / rig::STIFFNESS, "{far}");
}

/// A load cell that jumps and stays there would lead its specimen to a wrong force; one that recovers is trusted again.
#[test]
fn jumped_force_unloads_only_if_it_recovers() {
    let limits = AxisLimits::NONE.with(
        Limit::ForceStep,
        Bound {
            trip: 5e4,
            ..Bound::NONE
        },
    );
    for (lasts, left) in [
        (2, EndPosition::Reached),
        (
            u64::MAX,
            EndPosition::NotReached(Some(UnloadFailure::Jumped)),
        ),
    ] {
        let (way, run) = led_to_zero_force(limits, reads(2e5, lasts));
        let hit = limit_hit(&run);
        assert_eq!(hit.quantity, Limit::ForceStep);
        assert_eq!(run.outcome.left, [left], "{lasts}");
        let moved = way.iter().any(|disp| *disp != way[0]);
        assert_eq!(moved, left == EndPosition::Reached, "{lasts}");
        let (_, reason) = ending(&run.outcome);
        let told = reason.contains(&UnloadFailure::Jumped.to_string());
        assert_eq!(told, !moved, "{reason}");
    }
}

/// A force beyond the range of its load cell moves no specimen, whether it stays there or not. A return to a displacement needs no
/// force.
#[test]
fn out_of_range_load_cell_moves_nothing() {
    let limits = AxisLimits::NONE.with(
        Limit::SensorForce,
        Range {
            trip: [-1e5, 1e5],
            ..Range::NONE
        },
    );
    for lasts in [1, u64::MAX] {
        for (exit, left) in [
            (
                Exit::ZeroForce,
                EndPosition::NotReached(Some(UnloadFailure::Unfelt)),
            ),
            (Exit::ZeroDisp, EndPosition::Reached),
        ] {
            let (way, run) = led_to(exit, limits, reads(2e5, lasts));
            let hit = limit_hit(&run);
            assert_eq!(hit.quantity, Limit::SensorForce);
            assert_eq!(run.outcome.left, [left], "{lasts}");
            assert_eq!(way.is_empty(), left != EndPosition::Reached, "{way:?}");
        }
    }
}

/// Along a sine that ends at its middle, at 79 mm/s, behind an actuator with a delay of `delay` seconds.
fn behind_a_delay(delay: f64, safety: &str, limits: &str) -> String {
    format!(
        "[time]\nrate_hz = 1000\nduration_s = 2\nclock = \"simulated\"\n[safety]\nexit_speed_m_per_s = 0.02\n{safety}\n\
         [[excitation.prescribed_displacement]]\nspecimen = \"a\"\nease_in_s = 0.2\n\
         signal.sine = {{ amplitude = 0.025, frequency_hz = 0.5 }}\n\
         [[specimen]]\nname = \"a\"\nlaw.linear = {{ stiffness_n_per_m = 10e6 }}\ntransfer.delay_s = {delay}\n{limits}"
    )
}

/// A test that ends in motion leaves its actuator on the way to the last command: its following error does not grow.
#[test]
fn lag_within_its_limit_passes_the_shutdown() {
    let limits = "[specimen.limits]\nfollowing_error_m = { trip = 1e-3 }\nfollowing_time_s = 0.03";
    for exit in ["zero_displacement", "zero_force"] {
        let text = behind_a_delay(0.024, &format!("at_end = \"{exit}\""), limits);
        let run = crate::common::engine::run(&text);
        assert_eq!(run.outcome.ending, Ending::Completed, "{exit}");
        assert_eq!(run.outcome.left, [EndPosition::Reached], "{exit}");
        let behind = run.all("cmd_1_1").into_iter().zip(run.all("raw_disp_1_1"));
        let worst = behind.fold(0.0, |worst: f64, (cmd, disp)| worst.max((cmd - disp).abs()));
        assert!(worst > 1.8e-3, "it comes behind by 79 mm/s for 24 ms");
    }
}

/// The limits that trip in a run, with the tick of each.
fn trips(run: &Run) -> Vec<(u64, u32, &str)> {
    let events = run.events.iter().filter_map(|event| match &event.kind {
        Event::LimitTrip(reached) if !reached.is_of_test() => {
            Some((event.tick, reached.axis?, reached.limit.as_ref()))
        }
        _ => None,
    });
    events.collect()
}

/// Limits that trip in one tick are one trip: each is reported then, and none stops the shutdown.
#[test]
fn two_trips_in_one_tick_are_both_excused() {
    let (force, disp) = (
        "measured_force_n = { trip = [-104e3, 104e3] }",
        "measured_disp_m = { trip = [-0.0104, 0.0104] }",
    );
    for exit in ["zero_force", "zero_displacement"] {
        let exit = format!("on_trip = \"{exit}\"");
        let one = behind_a_delay(0.0, &exit, &format!("[specimen.limits]\n{force}\n{disp}"));
        let one = one.without("specimen.0.transfer");
        let both = one
            .without("specimen.0.limits.measured_disp_m")
            .without("specimen.0.law")
            .with(
                "specimen.laws = [{ linear.stiffness_n_per_m = 10e6 }, { linear.stiffness_n_per_m = 10e6 }]\n\
                 excitation.prescribed_displacement.axis = 1",
            )
            .with(
                "[[excitation.prescribed_displacement]]\nspecimen = \"a\"\naxis = 2\nease_in_s = 0.2\n\
                 signal.sine = { amplitude = 0.025, frequency_hz = 0.5 }",
            );
        for text in [one, both] {
            let run = crate::common::engine::run(&text);
            assert!(matches!(
                run.outcome.ending,
                Ending::Stopped(Stop::Limit { .. })
            ));
            let tripped = trips(&run);
            assert_eq!(tripped.len(), 2, "{tripped:?}");
            assert_eq!(tripped[0].0, tripped[1].0, "{tripped:?}");
            assert_eq!(run.outcome.unfinished, None, "{exit}");
            assert_eq!(run.outcome.left, [EndPosition::Reached], "{exit}");
        }
    }
}

/// A column that yields in tension goes into compression as it returns, of which little is allowed.
#[test]
fn trip_on_one_side_excuses_no_other_side() {
    let exit = "on_trip = \"zero_displacement\"";
    let limits = "[specimen.limits]\nmeasured_force_n = { trip = [-2e3, 104e3] }";
    let yields = "specimen.law.bilinear = { stiffness_n_per_m = 10e6, yield_force_n = 100e3, post_yield_ratio = 0.05 }";
    let text = behind_a_delay(0.0, exit, limits).without("specimen.0.transfer");
    let text = text.without("specimen.0.law").with(yields);
    let run = crate::common::engine::run(&text);
    let force = run.all("raw_force_1_1");
    let least = force.iter().fold(0.0f64, |least, force| least.min(*force));
    assert!((-2.3e3..-2e3).contains(&least), "{least}");
    assert_eq!(force.last(), Some(&least), "it is left there");
    assert_eq!(run.outcome.left, [EndPosition::NotReached(None)]);
    let hit = run.outcome.unfinished.map(|unfinished| unfinished.stop);
    assert!(matches!(hit, Some(Stop::Limit { hit, .. }) if hit.bound == -2e3));
    assert_eq!(trips(&run).len(), 2);
}

/// A command sent before the trip may still arrive: it must neither pull the specimen back nor keep it there.
#[test]
fn lagging_actuator_returns_from_command() {
    let force = "[specimen.limits]\nmeasured_force_n = { trip = [-104e3, 104e3] }";
    let disp = "measured_disp_m = { trip = [-0.0115, 0.0115] }";
    for exit in ["zero_force", "zero_displacement"] {
        for delay in [0.002, 0.005, 0.01, 0.024] {
            for (limits, count) in [(force.to_owned(), 1), (format!("{force}\n{disp}"), 2)] {
                let exit = format!("on_trip = \"{exit}\"");
                let run = crate::common::engine::run(&behind_a_delay(delay, &exit, &limits));
                let place = format!("{exit}, {delay} s, {count}");
                assert_eq!(run.outcome.unfinished, None, "{place}");
                assert_eq!(run.outcome.left, [EndPosition::Reached], "{place}");
                let Ending::Stopped(Stop::Limit { hit, .. }) = run.outcome.ending else {
                    panic!("{place}: {:?}", run.outcome.ending);
                };
                assert_eq!(hit.quantity, Limit::MeasuredForce);
                // The second is a tenth farther, 9 ms later.
                let count = if delay < 0.01 { 1 } else { count };
                assert_eq!(trips(&run).len(), count, "{place}");
                let last = run.all("raw_force_1_1").pop().unwrap();
                assert!(last.abs() <= 0.011 * 128e3, "{place}: {last} N");
            }
        }
    }
}
