//! A prescribed displacement without any structure, the test before every hybrid test: the specimen follows its history, shows the
//! loop of its law, and the test reads its stiffness from it.

use crate::common::test_file::TestFile;
use std::f64::consts::TAU;

use crate::common::engine::{Run, distance, run};
use gusset_view::report::metrics::{absorbed_energy, identify, loading};

const K: f64 = 2e6;
const YIELD: f64 = 6e3;
const RATIO: f64 = 0.15;
const DT: f64 = 1.0 / 512.0;

fn test(duration: f64, signal: &str, law: &str) -> Run {
    run(&format!(
        "[time]\nrate_hz = 512\nduration_s = {duration}\n\
         [[specimen]]\nname = \"brace\"\nlaw = {{ {law} }}\n\
         [[excitation.prescribed_displacement]]\nspecimen = \"brace\"\nsignal = {{ {signal} }}\n"
    ))
}

fn bilinear() -> String {
    format!(
        "bilinear = {{ stiffness_n_per_m = {K}, yield_force_n = {YIELD}, post_yield_ratio = {RATIO} }}"
    )
}

/// Triangles of 2, 5 and 10 mm, two cycles each, at 40 mm/s: 1 s for a cycle of 10 mm.
fn cyclic() -> Run {
    let signal = "cyclic = { amplitudes = [2, 5, 10], unit = \"mm\", cycles_per_amplitude = 2, \
                  shape = \"triangle\", speed = 40.0 }";
    test(3.5, signal, &bilinear())
}

/// |d| of a triangle wave of this amplitude, `t` into it at 40 mm/s.
fn triangle(amplitude: f64, t: f64) -> f64 {
    let phase = (t * 0.04 / amplitude).rem_euclid(4.0);
    amplitude
        * if phase < 1.0 {
            phase
        } else if phase < 3.0 {
            2.0 - phase
        } else {
            phase - 4.0
        }
}

#[test]
fn specimen_follows_the_given_history() {
    let run = cyclic();
    let wanted: Vec<f64> = run
        .column("time")
        .iter()
        .map(|&t| match t {
            t if t <= 0.4 => triangle(0.002, t),
            t if t <= 1.4 => triangle(0.005, t - 0.4),
            t if t <= 3.4 => triangle(0.010, t - 1.4),
            _ => 0.0,
        })
        .collect();
    // Corners lie off the grid; a phase known to 1e-15 leaves the same on the displacement.
    assert!(distance(&run.column("target_1_1"), &wanted) < 1e-12);
    for name in ["cmd_1_1", "meas_1_1", "raw_disp_1_1"] {
        assert_eq!(run.column(name), run.column("target_1_1"), "{name}");
    }
}

/// Kinematic hardening in closed form: elastic from the last point, but never outside the two lines b k d ± (1 − b) F_y.
#[test]
fn the_loop_is_the_closed_form_of_the_law() {
    let run = cyclic();
    let (disp, force) = (run.column("meas_1_1"), run.column("force_1_1"));
    let (mut before, mut at) = (0.0, 0.0);
    let mut exact = Vec::new();
    for d in &disp {
        let centre = RATIO * K * d;
        let half = (1.0 - RATIO) * YIELD;
        at = f64::clamp(at + K * (d - before), centre - half, centre + half);
        before = *d;
        exact.push(at);
    }
    // The closed form adds up its steps, two roundings each, 1793 of them.
    assert!(distance(&force, &exact) < 1793.0 * 2.0 * f64::EPSILON);
    // A closed loop at amplitude A absorbs 4 (1 − b) F_y (A − u_y). The trapezoid rule errs at each of its four corners by at
    // most (k − b k) h²/8 (two yields) and k h²/4 (two reversals, where the path itself is cut), h = 40 mm/s · Δt.
    let cycle = |from: f64, to: f64| {
        let range = (from / DT).round() as usize..=(to / DT).round() as usize;
        absorbed_energy(&disp[range.clone()], &force[range]).unwrap()
    };
    let h: f64 = 0.04 * DT;
    for (amplitude, from, to) in [(0.005, 0.9, 1.4), (0.010, 2.4, 3.4)] {
        let exact = 4.0 * (1.0 - RATIO) * YIELD * (amplitude - YIELD / K);
        // Cut corners also shorten the loop by up to h at either end, at the width 2 (1 − b) F_y of the loop, and the cycle's
        // own ends are up to a step off the grid.
        let allowed = K * h * h + 4.0 * h * (1.0 - RATIO) * YIELD;
        assert!(
            (cycle(from, to) - exact).abs() < allowed,
            "{amplitude}: {} {exact}",
            cycle(from, to)
        );
    }
    // Below yield nothing is absorbed.
    assert!(cycle(0.0, 0.4).abs() < K * h * h);
}

/// Before yield the loop is a straight line: least squares finds its slope to roundoff of some hundred sums.
#[test]
fn initial_stiffness_is_read_before_yield() {
    let run = cyclic();
    let (disp, force) = (run.column("meas_1_1"), run.column("force_1_1"));
    let elastic = 0.99 * YIELD / K / 0.010;
    let part = loading(&disp, elastic);
    assert!(part > 100);
    let found = identify(&disp[..part], &disp[..part], &force[..part], DT).unwrap();
    assert!((found.stiffness.value / K - 1.0).abs() < 1e-9, "{found:?}");
    // Over all of the test it is a secant, smaller, as the doc comment of `identify` states.
    assert!(identify(&disp, &disp, &force, DT).unwrap().stiffness.value < 0.9 * K);
}

