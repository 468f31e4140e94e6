//! A test whose targets another controller sends.
//!
//! Its server makes each command with the port, and judges what only a server knows: the limits that its client announced, the first
//! command, poses. The engine waits for the edge, exchanges, judges the answer by the limits of the specimen, checks the wiring, and
//! keeps the rows: as in a test whose targets are integrated. The port outlives the test, so it is lent for each call.

use super::columns::Row;
use super::cycle::{Engine, Maneuver};
use super::journal::Journal;
use super::operator::Client;
use super::order::{Kind, Order, Sends};
use super::owned_test::Parts;
use super::phase::Phase;
use super::plan::Plan;
use super::received_columns::{Received, ReceivedCounts, ReceivedRow};
use super::tick::Tick;
use super::wiring_check::WiringCheck;
use super::{Ending, Limits, OnMiss, Operator, Side, StartupSettings, Stop, TestLimits};
use crate::port::{OnStale, Port, ReceivedPort, WaitRules, WayBack, Wiring};
use gusset_quantity::frame::AtAxis;
use gusset_quantity::time::{Clock, Nanos, Ratio};
use gusset_quantity::units::AxisUnits;
use gusset_record::Recorder;
use gusset_record::rt::timing::{TickStamps, Timing};

/// Answers in a row in which a specimen may report a hold: as many as a controller's loop tolerates at least.
const HOLDING_IN_A_ROW: u64 = 10;

/// One received command.
struct Target {
    order: Option<Order>,
}

impl Maneuver for Target {
    fn next(&mut self, _: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        Ok(self.order.take())
    }

    /// The exchange belongs to the test, and its server counts it.
    fn recorded(&mut self, _: &mut Engine<'_>, _: &Order, _: &mut TickStamps) -> Result<(), Stop> {
        Ok(())
    }
}

/// A command of the port that is to leave.
#[derive(Debug, Clone, Copy)]
pub struct ReceivedCommand {
    /// Its number.
    pub sequence: u64,
    /// Its test time in s, and the time since the command before.
    pub time: f64,
    /// See `time`.
    pub dt: f64,
    /// It leaves at the next edge of the pace, not at once.
    pub is_paced: bool,
}

/// Settings of a test with received targets.
#[derive(Debug)]
pub struct ReceivedSettings {
    /// Number of displacements that the controller commands.
    pub signals: usize,
    /// Units of the axes.
    pub units: Vec<AxisUnits>,
    /// Units in which the port counts.
    pub port_units: Vec<AxisUnits>,
    /// From one paced command to the next, in ns.
    pub period_ns: u64,
    /// Longest wait for an answer in ns; 0 of a specimen without a link.
    pub reply_timeout_ns: u64,
    /// Number of columns of a row; 0 of a test without a record, which keeps no histograms either.
    pub width: usize,
}

/// A period of whole ns in s.
fn period_of(ns: u64) -> Ratio {
    Ratio::new(ns.max(1), 1_000_000_000).unwrap_or(Ratio::ONE)
}

/// A test whose targets another controller sends.
pub struct ReceivedTest(Box<Parts>);

impl std::fmt::Debug for ReceivedTest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ReceivedTest").finish_non_exhaustive()
    }
}

impl ReceivedTest {
    /// A test with this specimen, which is connected later.
    #[must_use]
    pub fn new(
        port: &mut ReceivedPort,
        settings: ReceivedSettings,
        clock: Box<dyn Clock>,
        recorder: Box<dyn Recorder>,
    ) -> Self {
        let ReceivedSettings {
            signals,
            units,
            port_units,
            period_ns,
            reply_timeout_ns,
            width,
        } = settings;
        let period = period_of(period_ns);
        let timing = if width > 0 {
            Timing::new(&[port.name()], true, 0)
        } else {
            Timing::counting()
        };
        port.wait_by(WaitRules {
            reply_timeout_ns,
            on_stale: OnStale::Stop,
            stale_in_a_row: HOLDING_IN_A_ROW,
            has_clock: false,
        });
        let received = Received::new(signals, port.axes(), units, port_units, clock.now());
        let limits = Limits {
            on_miss: OnMiss::Stretch,
            extrapolate_stale: false,
            stale_in_a_row: 0,
            reply_timeout_ns,
            warmup_ticks: 0,
            divergence: f64::INFINITY,
            test: TestLimits::NONE,
        };
        let plan = Plan {
            dt: period.value(),
            steps: u64::MAX,
            opening: StartupSettings::default(),
            limits,
            checkpoint_ticks: u64::MAX,
            keeps_state: false,
        };
        let journal = Journal::new(Row::of_received(width), width, recorder);
        let side = Side::Received(Box::new(received));
        let (time, record) = ((clock, period), (timing, journal));
        Self(Box::new(Parts::new(
            plan,
            side,
            port.as_ports(),
            time,
            record,
        )))
    }

