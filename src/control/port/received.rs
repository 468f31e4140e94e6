//! Commands that another controller sends, through a server.
//!
//! The controller commands the signals of the port: the deformations of its axes, or the coordinates of its loading
//! unit. They go through the port as the targets of a structure do, and displacements and forces come back the same way.

use super::error::fits;
use super::*;
use gusset_quantity::frame::AtPose;

/// A port whose commands another controller sends. Nothing is estimated.
#[derive(Debug)]
pub struct ReceivedPort(pub(super) Port);

impl std::ops::Deref for ReceivedPort {
    type Target = Port;

    fn deref(&self) -> &Port {
        &self.0
    }
}

impl std::ops::DerefMut for ReceivedPort {
    fn deref_mut(&mut self) -> &mut Port {
        &mut self.0
    }
}

impl PortSpec {
    /// Joins the specimen to another controller: each of its commands is a target, and is answered. Nothing is estimated.
    ///
    /// # Errors
    /// As [`PortSpec::build`].
    pub fn build_received(self) -> Result<ReceivedPort, PortError> {
        self.check()?;
        Ok(self.join_received())
    }

    /// Parts that fit, commanded once for each target of the other controller.
    fn join_received(mut self) -> ReceivedPort {
        self.per_step = true;
        self.order = Order::default();
        let mut port = self.join();
        port.pause_estimates();
        ReceivedPort(port)
    }

    /// A specimen whose axes another controller commands in their own units: what that sends is passed on to the last bit. `stiffness`
    /// is the estimate k̂ of each axis, in its units; 0 where it is missing.
    #[must_use]
    pub fn passing_on(
        name: impl Into<String>,
        substructure: Box<dyn Substructure>,
        stiffness: &[f64],
    ) -> ReceivedPort {
        let axes = 0..substructure.axes();
        let axes = axes.map(|index| {
            let stiffness = stiffness.get(index).copied().unwrap_or(0.0);
            AxisSpec::new(Axis::received(), stiffness)
        });
        // One axis for each of the substructure's, and no other list.
        Self::new(name, substructure, 0, axes.collect()).join_received()
    }
}

// For the engine.
impl ReceivedPort {
    pub(crate) const fn as_ports(&self) -> &[Port] {
        std::slice::from_ref(&self.0)
    }

    pub(crate) const fn as_ports_mut(&mut self) -> &mut [Port] {
        std::slice::from_mut(&mut self.0)
    }

    /// How long an answer is waited for, and what a late one is worth.
    pub(crate) const fn wait_by(&mut self, rules: WaitRules) {
        self.0.exchange.set_wait(Some(rules));
    }
}

impl Port {
    /// Number of coordinates of the loading unit; 0 without one.
    pub(crate) fn coordinates(&self) -> usize {
        let geometry = self.geometry();
        geometry.map_or(0, |geometry| geometry.coordinates().len())
    }

    /// The target that was sought last: deformations of the axes in m, of a loading unit the strokes of its actuators. Real-time: yes.
    pub(crate) fn goal(&self) -> AtStructure<&[f64]> {
        self.path.goal().part(AxisMotion::disp)
    }

    /// Velocities of the next command, in the specimen's unit. Real-time: yes.
    pub(crate) fn command_vel(&self) -> AtAxis<&[f64]> {
        self.path.command().part(AxisMotion::vel)
    }
}

impl ReceivedPort {
    /// Takes the guard that another server of the same specimen had.
    ///
    /// # Errors
    /// It has another number of axes.
    pub fn set_guard(&mut self, guard: Guard) -> Result<(), PortError> {
        fits("axes of the guard", guard.declared().len(), self.axes())?;
        self.0.guard = guard;
        Ok(())
    }

    /// The guard forgets past commands, and its ticks take `tick` s.
    pub fn renew_guard(&mut self, tick: f64) {
        self.0.guard = self.guard.forgetful(tick);
    }

