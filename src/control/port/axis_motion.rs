//! Displacement and velocity of all axes of one specimen.

use super::axis::Axis;
use super::loading_unit::LoadingUnit;
use gusset_quantity::frame::{AtAxis, AtStructure};
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

    /// Displacements. Real-time: yes.
    #[inline]
    pub(crate) fn disp(&self) -> &[f64] {
        &self.disp
    }

    /// Velocities. Real-time: yes.
    #[inline]
    pub(crate) fn vel(&self) -> &[f64] {
        &self.vel
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

    /// A command takes displacements, at rest. Real-time: yes.
    pub(crate) fn rest_at(command: &mut AtAxis<Self>, disp: AtAxis<&[f64]>) {
        command.disp.copy_from_slice(&disp);
        command.vel.fill(0.0);
    }

    /// A target takes the values of another of as many axes. Real-time: yes.
    #[inline]
    pub(crate) fn copy(target: &mut AtStructure<Self>, other: &AtStructure<Self>) {
        target.disp.copy_from_slice(&other.disp);
        target.vel.copy_from_slice(&other.vel);
    }

    /// Displacements and velocities of a target, to be changed.
    fn parts(target: &mut AtStructure<Self>) -> AtStructure<[&mut [f64]; 2]> {
        let AtStructure(Self { disp, vel }) = target;
        AtStructure([disp, vel])
    }

    /// A target takes the deformations that the structure's [displacement, velocity] asks for, of a base that moves by [displacement,
    /// velocity]; of the actuators of a loading unit the strokes. Real-time: yes.
    #[inline]
    pub(crate) fn seek(
        target: &mut AtStructure<Self>,
        axes: &[Axis],
        unit: Option<&mut LoadingUnit>,
        state: [&[f64]; 2],
        base: [f64; 2],
    ) {
        match unit {
            Some(unit) => unit.seek(state, base, Self::parts(target)),
            None => target.take(axes.iter().map(|axis| axis.dots(state, base))),
        }
    }

    /// A target takes prescribed deformations, of one axis after the other; with a loading unit of one coordinate after the other.
    /// Real-time: yes.
    pub(crate) fn seek_at(
        target: &mut AtStructure<Self>,
        unit: Option<&mut LoadingUnit>,
        along: &mut impl Iterator<Item = AtStructure<(f64, f64)>>,
    ) {
        match unit {
            Some(unit) => unit.seek_at(along, Self::parts(target)),
            None => target.take(along.map(|AtStructure(motion)| motion)),
        }
    }
}
