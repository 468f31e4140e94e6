//! One specimen as the loop sees it: the way from the structure's degrees of freedom to a specimen's axes and back.
//!
//! A [`Port`] is made of parts that own their data. The command path makes commands of targets, the guard judges them, the exchange
//! sends them and takes the answer, and the feedback brings it back to the structure. Startup, estimates and tracking are parts of
//! their own. The port itself holds the operations that need several parts. Invariant: no command leaves that was not
//! judged. The last command may leave again, at rest.
//! Limits: no clock, no thread, no file; every value of a tick can be read, so that the row hides nothing.
//!
//! A value that leaves or enters a port carries its frame: see [`gusset_quantity::frame`]. A target in metres becomes a command:
//!
//! ```
//! use gusset_control::port::ReceivedPort;
//! use gusset_quantity::frame::AtStructure;
//!
//! fn send(port: &mut ReceivedPort, target: AtStructure<&[f64]>) {
//!     let command = port.commands_for(target).unwrap();
//!     port.begin_commands(0, command.part(Vec::as_slice));
//! }
//! ```
//!
//! A command in the unit of an axis cannot be sent as metres:
//!
//! ```compile_fail,E0308
//! use gusset_control::port::ReceivedPort;
//!
//! fn send(port: &mut ReceivedPort) {
//!     let command = port.commands_for(port.command()).unwrap();
//!     port.begin_commands(0, command.part(Vec::as_slice));
//! }
//! ```

mod assembly;
mod axis;
mod axis_motion;
mod bend;
mod brake;
mod command_path;
mod compensators;
mod error;
mod estimates;
mod exchange;
mod exchange_state;
mod feedback;
mod guard;
mod initial_stiffness;
mod interpolation;
mod introduction;
mod late_pacer;
pub mod limits;
mod linear_stand_in;
mod link_numbers;
mod loading_unit;
mod motion_check;
mod passed;
mod prediction;
mod probe;
mod ramp;
mod received;
mod rest;
mod retrace;
mod return_move;
mod row_product;
mod sensor_zero;
mod spec;
mod startup;
mod step_pacer;
mod stiffness;
mod stiffness_check;
mod tangent;
mod target_path;
mod tracking;
mod trend;
mod unloading;
mod wiring_check;
mod wiring_fault;

pub use axis::Axis;
pub(crate) use brake::Brake;
pub use compensators::Compensation;
pub use error::PortError;
pub use estimates::Declared;
pub use exchange::{Hold, LinkCount, OnStale, WaitRules};
pub use guard::Guard;
pub use interpolation::{Order, PathPoint, shares};
pub use late_pacer::SlowDown;
pub use linear_stand_in::LinearStandIn;
pub use loading_unit::{LoadingUnit, PoseRow, Poses};
pub(crate) use motion_check::MotionCheck;
pub use prediction::{Ahead, Made, Prediction, Refusal};
pub use probe::{Found, Pace, Probe, WayBack, Wiring};
pub use ramp::SHARE_OF_SPEED;
pub(crate) use ramp::UNBOUNDED_RAMP_S;
pub use received::ReceivedPort;
pub(crate) use rest::Rest;
pub(crate) use return_move::ReturnMove;
pub use return_move::{Exit, Exits};
pub use sensor_zero::{DispZero, Reading, Reference, Zero};
pub use spec::{AxisSpec, LoadingUnitSpec, PortSpec};
pub use startup::NeedsMeasuredDisp;
pub(crate) use step_pacer::PacerTick;
pub(crate) use step_pacer::StepPacer;
pub use tangent::{Point as TangentPoint, Tangent};
pub use tracking::TrackingSpec;
pub use trend::Trend;
pub use unloading::UnloadFailure;
pub use wiring_check::WiringCheck;
pub use wiring_fault::{Channel, WiringFault};

pub use gusset_quantity::catalog::phase::Stage;

use std::ops::Range;

