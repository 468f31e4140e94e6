//! `limits` of a specimen or of one of its axes, in a file.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{self, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

use super::{AxisLimits, Bound, Range};

/// Size of a measured displacement in m that trips where nothing else is given.
pub const DIVERGENCE_M: f64 = 1e3;

/// Limits of one axis in SI units, at the specimen's own scale. A limit that is absent is not
/// checked. NaN and infinity always trip. More: guide, limits.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LimitsSpec {
    /// Range of the commanded displacement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_disp_m: Option<RangeSpec>,
    /// Largest change of the command between two commands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_step_m: Option<BoundSpec>,
    /// Largest velocity of the command, in wall time. With a trip level v, clients of `gusset
    /// serve` move a physical specimen by at most v·(T + burst) in T seconds. The burst is 0.02 s
    /// or two announced periods, at most 0.1 s. More: guide, limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_vel_m_per_s: Option<BoundSpec>,
    /// Largest acceleration of the command, from its second difference in wall time.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"warn": 20.0, "trip": 30.0}))]
    pub command_accel_m_per_s2: Option<BoundSpec>,
    /// Range of the measured displacement. Default: a measured displacement beyond ±1000 m trips.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_disp_m: Option<RangeSpec>,
    /// Range of the measured force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_force_n: Option<RangeSpec>,
    /// Measuring range of the displacement sensor. A reading outside this range is not reliable.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"trip": [-0.12, 0.12]}))]
    pub sensor_disp_m: Option<RangeSpec>,
    /// Measuring range of the load cell. A reading outside this range is not reliable, and no
    /// specimen moves to zero force by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_force_n: Option<RangeSpec>,
    /// Largest following error, |measured − commanded| displacement, at rest. `following_time_s`
    /// allows for more in motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub following_error_m: Option<BoundSpec>,
    /// Delay of the actuator that the following error allows for. The limit grows by this time
    /// multiplied by the largest recent speed of the command.
    pub following_time_s: f64,
    /// Largest change of the measured force between two measurements.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"trip": 5.0e3}))]
    pub force_step_n: Option<BoundSpec>,
    /// Number of successive measurements in which both sensors are unchanged to the last bit
    /// although the command moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"warn": 20.0, "trip": 50.0}))]
    pub stuck_ticks: Option<BoundSpec>,
    /// Motion of the command that is too small to change the sensors. `stuck_ticks` ignores it.
    #[schemars(example = 1.0e-5)]
    pub stuck_travel_m: f64,
    /// Number of successive commands in which the second difference changes its sign and grows.
    /// Such a sawtooth is an early sign of an unstable integration.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"warn": 6.0, "trip": 12.0}))]
    pub alternating_ticks: Option<BoundSpec>,
    /// Second difference of the command that counts as noise. `alternating_ticks` ignores it.
    #[schemars(example = 1.0e-5)]
    pub alternating_m: f64,
    /// Estimated tangent stiffness divided by its declared upper bound. The bound is
    /// `hardening_bound` · `stiffness_n_per_m`, or that of the law. The proof of stability holds up
    /// to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"warn": 1.0, "trip": 1.2}))]
    pub stiffness_ratio: Option<BoundSpec>,
    /// Estimated tangent damping divided by its declared upper bound. It is only estimated if
    /// damping is declared.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"warn": 1.0, "trip": 1.2}))]
    pub damping_ratio: Option<BoundSpec>,
    /// Energy that the tracking error of this axis adds to the structure. A delay adds energy, a
    /// lead removes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"warn": 5.0, "trip": 10.0}))]
    pub added_energy_j: Option<BoundSpec>,
    /// Lag of the measured displacement behind the target, or lead if it is early. It is estimated
    /// over the last seconds of motion, after two periods.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"warn": 0.002, "trip": 0.004}))]
    pub lag_s: Option<BoundSpec>,
    /// Amplitude error |gain − 1| of the measured displacement relative to the target. It is
    /// estimated over the last seconds of motion, after two periods.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({"warn": 0.05, "trip": 0.1}))]
    pub gain_error: Option<BoundSpec>,
    /// Smallest motion that is used to estimate tangent stiffness and damping. 0 is ten times the
    /// noise that was measured before the test.
    #[schemars(example = 1.0e-5)]
    pub tangent_step_m: f64,
}

