//! Limits of the test as a whole: what belongs to no specimen alone.

use super::misses::{MissLevels, Missed};
use super::numerical::Side;
use super::telling::limit_event;
use super::test_hit::TestHit;
use super::tick::Tick;
use super::{Engine, Limits, Stop};
use crate::catalog::limit::{Judges, Limit};
use crate::control::Port;
use crate::control::limits::{Bound, Level};
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
        _ => f64::NAN,
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

/// Levels of all that belongs to the test as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct TestLimits {
    /// Of [`Limit::StabilityUsed`].
    pub stability_used: Bound,
    /// Of [`Limit::DelayUsed`].
    pub delay_used: Bound,
    /// Of [`Limit::StepAudit`].
    pub step_audit: Bound,
    /// Of [`Limit::AddedEnergyShare`].
    pub added_energy_share: Bound,
    /// Of misses, beside those that [`super::Limits`] has.
    pub misses: MissLevels,
}

impl Default for TestLimits {
    fn default() -> Self {
        Self {
            stability_used: Bound::NONE,
            delay_used: Bound::NONE,
            step_audit: Bound::NONE,
            added_energy_share: Bound::NONE,
            misses: MissLevels::NONE,
        }
    }
}

impl Limits {
    /// The levels of what belongs to the test as a whole, infinite where there is none.
    #[must_use]
    pub fn of_test(&self, quantity: Limit) -> Bound {
        let test = &self.test;
        let counts = |warn: u64, trip: u64| {
            let level = |count: u64| match count {
                u64::MAX => f64::INFINITY,
                count => count as f64,
            };
            Bound {
                warn: level(warn),
                trip: level(trip),
            }
        };
        match quantity {
            Limit::StabilityUsed => test.stability_used,
            Limit::DelayUsed => test.delay_used,
            Limit::StepAudit => test.step_audit,
            Limit::AddedEnergyShare => test.added_energy_share,
            Limit::MissesInARow => counts(test.misses.warn_in_a_row, self.misses_in_a_row),
            Limit::MissesInWindow => counts(test.misses.warn_in_window, test.misses.most_in_window),
            Limit::Misses => counts(test.misses.warn_in_all, self.misses_in_total),
            _ => Bound::NONE,
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
            let limits = &self.limits.test;
            // What cannot be estimated is no finding; a step that leaves no number is one.
            let (bound, is_estimate) = match quantity {
                Limit::StabilityUsed => (limits.stability_used, true),
                Limit::DelayUsed => (limits.delay_used, true),
                Limit::AddedEnergyShare => (limits.added_energy_share, false),
                _ => (limits.step_audit, false),
            };
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

    /// Judges a miss that was just counted. Real-time: yes.
    pub(super) fn judge_misses(&mut self, tick: &Tick) -> Result<(), Stop> {
        let missed = Missed {
            in_a_row: self.misses_in_a_row,
            in_window: self.row.lateness.in_window,
            in_all: self.misses,
        };
        let mut result = Ok(());
        for (quantity, value, judged) in self.limits.test.misses.judge(missed) {
            result = result.and(self.heed(tick, quantity, value, judged));
        }
        result
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
