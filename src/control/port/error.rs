//! Why a specimen cannot be joined to a structure.

use thiserror::Error;

/// A port whose parts do not fit together.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PortError {
    /// B and the substructure disagree about the number of axes.
    #[error("B has {rows} rows, but the specimen has {axes} axes")]
    Axes {
        /// Rows of B.
        rows: usize,
        /// Axes of the substructure.
        axes: usize,
    },
    /// A row of B names a degree of freedom that does not exist.
    #[error("row {row} of B names DOF {dof}, but the structure has {dofs}")]
    Dof {
        /// Row of B, from 1.
        row: usize,
        /// Degree of freedom, from 1.
        dof: usize,
        /// Degrees of freedom of the structure.
        dofs: usize,
    },
    /// A gain that is zero or not finite cannot be undone.
    #[error("axis {axis}: the {what} is {found}, but must be finite and not zero")]
    Gain {
        /// Axis, from 1.
        axis: usize,
        /// Which gain.
        what: &'static str,
        /// What was found, as text so that the error can be compared.
        found: String,
    },
    /// A list whose length does not fit.
    #[error("{found} {what}, but there must be {wanted}")]
    Length {
        /// Name of the counted items.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there must be.
        wanted: usize,
    },
}

/// Refuses a list whose length does not fit.
pub(super) const fn fits(what: &'static str, found: usize, wanted: usize) -> Result<(), PortError> {
    if found == wanted {
        return Ok(());
    }
    Err(PortError::Length {
        what,
        found,
        wanted,
    })
}