    /// Sends the command of the port, which was judged, and judges its answer by the limits of the specimen. `client` may end the wait.
    /// Real-time: yes.
    ///
    /// # Errors
    /// The test ends. [`Stop::Operator`]: the client does not want the answer any more.
    pub fn exchange(
        &mut self,
        port: &mut ReceivedPort,
        command: ReceivedCommand,
        client: &mut dyn FnMut() -> Option<Operator>,
    ) -> Result<(), Stop> {
        let tick = self.place(command.time, command.dt);
        let kind = Kind::Received {
            is_paced: command.is_paced,
        };
        let mut target = Target {
            order: Some(Order::new(tick, Sends::Next, kind)),
        };
        let mut engine = self.engine(port, client);
        engine.exchanges.continue_at(command.sequence);
        engine.perform(&mut target)
    }

    /// Judges the next command of the port, of this test time, by the limits of the specimen. Real-time: yes.
    ///
    /// # Errors
    /// A limit is passed, or the actuators cannot have this pose.
    pub fn judge_command(&mut self, port: &mut ReceivedPort, time: f64) -> Result<(), Stop> {
        self.place(time, 0.0);
        self.engine(port, &mut || None).judge_commands()
    }

    /// Checks the wiring of the specimen, which is armed where it stands. The word of its `client` lets it go back.
    ///
    /// # Errors
    /// The wiring is wrong, or the test ends. A tick that ended it has no row yet.
    pub fn check_wiring(
        &mut self,
        port: &mut ReceivedPort,
        client: &mut dyn FnMut() -> Option<Operator>,
    ) -> Result<Option<Wiring>, Stop> {
        let Some(probe) = port.as_ports().first().and_then(Port::probe) else {
            return Ok(None);
        };
        // It keeps to its own pace.
        let period = period_of(probe.period_ns());
        let usual = self.0.environment.pace.take_period(period);
        self.0.plan.dt = period.value();
        port.guard_mut().set_motion_time(self.0.plan.dt);
        self.set_row(ReceivedRow::default());
        self.asks_nothing();
        let mut engine = self.engine(port, client);
        let environment = &mut engine.environment;
        environment.enter(Phase::Probing, Ending::Completed);
        let checked = WiringCheck::of_armed(&mut engine);
        let environment = &mut engine.environment;
        if checked.is_ok() {
            environment.enter(Phase::Armed, Ending::Completed);
            environment.enter(Phase::Running, Ending::Completed);
        }
        // The next wait queries the client again.
        environment.supervision.forget_requests();
        environment.pace.take_period(usual);
        self.0.plan.dt = usual.value();
        checked.map(|mut found| found.pop())
    }

    /// The axis, from 0, of a wiring check that was interrupted, and how it went back.
    #[must_use]
    pub const fn way_back(&self) -> Option<(usize, WayBack)> {
        self.0.ends.way_back
    }

    /// The controller asks for a target: its test time in s and that since the last commit, displacement and velocity of each signal. The
    /// rows of all commands to it have them. Real-time: yes.
    pub fn asks(&mut self, times: [f64; 2], motion: impl Iterator<Item = [f64; 2]>) {
        if let Some(received) = self.received_mut() {
            received.asks(times, motion);
        }
    }

    /// Forces are corrected from here on.
    pub fn corrects(&mut self, signals: usize) {
        if let Some(received) = self.received_mut() {
            received.corrections = vec![0.0; signals + 1];
        }
    }

    /// The corrections of the next row: one for each signal in N or N m, and the energy of all in J. Real-time: yes.
    pub fn note_corrections(&mut self, corrections: &[f64]) {
        let received = self.received_mut();
        let to = received
            .into_iter()
            .flat_map(|received| &mut received.corrections);
        to.zip(corrections).for_each(|(to, from)| *to = *from);
    }

