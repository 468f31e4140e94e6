//! The tick loop.
//!
//! Every tick of a test goes through [`Engine::perform`]: wait for the edge, exchange commands and
//! measurements, record the row, close the tick. The exchange judges each measurement as it arrives. A [`Maneuver`] defines the differences: the next command, the reaction to the measurements, and the completion. Each command is
//! judged before its tick begins, so that nothing but the send stands between the edge and the wire. A stop leaves the loop at
//! once, and the next commands do not leave.
//! Everything here is on the real-time path: no allocation, no lock, no system call but the clock's and the links', no panic.

use super::commanding::Exchanges;
use super::deadlines::Deadlines;
use super::end_positions::Ends;
use super::environment::Environment;
use super::numerical::Side;
use super::operator::{Client, OperatorCommands};
use super::order::{Kind, Order};
use super::phase::Phase;
use super::running_state::RunningState;
use super::step_progress::StepProgress;
use super::test_judge::TestJudge;
use super::tick::Tick;
use super::{Peaks, Plan, StaticLoad, Stop};
use crate::port::Port;
use gusset_record::rt::timing::TickStamps;
use gusset_record::{Event, LimitReached, ON_MISS, Recorder, WarmUpRows};

/// A motion or a rest of all specimens, tick by tick.
pub(super) trait Maneuver {
    /// The next tick, whose command is made and judged; none when the maneuver is complete.
    ///
    /// # Errors
    /// The test ends.
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop>;

    /// Reacts to the measurements, before the row is made.
    ///
    /// # Errors
    /// The test ends. A maneuver that wants a row of this tick makes it before it returns the error.
    fn measured(
        &mut self,
        _: &mut Engine<'_>,
        _: &mut Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        Ok(())
    }

    /// Reacts to the measurements, after the row is made.
    ///
    /// # Errors
    /// The test ends.
    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        _: &Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        engine.reuse_number();
        Ok(())
    }
}

/// The running engine: a test with its ports, borrowed from the life cycle that owns them.
pub(super) struct Engine<'a> {
    pub plan: &'a Plan,
    pub ports: &'a mut [Port],
    pub side: &'a mut Side,
    /// The static load that is still to be applied.
    pub settling: &'a mut Option<StaticLoad>,
    pub peaks: &'a mut Peaks,
    pub progress: &'a mut StepProgress,
    pub exchanges: &'a mut Exchanges,
    pub judge: &'a mut TestJudge,
    pub environment: &'a mut Environment,
    pub ends: &'a mut Ends,
    /// Whether another controller still wants its test, and what ends it.
    pub client: Option<&'a mut Client<'a>>,
}

