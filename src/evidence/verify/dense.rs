//! Example 4.3 as a dense implementation does it, which is what Table 2 times: full matrices, the equations as printed,
//! a factorisation in every iteration of the methods that iterate. It shares nothing with the program's own methods and
//! counts what it does.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::drive::Method;
use gusset_numerics::integrate::NewmarkBeta;
use gusset_numerics::law::BiviscousSpec;

pub(super) const MASS: f64 = 150.0;
pub(super) const STIFFNESS: f64 = 2.5e5;
pub(super) const DAMPING: f64 = 10.0;
pub(super) const DT: f64 = 0.02;

/// The damper of Fig. 15: c_a0 = 180, c_ay = 90 N s/m, v_y = 1/3 m/s.
pub(super) const DAMPER: BiviscousSpec = BiviscousSpec {
    damping_n_s_per_m: 180.0,
    post_yield_damping_n_s_per_m: 90.0,
    yield_velocity_m_per_s: 1.0 / 3.0,
};

/// A chain of full matrices on its way.
pub(super) struct Dense {
    method: Method,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    /// α as printed, or what Chang's predictor divides by, as an inverse.
    operator: Option<DMatrix<f64>>,
    pub(super) disp: DVector<f64>,
    vel: DVector<f64>,
    accel: DVector<f64>,
    step: usize,
    largest: f64,
    /// Factorisations of n × n matrices so far, without those before the first step.
    pub(super) factorisations: usize,
    /// Products of an n × n matrix with a vector, and pairs of triangular solves, so far.
    pub(super) products: usize,
}

fn tridiagonal(n: usize, value: f64) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 if i + 1 == n => value,
        0 => 2.0 * value,
        1 => -value,
        _ => 0.0,
    })
}

/// Force and tangent of the absolute damper.
fn damper(v: f64) -> (f64, f64) {
    let (c, after, yields) = (
        DAMPER.damping_n_s_per_m,
        DAMPER.post_yield_damping_n_s_per_m,
        DAMPER.yield_velocity_m_per_s,
    );
    if v.abs() <= yields {
        (c * v, c)
    } else {
        (
            v.signum() * (c * yields + after * (v.abs() - yields)),
            after,
        )
    }
}

/// Columns that a blocked factorisation takes at once.
const BLOCK: usize = 64;

/// A⁻¹ r by Cholesky in blocks, most of it products of matrices: what a good dense library does on one core.
fn solve(mut matrix: DMatrix<f64>, mut r: DVector<f64>) -> Option<DVector<f64>> {
    let n = matrix.nrows();
    for start in (0..n).step_by(BLOCK) {
        let width = BLOCK.min(n - start);
        let end = start + width;
        let diagonal = matrix.view((start, start), (width, width)).into_owned();
        let diagonal = diagonal.cholesky()?.l();
        matrix
            .view_mut((start, start), (width, width))
            .copy_from(&diagonal);
        let rows = n - end;
        let below = matrix.view((end, start), (rows, width)).transpose();
        let across = diagonal.solve_lower_triangular(&below)?;
        let down = across.transpose();
        matrix
            .view_mut((end, start), (rows, width))
            .copy_from(&down);
        for from in (0..rows).step_by(4 * BLOCK) {
            let columns = (4 * BLOCK).min(rows - from);
            let mut rest = matrix.view_mut((end + from, end + from), (rows - from, columns));
            let (left, right) = (down.rows(from, rows - from), across.columns(from, columns));
            rest.gemm(-1.0, &left, &right, 1.0);
        }
    }
    matrix.solve_lower_triangular_mut(&mut r);
    matrix.tr_solve_lower_triangular_mut(&mut r);
    Some(r)
}

