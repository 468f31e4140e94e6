//! The stiffness of a few axes and its inverse, in rows one behind the other.

use nalgebra::{DMatrix, SymmetricEigen};

/// Beside the stiffest direction, so much is no stiffness.
const NONE: f64 = 1e-9;

/// A stiffness and its inverse.
#[derive(Debug)]
pub(super) struct Elasticity {
    /// By rows; where they do not say what the inverse is, without what is beside the diagonal.
    pub stiffness: Vec<f64>,
    /// The inverse does not move in a direction that has no stiffness.
    pub compliance: Vec<f64>,
}

impl Elasticity {
    /// Inverts a stiffness of `n` axes, by rows.
    pub(crate) fn new(stiffness: Vec<f64>, n: usize) -> Self {
        let (stiffness, compliance) = compliance(stiffness, n);
        Self {
            stiffness,
            compliance,
        }
    }
}

/// A stiffness and its inverse, which does not move in a direction that has no stiffness: one of more actuators than a platform has
/// coordinates, say. Where a direction would give way, both go without what is beside the diagonal.
fn compliance(stiffness: Vec<f64>, n: usize) -> (Vec<f64>, Vec<f64>) {
    let matrix = DMatrix::from_row_iterator(n, n, stiffness.iter().copied());
    let symmetric = 0.5 * (&matrix + matrix.transpose());
    let is_finite = symmetric.iter().all(|entry| entry.is_finite());
    let modes = is_finite.then(|| SymmetricEigen::new(symmetric));
    let modes = modes.filter(|modes| {
        let [least, most] = [modes.eigenvalues.min(), modes.eigenvalues.max()];
        least >= -NONE * most
    });
    if let Some(SymmetricEigen {
        eigenvalues,
        eigenvectors,
    }) = modes
    {
        let least = NONE * eigenvalues.max();
        let inverse = eigenvalues.map(|stiffness| {
            if stiffness > least {
                1.0 / stiffness
            } else {
                0.0
            }
        });
        let inverse = &eigenvectors * DMatrix::from_diagonal(&inverse) * eigenvectors.transpose();
        // Symmetric: by columns as by rows.
        return (stiffness, inverse.as_slice().to_vec());
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
