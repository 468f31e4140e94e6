//! The way out: hold, leave, and the last words.
//!
//! From the first command on every end goes through [`Engine::conclude`]. Before it, in an orderly end or a trip, each
//! specimen is moved to where the test file wants it left; after a panic nothing is moved any more. A specimen whose link is
//! lost or whose interlock is open is not commanded: its own watchdog holds it. Until it is known which way round the
//! specimens are wired, where their zeros are and that they stand where they should, none is moved: their exits would be
//! anywhere. What stops the way out stops it for all, and is part of how the test ended: a test that trips there has
//! tripped.

use super::columns::GIVEN_UP;
use super::operator::Control;
use super::phase::{Cause, Phase};
use super::tick::Tick;
use super::{Ending, Engine, Stop};
use crate::control::limits::Quantity;
use crate::control::{Departure, Port};
use crate::rt::timing::TickStamps;
use crate::substructure::LinkFault;
use crate::time::Nanos;

/// Where a specimen was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Left {
    /// At its last command: nothing else is asked for, or too little was known of it to move it.
    Stayed,
    /// Where the test file wants it.
    Reached,
    /// Somewhere else, although the test file wants it moved.
    NotReached,
    /// Its link is lost: wherever its own watchdog holds it.
    Lost,
}

impl Left {
    /// As the files spell it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Left::Stayed => "stayed",
            Left::Reached => "reached",
            Left::NotReached => "not_reached",
            Left::Lost => "lost",
        }
    }
}

/// A way out that did not come to its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unfinished {
    /// What stopped it.
    pub stop: Stop,
    /// How the test had ended before.
    pub after: Ending,
}

/// True of a partner that is to be led away and owes an answer of the test.
fn is_waited_for(port: &Port, tripped: bool) -> bool {
    !port.partner.lost && port.partner.owes_the_last && port.exits.moves(tripped)
}

impl Engine {
    /// Test time stands still, the specimens hold the last command, until the operator goes on. A hold ends no step: the
    /// next tick follows as if there had been none.
    pub(super) fn stand(&mut self, after: &Tick, control: &Control) -> Result<(), Stop> {
        self.enter(Phase::Holding, Cause::Operator);
        for (index, port) in self.ports.iter_mut().enumerate() {
            port.pause()
                .map_err(|fault| Stop::Link { port: index, fault })?;
        }
        let mut tick = Tick {
            step: self.steps_done,
            dt: 0.0,
            ..*after
        };
        while self.hold_wanted {
            tick.sub_tick += 1;
            let mut stamps = TickStamps::default();
            self.wait_before_start(&mut stamps, control)?;
            self.exchange_again(&tick, &mut stamps)?;
            self.row
                .between(&tick, Phase::Holding.code(), &self.side, &self.ports);
            self.row
                .timing(&stamps, self.first_edge, self.schedule.stretched());
            if !self.recorder.row(self.row.values()) {
                self.rows_lost += 1;
            }
            self.skip_numbers();
        }
        self.ride.sub_tick = tick.sub_tick;
        self.prepare_next();
        self.clear_commands()?;
        self.enter(Phase::Running, Cause::Operator);
        Ok(())
    }

    /// Moves every specimen to where it is to be left. What stops it on the way freezes all, and ends a test that had ended
    /// well: how it ended is what comes back.
    pub(super) fn leave(&mut self, ending: Ending, control: &Control) -> Ending {
        if let Ending::Stopped(stop) = &ending {
            self.report_stop(stop);
        }
        let Err(stop) = self.lead_out(&ending, control) else {
            return ending;
        };
        self.report_stop(&stop);
        self.unfinished = Some(Unfinished {
            stop,
            after: ending,
        });
        if stop != Stop::Operator {
            self.enter(Phase::Tripped, Cause::Stopped);
        }
        match ending {
            Ending::Completed | Ending::Stopped(Stop::Operator) => Ending::Stopped(stop),
            Ending::Stopped(_) => ending,
        }
    }

