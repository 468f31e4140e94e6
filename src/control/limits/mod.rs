//! What a specimen may be told and may answer: limits of one axis, each with a level to warn at and one to trip at.
//!
//! Everything is in SI at the specimen's own scale, because that is what breaks: an actuator's stroke, a pump's flow,
//! a load cell's range; energy and tangents are the structure's. The rules are pure; [`Watch`] keeps the few past values that they need. Invariant: a command is
//! judged before it leaves, and what is not a number trips. Not here: what a trip leads to.

mod calm;
mod lately;
mod look;
mod past;
mod quantity;
mod sawtooth;
mod spec;
mod trips;
mod watch;

pub use calm::{Asked, Seen};
pub use quantity::Quantity;
pub use spec::{BoundSpec, DIVERGENCE_M, LimitsError, LimitsSpec, RangeSpec};
pub use watch::{Estimated, Watch};

use crate::units::compared;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// It is told, and the test goes on.
    Warning,
    /// The test ends.
    Trip,
}

/// One limit that was reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Axis, from 0.
    pub axis: usize,
    /// Of what.
    pub quantity: Quantity,
    /// How bad it is.
    pub level: Level,
    /// What was found, SI.
    pub value: f64,
    /// What is allowed, SI.
    pub bound: f64,
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

/// A size that is to be warned of, and one to trip at; infinite where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Warned of above this.
    pub warn: f64,
    /// Tripped above this.
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

    /// The level that is reached first.
    #[must_use]
    pub const fn lower(self) -> f64 {
        self.warn.min(self.trip)
    }

    /// What `value` is beyond, and the bound. Real-time: yes.
    #[must_use]
    pub fn judge(self, value: f64) -> Option<(Level, f64)> {
        if !value.is_finite() || value > self.trip {
            Some((Level::Trip, self.trip))
        } else if value > self.warn {
            Some((Level::Warning, self.warn))
        } else {
            None
        }
    }
}

/// Smallest and largest value, for each level; infinite where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Warned of outside of this.
    pub warn: [f64; 2],
    /// Tripped outside of this.
    pub trip: [f64; 2],
}

impl Range {
    /// No limit.
    pub const NONE: Range = Range {
        warn: [f64::NEG_INFINITY, f64::INFINITY],
        trip: [f64::NEG_INFINITY, f64::INFINITY],
    };

