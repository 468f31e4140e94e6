//! [`SymMatrix`]: a symmetric matrix by rows, both triangles stored, exactly symmetric by construction.
//!
//! Entries that are exactly zero are not stored. Products recognise diagonal and tridiagonal matrices and run
//! over plain arrays then.

use std::ops::Range;

use nalgebra::DMatrix;

use super::Lanes;
use super::products::{Chain, Diagonal, EvenChain};

/// A symmetric n × n matrix in compact rows.
#[derive(Debug, Clone, PartialEq)]
pub struct SymMatrix {
    n: usize,
    /// Start of each row in `columns` and `values`; n + 1 entries.
    row_start: Vec<usize>,
    /// Ascending within a row.
    columns: Vec<u32>,
    values: Vec<f64>,
    shape: Shape,
}

/// Structure that the product may exploit.
#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Zero,
    Diagonal(Vec<f64>),
    Tridiagonal {
        diagonal: Vec<f64>,
        beside: Vec<f64>,
        /// Diagonal and beside of all rows but the first and the last, if they are alike.
        inner: Option<(f64, f64)>,
    },
    General,
}

impl SymMatrix {
    /// The sum of the given entries; each off-diagonal one is given once, (i, j) or (j, i), and mirrored.
    ///
    /// # Panics
    /// If an index is not below `n`.
    #[must_use]
    pub fn from_triplets(n: usize, entries: impl IntoIterator<Item = (usize, usize, f64)>) -> Self {
        let mut both = Vec::new();
        for (i, j, value) in entries {
            assert!(
                i < n && j < n,
                "entry ({i}, {j}) lies outside of a {n} by {n} matrix"
            );
            both.push((i as u32, j as u32, value));
            if i != j {
                both.push((j as u32, i as u32, value));
            }
        }
        Self::assemble(n, both)
    }

    /// A diagonal matrix.
    #[must_use]
    pub fn diagonal(values: &[f64]) -> Self {
        Self::from_triplets(
            values.len(),
            values.iter().enumerate().map(|(i, &value)| (i, i, value)),
        )
    }

    /// The n × n matrix of zeros.
    #[must_use]
    pub fn zeros(n: usize) -> Self {
        Self::assemble(n, Vec::new())
    }

    /// Sorts, sums duplicates in the order given, drops zeros.
    pub(super) fn assemble(n: usize, mut entries: Vec<(u32, u32, f64)>) -> Self {
        entries.sort_by_key(|&(row, column, _)| (row, column));
        entries.dedup_by(|next, kept| {
            let same = (next.0, next.1) == (kept.0, kept.1);
            if same {
                kept.2 += next.2;
            }
            same
        });
        entries.retain(|&(_, _, value)| value != 0.0);
        let mut row_start = vec![0; n + 1];
        for &(row, _, _) in &entries {
            row_start[row as usize + 1] += 1;
        }
        for i in 0..n {
            row_start[i + 1] += row_start[i];
        }
        let columns = entries.iter().map(|&(_, column, _)| column).collect();
        let values = entries.iter().map(|&(_, _, value)| value).collect();
        Self::from_rows(row_start, columns, values)
    }

    /// Takes finished rows and looks at their shape.
    fn from_rows(row_start: Vec<usize>, columns: Vec<u32>, values: Vec<f64>) -> Self {
        let n = row_start.len() - 1;
        let mut matrix = Self {
            n,
            row_start,
            columns,
            values,
            shape: Shape::General,
        };
        matrix.shape = match matrix.half_bandwidth() {
            _ if matrix.values.is_empty() => Shape::Zero,
            0 => Shape::Diagonal((0..n).map(|i| matrix.get(i, i)).collect()),
            1 => {
                let (diagonal, beside) = matrix.chain();
                let inner = even(&diagonal, &beside);
                Shape::Tridiagonal {
                    diagonal,
                    beside,
                    inner,
                }
            }
            _ => Shape::General,
        };
        matrix
    }

    /// Number of rows.
    #[must_use]
    pub fn n(&self) -> usize {
        self.n
    }

    /// Number of stored entries, both triangles.
    #[must_use]
    pub fn stored(&self) -> usize {
        self.values.len()
    }

    /// Entry (i, j), zero where nothing is stored.
    #[must_use]
    pub fn get(&self, i: usize, j: usize) -> f64 {
        if i >= self.n {
            return 0.0;
        }
        let range = self.row_start[i]..self.row_start[i + 1];
        match self.columns[range.clone()].binary_search(&(j as u32)) {
            Ok(k) => self.values[range.start + k],
            Err(_) => 0.0,
        }
    }

