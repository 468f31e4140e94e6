//! Common parts of adaptive compensators: coefficients with bounds and rates, and regressors made in the same way from
//! commands and measurements.

use super::filter::{Differences, LowPass};
use super::{CompensationError, Compensator, Parameter, inside, positive};
use gusset_quantity::state;
use gusset_quantity::state::Stateful;

/// Names of the coefficients of a model's inverse.
pub(super) const COEFFICIENTS: &[Parameter] = &[
    Parameter {
        name: "a0",
        unit: "1",
    },
    Parameter {
        name: "a1",
        unit: "s",
    },
    Parameter {
        name: "a2",
        unit: "s2",
    },
    Parameter {
        name: "a3",
        unit: "s3",
    },
];

/// Static gain of a lead, as a share of its initial gain: the range of an actuator's own gain.
pub(super) const GAIN: (f64, f64) = (0.7, 1.4);

/// Coefficients that move towards a goal, within bounds and no faster than they may.
#[derive(Debug, Clone)]
pub(super) struct Bounded {
    start: Vec<f64>,
    pub values: Vec<f64>,
    pub bounds: Vec<(f64, f64)>,
    /// Per tick.
    rates: Vec<f64>,
}

state! { Bounded { values } keeps { start, bounds, rates } }

impl Bounded {
    /// Defaults for bounds and rates are those given with each coefficient. `given` are the keys `lower`, `upper` and
    /// `rate_per_s`.
    pub(crate) fn new(
        start: Vec<f64>,
        default_bounds: Vec<(f64, f64)>,
        given: [&Option<Vec<f64>>; 3],
        dt: f64,
    ) -> Result<Self, CompensationError> {
        let n = start.len();
        for (name, list) in ["lower", "upper", "rate_per_s"].into_iter().zip(given) {
            if let Some(list) = list
                && list.len() != n
            {
                return Err(CompensationError::Length {
                    name,
                    found: list.len(),
                    wanted: n,
                });
            }
        }
        let pick = |list: &Option<Vec<f64>>, i: usize| list.as_ref()?.get(i).copied();
        let [lower, upper, rate_per_s] = given;
        let mut bounds = Vec::with_capacity(n);
        let mut rates = Vec::with_capacity(n);
        for (index, (start, default)) in start.iter().zip(default_bounds).enumerate() {
            let lower = pick(lower, index).unwrap_or(default.0);
            let upper = pick(upper, index).unwrap_or(default.1);
            // Written so that NaN fails.
            if !(lower <= *start && *start <= upper) {
                return Err(CompensationError::Bounds {
                    index,
                    start: *start,
                    lower,
                    upper,
                });
            }
            // Across the whole range in two seconds.
            let rate = match pick(rate_per_s, index) {
                Some(rate) => inside("rate_per_s", rate, rate >= 0.0, "finite and not negative")?,
                None => 0.5 * (upper - lower),
            };
            bounds.push((lower, upper));
            rates.push(rate * dt);
        }
        Ok(Self {
            values: start.clone(),
            start,
            bounds,
            rates,
        })
    }

    /// Σ a_j d_j. Real-time: yes.
    pub(crate) fn times(&self, derivatives: [f64; 4]) -> f64 {
        let mut sum = 0.0;
        for (a, d) in self.values.iter().zip(derivatives) {
            sum += a * d;
        }
        sum
    }

    /// Moves towards `goal`. A goal that is NaN or infinite moves nothing. Real-time: yes.
    pub(crate) fn approach(&mut self, goal: &[f64]) {
        if !goal.iter().all(|goal| goal.is_finite()) {
            return;
        }
        let limits = self.bounds.iter().zip(&self.rates);
        for ((value, goal), ((lower, upper), rate)) in self.values.iter_mut().zip(goal).zip(limits)
        {
            let change = (goal - *value).clamp(-rate, *rate);
            *value = (*value + change).clamp(*lower, *upper);
        }
    }

    /// Moves towards `goal` on a straight line, for coefficients that only have a meaning together: all points between two valid
    /// ends are valid. The slowest coefficient sets the pace. All stop where one reaches its bound. A goal that is NaN or
    /// infinite moves nothing. Real-time: yes.
    pub(crate) fn approach_as_one(&mut self, goal: &[f64]) {
        if !goal.iter().all(|goal| goal.is_finite()) {
            return;
        }
        let mut share = 1.0f64;
        let limits = self.bounds.iter().zip(&self.rates);
        for ((value, goal), ((lower, upper), rate)) in self.values.iter().zip(goal).zip(limits) {
            let way = goal - value;
            let room = if way > 0.0 {
                upper - value
            } else {
                value - lower
            };
            let most = room.min(*rate);
            if way.abs() > most {
                share = share.min(most / way.abs());
            }
        }
        let bounds = self.bounds.iter();
        for ((value, goal), (lower, upper)) in self.values.iter_mut().zip(goal).zip(bounds) {
            *value = (*value + share * (goal - *value)).clamp(*lower, *upper);
        }
    }

