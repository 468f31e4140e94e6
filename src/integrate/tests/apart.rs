//! A λ of their own for elements and modes: against dense algebra, against separate oscillators, and at the edge of the
//! unit disc.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::{random_proof, scalar, spectral_radius, storeys};
use crate::integrate::*;
use crate::linalg::{SymMatrix, modes};
use crate::stability::{StabilityError, StabilityProof};

const DT: f64 = 0.05;

/// The share of storey `i` (from 0) in a matrix of storeys.
fn storey(stiffness: &SymMatrix, i: usize) -> SymMatrix {
    let n = stiffness.n();
    let value = |i: usize| {
        (i..n)
            .map(|j| stiffness.row(j).map(|(_, k)| k).sum::<f64>())
            .sum::<f64>()
    };
    // Rows of a fixed-free chain sum to zero but the first, which sums to the ground storey.
    let k = if i == 0 {
        value(0)
    } else {
        -stiffness.get(i - 1, i)
    };
    let entries = match i {
        0 => vec![(0, 0, k)],
        _ => vec![(i - 1, i - 1, k), (i - 1, i, -k), (i, i, k)],
    };
    SymMatrix::from_triplets(n, entries)
}

fn gui(proof: &StabilityProof, lambda: f64) -> Gui {
    let lambda = Lambda::new(lambda).unwrap();
    let (c, k) = (&proof.damping, &proof.stiffness);
    let apart = proof.apart.as_ref();
    Gui::with_apart(&proof.mass, c, k, proof.dt, lambda, Start::Published, apart).unwrap()
}

fn frame(apart: Option<Apart>) -> StabilityProof {
    let stiffness = storeys(&[9e5, 4e5, 7e5, 2e5, 3e5]);
    let mass = SymMatrix::diagonal(&[900.0, 1200.0, 700.0, 0.0, 800.0]);
    let damping = SymMatrix::zeros(5).plus(0.4, &mass).plus(2e-3, &stiffness);
    StabilityProof {
        damping_bound: damping.clone(),
        stiffness_bound: stiffness.clone(),
        mass,
        damping,
        stiffness,
        dt: DT,
        apart,
        late_mass: None,
    }
}

/// Largest deviation of w from M_eff⁻¹ r by a dense factorisation of M + (Δt/2) C0 + Δt² K̃.
fn deviation(proof: &StabilityProof, lambda: f64, weighted: &DMatrix<f64>) -> f64 {
    let n = proof.mass.n();
    let r: Vec<f64> = (0..n)
        .map(|i| 1e3 * libm::cos(1.0 + 2.0 * i as f64))
        .collect();
    let dt = proof.dt;
    let matrix =
        proof.mass.to_dense() + proof.damping.to_dense() * (dt / 2.0) + weighted * (dt * dt);
    let wanted = matrix.lu().solve(&DVector::from_vec(r.clone())).unwrap();
    let (mut state, mut reported) = (State::at_rest(n), vec![0.0; n]);
    gui(proof, lambda).advance(&mut state, &r.clone(), &mut reported);
    let gaps = state.weighted_accel.iter().zip(wanted.iter());
    gaps.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / wanted.amax()
}

#[test]
fn elements_of_their_own_lambda_stand_in_the_effective_mass_with_it() {
    let stiffness = frame(None).stiffness;
    let values = [(0, 2.0), (3, f64::INFINITY), (4, 11.5)];
    let named: Vec<_> = values
        .iter()
        .map(|&(i, lambda)| (storey(&stiffness, i), Lambda::new(lambda).unwrap()))
        .collect();
    let proof = frame(Some(Apart::elements(5, &named)));
    // Σ k_e/λ_e b bᵀ over all storeys, the rest at λ = 3.7.
    let mut weighted = DMatrix::zeros(5, 5);
    for i in 0..5 {
        let own = values.iter().find(|(j, _)| *j == i).map_or(3.7, |v| v.1);
        weighted += storey(&stiffness, i).to_dense() / own;
    }
    let found = deviation(&proof, 3.7, &weighted);
    assert!(found < 1e-12, "{found}");
    // Nothing dense has come of it.
    assert_eq!(
        gui(&proof, 3.7).storage(),
        crate::linalg::Storage::Tridiagonal
    );
}

#[test]
fn modes_of_their_own_lambda_stand_in_the_effective_mass_with_it() {
    let plain = frame(None);
    let shapes = modes(&plain.stiffness, &plain.mass).unwrap();
    let lambdas = [11.5, f64::INFINITY, 2.0].map(|value| Lambda::new(value).unwrap());
    let proof = frame(Some(Apart::modes(&shapes, &plain.mass, &lambdas)));
    let mut weighted = plain.stiffness.to_dense() / 4.0;
    for (j, lambda) in lambdas.iter().enumerate() {
        let u = plain.mass.to_dense() * shapes.shapes.column(j);
        let square = shapes.frequencies[j] * shapes.frequencies[j];
        weighted += &u * u.transpose() * (square * (lambda.inverse() - 0.25));
    }
    let found = deviation(&proof, 4.0, &weighted);
    assert!(found < 1e-12, "{found}");
    assert_eq!(
        gui(&proof, 4.0).storage(),
        crate::linalg::Storage::Tridiagonal
    );
}

