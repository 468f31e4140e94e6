//! Limits of the test as a whole: what belongs to no specimen alone.

use super::misses::{MissLevels, Missed};
use super::numerical::Side;
use super::telling::limit_event;
use super::tick::Tick;
use super::{Engine, Limits, Stop};
use crate::control::Port;
use crate::control::limits::{Bound, Level};
use crate::record::LimitReached;

/// What is limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum TestQuantity {
    /// Share of the room for stability that tangents beyond their declared bounds use up.
    StabilityUsed,
    /// The largest share of its critical delay that the lag of a specimen uses up.
    DelayUsed,
    /// What the exact audit of the steps leaves over, in parts of the energy that was turned over.
    StepAudit,
    /// Energy that the transfer systems have added, in parts of what the test has taken in.
    AddedEnergyShare,
    /// Deadline misses in a row.
    MissesInARow,
    /// Deadline misses in a stretch of time.
    MissesInWindow,
    /// Deadline misses in all.
    Misses,
}

impl TestQuantity {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::StabilityUsed,
        Self::DelayUsed,
        Self::StepAudit,
        Self::AddedEnergyShare,
        Self::MissesInARow,
        Self::MissesInWindow,
        Self::Misses,
    ];

    /// Those that stand in the row.
    const RECORDED: [Self; 4] = [
        Self::StabilityUsed,
        Self::DelayUsed,
        Self::StepAudit,
        Self::AddedEnergyShare,
    ];

    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::StabilityUsed => "stability margin used by tangents beyond their declared bounds",
            Self::DelayUsed => {
                "lag in parts of the critical delay at the stiffness of the last seconds"
            }
            Self::StepAudit => "energy that the exact audit of the steps leaves over, relative",
            Self::AddedEnergyShare => {
                "energy that the transfer systems have added, in parts of what the test has taken in"
            }
            Self::MissesInARow => "deadlines missed in a row",
            Self::MissesInWindow => "deadlines missed in the last while",
            Self::Misses => "deadlines missed",
        }
    }

    /// The key of the test file, and the name of the column.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::StabilityUsed => "stability_used",
            Self::DelayUsed => "delay_used",
            Self::StepAudit => "step_audit",
            Self::AddedEnergyShare => "added_energy_share",
            Self::MissesInARow => "max_consecutive_misses",
            Self::MissesInWindow => "max_misses_in_window",
            Self::Misses => "max_total_misses",
        }
    }

    const fn bit(self) -> u8 {
        1 << self as u8
    }

    /// Whether it counts deadlines that were missed.
    #[must_use]
    pub const fn is_of_misses(self) -> bool {
        matches!(
            self,
            Self::MissesInARow | Self::MissesInWindow | Self::Misses
        )
    }

    /// Whether it is kept in such a test.
    fn is_kept(self, side: &Side, ports: &[Port]) -> bool {
        match (self, side) {
            (Self::StabilityUsed, Side::Structure(_)) => {
                !ports.is_empty() && ports.iter().all(Port::knows_stability)
            }
            (Self::DelayUsed, Side::Structure(_)) => ports.iter().any(Port::knows_margin),
            (Self::StepAudit, Side::Structure(numerical)) => numerical.audit().is_some(),
            (Self::AddedEnergyShare, Side::Structure(numerical)) => {
                numerical.intake().is_some() && !ports.is_empty()
            }
            _ => false,
        }
    }

    /// Its value. Real-time: yes.
    #[inline]
    pub(super) fn value(self, side: &Side, ports: &[Port]) -> f64 {
        match (self, side) {
            (Self::StabilityUsed, _) => {
                let used = |port: &Port| port.stability_used().unwrap_or(f64::NAN);
                ports.iter().fold(-0.0, |sum, port| sum + used(port))
            }
            (Self::DelayUsed, _) => {
                let ports = ports.iter().map(Port::delay_used);
                // A number wins against none.
                ports.fold(f64::NAN, f64::max)
            }
            (Self::StepAudit, Side::Structure(numerical)) => numerical
                .audit()
                .map_or(f64::NAN, super::audit::StepAudit::relative),
            (Self::AddedEnergyShare, Side::Structure(numerical)) => {
                let added = ports.iter().fold(0.0, |sum, port| port.added_energy(sum));
                let intake = numerical.intake();
                intake.map_or(f64::NAN, |intake| intake.share(added))
            }
            _ => f64::NAN,
        }
    }

    /// Specimen and axis, from 0, that have the most of it, where it is made of what each of them has.
    fn worst(self, ports: &[Port]) -> Option<(usize, usize)> {
        let mut worst: Option<(f64, usize, usize)> = None;
        let mut note = |port: usize, shares: &mut dyn Iterator<Item = f64>| {
            for (axis, share) in shares.enumerate() {
                if share > worst.map_or(0.0, |(most, ..)| most) {
                    worst = Some((share, port, axis));
                }
            }
        };
        for (index, port) in ports.iter().enumerate() {
            match self {
                Self::StabilityUsed => note(index, &mut port.stability_used_by_axis()),
                Self::DelayUsed => note(index, &mut port.delay_used_by_axis()),
                _ => {}
            }
        }
        worst.map(|(_, port, axis)| (port, axis))
    }

    /// What is kept, of what belongs to no specimen alone and is judged at every step: it stands in the row, in this order.
    #[must_use]
    pub fn kept(side: &Side, ports: &[Port]) -> Vec<Self> {
        let mut kept = Self::RECORDED.to_vec();
        kept.retain(|quantity| quantity.is_kept(side, ports));
        kept
    }
}

