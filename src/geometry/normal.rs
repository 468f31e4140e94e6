//! The normal equations JᵀJ x = b of up to six unknowns, by LDLᵀ without square roots.
//!
//! Columns may have different units: pivots are judged by their share of the diagonal, which does not know of units. With
//! two independent directions as close as [`LEAST`] allows, a solution is good to six digits: enough for Newton, whose
//! residual is exact, and that is where it is used; the forces of a platform's law stand in their own balance.

use super::{MOST, Six};

/// A pivot below this share of its diagonal is none: what this column does, others do, to within an angle of 1e-4.
const LEAST: f64 = 1e-8;

/// LDLᵀ of JᵀJ: unit lower triangle and the inverse pivots.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Factor {
    lower: [Six; MOST],
    inverse: Six,
    least: f64,
}

impl Factor {
    /// Of the first `columns` columns of `rows`; none if they are not independent, or not numbers. Real-time: yes.
    pub fn of(rows: &[Six], columns: usize) -> Option<Self> {
        let mut factor = Self {
            least: 1.0,
            ..Self::default()
        };
        let mut pivots = [0.0; MOST];
        for i in 0..columns.min(MOST) {
            for j in 0..=i {
                let mut sum = 0.0;
                for row in rows {
                    sum += row[i] * row[j];
                }
                let whole = sum;
                for (k, pivot) in pivots.iter().enumerate().take(j) {
                    sum -= factor.lower[i][k] * factor.lower[j][k] * pivot;
                }
                if j < i {
                    factor.lower[i][j] = sum * factor.inverse[j];
                } else {
                    let share = sum / whole;
                    // Written so that NaN, of 0/0 too, is no pivot.
                    if !(share >= LEAST && whole.is_finite()) {
                        return None;
                    }
                    factor.least = factor.least.min(share);
                    pivots[i] = sum;
                    factor.inverse[i] = 1.0 / sum;
                }
            }
        }
        Some(factor)
    }

    /// Smallest share of a pivot in its diagonal.
    pub const fn least(&self) -> f64 {
        self.least
    }

    /// x in place of b. Real-time: yes.
    pub fn solve(&self, b: &mut Six, columns: usize) {
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