    /// What `value` is outside of, and the bound on that side. Real-time: yes.
    fn judge(&self, value: f64) -> Option<(Level, f64)> {
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
    /// Of the commanded displacement.
    pub command_disp: Range,
    /// Of its change in one tick.
    pub command_step: Bound,
    /// Of its change over the tick's wall time.
    pub command_vel: Bound,
    /// Of its second difference over the tick's wall time squared.
    pub command_accel: Bound,
    /// Of the measured displacement.
    pub measured_disp: Range,
    /// Size of a measured displacement in m that trips where `measured_disp` has no trip level.
    pub divergence: f64,
    /// Of the measured force.
    pub measured_force: Range,
    /// Range of the displacement sensor.
    pub sensor_disp: Range,
    /// Range of the load cell.
    pub sensor_force: Range,
    /// Of |measured − commanded|, at rest.
    pub following_error: Bound,
    /// Seconds of commanded motion by which the following error may be larger, at the largest speed of as many seconds.
    pub following_time: f64,
    /// Of the change of the measured force from one measurement to the next.
    pub force_step: Bound,
    /// Of the ticks in a row with unchanged sensors.
    pub stuck_ticks: Bound,
    /// Travel of the command in m over these ticks below which nothing is expected to change.
    pub stuck_travel: f64,
    /// Of the ticks in a row of a growing sawtooth.
    pub alternating_ticks: Bound,
    /// Second difference of the command in m up to which it is no sawtooth.
    pub alternating_floor: f64,
    /// Of the tangent stiffness over its declared bound.
    pub stiffness_ratio: Bound,
    /// Of the tangent damping over its declared bound.
    pub damping_ratio: Bound,
    /// Of the energy that the transfer system adds, J at the structure.
    pub added_energy: Bound,
    /// Of the lag behind the target, s.
    pub lag: Bound,
    /// Of the error of the gain.
    pub gain_error: Bound,
    /// Motion in m below which no tangent is taken.
    pub tangent_step: f64,
}

impl AxisLimits {
    /// No limit at all.
    pub const NONE: AxisLimits = AxisLimits {
        command_disp: Range::NONE,
        command_step: Bound::NONE,
        command_vel: Bound::NONE,
        command_accel: Bound::NONE,
        measured_disp: Range::NONE,
        divergence: f64::INFINITY,
        measured_force: Range::NONE,
        sensor_disp: Range::NONE,
        sensor_force: Range::NONE,
        following_error: Bound::NONE,
        following_time: 0.0,
        force_step: Bound::NONE,
        stuck_ticks: Bound::NONE,
        stuck_travel: 0.0,
        alternating_ticks: Bound::NONE,
        alternating_floor: 0.0,
        stiffness_ratio: Bound::NONE,
        damping_ratio: Bound::NONE,
        added_energy: Bound::NONE,
        lag: Bound::NONE,
        gain_error: Bound::NONE,
        tangent_step: 0.0,
    };
}

impl AxisLimits {
    /// The levels by which a measured displacement is judged. Real-time: yes.
    const fn measured_range(&self) -> Range {
        let Range {
            warn,
            trip: [low, high],
        } = self.measured_disp;
        let far = self.divergence;
        Range {
            warn,
            trip: [
                if low == f64::NEG_INFINITY { -far } else { low },
                if high == f64::INFINITY { far } else { high },
            ],
        }
    }
}

/// Both levels of one limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Levels {
    /// Of a size.
    Size(Bound),
    /// Of a value with a sign.
    Range(Range),
}

impl Levels {
    /// True if there is a trip level.
    #[must_use]
    pub fn trips(&self) -> bool {
        match self {
            Self::Size(bound) => bound.trip.is_finite(),
            Self::Range(range) => range.trip.iter().any(|level| level.is_finite()),
        }
    }
}

impl AxisLimits {
    /// All limits with their levels, infinite where there is none.
    #[must_use]
    pub fn levels(&self) -> [(Quantity, Levels); 17] {
        Quantity::ALL.map(|quantity| {
            let levels = match quantity {
                Quantity::CommandDisp => Levels::Range(self.command_disp),
                Quantity::CommandStep => Levels::Size(self.command_step),
                Quantity::CommandVel => Levels::Size(self.command_vel),
                Quantity::CommandAccel => Levels::Size(self.command_accel),
                Quantity::MeasuredDisp => Levels::Range(self.measured_disp),
                Quantity::MeasuredForce => Levels::Range(self.measured_force),
                Quantity::FollowingError => Levels::Size(self.following_error),
                Quantity::ForceStep => Levels::Size(self.force_step),
                Quantity::StuckSensor => Levels::Size(self.stuck_ticks),
                Quantity::SensorDisp => Levels::Range(self.sensor_disp),
                Quantity::SensorForce => Levels::Range(self.sensor_force),
                Quantity::Alternation => Levels::Size(self.alternating_ticks),
                Quantity::StiffnessRatio => Levels::Size(self.stiffness_ratio),
                Quantity::DampingRatio => Levels::Size(self.damping_ratio),
                Quantity::AddedEnergy => Levels::Size(self.added_energy),
                Quantity::Lag => Levels::Size(self.lag),
                Quantity::GainError => Levels::Size(self.gain_error),
            };
            (quantity, levels)
        })
    }
}

/// What one look found: what trips, and a warning that was not given before.
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
    pub const fn is_something(&self) -> bool {
        self.trip.is_some() || self.warning.is_some() || self.more
    }
}

#[cfg(test)]
mod tests;
