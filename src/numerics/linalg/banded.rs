//! LDLᵀ of a matrix with a narrow band, by rows.
//!
//! Row i of L keeps exactly `width` = b entries, columns i − b … i − 1; columns before the first are zeros.

use super::ordering::Order;
use super::{NotPositiveDefinite, SymMatrix, check_pivot, dot};

/// A banded factor in its own numbering.
#[derive(Debug)]
pub(super) struct Banded {
    width: usize,
    /// n rows of `width` multipliers.
    lower: Vec<f64>,
    inverse_pivots: Vec<f64>,
    old_of_new: Option<Vec<u32>>,
    /// `width` zeros, then the right-hand side in the new numbering: rows near the top need no special case.
    work: Vec<f64>,
}

impl Banded {
    pub(super) fn factor(matrix: &SymMatrix, order: Order) -> Result<Self, NotPositiveDefinite> {
        let n = matrix.n();
        let width = order.half_bandwidth;
        let old = |new: usize| order.old_of_new.as_ref().map_or(new, |o| o[new] as usize);
        let mut new_of_old = vec![0usize; n];
        for new in 0..n {
            new_of_old[old(new)] = new;
        }
        let mut lower = vec![0.0; n * width];
        let mut pivots = vec![0.0; n];
        let mut row = vec![0.0; width];
        for i in 0..n {
            // `row` holds columns i − width … i − 1: first aᵢⱼ, then gᵢⱼ = lᵢⱼ dⱼ.
            row.fill(0.0);
            for (j, value) in matrix.row(old(i)) {
                let j = new_of_old[j];
                if j < i {
                    row[j + width - i] = value;
                }
            }
            let first = i.saturating_sub(width);
            for j in first..i {
                let at = j + width - i;
                // Columns common to rows i and j: max(first, j − width) … j − 1.
                let common = j.saturating_sub(width).max(first);
                let of_j = &lower[j * width + (common + width - j)..(j + 1) * width];
                row[at] -= dot(&row[common + width - i..at], of_j);
            }
            let target = &mut lower[i * width..(i + 1) * width];
            let diagonal = matrix.get(old(i), old(i));
            let mut pivot = diagonal;
            let earlier = &pivots[first..i];
            let own = row[first + width - i..]
                .iter()
                .zip(&mut target[first + width - i..]);
            for ((g, multiplier), earlier) in own.zip(earlier) {
                *multiplier = g / earlier;
                pivot -= g * *multiplier;
            }
            check_pivot(old(i), pivot, diagonal)?;
            pivots[i] = pivot;
        }
        Ok(Self {
            width,
            lower,
            inverse_pivots: pivots.iter().map(|p| 1.0 / p).collect(),
            old_of_new: order.old_of_new,
            work: vec![0.0; width + n],
        })
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.lower[..]) + size_of_val(&self.inverse_pivots[..])
    }

    /// x ← A⁻¹ x. Real-time: yes.
    pub(super) fn solve_in_place(&mut self, x: &mut [f64]) {
        let (head, body) = self.work.split_at_mut(self.width);
        head.fill(0.0);
        match &self.old_of_new {
            None => body.copy_from_slice(x),
            Some(order) => {
                for (y, &old) in body.iter_mut().zip(order) {
                    *y = x[old as usize];
                }
            }
        }
        let width = self.width;
        let rows = self.lower.chunks_exact(width.max(1));
        for (i, row) in rows.clone().enumerate() {
            let (before, after) = self.work.split_at_mut(i + width);
            if let Some(y) = after.first_mut() {
                *y -= dot(row, &before[i..]);
            }
        }
        for (y, inverse) in self.work[width..].iter_mut().zip(&self.inverse_pivots) {
            *y *= inverse;
        }
        for (i, row) in rows.enumerate().rev() {
            let (before, after) = self.work.split_at_mut(i + width);
            if let Some(&y) = after.first() {
                for (earlier, l) in before[i..].iter_mut().zip(row) {
                    *earlier -= l * y;
                }
            }
        }
        let body = &self.work[width..];
        match &self.old_of_new {
            None => x.copy_from_slice(body),
            Some(order) => {
                for (y, &old) in body.iter().zip(order) {
                    x[old as usize] = *y;
                }
            }
        }
    }
}
