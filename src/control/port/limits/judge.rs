//! The values of one judgement against the levels of their limits.
//!
//! A judgement takes all values of one group: commands, measurements, estimates or tracking. Each group is a list from the
//! catalogue, and its values come in the order of this list. Inner bounds say when nothing is beyond a level: one loop of
//! comparisons without branches. Beyond one of them, for the first values, and while
//! a warning stands, [`AxisJudge`] walks the list and keeps every trip and every new warning.
//! Invariant: a command or a measurement that is not finite is never inside; an estimate that is not finite is not judged.

use super::trips::{GoesOn, Trips, Verdict};
use super::{AxisLimits, Found, Hit, Level, Range};
use gusset_quantity::catalog::limit::{Judges, Limit};

pub(super) const COMMAND: [Limit; 5] = Limit::judging(&[Judges::Command]);
pub(super) const MEASUREMENT: [Limit; 7] = Limit::judging(&[Judges::Sensor, Judges::Measurement]);
pub(super) const ESTIMATE: [Limit; 3] = Limit::judging(&[Judges::Estimate]);
pub(super) const TRACKING: [Limit; 2] = Limit::judging(&[Judges::Tracking]);

/// Limits whose judged value has a column where the limit has a level.
pub(crate) const RECORDED: [Limit; 7] = Limit::without_column();

/// The bounds of a group inside of which no value is beyond a level.
#[derive(Debug, Clone, Copy)]
pub(super) struct Inner<const N: usize> {
    low: [f64; N],
    high: [f64; N],
}

impl<const N: usize> Inner<N> {
    fn of(group: [Limit; N], limits: &AxisLimits) -> Self {
        let inner = group.map(|limit| limits.in_force(limit).inner());
        Self {
            low: inner.map(|[low, _]| low),
            high: inner.map(|[_, high]| high),
        }
    }

    /// True if every value is inside. Real-time: yes.
    #[inline]
    pub(crate) fn covers(&self, values: &[f64; N]) -> bool {
        let bounds = self.low.iter().zip(&self.high);
        let mut covers = true;
        for (value, (low, high)) in values.iter().zip(bounds) {
            covers &= (value >= low) & (value <= high);
        }
        covers
    }

    /// True if every value is inside or not a number. Real-time: yes.
    #[inline]
    pub(crate) fn covers_known(&self, values: &[f64; N]) -> bool {
        let bounds = self.low.iter().zip(&self.high);
        let mut covers = true;
        for (value, (low, high)) in values.iter().zip(bounds) {
            covers &= value.is_nan() | ((value >= low) & (value <= high));
        }
        covers
    }
}

/// The inner bounds of one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct AllInner {
    pub command: Inner<{ COMMAND.len() }>,
    pub measurement: Inner<{ MEASUREMENT.len() }>,
    pub estimate: Inner<{ ESTIMATE.len() }>,
    pub tracking: Inner<{ TRACKING.len() }>,
}

impl AllInner {
    pub(crate) fn of(limits: &AxisLimits) -> Self {
        Self {
            command: Inner::of(COMMAND, limits),
            measurement: Inner::of(MEASUREMENT, limits),
            estimate: Inner::of(ESTIMATE, limits),
            tracking: Inner::of(TRACKING, limits),
        }
    }
}

impl Range {
    /// The values that are within both levels and finite.
    const fn inner(&self) -> [f64; 2] {
        both(both(self.warn, self.trip), [f64::MIN, f64::MAX])
    }
}

/// The values inside of both.
const fn both([low, high]: [f64; 2], [other_low, other_high]: [f64; 2]) -> [f64; 2] {
    [higher(low, other_low), lower(high, other_high)]
}

/// An end that is not a number stays: nothing is inside of it.
const fn lower(a: f64, b: f64) -> f64 {
    if a < b || a.is_nan() { a } else { b }
}

const fn higher(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

/// One axis, what was warned of on it and what has tripped, and what is found.
pub(super) struct AxisJudge<'a> {
    pub axis: usize,
    pub limits: &'a AxisLimits,
    pub warned: &'a mut u32,
    pub trips: &'a mut Trips,
    /// Of measurements during the shutdown.
    pub goes_on: GoesOn,
    pub found: &'a mut Found,
}

