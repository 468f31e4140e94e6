//! Polynomial extrapolation through past targets (Horiuchi, Inoue, Konno & Namita 1999).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::filter::History;
use super::{CompensationError, Compensator, Parameter, history, inside, not_negative};
use gusset_quantity::state;

/// Polynomial extrapolation of the targets by a delay. Source: Horiuchi, Inoue, Konno & Namita
/// 1999.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PolynomialSpec {
    /// Order of the polynomial. Orders above 3 can destabilise lightly damped higher modes.
    #[schemars(range(min = 1, max = 4))]
    #[schemars(example = 3)]
    pub order: u32,
    /// Delay to compensate.
    #[schemars(example = 0.01)]
    pub delay_s: f64,
    /// Spacing of the past targets that the polynomial passes through.
    #[serde(default)]
    #[schemars(example = &"step")]
    pub nodes: Nodes,
}

/// Spacing of the past targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Nodes {
    /// Spacing equal to the delay. The weights are 2, −1 (order 1); 3, −3, 1 (order 2); 4, −6, 4,
    /// −1 (order 3); 5, −10, 10, −5, 1 (order 4).
    #[default]
    Delay,
    /// Spacing of one tick. The weights grow with powers of the delay in ticks.
    Step,
}

/// Weights of x(t), x(t − τ) … for x(t + τ): (−1)^j (n+1 over j+1).
#[must_use]
pub(crate) fn horiuchi_weights(order: u32) -> [f64; 5] {
    let mut weights = [0.0; 5];
    let n = f64::from(order);
    let mut binomial = n + 1.0;
    for (j, weight) in weights.iter_mut().enumerate().take(order as usize + 1) {
        *weight = if j % 2 == 0 { binomial } else { -binomial };
        let j = j as f64;
        binomial *= (n - j) / (j + 2.0);
    }
    weights
}

/// Weights of x\[i\], x\[i−1\] … for x(t + η Δt): Π_{k≠j} (η + k)/(k − j).
#[must_use]
pub(crate) fn lagrange_weights(order: u32, eta: f64) -> [f64; 5] {
    let mut weights = [0.0; 5];
    for (j, weight) in weights.iter_mut().enumerate().take(order as usize + 1) {
        let mut product = 1.0;
        for k in (0..=order as usize).filter(|k| *k != j) {
            product *= (eta + k as f64) / (k as f64 - j as f64);
        }
        *weight = product;
    }
    weights
}

#[derive(Debug)]
pub(super) struct Polynomial {
    weights: [f64; 5],
    nodes: usize,
    /// In ticks.
    spacing: f64,
    targets: History,
    delay: [f64; 1],
}

state! {
    Polynomial as "polynomial" { targets } keeps { weights, nodes, spacing, delay }
}

impl PolynomialSpec {
    pub(super) fn build(&self, dt: f64) -> Result<Polynomial, CompensationError> {
        inside(
            "order",
            f64::from(self.order),
            (1..=4).contains(&self.order),
            "1, 2, 3 or 4",
        )?;
        not_negative("delay_s", self.delay_s)?;
        let eta = self.delay_s / dt;
        let (weights, spacing) = match self.nodes {
            Nodes::Delay => (horiuchi_weights(self.order), eta),
            Nodes::Step => (lagrange_weights(self.order, eta), 1.0),
        };
        let entries = history("delay_s", spacing * f64::from(self.order) + 2.0)?;
        Ok(Polynomial {
            weights,
            nodes: self.order as usize + 1,
            spacing,
            targets: History::new(entries),
            delay: [self.delay_s],
        })
    }
}

impl Compensator for Polynomial {
    fn lead(&mut self, disp: f64, _: f64, _: f64) -> f64 {
        self.targets.push(disp);
        let mut sum = 0.0;
        for (j, weight) in self.weights.iter().enumerate().take(self.nodes) {
            sum += weight * self.targets.between(j as f64 * self.spacing);
        }
        sum
    }

    fn amend(&mut self, disp: f64) {
        self.targets.amend(disp);
    }

    fn reset(&mut self, disp: f64) {
        self.targets.reset(disp);
    }

    fn names(&self) -> &'static [Parameter] {
        super::DELAY
    }

    fn parameters(&self) -> &[f64] {
        &self.delay
    }
}
