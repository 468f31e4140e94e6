//! Specimens in process: deformations in, resisting forces out, with commit and revert.
//!
//! A [`Specimen`] is pure mathematics, so the same object serves in the loop, behind a server and in a
//! simulated link. [`InProcess`] makes a [`Substructure`](gusset_quantity::substructure::Substructure) of it.

/// Methods that a wrapper passes on to the specimen inside: `passed_on!(self => self.inner)` within its `impl Specimen`.
macro_rules! passed_on {
    ($self:ident => $inner:expr) => {
        fn is_saturated(&$self) -> bool {
            $inner.is_saturated()
        }

        fn is_settled(&$self) -> bool {
            $inner.is_settled()
        }

        fn commanded_every(&mut $self, seconds: f64) {
            $inner.commanded_every(seconds);
        }

        fn commit(&mut $self) {
            $inner.commit();
        }

        fn revert(&mut $self) {
            $inner.revert();
        }
    };
}

mod bearing;
mod coupled;
mod in_process;
mod in_units;
mod mounted;
mod platform;
mod spec;
mod stiffened;
mod uniaxial;

#[cfg(test)]
mod tests;

pub use coupled::{Coupled, CoupledSpec};
pub use gusset_numerics::law::BearingSpec;
pub use in_process::InProcess;
pub use in_process::status;
pub use in_units::InUnits;
pub use mounted::Mounted;
pub use platform::{Gear, Platform};
pub use spec::SpecimenLaw;
pub use stiffened::Stiffened;
pub(crate) use uniaxial::Uniaxial;

use gusset_numerics::law::Reach;
use gusset_quantity::state::Stateful;

/// The object behind a command: one or more axes with memory. Matrices are n × n, stored by columns.
///
/// All methods are on the real-time path, unless their comment excludes it.
pub trait Specimen: Stateful + Send + std::fmt::Debug {
    /// Number of axes n.
    fn axes(&self) -> usize;

    /// Resisting force in N at `disp` (m), `vel` (m/s), reached from the committed state in `dt` seconds. Always
    /// starts from the committed state; slices have n entries.
    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]);

    /// Displacement that a sensor reads after the last trial, m. On call `disp` is the command, and stays so for a
    /// specimen that follows exactly.
    fn measured(&mut self, disp: &mut [f64]) {
        let _ = disp;
    }

    /// True if an actuator or a sensor was at the end of its range in the last trial.
    fn is_saturated(&self) -> bool {
        false
    }

    /// False if the actuator–specimen iteration did not converge in the last trial: the answer is not exact.
    fn is_settled(&self) -> bool {
        true
    }

    /// Announces before the first trial, where it is known, that commands come every `seconds` of wall time; 0 where it is no
    /// longer known. A specimen that samples at that rate cannot see it while test time stops.
    fn commanded_every(&mut self, seconds: f64) {
        let _ = seconds;
    }

    /// The last trial becomes the committed state.
    fn commit(&mut self);

    /// Forgets the last trial.
    fn revert(&mut self);

    /// Stiffness, damping and mass that enter K0, C0 and M_eff (OpenFresco 12, 14, 15), n × n each.
    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]);

    /// Tangent stiffness at the last trial, n × n (OpenFresco 13). A trial that repeats the committed displacements keeps the
    /// tangent of the motion that led there.
    fn tangent(&self, stiffness: &mut [f64]);

    /// Tangent damping at the last trial, n × n; the reference where that is less, since a damper may have no finite tangent at
    /// rest. Default: the reference. Not for the loop.
    fn tangent_damping(&self, damping: &mut [f64]) {
        let (mut stiffness, mut mass) = (vec![0.0; damping.len()], vec![0.0; damping.len()]);
        self.reference(&mut stiffness, damping, &mut mass);
    }

    /// Part of the reference damping that acts around rest only, n × n; see [`gusset_numerics::law::Law::rest_damping`]. Default: none.
    fn rest_damping(&self, damping: &mut [f64]) {
        damping.fill(0.0);
    }

    /// Upper bounds of both tangents within the reach of each axis, n × n each, for the proof of stability: the true
    /// tangents never exceed them in the sense of symmetric matrices. A bound may be +∞ where none exists.
    ///
    /// # Errors
    /// The first axis (from 0) whose law needs a declared reach and has none; the matrices are then unfinished.
    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize>;
}
