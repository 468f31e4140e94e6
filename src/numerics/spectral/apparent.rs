//! Apparent frequency and damping of a numerical mode, equations (21) to (26).
//!
//! The angle of a pole is taken in all four quadrants: arctan(ε/σ) of equation (25) fails for σ < 0.

use nalgebra::ComplexField as _;
use std::f64::consts::PI;

use super::{Pole, poles};

/// Apparent oscillation of a complex pair of poles: z = exp(Ω̄ (−ξ̄ ± i √(1 − ξ̄²))), equation (23).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Apparent {
    /// Ω̄: apparent frequency times Δt.
    pub omega: f64,
    /// ξ̄: apparent damping ratio.
    pub ratio: f64,
}

impl Apparent {
    /// From a pole; none for a real one, which does not swing.
    #[must_use]
    pub fn of(pole: Pole) -> Option<Self> {
        let angle = libm::atan2(pole.im.abs(), pole.re);
        if !(pole.im != 0.0 && angle > 0.0) {
            return None;
        }
        let log = libm::log(pole.modulus());
        let omega = (angle * angle + log * log).sqrt();
        Some(Self {
            omega,
            ratio: -log / omega,
        })
    }
}

/// Ω̄ and ξ̄ of the family; none where the poles are real.
#[must_use]
pub fn apparent(omega: f64, ratio: f64, lambda: f64) -> Option<Apparent> {
    Apparent::of(poles(omega, ratio, lambda)[0])
}

/// PE = Ω/Ω̄ − 1, equation (26): positive for a period that is too long. None where the poles are real.
#[must_use]
pub fn period_error(omega: f64, ratio: f64, lambda: f64) -> Option<f64> {
    apparent(omega, ratio, lambda).map(|found| omega / found.omega - 1.0)
}

/// AD = 1 − exp(−2π ξ̄): the value of equation (21) at the numerical period.
#[must_use]
pub fn amplitude_decay(ratio: f64) -> f64 {
    -libm::expm1(-2.0 * PI * ratio)
}

/// λ whose undamped period is exact at Ω: Ω²/(Ω²/(4 sin²(Ω/2)) − 1) for 0 < Ω < π; 12 for Ω → 0, falling as Ω grows.
#[must_use]
pub fn zero_period_error_lambda(omega: f64) -> f64 {
    let chord = 2.0 * libm::sin(omega / 2.0);
    let square = omega * omega;
    if square < 1e-4 {
        // Ω²/(4 sin²(Ω/2)) − 1 = Ω²/12 + Ω⁴/240 + …: the series, where the difference cancels.
        return 12.0 / (1.0 + square / 20.0);
    }
    square / (square / (chord * chord) - 1.0)
}
