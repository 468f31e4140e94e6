//! Commands that another controller sends, through a server.
//!
//! The controller commands the signals of the port: the deformations of its axes, or the coordinates of its loading
//! unit. They go through the port as the targets of a structure do, and displacements and forces come back the same way.

use super::*;

impl Port {
    /// Joins a substructure to a controller that commands its axes in their own units. What that sends is passed on to the last bit.
    /// Nothing is estimated. `stiffness` is the estimate k̂ of each axis, in its units.
    #[must_use]
    pub fn received(
        name: impl Into<String>,
        substructure: Box<dyn Substructure>,
        mut stiffness: Vec<f64>,
    ) -> Self {
        let axes = vec![Axis::received(); substructure.axes()];
        stiffness.resize(axes.len(), 0.0);
        let mut port = Self::joined(name.into(), axes, substructure, stiffness);
        port.take_received_commands();
        port
    }

    /// Another controller commands it: each of its commands is a target, and is answered. Nothing is estimated.
    #[must_use]
    pub fn with_received_commands(mut self) -> Self {
        self.take_received_commands();
        self
    }

    fn take_received_commands(&mut self) {
        self.path.set_pace(true, Order::default());
        self.pause_estimates();
    }

    /// Its guard, for a specimen that has more than one server: only one of them commands it at a time.
    #[must_use]
    pub const fn guard(&self) -> &Guard {
        &self.guard
    }

    /// Takes the guard that another server of the same specimen had.
    pub fn set_guard(&mut self, guard: Guard) {
        if guard.declared().len() == self.axes.len() {
            self.guard = guard;
        }
    }

    /// Another substructure with as many axes answers from here on, and all counts restart. Returns the substructure before, or the
    /// new one if its axes do not fit.
    pub fn swap_partner(&mut self, substructure: Box<dyn Substructure>) -> Box<dyn Substructure> {
        if substructure.axes() != self.axes.len() {
            return substructure;
        }
        self.feedback = Feedback::new(self.axes.len());
        self.exchange.swap(substructure)
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
    pub fn begin_commands(&mut self, sequence: u64, disp: &[f64]) {
        self.found_at(disp);
        self.path.stands_at(disp);
        self.stand_still();
        let strokes = self.deformations_at(disp);
        if let Some(unit) = &mut self.loading_unit {
            unit.stands_at(&strokes);
        }
        self.exchange.renumber(sequence);
        self.feedback.forget_number();
    }

    /// The specimen is found at `disp`, in its own unit: the next command is a step from there.
    pub fn found_at(&mut self, disp: &[f64]) {
        self.guard.is_found_at(disp);
    }

    /// Wall time in s of the next motion. Real-time: yes.
    pub fn set_motion_time(&mut self, seconds: f64) {
        self.guard.watch_mut().tick_is(seconds);
    }

    /// True if the next command is the last one once more. Real-time: yes.
    #[must_use]
    pub fn repeats(&self) -> bool {
        self.guard.is_at(&self.path.command().disp)
    }

    /// The specimen came to where it stands with the velocities of the next command, for `seconds`. Real-time: yes.
    pub fn came_with_command(&mut self, seconds: f64) {
        self.guard.came_with(&self.path.command().vel, seconds);
    }

    /// The guard's record of past commands.
    #[must_use]
    pub const fn watch(&self) -> &limits::Watch {
        self.guard.watch()
    }

    /// The specimen's introduction. Nothing moves.
    ///
    /// # Errors
    /// The specimen cannot take part.
    pub fn introduce(&mut self) -> Result<Introduction, Unavailable> {
        self.exchange.connect()
    }

    /// See [`Substructure::commanded_every`].
    pub fn commanded_every(&mut self, seconds: f64) {
        self.exchange.commanded_every(seconds);
    }

    /// Measures before the first command, in the specimen's units; false if the specimen does not.
    pub fn at_rest(&mut self, into: &mut Measurement) -> bool {
        self.exchange.at_rest(into)
    }

    /// A computed specimen forgets what was not accepted.
    pub fn revert(&mut self) {
        self.exchange.revert();
    }

    /// Tangent stiffness, n × n by columns, in the specimen's units; false if it is not known. Real-time: yes.
    pub fn tangent(&self, stiffness: &mut [f64]) -> bool {
        self.exchange.tangent(stiffness)
    }

    /// Takes note of whether the last answer says that the specimen's own watchdog holds it. Real-time: yes.
    pub fn note_hold(&mut self, freshness: Freshness) -> Hold {
        let status = self.feedback.raw().status;
        self.exchange.note_hold(status, freshness)
    }
}

// Signals: what the controller commands, at the structure's scale.
impl Port {
    /// Number of coordinates of the loading unit; 0 without one.
    #[must_use]
    pub fn coordinates(&self) -> usize {
        let geometry = self.geometry();
        geometry.map_or(0, |geometry| geometry.coordinates().len())
    }