/// Largest absolute value. Give `warn`, `trip` or both.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BoundSpec {
    /// Beyond this level, the controller writes an event.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warn: Option<f64>,
    /// Beyond this level, the specimens hold and the test ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trip: Option<f64>,
}

/// Smallest and largest value. Give `warn`, `trip` or both.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RangeSpec {
    /// Outside this range, the controller writes an event.
    #[serde(deserialize_with = "range", skip_serializing_if = "Option::is_none")]
    pub warn: Option<[f64; 2]>,
    /// Outside this range, the specimens hold and the test ends.
    #[serde(deserialize_with = "range", skip_serializing_if = "Option::is_none")]
    pub trip: Option<[f64; 2]>,
}

/// Reads a range, and says how one is written where a single number is found.
fn range<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[f64; 2]>, D::Error> {
    struct RangeVisitor;

    impl<'de> Visitor<'de> for RangeVisitor {
        type Value = [f64; 2];

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a range `[lowest, highest]`")
        }

        fn visit_i64<E: de::Error>(self, value: i64) -> Result<[f64; 2], E> {
            self.visit_f64(value as f64)
        }

        fn visit_u64<E: de::Error>(self, value: u64) -> Result<[f64; 2], E> {
            self.visit_f64(value as f64)
        }

        fn visit_f64<E: de::Error>(self, value: f64) -> Result<[f64; 2], E> {
            let size = value.abs();
            let wanted = format!("a range `[lowest, highest]`, such as `[-{size}, {size}]`");
            Err(E::invalid_type(Unexpected::Float(value), &wanted.as_str()))
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut numbers: A) -> Result<[f64; 2], A::Error> {
            let short = |count: usize| de::Error::invalid_length(count, &self);
            let low = numbers.next_element()?.ok_or_else(|| short(0))?;
            let high = numbers.next_element()?.ok_or_else(|| short(1))?;
            Ok([low, high])
        }
    }

    deserializer.deserialize_any(RangeVisitor).map(Some)
}

/// A bound that cannot be.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LimitsError {
    /// Neither level is given.
    #[error("`{key}` has neither a `warn` nor a `trip` level")]
    Empty {
        /// The bound.
        key: &'static str,
    },
    /// A size that is not greater than zero.
    #[error("a level of `{key}` is {found}, but must be greater than 0")]
    NotPositive {
        /// The bound.
        key: &'static str,
        /// The given value.
        found: f64,
    },
    /// A size that is counted and no whole number.
    #[error("a level of `{key}` is {found}, but must be a whole number of at least 1")]
    NotWhole {
        /// The bound.
        key: &'static str,
        /// The given value.
        found: f64,
    },
    /// The smallest value is not below the largest.
    #[error("`{key}` goes from {low} to {high}, which leaves no room")]
    Inverted {
        /// The bound.
        key: &'static str,
        /// Smallest.
        low: f64,
        /// Largest.
        high: f64,
    },
    /// A warning that would come after the trip.
    #[error("`{key}` warns at {warn}, which is not within its trip level of {trip}")]
    Order {
        /// The bound.
        key: &'static str,
        /// Level of the warning.
        warn: f64,
        /// Level of the trip.
        trip: f64,
    },
}

impl LimitsError {
    /// The key to point at.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Empty { key }
            | Self::NotPositive { key, .. }
            | Self::NotWhole { key, .. }
            | Self::Inverted { key, .. }
            | Self::Order { key, .. } => key,
        }
    }
}

impl BoundSpec {
    /// Whether the levels can be kept.
    ///
    /// # Errors
    /// Why not.
    pub fn check(self, key: &'static str) -> Result<(), LimitsError> {
        for found in [self.warn, self.trip].into_iter().flatten() {
            // Written as "is inside", so that NaN fails.
            let inside = found > 0.0;
            if !inside {
                return Err(LimitsError::NotPositive { key, found });
            }
        }
        match (self.warn, self.trip) {
            (None, None) => Err(LimitsError::Empty { key }),
            (Some(warn), Some(trip)) if warn >= trip => Err(LimitsError::Order { key, warn, trip }),
            _ => Ok(()),
        }
    }

