//! From the connection to the first step: whatever comes first, a specimen moves from where it is, and nothing jumps.

use std::sync::{Arc, Mutex};

use crate::common::engine::{Run, prepare, run_on, run_under};
use crate::common::rig;
use crate::common::spring::Spring;
use gusset_control::engine::{Control, EndPosition, Ending, Operator, Stop};
use gusset_control::port::limits::{AxisLimits, Bound};
use gusset_control::port::{
    Axis, AxisSpec, Exit, Exits, Pace, Port, PortSpec, Reference, WiringCheck, Zero,
};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::time::SimClock;
use gusset_record::Event;

const PERIOD: f64 = 1e-3;
const STIFFNESS: f64 = 2e5;

/// Half a second at 1 kHz with a spring in the only storey, made ready by `ready`: the run and every command.
fn led(more: &str, ready: impl FnOnce(PortSpec) -> Port) -> (Run, Vec<f64>) {
    led_by(
        more,
        ready,
        |_| {},
        &Control::from(crossbeam_channel::never()),
        [0.0; 2],
    )
}

/// Like `led`; `hears` gets the number of commands so far at each command, and the sensors read `bias` at rest.
fn led_by(
    more: &str,
    ready: impl FnOnce(PortSpec) -> Port,
    mut hears: impl FnMut(usize) + Send + 'static,
    control: &Control,
    bias: [f64; 2],
) -> (Run, Vec<f64>) {
    let text = format!(
        "{more}\n[time]\nrate_hz = 1000\nduration_s = 0.5\n[integrator]\nlambda = 2\n[structure.shear_building]\n\
         mass_kg = [2e3]\nstiffness_n_per_m = [3e5]\n[excitation.ground_acceleration.signal.sine]\namplitude = 0.2\n\
         frequency_hz = 2\n"
    );
    let mut experiment = prepare(&text).experiment;
    let way: Arc<Mutex<Vec<f64>>> = Arc::default();
    let went = Arc::clone(&way);
    let mut spring = Spring::new(STIFFNESS, move |command| {
        let mut went = went.lock().unwrap();
        went.push(command.disp[0]);
        hears(went.len());
    });
    spring.bias = bias;
    let axis = Axis::plain(vec![(0, 1.0)]);
    let axes = vec![AxisSpec::new(axis, STIFFNESS)];
    let spec = PortSpec::new("rig", Box::new(spring), 1, axes);
    experiment.ports.push(ready(spec));
    let run = run_under(experiment, SimClock::new(), control);
    let way = way.lock().unwrap().clone();
    (run, way)
}

fn largest_step(way: &[f64]) -> f64 {
    let steps = way.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    steps.fold(0.0, f64::max)
}

/// At most 0.1 m/s, which is tripped at.
fn slowly(spec: &mut PortSpec) {
    let mut limits = AxisLimits::NONE;
    limits.set(
        Limit::CommandVel,
        Bound {
            warn: 0.1,
            trip: 0.1,
        },
    );
    (spec.axes[0].limits, spec.tick) = (limits, PERIOD);
}

#[test]
fn specimen_elsewhere_is_checked_and_ramped() {
    for (more, stands) in [
        ("safety.zero_s = 0.005", 0.02),
        ("safety.zero_s = 0", 0.02),
        ("safety.zero_s = 0", -0.013),
    ] {
        let more = format!("timing.warmup_ticks = 3\n{more}");
        let (run, way) = led(&more, |mut spec| {
            slowly(&mut spec);
            let mut port = spec.build().unwrap();
            port.startup_mut().report_position(AtAxis(&[stands]));
            *port.startup_mut().wiring_mut() = WiringCheck::Probe {
                amplitude: vec![0.001],
                stiffness: vec![STIFFNESS],
                accepted: None,
                pace: Pace::of(0.05, PERIOD),
                units: Vec::new(),
            };
            port
        });
        assert_eq!(run.outcome.ending, Ending::Completed, "{more}");
        // 2 · 50 ticks of ramps and 3 · 20 of holds.
        let (tried, rest) = way.split_at(160);
        assert!(
            tried
                .iter()
                .all(|disp| (stands..=stands + 0.001 + 1e-12).contains(disp))
        );
        assert_eq!(tried[0], stands);
        assert!((rest[0] - stands).abs() < 0.0501 * PERIOD, "{more}");
        assert!(tried.contains(&(stands + 0.001)));
        // Half the limit, by what the ramp may use.
        let to_the_test = &way[..way.iter().position(|disp| *disp == 0.0).unwrap()];
        assert!(largest_step(to_the_test) < 0.0501 * PERIOD, "{more}");
    }
}

