//! Reduction of the linear part of a structure by the method of Craig and Bampton.
//!
//! A large model has far more directions than a test can integrate in real time. The reduced model keeps some of them and
//! describes the motion of the others, the interior, by static shapes and by its lowest modes with the kept directions fixed.
//! Without modes this is the condensation of Guyan. Source: R. R. Craig, M. C. C. Bampton (1968), AIAA Journal 6(7), 1313.
//!
//! [`Reduction`] holds the shapes Ψ as columns and makes Ψᵀ A Ψ of a matrix, Ψᵀ f of a load, and the coordinates of a motion.
//! A kept direction without mass stays without mass: its static shape moves massless directions alone, and the part of the shape
//! that has mass becomes a further coordinate. [`Reduction::accuracy`] compares the lowest modes with those of the full model.
//!
//! This member knows no file, no test and no time step. It solves by sparse factors and never fills a matrix of the full model.
//! One thread does all the work, so equal input gives equal bits. Begin reading with [`Reduction::new`].

mod accuracy;
mod basis;
mod factor;
mod modes;
#[cfg(test)]
mod tests;

pub use accuracy::{Accuracy, GroundShare};
pub use basis::{Coordinate, Reduction, ReductionError};

/// Σ aᵢ bᵢ in four sums, always in the same order.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a_blocks, a_rest) = a.as_chunks::<4>();
    let (b_blocks, b_rest) = b.as_chunks::<4>();
    for (a, b) in a_blocks.iter().zip(b_blocks) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    ((sums[0] + sums[1]) + (sums[2] + sums[3])) + rest
}

/// A x.
fn times(matrix: &gusset_numerics::linalg::SymMatrix, x: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; x.len()];
    matrix.subtract_product(x, &mut product);
    product.iter_mut().for_each(|value| *value = -*value);
    product
}

/// y ← y + a x.
fn add(y: &mut [f64], a: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}
