//! A specimen as a server commands it, from one controller's test to the next.

use std::collections::BTreeSet;

use super::client_scale::{AxesBehind, ClientScale};
use super::guard_store::GuardStore;
use super::guarded_specimen::{ByTheClock, GuardedSpecimen, Origin};
use super::identity::Identity;
use super::latch::Latch;
use super::link_maker::{LinkMaker, Unconnected};
use super::pacing::Pacing;
use super::readiness::Readiness;
use super::session_record::RecordSettings;
use super::session_summary::peak_of;
use super::speed_allowance::{SpeedAllowance, Times};
use super::{Controller, TestEnd, Trip, USUAL_TICK_S, Wanted, simulated_pace, with_last_words};
use gusset_config::LimitsSpec;
use gusset_control::engine::{Between, ReceivedCounts};
use gusset_control::port::limits::AxisLimits;
use gusset_control::port::{PortError, PortSpec, ReceivedPort, WiringCheck};
use gusset_quantity::catalog::ending::{Cause, Status as Ended};
use gusset_quantity::catalog::event::Remark;
use gusset_quantity::frame::{AtAxis, AtClient};
use gusset_quantity::substructure::{Command, LinkStats, Measurement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_quantity::units::AxisUnits;
use gusset_record::summary::Peak;
use gusset_record::{Column, Event, Ready, Recorder};
use gusset_wire::handshake::Limits;

/// How far a controller's test has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Stage {
    /// The test is closed.
    #[default]
    Closed,
    /// A test is open, and the specimen has not received the goodbye.
    Open,
    /// The specimen has received the goodbye of the test, or was not connected yet.
    Dismissed,
}

/// A specimen as a server commands it. Ends its test when it is dropped.
pub struct ServedSpecimen {
    pub(super) guarded: GuardedSpecimen,
    /// Links of a gateway.
    pub(super) links: Option<LinkMaker>,
    stage: Stage,
    /// The specimen was ready for the commands of the controller.
    is_ready: bool,
    /// Everything with which the test began.
    ready: Option<Box<Ready>>,
}

