//! Smooth hysteresis after Bouc (1967) and Wen (1976), with the degradation and pinching of Baber and Noori (1985).
//!
//! Normalised form: with the yield displacement u_y = F_y/k, the path length τ = |Δx|/u_y, the direction
//! s = sgn(Δx) and the hysteretic variable ζ (a pure number),
//!
//! ```text
//! F     = α k x + (1 − α) F_y ζ
//! dζ/dx = (h/η) (A − ν |ζ|ⁿ (β sgn(s ζ) + γ)) / u_y
//! ```
//!
//! Plain (h = η = ν = 1), each stretch of a straight path on which s ζ keeps its sign is solved in closed form or by
//! a convergent series ([`branch`]); otherwise by extrapolation to roundoff ([`wear`]). Either way one step equals
//! any number of partial steps: the result does not depend on an inner step. The law knows no rate effect.

mod branch;
mod wear;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{fraction, inside, positive, yield_disp};
use super::{Law, LawError, Reach, Tangent};
use branch::Branch;
use gusset_quantity::state;
pub use wear::{DegradationSpec, PinchingSpec};
use wear::{Point, Wear};

/// Bouc–Wen hysteresis, F = α k x + (1 − α) F_y ζ.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct BoucWenSpec {
    /// Stiffness k, greater than 0. With `a = 1` it is the initial tangent stiffness.
    pub stiffness_n_per_m: f64,
    /// Force scale F_y of the hysteretic part, greater than 0. It is the yield force if `a = 1` and
    /// `beta` + `gamma` = 1.
    pub yield_force_n: f64,
    /// Ratio α of the stiffness after yield to k, from 0 to 1.
    pub post_yield_ratio: f64,
    /// Parameter A, greater than 0. Other values than 1 are rarely needed, because the other
    /// parameters can be scaled instead.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub a: f64,
    /// Parameter β, greater than 0. It determines the width of the hysteresis loop.
    pub beta: f64,
    /// Parameter γ, greater than −β. Unloading is stiffer than loading if γ < β, and softer if γ >
    /// β.
    pub gamma: f64,
    /// Exponent n, from 1 to 100. A larger value makes the transition to yielding sharper.
    pub exponent: f64,
    /// Upper bound of the tangent stiffness divided by the initial tangent, at least 1. Required
    /// with degradation or pinching. Default: the bound of the formula, α + (1 − α) max(1, 2β/(β +
    /// γ)) for `a = 1`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.5)]
    pub hardening_ratio: Option<f64>,
    /// Loss of strength and stiffness with dissipated energy. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degradation: Option<DegradationSpec>,
    /// Pinching of the loop with dissipated energy. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pinching: Option<PinchingSpec>,
}

fn one() -> f64 {
    1.0
}

/// Smallest relative distance of β from γ and −γ. If they are closer, the rounding of ζ decides.
const SEPARATION: f64 = 1e-6;

impl BoucWenSpec {
    /// # Errors
    /// A parameter outside its domain, or no `hardening_ratio` where it is needed.
    pub fn build(&self) -> Result<BoucWen, LawError> {
        let stiffness = positive("stiffness_n_per_m", self.stiffness_n_per_m)?;
        let yield_force = positive("yield_force_n", self.yield_force_n)?;
        let ratio = fraction("post_yield_ratio", self.post_yield_ratio)?;
        let exponent = inside(
            "exponent",
            self.exponent,
            (1.0..=100.0).contains(&self.exponent),
            "from 1 to 100",
        )?;
        let (a, beta, gamma) = self.shape()?;
        let virgin = ratio + (1.0 - ratio) * a;
        let stiffest = ratio + (1.0 - ratio) * a * f64::max(1.0, 2.0 * beta / (beta + gamma));
        let worn = self.degradation.is_some() || self.pinching.is_some();
        let hardening = match self.hardening_ratio {
            Some(given) => inside(
                "hardening_ratio",
                given,
                given >= 1.0 && given.is_finite(),
                "finite and at least 1",
            )?
            .max(if worn { 1.0 } else { stiffest / virgin }),
            None if worn => {
                return Err(LawError::BoundNeeded {
                    law: "bouc_wen",
                    name: "hardening_ratio",
                });
            }
            None => stiffest / virgin,
        };
        let constants = Constants {
            stiffness,
            yield_force,
            yield_disp: yield_disp("yield_force_n", yield_force, stiffness)?,
            ratio,
            reference: virgin * stiffness,
            bound: hardening * virgin * stiffness,
            loading: Branch::new(a, beta + gamma, exponent),
            unloading: Branch::new(a, gamma - beta, exponent),
            wear: if worn {
                Some(Wear::new(
                    self.degradation.as_ref(),
                    self.pinching.as_ref(),
                )?)
            } else {
                None
            },
            parameters: Parameters {
                a,
                beta,
                gamma,
                exponent,
            },
        };
        Ok(BoucWen {
            constants: Arc::new(constants),
            committed: State::VIRGIN,
            trial: State::VIRGIN,
        })
    }

    fn shape(&self) -> Result<(f64, f64, f64), LawError> {
        let sane = |value: f64| (1e-100..=1e100).contains(&value);
        let a = inside(
            "a",
            self.a,
            sane(self.a),
            "greater than 0 (1e-100 to 1e100)",
        )?;
        let beta = inside(
            "beta",
            self.beta,
            sane(self.beta),
            "greater than 0 (1e-100 to 1e100)",
        )?;
        let gamma = inside(
            "gamma",
            self.gamma,
            self.gamma + beta >= SEPARATION * beta && self.gamma * SEPARATION <= beta,
            "greater than -beta (by 1e-6 of it) and at most 1e6 beta",
        )?;
        Ok((a, beta, gamma))
    }
}

