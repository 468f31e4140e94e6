//! The engine against independent solutions: closed forms of free vibration, and a Runge-Kutta integration on a fine grid.
//!
//! The recursion itself has a closed form for one degree of freedom (its two poles, coefficients (27) of the paper), which must be
//! met to roundoff. The differential equation is met to the order of the method: the test is the factor between two halvings of Δt.

use crate::common::engine::{Run, distance, prepare, run};
use gusset_config::ClockChoice;
use gusset_record::RunFolder;
use gusset_session as session;

const MASS: f64 = 2e3;

/// One mass, x\[0\] = 10 mm, v\[0\] = 0.2 m/s.
fn oscillator(step: f64, duration: f64, k: f64, c: f64, lambda: f64, start: &str) -> Run {
    run(&format!(
        "[time]\nstep_s = {step}\nduration_s = {duration}\n\
         [integrator]\nlambda = {lambda}\nstart = \"{start}\"\n\
         [structure]\ninitial_displacement_m = [0.01]\ninitial_velocity_m_per_s = [0.2]\n\
         [structure.shear_building]\nmass_kg = [{MASS}]\nstiffness_n_per_m = [{k}]\n\
         damping_n_s_per_m = [{c}]\n"
    ))
}

/// x\[i\] = ρⁱ (P cos iθ + Q sin iθ), poles from A1 z² + A2 z + A3 (27), P and Q from x\[0\] and the first step.
fn recursion(steps: usize, dt: f64, k: f64, c: f64, lambda: f64, second: bool) -> Vec<f64> {
    let (x0, v0) = (0.01, 0.2);
    let omega2 = k / MASS * dt * dt;
    let damping = c * dt / (2.0 * MASS);
    let a1 = omega2 + lambda + lambda * damping;
    let a2 = lambda * omega2 - 2.0 * omega2 - 2.0 * lambda;
    let a3 = omega2 + lambda - lambda * damping;
    let rho = (a3 / a1).sqrt();
    let theta = libm::acos(-a2 / (2.0 * a1) / rho);
    let weighted = lambda / (lambda + lambda * damping + omega2) * (-k * x0 - c * v0) / MASS;
    let share = if second { 0.5 } else { 1.0 };
    let x1 = x0 + dt * v0 + share * dt * dt * weighted;
    let q = (x1 / rho - x0 * libm::cos(theta)) / libm::sin(theta);
    (0..=steps)
        .map(|i| {
            let (sine, cosine) = libm::sincos(i as f64 * theta);
            rho.powi(i as i32) * (x0 * cosine + q * sine)
        })
        .collect()
}

