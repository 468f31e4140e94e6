//! The lowest modes of K φ = ω² M φ by a block Lanczos iteration with K⁻¹ M.
//!
//! Source: R. G. Grimes, J. G. Lewis, H. D. Simon (1994), SIAM J. Matrix Anal. Appl. 15(1), 228. Every vector is made
//! M-orthogonal to all others, twice. Blocks find frequencies that occur several times. Directions without mass follow statically.

use gusset_numerics::linalg::SymMatrix;
use nalgebra::{DMatrix, SymmetricEigen};

use crate::factor::Factor;
use crate::{add, dot, times};

/// Vectors of a block.
const BLOCK: usize = 8;
/// Residual of K⁻¹ M φ − φ/ω², as a part of 1/ω², at which a mode has converged.
const TOLERANCE: f64 = 1e-6;
/// Vectors for each mode after which the iteration counts as failed.
const MOST_PER_MODE: usize = 10;
/// Part of a vector that must remain when others are subtracted from it, or else it depends on them.
const INDEPENDENT: f64 = 1e-8;

/// Modes, the lowest first.
pub(crate) struct Lowest {
    /// ω² in rad²/s².
    pub(crate) squared: Vec<f64>,
    /// Shapes, n rows, φᵀ M φ = 1.
    pub(crate) shapes: DMatrix<f64>,
}

/// The `count` lowest modes, at most as many as directions have mass. `None` if the iteration does not settle.
pub(crate) fn lowest(factor: &mut Factor, mass: &SymMatrix, count: usize) -> Option<Lowest> {
    let n = mass.n();
    let massive = (0..n).filter(|&row| !mass.row_is_zero(row)).count();
    if count == 0 {
        let (squared, shapes) = (Vec::new(), DMatrix::zeros(n, 0));
        return Some(Lowest { squared, shapes });
    }
    // Any fixed start will do (Lehmer's generator).
    let mut seed = 42u64;
    let mut random = || {
        DMatrix::from_fn(n, BLOCK.min(massive), |_, _| {
            seed = seed * 48_271 % 2_147_483_647;
            seed as f64 / 2_147_483_647.0 - 0.5
        })
    };
    let mut basis: Vec<Vec<f64>> = Vec::new();
    // vᵢᵀ M K⁻¹ M vⱼ by columns j: rows from 0 to the end of the block after that of j.
    let mut inner: Vec<Vec<f64>> = Vec::new();
    // M K⁻¹ M v of the last block.
    let mut products: Vec<Vec<f64>> = Vec::new();
    let mut next = applied(factor, mass, &random());
    let mut was_dry = false;
    loop {
        let first = basis.len();
        for vector in next.column_iter() {
            extend(&mut basis, mass, vector.as_slice());
        }
        let last = first - products.len();
        for (column, product) in inner[last..].iter_mut().zip(&products) {
            column.extend(basis[first..].iter().map(|v| dot(v, product)));
        }
        let is_dry = basis.len() == first;
        if first >= count {
            let found = ritz(&inner);
            let settled = |mode: usize| {
                let rest = (first..basis.len()).map(|row| {
                    let block = last..first;
                    let terms = block.map(|j| inner[j][row] * found.1[(j, mode)]);
                    terms.sum::<f64>().powi(2)
                });
                rest.sum::<f64>().sqrt() <= TOLERANCE * found.0[mode]
            };
            if is_dry || (0..count).all(settled) {
                return Some(combined(&basis, &found, count));
            }
        }
        if is_dry {
            // The space is exhausted. A second random block in vain ends the search.
            if was_dry {
                return None;
            }
            (was_dry, next) = (true, applied(factor, mass, &random()));
            continue;
        }
        if first > MOST_PER_MODE * count + 20 * BLOCK {
            return None;
        }
        was_dry = false;
        let block = DMatrix::from_fn(n, basis.len() - first, |i, j| basis[first + j][i]);
        next = applied(factor, mass, &block);
        products = next
            .column_iter()
            .map(|image| times(mass, image.as_slice()))
            .collect();
        for product in &products {
            inner.push(basis.iter().map(|v| dot(v, product)).collect());
        }
    }
}

/// K⁻¹ M X.
fn applied(factor: &mut Factor, mass: &SymMatrix, block: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(block.nrows(), block.ncols());
    for (from, mut to) in block.column_iter().zip(out.column_iter_mut()) {
        to.copy_from_slice(&times(mass, from.as_slice()));
    }
    factor.solve(&mut out);
    out
}

/// Adds the part of a vector that is M-orthogonal to the basis, with φᵀ M φ = 1, if there is one.
pub(crate) fn extend(basis: &mut Vec<Vec<f64>>, mass: &SymMatrix, vector: &[f64]) {
    let mut own = vector.to_vec();
    let size = dot(&own, &times(mass, &own)).max(0.0).sqrt();
    for _ in 0..2 {
        let product = times(mass, &own);
        let parts: Vec<f64> = basis.iter().map(|v| dot(v, &product)).collect();
        for (v, part) in basis.iter().zip(parts) {
            add(&mut own, -part, v);
        }
    }
    let left = dot(&own, &times(mass, &own)).max(0.0).sqrt();
    if left > INDEPENDENT * size {
        own.iter_mut().for_each(|value| *value /= left);
        basis.push(own);
    }
}

/// 1/ω² in the space of the basis, falling, and the coefficients of the modes.
fn ritz(inner: &[Vec<f64>]) -> (Vec<f64>, DMatrix<f64>) {
    let m = inner.len();
    let found = SymmetricEigen::new(DMatrix::from_fn(m, m, |i, j| inner[i.max(j)][i.min(j)]));
    let mut order: Vec<usize> = (0..m).collect();
    order.sort_by(|&a, &b| found.eigenvalues[b].total_cmp(&found.eigenvalues[a]));
    let values = order.iter().map(|&at| found.eigenvalues[at]).collect();
    let coefficients = DMatrix::from_fn(m, m, |i, j| found.eigenvectors[(i, order[j])]);
    (values, coefficients)
}

/// The first `count` modes.
fn combined(
    basis: &[Vec<f64>],
    (values, coefficients): &(Vec<f64>, DMatrix<f64>),
    count: usize,
) -> Lowest {
    let mut shapes = DMatrix::zeros(basis.first().map_or(0, Vec::len), count);
    for (mut shape, parts) in shapes.column_iter_mut().zip(coefficients.column_iter()) {
        for (v, part) in basis.iter().zip(parts.iter()) {
            add(shape.as_mut_slice(), *part, v);
        }
    }
    let squared = values.iter().take(count).map(|value| 1.0 / value).collect();
    Lowest { squared, shapes }
}
