//! Eigenvalues of a small real matrix.

use nalgebra::{DMatrix, Schur};

use super::Pole;

/// Sweeps per row after which the iteration counts as stuck.
const SWEEPS: usize = 300;

/// All eigenvalues; none if the iteration does not end or an entry is not finite.
#[must_use]
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Pole>> {
    if matrix.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let schur = Schur::try_new(matrix.clone(), f64::EPSILON, SWEEPS * matrix.nrows().max(1))?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}

/// Largest modulus of an eigenvalue; none as for [`eigenvalues`].
#[must_use]
pub fn spectral_radius(matrix: &DMatrix<f64>) -> Option<f64> {
    let all = eigenvalues(matrix)?;
    Some(all.iter().map(|z| z.norm()).fold(0.0, f64::max))
}
