//! What can be wrong with a structure, and with its description.

use thiserror::Error;

use super::{DampingError, End};
use crate::frame::FrameError;
use crate::law::LawError;
use crate::linalg::{MatrixError, NotPositiveDefinite};
use gusset_quantity::domain::OutOfDomain;

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
        /// The entry and its fault.
        source: MatrixError,
    },
    /// An influence coefficient that is not finite.
    #[error("influence of degree of freedom {} is {found}, but must be finite", dof + 1)]
    Influence {
        /// From 0.
        dof: usize,
        /// The value found.
        found: f64,
    },
    /// A mass below zero.
    #[error("mass of degree of freedom {} is {found} kg, but must not be negative", dof + 1)]
    NegativeMass {
        /// From 0.
        dof: usize,
        /// The value found.
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
        /// The value found.
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

/// Why a description does not make a structure. Storeys count from 1.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum BuildError {
    /// A list of another length than the masses.
    #[error("{key} has {found} entries, but mass_kg has {expected}")]
    Length {
        /// Key in the test file.
        key: &'static str,
        /// Number of masses.
        expected: usize,
        /// Entries found.
        found: usize,
    },
    /// A value of one storey or floor outside its range.
    #[error("{key} of {place} {number} is {found}, but must be finite and not negative")]
    Value {
        /// Key in the test file.
        key: &'static str,
        /// "storey" or "floor".
        place: &'static str,
        /// From 1.
        number: usize,
        /// The value found.
        found: f64,
    },
    /// A value of a chain outside its range.
    #[error(transparent)]
    Parameter(#[from] OutOfDomain),
    /// No mass anywhere.
    #[error("every mass is zero: nothing would move")]
    NoMass,
    /// A matrix given twice, or missing.
    #[error("give {key} either inline or as {key}_file{}", if *both { ", not both" } else { "" })]
    Source {
        /// "mass", "stiffness" or "damping".
        key: &'static str,
        /// True if both are there.
        both: bool,
    },
    /// Rows of an inline matrix that differ in length.
    #[error("{key}: row {row} has {found} entries, but row 1 has {expected}")]
    Ragged {
        /// "mass", "stiffness" or "damping".
        key: &'static str,
        /// From 1.
        row: usize,
        /// Length of the first row.
        expected: usize,
        /// Length of this one.
        found: usize,
    },
    /// A matrix that is not symmetric, square and finite.
    #[error("{key}: {source}")]
    Matrix {
        /// Key, with the file if it came from one.
        key: String,
        /// The error.
        source: MatrixError,
    },
    /// A file that was not handed over.
    #[error("{key}: the file {file} was not read")]
    File {
        /// "mass_file", "stiffness_file" or "damping_file".
        key: &'static str,
        /// Its name.
        file: String,
    },
    /// Dashpots or a matrix and a rule at once.
    #[error("damping is given twice: as {given} and by a rule; remove one")]
    DampingTwice {
        /// The key that gives it.
        given: &'static str,
    },
    /// The rule gives no matrix.
    #[error("damping: {0}")]
    Damping(#[from] DampingError),
    /// A law with parameters outside their range.
    #[error("{element}: {source}")]
    Law {
        /// Name of the element.
        element: String,
        /// The error.
        source: LawError,
    },
    /// The parts do not make a structure.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A storey beyond the top, or 0.
    #[error("storey {storey} does not exist, the structure has storeys 1 to {storeys}")]
    NoSuchStorey {
        /// As given.
        storey: usize,
        /// Number of storeys.
        storeys: usize,
    },
    /// Matrices and frames have no storeys.
    #[error(
        "a structure given by matrices or as a frame has no storeys: describe the deformation by rows of a transformation"
    )]
    NoStoreys,
    /// The frame is wrong.
    #[error(transparent)]
    Frame(#[from] FrameError),
}
