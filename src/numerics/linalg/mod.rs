//! Symmetric matrices and their factors.
//!
//! [`SymMatrix`] holds M, C, K; [`Spd`] is the factor of a symmetric positive definite matrix that picks its own
//! storage once and then solves on the real-time path. The invariant: a solve allocates nothing and its order of
//! operations depends on the matrix only, never on the processor, so equal inputs give equal bits. General
//! (asymmetric, complex, rectangular) algebra is not done here.
//!
//! ```
//! use gusset_numerics::linalg::{Spd, Storage, SymMatrix};
//!
//! let chain = SymMatrix::from_triplets(3, [(0, 0, 2.0), (1, 1, 2.0), (2, 2, 1.0), (0, 1, -1.0), (1, 2, -1.0)]);
//! let mut factor = Spd::factor(&chain)?;
//! assert_eq!(factor.storage(), Storage::Tridiagonal);
//! let mut x = [0.0, 0.0, 1.0];
//! factor.solve_in_place(&mut x);
//! assert!((x[2] - 3.0).abs() < 1e-15);
//! # Ok::<(), gusset_numerics::linalg::NotPositiveDefinite>(())
//! ```

mod aligned;
mod banded;
mod checked;
mod condensation;
mod condition;
mod dense;
mod dissection;
mod eigen;
pub(crate) mod lanes;
mod matrix;
mod ordering;
mod panels;
mod partitioned;
mod products;
mod sparse;
mod tridiagonal;

use std::fmt;
use std::ops::Range;

use thiserror::Error;

pub use aligned::Aligned;
pub(crate) use banded::Banded;
pub use checked::MatrixError;
pub use condensation::Condensation;
pub use dissection::nested_dissection;
pub(crate) use eigen::LARGEST_DENSE;
pub use eigen::{EigenError, Modes, frequencies, highest_frequency, lowest_modes, modes};
pub use lanes::Lanes;
pub use matrix::SymMatrix;

/// A pivot that is not positive: the matrix has a direction without, or with negative, stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("not positive definite: pivot {pivot:e} at degree of freedom {}", dof + 1)]
pub struct NotPositiveDefinite {
    /// Degree of freedom of the pivot, from 0, in the numbering of the matrix that was given.
    pub dof: usize,
    /// The pivot: zero or negative (to roundoff), or not finite.
    pub pivot: f64,
}

/// How a factor is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Storage {
    /// Nothing off the diagonal.
    Diagonal,
    /// LDLᵀ of a short chain, eliminated from both ends at once.
    Tridiagonal,
    /// LDLᵀ of a long chain in segments that are eliminated side by side.
    Partitioned,
    /// LDLᵀ within a band, after reverse Cuthill–McKee where that narrows it.
    Banded,
    /// Dense Cholesky.
    Dense,
    /// Sparse LDLᵀ after nested dissection or approximate minimum degree.
    Sparse,
}

impl fmt::Display for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Storage::Diagonal => "diagonal",
            Storage::Tridiagonal => "tridiagonal",
            Storage::Partitioned => "tridiagonal, in segments",
            Storage::Banded => "banded",
            Storage::Dense => "dense",
            Storage::Sparse => "sparse",
        })
    }
}

/// The factor of a symmetric positive definite matrix, made once, solved with every step.
#[derive(Debug)]
pub struct Spd {
    n: usize,
    factor: Factor,
}

#[derive(Debug)]
enum Factor {
    Diagonal(Vec<f64>),
    Tridiagonal(tridiagonal::Tridiagonal),
    Partitioned(partitioned::Partitioned),
    Banded(banded::Banded),
    Dense(dense::Dense),
    Sparse(sparse::Sparse),
}

impl Spd {
    /// Factors `matrix` in the storage that makes a solve cheapest.
    ///
    /// # Errors
    /// [`NotPositiveDefinite`] with the degree of freedom at which elimination failed. Pivots below roundoff of
    /// their own diagonal entry count as failed.
    pub fn factor(matrix: &SymMatrix) -> Result<Self, NotPositiveDefinite> {
        let n = matrix.n();
        if matrix.is_diagonal() {
            return Self::factor_as(matrix, Storage::Diagonal);
        }
        if matrix.half_bandwidth() <= 1 {
            let storage = if n < SMALLEST_PARTITIONED {
                Storage::Tridiagonal
            } else {
                Storage::Partitioned
            };
            return Self::factor_as(matrix, storage);
        }
        // Cost of one solve in ns, fitted on a 2.5 GHz machine; only the ranking matters.
        let order = ordering::narrowest(matrix);
        let banded_cost = n as f64 * (order.half_bandwidth as f64 + 1.0) + 6.0 * n as f64;
        let dense_cost = if n <= LARGEST_DENSE_FACTOR {
            0.5 * (n * n) as f64 + 8.0 * n as f64
        } else {
            f64::INFINITY
        };
        if n > SMALLEST_SPARSE {
            let pattern = sparse::Pattern::new(matrix);
            let sparse_cost = 2.4 * pattern.nonzeros() as f64 + 10.0 * n as f64;
            if sparse_cost < banded_cost.min(dense_cost) {
                let factor = Factor::Sparse(sparse::Sparse::factor(matrix, pattern)?);
                return Ok(Self { n, factor });
            }
        }
        let factor = if dense_cost <= banded_cost {
            Factor::Dense(dense::Dense::factor(matrix)?)
        } else {
            Factor::Banded(banded::Banded::factor(matrix, order)?)
        };
        Ok(Self { n, factor })
    }

