//! Whether matrices make a structure, and where the base pulls at it.

use super::{Acceleration, ModelError};
use crate::linalg::{MatrixError, SymMatrix};

/// Largest size of an entry: its square is far inside the range of a double, with room for 1/Δt² and sums.
const LARGEST_ENTRY: f64 = 1e140;

/// Checks mass, damping and stiffness (n × n) and the influence vector (n) of a structure.
///
/// # Errors
/// See [`ModelError`].
pub(super) fn check(
    matrices: [(&'static str, &SymMatrix); 3],
    influence: &[f64],
) -> Result<(), ModelError> {
    let [(_, mass), ..] = matrices;
    let n = mass.n();
    if n == 0 {
        return Err(ModelError::Empty);
    }
    for (what, matrix) in matrices {
        check_matrix(what, matrix, n)?;
    }
    if influence.len() != n {
        return Err(ModelError::Size {
            what: "influence",
            expected: n,
            found: influence.len(),
        });
    }
    for (dof, &found) in influence.iter().enumerate() {
        if !found.is_finite() {
            return Err(ModelError::Influence { dof, found });
        }
    }
    for dof in 0..n {
        let found = mass.get(dof, dof);
        // Entries are finite here.
        if found < 0.0 {
            return Err(ModelError::NegativeMass { dof, found });
        }
    }
    Acceleration::new(mass)
        .map(|_| ())
        .map_err(ModelError::Mass)
}

pub(super) fn check_matrix(
    what: &'static str,
    matrix: &SymMatrix,
    n: usize,
) -> Result<(), ModelError> {
    if matrix.n() != n {
        return Err(ModelError::Size {
            what,
            expected: n,
            found: matrix.n(),
        });
    }
    let is_inside = |value: f64| f64::abs(value) <= LARGEST_ENTRY;
    match matrix.entries().find(|(_, _, value)| !is_inside(*value)) {
        None => Ok(()),
        Some((row, column, found)) => Err(ModelError::Entry {
            what,
            source: if found.is_finite() {
                let limit = LARGEST_ENTRY;
                MatrixError::TooLarge {
                    row,
                    column,
                    found,
                    limit,
                }
            } else {
                MatrixError::NotFinite { row, column, found }
            },
        }),
    }
}

/// Rows of K ι and C ι that exceed the roundoff of their sums.
pub(super) fn tied_to_base(
    stiffness: &SymMatrix,
    damping: &SymMatrix,
    influence: &[f64],
) -> Vec<(usize, f64, f64)> {
    let product = |matrix: &SymMatrix, dof: usize| {
        let (mut sum, mut size) = (0.0, 0.0);
        for (column, value) in matrix.row(dof) {
            let term = value * influence[column];
            sum += term;
            size += f64::abs(term);
        }
        if f64::abs(sum) > 1e-13 * size {
            sum
        } else {
            0.0
        }
    };
    (0..stiffness.n())
        .map(|dof| (dof, product(stiffness, dof), product(damping, dof)))
        .filter(|&(_, k, c)| k != 0.0 || c != 0.0)
        .collect()
}
