//! A specimen as a server commands it: a port whose commands are received.

use std::collections::BTreeSet;

use super::announced_limits::AnnouncedLimits;
use super::exchange_columns::Exchange;
use super::first_command::{self, FirstCommand};
use super::guard_store::{GuardStore, LastingGuard};
use super::latch::Latch;
use super::link_maker::{LinkMaker, Unconnected};
use super::readiness::Readiness;
use super::recording::Recording;
use super::session_record::RecordSettings;
use super::speed_allowance::{Request, SpeedAllowance, Times};
use super::{Controller, TestEnd, Trip, USUAL_TICK_S, Wanted, with_last_words};
use crate::catalog::ending::{Cause, Status as Ended};
use crate::catalog::event::Remark;
use crate::catalog::limit::Limit;
use crate::config::LimitsSpec;
use crate::port::limits::{AxisLimits, Found, Level};
use crate::port::{Guard, Port, WiringCheck};
use crate::rt::os;
use crate::substructure::{
    Command, Freshness, LISTEN_NS, LinkFault, LinkStats, Measurement, Status, Substructure,
};
use crate::time::Nanos;
use crate::units::{AxisUnits, position};

/// Whose motion a command is part of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Origin {
    /// A command of the controller's test.
    Controller,
    /// A command of ours before the test. It has `period_s` for its motion.
    Own { period_s: f64 },
}

impl Origin {
    /// Its value in the column `state`.
    const fn state(self) -> f64 {
        match self {
            Self::Controller => Exchange::RUNNING,
            Self::Own { .. } => Exchange::PROBING,
        }
    }
}

/// Answers in a row in which a specimen may say that it holds: as many as a controller's loop puts up with at least.
const HOLDING_IN_A_ROW: u64 = 10;

/// What never changes of a served specimen.
#[derive(Debug)]
pub(super) struct Identity {
    pub name: String,
    pub units: Vec<AxisUnits>,
    /// n × n by columns, in `units`.
    pub stiffness: Vec<f64>,
    pub mass: Vec<f64>,
    /// Keys of its limits that need a measured displacement.
    pub needs_measured_disp: Vec<&'static str>,
    /// It moves: its speed is judged by the wall clock.
    pub moves: bool,
    /// It is computed and keeps its state between sessions.
    pub remembers: bool,
}

impl Identity {
    /// True if a session finds the specimen as the last one left it: the history of its limits and its trip stay, too.
    const fn is_lasting(&self) -> bool {
        self.moves || self.remembers
    }

    /// A place, axis after axis.
    pub fn in_words(&self, place: &[f64]) -> String {
        let axes = place.iter().zip(&self.units);
        let words: Vec<_> = axes
            .map(|(disp, units)| position(*disp, units.disp))
            .collect();
        words.join(", ")
    }
}

/// How far a controller's test has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Stage {
    /// There is no test.
    #[default]
    Closed,
    /// A test is open, and the specimen has not heard its last word.
    Open,
    /// The specimen has heard the last word of the test, or was not connected yet.
    Dismissed,
}

/// A specimen as a server commands it. Ends its test when it is dropped.
pub struct ServedSpecimen {
    pub(super) identity: Identity,
    pub(super) port: Port,
    /// Of a gateway.
    pub(super) links: Option<LinkMaker>,
    allowance: SpeedAllowance,
    announced: Option<AnnouncedLimits>,
    pub(super) first: FirstCommand,
    store: GuardStore,
    latch: Latch,
    pub(super) recording: Recording,
    stage: Stage,
    /// The last answer. Each of its numbers is finite.
    pub(super) answer: Measurement,
    tripped: Option<Trip>,
    commits: u64,
    /// The wall time of whoever commands it; the machine's own until that is told.
    now: Option<Nanos>,
}

impl std::fmt::Debug for ServedSpecimen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ServedSpecimen")
            .field("identity", &self.identity)
            .finish_non_exhaustive()
    }
}

