//! Inverse compensation (Chen, Ricles, Marullo & Mercan 2009): the inverse of the plant z/(α z − (α − 1)).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CompensationError, Compensator, Parameter, history, not_negative};
use gusset_quantity::state;

/// Inverse compensation, α d\[i\] − (α − 1) d\[i−1\] with α = 1 + delay/Δt. It equals a polynomial
/// of order 1 with `nodes = "step"`. Source: Chen, Ricles, Marullo & Mercan 2009.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InverseSpec {
    /// Delay to compensate.
    #[schemars(example = 0.01)]
    pub delay_s: f64,
}

#[derive(Debug)]
pub(super) struct Inverse {
    alpha: [f64; 1],
    last: f64,
}

state! { Inverse as "inverse" { last } keeps { alpha } }

impl InverseSpec {
    pub(super) fn build(&self, dt: f64) -> Result<Inverse, CompensationError> {
        let ticks = not_negative("delay_s", self.delay_s)? / dt;
        history("delay_s", ticks)?;
        Ok(Inverse {
            alpha: [1.0 + ticks],
            last: 0.0,
        })
    }
}

impl Compensator for Inverse {
    fn lead(&mut self, disp: f64, _: f64, _: f64) -> f64 {
        let [alpha] = self.alpha;
        let command = alpha * disp - (alpha - 1.0) * self.last;
        self.last = disp;
        command
    }

    fn amend(&mut self, disp: f64) {
        self.last = disp;
    }

    fn reset(&mut self, disp: f64) {
        self.last = disp;
    }

    fn names(&self) -> &'static [Parameter] {
        &[Parameter {
            name: "alpha",
            unit: "1",
        }]
    }

    fn parameters(&self) -> &[f64] {
        &self.alpha
    }
}