    /// Another substructure answers from here on, and all counts restart. Returns the substructure before.
    ///
    /// # Errors
    /// It has another number of axes.
    pub fn swap_partner(
        &mut self,
        substructure: Box<dyn Substructure>,
    ) -> Result<Box<dyn Substructure>, PortError> {
        fits("axes of the partner", substructure.axes(), self.axes())?;
        self.feedback = Feedback::new(self.axes());
        Ok(self.exchange.swap(substructure))
    }

    /// Another controller commands: nothing was counted, measured, warned of or tripped. The guard keeps the commands before.
    pub fn begin_session(&mut self, tick: f64) {
        self.exchange.begin_session();
        self.feedback = Feedback::new(self.axes.len());
        let watch = self.guard.watch_mut();
        watch.begins_session();
        watch.tick_is(tick);
    }

    /// The specimen is at `disp`, in its own unit. The next command has the number `sequence`, and leads away from there.
    pub fn begin_commands(&mut self, sequence: u64, disp: AtAxis<&[f64]>) {
        self.guard.is_found_at(disp);
        self.path.stands_at(disp);
        self.stand_still();
        let strokes = self.deformations_at(disp);
        if let Some(unit) = &mut self.loading_unit {
            unit.stands_at(strokes.part(Vec::as_slice));
        }
        self.exchange.renumber(sequence);
        self.feedback.forget_number();
    }

    /// True if the next command is the last one once more. Real-time: yes.
    #[must_use]
    pub fn repeats(&self) -> bool {
        self.guard.is_at(self.command())
    }

    /// The specimen came to where it stands with the velocities of the next command, for `seconds`. Real-time: yes.
    pub fn came_with_command(&mut self, seconds: f64) {
        let port = &mut self.0;
        let vel = port.path.command().part(AxisMotion::vel);
        port.guard.came_with(vel, seconds);
    }
}

// Signals: what the controller commands, at the structure's scale.
impl ReceivedPort {
    /// Makes the next command from deformations of the axes in m, of a loading unit from the strokes of its actuators: displacement
    /// and velocity of one axis after the other. Nothing is compensated. Real-time: yes.
    pub fn aim_axes(&mut self, along: impl Iterator<Item = AtStructure<(f64, f64)>>) {
        self.leave_pose();
        let port = &mut self.0;
        let along = along.map(|AtStructure(motion)| motion);
        port.path.target_mut().take(along);
        port.path.follow_target(&port.axes);
    }

    /// Writes the commands that hold the axes at the target that was sought last, in the specimen's unit. Real-time: yes.
    pub fn write_goal(&self, into: &mut AtAxis<Vec<f64>>) {
        let goal = self.axes.iter().zip(&self.path.goal().disp).enumerate();
        for (to, (index, (axis, disp))) in into.iter_mut().zip(goal) {
            *to = axis.command(AtStructure(self.static_gain(index) * disp)).0;
        }
    }

    /// Command at rest over the displacement at which the axis is to rest: 1 where no compensator has a static gain. Real-time: yes.
    fn static_gain(&self, axis: usize) -> f64 {
        let compensators = self.path.compensators();
        compensators.map_or(1.0, |compensators| compensators.static_gain(axis))
    }

    /// Compensators and estimates of tracking are as before any command; `fresh` is that state of the compensators.
    pub fn restart_following(&mut self, fresh: Option<&TestState>) {
        self.tracking.restart();
        if let (Some(compensators), Some(fresh)) = (self.path.compensators_mut(), fresh) {
            compensators.restart(fresh);
        }
    }

    /// Ticks have passed without a command: what is measured next does not follow what was measured last. Real-time: yes.
    pub fn skips_commands(&mut self) {
        if let Some(compensators) = self.path.compensators_mut() {
            compensators.hold();
        }
    }

    /// Commands at rest after which [`ReceivedPort::skips_commands`] is not needed: an adaptive compensator learns nothing wrong. Real-time: yes.
    pub fn ticks_to_rest(&mut self) -> u32 {
        let compensators = self.path.compensators_mut();
        compensators.map_or(0, |compensators| compensators.ticks_to_rest())
    }

