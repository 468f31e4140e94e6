//! One step of the chain of example 4.3 (Gui et al. 2014): predict, forces, solve. Three programs on the same chain in
//! one run, p50 of many steps each, and their ratios:
//!
//! * `family`: this crate, λ = 4, sparse factor, nonlinear dampers;
//! * `dense`: the paper's equations as printed: α, K and C as full matrices, three dense products a step;
//! * `newton`: average acceleration with Newton's iteration on a tridiagonal matrix, hand-written for this chain: no
//!   general structure, no allocation, the strongest honest opponent.
//!
//! `cargo bench --bench step -- 500 1000 5000` chooses sizes. Dense matrices take 24 n² bytes (600 MB at 5000); they are
//! left out beyond 3000 unless `dense` is among the arguments. Compare ratios of one run, not figures of two.

#![allow(clippy::disallowed_macros, reason = "a bench prints its table")]

use gusset::integrate::{Gui, Integrator, Lambda, Start, State};
use gusset::law::{BiviscousSpec, Reach};
use gusset::linalg::{Spd, SymMatrix};
use gusset::model::{Base, Element, End, Structure};
use gusset::rt::clock::{MonotonicClock, USUAL_SPIN_NS};
use gusset::time::Clock;
use nalgebra::{DMatrix, DVector};

const MASS: f64 = 150.0;
const STIFFNESS: f64 = 2.5e5;
const DAMPING: f64 = 10.0;
const DT: f64 = 0.02;
/// Biviscous damper: below and above the yield velocity.
const DAMPER: (f64, f64, f64) = (180.0, 90.0, 1.0 / 3.0);
const SIZES: [usize; 5] = [500, 1000, 2000, 3000, 5000];
const LARGEST_DENSE: usize = 3000;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let sizes: Vec<usize> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    let sizes = if sizes.is_empty() {
        SIZES.to_vec()
    } else {
        sizes
    };
    let all_dense = arguments.iter().any(|a| a == "dense");
    println!("µs per step, p50; ratios are over `family` of the same run\n");
    println!(
        "{:>7} {:>10} {:>12} {:>8} {:>12} {:>8} {:>10}",
        "n", "family", "dense", "ratio", "newton", "ratio", "iterations"
    );
    for n in sizes {
        let (family, disp) = family(n);
        let (newton, iterations, other) = newton(n);
        let apart = (disp - other).abs() / other.abs().max(1e-3);
        assert!(apart < 0.2, "both must move alike: {disp} {other}");
        let (dense, ratio) = if n <= LARGEST_DENSE || all_dense {
            let (time, same) = dense(n);
            assert!(
                (same - disp).abs() < 1e-9 * disp.abs().max(1e-3),
                "{same} {disp}"
            );
            (format!("{time:.2}"), format!("{:.1}", time / family))
        } else {
            ("-".to_owned(), "-".to_owned())
        };
        println!(
            "{n:>7} {family:>10.2} {dense:>12} {ratio:>8} {newton:>12.2} {:>8.1} {iterations:>10.2}",
            newton / family
        );
    }
}

fn base(step: usize) -> (f64, f64) {
    let angle = std::f64::consts::TAU * step as f64 * DT;
    (
        0.1 * libm::sin(angle),
        0.1 * std::f64::consts::TAU * libm::cos(angle),
    )
}

fn damper(v: f64) -> (f64, f64) {
    let (c, after, yields) = DAMPER;
    if v.abs() <= yields {
        (c * v, c)
    } else {
        ((c * yields + after * (v.abs() - yields)).copysign(v), after)
    }
}

/// Runs `step` often enough for a median: time in µs.
fn median(steps: usize, mut step: impl FnMut(usize)) -> f64 {
    let clock = MonotonicClock::new(USUAL_SPIN_NS);
    let mut times: Vec<u64> = (0..steps)
        .map(|k| {
            let start = clock.now();
            step(k);
            clock.now().since(start)
        })
        .collect();
    times.sort_unstable();
    times[steps / 2] as f64 * 1e-3
}

/// Steps that every program makes, so that they can be compared at the end.
const STEPS: usize = 150;

fn tridiagonal(n: usize, value: f64) -> SymMatrix {
    let mut entries = vec![(0, 0, value)];
    for i in 1..n {
        entries.extend([(i - 1, i - 1, value), (i - 1, i, -value), (i, i, value)]);
    }
    SymMatrix::from_triplets(n, entries)
}

/// This crate: time and displacement of the first mass at the end.
fn family(n: usize) -> (f64, f64) {
    let law = BiviscousSpec {
        damping_n_s_per_m: DAMPER.0,
        post_yield_damping_n_s_per_m: DAMPER.1,
        yield_velocity_m_per_s: DAMPER.2,
    };
    let dampers = (0..n).map(|dof| Element {
        name: String::new(),
        from: End::Fixed,
        to: End::Dof(dof),
        law: Box::new(law.build().expect("a damper")),
        reach: Reach::default(),
        hardening_ratio: None,
        damping_ratio: None,
    });
    let mut structure = Structure::new(
        SymMatrix::diagonal(&vec![MASS; n]),
        tridiagonal(n, DAMPING),
        tridiagonal(n, STIFFNESS),
        vec![1.0; n],
        dampers.collect(),
    )
    .expect("a chain");
    let mut gui = Gui::new(
        structure.mass(),
        &structure.reference_damping(),
        &structure.reference_stiffness(),
        DT,
        Lambda::Finite(4.0),
        Start::Published,
    )
    .expect("a definite effective mass");
    let mut state = State::at_rest(n);
    let (mut r, mut reported) = (vec![0.0; n], vec![0.0; n]);
    let time = median(STEPS, |step| {
        let (disp, vel) = base(step);
        r.fill(0.0);
        structure.subtract_internal(&state.disp, &state.vel, Base { disp, vel }, DT, &mut r);
        gui.advance(&mut state, &mut r, &mut reported);
    });
    (time, state.disp[0])
}