/// f = k d + c ḋ along a sine of ω: the central difference that the identification sees is ḋ · sin(ωΔt)/(ωΔt) at every
/// sample, so that ĉ = c ωΔt / sin(ωΔt), and k̂ = k, both to roundoff.
#[test]
fn damped_spring_is_identified() {
    let (c, hz) = (4e4, 2.0);
    let signal = format!("sine = {{ amplitude = 5, unit = \"mm\", frequency_hz = {hz} }}");
    let law = format!("linear = {{ stiffness_n_per_m = {K}, damping_n_s_per_m = {c} }}");
    let run = test(3.0, &signal, &law);
    let found = identify(
        &run.column("meas_1_1"),
        &run.column("meas_1_1"),
        &run.column("force_1_1"),
        DT,
    )
    .unwrap();
    let angle = TAU * hz * DT;
    assert!((found.stiffness.value / K - 1.0).abs() < 1e-9, "{found:?}");
    assert!(
        (found.damping.unwrap().value / (c * angle / libm::sin(angle)) - 1.0).abs() < 1e-9,
        "{found:?}"
    );
    assert!(found.unexplained < 1e-12 && found.offset.abs() < 1e-9 * K * 0.005);
}

/// Actuators of 4 m along x and of 3 m along y hold a point: two circles, whose point is known.
const TWO: &str = "[time]\nrate_hz = 512\nduration_s = 1\n[[specimen]]\nname = \"point\"\n\
                   geometry = { coordinates = [\"ux\", \"uy\"], plane = [{ base_m = [-4, 0] }, { base_m = [0, -3] }] }\n\
                   law.linear = { stiffness_n_per_m = 1e5, damping_n_s_per_m = 1e4 }\n";

fn stroke(axis: usize, at: &str, amplitude: f64) -> String {
    format!(
        "[[excitation.prescribed_displacement]]\nspecimen = \"point\"\naxis = {axis}\n{at}\n\
         signal.sine = {{ amplitude = {amplitude}, frequency_hz = 2 }}\n"
    )
}

#[test]
fn one_actuator_moves_the_other_stays() {
    let alone = TWO.with("specimen.geometry.law_at = 'actuators'");
    let run = run(&(alone + &stroke(2, "at = \"actuators\"", 0.3)));
    let [x, y] = [run.column("pose_1_1"), run.column("pose_1_2")];
    let [one, other] = [run.column("target_1_1"), run.column("target_1_2")];
    let [still, force] = [run.column("force_1_1"), run.column("force_1_2")];
    for (i, time) in run.column("time").iter().enumerate() {
        let wanted = 0.3 * libm::sin(2.0 * TAU * time);
        // A few roundoffs of 4 m, and the same at 1e5 N/m.
        assert!(one[i].abs() < 1e-14 && still[i].abs() < 1e-8, "{i}");
        assert!((other[i] - wanted).abs() < 1e-13, "{} {wanted}", other[i]);
        assert!((libm::hypot(x[i] + 4.0, y[i]) - 4.0).abs() < 1e-14);
        assert!((libm::hypot(x[i], y[i] + 3.0) - 3.0 - wanted).abs() < 1e-13);
        // Its damper knows the velocity; at the first tick it comes out of rest.
        let rate = 0.3 * 2.0 * TAU * libm::cos(2.0 * TAU * time);
        let felt = (force[i] - 1e5 * other[i]) / 1e4;
        assert!(
            (felt - rate).abs() < 1e-3 * 0.6 * TAU || i == 0,
            "{i}: {felt} {rate}"
        );
    }
    assert!(x.iter().any(|x| *x < -1e-3), "the point goes round");
}

#[test]
fn impossible_strokes_are_refused() {
    let here = "at = \"actuators\"";
    let mixed = TWO.to_owned() + &stroke(1, "", 0.1) + &stroke(2, here, 0.1);
    let text = refused(&mixed);
    assert!(text.contains("`point`"), "{text}");
    let three = TWO.with("[[specimen.geometry.plane]]\nbase_m = [3, 1]\n");
    let text = refused(&(three + &stroke(1, here, 0.1)));
    assert!(text.contains("3 actuators hold 2"), "{text}");
    let text = refused(&(TWO.to_owned() + &stroke(3, here, 0.1)));
    assert!(text.contains("has 2 actuators"), "{text}");
    // Both circles meet no more.
    let text = refused(&(TWO.to_owned() + &stroke(2, here, 6.0)));
    assert!(text.contains("these strokes"), "{text}");
}

fn refused(text: &str) -> String {
    let read = gusset_config::parse(std::path::Path::new("test.toml"), text.to_owned(), &[]);
    let built = read.and_then(|loaded| gusset_setup::build(&loaded));
    built.map(|_| ()).unwrap_err().to_string()
}