    fn lead_out(&mut self, ending: &Ending, control: &Control) -> Result<(), Stop> {
        let tripped = !matches!(
            ending,
            Ending::Completed | Ending::Stopped(Stop::Operator | Stop::Step(_))
        );
        let is_known = !matches!(
            self.phase,
            Phase::Connected | Phase::Probing | Phase::Zeroing
        ) && !matches!(
            ending,
            Ending::Stopped(Stop::Misfit { .. } | Stop::Moved { .. })
        );
        self.operator_stopped = matches!(ending, Ending::Stopped(Stop::Operator));
        if tripped {
            self.enter(Phase::Tripped, Cause::Stopped);
        }
        if let Ending::Stopped(stop) = ending {
            self.bear_in_mind(stop);
        }
        for port in &mut self.ports {
            port.end_test();
            port.partner.owes_the_last = port.owes();
        }
        let can_be_led = |port: &Port| is_known && port.has_begun() && port.is_heard();
        let led: Vec<bool> = self.ports.iter().map(can_be_led).collect();
        let mut departures = self.departures(tripped, &led);
        self.keep_warm_up();
        for (left, (port, departure)) in
            self.left.iter_mut().zip(self.ports.iter().zip(&departures))
        {
            let is_led = is_known && port.has_begun() && port.exits.moves(tripped);
            *left = if departure.is_some() || is_led {
                Left::NotReached
            } else if port.partner.gone {
                Left::Lost
            } else {
                Left::Stayed
            };
        }
        let follows = |port: &Port| is_known && port.has_begun() && is_waited_for(port, tripped);
        let follow: Vec<bool> = self.ports.iter().map(follows).collect();
        if departures.iter().all(Option::is_none) && !follow.contains(&true) {
            return Ok(());
        }
        if tripped && !self.trip_is_recorded {
            self.record_end(ending);
        }
        let cause = match ending {
            _ if tripped => Cause::Stopped,
            Ending::Stopped(Stop::Operator) => Cause::Operator,
            _ => Cause::Done,
        };
        self.enter(Phase::Leaving, cause);
        // Whatever ends it, the specimens stand at their last commands.
        self.all_departures(&mut departures, control)?;
        // Who owed an answer kept nobody else where they were.
        let lost = self.hear_who_owes(&follow, control)?;
        let mut departures = self.departures(tripped, &follow);
        self.all_departures(&mut departures, control)?;
        lost.map_or(Ok(()), Err)
    }

    /// The ways of those that are `led` away, as far as they can be told so now.
    fn departures(&mut self, tripped: bool, led: &[bool]) -> Vec<Option<Departure>> {
        let (period, sequence) = (self.period.value(), self.sequence);
        let each = self.ports.iter_mut().zip(led).map(|(port, led)| {
            if !led || !port.is_heard() {
                return None;
            }
            let departure = port.depart(tripped, period);
            // A specimen that stays where it is hears nothing more but the last words.
            if departure.is_some() {
                port.leave_number(sequence);
            }
            departure
        });
        each.collect()
    }

    /// What stopped the test is known on the way out: who is not commanded any more, and what may be as bad as it is. Real-time:
    /// yes.
    pub(super) fn bear_in_mind(&mut self, stop: &Stop) {
        match stop {
            Stop::Link { port, .. } | Stop::Interlock { port } => {
                if let Some(port) = self.ports.get_mut(*port) {
                    port.partner.lost = true;
                    port.partner.gone |= matches!(stop, Stop::Link { .. });
                }
            }
            // A displacement that tripped as a command was never gone to: the way out has no excuse to go there.
            Stop::Limit { port, hit } if hit.quantity != Quantity::CommandDisp => {
                if let Some(port) = self.ports.get_mut(*port) {
                    port.excuse(hit);
                }
            }
            _ => {}
        }
    }

