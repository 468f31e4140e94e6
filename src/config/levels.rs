//! The warn and trip levels of a limit, in a file.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

use super::value::{Judged, as_number};

/// Largest absolute value. Give `warn`, `trip` or both.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BoundSpec {
    /// Beyond this level, the controller writes an event.
    pub warn: Option<f64>,
    /// Beyond this level, the specimens hold and the test ends.
    pub trip: Option<f64>,
}

/// Smallest and largest value. Give `warn`, `trip` or both.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RangeSpec {
    /// Outside this range, the controller writes an event.
    #[serde(deserialize_with = "range")]
    pub warn: Option<[f64; 2]>,
    /// Outside this range, the specimens hold and the test ends.
    #[serde(deserialize_with = "range")]
    pub trip: Option<[f64; 2]>,
}

/// Reads a range, and says how one is written where a single number is found.
fn range<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[f64; 2]>, D::Error> {
    let range = Judged {
        expecting: "a range `[lowest, highest]`",
        judge: |found| {
            let size = as_number(found).map(f64::abs);
            Err(size
                .map(|size| format!("a range `[lowest, highest]`, such as `[-{size}, {size}]`")))
        },
        most: 2,
        list: |ends: Vec<f64>| <[f64; 2]>::try_from(ends).ok(),
    };
    deserializer.deserialize_any(range).map(Some)
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

/// A bound that cannot be kept.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{text}")]
pub(crate) struct LimitsError {
    /// The key to point at.
    pub key: &'static str,
    text: String,
}

impl LimitsError {
    fn empty<T>(key: &'static str) -> Result<T, Self> {
        let text = format!("`{key}` has neither a `warn` nor a `trip` level");
        Err(Self { key, text })
    }

    /// A size is greater than zero, and not NaN.
    pub(super) fn not_positive<T>(key: &'static str, found: f64) -> Result<T, Self> {
        let text = format!("a level of `{key}` is {found}, but must be greater than 0");
        Err(Self { key, text })
    }

    /// A warning that would come after the trip.
    fn order<T>(key: &'static str, warn: f64, trip: f64) -> Result<T, Self> {
        let text = format!("`{key}` warns at {warn}, which is not within its trip level of {trip}");
        Err(Self { key, text })
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
                return LimitsError::not_positive(key, found);
            }
        }
        match (self.warn, self.trip) {
            (None, None) => LimitsError::empty(key),
            (Some(warn), Some(trip)) if warn >= trip => LimitsError::order(key, warn, trip),
            _ => Ok(()),
        }
    }

    /// Checks the levels of a count.
    pub(super) fn check_count(self, key: &'static str) -> Result<(), LimitsError> {
        let mut levels = [self.warn, self.trip].into_iter().flatten();
        match levels.find(|level| level.fract() != 0.0 && level.is_finite()) {
            Some(found) => {
                let must = "must be a whole number of at least 1";
                let text = format!("a level of `{key}` is {found}, but {must}");
                Err(LimitsError { key, text })
            }
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
                let text = format!("`{key}` goes from {low} to {high}, which leaves no room");
                return Err(LimitsError { key, text });
            }
        }
        match (self.warn, self.trip) {
            (None, None) => LimitsError::empty(key),
            (Some([low, high]), Some([lowest, highest])) => {
                if low <= lowest {
                    LimitsError::order(key, low, lowest)
                } else if high >= highest {
                    LimitsError::order(key, high, highest)
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