impl std::fmt::Debug for ServedSpecimen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ServedSpecimen")
            .field("identity", &self.guarded.identity)
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
        let diagonal: Vec<f64> = stiffness.iter().step_by(axes + 1).copied().collect();
        let port = PortSpec::passing_on(name, substructure, &diagonal);
        let behind = None;
        Self::of(port, ClientScale { units, behind }, [stiffness, mass], None)
    }

    fn of(
        mut port: ReceivedPort,
        scale: ClientScale,
        [stiffness, mass]: [Vec<f64>; 2],
        links: Option<LinkMaker>,
    ) -> Self {
        let moves = port.exchange().is_remote();
        if moves {
            *port.startup_mut().wiring_mut() = WiringCheck::Unchecked;
        }
        let identity = Identity {
            name: port.name().to_owned(),
            scale,
            stiffness,
            mass,
            moves,
            corrects_at_most: 0.0,
            remembers: false,
        };
        let mut guarded = GuardedSpecimen::new(identity, port);
        guarded.reply_limit_ns = links.as_ref().map_or(0, LinkMaker::reply_limit_ns);
        let served = Self {
            guarded,
            links,
            stage: Stage::Closed,
            is_ready: false,
            ready: None,
        };
        served.limited(&[])
    }

    /// A specimen across a link that `links` makes for each test; one axis for each unit.
    #[must_use]
    pub(crate) fn linked(
        name: String,
        links: LinkMaker,
        units: Vec<AxisUnits>,
        stiffness: Vec<f64>,
        mass: Vec<f64>,
    ) -> Self {
        let unconnected = Box::new(Unconnected { axes: units.len() });
        let mut served = Self::new(name, unconnected, units, stiffness, mass);
        served.guarded.reply_limit_ns = links.reply_limit_ns();
        served.links = Some(links);
        served
    }

    /// A specimen across a link that `links` makes for each test, whose axes the controller does not command directly: `port`, whose
    /// partner is [`Unconnected`], converts its signals, which count in `units`. Stiffness and mass are those of the signals.
    #[must_use]
    pub(crate) fn converted(
        links: LinkMaker,
        port: ReceivedPort,
        behind: AxesBehind,
        units: Vec<AxisUnits>,
        matrices: [Vec<f64>; 2],
    ) -> Self {
        let scale = ClientScale {
            units,
            behind: Some(behind),
        };
        Self::of(port, scale, matrices, Some(links))
    }

    /// Each target of a controller becomes a path of commands.
    #[must_use]
    pub(crate) fn paced(mut self, pacing: Option<Pacing>) -> Self {
        if let Some(pacing) = pacing {
            self.guarded.set_pacing(pacing);
        }
        self
    }

    /// The bounds of its axes.
    #[must_use]
    pub fn limited(mut self, limits: &[LimitsSpec]) -> Self {
        let units = self.guarded.identity.scale.axis_units();
        self.guarded.port.set_limits(USUAL_TICK_S, |axis| {
            let limits = limits.get(axis).map_or(AxisLimits::NONE, AxisLimits::of);
            (
                limits,
                units
                    .get(axis)
                    .map_or((1.0, 1.0), |unit| (unit.metres, unit.newtons)),
            )
        });
        let needs = limits.iter().flat_map(LimitsSpec::needing_measured_disp);
        let needs = needs.map(str::to_owned).collect::<BTreeSet<_>>();
        let startup = self.guarded.port.startup_mut();
        startup.needs_measured_disp_mut().own.extend(needs);
        self
    }

    /// Where its guard is between sessions, and the latch of its trips: those of the specimen, which outlive this value.
    #[must_use]
    pub fn guarded(mut self, store: GuardStore, latch: Latch) -> Self {
        (self.guarded.store, self.guarded.latch) = (store, latch);
        self
    }

    /// It is computed and keeps its state between sessions, and so the history of its limits and its trip.
    #[must_use]
    pub(crate) fn remembering(mut self, remembers: bool) -> Self {
        self.guarded.identity.remembers = remembers;
        self
    }

    /// How its wiring is checked. `computed`: a computation answers, which forgets having been moved.
    #[must_use]
    pub(crate) fn checked(mut self, check: WiringCheck, computed: bool) -> Self {
        *self.guarded.port.startup_mut().wiring_mut() = check;
        self.guarded.port.startup_mut().set_computed(computed);
        self
    }

    /// The specimen moves, or represents one that moves, although it is not behind a link.
    #[must_use]
    pub(crate) fn moving(mut self) -> Self {
        self.guarded.identity.moves = true;
        self.guarded.allowance = SpeedAllowance::new(true);
        self
    }

    /// Faults of every test, in words for its record.
    #[must_use]
    pub(crate) fn played(mut self, words: Option<String>) -> Self {
        self.guarded.recording.played = words;
        self
    }

    /// Each controller's test gets a run folder.
    #[must_use]
    pub fn recorded(mut self, settings: Option<RecordSettings>) -> Self {
        self.guarded.recording.settings = settings;
        self
    }

    /// The processor that the threads of the record leave to the data.
    pub(crate) fn keep_record_away_from(&mut self, cpu: Option<usize>) {
        self.guarded.recording.away_from = cpu;
    }
}

// Properties.
impl ServedSpecimen {
    /// Number of displacements that a controller commands.
    #[must_use]
    pub const fn axes(&self) -> usize {
        self.guarded.identity.scale.units.len()
    }

    /// The units in which a controller counts.
    #[must_use]
    pub(crate) fn units(&self) -> &[AxisUnits] {
        &self.guarded.identity.scale.units
    }

    /// True if commands leave this process.
    #[must_use]
    pub(crate) fn is_remote(&self) -> bool {
        self.guarded.port.exchange().is_remote()
    }

    /// True if each target of a controller becomes a path of commands.
    #[must_use]
    pub(crate) const fn is_paced(&self) -> bool {
        self.guarded.pacing().is_some()
    }

    /// Initial stiffness, n × n by columns.
    #[must_use]
    pub fn stiffness(&self) -> &[f64] {
        &self.guarded.identity.stiffness
    }

    /// Mass, n × n by columns.
    #[must_use]
    pub(crate) fn mass(&self) -> &[f64] {
        &self.guarded.identity.mass
    }

    /// Tangent stiffness, n × n by columns; the initial one if the tangent is not known, as behind every link. Real-time: yes.
    pub(crate) fn tangent(&self, stiffness: &mut [f64]) {
        let is_of_axes = self.guarded.identity.scale.is_of_axes();
        if !(is_of_axes && self.guarded.port.exchange().tangent(stiffness)) {
            for (to, from) in stiffness.iter_mut().zip(&self.guarded.identity.stiffness) {
                *to = *from;
            }
        }
    }

    /// The last measurement.
    #[must_use]
    pub const fn measured(&self) -> &Measurement {
        &self.guarded.answer
    }

    /// Lag in s, gain, stiffness in N/m, and the damping in N s/m that the lag adds, per axis; empty where nothing is estimated.
    pub fn tracking(&self) -> impl Iterator<Item = [f64; 4]> {
        self.guarded.port.tracking().values()
    }