/// Levels of all that belongs to the test as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct TestLimits {
    /// Of [`TestQuantity::StabilityUsed`].
    pub stability_used: Bound,
    /// Of [`TestQuantity::DelayUsed`].
    pub delay_used: Bound,
    /// Of [`TestQuantity::StepAudit`].
    pub step_audit: Bound,
    /// Of [`TestQuantity::AddedEnergyShare`].
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
    pub fn of_test(&self, quantity: TestQuantity) -> Bound {
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
            TestQuantity::StabilityUsed => test.stability_used,
            TestQuantity::DelayUsed => test.delay_used,
            TestQuantity::StepAudit => test.step_audit,
            TestQuantity::AddedEnergyShare => test.added_energy_share,
            TestQuantity::MissesInARow => counts(test.misses.warn_in_a_row, self.misses_in_a_row),
            TestQuantity::MissesInWindow => {
                counts(test.misses.warn_in_window, test.misses.most_in_window)
            }
            TestQuantity::Misses => counts(test.misses.warn_in_all, self.misses_in_total),
        }
    }
}

/// One limit of the test that was reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestHit {
    /// Of what.
    pub quantity: TestQuantity,
    /// What was found.
    pub value: f64,
    /// What is allowed.
    pub bound: f64,
    /// Specimen and axis, from 0, that have the most of it, where that can be said.
    pub worst: Option<(usize, usize)>,
    /// It was found in the warm-up, and the test was not begun.
    pub in_warm_up: bool,
}

impl std::fmt::Display for TestHit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            quantity,
            value,
            bound,
            worst,
            in_warm_up,
        } = self;
        let (words, key) = (quantity.words(), quantity.key());
        match quantity {
            TestQuantity::MissesInARow if *in_warm_up => write!(
                f,
                "not ready: the warm-up ends with {value} {words}, allowed {bound} ({key}); the test was not begun"
            ),
            TestQuantity::MissesInWindow | TestQuantity::Misses if *in_warm_up => write!(
                f,
                "not ready: the warm-up lets expect {value} {words}, allowed {bound} ({key}); the test was not begun"
            ),
            TestQuantity::StabilityUsed
            | TestQuantity::DelayUsed
            | TestQuantity::StepAudit
            | TestQuantity::AddedEnergyShare => {
                write!(f, "{words}: {value:.3e}, allowed {bound:.3e} ({key})")?;
                worst.map_or(Ok(()), |(port, axis)| {
                    write!(
                        f,
                        ", most of it of specimen {}, axis {}",
                        port + 1,
                        axis + 1
                    )
                })
            }
            _ => write!(f, "{words}: {value}, allowed {bound} ({key})"),
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
                TestQuantity::StabilityUsed => (limits.stability_used, true),
                TestQuantity::DelayUsed => (limits.delay_used, true),
                TestQuantity::AddedEnergyShare => (limits.added_energy_share, false),
                _ => (limits.step_audit, false),
            };
            // Estimates are made of measurements only: nothing has changed since the row. The others know of the step.
            let value = if is_estimate {
                in_row
            } else {
                quantity.value(&self.side, &self.ports)
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
            in_window: self.miss_window.note(self.edge),
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
        quantity: TestQuantity,
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
        quantity: TestQuantity,
        value: f64,
        (level, bound): (Level, f64),
    ) -> Result<(), Stop> {
        let bit = quantity.bit();
        let trip = level == Level::Trip;
        let worst = quantity.worst(&self.ports);
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
