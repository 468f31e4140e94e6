//! Eigenvalues of a small real matrix.

use faer::Mat;
use nalgebra::{ComplexField as _, DMatrix, Schur};

use super::Pole;

/// Sweeps per row after which the iteration counts as stuck: two or three suffice if it converges.
const SWEEPS: usize = 30;

/// All eigenvalues; none if the iteration does not end or an entry is not finite.
#[must_use]
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Pole>> {
    if matrix.iter().any(|value| !value.is_finite()) {
        return None;
    }
    by_double_shifts(matrix).or_else(|| by_exceptional_shifts(matrix))
}

/// By shifts from the matrix itself: equal bits on every processor. The iteration stalls on a matrix that such a shift
/// leaves unchanged, such as a cyclic permutation or the history of several axes that are alike.
fn by_double_shifts(matrix: &DMatrix<f64>) -> Option<Vec<Pole>> {
    let schur = Schur::try_new(matrix.clone(), f64::EPSILON, SWEEPS * matrix.nrows().max(1))?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}

/// By these shifts, with an exceptional shift wherever they stall; the last bits may depend on the processor.
fn by_exceptional_shifts(matrix: &DMatrix<f64>) -> Option<Vec<Pole>> {
    let size = matrix.amax();
    if size == 0.0 {
        return Some(vec![Pole::default(); matrix.nrows()]);
    }
    let (rows, columns) = matrix.shape();
    let scaled = Mat::from_fn(rows, columns, |i, j| matrix[(i, j)] / size);
    let all = scaled.eigenvalues().ok()?;
    Some(
        all.iter()
            .map(|z| Pole::new(size * z.re, size * z.im))
            .collect(),
    )
}

/// Largest modulus of an eigenvalue; none as for [`eigenvalues`].
#[must_use]
pub fn spectral_radius(matrix: &DMatrix<f64>) -> Option<f64> {
    let all = eigenvalues(matrix)?;
    Some(all.iter().map(|z| z.modulus()).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests;
