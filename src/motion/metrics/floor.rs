//! A number beside its noise floor: what noise alone would make of it.

use serde::{Deserialize, Deserializer, Serialize};

/// Scatters that a number must exceed to count as different from zero.
const SEEN: f64 = 2.0;

/// A number, what noise alone would make of it, and what is left without the noise; null where no noise was measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// Value computed from the samples.
    #[serde(deserialize_with = "or_nan")]
    pub value: f64,
    /// Noise floor.
    pub floor: Option<f64>,
    /// Corrected for the noise floor.
    pub corrected: Option<f64>,
}

/// A number, or null: JSON has no number for a value that is not finite.
fn or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

impl Judged {
    /// A number that an older file lacks.
    pub(super) const fn unknown() -> Self {
        Self {
            value: f64::NAN,
            floor: None,
            corrected: None,
        }
    }

    /// A number whose square grows by that of its floor.
    pub(super) fn grown(value: f64, floor: Option<f64>) -> Self {
        let corrected = floor.map(|floor| (value * value - floor * floor).max(0.0).sqrt());
        Self {
            value,
            floor,
            corrected,
        }
    }

    /// These metrics less `perfect`, the value without any error.
    pub(super) fn less(self, perfect: f64) -> Self {
        Self {
            value: self.value - perfect,
            corrected: self.corrected.map(|value| value - perfect),
            ..self
        }
    }

    /// A number that noise scatters about `perfect`.
    pub(super) fn scattered(value: f64, floor: Option<f64>, perfect: f64) -> Self {
        let is_seen = |floor: f64| (value - perfect).abs() > SEEN * floor;
        let corrected = floor.map(|floor| if is_seen(floor) { value } else { perfect });
        Self {
            value,
            floor,
            corrected,
        }
    }
}
