//! The course of a test: settle, warm up, run to the last step, retire; and what happens when the loop is late.

use std::time::Duration;

use super::columns::{Lateness, Word, number};
use super::numerical::{Side, aim_along};
use super::operator::{Control, Operator, OperatorCommands};
use super::phase::{Glimpse, Phase};
use super::tick::Tick;
use super::{Ending, Engine, OnMiss, Outcome, Stop};
use crate::control::Port;
use crate::record::{Event, GridOf, LimitReached, MissCause, ON_MISS};
use crate::rt::timing::{Suspect, TickStamps};
use crate::substructure::{LISTEN_NS, Retirement};
use crate::time::Nanos;

/// Repetitions of the numerical path on scratch state before the first edge.
const REHEARSALS: usize = 300;
/// From the end of the set-up to the first edge, so that the first edge can be met.
pub(super) const LEAD_NS: u64 = 2_000_000;

/// Longest wait for an edge in which the operator is not listened to.
const NAP_NS: u64 = 100_000_000;

impl Engine {
    /// Runs the test to its end, whatever the end is; every specimen is retired on return.
    pub fn run(&mut self, control: &Control) -> Outcome {
        let ending = self.course(control).into();
        let ending = self.leave(ending, control);
        self.conclude(ending)
    }

    /// The one way out: every specimen is retired, then the books are closed. [`Engine::run`] ends with it; after a
    /// panic in there it is for the caller who caught it, with [`Stop::Internal`].
    pub fn conclude(&mut self, ending: Ending) -> Outcome {
        self.retire(ending.cause().into());
        self.note_unheard();
        let of_last_phase = match ending {
            Ending::Stopped(Stop::Internal) => ending,
            // The shutdown is complete, whatever had ended the test.
            _ if self.phase == Phase::Leaving && self.unfinished.is_none() => Ending::Completed,
            _ if self.phase == Phase::Leaving => Ending::Stopped(Stop::Operator),
            _ => ending,
        };
        self.enter(Phase::Safe, of_last_phase);
        if let Some(stamps) = self.unrecorded.take() {
            self.timing.tick(&stamps);
        }
        self.report_now(Event::Ended);
        self.outcome(ending)
    }

    /// Last words to every specimen, once to each. Needs nothing but the ports, so that it also works after a panic;
    /// after a panic in the last words of one specimen a second call goes on with the next.
    pub fn retire(&mut self, how: Retirement) {
        while let Some(port) = self.ports.get_mut(self.retired) {
            self.retired += 1;
            port.retire(how);
        }
    }

    pub(super) fn course(&mut self, control: &Control) -> Result<(), Stop> {
        if let Side::Structure(numerical) = &self.side
            && numerical.is_offline()
            && !self.ports.is_empty()
        {
            return Err(Stop::CannotCommand);
        }
        match self.resume.take() {
            Some(from) => self.take_up(from, control)?,
            None => self.open(control)?,
        }
        self.enter(Phase::Running, Ending::Completed);
        self.ports.iter_mut().for_each(Port::begin_compensation);
        self.report_now(Event::Started);
        if let Some(watch) = &mut self.before_first_tick {
            watch();
        }
        let result = self.all_steps(control);
        if let Some(stamps) = self.unrecorded.take() {
            self.timing.tick(&stamps);
        }
        if let Some(watch) = &mut self.after_last_tick {
            watch();
        }
        result
    }

    /// From the agreed connection to the tick before the first.
    fn open(&mut self, control: &Control) -> Result<(), Stop> {
        self.aim_at_start();
        if let Side::Structure(numerical) = &mut self.side
            // On simulated time nothing need be warm.
            && !self.clock.is_simulated()
            && let Some(scratch) = numerical.scratch()
        {
            for _ in 0..REHEARSALS {
                numerical.rehearse(&scratch, &mut self.ports);
            }
        }
        self.try_directions(control)?;
        if self.opening.is_gentle() {
            for port in &mut self.ports {
                port.stand_still();
            }
        }
        self.take_their_word();
        self.arm(control)?;
        self.begin_grid(GridOf::Opening);
        self.zero(control)?;
        self.aim_at_start();
        self.settle(control)?;
        self.aim_at_start();
        self.ramp(control)?;
        self.aim_at_start();
        self.begin_ride();
        let is_loaded = self.settling.is_some();
        self.warm_up(control)?;
        if !is_loaded {
            self.report_initial_forces(|port, axis| {
                let raw = port.raw();
                [raw.disp.get(axis), raw.force.get(axis)].map(|value| value.copied().unwrap_or(0.0))
            });
        }
        Ok(())
    }

    /// Specimens that say where they stand are commanded to stay there, whatever the test begins with.
    pub(super) fn take_their_word(&mut self) {
        self.ports.iter_mut().for_each(Port::take_its_word);
    }

