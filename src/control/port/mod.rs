//! One specimen as the loop sees it: the way from the structure's degrees of freedom to a specimen's axes and back.
//!
//! A [`Port`] is made of parts that own their data. The command path makes commands of targets, the guard judges them, the exchange
//! sends them and takes the answer, and the feedback brings it back to the structure. Startup, estimates and tracking are parts of
//! their own. The port itself holds the operations that need several parts. Invariant: no command leaves that was not
//! judged. The last command may leave again, at rest.
//! Limits: no clock, no thread, no file; every value of a tick can be read, so that the row hides nothing.

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
pub mod limits;
mod linear_stand_in;
mod link_numbers;
mod loading_unit;
mod motion_check;
mod passed;
mod probe;
mod ramp;
mod received;
mod rest;
mod retrace;
mod return_move;
mod row_product;
mod sensor_zero;
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
pub use brake::Brake;
pub use error::PortError;
pub use estimates::Declared;
pub use exchange::{Hold, LinkCount, OnStale, WaitRules};
pub use guard::Guard;
pub use interpolation::{Order, PathPoint, shares};
pub use linear_stand_in::LinearStandIn;
pub use loading_unit::{PoseRow, Poses};
pub use motion_check::MotionCheck;
pub use probe::{Found, Pace, Probe, WayBack, Wiring};
pub use ramp::{SHARE_OF_SPEED, UNBOUNDED_RAMP_S};
pub use rest::Rest;
pub use return_move::{Exit, Exits, ReturnMove};
pub use sensor_zero::{DispZero, Reading, Reference, Zero};
pub use startup::NeedsMeasuredDisp;
pub use step_pacer::{HOLD_AT, PacerTick, SLOW_FROM, StepPacer};
pub use stiffness::{Opinion, compare_stiffness};
pub use tangent::{Point as TangentPoint, Tangent};
pub use trend::Trend;
pub use unloading::UnloadFailure;
pub use wiring_check::WiringCheck;
pub use wiring_fault::{Channel, WiringFault};

pub use gusset_quantity::catalog::phase::Stage;

use std::ops::Range;

use command_path::CommandPath;
use estimates::{Estimates, Observation};
use exchange::Exchange;
use exchange_state::Loss;
use feedback::Feedback;
use gusset_actuator::compensation::Parameter;
use gusset_actuator::geometry::{Coordinate, Fault, Geometry};
use gusset_quantity::state;
use gusset_quantity::state::TestState;
use gusset_quantity::substructure::{
    Coupling, Freshness, Holder, Introduction, LinkFault, Measurement, Retirement, Substructure,
    Unavailable,
};
use gusset_quantity::time::Nanos;
use initial_stiffness::InitialStiffness;
use introduction::Expectation;
use loading_unit::LoadingUnit;
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

// Targets and commands.
impl Port {
    /// Makes the next command from the structure's state. Real-time: yes.
    pub fn aim(&mut self, disp: &[f64], vel: &[f64], base_disp: f64, base_vel: f64) {
        let target = self.path.target_mut();
        let unit = self.loading_unit.as_deref_mut();
        target.seek(&self.axes, unit, [disp, vel], [base_disp, base_vel]);
        self.path.prepare(&self.axes);
    }

    /// Makes the next command from prescribed deformations: takes displacement and velocity of one axis (or of one coordinate
    /// of the loading unit) after the other from `along`. Real-time: yes.
    pub fn aim_at(&mut self, along: &mut impl Iterator<Item = (f64, f64)>) {
        let target = self.path.target_mut();
        target.seek_at(self.loading_unit.as_deref_mut(), along);
        self.path.prepare(&self.axes);
    }

    /// The target of the next step, from the structure's state. Real-time: yes.
    #[inline]
    pub(crate) fn seek(&mut self, disp: &[f64], vel: &[f64], base_disp: f64, base_vel: f64) {
        let goal = self.path.goal_mut();
        let unit = self.loading_unit.as_deref_mut();
        goal.seek(&self.axes, unit, [disp, vel], [base_disp, base_vel]);
    }

    /// The target of the next step, from prescribed deformations. Real-time: yes.
    pub fn seek_at(&mut self, along: &mut impl Iterator<Item = (f64, f64)>) {
        let goal = self.path.goal_mut();
        goal.seek_at(self.loading_unit.as_deref_mut(), along);
    }

    /// The target is the first one of the test; everything has rested there.
    pub(crate) fn begin_way(&mut self) {
        self.path.begin();
        if self.path.is_per_step() {
            self.exchange.state_mut().pend();
        }
        self.guard.aims_from(&self.axes, &self.path.goal().disp);
    }