    /// Displacement in m (or rad) and force in N (or N m) of one signal after the other, as measured last, with its number from 0.
    /// [`Port::resolve_pose`] finds those of a loading unit. Real-time: yes.
    pub fn read_signals(&self, mut read: impl FnMut(usize, AtStructure<(f64, f64)>)) {
        if self.loading_unit.is_some() {
            for (index, (_, [_, disp, force])) in self
                .loading_unit()
                .into_iter()
                .flat_map(LoadingUnit::pose)
                .enumerate()
            {
                read(index, AtStructure((disp, force)));
            }
            return;
        }
        let measured = self.feedback.disp().iter().zip(*self.feedback.force());
        for (index, (disp, force)) in measured.enumerate() {
            read(index, AtStructure((*disp, *force)));
        }
    }

    /// Takes a measurement at rest, in the specimen's units, which belongs to no command.
    ///
    /// # Errors
    /// The actuators cannot have these strokes.
    pub fn take_at_rest(&mut self, at_rest: &Measurement) -> Result<(), Fault> {
        let port = &mut self.0;
        port.feedback.take_at_rest(at_rest, &port.axes);
        self.resolve_pose()
    }

    /// Commands in the specimen's unit that hold the axes at signals in m or rad.
    ///
    /// # Errors
    /// The actuators cannot have this pose.
    pub fn commands_for(&self, signals: AtStructure<&[f64]>) -> Result<AtAxis<Vec<f64>>, Fault> {
        let strokes = match &self.loading_unit {
            Some(unit) => unit.strokes_for(AtPose(*signals))?,
            None => AtStructure(signals.to_vec()),
        };
        let axes = self.axes.iter().zip(&*strokes).enumerate();
        let commands = axes.map(|(index, (axis, disp))| {
            axis.command(AtStructure(self.static_gain(index) * disp)).0
        });
        Ok(AtAxis(commands.collect()))
    }

    /// Signals in m or rad of axes that the commands `disp` hold, in the specimen's own unit.
    ///
    /// # Errors
    /// The actuators cannot have these strokes.
    pub fn signals_at(&self, disp: AtAxis<&[f64]>) -> Result<AtStructure<Vec<f64>>, Fault> {
        let mut strokes = self.deformations_at(disp);
        for (index, stroke) in strokes.iter_mut().enumerate() {
            *stroke /= self.static_gain(index);
        }
        match &self.loading_unit {
            Some(unit) => {
                let AtPose(pose) = unit.pose_at(strokes.part(Vec::as_slice))?;
                Ok(AtStructure(pose))
            }
            None => Ok(strokes),
        }
    }

    /// Deformations of the axes in m, or strokes of a loading unit, at the position `disp` of the specimen, in its own unit.
    #[must_use]
    pub fn deformations_at(&self, disp: AtAxis<&[f64]>) -> AtStructure<Vec<f64>> {
        let axes = self.axes.iter().zip(disp.each());
        AtStructure(axes.map(|(axis, disp)| axis.deformation(disp).0).collect())
    }
}

// Methods for the controller of a server, beside its signals.
impl ReceivedPort {
    /// See `Port::ramp_time`.
    #[must_use]
    pub fn ramp_time(&self, share: f64, tick: f64, shortest: f64) -> f64 {
        self.0.ramp_time(share, tick, shortest)
    }

    /// See `Port::pause`.
    ///
    /// # Errors
    /// The link is lost.
    pub fn pause(&mut self) -> Result<(), LinkFault> {
        self.0.pause()
    }

    /// See `Port::seek_at`.
    pub fn seek_at(&mut self, along: &mut impl Iterator<Item = AtStructure<(f64, f64)>>) {
        self.0.seek_at(along)
    }

    /// See `Port::freeze_compensation`.
    #[must_use]
    pub fn freeze_compensation(&mut self) -> Option<TestState> {
        self.0.freeze_compensation()
    }

    /// See `Port::has_come_to_rest`.
    pub fn has_come_to_rest(&mut self) {
        self.0.has_come_to_rest()
    }
}
