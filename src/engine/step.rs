//! One tick, top to bottom: issue to all, collect from all, judge, close equilibrium, advance, aim, row.
//!
//! Nothing but the send stands between the edge and the wire: the command was made in the tick before. A step
//! is never skipped. Everything here is on the real-time path: no allocation, no lock, no system call but the
//! clock's and the links', no panic.

use super::numerical::{Side, seek_along};
use super::operator::Control;
use super::peaks::first_beyond;
use super::phase::Phase;
use super::ride::{has_answer, tell};
use super::tick::Tick;
use super::{Engine, Stop};
use crate::port::Port;
use crate::record::Event;
use crate::rt::timing::TickStamps;
use crate::substructure::{Coupling, Freshness, LinkFault, Status};

impl Engine {
    /// One tick of the running test: the command that stands ready leaves; where it reaches its target and every partner has
    /// answered, the step is closed and the next target made; the next command stands ready on return, and the row is
    /// handed over. Real-time: yes.
    #[inline]
    pub(super) fn tick(
        &mut self,
        tick: &Tick,
        stamps: &mut TickStamps,
        control: &Control,
    ) -> Result<(), Stop> {
        if self.is_at_the_end() {
            self.exchange_again(tick, stamps, control)?;
        } else {
            self.exchange(tick, stamps, control)?;
        }
        self.arrive();
        if self.can_close() {
            self.close_step(tick, stamps)
        } else {
            self.pass(tick, stamps)
        }
    }

    /// Equilibrium at the step whose target was reached, in this tick or some ticks ago. Real-time: yes.
    #[inline]
    fn close_step(&mut self, tick: &Tick, stamps: &mut TickStamps) -> Result<(), Stop> {
        let stride = self.ride.stride;
        let tick = self.step_of(tick);
        if let Err(stop) = self.resolve_poses() {
            self.record_trip(&tick, stamps, &stop);
            return Err(stop);
        }
        self.row
            .exchange(&tick, Phase::Running, &self.side, &self.ports);
        self.note_reached();
        let advanced = self.advance_to_next(&tick);
        stamps.ready = self.clock.now();

        self.accept_step()?;
        if let Side::Structure(numerical) = &mut self.side {
            numerical.output_accel();
        }
        self.row.outputs(&self.side);
        self.row
            .timing(stamps, self.first_edge, self.schedule.stretched());
        self.hand_over(&tick);
        self.note_stage(&tick, &stride);
        self.check(&tick);
        self.note_peaks(&tick, stamps)?;
        advanced
    }

    /// Where the platforms of loading units are, and which forces act there. Real-time: yes.
    #[inline]
    pub(super) fn resolve_poses(&mut self) -> Result<(), Stop> {
        for (index, port) in self.ports.iter_mut().enumerate() {
            let found = port.resolve_pose();
            found.map_err(|fault| Stop::Geometry { port: index, fault })?;
        }
        Ok(())
    }

    /// Issue to all before collecting from any, so that several links cost one round trip.
    #[inline]
    pub(super) fn exchange(
        &mut self,
        tick: &Tick,
        stamps: &mut TickStamps,
        control: &Control,
    ) -> Result<(), Stop> {
        let sequence = self.sequence;
        self.exchange_by(tick, stamps, control, |port| {
            port.issue(sequence, tick.time, tick.dt)
        })
    }

    /// The same with the last commands, at rest: nothing moves. Real-time: yes.
    pub(super) fn exchange_again(
        &mut self,
        tick: &Tick,
        stamps: &mut TickStamps,
        control: &Control,
    ) -> Result<(), Stop> {
        let sequence = self.sequence;
        self.exchange_by(tick, stamps, control, |port| {
            port.repeat(sequence, tick.time)
        })
    }