    /// Whoever was told its target some ticks ago and is to be led away has answered before it is told anything else. Its
    /// patience began when it was asked. Returns the first that did not answer.
    fn hear_who_owes(&mut self, who: &[bool], control: &Control) -> Result<Option<Stop>, Stop> {
        let mut first = None;
        let owe = who.iter().enumerate().filter(|(_, owes)| **owes);
        for (index, _) in owe {
            let now = self.clock.now();
            let Some(port) = self.ports.get_mut(index) else {
                break;
            };
            let patience = port.patience_ns(self.limits.reply_timeout_ns);
            let until = port.partner.asked_at.unwrap_or(now).plus(patience);
            let in_time = self.await_answer(index, until, control)?;
            let Some(port) = self.ports.get_mut(index) else {
                break;
            };
            let answer = if in_time {
                port.let_answer(until)
            } else {
                Err(LinkFault::Timeout)
            };
            match answer {
                Ok(()) => port.partner.owes_the_last = false,
                Err(fault) => {
                    port.note_loss();
                    let stop = Stop::Link { port: index, fault };
                    self.report_stop(&stop);
                    self.bear_in_mind(&stop);
                    first = first.or(Some(stop));
                }
            }
        }
        Ok(first)
    }

    /// Until this partner has answered, or its link has failed: the operator is heard meanwhile, and the others hear that somebody
    /// is there. False if it is too late.
    fn await_answer(
        &mut self,
        index: usize,
        until: Nanos,
        control: &Control,
    ) -> Result<bool, Stop> {
        if self.clock.is_simulated() || self.ports.get(index).is_none_or(Port::is_recorded) {
            return Ok(true);
        }
        loop {
            match self.ports.get_mut(index).map(Port::is_answered) {
                Some(Ok(false)) if self.clock.now() >= until => return Ok(false),
                Some(Ok(false)) => {}
                _ => return Ok(true),
            }
            self.hear(control)?;
            for port in &mut self.ports {
                if !port.partner.lost && !port.owes() {
                    // A link that is lost shows at the next command.
                    let _ = port.attend();
                }
            }
            let next = self.clock.now().plus(self.schedule.period_ns());
            self.clock.sleep_until(next);
        }
    }

    /// What ended the test in no row of its own stands in one, if rows of the way out follow: a replay ends there, too.
    fn record_end(&mut self, ending: &Ending) {
        if let Ending::Stopped(Stop::Link { port, .. }) = ending
            && let Some(port) = self.ports.get_mut(*port)
        {
            port.note_loss();
        }
        let step = self.steps_done;
        let tick = Tick {
            step,
            sub_tick: 0,
            time: step as f64 * self.dt,
            dt: 0.0,
        };
        let state = if ending.is_for_being_late() {
            // What the operator said before the tick that was late stands in its own row.
            self.row.word.goes_on = false;
            GIVEN_UP
        } else {
            Phase::Tripped.code()
        };
        self.row.between(&tick, state, &self.side, &self.ports);
        self.row.no_outputs();
        let stamps = TickStamps::default();
        self.row
            .timing(&stamps, self.first_edge, self.schedule.stretched());
        if !self.recorder.row(self.row.values()) {
            self.rows_lost += 1;
        }
    }

    fn all_departures(
        &mut self,
        departures: &mut [Option<Departure>],
        control: &Control,
    ) -> Result<(), Stop> {
        self.hold_wanted = false;
        loop {
            let mut moving = false;
            for (port, departure) in self.ports.iter_mut().zip(departures.iter_mut()) {
                match departure {
                    Some(departure) => moving |= port.go_on(departure),
                    None => port.stand_still(),
                }
            }
            for (left, departure) in self.left.iter_mut().zip(departures.iter()) {
                if departure.as_ref().is_some_and(Departure::has_arrived) {
                    *left = Left::Reached;
                }
            }
            if !moving {
                return Ok(());
            }
            self.clear_commands()?;
            let step = self.steps_done;
            let tick = Tick {
                step,
                sub_tick: 0,
                time: step as f64 * self.dt,
                dt: self.tick_passes(),
            };
            let mut stamps = TickStamps::default();
            self.wait_before_start(&mut stamps, control)?;
            self.exchange(&tick, &mut stamps)?;
            self.row_before_start(&tick, Phase::Leaving, &stamps);
            self.accept()?;
        }
    }
}
