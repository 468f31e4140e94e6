//! The numerical substructure: M, C, K, nonlinear elements, and the internal force of one instant.
//!
//! A [`Structure`] that exists is valid: matrices of one size, finite, the mass positive semi-definite with zero
//! rows for massless degrees of freedom, every element between two distinct ends of which one is a degree of
//! freedom. It knows nothing of time steps except the `dt` that laws with memory are handed; integration is
//! [`crate::integrate`]'s affair. Descriptions from a test file are in [`StructureSpec`]; files are parsed from
//! bytes ([`parse_matrix`]), never read here.

mod accel;
mod build;
mod by_rows;
mod damping;
mod element;
mod elements;
mod error;
mod parse;
mod point;
mod rows;
mod run;
mod sound;
mod spec;
mod strip;
mod structure;
mod table;

use std::fmt;

pub use accel::Acceleration;
pub use build::{Linear, MatrixFiles, SpecimenShare};
pub use damping::DampingError;
pub use error::{BuildError, ModelError};
pub use parse::{ParseError, ParseFault, parse_matrix};
pub use spec::{
    ChainSpec, DampingSpec, ElementSpec, MatricesSpec, ModalSpec, PDeltaSpec, RayleighRatioSpec,
    RayleighSpec, ShearBuildingSpec, StiffnessPart, StructureSpec,
};
pub use structure::{Storey, Structure};
pub use table::MatrixTable;

use crate::law::{Law, Reach};

/// End point of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum End {
    /// A degree of freedom, counted from 0 (test files and messages count from 1).
    Dof(usize),
    /// The base: moves with it under base displacement, rests in relative coordinates.
    Ground,
    /// The inertial frame: never moves. Coordinates that move with the ground do not know it. In them it acts as the ground
    /// here, and test files must not use it.
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
    /// End to which it is counted.
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

/// The motion that determines the forces of one instant.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// x in m, one entry per degree of freedom.
    pub disp: &'a [f64],
    /// ẋ in m/s.
    pub vel: &'a [f64],
    /// The base.
    pub base: Base,
    /// Time since the last accepted step in s; 0 for the first or a hold.
    pub dt: f64,
}

impl<'a> Motion<'a> {
    /// Displacement and velocity of all degrees of freedom, on this base, `dt` after the last accepted step.
    #[inline]
    #[must_use]
    pub const fn new(disp: &'a [f64], vel: &'a [f64], base: Base, dt: f64) -> Self {
        Self {
            disp,
            vel,
            base,
            dt,
        }
    }
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

#[cfg(test)]
mod tests;