use axis_motion::AxisMotion;
use command_path::CommandPath;
use estimates::{Estimates, Observation};
use exchange::Exchange;
use exchange_state::Loss;
use feedback::Feedback;
use gusset_actuator::geometry::{Fault, Geometry};
use gusset_quantity::frame::{AtAxis, AtStructure};
use gusset_quantity::state;
use gusset_quantity::state::TestState;
use gusset_quantity::substructure::{
    Freshness, Holder, Introduction, LinkFault, Measurement, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;
use initial_stiffness::InitialStiffness;
use introduction::Expectation;
use retrace::Retrace;
use return_move::ReturnStart;
use startup::Startup;
use tracking::Tracking;

/// One specimen with its axes, guard and link.
pub struct Port {
    name: String,
    axes: Vec<Axis>,
    /// The loading unit whose actuators the axes are.
    loading_unit: Option<Box<LoadingUnit>>,
    path: CommandPath,
    exchange: Exchange,
    guard: Guard,
    feedback: Feedback,
    stiffness: InitialStiffness,
    estimates: Estimates,
    tracking: Tracking,
    startup: Startup,
    exits: Exits,
    /// The motion that is retraced when it is interrupted.
    retrace: Option<Retrace>,
}

// When a step is closed.
state! {
    Port as "port" {
        axes, loading_unit: configured(), path, exchange, guard, feedback, estimates, tracking, startup
    }
    keeps { name, stiffness, exits, retrace }
}

impl std::fmt::Debug for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Port")
            .field("name", &self.name)
            .field("axes", &self.axes)
            .finish()
    }
}

// Its parts.
impl Port {
    /// Name from the test file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of axes.
    #[inline]
    #[must_use]
    pub const fn axes(&self) -> usize {
        self.axes.len()
    }

    /// The map between each axis and the structure.
    #[inline]
    #[must_use]
    pub fn axis_maps(&self) -> &[Axis] {
        &self.axes
    }

    /// Targets and commands.
    #[inline]
    #[must_use]
    pub const fn path(&self) -> &CommandPath {
        &self.path
    }

    /// The link and its counts.
    #[inline]
    #[must_use]
    pub const fn exchange(&self) -> &Exchange {
        &self.exchange
    }

    /// The limits, and past commands.
    #[inline]
    #[must_use]
    pub const fn guard(&self) -> &Guard {
        &self.guard
    }

    /// The measurements.
    #[inline]
    #[must_use]
    pub const fn feedback(&self) -> &Feedback {
        &self.feedback
    }

    /// Readings at rest, and how the wiring is checked.
    #[inline]
    #[must_use]
    pub const fn startup(&self) -> &Startup {
        &self.startup
    }

    /// Tangents, and the energy that the transfer system adds.
    #[inline]
    #[must_use]
    pub const fn estimates(&self) -> &Estimates {
        &self.estimates
    }

    /// Delay and gain of the axes.
    #[inline]
    #[must_use]
    pub const fn tracking(&self) -> &Tracking {
        &self.tracking
    }

    /// Targets and commands, to be changed.
    #[inline]
    pub const fn path_mut(&mut self) -> &mut CommandPath {
        &mut self.path
    }

    /// The link and its counts, to be changed.
    #[inline]
    pub const fn exchange_mut(&mut self) -> &mut Exchange {
        &mut self.exchange
    }

    /// The limits and past commands, to be changed.
    #[inline]
    pub const fn guard_mut(&mut self) -> &mut Guard {
        &mut self.guard
    }

    /// The measurements, to be changed.
    #[inline]
    pub(crate) const fn feedback_mut(&mut self) -> &mut Feedback {
        &mut self.feedback
    }

    /// Readings at rest and the wiring check, to be changed.
    #[inline]
    pub const fn startup_mut(&mut self) -> &mut Startup {
        &mut self.startup
    }

    /// The loading unit, if its axes are actuators of one.
    #[inline]
    #[must_use]
    pub fn loading_unit(&self) -> Option<&LoadingUnit> {
        self.loading_unit.as_deref()
    }
}

// Targets and commands.
impl Port {
    /// Makes the next command from the structure's state. Real-time: yes.
    pub fn aim(&mut self, disp: &[f64], vel: &[f64], base_disp: f64, base_vel: f64) {
        let target = self.path.target_mut();
        let unit = self.loading_unit.as_deref_mut();
        AxisMotion::seek(target, &self.axes, unit, [disp, vel], [base_disp, base_vel]);
        self.path.prepare(&self.axes);
    }

    /// Makes the next command from prescribed deformations: takes displacement and velocity of one axis (or of one coordinate
    /// of the loading unit) after the other from `along`. Real-time: yes.
    pub fn aim_at(&mut self, along: &mut impl Iterator<Item = AtStructure<(f64, f64)>>) {
        let target = self.path.target_mut();
        AxisMotion::seek_at(target, self.loading_unit.as_deref_mut(), along);
        self.path.prepare(&self.axes);
    }

