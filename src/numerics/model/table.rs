//! A matrix as read from a file: its size and its entries that are not zero.

use crate::linalg::{MatrixError, SymMatrix};

/// Most rows or columns that a file may claim.
pub(super) const LARGEST_SIDE: usize = 1_000_000;

/// A rectangular matrix of numbers as read; entries count from 0, each place at most once for `.csv` and `.npy`.
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixTable {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Non-zero entries (row, column, value); entries of the same place add up.
    pub entries: Vec<(usize, usize, f64)>,
}

impl MatrixTable {
    /// As a symmetric matrix.
    ///
    /// # Errors
    /// Not square, not finite, not symmetric.
    pub(crate) fn to_symmetric(&self) -> Result<SymMatrix, MatrixError> {
        SymMatrix::from_entries(self.rows, self.columns, self.entries.iter().copied())
    }

    /// As a dense matrix.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn to_dense(&self) -> nalgebra::DMatrix<f64> {
        let mut dense = nalgebra::DMatrix::zeros(self.rows, self.columns);
        for &(i, j, value) in &self.entries {
            dense[(i, j)] += value;
        }
        dense
    }
}
