//! The shutdown: every specimen holds, or is moved slowly to where it is to be left, and then receives the last message.
//!
//! After a stop of the operator each specimen that moves is braked first, within its limit of acceleration; so is a drive after a
//! trip.
//!
//! A specimen that is saturated, whose measurements are stale, whose interlock is open, or which its own watchdog holds is not commanded: its own end holds it.
//! One whose load cell left its range is not led by a force. Until it is known how the specimens are wired, where their zeros
//! are and that they stand where they should, none is moved. What stops the shutdown stops it for all, and is part of how the
//! test ended: a test that trips there has tripped.

use super::columns::Word;
use super::cycle::{Engine, Maneuver};
use super::end_positions::{EndPosition, IncompleteShutdown};
use super::operator::OperatorCommands;
use super::order::Order;
use super::phase::Phase;
use super::stop::port_at;
use super::tick::Tick;
use super::{Ending, Stop};
use crate::port::{Brake, Port, ReturnMove, UnloadFailure};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::phase::GIVEN_UP;
use gusset_record::Event;
use gusset_record::rt::timing::TickStamps;

/// The shutdown of one specimen.
#[derive(Debug, Default)]
struct Exit {
    /// It is moved: the test file asks for it, and enough is known.
    is_led: bool,
    /// It comes to rest, while it does.
    brake: Option<Brake>,
    /// It received the message that it stops.
    is_halted: bool,
    /// Its motion, once it has begun.
    departure: Option<ReturnMove>,
}

impl Exit {
    /// It is commanded once more at least.
    const fn moves(&self) -> bool {
        self.is_led || self.brake.is_some()
    }
}

/// The motion of all specimens to where they are left. One may unload while another is lost.
pub(super) struct Shutdown {
    tripped: bool,
    /// The motion of an identification was interrupted: specimens go back to where it began.
    retraces: bool,
    exits: Vec<Exit>,
    /// The first link that was lost before its specimen could be commanded: it stops no other.
    lost: Option<Stop>,
}

impl Shutdown {
    /// Moves every specimen to where it is to be left. Returns how the test ended: what stops the shutdown freezes all, and
    /// ends a test that had ended well.
    pub(crate) fn perform(ending: Ending, engine: &mut Engine<'_>) -> Ending {
        if let Ending::Stopped(stop) = &ending {
            engine.environment.report_stop(stop);
        }
        engine.environment.journal.row.cause = Some(ending.cause());
        let led = Self::lead_out(ending, engine);
        for (index, port) in (0..).zip(&*engine.ports) {
            if let Some(way) = port.way_back() {
                engine.environment.report_now(Event::Retraced {
                    port: index,
                    what: way.word().into(),
                });
            }
        }
        let Err(stop) = led else {
            return ending;
        };
        let is_gone = |port: usize| {
            engine
                .ports
                .get(port)
                .is_some_and(|port| port.exchange().state().is_gone())
        };
        // One that was lost while the others were led was reported then.
        if !matches!(stop, Stop::Link { port, .. } if is_gone(port)) {
            engine.environment.report_stop(&stop);
        }
        if engine.environment.journal.lacks_commands() {
            Self::record_end(&Ending::Stopped(stop), engine);
        }
        if let Stop::Link { port, .. } = stop {
            engine.ends.mark_lost(port);
        }
        engine.ends.unfinished = Some(IncompleteShutdown {
            stop,
            after: ending,
        });
        if stop != Stop::Operator {
            let stopped = Ending::Stopped(stop);
            engine.environment.enter(Phase::Tripped, stopped);
        }
        match ending {
            Ending::Completed | Ending::Stopped(Stop::Operator) => Ending::Stopped(stop),
            Ending::Stopped(_) => ending,
        }
    }

