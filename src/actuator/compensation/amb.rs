//! Adaptive model-based compensation (Gálmez & Fermandois 2022): the inverse of a three-pole model whose coefficients follow
//! a normalised gradient.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adaptive::{Adaption, Adaptive, Bounded, GAIN};
use super::{CompensationError, inside};
use gusset_quantity::state;

/// Adaptive model-based compensation: the inverse of a model with three poles. The coefficients
/// follow ȧ = Γ φ (u − aᵀφ)/(1 + φᵀφ). φ is the filtered measured displacement with its first three
/// derivatives. Source: Gálmez & Fermandois 2022.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AmbSpec {
    /// Initial coefficients: a₀, a₁ in s, a₂ in s², a₃ in s³. The default is the loading system of
    /// the virtual hybrid simulation benchmark without a specimen.
    #[schemars(example = [1.0, 0.0249, 0.000_107, 2.0e-7])]
    pub start: [f64; 4],
    /// Decimal logarithms of the adaptive gains (the diagonal of Γ), for motions in m.
    #[schemars(example = [8.4, 6.2, 2.1, 0.8])]
    pub log10_gains: [f64; 4],
    /// Cutoff frequency of the low-pass filter for commands and measurements.
    #[schemars(example = 20.0)]
    pub filter_hz: f64,
    /// Lower bounds of the coefficients. Default: 0.7 of the initial value for a₀, 0 for the
    /// others.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.7, 0.0, 0.0, 0.0])]
    pub lower: Option<Vec<f64>>,
    /// Upper bounds of the coefficients. Default: 1.4 of the initial value for a₀, 3 times the
    /// initial value for the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [1.4, 0.06, 0.0003, 6.0e-7])]
    pub upper: Option<Vec<f64>>,
    /// Largest change of each coefficient per second. Default: half of the distance between its
    /// bounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.2, 0.02, 0.0001, 2.0e-7])]
    pub rate_per_s: Option<Vec<f64>>,
}

impl Default for AmbSpec {
    fn default() -> Self {
        Self {
            start: [1.0, 0.01986, 8.44e-5, 1.986e-7],
            log10_gains: [8.4, 6.2, 2.1, 0.8],
            filter_hz: 20.0,
            lower: None,
            upper: None,
            rate_per_s: None,
        }
    }
}

/// A normalised gradient with these gains, per tick.
#[derive(Debug)]
pub(super) struct Gradient {
    gains: [f64; 4],
}

state! { Gradient as "gradient" {} keeps { gains } }

impl AmbSpec {
    pub(super) fn build(&self, dt: f64) -> Result<Adaptive<Gradient>, CompensationError> {
        let defaults = self.start.iter().enumerate().map(|(j, a)| match j {
            0 => (GAIN.0 * a, GAIN.1 * a),
            _ => (0.0, 3.0 * a),
        });
        let a = Bounded::new(
            self.start.to_vec(),
            defaults.collect(),
            [&self.lower, &self.upper, &self.rate_per_s],
            dt,
        )?;
        let mut gains = [0.0; 4];
        for (gain, log) in gains.iter_mut().zip(self.log10_gains) {
            inside(
                "log10_gains",
                log,
                (-30.0..=30.0).contains(&log),
                "from -30 to 30",
            )?;
            *gain = libm::pow(10.0, log) * dt;
        }
        Adaptive::new(a, Gradient { gains }, self.filter_hz, dt)
    }
}

impl Adaption for Gradient {
    fn goal(&mut self, a: &[f64], u: f64, phi: [f64; 4]) -> Option<[f64; 4]> {
        let (mut fitted, mut norm, mut step) = (0.0, 1.0, 0.0);
        for ((a, phi), gain) in a.iter().zip(phi).zip(self.gains) {
            fitted += a * phi;
            norm += phi * phi;
            step += gain * phi * phi;
        }
        // One tick takes off at most the whole error: beyond, the law would not be that of continuous time.
        let size = (u - fitted) / norm.max(step);
        let mut goal = [0.0; 4];
        let each = goal.iter_mut().zip(a).zip(phi.iter().zip(self.gains));
        for ((goal, a), (phi, gain)) in each {
            *goal = a + gain * phi * size;
        }
        Some(goal)
    }
}
