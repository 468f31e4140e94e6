//! A port before and after the test: how it is put together, connected, zeroed, resumed and left.
//!
//! Everything here happens beside the running test, or once in it. The operations of a tick are in [`super`].

use super::compensators::Compensators;
use super::probe::SIGMAS;
use super::retrace::Tick;
use super::*;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtSpecimen;
use gusset_quantity::state::TestState;

// Construction.
impl Port {
    /// Puts a recording in place of the substructure that was there: it knows the test's numbers only.
    ///
    /// # Errors
    /// It has another number of axes.
    pub fn put_recording(&mut self, substructure: Box<dyn Substructure>) -> Result<(), PortError> {
        error::fits(
            "axes of the recording",
            substructure.axes(),
            self.axes.len(),
        )?;
        self.exchange.put_recording(substructure);
        Ok(())
    }

    /// Takes the live substructure of `fresh`, a port of the same test that was never used, in place of a recording; a formula
    /// stays with its state. The counts restart, and the limits are those of `fresh`.
    pub fn go_live(&mut self, fresh: Port) {
        if self.exchange.go_live(fresh.exchange) {
            self.startup.forget_stated();
        }
        self.guard.trust_force();
        self.guard.take_limits(&fresh.guard);
        self.path.resume_from_here();
    }

    /// The trip of the next command, if its displacement is beyond a limit.
    pub fn next_command_beyond(&self) -> Option<limits::Hit> {
        let mut guard = self.guard.clone();
        let found = guard.judge_command(self.path.command()).trip;
        found.filter(|hit| hit.quantity == Limit::CommandDisp)
    }

    /// From here on the guard has these limits, and metres and newtons in one unit of each axis; the axis counts from 0. Ticks take
    /// `tick` s.
    pub fn set_limits(
        &mut self,
        tick: f64,
        of: impl Fn(usize) -> (limits::AxisLimits, (f64, f64)),
    ) {
        let (limits, units) = (0..self.axes()).map(of).unzip();
        self.guard = Guard::new(limits, units, tick);
    }

    /// A port with an observer round its substructure: `wrap` takes that, and the metres and newtons in one unit of each axis.
    #[must_use]
    pub fn watched(
        mut self,
        wrap: impl FnOnce(Box<dyn Substructure>, &[(f64, f64)]) -> Box<dyn Substructure>,
    ) -> Self {
        let units = self.guard.units();
        self.exchange = self.exchange.wrapped(|inner| wrap(inner, units));
        self
    }
}