// How it is made.
impl ServedSpecimen {
    /// A specimen without limits and without a record, which `substructure` answers for in every test; `stiffness` and `mass` are
    /// n × n by columns, in `units`. An axis without a unit counts in m and N.
    #[must_use]
    pub fn new(
        name: String,
        substructure: Box<dyn Substructure>,
        mut units: Vec<AxisUnits>,
        stiffness: Vec<f64>,
        mass: Vec<f64>,
    ) -> Self {
        let axes = substructure.axes();
        units.resize(axes, AxisUnits::SI);
        let diagonal = stiffness.iter().step_by(axes + 1).copied().collect();
        let is_remote = substructure.is_remote();
        let mut port = Port::received(name.clone(), substructure, diagonal);
        if is_remote {
            *port.wiring_check_mut() = WiringCheck::Unchecked;
        }
        let served = Self {
            identity: Identity {
                name,
                units,
                stiffness,
                mass,
                needs_measured_disp: Vec::new(),
                moves: is_remote,
                remembers: false,
            },
            port,
            links: None,
            allowance: SpeedAllowance::new(is_remote),
            announced: None,
            first: FirstCommand::default(),
            store: GuardStore::default(),
            latch: Latch::default(),
            recording: Recording::default(),
            stage: Stage::Closed,
            answer: Measurement::zeros(axes),
            tripped: None,
            commits: 0,
            now: None,
        };
        served.limited(&[])
    }

    /// A specimen across a link that `links` makes for each test; one axis for each unit.
    #[must_use]
    pub fn linked(
        name: String,
        links: LinkMaker,
        units: Vec<AxisUnits>,
        stiffness: Vec<f64>,
        mass: Vec<f64>,
    ) -> Self {
        let unconnected = Box::new(Unconnected { axes: units.len() });
        let mut served = Self::new(name, unconnected, units, stiffness, mass);
        served.links = Some(links);
        served
    }

    /// The bounds of its axes.
    #[must_use]
    pub fn limited(mut self, limits: &[LimitsSpec]) -> Self {
        let given = |axis| limits.get(axis).map_or(AxisLimits::NONE, AxisLimits::of);
        let own: Vec<AxisLimits> = (0..self.axes()).map(given).collect();
        let units = self.identity.units.iter();
        let units = units.map(|unit| (unit.metres, unit.newtons)).collect();
        self.port.set_guard(Guard::new(own, units, USUAL_TICK_S));
        let needs = limits.iter().flat_map(LimitsSpec::needing_measured_disp);
        self.identity.needs_measured_disp = needs.collect::<BTreeSet<_>>().into_iter().collect();
        self
    }

    /// Where its guard is between sessions, and the latch of its trips: those of the specimen, which outlive this value.
    #[must_use]
    pub fn guarded(mut self, store: GuardStore, latch: Latch) -> Self {
        (self.store, self.latch) = (store, latch);
        self
    }

    /// It is computed and keeps its state between sessions, and so the history of its limits and its trip.
    #[must_use]
    pub fn remembering(mut self, remembers: bool) -> Self {
        self.identity.remembers = remembers;
        self
    }

    /// How its wiring is checked. `computed`: a computation answers, which forgets having been moved.
    #[must_use]
    pub fn checked(mut self, check: WiringCheck, computed: bool) -> Self {
        *self.port.wiring_check_mut() = check;
        self.port.set_computed(computed);
        self
    }

    /// It moves, or stands for something that does, although it is no link.
    #[must_use]
    pub fn moving(mut self) -> Self {
        self.identity.moves = true;
        self.allowance = SpeedAllowance::new(true);
        self
    }

    /// Faults are played on every test, as these words say: its record says so, too.
    #[must_use]
    pub fn played(mut self, words: Option<String>) -> Self {
        self.recording.played = words;
        self
    }

    /// Each controller's test gets a run folder.
    #[must_use]
    pub fn recorded(mut self, settings: Option<RecordSettings>) -> Self {
        self.recording.settings = settings;
        self
    }

    /// The processor that the threads of the record leave to the data.
    pub fn keep_record_away_from(&mut self, cpu: Option<usize>) {
        self.recording.away_from = cpu;
    }
}