impl AxisJudge<'_> {
    /// Judges a group; `before` earlier values are known, and a difference from more is not judged.
    #[cold]
    pub(crate) fn judge_group<const N: usize>(
        &mut self,
        group: [Limit; N],
        values: &[f64; N],
        before: u8,
    ) {
        for (limit, value) in group.into_iter().zip(values) {
            let row = limit.row();
            let may_be_unknown = matches!(row.judges, Judges::Estimate | Judges::Tracking);
            if row.differs_from <= before && (value.is_finite() || !may_be_unknown) {
                self.judge(limit, *value);
            }
        }
    }

    /// Judges `value`; keeps every trip, and every warning that is new.
    fn judge(&mut self, limit: Limit, value: f64) {
        let bit = limit.bit();
        let Some((level, bound)) = self.limits.in_force(limit).judge(value) else {
            *self.warned &= !bit;
            return;
        };
        let hit = Hit {
            axis: self.axis,
            quantity: limit,
            level,
            value,
            bound,
        };
        match level {
            Level::Trip => match self.trips.judge(&hit, self.goes_on) {
                Verdict::Trips if self.found.trip.is_none() => self.found.trip = Some(hit),
                Verdict::Trips | Verdict::Told => {
                    self.trips.tell(limit);
                    self.found.more = true;
                }
                Verdict::Excused => {}
            },
            Level::Warning if *self.warned & bit == 0 => {
                *self.warned |= bit;
                if self.found.warning.is_none() {
                    self.found.warning = Some(hit);
                } else {
                    self.trips.tell_warning(&hit);
                    self.found.more = true;
                }
            }
            Level::Warning => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::catalog::limit::AXIS_LIMITS;
    use proptest::prelude::*;

    /// Numbers of all kinds, and few enough of the ordinary ones that they meet their bounds exactly.
    fn any_number() -> impl Strategy<Value = f64> {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -0.0];
        prop_oneof![
            4 => (-3..=3).prop_map(f64::from),
            1 => prop::sample::select(odd.to_vec()),
        ]
    }

    fn any_range() -> impl Strategy<Value = Range> {
        let ends = || [any_number(), any_number()];
        (ends(), ends()).prop_map(|(warn, trip)| Range { warn, trip })
    }

    fn judged_inside<const N: usize>(
        group: [Limit; N],
        inner: &Inner<N>,
        values: &[f64; AXIS_LIMITS],
        limits: &AxisLimits,
    ) -> Option<Limit> {
        let values = group.map(|limit| values[limit as usize]);
        let is_known = matches!(group[0].row().judges, Judges::Estimate | Judges::Tracking);
        let covers = if is_known {
            inner.covers_known(&values)
        } else {
            inner.covers(&values)
        };
        let beyond = |(limit, value): &(Limit, f64)| {
            (!is_known || value.is_finite()) && limits.in_force(*limit).judge(*value).is_some()
        };
        let mut judged = group.into_iter().zip(values);
        covers.then(|| judged.find(beyond))?.map(|(limit, _)| limit)
    }

    #[test]
    fn a_limit_without_column_is_recorded() {
        for limit in Limit::OF_AXIS {
            assert_eq!(RECORDED.contains(&limit), !limit.row().has_column);
        }
    }

    proptest! {
        #[test]
        fn values_inside_bounds_pass_every_level(
            levels in prop::collection::vec(any_range(), AXIS_LIMITS),
            sizes in prop::array::uniform17(any_number()),
            divergence in any_number(),
        ) {
            let mut limits = AxisLimits { divergence, ..AxisLimits::NONE };
            for (limit, levels) in Limit::OF_AXIS.into_iter().zip(levels) {
                limits.set(limit, levels);
            }
            let all = AllInner::of(&limits);
            for beyond in [
                judged_inside(COMMAND, &all.command, &sizes, &limits),
                judged_inside(MEASUREMENT, &all.measurement, &sizes, &limits),
                judged_inside(ESTIMATE, &all.estimate, &sizes, &limits),
                judged_inside(TRACKING, &all.tracking, &sizes, &limits),
            ] {
                prop_assert_eq!(beyond, None);
            }
        }
    }

    #[test]
    fn every_limit_is_judged_once() {
        let groups: [&[Limit]; 4] = [&COMMAND, &MEASUREMENT, &ESTIMATE, &TRACKING];
        let mut judged: Vec<Limit> = groups.concat();
        judged.sort_unstable();
        assert_eq!(judged, Limit::OF_AXIS);
    }
}
