//! The ramp: every specimen goes from its last command to the next one, along half a cosine.
//!
//! All ramps end in the same tick, and none uses more than a share of a speed limit. No specimen moves before all have replied:
//! how long that may take is bounded by how many replies may stay away in a row. A hold stretches the time of the way.

use super::cycle::{Engine, Maneuver};
use super::order::Order;
use super::phase::Phase;
use super::{Ending, Stop};
use crate::port::{Port, SHARE_OF_SPEED};
use gusset_record::rt::timing::TickStamps;

/// The operator's hold over a motion: its pace falls from 1 to 0 and rises again.
#[derive(Debug, Clone, Copy)]
pub(super) struct HoldRamp(f64);

impl HoldRamp {
    /// At full pace, or at rest in a hold.
    pub(crate) fn new(engine: &Engine<'_>) -> Self {
        let held = engine.environment.supervision.is_held();
        Self(if held { 0.0 } else { 1.0 })
    }

    /// The pace of the next tick; none if nothing moves in it.
    pub(crate) fn next(&mut self, engine: &Engine<'_>) -> Option<f64> {
        let held = engine.environment.supervision.is_held();
        self.0 = engine.progress.pacer().eased(self.0, held);
        (self.0 != 0.0).then_some(self.0)
    }
}

/// Where a ramp is.
#[derive(Debug, Clone, Copy)]
enum Way {
    /// Some specimens have not replied yet.
    Awaits,
    /// The ticks of the way that are gone, and the hold ramp that sets the pace.
    Goes(f64, HoldRamp),
}

/// One ramp of all specimens.
pub(super) struct Ramp {
    phase: Phase,
    /// Ticks of the whole way.
    ticks: f64,
    /// Test time of the whole way, in s.
    seconds: f64,
    way: Way,
}

impl Ramp {
    /// Begins the ramp of every specimen to its next command. Returns the ticks of the longest way. `seconds` is the time of one
    /// way with the share of a speed limit that may be used.
    pub(crate) fn ticks(engine: &mut Engine<'_>, seconds: impl Fn(&Port, f64) -> f64) -> u64 {
        // The poses on its way say how fast it is.
        engine.ports.iter_mut().for_each(Port::begin_ramp);
        let ways = engine.ports.iter();
        let ways = ways.map(|port| seconds(port, SHARE_OF_SPEED));
        let longest = ways.fold(0.0, f64::max);
        (longest / engine.environment.pace.period_s()).ceil() as u64
    }

    /// The ramp that was begun, over this number of ticks.
    ///
    /// # Errors
    /// A command at rest passes a limit.
    pub(crate) fn of(ticks: u64, phase: Phase, engine: &mut Engine<'_>) -> Result<Self, Stop> {
        let whole = ticks as f64;
        let seconds = whole * engine.tick_passes();
        let all_replied = Self::all_replied(engine);
        if !all_replied {
            for port in &mut *engine.ports {
                port.ramp_to(0.0, seconds);
            }
            engine.judge_commands()?;
        }
        Ok(Self {
            phase,
            ticks: whole,
            seconds,
            way: Way::Awaits,
        })
    }

    /// Performs a ramp from the last commands to the next ones, if they differ.
    ///
    /// # Errors
    /// The test ends.
    pub(crate) fn perform(engine: &mut Engine<'_>) -> Result<(), Stop> {
        let (tick, shortest) = (
            engine.environment.pace.period_s(),
            engine.plan.opening.ramp_s,
        );
        let ticks = Self::ticks(engine, |port, share| port.ramp_time(share, tick, shortest));
        if ticks == 0 {
            return Ok(());
        }
        engine.environment.enter(Phase::Ramping, Ending::Completed);
        let mut ramp = Self::of(ticks, Phase::Ramping, engine)?;
        engine.perform(&mut ramp)?;
        engine.environment.deadlines.forget_timing();
        Ok(())
    }

    fn all_replied(engine: &Engine<'_>) -> bool {
        engine
            .ports
            .iter()
            .all(|port| port.exchange().has_answered())
    }
}

impl Maneuver for Ramp {
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        if let Way::Awaits = self.way {
            if !Self::all_replied(engine) {
                return Ok(Some(engine.still(self.phase)));
            }
            self.way = Way::Goes(0.0, HoldRamp::new(engine));
        }
        let Way::Goes(gone, hold) = &mut self.way else {
            return Ok(None);
        };
        if *gone >= self.ticks {
            return Ok(None);
        }
        let Some(pace) = hold.next(engine) else {
            return Ok(Some(engine.still(self.phase)));
        };
        *gone = (*gone + pace).min(self.ticks);
        for port in &mut *engine.ports {
            port.ramp_to(*gone / self.ticks, self.seconds / pace);
        }
        engine.judge_commands()?;
        let passes = engine.tick_passes();
        let tick = engine.environment.place.at_rest(passes * pace);
        Ok(Some(Order::moving(tick, self.phase)))
    }

    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        order: &Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        if order.is_still() {
            engine.reuse_number();
            return Ok(());
        }
        engine.accept()
    }
}
