//! A static load is brought on before t = 0 and held: the structure stays where it is, and nothing was driven back and forth.

use crate::common::engine::{Run, distance, prepare, run, run_on, run_under};
use crate::common::spring::Spring;
use gusset_control::engine::{Control, EndPosition, Ending, Experiment, Operator, Phase, Stop};
use gusset_control::port::{Trend, WiringCheck};
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::{Nanos, SimClock};
use gusset_record::rt::timing::Quantity;

const STEPS: f64 = 1024.0;

fn test(structure: &str, rest: &str) -> Run {
    run(&format!(
        "[time]\nrate_hz = 256\nduration_s = 4\n[integrator]\nlambda = 4\n[structure]\n{structure}\n\
         [structure.shear_building]\nmass_kg = [20e3, 20e3, 18e3]\n{rest}"
    ))
}

/// From t = 0 on every floor is at `at` and stays there. A force balance known to a few roundings of the load, and a few more in
/// each of 1024 undamped ticks: 10 ε a tick of the displacement, over the remaining share b of the stiffness.
fn assert_stays(run: &Run, at: [f64; 3], share: f64) {
    for (dof, at) in at.into_iter().enumerate() {
        let x = run.column(&format!("x{}", dof + 1));
        assert_eq!(x.len(), 1025);
        let found = distance(&x, &vec![at; x.len()]);
        assert!(
            found < STEPS * 10.0 * f64::EPSILON / share,
            "x{}: {found:e}",
            dof + 1
        );
    }
}

/// Rows before t = 0 have that phase, a constant time, and neither velocity nor acceleration.
fn assert_settling_rows(run: &Run) {
    let count = run.rows.len() - 1025;
    assert!(count > 0);
    let states = run.all("state");
    assert!(states[..count].iter().all(|s| *s == Phase::Settling.code()));
    assert!(states[count..].iter().all(|s| *s == Phase::Running.code()));
    for name in ["time", "v1", "v2", "v3", "a1", "a2", "a3", "ground"] {
        let before = &run.all(name)[..count];
        assert!(
            before.iter().all(|value| *value == 0.0),
            "{name}: {before:?}"
        );
    }
}

/// The specimen is four times as stiff as the file says: each correction would be twice the last, and turn back.
#[test]
fn diverging_corrections_end_the_test() {
    let text = "[time]\nrate_hz = 1024\nduration_s = 1\n[safety]\nunlimited = \"a spring\"\nzero_s = 0\n[structure]\n\
                gravity = { influence = [-1] }\n[structure.matrices]\nmass = [[20e3]]\nstiffness = [[2e6]]\n\
                damping = [[30e3]]\n[[specimen]]\nname = \"stiff\"\nrows = [[1]]\nstiffness_n_per_m = 4e6\n\
                link = { address = \"127.0.0.1:9\", coupling = \"lockstep\" }\n";
    let mut experiment = prepare(text).experiment;
    let port = experiment.ports.remove(0);
    let spring = Spring::new(16e6, |_| {});
    experiment.ports.push(port.watched(|_, _| Box::new(spring)));
    let run = run_on(experiment, SimClock::new());
    let Ending::Stopped(Stop::NotSettled { port, .. }) = run.outcome.ending else {
        panic!("{:?}", run.outcome.ending);
    };
    assert_eq!(port, Some(0));
    // The load, 196 kN in 20 parts over 6 MN/m.
    let commands = run.all("cmd_1_1").into_iter();
    let farthest = commands.fold(0.0, |most: f64, disp| most.max(disp.abs()));
    assert!(farthest > 1e-3 && farthest < 3e-3, "{farthest}");
}

const LOAD: &str = "static_load_n = [40e3, 20e3, 60e3]";

#[test]
fn linear_structure_stays_under_its_load() {
    let run = test(LOAD, "stiffness_n_per_m = [15e6, 14e6, 11e6]\n");
    let drift = [120e3 / 15e6, 80e3 / 14e6, 60e3 / 11e6];
    let at = [
        drift[0],
        drift[0] + drift[1],
        drift[0] + drift[1] + drift[2],
    ];
    assert_stays(&run, at, 1.0);
    assert_settling_rows(&run);
}

