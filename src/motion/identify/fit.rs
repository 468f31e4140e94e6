//! Nonlinear least squares of the models on the lines of the band (Levenberg–Marquardt), weighted by the noise of each line.
//!
//! The command is known and the noise of the lines is independent, so the sum of squares is the likelihood. The covariance
//! is the inverse of its curvature times the mean square of the residuals. A model that does not fit has larger residuals,
//! and its standard errors grow with them. Schwarz's criterion compares the models.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::lines::{C64, Lines};
use super::model::{Model, Parameter};
use super::{Estimate, Point};

/// Most iterations from one start.
const ITERATIONS: usize = 200;
/// The fit has arrived when a step changes the sum of squares by less than this part, and no parameter by more than the other.
const ARRIVED: f64 = 1e-13;
/// Relative step of the numerical derivatives.
const STEP: f64 = 1e-6;
/// Mean square per line, in parts of its noise, up to which a fit leaves nothing but noise.
const NOISE: f64 = 1.3;
/// Part of the measured power below which residuals are roundoff: models with smaller ones are equally right.
const EXACT: f64 = 1e-14;
/// A negative delay of a delayed lag is no delay.
const LEAST_DELAY: f64 = 0.0;

/// One fitted model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// Its parameters, in the order of [`Model::parameters`].
    pub parameters: Vec<Found>,
    /// Root mean square of the residuals, as a share of the measured signal in the band.
    pub residual: f64,
    /// Schwarz's criterion: the smallest is the best model.
    pub criterion: f64,
    /// Delay in s of slow motion.
    pub slow_delay_s: f64,
}

/// One parameter as found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Found {
    /// Key, as `transfer` spells it.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// The number.
    pub value: f64,
    /// Its standard error.
    pub std: f64,
}

impl Fit {
    /// A parameter by its key.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<Estimate> {
        let found = self.parameters.iter().find(|found| found.name == name)?;
        Some(Estimate {
            value: found.value,
            std: found.std,
        })
    }

    /// Values of all parameters, in order.
    #[must_use]
    pub(crate) fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|found| found.value).collect()
    }

    /// Measured over commanded displacement at a frequency, for samples of `dt` seconds.
    #[must_use]
    pub fn response(&self, hz: f64, dt: f64) -> C64 {
        let omega = 2.0 * std::f64::consts::PI * hz;
        self.model.response(&self.values(), omega, dt)
    }

    /// Phase lag over ω in s at a frequency; the slow delay says how often the phase went round.
    #[must_use]
    pub(crate) fn delay(&self, hz: f64, dt: f64) -> f64 {
        use std::f64::consts::TAU;
        let response = self.response(hz, dt);
        let raw = -libm::atan2(response.im, response.re);
        let turns = (hz * self.slow_delay_s - raw / TAU).round();
        (raw / TAU + turns) / hz
    }
}

/// Fits every model; those that fit nowhere are left out.
pub(super) fn fit_all(
    lines: &Lines,
    deviations: &[f64],
    points: &[Point],
    coarse: f64,
) -> Vec<Fit> {
    let first = points.iter().find(|point| point.trusted);
    let gain = first.map_or(1.0, |point| point.gain);
    let seen = first.map_or(coarse, |point| point.delay_s);
    let top = points.last().map_or(1.0, |point| point.hz);
    let data = Data { lines, deviations };
    Model::ALL
        .into_iter()
        .filter_map(|model| {
            let starts = starts(model, gain, seen.max(0.1 * lines.dt), coarse, top);
            let mut best: Option<(Vec<f64>, f64)> = None;
            for start in &starts {
                let Some((inner, cost)) = data.descend(model, start) else {
                    continue;
                };
                if best.as_ref().is_none_or(|(_, least)| cost < *least) {
                    best = Some((inner, cost));
                }
                // The residual is nothing but noise: no other start finds less.
                if cost < NOISE * lines.omega.len() as f64 {
                    break;
                }
            }
            let (inner, cost) = best?;
            data.judge(model, &inner, cost)
        })
        .collect()
}

