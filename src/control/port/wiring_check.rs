//! How it is checked which way round a specimen is wired, before the test.

use super::probe::{Pace, Probe};
use super::trend::Trend;
use super::wiring_fault::WiringFault;
use gusset_quantity::frame::AtStructure;
use gusset_quantity::units::AxisUnits;

/// How the wiring is checked.
#[derive(Debug, Clone, Default)]
pub enum WiringCheck {
    /// It is known, or the user does not want a check.
    #[default]
    Known,
    /// Not at all, and the user is warned of that.
    Unchecked,
    /// By the motion that brings the static load on.
    Settling(Trend),
    /// By a small motion and back.
    Probe {
        /// Along each axis, in m of the structure.
        amplitude: Vec<f64>,
        /// The estimate, n × n by rows, in N/m of the structure.
        stiffness: Vec<f64>,
        /// The reason of the user to accept a measured stiffness that is not near the estimate.
        accepted: Option<String>,
        /// How fast.
        pace: Pace,
        /// Units of the axes, for messages; empty where all is in m and N of the structure.
        units: Vec<AxisUnits>,
    },
}

impl WiringCheck {
    /// The small motion, from `start` in m of the structure, if that is the check.
    pub(super) fn probe(&self, start: AtStructure<&[f64]>) -> Option<Probe> {
        let Self::Probe {
            amplitude,
            stiffness,
            accepted,
            pace,
            units,
        } = self
        else {
            return None;
        };
        let units = if units.is_empty() {
            &vec![AxisUnits::SI; start.len()]
        } else {
            units
        };
        let estimate = (stiffness.as_slice(), accepted.is_some());
        Some(Probe::new(&start, amplitude, estimate, units, *pace))
    }

    /// The reason of the user to accept a measured stiffness that is not near the estimate.
    #[must_use]
    pub fn accepted(&self) -> Option<&str> {
        match self {
            Self::Probe { accepted, .. } => accepted.as_deref(),
            _ => None,
        }
    }

    /// True if the motion that brings the static load on is the check.
    pub(crate) const fn is_by_static_load(&self) -> bool {
        matches!(self, Self::Settling(_))
    }

    /// A reading at rest before the static load comes on: target, displacement and force. Real-time: yes.
    pub(super) fn rest(&mut self, [target, disp, force]: [AtStructure<&[f64]>; 3]) {
        if let Self::Settling(trend) = self {
            trend.rest(&target, &disp, &force);
        }
    }

    /// A reading at rest while the static load comes on. Real-time: yes.
    ///
    /// # Errors
    /// A channel is reversed.
    pub(super) fn moved(
        &mut self,
        [target, disp, force]: [AtStructure<&[f64]>; 3],
    ) -> Result<(), WiringFault> {
        match self {
            Self::Settling(trend) => trend.moved(&target, &disp, &force),
            _ => Ok(()),
        }
    }

    /// The axes (from 0) whose wiring the static load did not show.
    pub(crate) fn unshown(&self) -> Vec<usize> {
        match self {
            Self::Settling(trend) => trend.unshown().collect(),
            _ => Vec::new(),
        }
    }
}
