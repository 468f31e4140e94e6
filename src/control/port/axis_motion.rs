//! Displacement and velocity of all axes of one specimen.

use super::axis::Axis;
use super::loading_unit::LoadingUnit;
use gusset_quantity::frame::AtStructure;
use gusset_quantity::state;

/// One value per axis, of displacements and of their velocities, in the frame of [`gusset_quantity::frame`] that stands round it.
#[derive(Debug, Clone)]
pub(crate) struct AxisMotion {
    pub disp: Vec<f64>,
    pub vel: Vec<f64>,
}

state! { AxisMotion { disp, vel } }

impl AxisMotion {
    /// At zero, at rest.
    pub(crate) fn zeros(axes: usize) -> Self {
        Self {
            disp: vec![0.0; axes],
            vel: vec![0.0; axes],
        }
    }

    /// Takes the values of another of as many axes. Real-time: yes.
    #[inline]
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.disp.copy_from_slice(&other.disp);
        self.vel.copy_from_slice(&other.vel);
    }

    /// Takes displacements, at rest. Real-time: yes.
    pub(crate) fn rest_at(&mut self, disp: &[f64]) {
        self.disp.copy_from_slice(disp);
        self.vel.fill(0.0);
    }

    /// Takes displacement and velocity of one axis after the other. Real-time: yes.
    #[inline]
    pub(crate) fn take(&mut self, along: impl Iterator<Item = (f64, f64)>) {
        let axes = self.disp.iter_mut().zip(&mut self.vel);
        for ((disp, vel), (new_disp, new_vel)) in axes.zip(along) {
            (*disp, *vel) = (new_disp, new_vel);
        }
    }

    /// Displacement and velocity of one axis after the other, to be changed. Real-time: yes.
    #[inline]
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (&mut f64, &mut f64)> {
        self.disp.iter_mut().zip(&mut self.vel)
    }

    /// Displacement and velocity of one axis after the other. Real-time: yes.
    #[inline]
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&f64, &f64)> + Clone {
        self.disp.iter().zip(&self.vel)
    }
}

impl AtStructure<AxisMotion> {
    /// Takes the deformations that the structure's [displacement, velocity] asks for, of a base that moves by [displacement, velocity];
    /// of the actuators of a loading unit the strokes. Real-time: yes.
    #[inline]
    pub(crate) fn seek(
        &mut self,
        axes: &[Axis],
        unit: Option<&mut LoadingUnit>,
        state: [&[f64]; 2],
        base: [f64; 2],
    ) {
        match unit {
            Some(unit) => unit.seek(state, base, self),
            None => self.take(axes.iter().map(|axis| axis.dots(state, base))),
        }
    }

    /// Takes prescribed deformations, of one axis after the other; with a loading unit of one coordinate after the other.
    /// Real-time: yes.
    pub(crate) fn seek_at(
        &mut self,
        unit: Option<&mut LoadingUnit>,
        along: &mut impl Iterator<Item = (f64, f64)>,
    ) {
        match unit {
            Some(unit) => unit.seek_at(along, self),
            None => self.take(along),
        }
    }
}
