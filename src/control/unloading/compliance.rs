//! Stiffnesses of a few axes, their inverses and products, in rows one behind the other.

use nalgebra::DMatrix;

/// A row of a matrix of `n` columns times a vector. Real-time: yes.
pub(super) fn row_times(
    matrix: &[f64],
    row: usize,
    n: usize,
    vector: impl Iterator<Item = f64>,
) -> f64 {
    let row = matrix.get(row * n..(row + 1) * n).unwrap_or_default();
    row.iter().zip(vector).map(|(a, b)| a * b).sum()
}

/// A stiffness and its inverse. Where it is not positive definite, both go without what is beside the diagonal, and an axis without
/// a stiffness does not move.
pub(super) fn compliance(stiffness: Vec<f64>, n: usize) -> (Vec<f64>, Vec<f64>) {
    let matrix = DMatrix::from_row_iterator(n, n, stiffness.iter().copied());
    let symmetric = 0.5 * (&matrix + matrix.transpose());
    if let Some(factor) = symmetric.cholesky() {
        // Symmetric: by columns as by rows.
        return (stiffness, factor.inverse().as_slice().to_vec());
    }
    let of_diagonal = |of: fn(f64) -> f64| {
        let diagonal = matrix.diagonal().map(of);
        DMatrix::from_diagonal(&diagonal).as_slice().to_vec()
    };
    let inverse = |stiffness: f64| {
        if stiffness == 0.0 {
            0.0
        } else {
            1.0 / stiffness
        }
    };
    (of_diagonal(|stiffness| stiffness), of_diagonal(inverse))
}
