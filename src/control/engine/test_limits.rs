//! Limits of the test as a whole: what belongs to no specimen alone.

use super::numerical::Numerical;
use super::numerical::Side;
use crate::port::Port;
use crate::port::limits::Bound;
use gusset_numerics::integrate::Massless;
use gusset_quantity::catalog::limit::{AXIS_LIMITS, Judges, LIMITS, Limit};

/// Limits of the test that are judged at every step, in the order of their columns.
const OF_STEPS: [Limit; 5] = Limit::judging(&[Judges::Step]);

/// Whether a limit is judged in such a test.
fn is_kept(limit: Limit, side: &Side, ports: &[Port]) -> bool {
    match (limit, side) {
        (Limit::StabilityUsed, Side::Structure(_)) => {
            !ports.is_empty() && ports.iter().all(|port| port.estimates().knows_stability())
        }
        (Limit::DelayUsed, Side::Structure(_)) => {
            ports.iter().any(|port| port.tracking().knows_margin())
        }
        (Limit::StepAudit, Side::Structure(numerical)) => numerical.audit.as_ref().is_some(),
        (Limit::AddedEnergyShare, Side::Structure(numerical)) => {
            numerical.intake().is_some() && !ports.is_empty()
        }
        (Limit::StaticUnbalance, Side::Structure(numerical)) => {
            numerical.massless().is_some() || numerical.structure.members().can_lack_balance()
        }
        _ => false,
    }
}

/// The value that a limit judges. Real-time: yes.
#[inline]
pub(super) fn value(limit: Limit, side: &Side, ports: &[Port]) -> f64 {
    match (limit, side) {
        (Limit::StabilityUsed, _) => {
            let used = |port: &Port| port.estimates().total_stability_used().unwrap_or(f64::NAN);
            ports.iter().fold(-0.0, |sum, port| sum + used(port))
        }
        (Limit::DelayUsed, _) => {
            let ports = ports.iter().map(|port| port.tracking().delay_used());
            // A number wins against none.
            ports.fold(f64::NAN, f64::max)
        }
        (Limit::StepAudit, Side::Structure(numerical)) => numerical
            .audit
            .as_ref()
            .map_or(f64::NAN, super::audit::StepAudit::relative),
        (Limit::AddedEnergyShare, Side::Structure(numerical)) => {
            let added = ports
                .iter()
                .fold(0.0, |sum, port| port.estimates().added_energy(sum));
            let intake = numerical.intake();
            intake.map_or(f64::NAN, |intake| intake.share(added))
        }
        (Limit::StaticUnbalance, Side::Structure(numerical)) => {
            let [of_rows, of_members] = unbalances(numerical);
            // One that is not a number wins.
            if of_rows >= of_members || of_rows.is_nan() {
                of_rows
            } else {
                of_members
            }
        }
        (Limit::StepAudit | Limit::AddedEnergyShare | Limit::StaticUnbalance, _) => f64::NAN,
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

/// The lasting unbalance of the rows without mass, and that along members. Real-time: yes.
fn unbalances(numerical: &Numerical) -> [f64; 2] {
    let of_rows = numerical
        .massless()
        .map_or(0.0, Massless::lasting_unbalance);
    [of_rows, numerical.structure.members().lasting_unbalance()]
}

/// Where a value comes from that is a sum or a maximum, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Worst {
    /// Specimen and axis with the largest part.
    Axis(usize, usize),
    /// Degree of freedom with the largest part.
    Dof(usize),
    /// Number, from 1, of the member of a frame with the largest value.
    Member(usize),
}

impl Worst {
    /// Specimen and axis.
    #[must_use]
    pub fn axis(self) -> Option<(usize, usize)> {
        match self {
            Self::Axis(port, axis) => Some((port, axis)),
            Self::Dof(_) | Self::Member(_) => None,
        }
    }
}

/// Where the largest part of the value comes from.
pub(super) fn worst(limit: Limit, side: &Side, ports: &[Port]) -> Option<Worst> {
    if let (Limit::StaticUnbalance, Side::Structure(numerical)) = (limit, side) {
        let [of_rows, of_members] = unbalances(numerical);
        return match numerical.massless() {
            Some(massless) if of_rows >= of_members || of_rows.is_nan() => {
                Some(Worst::Dof(massless.worst_dof()))
            }
            _ => numerical.structure.members().worst().map(Worst::Member),
        };
    }
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
            Limit::StabilityUsed => note(index, &mut port.estimates().stability_used()),
            Limit::DelayUsed => note(index, &mut port.tracking().delay_used_by_axis()),
            _ => {}
        }
    }
    worst.map(|(_, port, axis)| Worst::Axis(port, axis))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::limits::Level;

    #[test]
    fn each_test_limit_trips_beyond_its_level() {
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
