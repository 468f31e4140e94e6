//! The family against closed forms, published values and independent formulations.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::*;
use crate::linalg::SymMatrix;
use crate::model::Part;

mod companions;

fn scalar(value: f64) -> SymMatrix {
    SymMatrix::diagonal(&[value])
}

/// Fixed-free storeys; `values` from the bottom.
fn storeys(values: &[f64]) -> SymMatrix {
    let mut entries = vec![(0, 0, values[0])];
    for (i, &k) in values.iter().enumerate().skip(1) {
        entries.extend([(i - 1, i - 1, k), (i - 1, i, -k), (i, i, k)]);
    }
    SymMatrix::from_triplets(values.len(), entries)
}

/// Runs `steps` steps and returns x[0] … x[steps], reported v[0] … v[steps − 1].
fn run(
    gui: &mut Gui,
    mut state: State,
    steps: usize,
    mut residual: impl FnMut(usize, &State, &mut [f64]),
) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let n = state.disp.len();
    let (mut disps, mut vels) = (vec![state.disp.to_vec()], Vec::new());
    let (mut r, mut reported) = (vec![0.0; n], vec![0.0; n]);
    for step in 0..steps {
        r.fill(0.0);
        residual(step, &state, &mut r);
        gui.advance(&mut state, &r, &mut reported);
        disps.push(state.disp.to_vec());
        vels.push(reported.clone());
    }
    (disps, vels)
}

fn linear<'a>(c: &'a SymMatrix, k: &'a SymMatrix) -> impl FnMut(usize, &State, &mut [f64]) + 'a {
    move |_, state, r| {
        c.subtract_product(&state.vel, r);
        k.subtract_product(&state.disp, r);
    }
}

fn sdof(m: f64, c: f64, k: f64, dt: f64, lambda: f64, start: Start) -> Gui {
    let lambda = Lambda::new(lambda).unwrap();
    Gui::new(&scalar(m), &scalar(c), &scalar(k), dt, lambda, start).unwrap()
}

fn peak(disps: &[Vec<f64>], dof: usize) -> f64 {
    disps.iter().fold(0.0, |p, x| {
        if x[dof].abs() > p || x[dof].is_nan() {
            x[dof].abs()
        } else {
            p
        }
    })
}

/// A thousandfold, or beyond all numbers.
fn grows(ratio: f64) -> bool {
    ratio >= 1e3 || !ratio.is_finite()
}

/// R > 3 or not finite.
fn unstable(ratio: f64) -> bool {
    ratio > 3.0 || !ratio.is_finite()
}

#[test]
fn lambda_is_a_positive_number_or_infinity() {
    for bad in [0.0, -1.0, f64::NAN, f64::NEG_INFINITY] {
        let error = Lambda::new(bad).unwrap_err();
        assert!(error.to_string().contains("must be greater than 0"));
        let built = Gui::new(
            &scalar(1.0),
            &scalar(0.0),
            &scalar(1.0),
            0.1,
            Lambda::Finite(bad),
            Start::Published,
        );
        assert!(matches!(built, Err(GuiError::Lambda(_))));
    }
    assert_eq!(Lambda::new(f64::INFINITY).unwrap(), Lambda::Infinite);
    assert_eq!(Lambda::Infinite.to_string(), "inf");
    assert_eq!(Lambda::new(11.5).unwrap().to_string(), "11.5");
    assert_eq!(Lambda::Infinite.inverse(), 0.0);
}

#[test]
fn what_cannot_be_integrated_is_refused_with_numbers() {
    let one = scalar(1.0);
    let four = Lambda::Finite(4.0);
    for dt in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let built = Gui::new(&one, &one, &one, dt, four, Start::Published);
        assert!(matches!(built, Err(GuiError::Step { .. })));
    }
    let built = Gui::new(
        &one,
        &SymMatrix::zeros(2),
        &one,
        0.1,
        four,
        Start::Published,
    );
    assert_eq!(
        built.unwrap_err().to_string(),
        "mass has 1 degrees of freedom, damping 2 and stiffness 1, but all must agree"
    );
    // A massless degree of freedom that nothing holds.
    let mass = SymMatrix::diagonal(&[1.0, 0.0, 1.0]);
    let stiffness = SymMatrix::diagonal(&[1.0, 0.0, 1.0]);
    let built = Gui::new(
        &mass,
        &SymMatrix::zeros(3),
        &stiffness,
        0.1,
        four,
        Start::Published,
    );
    let text = built.unwrap_err().to_string();
    assert!(text.contains("degree of freedom 2"), "{text}");
}

/// (sum, product) of the roots of the frozen recursion, from what `advance` does to two basis states.
fn roots(m: f64, c: f64, k: f64, dt: f64, lambda: f64) -> (f64, f64) {
    let mut gui = sdof(m, c, k, dt, lambda, Start::Published);
    let mut column = |x: f64, v: f64| {
        let mut state = State::new(vec![x], vec![v]);
        let r = [-k * x - c * v];
        gui.advance(&mut state, &r, &mut [0.0]);
        (state.disp[0], state.vel[0])
    };
    let (xx, vx) = column(1.0, 0.0);
    let (xv, vv) = column(0.0, 1.0);
    (xx + vv, xx * vv - xv * vx)
}

