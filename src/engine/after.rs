//! The way out: hold, leave, and the last words.
//!
//! From the first command on every end goes through [`Engine::conclude`]. Before it, in an orderly end or a trip, each
//! specimen is moved to where the test file wants it left; after a panic nothing is moved any more. A specimen whose link is
//! lost or whose interlock is open is not commanded: its own watchdog holds it.

use super::columns::GIVEN_UP;
use super::operator::Control;
use super::phase::{Cause, Phase};
use super::tick::Tick;
use super::{Ending, Engine, Stop};
use crate::control::Departure;
use crate::control::limits::Quantity;
use crate::rt::timing::TickStamps;

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

    /// Moves every specimen to where it is to be left. What stops it on the way freezes all.
    pub(super) fn leave(&mut self, ending: &Ending, control: &Control) {
        let tripped = !matches!(
            ending,
            Ending::Completed | Ending::Stopped(Stop::Operator | Stop::Step(_))
        );
        if tripped {
            self.enter(Phase::Tripped, Cause::Stopped);
        }
        if let Ending::Stopped(Stop::Link { port, .. } | Stop::Interlock { port }) = ending
            && let Some(port) = self.ports.get_mut(*port)
        {
            port.partner.lost = true;
        }
        // A displacement that tripped as a command was never gone to: the way out has no excuse to go there.
        if let Ending::Stopped(Stop::Limit { port, hit }) = ending
            && hit.quantity != Quantity::CommandDisp
            && let Some(port) = self.ports.get_mut(*port)
        {
            port.excuse(hit);
        }
        let period = self.period.value();
        let sequence = self.sequence;
        let mut departures: Vec<Option<Departure>> = self
            .ports
            .iter_mut()
            .map(|port| {
                if port.partner.lost || !port.has_begun() {
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
        if departures.iter().all(Option::is_none) {
            return;
        }
        if tripped && !self.trip_is_recorded {
            self.record_end(ending);
        }
        let cause = if tripped { Cause::Stopped } else { Cause::Done };
        self.enter(Phase::Leaving, cause);
        // Whatever ends it, the specimens stand at their last commands.
        let _ = self.all_departures(&mut departures, control);
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
