//! The normal equations JᵀJ x = b of up to six unknowns, by LDLᵀ without square roots.
//!
//! Columns may have different units: weights bring them to one. The smallest pivot over the largest diagonal is, but for a
//! factor of a few, the square of the smallest singular value of J over the largest. As near to a singular pose as [`LEAST`]
//! allows, a solution is good to eight digits: enough for Newton, whose residual is exact.

use super::{MOST, Six};
use gusset_quantity::state;

/// A pivot below this share of the largest diagonal counts as zero: a condition number of about 1e4.
const LEAST: f64 = 1e-8;

/// LDLᵀ of JᵀJ: unit lower triangle and the inverse pivots.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Factor {
    lower: [Six; MOST],
    inverse: Six,
    least: f64,
}

state! { Factor { lower, inverse, least } }

impl Factor {
    /// Becomes that of the first `columns` columns of `rows`, whose squares are weighed by `weights` where they are compared;
    /// false if they are not independent, or not numbers. Real-time: yes.
    pub(crate) fn remake(&mut self, rows: &[Six], columns: usize, weights: &Six) -> bool {
        let (mut least, mut largest) = (f64::INFINITY, 0.0f64);
        let mut pivots = [0.0; MOST];
        for i in 0..columns.min(MOST) {
            for j in 0..=i {
                let mut sum = 0.0;
                for row in rows {
                    sum += row[i] * row[j];
                }
                let whole = sum;
                for (k, pivot) in pivots.iter().enumerate().take(j) {
                    sum -= self.lower[i][k] * self.lower[j][k] * pivot;
                }
                if j < i {
                    self.lower[i][j] = sum * self.inverse[j];
                } else {
                    // Written so that NaN is no pivot.
                    if !(sum > 0.0 && whole.is_finite()) {
                        return false;
                    }
                    least = least.min(weights[i] * sum);
                    largest = largest.max(weights[i] * whole);
                    pivots[i] = sum;
                    self.inverse[i] = 1.0 / sum;
                }
            }
        }
        self.least = least / largest;
        self.least >= LEAST
    }

    /// Smallest pivot over the largest diagonal.
    pub(crate) const fn least(&self) -> f64 {
        self.least
    }

    /// x in place of b. Real-time: yes.
    pub(crate) fn solve(&self, b: &mut Six, columns: usize) {
        let n = columns.min(MOST);
        for i in 1..n {
            for j in 0..i {
                b[i] -= self.lower[i][j] * b[j];
            }
        }
        for i in (0..n).rev() {
            b[i] *= self.inverse[i];
            for j in i + 1..n {
                b[i] -= self.lower[j][i] * b[j];
            }
        }
    }
}
