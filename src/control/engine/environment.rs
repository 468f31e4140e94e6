//! The surroundings of the mechanics of a test: time, operator and record.

use super::columns::Word;
use super::deadlines::Deadlines;
use super::journal::Journal;
use super::operator::{Operator, OperatorCommands};
use super::pace::Pace;
use super::phase::Phase;
use super::place::Place;
use super::supervision::Supervision;
use super::tick::Tick;
use super::{Ending, Stop};
use gusset_numerics::integrate::StepError;
use gusset_quantity::time::Nanos;
use gusset_record::rt::timing::TickStamps;
use gusset_record::{Event, GridOf, Standing, TimedEvent};

/// Longest wait for an edge in which no request of the operator is taken.
const NAP_NS: u64 = 100_000_000;

/// Time, operator and record of one test.
pub(super) struct Environment {
    pub pace: Pace,
    pub deadlines: Deadlines,
    pub supervision: Supervision,
    pub journal: Journal,
    pub place: Place,
}

impl Environment {
    /// Sends an event of this tick. During the shutdown test time stands where the test ended. Real-time: yes.
    pub(crate) fn report(&mut self, tick: &Tick, kind: Event) {
        let Nanos(clock_ns) = self.pace.now();
        let Tick { step, time, .. } = if self.supervision.phase().can_be_held() {
            *tick
        } else {
            self.place.of_event()
        };
        self.journal.event(TimedEvent {
            tick: step,
            time,
            clock_ns,
            kind,
        });
    }

    /// Sends an event of this moment. Real-time: yes.
    pub(crate) fn report_now(&mut self, kind: Event) {
        self.pace.keep_reading();
        let tick = self.place.of_event();
        self.report(&tick, kind);
    }

    /// Sends when the grid began, from which rows count their wall time. Real-time: yes.
    pub(crate) fn report_grid(&mut self, of: GridOf) {
        let Nanos(first_edge_ns) = self.pace.first_edge();
        let tick = self.place.of_event();
        self.report(&tick, Event::Grid { of, first_edge_ns });
    }

    /// Begins a new grid of edges.
    pub(crate) fn begin_grid(&mut self, of: GridOf) {
        self.pace.begin();
        self.report_grid(of);
    }

    /// Enters the next phase; `of_last` is how the phase before it ended. Real-time: yes.
    pub(crate) fn enter(&mut self, phase: Phase, of_last: Ending) {
        let from = self.supervision.enter(phase);
        self.report_now(Event::Phase {
            from,
            to: phase,
            cause: of_last.word().into(),
            port: of_last.port().map(|port| port as u32),
        });
    }

    /// Waits for the next edge and takes a request of the operator. Real-time: yes.
    ///
    /// # Errors
    /// The operator ends the test.
    #[inline]
    pub(crate) fn wait_for_edge(
        &mut self,
        is_still: bool,
        stamps: &mut TickStamps,
    ) -> Result<(), Stop> {
        stamps.idle = self.pace.now();
        self.supervision.begin_tick(is_still);
        self.journal.row.commands.begin_tick();
        if self.pace.is_simulated() {
            self.supervision.wait_where_it_stands();
        }
        let was_asked = self.supervision.is_unconfirmed();
        stamps.release = self.pace.next_edge();
        let heard = self.nap(stamps).and_then(|()| {
            self.pace.sleep_until(stamps.release);
            self.pace.begin_tick(stamps);
            let heard = self.hear();
            self.journal.row.word = Word {
                holds: self.supervision.is_held(),
                goes_on: self.supervision.continues(),
                confirms: was_asked && !self.supervision.is_unconfirmed(),
            };
            heard
        });
        self.supervision.end_wait();
        heard
    }

    /// A slow test has far edges: requests of the operator are taken before them, too.
    #[inline]
    fn nap(&mut self, stamps: &TickStamps) -> Result<(), Stop> {
        if stamps.release.since(stamps.idle) > NAP_NS {
            while stamps.release.since(self.pace.read()) > NAP_NS {
                self.pace.sleep_until(self.pace.read().plus(NAP_NS / 2));
                self.hear()?;
            }
        }
        Ok(())
    }

    /// Moves the grid after a late wake-up of the test, by the policy. Returns the ticks. Real-time: yes.
    #[inline]
    pub(crate) fn stretch_after_wakeup(&mut self, stamps: &TickStamps) -> u64 {
        let late_ns = stamps.woke.since(stamps.release);
        let stalled = self.deadlines.stretch(&mut self.pace, late_ns, 0);
        self.journal.row.lateness.skipped_by_wakeup = stalled;
        stalled
    }

