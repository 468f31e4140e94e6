//! The limits of one axis for commands and measurements, each with a warning and a trip level.
//!
//! All numbers are SI at the specimen's own scale, except energy and tangents, which are the structure's. The catalogue says
//! what each limit is; [`AxisLimits`] holds its levels; [`Watch`] keeps the few past values that the judgement needs.
//! One loop compares all values of a judgement with inner bounds. The table of limits is walked beyond one of them, for the
//! first two commands, and while a warning stands.
//! Invariant: a command is judged before it leaves, and a command or a measurement that is not a number trips.
//! The reaction to a trip is decided elsewhere.

mod judge;
mod lately;
mod past;
mod sawtooth;
mod trips;
mod watch;

pub(crate) use judge::RECORDED;
pub use watch::{Estimated, Watch};

use gusset_config::{BoundSpec, DIVERGENCE_M, LimitsSpec, RangeSpec};
use gusset_quantity::catalog::limit::{AXIS_LIMITS, Kind, Limit};
use gusset_quantity::units::compared;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// The controller writes an event, and the test continues.
    Warning,
    /// The test ends.
    Trip,
}

/// One limit that was reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Axis, from 0.
    pub axis: usize,
    /// The limit.
    pub quantity: Limit,
    /// How bad it is.
    pub level: Level,
    /// What was found, SI.
    pub value: f64,
    /// What is allowed, SI.
    pub bound: f64,
}

impl Hit {
    /// A limit that trips.
    #[must_use]
    pub const fn trip(axis: usize, quantity: Limit, value: f64, bound: f64) -> Self {
        Self {
            axis,
            quantity,
            level: Level::Trip,
            value,
            bound,
        }
    }
}

impl std::fmt::Display for Hit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Hit {
            axis,
            quantity,
            value,
            bound,
            ..
        } = self;
        let [value, bound] = compared(*value, *bound, quantity.unit());
        let words = quantity.words();
        write!(f, "axis {}: {words} {value}, allowed {bound}", axis + 1)
    }
}

/// Size of the warning and of the trip level; infinite without a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// The controller warns above this.
    pub warn: f64,
    /// The test ends above this.
    pub trip: f64,
}

impl Bound {
    /// No limit.
    pub const NONE: Bound = Bound {
        warn: f64::INFINITY,
        trip: f64::INFINITY,
    };

    /// A trip level without a warning.
    #[must_use]
    pub const fn trip(trip: f64) -> Self {
        Self {
            warn: f64::INFINITY,
            trip,
        }
    }

    /// The levels that a file gives.
    #[must_use]
    pub fn of(spec: BoundSpec) -> Self {
        let [warn, trip] = spec.levels();
        Self { warn, trip }
    }

    /// The level that is reached first.
    #[must_use]
    pub(crate) const fn lower(self) -> f64 {
        self.warn.min(self.trip)
    }

    /// The level that `value` is beyond, and its bound. Real-time: yes.
    #[must_use]
    pub(crate) fn judge(self, value: f64) -> Option<(Level, f64)> {
        Range::from(self).judge(value)
    }
}

/// Smallest and largest value of each level; infinite without a level. A size has no smallest value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The controller warns outside of this.
    pub warn: [f64; 2],
    /// The test ends outside of this.
    pub trip: [f64; 2],
}

impl From<Bound> for Range {
    fn from(Bound { warn, trip }: Bound) -> Self {
        Self {
            warn: [f64::NEG_INFINITY, warn],
            trip: [f64::NEG_INFINITY, trip],
        }
    }
}

impl Range {
    /// No limit.
    pub const NONE: Range = Range {
        warn: [f64::NEG_INFINITY, f64::INFINITY],
        trip: [f64::NEG_INFINITY, f64::INFINITY],
    };

    /// Trip levels without a warning.
    #[must_use]
    pub const fn trip(trip: [f64; 2]) -> Self {
        Self { trip, ..Self::NONE }
    }

    /// The largest values.
    #[must_use]
    pub(crate) const fn upper(&self) -> Bound {
        let ([_, warn], [_, trip]) = (self.warn, self.trip);
        Bound { warn, trip }
    }

    /// True if there is a trip level.
    #[must_use]
    pub fn trips(&self) -> bool {
        self.trip.iter().any(|level| level.is_finite())
    }

    /// True if there is a level.
    #[must_use]
    pub fn is_some(&self) -> bool {
        *self != Self::NONE
    }

