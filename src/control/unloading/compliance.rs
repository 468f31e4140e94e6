//! The stiffness of a few axes and its inverse, in rows one behind the other.

use nalgebra::DMatrix;

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
