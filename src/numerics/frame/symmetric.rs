//! Symmetric matrices of few rows.

use gusset_quantity::state::Visit;

/// All rows of a symmetric matrix.
pub(super) type Sym<const N: usize> = [[f64; N]; N];

/// A determinant below this share of that of the initial matrix counts as zero.
const SINGULAR: f64 = 1e-9;
/// Share of the initial matrix that is then added.
const LEAST: f64 = 1e-4;
/// A determinant below this share of the product of the diagonal counts as zero.
const ROUNDOFF: f64 = 1e-13;

/// The cofactors, and the determinant; for one to three rows.
fn cofactors<const N: usize>(m: &Sym<N>) -> (Sym<N>, f64) {
    let at = |i: usize, j: usize| m.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0);
    let mut out = [[0.0; N]; N];
    let mut put = |i: usize, j: usize, value: f64| {
        for (i, j) in [(i, j), (j, i)] {
            if let Some(to) = out.get_mut(i).and_then(|row| row.get_mut(j)) {
                *to = value;
            }
        }
    };
    let [a, b, c, d, e, f] = [at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)];
    let det = if N == 2 {
        put(0, 0, d);
        put(0, 1, -b);
        put(1, 1, a);
        a * d - b * b
    } else {
        let (p, q, r) = (d * f - e * e, c * e - b * f, b * e - c * d);
        put(0, 0, p);
        put(0, 1, q);
        put(0, 2, r);
        put(1, 1, a * f - c * c);
        put(1, 2, b * c - a * e);
        put(2, 2, a * d - b * b);
        a * p + b * q + c * r
    };
    (out, det)
}

/// The inverse for two or three rows. Where `matrix` is singular, a little of `initial` is added: the fibres of a section may all
/// yield. Real-time: yes.
pub(super) fn inverse_of_section<const N: usize>(matrix: &Sym<N>, initial: &Sym<N>) -> Sym<N> {
    let (mut of, mut det) = cofactors(matrix);
    if det.abs() <= SINGULAR * cofactors(initial).1 {
        let mut m = *matrix;
        for (entry, least) in m.iter_mut().flatten().zip(initial.iter().flatten()) {
            *entry += LEAST * least;
        }
        (of, det) = cofactors(&m);
    }
    of.iter_mut().flatten().for_each(|entry| *entry /= det);
    of
}

/// The inverse for three or more rows; none where the determinant vanishes. Real-time: yes.
pub(super) fn inverse<const N: usize>(m: &Sym<N>) -> Option<Sym<N>> {
    if N > 3 {
        return eliminated(m);
    }
    let (mut of, det) = cofactors(m);
    let size: f64 = (0..N).filter_map(|k| m.get(k)?.get(k)).product();
    if det.abs() > ROUNDOFF * size.abs() {
        of.iter_mut().flatten().for_each(|entry| *entry /= det);
        Some(of)
    } else {
        None
    }
}

/// The inverse by elimination with pivots of the column.
fn eliminated<const N: usize>(m: &Sym<N>) -> Option<Sym<N>> {
    let (mut left, mut right) = (*m, [[0.0; N]; N]);
    for (k, row) in right.iter_mut().enumerate() {
        *row.get_mut(k)? = 1.0;
    }
    let size = |k: usize| m.get(k).and_then(|row| row.get(k)).map_or(0.0, |x| x.abs());
    let mut share = 1.0;
    for k in 0..N {
        let largest = |row: &usize| {
            left.get(*row)
                .and_then(|row| row.get(k))
                .map_or(0.0, |x| x.abs())
        };
        let pivot = (k..N).max_by(|a, b| largest(a).total_cmp(&largest(b)))?;
        left.swap(k, pivot);
        right.swap(k, pivot);
        let value = *left.get(k)?.get(k)?;
        share *= value.abs() / size(k);
        if share.is_nan() || share <= ROUNDOFF {
            return None;
        }
        for side in [&mut left, &mut right] {
            side.get_mut(k)?.iter_mut().for_each(|x| *x /= value);
        }
        let (own, own_right) = (*left.get(k)?, *right.get(k)?);
        for row in (0..N).filter(|row| *row != k) {
            let factor = *left.get(row)?.get(k)?;
            for (side, own) in [(&mut left, &own), (&mut right, &own_right)] {
                for (x, own) in side.get_mut(row)?.iter_mut().zip(own) {
                    *x -= factor * own;
                }
            }
        }
    }
    Some(right)
}

/// m x. Real-time: yes.
#[inline]
pub(super) fn product<const N: usize>(m: &Sym<N>, x: &[f64; N]) -> [f64; N] {
    m.map(|row| dot(&row, x))
}

/// a · x, added up from the first. Real-time: yes.
#[inline]
pub(super) fn dot<const N: usize>(a: &[f64; N], x: &[f64; N]) -> f64 {
    // −0 leaves every number that it is added to.
    a.iter().zip(x).fold(-0.0, |sum, (a, x)| sum + a * x)
}

/// The lower triangle becomes the upper one. Real-time: yes.
#[inline(always)]
pub(super) fn mirror<const N: usize>(m: &mut Sym<N>) {
    let upper = *m;
    for (i, row) in m.iter_mut().enumerate() {
        for (x, other) in row.iter_mut().take(i).zip(&upper) {
            *x = other[i];
        }
    }
}

/// Visits the upper triangle of the first `n` rows, by rows.
pub(super) fn visit_upper<const N: usize>(m: &mut Sym<N>, n: usize, visit: &mut dyn Visit) {
    let n = n.min(N);
    for (i, row) in m.iter_mut().enumerate().take(n) {
        row[i..n].iter_mut().for_each(|x| visit.number(x));
    }
    mirror(m);
}

/// A matrix of all six deformations with this one at its upper left.
pub(super) fn widened<const N: usize>(m: &Sym<N>) -> Sym<6> {
    let mut out = [[0.0; 6]; 6];
    for (to, from) in out.iter_mut().zip(m) {
        for (to, from) in to.iter_mut().zip(from) {
            *to = *from;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::array::from_fn;

    #[test]
    fn inverses_have_the_unit_product() {
        fn check<const N: usize>(of: impl Fn(&Sym<N>) -> Option<Sym<N>>) {
            let mut seed = 7u64;
            for definite in [true, false] {
                let mut m = [[0.0; N]; N];
                for (i, row) in m.iter_mut().enumerate() {
                    for (j, entry) in row.iter_mut().enumerate() {
                        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1);
                        *entry = (seed >> 40) as f64 / (1u64 << 24) as f64 - 0.5;
                        *entry += if i == j && definite { 4.0 } else { 0.0 };
                    }
                }
                let transposed: Sym<N> = from_fn(|i| from_fn(|j| m[j][i]));
                for (row, other) in m.iter_mut().zip(transposed) {
                    row.iter_mut().zip(other).for_each(|(x, y)| *x += y);
                }
                let inverse = of(&m).unwrap();
                for (i, row) in inverse.iter().enumerate() {
                    for (j, sum) in product(&m, row).into_iter().enumerate() {
                        let unit = if i == j { 1.0 } else { 0.0 };
                        assert!((sum - unit).abs() < 1e-9, "{N} {definite} {i} {j}: {sum}");
                    }
                }
            }
        }
        check::<2>(|m| Some(inverse_of_section(m, &[[1e-3, 0.0], [0.0, 1e-3]])));
        check::<3>(inverse);
        check::<5>(inverse);
        let singular = [[1.0; 5]; 5];
        assert!(inverse(&singular).is_none());
        assert!(inverse(&[[1.0; 3]; 3]).is_none());
    }
}