    /// The commands from here on are those of the server itself. Real-time: yes.
    pub fn asks_nothing(&mut self) {
        if let Some(received) = self.received_mut() {
            received.asks_nothing();
        }
    }

    /// Records the last exchange in this state. Real-time: yes.
    pub fn record(&mut self, port: &mut ReceivedPort, state: f64, row: ReceivedRow) {
        self.set_row(row);
        let Parts {
            side, environment, ..
        } = &mut *self.0;
        let tick = Tick {
            step: 0,
            sub_tick: 0,
            time: row.time,
            dt: row.elapsed,
        };
        let ports = port.as_ports();
        let journal = &mut environment.journal;
        journal.row.between(&tick, state, side, ports);
        // A full queue counts it.
        journal.keep_row();
        if let Side::Received(received) = side {
            received.count(state != Phase::Tripped.code(), port);
            let period_s = environment.pace.period_s();
            let (at_s, _) = received.times();
            received.stages.count(state, at_s, period_s);
        }
    }

    /// True if a command has left since the last row. Real-time: yes.
    #[must_use]
    pub fn lacks_row(&self) -> bool {
        self.0.environment.journal.lacks_commands()
    }

    /// The command of the next row is judged where it stands: no exchange gives its times. Real-time: yes.
    pub fn note_arrival(&mut self) {
        let now = self.0.environment.pace.keep_reading();
        if let Some(received) = self.received_mut() {
            received.stamp(&TickStamps {
                woke: now,
                decoded: now,
                ..TickStamps::default()
            });
        }
    }

    /// The last command that left to the axes, in their units; empty before one. Real-time: yes.
    #[must_use]
    pub fn told(&self) -> AtAxis<&[f64]> {
        let received = self.received();
        received.map_or(AtAxis(&[]), |received| received.told.part(Vec::as_slice))
    }

    /// Exchanges so far: the number of the next row. Real-time: yes.
    #[must_use]
    pub fn exchanges(&self) -> u64 {
        self.received()
            .map_or(0, |received| received.counts.exchanges)
    }

    /// Counts so far.
    #[must_use]
    pub fn counts(&self) -> ReceivedCounts {
        let counts = self.received().map(|received| ReceivedCounts {
            stages: received.stages.times(),
            ..received.counts.clone()
        });
        counts.unwrap_or_default()
    }

    /// True if the last paced command left late by more than half a period. Real-time: yes.
    #[must_use]
    pub fn was_late(&self) -> bool {
        self.received().is_some_and(|received| received.is_late)
    }

    /// When the next paced command may leave. Real-time: yes.
    #[must_use]
    pub fn next_edge(&self) -> Nanos {
        self.0.environment.pace.next_edge()
    }

    /// True if a command that leaves now comes later than a tick after the last. Real-time: yes.
    #[must_use]
    pub fn is_behind(&self) -> bool {
        self.0.environment.pace.is_behind()
    }

    /// The histograms. A second call has none.
    pub fn take_timing(&mut self) -> Timing {
        self.0.environment.deadlines.take_timing()
    }

    /// The place of a command in the record: the controller's test runs. Real-time: yes.
    fn place(&mut self, time: f64, dt: f64) -> Tick {
        self.0.environment.supervision.continue_running();
        let place = Tick {
            step: self.exchanges(),
            sub_tick: 0,
            time,
            dt,
        };
        if let Some(received) = self.received_mut() {
            received.place = place;
        }
        place
    }

    fn set_row(&mut self, row: ReceivedRow) {
        if let Some(received) = self.received_mut() {
            received.row = row;
        }
    }

    /// Always there: the side was made so.
    const fn received(&self) -> Option<&Received> {
        match &self.0.side {
            Side::Received(received) => Some(received),
            _ => None,
        }
    }

    const fn received_mut(&mut self) -> Option<&mut Received> {
        match &mut self.0.side {
            Side::Received(received) => Some(received),
            _ => None,
        }
    }

    fn engine<'a>(
        &'a mut self,
        port: &'a mut ReceivedPort,
        client: &'a mut Client<'a>,
    ) -> Engine<'a> {
        self.0.engine(port.as_ports_mut(), Some(client))
    }
}
