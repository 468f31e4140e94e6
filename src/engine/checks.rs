//! Limits of the test as a whole: what belongs to no specimen alone.

use super::numerical::Side;
use super::telling::limit_event;
use super::test_hit::TestHit;
use super::tick::Tick;
use super::{Engine, Stop};
use crate::catalog::limit::{AXIS_LIMITS, Judges, LIMITS, Limit};
use crate::port::Port;
use crate::port::limits::{Bound, Level};
use crate::record::LimitReached;

/// Limits of the test that are judged at every step, in the order of their columns.
const OF_STEPS: [Limit; 4] = Limit::judging(&[Judges::Step]);

/// Whether a limit is judged in such a test.
fn is_kept(limit: Limit, side: &Side, ports: &[Port]) -> bool {
    match (limit, side) {
        (Limit::StabilityUsed, Side::Structure(_)) => {
            !ports.is_empty() && ports.iter().all(Port::knows_stability)
        }
        (Limit::DelayUsed, Side::Structure(_)) => ports.iter().any(Port::knows_margin),
        (Limit::StepAudit, Side::Structure(numerical)) => numerical.audit().is_some(),
        (Limit::AddedEnergyShare, Side::Structure(numerical)) => {
            numerical.intake().is_some() && !ports.is_empty()
        }
        _ => false,
    }
}

/// The value that a limit judges. Real-time: yes.
#[inline]
pub(super) fn value(limit: Limit, side: &Side, ports: &[Port]) -> f64 {
    match (limit, side) {
        (Limit::StabilityUsed, _) => {
            let used = |port: &Port| port.stability_used().unwrap_or(f64::NAN);
            ports.iter().fold(-0.0, |sum, port| sum + used(port))
        }
        (Limit::DelayUsed, _) => {
            let ports = ports.iter().map(Port::delay_used);
            // A number wins against none.
            ports.fold(f64::NAN, f64::max)
        }
        (Limit::StepAudit, Side::Structure(numerical)) => numerical
            .audit()
            .map_or(f64::NAN, super::audit::StepAudit::relative),
        (Limit::AddedEnergyShare, Side::Structure(numerical)) => {
            let added = ports.iter().fold(0.0, |sum, port| port.added_energy(sum));
            let intake = numerical.intake();
            intake.map_or(f64::NAN, |intake| intake.share(added))
        }
        (Limit::StepAudit | Limit::AddedEnergyShare, Side::Prescribed(_)) => f64::NAN,
        // No limits of the steps of a test. A new limit of these must be computed above.
        (
            Limit::CommandDisp
            | Limit::CommandStep
            | Limit::CommandVel
            | Limit::CommandAccel
            | Limit::MeasuredDisp
            | Limit::MeasuredForce
            | Limit::FollowingError
            | Limit::ForceStep
            | Limit::StuckSensor
            | Limit::SensorDisp
            | Limit::SensorForce
            | Limit::Alternation
            | Limit::StiffnessRatio
            | Limit::DampingRatio
            | Limit::AddedEnergy
            | Limit::Lag
            | Limit::GainError
            | Limit::MissesInARow
            | Limit::MissesInWindow
            | Limit::Misses,
            _,
        ) => f64::NAN,
    }
}

/// Specimen and axis, from 0, with the largest part of the value, where it is a sum or a maximum over them.
fn worst(limit: Limit, ports: &[Port]) -> Option<(usize, usize)> {
    let mut worst: Option<(f64, usize, usize)> = None;
    let mut note = |port: usize, shares: &mut dyn Iterator<Item = f64>| {
        for (axis, share) in shares.enumerate() {
            if share > worst.map_or(0.0, |(most, ..)| most) {
                worst = Some((share, port, axis));
            }
        }
    };
    for (index, port) in ports.iter().enumerate() {
        match limit {
            Limit::StabilityUsed => note(index, &mut port.stability_used_by_axis()),
            Limit::DelayUsed => note(index, &mut port.delay_used_by_axis()),
            _ => {}
        }
    }
    worst.map(|(_, port, axis)| (port, axis))
}

/// The limits that are judged at every step of such a test. Each has a column, in this order.
#[must_use]
pub fn kept_limits(side: &Side, ports: &[Port]) -> Vec<Limit> {
    let mut kept = OF_STEPS.to_vec();
    kept.retain(|limit| is_kept(*limit, side, ports));
    kept
}

/// Levels of the limits of the test as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct TestLimits {
    /// In the order of [`Limit::OF_TEST`]; infinite where there is no level.
    levels: [Bound; LIMITS - AXIS_LIMITS],
    /// Length in ticks of the window of [`Limit::MissesInWindow`].
    pub window_ticks: u64,
}

impl TestLimits {
    /// No level at all.
    pub const NONE: Self = Self {
        levels: [Bound::NONE; LIMITS - AXIS_LIMITS],
        window_ticks: 0,
    };