#[test]
fn each_mode_moves_as_an_oscillator_of_its_own_lambda() {
    let stiffness = storeys(&[9e5, 4e5, 7e5, 2e5]);
    let mass = SymMatrix::diagonal(&[900.0, 1200.0, 700.0, 800.0]);
    let damping = SymMatrix::zeros(4).plus(0.4, &mass).plus(2e-3, &stiffness);
    let shapes = modes(&stiffness, &mass).unwrap();
    let own = [11.5, 6.0].map(|value| Lambda::new(value).unwrap());
    let proof = StabilityProof {
        damping_bound: damping.clone(),
        stiffness_bound: stiffness.clone(),
        apart: Some(Apart::modes(&shapes, &mass, &own)),
        mass,
        damping,
        stiffness,
        dt: DT,
        late_mass: None,
    };
    let mut whole = gui(&proof, 3.0);
    let start = [0.01, -0.02, 0.03, 0.015];
    let mut state = State::new(start.to_vec(), vec![0.0; 4]);
    // q_j = φ_jᵀ M x.
    let part = |x: &[f64], j: usize| -> f64 {
        let shape = shapes.shapes.column(j);
        (0..4).map(|i| shape[i] * proof.mass.get(i, i) * x[i]).sum()
    };
    let mut single: Vec<(Gui, State, f64, f64)> = (0..4)
        .map(|j| {
            let w = shapes.frequencies[j];
            let (c, k) = (0.4 + 2e-3 * w * w, w * w);
            let lambda = own.get(j).copied().unwrap_or(Lambda::Finite(3.0));
            let gui = Gui::new(
                &scalar(1.0),
                &scalar(c),
                &scalar(k),
                DT,
                lambda,
                Start::Published,
            );
            (
                gui.unwrap(),
                State::new(vec![part(&start, j)], vec![0.0]),
                c,
                k,
            )
        })
        .collect();
    for _ in 0..300 {
        let (mut r, mut reported) = (vec![0.0; 4], vec![0.0; 4]);
        proof.stiffness.subtract_product(&state.disp, &mut r);
        proof.damping.subtract_product(&state.vel, &mut r);
        whole.advance(&mut state, &r, &mut reported);
        for (j, (gui, q, c, k)) in single.iter_mut().enumerate() {
            let r = [-*c * q.vel[0] - *k * q.disp[0]];
            gui.advance(q, &r, &mut [0.0]);
            // √m of the largest displacement; 300 steps of roundoff.
            let gap = (part(&state.disp, j) - q.disp[0]).abs();
            assert!(gap < 1e-11, "mode {}: {gap}", j + 1);
        }
    }
}

#[test]
fn all_elements_at_one_lambda_are_the_family_itself() {
    let stiffness = frame(None).stiffness;
    let named: Vec<_> = (0..5)
        .map(|i| (storey(&stiffness, i), Lambda::Finite(3.0)))
        .collect();
    let proof = frame(Some(Apart::elements(5, &named)));
    let found = deviation(&proof, 11.5, &(stiffness.to_dense() / 3.0));
    assert!(found < 1e-12, "{found}");
}

#[test]
fn a_step_with_modes_of_their_own_allocates_nothing() {
    let plain = frame(None);
    let shapes = modes(&plain.stiffness, &plain.mass).unwrap();
    let apart = Apart::modes(&shapes, &plain.mass, &[Lambda::Finite(11.5); 2]);
    let proof = frame(Some(apart));
    let mut gui = gui(&proof, 4.0);
    let (mut state, r, mut reported) = (State::at_rest(5), [1.0; 5], [0.0; 5]);
    let counted = allocation_counter::measure(|| {
        for _ in 0..50 {
            gui.advance(&mut state, &r, &mut reported);
        }
    });
    assert_eq!(counted.count_total, 0);
}

proptest! {
    /// The limit of the rest is where the recursion leaves the unit disc, whatever the others were given.
    #[test]
    fn the_limit_of_the_rest_is_the_edge_of_the_unit_disc(
        proof in random_proof(), own in 0.3f64..8.0, which in 0usize..5, by_mode in any::<bool>(),
    ) {
        let n = proof.mass.n();
        let mut proof = proof;
        let lambda = Lambda::Finite(own);
        proof.apart = Some(if by_mode {
            let shapes = modes(&proof.stiffness, &proof.mass).unwrap();
            Apart::modes(&shapes, &proof.mass, &vec![lambda; which % n])
        } else {
            Apart::elements(n, &[(storey(&proof.stiffness, which % n), lambda)])
        });
        match proof.limit(f64::INFINITY, &[]) {
            // Every λ of the rest is stable.
            Ok(None) => prop_assert!([0.5, 4.0, 1e5].iter().all(|l| spectral_radius(&proof, *l) < 1.0 + 1e-7)),
            Ok(Some(limit)) => {
                prop_assert!(spectral_radius(&proof, 0.99 * limit) < 1.0 + 1e-7);
                prop_assert!(spectral_radius(&proof, 1.01 * limit) > 1.0);
            }
            // What was given is too much: no λ of the rest mends it.
            Err(StabilityError::NoneAdmissible { .. } | StabilityError::Overflow { .. }) => {
                prop_assert!([1e-3, 1.0, 1e3].iter().all(|l| spectral_radius(&proof, *l) > 1.0));
            }
        }
    }
}
