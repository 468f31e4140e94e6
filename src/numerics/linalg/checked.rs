//! Symmetric matrices from numbers that somebody else wrote down: square, finite and symmetric, or refused by entry.

use nalgebra::DMatrix;
use thiserror::Error;

use super::SymMatrix;

/// Why numbers do not make a symmetric matrix. Rows and columns count from 0 here and from 1 in the text.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum MatrixError {
    /// Rows and columns differ.
    #[error("must be square, but is {rows} by {columns}")]
    NotSquare {
        /// Number of rows.
        rows: usize,
        /// Number of columns.
        columns: usize,
    },
    /// NaN or infinite.
    #[error("entry ({}, {}) is {found}, but must be finite", row + 1, column + 1)]
    NotFinite {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// The value found.
        found: f64,
    },
    /// Too large: products leave the range of a double.
    #[error(
        "entry ({}, {}) is {found:e}, but must be at most {limit:e}: its products overflow",
        row + 1,
        column + 1
    )]
    TooLarge {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// The value found.
        found: f64,
        /// Largest size that is computed with.
        limit: f64,
    },
    /// An entry and its mirror differ by more than roundoff.
    #[error(
        "must be symmetric, but entry ({i}, {j}) is {here} and entry ({j}, {i}) is {there}",
        i = row + 1,
        j = column + 1
    )]
    Asymmetric {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// Entry (row, column).
        here: f64,
        /// Entry (column, row).
        there: f64,
    },
}

/// Relative difference between an entry and its mirror that still counts as symmetric.
const SYMMETRY_TOLERANCE: f64 = 1e-9;

impl SymMatrix {
    /// A symmetric matrix from entries of both triangles, such as a file holds.
    ///
    /// # Errors
    /// See [`MatrixError`]: not square, not finite, or an entry that differs from its mirror by more than 1e-9
    /// of the larger of both and of √|aᵢᵢ aⱼⱼ|. Smaller differences are averaged away.
    ///
    /// # Panics
    /// If an index is outside of the given size.
    pub(crate) fn from_entries(
        rows: usize,
        columns: usize,
        entries: impl IntoIterator<Item = (usize, usize, f64)>,
    ) -> Result<Self, MatrixError> {
        if rows != columns {
            return Err(MatrixError::NotSquare { rows, columns });
        }
        let n = rows;
        let mut all = Vec::new();
        for (row, column, found) in entries {
            assert!(
                row < n && column < n,
                "entry ({row}, {column}) lies outside of a {n} by {n} matrix"
            );
            if !found.is_finite() {
                return Err(MatrixError::NotFinite { row, column, found });
            }
            all.push((row as u32, column as u32, found));
        }
        let full = Self::assemble(n, all);
        let mut upper = Vec::new();
        for i in 0..n {
            for (j, _) in full.row(i) {
                // Each pair once, also if only one of the two is stored.
                let (row, column) = (i.min(j), i.max(j));
                let (here, there) = (full.get(row, column), full.get(column, row));
                let scale = (full.get(row, row) * full.get(column, column))
                    .abs()
                    .sqrt()
                    .max(here.abs())
                    .max(there.abs());
                if (here - there).abs() > SYMMETRY_TOLERANCE * scale {
                    return Err(MatrixError::Asymmetric {
                        row,
                        column,
                        here,
                        there,
                    });
                }
                if i <= j || here == 0.0 {
                    upper.push((row, column, here / 2.0 + there / 2.0));
                }
            }
        }
        Ok(Self::from_triplets(n, upper))
    }

    /// A symmetric matrix from a dense one; see [`SymMatrix::from_entries`].
    ///
    /// # Errors
    /// See [`SymMatrix::from_entries`].
    pub fn from_dense(matrix: &DMatrix<f64>) -> Result<Self, MatrixError> {
        let (rows, columns) = matrix.shape();
        let entries = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
        Self::from_entries(
            rows,
            columns,
            entries
                .map(|(i, j)| (i, j, matrix[(i, j)]))
                .filter(|&(_, _, value)| value != 0.0),
        )
    }
}
