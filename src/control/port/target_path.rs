//! The path of a target: the goal of the next step, and the interpolation that leads there.

use super::axis_motion::AxisMotion;
use super::interpolation::{Interpolation, Order, PathPoint};
use gusset_quantity::frame::AtStructure;
use gusset_quantity::state;

/// Where the target goes.
#[derive(Debug)]
pub(crate) struct TargetPath {
    goal: AtStructure<AxisMotion>,
    interpolation: Interpolation,
}

state! { TargetPath { goal, interpolation } }

impl TargetPath {
    pub(crate) fn new(axes: usize) -> Self {
        Self {
            goal: AtStructure(AxisMotion::zeros(axes)),
            interpolation: Interpolation::new(axes, Order::default()),
        }
    }

    /// Predicts with this order while the goal is unknown.
    pub(crate) fn set_order(&mut self, order: Order) {
        self.interpolation.set_order(order);
    }

    /// The target of the next step. Real-time: yes.
    #[inline]
    pub(crate) const fn goal(&self) -> &AtStructure<AxisMotion> {
        &self.goal
    }

    /// Where the target of the next step is to be written. Real-time: yes.
    #[inline]
    pub(crate) const fn goal_mut(&mut self) -> &mut AtStructure<AxisMotion> {
        &mut self.goal
    }

    /// Everything has rested at `target`, which is the goal.
    pub(crate) fn begin(&mut self, target: &AtStructure<AxisMotion>) {
        AxisMotion::copy(&mut self.goal, target);
        self.interpolation.rest(&target.disp);
    }

    /// The goal is known from here on, `share` of the step after the last target. Real-time: yes.
    #[inline]
    pub(crate) fn know(&mut self, share: f64) {
        self.interpolation.aim(&self.goal.disp, share);
    }

    /// The goal is reached; the next is unknown. Real-time: yes.
    #[inline]
    pub(crate) fn reach(&mut self) {
        self.interpolation.reach();
    }

    /// Where an axis is at a share of the step. Real-time: yes.
    #[inline]
    pub(crate) fn at(&self, axis: usize, share: f64) -> PathPoint {
        self.interpolation.at(axis, share)
    }

    /// Where an axis is at a point of the path beyond now, and a whole step after the last target, if the next is known, the
    /// integrator's own velocity there in m/s. Real-time: yes.
    pub(crate) fn point(&self, axis: usize, share: f64, whole: bool) -> (f64, Option<f64>) {
        let goal = self.goal.disp.get(axis).zip(self.goal.vel.get(axis));
        match goal {
            Some((goal, vel)) if whole && self.interpolation.is_known() => (*goal, Some(*vel)),
            _ => (self.at(axis, share).disp, None),
        }
    }
}
