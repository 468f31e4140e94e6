//! The second look: what a controller announced in the handshake, kept by the specimen's end as well.

use super::{AxisLimits, AxisUnits, Trip, USUAL_TICK_S, Watch};
use crate::link::announce;
use crate::link::rig::Visitor;

/// What one controller has announced.
#[derive(Debug)]
pub(super) struct Announced {
    limits: Vec<AxisLimits>,
    watch: Watch,
    /// Wall time from one command to the next, as announced.
    period_s: f64,
    last: Option<u64>,
}

impl Announced {
    /// None if the protocol has no limits.
    pub fn by(visitor: &Visitor, units: &[AxisUnits]) -> Option<Self> {
        if visitor.limits.len() != units.len() {
            return None;
        }
        let axes = visitor.limits.iter().zip(units);
        let limits: Vec<_> = axes
            .map(|(limits, units)| announce::kept(limits, units))
            .collect();
        let period_s = visitor.rate.map_or(USUAL_TICK_S, |(commands, seconds)| {
            seconds as f64 / commands as f64
        });
        Some(Self {
            watch: Watch::new(limits.clone(), period_s),
            limits,
            period_s,
            last: None,
        })
    }

    /// From here the next command goes.
    pub fn begin(&mut self, disp: impl Iterator<Item = f64>) {
        self.watch = Watch::new(self.limits.clone(), self.period_s);
        self.watch.stands_at(disp);
        self.last = None;
    }

    /// Judges a command of the controller; lost ones before it give it more time. Real-time: yes.
    pub fn command(
        &mut self,
        sequence: u64,
        disp: impl Iterator<Item = f64> + Clone,
    ) -> Result<(), Trip> {
        let commands = self
            .last
            .map_or(1, |last| sequence.saturating_sub(last).max(1));
        self.watch.tick_is(self.period_s * commands as f64);
        let found = self.watch.command(disp.clone());
        if let Some(hit) = found.trip {
            return Err(Trip::Announced(hit));
        }
        self.last = Some(sequence);
        self.watch.sent(disp);
        Ok(())
    }

    /// Judges what was measured. Real-time: yes.
    pub fn measured(&mut self, values: impl Iterator<Item = (f64, f64)>) -> Result<(), Trip> {
        let found = self.watch.measured(values);
        found.trip.map_or(Ok(()), |hit| Err(Trip::Announced(hit)))
    }
}