/// Without zeroing, too, the ramp waits for the first answer of every specimen, within the limits for waiting. A specimen without
/// an answer does not move in the shutdown either.
#[test]
fn no_specimen_moves_before_all_answered() {
    let stale = Stop::Stale { port: 1, ticks: 21 };
    for (silent, stops, ends) in [
        (8, None, Ending::Completed),
        (100, None, Ending::Stopped(stale)),
        (100, Some(8), Ending::Stopped(Stop::Operator)),
    ] {
        let log = rig::Log::default();
        let more = "timing.warmup_ticks = 3\nstructure.initial_displacement_m = [0.01, 0.03]";
        let mut experiment = rig::two_floors(20, more);
        experiment.opening.ramp_s = 0.05;
        experiment.limits.stale_in_a_row = 20;
        for number in 0..2 {
            let act = move |phase, sequence| match phase {
                rig::Phase::Collect if number == 1 && sequence < silent => rig::Act::Miss,
                _ => rig::Act::Serve,
            };
            let axis = rig::storey(number);
            let mut exits = Exits {
                on_trip: Exit::Safe(AtAxis(vec![0.002])),
                speed: 0.5,
                ..Exits::default()
            };
            if stops.is_some() {
                exits.at_end = Exit::Safe(AtAxis(vec![0.002]));
            }
            rig::attach_leaving(&mut experiment, axis, exits, &log, act);
        }
        let (ask, requests) = crossbeam_channel::bounded(16);
        for _ in 0..stops.unwrap_or(0) {
            ask.send(Operator::Continue).unwrap();
        }
        if stops.is_some() {
            ask.send(Operator::Stop).unwrap();
        }
        let run = run_under(experiment, SimClock::new(), &Control::from(requests));
        assert_eq!(run.outcome.ending, ends);
        let told = |of: usize| -> Vec<f64> {
            let calls = log.lock().unwrap();
            let issued = calls.iter().filter_map(|call| match *call {
                (rig, rig::Call::Issue { disp, .. }) if rig == of => Some(disp),
                _ => None,
            });
            issued.collect()
        };
        let stands = |way: Vec<f64>| way.iter().take_while(|disp| **disp == 0.0).count();
        let never_moves = told(1).iter().all(|disp| *disp == 0.0);
        if ends == Ending::Completed {
            assert_eq!((stands(told(0)), stands(told(1))), (9, 9));
        } else {
            let stood = stands(told(0));
            assert_eq!((stood, never_moves), (stops.unwrap_or(21), true));
            assert_eq!(
                run.outcome.left,
                [EndPosition::Reached, EndPosition::Stayed]
            );
        }
    }
}

