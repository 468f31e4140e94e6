//! The delay of an achieved displacement at which a hybrid test becomes unstable.
//!
//! A delay τ acts like the negative dashpot −k_e τ beside the specimen. Three statements of the same question: [`sdof`]
//! in closed form, [`continuous`] by the frequency at which the loop gain is one, [`discrete`] by the spectral radius of
//! the recursion with its history of commands. Specimens are linear here, at their estimated stiffness and damping.

mod continuous;
mod discrete;
mod single;

use nalgebra::DMatrix;
use thiserror::Error;

pub use continuous::{Critical, continuous};
pub use discrete::{DiscreteLimit, LONGEST_STEPS, discrete, recursion};
pub use single::{critical_lag, sdof, sdof_estimate};

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
    /// K̃ of M_eff = M + (Δt/2) C0 + Δt² K̃, n × n, where it is not K0/λ.
    pub weighted: Option<DMatrix<f64>>,
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
        /// Which.
        name: &'static str,
        /// What was given.
        found: f64,
    },
}
