//! A filter of four targets whose weights follow recursive least squares (Quiroz, Gálmez & Fermandois 2024).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adaptive::{Bounded, GAIN, low_pass};
use super::filter::{History, LowPass};
use super::polynomial::lagrange_weights;
use super::{CompensationError, Compensator, Parameter, history, inside, not_negative, positive};
use gusset_quantity::state;

const TAPS: usize = 4;

/// Filter θᵀ \[d, d(t − s), d(t − 2s), d(t − 3s)\] of the targets. Recursive least squares of
/// commands on measurements gives the weights θ. Source: Quiroz, Gálmez & Fermandois 2024.
///
/// All weights change in the same proportion. They stop where one of them would exceed its bound.
/// Their sum, the static gain, stays between 0.7 and 1.4.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecursiveFirSpec {
    /// Delay τ that determines the initial weights: 1 + τ/s, −τ/s, 0, 0.
    #[schemars(example = 0.01)]
    pub delay_s: f64,
    /// Time s between the targets. It must be a whole number of ticks. Default: the number of ticks
    /// closest to 1 ms, at least one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.001)]
    pub spacing_s: Option<f64>,
    /// Forgetting factor per tick, above 0.9 and at most 1. 1 never forgets.
    #[serde(default = "one")]
    #[schemars(example = 0.999)]
    pub forgetting: f64,
    /// Initial variance of the weights divided by the variance of the motion. A larger value adapts
    /// faster at the start.
    #[serde(default = "variance")]
    #[schemars(example = 1.0e7)]
    pub start_variance_per_m2: f64,
    /// Cutoff frequency of the low-pass filter for commands and measurements.
    #[serde(default = "twenty")]
    #[schemars(example = 20.0)]
    pub filter_hz: f64,
    /// Lower bounds of the weights. Default: the initial weight minus the largest weight of a
    /// third-order extrapolation by τ. At least 4 (1 + τ/s) is subtracted.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [-50.0, -50.0, -50.0, -50.0])]
    pub lower: Option<Vec<f64>>,
    /// Upper bounds of the weights. Default: as far above the initial weight as `lower` is below
    /// it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [50.0, 50.0, 50.0, 50.0])]
    pub upper: Option<Vec<f64>>,
    /// Largest change of each weight per second. Default: half of the distance between its bounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [10.0, 10.0, 10.0, 10.0])]
    pub rate_per_s: Option<Vec<f64>>,
}

const fn one() -> f64 {
    1.0
}

const fn twenty() -> f64 {
    20.0
}

const fn variance() -> f64 {
    1e8
}

#[derive(Debug)]
pub(super) struct RecursiveFir {
    /// Weights in use.
    theta: Bounded,
    /// Estimated weights.
    estimate: [f64; TAPS],
    covariance: [[f64; TAPS]; TAPS],
    spacing: usize,
    forgetting: f64,
    variance: f64,
    targets: History,
    commands: LowPass,
    measurements: LowPass,
    measured: History,
}

state! {
    RecursiveFir as "recursive_fir" {
        theta, estimate, covariance, targets, commands, measurements, measured
    }
    keeps { spacing, forgetting, variance }
}

impl RecursiveFirSpec {
    pub(super) fn build(&self, dt: f64) -> Result<RecursiveFir, CompensationError> {
        let delay = not_negative("delay_s", self.delay_s)?;
        let spacing = match self.spacing_s {
            Some(spacing) => {
                let ticks = positive("spacing_s", spacing)? / dt;
                let whole = ticks.round();
                let is_whole = whole >= 1.0 && (ticks - whole).abs() < 1e-6 * whole;
                inside("spacing_s", spacing, is_whole, "a whole number of ticks")?;
                whole
            }
            None => (1e-3 / dt).round().max(1.0),
        };
        let entries = history("spacing_s", spacing * 3.0 + 1.0)?;
        history("delay_s", delay / dt)?;
        let forgets = self.forgetting > 0.9 && self.forgetting <= 1.0;
        inside(
            "forgetting",
            self.forgetting,
            forgets,
            "above 0.9 and at most 1",
        )?;
        let variance = positive("start_variance_per_m2", self.start_variance_per_m2)?;
        let filter = low_pass(self.filter_hz, dt)?;
        let eta = delay / (spacing * dt);
        let start = vec![1.0 + eta, -eta, 0.0, 0.0];
        let third = lagrange_weights(3, eta).into_iter().map(f64::abs);
        let way = third.fold(4.0 * (1.0 + eta), f64::max);
        let defaults = start
            .iter()
            .map(|theta| (theta - way, theta + way))
            .collect();
        let theta = Bounded::new(
            start,
            defaults,
            [&self.lower, &self.upper, &self.rate_per_s],
            dt,
        )?;
        let mut fir = RecursiveFir {
            theta,
            estimate: [0.0; TAPS],
            covariance: [[0.0; TAPS]; TAPS],
            spacing: spacing as usize,
            forgetting: self.forgetting,
            variance,
            targets: History::new(entries),
            commands: filter,
            measurements: filter,
            measured: History::new(entries),
        };
        fir.begin();
        Ok(fir)
    }
}