/// Whatever bounds the commands bounds the ramp: by half of it.
#[test]
fn the_ramp_keeps_every_bound_of_a_command() {
    let ramp = |limits: AxisLimits| {
        let more = "timing.warmup_ticks = 3\nsafety.ramp_s = 0.01\nstructure.initial_displacement_m = [0.02]";
        let (run, way) = led(more, |mut spec| {
            (spec.axes[0].limits, spec.tick) = (limits, PERIOD);
            spec.build().unwrap()
        });
        assert_eq!(run.outcome.ending, Ending::Completed);
        way[..=way.iter().position(|disp| *disp == 0.02).unwrap()].to_vec()
    };
    let (step, speed, accel) = (5e-4, 5e-4 / PERIOD, 40.0);
    let by_step = ramp(AxisLimits::NONE.with(Limit::CommandStep, Bound::trip(step)));
    assert!(largest_step(&by_step) <= 0.5 * step);
    let by_speed = ramp(AxisLimits::NONE.with(Limit::CommandVel, Bound::trip(speed)));
    assert_eq!(by_step, by_speed, "the same bound in other units");
    let by_accel = ramp(AxisLimits::NONE.with(
        Limit::CommandAccel,
        Bound {
            warn: accel,
            trip: 2.0 * accel,
        },
    ));
    let bend = |three: &[f64]| (three[0] - 2.0 * three[1] + three[2]).abs();
    let most = by_accel.windows(3).map(bend).fold(0.0, f64::max);
    assert!(most <= 0.5 * accel * PERIOD * PERIOD, "{most}");
    // And no slower than that: a tick more at the most.
    assert!(most > 0.45 * accel * PERIOD * PERIOD, "{most}");
}

/// A run whose operator gives each of these once its number of commands has left.
fn held(more: &str, says: &'static [(usize, Operator)]) -> (Run, Vec<f64>) {
    let (ask, requests) = crossbeam_channel::bounded(8);
    let hears = move |told| {
        for (_, word) in says.iter().filter(|(at, _)| *at == told) {
            ask.send(*word).unwrap();
        }
    };
    led_by(
        more,
        |spec| spec.build().unwrap(),
        hears,
        &Control::from(requests),
        [0.0; 2],
    )
}

const EASED: &str = "timing.warmup_ticks = 3\nsafety.zero_s = 0.005\nsafety.ease_s = 0.05";

#[test]
fn hold_in_the_ramp_comes_to_rest() {
    let text = format!("{EASED}\nstructure.initial_displacement_m = [0.02]");
    let (free, free_way) = held(&text, &[]);
    let says = &[(300, Operator::Hold), (700, Operator::Continue)];
    let (run, way) = held(&text, says);
    assert_eq!(run.outcome.ending, Ending::Completed);
    // Requested with command 300, accepted before the next one was sent: 50 ticks to rest after it.
    let stood = &way[350..700];
    assert!(stood.iter().all(|disp| *disp == way[350]));
    assert!(way[350] > way[300] && way[350] < 0.006, "{}", way[350]);
    // The ramp of 1 s: π/2 of the mean speed, and π²/2 of the mean speed in half of it; the hold ramp takes 50 ticks.
    let speed = std::f64::consts::FRAC_PI_2 * 0.02 / 1000.0;
    let bend = speed * std::f64::consts::PI / 1000.0 + speed / 50.0;
    let ramp = &way[..=way.iter().position(|disp| *disp == 0.02).unwrap()];
    for three in ramp.windows(3) {
        assert!((three[0] - 2.0 * three[1] + three[2]).abs() < bend);
        assert!(three[2] >= three[1]);
    }
    for column in ["x1", "force_1_1"] {
        assert_eq!(run.column(column), free.column(column), "{column}");
    }
    // A linear fall and a linear rise: half of the 50 ticks of each is lost, besides the time of the hold.
    let more = way.len() - free_way.len();
    assert!((395..=405).contains(&more), "{more}");
}

#[test]
fn hold_before_the_ramp_moves_nothing() {
    let text = format!("{EASED}\nstructure.initial_displacement_m = [0.02]");
    let (_, way) = held(&text, &[(2, Operator::Hold), (200, Operator::Continue)]);
    assert!(way[..200].iter().all(|disp| *disp == 0.0));
    assert!(way.contains(&0.02));
    let (free, _) = held(EASED, &[]);
    for at in [
        &[(2, Operator::Hold), (200, Operator::Continue)],
        &[(7, Operator::Hold), (200, Operator::Continue)],
    ] {
        let (run, way) = held(EASED, at);
        assert!(way[..200].iter().all(|disp| *disp == 0.0));
        assert_eq!(run.column("x1"), free.column("x1"));
    }
}

