//! One exchange with all specimens: commands leave, measurements come in and are judged.
//!
//! Commands are issued to all before any reply is collected, so that several links cost one round trip. What stops the test does
//! not stop the exchange: a reply that is owed is still collected, or its specimen could not be commanded during the shutdown.
//! The first stop counts. Everything here is on the real-time path.

use super::commanding::{Commanding, Recordings};
use super::cycle::Engine;
use super::numerical::{Side, aim_along};
use super::order::{Kind, Order, Sends};
use super::phase::Phase;
use super::stop::port_at;
use super::test_judge::limit_event;
use super::tick::Tick;
use super::{Limits, Stop};
use crate::port::limits::{Found, Hit, Level};
use crate::port::{LoadingUnit, OnStale, Port};
use gusset_quantity::catalog::event::Remark;
use gusset_quantity::catalog::phase::NOT_AWAITED;
use gusset_quantity::substructure::{Coupling, Freshness, Holder, LISTEN_NS, LinkFault, Status};
use gusset_quantity::time::Nanos;
use gusset_record::rt::timing::TickStamps;
use gusset_record::{Event, LimitReached};

/// Sends the target to a specimen that is commanded once a step, once the target is known. In a hold (`holds`) nothing moves: it
/// is sent afterwards. Real-time: yes.
fn send_target(
    port: &mut Port,
    sequence: u64,
    step: u64,
    dt: f64,
    holds: bool,
) -> Result<(), LinkFault> {
    if port.exchange().state().is_pending() && !holds {
        let passed = if step == 0 { 0.0 } else { dt };
        return port.tell_target(sequence, step as f64 * dt, passed);
    }
    port.exchange_mut().skip_command();
    Ok(())
}

/// False if the reply of a specimen that is commanded once a step is not here, or not owed. Real-time: yes.
fn has_reply(
    port: &mut Port,
    now: Nanos,
    patience_ns: u64,
    simulated: bool,
) -> Result<bool, LinkFault> {
    if !port.exchange().state().owes() {
        port.exchange_mut().attend()?;
        return Ok(false);
    }
    // A socket lives in wall time: under the simulated clock it is waited for.
    if (simulated && port.exchange().is_remote()) || port.exchange_mut().is_answered(0)? {
        return Ok(true);
    }
    let asked_at = port.exchange_mut().state_mut().look_for_answer(now);
    if now.since(asked_at) > patience_ns {
        return Err(LinkFault::Timeout);
    }
    Ok(false)
}

/// The stop that the specimen itself reports.
fn reported_stop(port: usize, status: Status) -> Option<Stop> {
    if status.has(Status::INTERLOCK) {
        Some(Stop::Interlock { port })
    } else if status.has(Status::SATURATED) {
        Some(Stop::Saturated { port })
    } else {
        None
    }
}

/// The use of stale data of a specimen, and how many in a row are accepted. Real-time: yes.
fn stale_rules(port: &Port, limits: &Limits) -> (OnStale, u64) {
    match port.exchange().wait() {
        Some(own) => (own.on_stale, own.stale_in_a_row),
        None if limits.extrapolate_stale => (OnStale::Extrapolate, limits.stale_in_a_row),
        None => (OnStale::Hold, limits.stale_in_a_row),
    }
}