#[test]
fn weight_is_mass_times_g_in_its_direction() {
    let gravity = "gravity = { influence = [0, 0, 1], accel_m_per_s2 = 9.5 }";
    let run = test(gravity, "stiffness_n_per_m = [15e6, 14e6, 11e6]\n");
    let weight = 18e3 * 9.5;
    let drift = [weight / 15e6, weight / 14e6, weight / 11e6];
    let at = [
        drift[0],
        drift[0] + drift[1],
        drift[0] + drift[1] + drift[2],
    ];
    assert_stays(&run, at, 1.0);
}

/// 120 kN on a storey that yields at 70 kN: u_y + 50 kN/(b k). As an element and as a specimen.
#[test]
fn yielded_storey_stays_under_its_load() {
    let (k, b) = (9e6, 0.1);
    let law = "law = { bilinear = { stiffness_n_per_m = 9e6, yield_force_n = 70e3, post_yield_ratio = 0.1 } }";
    let first = 70e3 / k + 50e3 / (b * k);
    let at = [
        first,
        first + 80e3 / 14e6,
        first + 80e3 / 14e6 + 60e3 / 11e6,
    ];
    let storeys = "stiffness_n_per_m = [0, 14e6, 11e6]\n";
    let element = format!("{storeys}[[structure.element]]\nfrom = \"ground\"\nto = 1\n{law}\n");
    assert_stays(&test(LOAD, &element), at, b);
    let specimen = format!("{storeys}[[specimen]]\nname = \"s\"\nstorey = 1\n{law}\n");
    let run = test(LOAD, &specimen);
    assert_stays(&run, at, b);
    assert_settling_rows(&run);
}

/// Two yielding specimens, one with an unloading stiffer than its loading (β > γ): every command before t = 0 continues in the
/// direction of the previous one, and so does the force. A reversal by rounding near equilibrium is no motion.
#[test]
fn yielding_specimen_never_moves_backwards() {
    let run = test(
        LOAD,
        "stiffness_n_per_m = [0, 0, 11e6]\n\
         [[specimen]]\nname = \"lower\"\nstorey = 1\nlaw = { bouc_wen = { stiffness_n_per_m = 9e6, \
         yield_force_n = 70e3, post_yield_ratio = 0.1, beta = 0.8, gamma = 0.2, exponent = 1.6 } }\n\
         [[specimen]]\nname = \"upper\"\nstorey = 2\nlaw = { bilinear = { stiffness_n_per_m = 8e6, \
         yield_force_n = 50e3, post_yield_ratio = 0.1 } }\n",
    );
    for name in ["cmd_1_1", "cmd_2_1", "force_1_1", "force_2_1"] {
        let settling = run.rows.len() - run.column(name).len();
        let values = &run.all(name)[..=settling];
        assert!(values[0] == 0.0 && values[settling] > 0.0);
        for pair in values.windows(2) {
            let back = pair[0] - pair[1];
            assert!(back <= 8.0 * f64::EPSILON * pair[0], "{name}: {pair:?}");
        }
    }
    // Storey shears: 120 kN and 80 kN, both beyond yield.
    let force = [run.column("force_1_1")[0], run.column("force_2_1")[0]];
    assert!(
        (force[0] / 120e3 - 1.0).abs() < 1e-12 && (force[1] / 80e3 - 1.0).abs() < 1e-12,
        "{force:?}"
    );
}

/// On a spring of known stiffness each part of the load is one move, and the next begins at its end: twenty equal parts, each in
/// one tick where no time is configured.
#[test]
fn static_load_comes_in_twenty_equal_parts() {
    let run = test(
        LOAD,
        "stiffness_n_per_m = [0, 14e6, 11e6]\n\
         [[specimen]]\nname = \"s\"\nstorey = 1\nlaw = { linear = { stiffness_n_per_m = 15e6 } }\n\
         [safety]\nramp_s = 0\n",
    );
    let command = run.all("cmd_1_1");
    let part = 120e3 / 15e6 / 20.0;
    let ways: Vec<f64> = command.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let long = ways.iter().filter(|way| (**way / part - 1.0).abs() < 1e-9);
    assert_eq!(long.count(), 20);
    let rest = ways.iter().filter(|way| (**way / part - 1.0).abs() >= 1e-9);
    assert!(rest.into_iter().all(|way| way.abs() < 1e-9 * part));
}

