//! A specimen behind its guard: everything that is judged of a received command and of its answer.

use super::announced_limits::AnnouncedLimits;
use super::client_scale::copy;
use super::first_command::{self, FirstCommand};
use super::guard_store::{GuardStore, LastingGuard};
use super::identity::Identity;
use super::latch::Latch;
use super::pacing::{Corrections, PaceClock, PacedPath, Pacing};
use super::recording::{Recording, Unrecorded};
use super::session_record::RowSink;
use super::speed_allowance::{Request, SpeedAllowance, Times};
use super::{Controller, TestEnd, Trip, USUAL_TICK_S, Wanted};
use gusset_control::engine::{
    Between, Operator, Phase, ReceivedCommand, ReceivedRow, ReceivedSettings, ReceivedTarget,
    ReceivedTest, Stop,
};
use gusset_control::port::{LoadingUnit, ReceivedPort, Stage};
use gusset_quantity::catalog::event::Remark;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::{AtAxis, AtClient, AtSpecimen, AtStructure};
use gusset_quantity::substructure::{Command, Introduction, LinkFault, Measurement, Status};
use gusset_quantity::time::Nanos;
use gusset_quantity::units::AxisUnits;
use gusset_record::Event;
use gusset_record::rt::os;

/// Whose motion a command is part of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Origin {
    /// A command of the controller's test.
    Controller,
    /// A command on the path to a target of the controller. It has `period_s` for its motion.
    Paced { period_s: f64 },
    /// A command on the predicted way from target to target, which the port has made already.
    Predicted {
        period_s: f64,
        stage: Stage,
        lands: bool,
    },
    /// A command on the ramp to the first target of the controller, which the port has made already.
    Ramp { period_s: f64, lands: bool },
    /// A command of ours before the test. It has `period_s` for its motion.
    Own { period_s: f64 },
}

impl Origin {
    /// Its state in the record.
    fn state(self) -> f64 {
        match self {
            Self::Controller | Self::Paced { .. } | Self::Predicted { lands: true, .. } => {
                Phase::Running.code()
            }
            Self::Predicted { stage, .. } => stage.code(),
            Self::Ramp { .. } => Phase::Ramping.code(),
            Self::Own { .. } => Phase::Probing.code(),
        }
    }

    /// Number in the record of a command that the specimen knows by `own`, during the path to the target `target` of the
    /// controller.
    const fn number(self, own: u64, target: u64) -> u64 {
        match self {
            Self::Controller | Self::Own { .. } => own,
            Self::Paced { .. } | Self::Predicted { .. } | Self::Ramp { .. } => target,
        }
    }

    /// Time in s for its motion, if that is known.
    const fn period_s(self) -> Option<f64> {
        match self {
            Self::Controller => None,
            Self::Paced { period_s }
            | Self::Predicted { period_s, .. }
            | Self::Ramp { period_s, .. }
            | Self::Own { period_s } => Some(period_s),
        }
    }

    /// True of a command of ours before the test.
    const fn is_own(self) -> bool {
        matches!(self, Self::Own { .. })
    }
}

/// The decisions of the wall clock about a command.
#[derive(Debug, Clone, Copy)]
pub(super) struct ByTheClock {
    /// The specimen has come to rest since the command before.
    pub rested: bool,
    /// The specimen has moved on since the last target.
    pub late: bool,
    /// The times that the command has for its motion.
    pub times: Option<Times>,
}

/// A specimen with its guard, and everything that is judged by it.
pub(super) struct GuardedSpecimen {
    pub identity: Identity,
    pub port: ReceivedPort,
    /// The engine's part of the controller's test.
    pub test: ReceivedTest,
    /// Longest wait for an answer in ns; 0 of a specimen without a link.
    pub reply_limit_ns: u64,
    pub allowance: SpeedAllowance,
    pub announced: Option<AnnouncedLimits>,
    pub first: FirstCommand,
    pub store: GuardStore,
    pub latch: Latch,
    pub recording: Recording,
    /// The last answer, as the controller counts. Each of its numbers is finite.
    pub answer: Measurement,
    tripped: Option<Trip>,
    commits: u64,
    /// What happened since the last command.
    pub between: Between,
    /// The recorded decisions of the wall clock about the next command, in a replay.
    pub foretold: Option<ByTheClock>,
    /// The clock of commands that are not paced.
    clock: PaceClock,
    /// The times that the last command has for its motion.
    times: Option<Times>,
    /// Corrections of the forces at targets on the move.
    pub corrections: Corrections,
    /// The path to the controller's targets, if they are paced.
    pub(super) path: Option<PacedPath>,
    /// The wall time of the server; the machine's own until the server gives it.
    now: Option<Nanos>,
}