    pub(crate) fn reset(&mut self) {
        self.values.copy_from_slice(&self.start);
    }
}

/// Filtered commands, and filtered measurements with their derivatives.
#[derive(Debug, Clone, Copy)]
pub(super) struct Regressors {
    command: LowPass,
    measured: LowPass,
    derivatives: Differences,
}

state! { Regressors { command, measured, derivatives } }

/// The filter with the corner `filter_hz`, which must be below half the rate of ticks.
pub(super) fn low_pass(filter_hz: f64, dt: f64) -> Result<LowPass, CompensationError> {
    positive("filter_hz", filter_hz)?;
    let below = filter_hz * dt < 0.5;
    inside(
        "filter_hz",
        filter_hz,
        below,
        "below half the rate of ticks",
    )?;
    Ok(LowPass::new(filter_hz, dt))
}

impl Regressors {
    pub(crate) fn new(filter_hz: f64, dt: f64) -> Result<Self, CompensationError> {
        let filter = low_pass(filter_hz, dt)?;
        Ok(Self {
            command: filter,
            measured: filter,
            derivatives: Differences::new(dt),
        })
    }

    /// Filtered command, and filtered measurement with its derivatives. Real-time: yes.
    pub(crate) fn push(&mut self, command: f64, measured: f64) -> (f64, [f64; 4]) {
        let command = self.command.push(command);
        let measured = self.measured.push(measured);
        (command, self.derivatives.push(measured))
    }

    /// Ticks after which a pair has no effect: the filters' memory and that of the differences of their outputs.
    pub(crate) const fn memory(&self) -> u32 {
        self.measured.memory().saturating_add(3)
    }

    pub(crate) fn reset(&mut self, disp: f64) {
        self.command.reset(disp);
        self.measured.reset(disp);
        self.derivatives.reset(disp);
    }
}

/// How coefficients follow from the regressors.
pub(super) trait Adaption: Stateful + Send + std::fmt::Debug {
    /// Where the coefficients `a` go after the filtered command `u` and the regressors `phi`; `None` if they stay. Real-time: yes.
    fn goal(&mut self, a: &[f64], u: f64, phi: [f64; 4]) -> Option<[f64; 4]>;

    /// Forgets the past.
    fn clear(&mut self) {}
}

/// A lead Σ a_j d_j of the target and its derivatives, with coefficients that adapt.
#[derive(Debug)]
pub(super) struct Adaptive<L> {
    a: Bounded,
    law: L,
    targets: Differences,
    regressors: Regressors,
}

state! { <L: Adaption> Adaptive<L> as "adaptive" { a, law, targets, regressors } }

impl<L: Adaption> Adaptive<L> {
    pub(crate) fn new(
        a: Bounded,
        law: L,
        filter_hz: f64,
        dt: f64,
    ) -> Result<Self, CompensationError> {
        Ok(Self {
            a,
            law,
            targets: Differences::new(dt),
            regressors: Regressors::new(filter_hz, dt)?,
        })
    }
}

impl<L: Adaption> Compensator for Adaptive<L> {
    fn lead(&mut self, disp: f64, _: f64, _: f64) -> f64 {
        self.a.times(self.targets.push(disp))
    }

    fn stands(&self, disp: f64) -> f64 {
        self.a.times([disp, 0.0, 0.0, 0.0])
    }

    fn amend(&mut self, disp: f64) {
        self.targets.amend(disp);
    }

    fn observe(&mut self, command: f64, measured: f64) {
        let (u, phi) = self.regressors.push(command, measured);
        if let Some(goal) = self.law.goal(&self.a.values, u, phi) {
            self.a.approach(&goal);
        }
    }

    fn notice(&mut self, command: f64, measured: f64) {
        self.regressors.push(command, measured);
    }

    fn memory(&self) -> u32 {
        self.regressors.memory()
    }

    fn reset(&mut self, disp: f64) {
        self.a.reset();
        self.targets.reset(disp);
        self.regressors.reset(disp);
        self.law.clear();
    }

    fn names(&self) -> &'static [Parameter] {
        COEFFICIENTS.get(..self.a.values.len()).unwrap_or_default()
    }

    fn parameters(&self) -> &[f64] {
        &self.a.values
    }

    #[cfg(test)]
    fn bounds(&self) -> &[(f64, f64)] {
        &self.a.bounds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goal_that_is_nan_moves_nothing() {
        let bounds = vec![(0.5, 1.5), (0.0, 0.1)];
        let made = Bounded::new(vec![1.0, 0.01], bounds, [&None; 3], 1e-3);
        let mut learnt = made.unwrap();
        for goal in [[f64::NAN, 0.02], [1.1, f64::INFINITY]] {
            learnt.approach(&goal);
            learnt.approach_as_one(&goal);
            assert_eq!(learnt.values, [1.0, 0.01]);
        }
    }
}
