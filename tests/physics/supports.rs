//! Supports of a frame that move, against the base that moves whole, the ground that accelerates, and the matrix exponential.

use crate::common::engine::{Run, distance, run};
use nalgebra::{DMatrix, DVector};

/// A portal on A and D with unequal columns, a brace between its floors as specimen, and these motions.
fn portal(rate: u32, initial: &str, excitation: &str) -> Run {
    run(&format!(
        "[time]\nrate_hz = {rate}\nduration_s = 3\n[integrator]\nlambda = 4\nstart = \"second-order\"\n[structure]\n{initial}\n\
         [structure.damping.rayleigh]\nmass_coefficient_per_s = 0.4\nstiffness_coefficient_s = 1e-3\n\
         [structure.frame]\n\
         node = [{{ name = \"A\", at_m = [0, 0], fixed = [\"x\", \"y\", \"rz\"] }}, \
         {{ name = \"B\", at_m = [0, 3], mass_kg = 20000, rotary_mass_kg_m2 = 2000 }}, {{ name = \"C\", at_m = [4, 3], mass_kg = 10000, rotary_mass_kg_m2 = 2000 }}, \
         {{ name = \"D\", at_m = [4, 0], fixed = [\"x\", \"y\"], rotary_mass_kg_m2 = 2000 }}, {{ name = \"E\", at_m = [0, 6], mass_kg = 15000, rotary_mass_kg_m2 = 2000 }}]\n\
         member = [{{ nodes = [\"A\", \"B\"], section = \"s\" }}, {{ nodes = [\"B\", \"C\"], section = \"s\" }}, \
         {{ nodes = [\"C\", \"D\"], section = \"s\" }}, {{ nodes = [\"B\", \"E\"], section = \"s\" }}]\n\
         section.s.elastic = {{ young_pa = 2.1e11, area_m2 = 4e-3, inertia_m4 = 4e-5 }}\n\
         [[specimen]]\nname = \"brace\"\nreach_disp_m = 0.1\ndeformations = [{{ node = \"E\", direction = \"x\", from = \"C\" }}]\n\
         law.cubic = {{ stiffness_n_per_m = 5e5, cubic_n_per_m3 = 1e8 }}\n[excitation]\n{excitation}"
    ))
}

const AMPLITUDE: f64 = 0.02;
const OMEGA: f64 = 9.0;
/// Degrees of freedom of the portal in x: B, C and E.
const ACROSS: [&str; 3] = ["x1", "x4", "x8"];

fn sine() -> String {
    format!(
        "signal = {{ sine = {{ amplitude = {AMPLITUDE}, angular_frequency_rad_per_s = {OMEGA} }} }}"
    )
}

/// All supports move alike.
fn alike(rate: u32) -> Run {
    let sine = sine();
    portal(
        rate,
        "",
        &format!("support_motion = [{{ nodes = [\"A\", \"D\"], direction = \"x\", {sine} }}]"),
    )
}

#[test]
fn supports_alike_are_a_moving_base() {
    let base = portal(256, "", &format!("base_displacement = {{ {} }}", sine()));
    let supports = alike(256);
    for name in ACROSS
        .into_iter()
        .chain(["x2", "x3", "target_1_1", "force_1_1"])
    {
        // Equal equations; the products differ by their rounding.
        let found = distance(&supports.column(name), &base.column(name));
        assert!(found < 1e-9, "{name}: {found:e}");
    }
}

#[test]
fn supports_alike_are_an_accelerated_ground() {
    // Relative coordinates: rest is a velocity of −A ω in x.
    let difference = |rate: u32| {
        let vel = -AMPLITUDE * OMEGA;
        let mut initial = [0.0; 11];
        for dof in [0, 3, 7] {
            initial[dof] = vel;
        }
        let accel = -AMPLITUDE * OMEGA * OMEGA;
        let relative = portal(
            rate,
            &format!("initial_velocity_m_per_s = {:?}", &initial[..10]),
            &format!(
                "ground_acceleration = {{ signal = {{ sine = {{ amplitude = {accel}, angular_frequency_rad_per_s = {OMEGA} }} }} }}"
            ),
        );
        let absolute = alike(rate);
        let time = absolute.column("time");
        let each = ACROSS.map(|name| {
            let against = absolute.column(name).into_iter().zip(&time);
            let against = against.map(|(x, t)| x - AMPLITUDE * libm::sin(OMEGA * t));
            distance(&against.collect::<Vec<f64>>(), &relative.column(name))
        });
        each.into_iter().fold(0.0, f64::max)
    };
    let [coarse, middle, fine] = [1024, 2048, 4096].map(difference);
    for ratio in [coarse / middle, middle / fine] {
        assert!(
            (3.8..4.2).contains(&ratio),
            "{coarse:e} {middle:e} {fine:e}"
        );
    }
    assert!(fine < 1e-3, "{fine:e}");
}

