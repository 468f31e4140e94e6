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

/// Where a specimen was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Left {
    /// At its last command: nothing else is asked for, or too little was known of it to move it.
    Stayed,
    /// Where the test file wants it.
    Reached,
    /// Somewhere else, although the test file wants it moved.
    NotReached,
}

impl Left {
    /// As the files spell it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Left::Stayed => "stayed",
            Left::Reached => "reached",
            Left::NotReached => "not_reached",
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

impl Engine {
    /// Test time stands still, the specimens hold the last command, until the operator goes on. A hold ends no step: the
    /// next tick follows as if there had been none.
    pub(super) fn stand(&mut self, after: &Tick, control: &Control) -> Result<(), Stop> {
        self.enter(Phase::Holding, Cause::Operator);
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
        self.ports.iter_mut().for_each(Port::end_test);
        if is_known {
            self.hear_who_owes(tripped);
        }
        let period = self.period.value();
        let sequence = self.sequence;
        let mut departures: Vec<Option<Departure>> = self
            .ports
            .iter_mut()
            .map(|port| {
                if port.partner.lost || !port.has_begun() || !is_known {
                    None
                } else {
                    let departure = port.depart(tripped, period);
                    // A specimen that stays where it is hears nothing more but the last words.
                    if departure.is_some() {
                        port.leave_number(sequence);
                    }
                    departure
                }
            })
            .collect();
        self.keep_warm_up();
        for (left, (port, departure)) in
            self.left.iter_mut().zip(self.ports.iter().zip(&departures))
        {
            let is_led = is_known && port.has_begun() && port.exits.moves(tripped);
            let stays = departure.is_none() && !is_led;
            *left = if stays {
                Left::Stayed
            } else {
                Left::NotReached
            };
        }
        if departures.iter().all(Option::is_none) {
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
        for (left, departure) in self.left.iter_mut().zip(&departures) {
            if departure.as_ref().is_some_and(Departure::has_arrived) {
                *left = Left::Reached;
            }
        }
        Ok(())
    }

    /// What stopped the test is known on the way out: who is not commanded any more, and what may be as bad as it is. Real-time:
    /// yes.
    pub(super) fn bear_in_mind(&mut self, stop: &Stop) {
        match stop {
            Stop::Link { port, .. } | Stop::Interlock { port } => {
                if let Some(port) = self.ports.get_mut(*port) {
                    port.partner.lost = true;
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

    /// Whoever was told its target some ticks ago and is to be led away has answered before it is told anything else.
    fn hear_who_owes(&mut self, tripped: bool) {
        for index in 0..self.ports.len() {
            let Some(port) = self.ports.get_mut(index) else {
                break;
            };
            if port.partner.lost || !port.owes() || !port.exits.moves(tripped) {
                continue;
            }
            let patience = port.patience_ns(self.limits.reply_timeout_ns);
            if let Err(fault) = port.let_answer(self.clock.now().plus(patience)) {
                port.note_loss();
                let stop = Stop::Link { port: index, fault };
                self.report_stop(&stop);
                self.bear_in_mind(&stop);
            }
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
