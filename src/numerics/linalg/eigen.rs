//! The generalised symmetric eigenproblem K φ = ω² M φ: natural frequencies and mass-normalised modes.
//!
//! Dense problems go through static condensation of massless degrees of freedom, Cholesky of the mass and cyclic
//! Jacobi rotations, which keep the relative accuracy of low frequencies and use nothing but + − × ÷ √, so that
//! modal damping has the same bits on every machine. Large ones give their lowest frequencies by subspace
//! iteration on a sparse factor. Frequencies are in rad/s. Damping plays no part here.

use nalgebra::{Cholesky, DMatrix};
use thiserror::Error;

use super::{Condensation, NotPositiveDefinite, Spd, SymMatrix, dot};

/// Largest number of degrees of freedom for which all modes are computed.
pub(crate) const LARGEST_DENSE: usize = 300;

/// Up to this size all modes are computed even if only a few frequencies are wanted.
const SMALL: usize = 100;

/// Reason why there are no frequencies. Degrees of freedom count from 0 here and from 1 in the text.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum EigenError {
    /// Too many degrees of freedom for all modes.
    #[error("all modes of {n} degrees of freedom were asked for, the limit is {limit}")]
    TooLarge {
        /// Degrees of freedom.
        n: usize,
        /// The limit.
        limit: usize,
    },
    /// The mass of the degrees of freedom that have mass is not positive definite.
    #[error("the mass matrix is {0}")]
    Mass(NotPositiveDefinite),
    /// A massless degree of freedom that no stiffness holds.
    #[error("the stiffness of the massless degrees of freedom is {0}")]
    Massless(NotPositiveDefinite),
    /// A negative stiffness makes a mode grow instead of swing.
    #[error(
        "a mode has the negative squared frequency {squared:e} rad²/s²: the stiffness is not positive semi-definite"
    )]
    Negative {
        /// ω², below zero by more than roundoff.
        squared: f64,
    },
    /// The iteration for a large model did not settle.
    #[error("the lowest {count} frequencies did not converge in {iterations} iterations")]
    NotConverged {
        /// How many were wanted.
        count: usize,
        /// How many iterations were spent.
        iterations: usize,
    },
}

/// All natural modes with finite frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct Modes {
    /// Natural frequencies in rad/s, ascending; 0 for a rigid-body mode.
    pub frequencies: Vec<f64>,
    /// n rows; column j is mode j with φᵀ M φ = 1 and its largest component positive.
    pub shapes: DMatrix<f64>,
}

/// All modes of K φ = ω² M φ for n ≤ [`LARGEST_DENSE`]; a massless degree of freedom follows the others
/// statically and adds no mode.
///
/// # Errors
/// See [`EigenError`].
pub fn modes(stiffness: &SymMatrix, mass: &SymMatrix) -> Result<Modes, EigenError> {
    let n = mass.n();
    if n > LARGEST_DENSE {
        return Err(EigenError::TooLarge {
            n,
            limit: LARGEST_DENSE,
        });
    }
    let (massless, massive): (Vec<usize>, Vec<usize>) = (0..n).partition(|&i| mass.row_is_zero(i));
    let in_user_numbering = |failure: NotPositiveDefinite, of: &[usize]| NotPositiveDefinite {
        dof: of[failure.dof],
        ..failure
    };
    let mut condensation = Condensation::new(stiffness, &massless).map_err(EigenError::Massless)?;
    let condensed = condensation.complement().to_dense();
    let inner_mass = mass.block(&massive);
    Spd::factor(&inner_mass)
        .map_err(|failure| EigenError::Mass(in_user_numbering(failure, &massive)))?;
    let (squared, inner) =
        pencil(condensed, inner_mass.to_dense()).ok_or(EigenError::Mass(NotPositiveDefinite {
            dof: 0,
            pivot: f64::NAN,
        }))?;

    let largest = squared.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    let roundoff = 16.0 * n as f64 * f64::EPSILON * largest;
    let mut frequencies = Vec::with_capacity(squared.len());
    for &value in &squared {
        if value < -roundoff {
            return Err(EigenError::Negative { squared: value });
        }
        frequencies.push(if value <= roundoff { 0.0 } else { value.sqrt() });
    }
    let mut shapes = DMatrix::zeros(n, massive.len());
    let mut shape = vec![0.0; n];
    for j in 0..massive.len() {
        for (i, &row) in massive.iter().enumerate() {
            shape[row] = inner[(i, j)];
        }
        condensation.follow(&mut shape);
        shapes.column_mut(j).copy_from_slice(&shape);
        let peak = (0..n).fold(0.0f64, |peak, i| {
            let value: f64 = shapes[(i, j)];
            // A later component must be clearly larger: roundoff does not decide the sign of a symmetric shape.
            if value.abs() > peak.abs() * (1.0 + 1e-9) {
                value
            } else {
                peak
            }
        });
        if peak < 0.0 {
            shapes.column_mut(j).neg_mut();
        }
    }
    Ok(Modes {
        frequencies,
        shapes,
    })
}