    /// The level that `value` is outside of, and the bound on that side. Real-time: yes.
    #[must_use]
    pub(crate) fn judge(&self, value: f64) -> Option<(Level, f64)> {
        let outside = |[low, high]: [f64; 2]| {
            if value.is_finite() && value >= low && value <= high {
                None
            } else {
                Some(if value < low { low } else { high })
            }
        };
        match outside(self.trip) {
            Some(bound) => Some((Level::Trip, bound)),
            None => outside(self.warn).map(|bound| (Level::Warning, bound)),
        }
    }
}

/// The limits of one axis, SI at the specimen's own scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisLimits {
    levels: [Range; AXIS_LIMITS],
    /// Size of a measured displacement in m that trips where [`Limit::MeasuredDisp`] has no trip level.
    pub divergence: f64,
    /// Seconds of commanded motion by which the following error may be larger, at the largest speed of as many seconds.
    pub following_time: f64,
    /// Travel of the command in m below which [`Limit::StuckSensor`] expects no change.
    pub stuck_travel: f64,
}

impl AxisLimits {
    /// No limit at all.
    pub const NONE: AxisLimits = AxisLimits {
        levels: [Range::NONE; AXIS_LIMITS],
        divergence: f64::INFINITY,
        following_time: 0.0,
        stuck_travel: 0.0,
    };

    /// The limits that a file gives.
    #[must_use]
    pub fn of(spec: &LimitsSpec) -> Self {
        let mut limits = Self {
            divergence: DIVERGENCE_M,
            following_time: spec.following_time_s,
            stuck_travel: spec.stuck_travel_m,
            ..Self::NONE
        };
        for limit in Limit::OF_AXIS {
            if let Some(RangeSpec { warn, trip }) = spec.get(limit) {
                limits.set(
                    limit,
                    Range {
                        warn: warn.unwrap_or(Range::NONE.warn),
                        trip: trip.unwrap_or(Range::NONE.trip),
                    },
                );
            }
        }
        limits
    }

    /// The levels of a limit; none of one that belongs to no axis. Real-time: yes.
    #[must_use]
    pub fn get(&self, limit: Limit) -> Range {
        let levels = self.levels.get(limit as usize);
        levels.copied().unwrap_or(Range::NONE)
    }

    /// The levels of a limit whose kind is a size or a count. Real-time: yes.
    #[must_use]
    pub fn size(&self, limit: Limit) -> Bound {
        self.get(limit).upper()
    }

    /// Sets the levels of a limit of an axis.
    pub fn set(&mut self, limit: Limit, levels: impl Into<Range>) {
        if let Some(place) = self.levels.get_mut(limit as usize) {
            *place = levels.into();
        }
    }

    /// A copy with other levels of one limit.
    #[must_use]
    pub fn with(mut self, limit: Limit, levels: impl Into<Range>) -> Self {
        self.set(limit, levels);
        self
    }

    /// The levels that a value is judged by: `divergence` is the trip level where the measured displacement has none.
    fn in_force(&self, limit: Limit) -> Range {
        let mut levels = self.get(limit);
        if limit == Limit::MeasuredDisp {
            let [low, high] = &mut levels.trip;
            if *low == f64::NEG_INFINITY {
                *low = -self.divergence;
            }
            if *high == f64::INFINITY {
                *high = self.divergence;
            }
        }
        levels
    }

    /// All limits with their levels; infinite without a level.
    pub fn levels(&self) -> impl Iterator<Item = (Limit, Range)> {
        Limit::OF_AXIS.into_iter().zip(self.levels)
    }
}

/// The numbers of a level, for a list: one for a size, two for a range, none without a level.
#[must_use]
pub fn listed(limit: Limit, ends: [f64; 2]) -> Vec<f64> {
    match limit.row().kind {
        _ if ends.iter().all(|end| end.is_infinite()) => Vec::new(),
        Kind::Range => ends.to_vec(),
        Kind::Size | Kind::Count => ends.iter().skip(1).copied().collect(),
    }
}

/// What one judgement found: what trips, and a warning that was not given before.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Found {
    /// The first limit that trips.
    pub trip: Option<Hit>,
    /// More is beyond a level, which [`Watch::next_untold`] tells: beside the first, or where a trip level stops no way out.
    pub more: bool,
    /// The first limit whose warning level was crossed from inside.
    pub warning: Option<Hit>,
}

impl Found {
    /// True if there is something to tell. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn is_something(&self) -> bool {
        self.trip.is_some() || self.warning.is_some() || self.more
    }
}

#[cfg(test)]
mod file_tests;
#[cfg(test)]
mod tests;
