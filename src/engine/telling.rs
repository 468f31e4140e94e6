//! What the loop tells the log: rows, events of a tick, of this moment, and of what ends a test.

use super::operator::OperatorCommands;
use super::phase::Phase;
use super::tick::Tick;
use super::{Engine, Stop};
use crate::catalog::ending::Cause;
use crate::catalog::phase::NOT_AWAITED;
use crate::integrate::StepError;
use crate::record::{Event, GridOf, LimitReached, Standing, TimedEvent};
use crate::rt::timing::TickStamps;
use crate::time::Nanos;

impl Engine {
    /// Hands the finished row over; false if it was lost, which is counted and never waited for. Real-time: yes.
    #[inline]
    pub(super) fn keep_row(&mut self) -> bool {
        self.sent_since_row = false;
        let is_kept = self.recorder.row(self.row.values());
        self.row.commands = OperatorCommands::default();
        self.rows_lost += u64::from(!is_kept);
        is_kept
    }

    /// What was measured in the tick that ends the test, or its way out, is kept, although nothing follows from it.
    #[cold]
    pub(super) fn record_trip(&mut self, tick: &Tick, stamps: &TickStamps, stop: &Stop) {
        let is_not_awaited = *stop == Stop::Operator;
        if is_not_awaited
            || matches!(
                stop,
                Stop::Limit { .. }
                    | Stop::Interlock { .. }
                    | Stop::Saturated { .. }
                    | Stop::HoldsOn { .. }
                    | Stop::Geometry { .. }
                    | Stop::Stale { .. }
            )
        {
            self.trip_is_recorded = true;
            self.row.stopped = self.stops_on_its_way_out();
            self.row.cause = Some(stop.cause());
            if is_not_awaited {
                self.row.commands.add(OperatorCommands::STOP_IN_WAIT);
            }
            self.keep_warm_up();
            if tick.step == self.ride.step && !is_not_awaited {
                // Of the test it is the row of its step, as one that is closed is.
                let sub_tick = if self.riding { 0 } else { tick.sub_tick };
                let tick = Tick { sub_tick, ..*tick };
                self.row
                    .exchange(&tick, Phase::Tripped, &self.side, &self.ports);
                if self.riding {
                    self.note_reached();
                }
            } else {
                let state = if is_not_awaited {
                    NOT_AWAITED
                } else {
                    Phase::Tripped.code()
                };
                self.row.between(tick, state, &self.side, &self.ports);
            }
            self.row.no_outputs();
            self.row
                .timing(stamps, self.first_edge, self.schedule.stretched());
            self.keep_row();
        }
    }

    /// Keeps the row of the step whose displacements are beyond the divergence bound. Its command never leaves, so that its
    /// measurements are those of the step before, and it has no velocities and accelerations.
    #[cold]
    pub(super) fn record_divergence(&mut self, tick: &Tick, stamps: &TickStamps) {
        self.row.cause = Some(Cause::Diverged);
        let next = Tick {
            step: tick.step + 1,
            sub_tick: 0,
            time: (tick.step + 1) as f64 * self.dt,
            dt: self.dt,
        };
        self.trip_is_recorded = true;
        self.row
            .exchange(&next, Phase::Tripped, &self.side, &self.ports);
        self.note_reached();
        self.row.no_outputs();
        self.row
            .timing(stamps, self.first_edge, self.schedule.stretched());
        self.keep_row();
    }

    /// Sends an event of this tick; a full queue is not waited for. On the way out test time stands where the test ended.
    /// Real-time: yes.
    pub(super) fn report(&mut self, tick: &Tick, kind: Event) {
        let Nanos(clock_ns) = self.clock_now;
        let Tick { step, time, .. } = if self.phase.can_be_held() {
            *tick
        } else {
            self.tick_of_report()
        };
        let event = TimedEvent {
            tick: step,
            time,
            clock_ns,
            kind,
        };
        if !self.recorder.event(event) {
            self.events_lost += 1;
        }
    }

    /// When the grid began, from which rows count their wall time; the clock is not read for it. Real-time: yes.
    pub(super) fn report_grid(&mut self, of: GridOf) {
        let Nanos(first_edge_ns) = self.first_edge;
        let tick = self.tick_of_report();
        self.report(&tick, Event::Grid { of, first_edge_ns });
    }

    pub(super) fn report_now(&mut self, kind: Event) {
        self.clock_now = self.clock.now();
        let tick = self.tick_of_report();
        self.report(&tick, kind);
    }

    /// Where the test is: at the last tick that was exchanged, whose step may never end, or at the last step that was made.
    /// Real-time: yes.
    pub(super) fn tick_of_report(&self) -> Tick {
        let step = self.steps_done;
        let made = Tick {
            step,
            sub_tick: 0,
            time: step as f64 * self.dt,
            dt: 0.0,
        };
        if self.at.time > made.time {
            self.at
        } else {
            made
        }
    }

    /// What ends the test, or its way out, as an event at the moment of it.
    pub(super) fn report_stop(&mut self, stop: &Stop) {
        match stop {
            Stop::Operator => self.report_now(Event::StopRequested),
            Stop::Link { port, fault } => {
                self.report_now(Event::link_lost(*port as u32, *fault));
            }
            Stop::Interlock { port } => {
                self.report_now(Event::Interlock { port: *port as u32 });
            }
            Stop::Misfit { port, misfit } => {
                self.report_now(Event::Misfit {
                    port: *port as u32,
                    axis: misfit.axis() as u32,
                    what: misfit.name().into(),
                });
            }
            Stop::Geometry { port, fault } => {
                self.report_now(Event::Geometry {
                    port: *port as u32,
                    actuator: fault.wrong.actuator().map(|actuator| actuator as u32),
                    what: fault.wrong.word().into(),
                });
            }
            Stop::Saturated { port } => {
                self.report_now(Event::Saturated { port: *port as u32 });
            }
            Stop::HoldsOn { port, .. } => {
                self.report_now(Event::SpecimenHoldsOn { port: *port as u32 });
            }
            Stop::Moved {
                port,
                axis,
                found,
                left,
                within,
                ..
            } => {
                self.report_now(Event::Moved(Standing {
                    port: *port as u32,
                    axis: *axis as u32,
                    found: *found,
                    left: *left,
                    within: *within,
                }));
            }
            Stop::Diverged { dof, .. } | Stop::Step(StepError::NotConverged { dof, .. }) => {
                self.report_now(Event::Diverged { dof: *dof as u32 });
            }
            _ => {}
        }
    }
}

/// A limit that was reached, on the way to its event. Real-time: yes.
pub(super) fn limit_event(trip: bool, reached: LimitReached) -> Event {
    if trip {
        Event::LimitTrip(reached)
    } else {
        Event::LimitWarning(reached)
    }
}