    /// Outside of the test late ticks are not made up for, whatever the policy, so that no specimen sees a burst of commands.
    /// Real-time: yes.
    #[inline]
    pub(crate) fn skip_late_edges(&mut self, stamps: &TickStamps) {
        let ticks = self.pace.skip_edges_before(stamps.woke);
        if ticks > 0 {
            self.note_gap(stamps.woke.since(stamps.release), ticks);
        }
    }

    #[cold]
    fn note_gap(&mut self, late_ns: u64, ticks: u64) {
        if self.deadlines.gap(late_ns) {
            let tick = self.place.of_event();
            self.report(&tick, Event::Gap { late_ns, ticks });
        }
    }

    /// Takes one request of the operator, if there is one. Real-time: yes.
    ///
    /// # Errors
    /// The operator ends the test.
    #[inline]
    pub(crate) fn hear(&mut self) -> Result<(), Stop> {
        if let Some(request) = self.supervision.take_request() {
            self.obey(request)?;
        }
        self.supervision.show();
        Ok(())
    }

    fn obey(&mut self, request: Operator) -> Result<(), Stop> {
        let can_be_held = self.supervision.phase().can_be_held();
        match request {
            Operator::Stop => {
                self.journal.row.commands.add(OperatorCommands::STOP);
                return Err(Stop::Operator);
            }
            Operator::Interrupt => {
                let commands = if self.supervision.can_go_back() {
                    self.supervision.begin_going_back();
                    OperatorCommands::RETRACE
                } else {
                    OperatorCommands::STOP
                };
                self.journal.row.commands.add(commands);
                return Err(Stop::Operator);
            }
            Operator::GiveUp => {
                return Err(Stop::Late {
                    total: self.deadlines.total(),
                    in_a_row: self.deadlines.in_a_row(),
                    late_ns: 0,
                });
            }
            // The shutdown is neither held nor confirmed.
            _ if !can_be_held => {}
            Operator::Hold => {
                if self.supervision.begin_hold() {
                    self.journal.row.commands.add(OperatorCommands::HOLD);
                    self.report_now(Event::HoldRequested);
                }
            }
            Operator::EndHold(hold) if hold != self.supervision.hold_number() => {
                let latest = self.supervision.hold_number();
                self.report_now(Event::ContinueDropped { hold, latest });
            }
            Operator::EndHold(_) | Operator::Continue => {
                let commands = &mut self.journal.row.commands;
                commands.remove(OperatorCommands::HOLD);
                commands.add(OperatorCommands::CONTINUE);
                if self.supervision.is_held() {
                    self.report_now(Event::ContinueRequested);
                }
                self.supervision.end_hold();
            }
            Operator::Confirm => {
                if self.supervision.confirm() {
                    self.journal.row.commands.add(OperatorCommands::CONFIRM);
                }
            }
        }
        Ok(())
    }

    /// Takes the request to give the test up, if it is the next. A replay makes it, whose clock is never late.
    pub(crate) fn hear_if_given_up(&mut self) -> Result<(), Stop> {
        match self.supervision.next_request() {
            Some(Operator::GiveUp) => self.hear(),
            _ => Ok(()),
        }
    }

    /// Reports the stop of the test, or of its shutdown, at this moment.
    pub(crate) fn report_stop(&mut self, stop: &Stop) {
        if let Some(event) = event_of(stop) {
            self.report_now(event);
        }
    }
}

/// The event of a stop; none for one that was reported where it was found.
fn event_of(stop: &Stop) -> Option<Event> {
    Some(match stop {
        Stop::Operator => Event::StopRequested,
        Stop::Link { port, fault } => Event::link_lost(*port as u32, *fault),
        Stop::Interlock { port } => Event::Interlock { port: *port as u32 },
        Stop::Misfit { port, misfit } => Event::Misfit {
            port: *port as u32,
            axis: misfit.axis() as u32,
            what: misfit.name().into(),
        },
        Stop::Geometry { port, fault } => Event::Geometry {
            port: *port as u32,
            actuator: fault.wrong.actuator().map(|actuator| actuator as u32),
            what: fault.wrong.word().into(),
        },
        Stop::Saturated { port } => Event::Saturated { port: *port as u32 },
        Stop::HoldsOn { port, .. } => Event::SpecimenHoldsOn { port: *port as u32 },
        Stop::Moved {
            port,
            axis,
            found,
            left,
            within,
            ..
        } => Event::Moved(Standing {
            port: *port as u32,
            axis: *axis as u32,
            found: *found,
            left: *left,
            within: *within,
            differs: true,
        }),
        Stop::Diverged { dof, .. } | Stop::Step(StepError::NotConverged { dof, .. }) => {
            Event::Diverged { dof: *dof as u32 }
        }
        _ => return None,
    })
}