// Connection, position and wiring.
impl Port {
    pub(super) fn expected(&self) -> Expectation<'_> {
        Expectation {
            name: &self.name,
            axes: &self.axes,
            stiffness: self.stiffness.own(),
            startup: &self.startup,
            wait: self.exchange.wait(),
            is_remote: self.exchange.is_remote(),
            is_resumed: self.path.is_resumed(),
        }
    }

    /// Connects the substructure and compares its own estimate of its stiffness with k̂: more than 10 % apart is a
    /// warning, another sign is refused. Nothing moves.
    ///
    /// # Errors
    /// The specimen cannot take part.
    pub fn connect(&mut self) -> Result<Introduction, Unavailable> {
        let mut introduction = self.exchange.connect()?;
        let warnings = self.meet(&introduction, |_| 1.0)?;
        introduction.warnings.extend(warnings);
        Ok(introduction)
    }

    /// Compares the introduction of a specimen that is connected, as [`Port::connect`] does, and returns the warnings. `units`: N/m
    /// in the unit of stiffness of an axis.
    ///
    /// # Errors
    /// The specimen cannot take part.
    pub fn meet(
        &mut self,
        found: &Introduction,
        units: impl Fn(usize) -> f64,
    ) -> Result<Vec<String>, Unavailable> {
        self.startup.learn_position(AtAxis(&found.standing));
        let expected = self.expected();
        let mut warnings = expected.warnings(found);
        warnings.extend(expected.compare_stiffness(&found.stiffness, units)?);
        Ok(warnings)
    }

    /// What of the test file needs a measured displacement, where the end of the link does not say that it measures one: why the
    /// test cannot begin.
    #[must_use]
    pub fn lacks_measured_disp(&self, introduction: &Introduction) -> Option<String> {
        self.expected().lacks_measured_disp(introduction)
    }

    /// The reported position is where the next command is, and what that is held against. Once a command has left the specimen
    /// stands where that sent it, whatever it reported before. Does nothing if it does not report one.
    pub(crate) fn take_reported_position(&mut self) {
        let has_begun = self.exchange.has_begun();
        let Some(standing) = self.startup.standing() else {
            return;
        };
        if !has_begun {
            self.path.stands_at(standing);
            self.guard.stands_at(standing);
        }
        self.stand_still();
    }

    /// Where the specimen stands, in its own unit, one value per axis: it was moved there by others than this port.
    pub fn stands_at(&mut self, disp: AtAxis<&[f64]>) {
        self.path.stands_at(disp);
    }

    /// Asks what [`Port::arm`] waits for, and does not wait.
    ///
    /// # Errors
    /// The specimen is gone.
    pub fn ask_to_arm(&mut self, sequence: u64) -> Result<(), LinkFault> {
        self.exchange
            .ask_to_arm(sequence, self.path.command().part(AxisMotion::disp))
    }

    /// The last agreement before commands move the specimen; command `sequence` is the next. False if the user does not want it any
    /// more (`wanted`).
    ///
    /// # Errors
    /// The specimen is not ready, stands elsewhere, or is gone.
    pub fn arm(
        &mut self,
        sequence: u64,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        let command = self.path.command().part(AxisMotion::disp);
        self.exchange.arm(sequence, command, wanted)
    }

    /// The small motion that checks the wiring of this specimen, if there is to be one: from where it reports that it stands, else
    /// from its target.
    #[must_use]
    pub(crate) fn probe(&self) -> Option<Probe> {
        let reported = self.startup.standing().map(|standing| {
            let axes = standing.each().zip(&self.axes);
            let deformed = axes.map(|(disp, axis)| axis.deformation(disp).0);
            AtStructure(deformed.collect::<Vec<f64>>())
        });
        let start = reported
            .as_ref()
            .map(|reported| reported.part(Vec::as_slice));
        let start = start.unwrap_or_else(|| self.target());
        self.startup.wiring().probe(start)
    }

    /// Makes the next command of a probe, `share` of an exchange after the last; false at its end. Real-time: yes.
    pub(crate) fn aim_probe(&mut self, probe: &mut Probe, share: f64) -> bool {
        let AtStructure(target) = self.path.target_mut();
        let goes_on = probe.go_on(share, &mut target.disp, &mut target.vel);
        self.path.follow_target(&self.axes);
        goes_on
    }

    /// Gives a probe what was measured, unless it is old. Real-time: yes.
    pub(crate) fn take_probe(&self, probe: &mut Probe) {
        if self.feedback.is_fresh() {
            probe.take(&self.feedback.disp(), &self.feedback.force());
        } else {
            probe.give_again();
        }
    }

    /// Turns a probe that was interrupted back to its start, after the last command that left; false if there is nothing to undo.
    /// Real-time: yes.
    pub(crate) fn turn_back(&self, probe: &mut Probe) -> bool {
        let period_s = probe.period_ns() as f64 * 1e-9;
        let sent = |index: usize| {
            let axis = self.axes.get(index).zip(self.path.sent().get(index));
            axis.map_or(f64::NAN, |(axis, sent)| axis.deformation(AtAxis(*sent)).0)
        };
        let brake = |index: usize| {
            let gain = self.axes.get(index).map_or(1.0, |axis| axis.disp_gain);
            let metres = (self.guard.metres_of(index) * gain).abs();
            self.guard.brake_accel(index) * period_s * period_s / metres
        };
        probe.turn_back(sent, brake)
    }

    /// Accepts the exchange of a probe, unless a computation answers. Over OpenFresco's protocols a specimen that received no step
    /// would take the return of a probe for a revoked step.
    ///
    /// # Errors
    /// The link is lost.
    pub(crate) fn accept_probe(&mut self, sequence: u64) -> Result<(), LinkFault> {
        if self.exchange.is_remote() && !self.startup.is_computed() {
            return self.exchange.accepted(sequence, false);
        }
        Ok(())
    }

    /// A reading at rest, before the static load comes on; none if it is an old one. Real-time: yes.
    pub(crate) fn read_before_static_load(&mut self) {
        if self.feedback.is_fresh() {
            let reading = at_rest(&self.path, &self.feedback);
            self.startup.wiring_mut().rest(reading);
        }
    }

    /// A reading at rest, while the static load comes on. Real-time: yes.
    ///
    /// # Errors
    /// A channel is reversed.
    pub(crate) fn check_by_static_load(&mut self) -> Result<(), WiringFault> {
        let reading = at_rest(&self.path, &self.feedback);
        self.startup.wiring_mut().moved(reading)
    }

    /// The specimen rests where it was sent, or as near as it comes. Returns the first axis (from 0) that does not follow; ways
    /// shorter than `least`, in the structure's units, are not judged. Real-time: yes.
    pub(crate) fn check_motion(&self, check: &mut MotionCheck, least: f64) -> Option<usize> {
        let reading = at_rest(&self.path, &self.feedback);
        check.rests(reading, self.stiffness.own(), least)
    }

    /// Displacement and force are those that were read at rest, where they are known better than by one answer; false where they
    /// are not. Real-time: yes.
    pub(crate) fn take_rest(&mut self, rest: &Rest) -> bool {
        self.feedback.take_rest(rest, &self.axes)
    }
}