    /// The trip for which the specimen holds, if there is one.
    #[must_use]
    pub const fn tripped(&self) -> Option<Trip> {
        self.guarded.tripped()
    }

    /// True if the link to the specimen was lost: only its own server knows its position.
    #[must_use]
    pub(crate) const fn has_lost_it(&self) -> bool {
        matches!(self.guarded.tripped(), Some(Trip::Lost(_)))
    }

    /// The latch of the specimen's trips.
    #[must_use]
    pub const fn latch(&self) -> &Latch {
        &self.guarded.latch
    }

    /// The operator's next step, if a trip is latched.
    #[must_use]
    pub(crate) fn next_step(&self) -> Option<String> {
        let latch = &self.guarded.latch;
        let trip = latch.trip();
        trip.map(|_| format!("no test begins until {}", latch.next_step()))
    }

    /// A trip in words, with the complaint of its link.
    #[must_use]
    pub fn whole(&self, trip: Trip) -> String {
        self.guarded.whole(trip)
    }
}

// How a controller's test begins.
impl ServedSpecimen {
    /// Gets everything ready for a controller's test: record, connection, wiring check, arming. Returns messages for the
    /// operator of the server. May block and move the specimen for its check, for as long as the test is `wanted`.
    ///
    /// # Errors
    /// Why the test cannot begin. A specimen that was reached is informed and holds where it is.
    pub fn begin(
        &mut self,
        controller: &Controller,
        wanted: &mut Wanted<'_>,
    ) -> Result<Vec<String>, TestEnd> {
        self.end(Cause::Protocol, "another controller came");
        if let Some(refusal) = self.guarded.latch.refusal() {
            return Err(TestEnd::failed(refusal));
        }
        self.guarded.begin_session(controller)?;
        // The specimen is not connected yet.
        (self.stage, self.is_ready) = (Stage::Dismissed, false);
        if let Err(text) = self.guarded.open_record(controller) {
            self.end(Cause::Protocol, &text);
            return Err(text.into());
        }
        self.stage = Stage::Open;
        let ready =
            Readiness::new(&mut self.guarded, self.links.as_ref(), controller).reach(wanted);
        self.is_ready = ready.is_ok();
        let ready = ready.map(|(told, ready)| {
            let ready = Box::new(ready);
            self.guarded.recording.event(Event::Ready(ready.clone()));
            self.ready = Some(ready);
            told
        });
        ready.map_err(|TestEnd { cause, text, .. }| {
            // Its own reason is one for its controller, too.
            let said = self.dismiss(cause);
            let text = with_last_words(text, said);
            if cause.status() == Ended::Failed {
                self.note(Remark::Link, &text);
            }
            self.end(cause, &text);
            TestEnd::of(cause, text)
        })
    }

    /// The controller begins again after commands that only checked the wiring: a computed specimen forgets them. May block, for
    /// as long as that is `wanted`.
    ///
    /// # Errors
    /// The specimen is not ready, lost, or no longer needed.
    pub fn begin_again(
        &mut self,
        sequence: u64,
        start: &[f64],
        wanted: &mut Wanted<'_>,
    ) -> Result<(), TestEnd> {
        if self.guarded.rests_on_the_way() {
            let text = "the specimen was held on the way to a target, so the test cannot begin again: connect again";
            return Err(TestEnd::failed(text));
        }
        self.note(Remark::ArmedAgain, "the controller begins again");
        let asked = start;
        let start = self.guarded.place_for(AtClient(start))?;
        let start = start.part(Vec::as_slice);
        self.guarded.arm(sequence, start, wanted)?;
        self.guarded.begins_at(sequence, start);
        if let Some(ready) = &mut self.ready {
            (ready.first, ready.start) = (sequence, asked.to_vec());
            self.guarded.recording.event(Event::Ready(ready.clone()));
        }
        Ok(())
    }

    /// Commands may come from now on. Real-time: yes.
    pub(crate) fn starts(&mut self, now: Nanos) {
        self.guarded.starts(now);
    }

    /// The present wall time, by a clock other than the machine's. Real-time: yes.
    pub(crate) const fn now_is(&mut self, now: Nanos) {
        self.guarded.now_is(now);
    }

    /// The present wall time of a double of the machine's clock.
    #[cfg(feature = "test-doubles")]
    pub const fn simulated_now_is(&mut self, now: Nanos) {
        self.guarded.now_is(now);
    }
}

