//! LDLᵀ of a matrix with a narrow band, by rows.
//!
//! Row i of L keeps exactly `width` = b entries, columns i − b … i − 1; columns before the first are zeros.

use super::ordering::{Order, narrowest};
use super::{NotPositiveDefinite, SymMatrix, check_pivot, dot};

/// A banded matrix in its own numbering, or its factor.
#[derive(Debug)]
pub(crate) struct Banded {
    width: usize,
    /// n rows of `width` entries left of the diagonal, and the diagonal; once eliminated, multipliers and pivots.
    lower: Vec<f64>,
    diagonal: Vec<f64>,
    inverse_pivots: Vec<f64>,
    /// Before elimination.
    original: Vec<f64>,
    old_of_new: Option<Vec<u32>>,
    new_of_old: Vec<u32>,
    /// The row that is eliminated.
    row: Vec<f64>,
    /// `width` zeros, then the right-hand side in the new numbering: rows near the top need no special case.
    work: Vec<f64>,
}

impl Banded {
    pub(super) fn factor(matrix: &SymMatrix, order: Order) -> Result<Self, NotPositiveDefinite> {
        let mut banded = Self::zeros(matrix.n(), order);
        for (i, j, value) in matrix.entries() {
            banded.add(i, j, value);
        }
        banded.eliminate()?;
        Ok(banded)
    }

    /// Zeros with room for the entries of `pattern`.
    pub(crate) fn like(pattern: &SymMatrix) -> Self {
        Self::zeros(pattern.n(), narrowest(pattern))
    }

    fn zeros(n: usize, order: Order) -> Self {
        let width = order.half_bandwidth;
        let mut new_of_old: Vec<u32> = (0..n as u32).collect();
        for (new, &old) in (0..).zip(order.old_of_new.iter().flatten()) {
            new_of_old[old as usize] = new;
        }
        Self {
            width,
            lower: vec![0.0; n * width],
            diagonal: vec![0.0; n],
            inverse_pivots: vec![0.0; n],
            original: vec![0.0; n],
            old_of_new: order.old_of_new,
            new_of_old,
            row: vec![0.0; width],
            work: vec![0.0; width + n],
        }
    }

    /// Every entry ← 0. Real-time: yes.
    pub(crate) fn clear(&mut self) {
        self.lower.fill(0.0);
        self.diagonal.fill(0.0);
    }

    /// Adds to entry (i, j) and its mirror image, in the user's numbering. Real-time: yes.
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        let new = |old: usize| self.new_of_old.get(old).map(|new| *new as usize);
        let (Some(i), Some(j)) = (new(i), new(j)) else {
            return;
        };
        let (low, high) = (i.min(j), i.max(j));
        let place = if low == high {
            self.diagonal.get_mut(low)
        } else {
            self.lower.get_mut((high + 1) * self.width + low - high)
        };
        if let Some(place) = place {
            *place += value;
        }
    }

    /// Replaces the matrix by its factor. Real-time: yes.
    pub(crate) fn eliminate(&mut self) -> Result<(), NotPositiveDefinite> {
        let width = self.width;
        self.original.copy_from_slice(&self.diagonal);
        for i in 0..self.diagonal.len() {
            // `row` holds columns i − width … i − 1: first aᵢⱼ, then gᵢⱼ = lᵢⱼ dⱼ.
            let row = &mut self.row;
            row.copy_from_slice(&self.lower[i * width..(i + 1) * width]);
            let first = i.saturating_sub(width);
            for j in first..i {
                let at = j + width - i;
                // Columns common to rows i and j: max(first, j − width) … j − 1.
                let common = j.saturating_sub(width).max(first);
                let of_j = &self.lower[j * width + (common + width - j)..(j + 1) * width];
                row[at] -= dot(&row[common + width - i..at], of_j);
            }
            let target = &mut self.lower[i * width..(i + 1) * width];
            let (earlier, later) = self.diagonal.split_at_mut(i);
            let own = row[first + width - i..]
                .iter()
                .zip(&mut target[first + width - i..]);
            for ((g, multiplier), earlier) in own.zip(&earlier[first..]) {
                *multiplier = g / earlier;
                later[0] -= g * *multiplier;
            }
            let pivot = later[0];
            let dof = self.old_of_new.as_ref().map_or(i, |old| old[i] as usize);
            check_pivot(dof, pivot, self.original[i])?;
            self.inverse_pivots[i] = 1.0 / pivot;
        }
        Ok(())
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.lower[..]) + size_of_val(&self.inverse_pivots[..])
    }

    /// x ← A⁻¹ x. Real-time: yes.
    pub(crate) fn solve_in_place(&mut self, x: &mut [f64]) {
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