// What it is.
impl ServedSpecimen {
    /// Number of axes.
    #[must_use]
    pub const fn axes(&self) -> usize {
        self.port.axes()
    }

    /// True if commands leave this process.
    #[must_use]
    pub fn is_remote(&self) -> bool {
        self.port.is_remote()
    }

    /// Initial stiffness, n × n by columns.
    #[must_use]
    pub fn stiffness(&self) -> &[f64] {
        &self.identity.stiffness
    }

    /// Mass, n × n by columns.
    #[must_use]
    pub fn mass(&self) -> &[f64] {
        &self.identity.mass
    }

    /// Tangent stiffness, n × n by columns; the initial one where it is not known. Real-time: yes.
    pub fn tangent(&self, stiffness: &mut [f64]) {
        if !self.port.tangent(stiffness) {
            for (to, from) in stiffness.iter_mut().zip(&self.identity.stiffness) {
                *to = *from;
            }
        }
    }

    /// What was measured last.
    #[must_use]
    pub const fn measured(&self) -> &Measurement {
        &self.answer
    }

    /// Why the specimen holds, if it does.
    #[must_use]
    pub const fn tripped(&self) -> Option<Trip> {
        self.tripped
    }

    /// The latch of the specimen's trips.
    #[must_use]
    pub const fn latch(&self) -> &Latch {
        &self.latch
    }

    /// The operator's next step, if a trip is latched.
    #[must_use]
    pub fn next_step(&self) -> Option<String> {
        let trip = self.latch.trip();
        trip.map(|_| format!("no test begins until {}", self.latch.next_step()))
    }

