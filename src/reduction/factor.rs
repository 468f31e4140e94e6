//! Factor of a large sparse matrix: nested dissection, then blocks of columns by faer.
//!
//! Small matrices go to [`Spd`], whose bits are the same on every processor. The blocks of a large one use the vector width of the
//! processor: equal input gives equal bits on processors of one kind.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use gusset_numerics::linalg::{NotPositiveDefinite, Spd, SymMatrix, nested_dissection};
use nalgebra::DMatrix;

/// Largest matrix for [`Spd`].
const SMALL: usize = 3000;

/// A pivot below this part of its diagonal entry is roundoff.
const ROUNDOFF: f64 = 1e-13;

/// The factor of a positive definite matrix.
pub(crate) enum Factor {
    Small(Box<Spd>),
    Large(Box<SymbolicCholesky<usize>>, Vec<f64>),
}

impl Factor {
    pub(crate) fn new(matrix: &SymMatrix) -> Result<Self, NotPositiveDefinite> {
        if matrix.n() <= SMALL || matrix.half_bandwidth() <= 1 {
            return Spd::factor(matrix).map(|factor| Self::Small(Box::new(factor)));
        }
        let n = matrix.n();
        let failed = |dof, pivot| NotPositiveDefinite { dof, pivot };
        let old: Vec<usize> = nested_dissection(matrix)
            .into_iter()
            .map(|old| old as usize)
            .collect();
        let mut new = vec![0; n];
        for (at, &old) in old.iter().enumerate() {
            new[old] = at;
        }
        let mut column_start = vec![0];
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for column in 0..n {
            let upper = matrix.row(column).take_while(|(row, _)| *row <= column);
            for (row, value) in upper {
                rows.push(row);
                values.push(value);
            }
            column_start.push(rows.len());
        }
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &column_start, None, &rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let order = SymmetricOrdering::Custom(PermRef::new_checked(&old, &new, n));
        // Fails only for want of memory or index range.
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Upper, order, params)
            .map_err(|_| failed(0, f64::NAN))?;
        let mut factor = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let made = symbolic.factorize_numeric_llt(
            &mut factor,
            SparseColMatRef::new(pattern, &values[..]),
            Side::Upper,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        );
        if let Err(LltError::NonPositivePivot { index }) = made {
            let dof = old.get(index).copied().unwrap_or(0);
            return Err(failed(dof, f64::NAN));
        }
        if let SymbolicCholeskyRaw::Supernodal(blocks) = symbolic.raw() {
            let ends = blocks.supernode_begin().iter().zip(blocks.supernode_end());
            for (block, (&begin, &end)) in ends.enumerate() {
                let height = end - begin + blocks.supernode(block).pattern().len();
                let first = blocks.col_ptr_for_val()[block];
                for (column, &dof) in old[begin..end].iter().enumerate() {
                    let pivot = factor[first + column * (height + 1)].powi(2);
                    if pivot <= ROUNDOFF * matrix.get(dof, dof) {
                        return Err(failed(dof, pivot));
                    }
                }
            }
        }
        Ok(Self::Large(Box::new(symbolic), factor))
    }

    /// X ← A⁻¹ X.
    pub(crate) fn solve(&mut self, columns: &mut DMatrix<f64>) {
        match self {
            Self::Small(factor) => {
                for mut column in columns.column_iter_mut() {
                    factor.solve_in_place(column.as_mut_slice());
                }
            }
            Self::Large(symbolic, values) => {
                let (rows, count) = columns.shape();
                let scratch = symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
                LltRef::new(symbolic, &values[..]).solve_in_place_with_conj(
                    Conj::No,
                    MatMut::from_column_major_slice_mut(columns.as_mut_slice(), rows, count),
                    Par::Seq,
                    MemStack::new(&mut MemBuffer::new(scratch)),
                );
            }
        }
    }
}