#[test]
fn free_vibration_is_that_of_the_two_poles() {
    let dt = 0.02;
    // Ω = 0.19, 1.2 and 60; the last two modes of a stiff storey, where only λ ≤ 4 holds.
    for (omega, lambdas) in [
        (9.5, &[2.0, 4.0, 11.5][..]),
        (60.0, &[2.0, 4.0, 11.5]),
        (3000.0, &[2.0]),
    ] {
        for &lambda in lambdas {
            for ratio in [0.0, 0.04] {
                for start in ["published", "second-order"] {
                    let k = MASS * omega * omega;
                    let c = 2.0 * ratio * MASS * omega;
                    let run = oscillator(dt, 20.0, k, c, lambda, start);
                    let exact = recursion(1000, dt, k, c, lambda, start == "second-order");
                    // Ten roundings a tick add up over 1000 ticks; θ itself is known to 1e-16 / sin θ, 1000 times over.
                    let found = distance(&run.column("x1"), &exact);
                    assert!(
                        found < 1000.0 * 20.0 * f64::EPSILON / (omega * dt).min(1.0),
                        "{omega} {lambda} {ratio} {start}: {found:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn free_vibration_decays_to_second_order() {
    let (omega, ratio) = (9.5, 0.04);
    let (k, c) = (MASS * omega * omega, 2.0 * ratio * MASS * omega);
    let damped = omega * f64::sqrt(1.0 - ratio * ratio);
    let error = |step: f64, lambda: f64, name: &str| {
        let run = oscillator(step, 4.0, k, c, lambda, "second-order");
        let exact: Vec<f64> = run
            .column("time")
            .iter()
            .map(|t| {
                let (sine, cosine) = libm::sincos(damped * t);
                let q = (0.2 + ratio * omega * 0.01) / damped;
                let decay = libm::exp(-ratio * omega * t);
                let x = decay * (0.01 * cosine + q * sine);
                let v = decay * damped * (q * cosine - 0.01 * sine) - ratio * omega * x;
                if name == "x1" { x } else { v }
            })
            .collect();
        distance(&run.column(name), &exact)
    };
    for lambda in [2.0, 4.0, 11.5] {
        for name in ["x1", "v1"] {
            let errors = [0.01, 0.005, 0.0025].map(|step| error(step, lambda, name));
            for pair in errors.windows(2) {
                assert!(
                    (pair[0] / pair[1] - 4.0).abs() < 0.2,
                    "{lambda} {name}: {errors:?}"
                );
            }
        }
    }
}

const CUBIC: [f64; 2] = [3e5, 3e8];
const DASHPOT: f64 = 3e3;

/// Two floors on a hardening, damped specimen; a force that is there at once, 8 kN cos 5t, on the upper one.
fn two_floors(rate: u32, start: &str) -> Run {
    run(&format!(
        r#"
        [time]
        rate_hz = {rate}
        duration_s = 3
        [integrator]
        lambda = 2
        start = "{start}"
        [structure.shear_building]
        mass_kg = [2e3, 3e3]
        stiffness_n_per_m = [0, 4e5]
        [[structure.element]]
        from = "fixed"
        to = 2
        law = {{ linear = {{ stiffness_n_per_m = 0, damping_n_s_per_m = 1e3 }} }}
        [[excitation.nodal_force]]
        dofs = [2]
        [excitation.nodal_force.signal.sine]
        amplitude = 8e3
        angular_frequency_rad_per_s = 5
        phase_rad = {}
        [[specimen]]
        name = "base"
        storey = 1
        law = {{ parallel = [ {{ cubic = {{ stiffness_n_per_m = {}, cubic_n_per_m3 = {} }} }},
                              {{ linear = {{ stiffness_n_per_m = 0, damping_n_s_per_m = {DASHPOT} }} }} ] }}"#,
        std::f64::consts::FRAC_PI_2,
        CUBIC[0],
        CUBIC[1]
    ))
}

/// ẏ = g(t, y), y = (x1, x2, v1, v2), by the classical fourth-order method with steps of 1/16384 s: its error is of the order
/// of (ω h)⁴ = 1e-10 for the fastest motion (25 rad/s), far below what is judged.
fn runge_kutta(rate: u32) -> Vec<[f64; 4]> {
    let slope = |t: f64, y: [f64; 4]| {
        let bottom = y[0] * (CUBIC[0] + CUBIC[1] * y[0] * y[0]) + DASHPOT * y[2];
        let top = 4e5 * (y[1] - y[0]);
        let load = 8e3 * libm::cos(5.0 * t);
        [
            y[2],
            y[3],
            (top - bottom) / 2e3,
            (load - top - 1e3 * y[3]) / 3e3,
        ]
    };
    let fine = 16384 / rate as usize;
    let h = 1.0 / 16384.0;
    let mut y = [0.0; 4];
    let mut history = vec![y];
    for step in 0..3 * 16384 {
        let t = step as f64 * h;
        let along = |k: [f64; 4], share: f64| [0, 1, 2, 3].map(|i| y[i] + share * h * k[i]);
        let k1 = slope(t, y);
        let k2 = slope(t + h / 2.0, along(k1, 0.5));
        let k3 = slope(t + h / 2.0, along(k2, 0.5));
        let k4 = slope(t + h, along(k3, 1.0));
        for i in 0..4 {
            y[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
        if (step + 1) % fine == 0 {
            history.push(y);
        }
    }
    history
}

/// Errors of x1, x2, v1, v2 at three rates.
fn errors(rates: [u32; 3], start: &str) -> [[f64; 3]; 4] {
    let at = rates.map(|rate| {
        let (run, exact) = (two_floors(rate, start), runge_kutta(rate));
        ["x1", "x2", "v1", "v2"]
            .map(|name| run.column(name))
            .into_iter()
            .enumerate()
            .map(|(i, found)| distance(&found, &exact.iter().map(|y| y[i]).collect::<Vec<_>>()))
            .collect::<Vec<_>>()
    });
    [0, 1, 2, 3].map(|i| [at[0][i], at[1][i], at[2][i]])
}

#[test]
fn nonlinear_test_converges_at_second_order() {
    for errors in errors([256, 512, 1024], "second-order") {
        for pair in errors.windows(2) {
            assert!((pair[0] / pair[1] - 4.0).abs() < 0.3, "{errors:?}");
        }
    }
}

/// The force is there at once, so the published start is half a step off (guide: mathematics-integrator): first order.
#[test]
fn published_form_converges_at_first_order() {
    for errors in errors([512, 1024, 2048], "published") {
        for pair in errors.windows(2) {
            assert!((pair[0] / pair[1] - 2.0).abs() < 0.2, "{errors:?}");
        }
    }
}

/// A floor without mass between two springs is one spring, k1 k2 / (k1 + k2): the recursion of the floor above is that of the
/// single mass. Its acceleration does not exist: NaN in the rows, null in the summary.
#[test]
fn massless_floor_is_condensed() {
    let (k1, k2) = (6e5, 3e5);
    let ratio = k2 / (k1 + k2);
    let text = format!(
        "[time]\nstep_s = 0.02\nduration_s = 20\nclock = \"simulated\"\n[integrator]\nlambda = 2\n\
         [structure]\ninitial_displacement_m = [{}, 0.01]\ninitial_velocity_m_per_s = [{}, 0.2]\n\
         [structure.shear_building]\nmass_kg = [0, {MASS}]\nstiffness_n_per_m = [{k1}, {k2}]\n",
        ratio * 0.01,
        ratio * 0.2
    );
    let found = run(&text);
    // The published start moves floor 1 by Δt v + Δt² w like any other: in balance from the first step on.
    let exact = recursion(1000, 0.02, ratio * k1, 0.0, 2.0, false);
    assert!(distance(&found.column("x2"), &exact) < 1000.0 * 20.0 * f64::EPSILON);
    let condensed: Vec<f64> = exact.iter().map(|x| ratio * x).collect();
    assert!(distance(&found.column("x1"), &condensed) < 1000.0 * 20.0 * f64::EPSILON);
    assert!(found.column("a1").iter().all(|a| a.is_nan()));
    assert!(found.column("a2").iter().all(|a| a.is_finite()));
    assert!(found.outcome.peaks.accel[0].is_nan());

    let place = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(&place.path().join("run")).unwrap();
    let prepared = prepare(&text);
    assert_eq!(prepared.facts.clock, ClockChoice::Simulated);
    let requests = crossbeam_channel::never();
    session::run(
        prepared,
        folder,
        requests,
        session::Watches::default(),
        &mut |_| {},
    )
    .unwrap();
    let text = std::fs::read_to_string(place.path().join("run/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    let peaks = &summary["peak"]["acceleration"];
    assert!(peaks[0].is_null() && peaks[1].is_f64(), "{peaks}");
}
