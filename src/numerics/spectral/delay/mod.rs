//! The delay of an achieved displacement at which a hybrid test becomes unstable.
//!
//! A delay τ acts like the negative dashpot −k_e τ beside the specimen. Two statements of the same question: [`continuous()`] by the frequency at which the loop gain is one, [`discrete()`] by the spectral radius of
//! the recursion with its history of commands. Specimens are linear here, at their estimated stiffness and damping.

mod continuous;
mod discrete;
mod late;
#[cfg(test)]
mod tests;

use nalgebra::{Complex, ComplexField as _, DMatrix};
use thiserror::Error;

pub use continuous::{Critical, continuous};
pub use discrete::{DiscreteLimit, discrete, recursion};
pub use late::Weights;
#[cfg(test)]
pub(crate) use tests::{critical_lag, sdof, sdof_estimate};

/// Growth over the largest pole that is roundoff: the double pole of a body that moves freely carries its square root.
const AT_REST: f64 = 1e-6;

/// A linear structure with one specimen of r axes whose motion arrives late. SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Delayed {
    /// M, n × n.
    pub mass: DMatrix<f64>,
    /// C of everything but the delayed specimen, n × n.
    pub damping: DMatrix<f64>,
    /// K of everything but the delayed specimen, n × n.
    pub stiffness: DMatrix<f64>,
    /// B, r × n: deformations of the specimen's axes.
    pub rows: DMatrix<f64>,
    /// Stiffness of the specimen, r × r.
    pub specimen_stiffness: DMatrix<f64>,
    /// Damping of the specimen, r × r.
    pub specimen_damping: DMatrix<f64>,
    /// Mass in kg that moves with each axis and whose inertia is in the specimen's force: as late as that force, and not
    /// part of M.
    pub specimen_mass: f64,
    /// K̃ of M_eff = M + (Δt/2) C0 + Δt² K̃, n × n, where it is not K0/λ.
    pub weighted: Option<DMatrix<f64>>,
    /// Weights of the commands of the ticks of a step, from the one at the target back; empty where the specimen is commanded once
    /// a step.
    pub ticks: Vec<Weights>,
}

impl Delayed {
    /// Places and widths in rad/s of the poles of the whole, nothing delayed, for [`super::unstable_roots`]; none where the
    /// mass has no inverse.
    #[must_use]
    pub fn marks(&self) -> Vec<(f64, f64)> {
        let poles = self.poles();
        let above = poles.iter().filter(|pole| pole.im > 0.0);
        above.map(|pole| (pole.im, pole.re.abs())).collect()
    }

    /// How fast the whole grows in continuous time with nothing delayed, in 1/s; none if nothing in it grows by more than
    /// roundoff, or the mass has no inverse.
    #[must_use]
    pub fn growth(&self) -> Option<f64> {
        let poles = self.poles();
        let largest = poles.iter().map(|pole| pole.modulus()).fold(0.0, f64::max);
        let fastest = poles.iter().map(|pole| pole.re).fold(0.0, f64::max);
        (fastest > AT_REST * largest).then_some(fastest)
    }

    /// The poles of the whole in rad/s, nothing delayed; none where the mass has no inverse.
    fn poles(&self) -> Vec<Complex<f64>> {
        let n = self.mass.nrows();
        let square = self.rows.transpose() * &self.rows;
        let Some(mass) = (&self.mass + square * self.specimen_mass).cholesky() else {
            return Vec::new();
        };
        let whole = |own: &DMatrix<f64>, of_specimen: &DMatrix<f64>| {
            mass.solve(&(own + self.rows.transpose() * of_specimen * &self.rows))
        };
        let stiffness = whole(&self.stiffness, &self.specimen_stiffness);
        // Time in units in which displacement and velocity are of one size.
        let scale = (stiffness.trace().abs() / n as f64).sqrt();
        if !(scale > 0.0 && scale.is_finite()) {
            return Vec::new();
        }
        let damping = whole(&self.damping, &self.specimen_damping) / -scale;
        let mut state = DMatrix::zeros(2 * n, 2 * n);
        state.view_mut((0, n), (n, n)).fill_with_identity();
        let stiffness = stiffness / (-scale * scale);
        state.view_mut((n, 0), (n, n)).copy_from(&stiffness);
        state.view_mut((n, n), (n, n)).copy_from(&damping);
        let poles = super::eigenvalues(&state).unwrap_or_default();
        poles
            .iter()
            .map(|pole| Complex::new(scale * pole.re, scale * pole.im))
            .collect()
    }
}

/// Why no critical delay is known.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum DelayError {
    /// The mass has no inverse.
    #[error("degrees of freedom without mass have no delay analysis")]
    Massless,
    /// The loop gain of several axes at once is no single number.
    #[error("the specimen has {axes} axes, the frequency condition is for one")]
    Axes {
        /// Its axes.
        axes: usize,
    },
    /// Unstable before any delay.
    #[error("unstable without any delay: spectral radius {radius}")]
    Unstable {
        /// Spectral radius of the recursion.
        radius: f64,
    },
    /// The eigenvalue iteration did not end.
    #[error("the eigenvalues did not converge")]
    Eigenvalues,
    /// Δt or λ is not a positive number.
    #[error("{name} is {found}, but must be greater than 0")]
    Parameter {
        /// The number.
        name: &'static str,
        /// The value given.
        found: f64,
    },
}
