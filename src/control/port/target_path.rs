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
    /// Test time of a step in s, where the prediction takes the velocities of the targets; else 0.
    step_s: f64,
}

state! { TargetPath { goal, interpolation } keeps { step_s } }

impl TargetPath {
    pub(crate) fn new(axes: usize) -> Self {
        Self {
            goal: AtStructure(AxisMotion::zeros(axes)),
            interpolation: Interpolation::new(axes, Order::default()),
            step_s: 0.0,
        }
    }

    /// Predicts with this order while the goal is unknown.
    pub(crate) fn set_order(&mut self, order: Order) {
        self.interpolation.set_order(order);
    }

    /// From here on the acceleration does not jump, and velocities of the targets count, with steps of `step_s` s.
    pub(crate) fn smooth(&mut self, step_s: f64) {
        self.interpolation.smooth();
        self.step_s = step_s;
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
        let goals = self.goal.iter();
        let goals = goals.map(|(disp, vel)| (*disp, vel * self.step_s));
        self.interpolation.aim(goals, share);
    }

    /// The goal is unknown again, and the prediction continues. Real-time: yes.
    pub(crate) fn forget(&mut self) {
        self.interpolation.forget();
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

    /// Where an axis is predicted `share` of a step after the goal. Real-time: yes.
    pub(crate) fn beyond(&self, axis: usize, share: f64) -> PathPoint {
        self.interpolation.beyond(axis, share)
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