/// In the middle of the loading half, at the top, and on the return half: the hold comes to rest as in the test, and the result of
/// the wiring check does not change.
#[test]
fn hold_in_the_wiring_check_comes_to_rest() {
    const AMPLITUDE: f64 = 0.001;
    let tried = |says: Vec<(usize, Operator)>| {
        let (ask, requests) = crossbeam_channel::bounded(8);
        let hears = move |told| {
            for (_, word) in says.iter().filter(|(at, _)| *at == told) {
                ask.send(*word).unwrap();
            }
        };
        let ready = |mut spec: PortSpec| {
            spec.wiring = WiringCheck::Probe {
                amplitude: vec![AMPLITUDE],
                stiffness: vec![STIFFNESS],
                accepted: None,
                pace: Pace::of(1.0, PERIOD),
                units: Vec::new(),
            };
            spec.build().unwrap()
        };
        led_by(EASED, ready, hears, &Control::from(requests), [0.0; 2])
    };
    // Holds of 400 ticks and ways of 1000.
    let (free, free_way) = tried(Vec::new());
    for at in [900, 1500, 2300] {
        let (run, way) = tried(vec![(at, Operator::Hold), (at + 400, Operator::Continue)]);
        assert_eq!(run.outcome.ending, Ending::Completed);
        let stood = &way[at + 50..at + 400];
        assert!(stood.iter().all(|disp| *disp == stood[0]), "{at}");
        // It resumes from there: half of the 50 ticks of each hold ramp is lost, besides the time of the hold.
        let more = way.len() - free_way.len();
        assert!((395..=405).contains(&more), "{at}: {more}");
        assert_eq!(way[3200 + more - 1], 0.0, "back to the last bit");
        let speed = std::f64::consts::FRAC_PI_2 * AMPLITUDE / 1000.0;
        let bend = speed * std::f64::consts::PI / 1000.0 + speed / 50.0;
        for three in way[..3200 + more].windows(3) {
            assert!((three[0] - 2.0 * three[1] + three[2]).abs() < bend, "{at}");
        }
        let found = |run: &Run| {
            let mut found = run.events.iter().filter_map(|event| match event.kind {
                Event::Direction { disp, force, .. } => Some((disp, force)),
                _ => None,
            });
            found.next().unwrap()
        };
        let (usual, found) = (found(&free), found(&run));
        assert!((found.0 / usual.0 - 1.0).abs() < 1e-12 && (found.1 / usual.1 - 1.0).abs() < 1e-9);
        for column in ["x1", "force_1_1"] {
            assert_eq!(run.column(column), free.column(column), "{column}");
        }
    }
    // An operator who stops the test in the hold ends it there.
    let says = vec![(900, Operator::Hold), (1200, Operator::Stop)];
    let (run, way) = tried(says);
    assert_eq!(run.outcome.ending, Ending::Stopped(Stop::Operator));
    assert_eq!((way.len(), way[950]), (1200, way[1199]));
}

#[test]
fn sensor_offset_is_no_following_error() {
    let ended = |reference: Reference, bias: f64| {
        let ready = |mut spec: PortSpec| {
            let mut limits = AxisLimits::NONE;
            limits.set(
                Limit::FollowingError,
                Bound {
                    warn: 0.001,
                    trip: 0.001,
                },
            );
            spec.tick = PERIOD;
            (spec.axes[0].limits, spec.axes[0].reference) = (limits, reference);
            spec.build().unwrap()
        };
        let nobody = Control::from(crossbeam_channel::never());
        led_by(EASED, ready, |_| {}, &nobody, [bias, 0.0])
            .0
            .outcome
            .ending
    };
    let relative = Reference {
        disp: Zero::Relative,
        force: Zero::Absolute,
    };
    assert_eq!(ended(relative, 0.004), Ending::Completed);
    assert_eq!(ended(Reference::default(), 0.0), Ending::Completed);
    assert!(matches!(
        ended(Reference::default(), 0.004),
        Ending::Stopped(_)
    ));
}