/// The lowest natural frequencies in rad/s, ascending; at most `count` of them, fewer if there are fewer modes.
///
/// # Errors
/// See [`EigenError`].
pub fn frequencies(
    stiffness: &SymMatrix,
    mass: &SymMatrix,
    count: usize,
) -> Result<Vec<f64>, EigenError> {
    let n = mass.n();
    if n <= SMALL || (n <= LARGEST_DENSE && 4 * count > n) {
        let mut all = modes(stiffness, mass)?.frequencies;
        all.truncate(count);
        return Ok(all);
    }
    Ok(subspace(stiffness, mass, count)?.frequencies)
}

/// The `count` lowest modes by subspace iteration on a sparse factor, for models of any size; fewer if there are fewer.
///
/// # Errors
/// See [`EigenError`].
pub fn lowest_modes(
    stiffness: &SymMatrix,
    mass: &SymMatrix,
    count: usize,
) -> Result<Modes, EigenError> {
    let n = mass.n();
    if n <= SMALL {
        let Modes {
            mut frequencies,
            shapes,
        } = modes(stiffness, mass)?;
        frequencies.truncate(count);
        let shapes = shapes.columns(0, frequencies.len()).into_owned();
        return Ok(Modes {
            frequencies,
            shapes,
        });
    }
    subspace(stiffness, mass, count)
}

/// The highest natural frequency in rad/s, found by bisection on the definiteness of s M − K; `None` if a massless
/// degree of freedom or a mass matrix that is not positive definite leaves it without a bound.
#[must_use]
pub fn highest_frequency(stiffness: &SymMatrix, mass: &SymMatrix) -> Option<f64> {
    Spd::factor(mass).ok()?;
    if stiffness.is_zero() {
        return Some(0.0);
    }
    let above = |s: f64| {
        Spd::factor(
            &SymMatrix::zeros(mass.n())
                .plus(s, mass)
                .plus(-1.0, stiffness),
        )
        .is_ok()
    };
    let mut high = trace(stiffness).abs() / trace(mass);
    // Doubling from the mean of all ω²: 1024 doublings exhaust the exponent.
    for _ in 0..1024 {
        if above(high) {
            break;
        }
        high *= 2.0;
    }
    let mut low = 0.0;
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if above(middle) {
            high = middle
        } else {
            low = middle
        }
    }
    high.is_finite().then(|| high.sqrt())
}

fn trace(matrix: &SymMatrix) -> f64 {
    (0..matrix.n()).map(|i| matrix.get(i, i)).sum()
}

/// Eigenvalues ascending and M-orthonormal vectors of the dense pencil (K, M); `None` if M has no Cholesky factor.
fn pencil(stiffness: DMatrix<f64>, mass: DMatrix<f64>) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let n = mass.nrows();
    let factor = Cholesky::new(mass)?;
    let lower = factor.l();
    // A = L⁻¹ K L⁻ᵀ
    let mut a = stiffness;
    lower.solve_lower_triangular_mut(&mut a);
    a.transpose_mut();
    lower.solve_lower_triangular_mut(&mut a);
    let mut rows = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            rows[i * n + j] = (a[(i, j)] + a[(j, i)]) / 2.0;
        }
    }
    let vectors = jacobi(&mut rows, n);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| rows[i * n + i].total_cmp(&rows[j * n + j]));
    let values = order.iter().map(|&i| rows[i * n + i]).collect();
    let mut shapes = DMatrix::from_fn(n, n, |i, j| vectors[order[j] * n + i]);
    lower.tr_solve_lower_triangular_mut(&mut shapes);
    Some((values, shapes))
}