/// Target, displacement and force of a specimen at rest.
fn at_rest<'a>(path: &'a CommandPath, feedback: &'a Feedback) -> [AtStructure<&'a [f64]>; 3] {
    let target = path.target().part(AxisMotion::disp);
    [target, feedback.disp(), feedback.force()]
}

// Zero, initial force, and the estimates that begin there.
impl Port {
    /// Keeps the measurement last taken for the zero, unless it is an old one.
    pub(crate) fn take_reading(&mut self) {
        if self.feedback.is_fresh() {
            self.startup.take_reading(self.feedback.raw());
        }
    }

    /// Takes the zero of every relative channel from the readings. The estimates restart with the noise that was read.
    pub(crate) fn take_zero(&mut self) {
        self.startup.take_zero(&mut self.axes, self.path.sent());
        self.estimates.rest(false);
        let axes = self.axes.iter().enumerate();
        let noise = axes.map(|(index, axis)| {
            let reading = self.startup.reading(index);
            let disp = (reading.disp_noise / axis.disp_gain).abs();
            (disp, (reading.force_noise * axis.force_gain).abs())
        });
        self.estimates.begin(noise);
        let axes = self.axes.iter().enumerate();
        let noise = axes.map(|(index, axis)| {
            let reading = self.startup.reading(index);
            let disp = (reading.disp_noise / axis.disp_gain).abs();
            (disp, reading.noise().is_some())
        });
        self.tracking.read_noise(noise);
    }

    /// An axis reads what it reads now where it read `disp` before an interruption: a relative channel takes the difference
    /// for drift of its zero.
    pub(crate) fn take_disp_drift(&mut self, index: usize, disp: f64) {
        if let Some(axis) = self.axes.get_mut(index) {
            self.startup.take_disp_drift(index, disp, axis);
        }
    }

    /// A relative load cell takes its difference from `force` for drift.
    pub(crate) fn take_force_drift(&mut self, index: usize, force: f64) {
        if let Some(axis) = self.axes.get_mut(index) {
            self.startup.take_force_drift(index, force, axis);
        }
    }