#[test]
fn poles_are_those_of_table_1() {
    for omega in [0.05, 0.7, 1.3, 2.9, 6.0] {
        for ratio in [0.0, 0.02, 0.3] {
            // m = 1, Δt = 0.1: ω = Ω/Δt, c = 2 ξ ω.
            let dt = 0.1;
            let w = omega / dt;
            let (k, c) = (w * w, 2.0 * ratio * w);
            let o2 = omega * omega;
            // z = (p ± √q)/d in the rows of the table: sum 2p/d, product (p² − q)/d².
            let rows = [
                (
                    4.0,
                    4.0 - o2,
                    16.0 * o2 * (ratio * ratio - 1.0),
                    4.0 + o2 + 4.0 * omega * ratio,
                ),
                (
                    6.0,
                    6.0 - 2.0 * o2,
                    o2 * (3.0 * o2 + 36.0 * ratio * ratio - 36.0),
                    6.0 + o2 + 6.0 * omega * ratio,
                ),
                (
                    f64::INFINITY,
                    2.0 - o2,
                    o2 * (o2 + 4.0 * ratio * ratio - 4.0),
                    2.0 + 2.0 * omega * ratio,
                ),
            ];
            for (lambda, p, q, d) in rows {
                let (sum, product) = roots(1.0, c, k, dt, lambda);
                // Roundoff of a handful of operations on numbers up to Ω².
                let tolerance = 1e-14 * (1.0 + o2);
                assert!(
                    (sum - 2.0 * p / d).abs() < tolerance,
                    "λ = {lambda}, Ω = {omega}"
                );
                assert!((product - (p * p - q) / (d * d)).abs() < 10.0 * tolerance);
            }
            // Equation (27) for any other λ.
            for lambda in [0.5, 2.0, 11.5, 100.0] {
                let a1 = o2 + lambda + lambda * omega * ratio;
                let a2 = lambda * o2 - 2.0 * o2 - 2.0 * lambda;
                let a3 = o2 + lambda - lambda * omega * ratio;
                let (sum, product) = roots(1.0, c, k, dt, lambda);
                assert!((sum + a2 / a1).abs() < 1e-14 * (1.0 + o2));
                assert!((product - a3 / a1).abs() < 1e-13 * (1.0 + o2));
            }
        }
    }
}

#[test]
fn free_vibration_has_the_numerical_period_and_no_damping() {
    // 4 sin²(Ω̄/2) = Ω²/(1 + Ω²/λ): x[i] = x0 cos iΩ̄ + b sin iΩ̄ for ever, b from x[1].
    for lambda in [1.0, 4.0, 11.5, f64::INFINITY] {
        for omega in [0.1f64, 0.9, 1.7] {
            let dt = 0.02;
            let k = (omega / dt) * (omega / dt);
            let mut gui = sdof(1.0, 0.0, k, dt, lambda, Start::Published);
            let state = State::new(vec![1.0], vec![3.0]);
            let (c, k) = (scalar(0.0), scalar(k));
            let (x, _) = run(&mut gui, state, 2000, linear(&c, &k));
            let s = (omega * omega / (1.0 + omega * omega / lambda)).sqrt() / 2.0;
            let angle = 2.0 * libm::asin(s);
            let b = (x[1][0] - x[0][0] * libm::cos(angle)) / libm::sin(angle);
            let size = 1.0f64.hypot(b);
            for (i, x) in x.iter().enumerate() {
                let phase = i as f64 * angle;
                let exact = libm::cos(phase) + b * libm::sin(phase);
                // Roundoff of the phase grows linearly: 2000 steps × a few ε / sin Ω̄.
                assert!(
                    (x[0] - exact).abs() < 1e-10 * size,
                    "λ = {lambda}, Ω = {omega}, i = {i}"
                );
            }
        }
    }
}

#[test]
fn the_second_order_start_of_an_undamped_mode_is_exactly_a_cosine() {
    // Even for a stiff mode (Ω = 30), where the published start overshoots.
    for (lambda, omega) in [(4.0, 0.3), (4.0, 30.0), (2.0, 30.0)] {
        let (k, c) = (scalar(omega * omega), scalar(0.0));
        let mut gui = sdof(1.0, 0.0, omega * omega, 1.0, lambda, Start::SecondOrder);
        let (x, v) = run(
            &mut gui,
            State::new(vec![1.0], vec![0.0]),
            100,
            linear(&c, &k),
        );
        let s: f64 = (omega * omega / (1.0 + omega * omega / lambda)).sqrt() / 2.0;
        let angle = 2.0 * libm::asin(s);
        for (i, x) in x.iter().enumerate() {
            // Phase error: asin near 1 loses half the digits at λ = 4, Ω = 30 (√ε Ω-fold), 100 steps.
            assert!(
                (x[0] - libm::cos(i as f64 * angle)).abs() < 1e-10,
                "λ = {lambda}, i = {i}"
            );
        }
        assert_eq!(v[0][0], 0.0);
    }
}

#[test]
fn the_published_start_overshoots_a_stiff_mode_by_the_known_envelope() {
    // √(1 + Ω²/4) at λ = 4. The sawtooth phase drifts slowly: 4 Ω steps pass a quarter turn.
    let omega = 20.0f64;
    let (k, c) = (scalar(omega * omega), scalar(0.0));
    let mut gui = sdof(1.0, 0.0, omega * omega, 1.0, 4.0, Start::Published);
    let (x, _) = run(
        &mut gui,
        State::new(vec![1.0], vec![0.0]),
        400,
        linear(&c, &k),
    );
    let envelope = (1.0 + omega * omega / 4.0).sqrt();
    // Phase steps of π − Ω̄ ≈ 4/Ω = 0.2: a sample lies within 0.1 of the crest, cos 0.1 = 0.995.
    assert!(peak(&x, 0) <= envelope * (1.0 + 1e-9) && peak(&x, 0) > 0.99 * envelope);
}