    fn lead_out(ending: Ending, engine: &mut Engine<'_>) -> Result<(), Stop> {
        let tripped = !matches!(
            ending,
            Ending::Completed | Ending::Stopped(Stop::Operator | Stop::Step(_))
        );
        let phase = engine.environment.supervision.phase();
        let is_known = !matches!(phase, Phase::Connected | Phase::Probing | Phase::Zeroing)
            && !matches!(
                ending,
                Ending::Stopped(
                    Stop::Misfit { .. } | Stop::Moved { .. } | Stop::ForceChanged { .. }
                )
            );
        engine.ends.begin(ending);
        if tripped {
            engine.environment.enter(Phase::Tripped, ending);
        }
        if let Ending::Stopped(stop) = &ending {
            engine.exclude(stop);
        }
        if tripped {
            engine.ports.iter_mut().for_each(Port::excuse);
        }
        let brakes = Self::end_motion(engine.ends.is_after_operator(), tripped, engine);
        let shutdown = Self::new(tripped, is_known, brakes, engine);
        let ports = engine.ports.iter().zip(&shutdown.exits);
        let moves =
            { ports }.any(|(port, exit)| exit.moves() && !port.exchange().state().is_lost());
        let journal = &mut engine.environment.journal;
        journal.keep_warm_up();
        if tripped && !journal.has_trip() && (moves || journal.lacks_commands()) {
            Self::record_end(&ending, engine);
        }
        if !moves {
            return Ok(());
        }
        let of_test = if tripped || engine.ends.is_after_operator() {
            ending
        } else {
            Ending::Completed
        };
        engine.environment.enter(Phase::Leaving, of_test);
        engine.environment.supervision.drop_hold();
        let led = shutdown.run(engine);
        if led == Err(Stop::Operator) {
            Self::come_to_rest(engine)?;
        }
        // However it ends, the specimens hold their last commands.
        led
    }

    /// The motion under way is over. Returns the brake of each specimen that needs one, if `all` are to brake; after a trip
    /// those that a frozen command would jerk do.
    fn end_motion(all: bool, tripped: bool, engine: &mut Engine<'_>) -> Vec<Option<Brake>> {
        let tick = engine.environment.pace.period_s();
        let ports = engine.ports.iter_mut();
        ports
            .map(|port| {
                let brakes = all || (tripped && port.exits().comes_to_rest);
                port.end_test(brakes.then_some(tick), tripped)
            })
            .collect()
    }

    /// Brakes the specimens whose shutdown the operator stopped.
    fn come_to_rest(engine: &mut Engine<'_>) -> Result<(), Stop> {
        let exit = |brake| Exit {
            brake,
            ..Exit::default()
        };
        let brakes = Self::end_motion(true, false, engine);
        let rests = Self {
            tripped: false,
            retraces: false,
            exits: brakes.into_iter().map(exit).collect(),
            lost: None,
        };
        rests.run(engine)
    }

    /// Which specimens are moved.
    fn new(
        tripped: bool,
        is_known: bool,
        brakes: Vec<Option<Brake>>,
        engine: &mut Engine<'_>,
    ) -> Self {
        let mut exits = Vec::with_capacity(engine.ports.len());
        let retraces = !tripped && engine.environment.supervision.goes_back();
        let ports = engine.ports.iter().zip(brakes);
        for (left, (port, brake)) in engine.ends.left.iter_mut().zip(ports) {
            // The position of one that never replied is unknown.
            let replies = port.exchange().has_answered() || port.exchange().state().owes_the_last();
            let is_wanted = is_known
                && port.exchange().has_begun()
                && replies
                && (port.can_retrace() || !retraces)
                && (retraces || port.exits().moves(tripped));
            let is_felt = retraces || port.can_be_led(tripped);
            let unfelt = (!is_felt).then_some(UnloadFailure::Unfelt);
            *left = if port.exchange().state().is_gone() {
                EndPosition::Lost
            } else if is_wanted {
                EndPosition::NotReached(unfelt)
            } else {
                EndPosition::Stayed
            };
            exits.push(Exit {
                is_led: is_wanted && unfelt.is_none(),
                brake,
                ..Exit::default()
            });
        }
        Self {
            tripped,
            retraces,
            exits,
            lost: None,
        }
    }

    fn run(mut self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        engine.perform(&mut self)?;
        self.lost.map_or(Ok(()), Err)
    }

    /// Brakes those that move; true if one of them does.
    fn brake(&mut self, engine: &mut Engine<'_>) -> bool {
        let sequence = engine.exchanges.sequence();
        let mut moving = false;
        for (port, exit) in engine.ports.iter_mut().zip(&mut self.exits) {
            if let Some(brake) = &mut exit.brake {
                if brake.is_new() {
                    port.exchange_mut().leave_number(sequence);
                }
                if port.brake(brake) {
                    moving = true;
                } else {
                    exit.brake = None;
                    port.has_come_to_rest();
                    if self.tripped {
                        port.excuse();
                    }
                }
            }
        }
        moving
    }

    /// Begins the motions that can begin now. One that owes a reply of the test is commanded nothing before. All that are
    /// commanded stop first.
    fn begin_motions(&mut self, engine: &mut Engine<'_>) {
        let (period, sequence) = (
            engine.environment.pace.period_s(),
            engine.exchanges.sequence(),
        );
        let each = engine.ports.iter_mut().zip(&mut self.exits);
        let each = each.filter(|(port, exit)| {
            port.exchange().state().may_be_commanded() && exit.brake.is_none()
        });
        for (port, exit) in each {
            if !std::mem::replace(&mut exit.is_halted, true) {
                port.exchange_mut().halt();
            }
            if exit.is_led && exit.departure.is_none() {
                exit.departure = if self.retraces {
                    port.begin_retrace(period)
                } else {
                    port.begin_return_move(self.tripped, period)
                };
                port.exchange_mut().leave_number(sequence);
            }
        }
    }