    /// The target of the next step, from the structure's state. Real-time: yes.
    #[inline]
    pub(crate) fn seek(&mut self, disp: &[f64], vel: &[f64], base_disp: f64, base_vel: f64) {
        let goal = self.path.goal_mut();
        let unit = self.loading_unit.as_deref_mut();
        AxisMotion::seek(goal, &self.axes, unit, [disp, vel], [base_disp, base_vel]);
    }

    /// The target of the next step, from prescribed deformations. Real-time: yes.
    pub(crate) fn seek_at(&mut self, along: &mut impl Iterator<Item = AtStructure<(f64, f64)>>) {
        let goal = self.path.goal_mut();
        AxisMotion::seek_at(goal, self.loading_unit.as_deref_mut(), along);
    }

    /// The target is the first one of the test; everything has rested there.
    pub(crate) fn begin_way(&mut self) {
        self.path.begin();
        if self.path.is_per_step() {
            self.exchange.state_mut().pend();
        }
        let goal = self.path.goal().part(AxisMotion::disp);
        self.guard.aims_from(&self.axes, goal);
    }

    /// The next target is known from here on, `share` of the step after the last. Real-time: yes.
    #[inline]
    pub(crate) fn know(&mut self, share: f64) {
        let goal = self.path.goal().part(AxisMotion::disp);
        self.guard.aims_at(&self.axes, goal);
        self.path.know(share, &self.axes);
        if self.path.is_per_step() {
            self.exchange.state_mut().pend();
        }
    }

    /// The axes rest at the target: a path that is predicted begins. Real-time: yes.
    pub(crate) fn rest_on_the_way(&mut self) {
        self.path.begin();
        self.path.reach();
        let goal = self.path.goal().part(AxisMotion::disp);
        self.guard.aims_from(&self.axes, goal);
    }

    /// The next target of a path that is predicted is known. Real-time: yes.
    pub(crate) fn know_on_the_way(&mut self, share: f64) {
        let goal = self.path.goal().part(AxisMotion::disp);
        self.guard.aims_at(&self.axes, goal);
        self.path.know_on_the_way(share, &self.axes);
    }

    /// Makes the command at the end of a tick of the step pacer, with steps of `dt` seconds of test time. Real-time: yes.
    #[inline]
    pub(crate) fn advance(&mut self, tick: &PacerTick, dt: f64) {
        self.path.advance(tick, dt, &self.axes);
    }

    /// The next command is the last one: nothing moves.
    pub(crate) fn stand_still(&mut self) {
        self.leave_pose();
        self.path.stand_still();
    }

    /// The next commands are strokes from where the actuators are, whatever pose was sought.
    fn leave_pose(&mut self) {
        if let Some(unit) = &mut self.loading_unit {
            unit.leave_pose();
        }
    }

    /// The ramp goes from the last command to the next one.
    pub fn begin_ramp(&mut self) {
        let unit = self.loading_unit.as_deref_mut();
        self.path.begin_ramp(&self.axes, unit);
    }

    /// The next command is at this share (0 … 1) of a ramp that takes `seconds` of test time.
    pub fn ramp_to(&mut self, share: f64, seconds: f64) {
        let unit = self.loading_unit.as_deref_mut();
        self.path.ramp_to(share, seconds, &self.axes, unit);
    }

    /// Shortest time in s of wall time for the ramp that was begun, in ticks of `tick` s: `shortest`, or longer where it would exceed
    /// `share` of a limit. A specimen whose position is known is given a second at least where no limit bounds its speed.
    #[must_use]
    pub(crate) fn ramp_time(&self, share: f64, tick: f64, shortest: f64) -> f64 {
        self.way_time(share, tick, shortest, UNBOUNDED_RAMP_S)
    }

    /// Shortest time of one part of a way, as [`Port::ramp_time`]: where no limit bounds the speed, a specimen whose position is known
    /// gets `unbounded` s at least, and any other `shortest`.
    #[must_use]
    pub(crate) fn way_time(&self, share: f64, tick: f64, shortest: f64, unbounded: f64) -> f64 {
        let unbounded = if self.startup.standing().is_some() {
            unbounded
        } else {
            shortest
        };
        let ends = [self.path.sent(), self.command()];
        let steepest = |axis| self.steepest(axis);
        self.guard
            .way_time(ends, steepest, [share, tick], [shortest, unbounded])
    }

    /// Where its poses bend the way of an actuator, the distance in its own unit for which that is nowhere faster; else 0.
    fn steepest(&self, axis: usize) -> AtAxis<f64> {
        let unit = self.loading_unit.as_deref().zip(self.axes.get(axis));
        AtAxis(unit.map_or(0.0, |(unit, of)| {
            (unit.steepest(axis).0 * of.disp_gain).abs()
        }))
    }