/// A mass between two rods whose far ends move differently: m ẍ + c (ẋ − R v_s) + (k₁ + k₂) x = k₁ x₁ + k₂ x₂.
#[test]
fn two_supports_converge_to_the_exponential() {
    const MASS: f64 = 12e3;
    const COEFFICIENTS: [f64; 2] = [0.6, 2e-3];
    let stiffness = [1.0 / 4.0, 1.0 / 2.5].map(|length| 2e9 * 1e-3 * length);
    let motions = [(0.01, 8.0), (-0.006, 13.0)];
    let total = stiffness[0] + stiffness[1];
    let damping = COEFFICIENTS[0] * MASS + COEFFICIENTS[1] * total;
    let error = |rate: u32| {
        let moved = [("L", motions[0]), ("R", motions[1])].map(|(node, (a, omega))| {
            format!(
                "[[excitation.support_motion]]\nnode = \"{node}\"\ndirection = \"x\"\n\
                 signal.sine = {{ amplitude = {a}, angular_frequency_rad_per_s = {omega} }}\n"
            )
        });
        let run = run(&format!(
            "[time]\nrate_hz = {rate}\nduration_s = 2\n[integrator]\nlambda = 4\nstart = \"second-order\"\n\
             [structure.damping.rayleigh]\nmass_coefficient_per_s = {}\nstiffness_coefficient_s = {}\n\
             [structure.frame]\nnode = [{{ name = \"L\", at_m = [0, 0], fixed = [\"x\", \"y\", \"rz\"] }}, \
             {{ name = \"M\", at_m = [4, 0], mass_kg = {MASS}, fixed = [\"y\", \"rz\"] }}, \
             {{ name = \"R\", at_m = [6.5, 0], fixed = [\"x\", \"y\", \"rz\"] }}]\n\
             member = [{{ nodes = [\"L\", \"M\"], section = \"s\" }}, {{ nodes = [\"M\", \"R\"], section = \"s\" }}]\n\
             section.s.elastic = {{ young_pa = 2e9, area_m2 = 1e-3, inertia_m4 = 1e-6 }}\n{}",
            COEFFICIENTS[0],
            COEFFICIENTS[1],
            moved.concat()
        ));
        // x, v, and (sin, cos) of each support.
        let mut system = DMatrix::<f64>::zeros(6, 6);
        system[(0, 1)] = 1.0;
        system[(1, 0)] = -total / MASS;
        system[(1, 1)] = -damping / MASS;
        let mut state = DVector::<f64>::zeros(6);
        for (i, (a, omega)) in motions.into_iter().enumerate() {
            let at = 2 + 2 * i;
            system[(at, at + 1)] = omega;
            system[(at + 1, at)] = -omega;
            system[(1, at)] = stiffness[i] * a / MASS;
            system[(1, at + 1)] = damping * stiffness[i] / total * a * omega / MASS;
            state[at + 1] = 1.0;
        }
        let step = (system / f64::from(rate)).exp();
        let found = run.column("x1");
        let exact = found.iter().map(|_| {
            let x = state[0];
            state = &step * &state;
            x
        });
        distance(&found, &exact.collect::<Vec<f64>>())
    };
    let [coarse, middle, fine] = [512, 1024, 2048].map(error);
    for ratio in [coarse / middle, middle / fine] {
        assert!(
            (3.9..4.1).contains(&ratio),
            "{coarse:e} {middle:e} {fine:e}"
        );
    }
    let finest = error(32768);
    assert!(finest < 1e-6, "{finest:e}");
}
