//! Pinched hysteresis of four corners with three kinds of damage: the material `Pinching4` of OpenSees.
//!
//! Source: Lowes, Mitra & Altoontash 2003, A Beam-Column Joint Model for Simulating the Earthquake Response of Reinforced Concrete
//! Frames, PEER 2003/10. Where it leaves a choice, the law follows the behaviour of OpenSees 3.7.1.
//!
//! From a reversal the force follows three straight lines to a target on the envelope of the other direction ([`path`]).
//! Damage is taken from the energy or from the cycles when the motion reverses. Each event is solved where it lies on the path,
//! so one step equals any number of partial steps.
//!
//! As in OpenSees, a small cycle on one side of zero can give back more energy than it takes, where both directions have different
//! parameters. In the tests that was up to 1 % of the elastic energy at yield in each cycle.

mod damage;
mod path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{self, inside, not_negative};
use super::envelope::{self, Envelope, EnvelopePointSpec, Point};
use super::{Law, LawError, Reach, Tangent};
use damage::{Damage, Mode};
use gusset_quantity::state;
use path::State;

/// Pinched hysteresis of four corners with damage, as the material `Pinching4` of OpenSees. As a rotational hinge it takes moments
/// in N m and rotations in rad in place of N and m. Source: Lowes, Mitra & Altoontash 2003.
///
/// A damage is g1 (d/d_u)^g3 + g2 s^g4, at most its limit. d is the largest displacement and d_u that of the last corner. s is the
/// dissipated energy over g_e times the work along the envelope, or the number of cycles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Pinching4Spec {
    /// Four corners of the envelope. Beyond the last one the force stays constant, or rises with the last line where that rises.
    #[schemars(example = four())]
    pub positive: Vec<EnvelopePointSpec>,
    /// Four corners of the negative direction, as positive numbers. Default: those of the positive direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = four())]
    pub negative: Option<Vec<EnvelopePointSpec>>,
    /// Pinching on the way to positive displacement.
    pub pinching: PinchSpec,
    /// Pinching on the way to negative displacement. Default: that of the other way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub negative_pinching: Option<PinchSpec>,
    /// Damage of the unloading stiffness: gK1, gK2, gK3, gK4 and its limit. Default: none.
    #[serde(default)]
    #[schemars(example = [1.0, 0.2, 0.3, 0.2, 0.9])]
    pub g_k: [f64; 5],
    /// Damage of the reloading: gD1, gD2, gD3, gD4 and its limit. The target of reloading moves outwards. Default: none.
    #[serde(default)]
    #[schemars(example = [0.5, 0.5, 2.0, 2.0, 0.5])]
    pub g_d: [f64; 5],
    /// Damage of the strength: gF1, gF2, gF3, gF4 and its limit, at most 1. Default: none.
    #[serde(default)]
    #[schemars(example = [1.0, 0.0, 1.0, 1.0, 0.9])]
    pub g_f: [f64; 5],
    /// Energy capacity gE, as a multiple of the work along the envelope up to its last corner. It is greater than 0.
    #[serde(default = "ten")]
    #[schemars(example = 10.0)]
    pub g_e: f64,
    /// What counts in the second part of a damage.
    #[serde(default)]
    #[schemars(example = &"energy")]
    pub damage: DamageType,
}

/// Points of reloading and unloading of a [`Pinching4Spec`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PinchSpec {
    /// Displacement at which reloading begins, divided by that of the target (`rDisp`), from −1 to 1.
    #[schemars(example = 0.5)]
    pub r_disp: f64,
    /// Force at which reloading begins, divided by that of the target (`rForce`), from 0 to 1.
    #[schemars(example = 0.25)]
    pub r_force: f64,
    /// Force at the end of unloading, divided by the strength of the envelope ahead (`uForce`), from −1 to 1 and less than
    /// `r_force`.
    #[schemars(example = 0.05)]
    pub u_force: f64,
}

impl PinchSpec {
    fn checked(self) -> Result<Self, LawError> {
        let either = |value: f64| (-1.0..=1.0).contains(&value);
        inside("r_disp", self.r_disp, either(self.r_disp), "from -1 to 1")?;
        domain::fraction("r_force", self.r_force)?;
        let fits = either(self.u_force) && self.u_force < self.r_force;
        inside(
            "u_force",
            self.u_force,
            fits,
            "from -1 to 1 and less than r_force",
        )?;
        Ok(self)
    }
}

/// What counts in a damage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DamageType {
    /// Dissipated energy.
    #[default]
    Energy,
    /// Cycles: the path over four times the largest displacement.
    Cycle,
}

fn ten() -> f64 {
    10.0
}