/// The base may move already at t = 0: while the load is brought on nothing moves, and no damper pushes.
#[test]
fn moving_base_does_not_push_before_t_0() {
    let text = |motion: &str| {
        format!(
            "stiffness_n_per_m = [15e6, 14e6, 11e6]\ndamping_n_s_per_m = [2e5, 2e5, 2e5]\n{motion}"
        )
    };
    let moving = "[excitation.base_displacement.signal.sine]\namplitude = 0.05\nfrequency_hz = 1\n";
    let (still, moving) = (test(LOAD, &text("")), test(LOAD, &text(moving)));
    for name in ["x1", "x2", "x3"] {
        assert_eq!(
            still.column(name)[0].to_bits(),
            moving.column(name)[0].to_bits()
        );
    }
    assert!(moving.column("a1")[0] > 1.0, "and at t = 0 it does push");
}

/// The exchanges that apply the load are no ticks of the test: no histogram counts them, with or without a warm-up.
#[test]
fn exchanges_before_t_0_are_not_timed() {
    let run = test(
        LOAD,
        "stiffness_n_per_m = [0, 14e6, 11e6]\n[timing]\nwarmup_ticks = 0\n\
         [[specimen]]\nname = \"s\"\nstorey = 1\nlaw = { linear = { stiffness_n_per_m = 9e6 } }\n",
    );
    assert!(run.rows.len() > 1025);
    for quantity in [
        Quantity::WakeupLateness,
        Quantity::RoundTrip,
        Quantity::Compute,
    ] {
        assert_eq!(
            run.outcome.pace.timing.histogram(quantity).len(),
            1025,
            "{quantity:?}"
        );
    }
}

/// 20 kN on 2e5 N/m beside 8e5 N/m: 20 mm, in 20 equal corrections, for both are known exactly. The ramp's second is shared
/// over them; half of a limit of 0.02 m/s takes longer.
#[test]
fn static_load_keeps_ramp_and_speed_limit() {
    let loaded = |more: &str| {
        let run = run(&format!(
            "safety.zero_s = 0\n[time]\nrate_hz = 256\nduration_s = 1\n[structure]\nstatic_load_n = [20e3]\n\
             [structure.shear_building]\nmass_kg = [20e3]\nstiffness_n_per_m = [2e5]\n[[specimen]]\nname = \"s\"\n\
             storey = 1\nlaw = {{ linear = {{ stiffness_n_per_m = 8e5 }} }}\n{more}"
        ));
        let way = run.all("cmd_1_1");
        let loading = run
            .all("state")
            .iter()
            .take_while(|s| **s == Phase::Settling.code())
            .count();
        let steps = way.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        assert!((way[loading] - 0.02).abs() < 1e-12, "{more}");
        (loading, steps.fold(0.0, f64::max) * 256.0)
    };
    let cosine = std::f64::consts::FRAC_PI_2;
    // 12.8 ticks to a part are 13.
    let (ticks, fastest) = loaded("");
    assert!(
        (260..330).contains(&ticks) && fastest <= cosine * 0.00100001 * 256.0 / 13.0,
        "{ticks} {fastest}"
    );
    let limit = "[specimen.limits]\ncommand_vel_m_per_s = { trip = 0.02 }\n";
    let (ticks, fastest) = loaded(limit);
    assert!(ticks > 700 && fastest <= 0.01, "{ticks} {fastest}");
}

/// A compensator for an actuator with a gain of 0.9 commands 1/0.9 from the first part of the load on, not at t = 0.
#[test]
fn compensator_with_a_gain_reaches_the_load() {
    let run = run(
        "safety.zero_s = 0\n[time]\nrate_hz = 256\nduration_s = 0.25\n[structure]\nstatic_load_n = [20e3]\n\
         [structure.shear_building]\nmass_kg = [20e3]\nstiffness_n_per_m = [2e5]\n[[specimen]]\nname = \"s\"\n\
         storey = 1\nlaw = { linear = { stiffness_n_per_m = 8e5 } }\n[specimen.compensation.ats]\ndelay_s = 0.005\n\
         gain = 0.9\n",
    );
    let (way, targets) = (run.all("cmd_1_1"), run.all("x1"));
    let states = run.all("state");
    let first = states
        .iter()
        .position(|state| *state == Phase::Running.code());
    let first = first.unwrap();
    let largest = way[..=first + 1]
        .windows(2)
        .map(|two| (two[1] - two[0]).abs());
    // A twentieth of 22 mm in 13 ticks, π/2 times as fast in the middle.
    assert!(largest.fold(0.0, f64::max) < 1.6 * 0.0012 / 13.0);
    assert!((way[first] * 0.9 / targets[first] - 1.0).abs() < 1e-9);
}

