//! Other forms of the same recursion: two steps, energy, Newmark, modes.

use super::*;

#[test]
fn recursion_equals_its_two_step_form() {
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
fn discrete_energy_balance_closes() {
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
        let with_damping = system.m.plus(dt / 2.0, &system.c);
        let m_eff = match lambda {
            Lambda::Finite(value) => with_damping.plus(dt * dt / value, &system.k),
            Lambda::Infinite => with_damping,
        };
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
fn infinite_lambda_is_explicit_newmark() {
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
fn many_dofs_move_as_their_modes() {
    // Undamped: each mode is one degree of freedom with m = 1, k = ω², the same λ and Δt.
    let (m, k) = (Nonlinear::new().m, storeys(&[400.0, 300.0, 200.0]));
    let modes = gusset_numerics::linalg::modes(&k, &m).unwrap();
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
