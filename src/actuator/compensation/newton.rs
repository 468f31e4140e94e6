//! The Newton form with the integrator's own velocity and acceleration: d + τ v + ½ τ (τ + Δt) w.
//!
//! With v = ∇d/Δt and w = ∇²d/Δt² this is the polynomial of order 2 on nodes a step apart, without the cancellation. The
//! Taylor form with ½ τ² would be wrong by ½ τ Δt ẍ: the published v belongs to t − Δt/2.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CompensationError, Compensator, Parameter, history, not_negative};
use gusset_quantity::state;

/// Extrapolation with the velocity and acceleration of the integrator: d + τ v + ½ τ (τ + Δt) w.
/// Only for the method "gui".
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NewtonSpec {
    /// Delay τ to compensate.
    #[schemars(example = 0.01)]
    pub delay_s: f64,
}

#[derive(Debug)]
pub(super) struct Newton {
    delay: [f64; 1],
    curve: f64,
}

state! { Newton as "newton" {} keeps { delay, curve } }

impl NewtonSpec {
    pub(super) fn build(&self, dt: f64) -> Result<Newton, CompensationError> {
        let delay = not_negative("delay_s", self.delay_s)?;
        history("delay_s", delay / dt)?;
        Ok(Newton {
            delay: [delay],
            curve: 0.5 * delay * (delay + dt),
        })
    }
}

impl Compensator for Newton {
    fn lead(&mut self, disp: f64, vel: f64, accel: f64) -> f64 {
        disp + self.delay[0] * vel + self.curve * accel
    }

    fn reset(&mut self, _: f64) {}

    fn names(&self) -> &'static [Parameter] {
        super::DELAY
    }

    fn parameters(&self) -> &[f64] {
        &self.delay
    }
}