/// 20 kN on each of two floors; the lower storey is mostly the specimen, behind `transfer`.
fn behind(transfer: &str, rate_hz: u32, rest_n_per_m: f64, law: &str) -> Experiment {
    behind_with("", transfer, rate_hz, rest_n_per_m, law)
}

/// The same with more keys of `[safety]`.
fn behind_with(
    safety: &str,
    transfer: &str,
    rate_hz: u32,
    rest_n_per_m: f64,
    law: &str,
) -> Experiment {
    prepare(&format!(
        "[time]\nrate_hz = {rate_hz}\nduration_s = 0.25\n[structure]\nstatic_load_n = [20e3, 20e3]\n\
         [structure.shear_building]\nmass_kg = [10e3, 10e3]\nstiffness_n_per_m = [{rest_n_per_m}, 8e6]\n\
         [structure.damping.rayleigh_ratio]\nratio = 0.05\nmodes = [1, 2]\n[safety]\nzero_s = 0\nramp_s = 1\n{safety}\
         [[specimen]]\nname = \"s\"\nstorey = 1\nlaw = {law}\n[specimen.transfer]\n{transfer}\n"
    ))
    .experiment
}

const SPRING: &str = "{ linear = { stiffness_n_per_m = 4e6 } }";

/// Rows before t = 0 of a test that completed: its commands there and the forces read, the last of them at t = 0.
fn brought_on(run: &Run) -> [Vec<f64>; 2] {
    assert_eq!(run.outcome.ending, Ending::Completed);
    let begun = run.rows.len() - run.column("x1").len();
    ["cmd_1_1", "raw_force_1_1"].map(|name| run.all(name)[..=begun].to_vec())
}

/// How far the values went back in all.
fn back(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[0] - pair[1]).max(0.0));
    steps.sum()
}

/// Whatever is between a command and the specimen, each correction uses the measurement after arrival. A twentieth of the load is
/// one move: an actuator that overshoots by 5 % of a move overshoots the load by 0.25 %.
#[test]
fn slow_actuator_is_waited_for() {
    let second_order = "actuator = { second_order = { frequency_hz = 2, damping_ratio = 0.7 } }";
    for (transfer, rate_hz) in [
        ("delay_s = 0.002", 1000),
        ("delay_s = 0.024", 1000),
        ("delay_s = 0.024", 100),
        ("delay_s = 0.1", 1000),
        (
            "actuator = { first_order = { time_constant_s = 0.002 } }",
            1000,
        ),
        (
            "actuator = { first_order = { time_constant_s = 0.024 } }",
            1000,
        ),
        (second_order, 1000),
        ("actuator = { servo_hydraulic = {} }", 4096),
        ("rate_limit_m_per_s = 0.01", 1000),
    ] {
        for (rest, law, most) in [
            (0.0, SPRING, 40e3),
            (2e6, "{ linear = { stiffness_n_per_m = 2e6 } }", 20e3),
        ] {
            let run = run_on(behind(transfer, rate_hz, rest, law), SimClock::new());
            let [way, force] = brought_on(&run);
            let seconds = way.len() as f64 / f64::from(rate_hz);
            assert!(seconds < 60.0, "{transfer}: {seconds} s");
            let last = force[force.len() - 1];
            let unbalance = 40e3 - rest * run.column("x1")[0] - last;
            assert!(unbalance.abs() < 1e-6 * 40e3, "{transfer}: {unbalance} N");
            let largest = force
                .iter()
                .fold(0.0, |most: f64, force| most.max(force.abs()));
            assert!(largest < 1.003 * most, "{transfer}: {largest} N");
            let (back, whole) = (back(&way), way[way.len() - 1]);
            assert!(
                back < 2e-3 * whole,
                "{transfer}: back by {back} of {whole} m"
            );
        }
    }
}

