//! Amplification matrices of the methods that the family is compared with, for the state (x, Δt v, Δt² a) of one
//! linear degree of freedom.

use nalgebra::{DMatrix, Matrix3};

use super::{Apparent, eigenvalues};

/// a⁺ as a row over the old state, given x⁺ and v⁺ without their own share of a⁺, and those shares.
fn closed(disp: [f64; 4], vel: [f64; 4], omega: f64, ratio: f64) -> Matrix3<f64> {
    let (stiffness, damping) = (omega * omega, 2.0 * ratio * omega);
    let below = 1.0 + stiffness * disp[3] + damping * vel[3];
    let accel = |k: usize| -(stiffness * disp[k] + damping * vel[k]) / below;
    Matrix3::from_fn(|row, k| match row {
        0 => disp[k] + disp[3] * accel(k),
        1 => vel[k] + vel[3] * accel(k),
        _ => accel(k),
    })
}

/// Newmark with γ and β.
#[must_use]
pub fn newmark(gamma: f64, beta: f64, omega: f64, ratio: f64) -> Matrix3<f64> {
    closed(
        [1.0, 1.0, 0.5 - beta, beta],
        [0.0, 1.0, 1.0 - gamma, gamma],
        omega,
        ratio,
    )
}

/// Chang (2002), explicit in displacement alone.
#[must_use]
pub fn chang(omega: f64, ratio: f64) -> Matrix3<f64> {
    let d = 1.0 + omega * ratio + omega * omega / 4.0;
    closed(
        [1.0, (1.0 + omega * ratio) / d, 0.5 / d, 0.0],
        [0.0, 1.0, 0.5, 0.5],
        omega,
        ratio,
    )
}

/// KR-α or MKR-α, with α1, α2 and α3 as printed.
#[cfg(test)]
pub(crate) fn alpha_method(
    weights: crate::integrate::AlphaWeights,
    omega: f64,
    ratio: f64,
) -> Matrix3<f64> {
    let crate::integrate::AlphaWeights {
        alpha_m,
        alpha_f,
        gamma,
        beta,
    } = weights;
    let (stiffness, damping) = (omega * omega, 2.0 * ratio * omega);
    let below = 1.0 + gamma * damping + beta * stiffness;
    let alpha_1 = 1.0 / below;
    let alpha_2 = (0.5 + gamma) * alpha_1;
    let alpha_3 = (alpha_m + alpha_f * (gamma * damping + beta * stiffness)) / below;
    let disp = [1.0, 1.0, alpha_2];
    let vel = [0.0, 1.0, alpha_1];
    let old = [stiffness, damping, 0.0];
    let accel = |k: usize| {
        let new = stiffness * disp[k] + damping * vel[k];
        let own = if k == 2 { alpha_3 } else { 0.0 };
        -((1.0 - alpha_f) * new + alpha_f * old[k] + own) / (1.0 - alpha_3)
    };
    Matrix3::from_fn(|row, k| match row {
        0 => disp[k],
        1 => vel[k],
        _ => accel(k),
    })
}

/// Apparent oscillation of the mode itself: the complex eigenvalue nearest to exp(i Ω).
#[must_use]
pub fn principal(matrix: &Matrix3<f64>, omega: f64) -> Option<Apparent> {
    let dense = DMatrix::from_fn(3, 3, |i, j| matrix[(i, j)]);
    let found = eigenvalues(&dense)?.into_iter().filter_map(Apparent::of);
    found.min_by(|a, b| {
        let away = |apparent: &Apparent| (apparent.omega - omega).abs();
        away(a).total_cmp(&away(b))
    })
}
