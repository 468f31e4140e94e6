//! Commands are judged before they leave; and what follows from what was found of a specimen in a tick: an event, a count, a value
//! in place of a missing one, or the end of the test. Everything here is on the real-time path, and out of its way where nothing was
//! found.

use super::telling::limit_event;
use super::tick::Tick;
use super::{Engine, Limits, Stop};
use crate::port::limits::{Found, Hit, Level};
use crate::port::{OnStale, Port};
use crate::record::{Event, LimitReached};
use crate::substructure::{Freshness, Status};

impl Engine {
    /// Judges the commands that stand ready, all of them: what trips beside the first that does is told, too. Only after it may
    /// they leave. Real-time: yes.
    pub(super) fn clear_commands(&mut self) -> Result<(), Stop> {
        let mut result = Ok(());
        for index in 0..self.ports.len() {
            if let Err(stop) = self.clear_command(index) {
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
    fn clear_command(&mut self, index: usize) -> Result<(), Stop> {
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        if self.riding && port.is_per_step() && !port.has_pending_target() {
            return Ok(());
        }
        let found = port.clear();
        if let Some(fault) = port.geometry_fault() {
            return Err(Stop::Geometry { port: index, fault });
        }
        if found.is_something() {
            let tick = self.tick_of_report();
            self.act_on(index, &found, &tick)?;
        }
        Ok(())
    }

    /// The specimen itself says that the test ends: what its answer is beyond is told beside that, and is asked for where the test
    /// is to go on. Real-time: yes.
    #[cold]
    pub(super) fn tell_beside(&mut self, index: usize, tick: &Tick) {
        let Some(port) = self.ports.get_mut(index) else {
            return;
        };
        let found = port.judge();
        // That it ends the test, too, changes nothing: what the specimen says comes first.
        let _ = self.act_on(index, &found, tick);
    }

    /// Warnings are told, a trip ends the test, and all that trip are told. Real-time: yes.
    #[cold]
    pub(super) fn act_on(&mut self, index: usize, found: &Found, tick: &Tick) -> Result<(), Stop> {
        for hit in found.warning.iter().chain(&found.trip) {
            self.report_hit(index, hit, tick);
        }
        while let Some(hit) = self.ports.get_mut(index).and_then(Port::next_untold) {
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
        let reached = LimitReached {
            port: Some(index as u32),
            axis: Some(hit.axis as u32),
            limit: hit.quantity.key().into(),
            value: hit.value,
            bound: hit.bound,
        };
        self.report(tick, limit_event(hit.level == Level::Trip, reached));
    }

    /// Stale data are used as the policy says, a bounded number of times in a row. The test has no use for those that nobody
    /// ever measured.
    #[cold]
    pub(super) fn judge_age(&mut self, index: usize, tick: &Tick) -> Result<(), Stop> {
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        let count = port.count_stale();
        // While it stands, numbers stand, too: there it is as old as the exchanges that brought nothing.
        let age = self.sequence.saturating_sub(port.raw().sequence);
        let age = age.max(count);
        let (on_stale, in_a_row) = stale_rules(port, &self.limits);
        if on_stale == OnStale::Extrapolate {
            port.extrapolate();
        }
        let is_made_up = self.riding && !port.has_answered();
        self.report(
            tick,
            Event::Stale {
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

    /// A specimen holds by its own watchdog, as it says: no command moves it then, and what it answers belongs to none. Each time is
    /// told. Where more answers in a row say so than stale ones are put up with, although commands come, the test ends. Real-time:
    /// yes.
    #[cold]
    pub(super) fn judge_holding(
        &mut self,
        index: usize,
        status: Status,
        freshness: Freshness,
        tick: &Tick,
    ) -> Result<(), Stop> {
        let Some(port) = self.ports.get_mut(index) else {
            return Ok(());
        };
        let before = port.holding_in_a_row();
        let holds = status.has(Status::HOLDING);
        let goes_on = holds && !status.has(Status::HELD);
        let answers = match (goes_on, freshness) {
            (true, Freshness::Fresh) => before + 1,
            (true, Freshness::Stale) => before.max(1),
            (false, Freshness::Fresh) => 0,
            // What is stale says nothing new.
            (false, Freshness::Stale) => before,
        };
        port.set_holding_in_a_row(answers);
        let (_, in_a_row) = stale_rules(port, &self.limits);
        if holds && before == 0 {
            port.count_hold();
            let port = index as u32;
            self.report(tick, Event::SpecimenHolds { port });
        }
        if answers > in_a_row {
            let port = index;
            return Err(Stop::HoldsOn { port, answers });
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
                .and_then(|port| port.recovered_force().get(axis))
            {
                let kind = Event::Recovered {
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
        let ticks = port.count_unsettled();
        if ticks.is_power_of_two() {
            let port = index as u32;
            self.report(tick, Event::Unsettled { port, ticks });
        }
    }
}

/// What is done with stale data of a specimen, and how many in a row are put up with. Real-time: yes.
fn stale_rules(port: &Port, limits: &Limits) -> (OnStale, u64) {
    match port.wait_rules() {
        Some(own) => (own.on_stale, own.stale_in_a_row),
        None if limits.extrapolate_stale => (OnStale::Extrapolate, limits.stale_in_a_row),
        None => (OnStale::Hold, limits.stale_in_a_row),
    }
}