// Commands.
impl ServedSpecimen {
    /// One exchange of the controller: limits, specimen, limits, record. `elapsed` is the test time since the last commit. `into`
    /// receives the last measurement, with the interlock flag after a trip. False if the answer is missing, and no longer
    /// `wanted`. Real-time: yes, as far as the link is.
    ///
    /// # Errors
    /// The specimen holds. The command was not passed on, or is the last one.
    pub fn exchange(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        self.guarded
            .exchange_as(Origin::Controller, command, elapsed, wanted, into)
    }

    /// The controller makes an impossible request: the specimen holds from here on.
    pub fn trip(&mut self, trip: Trip) {
        if self.guarded.tripped().is_none() {
            self.guarded.trip_between(trip);
        }
    }

    /// The last command is accepted. Real-time: yes.
    pub fn commit(&mut self) {
        self.guarded.commit();
    }

    /// A computed specimen forgets uncommitted steps.
    pub(crate) fn revert(&mut self) {
        self.guarded.port.exchange_mut().revert();
    }

    /// The specimen moves on by a tick while its controller computes, if that is due. Returns when the next tick is due; none if nothing
    /// moves. Real-time: yes, as far as the link is.
    ///
    /// # Errors
    /// The specimen holds.
    pub fn go_on(&mut self) -> Result<Option<Nanos>, Trip> {
        self.guarded.go_on()
    }

    /// The controller wants nothing any more: a specimen that still moves comes to rest.
    pub fn come_to_rest(&mut self) {
        self.guarded.come_to_rest();
    }

    /// True if the specimen keeps moving between targets.
    #[must_use]
    pub fn predicts(&self) -> bool {
        self.guarded.predicts()
    }

    /// No command for now: notices a lost specimen. Does not block.
    ///
    /// # Errors
    /// It has.
    pub fn attend(&mut self) -> Result<(), Trip> {
        if self.stage != Stage::Closed
            && self.guarded.tripped().is_none()
            && let Err(fault) = self.guarded.port.exchange_mut().attend()
        {
            self.guarded.trip_between(fault.into());
            return Err(fault.into());
        }
        Ok(())
    }

    /// Its controller is held by an operator.
    pub(crate) fn pause(&mut self) {
        // A specimen that is lost shows when it is attended to.
        let _ = self.guarded.port.pause();
    }

    /// Its controller ends its test here: it stops, and the next motion starts from rest.
    pub fn halt(&mut self) {
        self.guarded.between.add(Between::HALTED);
        self.guarded.has_come_to_rest();
        self.guarded.port.exchange_mut().halt();
    }
}

// A replay.
impl ServedSpecimen {
    /// Columns of the rows of its tests.
    #[must_use]
    pub fn columns(&self) -> Vec<Column> {
        self.guarded.identity.columns(&self.guarded.port)
    }

    /// The specimen of a recorded test that began with `ready`: `partner` answers for it, and its rows go to the `recorder`. Nothing is
    /// sent anywhere, and no time passes but in waits.
    ///
    /// # Errors
    /// The partner has another number of axes.
    pub fn replaying(
        mut self,
        ready: &Ready,
        partner: Box<dyn Substructure>,
        recorder: Box<dyn Recorder>,
    ) -> Result<Self, PortError> {
        if ready.moves && !self.guarded.identity.moves {
            self = self.moving();
        }
        self.links = None;
        self.guarded.port.put_recording(partner)?;
        self.guarded.recording.replay = Some(recorder);
        self.guarded.keep_time_by(simulated_pace::CLOCK);
        self.foretell(Between::default(), None);
        Ok(self)
    }

    /// Begins a recorded test as it began.
    ///
    /// # Errors
    /// It cannot begin so.
    pub fn begin_as(&mut self, ready: &Ready) -> Result<(), TestEnd> {
        let limits = ready.limits.iter().map(|[min, max, speed, force]| Limits {
            disp_min: min.unwrap_or(Limits::NONE.disp_min),
            disp_max: max.unwrap_or(Limits::NONE.disp_max),
            speed_max: speed.unwrap_or(Limits::NONE.speed_max),
            force_max: force.unwrap_or(Limits::NONE.force_max),
        });
        let controller = Controller {
            rate: ready.rate.map(|[above, below]| (above, below)),
            first_sequence: ready.first,
            start: ready.start.clone(),
            limits: limits.collect(),
            ..Controller::unnamed((std::net::Ipv4Addr::LOCALHOST, 0).into())
        };
        self.begin(&controller, &mut || Ok(())).map(|_| ())
    }

    /// The decisions of the wall clock about the next command of a recorded test: `between` of its row, and the times for its
    /// motion. Real-time: yes.
    pub fn foretell(&mut self, between: Between, times: Option<[f64; 2]>) {
        self.guarded.foretold = Some(ByTheClock {
            rested: between.has(Between::RESTED),
            late: between.has(Between::LATE),
            times: times.map(|[own, announced]| Times { own, announced }),
        });
    }

