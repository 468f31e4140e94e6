//! Factor of a tridiagonal matrix, eliminated from both ends at once.
//!
//! A recurrence costs its latency, not its arithmetic; the two halves are independent until they meet in the
//! middle row, so the processor works on both. Pivot `p`, multiplier `l`: from the top lᵢ = eᵢ₋₁/pᵢ₋₁,
//! pᵢ = dᵢ − lᵢ eᵢ₋₁, from the bottom the mirror image (the twisted factorisation of the LAPACK eigenvalue codes).

use super::{NotPositiveDefinite, SymMatrix, check_pivot};

/// Factors of a row that is eliminated towards the middle.
#[derive(Debug, Clone, Copy)]
struct Row {
    /// Multiplier between this row and the next one inwards.
    multiplier: f64,
    /// Reciprocal pivot.
    inverse: f64,
}

/// LDLᵀ of a tridiagonal matrix with its middle row eliminated last. The halves have equal length or the top one is longer
/// by one row (n even).
#[derive(Debug)]
pub(super) struct Tridiagonal {
    /// Rows as far from the top as from the bottom, from the ends towards the middle.
    pairs: Vec<[Row; 2]>,
    /// The last row of the top half, if it has no counterpart.
    odd: Option<Row>,
    middle_inverse: f64,
}

impl Tridiagonal {
    pub(super) fn factor(matrix: &SymMatrix) -> Result<Self, NotPositiveDefinite> {
        let n = matrix.n();
        let middle = n / 2;
        // Each half: (row, neighbour inwards) from the end to the row beside the middle.
        let half = |rows: &mut dyn Iterator<Item = (usize, usize)>| {
            let mut half = Vec::new();
            let mut carried = 0.0;
            for (row, inwards) in rows {
                let diagonal = matrix.get(row, row);
                let pivot = diagonal - carried;
                check_pivot(row, pivot, diagonal)?;
                let beside = matrix.get(row, inwards);
                let multiplier = beside / pivot;
                half.push(Row {
                    multiplier,
                    inverse: 1.0 / pivot,
                });
                carried = multiplier * beside;
            }
            Ok((half, carried))
        };
        let (top, from_top) = half(&mut (0..middle).map(|i| (i, i + 1)))?;
        let (bottom, from_bottom) = half(&mut (middle + 1..n).rev().map(|i| (i, i - 1)))?;
        let diagonal = matrix.get(middle, middle);
        let pivot = diagonal - (from_top + from_bottom);
        if n > 0 {
            check_pivot(middle, pivot, diagonal)?;
        }
        Ok(Self {
            odd: top.get(bottom.len()).copied(),
            pairs: top.into_iter().zip(bottom).map(<[Row; 2]>::from).collect(),
            middle_inverse: 1.0 / pivot,
        })
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.pairs[..]) + self.odd.map_or(0, |odd| size_of_val(&odd))
    }

    /// x ← A⁻¹ x. Real-time: yes.
    #[inline]
    pub(super) fn solve_in_place(&self, x: &mut [f64]) {
        let pairs = self.pairs.len();
        let Some((top, rest)) = x.split_at_mut_checked(pairs) else {
            return;
        };
        let inner = rest.len().saturating_sub(pairs);
        let Some((inner, bottom)) = rest.split_at_mut_checked(inner) else {
            return;
        };
        // Inwards.
        let (mut above, mut below) = (0.0, 0.0);
        let ends = top.iter_mut().zip(bottom.iter_mut().rev());
        for ((from_top, from_bottom), [l, u]) in ends.zip(&self.pairs) {
            *from_top -= above;
            *from_bottom -= below;
            above = l.multiplier * *from_top;
            below = u.multiplier * *from_bottom;
        }
        // The middle row, and before it the odd one of the top half, so that outwards both run in step again.
        match (inner, self.odd) {
            ([odd, middle], Some(row)) => {
                *odd -= above;
                above = row.multiplier * *odd;
                *middle = (*middle - (above + below)) * self.middle_inverse;
                below = *middle;
                *odd = *odd * row.inverse - row.multiplier * *middle;
                above = *odd;
            }
            ([middle], None) => {
                *middle = (*middle - (above + below)) * self.middle_inverse;
                (above, below) = (*middle, *middle);
            }
            _ => return,
        }
        // Outwards. `bottom` counts from the middle here, its factors from the end.
        let ends = top.iter_mut().rev().zip(bottom);
        for ((from_top, from_bottom), [l, u]) in ends.zip(self.pairs.iter().rev()) {
            *from_top = *from_top * l.inverse - l.multiplier * above;
            *from_bottom = *from_bottom * u.inverse - u.multiplier * below;
            above = *from_top;
            below = *from_bottom;
        }
    }
}
