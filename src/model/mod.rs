//! The numerical substructure: M, C, K, nonlinear elements, and the internal force of one instant.
//!
//! A [`Structure`] that exists is valid: matrices of one size, finite, the mass positive semi-definite with zero
//! rows for massless degrees of freedom, every element between two distinct ends of which one is a degree of
//! freedom. It knows nothing of time steps except the `dt` that laws with memory are handed; integration is
//! [`crate::integrate`]'s affair. Descriptions from a test file are in [`StructureSpec`]; files are parsed from
//! bytes ([`parse_matrix`]), never read here.

mod accel;
mod build;
mod damping;
mod npy;
mod parse;
mod spec;
mod structure;

use std::fmt;

use thiserror::Error;

pub use accel::Acceleration;
pub use build::{BuildError, MatrixFiles};
pub use damping::DampingError;
pub use npy::NpyError;
pub use parse::{MatrixTable, ParseError, parse_matrix};
pub use spec::{
    ChainSpec, DampingSpec, ElementSpec, MatricesSpec, ModalSpec, RayleighRatioSpec, RayleighSpec,
    ShearBuildingSpec, StructureSpec,
};
pub use structure::Structure;

use crate::law::{Law, Reach};
use crate::linalg::{MatrixError, NotPositiveDefinite};

/// What an element is fastened to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum End {
    /// A degree of freedom, counted from 0 (test files and messages count from 1).
    Dof(usize),
    /// The base: moves with it under base displacement, rests in relative coordinates.
    Ground,
    /// The inertial frame: never moves. In relative coordinates the same as the ground.
    Fixed,
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            End::Dof(dof) => write!(f, "degree of freedom {}", dof + 1),
            End::Ground => f.write_str("ground"),
            End::Fixed => f.write_str("fixed"),
        }
    }
}

/// A law between two ends. Its deformation is x(to) − x(from); a positive force pulls the ends together.
#[derive(Debug)]
pub struct Element {
    /// Name in reports and messages.
    pub name: String,
    /// Where the deformation is counted from.
    pub from: End,
    /// Where it is counted to.
    pub to: End,
    /// The force.
    pub law: Box<dyn Law>,
    /// Largest deformation and velocity that the user expects, as far as declared.
    pub reach: Reach,
    /// Declared bound of the tangent stiffness over the reference stiffness, ≥ 1; takes the place of the law's own.
    pub hardening_ratio: Option<f64>,
    /// Declared bound of the tangent damping over the reference damping, ≥ 1; takes the place of the law's own.
    pub damping_ratio: Option<f64>,
}

/// Motion of the base in absolute coordinates; zeros in relative ones (ground acceleration as a load).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Base {
    /// x_g in m.
    pub disp: f64,
    /// ẋ_g in m/s.
    pub vel: f64,
}

/// A named, uniaxial share of K and C, for the proof of stability: k b bᵀ with the row b.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Name in reports.
    pub name: String,
    /// Non-zero entries of b: (degree of freedom from 0, coefficient).
    pub row: Vec<(usize, f64)>,
    /// Upper bound of the tangent stiffness, N/m.
    pub stiffness_bound: f64,
    /// Damping in C0, N s/m.
    pub damping: f64,
    /// Upper bound of the tangent damping, N s/m.
    pub damping_bound: f64,
}

impl Part {
    /// b · shape.
    #[must_use]
    pub fn deformation(&self, shape: &[f64]) -> f64 {
        let terms = self.row.iter();
        terms
            .map(|&(dof, b)| b * shape.get(dof).copied().unwrap_or(0.0))
            .sum()
    }
}

/// Why matrices and elements do not make a structure.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// No degree of freedom.
    #[error("a structure needs at least one degree of freedom")]
    Empty,
    /// A matrix or vector of another size.
    #[error("{what} has {found} degrees of freedom, but the mass matrix has {expected}")]
    Size {
        /// "stiffness", "damping" or "influence".
        what: &'static str,
        /// Rows of the mass matrix.
        expected: usize,
        /// Rows found.
        found: usize,
    },
    /// An entry that is not finite.
    #[error("{what}: {source}")]
    Entry {
        /// "mass", "damping" or "stiffness".
        what: &'static str,
        /// Which entry.
        source: MatrixError,
    },
    /// An influence coefficient that is not finite.
    #[error("influence of degree of freedom {} is {found}, but must be finite", dof + 1)]
    Influence {
        /// From 0.
        dof: usize,
        /// What was found.
        found: f64,
    },
    /// A mass below zero.
    #[error("mass of degree of freedom {} is {found} kg, but must not be negative", dof + 1)]
    NegativeMass {
        /// From 0.
        dof: usize,
        /// What was found.
        found: f64,
    },
    /// A full mass matrix without a Cholesky factor.
    #[error("the mass matrix is {0}")]
    Mass(NotPositiveDefinite),
    /// An element on a degree of freedom that does not exist.
    #[error("{element}: degree of freedom {} does not exist, the structure has {dofs}", dof + 1)]
    NoSuchDof {
        /// Name of the element.
        element: String,
        /// From 0.
        dof: usize,
        /// Degrees of freedom of the structure.
        dofs: usize,
    },
    /// An element from a point to itself, or between ground and frame.
    #[error(
        "{element}: lies between {from} and {to}, but must join two different points of which one is a degree of freedom"
    )]
    Ends {
        /// Name of the element.
        element: String,
        /// One end.
        from: End,
        /// The other.
        to: End,
    },
    /// A declared number outside its range.
    #[error("{element}: {key} is {found}, but must be {allowed}")]
    Declared {
        /// Name of the element.
        element: String,
        /// Key in the test file.
        key: &'static str,
        /// What was found.
        found: f64,
        /// The range, in words.
        allowed: &'static str,
    },
    /// The tangent of a law has no bound without a declared reach.
    #[error("{element}: the tangent {tangent} has no bound unless {key} (or {ratio}) is given")]
    NoBound {
        /// Name of the element.
        element: String,
        /// "stiffness" or "damping".
        tangent: &'static str,
        /// The reach that is missing.
        key: &'static str,
        /// The ratio that would do instead.
        ratio: &'static str,
    },
}

#[cfg(test)]
mod tests;