/// Equations (1) to (3) with full matrices: α = M_eff⁻¹ M, column by column.
fn dense(n: usize) -> (f64, f64) {
    let (c, k) = (tridiagonal(n, DAMPING), tridiagonal(n, STIFFNESS));
    let initial = c.plus(1.0, &SymMatrix::diagonal(&vec![DAMPER.0; n]));
    let effective = SymMatrix::diagonal(&vec![MASS; n])
        .plus(DT / 2.0, &initial)
        .plus(DT * DT / 4.0, &k);
    let mut factor = Spd::factor(&effective).expect("a definite effective mass");
    let mut alpha = DMatrix::zeros(n, n);
    for (j, mut column) in alpha.column_iter_mut().enumerate() {
        column[j] = MASS;
        factor.solve_in_place(column.as_mut_slice());
    }
    let (c, k) = (c.to_dense(), k.to_dense());
    let (mut x, mut v) = (DVector::zeros(n), DVector::zeros(n));
    let (mut a, mut w) = (DVector::zeros(n), DVector::zeros(n));
    let time = median(STEPS, |step| {
        let (disp, vel) = base(step);
        for (a, v) in a.iter_mut().zip(v.iter()) {
            *a = -damper(*v).0 / MASS;
        }
        a[0] += (STIFFNESS * disp + DAMPING * vel) / MASS;
        a.gemv(-1.0 / MASS, &k, &x, 1.0);
        a.gemv(-1.0 / MASS, &c, &v, 1.0);
        w.gemv(1.0, &alpha, &a, 0.0);
        v.axpy(DT, &w, 1.0);
        x.axpy(DT, &v, 1.0);
    });
    (time, x[0])
}

/// Average acceleration, Newton on x⁺: time, mean iterations, displacement of the first mass at the end.
fn newton(n: usize) -> (f64, f64, f64) {
    let (m, per_v) = (4.0 * MASS / (DT * DT), 2.0 / DT);
    let (mut x, mut v) = (vec![0.0f64; n], vec![0.0f64; n]);
    let mut a = vec![0.0; n];
    // From equilibrium at t = 0.
    a[0] = DAMPING * base(0).1 / MASS;
    let (mut next, mut vel) = (vec![0.0f64; n], vec![0.0f64; n]);
    let (mut diagonal, mut change) = (vec![0.0; n], vec![0.0; n]);
    let (mut made, mut largest) = (0usize, 0.0f64);
    let beside = -(per_v * DAMPING + STIFFNESS);
    let time = median(STEPS, |step| {
        let (xg, vg) = base(step + 1);
        next.copy_from_slice(&x);
        for _ in 0..50 {
            made += 1;
            for i in 0..n {
                vel[i] = per_v * (next[i] - x[i]) - v[i];
            }
            for i in 0..n {
                let accel = (next[i] - x[i] - DT * v[i]) * 4.0 / (DT * DT) - a[i];
                let (force, tangent) = damper(vel[i]);
                let (below, vel_below) = if i == 0 {
                    (xg, vg)
                } else {
                    (next[i - 1], vel[i - 1])
                };
                let mut sum = STIFFNESS * (next[i] - below) + DAMPING * (vel[i] - vel_below);
                let mut springs = 1.0;
                if i + 1 < n {
                    sum -= STIFFNESS * (next[i + 1] - next[i]) + DAMPING * (vel[i + 1] - vel[i]);
                    springs = 2.0;
                }
                change[i] = -(MASS * accel + force + sum);
                diagonal[i] = m + per_v * tangent - springs * beside;
            }
            // Thomas.
            for i in 1..n {
                let multiplier = beside / diagonal[i - 1];
                diagonal[i] -= multiplier * beside;
                change[i] -= multiplier * change[i - 1];
            }
            change[n - 1] /= diagonal[n - 1];
            for i in (0..n - 1).rev() {
                change[i] = (change[i] - beside * change[i + 1]) / diagonal[i];
            }
            let mut moved = 0.0f64;
            for (x, dx) in next.iter_mut().zip(&change) {
                *x += dx;
                moved = moved.max(dx.abs());
                largest = largest.max(x.abs());
            }
            if moved <= 1e-10 * largest {
                break;
            }
        }
        for i in 0..n {
            let accel = (next[i] - x[i] - DT * v[i]) * 4.0 / (DT * DT) - a[i];
            v[i] += DT / 2.0 * (a[i] + accel);
            a[i] = accel;
            x[i] = next[i];
        }
    });
    (time, made as f64 / STEPS as f64, x[0])
}