impl Engine<'_> {
    /// Performs a maneuver, tick by tick: the only tick loop. Real-time: yes.
    ///
    /// # Errors
    /// The stop that ended the test before the maneuver was complete.
    #[inline]
    pub(crate) fn perform(&mut self, maneuver: &mut impl Maneuver) -> Result<(), Stop> {
        while let Some(mut order) = maneuver.next(self)? {
            let mut stamps = TickStamps::default();
            let skipped = self.wait_for_edge(&order, &mut stamps)?;
            self.exchange(&order, &mut stamps)?;
            maneuver.measured(self, &mut order, &mut stamps)?;
            self.record(&order, &stamps);
            maneuver.recorded(self, &order, &mut stamps)?;
            self.close_tick(&order, stamps, skipped)?;
        }
        Ok(())
    }

    /// The parts that have a state, after the tick `last`, and the recorder that takes it.
    pub(crate) fn state<'s>(
        &'s mut self,
        last: &'s mut Tick,
    ) -> (RunningState<'s>, &'s mut dyn Recorder) {
        let Engine {
            plan: _,
            ports,
            side,
            settling: _,
            peaks,
            progress,
            exchanges,
            judge,
            environment,
            ends: _,
            client: _,
        } = self;
        let Environment {
            pace: _,
            deadlines: _,
            supervision,
            journal,
            place,
        } = &mut **environment;
        let (row, recorder) = journal.row_and_recorder();
        let state = RunningState {
            ports,
            side,
            peaks,
            progress,
            exchanges,
            judge,
            place,
            supervision,
            row,
            last,
        };
        (state, recorder)
    }

    /// Waits for the edge of a tick and hears the operator. Returns the ticks by which the grid was moved.
    #[inline]
    fn wait_for_edge(&mut self, order: &Order, stamps: &mut TickStamps) -> Result<u64, Stop> {
        if let (Kind::Received { is_paced }, Side::Received(received)) =
            (order.kind, &mut *self.side)
        {
            received.is_late = self.environment.pace.wait_for_client(is_paced, stamps);
            return Ok(0);
        }
        if let Some(client) = &mut self.client {
            self.environment.supervision.hear_client(client);
        }
        self.environment.wait_for_edge(order.is_still(), stamps)?;
        if self.side.is_received() {
            // A reply that came late is no reason to go faster.
            self.environment.pace.count_from(stamps.woke);
            return Ok(0);
        }
        if order.kind == Kind::Test {
            return Ok(self.environment.stretch_after_wakeup(stamps));
        }
        self.environment.skip_late_edges(stamps);
        Ok(0)
    }

    /// Makes the row of a tick and hands it to the recorder; a lost row is an event and a count, never a wait.
    #[inline]
    fn record(&mut self, order: &Order, stamps: &TickStamps) {
        let place = &order.place;
        match order.kind {
            Kind::WarmUp(WarmUpRows::Never) | Kind::Received { .. } => return,
            // The maneuver has filled it.
            Kind::Test => self.environment.journal.drop_warm_up(),
            Kind::Hold => self.fill_row_between(order, Phase::Holding),
            Kind::WarmUp(_) => self.fill_row_between(order, Phase::Armed),
            Kind::Beside(phase) => {
                for port in &mut *self.ports {
                    port.look_at_pose();
                }
                let row = &mut self.environment.journal.row;
                row.exchange(place, phase, self.side, self.ports);
                row.outputs(self.side);
                if let (Side::Received(received), Some(port)) =
                    (&mut *self.side, self.ports.first())
                {
                    received.count(true, port);
                }
            }
        }
        self.time_row(stamps);
        if order.kind == Kind::WarmUp(WarmUpRows::IfTheyMatter) {
            self.environment.journal.hold_row_back();
        } else if !self.environment.journal.keep_row() && order.kind == Kind::Test {
            self.environment.report(place, Event::RowLost);
        }
    }

    fn fill_row_between(&mut self, order: &Order, phase: Phase) {
        let row = &mut self.environment.journal.row;
        row.between(&order.place, phase.code(), self.side, self.ports);
    }

    /// The columns of the row that depend on wall time. Real-time: yes.
    #[inline]
    pub(crate) fn time_row(&mut self, stamps: &TickStamps) {
        if self.side.is_received() {
            return;
        }
        let pace = &self.environment.pace;
        let (first_edge, stretched) = (pace.first_edge(), pace.stretched());
        let row = &mut self.environment.journal.row;
        row.timing(stamps, first_edge, stretched);
    }

    /// Ends a tick. In the test a deadline miss is counted, judged and answered by the policy.
    #[inline]
    fn close_tick(&mut self, order: &Order, stamps: TickStamps, skipped: u64) -> Result<(), Stop> {
        if order.kind != Kind::Test {
            return Ok(());
        }
        let Environment {
            pace,
            deadlines,
            journal,
            ..
        } = &mut *self.environment;
        match deadlines.close(pace, &mut journal.row, stamps, skipped) {
            None => Ok(()),
            Some(missed) => self.heed_miss(order, &missed),
        }
    }

    #[cold]
    fn heed_miss(&mut self, order: &Order, missed: &super::deadlines::Missed) -> Result<(), Stop> {
        let tick = &order.tick;
        let late_ns = missed.late_ns;
        self.environment.report(
            tick,
            Event::Miss {
                class: missed.cause,
                late_ns,
                stretched: missed.stretched,
                evidence: None,
            },
        );
        self.judge.judge_misses(tick, self.environment)?;
        let pace = &self.environment.pace;
        let (in_a_row, total) = (
            self.environment.deadlines.in_a_row(),
            self.environment.deadlines.total(),
        );
        let beyond = if Deadlines::ends_the_test(missed, pace.on_miss()) {
            let seconds = |ns: u64| super::columns::number(ns) * 1e-9;
            Some((ON_MISS, seconds(late_ns), seconds(pace.period_ns())))
        } else {
            let beyond = self.judge.misses_beyond(in_a_row, total);
            beyond.map(|(limit, found, most)| (limit.key(), found, most))
        };
        let Some((limit, value, bound)) = beyond else {
            return Ok(());
        };
        self.environment.report(
            tick,
            Event::LimitTrip(LimitReached {
                port: None,
                axis: None,
                limit: limit.into(),
                value,
                bound,
            }),
        );
        Err(Stop::Late {
            total,
            in_a_row,
            late_ns,
        })
    }

    /// Keeps the row of a step that ends the test: its measurements, without velocities and accelerations.
    #[cold]
    pub(crate) fn keep_last_row(&mut self, stamps: &TickStamps) {
        self.environment.journal.row.no_outputs();
        self.time_row(stamps);
        self.environment.journal.keep_row();
    }

    /// Notes the peak displacements of a step whose target was reached. Real-time: yes.
    #[inline]
    pub(crate) fn note_reached(&mut self) {
        if let Side::Structure(numerical) = &*self.side {
            self.peaks.note_disp(&numerical.state.disp);
        }
    }

    /// The row records a stop that ended the wait for a reply. Real-time: yes.
    pub(crate) fn mark_stop_in_wait(&mut self) {
        let row = &mut self.environment.journal.row;
        row.commands.add(OperatorCommands::STOP_IN_WAIT);
    }

    /// Test time of one tick that moves the specimens beside the test, in s.
    pub(crate) fn tick_passes(&self) -> f64 {
        self.plan.dt / self.progress.pacer().ticks_per_step()
    }

    /// A tick in which the last commands leave again: nothing moves, everything is read.
    pub(crate) fn still(&self, phase: Phase) -> Order {
        Order::still(self.environment.place.at_rest(0.0), phase)
    }
}
