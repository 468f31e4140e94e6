//! A test with drawn numbers, by a controller that does not know them: the draws are the truth, and the estimates k̂, ĉ and λ of
//! the controller stay those of the file.

use gusset_config::{ConfigError, LambdaValue, Loaded};
use gusset_setup::{self as setup, Trial};

/// Estimates and λ of a controller, which no draw changes.
#[derive(Debug)]
pub(crate) struct Unaware<'a> {
    loaded: &'a Loaded,
    /// k̂ and ĉ of every specimen.
    estimates: Vec<setup::Estimate>,
    lambda: Option<f64>,
}

impl<'a> Unaware<'a> {
    /// The controller of a test that runs with `lambda`, or with the λ of its file.
    ///
    /// # Errors
    /// As [`setup::estimates`].
    pub(crate) fn of(loaded: &'a Loaded, lambda: Option<f64>) -> Result<Self, ConfigError> {
        Ok(Self {
            loaded,
            estimates: setup::estimates(loaded)?,
            lambda,
        })
    }

    /// A trial with the estimates of this controller.
    #[must_use]
    pub(crate) fn trial(&self, trial: Trial) -> Trial {
        Trial {
            believed: self.estimates.clone(),
            ..trial
        }
    }

    /// The test with other numbers and the λ of this controller.
    ///
    /// # Errors
    /// The test cannot have these numbers.
    pub(crate) fn with(&self, sets: &[String]) -> Result<Loaded, ConfigError> {
        let mut drawn = self.loaded.varied(sets)?;
        if let Some(lambda) = self.lambda {
            drawn.file.integrator.lambda = if lambda == f64::INFINITY {
                LambdaValue::Infinite
            } else {
                LambdaValue::Number(lambda)
            };
        }
        Ok(drawn)
    }
}