    #[inline]
    fn exchange_by(
        &mut self,
        tick: &Tick,
        stamps: &mut TickStamps,
        control: &Control,
        issue: impl Fn(&mut Port) -> Result<(), LinkFault>,
    ) -> Result<(), Stop> {
        let mut result = Ok(());
        if tick.time > self.at.time {
            self.at = *tick;
        }
        self.sent_since_row = true;
        let is_held = self.hold_wanted || !self.is_at_the_end();
        let holds = is_held && self.ride.tempo.stands() && tick.sub_tick > 0;
        self.ports.iter_mut().for_each(Port::begin_tick);
        for (index, port) in self.ports.iter_mut().enumerate() {
            if port.owes_the_last() {
                port.skip_command();
            } else if !port.is_lost() {
                let left = if self.riding && port.is_per_step() {
                    tell(port, self.sequence, self.ride.step, self.dt, holds)
                } else {
                    issue(port)
                };
                if let Err(fault) = left {
                    result = Err(Stop::Link { port: index, fault });
                    break;
                }
            }
        }
        stamps.sent = self.clock.now();
        stamps.decoded = stamps.sent;
        let result = self.collect_all(tick, stamps, control, result);
        if self.riding {
            self.ports.iter_mut().for_each(Port::note_peak);
        } else if self.phase.is_on_the_way_in() {
            let ports = self.ports.iter_mut();
            ports.for_each(Port::note_force_at_startup);
        }
        if let Err(stop) = &result {
            self.record_trip(tick, stamps, stop);
        }
        result
    }

    /// Takes and judges what every partner answers. What stops the test does not stop this: whoever owes an answer is heard,
    /// or it could not be told anything on the way out. Only the operator's word ends a wait, and with it all of them. The first
    /// stop counts. Real-time: yes.
    #[inline]
    fn collect_all(
        &mut self,
        tick: &Tick,
        stamps: &mut TickStamps,
        control: &Control,
        mut result: Result<(), Stop>,
    ) -> Result<(), Stop> {
        let mut control = Some(control);
        for index in 0..self.ports.len() {
            let Some(port) = self.ports.get(index) else {
                break;
            };
            if !port.may_be_commanded() || (result.is_err() && !port.owes()) {
                continue;
            }
            if let Err(stop) = self.collect_from(index, tick, stamps, control) {
                let was_heard = control.is_none() && stop == Stop::Operator;
                if stop == Stop::Operator {
                    control = None;
                }
                if result.is_ok() {
                    result = Err(stop);
                } else if !was_heard {
                    self.stops_too(&stop);
                }
            }
        }
        result
    }

    /// A second specimen ends a test that ends already: it is told, and the way out knows of it. Real-time: yes.
    #[cold]
    pub(super) fn stops_too(&mut self, stop: &Stop) {
        // A limit that trips was told where it was judged.
        self.report_stop(stop);
        self.bear_in_mind(stop);
        if let Stop::Link { port, .. } = stop
            && let Some(port) = self.ports.get_mut(*port)
        {
            port.note_loss();
        }
    }

    /// Takes and judges the answer of one partner, if it is here: who takes several ticks for it is not waited for, and nobody
    /// without a `control`. Real-time: yes.
    #[inline]
    pub(super) fn collect_from(
        &mut self,
        index: usize,
        tick: &Tick,
        stamps: &mut TickStamps,
        control: Option<&Control>,
    ) -> Result<(), Stop> {
        let known = self.newest_of(index);
        let result = self.take_from(index, tick, stamps, control);
        if self.newest_of(index) > known + 1 {
            self.note_recovered(index, tick);
        }
        result
    }

    /// Number of the command that a partner answered last. Real-time: yes.
    #[inline]
    fn newest_of(&self, index: usize) -> u64 {
        self.ports.get(index).map_or(0, |port| port.raw().sequence)
    }

    #[inline]
    fn take_from(
        &mut self,
        index: usize,
        tick: &Tick,
        stamps: &mut TickStamps,
        control: Option<&Control>,
    ) -> Result<(), Stop> {
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        let broken = |fault| Stop::Link { port: index, fault };
        let patience = port.patience_ns(self.limits.reply_timeout_ns);
        if (self.riding && port.is_per_step()) || port.owes_the_last() {
            let simulated = self.clock.is_simulated();
            let answer = has_answer(port, stamps.sent, patience, simulated);
            if !answer.map_err(broken)? {
                return Ok(());
            }
        }
        self.wait_for(index, control)?;
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        // A lockstep partner was waited for, a sampled one has until its share of the tick is over.
        let deadline = match port.coupling() {
            Coupling::Lockstep => stamps.sent.plus(patience),
            // The edge was counted when the tick began: this is the one that ends it.
            Coupling::Sampled => self
                .schedule
                .tick(self.edge)
                .minus(self.schedule.period_ns() / 8),
        };
        // A slow partner may have been asked some ticks ago.
        let asked_at = port.asked_at().unwrap_or(stamps.sent);
        let freshness = port.collect(deadline).map_err(broken)?;
        stamps.decoded = self.clock.now();
        if self.unanswered && port.is_recorded() {
            return Ok(());
        }
        self.timing
            .round_trip(index, stamps.decoded.since(asked_at));
        let status = port.raw().status;
        let says_stop = if status.has(Status::INTERLOCK) {
            Some(Stop::Interlock { port: index })
        } else if status.has(Status::SATURATED) {
            Some(Stop::Saturated { port: index })
        } else {
            None
        };
        if let Some(stop) = says_stop {
            if freshness == Freshness::Fresh {
                self.tell_beside(index, tick);
            }
            return Err(stop);
        }
        if status.has(Status::HOLDING) || port.holding_in_a_row() > 0 {
            self.judge_holding(index, status, freshness, tick)?;
        }
        if freshness == Freshness::Stale {
            return self.judge_age(index, tick);
        }
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        port.forget_stale();
        let found = port.judge();
        if status.has(Status::UNSETTLED) {
            self.note_unsettled(index, tick);
        }
        if found.is_something() {
            self.act_on(index, &found, tick)?;
        }
        Ok(())
    }

