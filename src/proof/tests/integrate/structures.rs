//! Free and massless structures, allocation, and random ones against the pencil.

use super::*;

#[test]
fn free_chain_keeps_its_momentum() {
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
        late_mass: None,
        massless: Vec::new(),
    };
    let limit = proof.limit(f64::INFINITY, &[]).unwrap().unwrap();
    let w = gusset_numerics::linalg::highest_frequency(&k, &proof.mass).unwrap();
    let o2 = w * w * 0.04;
    assert!((limit / (4.0 * o2 / (o2 - 4.0)) - 1.0).abs() < 1e-6);
}

#[test]
fn massless_joint_matches_condensation() {
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
fn advancing_repeats_without_allocation() {
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

proptest! {
    #[test]
    fn limit_is_the_pencil_eigenvalue(proof in random_proof()) {
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
fn limit_of_long_chain_is_its_highest_mode() {
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
        late_mass: None,
        massless: Vec::new(),
    };
    let angle = (2 * n - 1) as f64 * PI / (2 * (2 * n + 1)) as f64;
    let o2 = 4.0 * libm::sin(angle) * libm::sin(angle) * dt * dt;
    let limit = proof.limit(f64::INFINITY, &[]).unwrap().unwrap();
    assert!((limit / (4.0 * o2 / (o2 - 4.0)) - 1.0).abs() < 2e-6);
}
