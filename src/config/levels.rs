//! The warn and trip levels of a limit, in a file.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{self, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

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

impl From<BoundSpec> for RangeSpec {
    fn from(BoundSpec { warn, trip }: BoundSpec) -> Self {
        let up_to = |level: f64| [f64::NEG_INFINITY, level];
        Self {
            warn: warn.map(up_to),
            trip: trip.map(up_to),
        }
    }
}

/// A bound that cannot be.
#[derive(Debug, Clone, PartialEq, Error)]
pub(crate) enum LimitsError {
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
    pub(crate) const fn key(&self) -> &'static str {
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
    pub(crate) fn check(self, key: &'static str) -> Result<(), LimitsError> {
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
    pub(super) fn check_count(self, key: &'static str) -> Result<(), LimitsError> {
        let mut levels = [self.warn, self.trip].into_iter().flatten();
        match levels.find(|level| level.fract() != 0.0 && level.is_finite()) {
            Some(found) => Err(LimitsError::NotWhole { key, found }),
            None => self.check(key),
        }
    }

    /// Both levels, infinite where none is given.
    #[must_use]
    pub fn levels(self) -> [f64; 2] {
        [self.warn, self.trip].map(|level| level.unwrap_or(f64::INFINITY))
    }
}

impl RangeSpec {
    pub(super) fn check(self, key: &'static str) -> Result<(), LimitsError> {
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
    pub(super) fn over(own: Option<Self>, all: Option<Self>) -> Option<Self> {
        let (Some(one), Some(other)) = (own, all) else {
            return own.or(all);
        };
        Some(Self {
            warn: one.warn.or(other.warn),
            trip: one.trip.or(other.trip),
        })
    }

    /// The largest values alone.
    #[must_use]
    pub(crate) fn upper(self) -> BoundSpec {
        BoundSpec {
            warn: self.warn.map(|[_, high]| high),
            trip: self.trip.map(|[_, high]| high),
        }
    }
}
