//! The chain of example 4.3 by other means: plain sweeps, dense matrices, Newton on a band. Written for this chain alone,
//! without a general structure and without allocation in a step: the strongest honest opponents.

use nalgebra::{DMatrix, DVector};

use gusset_numerics::linalg::{Spd, SymMatrix};

use crate::timed;

pub const MASS: f64 = 150.0;
pub const STIFFNESS: f64 = 2.5e5;
pub const DAMPING: f64 = 10.0;
pub const DT: f64 = 0.02;
/// Biviscous damper: below and above the yield velocity.
pub const DAMPER: (f64, f64, f64) = (180.0, 90.0, 1.0 / 3.0);
pub const LAMBDA: f64 = 4.0;

/// Displacement and velocity of the base.
pub fn base(step: usize) -> (f64, f64) {
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

/// Springs of a row, the first one to the base.
pub fn springs(n: usize, value: f64) -> SymMatrix {
    let mut entries = vec![(0, 0, value)];
    for i in 1..n {
        entries.extend([(i - 1, i - 1, value), (i - 1, i, -value), (i, i, value)]);
    }
    SymMatrix::from_triplets(n, entries)
}

/// The family with two fused sweeps and one recurrence each: forces with the elimination, back substitution with the
/// predictor. Median in µs, displacement of the first mass at the end.
pub fn plain_sweeps(n: usize, steps: usize) -> (f64, f64) {
    let per = |i: usize| if i + 1 < n { 2.0 } else { 1.0 };
    let link = DT / 2.0 * DAMPING + DT * DT / LAMBDA * STIFFNESS;
    let (mut multiplier, mut inverse) = (vec![0.0; n], vec![0.0; n]);
    for i in 0..n {
        let carried = if i > 0 { multiplier[i] * -link } else { 0.0 };
        let pivot = MASS + DT / 2.0 * DAMPER.0 + per(i) * link - carried;
        inverse[i] = 1.0 / pivot;
        if i + 1 < n {
            multiplier[i + 1] = -link * inverse[i];
        }
    }
    let (mut x, mut v, mut y) = (vec![0.0f64; n], vec![0.0f64; n], vec![0.0f64; n]);
    let (p50, _) = timed(steps, |step| {
        let (mut below, mut vel_below) = base(step);
        let mut above = 0.0;
        let rows = x.windows(2).zip(v.windows(2)).zip(&mut y).zip(&multiplier);
        for (((x, v), y), l) in rows {
            let spring = STIFFNESS * (x[0] - below) - STIFFNESS * (x[1] - x[0]);
            let dashpot = DAMPING * (v[0] - vel_below) - DAMPING * (v[1] - v[0]);
            above = -(spring + dashpot + damper(v[0]).0) - l * above;
            *y = above;
            (below, vel_below) = (x[0], v[0]);
        }
        let last = n - 1;
        let spring = STIFFNESS * (x[last] - below) + DAMPING * (v[last] - vel_below);
        y[last] = -(spring + damper(v[last]).0) - multiplier[last] * above;
        let (mut w, mut link) = (0.0, 0.0);
        let rows = x
            .iter_mut()
            .zip(&mut v)
            .zip(&y)
            .zip(&inverse)
            .zip(&multiplier);
        for ((((x, v), y), d), l) in rows.rev() {
            w = y * d - link * w;
            link = *l;
            *v += DT * w;
            *x += DT * *v;
        }
    });
    (p50, x[0])
}

/// Equations (1) to (3) with full matrices: α = M_eff⁻¹ M, column by column.
pub fn dense(n: usize, steps: usize) -> (f64, f64) {
    let (c, k) = (springs(n, DAMPING), springs(n, STIFFNESS));
    let initial = c.plus(1.0, &SymMatrix::diagonal(&vec![DAMPER.0; n]));
    let effective = SymMatrix::diagonal(&vec![MASS; n])
        .plus(DT / 2.0, &initial)
        .plus(DT * DT / LAMBDA, &k);
    let mut factor = Spd::factor(&effective).expect("a definite effective mass");
    let mut alpha = DMatrix::zeros(n, n);
    for (j, mut column) in alpha.column_iter_mut().enumerate() {
        column[j] = MASS;
        factor.solve_in_place(column.as_mut_slice());
    }
    let (c, k) = (c.to_dense(), k.to_dense());
    let (mut x, mut v) = (DVector::zeros(n), DVector::zeros(n));
    let (mut a, mut w) = (DVector::zeros(n), DVector::zeros(n));
    let (p50, _) = timed(steps, |step| {
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
    (p50, x[0])
}

/// Average acceleration, Newton on x⁺ with a tridiagonal tangent: median in µs, mean iterations, displacement of the
/// first mass at the end.
pub fn newton(n: usize, steps: usize) -> (f64, f64, f64) {
    let (m, per_v) = (4.0 * MASS / (DT * DT), 2.0 / DT);
    let (mut x, mut v) = (vec![0.0f64; n], vec![0.0f64; n]);
    let mut a = vec![0.0; n];
    // From equilibrium at t = 0.
    a[0] = DAMPING * base(0).1 / MASS;
    let (mut next, mut vel) = (vec![0.0f64; n], vec![0.0f64; n]);
    let (mut diagonal, mut change) = (vec![0.0; n], vec![0.0; n]);
    let (mut made, mut largest) = (0usize, 0.0f64);
    let beside = -(per_v * DAMPING + STIFFNESS);
    let (p50, _) = timed(steps, |step| {
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
    (p50, made as f64 / steps as f64, x[0])
}