// How a session begins.
impl GuardedSpecimen {
    /// A specimen without limits and without a record.
    pub(crate) fn new(identity: Identity, mut port: ReceivedPort) -> Self {
        let store = GuardStore::default();
        let clock = PaceClock::MACHINE;
        let sink = Unrecorded::sink(&store);
        let test = Self::test(&identity, &mut port, (None, clock, 0), sink);
        Self {
            test,
            answer: Measurement::zeros(identity.scale.units.len()),
            corrections: Corrections::new(identity.scale.units.len()),
            allowance: SpeedAllowance::new(identity.moves),
            identity,
            port,
            reply_limit_ns: 0,
            announced: None,
            first: FirstCommand::default(),
            store,
            latch: Latch::default(),
            recording: Recording::default(),
            tripped: None,
            commits: 0,
            between: Between::default(),
            foretold: None,
            clock,
            times: None,
            path: None,
            now: None,
        }
    }

    /// A test at this pace, whose answers take at most so long (ns). It has no record if its rows have no column.
    fn test(
        identity: &Identity,
        port: &mut ReceivedPort,
        (pacing, clock, reply_timeout_ns): (Option<Pacing>, PaceClock, u64),
        (width, recorder): RowSink,
    ) -> ReceivedTest {
        let scale = &identity.scale;
        let axes = 0..scale.axis_units().len();
        let settings = ReceivedSettings {
            signals: scale.units.len(),
            units: scale.axis_units().to_vec(),
            port_units: axes.map(|axis| *scale.port_units(axis)).collect(),
            period_ns: pacing.map_or((USUAL_TICK_S * 1e9) as u64, |pacing| pacing.period_ns),
            reply_timeout_ns,
            width,
        };
        let clock = pacing.map_or(clock, |pacing| pacing.clock);
        ReceivedTest::new(port, settings, Box::new(clock), recorder)
    }

    /// Begins a controller's test, and opens its record if there is to be one.
    ///
    /// # Errors
    /// The record cannot be kept: the test has none.
    pub(crate) fn open_record(&mut self, controller: &Controller) -> Result<(), String> {
        let pacing = self.pacing();
        let pace_hz = pacing.map(|pacing| pacing.period_s().recip());
        let specimen = (&self.identity, &self.port);
        let opened = self.recording.open(specimen, controller, pace_hz);
        let (sink, outcome) = match opened {
            Ok(sink) => (sink, Ok(())),
            Err(text) => (None, Err(text)),
        };
        let sink = sink.unwrap_or_else(|| Unrecorded::sink(&self.store));
        let pace = (pacing, self.clock, self.reply_limit_ns);
        self.test = Self::test(&self.identity, &mut self.port, pace, sink);
        if self.identity.corrects_at_most > 0.0 {
            self.test.corrects(self.identity.scale.units.len());
        }
        outcome
    }

    /// Each target of a controller becomes a path of commands.
    pub(crate) fn set_pacing(&mut self, pacing: Pacing) {
        let (signals, axes) = (self.identity.scale.units.len(), self.port.axes());
        self.port.path_mut().take_velocities_of_a_path();
        self.identity.corrects_at_most = pacing
            .predict
            .map_or(0.0, |predict| predict.correct_at_most);
        let mut path = PacedPath::new(pacing, signals, axes);
        path.fresh = self.port.freeze_compensation();
        self.path = Some(path);
    }

    /// Another clock than the machine's.
    pub(crate) const fn keep_time_by(&mut self, clock: PaceClock) {
        self.clock = clock;
        if let Some(path) = &mut self.path {
            path.pacing.clock = clock;
        }
    }

    /// How targets are paced.
    pub(crate) const fn pacing(&self) -> Option<Pacing> {
        match &self.path {
            Some(path) => Some(path.pacing),
            None => None,
        }
    }