/// Where the search begins.
fn starts(model: Model, gain: f64, seen: f64, coarse: f64, top: f64) -> Vec<Vec<f64>> {
    use std::f64::consts::PI;
    let two = |delay: f64, hz: f64| [hz, (PI * hz * delay).clamp(0.05, 4.0)];
    let frequencies = [0.5 * top, 1.2 * top, 3.0 * top];
    let shares = [0.15, 0.5, 0.85];
    match model {
        Model::Delay => vec![vec![gain, coarse], vec![gain, seen]],
        Model::FirstOrder => vec![vec![gain, seen], vec![gain, 0.3 * seen]],
        Model::SecondOrder => frequencies
            .map(|hz| [&[gain], &two(seen, hz)[..]].concat())
            .to_vec(),
        Model::DelayedFirstOrder => shares
            .map(|share| vec![gain, share * seen, (1.0 - share) * seen])
            .to_vec(),
        Model::DelayedSecondOrder => shares
            .iter()
            .flat_map(|share| {
                frequencies.map(|hz| {
                    let rest = (1.0 - share) * seen;
                    [&[gain, share * seen], &two(rest, hz)[..]].concat()
                })
            })
            .collect(),
    }
}

struct Data<'a> {
    lines: &'a Lines,
    deviations: &'a [f64],
}

/// Positive parameters are fitted by their logarithms.
fn outer(parameters: &[Parameter], inner: &[f64]) -> Vec<f64> {
    let pairs = parameters.iter().zip(inner);
    pairs
        .map(|(p, v)| if p.positive { libm::exp(*v) } else { *v })
        .collect()
}