    /// The next target is known from here on, `share` of the step after the last. Real-time: yes.
    #[inline]
    pub(crate) fn know(&mut self, share: f64) {
        self.guard.aims_at(&self.axes, &self.path.goal().disp);
        self.path.know(share, &self.axes);
        if self.path.is_per_step() {
            self.exchange.state_mut().pend();
        }
    }

    /// The command reaches its target in this tick: from here on the next is sought. Real-time: yes.
    #[inline]
    pub(crate) fn reach(&mut self) {
        self.path.reach();
    }

    /// Makes the command at the end of a tick of the step pacer, with steps of `dt` seconds of test time. Real-time: yes.
    #[inline]
    pub(crate) fn advance(&mut self, tick: &PacerTick, dt: f64) {
        self.path.advance(tick, dt, &self.axes);
    }

    /// No command is made for the next tick: the last one has left, and is repeated. Real-time: yes.
    #[inline]
    pub(crate) fn hold_compensation(&mut self) {
        self.path.hold();
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
    pub fn ramp_time(&self, share: f64, tick: f64, shortest: f64) -> f64 {
        self.way_time(share, tick, shortest, UNBOUNDED_RAMP_S)
    }

    /// Shortest time of one part of a way, as [`Port::ramp_time`]: where no limit bounds the speed, a specimen whose position is known
    /// gets `unbounded` s at least, and any other `shortest`.
    #[must_use]
    pub(crate) fn way_time(&self, share: f64, tick: f64, shortest: f64, unbounded: f64) -> f64 {
        let unbounded = if self.standing().is_some() {
            unbounded
        } else {
            shortest
        };
        let ends = [self.sent(), self.command()];
        let steepest = |axis| self.steepest(axis);
        self.guard
            .way_time(ends, steepest, [share, tick], [shortest, unbounded])
    }

    /// Where its poses bend the way of an actuator, the distance in its own unit for which that is nowhere faster; else 0.
    fn steepest(&self, axis: usize) -> f64 {
        let unit = self.loading_unit.as_deref().zip(self.axes.get(axis));
        unit.map_or(0.0, |(unit, of)| (unit.steepest(axis) * of.disp_gain).abs())
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
    /// A tick begins: nothing was judged in it. Real-time: yes.
    #[inline]
    pub(crate) fn begin_tick(&mut self) {
        self.guard.begin_tick();
    }

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
        self.guard.sent(&command.disp);
        self.feedback.mark_command();
        self.tracking.note_sent(Some(dt));
        let motion = [&*command.disp, &*command.vel];
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
        self.path.hear(&self.axes, &raw.disp, is_fresh);
        match (is_finite, is_fresh) {
            (false, _) => Err(LinkFault::NotFinite),
            (true, true) => Ok(Freshness::Fresh),
            (true, false) => Ok(Freshness::Stale),
        }
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

    /// The next of the trips and warnings that were found beside the first. Real-time: yes.
    pub fn next_untold(&mut self) -> Option<limits::Hit> {
        self.guard.next_untold()
    }

    /// Takes the force of an answer that was lost and came with a later one into [`Port::recovered_force`], one with each call;
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
        let target = &self.path.target().disp;
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
        if self.is_fresh() {
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

    /// Raises the peak of the force, if it was measured. Real-time: yes.
    #[inline]
    pub(crate) fn note_peak(&mut self) {
        self.feedback.note_peak();
    }

    /// Raises the peak of the force before the test. Real-time: yes.
    pub(crate) fn note_force_at_startup(&mut self) {
        self.feedback.note_peak_at_startup();
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
    /// Whether a reply is owed for each command.
    #[inline]
    #[must_use]
    pub fn coupling(&self) -> Coupling {
        self.exchange.coupling()
    }

    /// True if replies come from outside this process, so that a late one is the peer's doing.
    #[inline]
    #[must_use]
    pub fn is_remote(&self) -> bool {
        self.exchange.is_remote()
    }

    /// True if a recording answers in place of the specimen.
    #[inline]
    #[must_use]
    pub(crate) const fn is_recorded(&self) -> bool {
        self.exchange.is_recording()
    }

    /// True if it is neither behind a link nor a recording.
    #[must_use]
    pub fn is_formula(&self) -> bool {
        !self.is_recorded() && !self.is_remote()
    }

    /// True if it is commanded once a step.
    #[inline]
    #[must_use]
    pub const fn is_per_step(&self) -> bool {
        self.path.is_per_step()
    }

    /// True if each of its commands has an answer that comes from outside this process and has to be waited for. A recording keeps
    /// the property. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) fn is_awaited(&self) -> bool {
        self.exchange.is_awaited()
    }

    /// True if its answer is here, or comes within `wait_ns` of wall time. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    #[inline]
    pub fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        self.exchange.is_answered(wait_ns)
    }

    /// True if a command has left whose answer was not taken. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn owes(&self) -> bool {
        self.exchange.state().owes()
    }

    /// True if its target is known and was not sent yet. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn has_pending_target(&self) -> bool {
        self.exchange.state().is_pending()
    }