/// A, β, γ, n.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Parameters {
    a: f64,
    beta: f64,
    gamma: f64,
    exponent: f64,
}

impl Parameters {
    /// |ζ|ⁿ (β sgn y + γ) for y = s ζ. Continuous at 0, where it vanishes. Real-time: yes.
    fn resistance(&self, y: f64) -> f64 {
        let sum = if y < 0.0 {
            self.gamma - self.beta
        } else {
            self.gamma + self.beta
        };
        sum * power(y.abs(), self.exponent)
    }
}

/// xⁿ for x ≥ 0. Real-time: yes.
fn power(x: f64, exponent: f64) -> f64 {
    if exponent == 1.0 {
        x
    } else if exponent == 2.0 {
        x * x
    } else {
        libm::pow(x, exponent)
    }
}

#[derive(Debug, Clone, Copy)]
struct State {
    disp: f64,
    /// ζ.
    zeta: f64,
    /// ∫ ζ dx/u_y, a pure number; stays 0 without degradation and pinching, which alone ask for it.
    energy: f64,
    /// s of the last motion, +1 or −1.
    direction: f64,
}

state! { State { disp, zeta, energy, direction } }

impl State {
    const VIRGIN: State = State {
        disp: 0.0,
        zeta: 0.0,
        energy: 0.0,
        direction: 1.0,
    };
}

/// See [`BoucWenSpec`]. A step of some thousand yield displacements is too long for a degraded law: it gives NaN.
#[derive(Debug, Clone)]
pub struct BoucWen {
    constants: Arc<Constants>,
    committed: State,
    trial: State,
}

state! {
    BoucWen as "bouc_wen" { committed } keeps { constants, trial }
    restored { *trial = *committed; }
}

/// What does not change in a test.
#[derive(Debug, PartialEq)]
pub(crate) struct Constants {
    stiffness: f64,
    yield_force: f64,
    yield_disp: f64,
    ratio: f64,
    reference: f64,
    bound: f64,
    parameters: Parameters,
    /// |ζ| while it grows: A − (β + γ) |ζ|ⁿ.
    loading: Branch,
    /// |ζ| while it shrinks: A − (γ − β) |ζ|ⁿ, backwards.
    unloading: Branch,
    wear: Option<Wear>,
}

/// Different constants that are kept for sharing. More are compared with none.
const MOST_SHARED: usize = 32;

impl BoucWen {
    /// Replaces its constants by equal ones of `known`; others join `known`. A long chain of equal elements then
    /// reads them from the nearest cache.
    pub(crate) fn share(&mut self, known: &mut Vec<Arc<Constants>>) {
        match known.iter().find(|other| ***other == *self.constants) {
            Some(equal) => self.constants = Arc::clone(equal),
            None if known.len() < MOST_SHARED => known.push(Arc::clone(&self.constants)),
            None => {}
        }
    }
}

impl Constants {
    /// y = s ζ and the energy after the path length τ.
    #[inline]
    fn along(&self, start: Point, tau: f64) -> Point {
        if let Some(wear) = &self.wear {
            return wear.along(&self.parameters, start, tau).unwrap_or(Point {
                y: f64::NAN,
                energy: f64::NAN,
            });
        }
        let (grown_from, tau) = if start.y < 0.0 {
            let (left, rest) = self.unloading.shrink(-start.y, tau);
            if rest <= 0.0 {
                return Point { y: -left, ..start };
            }
            (0.0, rest)
        } else {
            (start.y, tau)
        };
        Point {
            y: self.loading.grow(grown_from, tau),
            ..start
        }
    }
}

impl BoucWen {
    /// The state at `disp`, on a straight path from the committed one.
    #[inline]
    fn at(&self, disp: f64) -> State {
        let from = self.committed;
        let travel = disp - from.disp;
        if travel == 0.0 {
            return from;
        }
        let direction = f64::copysign(1.0, travel);
        let start = Point {
            y: direction * from.zeta,
            energy: from.energy,
        };
        let constants = &*self.constants;
        let end = constants.along(start, travel.abs() / constants.yield_disp);
        State {
            disp,
            zeta: direction * end.y,
            energy: end.energy,
            direction,
        }
    }

    #[inline]
    fn force(&self, disp: f64, zeta: f64) -> f64 {
        let Constants {
            stiffness,
            yield_force,
            ratio,
            ..
        } = *self.constants;
        ratio * stiffness * disp + (1.0 - ratio) * yield_force * zeta
    }
}

impl Law for BoucWen {
    fn trial(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        self.trial = self.at(disp);
        self.force(disp, self.trial.zeta)
    }

    fn step(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        let state = self.at(disp);
        (self.trial, self.committed) = (state, state);
        self.force(disp, state.zeta)
    }

    fn commit(&mut self) {
        self.committed = self.trial;
    }

    fn revert(&mut self) {
        self.trial = self.committed;
    }

    fn tangent(&self) -> Tangent {
        let point = Point {
            y: self.trial.direction * self.trial.zeta,
            energy: self.trial.energy,
        };
        let Constants {
            stiffness,
            ratio,
            parameters,
            wear,
            ..
        } = &*self.constants;
        let slope = match wear {
            Some(wear) => wear.slope(parameters, point),
            None => parameters.a - parameters.resistance(point.y),
        };
        Tangent::elastic(stiffness * (ratio + (1.0 - ratio) * slope))
    }

    fn reference(&self) -> Tangent {
        Tangent::elastic(self.constants.reference)
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(self.constants.bound), Some(0.0))
    }

    fn bouc_wen(&mut self) -> Option<&mut BoucWen> {
        Some(self)
    }
}

#[cfg(test)]
mod tests;
