//! The map between one axis of a specimen and the structure: a row of B, gains and offsets.
//!
//! Invariant: both directions use the same gains, so a command that is followed exactly comes back as its own target.

use super::error::PortError;
use gusset_quantity::frame::{AtAxis, AtStructure};
use gusset_quantity::state;

/// One axis of a specimen as the structure sees it: the row of B and the map between the two systems of units.
///
/// Command = `disp_gain`·d + `disp_offset`, force = `force_gain`·(raw − `force_offset`). The gains carry
/// sign, scale, similitude and unit; for a specimen in SI units and full scale they are 1 and the offsets 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Nonzero entries of the row of B: degree of freedom (from 0) and coefficient. Of an actuator: what the stroke is of
    /// small displacements.
    pub row: Vec<(usize, f64)>,
    /// b·ι: the part of a base displacement that this deformation does not see.
    pub base: f64,
    /// Specimen displacement units per metre.
    pub disp_gain: f64,
    /// Command at d = 0, in the specimen's unit.
    pub disp_offset: f64,
    /// Reading of the displacement sensor there less the command: 0 unless it was found while zeroing.
    pub measured_offset: f64,
    /// Specimen velocity units per m/s.
    pub vel_gain: f64,
    /// Newtons at the structure per unit of raw force.
    pub force_gain: f64,
    /// Raw force to be taken as zero, in the specimen's unit.
    pub force_offset: f64,
}

// What zeroing has found.
state! {
    Axis { disp_offset, measured_offset, force_offset } keeps { row, base, disp_gain, vel_gain, force_gain }
}

impl Axis {
    /// An axis in SI units at full scale.
    #[must_use]
    pub fn plain(row: Vec<(usize, f64)>) -> Self {
        Self {
            row,
            base: 0.0,
            disp_gain: 1.0,
            disp_offset: 0.0,
            measured_offset: 0.0,
            vel_gain: 1.0,
            force_gain: 1.0,
            force_offset: 0.0,
        }
    }

    /// An axis that another controller commands in its own units: a command stays what it is to the last bit, and so does zero with
    /// its sign.
    pub(super) fn received() -> Self {
        Self {
            disp_offset: -0.0,
            ..Self::plain(Vec::new())
        }
    }

    /// Refuses rows of B beyond `dofs` degrees of freedom, and gains that cannot be undone; the axis counts from 0.
    pub(super) fn check(&self, index: usize, dofs: usize) -> Result<(), PortError> {
        if let Some(&(dof, _)) = self.row.iter().find(|&&(dof, _)| dof >= dofs) {
            return Err(PortError::Dof {
                row: index + 1,
                dof: dof + 1,
                dofs,
            });
        }
        let gains = [
            ("displacement gain", self.disp_gain),
            ("velocity gain", self.vel_gain),
            ("force gain", self.force_gain),
        ];
        let bad = gains.iter().find(|(_, g)| !(g.is_finite() && *g != 0.0));
        bad.map_or(Ok(()), |&(what, found)| {
            Err(PortError::Gain {
                axis: index + 1,
                what,
                found: found.to_string(),
            })
        })
    }

    /// The command in the specimen's unit for d in m at the structure. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn command(&self, deformation: AtStructure<f64>) -> AtAxis<f64> {
        AtAxis(self.disp_gain * deformation.0 + self.disp_offset)
    }

    /// d in m at the structure for which this is the command, in the specimen's unit. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn deformation(&self, command: AtAxis<f64>) -> AtStructure<f64> {
        AtStructure((command.0 - self.disp_offset) / self.disp_gain)
    }

    /// Displacement in m and force in N at the structure of a measurement in the specimen's units. Real-time: yes.
    #[inline]
    pub(super) fn at_structure(&self, raw: AtAxis<(f64, f64)>) -> AtStructure<(f64, f64)> {
        let AtAxis((disp, force)) = raw;
        let disp = (disp - self.measured_offset - self.disp_offset) / self.disp_gain;
        AtStructure((disp, self.force_gain * (force - self.force_offset)))
    }

    /// b·x and b·v, relative to the base. Real-time: yes.
    #[inline]
    pub(super) fn dots(&self, state: [&[f64]; 2], base: [f64; 2]) -> (f64, f64) {
        dots(&self.row, self.base, state, base)
    }
}

/// b·x and b·v, relative to the base; not a number if b has an entry that x or v lacks: no command of it may leave. Real-time: yes.
#[inline]
pub(super) fn dots(
    row: &[(usize, f64)],
    base_part: f64,
    [x, v]: [&[f64]; 2],
    [base_disp, base_vel]: [f64; 2],
) -> (f64, f64) {
    let (mut disp, mut vel) = (0.0, 0.0);
    for &(dof, coefficient) in row {
        let at = |of: &[f64]| of.get(dof).copied().unwrap_or(f64::NAN);
        disp += coefficient * at(x);
        vel += coefficient * at(v);
    }
    (disp - base_part * base_disp, vel - base_part * base_vel)
}