    /// Name of the specimen.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.guarded.identity.name
    }

    /// Counts of the exchanges so far.
    #[must_use]
    pub fn counts(&self) -> ReceivedCounts {
        self.guarded.test.counts()
    }

    /// The largest forces so far, as its summary has them.
    #[must_use]
    pub fn peak(&self) -> Peak {
        peak_of(&self.counts(), self.name())
    }

    /// Commands that were accepted so far.
    #[must_use]
    pub const fn commits(&self) -> u64 {
        self.guarded.commits()
    }
}

// Notes, and how a controller's test ends.
impl ServedSpecimen {
    /// A warning about the controller or the specimen: for the program's log, and once for the events and the summary of the
    /// run folder.
    pub(crate) fn warn(&mut self, event: Remark, text: &str) {
        self.guarded.warn(event, text);
    }

    /// A note for the record.
    pub(crate) fn note(&self, event: Remark, text: &str) {
        self.guarded.note(event, text);
    }

    /// Counts for the controller: commands, those that never arrived, and frames that failed a check.
    pub(crate) fn counted(&mut self, commands: u64, missed: u32, corrupt: u64) {
        let text = format!("{commands} commands, {missed} missed, {corrupt} frames corrupt");
        self.note(Remark::Counts, &text);
        if !self.guarded.port.exchange().is_remote() {
            self.guarded.recording.link = LinkStats {
                missed: missed.into(),
                corrupt,
                ..LinkStats::default()
            };
        }
    }

    /// The specimen receives the goodbye of this test, once, before the record is closed. Its answer beyond a plain goodbye is
    /// returned for the controller.
    pub(crate) fn dismiss(&mut self, cause: Cause) -> Option<String> {
        if self.stage != Stage::Open {
            return None;
        }
        self.stage = Stage::Dismissed;
        let unsettled = self.guarded.port.exchange().count().unsettled;
        if unsettled > 0 {
            let text = format!(
                "the actuator–specimen iteration did not converge in {unsettled} answers, which are not exact"
            );
            self.note(Remark::Unsettled, &text);
        }
        if self.guarded.port.exchange().is_remote() {
            self.guarded.recording.link = self.guarded.port.exchange().full_count().stats;
        }
        let told = self.guarded.tripped().map(|trip| self.guarded.whole(trip));
        self.guarded.port.exchange_mut().retire(cause.into());
        let said = self.guarded.port.exchange().last_words();
        if let Some(links) = &self.links {
            let told = self.guarded.test.told();
            if !told.is_empty() {
                links.left_at(&told);
            }
            // The connection closes.
            let axes = self.guarded.port.axes();
            drop(
                self.guarded
                    .port
                    .swap_partner(Box::new(Unconnected { axes })),
            );
        }
        let said = said?;
        // The trip and the answer report the same.
        if told.is_some_and(|told| told.contains(&said) || said.ends_with(&told)) {
            return None;
        }
        let text = format!("the specimen reported after the test: {said}");
        self.warn(Remark::LastWords, &text);
        Some(said)
    }

    /// The controller's test is over: the specimen receives the goodbye, and the record is closed. Does nothing without a test.
    pub fn end(&mut self, cause: Cause, text: &str) {
        if self.stage == Stage::Closed {
            return;
        }
        self.guarded.come_to_rest();
        // A trip is the reason of the end, whatever other reasons there are; repeating it adds nothing.
        let why = self.guarded.tripped().map(|trip| match trip {
            Trip::Lost(_) => self.guarded.whole(trip),
            _ => trip.to_string(),
        });
        let cause = self.guarded.tripped().map_or(cause, Trip::cause);
        let text = match why {
            Some(why) if !text.contains(&why) => format!("{why}; {text}"),
            _ => text.to_owned(),
        };
        self.dismiss(cause);
        self.stage = Stage::Closed;
        let is_regular = self.is_ready && cause == Cause::Done && !self.guarded.rests_on_the_way();
        let is_lost = self.has_lost_it();
        let AtAxis(told) = self.guarded.test.told();
        let last = (told.is_empty() || !is_lost).then_some(told);
        self.guarded.latch.ends(last, is_regular);
        self.guarded.end_session();
        let commits = self.guarded.commits();
        let test = &mut self.guarded.test;
        self.guarded.recording.close(cause, &text, commits, test);
    }
}

impl Drop for ServedSpecimen {
    fn drop(&mut self) {
        self.end(Cause::Internal, "internal error: the test was dropped");
    }
}