/// In the test it is commanded once in ten ticks, but not yet here: 10 mm in 0.05 s are 0.3 m/s.
#[test]
fn per_step_velocity_uses_tick_in_startup() {
    let (run, way) = led(EASED, |mut spec| {
        slowly(&mut spec);
        (spec.per_step, spec.step) = (true, Some(10.0 * PERIOD));
        spec.wiring = WiringCheck::Probe {
            amplitude: vec![0.01],
            stiffness: vec![STIFFNESS],
            accepted: None,
            pace: Pace::of(0.05, PERIOD),
            units: Vec::new(),
        };
        spec.build().unwrap()
    });
    let Ending::Stopped(Stop::Limit { hit, .. }) = run.outcome.ending else {
        panic!("{:?}", run.outcome.ending);
    };
    assert_eq!(hit.quantity, Limit::CommandVel);
    assert!(largest_step(&way) <= 0.1 * PERIOD);
}

/// In the test it has the ten ticks of its step for each command. In the shutdown it is commanded every tick again, and has one:
/// 0.1 m/s is too fast there, and would be 0.01 m/s by the step.
#[test]
fn per_step_velocity_uses_the_step_in_test() {
    let (run, way) = led(EASED, |mut spec| {
        let limits = AxisLimits::NONE.with(Limit::CommandVel, Bound::trip(0.02));
        (spec.axes[0].limits, spec.tick) = (limits, PERIOD);
        (spec.per_step, spec.step) = (true, Some(10.0 * PERIOD));
        (spec.exits.at_end, spec.exits.speed) = (Exit::Safe(AtAxis(vec![0.05])), 0.1);
        spec.build().unwrap()
    });
    assert!(largest_step(&way) > 0.02 * PERIOD, "{}", largest_step(&way));
    assert_eq!(run.outcome.steps, 500);
    let unfinished = run.outcome.unfinished.unwrap();
    assert_eq!(unfinished.after, Ending::Completed);
    let Stop::Limit { hit, .. } = unfinished.stop else {
        panic!("{:?}", unfinished.stop);
    };
    assert_eq!(hit.quantity, Limit::CommandVel);
}

#[test]
fn startup_tick_uses_its_share_of_the_step() {
    let text = "safety.zero_s = 0\nsafety.ramp_s = 0.4\nstructure.initial_displacement_m = [0.02]\n[time]\n\
                step_s = 0.01\nduration_s = 0.1\nclock = \"simulated\"\nticks_per_step = 8\n[integrator]\nlambda = 2\n\
                [structure.shear_building]\nmass_kg = [2e3]\nstiffness_n_per_m = [3e5]\n[timing]\nwarmup_ticks = 3\n";
    let mut experiment = prepare(text).experiment;
    let passed: Arc<Mutex<Vec<f64>>> = Arc::default();
    let heard = Arc::clone(&passed);
    let spring = Spring::new(STIFFNESS, move |command| {
        heard.lock().unwrap().push(command.dt)
    });
    let axis = Axis::plain(vec![(0, 1.0)]);
    let mut spec = PortSpec::new(
        "rig",
        Box::new(spring),
        1,
        vec![AxisSpec::new(axis, STIFFNESS)],
    );
    spec.exits = Exits {
        on_trip: Exit::Freeze,
        at_end: Exit::ZeroDisp,
        speed: 0.05,
        comes_to_rest: false,
    };
    experiment.ports.push(spec.build().unwrap());
    let period = experiment.period.value();
    let run = run_on(experiment, SimClock::new());
    assert_eq!(run.outcome.ending, Ending::Completed);
    let passed = passed.lock().unwrap();
    let ramp = (0.4 / period).ceil() as usize;
    // Before it moves, the loop queries its position.
    assert_eq!(passed[0], 0.0);
    let behind = 1 + ramp + 3 + 81;
    assert!(passed.len() > behind + 8);
    for dt in passed[1..=ramp].iter().chain(&passed[behind..]) {
        assert!((dt - 0.01 / 8.0).abs() < 1e-15, "{dt}");
    }
}

