//! Roots of a loop with its actuators right of the imaginary axis.
//!
//! Each axis j of all specimens behind declared actuators follows its command by H_j. With Z the dynamic stiffness of the
//! whole, B the rows of these axes and Z_e their own dynamic stiffness, the loop is stable if
//! det(I + Z_e diag(H − 1) B Z⁻¹ Bᵀ) has no zero right of the imaginary axis. One axis is the simplest case of it.

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix};

use super::actuator::Follows;
use gusset_numerics::spectral::delay::Delayed;
use gusset_numerics::spectral::unstable_roots;

/// Frequencies that count are below this share of half the rate.
const HIGHEST: f64 = 0.9;

type Matrix = DMatrix<Complex<f64>>;

/// Roots of the loop right of the imaginary axis; none if they cannot be counted. All systems are those of one structure.
pub(super) fn roots(actuated: &[(&Delayed, Follows<'_>)]) -> Option<u32> {
    let (first, follows) = actuated.first()?;
    let highest = HIGHEST * PI / follows.tick;
    let marks = first.marks();
    let systems: Vec<&Delayed> = actuated.iter().map(|(system, _)| *system).collect();
    let rows = stacked(&systems);
    let transposed = rows.transpose();
    let chain = |omega: f64| {
        let whole = whole(first, omega).lu();
        let compliance = &rows * whole.solve(&transposed)?;
        let mut missing = Matrix::zeros(rows.nrows(), rows.nrows());
        let mut start = 0;
        for (system, follows) in actuated {
            let own = dynamic(system, omega);
            let axes = own.nrows();
            for column in 0..axes {
                let lack = follows.at(omega, system, column)? - 1.0;
                for row in 0..axes {
                    missing[(start + row, start + column)] = own[(row, column)] * lack;
                }
            }
            start += axes;
        }
        let chain = Matrix::identity(start, start) + missing * compliance;
        Some(chain.lu().determinant())
    };
    unstable_roots(chain, 1e-2, highest, &marks)
}

/// Z_e of a specimen at iω.
fn dynamic(system: &Delayed, omega: f64) -> Matrix {
    let axes = system.rows.nrows();
    let inertia = omega * omega * system.specimen_mass;
    Matrix::from_fn(axes, axes, |i, j| {
        let mass = if i == j { inertia } else { 0.0 };
        Complex::new(
            system.specimen_stiffness[(i, j)] - mass,
            omega * system.specimen_damping[(i, j)],
        )
    })
}

/// Z of the whole at iω, this specimen included.
fn whole(system: &Delayed, omega: f64) -> Matrix {
    let n = system.mass.nrows();
    let rows = stacked(&[system]);
    let own = Matrix::from_fn(n, n, |i, j| {
        Complex::new(
            system.stiffness[(i, j)] - omega * omega * system.mass[(i, j)],
            omega * system.damping[(i, j)],
        )
    });
    own + rows.transpose() * dynamic(system, omega) * rows
}

/// The rows of all specimens below each other.
fn stacked(systems: &[&Delayed]) -> Matrix {
    let n = systems.first().map_or(0, |system| system.mass.nrows());
    let all = systems.iter().flat_map(|system| system.rows.row_iter());
    let rows: Vec<_> = all.collect();
    Matrix::from_fn(rows.len(), n, |i, j| Complex::new(rows[i][j], 0.0))
}