/// A specimen that yields at half of its load behind 24 ms: it never moves back by more than a share of the last part.
#[test]
fn delay_does_not_overload_a_yielding_one() {
    let law =
        "{ bilinear = { stiffness_n_per_m = 4e6, yield_force_n = 20e3, post_yield_ratio = 0.2 } }";
    let run = run_on(behind("delay_s = 0.024", 1000, 0.0, law), SimClock::new());
    let [way, force] = brought_on(&run);
    let at = 20e3 / 4e6 + 20e3 / 0.8e6;
    assert!((way[way.len() - 1] / at - 1.0).abs() < 1e-6);
    assert!(way.iter().all(|disp| *disp < 1.0001 * at));
    assert!(force.iter().all(|force| *force < 1.0001 * 40e3));
    assert!(back(&way) < 1e-4 * at, "{}", back(&way));
}

/// Noise of 0.1 % of the load, a quantum, a bias and an actuator with a gain of 95 %: the load is carried to within their errors.
#[test]
fn imperfect_sensors_do_not_block_the_load() {
    for transfer in [
        "force_sensor = { noise_rms_n = 40 }\ndisp_sensor = { noise_rms_m = 1e-5 }",
        "delay_s = 0.01\nforce_sensor = { noise_rms_n = 40 }\ndisp_sensor = { noise_rms_m = 1e-5 }",
        "delay_s = 0.01\nforce_sensor = { quantum_n = 20, bias_n = 30 }\ndisp_sensor = { quantum_m = 5e-6 }",
        "delay_s = 0.01\nactuator = { proportional = { gain = 0.95 } }",
    ] {
        let run = run_on(behind(transfer, 1000, 0.0, SPRING), SimClock::new());
        let [way, force] = brought_on(&run);
        let seconds = way.len() as f64 / 1000.0;
        assert!(seconds < 60.0, "{transfer}: {seconds} s");
        let last = force[force.len() - 1];
        assert!((last / 40e3 - 1.0).abs() < 5e-3, "{transfer}: {last}");
    }
}

/// A specimen whose end multiplies commands by `gain` and calls `heard` before each.
struct Wired<F> {
    inner: Box<dyn Substructure>,
    gain: f64,
    heard: F,
}

impl<F: FnMut() + Send> Substructure for Wired<F> {
    fn axes(&self) -> usize {
        1
    }
    fn coupling(&self) -> Coupling {
        self.inner.coupling()
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.heard)();
        self.inner.issue(&Command {
            disp: &[self.gain * command.disp[0]],
            vel: &[self.gain * command.vel[0]],
            ..*command
        })
    }
    fn collect(&mut self, until: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.inner.collect(until, into)
    }
    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        self.inner.accepted(sequence)
    }
    fn retire(&mut self, how: Retirement) {
        self.inner.retire(how);
    }
}

#[test]
fn slow_actuator_is_not_taken_for_reversed() {
    for transfer in [
        "actuator = { second_order = { frequency_hz = 2, damping_ratio = 0.7 } }",
        "actuator = { second_order = { frequency_hz = 5, damping_ratio = 0.5 } }",
        "delay_s = 0.1",
    ] {
        let listened_to = || {
            let mut experiment = behind_with(
                "on_trip = \"zero_displacement\"\nexit_speed_m_per_s = 0.05\n",
                transfer,
                500,
                0.5e6,
                "{ linear = { stiffness_n_per_m = 3.5e6 } }",
            );
            *experiment.ports[0].startup_mut().wiring_mut() =
                WiringCheck::Settling(Trend::new(1, vec![3.5e6]));
            experiment
        };
        brought_on(&run_on(listened_to(), SimClock::new()));
        let mut experiment = listened_to();
        let port = experiment.ports.pop().unwrap();
        // No safe direction is known.
        experiment.ports.push(port.watched(|inner, _| {
            Box::new(Wired {
                inner,
                gain: -1.0,
                heard: || (),
            })
        }));
        let run = run_on(experiment, SimClock::new());
        let Ending::Stopped(Stop::Misfit { misfit, .. }) = run.outcome.ending else {
            panic!("{transfer}: {:?}", run.outcome.ending);
        };
        assert_eq!(misfit.name(), "command_reversed");
        assert_eq!(run.outcome.left, [EndPosition::Stayed]);
        let way = run.all("cmd_1_1");
        assert!(way.iter().all(|disp| disp.abs() < 0.2 * 0.01), "{transfer}");
    }
}