/// However short the ramp in the file: without a limit of its speed a specimen at another place gets one second.
#[test]
fn a_short_ramp_is_no_jump() {
    let (run, way) = led("safety.zero_s = 0.005\nsafety.ramp_s = 0.001", |spec| {
        let mut port = spec.build().unwrap();
        port.startup_mut().report_position(AtAxis(&[0.02]));
        port
    });
    assert_eq!(run.outcome.ending, Ending::Completed);
    let to_the_test = &way[..way.iter().position(|disp| *disp == 0.0).unwrap()];
    assert!(to_the_test.len() >= 1000, "{}", to_the_test.len());
    // Half a cosine is π/2 times as fast in its middle as on the average.
    assert!(largest_step(to_the_test) < 0.02 * 1.5709 * PERIOD);
}

/// Sensor noise of a specimen at rest is no stiffness: no stiffness limit trips, whatever the noise.
#[test]
fn specimen_at_rest_shows_no_stiffness() {
    for seed in [1, 2, 3, 4, 6, 12] {
        let text = format!(
            "safety.zero_s = 0.2\n[time]\nrate_hz = 500\nduration_s = 1\nclock = \"simulated\"\n\
             [structure.shear_building]\nmass_kg = [2000]\nstiffness_n_per_m = [1e5]\ndamping_n_s_per_m = [2000]\n\
             [excitation.ground_acceleration.signal.sine]\namplitude = 1.0\nfrequency_hz = 1\n\
             [[specimen]]\nname = \"s\"\nstorey = 1\nlaw.linear = {{ stiffness_n_per_m = 1e6 }}\n\
             limits.stiffness_ratio = {{ trip = 2 }}\n[specimen.transfer]\nseed = {seed}\n\
             disp_sensor = {{ noise_rms_m = 5e-5 }}\nforce_sensor = {{ noise_rms_n = 300 }}\n"
        );
        let experiment = prepare(&text).experiment;
        let run = run_under(
            experiment,
            SimClock::new(),
            &Control::from(crossbeam_channel::never()),
        );
        assert_eq!(run.outcome.ending, Ending::Completed, "{seed}");
    }
}

/// A user may take an hour to answer a question: at full speed the rows would fill hundreds of gigabytes.
#[test]
#[expect(clippy::disallowed_methods, reason = "what one does who waits")]
fn waiting_in_simulated_time_makes_few_rows() {
    let (ask, requests) = crossbeam_channel::bounded(4);
    let control = Control {
        request_socket: Some(ask.clone()),
        ..Control::from(requests)
    };
    let says = std::thread::spawn(move || {
        gusset_session::pause(std::time::Duration::from_millis(300));
        ask.send(Operator::Stop).unwrap();
    });
    let began = std::time::Instant::now();
    let safety = "[safety]\nconfirm = true\nzero_s = 0.05";
    let (run, way) = led_by(
        safety,
        |spec| spec.build().unwrap(),
        |_| {},
        &control,
        [0.0; 2],
    );
    let waited = began.elapsed();
    says.join().unwrap();
    assert_eq!(run.outcome.ending, Ending::Stopped(Stop::Operator));
    // A reading is 50 ticks, a wait 50 ms.
    let most = 60 + waited.as_millis() / 50;
    assert!((way.len() as u128) < most, "{} in {waited:?}", way.len());
}