impl Engine<'_> {
    /// The exchange of a tick: commands out, measurements in and judged. Real-time: yes.
    ///
    /// # Errors
    /// The first stop. The row of the tick is kept, unless the link is lost.
    #[inline]
    pub(crate) fn exchange(&mut self, order: &Order, stamps: &mut TickStamps) -> Result<(), Stop> {
        let tick = &order.tick;
        self.environment.place.exchanged(tick);
        self.environment.journal.command_left();
        self.ports
            .iter_mut()
            .for_each(|port| port.guard_mut().begin_tick());
        let issued = self.issue(order);
        stamps.sent = self.environment.pace.read();
        stamps.decoded = stamps.sent;
        if order.kind == Kind::Test {
            self.work_while_they_move();
        }
        let result = self.collect_all(tick, stamps, issued);
        if self.exchanges.commanding == Commanding::EveryStep {
            self.ports
                .iter_mut()
                .for_each(|port| port.feedback_mut().note_peak());
        } else if self.environment.supervision.phase().is_on_the_way_in() {
            let ports = self.ports.iter_mut();
            ports.for_each(|port| port.feedback_mut().note_peak_at_startup());
        }
        if let Side::Received(received) = &mut *self.side {
            // Its server judges the answer, too, before it has the row recorded.
            if result.is_err() {
                stamps.decoded = self.environment.pace.read();
            }
            received.stamp(stamps);
        } else if let Err(stop) = &result {
            self.record_trip(tick, stamps, stop);
        }
        result
    }

    /// Work on the next closed step that needs no measured force; the last tick of a step does the rest of it. Real-time: yes.
    #[inline]
    fn work_while_they_move(&mut self) {
        let Side::Structure(numerical) = &mut *self.side else {
            return;
        };
        let step = self.progress.step();
        let dt = if step == 0 { 0.0 } else { self.plan.dt };
        let budget = if self.progress.has_reached() || self.progress.stride().lands() {
            usize::MAX
        } else {
            let ticks = self.progress.pacer().ticks_per_step();
            let most = numerical.most_evaluations() * numerical.structure.members().count();
            (most as f64 / ticks) as usize + 1
        };
        numerical.work_ahead(step, dt, budget);
    }

    #[inline]
    fn issue(&mut self, order: &Order) -> Result<(), Stop> {
        let (tick, steps) = (&order.tick, self.plan.steps);
        let held = self.environment.supervision.is_held();
        let may_stand = held || !self.progress.is_at_the_end(steps);
        let holds = may_stand && self.progress.pacer().stands() && tick.sub_tick > 0;
        let sequence = self.exchanges.sequence();
        let (step, dt) = (self.progress.step(), self.plan.dt);
        for (index, port) in self.ports.iter_mut().enumerate() {
            if port.exchange().state().owes_the_last() {
                port.exchange_mut().skip_command();
            } else if !port.exchange().state().is_lost() {
                let left = if self.exchanges.is_by_steps(port) {
                    send_target(port, sequence, step, dt, holds)
                } else {
                    match order.sends {
                        Sends::Next => port.issue(sequence, tick.time, tick.dt),
                        Sends::Last => port.repeat(sequence, tick.time),
                    }
                };
                left.map_err(|fault| Stop::Link { port: index, fault })?;
                if let Side::Received(received) = &mut *self.side {
                    received.left(port.path().sent());
                }
            }
        }
        Ok(())
    }

    /// Collects and judges what every specimen replies. Only the operator's stop ends a wait, and with it all of them.
    #[inline]
    fn collect_all(
        &mut self,
        tick: &Tick,
        stamps: &mut TickStamps,
        mut result: Result<(), Stop>,
    ) -> Result<(), Stop> {
        let mut waits = true;
        for index in 0..self.ports.len() {
            let is_asked = |port: &Port| {
                port.exchange().state().may_be_commanded()
                    && (result.is_ok() || port.exchange().state().owes())
            };
            if !self.ports.get(index).is_none_or(is_asked) {
                continue;
            }
            if let Err(stop) = self.collect_from(index, tick, stamps, waits) {
                let was_heard = !waits && stop == Stop::Operator;
                waits &= stop != Stop::Operator;
                if result.is_ok() {
                    result = Err(stop);
                } else if !was_heard {
                    self.stops_too(&stop);
                }
            }
        }
        result
    }

    /// A second specimen ends a test that ends already: it is reported, and the shutdown knows of it. Real-time: yes.
    #[cold]
    pub(crate) fn stops_too(&mut self, stop: &Stop) {
        // A limit that trips was reported where it was judged.
        self.environment.report_stop(stop);
        self.exclude(stop);
        if let Stop::Link { port, .. } = stop
            && let Some(port) = self.ports.get_mut(*port)
        {
            port.feedback_mut().note_loss();
        }
    }

    /// The specimen of a stop is not commanded during the shutdown: it may not follow, or its force may be wrong. Real-time: yes.
    pub(crate) fn exclude(&mut self, stop: &Stop) {
        match stop {
            Stop::Link { port, .. }
            | Stop::Interlock { port }
            | Stop::Saturated { port }
            | Stop::HoldsOn { port, .. }
            | Stop::Stale { port, .. } => {
                if let Some(port) = self.ports.get_mut(*port) {
                    port.lose(matches!(stop, Stop::Link { .. }));
                }
            }
            _ => {}
        }
    }

    /// Collects and judges the reply of one specimen, if it is here. It is waited for only if the exchange `waits`, and if the
    /// specimen does not take several ticks for it. Real-time: yes.
    #[inline]
    pub(crate) fn collect_from(
        &mut self,
        index: usize,
        tick: &Tick,
        stamps: &mut TickStamps,
        waits: bool,
    ) -> Result<(), Stop> {
        let known = port_at(self.ports, index)?.feedback().raw().sequence;
        let result = self.take_from(index, tick, stamps, waits);
        if port_at(self.ports, index)?.feedback().raw().sequence > known + 1 {
            self.report_recovered(index, tick)?;
        }
        result
    }

    #[inline]
    fn take_from(
        &mut self,
        index: usize,
        tick: &Tick,
        stamps: &mut TickStamps,
        waits: bool,
    ) -> Result<(), Stop> {
        let port = port_at(self.ports, index)?;
        let broken = |fault| Stop::Link { port: index, fault };
        let pace = &self.environment.pace;
        let patience = port
            .exchange()
            .patience_ns(self.plan.limits.reply_timeout_ns);
        if self.exchanges.is_by_steps(port) || port.exchange().state().owes_the_last() {
            let reply = has_reply(port, stamps.sent, patience, pace.is_simulated());
            if !reply.map_err(broken)? {
                return Ok(());
            }
        }
        self.wait_for(index, waits)?;
        let port = port_at(self.ports, index)?;
        let pace = &self.environment.pace;
        // A lockstep specimen was waited for, a sampled one has until its share of the tick is over.
        let deadline = match port.exchange().coupling() {
            Coupling::Lockstep => stamps.sent.plus(patience),
            // Commands that are received come at any time.
            Coupling::Sampled if self.side.is_received() => stamps.sent.plus(patience),
            // The edge was counted when the tick began: this is the one that ends it.
            Coupling::Sampled => pace.next_edge().minus(pace.period_ns() / 8),
        };
        // A slow specimen may have been asked some ticks ago.
        let asked_at = port.exchange().state().asked_at().unwrap_or(stamps.sent);
        let freshness = port.collect(deadline).map_err(broken)?;
        stamps.decoded = pace.read();
        if self.exchanges.recordings == Recordings::AreSilent && port.exchange().is_recording() {
            return Ok(());
        }
        let round_trip_ns = stamps.decoded.since(asked_at);
        self.environment.deadlines.round_trip(index, round_trip_ns);
        self.judge_reply(index, freshness, tick)
    }

    #[inline]
    fn judge_reply(&mut self, index: usize, freshness: Freshness, tick: &Tick) -> Result<(), Stop> {
        if self.side.is_received() {
            return self.judge_received(index, freshness, tick);
        }
        let port = port_at(self.ports, index)?;
        let (status, was_holding) = (
            port.feedback().raw().status,
            port.exchange().holding_in_a_row() > 0,
        );
        if let Some(stop) = reported_stop(index, status) {
            if freshness == Freshness::Fresh {
                // Limits that its reply passes are reported, too: a resumed test needs them. The stop that it reports counts.
                let found = port.judge();
                let _ = self.act_on(index, &found, tick);
            }
            return Err(stop);
        }
        if status.has(Status::HOLDING) || was_holding {
            self.judge_holding(index, freshness, tick)?;
        }
        if freshness == Freshness::Stale {
            return self.judge_age(index, tick);
        }
        self.judge_fresh(index, status, tick)
    }

    /// Judges a fresh measurement by the limits of its specimen. Real-time: yes.
    #[inline]
    fn judge_fresh(&mut self, index: usize, status: Status, tick: &Tick) -> Result<(), Stop> {
        let port = port_at(self.ports, index)?;
        port.exchange_mut().forget_stale();
        let found = port.judge();
        if status.has(Status::UNSETTLED) {
            self.count_unsettled(index, tick)?;
        }
        if found.is_something() {
            self.act_on(index, &found, tick)?;
        }
        Ok(())
    }

    /// Judges the reply to a received command: the limits of the specimen come first, and then what it reports. Real-time: yes.
    fn judge_received(
        &mut self,
        index: usize,
        freshness: Freshness,
        tick: &Tick,
    ) -> Result<(), Stop> {
        if freshness == Freshness::Stale {
            return self.judge_age(index, tick);
        }
        let port = port_at(self.ports, index)?;
        let status = port.feedback().raw().status;
        let was_holding = port.exchange().holding_in_a_row() > 0;
        self.judge_fresh(index, status, tick)?;
        if status.has(Status::SATURATED) {
            return Err(Stop::Saturated { port: index });
        }
        if status.has(Status::INTERLOCK) {
            return Err(Stop::Interlock { port: index });
        }
        if status.has(Status::HOLDING) || was_holding {
            self.judge_holding(index, freshness, tick)?;
        }
        Ok(())
    }

    /// Waits for the reply that a lockstep specimen owes. A stop of the operator ends the wait. The time limit of the specimen is
    /// judged when its reply is taken. Real-time: yes.
    #[inline]
    fn wait_for(&mut self, index: usize, waits: bool) -> Result<(), Stop> {
        let is_received = self.side.is_received();
        let port = port_at(self.ports, index)?;
        if !(port.exchange().is_awaited() || is_received && port.exchange().is_remote()) {
            return Ok(());
        }
        let (wait_ns, parts) = if waits || port.exchange().is_recording() {
            let patience = port
                .exchange()
                .patience_ns(self.plan.limits.reply_timeout_ns);
            (LISTEN_NS, patience.div_ceil(LISTEN_NS))
        } else {
            (0, 1)
        };
        let supervision = &mut self.environment.supervision;
        for _ in 0..parts {
            let answered = port.exchange_mut().is_answered(wait_ns);
            if answered.map_err(|fault| Stop::Link { port: index, fault })? {
                return Ok(());
            }
            if let Some(client) = &mut self.client {
                supervision.hear_client(client);
            }
            // A recording replies unless the operator did not wait.
            if port.exchange().is_recording() || !waits || supervision.takes_a_stop_in_wait() {
                port.feedback_mut().leave_owing();
                return Err(Stop::Operator);
            }
        }
        Ok(())
    }

    /// Judges the next command of every specimen: a trip beside the first is reported, too. Only judged commands may leave.
    /// Real-time: yes.
    ///
    /// # Errors
    /// The first trip.
    pub(crate) fn judge_commands(&mut self) -> Result<(), Stop> {
        let mut result = Ok(());
        for index in 0..self.ports.len() {
            if let Err(stop) = self.judge_command(index) {
                if result.is_ok() {
                    result = Err(stop);
                } else {
                    self.stops_too(&stop);
                }
            }
        }
        result
    }

    #[inline]
    fn judge_command(&mut self, index: usize) -> Result<(), Stop> {
        let port = port_at(self.ports, index)?;
        if self.exchanges.is_by_steps(port) && !port.exchange().state().is_pending() {
            return Ok(());
        }
        let found = port.clear();
        if let Some(fault) = port.loading_unit().and_then(LoadingUnit::fault) {
            return Err(Stop::Geometry { port: index, fault });
        }
        if found.is_something() {
            let tick = self.environment.place.of_event();
            self.act_on(index, &found, &tick)?;
        }
        Ok(())
    }

    /// Reports all warnings and trips of a specimen; a trip ends the test. Real-time: yes.
    #[cold]
    fn act_on(&mut self, index: usize, found: &Found, tick: &Tick) -> Result<(), Stop> {
        let first = found.trip.filter(|_| !self.side.is_received());
        for hit in found.warning.iter().chain(&first) {
            self.report_hit(index, hit, tick);
        }
        while let Some(hit) = port_at(self.ports, index)?.guard_mut().next_untold() {
            self.report_hit(index, &hit, tick);
        }
        match found.trip {
            None => Ok(()),
            Some(hit) if hit.value.is_finite() => Err(Stop::Limit { port: index, hit }),
            Some(_) => Err(Stop::NotFinite { port: index }),
        }
    }

    fn report_hit(&mut self, index: usize, hit: &Hit, tick: &Tick) {
        if let Side::Received(received) = &*self.side {
            let step = received.counts.exchanges;
            let tick = Tick {
                step,
                ..received.place
            };
            // The server reports the trip that ends the test.
            let what = match hit.level {
                Level::Warning => "a warning",
                Level::Trip => "it trips, too",
            };
            let text = format!("{hit} ({}): {what}", hit.quantity.key());
            return self
                .environment
                .report(&tick, Event::said(Remark::Limit, text));
        }
        let reached = LimitReached {
            port: Some(index as u32),
            axis: Some(hit.axis as u32),
            limit: hit.quantity.key().into(),
            value: hit.value,
            bound: hit.bound,
        };
        let event = limit_event(hit.level == Level::Trip, reached);
        self.environment.report(tick, event);
    }

    /// Stale data are used as the policy says, a bounded number of times in a row. The test cannot use data that were never
    /// measured. Real-time: yes.
    #[cold]
    fn judge_age(&mut self, index: usize, tick: &Tick) -> Result<(), Stop> {
        let port = port_at(self.ports, index)?;
        let ticks = port.exchange_mut().count_stale();
        // While it stands, numbers stand, too: there the age is the count of exchanges without a measurement.
        let sequence = self.exchanges.sequence();
        let age = sequence.saturating_sub(port.feedback().raw().sequence);
        let age = age.max(ticks);
        let (on_stale, in_a_row) = stale_rules(port, &self.plan.limits);
        if on_stale == OnStale::Extrapolate {
            port.extrapolate();
        }
        let in_test = self.exchanges.commanding == Commanding::EveryStep;
        let is_made_up = in_test && !port.exchange().has_answered();
        let port = index as u32;
        self.environment.report(tick, Event::Stale { port, age });
        if on_stale == OnStale::Stop || ticks > in_a_row || is_made_up {
            return Err(Stop::Stale { port: index, ticks });
        }
        Ok(())
    }

    /// A specimen reports that it is held at its own end: no command moves it then, and its replies belong to none. A target that it
    /// did not reach leaves once more. Each time is reported. More replies in a row than stale ones are accepted end the test. Real-time: yes.
    #[cold]
    fn judge_holding(
        &mut self,
        index: usize,
        freshness: Freshness,
        tick: &Tick,
    ) -> Result<(), Stop> {
        let port = port_at(self.ports, index)?;
        let hold = port.note_hold(freshness);
        let (_, in_a_row) = stale_rules(port, &self.plan.limits);
        if hold.begins && !self.side.is_received() {
            let port = index as u32;
            self.environment.report(tick, Event::SpecimenHolds { port });
        }
        let answers = hold.answers;
        if answers > in_a_row {
            let port = index;
            return Err(Stop::HoldsOn { port, answers });
        }
        // A fresh answer counts only while the specimen is held.
        let is_held = answers > 0 && freshness == Freshness::Fresh;
        if is_held && self.exchanges.is_by_steps(port) {
            port.take_back_target();
        }
        Ok(())
    }

    /// Reports replies that were lost and that a later reply repeats: the forces of their commands are recorded. Real-time: yes.
    #[cold]
    fn report_recovered(&mut self, index: usize, tick: &Tick) -> Result<(), Stop> {
        let port = port_at(self.ports, index)?;
        while let Some(sequence) = port.recover() {
            let age = self.exchanges.sequence().saturating_sub(sequence);
            for (axis, force) in (0..).zip(*port.feedback().recovered()) {
                let event = Event::Recovered {
                    port: index as u32,
                    axis,
                    age,
                    force: *force,
                };
                self.environment.report(tick, event);
            }
        }
        Ok(())
    }

    /// Counts an iteration of a simulated actuator that did not converge; reported more and more seldom. Real-time: yes.
    #[cold]
    fn count_unsettled(&mut self, index: usize, tick: &Tick) -> Result<(), Stop> {
        let port = port_at(self.ports, index)?;
        let ticks = port.exchange_mut().count_unsettled();
        if ticks.is_power_of_two() {
            let port = index as u32;
            self.environment
                .report(tick, Event::Unsettled { port, ticks });
        }
        Ok(())
    }

    /// Keeps the row of the tick that ends the test, or its shutdown, although nothing follows from it.
    #[cold]
    pub(crate) fn record_trip(&mut self, tick: &Tick, stamps: &TickStamps, stop: &Stop) {
        let in_wait = *stop == Stop::Operator;
        let has_row = matches!(
            stop,
            Stop::Limit { .. }
                | Stop::Interlock { .. }
                | Stop::Saturated { .. }
                | Stop::HoldsOn { .. }
                | Stop::Geometry { .. }
                | Stop::Stale { .. }
        );
        if !in_wait && !has_row {
            return;
        }
        let stopped = self.ends.is_operators(self.environment.supervision.phase());
        let journal = &mut self.environment.journal;
        journal.note_trip();
        journal.row.stopped = stopped;
        journal.row.cause = Some(stop.cause());
        journal.keep_warm_up();
        if in_wait {
            self.mark_stop_in_wait();
        }
        let in_test = self.exchanges.commanding == Commanding::EveryStep;
        let row = &mut self.environment.journal.row;
        if tick.step == self.progress.step() && !in_wait {
            // In the test it is the row of its step, as one that is closed is.
            let sub_tick = if in_test { 0 } else { tick.sub_tick };
            let tick = Tick { sub_tick, ..*tick };
            row.exchange(&tick, Phase::Tripped, self.side, self.ports);
            if in_test {
                self.note_reached();
            }
        } else {
            let state = if in_wait {
                NOT_AWAITED
            } else {
                Phase::Tripped.code()
            };
            row.between(tick, state, self.side, self.ports);
        }
        self.keep_last_row(stamps);
    }

    /// Platform poses of loading units, and the forces that act there. Real-time: yes.
    ///
    /// # Errors
    /// The actuators cannot have these strokes.
    #[inline]
    pub(crate) fn resolve_poses(&mut self) -> Result<(), Stop> {
        for (index, port) in self.ports.iter_mut().enumerate() {
            let found = port.resolve_pose();
            found.map_err(|fault| Stop::Geometry { port: index, fault })?;
        }
        Ok(())
    }

    /// The command of this tick is accepted. Specimens commit, but for those that are commanded once a step. Real-time: yes.
    ///
    /// # Errors
    /// A link is lost.
    #[inline]
    pub(crate) fn accept(&mut self) -> Result<(), Stop> {
        let exchanges = *self.exchanges;
        self.accept_if(|port| !exchanges.is_by_steps(port))
    }

    /// The step is accepted: all specimens commit. Real-time: yes.
    ///
    /// # Errors
    /// A link is lost.
    #[inline]
    pub(crate) fn accept_step(&mut self) -> Result<(), Stop> {
        self.accept_if(|_| true)
    }

    #[inline]
    fn accept_if(&mut self, commits: impl Fn(&Port) -> bool) -> Result<(), Stop> {
        let sequence = self.exchanges.sequence();
        for (index, port) in self.ports.iter_mut().enumerate() {
            if port.exchange().state().may_be_commanded() && commits(port) {
                port.accepted(sequence)
                    .map_err(|fault| Stop::Link { port: index, fault })?;
            }
        }
        self.exchanges.count();
        Ok(())
    }

    /// The exchange did not belong to the test: its number is used again. Real-time: yes.
    #[inline]
    pub(crate) fn reuse_number(&mut self) {
        self.ports
            .iter_mut()
            .for_each(|port| port.exchange_mut().skip_number());
    }

    /// Aims every specimen at the first target, `B·x[0]`.
    pub(crate) fn aim_at_start(&mut self) {
        match &mut *self.side {
            Side::Structure(numerical) => {
                let base = numerical.base(0);
                for port in &mut *self.ports {
                    let state = &numerical.state;
                    port.aim(&state.disp, &state.vel, base.disp, base.vel);
                }
                self.peaks.start(&numerical.state.disp);
            }
            Side::Prescribed(histories) => aim_along(histories, 0, self.ports),
            Side::Received(_) => {}
        }
    }

    /// Arms all specimens: all receive the request before the first wait, so that they get ready at the same time. A stop of the
    /// operator ends the wait.
    ///
    /// # Errors
    /// A specimen is not ready, or the operator ends the test.
    pub(crate) fn arm(&mut self) -> Result<(), Stop> {
        let sequence = self.exchanges.sequence();
        for (index, port) in self.ports.iter_mut().enumerate() {
            port.ask_to_arm(sequence)
                .map_err(|fault| Stop::Link { port: index, fault })?;
        }
        let supervision = &mut self.environment.supervision;
        let mut wanted = || !supervision.takes_a_stop();
        for (index, port) in self.ports.iter_mut().enumerate() {
            let is_armed = port.arm(sequence, &mut wanted);
            if !is_armed.map_err(|fault| Stop::Link { port: index, fault })? {
                let waited_for = self.ports.iter().enumerate().skip(index);
                let gets_ready =
                    waited_for.filter(|(_, port)| port.exchange().holder() == Holder::ItsWatchdog);
                self.ends.unarmed = gets_ready.map(|(index, _)| index).collect();
                return Err(Stop::Operator);
            }
        }
        Ok(())
    }
}
