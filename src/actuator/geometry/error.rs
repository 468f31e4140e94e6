//! Why a description is no geometry.

use thiserror::Error;

use super::{Fault, MOST};

/// An invalid geometry. Actuators and rows count from 1.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GeometryError {
    /// None, or more than one, of the three forms.
    #[error("`geometry` has {found} of `plane`, `space` and `matrix`, but must have exactly one")]
    Forms {
        /// How many were given.
        found: usize,
    },
    /// No actuator, or too many.
    #[error("`{key}` has {found} actuators, but must have 1 to {MOST}")]
    Count {
        /// Which form.
        key: &'static str,
        /// How many were given.
        found: usize,
    },
    /// The driven coordinates are not declared, and there is more than one choice.
    #[error(
        "`coordinates` must say which coordinates of the platform the structure drives: {actuators} actuators in `{key}` can \
         hold several choices of them"
    )]
    Unsaid {
        /// Which form.
        key: &'static str,
        /// How many there are.
        actuators: usize,
    },
    /// Too many, too few or repeated coordinates.
    #[error("`coordinates` has {found}, but {wanted}")]
    Coordinates {
        /// The value that was given.
        found: String,
        /// The values that are allowed.
        wanted: String,
    },
    /// A row of the matrix of another length.
    #[error("row {row} of `matrix` has {found} numbers, but there are {wanted} coordinates")]
    Row {
        /// Row, from 1.
        row: usize,
        /// Its length.
        found: usize,
        /// One number per coordinate.
        wanted: usize,
    },
    /// The two pins of an actuator are in one place.
    #[error("actuator {actuator}: both pins are at the same place, so it has no direction")]
    NoLength {
        /// Actuator, from 1.
        actuator: usize,
    },
    /// Something is not a finite number.
    #[error("actuator {actuator}: {key} is not a finite number")]
    NotFinite {
        /// Actuator, from 1.
        actuator: usize,
        /// The wrong key.
        key: &'static str,
    },
    /// An invalid range of lengths, or one that excludes the reference pose.
    #[error(
        "actuator {actuator}: its pins are {length:.6} m apart at the reference pose, but `length_m` allows {} to {} m",
        range[0],
        range[1]
    )]
    Length {
        /// Actuator, from 1.
        actuator: usize,
        /// Pin to pin, m.
        length: f64,
        /// The allowed lengths, m.
        range: [f64; 2],
    },
    /// A matrix has no pins that could move.
    #[error("`exact` needs the pins of the actuators: a matrix is for small displacements only")]
    ExactMatrix,
    /// The reference pose is singular.
    #[error("the geometry is {0}")]
    Fault(Fault),
}

impl GeometryError {
    /// The key that is wrong, for messages that show its place.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            GeometryError::Count { key, .. } | GeometryError::Unsaid { key, .. } => key,
            GeometryError::Coordinates { .. } => "coordinates",
            GeometryError::Row { .. } => "matrix",
            GeometryError::NotFinite { key, .. } => key,
            GeometryError::NoLength { .. } => "base_m",
            GeometryError::Length { .. } => "length_m",
            GeometryError::ExactMatrix => "exact",
            GeometryError::Forms { .. } | GeometryError::Fault(_) => "geometry",
        }
    }
}
