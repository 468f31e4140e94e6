//! One tick, top to bottom: issue to all, collect from all, judge, close equilibrium, advance, aim, row.
//!
//! Nothing but the send stands between the edge and the wire: the command was made in the tick before. A step
//! is never skipped. Everything here is on the real-time path: no allocation, no lock, no system call but the
//! clock's and the links', no panic.

use super::columns::state;
use super::numerical::{Side, aim_along};
use super::tick::Tick;
use super::{Engine, Stop};
use crate::control::OnStale;
use crate::record::EventKind;
use crate::rt::timing::TickStamps;
use crate::substructure::{Coupling, Freshness, Status};
use crate::time::Nanos;

impl Engine {
    /// One tick of the running test. On return command k + 1 stands ready and row k is handed over.
    /// Real-time: yes.
    pub(super) fn tick(&mut self, tick: &Tick, stamps: &mut TickStamps) -> Result<(), Stop> {
        self.exchange(tick, stamps)?;
        self.row
            .exchange(tick, state::RUNNING, &self.side, &self.ports);
        let advanced = self.advance_to_next(tick);
        stamps.ready = self.clock.now();

        self.accept()?;
        if let Side::Structure(numerical) = &mut self.side {
            numerical.output_accel();
        }
        self.row.outputs(&self.side);
        self.row
            .timing(stamps, self.first_edge, self.schedule.stretched());
        self.hand_over(tick);
        self.note_peaks(tick)?;
        advanced
    }

    /// Issue to all before collecting from any, so that several links cost one round trip.
    pub(super) fn exchange(&mut self, tick: &Tick, stamps: &mut TickStamps) -> Result<(), Stop> {
        for (index, port) in self.ports.iter_mut().enumerate() {
            port.issue(self.sequence, tick.time, tick.dt)
                .map_err(|fault| Stop::Link { port: index, fault })?;
        }
        stamps.sent = self.clock.now();
        stamps.decoded = stamps.sent;
        for index in 0..self.ports.len() {
            let deadline = self.reply_deadline(index, stamps.sent);
            let Some(port) = self.ports.get_mut(index) else {
                break;
            };
            let freshness = port
                .collect(deadline)
                .map_err(|fault| Stop::Link { port: index, fault })?;
            stamps.decoded = self.clock.now();
            self.timing
                .round_trip(index, stamps.decoded.since(stamps.sent));
            let status = port.raw().status;
            if status.has(Status::INTERLOCK) {
                return Err(Stop::Interlock { port: index });
            }
            if status.has(Status::SATURATED) {
                return Err(Stop::Saturated { port: index });
            }
            self.judge_age(index, freshness, tick)?;
        }
        Ok(())
    }

    /// A lockstep partner is waited for, a sampled one has until its share of the tick is over.
    fn reply_deadline(&self, index: usize, sent: Nanos) -> Nanos {
        let port = self.ports.get(index);
        match port.map(crate::control::Port::coupling) {
            // The edge was counted when the tick began: this is the one that ends it.
            Some(Coupling::Sampled) => self
                .schedule
                .tick(self.edge)
                .minus(self.schedule.period_ns() / 8),
            _ => {
                let own = port.and_then(|port| port.wait);
                sent.plus(own.map_or(self.limits.reply_timeout_ns, |own| own.reply_timeout_ns))
            }
        }
    }

    /// Stale data are used as the policy says, a bounded number of times in a row.
    fn judge_age(&mut self, index: usize, freshness: Freshness, tick: &Tick) -> Result<(), Stop> {
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        let Some(stale) = self.stale.get_mut(index) else {
            return Ok(());
        };
        if freshness == Freshness::Fresh {
            *stale = 0;
            return Ok(());
        }
        *stale += 1;
        let age = self.sequence.saturating_sub(port.raw().sequence);
        let (on_stale, in_a_row) = match port.wait {
            Some(own) => (own.on_stale, own.stale_in_a_row),
            None if self.limits.extrapolate_stale => {
                (OnStale::Extrapolate, self.limits.stale_in_a_row)
            }
            None => (OnStale::Hold, self.limits.stale_in_a_row),
        };
        if on_stale == OnStale::Extrapolate {
            port.extrapolate();
        }
        let count = *stale;
        self.report(
            tick,
            EventKind::Stale {
                port: index as u32,
                age,
            },
        );
        if on_stale == OnStale::Stop || count > in_a_row {
            return Err(Stop::Stale {
                port: index,
                ticks: count,
            });
        }
        Ok(())
    }

    /// Equilibrium at this step, x and v of the next, and the commands that follow from them.
    /// An offline method that finds no equilibrium ends the test after the row of this step.
    fn advance_to_next(&mut self, tick: &Tick) -> Result<(), Stop> {
        match &mut self.side {
            Side::Structure(numerical) => {
                numerical.close(tick.step, tick.dt, &mut self.ports);
                numerical.advance(tick.step).map_err(Stop::Step)?;
                let base = numerical.base(tick.step + 1);
                let state = &numerical.state;
                for port in &mut self.ports {
                    port.note_peak();
                    port.aim(&state.disp, &state.vel, base.disp, base.vel);
                }
            }
            Side::Prescribed(histories) => {
                for port in &mut self.ports {
                    port.note_peak();
                }
                aim_along(histories, tick.index() + 1, &mut self.ports);
            }
        }
        Ok(())
    }

    /// The step is accepted: specimens commit. The command that stands ready has not left yet.
    pub(super) fn accept(&mut self) -> Result<(), Stop> {
        for (index, port) in self.ports.iter_mut().enumerate() {
            port.accepted(self.sequence)
                .map_err(|fault| Stop::Link { port: index, fault })?;
        }
        self.sequence += 1;
        Ok(())
    }

    /// Row to the recorder; a lost row is an event and a count, never a wait.
    fn hand_over(&mut self, tick: &Tick) {
        if !self.recorder.row(self.row.values()) {
            self.rows_lost += 1;
            self.report(tick, EventKind::RowLost);
        }
        self.steps_done = tick.step;
    }

    /// Peaks over all DOFs, and the last look at the state before its command leaves; after the last step none does.
    fn note_peaks(&mut self, tick: &Tick) -> Result<(), Stop> {
        if let Side::Structure(numerical) = &self.side {
            self.peaks
                .note_rates(&numerical.reported_vel, &numerical.accel);
        }
        if tick.step >= self.steps {
            return Ok(());
        }
        if let Side::Structure(numerical) = &self.side {
            let bound = self.limits.divergence;
            if let Some((dof, value)) = self.peaks.note_disp(&numerical.state.disp, bound) {
                return Err(Stop::Diverged { dof, value });
            }
        }
        match self.ports.iter().position(|port| !port.command_is_finite()) {
            Some(port) => Err(Stop::NotFinite { port }),
            None => Ok(()),
        }
    }
}