/// A specimen whose force never settles carries no load: after 30 s the test ends.
#[test]
fn specimen_that_never_rests_ends_the_test() {
    let creeping = "rate_limit_m_per_s = 1e-6";
    let run = run_on(behind(creeping, 100, 0.0, SPRING), SimClock::new());
    let Ending::Stopped(stop) = run.outcome.ending else {
        panic!("{:?}", run.outcome.ending);
    };
    assert!(matches!(stop, Stop::NotAtRest { port: 0, .. }), "{stop}");
}

/// An actuator that does not move ends the test, beside a spring and without one.
#[test]
fn actuator_that_never_follows_ends_test() {
    let ends = "actuator = { proportional = { gain = 1e-9 } }";
    for (rest, law) in [
        (0.0, SPRING),
        (2e6, "{ linear = { stiffness_n_per_m = 2e6 } }"),
    ] {
        let run = run_on(behind(ends, 100, rest, law), SimClock::new());
        let Ending::Stopped(Stop::DoesNotFollow {
            port: 0,
            axis: 0,
            sent,
            read,
        }) = run.outcome.ending
        else {
            panic!("{:?}", run.outcome.ending);
        };
        assert!(read.abs() < 1e-9, "{read}");
        assert!(sent > read + 4e-4 && sent < 4.5e-3, "{sent}");
        let way = run.all("cmd_1_1");
        assert!(way.iter().all(|disp| *disp <= sent));
    }
}

/// Half of every move, and a sensor that shows a move only after eight: a specimen that follows at all moves on until it carries
/// the load.
#[test]
fn actuator_with_a_gain_error_reaches_load() {
    for transfer in [
        "actuator = { proportional = { gain = 0.5 } }",
        "disp_sensor = { quantum_m = 4e-3 }",
    ] {
        let run = run_on(behind(transfer, 100, 0.0, SPRING), SimClock::new());
        let [_, force] = brought_on(&run);
        let last = force[force.len() - 1];
        assert!((last / 40e3 - 1.0).abs() < 1e-3, "{transfer}: {last}");
    }
}

/// 60 kN on a stiff storey and none on a soft one, each with noise of 50 N: as a displacement the noise in the soft one is a
/// tenth of what the load does to the stiff one.
#[test]
fn noise_in_a_soft_direction_keeps_the_load() {
    let storey = |number: u32, stiffness: f64| {
        format!(
            "[[specimen]]\nname = \"s{number}\"\nstorey = {number}\nlaw = {{ linear = {{ stiffness_n_per_m = {stiffness} }} }}\n\
             transfer = {{ delay_s = 0.008, force_sensor = {{ noise_rms_n = 50 }}, seed = {number} }}\n"
        )
    };
    let run = run(&format!(
        "[time]\nrate_hz = 256\nduration_s = 0.25\n[structure]\nstatic_load_n = [60e3, 0]\n\
         [structure.shear_building]\nmass_kg = [50e3, 5e3]\nstiffness_n_per_m = [0, 0]\n\
         [structure.damping.modal]\nratios = [0.05]\n[safety]\nzero_s = 0\n{}{}",
        storey(1, 666e6),
        storey(2, 2e6)
    ));
    let [way, _] = brought_on(&run);
    let seconds = way.len() as f64 / 256.0;
    assert!(seconds < 60.0, "{seconds} s");
    let last = way[way.len() - 1];
    assert!((last * 666e6 / 60e3 - 1.0).abs() < 5e-3, "{last}");
}

/// It is pushed to its offset of 20 mm with 60 kN, and the load begins there: those forces are not part of the test.
#[test]
fn force_before_the_test_is_no_peak() {
    let run = run(
        "[time]\nrate_hz = 100\nduration_s = 0.5\n[structure]\nstatic_load_n = [10e3]\n[structure.shear_building]\n\
         mass_kg = [5e3]\nstiffness_n_per_m = [0]\n[safety]\nzero_s = 0.1\n[[specimen]]\nname = \"s\"\nstorey = 1\n\
         law = { linear = { stiffness_n_per_m = 3e6 } }\n[[specimen.axis]]\noffset_m = 0.02\n",
    );
    let forces = run.column("force_1_1");
    let largest = forces.iter().fold(0.0, |m: f64, force| m.max(force.abs()));
    assert!(largest < 11e3, "{largest}");
    assert_eq!(run.outcome.ports[0].1, [largest]);
    assert!(run.outcome.forces_on_the_way_in[0][0] > 59e3);
}