    /// Command 0 is `B·x[0]`: held, and measured, before anything moves.
    pub(super) fn aim_at_start(&mut self) {
        match &mut self.side {
            Side::Structure(numerical) => {
                let base = numerical.base(0);
                for port in &mut self.ports {
                    let state = &numerical.state;
                    port.aim(&state.disp, &state.vel, base.disp, base.vel);
                }
                self.peaks.start(&numerical.state.disp);
            }
            Side::Prescribed(histories) => aim_along(histories, 0, &mut self.ports),
        }
    }

    /// Waits for the next edge and polls the operator. Real-time: yes.
    #[inline]
    pub(super) fn wait_for_edge(
        &mut self,
        stamps: &mut TickStamps,
        control: &Control,
    ) -> Result<(), Stop> {
        stamps.idle = self.clock_now;
        self.goes_on = false;
        self.row.commands.begin_tick();
        self.wait_for_somebody(control);
        let was_asked = self.unconfirmed;
        stamps.release = self.schedule.tick(self.edge);
        // A slow test has far edges: the operator is heard on the way there.
        if stamps.release.since(stamps.idle) > NAP_NS {
            while stamps.release.since(self.clock.now()) > NAP_NS {
                self.clock.sleep_until(self.clock.now().plus(NAP_NS / 2));
                self.hear(control)?;
            }
        }
        self.clock.sleep_until(stamps.release);
        stamps.woke = self.clock.now();
        self.clock_now = stamps.woke;
        self.edge += 1;
        stamps.deadline = self.schedule.tick(self.edge);
        let heard = self.hear(control);
        self.row.word = Word {
            holds: self.hold_wanted,
            goes_on: self.goes_on,
            confirms: was_asked && !self.unconfirmed,
        };
        heard
    }

    /// On simulated time a test that stands until somebody says a word would make millions of rows meanwhile: it makes some.
    fn wait_for_somebody(&mut self, control: &Control) {
        let stands = self.still || self.phase == Phase::Holding;
        let is_waiting = stands && (self.unconfirmed || self.hold_wanted);
        if is_waiting && control.desk.is_some() && self.clock.is_simulated() {
            self.asked.wait(control, Duration::from_nanos(LISTEN_NS));
        }
    }

    /// What the operator asks for, if anything. Real-time: yes.
    #[inline]
    pub(super) fn hear(&mut self, control: &Control) -> Result<(), Stop> {
        let commands = &mut self.row.commands;
        match self.asked.take(control) {
            Some(Operator::Stop) => {
                commands.add(OperatorCommands::STOP);
                return Err(Stop::Operator);
            }
            Some(Operator::GiveUp) => {
                return Err(Stop::Late {
                    total: self.misses,
                    in_a_row: self.misses_in_a_row,
                    late_ns: 0,
                });
            }
            // The way out is neither held nor confirmed.
            Some(_) if !self.phase.can_be_held() => {}
            Some(Operator::Hold) => {
                if !self.hold_wanted {
                    commands.add(OperatorCommands::HOLD);
                    self.hold_number = self.hold_number.saturating_add(1);
                    self.report_now(Event::HoldRequested);
                }
                self.hold_wanted = true;
            }
            Some(Operator::EndHold(hold)) if hold != self.hold_number => {
                self.report_now(Event::ContinueDropped {
                    hold,
                    latest: self.hold_number,
                });
            }
            Some(Operator::EndHold(_) | Operator::Continue) => {
                commands.remove(OperatorCommands::HOLD);
                commands.add(OperatorCommands::CONTINUE);
                if self.hold_wanted {
                    self.report_now(Event::ContinueRequested);
                }
                self.hold_wanted = false;
                self.goes_on = true;
            }
            Some(Operator::Confirm) => {
                let was_asked = std::mem::take(&mut self.unconfirmed);
                if was_asked {
                    commands.add(OperatorCommands::CONFIRM);
                }
            }
            None => {}
        }
        self.show();
        Ok(())
    }

    /// A replay says that the test was given up here: its own clock finds nothing late. What else is asked for is heard later.
    pub(super) fn hear_if_given_up(&mut self, control: &Control) -> Result<(), Stop> {
        match self.asked.next(control) {
            Some(Operator::GiveUp) => self.hear(control),
            _ => Ok(()),
        }
    }

    /// Leaves behind what can be seen of the test from outside. Real-time: yes.
    pub(super) fn show(&self) {
        self.phase_cell.show(Glimpse {
            phase: self.phase,
            hold: self.hold_wanted,
            unconfirmed: self.unconfirmed,
            hold_number: self.hold_number,
            stands: self.still || matches!(self.phase, Phase::Armed | Phase::Holding),
        });
    }

    /// Enters the next phase; `of_last` is how the phase before it ended. Real-time: yes.
    pub(super) fn enter(&mut self, phase: Phase, of_last: Ending) {
        let from = self.phase;
        debug_assert!(from.may_become(phase), "{from:?} to {phase:?}");
        self.phase = phase;
        self.show();
        self.report_now(Event::Phase {
            from,
            to: phase,
            cause: of_last.word().into(),
            port: of_last.port().map(|port| port as u32),
        });
    }