    /// Makes the next command of every specimen; true if one of them moves.
    fn go_on(&mut self, engine: &mut Engine<'_>) -> bool {
        let mut moving = false;
        for (port, exit) in engine.ports.iter_mut().zip(&mut self.exits) {
            match &mut exit.departure {
                Some(departure) => moving |= port.go_on(departure),
                None if exit.brake.is_none() => port.stand_still(),
                None => {}
            }
        }
        for (left, exit) in engine.ends.left.iter_mut().zip(&self.exits) {
            match exit.departure.as_ref().and_then(ReturnMove::end) {
                Some(Ok(())) => *left = EndPosition::Reached,
                Some(Err(failure)) => *left = EndPosition::NotReached(Some(failure)),
                None => {}
            }
        }
        moving
    }

    /// Hears specimens that owe the reply to their last command of the test; their patience began when they were asked. One that
    /// is lost by that stops no other.
    fn hear_those_who_owe(
        &mut self,
        engine: &mut Engine<'_>,
        tick: &Tick,
        stamps: &mut TickStamps,
    ) -> Result<(), Stop> {
        for index in 0..engine.ports.len() {
            if !port_at(engine.ports, index)?
                .exchange()
                .state()
                .owes_the_last()
            {
                continue;
            }
            match engine.collect_from(index, tick, stamps, true) {
                Ok(()) => {}
                Err(stop @ Stop::Link { .. }) => {
                    engine.stops_too(&stop);
                    self.lost = self.lost.or(Some(stop));
                }
                Err(stop) => {
                    engine.record_trip(tick, stamps, &stop);
                    return Err(stop);
                }
            }
        }
        Ok(())
    }

    /// Makes the row of a stop that has none: a replay ends there, too, and the last command of every specimen is on record.
    fn record_end(ending: &Ending, engine: &mut Engine<'_>) {
        if let Ending::Stopped(Stop::Link { port, .. }) = ending
            && let Some(port) = engine.ports.get_mut(*port)
        {
            port.feedback_mut().note_loss();
        }
        let tick = Self::tick_after_the_last(engine, 0.0);
        let stopped = (engine.ends).is_operators(engine.environment.supervision.phase());
        let row = &mut engine.environment.journal.row;
        row.cause = Some(ending.cause());
        let state = if ending.is_for_being_late() {
            // Requests of the operator before the late tick are in an earlier row.
            row.word = Word {
                holds: row.word.holds,
                ..Word::default()
            };
            row.commands = OperatorCommands::GIVE_UP;
            row.cause = Some(Cause::Late);
            GIVEN_UP
        } else {
            Phase::Tripped.code()
        };
        row.stopped = stopped;
        row.between(&tick, state, engine.side, engine.ports);
        engine.keep_last_row(&TickStamps::default());
    }

    /// A tick at the last row of the test, which may be between two steps. No test time passes.
    fn tick_after_the_last(engine: &Engine<'_>, dt: f64) -> Tick {
        let tick = engine.environment.place.at_rest(dt);
        let (sub_tick, time) = engine.environment.journal.row.moment();
        if time > tick.time {
            return Tick {
                sub_tick: sub_tick as u64,
                time,
                ..tick
            };
        }
        tick
    }
}

impl Maneuver for Shutdown {
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        let mut moving = self.brake(engine);
        self.begin_motions(engine);
        moving |= self.go_on(engine);
        let mut ports = engine.ports.iter().zip(&self.exits);
        let waits =
            ports.any(|(port, exit)| exit.is_led && port.exchange().state().owes_the_last());
        if !moving && !waits {
            return Ok(None);
        }
        engine.judge_commands()?;
        let tick = Self::tick_after_the_last(engine, engine.tick_passes());
        Ok(Some(Order::moving(tick, Phase::Leaving)))
    }

    fn measured(
        &mut self,
        engine: &mut Engine<'_>,
        order: &mut Order,
        stamps: &mut TickStamps,
    ) -> Result<(), Stop> {
        self.hear_those_who_owe(engine, &order.tick, stamps)
    }

    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        _: &Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        engine.accept()?;
        for port in &mut *engine.ports {
            port.exchange_mut().state_mut().close_tick_of_shutdown();
        }
        Ok(())
    }
}
