//! A static load is brought on before t = 0 and held: the structure stays where it is, and nothing was driven back and forth.

mod common;

use common::engine::{Run, distance, prepare, run, run_on};
use gusset::engine::{Ending, Phase};
use gusset::rt::timing::Quantity;
use gusset::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset::time::{Nanos, SimClock};

const STEPS: f64 = 1024.0;

fn test(structure: &str, rest: &str) -> Run {
    run(&format!(
        "[time]\nrate_hz = 256\nduration_s = 4\n[integrator]\nlambda = 4\n[structure]\n{structure}\n\
         [structure.shear_building]\nmass_kg = [20e3, 20e3, 18e3]\n{rest}"
    ))
}

/// From t = 0 on every floor is at `at` and stays there. A force balance known to a few roundings of the load, and a few
/// more in each of 1024 undamped ticks: 10 ε a tick of the displacement, over the share b of the stiffness that is left.
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

/// Rows before t = 0 say so, stand still in time, and have neither velocity nor acceleration.
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

const LOAD: &str = "static_load_n = [40e3, 20e3, 60e3]";

#[test]
fn a_linear_structure_stays_where_the_load_has_put_it() {
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
fn a_storey_that_yielded_under_the_load_stays_too() {
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

/// Two yielding specimens, one with an unloading stiffer than its loading (β > γ): every command before t = 0 goes on from
/// the one before, and the force with it. Backwards by rounding, where balance is reached, is no motion.
#[test]
fn a_yielding_specimen_is_never_driven_backwards() {
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

/// On a spring of known stiffness each part of the load is one way, and the next begins where it has led: twenty equal ones,
/// each in one tick where no time is asked for.
#[test]
fn the_load_comes_on_in_twenty_equal_parts() {
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
fn a_base_that_starts_with_a_velocity_does_not_push_before_t_0() {
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

/// The exchanges that bring the load on are no ticks of the test: no histogram counts them, warm-up or none.
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
            run.outcome.timing.histogram(quantity).len(),
            1025,
            "{quantity:?}"
        );
    }
}

/// 20 kN on 2e5 N/m beside 8e5 N/m: 20 mm, in 20 equal corrections, for both are known exactly. The ramp's second is shared
/// over them; half of a limit of 0.02 m/s takes longer.
#[test]
fn a_static_load_comes_on_within_the_ramps_time_and_half_the_speed_limit() {
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

/// What makes up for an actuator that goes 0.9 of the way commands 1/0.9 from the first part of the load on, not at t = 0.
#[test]
fn a_compensator_with_a_gain_is_there_before_the_test_begins() {
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

/// A specimen some of whose answers are lost: those to so many commands from one of them on.
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

/// 60 kN on a spring alone, in 20 ticks and 200; nine answers in a row are lost, whenever: the load comes on later for it, never
/// beyond what it is, and never back.
#[test]
fn answers_that_stay_away_do_not_overload_a_specimen() {
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