    /// A trip with what its link has to say.
    #[must_use]
    pub fn whole(&self, trip: Trip) -> String {
        let mut text = trip.to_string();
        match trip {
            Trip::Lost(_) => {
                if let Some(complaint) = self.port.complaint() {
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
                if let Some(why) = leaves.and_then(|_| first_command::why(self.port.limits(), &hit))
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
}

// How a controller's test begins.
impl ServedSpecimen {
    /// Gets everything ready for a controller's test: record, connection, wiring check, arming. Returns what whoever watches
    /// should know. May block and move the specimen for its check, for as long as the test is `wanted`.
    ///
    /// # Errors
    /// Why there is no test. A specimen that was reached is informed and holds where it is.
    pub fn begin(
        &mut self,
        controller: &Controller,
        wanted: &mut Wanted<'_>,
    ) -> Result<Vec<String>, TestEnd> {
        self.end(Cause::Protocol, "another controller came");
        if let Some(refusal) = self.latch.refusal() {
            return Err(TestEnd::failed(refusal));
        }
        self.borrow_guard(controller)?;
        // The specimen is not connected yet.
        self.stage = Stage::Dismissed;
        (self.tripped, self.commits) = (None, 0);
        self.announced = AnnouncedLimits::by(controller, &self.identity.units);
        self.first.begins = None;
        self.answer = Measurement::zeros(self.axes());
        if let Err(text) = self.recording.open(&self.identity, controller) {
            self.end(Cause::Protocol, &text);
            return Err(text.into());
        }
        self.stage = Stage::Open;
        let ready = Readiness::new(self, controller).reach(wanted);
        ready.map_err(|TestEnd { cause, text }| {
            // Its own reason is one for its controller, too.
            let said = self.dismiss(cause);
            let text = with_last_words(text, said);
            if cause.status() == Ended::Failed {
                self.note(Remark::Link, &text);
            }
            self.end(cause, &text);
            TestEnd { cause, text }
        })
    }

    /// A session begins with the guard of the specimen, or with a new one where the specimen is new, too.
    fn borrow_guard(&mut self, controller: &Controller) -> Result<(), TestEnd> {
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
        self.port.set_guard(lent.guard);
        self.allowance = lent.allowance;
        self.port.begin_session(USUAL_TICK_S);
        self.allowance.announced(controller.rate);
        Ok(())
    }

    /// The controller begins anew after commands that only checked the wiring: a computed specimen forgets them. May block, for as
    /// long as that is `wanted`.
    ///
    /// # Errors
    /// The specimen is not ready, or gone, or need not be ready.
    pub fn begin_again(
        &mut self,
        sequence: u64,
        start: &[f64],
        wanted: &mut Wanted<'_>,
    ) -> Result<(), TestEnd> {
        self.note(Remark::ArmedAgain, "the controller begins again");
        self.arm(sequence, start, wanted)?;
        self.begins_at(sequence, start);
        Ok(())
    }

    /// The controller said that its first command will be here.
    pub(super) fn begins_at(&mut self, sequence: u64, start: &[f64]) {
        self.first.begins = self.identity.moves.then(|| (sequence, start.to_vec()));
    }

    pub(super) fn arm(
        &mut self,
        sequence: u64,
        start: &[f64],
        wanted: &mut Wanted<'_>,
    ) -> Result<(), TestEnd> {
        if !self.identity.is_lasting() {
            self.port
                .set_guard(self.port.guard().forgetful(USUAL_TICK_S));
            self.allowance.forget();
        }
        self.port.begin_commands(sequence, start);
        self.allowance.begin(sequence);
        self.first.armed();
        if let Some(announced) = &mut self.announced {
            announced.begin(self.port.watch());
        }
        let mut unwanted = None;
        let mut is_wanted = || wanted().map_err(|over| unwanted = Some(over)).is_ok();
        let asked = self.port.ask_to_arm(sequence);
        let outcome = asked.and_then(|()| self.port.arm(sequence, &mut is_wanted));
        if let Some(over) = unwanted {
            return Err(over);
        }
        outcome.map(|_| ()).map_err(|fault| {
            let why = self.port.complaint().unwrap_or_default();
            let between = if why.is_empty() { "" } else { ": " };
            TestEnd::failed(format_args!("not armed: {fault}{between}{why}"))
        })
    }

    /// Commands may come from now on. Real-time: yes.
    pub fn starts(&mut self, now: Nanos) {
        self.now = Some(now);
        self.allowance.starts(now);
    }

    /// The present wall time, by a clock other than the machine's. Real-time: yes.
    pub const fn now_is(&mut self, now: Nanos) {
        self.now = Some(now);
    }
}

// One exchange.
impl ServedSpecimen {
    /// One exchange: limits, specimen, limits, record. `elapsed` is the test time since the last commit. `into` holds what was
    /// measured last, with the interlock flag while a trip is latched. False if the answer is owed, and not `wanted` any more.
    /// Real-time: yes, as far as the link is.
    ///
    /// # Errors
    /// The specimen holds; this command, or the one that tripped, was not passed on or must be the last.
    pub fn exchange(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        self.exchange_as(Origin::Controller, command, elapsed, wanted, into)
    }

    pub(super) fn exchange_as(
        &mut self,
        origin: Origin,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        let received_ns = self.recording.begins(command.time);
        let mut answered_ns = None;
        let mut is_answered = true;
        if self.tripped.is_none() {
            match self.attempt(command, elapsed, origin, wanted, &mut answered_ns) {
                Ok(answered) => is_answered = answered,
                Err(trip) => self.trip(trip),
            }
        }
        into.sequence = command.sequence;
        into.time = self.answer.time;
        into.status = self.answer.status;
        copy(&self.answer, into);
        if self.tripped.is_some() {
            into.status.0 |= Status::INTERLOCK.0;
        }
        if !is_answered {
            into.status.0 |= Status::OWED.0;
        }
        self.recording.exchange(&Exchange {
            state: answered_ns.map_or(Exchange::KEPT_BACK, |_| origin.state()),
            command,
            elapsed,
            commits: self.commits,
            measured: into,
            trip: self.tripped,
            received_ns,
            answered_ns: answered_ns.unwrap_or(received_ns),
        });
        self.tripped.map_or(Ok(is_answered), Err)
    }

    /// `answered_ns` stays empty for a command that is not passed on. False if its answer is owed, and not
    /// `wanted` any more.
    fn attempt(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        origin: Origin,
        wanted: &mut dyn FnMut() -> bool,
        answered_ns: &mut Option<u64>,
    ) -> Result<bool, Trip> {
        self.judge_command(command, elapsed, origin)?;
        let is_theirs = origin == Origin::Controller;
        if is_theirs {
            self.first.passed();
        }
        let answer = self.pass_on(command, elapsed, wanted);
        *answered_ns = Some(self.recording.now_ns());
        let fault = match answer {
            Ok(true) => None,
            Ok(false) => return Ok(false),
            Err(LinkFault::NotFinite) => Some(LinkFault::NotFinite),
            Err(fault) => return Err(Trip::Lost(fault)),
        };
        let raw = self.port.raw();
        (self.answer.time, self.answer.status) = (raw.time, raw.status);
        copy(raw, &mut self.answer);
        if let Some(axis) = not_finite(&raw.disp, &raw.force) {
            // A sensor is at its end. What it read before is the answer.
            self.answer.status.0 |= Status::SATURATED.0;
            let measured = true;
            return Err(Trip::NotFinite { axis, measured });
        }
        if let Some(fault) = fault {
            return Err(Trip::Lost(fault));
        }
        self.judge_answer(is_theirs)?;
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
            let measured = false;
            return Err(Trip::NotFinite { axis, measured });
        }
        let time = self.time_of(command, elapsed, origin);
        if let Some(time) = time {
            self.port.set_motion_time(time.own);
        }
        // Our own small motions before the test are none of the controller's.
        let is_theirs = origin == Origin::Controller;
        if is_theirs {
            self.first.judge(command, &self.port)?;
            self.first.take_up_pace(command, elapsed, &mut self.port);
        }
        let motion = command.disp.iter().zip(command.vel);
        self.port
            .aim_at(&mut motion.map(|(disp, vel)| (*disp, *vel)));
        let found = self.port.clear();
        self.heed(found)?;
        if let Some(announced) = self.announced.as_mut().filter(|_| is_theirs) {
            let units = self.port.units().iter();
            let disp = command.disp.iter().zip(units);
            let disp = disp.map(|(disp, (metres, _))| disp * metres);
            announced.command(time.map_or(USUAL_TICK_S, |time| time.announced), disp)?;
        }
        Ok(())
    }

    /// Sends the command that was judged, and takes its answer; false if that is not `wanted` any more.
    fn pass_on(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        // The other end counts the time over commands that were lost by itself.
        let dt = if self.port.is_remote() {
            command.dt
        } else {
            elapsed
        };
        let limit_ns = self.links.as_ref().map_or(0, LinkMaker::reply_limit_ns);
        let deadline = match limit_ns {
            0 => Nanos(0),
            _ => Nanos(os::monotonic_ns()).plus(limit_ns),
        };
        self.port.issue(command.sequence, command.time, dt)?;
        for _ in 0..limit_ns.div_ceil(LISTEN_NS) {
            if self.port.is_answered(LISTEN_NS)? {
                break;
            }
            if !wanted() {
                return Ok(false);
            }
        }
        match self.port.collect(deadline)? {
            Freshness::Fresh => Ok(true),
            // The time limit of a link that does not keep one itself.
            Freshness::Stale => Err(LinkFault::Timeout),
        }
    }

    /// Everything that is judged of an answer. Real-time: yes.
    fn judge_answer(&mut self, is_theirs: bool) -> Result<(), Trip> {
        if self.answer.status.has(Status::UNSETTLED) {
            self.port.count_unsettled();
        }
        let found = self.port.judge();
        if let Some(announced) = self.announced.as_mut().filter(|_| is_theirs) {
            let units = self.port.units().iter();
            let values = self.answer.disp.iter().zip(&self.answer.force).zip(units);
            announced.measured(
                values.map(|((disp, force), (metres, newtons))| (disp * metres, force * newtons)),
            )?;
        }
        self.heed(found)?;
        if self.answer.status.has(Status::SATURATED) {
            return Err(Trip::Saturated);
        }
        if self.answer.status.has(Status::INTERLOCK) {
            return Err(Trip::Interlock);
        }
        let hold = self.port.note_hold(Freshness::Fresh);
        // No word of a link.
        self.answer.status.0 &= !Status::HELD.0;
        if hold.begins {
            let text = "the specimen says that it holds by its own watchdog, since commands had stopped: what it answers meanwhile \
                        does not belong to the commands";
            self.warn(Remark::SpecimenHolds, text);
        }
        if hold.answers > HOLDING_IN_A_ROW {
            return Err(Trip::Holds(hold.answers));
        }
        Ok(())
    }

    /// The times that a command has for its motion, if anything is known of them. Our own small motions before the test keep to
    /// a pace of ours, and no controller decides their time. Real-time: yes.
    fn time_of(&mut self, command: &Command<'_>, elapsed: f64, origin: Origin) -> Option<Times> {
        if let Origin::Own { period_s } = origin {
            return Some(Times::both(period_s));
        }
        let now = self.now.unwrap_or_else(|| Nanos(os::monotonic_ns()));
        if self.allowance.has_rested(now) {
            self.port.has_come_to_rest();
            if let Some(announced) = &mut self.announced {
                announced.rests();
            }
        }
        let request = Request {
            sequence: command.sequence,
            elapsed,
            stays: self.port.is_at(command.disp),
        };
        self.allowance.time_of(request, now)
    }

    /// Warnings are told, and so is what trips beside the first; that ends the test.
    fn heed(&mut self, found: Found) -> Result<(), Trip> {
        let mut untold = found.warning;
        while let Some(hit) = untold.take().or_else(|| self.port.next_untold()) {
            // Each time that the level is crossed from inside.
            let what = match hit.level {
                Level::Warning => "a warning",
                Level::Trip => "it trips, too",
            };
            let text = format!("{hit} ({}): {what}", hit.quantity.key());
            self.note(Remark::Limit, &text);
        }
        found.trip.map_or(Ok(()), |hit| Err(Trip::Limit(hit)))
    }

    /// Latches the trip of a lasting specimen: no session begins before its operator has cleared it. A lost link is not latched.
    pub(super) fn trip(&mut self, trip: Trip) {
        self.tripped = Some(trip);
        let text = self.whole(trip);
        if self.identity.is_lasting() && !matches!(trip, Trip::Lost(_)) {
            self.latch.set(&self.identity.name, trip.name(), &text);
        }
        self.recording.tripped(trip, &text);
    }

    /// The last command is accepted. A specimen that is lost meanwhile shows at the next command. Real-time: yes.
    pub fn commit(&mut self) {
        if self.tripped.is_some() {
            return;
        }
        self.commits += 1;
        if self.port.has_begun()
            && let Err(fault) = self.port.accepted(0)
        {
            self.trip(Trip::Lost(fault));
        }
    }

    /// What was not committed is forgotten, by what can forget.
    pub fn revert(&mut self) {
        self.port.revert();
    }

    /// Nothing to command for now: notices a specimen that has gone. Does not block.
    ///
    /// # Errors
    /// It has.
    pub fn attend(&mut self) -> Result<(), Trip> {
        if self.stage != Stage::Closed
            && self.tripped.is_none()
            && let Err(fault) = self.port.attend()
        {
            self.trip(Trip::Lost(fault));
            return Err(Trip::Lost(fault));
        }
        Ok(())
    }

    /// Its controller is held by an operator.
    pub fn pause(&mut self) {
        // A specimen that is lost shows when it is attended to.
        let _ = self.port.pause();
    }

    /// Its controller ends its test here: it stops, and what comes next comes from rest.
    pub fn halt(&mut self) {
        self.port.has_come_to_rest();
        if let Some(announced) = &mut self.announced {
            announced.rests();
        }
        self.port.halt();
    }
}

// Notes, and how a controller's test ends.
impl ServedSpecimen {
    /// A warning about the controller or the specimen: for the program's log, and once for the events and the summary of the
    /// run folder.
    pub fn warn(&mut self, event: Remark, text: &str) {
        self.recording.warn_once(&self.store, event, text);
    }

    /// Something for the record.
    pub fn note(&self, event: Remark, text: &str) {
        self.recording.note(&self.store, event, text);
    }

    /// What came of the controller: commands, those that never arrived, and frames that failed a check.
    pub fn counted(&mut self, commands: u64, missed: u32, corrupt: u64) {
        let text = format!("{commands} commands, {missed} missed, {corrupt} frames corrupt");
        self.note(Remark::Counts, &text);
        if !self.port.is_remote() {
            self.recording.link = LinkStats {
                missed: missed.into(),
                corrupt,
                ..LinkStats::default()
            };
        }
    }

    /// The specimen hears the last word of this test, once, before the books are closed: what it answers beyond a plain goodbye is
    /// for its controller, too.
    pub fn dismiss(&mut self, cause: Cause) -> Option<String> {
        if self.stage != Stage::Open {
            return None;
        }
        self.stage = Stage::Dismissed;
        if self.port.is_remote() {
            self.recording.link = self.port.link_count().stats;
        }
        let told = self.tripped.map(|trip| self.whole(trip));
        self.port.retire(cause.into());
        let said = self.port.last_words();
        if let Some(links) = &self.links {
            if self.port.has_begun() {
                links.left_at(self.port.sent());
            }
            // The connection closes.
            let axes = self.axes();
            drop(self.port.swap_partner(Box::new(Unconnected { axes })));
        }
        let said = said?;
        // The trip said so already, or it says what the trip said.
        if told.is_some_and(|told| told.contains(&said) || said.ends_with(&told)) {
            return None;
        }
        let text = format!("the specimen reported after the test: {said}");
        self.recording.warn(&self.store, Remark::LastWords, &text);
        Some(said)
    }

    /// The controller's test is over: last words to the specimen, and the record is closed. Nothing if there is no test.
    pub fn end(&mut self, cause: Cause, text: &str) {
        if self.stage == Stage::Closed {
            return;
        }
        let unsettled = self.port.counts().unsettled;
        if unsettled > 0 {
            let text = format!(
                "the actuator–specimen iteration did not converge in {unsettled} answers, which are not exact"
            );
            self.note(Remark::Unsettled, &text);
        }
        // A trip is why it ended, whatever else was said about it, and who says it again says nothing else.
        let why = self.tripped.map(|trip| match trip {
            Trip::Lost(_) => self.whole(trip),
            _ => trip.to_string(),
        });
        let cause = self.tripped.map_or(cause, Trip::cause);
        let text = match why {
            Some(why) if !text.contains(&why) => format!("{why}; {text}"),
            _ => text.to_owned(),
        };
        self.dismiss(cause);
        self.stage = Stage::Closed;
        if self.identity.is_lasting() {
            self.store.take_back(LastingGuard {
                guard: self.port.guard().clone(),
                allowance: self.allowance.clone(),
            });
            self.latch.settle();
        }
        self.recording.close(cause, &text, self.commits);
    }
}

impl Drop for ServedSpecimen {
    fn drop(&mut self) {
        self.end(Cause::Internal, "internal error: the test was dropped");
    }
}

/// The numbers of each axis that are finite. Real-time: yes.
fn copy(from: &Measurement, to: &mut Measurement) {
    let values = to.disp.iter_mut().zip(&mut to.force);
    for ((disp, force), (from_disp, from_force)) in values.zip(from.disp.iter().zip(&from.force)) {
        if from_disp.is_finite() && from_force.is_finite() {
            (*disp, *force) = (*from_disp, *from_force);
        }
    }
}

/// The first axis (from 0) on which a number is none. Real-time: yes.
pub(super) fn not_finite(one: &[f64], other: &[f64]) -> Option<usize> {
    let mut pairs = one.iter().zip(other);
    pairs.position(|(one, other)| !(one.is_finite() && other.is_finite()))
}
