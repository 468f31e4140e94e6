//! Adaptive time series compensation (Chae, Kazemibidokhti & Ricles 2013).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adaptive::{Adaption, Adaptive, Bounded, GAIN};
use super::least_squares::Window;
use super::{CompensationError, history, inside, not_negative, positive};
use gusset_quantity::state;

/// Adaptive time series compensation, a₀ d + a₁ ḋ + …. A least-squares fit of past commands to the
/// measured displacement and its derivatives gives the coefficients. Source: Chae, Kazemibidokhti &
/// Ricles 2013.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AtsSpec {
    /// Highest derivative.
    #[serde(default = "two")]
    #[schemars(range(min = 1, max = 3))]
    #[schemars(example = 2)]
    pub order: u32,
    /// Delay τ that determines the initial coefficients. Required without `start`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.02)]
    pub delay_s: Option<f64>,
    /// Gain A of the actuator for the initial coefficients: a₀ = 1/A, a₁ = τ/A, a₂ = τ²/2A, a₃ =
    /// τ³/6A.
    #[serde(default = "one")]
    #[schemars(example = 0.98)]
    pub gain: f64,
    /// Initial coefficients from a₀ up, instead of `delay_s` and `gain`. The inverse of an
    /// identified actuator model excites higher modes less than that of a pure delay. Default: from
    /// `delay_s` and `gain`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Vec<f64>>,
    /// Length of the moving window of the fit.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub window_s: f64,
    /// Cutoff frequency of the low-pass filter for commands and measurements.
    #[serde(default = "twenty")]
    #[schemars(example = 20.0)]
    pub filter_hz: f64,
    /// Smallest root mean square of the motion in the window. Below it, the coefficients do not
    /// change.
    #[serde(default = "least")]
    #[schemars(example = 0.0001)]
    pub least_motion_m: f64,
    /// Lower bounds of the coefficients. Default: 0.7 of the initial value for a₀, 0 for the
    /// others.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.7, 0.0, 0.0])]
    pub lower: Option<Vec<f64>>,
    /// Upper bounds of the coefficients. Default: 1.4 of the initial value for a₀; 2, 3 and 4 times
    /// for a₁, a₂ and a₃.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [1.4, 0.05, 0.0003])]
    pub upper: Option<Vec<f64>>,
    /// Largest change of each coefficient per second. Default: half of the distance between its
    /// bounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.2, 0.02, 0.0001])]
    pub rate_per_s: Option<Vec<f64>>,
}

const fn one() -> f64 {
    1.0
}

const fn two() -> u32 {
    2
}

const fn twenty() -> f64 {
    20.0
}

const fn least() -> f64 {
    1e-4
}

/// A least-squares fit over a window of the past.
#[derive(Debug)]
pub(super) struct Fit {
    window: Window,
    /// Mean square of motion.
    least: f64,
}

state! { Fit { window } keeps { least } }

impl AtsSpec {
    pub(super) fn build(&self, dt: f64) -> Result<Adaptive<Fit>, CompensationError> {
        let order = f64::from(self.order);
        inside("order", order, (1..=3).contains(&self.order), "1, 2 or 3")?;
        let delay = match (self.delay_s, &self.start) {
            (Some(delay), _) => not_negative("delay_s", delay)?,
            // `start` is given instead.
            (None, Some(_)) => 0.0,
            (None, None) => return Err(CompensationError::NoDelay),
        };
        let gain = positive("gain", self.gain)?;
        let window = positive("window_s", self.window_s)? / dt;
        let rows = history("window_s", window)?;
        let enough = rows > 2 * (self.order as usize + 1);
        inside("window_s", self.window_s, enough, "at least a few ticks")?;
        let least = not_negative("least_motion_m", self.least_motion_m)?;
        let start = [1.0, delay, delay * delay / 2.0, delay * delay * delay / 6.0];
        let wanted = self.order as usize + 1;
        let start: Vec<f64> = match &self.start {
            None => start.iter().take(wanted).map(|a| a / gain).collect(),
            Some(given) if given.len() == wanted => given.clone(),
            Some(given) => {
                return Err(CompensationError::Length {
                    name: "start",
                    found: given.len(),
                    wanted,
                });
            }
        };
        let defaults = start.iter().enumerate().map(|(j, a)| match j {
            0 => (GAIN.0 * a, GAIN.1 * a),
            // One that begins at zero may still find the discretisation's own term.
            _ => (0.0, (j as f64 + 1.0) * a + dt.powi(j as i32)),
        });
        let a = Bounded::new(
            start.clone(),
            defaults.collect(),
            [&self.lower, &self.upper, &self.rate_per_s],
            dt,
        )?;
        let window = Window::new(rows);
        let least = least * least;
        Adaptive::new(a, Fit { window, least }, self.filter_hz, dt)
    }
}

impl Adaption for Fit {
    fn goal(&mut self, a: &[f64], u: f64, phi: [f64; 4]) -> Option<[f64; 4]> {
        self.window.push(phi, u);
        let moves = self.window.mean_square() > self.least;
        moves.then(|| self.window.solve(a.len(), a)).flatten()
    }

    fn clear(&mut self) {
        self.window.clear();
    }
}