/// Four corners as an example.
fn four() -> [EnvelopePointSpec; 4] {
    let points = [(0.001, 5e4), (0.005, 1e5), (0.02, 1.1e5), (0.05, 3e4)];
    points.map(|(disp_m, force_n)| EnvelopePointSpec { disp_m, force_n })
}

impl Pinching4Spec {
    /// # Errors
    /// A parameter outside its domain, or a list of another length than 4.
    pub(crate) fn build(&self) -> Result<Pinching4, LawError> {
        let positive: [Point; 4] = envelope::corners("positive", &self.positive)?;
        let negative = match &self.negative {
            Some(given) => envelope::corners("negative", given)?,
            None => positive,
        };
        let stiffest = |corners: &[Point; 4]| corners[0].force / corners[0].disp;
        let stiffness = stiffest(&positive).max(stiffest(&negative));
        let elastic = 1e-4 * positive[0].disp.max(negative[0].disp);
        inside(
            "disp_m",
            elastic,
            elastic < positive[0].disp.min(negative[0].disp),
            "of one size in both first corners",
        )?;
        let first = Point {
            disp: elastic,
            force: stiffness * elastic,
        };
        let [positive, negative] = [positive, negative].map(|[a, b, c, d]| Envelope {
            corners: [first, a, b, c, d],
            beyond: c.slope_to(d).max(0.0),
        });
        let work = positive.work().max(negative.work());
        let damage = Damage {
            modes: [
                mode("g_k", &self.g_k)?,
                mode("g_d", &self.g_d)?,
                mode("g_f", &self.g_f)?,
            ],
            capacity: domain::positive("g_e", self.g_e)? * work,
            by_cycles: self.damage == DamageType::Cycle,
            ultimate: positive.corners[4].disp.max(negative.corners[4].disp),
        };
        let constants = Constants {
            stiffness,
            positive: Direction {
                envelope: positive,
                pinch: self.pinching.checked()?,
            },
            negative: Direction {
                envelope: negative,
                pinch: self.negative_pinching.unwrap_or(self.pinching).checked()?,
            },
            damage,
        };
        let committed = State::virgin(&constants);
        Ok(Pinching4 {
            constants,
            committed,
            trial: committed,
        })
    }

    /// The smaller force of both first corners.
    pub(super) fn yield_force(&self) -> Option<f64> {
        envelope::yield_force(&self.positive, self.negative.as_deref())
    }
}

fn mode(name: &'static str, given: &[f64; 5]) -> Result<Mode, LawError> {
    for value in given {
        not_negative(name, *value)?;
    }
    let [g1, g2, g3, g4, limit] = *given;
    inside(name, limit, limit <= 1.0, "at most 1 in the limit")?;
    Ok(Mode {
        factors: [g1, g2],
        exponents: [g3, g4],
        limit,
    })
}

/// One direction, in positive numbers.
#[derive(Debug, Clone, Copy)]
struct Direction {
    /// Its first corner ends the elastic range, in which nothing is pinched.
    envelope: Envelope<5>,
    pinch: PinchSpec,
}

impl Direction {
    /// Stiffness up to the first corner that the user gave.
    fn stiffness(&self) -> f64 {
        Point::default().slope_to(self.envelope.corners[1])
    }

    /// Strength that counts for unloading, once `disp` was reached.
    fn strength(&self, disp: f64) -> f64 {
        let [.., third, fourth] = self.envelope.corners;
        if disp > third.disp {
            fourth.force
        } else {
            third.force
        }
    }
}

/// What does not change in a test.
#[derive(Debug, Clone)]
struct Constants {
    /// The steeper of both first lines.
    stiffness: f64,
    positive: Direction,
    negative: Direction,
    damage: Damage,
}

/// See [`Pinching4Spec`].
#[derive(Debug, Clone)]
pub struct Pinching4 {
    constants: Constants,
    committed: State,
    trial: State,
}

state! {
    Pinching4 as "pinching4" { committed } keeps { constants, trial }
    restored { *trial = *committed; }
}

impl Law for Pinching4 {
    fn steepest_softening(&self) -> f64 {
        let falls = [&self.constants.positive, &self.constants.negative];
        let falls = falls.map(|direction| direction.envelope.steepest_fall());
        falls[0].max(falls[1])
    }

    fn trial(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        self.trial = self.committed.moved(&self.constants, disp);
        self.trial.signed_force()
    }

    fn commit(&mut self) {
        self.committed = self.trial;
    }

    fn revert(&mut self) {
        self.trial = self.committed;
    }

    fn tangent(&self) -> Tangent {
        Tangent::elastic(self.trial.slope())
    }

    /// The stiffer of both first lines.
    fn reference(&self) -> Tangent {
        Tangent::elastic(self.constants.stiffness)
    }

    /// No bound: the way between two corners of a pinched path may be steep.
    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(f64::INFINITY), Some(0.0))
    }
}

#[cfg(test)]
mod tests;