    /// True if it owed an answer when the test ended: it gets no command until the tick after that has come. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn owes_the_last(&self) -> bool {
        self.exchange.state().owes_the_last()
    }

    /// A tick of the shutdown is over: an overdue answer that came in it is not waited for any more. Real-time: yes.
    pub(crate) const fn close_tick_of_shutdown(&mut self) {
        self.exchange.state_mut().close_tick_of_shutdown();
    }

    /// True if it may be commanded: it is not lost, and owes no answer of a test that is over. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn may_be_commanded(&self) -> bool {
        self.exchange.state().may_be_commanded()
    }

    /// True if it is not commanded any more. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn is_lost(&self) -> bool {
        self.exchange.state().is_lost()
    }

    /// True if it is lost because its link is gone: nothing is known of it. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn is_gone(&self) -> bool {
        self.exchange.state().is_gone()
    }

    /// It is not commanded any more; `gone`: because its link is. Real-time: yes.
    pub(crate) fn lose(&mut self, gone: bool) {
        self.exchange
            .state_mut()
            .lose(if gone { Loss::Gone } else { Loss::Distrusted });
    }

    /// The specimen is lost: its status shows that in every row from here on.
    pub(crate) const fn note_loss(&mut self) {
        self.feedback.note_loss();
    }

    /// True if a fresh measurement has come since the specimen was armed. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn has_answered(&self) -> bool {
        self.exchange.has_answered()
    }

    /// From here on it counts as one that has answered.
    pub(crate) const fn take_for_answered(&mut self) {
        self.exchange.take_for_answered();
    }

    /// When the loop first looked for the answer that is owed; none if it did not. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn asked_at(&self) -> Option<Nanos> {
        self.exchange.state().asked_at()
    }

    /// The same; the loop looks for the answer now, if it has not before. Real-time: yes.
    #[inline]
    pub(crate) fn look_for_answer(&mut self, now: Nanos) -> Nanos {
        self.exchange.state_mut().look_for_answer(now)
    }

    /// Its answer is not waited for any more: its status shows that until it comes. Real-time: yes.
    pub(crate) const fn leave_owing(&mut self) {
        self.feedback.leave_owing();
    }

    /// True while its answer is owed and not waited for.
    #[must_use]
    pub(crate) const fn is_left_owing(&self) -> bool {
        self.feedback.is_left_owing()
    }

    /// Stale measurements in a row. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn stale_in_a_row(&self) -> u64 {
        self.exchange.stale_in_a_row()
    }

    /// One more; how many there are. Real-time: yes.
    pub(crate) const fn count_stale(&mut self) -> u64 {
        self.exchange.count_stale()
    }

    /// The last measurement was fresh. Real-time: yes.
    #[inline]
    pub(crate) const fn forget_stale(&mut self) {
        self.exchange.forget_stale();
    }

    /// Answers in a row in which it reports a hold by its own watchdog. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn holding_in_a_row(&self) -> u64 {
        self.exchange.holding_in_a_row()
    }

    /// Sets their number. Real-time: yes.
    pub(crate) const fn set_holding_in_a_row(&mut self, answers: u64) {
        self.exchange.set_holding_in_a_row(answers);
    }

    /// One more measurement whose actuator–specimen iteration did not converge; how many there are. Real-time: yes.
    pub const fn count_unsettled(&mut self) -> u64 {
        self.exchange.count_unsettled()
    }

    /// How the loop waits for this specimen; none: by the limits of the test.
    #[must_use]
    pub const fn wait_rules(&self) -> Option<WaitRules> {
        self.exchange.wait()
    }

    /// How long the loop waits for this specimen in ns: by its own rules, or as long as for others. Real-time: yes.
    #[inline]
    pub(crate) fn patience_ns(&self, others: u64) -> u64 {
        self.wait_rules().map_or(others, |own| own.reply_timeout_ns)
    }

    /// Counts of this exchange, without those of the link itself. Real-time: yes.
    #[inline]
    #[must_use]
    pub const fn counts(&self) -> &LinkCount {
        self.exchange.count()
    }

    /// Everything that was counted.
    #[must_use]
    pub fn link_count(&self) -> LinkCount {
        self.exchange.full_count()
    }

    /// True if a command has left.
    #[must_use]
    pub const fn has_begun(&self) -> bool {
        self.exchange.has_begun()
    }

    /// A tick passes without a command. Real-time: yes.
    pub(crate) const fn skip_command(&mut self) {
        self.exchange.skip_command();
    }

    /// The last exchange was not part of the test: the test's numbers continue without it. Real-time: yes.
    pub(crate) const fn skip_number(&mut self) {
        self.exchange.skip_number();
    }

    /// The next command is not the command `sequence` of the test. The exchange of that number may have been made: then the specimen
    /// is where that command sent it.
    pub(crate) fn leave_number(&mut self, sequence: u64) {
        self.exchange.leave_number(sequence);
    }

    /// The operator holds the test. A partner that is commanded in every tick need not know.
    /// Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    pub fn pause(&mut self) -> Result<(), LinkFault> {
        if self.is_lost() || !self.is_per_step() {
            return Ok(());
        }
        self.exchange.pause()
    }

    /// Nothing to command: see [`gusset_quantity::substructure::Substructure::attend`]. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    pub fn attend(&mut self) -> Result<(), LinkFault> {
        self.exchange.attend()
    }
}