impl Dense {
    /// At rest, a\[0\] from equilibrium.
    pub(super) fn new(method: Method, n: usize) -> Option<Self> {
        let (damping, stiffness) = (tridiagonal(n, DAMPING), tridiagonal(n, STIFFNESS));
        let initial = &damping + DMatrix::identity(n, n) * DAMPER.damping_n_s_per_m;
        let mass = DMatrix::identity(n, n) * MASS;
        let operator = match method {
            // (19), with its inverse.
            Method::Family(lambda) => {
                let matrix = &mass * (2.0 * lambda)
                    + &initial * (lambda * DT)
                    + &stiffness * (2.0 * DT * DT);
                Some(matrix.cholesky()?.inverse() * (2.0 * lambda * MASS))
            }
            Method::Chang => {
                let matrix = &mass + &initial * (DT / 2.0) + &stiffness * (DT * DT / 4.0);
                Some(matrix.cholesky()?.inverse())
            }
            Method::Newmark(_) => None,
        };
        let zeros = DVector::zeros(n);
        let mut made = Self {
            method,
            damping,
            stiffness,
            operator,
            disp: zeros.clone(),
            vel: zeros.clone(),
            accel: zeros,
            step: 0,
            largest: 0.0,
            factorisations: 0,
            products: 0,
        };
        made.accel = made.internal(0) / MASS;
        Some(made)
    }

    /// F − R_d − R_s at the current x and v.
    fn internal(&mut self, step: usize) -> DVector<f64> {
        let mut r = -(&self.damping * &self.vel) - &self.stiffness * &self.disp;
        self.products += 2;
        for (r, v) in r.iter_mut().zip(self.vel.iter()) {
            *r -= damper(*v).0;
        }
        let t = step as f64 * DT;
        r[0] += STIFFNESS * 0.1 * libm::sin(TAU * t) + DAMPING * 0.1 * TAU * libm::cos(TAU * t);
        r
    }

    /// One step; none if a matrix has no factor.
    pub(super) fn step(&mut self) -> Option<()> {
        self.step += 1;
        match (self.method, &self.operator) {
            (Method::Family(_), Some(alpha)) => {
                // (2), (3), (1).
                let gained = alpha * &self.accel;
                self.products += 1;
                self.disp += &self.vel * DT + &gained * (DT * DT);
                self.vel += gained * DT;
                self.accel = self.internal(self.step) / MASS;
                Some(())
            }
            (Method::Newmark(NewmarkBeta::Average), _) => {
                // From x⁺ = x.
                let next = -(&self.vel * (4.0 / DT)) - &self.accel;
                self.vel += (&self.accel + &next) * (DT / 2.0);
                self.accel = next;
                self.iterate(DT * DT / 4.0)
            }
            (Method::Newmark(NewmarkBeta::Explicit), _) => {
                self.disp += &self.vel * DT + &self.accel * (DT * DT / 2.0);
                self.vel += &self.accel * DT;
                self.iterate(0.0)
            }
            (Method::Chang, Some(inverse)) => {
                let damped = &self.damping * &self.vel + &self.vel * DAMPER.damping_n_s_per_m;
                let pushed = (&self.vel * MASS + damped * (DT / 2.0)) * DT
                    + &self.accel * (MASS * DT * DT / 2.0);
                self.disp += inverse * pushed;
                self.products += 2;
                self.vel += &self.accel * DT;
                self.iterate(0.0)
            }
            _ => None,
        }
    }

    /// Newton's iteration on a⁺ with x⁺ = x_p + θ a⁺ and v⁺ = v_p + (Δt/2) a⁺, a factorisation in each.
    fn iterate(&mut self, disp_share: f64) -> Option<()> {
        let n = self.disp.len();
        let mut change = f64::INFINITY;
        for _ in 0..50 {
            let mut r = self.internal(self.step);
            if change <= 1e-10 * self.largest {
                return Some(());
            }
            r -= &self.accel * MASS;
            let mut matrix = &self.damping * (DT / 2.0);
            if disp_share > 0.0 {
                matrix += &self.stiffness * disp_share;
            }
            for i in 0..n {
                matrix[(i, i)] += MASS + DT / 2.0 * damper(self.vel[i]).1;
            }
            let delta = solve(matrix, r)?;
            self.factorisations += 1;
            self.products += 1;
            self.disp += &delta * disp_share;
            self.vel += &delta * (DT / 2.0);
            let share = if disp_share > 0.0 {
                disp_share
            } else {
                DT / 2.0
            };
            change = share * delta.amax();
            let size = if disp_share > 0.0 {
                self.disp.amax()
            } else {
                self.vel.amax()
            };
            self.largest = self.largest.max(size);
            self.accel += delta;
        }
        None
    }
}