impl Data<'_> {
    /// Residual on each line, over its noise.
    fn residuals(&self, model: Model, inner: &[f64]) -> Vec<C64> {
        let values = outer(model.parameters(), inner);
        let Lines {
            omega,
            command,
            measured,
            dt,
            ..
        } = self.lines;
        let each = omega.iter().zip(command).zip(measured).zip(self.deviations);
        each.map(|(((w, u), y), deviation)| (y - model.response(&values, *w, *dt) * u) / *deviation)
            .collect()
    }

    /// Derivatives of the residuals, one column per parameter.
    fn slopes(&self, model: Model, inner: &[f64]) -> Vec<Vec<C64>> {
        let sizes = model.parameters().iter().zip(inner);
        let columns = sizes.enumerate().map(|(index, (parameter, value))| {
            let step = if parameter.positive {
                STEP
            } else if parameter.unit == "s" {
                STEP * value.abs().max(self.lines.dt)
            } else {
                STEP * value.abs().max(1e-3)
            };
            let moved = |by: f64| {
                let mut inner = inner.to_vec();
                inner[index] += by;
                self.residuals(model, &inner)
            };
            let (up, down) = (moved(step), moved(-step));
            let pairs = up.iter().zip(&down);
            pairs.map(|(a, b)| (a - b) / (2.0 * step)).collect()
        });
        columns.collect()
    }

    /// From a start to the nearest minimum: the inner parameters there and the sum of squares.
    fn descend(&self, model: Model, start: &[f64]) -> Option<(Vec<f64>, f64)> {
        let parameters = model.parameters();
        let pairs = parameters.iter().zip(start);
        let mut inner: Vec<f64> = pairs
            .map(|(p, v)| if p.positive { libm::log(*v) } else { *v })
            .collect();
        let mut residuals = self.residuals(model, &inner);
        let mut cost = sum(&residuals);
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            let (curvature, slope) = normal(&self.slopes(model, &inner), &residuals);
            let mut arrived = false;
            let mut moved = false;
            for _ in 0..30 {
                let mut damped = curvature.clone();
                for i in 0..damped.nrows() {
                    damped[(i, i)] *= 1.0 + damping;
                }
                let Some(step) = damped.cholesky().map(|factor| factor.solve(&slope)) else {
                    damping *= 10.0;
                    continue;
                };
                let next: Vec<f64> = inner.iter().zip(step.iter()).map(|(v, s)| v - s).collect();
                let next_residuals = self.residuals(model, &next);
                let next_cost = sum(&next_residuals);
                if next_cost <= cost {
                    arrived = cost - next_cost <= ARRIVED * cost;
                    (inner, residuals, cost) = (next, next_residuals, next_cost);
                    damping = (damping * 0.2).max(1e-12);
                    moved = true;
                    break;
                }
                damping *= 5.0;
            }
            if arrived || !moved {
                break;
            }
        }
        cost.is_finite().then_some((inner, cost))
    }

    /// Standard errors and criterion of a fit; none if it is no model of an actuator.
    fn judge(&self, model: Model, inner: &[f64], cost: f64) -> Option<Fit> {
        let parameters = model.parameters();
        let values = outer(parameters, inner);
        let p = parameters.len();
        // Real and imaginary part of every line.
        let freedom = 2.0 * self.lines.omega.len() as f64 - p as f64;
        let slopes = self.slopes(model, inner);
        let (curvature, _) = normal(&slopes, &[]);
        let covariance = curvature.try_inverse()? * (cost / freedom);
        let found = parameters.iter().zip(&values).enumerate();
        let found: Vec<Found> = found
            .map(|(i, (parameter, value))| {
                let std = covariance[(i, i)].max(0.0).sqrt();
                Found {
                    name: parameter.name,
                    unit: parameter.unit,
                    value: *value,
                    // d exp(v) = exp(v) dv.
                    std: if parameter.positive { value * std } else { std },
                }
            })
            .collect();
        // A parameter with an uncertainty above its own size is not determined, and a motion faster than the ticks is not
        // visible. Another model gives the same result with fewer parameters.
        let of_all = parameters.iter().zip(&found);
        let sound = of_all.fold(true, |sound, (parameter, f)| {
            let is_known = !parameter.positive || f.std < f.value;
            let is_seen = parameter.unit != "Hz" || f.value < 0.5 / self.lines.dt;
            sound && f.value.is_finite() && f.std.is_finite() && is_known && is_seen
        });
        let delay = found.iter().find(|f| f.name == "delay_s");
        let is_lag = p == 2 || delay.is_none_or(|delay| delay.value >= LEAST_DELAY);
        let is_forward = values.first().is_some_and(|gain| *gain > 0.0);
        if !(sound && is_lag && is_forward) {
            return None;
        }
        let pairs = self.lines.measured.iter().zip(self.deviations);
        let power: f64 = pairs.map(|(y, d)| y.norm_sqr() / (d * d)).sum();
        let plain = self.residuals(model, inner);
        let plain: f64 = plain
            .iter()
            .zip(self.deviations)
            .map(|(r, d)| r.norm_sqr() * d * d)
            .sum();
        let measured: f64 = self.lines.measured.iter().map(C64::norm_sqr).sum();
        let count = 2.0 * self.lines.omega.len() as f64;
        let unexplained = (cost / power).max(EXACT);
        Some(Fit {
            model,
            slow_delay_s: model.slow_delay(&values),
            parameters: found,
            residual: (plain / measured).sqrt(),
            criterion: count * libm::log(unexplained) + p as f64 * libm::log(count),
        })
    }
}

fn sum(residuals: &[C64]) -> f64 {
    residuals.iter().map(C64::norm_sqr).sum()
}

/// JᵀJ and Jᵀr of complex columns, real and imaginary parts taken for themselves.
fn normal(slopes: &[Vec<C64>], residuals: &[C64]) -> (DMatrix<f64>, DVector<f64>) {
    let product = |a: &[C64], b: &[C64]| -> f64 {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| a.re * b.re + a.im * b.im).sum()
    };
    let p = slopes.len();
    let curvature = DMatrix::from_fn(p, p, |i, j| product(&slopes[i], &slopes[j]));
    let slope = DVector::from_fn(p, |i, _| product(&slopes[i], residuals));
    (curvature, slope)
}