    /// Equilibrium at this step, x and v of the next, and the commands that follow from them.
    /// An offline method that finds no equilibrium ends the test after the row of this step.
    #[inline]
    fn advance_to_next(&mut self, tick: &Tick) -> Result<(), Stop> {
        match &mut self.side {
            Side::Structure(numerical) => {
                let dt = if tick.step == 0 { 0.0 } else { self.dt };
                numerical.close(tick.step, dt, &mut self.ports);
                numerical.advance(tick.step).map_err(Stop::Step)?;
                let base = numerical.base(tick.step + 1);
                let state = &numerical.state;
                for port in &mut self.ports {
                    port.seek(&state.disp, &state.vel, base.disp, base.vel);
                }
            }
            Side::Prescribed(histories) => {
                seek_along(histories, tick.index() + 1, &mut self.ports);
            }
        }
        self.know_the_next();
        Ok(())
    }

    /// The command of this tick is accepted: specimens commit. The command that stands ready has not left yet.
    #[inline]
    pub(super) fn accept(&mut self) -> Result<(), Stop> {
        let riding = self.riding;
        self.accept_if(|port| !(riding && port.is_per_step()))
    }

    /// The step is accepted: those that are commanded once a step commit, too. Real-time: yes.
    #[inline]
    fn accept_step(&mut self) -> Result<(), Stop> {
        self.accept_if(|_| true)
    }

    #[inline]
    fn accept_if(&mut self, commits: impl Fn(&Port) -> bool) -> Result<(), Stop> {
        for (index, port) in self.ports.iter_mut().enumerate() {
            if port.may_be_commanded() && commits(port) {
                port.accepted(self.sequence)
                    .map_err(|fault| Stop::Link { port: index, fault })?;
            }
        }
        self.sequence += 1;
        Ok(())
    }

    /// Row to the recorder; a lost row is an event and a count, never a wait.
    #[inline]
    fn hand_over(&mut self, tick: &Tick) {
        self.held_back.clear();
        if !self.keep_row() {
            self.report(tick, Event::RowLost);
        }
        self.steps_done = tick.step;
    }

    /// The displacement of a step whose target was reached: what was only aimed at never was. Real-time: yes.
    #[inline]
    pub(super) fn note_reached(&mut self) {
        if let Side::Structure(numerical) = &self.side {
            self.peaks.note_disp(&numerical.state.disp);
        }
    }

    /// Peaks over all DOFs, and the last look at the state before its command leaves; after the last step none does.
    #[inline]
    fn note_peaks(&mut self, tick: &Tick, stamps: &TickStamps) -> Result<(), Stop> {
        if let Side::Structure(numerical) = &self.side {
            self.peaks
                .note_rates(&numerical.reported_vel, &numerical.accel);
        }
        if tick.step >= self.steps {
            return Ok(());
        }
        if let Side::Structure(numerical) = &self.side {
            let bound = self.limits.divergence;
            if let Some((dof, value)) = first_beyond(&numerical.state.disp, bound) {
                self.record_divergence(tick, stamps);
                return Err(Stop::Diverged { dof, value, bound });
            }
        }
        // A command that cannot be sent says more than the audit that it spoils.
        self.clear_commands()?;
        self.judge_test(tick)
    }
}
