//! What follows from what was found of a specimen in a tick: an event, a count, a value in place of a missing one, or the end of
//! the test. Everything here is on the real-time path, and out of its way where nothing was found.

use super::tick::Tick;
use super::{Engine, Stop};
use crate::control::limits::{Found, Hit, Level};
use crate::control::{OnStale, Port};
use crate::record::EventKind;

impl Engine {
    /// A warning is told, a trip ends the test, and all that trip are told. Real-time: yes.
    #[cold]
    pub(super) fn act_on(&mut self, index: usize, found: &Found, tick: &Tick) -> Result<(), Stop> {
        for hit in found.warning.iter().chain(&found.trip) {
            self.report_hit(index, hit, tick);
        }
        while let Some(hit) = self.ports.get_mut(index).and_then(Port::next_trip) {
            self.report_hit(index, &hit, tick);
        }
        let Some(hit) = found.trip else {
            return Ok(());
        };
        Err(if hit.value.is_finite() {
            Stop::Limit { port: index, hit }
        } else {
            Stop::NotFinite { port: index }
        })
    }

    fn report_hit(&mut self, index: usize, hit: &Hit, tick: &Tick) {
        let kind = EventKind::Limit {
            port: index as u32,
            axis: hit.axis as u32,
            quantity: hit.quantity.key(),
            trip: hit.level == Level::Trip,
            value: hit.value,
            bound: hit.bound,
        };
        self.report(tick, kind);
    }

    /// Stale data are used as the policy says, a bounded number of times in a row. The test has no use for those that nobody
    /// ever measured.
    #[cold]
    pub(super) fn judge_age(&mut self, index: usize, tick: &Tick) -> Result<(), Stop> {
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        port.partner.stale += 1;
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
        let count = port.partner.stale;
        let is_made_up = self.riding && !port.partner.measured;
        self.report(
            tick,
            EventKind::Stale {
                port: index as u32,
                age,
            },
        );
        if on_stale == OnStale::Stop || count > in_a_row || is_made_up {
            return Err(Stop::Stale {
                port: index,
                ticks: count,
            });
        }
        Ok(())
    }

    /// Answers that were lost and stand in a later one: the forces of their commands are kept. Real-time: yes.
    #[cold]
    pub(super) fn note_recovered(&mut self, index: usize, tick: &Tick) {
        while let Some(sequence) = self.ports.get_mut(index).and_then(Port::recover) {
            let age = self.sequence.saturating_sub(sequence);
            let mut axis = 0;
            while let Some(&force) = self
                .ports
                .get(index)
                .and_then(|port| port.recovered.get(axis))
            {
                let kind = EventKind::Recovered {
                    port: index as u32,
                    axis: axis as u32,
                    age,
                    force,
                };
                self.report(tick, kind);
                axis += 1;
            }
        }
    }

    /// A specimen whose simulated actuator did not come to terms with it is counted; told more and more seldom. Real-time: yes.
    #[cold]
    pub(super) fn note_unsettled(&mut self, index: usize, tick: &Tick) {
        let Some(port) = self.ports.get_mut(index) else {
            return;
        };
        port.link.unsettled += 1;
        let ticks = port.link.unsettled;
        if ticks.is_power_of_two() {
            let port = index as u32;
            self.report(tick, EventKind::Unsettled { port, ticks });
        }
    }
}
