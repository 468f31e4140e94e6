//! Judges the limits of the test as a whole at every step and at every deadline miss.

use super::environment::Environment;
use super::numerical::Side;
use super::stop::Stop;
use super::test_hit::TestHit;
use super::test_limits::{TestLimits, Worst, value, worst};
use super::tick::Tick;
use crate::port::Port;
use crate::port::limits::Level;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::state;
use gusset_record::{Event, LimitReached};

/// Judges the limits of the test as a whole, and remembers what was warned of.
pub(super) struct TestJudge {
    limits: TestLimits,
    /// A bit for each limit beyond its warning level.
    warned: u32,
}

state! { TestJudge { warned } keeps { limits } }

impl TestJudge {
    /// With these limits; nothing was warned of.
    pub(crate) const fn new(limits: TestLimits) -> Self {
        Self { limits, warned: 0 }
    }

    /// The limits.
    pub(crate) const fn limits(&self) -> &TestLimits {
        &self.limits
    }

    /// Judges a step: all limits of it, and the first that trips ends the test. Real-time: yes.
    ///
    /// # Errors
    /// A limit tripped.
    #[inline]
    pub(crate) fn judge_step(
        &mut self,
        tick: &Tick,
        side: &Side,
        ports: &[Port],
        environment: &mut Environment,
    ) -> Result<(), Stop> {
        let mut result = Ok(());
        let mut place = 0;
        while let Some((limit, in_row)) = environment.journal.row.kept_at(place) {
            place += 1;
            // What cannot be estimated is no finding; a step that leaves no number is one.
            let is_estimate = matches!(limit, Limit::StabilityUsed | Limit::DelayUsed);
            let bound = self.limits.of_test(limit);
            // Estimates are made of measurements only: nothing has changed since the row. The others know of the step.
            let value = if is_estimate {
                in_row
            } else {
                value(limit, side, ports)
            };
            let judged = if value.is_nan() && is_estimate {
                None
            } else {
                bound.judge(value)
            };
            let from = || worst(limit, side, ports);
            result = result.and(self.heed(tick, limit, value, judged, &from, environment));
        }
        result
    }

    /// Judges a miss that was just counted, except for [`TestJudge::misses_beyond`]. Real-time: yes.
    ///
    /// # Errors
    /// A limit tripped.
    pub(crate) fn judge_misses(
        &mut self,
        tick: &Tick,
        environment: &mut Environment,
    ) -> Result<(), Stop> {
        let mut result = Ok(());
        for (limit, found) in [
            (Limit::MissesInARow, environment.deadlines.in_a_row()),
            (
                Limit::MissesInWindow,
                environment.journal.row.lateness.in_window,
            ),
            (Limit::Misses, environment.deadlines.total()),
        ] {
            let mut bound = self.limits.of_test(limit);
            if limit != Limit::MissesInWindow {
                bound.trip = f64::INFINITY;
            }
            let value = found as f64;
            let judged = bound.judge(value);
            result = result.and(self.heed(tick, limit, value, judged, &|| None, environment));
        }
        result
    }

    /// More misses in a row or in total than allowed: the limit, how many, and how many are allowed. Real-time: yes.
    pub(crate) fn misses_beyond(&self, in_a_row: u64, total: u64) -> Option<(Limit, f64, f64)> {
        [(Limit::MissesInARow, in_a_row), (Limit::Misses, total)]
            .map(|(limit, found)| (limit, found as f64, self.limits.of_test(limit).trip))
            .into_iter()
            .find(|(_, found, most)| found > most)
    }

    /// A warning is reported when its level is crossed, a trip ends the test. Real-time: yes.
    #[inline]
    fn heed(
        &mut self,
        tick: &Tick,
        limit: Limit,
        value: f64,
        judged: Option<(Level, f64)>,
        from: &dyn Fn() -> Option<Worst>,
        environment: &mut Environment,
    ) -> Result<(), Stop> {
        match judged {
            None => {
                self.warned &= !limit.bit();
                Ok(())
            }
            Some(beyond) => self.heed_hit(tick, limit, value, beyond, from, environment),
        }
    }

    #[cold]
    fn heed_hit(
        &mut self,
        tick: &Tick,
        quantity: Limit,
        value: f64,
        (level, bound): (Level, f64),
        from: &dyn Fn() -> Option<Worst>,
        environment: &mut Environment,
    ) -> Result<(), Stop> {
        let bit = quantity.bit();
        let trip = level == Level::Trip;
        let worst = from();
        let axis = worst.and_then(Worst::axis);
        if trip || self.warned & bit == 0 {
            self.warned |= bit;
            let reached = LimitReached {
                port: axis.map(|(port, _)| port as u32),
                axis: axis.map(|(_, axis)| axis as u32),
                limit: quantity.key().into(),
                value,
                bound,
            };
            environment.report(tick, limit_event(trip, reached));
        }
        if !trip {
            return Ok(());
        }
        Err(Stop::TestLimit(TestHit {
            quantity,
            value,
            bound,
            worst,
            in_warm_up: false,
        }))
    }
}

/// The event of a limit that was reached. Real-time: yes.
pub(super) fn limit_event(trip: bool, reached: LimitReached) -> Event {
    if trip {
        Event::LimitTrip(reached)
    } else {
        Event::LimitWarning(reached)
    }
}
