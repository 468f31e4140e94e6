//! One degree of freedom: poles, period, starts and orders of accuracy of the family.

use super::*;

#[test]
fn lambda_is_a_positive_number_or_infinity() {
    for bad in [0.0, -1.0, f64::NAN, f64::NEG_INFINITY] {
        assert!(Lambda::new(bad).is_err());
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
fn invalid_systems_are_refused_with_numbers() {
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
    assert_is!(built.unwrap_err() => GuiError::Sizes { mass: 1, damping: 2, stiffness: 1 });
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
    assert_is!(built.unwrap_err() => GuiError::EffectiveMass(NotPositiveDefinite { dof: 1, .. }));
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
fn free_vibration_is_undamped() {
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
            let size = libm::hypot(1.0f64, b);
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
fn second_order_start_is_exactly_a_cosine() {
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
fn published_start_overshoots_a_stiff_mode() {
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
fn orders_of_accuracy_match_theory() {
    for lambda in [2.0, 4.0, 11.5, f64::INFINITY] {
        let slope = |start, free| {
            let (coarse, fine) = (
                errors(start, lambda, 400, free),
                errors(start, lambda, 800, free),
            );
            (libm::log2(coarse.0 / fine.0), libm::log2(coarse.1 / fine.1))
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
fn started_state_is_not_started_again() {
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
