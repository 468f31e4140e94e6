//! How many digits a solve can keep.
//!
//! A factor is as exact as the matrix lets it be: of the sixteen digits of a double, log₁₀ κ are lost in the worst case. What
//! counts is κ of D^−½ A D^−½ with D the diagonal of A, for neither units nor unequal masses cost a digit of a symmetric
//! positive definite solve (van der Sluis 1969). The norm of the inverse is estimated from below by a few solves (Hager 1984;
//! Higham 1988), as a rule exactly and hardly ever by less than a third. Nothing here runs during a test.

use super::{Spd, SymMatrix};

/// Most rounds of the search for the column of the inverse with the largest sum; two or three are usual.
const ROUNDS: usize = 5;

impl Spd {
    /// 1/κ of the scaled `matrix` that this is the factor of, in the 1-norm, from 1 (a diagonal) down to roundoff: the digits that
    /// are left of sixteen are as many as its logarithm leaves.
    #[must_use]
    pub(crate) fn reciprocal_condition(&mut self, matrix: &SymMatrix) -> f64 {
        let n = matrix.n();
        if n == 0 {
            return 1.0;
        }
        let scale: Vec<f64> = (0..n).map(|i| matrix.get(i, i).sqrt()).collect();
        let mut columns = vec![0.0; n];
        for (i, j, value) in matrix.entries() {
            let value = value.abs() / (scale[i] * scale[j]);
            columns[i] += value;
            if i != j {
                columns[j] += value;
            }
        }
        let norm = columns.iter().fold(0.0, |most: f64, sum| most.max(*sum));
        1.0 / (norm * self.inverse_norm(&scale))
    }

    /// Largest sum of |entries| in a column of D^½ A⁻¹ D^½, from below; `scale` is the diagonal of D^½.
    fn inverse_norm(&mut self, scale: &[f64]) -> f64 {
        let n = scale.len();
        let mut solved = |x: &[f64]| -> Vec<f64> {
            let mut y: Vec<f64> = x.iter().zip(scale).map(|(x, d)| x * d).collect();
            self.solve_in_place(&mut y);
            y.iter_mut().zip(scale).for_each(|(y, d)| *y *= d);
            y
        };
        let sum = |y: &[f64]| y.iter().map(|y| y.abs()).sum::<f64>();
        let mut x = vec![1.0 / n as f64; n];
        let mut largest = 0.0_f64;
        for _ in 0..ROUNDS {
            let y = solved(&x);
            let found = sum(&y);
            if found <= largest {
                break;
            }
            largest = found;
            let signs: Vec<f64> = y.iter().map(|y| 1.0_f64.copysign(*y)).collect();
            let slope = solved(&signs);
            let here: f64 = slope.iter().zip(&x).map(|(z, x)| z * x).sum();
            let sizes = slope.iter().map(|z| z.abs()).enumerate();
            let Some((best, most)) = sizes.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                break;
            };
            if most <= here {
                break;
            }
            x.fill(0.0);
            x[best] = 1.0;
        }
        // What deceives the search seldom deceives this as well.
        let last = n.saturating_sub(1).max(1) as f64;
        let mut sign = -1.0;
        let alternating: Vec<f64> = (0..n)
            .map(|i| {
                sign = -sign;
                sign * (1.0 + i as f64 / last)
            })
            .collect();
        largest.max(2.0 * sum(&solved(&alternating)) / (3.0 * n as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Storage;

    fn reciprocal(matrix: &SymMatrix) -> f64 {
        Spd::factor(matrix).unwrap().reciprocal_condition(matrix)
    }

    #[test]
    fn diagonal_loses_nothing_in_any_units() {
        assert_eq!(reciprocal(&SymMatrix::diagonal(&[1e-9, 4.0, 1e16])), 1.0);
    }

    #[test]
    fn two_masses_have_the_closed_condition() {
        // [[1, −c], [−c, 1]] has κ₁ = (1 + c)/(1 − c), before and after its rows are scaled.
        for lost in [1.0, 4.0, 8.0] {
            let c = 1.0 - libm::pow(10.0, -lost);
            for (p, q) in [(1.0, 1.0), (1e6, 1e-3)] {
                let entries = [(0, 0, p * p), (0, 1, -c * p * q), (1, 1, q * q)];
                let found = reciprocal(&SymMatrix::from_triplets(2, entries));
                let exact = (1.0 - c) / (1.0 + c);
                // 1 − c itself has lost this number of digits.
                let roundoff = 10.0 * f64::EPSILON * libm::pow(10.0, lost);
                assert!(
                    (found / exact - 1.0).abs() < roundoff,
                    "{lost}: {found:e} {exact:e}"
                );
            }
        }
    }

    #[test]
    fn estimate_is_a_close_lower_bound() {
        let n = 24;
        let mut seed = 1_u64;
        let mut random = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for stiff in [1.0, 1e3, 1e7] {
            // Springs between neighbours and here and there beyond, one of them stiff.
            let mut entries = vec![];
            for i in 0..n {
                entries.push((i, i, 2.0 + random().abs()));
                let spring = if i == n / 3 { stiff } else { 1.0 };
                let mut tie = |i: usize, j: usize, k: f64| {
                    entries.extend([(i, i, k), (j, j, k), (i, j, -k)]);
                };
                if i + 1 < n {
                    tie(i, i + 1, spring);
                }
                if i + 7 < n {
                    tie(i, i + 7, 0.1);
                }
            }
            let matrix = SymMatrix::from_triplets(n, entries);
            let dense = matrix.to_dense();
            let scaled = nalgebra::DMatrix::from_fn(n, n, |i, j| {
                dense[(i, j)] / (dense[(i, i)] * dense[(j, j)]).sqrt()
            });
            let norm = |m: &nalgebra::DMatrix<f64>| {
                let sums = m
                    .column_iter()
                    .map(|c| c.iter().map(|v| v.abs()).sum::<f64>());
                sums.fold(0.0, f64::max)
            };
            let exact = 1.0 / (norm(&scaled) * norm(&scaled.clone().try_inverse().unwrap()));
            for storage in [Storage::Banded, Storage::Dense, Storage::Sparse] {
                let mut factor = Spd::factor_as(&matrix, storage).unwrap();
                let found = factor.reciprocal_condition(&matrix);
                // From below in the norm, so from above here; by no more than Hager's three.
                let ratio = found / exact;
                assert!(
                    ratio > 1.0 - 1e-6 && ratio < 3.0,
                    "{stiff:e} {storage}: {ratio}"
                );
            }
        }
    }
}
