//! The command path: targets, the way between two targets, and the command that is made of them.
//!
//! Quantities at the structure are in m and m/s, commands in the specimen's unit. A specimen is commanded at every tick along the
//! interpolation of its targets; or, if it is slow, once a step with the target itself. The next command is made here
//! and judged elsewhere. Invariant: each change of this command revokes its clearance, so no command leaves that was not judged.

use super::axis::Axis;
use super::axis_motion::AxisMotion;
use super::compensators::Compensators;
use super::interpolation::Order;
use super::loading_unit::LoadingUnit;
use super::ramp::Ramp;
use super::step_pacer::PacerTick;
use super::target_path::TargetPath;
use gusset_actuator::compensation::Parameter;
use gusset_actuator::geometry::MOST;
use gusset_quantity::frame::{AtAxis, AtStructure};
use gusset_quantity::state;

/// Which moment the velocity that belongs to a target is of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum VelocityOf {
    /// That of the integrator, some part of a tick ago.
    #[default]
    Integrator,
    /// Now: the slope of the path between two targets.
    Path,
}

state! { enum VelocityOf { Integrator, Path } }

/// Whether the next command may leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Clearance {
    /// It was not judged, or it tripped.
    Unjudged,
    /// It was judged, and nothing tripped.
    Cleared,
}

state! { enum Clearance { Unjudged, Cleared } }

/// Kind of the command in force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum InForce {
    /// One that was made to move.
    Motion,
    /// The last one once more, at rest.
    Repetition,
}

state! { enum InForce { Motion, Repetition } }

/// From targets to commands, for all axes of one specimen.
#[derive(Debug)]
pub struct CommandPath {
    /// Deformation that the structure asks for: B·x; of an actuator the stroke for the pose B·x.
    target: AtStructure<AxisMotion>,
    velocity_of: VelocityOf,
    /// The target of the tick in which it was reached.
    kept_target: AtStructure<Vec<f64>>,
    /// The target of the next step.
    path: TargetPath,
    /// It is commanded once a step.
    per_step: bool,
    ramp: Ramp,
    compensators: Option<Compensators>,
    /// The next command.
    command: AtAxis<AxisMotion>,
    clearance: Clearance,
    /// The last command.
    sent: AtAxis<Vec<f64>>,
    in_force: InForce,
    /// Zero velocities.
    still: AtAxis<Vec<f64>>,
    /// The last command of an interrupted test; empty without one.
    resumed_from: AtAxis<Vec<f64>>,
}

// When a step is closed no target is kept, and no ramp is under way.
state! {
    CommandPath as "command path" {
        target, velocity_of, path, compensators: configured(), command, clearance, sent, in_force
    }
    keeps { kept_target, per_step, ramp, still, resumed_from }
}

impl CommandPath {
    /// Of axes that stand where their deformation is zero.
    pub(crate) fn new(axes: &[Axis]) -> Self {
        let n = axes.len();
        Self {
            target: AtStructure(AxisMotion::zeros(n)),
            velocity_of: VelocityOf::default(),
            kept_target: AtStructure(vec![0.0; n]),
            path: TargetPath::new(n),
            per_step: false,
            ramp: Ramp::new(n),
            compensators: None,
            command: AtAxis(AxisMotion::zeros(n)),
            clearance: Clearance::Unjudged,
            sent: AtAxis(axes.iter().map(|axis| axis.disp_offset).collect()),
            in_force: InForce::Repetition,
            still: AtAxis(vec![0.0; n]),
            resumed_from: AtAxis(Vec::new()),
        }
    }

    pub(crate) fn set_pace(&mut self, per_step: bool, order: Order) {
        self.per_step = per_step;
        self.path.set_order(order);
    }

    pub(crate) fn set_compensators(&mut self, compensators: Compensators) {
        self.compensators = Some(compensators);
    }

    pub(crate) const fn compensators(&self) -> Option<&Compensators> {
        self.compensators.as_ref()
    }

