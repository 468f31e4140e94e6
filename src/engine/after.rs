//! The way out: hold, leave, and the last words.
//!
//! From the first command on every end goes through [`Engine::conclude`]. Before it, in an orderly end or a trip, each
//! specimen is moved to where the test file wants it left; after a panic nothing is moved any more. A specimen whose
//! link is lost, whose measurements stayed away too long or say nothing, since a sensor of it is saturated, whose
//! interlock is open, or which its own watchdog holds is not commanded: its own end holds it, or nobody. One whose load
//! cell came out of its range stays where a force would lead it. Until it is known which way round the specimens are
//! wired, where their zeros are and that they stand where they should, none is moved: their exits would be anywhere.
//! What stops the way out stops it for all, and is part of how the test ended: a test that trips there has tripped.

use super::columns::Word;
use super::operator::{Control, OperatorCommands};
use super::phase::Phase;
use super::tick::Tick;
use super::{Ending, Engine, Stop};
use crate::catalog::ending::Cause;
use crate::catalog::phase::GIVEN_UP;
use crate::port::{Port, ReturnMove, UnloadFailure};
use crate::record::Event;
use crate::rt::timing::TickStamps;

/// Where a specimen was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Left {
    /// At its last command: nothing else is asked for, or too little was known of it to move it.
    Stayed,
    /// Where the test file wants it.
    Reached,
    /// Somewhere else, although the test file wants it moved; and why, where it was not something else that ended its way.
    NotReached(Option<UnloadFailure>),
    /// Its link is lost: wherever its own end holds or leaves it.
    Lost,
}

impl Left {
    /// As the files spell it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Left::Stayed => "stayed",
            Left::Reached => "reached",
            Left::NotReached(_) => "not_reached",
            Left::Lost => "lost",
        }
    }
}