/// Errors of displacement and reported velocity at t = 0.7 s with 1/`per_second` steps: away from the instants where the
/// leading error term sin ω_d t vanishes.
fn errors(start: Start, lambda: f64, per_second: usize, free: bool) -> (f64, f64) {
    let (w, ratio, dt) = (2.0 * PI, 0.05, 1.0 / per_second as f64);
    let (k, c) = (w * w, 2.0 * ratio * w);
    let mut gui = sdof(1.0, c, k, dt, lambda, start);
    let steps = per_second * 7 / 10;
    let (x0, v0, p) = if free {
        (0.02, 0.1, 0.0)
    } else {
        (0.0, 0.0, 3.0)
    };
    let (x, v) = run(
        &mut gui,
        State::new(vec![x0], vec![v0]),
        per_second + 1,
        |i, s, r| {
            r[0] = libm::sin(p * i as f64 * dt) - k * s.disp[0] - c * s.vel[0];
        },
    );
    // x = e^{−ξωt} (A cos ω_d t + B sin ω_d t) + P cos pt + Q sin pt
    let d = (k - p * p) * (k - p * p) + (c * p) * (c * p);
    let (big_p, big_q) = if free {
        (0.0, 0.0)
    } else {
        (-c * p / d, (k - p * p) / d)
    };
    let wd = w * (1.0 - ratio * ratio).sqrt();
    let a = x0 - big_p;
    let b = (v0 + ratio * w * a - p * big_q) / wd;
    let t = 0.7;
    let (cos, sin, e) = (
        libm::cos(wd * t),
        libm::sin(wd * t),
        libm::exp(-ratio * w * t),
    );
    let exact = e * (a * cos + b * sin) + big_p * libm::cos(p * t) + big_q * libm::sin(p * t);
    let exact_v = e * (wd * (b * cos - a * sin) - ratio * w * (a * cos + b * sin))
        + p * (big_q * libm::cos(p * t) - big_p * libm::sin(p * t));
    ((x[steps][0] - exact).abs(), (v[steps][0] - exact_v).abs())
}

#[test]
fn orders_of_accuracy_are_those_of_the_theory() {
    for lambda in [2.0, 4.0, 11.5, f64::INFINITY] {
        let slope = |start, free| {
            let (coarse, fine) = (
                errors(start, lambda, 400, free),
                errors(start, lambda, 800, free),
            );
            ((coarse.0 / fine.0).log2(), (coarse.1 / fine.1).log2())
        };
        let (x, v) = slope(Start::Published, true);
        assert!(
            (x - 1.0).abs() < 0.1,
            "published, a[0] ≠ 0, λ = {lambda}: order {x}"
        );
        assert!(
            (v - 1.0).abs() < 0.1,
            "published velocity, λ = {lambda}: order {v}"
        );
        let (x, _) = slope(Start::Published, false);
        assert!(
            (x - 2.0).abs() < 0.1,
            "published, a[0] = 0, λ = {lambda}: order {x}"
        );
        for free in [true, false] {
            let (x, v) = slope(Start::SecondOrder, free);
            assert!(
                (x - 2.0).abs() < 0.1,
                "second order, λ = {lambda}: order {x}"
            );
            assert!(
                (v - 2.0).abs() < 0.1,
                "second-order velocity, λ = {lambda}: order {v}"
            );
        }
    }
}

#[test]
fn a_state_that_has_begun_is_not_started_anew() {
    // Warming up on a copy leaves no trace, and a second method continues where the first one stopped.
    let (c, k) = (scalar(0.3), scalar(40.0));
    let start = State::new(vec![1.0], vec![-0.5]);
    let make = || sdof(1.0, 0.3, 40.0, 0.02, 4.0, Start::SecondOrder);
    let (straight, _) = run(&mut make(), start.clone(), 50, linear(&c, &k));
    let mut warmed = make();
    run(&mut warmed, start.clone(), 7, linear(&c, &k));
    let mut state = start;
    let (mut r, mut reported) = ([0.0], [0.0]);
    let mut other = make();
    for step in 0..50 {
        let gui = if step < 20 { &mut warmed } else { &mut other };
        r[0] = -0.3 * state.vel[0] - 40.0 * state.disp[0];
        gui.advance(&mut state, &r, &mut reported);
        // Products of subtract_product round as c·v and k·x one after the other, as here.
        assert!((state.disp[0] - straight[step + 1][0]).abs() < 1e-14);
    }
}

/// Three storeys with a full mass matrix, a damping matrix that the modes do not diagonalise, hardening springs,
/// biviscous dampers.
struct Nonlinear {
    m: SymMatrix,
    c: SymMatrix,
    k: SymMatrix,
}

impl Nonlinear {
    fn new() -> Self {
        Self {
            m: SymMatrix::from_triplets(
                3,
                [
                    (0, 0, 3.0),
                    (1, 1, 2.0),
                    (2, 2, 2.5),
                    (0, 1, 0.4),
                    (1, 2, -0.3),
                ],
            ),
            c: SymMatrix::from_triplets(3, [(0, 0, 0.9), (1, 1, 0.4), (2, 2, 0.6), (0, 2, 0.2)]),
            k: storeys(&[400.0, 300.0, 200.0]),
        }
    }

    fn load(t: f64) -> [f64; 3] {
        [libm::sin(3.0 * t), 0.5, -2.0 * libm::cos(5.0 * t)]
    }

    /// F − R_d(v) − R_s(x)
    fn residual(&self, t: f64, x: &[f64], v: &[f64], r: &mut [f64]) {
        r.copy_from_slice(&Self::load(t));
        self.k.subtract_product(x, r);
        self.c.subtract_product(v, r);
        for i in 0..3 {
            r[i] -= 3e4 * x[i] * x[i] * x[i] + 0.5 * v[i].clamp(-0.1, 0.1);
        }
    }
}