    /// Judges the next command. It may leave only if nothing trips. Real-time: yes.
    #[inline]
    pub fn clear(&mut self) -> limits::Found {
        let found = self.guard.judge_command(self.path.command());
        // No stroke belongs to a pose that cannot be.
        let unit = self.loading_unit.as_deref();
        let is_posed = unit.is_none_or(LoadingUnit::is_possible);
        self.path.clear(found.trip.is_none() && is_posed);
        found
    }
}

// The exchange of one tick.
impl Port {
    /// Sends the next command, if it was judged. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost, or the command was not judged ([`Port::clear`]).
    #[inline]
    pub fn issue(&mut self, sequence: u64, time: f64, dt: f64) -> Result<(), LinkFault> {
        if !self.path.release() {
            return Err(LinkFault::Refused);
        }
        let command = self.path.command();
        let motion = [
            command.part(AxisMotion::disp),
            command.part(AxisMotion::vel),
        ];
        self.guard.sent(motion[0]);
        self.feedback.mark_command();
        self.tracking.note_sent(Some(dt));
        let outcome = self.exchange.send(sequence, [time, dt], motion);
        if outcome.is_err() {
            self.feedback.note_unsent();
        }
        outcome
    }

    /// Sends the target of a partner that is commanded once a step, if it was judged. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost, or the command was not judged.
    pub(crate) fn tell_target(
        &mut self,
        sequence: u64,
        time: f64,
        dt: f64,
    ) -> Result<(), LinkFault> {
        self.issue(sequence, time, dt)?;
        self.exchange.state_mut().told_the_target();
        Ok(())
    }

    /// Sends the last command again, at rest, whatever the next command is. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    pub(crate) fn repeat(&mut self, sequence: u64, time: f64) -> Result<(), LinkFault> {
        self.guard.sent_again(self.path.sent());
        self.path.repeat();
        self.tracking.note_sent(None);
        let motion = self.path.last_at_rest();
        let outcome = self.exchange.send(sequence, [time, 0.0], motion);
        if outcome.is_err() {
            self.feedback.note_unsent();
        }
        outcome
    }

    /// Takes the answer and brings it into the structure's units. One that is older than what is known already counts
    /// as stale and changes nothing. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost, or the force is not a finite number.
    #[inline]
    pub fn collect(&mut self, deadline: Nanos) -> Result<Freshness, LinkFault> {
        let incoming = self.feedback.incoming();
        let answer = self.exchange.collect(deadline, incoming);
        let (is_fresh, is_finite) = self.feedback.take(answer, &self.axes)?;
        self.exchange.note_answer(is_fresh, is_finite);
        let raw = self.feedback.raw();
        self.path.hear(&self.axes, AtAxis(&raw.disp), is_fresh);
        match (is_finite, is_fresh) {
            (false, _) => Err(LinkFault::NotFinite),
            (true, true) => Ok(Freshness::Fresh),
            (true, false) => Ok(Freshness::Stale),
        }
    }

    /// Takes note of whether the last answer says that the specimen's own watchdog holds it. Real-time: yes.
    pub(crate) fn note_hold(&mut self, freshness: Freshness) -> Hold {
        let status = self.feedback.raw().status;
        self.exchange.note_hold(status, freshness)
    }

    /// Judges the measurement last taken, which must be a fresh one. Real-time: yes.
    #[inline]
    pub fn judge(&mut self) -> limits::Found {
        let raw = self.feedback.raw();
        let mut found = self
            .guard
            .judge_measured(raw, &self.axes, self.path.sent(), &self.startup);
        let observed = Observation {
            axes: &self.axes,
            path: &self.path,
            feedback: &self.feedback,
            stiffness: &self.stiffness,
        };
        if !self.estimates.is_resting() {
            self.estimates.take(&observed);
            let judged = self.estimates.judged();
            self.guard.judge_estimates(judged, &mut found);
        }
        if self.tracking.take(&observed) {
            self.guard
                .judge_tracking(self.tracking.judged(), &mut found);
        }
        found
    }

    /// Takes the force of an answer that was lost and came with a later one into [`Feedback::recovered`], one with each call;
    /// the number of its command in the test. Real-time: yes.
    pub(crate) fn recover(&mut self) -> Option<u64> {
        let Self {
            exchange, feedback, ..
        } = self;
        feedback.take_recovered(|force| exchange.recover(force), &self.axes)
    }

    /// Moves a stale force along the known tangent, within its bounds, from the measured displacement to the target. Real-time: yes.
    pub(crate) fn extrapolate(&mut self) {
        let tangents = self.estimates.bounded(self.stiffness.own());
        let target = self.path.target().part(AxisMotion::disp);
        self.feedback.extrapolate(tangents, target);
    }

    /// residual −= Bᵀ·force, these rows of it; the slice is whole. Real-time: yes.
    #[inline]
    pub(crate) fn subtract_force(&mut self, rows: Range<usize>, residual: &mut [f64]) {
        match &self.loading_unit {
            Some(unit) => unit.subtract_force(rows, residual),
            None => self.feedback.subtract_force(&self.axes, rows, residual),
        }
    }

    /// Takes the pose and the forces of its coordinates from what was measured for the step that is closed. Does nothing
    /// where there is no loading unit. Real-time: yes.
    ///
    /// # Errors
    /// The actuators cannot have these strokes.
    #[inline]
    pub fn resolve_pose(&mut self) -> Result<(), Fault> {
        match &mut self.loading_unit {
            Some(unit) => unit.resolve(self.feedback.disp(), self.feedback.force()),
            None => Ok(()),
        }
    }

    /// Takes the pose of a measurement that belongs to no step: in the row an impossible pose is NaN. Real-time: yes.
    pub(crate) fn look_at_pose(&mut self) {
        if self.feedback.is_fresh() {
            let _ = self.resolve_pose();
        }
    }

    /// Keeps what belongs to the target that was just reached, until the slowest partner has answered. Real-time: yes.
    pub(crate) fn keep(&mut self) {
        if !self.path.is_per_step() {
            self.path.keep_target();
            self.feedback.keep();
        }
    }

    /// Takes what was kept for what enters equilibrium now. Real-time: yes.
    pub(crate) fn take_kept(&mut self) {
        if !self.path.is_per_step() {
            self.path.take_kept_target();
            self.feedback.take_kept();
        }
    }

    /// The step is accepted. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    #[inline]
    pub fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        self.exchange.accepted(sequence, self.path.is_per_step())
    }
}