    /// The levels of a limit; none of one that belongs to an axis. Real-time: yes.
    #[must_use]
    pub fn of_test(&self, limit: Limit) -> Bound {
        let place = limit.place_in_test();
        let levels = place.and_then(|place| self.levels.get(place));
        levels.copied().unwrap_or(Bound::NONE)
    }

    /// Sets the levels of a limit of the test.
    pub fn set(&mut self, limit: Limit, levels: Bound) {
        let place = limit.place_in_test();
        if let Some(place) = place.and_then(|place| self.levels.get_mut(place)) {
            *place = levels;
        }
    }
}

impl Engine {
    /// Judges the test as a whole: all of it, and the first that trips ends it. Real-time: yes.
    #[inline]
    pub(super) fn judge_test(&mut self, tick: &Tick) -> Result<(), Stop> {
        let mut result = Ok(());
        let mut place = 0;
        while let Some((quantity, in_row)) = self.row.kept_at(place) {
            place += 1;
            // What cannot be estimated is no finding; a step that leaves no number is one.
            let is_estimate = matches!(quantity, Limit::StabilityUsed | Limit::DelayUsed);
            let bound = self.limits.test.of_test(quantity);
            // Estimates are made of measurements only: nothing has changed since the row. The others know of the step.
            let value = if is_estimate {
                in_row
            } else {
                value(quantity, &self.side, &self.ports)
            };
            let judged = if value.is_nan() && is_estimate {
                None
            } else {
                bound.judge(value)
            };
            result = result.and(self.heed(tick, quantity, value, judged));
        }
        result
    }

    /// Judges a miss that was just counted, except for [`Engine::misses_beyond`]. Real-time: yes.
    pub(super) fn judge_misses(&mut self, tick: &Tick) -> Result<(), Stop> {
        let mut result = Ok(());
        for (limit, found) in [
            (Limit::MissesInARow, self.misses_in_a_row),
            (Limit::MissesInWindow, self.row.lateness.in_window),
            (Limit::Misses, self.misses),
        ] {
            let mut bound = self.limits.test.of_test(limit);
            if limit != Limit::MissesInWindow {
                bound.trip = f64::INFINITY;
            }
            let value = found as f64;
            result = result.and(self.heed(tick, limit, value, bound.judge(value)));
        }
        result
    }

    /// More misses in a row or in total than allowed: the limit, how many, and how many are allowed. Real-time: yes.
    pub(super) fn misses_beyond(&self) -> Option<(Limit, f64, f64)> {
        [
            (Limit::MissesInARow, self.misses_in_a_row),
            (Limit::Misses, self.misses),
        ]
        .map(|(limit, found)| (limit, found as f64, self.limits.test.of_test(limit).trip))
        .into_iter()
        .find(|(_, found, most)| found > most)
    }

    /// A warning is told when its level is crossed, a trip ends the test. Real-time: yes.
    #[inline]
    fn heed(
        &mut self,
        tick: &Tick,
        quantity: Limit,
        value: f64,
        judged: Option<(Level, f64)>,
    ) -> Result<(), Stop> {
        match judged {
            None => {
                self.test_warned &= !quantity.bit();
                Ok(())
            }
            Some(beyond) => self.heed_hit(tick, quantity, value, beyond),
        }
    }

    #[cold]
    fn heed_hit(
        &mut self,
        tick: &Tick,
        quantity: Limit,
        value: f64,
        (level, bound): (Level, f64),
    ) -> Result<(), Stop> {
        let bit = quantity.bit();
        let trip = level == Level::Trip;
        let worst = worst(quantity, &self.ports);
        if trip || self.test_warned & bit == 0 {
            self.test_warned |= bit;
            self.report(
                tick,
                limit_event(
                    trip,
                    LimitReached {
                        port: worst.map(|(port, _)| port as u32),
                        axis: worst.map(|(_, axis)| axis as u32),
                        limit: quantity.key().into(),
                        value,
                        bound,
                    },
                ),
            );
        }
        if trip {
            Err(Stop::TestLimit(TestHit {
                quantity,
                value,
                bound,
                worst,
                in_warm_up: false,
            }))
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_of_the_test_has_its_own_level_and_is_passed_only_beyond_it() {
        let mut limits = TestLimits::NONE;
        for (count, limit) in (1..).zip(Limit::OF_TEST) {
            let warn = f64::from(2 * count);
            let trip = warn + 1.0;
            limits.set(limit, Bound { warn, trip });
        }
        for (count, limit) in (1..).zip(Limit::OF_TEST) {
            let level = f64::from(2 * count);
            let judged = [level, level + 1.0, level + 2.0];
            let judged = judged.map(|value| limits.of_test(limit).judge(value));
            let warned = Some((Level::Warning, level));
            let tripped = Some((Level::Trip, level + 1.0));
            assert_eq!(judged, [None, warned, tripped], "{limit:?}");
        }
        limits.set(Limit::CommandDisp, Bound::trip(1.0));
        assert_eq!(limits.of_test(Limit::CommandDisp), Bound::NONE);
    }
}