// Values for a row and a summary.
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

    /// Deformation that the structure asks for: B·x, in m; of an actuator the stroke for the pose B·x.
    #[inline]
    #[must_use]
    pub fn target(&self) -> &[f64] {
        &self.path.target().disp
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
    pub fn command(&self) -> &[f64] {
        &self.path.command().disp
    }

    /// The last command, in the specimen's unit.
    #[inline]
    #[must_use]
    pub fn sent(&self) -> &[f64] {
        self.path.sent()
    }

    /// The raw measurement of the last exchange, in the specimen's units.
    #[inline]
    #[must_use]
    pub const fn raw(&self) -> &Measurement {
        self.feedback.raw()
    }

    /// True if that answers the command of the exchange, and is not the newest known in place of an answer that stayed away.
    /// Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn is_fresh(&self) -> bool {
        self.feedback.is_fresh()
    }

    /// Measured displacement, brought back to the structure's metres.
    #[inline]
    #[must_use]
    pub fn measured(&self) -> &[f64] {
        self.feedback.disp()
    }

    /// Restoring force in N that enters equilibrium.
    #[inline]
    #[must_use]
    pub fn force(&self) -> &[f64] {
        self.feedback.force()
    }

    /// Force of an answer that was recovered last, N.
    #[inline]
    #[must_use]
    pub(crate) fn recovered_force(&self) -> &[f64] {
        self.feedback.recovered()
    }

    /// Largest |force| of the test so far, N.
    #[must_use]
    pub fn peak_force(&self) -> &[f64] {
        self.feedback.peak()
    }

    /// Largest |force| of every exchange before the test, N.
    #[must_use]
    pub(crate) fn force_at_startup(&self) -> &[f64] {
        self.feedback.peak_at_startup()
    }

    /// The limits, one entry per axis.
    #[must_use]
    pub fn limits(&self) -> &[limits::AxisLimits] {
        self.guard.declared()
    }

    /// Axis (from 0) and limit of each judged value that has a column: the limit has a level, and no other column has the value.
    pub(crate) fn recorded_limits(
        &self,
    ) -> impl Iterator<Item = (usize, gusset_quantity::catalog::limit::Limit)> {
        self.guard.recorded_limits()
    }

    /// The values of [`Port::recorded_limits`] that were judged in this tick, SI at the specimen; NaN where nothing was judged.
    /// Real-time: yes.
    #[inline]
    pub(crate) fn judged(&self) -> impl Iterator<Item = f64> {
        self.guard.judged()
    }

    /// Metres and newtons in one unit of each axis.
    #[must_use]
    pub fn units(&self) -> &[(f64, f64)] {
        self.guard.units()
    }

    /// Metres in one unit of an axis.
    #[must_use]
    pub fn metres_of(&self, axis: usize) -> f64 {
        self.guard.metres_of(axis)
    }

    /// Newtons in one unit of force of an axis.
    #[must_use]
    pub fn newtons_of(&self, axis: usize) -> f64 {
        self.guard.newtons_of(axis)
    }

    /// A force in N as the structure sees it, in the unit of the axis' load cell.
    #[must_use]
    pub fn in_own_unit(&self, axis: usize, newtons: f64) -> f64 {
        let gain = self.axes.get(axis).map_or(1.0, |axis| axis.force_gain);
        newtons / gain.abs()
    }

    /// Names of the compensators' parameters, axis by axis; the axis counts from 0.
    pub fn compensation_names(&self) -> impl Iterator<Item = (usize, Parameter)> {
        let compensators = self.path.compensators().into_iter();
        compensators.flat_map(|all| all.names())
    }

    /// The parameters of the moment, in the order of their names. Real-time: yes.
    #[inline]
    pub fn compensation_parameters(&self) -> impl Iterator<Item = f64> {
        let compensators = self.path.compensators().into_iter();
        compensators.flat_map(|all| all.parameters())
    }

    /// Tangent stiffness in N/m, tangent damping in N s/m (none where no damping is declared) and energy in J that the
    /// transfer system has added, per axis at the structure. Real-time: yes.
    #[inline]
    pub(crate) fn estimates(&self) -> impl Iterator<Item = (f64, Option<f64>, f64)> {
        self.estimates.values()
    }

    /// `others` J and the energy that the transfer system has added to each axis, one after the other. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) fn added_energy(&self, others: f64) -> f64 {
        self.estimates.added_energy(others)
    }

    /// Declared upper bounds of the tangent stiffness in N/m and of the tangent damping in N s/m, per axis at the structure;
    /// NaN without one.
    pub fn tangent_bounds(&self) -> impl Iterator<Item = (f64, f64)> {
        self.estimates.tangent_bounds()
    }

    /// Stability margin that tangents beyond their declared bounds use: 0 within the bounds; below 1 stable; exactly 1 is the limit
    /// of one axis alone. None if there is no proof to start from. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) fn stability_used(&self) -> Option<f64> {
        let used = self.stability_used_by_axis();
        let used = used.fold(-0.0, |sum, axis| sum + axis);
        used.is_finite().then_some(used)
    }

    /// What each axis has in [`Port::stability_used`]. Real-time: yes.
    pub(crate) fn stability_used_by_axis(&self) -> impl Iterator<Item = f64> {
        self.estimates.stability_used()
    }

    /// Whether [`Port::stability_used`] is known. Real-time: yes.
    #[must_use]
    pub(crate) fn knows_stability(&self) -> bool {
        self.estimates.knows_stability()
    }

    /// True if delay and gain are estimated: they have columns.
    #[must_use]
    pub const fn tracks(&self) -> bool {
        self.tracking.is_on()
    }

    /// Lag in s, gain, stiffness in N/m, and the damping in N s/m that the lag adds to it, per axis at the structure; NaN where
    /// nothing is known. Empty where nothing is estimated. Real-time: yes.
    #[inline]
    pub fn tracking(&self) -> impl Iterator<Item = [f64; 4]> {
        self.tracking.values()
    }

    /// True if [`Port::delay_margins`] are known as soon as the lag is. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) fn knows_margin(&self) -> bool {
        self.tracking.knows_margin()
    }

    /// Critical delay at the stiffness of the last seconds less their lag, s of test time, per axis: negative where the test is expected to
    /// grow, infinite where every delay is stable, not a number where nothing is known yet. Real-time: yes.
    pub(crate) fn delay_margins(&self) -> impl Iterator<Item = f64> {
        let lags = self.tracking.lags();
        lags.map(|(lag, critical)| critical - lag)
    }

    /// The largest share of its critical delay that an axis uses; not a number while nothing is known. Real-time: yes.
    #[must_use]
    pub(crate) fn delay_used(&self) -> f64 {
        // A number wins against none.
        self.delay_used_by_axis().fold(f64::NAN, f64::max)
    }

    /// The share of each axis. Real-time: yes.
    pub(crate) fn delay_used_by_axis(&self) -> impl Iterator<Item = f64> {
        let lags = self.tracking.lags();
        lags.map(|(lag, critical)| lag.max(0.0) / critical + 0.0 * lag)
    }

    /// The loading unit, if its axes are actuators of one.
    #[must_use]
    pub(crate) fn geometry(&self) -> Option<&Geometry> {
        self.loading_unit.as_deref().map(LoadingUnit::geometry)
    }

    /// Why the next command cannot be made. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn geometry_fault(&self) -> Option<Fault> {
        self.loading_unit.as_deref().and_then(LoadingUnit::fault)
    }

    /// Each coordinate: pose that the structure asks for, measured pose, force. Empty without a loading unit. Real-time: yes.
    #[inline]
    pub fn pose(&self) -> impl Iterator<Item = (Coordinate, [f64; 3])> {
        let unit = self.loading_unit.as_deref().into_iter();
        unit.flat_map(LoadingUnit::pose)
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