impl RecursiveFir {
    fn begin(&mut self) {
        self.theta.reset();
        for (estimate, theta) in self.estimate.iter_mut().zip(&self.theta.values) {
            *estimate = *theta;
        }
        self.covariance = [[0.0; TAPS]; TAPS];
        for (i, row) in self.covariance.iter_mut().enumerate() {
            row[i] = self.variance;
        }
    }

    /// Share of the past that still counts after this tick. It forgets no further than it began, or it would wind up where
    /// nothing moves. Then it forgets nothing at all, because a variance that is cut back alone leaves no covariance.
    fn forgets(&self, gain: &[f64; TAPS], scale: f64) -> f64 {
        let variances = self.covariance.iter().enumerate();
        let trace: f64 = variances
            .zip(gain)
            .map(|((i, row), gain)| row[i] - gain * gain / scale)
            .sum();
        if trace / self.forgetting > TAPS as f64 * self.variance {
            1.0
        } else {
            self.forgetting
        }
    }

    /// The best fit of all weights whose sum is within its bounds: the estimate, if its own sum is.
    fn goal(&self) -> [f64; TAPS] {
        let mut goal = self.estimate;
        let sum: f64 = goal.iter().sum();
        let off = sum.clamp(GAIN.0, GAIN.1) - sum;
        if off == 0.0 {
            return goal;
        }
        let mut along = [0.0; TAPS];
        for (along, row) in along.iter_mut().zip(&self.covariance) {
            *along = row.iter().sum();
        }
        let variance: f64 = along.iter().sum();
        // Positive but for roundoff: then the sum is known too well for another to fit.
        let share = if variance > 0.0 {
            off / variance
        } else {
            f64::NAN
        };
        for (goal, along) in goal.iter_mut().zip(along) {
            *goal += share * along;
        }
        goal
    }
}

impl Compensator for RecursiveFir {
    fn lead(&mut self, disp: f64, _: f64, _: f64) -> f64 {
        self.targets.push(disp);
        let mut sum = 0.0;
        for (j, theta) in self.theta.values.iter().enumerate() {
            sum += theta * self.targets.back(j * self.spacing);
        }
        sum
    }

    fn stands(&self, disp: f64) -> f64 {
        let sum: f64 = self.theta.values.iter().sum();
        sum * disp
    }

    fn amend(&mut self, disp: f64) {
        self.targets.amend(disp);
    }

    fn observe(&mut self, command: f64, measured: f64) {
        let u = self.commands.push(command);
        self.measured.push(self.measurements.push(measured));
        let mut phi = [0.0; TAPS];
        for (j, phi) in phi.iter_mut().enumerate() {
            *phi = self.measured.back(j * self.spacing);
        }
        let mut gain = [0.0; TAPS];
        let (mut error, mut seen) = (u, self.forgetting);
        for ((gain, row), (phi_i, estimate)) in gain
            .iter_mut()
            .zip(&self.covariance)
            .zip(phi.iter().zip(&self.estimate))
        {
            for (p, phi) in row.iter().zip(&phi) {
                *gain += p * phi;
            }
            seen += *gain * phi_i;
            error -= estimate * phi_i;
        }
        let forgetting = self.forgets(&gain, seen);
        let scale = seen + (forgetting - self.forgetting);
        // Positive but for roundoff.
        if !(scale.is_finite() && scale > 0.0 && error.is_finite()) {
            return;
        }
        for (estimate, gain) in self.estimate.iter_mut().zip(&gain) {
            *estimate += gain / scale * error;
        }
        for i in 0..TAPS {
            for j in 0..=i {
                let value = (self.covariance[i][j] - gain[i] * gain[j] / scale) / forgetting;
                let value = if i == j {
                    value.max(1e-12 * self.variance)
                } else {
                    value
                };
                self.covariance[i][j] = value;
                self.covariance[j][i] = value;
            }
        }
        let goal = self.goal();
        self.theta.approach_as_one(&goal);
    }

    fn notice(&mut self, command: f64, measured: f64) {
        self.commands.push(command);
        self.measured.push(self.measurements.push(measured));
    }

    fn memory(&self) -> u32 {
        let taps = u32::try_from((TAPS - 1) * self.spacing).unwrap_or(u32::MAX);
        taps.saturating_add(self.measurements.memory())
    }

    fn reset(&mut self, disp: f64) {
        self.begin();
        self.targets.reset(disp);
        self.measured.reset(disp);
        self.commands.reset(disp);
        self.measurements.reset(disp);
    }

    fn names(&self) -> &'static [Parameter] {
        const fn tap(name: &'static str) -> Parameter {
            Parameter { name, unit: "1" }
        }
        const NAMES: [Parameter; TAPS] = [tap("t0"), tap("t1"), tap("t2"), tap("t3")];
        &NAMES
    }

    fn parameters(&self) -> &[f64] {
        &self.theta.values
    }

    #[cfg(test)]
    fn bounds(&self) -> &[(f64, f64)] {
        &self.theta.bounds
    }
}
