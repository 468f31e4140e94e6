//! Products with rows of small matrices. Real-time: yes.

/// A row times a vector.
#[inline]
pub(super) fn product(row: &[f64], vector: impl Iterator<Item = f64>) -> f64 {
    row.iter().zip(vector).map(|(a, b)| a * b).sum()
}

/// A row of a matrix of `n` columns, in rows one behind the other, times a vector; not a number if there is no such row.
#[inline]
pub(super) fn row_times(
    matrix: &[f64],
    row: usize,
    n: usize,
    vector: impl Iterator<Item = f64>,
) -> f64 {
    let row = matrix.get(row * n..(row + 1) * n);
    row.map_or(f64::NAN, |row| product(row, vector))
}