    /// Checks the levels of a count.
    fn check_count(self, key: &'static str) -> Result<(), LimitsError> {
        let mut levels = [self.warn, self.trip].into_iter().flatten();
        match levels.find(|level| level.fract() != 0.0 && level.is_finite()) {
            Some(found) => Err(LimitsError::NotWhole { key, found }),
            None => self.check(key),
        }
    }

    /// Each level of `own` where it is given, and that of `all` elsewhere.
    fn over(own: Option<Self>, all: Option<Self>) -> Option<Self> {
        let (Some(one), Some(other)) = (own, all) else {
            return own.or(all);
        };
        Some(Self {
            warn: one.warn.or(other.warn),
            trip: one.trip.or(other.trip),
        })
    }

    /// The levels; none where nothing is given.
    #[must_use]
    pub fn bound(spec: Option<Self>) -> Bound {
        let Self { warn, trip } = spec.unwrap_or_default();
        Bound {
            warn: warn.unwrap_or(f64::INFINITY),
            trip: trip.unwrap_or(f64::INFINITY),
        }
    }
}

impl RangeSpec {
    fn check(self, key: &'static str) -> Result<(), LimitsError> {
        for [low, high] in [self.warn, self.trip].into_iter().flatten() {
            let inside = low < high;
            if !inside {
                return Err(LimitsError::Inverted { key, low, high });
            }
        }
        match (self.warn, self.trip) {
            (None, None) => Err(LimitsError::Empty { key }),
            (Some([low, high]), Some([lowest, highest])) => {
                let order = |warn, trip| Err(LimitsError::Order { key, warn, trip });
                if low <= lowest {
                    order(low, lowest)
                } else if high >= highest {
                    order(high, highest)
                } else {
                    Ok(())
                }
            }
            _ => Ok(()),
        }
    }

    /// Each level of `own` where it is given, and that of `all` elsewhere.
    fn over(own: Option<Self>, all: Option<Self>) -> Option<Self> {
        let (Some(one), Some(other)) = (own, all) else {
            return own.or(all);
        };
        Some(Self {
            warn: one.warn.or(other.warn),
            trip: one.trip.or(other.trip),
        })
    }

    fn range(spec: Option<Self>) -> Range {
        let Self { warn, trip } = spec.unwrap_or_default();
        Range {
            warn: warn.unwrap_or(Range::NONE.warn),
            trip: trip.unwrap_or(Range::NONE.trip),
        }
    }
}

impl LimitsSpec {
    /// These levels where they are given, and those of `all` elsewhere.
    #[must_use]
    pub fn over(&self, all: &Self) -> Self {
        let longer = |own: f64, all: f64| if own > 0.0 { own } else { all };
        Self {
            command_disp_m: RangeSpec::over(self.command_disp_m, all.command_disp_m),
            command_step_m: BoundSpec::over(self.command_step_m, all.command_step_m),
            command_vel_m_per_s: BoundSpec::over(self.command_vel_m_per_s, all.command_vel_m_per_s),
            command_accel_m_per_s2: BoundSpec::over(
                self.command_accel_m_per_s2,
                all.command_accel_m_per_s2,
            ),
            measured_disp_m: RangeSpec::over(self.measured_disp_m, all.measured_disp_m),
            measured_force_n: RangeSpec::over(self.measured_force_n, all.measured_force_n),
            sensor_disp_m: RangeSpec::over(self.sensor_disp_m, all.sensor_disp_m),
            sensor_force_n: RangeSpec::over(self.sensor_force_n, all.sensor_force_n),
            following_error_m: BoundSpec::over(self.following_error_m, all.following_error_m),
            following_time_s: longer(self.following_time_s, all.following_time_s),
            force_step_n: BoundSpec::over(self.force_step_n, all.force_step_n),
            stuck_ticks: BoundSpec::over(self.stuck_ticks, all.stuck_ticks),
            stuck_travel_m: longer(self.stuck_travel_m, all.stuck_travel_m),
            alternating_ticks: BoundSpec::over(self.alternating_ticks, all.alternating_ticks),
            alternating_m: longer(self.alternating_m, all.alternating_m),
            stiffness_ratio: BoundSpec::over(self.stiffness_ratio, all.stiffness_ratio),
            damping_ratio: BoundSpec::over(self.damping_ratio, all.damping_ratio),
            added_energy_j: BoundSpec::over(self.added_energy_j, all.added_energy_j),
            lag_s: BoundSpec::over(self.lag_s, all.lag_s),
            gain_error: BoundSpec::over(self.gain_error, all.gain_error),
            tangent_step_m: longer(self.tangent_step_m, all.tangent_step_m),
        }
    }