/// A specimen in the way out of all.
#[derive(Debug, Default)]
struct Leaving {
    /// It was told that it stops.
    is_halted: bool,
    /// Its own way, if it is led away.
    departure: Option<ReturnMove>,
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
        self.enter(Phase::Holding, Ending::Stopped(Stop::Operator));
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
            self.exchange_again(&tick, &mut stamps, control)?;
            self.row
                .between(&tick, Phase::Holding.code(), &self.side, &self.ports);
            self.row
                .timing(&stamps, self.first_edge, self.schedule.stretched());
            self.keep_row();
            self.skip_numbers();
        }
        self.ride.sub_tick = tick.sub_tick;
        self.prepare_next();
        self.clear_commands()?;
        self.enter(Phase::Running, Ending::Stopped(Stop::Operator));
        Ok(())
    }

    /// Moves every specimen to where it is to be left. What stops it on the way freezes all, and ends a test that had ended
    /// well: how it ended is what comes back.
    pub(super) fn leave(&mut self, ending: Ending, control: &Control) -> Ending {
        if let Ending::Stopped(stop) = &ending {
            self.report_stop(stop);
        }
        self.row.cause = Some(ending.cause());
        let Err(stop) = self.lead_out(&ending, control) else {
            return ending;
        };
        let is_gone = |port: usize| self.ports.get(port).is_some_and(|port| port.is_gone());
        // Whoever was lost while the others were led away was told of then.
        if !matches!(stop, Stop::Link { port, .. } if is_gone(port)) {
            self.report_stop(&stop);
        }
        if self.sent_since_row {
            self.record_end(&Ending::Stopped(stop));
        }
        if let Stop::Link { port, .. } = stop
            && let Some(left) = self.left.get_mut(port)
        {
            *left = Left::Lost;
        }
        self.unfinished = Some(Unfinished {
            stop,
            after: ending,
        });
        if stop != Stop::Operator {
            self.enter(Phase::Tripped, Ending::Stopped(stop));
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
            Ending::Stopped(Stop::Misfit { .. } | Stop::Moved { .. } | Stop::ForceChanged { .. })
        );
        self.operator_stopped = matches!(ending, Ending::Stopped(Stop::Operator));
        if tripped {
            self.enter(Phase::Tripped, *ending);
        }
        if let Ending::Stopped(stop) = ending {
            self.bear_in_mind(stop);
        }
        if tripped {
            self.ports.iter_mut().for_each(Port::excuse);
        }
        self.ports.iter_mut().for_each(Port::end_test);
        let is_led = |port: &Port| {
            // Of one that never answered nobody knows where it is.
            let answers = port.has_answered() || port.owes_the_last();
            is_known && port.has_begun() && answers && port.exits().moves(tripped)
        };
        let mut led: Vec<bool> = self.ports.iter().map(is_led).collect();
        let mut moves = false;
        for (left, (port, led)) in self.left.iter_mut().zip(self.ports.iter().zip(&mut led)) {
            let unfelt = (!port.can_be_led(tripped)).then_some(UnloadFailure::Unfelt);
            let is_wanted = std::mem::replace(led, *led && unfelt.is_none());
            moves |= *led && !port.is_lost();
            *left = if port.is_gone() {
                Left::Lost
            } else if is_wanted {
                Left::NotReached(unfelt)
            } else {
                Left::Stayed
            };
        }
        self.keep_warm_up();
        if tripped && !self.trip_is_recorded && (moves || self.sent_since_row) {
            self.record_end(ending);
        }
        if !moves {
            return Ok(());
        }
        let of_test = if tripped || self.operator_stopped {
            *ending
        } else {
            Ending::Completed
        };
        self.enter(Phase::Leaving, of_test);
        // Whatever ends it, the specimens stand at their last commands.
        self.all_departures(tripped, &led, control)
    }

    /// The ways of those that are `led` away and can be told so now, if they have none. Who owes an answer of the test is told
    /// nothing before. All that are commanded stop first.
    fn depart(&mut self, tripped: bool, led: &[bool], leaving: &mut [Leaving]) {
        let (period, sequence) = (self.period.value(), self.sequence);
        let each = self.ports.iter_mut().zip(led).zip(leaving);
        for ((port, led), leaving) in each.filter(|((port, _), _)| port.may_be_commanded()) {
            if !std::mem::replace(&mut leaving.is_halted, true) {
                port.halt();
            }
            if *led && leaving.departure.is_none() {
                leaving.departure = port.begin_return_move(tripped, period);
                port.leave_number(sequence);
            }
        }
    }

    /// What stopped the test is known on the way out: who is not commanded any more. Real-time: yes.
    pub(super) fn bear_in_mind(&mut self, stop: &Stop) {
        match stop {
            // Of one whose measurements stay away nobody knows whether it follows, of a saturated one what it feels; what holds by
            // itself does not follow.
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

    /// Whoever was told its target some ticks ago is asked for its answer in every tick, and hears from us until it is here: its
    /// patience began when it was asked. Who is lost by that keeps nobody else where they are; the first of them comes back.
    /// Real-time: yes.
    fn hear_who_owes(
        &mut self,
        tick: &Tick,
        stamps: &mut TickStamps,
        control: &Control,
    ) -> Result<Option<Stop>, Stop> {
        let mut first = None;
        for index in 0..self.ports.len() {
            let port = self.ports.get(index);
            if !port.is_some_and(|port| port.owes_the_last()) {
                continue;
            }
            match self.collect_from(index, tick, stamps, Some(control)) {
                Ok(()) => {}
                Err(stop @ Stop::Link { .. }) => {
                    self.stops_too(&stop);
                    first = first.or(Some(stop));
                }
                Err(stop) => {
                    self.record_trip(tick, stamps, &stop);
                    return Err(stop);
                }
            }
        }
        Ok(first)
    }

    /// Who did not answer the last words is told of. Where its last answer was not to its last command, nobody knows where it
    /// is.
    pub(super) fn note_unheard(&mut self) {
        let unheard = |(_, port): &(usize, &Port)| port.lacks_acknowledgement() && !port.is_gone();
        let unheard = self.ports.iter().enumerate().filter(unheard);
        self.unheard = unheard.map(|(index, _)| index).collect();
        for index in self.unheard.clone() {
            let is_behind = |port: &Port| port.stale_in_a_row() > 0 || port.owes();
            if self.ports.get(index).is_some_and(is_behind)
                && let Some(left) = self.left.get_mut(index)
            {
                *left = Left::Lost;
            }
            self.report_now(Event::Unacknowledged { port: index as u32 });
        }
        // Where nobody asks for that, the answer that is owed would have been the last that is heard of it.
        for (port, left) in self.ports.iter().zip(&mut self.left) {
            if port.needs_no_acknowledgement() && port.is_left_owing() && !port.is_gone() {
                *left = Left::Lost;
            }
        }
    }

    /// What ended the test, or its way out, in no row of its own stands in one, if rows of the way out follow or commands had
    /// left: a replay ends there, too, and where every specimen was sent last is on record.
    fn record_end(&mut self, ending: &Ending) {
        if let Ending::Stopped(Stop::Link { port, .. }) = ending
            && let Some(port) = self.ports.get_mut(*port)
        {
            port.note_loss();
        }
        let tick = self.tick_behind_the_last(0.0);
        self.row.cause = Some(ending.cause());
        let state = if ending.is_for_being_late() {
            // What the operator said before the tick that was late stands in its own row.
            self.row.word = Word {
                holds: self.row.word.holds,
                ..Word::default()
            };
            self.row.commands = OperatorCommands::GIVE_UP;
            self.row.cause = Some(Cause::Late);
            GIVEN_UP
        } else {
            Phase::Tripped.code()
        };
        self.row.stopped = self.stops_on_its_way_out();
        self.row.between(&tick, state, &self.side, &self.ports);
        self.row.no_outputs();
        let stamps = TickStamps::default();
        self.row
            .timing(&stamps, self.first_edge, self.schedule.stretched());
        self.keep_row();
    }

    /// A tick in which test time stands still where the last row of the test is, which may be between two steps.
    fn tick_behind_the_last(&self, dt: f64) -> Tick {
        let tick = self.tick_at_rest(dt);
        let (sub_tick, time) = self.row.moment();
        if time > tick.time {
            let sub_tick = sub_tick as u64;
            return Tick {
                sub_tick,
                time,
                ..tick
            };
        }
        tick
    }

    /// What trips does so on the way out that the operator asked for.
    pub(super) fn stops_on_its_way_out(&self) -> bool {
        self.phase == Phase::Leaving && self.operator_stopped
    }

    /// A link that is lost before its specimen could be told anything stops nobody else: it is what comes back at the end.
    fn all_departures(
        &mut self,
        tripped: bool,
        led: &[bool],
        control: &Control,
    ) -> Result<(), Stop> {
        self.hold_wanted = false;
        let mut leaving: Vec<Leaving> = led.iter().map(|_| Leaving::default()).collect();
        let mut lost = None;
        loop {
            self.depart(tripped, led, &mut leaving);
            let mut moving = false;
            for (port, leaving) in self.ports.iter_mut().zip(&mut leaving) {
                match &mut leaving.departure {
                    Some(departure) => moving |= port.go_on(departure),
                    None => port.stand_still(),
                }
            }
            for (left, leaving) in self.left.iter_mut().zip(&leaving) {
                match leaving.departure.as_ref().and_then(ReturnMove::end) {
                    Some(Ok(())) => *left = Left::Reached,
                    Some(Err(astray)) => *left = Left::NotReached(Some(astray)),
                    None => {}
                }
            }
            let mut ports = self.ports.iter().zip(led);
            let waits = ports.any(|(port, led)| *led && port.owes_the_last());
            if !moving && !waits {
                return lost.map_or(Ok(()), Err);
            }
            self.clear_commands()?;
            let tick = self.tick_behind_the_last(self.tick_passes());
            let mut stamps = TickStamps::default();
            self.wait_before_start(&mut stamps, control)?;
            self.exchange(&tick, &mut stamps, control)?;
            lost = lost.or(self.hear_who_owes(&tick, &mut stamps, control)?);
            self.row_before_start(&tick, Phase::Leaving, &stamps);
            self.accept()?;
            for port in &mut self.ports {
                port.close_tick_of_shutdown();
            }
        }
    }
}
