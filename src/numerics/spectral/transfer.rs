//! The discrete transfer function (11) and the amplification matrix (16) of one degree of freedom.

use nalgebra::{Matrix2, Vector2};

use super::{Pole, quadratic};

/// G(z) = X/F with general α1 and α2, equation (11); degrees fall from left to right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transfer {
    /// b1 z + b0, in m/N times the denominator.
    pub numerator: [f64; 2],
    /// a2 z² + a1 z + a0.
    pub denominator: [f64; 3],
}

impl Transfer {
    /// For mass m (kg), Ω, ξ, Δt (s), α1 and α2.
    #[must_use]
    pub fn new(mass: f64, omega: f64, ratio: f64, dt: f64, alpha_1: f64, alpha_2: f64) -> Self {
        let square = omega * omega;
        let viscous = 2.0 * alpha_1 * omega * ratio;
        Self {
            numerator: [alpha_2 * dt * dt, (alpha_1 - alpha_2) * dt * dt],
            denominator: [
                mass,
                (alpha_2 * square + viscous - 2.0) * mass,
                ((alpha_1 - alpha_2) * square - viscous + 1.0) * mass,
            ],
        }
    }

    /// G at a point of the z plane.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn at(&self, z: Pole) -> Pole {
        let [b1, b0] = self.numerator;
        let [a2, a1, a0] = self.denominator;
        (z * b1 + b0) / (z * z * a2 + z * a1 + a0)
    }

    /// Roots of the denominator, equation (12).
    #[must_use]
    pub fn poles(&self) -> [Pole; 2] {
        let [a2, a1, a0] = self.denominator;
        quadratic(a2, a1, a0)
    }

    /// x\[0\] … x\[steps\] after a unit force at step 0 alone: G(z) as a series in 1/z.
    #[must_use]
    pub fn impulse_response(&self, steps: usize) -> Vec<f64> {
        let [b1, b0] = self.numerator;
        let [a2, a1, a0] = self.denominator;
        let mut response = Vec::with_capacity(steps + 1);
        for step in 0..=steps {
            let input = match step {
                1 => b1,
                2 => b0,
                _ => 0.0,
            };
            let before = |back: usize| {
                step.checked_sub(back)
                    .and_then(|at| response.get(at).copied())
                    .unwrap_or(0.0)
            };
            response.push((input - a1 * before(1) - a0 * before(2)) / a2);
        }
        response
    }
}

/// A and B of equations (14) to (16) for the state (x, v).
#[must_use]
pub fn amplification(
    mass: f64,
    omega: f64,
    ratio: f64,
    dt: f64,
    alpha_1: f64,
    alpha_2: f64,
) -> (Matrix2<f64>, Vector2<f64>) {
    let natural = omega / dt;
    let square = natural * natural;
    let a = Matrix2::new(
        1.0 - alpha_2 * square * dt * dt,
        dt - 2.0 * alpha_2 * ratio * natural * dt * dt,
        -alpha_1 * square * dt,
        1.0 - 2.0 * alpha_1 * ratio * natural * dt,
    );
    (
        a,
        Vector2::new(alpha_2 * dt * dt / mass, alpha_1 * dt / mass),
    )
}
