//! `limits` of a specimen or of one of its axes, as the file says them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Bounds of one axis, in SI units at the specimen; they hold either way from zero. What is absent is not checked.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LimitsSpec {
    /// Displacement that may be commanded, in m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_disp_m: Option<Levels>,
    /// Velocity that may be commanded, in m/s of test time: that of the command itself, and the change of displacement
    /// over the test time that it takes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_vel_m_per_s: Option<Levels>,
    /// Change of displacement from one command to the next, in m, whatever time it takes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_step_m: Option<Levels>,
    /// Displacement that may be measured, in m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_disp_m: Option<Levels>,
    /// Force that may be measured, in N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_force_n: Option<Levels>,
    /// End of the range of the displacement sensor, in m: a reading there or beyond says nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_disp_m: Option<Levels>,
    /// End of the range of the load cell, in N: a reading there or beyond says nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_force_n: Option<Levels>,
}

/// Two levels of one bound; at least one of them is given.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Levels {
    /// From here on an event is written, once in a test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warn: Option<f64>,
    /// From here on the specimen holds, and the test is over.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trip: Option<f64>,
}

/// A bound that cannot be.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum LimitsError {
    /// Neither level is given.
    #[error("`{key}` has neither a `warn` nor a `trip` level")]
    Empty {
        /// The bound.
        key: &'static str,
    },
    /// A level that is not greater than zero.
    #[error("the {level} level of `{key}` is {found}, but must be greater than 0 and finite")]
    NotPositive {
        /// The bound.
        key: &'static str,
        /// Which level.
        level: &'static str,
        /// What was found.
        found: f64,
    },
    /// The warning would come after the trip.
    #[error("`{key}` warns at {warn}, which is not below its trip level of {trip}")]
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
            Self::Empty { key } | Self::NotPositive { key, .. } | Self::Order { key, .. } => key,
        }
    }
}

/// The units of an axis: metres and newtons in one of them, and their symbols.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisUnits {
    /// Metres in one unit of displacement.
    pub metres: f64,
    /// Newtons in one unit of force.
    pub newtons: f64,
    /// Symbol of the unit of displacement.
    pub disp: &'static str,
    /// Symbol of the unit of force.
    pub force: &'static str,
}

impl AxisUnits {
    /// Metres and newtons.
    pub const SI: AxisUnits = AxisUnits {
        metres: 1.0,
        newtons: 1.0,
        disp: "m",
        force: "N",
    };
}

impl LimitsSpec {
    /// Every bound that is given, by its key.
    pub fn given(&self) -> impl Iterator<Item = (&'static str, Levels)> {
        [
            ("command_disp_m", self.command_disp_m),
            ("command_vel_m_per_s", self.command_vel_m_per_s),
            ("command_step_m", self.command_step_m),
            ("measured_disp_m", self.measured_disp_m),
            ("measured_force_n", self.measured_force_n),
            ("sensor_disp_m", self.sensor_disp_m),
            ("sensor_force_n", self.sensor_force_n),
        ]
        .into_iter()
        .filter_map(|(key, levels)| levels.map(|levels| (key, levels)))
    }

    /// These bounds where they are given, and those of `all` elsewhere.
    #[must_use]
    pub fn over(&self, all: &Self) -> Self {
        Self {
            command_disp_m: self.command_disp_m.or(all.command_disp_m),
            command_vel_m_per_s: self.command_vel_m_per_s.or(all.command_vel_m_per_s),
            command_step_m: self.command_step_m.or(all.command_step_m),
            measured_disp_m: self.measured_disp_m.or(all.measured_disp_m),
            measured_force_n: self.measured_force_n.or(all.measured_force_n),
            sensor_disp_m: self.sensor_disp_m.or(all.sensor_disp_m),
            sensor_force_n: self.sensor_force_n.or(all.sensor_force_n),
        }
    }

    /// Whether each bound that is given can be kept.
    ///
    /// # Errors
    /// The first that cannot.
    pub fn check(&self) -> Result<(), LimitsError> {
        for (key, Levels { warn, trip }) in self.given() {
            for (level, found) in [("warn", warn), ("trip", trip)] {
                if let Some(found) = found
                    && !(found > 0.0 && found.is_finite())
                {
                    return Err(LimitsError::NotPositive { key, level, found });
                }
            }
            match (warn, trip) {
                (None, None) => return Err(LimitsError::Empty { key }),
                (Some(warn), Some(trip)) if warn >= trip => {
                    return Err(LimitsError::Order { key, warn, trip });
                }
                _ => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(warn: Option<f64>, trip: Option<f64>) -> Option<Levels> {
        Some(Levels { warn, trip })
    }

    #[test]
    fn levels_that_contradict_each_other_are_named() {
        let check = |bound| {
            LimitsSpec {
                measured_force_n: bound,
                ..LimitsSpec::default()
            }
            .check()
            .map_err(|error| error.to_string())
        };
        assert_eq!(check(None), Ok(()));
        assert_eq!(check(levels(Some(4.0), Some(5.0))), Ok(()));
        assert_eq!(check(levels(Some(4.0), None)), Ok(()));
        for (bound, words) in [
            (levels(Some(5.0), Some(5.0)), "not below its trip level"),
            (levels(None, Some(0.0)), "trip level of `measured_force_n` is 0"),
            (levels(Some(f64::NAN), None), "warn level"),
            (levels(None, Some(f64::INFINITY)), "finite"),
            (levels(None, None), "neither"),
        ] {
            let text = check(bound).unwrap_err();
            assert!(text.contains(words), "{text}");
        }
    }

    #[test]
    fn what_an_axis_says_itself_goes_before_what_is_said_of_all() {
        let all = LimitsSpec {
            command_disp_m: levels(None, Some(0.1)),
            sensor_force_n: levels(None, Some(1e5)),
            ..LimitsSpec::default()
        };
        let own = LimitsSpec {
            command_disp_m: levels(None, Some(0.2)),
            ..LimitsSpec::default()
        };
        let merged = own.over(&all);
        assert_eq!(merged.command_disp_m, levels(None, Some(0.2)));
        assert_eq!(merged.sensor_force_n, all.sensor_force_n);
    }
}
