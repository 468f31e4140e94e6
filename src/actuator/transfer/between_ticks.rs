//! Course of a command from one tick to the next before it reaches an actuator.

use nalgebra::Complex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Command to the actuator between two ticks. It has no effect on an actuator without a lag.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BetweenTicks {
    /// Straight line from the last command to the new one. The actuator reaches the new command at
    /// the end of the tick.
    #[default]
    Ramped,
    /// New command over the whole tick, like a digital-to-analogue converter. On average the
    /// actuator receives it half a tick earlier than with "ramped".
    Held,
}

impl BetweenTicks {
    /// The name in a test file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ramped => "ramped",
            Self::Held => "held",
        }
    }

    /// The input at the start of a tick that goes from the command `last` to the command `new`. Real-time: yes.
    #[must_use]
    pub const fn start(self, last: f64, new: f64) -> f64 {
        match self {
            Self::Ramped => last,
            Self::Held => new,
        }
    }

    /// The fundamental of a held command over the command at ω in rad/s, for ticks of `tick` s: e^{iωT/2} sin(ωT/2)/(ωT/2).
    /// A ramp counts as the command itself: it differs by (ωT)²/12.
    #[must_use]
    pub(crate) fn response(self, omega: f64, tick: f64) -> Complex<f64> {
        let half = 0.5 * omega * tick;
        if self == Self::Ramped || half == 0.0 {
            return Complex::new(1.0, 0.0);
        }
        let (sine, cosine) = libm::sincos(half);
        Complex::new(cosine, sine) * (sine / half)
    }
}
