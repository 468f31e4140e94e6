//! A bearing as a specimen: its law is that of a frame.

use super::Specimen;
use gusset_numerics::law::{Bearing, Reach};

impl Specimen for Bearing {
    fn axes(&self) -> usize {
        Self::axes(self)
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], _dt: f64, force: &mut [f64]) {
        Self::trial(self, disp, vel, force);
    }

    fn commit(&mut self) {
        Self::commit(self);
    }

    fn revert(&mut self) {
        Self::revert(self);
    }

    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        Self::reference(self, stiffness, damping);
        mass.fill(0.0);
    }

    fn tangent(&self, stiffness: &mut [f64]) {
        Self::tangent(self, stiffness);
    }

    fn rest_damping(&self, damping: &mut [f64]) {
        Self::rest_damping(self, damping);
    }

    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        Self::bound(self, reach, stiffness, damping)
    }
}