    /// Names of the compensators' parameters, axis by axis; the axis counts from 0.
    pub(crate) fn compensation_names(&self) -> impl Iterator<Item = (usize, Parameter)> + '_ {
        self.compensators.iter().flat_map(Compensators::names)
    }

    /// The parameters of the moment, in the order of their names. Real-time: yes.
    #[inline]
    pub(crate) fn compensation_parameters(&self) -> impl Iterator<Item = f64> + '_ {
        self.compensators.iter().flat_map(Compensators::parameters)
    }

    pub(crate) const fn compensators_mut(&mut self) -> Option<&mut Compensators> {
        self.compensators.as_mut()
    }

    /// True if it is commanded once a step.
    #[inline]
    #[must_use]
    pub const fn is_per_step(&self) -> bool {
        self.per_step
    }

    #[inline]
    pub(crate) const fn target(&self) -> &AtStructure<AxisMotion> {
        &self.target
    }

    /// Where a target is to be written. Real-time: yes.
    #[inline]
    pub(crate) const fn target_mut(&mut self) -> &mut AtStructure<AxisMotion> {
        &mut self.target
    }

    /// From here on, velocities that come with targets are the slope of a path, and no differences.
    pub const fn take_velocities_of_a_path(&mut self) {
        self.velocity_of = VelocityOf::Path;
    }

    #[inline]
    pub(crate) const fn velocity_of(&self) -> VelocityOf {
        self.velocity_of
    }

    #[inline]
    pub(crate) const fn command(&self) -> &AtAxis<AxisMotion> {
        &self.command
    }

    /// Where a command is to be written: its clearance is revoked. Real-time: yes.
    #[inline]
    const fn command_mut(&mut self) -> &mut AtAxis<AxisMotion> {
        self.clearance = Clearance::Unjudged;
        &mut self.command
    }

    /// The last command, in the specimen's unit.
    #[inline]
    #[must_use]
    pub fn sent(&self) -> AtAxis<&[f64]> {
        self.sent.part(Vec::as_slice)
    }

    /// The last command with zero velocities. Real-time: yes.
    #[inline]
    pub(crate) fn last_at_rest(&self) -> [AtAxis<&[f64]>; 2] {
        [&self.sent, &self.still].map(|of| of.part(Vec::as_slice))
    }

    /// The target of the next step. Real-time: yes.
    #[inline]
    pub(crate) const fn goal(&self) -> &AtStructure<AxisMotion> {
        self.path.goal()
    }

    /// Where the target of the next step is to be written. Real-time: yes.
    #[inline]
    pub(crate) const fn goal_mut(&mut self) -> &mut AtStructure<AxisMotion> {
        self.path.goal_mut()
    }

    /// The next command was judged. Real-time: yes.
    #[inline]
    pub(crate) const fn clear(&mut self, passes: bool) {
        self.clearance = if passes {
            Clearance::Cleared
        } else {
            Clearance::Unjudged
        };
    }

    /// Lets the next command leave, if it was judged; false if it was not. Real-time: yes.
    #[inline]
    pub(crate) fn release(&mut self) -> bool {
        if self.clearance != Clearance::Cleared {
            return false;
        }
        self.clearance = Clearance::Unjudged;
        self.in_force = InForce::Motion;
        for (sent, command) in self.sent.iter_mut().zip(&self.command.disp) {
            *sent = *command;
        }
        if let Some(compensators) = &mut self.compensators {
            compensators.note_sent(true);
        }
        true
    }

    /// The last command leaves once more, at rest. Real-time: yes.
    #[inline]
    pub(crate) fn repeat(&mut self) {
        self.in_force = InForce::Repetition;
        if let Some(compensators) = &mut self.compensators {
            compensators.note_sent(false);
        }
    }

    /// The command is the target itself. Real-time: yes.
    #[inline]
    pub(crate) fn follow_target(&mut self, axes: &[Axis]) {
        self.clearance = Clearance::Unjudged;
        let commands = self.command.iter_mut();
        let targets = self.target.iter();
        for (((command, command_vel), (disp, vel)), axis) in commands.zip(targets).zip(axes) {
            *command = axis.command(AtStructure(*disp)).0;
            *command_vel = axis.vel_gain * vel;
        }
    }

    /// Makes the command of the target. Real-time: yes.
    #[inline]
    pub(crate) fn prepare(&mut self, axes: &[Axis]) {
        self.follow_target(axes);
        if let Some(compensators) = &mut self.compensators {
            let is_published = self.velocity_of == VelocityOf::Integrator;
            compensators.lead(axes, &self.target, &mut self.command, is_published);
        }
    }

    /// The target is the first one of the test; everything has rested there.
    pub(crate) fn begin(&mut self) {
        self.path.begin(&self.target);
    }

    /// The goal is known from here on, `share` of the step after the last target. Real-time: yes.
    #[inline]
    pub(crate) fn know(&mut self, share: f64, axes: &[Axis]) {
        if self.per_step {
            self.path.know(share);
            self.take_goal(axes);
        } else {
            self.know_on_the_way(share, axes);
        }
    }

    /// The goal of a path that is predicted is known. Real-time: yes.
    pub(crate) fn know_on_the_way(&mut self, share: f64, axes: &[Axis]) {
        self.path.know(share);
        if let Some(compensators) = &mut self.compensators {
            compensators.amend(axes, &self.path);
        }
    }

    /// The targets of a specimen that is commanded once a step are led along a path: predicted so, with steps of `step_s` s of the
    /// controller's time.
    pub(crate) fn predict(&mut self, order: Order, step_s: f64) {
        self.path.set_order(order);
        self.path.smooth(step_s);
    }

    /// The goal is unknown again. Real-time: yes.
    pub(crate) fn forget_goal(&mut self) {
        self.path.forget();
    }

    /// The way between two targets.
    pub(crate) const fn way(&self) -> &TargetPath {
        &self.path
    }

    /// The goal is the target, and the command is made of it. Real-time: yes.
    pub(crate) fn take_goal(&mut self, axes: &[Axis]) {
        self.land();
        self.prepare(axes);
    }

    #[inline]
    fn land(&mut self) {
        AxisMotion::copy(&mut self.target, self.path.goal());
        self.velocity_of = VelocityOf::Integrator;
    }

    /// The target is reached: from here on the next is sought. Real-time: yes.
    #[inline]
    pub(crate) fn reach(&mut self) {
        self.path.reach();
        if let Some(compensators) = &mut self.compensators {
            compensators.begin_grid();
        }
    }

    /// Makes the command at the end of a tick of the step pacer, with steps of `dt` seconds of test time. Real-time: yes.
    #[inline]
    pub(crate) fn advance(&mut self, tick: &PacerTick, dt: f64, axes: &[Axis]) {
        if !self.per_step {
            self.go_along(tick, dt, axes);
        }
    }

    /// [`Self::advance`] on the path of targets that is predicted. Real-time: yes.
    #[inline]
    pub(crate) fn go_along(&mut self, tick: &PacerTick, dt: f64, axes: &[Axis]) {
        if tick.lands() && tick.length >= 1.0 {
            // A whole step in one tick: the integrator's own velocity belongs to it.
            self.land();
        } else {
            let targets = self.target.iter_mut();
            for (axis, (target, target_vel)) in targets.enumerate() {
                let point = self.path.at(axis, tick.share);
                *target = point.disp;
                *target_vel = point.slope / dt;
            }
            self.velocity_of = VelocityOf::Path;
        }
        self.follow_target(axes);
        if let Some(compensators) = &mut self.compensators {
            let is_published = self.velocity_of == VelocityOf::Integrator;
            let (path, target) = (&self.path, &self.target);
            let command = &mut self.command;
            compensators.lead_along(axes, path, target, command, (is_published, tick));
        }
    }

    /// No command is made for the next tick. Real-time: yes.
    #[inline]
    pub(crate) fn hold(&mut self) {
        // A partner of whole steps may still have its target before it.
        if self.per_step {
            return;
        }
        if let Some(compensators) = &mut self.compensators {
            compensators.hold();
        }
    }

    /// Keeps the target that was just reached. Real-time: yes.
    pub(crate) fn keep_target(&mut self) {
        self.kept_target.copy_from_slice(&self.target.disp);
    }

    /// Takes it back. Real-time: yes.
    pub(crate) fn take_kept_target(&mut self) {
        self.target.disp.copy_from_slice(&self.kept_target);
    }

    /// The next command is the last one: nothing moves.
    pub(crate) fn stand_still(&mut self) {
        self.clearance = Clearance::Unjudged;
        AxisMotion::rest_at(&mut self.command, self.sent.part(Vec::as_slice));
    }

    /// The next command is at these displacements; its velocity stays. For the begin of a ramp.
    pub(crate) fn command_place(&mut self, disp: AtAxis<&[f64]>) {
        self.command_mut().disp.copy_from_slice(&disp);
    }

    /// The next command is this many m of the structure's behind the last. Real-time: yes.
    pub(crate) fn go_back(&mut self, steps: impl Iterator<Item = AtStructure<f64>>, axes: &[Axis]) {
        self.clearance = Clearance::Unjudged;
        let commands = self.command.iter_mut();
        let steps = self.sent.iter().zip(axes).zip(steps);
        for ((command, vel), ((sent, axis), AtStructure(step))) in commands.zip(steps) {
            *command = sent - axis.disp_gain * step;
            *vel = 0.0;
        }
    }

    /// The next command is these steps after the last, in the unit of each axis, in a tick of `tick` s. Real-time: yes.
    pub(crate) fn coast(&mut self, steps: impl Iterator<Item = AtAxis<f64>>, tick: f64) {
        self.clearance = Clearance::Unjudged;
        let commands = self.command.iter_mut();
        for ((command, vel), (sent, AtAxis(step))) in commands.zip(self.sent.iter().zip(steps)) {
            *command = sent + step;
            *vel = step / tick;
        }
    }

    /// A ramp goes from the last command to the next one. A loading unit goes from pose to pose.
    pub(crate) fn begin_ramp(&mut self, axes: &[Axis], unit: Option<&mut LoadingUnit>) {
        let ends = [
            self.sent.part(Vec::as_slice),
            self.command.part(AxisMotion::disp),
        ];
        self.ramp.begin(ends);
        if let Some(unit) = unit {
            let mut strokes = [[0.0; MOST]; 2];
            for (strokes, commands) in strokes.iter_mut().zip(ends) {
                for (stroke, (axis, command)) in
                    strokes.iter_mut().zip(axes.iter().zip(commands.each()))
                {
                    *stroke = axis.deformation(command).0;
                }
            }
            unit.begin_way(strokes.each_ref().map(|strokes| AtStructure(&strokes[..])));
        }
    }

    /// The next command is at this share (0 … 1) of the ramp, which takes `seconds` of test time. Real-time: yes.
    pub(crate) fn ramp_to(
        &mut self,
        share: f64,
        seconds: f64,
        axes: &[Axis],
        unit: Option<&mut LoadingUnit>,
    ) {
        self.clearance = Clearance::Unjudged;
        self.ramp.go_to(share, seconds, axes, &mut self.command);
        let unit = unit.filter(|_| share < 1.0);
        if let Some(bends) = unit.and_then(|unit| unit.bends(Ramp::way(share))) {
            Ramp::bend([share, seconds], axes, bends, &mut self.command);
        }
    }

    /// The specimen stands here, in its own unit: others than this port moved it.
    pub(crate) fn stands_at(&mut self, disp: AtAxis<&[f64]>) {
        for (sent, disp) in self.sent.iter_mut().zip(disp.each()) {
            *sent = disp.0;
        }
    }

    /// The last command is the one of an interrupted test.
    pub(crate) fn resume_from_here(&mut self) {
        self.resumed_from.clone_from(&self.sent);
    }

    /// True in a test that resumes an interrupted one.
    pub(crate) fn is_resumed(&self) -> bool {
        !self.resumed_from.is_empty()
    }

    /// True if the specimen was led away from where the interrupted test left it.
    pub(crate) fn was_led_away(&self) -> bool {
        self.is_resumed() && self.sent != self.resumed_from
    }

    /// Makes the last command of the interrupted test again, at rest.
    pub(crate) fn return_to_the_test(&mut self) {
        self.clearance = Clearance::Unjudged;
        if self.resumed_from.len() == self.command.disp.len() {
            self.command.disp.copy_from_slice(&self.resumed_from);
        }
        self.command.vel.fill(0.0);
    }

    /// True if the command in force was made to move. Real-time: yes.
    #[inline]
    pub(crate) fn moves(&self) -> bool {
        self.in_force == InForce::Motion
    }

    /// Velocity of the command in force without its lead, `ready` if it has none; in the axis' unit. Real-time: yes.
    #[inline]
    pub(crate) fn own_vel(&self, axis: usize, ready: f64) -> f64 {
        let led = self.compensators.as_ref();
        led.and_then(|led| led.own_vel(axis)).unwrap_or(ready)
    }

    /// The answer to a command is there, or an old one in place of it. Real-time: yes.
    #[inline]
    pub(crate) fn hear(&mut self, axes: &[Axis], raw: AtAxis<&[f64]>, is_fresh: bool) {
        if let Some(compensators) = &mut self.compensators {
            let sent = self.sent.part(Vec::as_slice);
            compensators.hear(axes, sent, raw, is_fresh);
        }
    }
}