/// Cyclic Jacobi (Golub & Van Loan, section 8.5): `a` becomes diagonal; returns the eigenvectors as rows.
fn jacobi(a: &mut [f64], n: usize) -> Vec<f64> {
    let mut vectors = vec![0.0; n * n];
    for i in 0..n {
        vectors[i * n + i] = 1.0;
    }
    let largest = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let floor = f64::EPSILON * f64::EPSILON * largest;
    // Convergence is quadratic: 6 to 10 sweeps; the bound only guards against NaN.
    for _ in 0..40 {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let apq = a[p * n + q];
                let (app, aqq) = (a[p * n + p], a[q * n + q]);
                let small = f64::EPSILON * (app * aqq).abs().sqrt();
                if apq.abs() <= small.max(floor) {
                    continue;
                }
                rotated = true;
                let tau = (aqq - app) / (2.0 * apq);
                let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
                let c = 1.0 / (1.0 + t * t).sqrt();
                let s = t * c;
                rotate_rows(a, n, p, q, c, s);
                for k in 0..n {
                    if k != p && k != q {
                        a[k * n + p] = a[p * n + k];
                        a[k * n + q] = a[q * n + k];
                    }
                }
                a[p * n + p] = app - t * apq;
                a[q * n + q] = aqq + t * apq;
                a[p * n + q] = 0.0;
                a[q * n + p] = 0.0;
                rotate_rows(&mut vectors, n, p, q, c, s);
            }
        }
        if !rotated {
            break;
        }
    }
    vectors
}

/// Rows p < q ← (c p − s q, s p + c q).
fn rotate_rows(a: &mut [f64], n: usize, p: usize, q: usize, c: f64, s: f64) {
    let (head, tail) = a.split_at_mut(q * n);
    for (x, y) in head[p * n..(p + 1) * n].iter_mut().zip(&mut tail[..n]) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

/// Subspace iteration (Bathe) with (K + σM)⁻¹ M; the shift keeps free bodies solvable.
fn subspace(stiffness: &SymMatrix, mass: &SymMatrix, count: usize) -> Result<Modes, EigenError> {
    const ITERATIONS: usize = 300;
    let n = mass.n();
    let massive = (0..n).filter(|&i| !mass.row_is_zero(i)).count();
    let count = count.min(massive);
    let width = (2 * count).max(count + 8).min(massive);
    let shift = 1e-7 * trace(stiffness).abs() / trace(mass).max(f64::MIN_POSITIVE);
    let mut factor = Spd::factor(&stiffness.plus(shift, mass)).map_err(EigenError::Massless)?;
    // Any fixed start that is not orthogonal to a mode will do (Lehmer's generator).
    let mut seed = 42u64;
    let mut vectors = DMatrix::from_fn(n, width, |_, _| {
        seed = seed * 48_271 % 2_147_483_647;
        seed as f64 / 2_147_483_647.0 - 0.5
    });
    let mut before = vec![f64::INFINITY; count];
    for _ in 0..ITERATIONS {
        let mut next = times(mass, &vectors);
        for mut column in next.column_iter_mut() {
            factor.solve_in_place(column.as_mut_slice());
            let norm = column.norm();
            column.unscale_mut(norm.max(f64::MIN_POSITIVE));
        }
        let inner_stiffness = inner_products(&next, &times(stiffness, &next));
        let inner_mass = inner_products(&next, &times(mass, &next));
        let Some((squared, shapes)) = pencil(inner_stiffness, inner_mass) else {
            // The block lost rank: fewer finite modes than columns.
            return Err(EigenError::NotConverged {
                count,
                iterations: ITERATIONS,
            });
        };
        vectors.fill(0.0);
        for (shape, mut vector) in shapes.column_iter().zip(vectors.column_iter_mut()) {
            for (factor, column) in shape.iter().zip(next.column_iter()) {
                vector.axpy(*factor, &column, 1.0);
            }
        }
        let floor = shift * 1e-6;
        let settled = squared
            .iter()
            .zip(&before)
            .all(|(now, before)| (now - before).abs() <= 1e-12 * now.abs().max(floor));
        before = squared.into_iter().take(count).collect();
        if settled {
            if let Some(&squared) = before.iter().find(|&&s| s < -floor) {
                return Err(EigenError::Negative { squared });
            }
            let frequencies = before.iter();
            let frequencies = frequencies.map(|&s| if s <= floor { 0.0 } else { s.sqrt() });
            return Ok(Modes {
                frequencies: frequencies.collect(),
                shapes: vectors.columns(0, count).into_owned(),
            });
        }
    }
    Err(EigenError::NotConverged {
        count,
        iterations: ITERATIONS,
    })
}

/// A V, column by column.
fn times(matrix: &SymMatrix, vectors: &DMatrix<f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(vectors.nrows(), vectors.ncols());
    for (v, mut p) in vectors.column_iter().zip(product.column_iter_mut()) {
        matrix.subtract_product(v.as_slice(), p.as_mut_slice());
    }
    product.neg_mut();
    product
}

/// Aᵀ B by plain dot products: the library's matrix product picks its kernel by processor.
fn inner_products(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(a.ncols(), b.ncols(), |i, j| {
        dot(a.column(i).as_slice(), b.column(j).as_slice())
    })
}