    /// Keys of the bounds that are given and need a measured displacement.
    pub fn needing_measured_disp(&self) -> impl Iterator<Item = &'static str> {
        [
            ("measured_disp_m", self.measured_disp_m.is_some()),
            ("sensor_disp_m", self.sensor_disp_m.is_some()),
            ("following_error_m", self.following_error_m.is_some()),
            ("stuck_ticks", self.stuck_ticks.is_some()),
            ("added_energy_j", self.added_energy_j.is_some()),
            ("lag_s", self.lag_s.is_some()),
            ("gain_error", self.gain_error.is_some()),
        ]
        .into_iter()
        .filter_map(|(key, is_given)| is_given.then_some(key))
    }

    /// Whether each bound that is given can be kept.
    ///
    /// # Errors
    /// The first that cannot.
    pub fn check(&self) -> Result<(), LimitsError> {
        for (key, spec) in [
            ("command_disp_m", self.command_disp_m),
            ("measured_disp_m", self.measured_disp_m),
            ("measured_force_n", self.measured_force_n),
            ("sensor_disp_m", self.sensor_disp_m),
            ("sensor_force_n", self.sensor_force_n),
        ] {
            spec.map_or(Ok(()), |spec| spec.check(key))?;
        }
        for (key, spec) in [
            ("command_step_m", self.command_step_m),
            ("command_vel_m_per_s", self.command_vel_m_per_s),
            ("command_accel_m_per_s2", self.command_accel_m_per_s2),
            ("following_error_m", self.following_error_m),
            ("force_step_n", self.force_step_n),
            ("stiffness_ratio", self.stiffness_ratio),
            ("damping_ratio", self.damping_ratio),
            ("added_energy_j", self.added_energy_j),
            ("lag_s", self.lag_s),
            ("gain_error", self.gain_error),
        ] {
            spec.map_or(Ok(()), |spec| spec.check(key))?;
        }
        for (key, spec) in [
            ("stuck_ticks", self.stuck_ticks),
            ("alternating_ticks", self.alternating_ticks),
        ] {
            spec.map_or(Ok(()), |spec| spec.check_count(key))?;
        }
        for (key, found) in [
            ("following_time_s", self.following_time_s),
            ("stuck_travel_m", self.stuck_travel_m),
            ("alternating_m", self.alternating_m),
            ("tangent_step_m", self.tangent_step_m),
        ] {
            let inside = found >= 0.0;
            if !inside {
                return Err(LimitsError::NotPositive { key, found });
            }
        }
        Ok(())
    }

    /// The limits that are kept.
    #[must_use]
    pub fn limits(&self) -> AxisLimits {
        AxisLimits {
            command_disp: RangeSpec::range(self.command_disp_m),
            command_step: BoundSpec::bound(self.command_step_m),
            command_vel: BoundSpec::bound(self.command_vel_m_per_s),
            command_accel: BoundSpec::bound(self.command_accel_m_per_s2),
            measured_disp: RangeSpec::range(self.measured_disp_m),
            divergence: DIVERGENCE_M,
            measured_force: RangeSpec::range(self.measured_force_n),
            sensor_disp: RangeSpec::range(self.sensor_disp_m),
            sensor_force: RangeSpec::range(self.sensor_force_n),
            following_error: BoundSpec::bound(self.following_error_m),
            following_time: self.following_time_s,
            force_step: BoundSpec::bound(self.force_step_n),
            stuck_ticks: BoundSpec::bound(self.stuck_ticks),
            stuck_travel: self.stuck_travel_m,
            alternating_ticks: BoundSpec::bound(self.alternating_ticks),
            alternating_floor: self.alternating_m,
            stiffness_ratio: BoundSpec::bound(self.stiffness_ratio),
            damping_ratio: BoundSpec::bound(self.damping_ratio),
            added_energy: BoundSpec::bound(self.added_energy_j),
            lag: BoundSpec::bound(self.lag_s),
            gain_error: BoundSpec::bound(self.gain_error),
            tangent_step: self.tangent_step_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> LimitsSpec {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn levels_that_contradict_each_other_are_named_with_their_key() {
        for (text, words) in [
            (
                "command_step_m = { warn = 2, trip = 2 }",
                "not within its trip level",
            ),
            ("command_step_m = { trip = 0 }", "must be greater than 0"),
            ("command_step_m = { warn = nan }", "must be greater than 0"),
            ("force_step_n = {}", "neither a `warn` nor a `trip`"),
            ("command_disp_m = { trip = [1, 1] }", "leaves no room"),
            ("command_disp_m = { trip = [nan, 1] }", "leaves no room"),
            (
                "measured_force_n = { warn = [-5, 1], trip = [-4, 4] }",
                "warns at -5",
            ),
            (
                "measured_force_n = { warn = [-1, 5], trip = [-4, 4] }",
                "warns at 5",
            ),
            ("sensor_disp_m = {}", "neither"),
            (
                "alternating_ticks = { trip = 2.7 }",
                "is 2.7, but must be a whole number of at least 1",
            ),
            ("stuck_ticks = { warn = 0.5, trip = 4 }", "is 0.5"),
            ("stuck_ticks = {}", "neither"),
            ("stuck_travel_m = -1", "must be greater than 0"),
        ] {
            let error = read(text).check().unwrap_err();
            assert!(error.to_string().contains(words), "{text}: {error}");
            assert!(text.starts_with(error.key()));
        }
        let good = "command_disp_m = { warn = [-0.1, 0.2], trip = [-0.2, 0.3] }\nstuck_ticks = { trip = 5 }\n";
        assert_eq!(read(good).check(), Ok(()));
    }

    #[test]
    fn what_an_axis_says_itself_goes_before_what_is_said_of_all() {
        let all = read(
            "command_step_m = { trip = 0.1 }\nforce_step_n = { trip = 7 }\nfollowing_time_s = 1",
        );
        let limits = read("command_step_m = { trip = 0.2 }").over(&all).limits();
        assert_eq!(limits.command_step, Bound::trip(0.2));
        assert_eq!(limits.force_step, Bound::trip(7.0));
        assert_eq!(limits.following_time, 1.0);
        assert_eq!(limits.command_disp, Range::NONE);
    }

    #[test]
    fn an_axis_that_gives_one_level_keeps_the_other_of_the_specimen() {
        let all = read(
            "command_step_m = { warn = 0.1, trip = 0.2 }\nmeasured_force_n = { warn = [-5, 5], trip = [-9, 9] }",
        );
        let axis = |text: &str| read(text).over(&all).limits();
        let warned =
            axis("command_step_m = { warn = 0.15 }\nmeasured_force_n = { warn = [-6, 6] }");
        let bound = Bound {
            warn: 0.15,
            trip: 0.2,
        };
        assert_eq!(warned.command_step, bound);
        assert_eq!(warned.measured_force.trip, [-9.0, 9.0]);
        assert_eq!(warned.measured_force.warn, [-6.0, 6.0]);
        let tripped = axis("command_step_m = { trip = 0.3 }").command_step;
        assert_eq!((tripped.warn, tripped.trip), (0.1, 0.3));
    }
}
