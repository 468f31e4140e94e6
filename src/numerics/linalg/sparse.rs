//! Sparse LDLᵀ: factorisation by faer, numbering and triangular sweeps our own.
//!
//! faer's simplicial factorisation is scalar arithmetic in a fixed order. Its supernodal one picks vector width
//! and fused multiply-add by processor, which would break the promise of equal bits on every machine, so it is
//! not used. The factor is copied into [`Panels`]: a solve is bound by the memory it touches. Of nested dissection
//! and faer's approximate minimum degree the numbering with the smaller factor is taken. Nothing else that a test
//! computes with names faer.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Par, Side};

#[cfg(any(test, feature = "test-doubles"))]
use super::Lanes;
use super::dissection::nested_dissection;
use super::panels::{Columns, Panels};
use super::{NotPositiveDefinite, SymMatrix, check_pivot};

/// Where the factor has entries.
#[derive(Debug)]
pub(super) struct Pattern {
    symbolic: Option<SymbolicCholesky<usize>>,
    /// Upper triangle by columns.
    column_start: Vec<usize>,
    rows: Vec<usize>,
}

impl Pattern {
    pub(super) fn new(matrix: &SymMatrix) -> Self {
        let n = matrix.n();
        let mut column_start = vec![0];
        let mut rows = Vec::new();
        for column in 0..n {
            // By symmetry, row `column` up to its diagonal is that column of the upper triangle.
            rows.extend(matrix.row(column).map(|(i, _)| i).filter(|&i| i < column));
            rows.push(column);
            column_start.push(rows.len());
        }
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &column_start, None, &rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..Default::default()
        };
        // Fails only for want of memory or index range; then the caller sees "too expensive" and goes without.
        let by_degree =
            factorize_symbolic_cholesky(pattern, Side::Upper, SymmetricOrdering::Amd, params).ok();
        let old: Vec<usize> = nested_dissection(matrix)
            .into_iter()
            .map(|old| old as usize)
            .collect();
        let mut new = vec![0; n];
        for (at, &old) in old.iter().enumerate() {
            new[old] = at;
        }
        let order = SymmetricOrdering::Custom(PermRef::new_checked(&old, &new, n));
        let by_cuts = factorize_symbolic_cholesky(pattern, Side::Upper, order, params).ok();
        let symbolic = [by_degree, by_cuts]
            .into_iter()
            .flatten()
            .min_by_key(SymbolicCholesky::len_val);
        Self {
            symbolic,
            column_start,
            rows,
        }
    }

    /// Entries of L, the diagonal included.
    pub(super) fn nonzeros(&self) -> usize {
        self.symbolic
            .as_ref()
            .map_or(usize::MAX, SymbolicCholesky::len_val)
    }
}

/// LDLᵀ in its own numbering.
#[derive(Debug)]
pub(super) struct Sparse {
    /// User's index of each new index.
    old_of_new: Vec<u32>,
    lower: Panels,
    inverse_pivots: Vec<f64>,
    work: Vec<f64>,
}

impl Sparse {
    pub(super) fn factor(
        matrix: &SymMatrix,
        pattern: Pattern,
    ) -> Result<Self, NotPositiveDefinite> {
        let n = matrix.n();
        let failed = |dof| NotPositiveDefinite {
            dof,
            pivot: f64::NAN,
        };
        let symbolic = pattern.symbolic.as_ref().ok_or(failed(0))?;
        let old_of_new: Vec<u32> = match symbolic.perm() {
            Some(perm) => perm.arrays().0.iter().map(|&old| old as u32).collect(),
            None => (0..n as u32).collect(),
        };
        let values: Vec<f64> = (0..n)
            .flat_map(|column| {
                let rows =
                    &pattern.rows[pattern.column_start[column]..pattern.column_start[column + 1]];
                rows.iter().map(move |&i| matrix.get(i, column))
            })
            .collect();
        let upper = SparseColMatRef::new(
            SymbolicSparseColMatRef::new_checked(n, n, &pattern.column_start, None, &pattern.rows),
            &values[..],
        );
        let mut factor = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        let mut buffer = MemBuffer::new(scratch);
        let stopped = symbolic
            .factorize_numeric_ldlt(
                &mut factor,
                upper,
                Side::Upper,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut buffer),
                Default::default(),
            )
            .is_err();
        let SymbolicCholeskyRaw::Simplicial(raw) = symbolic.raw() else {
            return Err(failed(0)); // excluded by FORCE_SIMPLICIAL
        };
        let mut column_start = vec![0];
        let (mut rows, mut lower) = (Vec::new(), Vec::new());
        let mut inverse_pivots = Vec::with_capacity(n);
        for (range, &dof) in raw.col_ptr().windows(2).zip(&old_of_new) {
            let range = range[0]..range[1];
            // The diagonal comes first. faer leaves the pivot that stopped it, and all after it, at zero; it goes
            // on over negative ones, which we do not.
            let pivot = factor[range.start];
            let dof = dof as usize;
            check_pivot(dof, pivot, matrix.get(dof, dof))?;
            inverse_pivots.push(1.0 / pivot);
            rows.extend(
                raw.row_idx()[range.start + 1..range.end]
                    .iter()
                    .map(|&i| i as u32),
            );
            lower.extend_from_slice(&factor[range.start + 1..range.end]);
            column_start.push(rows.len());
        }
        if stopped {
            return Err(failed(0)); // not reachable while a stopped factorisation leaves a zero pivot
        }
        let lower = Panels::new(&Columns {
            start: &column_start,
            rows: &rows,
            values: &lower,
        });
        Ok(Self {
            old_of_new,
            lower,
            inverse_pivots,
            work: vec![0.0; n],
        })
    }

    pub(super) fn bytes(&self) -> usize {
        self.lower.bytes() + size_of_val(&self.inverse_pivots[..])
    }

    #[cfg(any(test, feature = "test-doubles"))]
    pub(super) fn set_lanes(&mut self, lanes: Lanes) {
        self.lower.set_lanes(lanes);
    }

    /// x ← A⁻¹ x. Real-time: yes. Row numbers lie below n by construction.
    pub(super) fn solve_in_place(&mut self, x: &mut [f64]) {
        for (y, &old) in self.work.iter_mut().zip(&self.old_of_new) {
            *y = x[old as usize];
        }
        self.lower
            .solve_in_place(&self.inverse_pivots, &mut self.work);
        for (y, &old) in self.work.iter().zip(&self.old_of_new) {
            x[old as usize] = *y;
        }
    }
}