    /// True after a hold on the path to a target, until the next one.
    pub(crate) const fn rests_on_the_way(&self) -> bool {
        match &self.path {
            Some(path) => path.is_on_the_way,
            None => false,
        }
    }

    pub(crate) const fn tripped(&self) -> Option<Trip> {
        self.tripped
    }

    pub(crate) const fn commits(&self) -> u64 {
        self.commits
    }

    /// A session begins with the guard of the specimen, or with a new one of a specimen that is new in each session.
    ///
    /// # Errors
    /// Another session has the guard.
    pub(crate) fn begin_session(&mut self, controller: &Controller) -> Result<(), TestEnd> {
        let new = || LastingGuard {
            guard: self.port.guard().forgetful(USUAL_TICK_S),
            allowance: SpeedAllowance::new(self.identity.moves),
        };
        let lent = if self.identity.is_lasting() {
            self.store.lend(new)
        } else {
            Some(new())
        };
        let lent = lent.ok_or_else(|| TestEnd::failed("another session has the specimen"))?;
        let taken = self.port.set_guard(lent.guard);
        taken.map_err(|error| TestEnd::failed(error.to_string()))?;
        self.allowance = lent.allowance;
        self.port.begin_session(USUAL_TICK_S);
        if let Some(path) = &self.path {
            // The place of a controller depends on the static gain of new compensators.
            self.port.restart_following(path.fresh.as_ref());
        }
        self.allowance.announced(controller.rate);
        (self.tripped, self.commits) = (None, 0);
        self.between = Between::default();
        self.announced = AnnouncedLimits::by(controller, &self.identity.scale.units);
        self.first.begins = None;
        self.answer = Measurement::zeros(self.identity.scale.units.len());
        self.corrections = Corrections::new(self.identity.scale.units.len());
        Ok(())
    }

    /// The session is over: the next one begins with this guard.
    pub(crate) fn end_session(&mut self) {
        if self.identity.is_lasting() {
            self.store.take_back(LastingGuard {
                guard: self.port.guard().clone(),
                allowance: self.allowance.clone(),
            });
        }
    }

    /// The place of the axes, in their units, for displacements of the controller.
    ///
    /// # Errors
    /// The actuators cannot have this pose.
    pub(crate) fn place_for(&self, disp: AtClient<&[f64]>) -> Result<AtAxis<Vec<f64>>, TestEnd> {
        let place = self.identity.scale.place_for(&self.port, disp);
        place.map_err(|fault| TestEnd::failed(format_args!("the test cannot begin there: {fault}")))
    }

    /// The controller announced that its first command will be at this place of the axes.
    pub(crate) fn begins_at(&mut self, sequence: u64, start: AtAxis<&[f64]>) {
        let moves = self.identity.moves;
        self.first.begins = moves.then(|| (sequence, AtAxis(start.to_vec())));
    }

    /// Gets the specimen ready for commands that lead away from `start`, a place of its axes.
    pub(crate) fn arm(
        &mut self,
        sequence: u64,
        start: AtAxis<&[f64]>,
        wanted: &mut Wanted<'_>,
    ) -> Result<(), TestEnd> {
        if !self.identity.is_lasting() {
            self.port.renew_guard(USUAL_TICK_S);
            self.allowance.forget();
        }
        self.port.begin_commands(sequence, start);
        self.allowance.begin(sequence);
        self.first.armed();
        if let Some(announced) = &mut self.announced {
            let scale = &self.identity.scale;
            if scale.is_of_axes() {
                announced.begin(self.port.guard().watch());
            } else if let Ok(disp) = scale.disp_at(&self.port, start) {
                announced.begin_at(in_metres(&scale.units, disp.part(Vec::as_slice)));
            }
        }
        if let Some(path) = &mut self.path {
            let disp = self.identity.scale.disp_at(&self.port, start);
            let disp = disp.map_err(|fault| TestEnd::failed(format_args!("not armed: {fault}")))?;
            path.rests_at(sequence, disp.part(Vec::as_slice), start);
            self.port.restart_following(path.fresh.as_ref());
        }
        let mut unwanted = None;
        let mut is_wanted = || wanted().map_err(|over| unwanted = Some(over)).is_ok();
        let asked = self.port.ask_to_arm(sequence);
        let outcome = asked.and_then(|()| self.port.arm(sequence, &mut is_wanted));
        if let Some(over) = unwanted {
            return Err(over);
        }
        outcome.map(|_| ()).map_err(|fault| {
            if fault != LinkFault::Refused {
                self.tripped = Some(Trip::Lost(fault));
            }
            let why = self.port.exchange().complaint().unwrap_or_default();
            let between = if why.is_empty() { "" } else { ": " };
            TestEnd::failed(format_args!("not armed: {fault}{between}{why}"))
        })
    }

