//! Dense Cholesky, for small or full matrices.

use nalgebra::{Cholesky, DMatrix, DVectorViewMut, Dyn};

use super::{NotPositiveDefinite, SymMatrix, check_pivot};

/// L of A = L Lᵀ.
#[derive(Debug)]
pub(super) struct Dense {
    cholesky: Cholesky<f64, Dyn>,
}

impl Dense {
    pub(super) fn factor(matrix: &SymMatrix) -> Result<Self, NotPositiveDefinite> {
        let dense = matrix.to_dense();
        let Some(cholesky) = Cholesky::new(dense.clone()) else {
            return Err(first_bad_pivot(dense));
        };
        for (dof, l) in cholesky.l_dirty().diagonal().iter().enumerate() {
            check_pivot(dof, l * l, dense[(dof, dof)])?;
        }
        Ok(Self { cholesky })
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.cholesky.l_dirty().as_slice())
    }

    /// x ← A⁻¹ x. Real-time: yes.
    pub(super) fn solve_in_place(&self, x: &mut [f64]) {
        let n = x.len();
        self.cholesky
            .solve_mut(&mut DVectorViewMut::from_slice(x, n));
    }
}

/// The library says only that it failed; elimination by hand says where.
fn first_bad_pivot(mut a: DMatrix<f64>) -> NotPositiveDefinite {
    let n = a.nrows();
    let diagonal: Vec<f64> = a.diagonal().iter().copied().collect();
    for k in 0..n {
        let pivot = a[(k, k)];
        if let Err(found) = check_pivot(k, pivot, diagonal[k]) {
            return found;
        }
        for i in k + 1..n {
            let multiplier = a[(i, k)] / pivot;
            for j in k + 1..=i {
                a[(i, j)] -= multiplier * a[(j, k)];
            }
        }
    }
    // Reached only if the two eliminations round to different sides of zero: the smallest pivot is the one.
    let dof = (0..n)
        .min_by(|&i, &j| (a[(i, i)] / diagonal[i]).total_cmp(&(a[(j, j)] / diagonal[j])))
        .unwrap_or(0);
    NotPositiveDefinite {
        dof,
        pivot: a.get((dof, dof)).copied().unwrap_or(0.0),
    }
}