    /// Factors `matrix` in a storage of the caller's choice, for comparisons. A matrix that does not fit into
    /// [`Storage::Diagonal`], [`Storage::Tridiagonal`] or [`Storage::Partitioned`] is factored as banded.
    ///
    /// # Errors
    /// As [`Spd::factor`].
    pub(crate) fn factor_as(
        matrix: &SymMatrix,
        storage: Storage,
    ) -> Result<Self, NotPositiveDefinite> {
        let factor = match storage {
            Storage::Diagonal if matrix.is_diagonal() => {
                let diagonal: Vec<f64> = (0..matrix.n()).map(|i| matrix.get(i, i)).collect();
                for (dof, &pivot) in diagonal.iter().enumerate() {
                    check_pivot(dof, pivot, pivot)?;
                }
                Factor::Diagonal(diagonal)
            }
            Storage::Tridiagonal if matrix.half_bandwidth() <= 1 => {
                Factor::Tridiagonal(tridiagonal::Tridiagonal::factor(matrix)?)
            }
            Storage::Partitioned if matrix.half_bandwidth() <= 1 => {
                Factor::Partitioned(partitioned::Partitioned::factor(matrix)?)
            }
            Storage::Dense => Factor::Dense(dense::Dense::factor(matrix)?),
            Storage::Sparse => Factor::Sparse(sparse::Sparse::factor(
                matrix,
                sparse::Pattern::new(matrix),
            )?),
            Storage::Diagonal | Storage::Tridiagonal | Storage::Partitioned | Storage::Banded => {
                Factor::Banded(banded::Banded::factor(matrix, ordering::narrowest(matrix))?)
            }
        };
        Ok(Self {
            n: matrix.n(),
            factor,
        })
    }

    /// Number of unknowns.
    #[must_use]
    pub(crate) fn n(&self) -> usize {
        self.n
    }

    /// The storage that was picked.
    #[must_use]
    pub fn storage(&self) -> Storage {
        match self.factor {
            Factor::Diagonal(_) => Storage::Diagonal,
            Factor::Tridiagonal(_) => Storage::Tridiagonal,
            Factor::Partitioned(_) => Storage::Partitioned,
            Factor::Banded(_) => Storage::Banded,
            Factor::Dense(_) => Storage::Dense,
            Factor::Sparse(_) => Storage::Sparse,
        }
    }

    /// x ← A⁻¹ x. `x` has [`Spd::n`] entries. Equal inputs give equal bits. Real-time: yes.
    #[inline]
    pub fn solve_in_place(&mut self, x: &mut [f64]) {
        debug_assert_eq!(x.len(), self.n);
        match &mut self.factor {
            Factor::Diagonal(diagonal) => {
                for (x, d) in x.iter_mut().zip(diagonal) {
                    *x /= *d;
                }
            }
            Factor::Tridiagonal(factor) => factor.solve_in_place(x),
            Factor::Partitioned(factor) => factor.solve_in_place(x),
            Factor::Banded(factor) => factor.solve_in_place(x),
            Factor::Dense(factor) => factor.solve_in_place(x),
            Factor::Sparse(factor) => factor.solve_in_place(x),
        }
    }

    /// x ← A⁻¹ b, both with [`Spd::n`] entries; the same bits as [`Spd::solve_in_place`]. `done` gets each run of rows
    /// once, in ascending order, as soon as its solution is known and still in the cache. Further work on the solution
    /// row by row is best done there. Real-time: yes, if `done` is.
    #[inline]
    pub(crate) fn solve_into(
        &mut self,
        rhs: &[f64],
        x: &mut [f64],
        done: impl FnMut(Range<usize>, &[f64]),
    ) {
        debug_assert_eq!((rhs.len(), x.len()), (self.n, self.n));
        self.solve_rows(&mut Apart(rhs, x, done));
    }

