use std::f64::consts::PI;

use nalgebra::{ComplexField as _, DMatrix, DVector};
use proptest::prelude::*;

use super::*;
use gusset_numerics::integrate::*;
use gusset_numerics::linalg::{NotPositiveDefinite, SymMatrix};
use gusset_numerics::model::Part;
use gusset_quantity::assert_is;

mod by_rows;
mod companions;
mod family;
mod forms;
mod limits;
mod structures;

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
                    late_mass: None,
                    massless: Vec::new(),
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
        .map(|z| z.modulus())
        .fold(0.0, f64::max)
}