#[test]
fn the_recursion_equals_its_two_step_form() {
    // M_eff (x[i+1] − 2x[i] + x[i−1])/Δt² + R_d((x[i] − x[i−1])/Δt) + R_s(x[i]) = F[i], solved with dense LU.
    let system = Nonlinear::new();
    let dt = 0.02;
    for lambda in [2.0, 4.0, 11.5, f64::INFINITY] {
        let lambda = Lambda::new(lambda).unwrap();
        for start in [Start::Published, Start::SecondOrder] {
            let mut gui = Gui::new(&system.m, &system.c, &system.k, dt, lambda, start).unwrap();
            let state = State::new(vec![0.01, 0.0, -0.02], vec![0.1, 0.2, 0.0]);
            let (x, _) = run(&mut gui, state, 300, |i, s, r| {
                system.residual(i as f64 * dt, &s.disp, &s.vel, r);
            });
            let m_eff = system.m.to_dense()
                + system.c.to_dense() * (dt / 2.0)
                + system.k.to_dense() * (dt * dt * lambda.inverse());
            let lu = m_eff.lu();
            let (mut before, mut now) = (x[0].clone(), x[1].clone());
            for (i, expected) in x.iter().enumerate().skip(2) {
                let v: Vec<f64> = now.iter().zip(&before).map(|(a, b)| (a - b) / dt).collect();
                let mut r = [0.0; 3];
                system.residual((i - 1) as f64 * dt, &now, &v, &mut r);
                let w = lu.solve(&DVector::from_row_slice(&r)).unwrap();
                let next: Vec<f64> = (0..3)
                    .map(|j| 2.0 * now[j] - before[j] + dt * dt * w[j])
                    .collect();
                (before, now) = (now, next);
                for j in 0..3 {
                    // ε/Δt amplification of the difference quotient over 300 steps of a bounded motion of 0.1 m.
                    assert!(
                        (now[j] - expected[j]).abs() < 1e-10,
                        "λ = {lambda}, step {i}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_discrete_energy_balance_closes_to_roundoff() {
    // ½ Δ(vᵀ M_eff v) = Σ ½ (x[i+1] − x[i−1])ᵀ r[i] for any law and λ.
    let system = Nonlinear::new();
    let dt = 0.02;
    for lambda in [Lambda::Finite(2.0), Lambda::Finite(11.5), Lambda::Infinite] {
        let mut gui = Gui::new(
            &system.m,
            &system.c,
            &system.k,
            dt,
            lambda,
            Start::Published,
        )
        .unwrap();
        let m_eff = gui::effective_mass(&system.m, &system.c, &system.k, dt, lambda);
        let mut state = State::new(vec![0.0, 0.01, 0.0], vec![0.3, 0.0, -0.2]);
        let (mut r, mut reported) = ([0.0; 3], [0.0; 3]);
        let mut before = state.disp.clone();
        system.residual(0.0, &state.disp, &state.vel, &mut r);
        gui.advance(&mut state, &r, &mut reported);
        let kinetic_start = m_eff.quadratic(&state.vel) / 2.0;
        let (mut work, mut exchanged) = (0.0, 0.0f64);
        for i in 1..1000 {
            let now = state.disp.clone();
            system.residual(i as f64 * dt, &state.disp, &state.vel, &mut r);
            gui.advance(&mut state, &r, &mut reported);
            for j in 0..3 {
                let part = 0.5 * (state.disp[j] - before[j]) * r[j];
                work += part;
                exchanged += part.abs();
            }
            before = now;
        }
        let gained = m_eff.quadratic(&state.vel) / 2.0 - kinetic_start;
        assert!(exchanged > 1.0, "nothing moved");
        assert!(
            (gained - work).abs() < 1e-12 * exchanged,
            "λ = {lambda}: {gained} against {work}"
        );
    }
}

#[test]
fn an_infinite_lambda_moves_like_explicit_newmark_from_rest() {
    // γ = ½, β = 0; damping that the modes do not diagonalise; F[0] = 0.
    let system = Nonlinear::new();
    let (dt, steps) = (0.02, 400);
    let load = |t: f64| [libm::sin(3.0 * t), 0.0, -2.0 * libm::sin(5.0 * t)];
    let mut gui = Gui::new(
        &system.m,
        &system.c,
        &system.k,
        dt,
        Lambda::Infinite,
        Start::Published,
    )
    .unwrap();
    let (x, _) = run(&mut gui, State::at_rest(3), steps, |i, s, r| {
        r.copy_from_slice(&load(i as f64 * dt));
        system.k.subtract_product(&s.disp, r);
        system.c.subtract_product(&s.vel, r);
    });
    let (c, k) = (system.c.to_dense(), system.k.to_dense());
    let lu = (system.m.to_dense() + &c * (dt / 2.0)).lu();
    let (mut u, mut v, mut a) = (DVector::zeros(3), DVector::zeros(3), DVector::zeros(3));
    for (i, expected) in x.iter().enumerate().skip(1) {
        u += &v * dt + &a * (dt * dt / 2.0);
        let half = &v + &a * (dt / 2.0);
        let force = DVector::from_row_slice(&load(i as f64 * dt)) - &c * &half - &k * &u;
        a = lu.solve(&force).unwrap();
        v = half + &a * (dt / 2.0);
        for j in 0..3 {
            assert!((u[j] - expected[j]).abs() < 1e-12, "step {i}");
        }
    }
    assert!(peak(&x, 2) > 1e-3);
}

#[test]
fn many_degrees_of_freedom_move_as_their_modes_do() {
    // Undamped: each mode is one degree of freedom with m = 1, k = ω², the same λ and Δt.
    let (m, k) = (Nonlinear::new().m, storeys(&[400.0, 300.0, 200.0]));
    let modes = crate::linalg::modes(&k, &m).unwrap();
    let c = SymMatrix::zeros(3);
    let x0 = [0.3, -0.1, 0.2];
    let mut gui = Gui::new(&m, &c, &k, 0.05, Lambda::Finite(4.0), Start::Published).unwrap();
    let (x, _) = run(
        &mut gui,
        State::new(x0.to_vec(), vec![0.0; 3]),
        200,
        linear(&c, &k),
    );
    let mut momentum = [0.0; 3];
    m.subtract_product(&x0, &mut momentum);
    let mut sum = vec![[0.0; 3]; 201];
    for (j, w) in modes.frequencies.iter().enumerate() {
        let q0: f64 = (0..3).map(|i| -momentum[i] * modes.shapes[(i, j)]).sum();
        let (zero, stiffness) = (scalar(0.0), scalar(w * w));
        let mut gui = sdof(1.0, 0.0, w * w, 0.05, 4.0, Start::Published);
        let (q, _) = run(
            &mut gui,
            State::new(vec![q0], vec![0.0]),
            200,
            linear(&zero, &stiffness),
        );
        for (sum, q) in sum.iter_mut().zip(&q) {
            for (sum, shape) in sum.iter_mut().zip(modes.shapes.column(j).iter()) {
                *sum += q[0] * shape;
            }
        }
    }
    for (x, sum) in x.iter().zip(&sum) {
        for i in 0..3 {
            assert!((x[i] - sum[i]).abs() < 1e-11);
        }
    }
}

#[test]
fn the_linear_limit_is_where_the_paper_puts_it_whatever_the_damping() {
    // (λ − 4) Ω² ≤ 4 λ: 1 % inside stays, 1 % outside grows as a sawtooth.
    for lambda in [5.0f64, 11.5, f64::INFINITY] {
        let limit = (4.0 / (1.0 - 4.0 / lambda)).sqrt();
        for ratio in [0.0, 0.02, 0.2] {
            let largest = |omega: f64| {
                let (c, k) = (2.0 * ratio * omega, omega * omega);
                let mut gui = sdof(1.0, c, k, 1.0, lambda, Start::Published);
                let (c, k) = (scalar(c), scalar(k));
                let (x, _) = run(
                    &mut gui,
                    State::new(vec![1e-3], vec![0.0]),
                    1500,
                    linear(&c, &k),
                );
                peak(&x, 0) / 1e-3
            };
            // Inside, the envelope 1/√(1 − Ω²/Ω_lim²)-like factor is below 20 at 1 %.
            assert!(largest(0.99 * limit) < 20.0, "λ = {lambda}, ξ = {ratio}");
            assert!(grows(largest(1.01 * limit)), "λ = {lambda}, ξ = {ratio}");
        }
    }
}

#[test]
fn a_changed_tangent_is_stable_up_to_the_published_bound() {
    // (41): λ (Ω_t² − 4 + 2 Δt (c_t − c_0)/m) ≤ 4 Ω0².
    let dt = 0.5;
    for (lambda, k0, c0, ct) in [
        (1.0, 40.0, 0.0, 0.0),
        (4.0, 30.0, 0.8, 0.8),
        (4.0, 30.0, 0.8, 1.4),
        (11.5, 8.0, 0.2, 0.5),
    ] {
        let kt = (4.0 * k0 * dt * dt / lambda + 4.0 - 2.0 * dt * (ct - c0)) / (dt * dt);
        let proof = |k: f64| StabilityProof {
            mass: scalar(1.0),
            damping: scalar(c0),
            stiffness: scalar(k0),
            damping_bound: scalar(ct),
            stiffness_bound: scalar(k),
            dt,
        };
        let largest = |k: f64| {
            let mut gui = sdof(1.0, c0, k0, dt, lambda, Start::Published);
            let (c, k) = (scalar(ct), scalar(k));
            let (x, _) = run(
                &mut gui,
                State::new(vec![1e-3], vec![0.0]),
                3000,
                linear(&c, &k),
            );
            peak(&x, 0) / 1e-3
        };
        assert!(largest(0.99 * kt) < 50.0, "λ = {lambda}");
        assert!(grows(largest(1.01 * kt)), "λ = {lambda}");
        let given = Lambda::Finite(lambda);
        assert!(proof(0.999_999 * kt).holds(given) && !proof(1.000_001 * kt).holds(given));
        let limit = proof(kt).limit(f64::INFINITY, &[]).unwrap().unwrap();
        assert!((limit / lambda - 1.0).abs() < 1e-9);
    }
}

/// Two undamped storeys under a_g = 20 sin t, as in examples 4.1 and 4.2.
struct TwoStoreys {
    m: [f64; 2],
    k: [f64; 2],
}

const EXAMPLE_4_1: TwoStoreys = TwoStoreys {
    m: [1e3, 4e3],
    k: [2e6, 1e5],
};
const EXAMPLE_4_2: TwoStoreys = TwoStoreys {
    m: [1e3, 6e3],
    k: [1e7, 1e5],
};

impl TwoStoreys {
    fn proof(&self) -> StabilityProof {
        StabilityProof {
            mass: SymMatrix::diagonal(&self.m),
            damping: SymMatrix::zeros(2),
            stiffness: storeys(&self.k),
            damping_bound: SymMatrix::zeros(2),
            stiffness_bound: storeys(&self.k),
            dt: 0.05,
        }
    }

    fn parts(&self) -> Vec<Part> {
        let rows = [vec![(0, 1.0)], vec![(0, -1.0), (1, 1.0)]];
        let parts = rows.into_iter().zip(self.k).enumerate();
        parts
            .map(|(i, (row, k))| Part {
                name: format!("storey {}", i + 1),
                row,
                stiffness_bound: k,
                damping: 0.0,
                damping_bound: 0.0,
            })
            .collect()
    }

    fn run(&self, lambda: f64, dt: f64, seconds: f64, theta: [f64; 2]) -> Vec<Vec<f64>> {
        let lambda = Lambda::new(lambda).unwrap();
        let (m, c) = (SymMatrix::diagonal(&self.m), SymMatrix::zeros(2));
        let mut gui = Gui::new(&m, &c, &storeys(&self.k), dt, lambda, Start::Published).unwrap();
        let steps = (seconds / dt).round() as usize;
        let force =
            |i: usize, drift: f64| self.k[i] * drift * (1.0 + theta[i] * drift.abs().sqrt());
        let (x, _) = run(&mut gui, State::at_rest(2), steps, |i, s, r| {
            let a = 20.0 * libm::sin(i as f64 * dt);
            let bottom = force(0, s.disp[0]);
            let top = force(1, s.disp[1] - s.disp[0]);
            r[0] = -self.m[0] * a - bottom + top;
            r[1] = -self.m[1] * a - top;
        });
        x
    }
}

#[test]
fn example_4_1_has_the_published_frequencies_limit_and_behaviour() {
    let found = crate::linalg::frequencies(
        &storeys(&EXAMPLE_4_1.k),
        &SymMatrix::diagonal(&EXAMPLE_4_1.m),
        2,
    )
    .unwrap();
    assert!((found[0] - 4.88).abs() < 0.005 && (found[1] - 45.84).abs() < 0.005);
    let limit = EXAMPLE_4_1
        .proof()
        .limit(f64::INFINITY, &[])
        .unwrap()
        .unwrap();
    assert!((limit - 16.77).abs() < 0.005, "{limit}");
    let reference = peak(&EXAMPLE_4_1.run(f64::INFINITY, 1e-4, 20.0, [0.0; 2]), 0);
    for lambda in [2.0, 4.0, 11.5] {
        // "Good" by the measure of the acceptance values: R ≤ 1.05.
        let ratio = peak(&EXAMPLE_4_1.run(lambda, 0.05, 20.0, [0.0; 2]), 0) / reference;
        assert!(ratio <= 1.05, "λ = {lambda}: {ratio}");
    }
    for lambda in [17.0, f64::INFINITY] {
        let ratio = peak(&EXAMPLE_4_1.run(lambda, 0.05, 20.0, [0.0; 2]), 0) / reference;
        assert!(unstable(ratio), "λ = {lambda}: {ratio}");
    }
}

#[test]
fn example_4_2_has_the_published_thresholds_and_behaviour() {
    let limit = EXAMPLE_4_2
        .proof()
        .limit(f64::INFINITY, &[])
        .unwrap()
        .unwrap();
    assert!((limit - 4.75).abs() < 0.005, "{limit}");
    // Least limit over the run, from the tangents of the reference: 4.75 softening (at rest), 3.79 hardening.
    for (theta, least, good, bad) in [
        ([-0.1, -0.2], 4.75, &[2.0, 4.0, 4.7][..], &[4.9, 11.5][..]),
        ([1.0, 2.0], 3.79, &[1.2, 3.7], &[3.9, 4.0, 11.5]),
    ] {
        let exact = EXAMPLE_4_2.run(f64::INFINITY, 1e-4, 15.0, theta);
        let limits = exact.iter().step_by(100).map(|x| {
            let tangent = |i: usize, drift: f64| {
                EXAMPLE_4_2.k[i] * (1.0 + 1.5 * theta[i] * drift.abs().sqrt())
            };
            let stiffness_bound = storeys(&[tangent(0, x[0]), tangent(1, x[1] - x[0])]);
            let proof = StabilityProof {
                stiffness_bound,
                ..EXAMPLE_4_2.proof()
            };
            proof.limit(f64::INFINITY, &[]).unwrap().unwrap()
        });
        let found = limits.fold(f64::INFINITY, f64::min);
        assert!((found - least).abs() < 0.0051, "θ = {theta:?}: {found}");

        // R = peak bottom drift over that of the reference: good to 1.05, unstable beyond 3.
        let reference = peak(&exact, 0);
        let ratio = |lambda| peak(&EXAMPLE_4_2.run(lambda, 0.05, 15.0, theta), 0) / reference;
        for &lambda in good {
            assert!(ratio(lambda) <= 1.05, "θ = {theta:?}, λ = {lambda}");
        }
        for &lambda in bad {
            assert!(unstable(ratio(lambda)), "θ = {theta:?}, λ = {lambda}");
        }
        if theta[0] < 0.0 {
            let fluctuating = ratio(4.8);
            assert!(fluctuating > 1.05 && fluctuating <= 3.0, "{fluctuating}");
        }
    }
}

#[test]
fn automatic_lambda_follows_its_rule_and_names_what_governs() {
    // Soft and well resolved: the accurate value.
    let mut proof = EXAMPLE_4_1.proof();
    proof.dt = 0.01;
    let choice = proof
        .choose(None, GAIN_NUMERICAL, &EXAMPLE_4_1.parts())
        .unwrap();
    assert_eq!(choice.lambda, Lambda::Finite(ACCURATE_LAMBDA));
    assert_eq!((choice.limit, choice.margin), (None, f64::INFINITY));
    assert!(choice.is_stable() && choice.governing.is_none());

    // One degree of freedom: λ_g = 4 Ω0²/(Ω0² (1 + 1/g) − 4), the closed form of the pencil.
    for gain in [2.0, 10.0] {
        let choice = EXAMPLE_4_2
            .proof()
            .choose(None, gain, &EXAMPLE_4_2.parts())
            .unwrap();
        let single = StabilityProof {
            mass: scalar(1.0),
            damping: scalar(0.0),
            stiffness: scalar(1e4),
            damping_bound: scalar(0.0),
            stiffness_bound: scalar(1e4),
            dt: 1.0,
        };
        let limit = single.limit(gain, &[]).unwrap().unwrap();
        let exact = 4e4 / (1e4 * (1.0 + 1.0 / gain) - 4.0);
        assert!((limit / exact - 1.0).abs() < 1e-10);
        assert!((limit / (4.0 * gain / (gain + 1.0)) - 1.0).abs() < 1e-3);
        assert_eq!(choice.lambda.value(), choice.limit_with_gain.unwrap());
        let Some(Governing::Part {
            name,
            share,
            frequency,
        }) = choice.governing
        else {
            panic!("{:?}", choice.governing)
        };
        assert_eq!(name, "storey 1");
        assert!(share > 0.95);
        assert!((frequency - 100.50).abs() < 0.005);
    }

    // A λ by request is kept, and its margin says what it is worth.
    let choice = EXAMPLE_4_1
        .proof()
        .choose(Some(Lambda::Finite(17.0)), 10.0, &[])
        .unwrap();
    assert_eq!(choice.lambda, Lambda::Finite(17.0));
    assert!(!choice.is_stable() && (choice.margin - 16.77 / 17.0).abs() < 1e-3);
    assert!(matches!(
        choice.governing,
        Some(Governing::Dof { dof: 0, .. })
    ));
    let choice = EXAMPLE_4_1
        .proof()
        .choose(Some(Lambda::Infinite), 10.0, &[])
        .unwrap();
    assert_eq!(choice.margin, 0.0);
}

#[test]
fn what_no_lambda_can_hold_is_an_error_with_a_name() {
    // A damper that C0 does not know: 2 Δt c_max > 4 m and nothing in K0.
    let proof = StabilityProof {
        mass: SymMatrix::diagonal(&[1.0, 1.0]),
        damping: SymMatrix::zeros(2),
        stiffness: SymMatrix::diagonal(&[100.0, 0.0]),
        damping_bound: SymMatrix::diagonal(&[0.0, 50.0]),
        stiffness_bound: SymMatrix::diagonal(&[100.0, 0.0]),
        dt: 0.1,
    };
    let damper = Part {
        name: "damper".to_owned(),
        row: vec![(1, 1.0)],
        stiffness_bound: 0.0,
        damping: 0.0,
        damping_bound: 50.0,
    };
    let error = proof.choose(None, 10.0, &[damper]).unwrap_err().to_string();
    assert!(
        error.contains("no lambda is stable") && error.contains("damper"),
        "{error}"
    );
}

#[test]
fn a_free_chain_drifts_straight_and_keeps_its_momentum() {
    // Free at both ends: K0 singular. Momentum Σ m v changes by roundoff only.
    let n = 40;
    let mut entries: Vec<_> = storeys(&vec![500.0; n]).entries().collect();
    entries.push((0, 0, -500.0));
    let k = SymMatrix::from_triplets(n, entries);
    let masses: Vec<f64> = (0..n).map(|i| 1.0 + (i % 3) as f64).collect();
    let c = k.plus(-0.999, &k);
    let mut gui = Gui::new(
        &SymMatrix::diagonal(&masses),
        &c,
        &k,
        0.05,
        Lambda::Finite(4.0),
        Start::Published,
    )
    .unwrap();
    let mut vel = vec![0.0; n];
    vel[0] = 2.0;
    let (x, _) = run(&mut gui, State::new(vec![0.0; n], vel), 500, linear(&c, &k));
    let moment = |x: &[f64]| -> f64 { x.iter().zip(&masses).map(|(x, m)| x * m).sum() };
    // Σ m x grows by Δt Σ m v = 0.05 · 2 each step.
    for (i, x) in x.iter().enumerate() {
        assert!((moment(x) - 0.1 * i as f64).abs() < 1e-10 * (1.0 + i as f64));
    }
    // With free bodies the limit is still found: the stiffest pair, not the rigid motion, decides.
    let proof = StabilityProof {
        mass: SymMatrix::diagonal(&masses),
        damping: c.clone(),
        stiffness: k.clone(),
        damping_bound: c,
        stiffness_bound: k.clone(),
        dt: 0.2,
    };
    let limit = proof.limit(f64::INFINITY, &[]).unwrap().unwrap();
    let w = crate::linalg::highest_frequency(&k, &proof.mass).unwrap();
    let o2 = w * w * 0.04;
    assert!((limit / (4.0 * o2 / (o2 - 4.0)) - 1.0).abs() < 1e-6);
}

#[test]
fn a_massless_joint_moves_as_the_statically_condensed_system_when_it_is_slow() {
    // Spring 100 to a massless joint, spring 300 on to a mass: k = 75. The joint's own pair of roots is bounded for
    // λ < 4; started in the static shape it is not excited beyond the truncation error of the slow motion.
    let m = SymMatrix::diagonal(&[0.0, 2.0]);
    let k = storeys(&[100.0, 300.0]);
    let c = SymMatrix::zeros(2);
    let (dt, lambda) = (0.001, Lambda::Finite(2.0));
    let mut gui = Gui::new(&m, &c, &k, dt, lambda, Start::SecondOrder).unwrap();
    let (x, _) = run(
        &mut gui,
        State::new(vec![0.75, 1.0], vec![0.0; 2]),
        3000,
        linear(&c, &k),
    );
    let w = 37.5f64.sqrt();
    for (i, x) in x.iter().enumerate() {
        let exact = libm::cos(w * i as f64 * dt);
        // Period error Ω²/6·… ≈ 1e-5 rad per radian over 18 rad.
        assert!((x[1] - exact).abs() < 2e-4, "step {i}: {x:?}");
        assert!((x[0] - 0.75 * exact).abs() < 1e-3, "step {i}: {x:?}");
    }
}

#[test]
fn advancing_allocates_nothing_and_repeats_to_the_bit() {
    let system = Nonlinear::new();
    let make = || {
        Gui::new(
            &system.m,
            &system.c,
            &system.k,
            0.01,
            Lambda::Finite(4.0),
            Start::SecondOrder,
        )
        .unwrap()
    };
    let step = |gui: &mut Gui, state: &mut State| {
        let (mut r, mut reported) = ([0.0; 3], [0.0; 3]);
        for i in 0..500 {
            system.residual(f64::from(i) * 0.01, &state.disp, &state.vel, &mut r);
            gui.advance(state, &r, &mut reported);
        }
    };
    let (mut gui, mut state) = (make(), State::at_rest(3));
    let counted = allocation_counter::measure(|| step(&mut gui, &mut state));
    assert_eq!(counted.count_total, 0);
    let (mut gui, mut again) = (make(), State::at_rest(3));
    step(&mut gui, &mut again);
    assert!(
        state
            .disp
            .iter()
            .zip(&again.disp)
            .all(|(a, b)| a.to_bits() == b.to_bits())
    );
}

/// Random structure of up to five degrees of freedom: K0 and C0 positive definite, K_max ⪰ K0-ish, C_max ⪰ C0.
fn random_proof() -> impl Strategy<Value = StabilityProof> {
    (1usize..6).prop_flat_map(|n| {
        let numbers = |count| proptest::collection::vec(0.1f64..1.0, count);
        (
            numbers(n),
            numbers(n),
            numbers(n),
            numbers(n),
            numbers(n),
            0.02f64..0.5,
            0.3f64..3.0,
        )
            .prop_map(|(m, k, c, grow, damp, dt, hardening)| {
                let times = |v: &[f64], by: f64| v.iter().map(|x| by * x).collect::<Vec<_>>();
                let stiffness = storeys(&times(&k, 1000.0));
                let damping = storeys(&times(&c, 2.0));
                StabilityProof {
                    mass: SymMatrix::diagonal(&m),
                    stiffness_bound: storeys(&times(&grow, 1000.0 * hardening)),
                    damping_bound: damping.plus(1.0, &SymMatrix::diagonal(&times(&damp, 0.3))),
                    damping,
                    stiffness,
                    dt,
                }
            })
    })
}

/// Largest |z| of the frozen recursion, from what `advance` does to every basis state.
fn spectral_radius(proof: &StabilityProof, lambda: f64) -> f64 {
    let n = proof.mass.n();
    let lambda = Lambda::new(lambda).unwrap();
    let mut gui = Gui::new(
        &proof.mass,
        &proof.damping,
        &proof.stiffness,
        proof.dt,
        lambda,
        Start::Published,
    )
    .unwrap();
    let mut step = DMatrix::zeros(2 * n, 2 * n);
    for j in 0..2 * n {
        let mut state = State::at_rest(n);
        if j < n {
            state.disp[j] = 1.0;
        } else {
            // Velocity in units of 1/Δt keeps the matrix well scaled.
            state.vel[j - n] = 1.0 / proof.dt;
        }
        let (mut r, mut reported) = (vec![0.0; n], vec![0.0; n]);
        proof.stiffness_bound.subtract_product(&state.disp, &mut r);
        proof.damping_bound.subtract_product(&state.vel, &mut r);
        gui.advance(&mut state, &r, &mut reported);
        for i in 0..n {
            step[(i, j)] = state.disp[i];
            step[(n + i, j)] = state.vel[i] * proof.dt;
        }
    }
    step.complex_eigenvalues()
        .iter()
        .map(|z| z.norm())
        .fold(0.0, f64::max)
}

proptest! {
    #[test]
    fn the_limit_is_the_pencil_eigenvalue_and_the_edge_of_the_unit_disc(proof in random_proof()) {
        // λ_lim = 4/μ, μ largest eigenvalue of (Δt² K_max + 2 Δt (C_max − C0) − 4 M, Δt² K0), by Cholesky of K0.
        let dt = proof.dt;
        let a = proof.stiffness_bound.to_dense() * (dt * dt)
            + (proof.damping_bound.to_dense() - proof.damping.to_dense()) * (2.0 * dt)
            - proof.mass.to_dense() * 4.0;
        let l = (proof.stiffness.to_dense() * (dt * dt)).cholesky().unwrap().l();
        let half = l.solve_lower_triangular(&a).unwrap().transpose();
        let reduced = l.solve_lower_triangular(&half).unwrap();
        let mu = ((&reduced + reduced.transpose()) / 2.0).symmetric_eigenvalues().max();
        match proof.limit(f64::INFINITY, &[]).unwrap() {
            None => prop_assert!(mu < 1e-9),
            Some(limit) => {
                prop_assert!((limit * mu / 4.0 - 1.0).abs() < 1e-8 / mu.min(1.0), "{} against {}", limit, 4.0 / mu);
                // Simple crossings at z = −1; eigenvalues of a non-symmetric matrix carry about √ε.
                prop_assert!(spectral_radius(&proof, 0.99 * limit) < 1.0 + 1e-7);
                prop_assert!(spectral_radius(&proof, 1.01 * limit) > 1.0);
            }
        }
    }
}

#[test]
fn the_limit_of_a_long_chain_is_that_of_its_highest_mode() {
    // Fixed-free, unit m and k: ω_max = 2 sin((2n − 1) π / (2 (2n + 1))); λ_lim = 4Ω²/(Ω² − 4), six digits at this size.
    let n = 1500;
    let k = storeys(&vec![1.0; n]);
    let dt = 1.3;
    let proof = StabilityProof {
        mass: SymMatrix::diagonal(&vec![1.0; n]),
        damping: SymMatrix::zeros(n),
        stiffness: k.clone(),
        damping_bound: SymMatrix::zeros(n),
        stiffness_bound: k,
        dt,
    };
    let angle = (2 * n - 1) as f64 * PI / (2 * (2 * n + 1)) as f64;
    let o2 = 4.0 * libm::sin(angle) * libm::sin(angle) * dt * dt;
    let limit = proof.limit(f64::INFINITY, &[]).unwrap().unwrap();
    assert!((limit / (4.0 * o2 / (o2 - 4.0)) - 1.0).abs() < 2e-6);
}