    /// [`Spd::solve_into`] where the right-hand side is only made when it is requested; see [`Rows`]. Real-time: yes, if `vectors` is.
    #[inline]
    pub(crate) fn solve_rows(&mut self, vectors: &mut impl Rows) {
        if let Factor::Partitioned(factor) = &mut self.factor {
            factor.solve(vectors);
            return;
        }
        let n = self.n;
        vectors.start(n);
        self.solve_in_place(vectors.solution(0..n));
        vectors.solved(0..n);
    }

    /// Rows after which [`Spd::solve_rows`] may hand solutions over: when the right-hand side of a row is requested, the
    /// solutions of all rows that lie further above it may be known.
    #[must_use]
    pub(crate) fn rows_at_a_time(&self) -> usize {
        match &self.factor {
            Factor::Partitioned(factor) => factor.rows_at_a_time(),
            _ => self.n,
        }
    }

    /// Chooses the instructions of block arithmetic, for comparisons: the fastest are chosen anyway, and the bits are
    /// the same with all of them.
    #[cfg(any(test, feature = "test-doubles"))]
    pub(crate) fn set_lanes(&mut self, lanes: Lanes) {
        match &mut self.factor {
            Factor::Partitioned(factor) => factor.set_lanes(lanes),
            Factor::Sparse(factor) => factor.set_lanes(lanes),
            _ => {}
        }
    }

    /// Bytes of the factor that one solve reads.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.factor {
            Factor::Diagonal(diagonal) => size_of_val(&diagonal[..]),
            Factor::Tridiagonal(factor) => factor.bytes(),
            Factor::Partitioned(factor) => factor.bytes(),
            Factor::Banded(factor) => factor.bytes(),
            Factor::Dense(factor) => factor.bytes(),
            Factor::Sparse(factor) => factor.bytes(),
        }
    }
}

/// Right-hand side and solution of [`Spd::solve_rows`]. Rows are requested in ascending order, each once, first their
/// right-hand side, then the place of their solution.
pub trait Rows {
    /// The right-hand side of these rows.
    fn rhs(&mut self, rows: Range<usize>) -> &[f64];

    /// Where the solution of these rows is written.
    fn solution(&mut self, rows: Range<usize>) -> &mut [f64];

    /// The solution of these rows is complete. Nothing is done by default.
    fn solved(&mut self, rows: Range<usize>) {
        let _ = rows;
    }

    /// In place of all that, where the factor does not work in blocks: the right-hand side of all `n` rows is copied to
    /// where the solution is written.
    fn start(&mut self, n: usize);
}

/// Right-hand side, solution, and the function that receives it.
struct Apart<'a, F>(&'a [f64], &'a mut [f64], F);

impl<F: FnMut(Range<usize>, &[f64])> Rows for Apart<'_, F> {
    fn rhs(&mut self, rows: Range<usize>) -> &[f64] {
        self.0.get(rows).unwrap_or_default()
    }

    fn solution(&mut self, rows: Range<usize>) -> &mut [f64] {
        self.1.get_mut(rows).unwrap_or_default()
    }

    fn solved(&mut self, rows: Range<usize>) {
        if let Some(values) = self.1.get(rows.clone()) {
            (self.2)(rows, values);
        }
    }

    fn start(&mut self, _n: usize) {
        for (x, b) in self.1.iter_mut().zip(self.0) {
            *x = *b;
        }
    }
}

/// Smallest n for which segments are worth their interfaces: below it two halves are as fast.
const SMALLEST_PARTITIONED: usize = 96;

/// Largest n for which a dense factor is considered: beyond it the factor leaves the caches.
const LARGEST_DENSE_FACTOR: usize = 600;

/// Smallest n for which a sparse factor is considered: below it the others always win.
const SMALLEST_SPARSE: usize = 64;

/// A pivot is accepted if it exceeds the roundoff of the diagonal entry it came from; NaN never does.
fn check_pivot(dof: usize, pivot: f64, diagonal: f64) -> Result<(), NotPositiveDefinite> {
    if pivot > 8.0 * f64::EPSILON * diagonal.abs() && pivot.is_finite() {
        Ok(())
    } else {
        Err(NotPositiveDefinite { dof, pivot })
    }
}

/// Σ aᵢ bᵢ in four interleaved sums, always in the same order. Real-time: yes.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a_blocks, a_rest) = a.as_chunks::<4>();
    let (b_blocks, b_rest) = b.as_chunks::<4>();
    for (a, b) in a_blocks.iter().zip(b_blocks) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let mut rest = 0.0;
    for (a, b) in a_rest.iter().zip(b_rest) {
        rest += a * b;
    }
    ((sums[0] + sums[1]) + (sums[2] + sums[3])) + rest
}

#[cfg(test)]
mod tests;