    /// Force of an axis that its displacement does not explain by the initial stiffness, and how far off that is where the stiffness is
    /// known to a `share` and the other axes are coupled with it. `measured`: displacement and force of each axis; all is in the
    /// specimen's own units.
    #[must_use]
    pub(crate) fn unexplained_force(
        &self,
        axis: usize,
        measured: AtAxis<&[[f64; 2]]>,
        share: f64,
    ) -> AtAxis<(f64, f64)> {
        self.stiffness
            .unexplained_force(axis, &self.axes, measured, share)
    }

    /// Initial stiffness of an axis at the specimen's own scale, N/m.
    #[must_use]
    pub(crate) fn stiffness_at_specimen(&self, axis: usize) -> AtSpecimen<f64> {
        let AtAxis(own) = self.elastic_force_of(axis, AtAxis(1.0));
        AtSpecimen((own * self.guard.newtons_of(axis) / self.guard.metres_of(axis)).abs())
    }

    /// Change of the force of an axis whose displacement changes by `way`, by its initial stiffness; both in the specimen's own units.
    #[must_use]
    pub(crate) fn elastic_force_of(&self, axis: usize, way: AtAxis<f64>) -> AtAxis<f64> {
        let known = self.axes.get(axis);
        known.map_or(AtAxis(0.0), |known| {
            self.stiffness.elastic_force(axis, known, way)
        })
    }

    /// The most that the force of an axis can change where the axes are displaced by `ways`, both in the specimen's own units and
    /// by its initial stiffness: |kᵢⱼ| is at most √(kᵢᵢ kⱼⱼ).
    #[must_use]
    pub(crate) fn most_force_of(&self, axis: usize, ways: AtAxis<&[f64]>) -> AtAxis<f64> {
        self.stiffness.most_force(axis, &self.axes, ways)
    }

    /// Nothing is estimated from here on: the specimen is at rest, and its measurements are in no row.
    pub(crate) const fn pause_estimates(&mut self) {
        self.estimates.rest(true);
    }

    /// Estimates continue.
    pub(crate) const fn resume_estimates(&mut self) {
        self.estimates.rest(false);
    }

    /// The estimates restart with the declared values: a wiring check is not part of the test.
    pub(crate) fn forget_trial(&mut self) {
        self.estimates.restart(self.stiffness.own());
    }
}

// Begin, interruption and end of the test.
impl Port {
    /// The test begins or is resumed: energy counts from the next measurement on. Measurements before it are forgotten, since a
    /// replay has only those of the rows.
    pub(crate) fn begin_test(&mut self) {
        self.guard.forget_measurements();
        self.estimates.begin_test();
    }

    /// The test is interrupted: no measurement is compared with those of the test, and no energy counts until it is resumed.
    pub(crate) fn leave_test(&mut self) {
        self.guard.forget_measurements();
        self.estimates.leave_test();
    }

    /// The test runs: from the next target on commands are compensated, and it is seen how they are followed.
    pub const fn begin_compensation(&mut self) {
        self.tracking.test_runs(true);
        if let Some(compensators) = self.path.compensators_mut() {
            compensators.begin();
        }
    }

    /// The motion from here on is not part of the test: nothing is estimated of how it is followed.
    pub(crate) const fn pause_following(&mut self) {
        self.tracking.test_runs(false);
    }

    /// The test is resumed: see [`Port::pause_following`].
    pub(crate) const fn go_on_following(&mut self) {
        self.tracking.test_runs(true);
    }

    /// From here on the state before each command is kept, too: the last one never leaves, and is made again.
    pub(crate) fn follow_compensation(&mut self) {
        if let Some(compensators) = self.path.compensators_mut() {
            compensators.follow_record();
        }
    }

    /// The compensators' states, for a test that is resumed later: before the next command, where the record
    /// was retraced.
    #[must_use]
    pub(crate) fn freeze_compensation(&mut self) -> Option<TestState> {
        self.path.compensators_mut().and_then(Compensators::freeze)
    }

    /// Takes them back.
    pub(crate) fn thaw_compensation(&mut self, state: &TestState) {
        if let Some(compensators) = self.path.compensators_mut() {
            compensators.thaw(state);
        }
    }

