//! Values of λ of their own for some elements or some modes.
//!
//! The proof of stability asks of M_eff = M + (Δt/2) C0 + Δt² K̃ only that
//!
//! ```text
//! S = 4 M + 2 Δt (C0 − C_t) + 4 Δt² K̃ − Δt² K_t ⪰ 0
//! ```
//!
//! K̃ = K0/λ is one way to get there. With λ_e for the elements and λ_j for the modes that are named, and λ for the rest,
//!
//! ```text
//! K̃ = Σ_e k0_e/λ_e b_e b_eᵀ + (K0 − Σ_e k0_e b_e b_eᵀ)/λ                      as sparse as K0
//! K̃ = K0/λ + Σ_j ω_j² (1/λ_j − 1/λ) (M φ_j)(M φ_j)ᵀ                           K0/λ and a few products
//! ```
//!
//! so that what is stiff or hardens is held by a small λ and what governs the response keeps the accuracy of a larger one.
//! The module `stability` proves which λ is stable.

use nalgebra::DMatrix;

use super::Lambda;
use crate::linalg::{Modes, Spd, SymMatrix};

/// The share of K0 that has a λ of its own.
#[derive(Debug, Clone)]
pub struct Apart {
    /// That share, n × n in N/m.
    stiffness: SymMatrix,
    /// What stands for it in K̃, n × n in N/m.
    settled: SymMatrix,
    /// Modes, if the share is one of modes.
    modes: Vec<OwnMode>,
}

#[derive(Debug, Clone)]
struct OwnMode {
    /// M φ with φᵀ M φ = 1.
    row: Vec<f64>,
    /// ω² in rad²/s².
    square: f64,
    lambda: Lambda,
}

impl Apart {
    /// Elements: k0_e b_e b_eᵀ (n × n, N/m) and λ_e of each.
    #[must_use]
    pub fn elements(dofs: usize, elements: &[(SymMatrix, Lambda)]) -> Self {
        let none = || SymMatrix::zeros(dofs);
        let sum = |weight: fn(Lambda) -> f64| {
            elements.iter().fold(none(), |sum, (stiffness, lambda)| {
                sum.plus(weight(*lambda), stiffness)
            })
        };
        Self {
            stiffness: sum(|_| 1.0),
            settled: sum(Lambda::inverse),
            modes: Vec::new(),
        }
    }

    /// The lowest modes of (K0, M), as many as there are values; values beyond the last mode have no effect.
    #[must_use]
    pub fn modes(modes: &Modes, mass: &SymMatrix, lambdas: &[Lambda]) -> Self {
        let n = mass.n();
        let shapes = modes.frequencies.iter().zip(modes.shapes.column_iter());
        let own: Vec<OwnMode> = shapes
            .zip(lambdas)
            .map(|((frequency, shape), &lambda)| {
                let mut row = vec![0.0; n];
                let minus: Vec<f64> = shape.iter().map(|value| -value).collect();
                mass.subtract_product(&minus, &mut row);
                OwnMode {
                    row,
                    square: frequency * frequency,
                    lambda,
                }
            })
            .collect();
        let sum = |weight: fn(Lambda) -> f64| {
            let entry = |i: usize, j: usize| {
                let each = own.iter();
                each.map(|mode| weight(mode.lambda) * mode.square * mode.row[i] * mode.row[j])
                    .sum::<f64>()
            };
            let upper = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
            SymMatrix::from_triplets(n, upper.map(|(i, j)| (i, j, entry(i, j))))
        };
        Self {
            stiffness: sum(|_| 1.0),
            settled: sum(Lambda::inverse),
            modes: own,
        }
    }

    /// What stands in K̃ for the share, n × n in N/m.
    #[must_use]
    pub fn settled(&self) -> &SymMatrix {
        &self.settled
    }

    /// What of K0 follows λ: K0 without the share.
    #[must_use]
    pub fn rest(&self, stiffness: &SymMatrix) -> SymMatrix {
        stiffness.plus(-1.0, &self.stiffness)
    }

    /// K̃ for K0 = `stiffness`.
    #[must_use]
    pub fn weighted(&self, stiffness: &SymMatrix, lambda: Lambda) -> SymMatrix {
        self.settled.plus(lambda.inverse(), &self.rest(stiffness))
    }

    /// True if the share is one of modes.
    #[must_use]
    pub fn is_of_modes(&self) -> bool {
        !self.modes.is_empty()
    }

    /// What the modes add to the factor of M + (Δt/2) C0 + Δt² K0/λ.
    pub(super) fn correction(
        &self,
        factor: &mut Spd,
        dt: f64,
        lambda: Lambda,
    ) -> Option<Correction> {
        let gains = self.modes.iter().map(|mode| {
            let gain = dt * dt * mode.square * (mode.lambda.inverse() - lambda.inverse());
            (mode, gain)
        });
        let changed: Vec<(&OwnMode, f64)> = gains.filter(|(_, gain)| *gain != 0.0).collect();
        let solved: Vec<Vec<f64>> = changed
            .iter()
            .map(|(mode, _)| {
                let mut column = mode.row.clone();
                factor.solve_in_place(&mut column);
                column
            })
            .collect();
        let count = changed.len();
        let between = DMatrix::from_fn(count, count, |i, j| {
            let (mode, gain) = changed[i];
            let products = mode.row.iter().zip(&solved[j]);
            let diagonal = if i == j { 1.0 / gain } else { 0.0 };
            diagonal + products.map(|(a, b)| a * b).sum::<f64>()
        });
        let between = between.try_inverse()?;
        let n = factor.n();
        let columns = (0..count).map(|j| {
            let entry = |row: usize| (0..count).map(|i| solved[i][row] * between[(i, j)]).sum();
            (0..n).map(entry).collect()
        });
        Some(Correction {
            rows: changed.iter().map(|(mode, _)| mode.row.clone()).collect(),
            columns: columns.collect(),
            sums: vec![0.0; count],
        })
    }
}

/// (B + U D Uᵀ)⁻¹ r = y − V (Uᵀ y) with y = B⁻¹ r and V = B⁻¹ U (D⁻¹ + Uᵀ B⁻¹ U)⁻¹: two products per mode.
#[derive(Debug)]
pub(super) struct Correction {
    rows: Vec<Vec<f64>>,
    columns: Vec<Vec<f64>>,
    sums: Vec<f64>,
}

impl Correction {
    /// y ← (B + U D Uᵀ)⁻¹ r from y = B⁻¹ r. Real-time: yes.
    pub(super) fn apply(&mut self, solved: &mut [f64]) {
        for (sum, row) in self.sums.iter_mut().zip(&self.rows) {
            *sum = row.iter().zip(solved.iter()).map(|(a, b)| a * b).sum();
        }
        for (sum, column) in self.sums.iter().zip(&self.columns) {
            for (y, v) in solved.iter_mut().zip(column) {
                *y -= sum * v;
            }
        }
    }
}