/// A hold of the operator in the midst of it changes nothing but when it is.
#[test]
fn hold_in_the_wait_changes_no_command() {
    let commands = |holds: std::ops::Range<u32>| {
        let (operator, requests) = crossbeam_channel::bounded(8);
        let mut experiment = behind("delay_s = 0.024", 1000, 0.0, SPRING);
        let port = experiment.ports.pop().unwrap();
        let mut asked = 0;
        experiment.ports.push(port.watched(|inner, _| {
            let heard = move || {
                asked += 1;
                if asked == holds.start {
                    operator.send(Operator::Hold).unwrap();
                } else if asked == holds.end {
                    operator.send(Operator::Continue).unwrap();
                }
            };
            Box::new(Wired {
                inner,
                gain: 1.0,
                heard,
            })
        }));
        let run = run_under(experiment, SimClock::new(), &Control::from(requests));
        let mut way = brought_on(&run)[0].clone();
        way.dedup();
        way
    };
    let undisturbed = commands(0..0);
    // The first part ends with its 50th tick or so.
    assert_eq!(commands(60..90), undisturbed);
}

/// A specimen that loses its answers to a range of commands.
struct Lossy {
    inner: Box<dyn Substructure>,
    lost: std::ops::Range<u32>,
    asked: u32,
    unread: Measurement,
}

impl Substructure for Lossy {
    fn axes(&self) -> usize {
        1
    }
    fn coupling(&self) -> Coupling {
        Coupling::Sampled
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.asked += 1;
        self.inner.issue(command)
    }
    fn collect(&mut self, until: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        if self.lost.contains(&self.asked) {
            self.inner.collect(until, &mut self.unread)?;
            return Ok(Freshness::Stale);
        }
        self.inner.collect(until, into)
    }
    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        self.inner.accepted(sequence)
    }
    fn retire(&mut self, how: Retirement) {
        self.inner.retire(how);
    }
}

/// 60 kN on a spring alone, in 20 ticks and 200; nine answers in a row are lost, at any time. The load arrives later, never above
/// its value, and never reversed.
#[test]
fn missing_answers_do_not_overload() {
    for (ramp_s, every) in [(0.2, 3), (1.0, 11)] {
        let loaded = |lost: std::ops::Range<u32>| {
            let mut experiment = prepare(&format!(
                "[time]\nrate_hz = 100\nduration_s = 0.1\n[structure]\nstatic_load_n = [60e3]\n\
                 [structure.shear_building]\nmass_kg = [20e3]\nstiffness_n_per_m = [0]\n[timing]\n\
                 warmup_ticks = 1\n[safety]\nzero_s = 0.1\nramp_s = {ramp_s}\n[[specimen]]\nname = \"s\"\n\
                 storey = 1\nlaw = {{ linear = {{ stiffness_n_per_m = 3e6 }} }}\n"
            ))
            .experiment;
            experiment.limits.stale_in_a_row = 10;
            let port = experiment.ports.pop().unwrap();
            experiment.ports.push(port.watched(|inner, _| {
                Box::new(Lossy {
                    inner,
                    lost,
                    asked: 0,
                    unread: Measurement::zeros(1),
                })
            }));
            let run = run_on(experiment, SimClock::new());
            assert_eq!(run.outcome.ending, Ending::Completed);
            run
        };
        let whole = loaded(0..0);
        let begun = |run: &Run| run.rows.len() - run.column("x1").len();
        for first in (1..begun(&whole) as u32).step_by(every) {
            let run = loaded(first..first + 9);
            let way = &run.all("cmd_1_1")[..=begun(&run)];
            for pair in way.windows(2) {
                assert!(pair[1] >= pair[0] - 1e-12, "{ramp_s} {first}: {pair:?}");
            }
            let last = way[way.len() - 1];
            assert!((last - 0.02).abs() < 1e-12, "{ramp_s} {first}: {last}");
        }
    }
}