    /// The specimen is at rest since the test was interrupted: the next command is judged by that.
    pub(crate) fn has_come_to_rest(&mut self) {
        self.guard.rests();
    }

    /// A partner that is commanded once a step gets an unanswered target once more.
    pub(crate) fn ask_again(&mut self) {
        let per_step = self.path.is_per_step();
        let was_told = self.exchange.state_mut().ask_again(per_step);
        if per_step {
            self.guard.interrupt(was_told);
        }
        // Only now: the guard keeps the commands of the test.
        if self.path.was_led_away() {
            self.guard.stands_at(self.path.sent());
        }
    }

    /// Makes the last command of the interrupted test again, at rest.
    pub(crate) fn return_to_the_test(&mut self) {
        self.path.return_to_the_test();
    }

    /// The test is resumed: a pending target is the next command again, and is judged by the commands of the test. All other ports
    /// make their next command of the path.
    pub(crate) fn take_up_target(&mut self) {
        self.guard.go_on();
        if self.exchange.state().is_pending() {
            self.path.take_goal(&self.axes);
        }
    }

    /// The answer to the target belongs to no command, because the specimen was held on its way: the target leaves once more. Real-time:
    /// yes.
    pub(crate) fn take_back_target(&mut self) {
        self.exchange.state_mut().pend();
        self.guard.watch_mut().takes_back_the_last();
        self.path.take_goal(&self.axes);
    }

    /// The test is over, and nothing is estimated from here on. A partner that owes an answer gets no command before that has come.
    /// `tick`: the operator ended it, and the specimen is to brake in ticks of these seconds of wall time. If it need not, the last
    /// command counts as one at rest.
    pub(crate) fn end_test(&mut self, tick: Option<f64>, tripped: bool) -> Option<Brake> {
        self.exchange.state_mut().end_test();
        self.pause_estimates();
        self.pause_following();
        let tick =
            tick.filter(|_| self.exchange.state().may_be_commanded() && !self.path.is_per_step());
        let brake = tick.and_then(|tick| self.guard.brake(tick));
        if brake.is_none() {
            self.guard.rests();
        } else if tripped {
            self.guard.lets_brake();
        }
        brake
    }

    /// Makes the next command of a brake; false when the specimen rests.
    pub(crate) fn brake(&mut self, brake: &mut Brake) -> bool {
        let goes_on = brake.go_on();
        if goes_on {
            let steps = self.guard.last_steps().each();
            let share = brake.share();
            self.path
                .coast(steps.map(|step| AtAxis(share * step.0)), brake.tick_s());
        }
        goes_on
    }

    /// The specimen is moved back from what it tripped at.
    pub(crate) fn excuse(&mut self) {
        self.guard.excuse(&self.startup);
    }

    /// True if what its return move goes by is known: no force that its load cell cannot read.
    #[must_use]
    pub(crate) fn can_be_led(&self, tripped: bool) -> bool {
        !(self.guard.force_is_unknown() && *self.exits.after(tripped) == Exit::ZeroForce)
    }

    /// Begins the return move with ticks of `tick` seconds of wall time; none where the specimen is to stay.
    pub(crate) fn begin_return_move(&mut self, tripped: bool, tick: f64) -> Option<ReturnMove> {
        let speed = self.exits.speed;
        self.leave_pose();
        let goal = match self.exits.after(tripped) {
            Exit::Freeze => return None,
            Exit::ZeroForce => {
                let from = ReturnStart {
                    observed: Observation {
                        axes: &self.axes,
                        path: &self.path,
                        feedback: &self.feedback,
                        stiffness: &self.stiffness,
                    },
                    guard: &self.guard,
                    startup: &self.startup,
                    unit: self.loading_unit.as_deref(),
                };
                return Some(ReturnMove::unload(&from, speed, tick));
            }
            Exit::ZeroDisp => AtAxis(self.axes.iter().map(|axis| axis.disp_offset).collect()),
            Exit::Safe(disp) => disp.clone(),
        };
        self.path.command_place(goal.part(Vec::as_slice));
        self.begin_ramp();
        let ends = self.path.sent().iter().zip(*self.command()).enumerate();
        let times = ends.map(|(axis, (from, to))| {
            let distance = (to - from).abs().max(self.steepest(axis).0);
            let distance = AtSpecimen(distance * self.guard.metres_of(axis));
            self.guard.cosine_time(axis, distance, speed)
        });
        let seconds = times.fold(0.0, f64::max);
        Some(ReturnMove::ramp(seconds, tick))
    }

