//! Coefficients of the target and its backward differences that undo what was measured of the actuator.
//!
//! They minimise |1 − H(ω) (a₀ + a₁ D + a₂ D²)| over the points that are trusted, with D = (1 − e^{−iωΔt})/Δt, the operator
//! that compensators difference with: its own half tick of delay is in a₂.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::Point;
use super::lines::C64;

/// What undoes an actuator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inverse {
    /// a₀, a₁ in s, a₂ in s², as `model_inverse` and the start of `ats` take them; none is negative.
    pub coefficients: Vec<f64>,
    /// Root mean square of |1 − chain| that remains in the band.
    pub residual: f64,
}

/// The inverse of order 2, or of a lower one where a coefficient would be negative.
pub(super) fn invert(points: &[Point], dt: f64) -> Option<Inverse> {
    let responses: Vec<(f64, C64)> = points
        .iter()
        .filter(|point| point.trusted)
        .map(|point| {
            let omega = 2.0 * std::f64::consts::PI * point.hz;
            let (sine, cosine) = libm::sincos(-omega * point.delay_s);
            (omega, C64::new(cosine, sine) * point.gain)
        })
        .collect();
    (1..=3)
        .rev()
        .filter_map(|count| solve(&responses, count, dt))
        .find(|inverse| inverse.coefficients.iter().all(|a| *a >= 0.0))
}

fn solve(responses: &[(f64, C64)], count: usize, dt: f64) -> Option<Inverse> {
    let columns: Vec<Vec<C64>> = responses
        .iter()
        .map(|(omega, response)| {
            let (sine, cosine) = libm::sincos(-omega * dt);
            let difference = (C64::new(1.0, 0.0) - C64::new(cosine, sine)) / dt;
            let mut power = *response;
            (0..count)
                .map(|_| {
                    let column = power;
                    power *= difference;
                    column
                })
                .collect()
        })
        .collect();
    if columns.len() < count {
        return None;
    }
    // The powers of a difference are of very different size.
    let scale = |j: usize| {
        let square: f64 = columns.iter().map(|row| row[j].norm_sqr()).sum();
        square.sqrt()
    };
    let scales: Vec<f64> = (0..count).map(scale).collect();
    let curvature: DMatrix<f64> = DMatrix::from_fn(count, count, |i, j| {
        let product = |row: &Vec<C64>| (row[i].conj() * row[j]).re;
        columns.iter().map(product).sum::<f64>() / (scales[i] * scales[j])
    });
    let slope: DVector<f64> = DVector::from_fn(count, |i, _| {
        columns.iter().map(|row| row[i].re).sum::<f64>() / scales[i]
    });
    let solution = curvature.cholesky()?.solve(&slope);
    let coefficients: Vec<f64> = solution.iter().zip(&scales).map(|(a, s)| a / s).collect();
    let left: f64 = columns
        .iter()
        .map(|row| {
            let terms = row.iter().zip(&coefficients);
            let chain: C64 = terms.map(|(column, a)| column * *a).sum();
            (C64::new(1.0, 0.0) - chain).norm_sqr()
        })
        .sum();
    Some(Inverse {
        coefficients,
        residual: (left / columns.len() as f64).sqrt(),
    })
}
