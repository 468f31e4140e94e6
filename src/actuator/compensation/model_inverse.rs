//! The inverse of a model with up to three poles, as a feed-forward of the target's derivatives (Carrion & Spencer 2007).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adaptive::COEFFICIENTS;
use super::filter::Differences;
use super::{CompensationError, Compensator, Parameter, inside, positive};
use gusset_quantity::state;

/// Feed-forward of the derivatives of the target, a₀ d + a₁ ḋ + a₂ d̈ + a₃ d⃛, with backward
/// differences. Source: Carrion & Spencer 2007.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelInverseSpec {
    /// One to four coefficients: a₀, a₁ in s, a₂ in s², a₃ in s³. They are the denominator of the
    /// actuator model divided by its gain.
    #[schemars(example = [1.0, 0.0249, 0.000_107])]
    pub coefficients: Vec<f64>,
}

#[derive(Debug)]
pub(super) struct ModelInverse {
    a: Vec<f64>,
    targets: Differences,
}

state! { ModelInverse as "model_inverse" { targets } keeps { a } }

impl ModelInverseSpec {
    pub(super) fn build(&self, dt: f64) -> Result<ModelInverse, CompensationError> {
        let found = self.coefficients.len();
        if found > 4 {
            return Err(CompensationError::NonCausal { found });
        }
        if found == 0 {
            return Err(CompensationError::Length {
                name: "coefficients",
                found,
                wanted: 1,
            });
        }
        for (i, a) in self.coefficients.iter().enumerate() {
            if i == 0 {
                positive("coefficients", *a)?;
            }
            inside("coefficients", *a, true, "finite")?;
        }
        Ok(ModelInverse {
            a: self.coefficients.clone(),
            targets: Differences::new(dt),
        })
    }
}

impl Compensator for ModelInverse {
    fn lead(&mut self, disp: f64, _: f64, _: f64) -> f64 {
        let derivatives = self.targets.push(disp);
        let mut sum = 0.0;
        for (a, d) in self.a.iter().zip(derivatives) {
            sum += a * d;
        }
        sum
    }

    fn stands(&self, disp: f64) -> f64 {
        self.a.first().map_or(disp, |a| a * disp)
    }

    fn amend(&mut self, disp: f64) {
        self.targets.amend(disp);
    }

    fn reset(&mut self, disp: f64) {
        self.targets.reset(disp);
    }

    fn names(&self) -> &'static [Parameter] {
        COEFFICIENTS.get(..self.a.len()).unwrap_or_default()
    }

    fn parameters(&self) -> &[f64] {
        &self.a
    }
}