    /// The motion that begins here is retraced when it is interrupted.
    pub(crate) fn begin_retraceable(&mut self) {
        let axes = 0..self.axes.len();
        let noise = axes.map(|axis| SIGMAS * self.startup.reading(axis).force_noise);
        self.retrace = Some(Retrace::new(self.path.sent(), noise.collect()));
    }

    /// A command of a motion that can be retraced has left, and was answered. Real-time: yes.
    pub(crate) fn pass(&mut self) {
        if let Some(retrace) = &mut self.retrace {
            let fresh = self.feedback.is_fresh().then(|| self.feedback.raw());
            retrace.pass(self.path.sent(), fresh);
        }
    }

    /// True if there is a motion to retrace, and the specimen is not at its start.
    #[must_use]
    pub(crate) fn can_retrace(&self) -> bool {
        let retrace = self.retrace.as_ref();
        retrace.is_some_and(|retrace| retrace.start() != self.path.sent())
    }

    /// Begins to retrace the motion, with ticks of `tick` seconds of wall time; none where there is nothing to retrace.
    pub(crate) fn begin_retrace(&mut self, tick: f64) -> Option<ReturnMove> {
        self.leave_pose();
        let retrace = self.retrace.as_mut()?;
        retrace.turn_back(tick);
        self.path.command_place(retrace.start());
        self.path.begin_ramp(&self.axes, None);
        let retrace = self.retrace.as_ref()?;
        let ends = self.path.sent().iter().zip(*retrace.start()).enumerate();
        let times = ends.filter(|(_, (from, to))| from != to);
        let times = times.map(|(axis, (from, to))| {
            let metres = self.guard.metres_of(axis);
            let speed = retrace.step(axis) * metres / self.guard.command_time(tick);
            self.guard
                .cosine_time(axis, AtSpecimen((to - from).abs() * metres), speed)
        });
        let seconds = times.fold(0.0, f64::max);
        Some(ReturnMove::ramp(seconds, tick))
    }

    /// How the return of a motion ended; none if it was not retraced.
    #[must_use]
    pub(crate) fn way_back(&self) -> Option<WayBack> {
        self.retrace.as_ref().and_then(Retrace::ended)
    }

    /// Makes the next command of the return move; false when there is no further to go.
    pub(crate) fn go_on(&mut self, way: &mut ReturnMove) -> bool {
        if let Some(retrace) = self.retrace.as_mut().filter(|retrace| retrace.goes_back()) {
            let fresh = self.feedback.is_fresh().then(|| self.feedback.raw());
            let tick = retrace.go_on(fresh);
            if tick != Tick::Goes {
                self.path.stand_still();
                return tick == Tick::Rests;
            }
            let goes_on = way.go_on(&self.axes, &mut self.path, &self.feedback, None);
            if !goes_on {
                retrace.arrive();
            }
            return goes_on;
        }
        let unit = self.loading_unit.as_deref_mut();
        way.go_on(&self.axes, &mut self.path, &self.feedback, unit)
    }

    /// Who holds the specimen after the goodbye, when it is known whether it was armed.
    #[must_use]
    pub(crate) fn left_to(&self) -> Holder {
        match self.exchange.holder() {
            Holder::ItsWatchdog if self.exchange.needs_no_acknowledgement() => Holder::NeverArmed,
            holder => holder,
        }
    }
}