    /// The same before t = 0, where nothing is integrated: late ticks are not made up for, whatever the policy, so that no
    /// specimen sees a burst of commands.
    pub(super) fn wait_before_start(
        &mut self,
        stamps: &mut TickStamps,
        control: &Control,
    ) -> Result<(), Stop> {
        self.wait_for_edge(stamps, control)?;
        let ticks = self.skip_edges_before(stamps.woke);
        if ticks > 0 {
            self.note_gap(stamps.woke.since(stamps.release), ticks);
        }
        Ok(())
    }

    /// Moves on to the first edge at or after `now`, by so many whole ticks. Steps are not counted by edges: none is lost.
    pub(super) fn skip_edges_before(&mut self, now: Nanos) -> u64 {
        let behind = now.since(self.schedule.tick(self.edge));
        let ticks = behind.div_ceil(self.schedule.period_ns().max(1));
        self.edge += ticks;
        ticks
    }

    /// Books the tick's timing, counts a miss and applies the policy. A step is never skipped; what can slip is wall
    /// time. Real-time: yes.
    #[inline]
    pub(super) fn close_tick(
        &mut self,
        tick: &Tick,
        mut stamps: TickStamps,
        stalled: u64,
    ) -> Result<(), Stop> {
        // The histograms of the tick before are updated here, so that their cost is inside `record`.
        if let Some(before) = &self.unrecorded {
            self.timing.tick(before);
        }
        stamps.pushed = self.clock.now();
        self.clock_now = stamps.pushed;
        self.row.record_before = number(stamps.pushed.since(stamps.ready)) * 1e-9;
        if stamps.pushed <= stamps.deadline {
            self.unrecorded = Some(stamps);
            self.misses_in_a_row = 0;
            self.row.lateness.in_a_row = 0;
            self.row.lateness.in_window = self.miss_window.at(self.edge);
            return Ok(());
        }
        self.unrecorded = None;
        let Some(miss) = self.timing.tick(&stamps) else {
            return Ok(());
        };
        let next_edge = self.schedule.tick(self.edge);
        let period = self.schedule.period_ns();
        let overrun_ns = stamps.pushed.since(next_edge);
        let skipped = self.stretch_after_stall(overrun_ns, period);
        let stretched = stalled + skipped;
        self.misses += 1;
        self.misses_in_a_row += 1;
        self.row.lateness = Lateness {
            in_a_row: self.misses_in_a_row,
            in_window: self.miss_window.note(self.edge),
            in_total: self.misses,
            skipped_by_wakeup: 0,
            skipped_by_work: skipped,
            overrun_ns: if skipped > 0 { overrun_ns + period } else { 0 },
        };
        let class = match miss.suspect {
            Suspect::LateReply => MissCause::LateReply,
            Suspect::TakenAway => MissCause::TakenAway,
            Suspect::Ours => MissCause::Ours,
        };
        let late_ns = miss.late_ns;
        self.report(
            tick,
            Event::Miss {
                class,
                late_ns,
                stretched,
                evidence: None,
            },
        );
        self.judge_misses(tick)?;
        let whole_period = stamps.woke.since(stamps.release).max(late_ns) >= period;
        let beyond = if self.limits.on_miss == OnMiss::Stop && whole_period {
            Some((ON_MISS, number(late_ns) * 1e-9, number(period) * 1e-9))
        } else {
            let beyond = self.misses_beyond();
            beyond.map(|(limit, found, most)| (limit.key(), found, most))
        };
        if let Some((limit, value, bound)) = beyond {
            self.report(
                tick,
                Event::LimitTrip(LimitReached {
                    port: None,
                    axis: None,
                    limit: limit.into(),
                    value,
                    bound,
                }),
            );
            let Engine {
                misses: total,
                misses_in_a_row: in_a_row,
                ..
            } = *self;
            return Err(Stop::Late {
                total,
                in_a_row,
                late_ns,
            });
        }
        Ok(())
    }

    /// Late by a period or more: moves the grid by the whole periods in `late_ns`, as far as the policy wants it.
    /// `booked_ns` is what must be added to count the lateness from the edge of the tick in which the stall showed.
    /// Real-time: yes.
    #[inline]
    pub(super) fn stretch_after_stall(&mut self, late_ns: u64, booked_ns: u64) -> u64 {
        let period = self.schedule.period_ns().max(1);
        if late_ns < period {
            return 0;
        }
        let whole = late_ns / period;
        let ticks = match self.limits.on_miss {
            OnMiss::Stretch => whole,
            OnMiss::CatchUp { at_most } => whole.saturating_sub(at_most),
            OnMiss::Stop => 0,
        };
        if ticks > 0 {
            self.schedule.stretch(ticks);
            self.timing.swallowed(late_ns + booked_ns, period, ticks);
        }
        ticks
    }
}