    /// Commands may come from now on. Real-time: yes.
    pub(crate) fn starts(&mut self, now: Nanos) {
        self.now = Some(now);
        self.allowance.starts(now);
    }

    /// The present wall time, by a clock other than the machine's. Real-time: yes.
    pub(crate) const fn now_is(&mut self, now: Nanos) {
        self.now = Some(now);
    }
}

// One exchange.
impl GuardedSpecimen {
    /// One exchange: limits, specimen, limits, record. `elapsed` is the test time since the last commit. The command is in the
    /// controller's signals, an own command in deformations of the axes. `into` receives the last measurement (in the units of the axes
    /// for an own command), with the interlock flag after a trip. False if the answer is missing, and no longer `wanted`. Real-time:
    /// yes, as far as the link is.
    ///
    /// # Errors
    /// The specimen holds. The command was not passed on, or is the last one.
    pub(crate) fn exchange_as(
        &mut self,
        origin: Origin,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        if origin.is_own() {
            self.test.asks_nothing();
        } else {
            let motion = command.disp.iter().zip(command.vel);
            let motion = motion.map(|(disp, vel)| [*disp, *vel]);
            self.test.asks([command.time, elapsed], motion);
        }
        let is_paced = origin == Origin::Controller && self.tripped.is_none();
        let path = if is_paced { self.path.take() } else { None };
        let Some(mut path) = path else {
            return self.exchange_once(origin, command, elapsed, wanted, into);
        };
        self.recording.target_number = command.sequence;
        let outcome = self.follow(&mut path, command, elapsed, wanted, into);
        self.path = Some(path);
        into.sequence = command.sequence;
        outcome
    }

    /// One command and its answer.
    pub(crate) fn exchange_once(
        &mut self,
        origin: Origin,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        let exchange = self.test.exchanges();
        self.recording.begins(exchange, command.time);
        self.test.note_arrival();
        self.times = None;
        let mut is_answered = true;
        let is_aimed = self.tripped.is_none() && not_finite(command.disp, command.vel).is_none();
        if self.tripped.is_none() {
            match self.attempt(command, elapsed, origin, wanted) {
                Ok(answered) => {
                    is_answered = answered;
                    let lands = matches!(origin, Origin::Predicted { lands: true, .. });
                    if lands && self.identity.corrects_at_most > 0.0 {
                        self.correct(command.disp);
                    }
                }
                Err(trip) => self.trip(trip),
            }
        }
        into.sequence = command.sequence;
        into.time = self.answer.time;
        into.status = self.answer.status;
        if origin.is_own() {
            copy(self.port.feedback().raw(), into);
        } else {
            copy(&self.answer, into);
        }
        if self.tripped.is_some() {
            into.status.0 |= Status::INTERLOCK.0;
        }
        if !is_answered {
            into.status.0 |= Status::OWED.0;
        }
        if !is_aimed {
            self.seek_for_the_record(command);
        }
        let is_number = command.disp.iter().all(|disp| disp.is_finite());
        let row = ReceivedRow {
            time: command.time,
            elapsed,
            number: Some(origin.number(command.sequence, self.recording.target_number)),
            commits: self.commits,
            trip: self.tripped.map_or(0, Trip::code),
            is_lost: matches!(self.tripped, Some(Trip::Lost(_))),
            status: Some(into.status),
            between: std::mem::take(&mut self.between),
            allowed: self.times.map(|times| [times.own, times.announced]),
            target: match (is_number, is_aimed) {
                (false, _) => ReceivedTarget::NoNumber,
                (true, true) => ReceivedTarget::Aimed,
                (true, false) => ReceivedTarget::Sought,
            },
        };
        self.record(origin.state(), row);
        self.tripped.map_or(Ok(is_answered), Err)
    }

    /// Records the last exchange; a command that did not leave counts as tripped. Real-time: yes.
    fn record(&mut self, state: f64, row: ReceivedRow) {
        let state = if self.test.lacks_row() {
            state
        } else {
            Phase::Tripped.code()
        };
        self.test.record(&mut self.port, state, row);
    }