    /// Stored entries of row `i` as (column, value), columns ascending.
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.row_start[i]..self.row_start[i + 1];
        let values = self.values[range.clone()].iter().copied();
        self.columns[range]
            .iter()
            .map(|&column| column as usize)
            .zip(values)
    }

    /// Stored entries (i, j, value) of the upper triangle and the diagonal, i ≤ j, each once.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        (0..self.n).flat_map(move |i| {
            self.row(i)
                .filter(move |&(j, _)| i <= j)
                .map(move |(j, value)| (i, j, value))
        })
    }

    /// self + scale · other.
    ///
    /// # Panics
    /// If `other` has another size.
    #[must_use]
    pub fn plus(&self, scale: f64, other: &SymMatrix) -> SymMatrix {
        assert_eq!(self.n, other.n, "sizes of the summands");
        let mut row_start = vec![0];
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        for i in 0..self.n {
            let (mut ours, mut theirs) = (self.row(i).peekable(), other.row(i).peekable());
            loop {
                let (column, value) = match (ours.peek().copied(), theirs.peek().copied()) {
                    (Some((j, a)), Some((k, b))) if j == k => {
                        ours.next();
                        theirs.next();
                        (j, a + scale * b)
                    }
                    (Some((j, a)), other) if other.is_none_or(|(k, _)| j < k) => {
                        ours.next();
                        (j, a)
                    }
                    (_, Some((k, b))) => {
                        theirs.next();
                        (k, scale * b)
                    }
                    (_, None) => break,
                };
                if value != 0.0 {
                    columns.push(column as u32);
                    values.push(value);
                }
            }
            row_start.push(columns.len());
        }
        Self::from_rows(row_start, columns, values)
    }

    /// The block of the rows and columns listed in `kept`, in that order; no index twice.
    #[must_use]
    pub fn block(&self, kept: &[usize]) -> SymMatrix {
        let mut place = vec![usize::MAX; self.n];
        for (new, &old) in kept.iter().enumerate() {
            place[old] = new;
        }
        let inside = self
            .entries()
            .map(|(i, j, value)| (place[i], place[j], value))
            .filter(|&(i, j, _)| i != usize::MAX && j != usize::MAX);
        Self::from_triplets(kept.len(), inside)
    }

    /// Diagonal (n entries) and the entries beside it (n − 1); anything further off is left out.
    pub(super) fn chain(&self) -> (Vec<f64>, Vec<f64>) {
        if let Shape::Tridiagonal {
            diagonal, beside, ..
        } = &self.shape
        {
            return (diagonal.clone(), beside.clone());
        }
        let diagonal = (0..self.n).map(|i| self.get(i, i)).collect();
        let beside = (1..self.n).map(|i| self.get(i - 1, i)).collect();
        (diagonal, beside)
    }

    /// Dense copy.
    #[must_use]
    pub fn to_dense(&self) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(self.n, self.n);
        for i in 0..self.n {
            for (j, value) in self.row(i) {
                dense[(i, j)] = value;
            }
        }
        dense
    }

    /// Largest |i − j| of a stored entry.
    #[must_use]
    pub fn half_bandwidth(&self) -> usize {
        // Columns ascend and the pattern is symmetric: the last entry of each row suffices.
        (0..self.n)
            .filter_map(|i| self.row(i).last().map(|(j, _)| j.saturating_sub(i)))
            .max()
            .unwrap_or(0)
    }

    /// [`SymMatrix::half_bandwidth`] without a search: all rows where the shape does not give it.
    pub(crate) fn reach(&self) -> usize {
        match self.shape {
            Shape::Zero | Shape::Diagonal(_) => 0,
            Shape::Tridiagonal { .. } => 1,
            Shape::General => self.n,
        }
    }

    /// What all inner rows of a chain have on the diagonal and beside it, if they have the same; zeros of a zero matrix.
    pub(crate) fn even(&self) -> Option<(f64, f64)> {
        match self.shape {
            Shape::Zero => Some((0.0, 0.0)),
            Shape::Tridiagonal { inner, .. } => inner,
            Shape::Diagonal(_) | Shape::General => None,
        }
    }

    /// True if nothing is stored off the diagonal.
    #[must_use]
    pub(crate) fn is_diagonal(&self) -> bool {
        self.half_bandwidth() == 0
    }

    /// True if every entry is zero.
    #[inline]
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.values.is_empty()
    }

    /// True if row `i` is all zeros.
    #[must_use]
    pub fn row_is_zero(&self, i: usize) -> bool {
        self.row(i).next().is_none()
    }

    /// out ← out − A x; both slices have n entries. Real-time: yes.
    pub fn subtract_product(&self, x: &[f64], out: &mut [f64]) {
        self.subtract_rows(0..self.n, x, out, Lanes::Portable);
    }

    /// Subtracts the product for some rows only; the slices are whole. The bits do not depend on the lanes.
    /// Real-time: yes.
    pub(crate) fn subtract_rows(
        &self,
        rows: Range<usize>,
        x: &[f64],
        out: &mut [f64],
        lanes: Lanes,
    ) {
        debug_assert_eq!((x.len(), out.len()), (self.n, self.n));
        match &self.shape {
            Shape::Zero => {}
            Shape::Diagonal(diagonal) => {
                if let (Some(diagonal), Some(x), Some(out)) = (
                    diagonal.get(rows.clone()),
                    x.get(rows.clone()),
                    out.get_mut(rows),
                ) {
                    lanes.run(Diagonal { diagonal, x, out });
                }
            }
            Shape::Tridiagonal {
                diagonal,
                beside,
                inner,
            } => {
                let (first, last) = (rows.start == 0, rows.end == self.n);
                let middle = rows.start.max(1)..rows.end.min(self.n - 1);
                if !middle.is_empty()
                    && let Some(x) = x.get(middle.start - 1..middle.end + 1)
                    && let Some(out) = out.get_mut(middle.clone())
                {
                    match *inner {
                        Some((d, e)) => lanes.run(EvenChain { d, e, x, out }),
                        None => lanes.run(Chain {
                            diagonal: &diagonal[middle.clone()],
                            beside: &beside[middle.start - 1..middle.end],
                            x,
                            out,
                        }),
                    }
                }
                // n ≥ 2 here: half bandwidth 1.
                if first
                    && let ([r, ..], [d, ..], [e, ..], [x0, x1, ..]) =
                        (&mut *out, &diagonal[..], &beside[..], x)
                {
                    *r -= d * x0 + e * x1;
                }
                if last
                    && let ([.., r], [.., d], [.., e], [.., x0, x1]) =
                        (out, &diagonal[..], &beside[..], x)
                {
                    *r -= e * x0 + d * x1;
                }
            }
            Shape::General => {
                let starts = self.row_start.windows(2);
                let rows = out.iter_mut().zip(starts).take(rows.end).skip(rows.start);
                for (out, range) in rows {
                    let range = range[0]..range[1];
                    let mut sum = 0.0;
                    for (&column, &value) in
                        self.columns[range.clone()].iter().zip(&self.values[range])
                    {
                        sum += value * x[column as usize];
                    }
                    *out -= sum;
                }
            }
        }
    }

    /// xᵀ A x; `x` has n entries. Rows are added in their order, and the entries of a row. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn quadratic(&self, x: &[f64]) -> f64 {
        match &self.shape {
            Shape::Diagonal(diagonal) => diagonal.iter().zip(x).map(|(d, x)| x * (d * x)).sum(),
            Shape::Tridiagonal {
                diagonal, beside, ..
            } => {
                let (mut total, mut above) = (0.0, 0.0);
                let rows = diagonal.iter().zip(beside).zip(x.windows(2));
                for ((d, e), pair) in rows {
                    if let [x, next] = pair {
                        total += x * (above + d * x + e * next);
                        above = e * x;
                    }
                }
                let last = diagonal.last().zip(x.last());
                total + last.map_or(0.0, |(d, x)| x * (above + d * x))
            }
            Shape::Zero | Shape::General => (0..self.n)
                .zip(x)
                .map(|(i, xi)| xi * self.row(i).map(|(j, value)| value * x[j]).sum::<f64>())
                .sum(),
        }
    }
}

/// What all inner rows of a chain have, if they have the same.
fn even(diagonal: &[f64], beside: &[f64]) -> Option<(f64, f64)> {
    let inner = diagonal.get(1..diagonal.len().checked_sub(1)?)?;
    let (d, e) = (*inner.first()?, *beside.first()?);
    (inner.iter().all(|other| *other == d) && beside.iter().all(|other| *other == e))
        .then_some((d, e))
}
