//! Factor of a tridiagonal matrix, eliminated from both ends at once.
//!
//! A recurrence costs its latency, not its arithmetic; the two halves are independent until they meet in the
//! middle row, so the processor works on both. Pivot `p`, multiplier `l`: from the top lᵢ = eᵢ₋₁/pᵢ₋₁,
//! pᵢ = dᵢ − lᵢ eᵢ₋₁, from the bottom the mirror image (the twisted factorisation of the LAPACK eigenvalue codes).

use super::{NotPositiveDefinite, SymMatrix, check_pivot};

/// One end of the chain, numbered from the end towards the middle.
#[derive(Debug, Default)]
struct Half {
    /// Multiplier between this row and the next one inwards.
    multiplier: Vec<f64>,
    /// Reciprocal pivot.
    inverse: Vec<f64>,
}

/// LDLᵀ of a tridiagonal matrix with its middle row eliminated last.
#[derive(Debug)]
pub(super) struct Tridiagonal {
    top: Half,
    bottom: Half,
    middle_inverse: f64,
}

impl Tridiagonal {
    pub(super) fn factor(matrix: &SymMatrix) -> Result<Self, NotPositiveDefinite> {
        let n = matrix.n();
        let middle = n / 2;
        // Each half: (row, neighbour inwards) from the end to the row beside the middle.
        let half = |rows: &mut dyn Iterator<Item = (usize, usize)>| {
            let mut half = Half::default();
            let mut carried = 0.0;
            for (row, inwards) in rows {
                let diagonal = matrix.get(row, row);
                let pivot = diagonal - carried;
                check_pivot(row, pivot, diagonal)?;
                let beside = matrix.get(row, inwards);
                let multiplier = beside / pivot;
                half.multiplier.push(multiplier);
                half.inverse.push(1.0 / pivot);
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
            top,
            bottom,
            middle_inverse: 1.0 / pivot,
        })
    }

    pub(super) fn bytes(&self) -> usize {
        let of = |half: &Half| size_of_val(&half.multiplier[..]) + size_of_val(&half.inverse[..]);
        of(&self.top) + of(&self.bottom)
    }

    /// x ← A⁻¹ x. Real-time: yes.
    pub(super) fn solve_in_place(&self, x: &mut [f64]) {
        let Some((top, rest)) = x.split_at_mut_checked(self.top.inverse.len()) else {
            return;
        };
        let Some((middle, bottom)) = rest.split_first_mut() else {
            return;
        };
        // Inwards. The halves have equal length or the top one is longer by one row (n even).
        let common = bottom.len();
        let (mut above, mut below) = (0.0, 0.0);
        let multipliers = self.top.multiplier.iter().zip(&self.bottom.multiplier);
        let ends = top.iter_mut().zip(bottom.iter_mut().rev());
        for ((from_top, from_bottom), (l, u)) in ends.zip(multipliers) {
            *from_top -= above;
            *from_bottom -= below;
            above = l * *from_top;
            below = u * *from_bottom;
        }
        for (y, l) in top.iter_mut().zip(&self.top.multiplier).skip(common) {
            *y -= above;
            above = l * *y;
        }
        *middle = (*middle - (above + below)) * self.middle_inverse;

        // Outwards, the odd row of the top half first so that both run in step again.
        let (mut above, mut below) = (*middle, *middle);
        let (top, odd) = top.split_at_mut(common.min(top.len()));
        let odd_rows = odd.iter_mut().zip(&self.top.multiplier[common..]).rev();
        for ((y, l), inverse) in odd_rows.zip(self.top.inverse[common..].iter().rev()) {
            *y = *y * inverse - l * above;
            above = *y;
        }
        let tops = top
            .iter_mut()
            .zip(self.top.multiplier.iter().zip(&self.top.inverse))
            .rev();
        // `bottom` counts from the middle here, its factors from the end.
        let bottoms = bottom.iter_mut().zip(
            self.bottom
                .multiplier
                .iter()
                .zip(&self.bottom.inverse)
                .rev(),
        );
        for ((from_top, (l, p)), (from_bottom, (u, q))) in tops.zip(bottoms) {
            *from_top = *from_top * p - l * above;
            *from_bottom = *from_bottom * q - u * below;
            above = *from_top;
            below = *from_bottom;
        }
    }
}