    /// A target that is not commanded is the goal of the port, if it is a number. Real-time: yes.
    fn seek_for_the_record(&mut self, command: &Command<'_>) {
        let scale = &self.identity.scale;
        if command.disp.iter().all(|disp| disp.is_finite()) {
            scale.seek(&mut self.port, AtClient(command.disp));
        }
    }

    /// False if the answer is missing, and no longer `wanted`.
    fn attempt(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        origin: Origin,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, Trip> {
        self.judge_command(command, elapsed, origin)?;
        let is_theirs = !origin.is_own();
        if is_theirs {
            self.first.passed();
        }
        let holds = self.port.exchange().count().holds;
        let judged = self.pass_on(command, elapsed, origin, wanted);
        let raw = self.port.feedback().raw();
        let not_finite = not_finite(&raw.disp, &raw.force);
        let judged = match judged {
            Err(Stop::Operator) => return Ok(false),
            Err(Stop::Link { fault, .. })
                if fault != LinkFault::NotFinite || not_finite.is_none() =>
            {
                // The link itself refused the answer, or it is too large to be converted.
                return Err(fault.into());
            }
            Err(stop @ Stop::Stale { .. }) => return Err(stop.into()),
            judged => judged.map_err(Trip::from),
        };
        (self.answer.time, self.answer.status) = (raw.time, raw.status);
        let posed = if self.is_converted() && (origin.is_own() || not_finite.is_some()) {
            Ok(None)
        } else {
            let scale = &self.identity.scale;
            scale.answer(&mut self.port, &mut self.answer)
        };
        // A signal that the controller counts may be too large where the number of the axis is not.
        let not_finite = not_finite.or(posed.unwrap_or_default());
        if not_finite.is_some() {
            // A sensor is at its end. Its reading before is the answer.
            self.answer.status.0 |= Status::SATURATED.0;
            let (axis, measured) = (not_finite, true);
            return Err(Trip::NotFinite { axis, measured });
        }
        self.judge_answer(is_theirs, judged)?;
        self.warn_of_holds(holds);
        // On a ramp only its end has an answer for the controller.
        let is_on_a_ramp = matches!(origin, Origin::Ramp { lands: false, .. });
        if let (Err(fault), false) = (posed, is_on_a_ramp) {
            return Err(Trip::Geometry(fault));
        }
        Ok(true)
    }

    /// Everything that is judged before a command leaves. Real-time: yes.
    fn judge_command(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        origin: Origin,
    ) -> Result<(), Trip> {
        if let Some(axis) = not_finite(command.disp, command.vel) {
            let (axis, measured) = (Some(axis), false);
            return Err(Trip::NotFinite { axis, measured });
        }
        self.aim(command, origin);
        if let Some(fault) = self.port.loading_unit().and_then(LoadingUnit::fault) {
            return Err(Trip::Geometry(fault));
        }
        let time = self.time_of(command, elapsed, origin);
        self.times = time;
        if let Some(time) = time {
            self.port.guard_mut().set_motion_time(time.own);
        }
        // The wiring check is not part of the controller's test.
        let is_theirs = origin == Origin::Controller;
        if is_theirs {
            self.first.judge(command, self.port.command(), &self.port)?;
            self.first.take_up_pace(command, elapsed, &mut self.port);
        }
        self.test.judge_command(&mut self.port, command.time)?;
        if let Some(announced) = self.announced.as_mut().filter(|_| is_theirs) {
            let disp = in_metres(&self.identity.scale.units, AtClient(command.disp));
            announced.command(time.map_or(USUAL_TICK_S, |time| time.announced), disp)?;
        }
        Ok(())
    }

    /// True if numbers of the controller are not those of the axes. Real-time: yes.
    const fn is_converted(&self) -> bool {
        !self.identity.scale.is_of_axes()
    }

    /// Makes the next command of the port. Real-time: yes.
    fn aim(&mut self, command: &Command<'_>, origin: Origin) {
        let Command { disp, vel, .. } = command;
        if matches!(origin, Origin::Ramp { .. } | Origin::Predicted { .. }) {
            return;
        }
        if origin.is_own() {
            let motion = disp.iter().zip(*vel);
            let motion = motion.map(|(disp, vel)| AtStructure((*disp, *vel)));
            self.port.aim_axes(motion);
            return;
        }
        let motion = [disp, vel].map(|of| AtClient(*of));
        self.identity.scale.aim(&mut self.port, motion);
    }

    /// Sends the command that was judged, and has its answer judged by the limits of the specimen.
    ///
    /// # Errors
    /// [`Stop::Operator`]: the answer is no longer `wanted`.
    fn pass_on(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        origin: Origin,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<(), Stop> {
        let command = ReceivedCommand {
            sequence: command.sequence,
            time: command.time,
            // The other end counts the time over commands that were lost by itself.
            dt: if self.port.exchange().is_remote() {
                command.dt
            } else {
                elapsed
            },
            is_paced: matches!(
                origin,
                Origin::Paced { .. } | Origin::Predicted { .. } | Origin::Ramp { .. }
            ),
        };
        let mut client = || (!wanted()).then_some(Operator::Stop);
        self.test.exchange(&mut self.port, command, &mut client)
    }

    /// Everything that is judged of an answer: `judged` by the limits of the specimen, which come first. Real-time: yes.
    fn judge_answer(&mut self, is_theirs: bool, judged: Result<(), Trip>) -> Result<(), Trip> {
        let mut announced = Ok(());
        if let Some(limits) = self.announced.as_mut().filter(|_| is_theirs) {
            let units = self.identity.scale.units.iter();
            let values = self.answer.disp.iter().zip(&self.answer.force).zip(units);
            announced = limits.measured(values.map(|((disp, force), unit)| {
                AtSpecimen((disp * unit.metres, force * unit.newtons))
            }));
        }
        judged?;
        announced?;
        // No word of a link.
        self.answer.status.0 &= !Status::HELD.0;
        Ok(())
    }

    /// The times that a command has for its motion, if anything is known of them. Our own small motions before the test keep to
    /// a pace of ours, and no controller decides their time. Real-time: yes.
    fn time_of(&mut self, command: &Command<'_>, elapsed: f64, origin: Origin) -> Option<Times> {
        if let Some(period_s) = origin.period_s() {
            return Some(Times::both(period_s));
        }
        if let Some(ByTheClock { rested, times, .. }) = self.foretold {
            if rested {
                self.rests_by_the_clock();
            }
            return times;
        }
        let now = self.now.unwrap_or_else(|| Nanos(os::monotonic_ns()));
        if self.allowance.has_rested(now) {
            self.rests_by_the_clock();
        }
        let request = Request {
            sequence: command.sequence,
            elapsed,
            stays: self.port.repeats(),
        };
        self.allowance.time_of(request, now)
    }

    /// No command came for so long that the specimen rests. Real-time: yes.
    fn rests_by_the_clock(&mut self) {
        self.between.add(Between::RESTED);
        self.has_come_to_rest();
    }

    /// The specimen has moved on since the last target: its path was not continued at once. Real-time: yes.
    pub(crate) fn is_behind(&mut self) -> bool {
        let is_behind = match self.foretold {
            Some(ByTheClock { late, .. }) => late,
            None => self.test.is_behind(),
        };
        if is_behind {
            self.between.add(Between::LATE);
        }
        is_behind
    }

    /// The test trips between two commands.
    pub(crate) fn trip_between(&mut self, trip: Trip) {
        self.between.add(Between::TRIPPED);
        self.trip(trip);
    }

    /// Latches the trip of a lasting specimen: no session begins before its operator has cleared it. A lost link is not latched.
    pub(crate) fn trip(&mut self, trip: Trip) {
        self.tripped = Some(trip);
        let text = self.whole(trip);
        if self.identity.is_lasting() && !matches!(trip, Trip::Lost(_)) {
            self.latch.set(&self.identity.name, trip.name(), &text);
        }
        self.recording.tripped(trip, &text);
    }

    /// A wiring check has ended by a trip, or at once: its last command is recorded, which may not have left.
    pub(crate) fn record_end_of_check(&mut self, trip: Option<Trip>) {
        let has_left = self.test.lacks_row();
        let exchange = self.test.exchanges();
        self.recording.begins(exchange, 0.0);
        let mut status = self.port.feedback().raw().status;
        status.0 &= !Status::HELD.0;
        match trip {
            Some(trip) => {
                self.trip(trip);
                status.0 |= Status::INTERLOCK.0;
                if matches!(trip, Trip::NotFinite { .. }) {
                    status.0 |= Status::SATURATED.0;
                }
            }
            None if has_left => status.0 |= Status::OWED.0,
            None => return,
        }
        if !has_left {
            self.test.note_arrival();
        }
        self.record(
            Phase::Probing.code(),
            ReceivedRow {
                number: (!has_left).then(|| self.port.exchange().count().sent),
                trip: trip.map_or(0, Trip::code),
                is_lost: matches!(trip, Some(Trip::Lost(_))),
                status: Some(status),
                ..ReceivedRow::default()
            },
        );
    }

    /// The last command is accepted. The next command shows a specimen that is lost meanwhile. Real-time: yes.
    pub(crate) fn commit(&mut self) {
        if self.tripped.is_some() {
            return;
        }
        self.commits += 1;
        if self.port.exchange().has_begun()
            && let Err(fault) = self.port.accepted(0)
        {
            self.trip_between(fault.into());
        }
    }

    /// The specimen rests, and the next command comes from rest.
    pub(crate) fn has_come_to_rest(&mut self) {
        self.port.has_come_to_rest();
        if let Some(announced) = &mut self.announced {
            announced.rests();
        }
    }
}

// Words and notes.
impl GuardedSpecimen {
    /// A trip with the details of its link.
    pub(crate) fn whole(&self, trip: Trip) -> String {
        let mut text = trip.to_string();
        match trip {
            Trip::Lost(_) => {
                if let Some(complaint) = self.port.exchange().complaint() {
                    text.push_str(&format!(" ({complaint})"));
                }
            }
            Trip::Limit(hit) if hit.quantity.is_of_motion() => {
                if let Some(stands) = &self.first.stands {
                    text.push_str(&format!(
                        ": the specimen is at {}, and the first command leads away from there",
                        self.identity.in_words(stands)
                    ));
                }
                let leaves = self.first.leaves.as_ref();
                if let Some(why) =
                    leaves.and_then(|_| first_command::why(self.port.guard().declared(), &hit))
                {
                    text.push_str(&format!(" ({why})"));
                }
                let is_timed = hit.quantity != Limit::CommandStep;
                if let Some(cut) = self.allowance.says_cut().filter(|_| is_timed) {
                    text.push_str(&format!(" ({cut})"));
                }
            }
            _ => {}
        }
        text
    }

    /// Warns of a hold by the specimen's own watchdog, if there were `before` of them before.
    pub(crate) fn warn_of_holds(&mut self, before: u64) {
        if self.port.exchange().count().holds > before {
            let text = "the specimen says that it holds by its own watchdog, since commands had stopped: what it answers meanwhile \
                        does not belong to the commands";
            self.warn(Remark::SpecimenHolds, text);
        }
    }

    /// A warning about the controller or the specimen: for the program's log, and once for the events and the summary of the
    /// run folder.
    pub(crate) fn warn(&mut self, event: Remark, text: &str) {
        self.recording.warn_once(&self.store, event, text);
    }

    /// The specimen's end repeats commands instead of measuring: no report may call them measurements.
    pub(crate) fn measures_no_disp(&self, introduction: &Introduction) {
        self.recording.event(Event::Connected {
            port: 0,
            peer: introduction.peer.clone(),
            measures_disp: Some(false),
            standing: None,
        });
    }

    /// Something for the record.
    pub(crate) fn note(&self, event: Remark, text: &str) {
        self.recording.note(&self.store, event, text);
    }
}

/// Displacements of the controller in m. Real-time: yes.
pub(super) fn in_metres<'a>(
    units: &'a [AxisUnits],
    disp: AtClient<&'a [f64]>,
) -> impl Iterator<Item = AtSpecimen<f64>> + Clone + 'a {
    disp.0
        .iter()
        .zip(units)
        .map(|(disp, unit)| AtSpecimen(disp * unit.metres))
}

/// The first axis (from 0) with a number that is not finite. Real-time: yes.
pub(super) fn not_finite(one: &[f64], other: &[f64]) -> Option<usize> {
    let mut pairs = one.iter().zip(other);
    pairs.position(|(one, other)| !(one.is_finite() && other.is_finite()))
}