    /// Makes the next command from deformations of the axes in m, of a loading unit from the strokes of its actuators: displacement
    /// and velocity of one axis after the other. Nothing is compensated. Real-time: yes.
    pub fn aim_axes(&mut self, along: impl Iterator<Item = (f64, f64)>) {
        self.leave_pose();
        self.path.target_mut().take(along);
        self.path.follow_target(&self.axes);
    }

    /// The target that was sought last: deformations of the axes in m, of a loading unit the strokes of its actuators. Real-time: yes.
    #[must_use]
    pub fn goal(&self) -> &[f64] {
        &self.path.goal().disp
    }

    /// Writes the commands that hold the axes at the target that was sought last, in the specimen's unit. Real-time: yes.
    pub fn write_goal(&self, into: &mut [f64]) {
        let goal = self.axes.iter().zip(&self.path.goal().disp).enumerate();
        for (to, (index, (axis, disp))) in into.iter_mut().zip(goal) {
            *to = axis.command(self.static_gain(index) * disp);
        }
    }

    /// Command at rest over the displacement at which the axis is to rest: 1 where no compensator has a static gain. Real-time: yes.
    fn static_gain(&self, axis: usize) -> f64 {
        let compensators = self.path.compensators();
        compensators.map_or(1.0, |compensators| compensators.static_gain(axis))
    }

    /// Velocities that come with targets are the slope of a path, and no differences.
    pub const fn take_velocities_of_a_path(&mut self) {
        self.path.take_velocities_of_a_path();
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

    /// Commands at rest after which [`Port::skips_commands`] is not needed: an adaptive compensator learns nothing wrong. Real-time: yes.
    pub fn ticks_to_rest(&mut self) -> u32 {
        let compensators = self.path.compensators_mut();
        compensators.map_or(0, |compensators| compensators.ticks_to_rest())
    }

    /// Velocities of the next command, in the specimen's unit. Real-time: yes.
    #[must_use]
    pub fn command_vel(&self) -> &[f64] {
        &self.path.command().vel
    }

    /// Displacement in m (or rad) and force in N (or N m) of one signal after the other, as measured last, with its number from 0.
    /// [`Port::resolve_pose`] finds those of a loading unit. Real-time: yes.
    pub fn read_signals(&self, mut read: impl FnMut(usize, f64, f64)) {
        if self.loading_unit.is_some() {
            for (index, (_, [_, disp, force])) in self.pose().enumerate() {
                read(index, disp, force);
            }
            return;
        }
        let measured = self.measured().iter().zip(self.force());
        for (index, (disp, force)) in measured.enumerate() {
            read(index, *disp, *force);
        }
    }

    /// Takes a measurement at rest, in the specimen's units, which belongs to no command.
    ///
    /// # Errors
    /// The actuators cannot have these strokes.
    pub fn take_at_rest(&mut self, at_rest: &Measurement) -> Result<(), Fault> {
        self.feedback.take_at_rest(at_rest, &self.axes);
        self.resolve_pose()
    }

    /// Commands in the specimen's unit that hold the axes at signals in m or rad.
    ///
    /// # Errors
    /// The actuators cannot have this pose.
    pub fn commands_for(&self, signals: &[f64]) -> Result<Vec<f64>, Fault> {
        let strokes = match &self.loading_unit {
            Some(unit) => unit.strokes_for(signals)?,
            None => signals.to_vec(),
        };
        let axes = self.axes.iter().zip(strokes).enumerate();
        let commands =
            axes.map(|(index, (axis, disp))| axis.command(self.static_gain(index) * disp));
        Ok(commands.collect())
    }

    /// Signals in m or rad of axes that the commands `disp` hold, in the specimen's own unit.
    ///
    /// # Errors
    /// The actuators cannot have these strokes.
    pub fn signals_at(&self, disp: &[f64]) -> Result<Vec<f64>, Fault> {
        let mut strokes = self.deformations_at(disp);
        for (index, stroke) in strokes.iter_mut().enumerate() {
            *stroke /= self.static_gain(index);
        }
        match &self.loading_unit {
            Some(unit) => unit.pose_at(&strokes),
            None => Ok(strokes),
        }
    }

    /// Deformations of the axes in m, or strokes of a loading unit, at the position `disp` of the specimen, in its own unit.
    #[must_use]
    pub fn deformations_at(&self, disp: &[f64]) -> Vec<f64> {
        let axes = self.axes.iter().zip(disp);
        axes.map(|(axis, disp)| axis.deformation(*disp)).collect()
    }

    /// Compares the stiffness that the specimen reports with k̂, at the structure's scale.
    ///
    /// # Errors
    /// An axis reports another sign.
    pub fn compare_stiffness(&self, reported: &[f64]) -> Result<Vec<String>, Unavailable> {
        self.expected().compare_stiffness(reported)
    }
}