// The partner and what is owed.
impl Port {
    /// It is not commanded any more; `gone`: because its link is. Real-time: yes.
    pub(crate) fn lose(&mut self, gone: bool) {
        self.exchange
            .state_mut()
            .lose(if gone { Loss::Gone } else { Loss::Distrusted });
    }

    /// The operator holds the test. A partner that is commanded in every tick need not know.
    /// Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    pub(crate) fn pause(&mut self) -> Result<(), LinkFault> {
        if self.exchange.state().is_lost() || !self.path.is_per_step() {
            return Ok(());
        }
        self.exchange.pause()
    }
}

// Values for a row and a summary.
impl Port {
    /// Deformation that the structure asks for: B·x, in m; of an actuator the stroke for the pose B·x.
    #[inline]
    #[must_use]
    pub(crate) fn target(&self) -> AtStructure<&[f64]> {
        self.path.target().part(AxisMotion::disp)
    }

    /// Target, command, measured displacement and force of an axis, and the last two as received; NaN of one that is not there.
    /// Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) fn motion_of(&self, axis: usize) -> [f64; 6] {
        let at = |values: &[f64]| values.get(axis).copied().unwrap_or(f64::NAN);
        let raw = self.feedback.raw();
        [
            at(&self.target()),
            at(&self.path.sent()),
            at(&self.feedback.disp()),
            at(&self.feedback.force()),
            at(&raw.disp),
            at(&raw.force),
        ]
    }

    /// Velocity of the target in m/s (it belongs to t − Δt/2 with the published start).
    #[inline]
    #[must_use]
    #[cfg(test)]
    pub(crate) fn target_vel(&self) -> &[f64] {
        &self.path.target().vel
    }

    /// The next command, in the specimen's unit.
    #[inline]
    #[must_use]
    pub fn command(&self) -> AtAxis<&[f64]> {
        self.path.command().part(AxisMotion::disp)
    }

    /// The loading unit, if its axes are actuators of one.
    #[must_use]
    pub(crate) fn geometry(&self) -> Option<&Geometry> {
        self.loading_unit.as_deref().map(LoadingUnit::geometry)
    }

    /// How far the platform went. Allocates.
    #[must_use]
    pub(crate) fn poses(&self) -> Option<Poses> {
        self.loading_unit.as_deref().map(LoadingUnit::poses)
    }

    /// How the specimen is left.
    #[must_use]
    pub const fn exits(&self) -> &Exits {
        &self.exits
    }
}

#[cfg(test)]
mod tests;
