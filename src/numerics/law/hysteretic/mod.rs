//! Hysteresis of straight lines with pinching and damage: the material `Hysteretic` of OpenSees, of Filippou.
//!
//! Sources: OpenSees command manual, `Hysteretic`; Takeda, Sozen & Nielsen 1970, J. Struct. Div. 96(12) (reloading towards earlier
//! peaks, unloading stiffness that decreases with the ductility). Details follow the behaviour of OpenSees 3.7.1.
//!
//! The force follows straight lines between events, and each event is solved where it lies on the path ([`path`]).
//! So one step equals any number of partial steps.
//!
//! The law differs from OpenSees where a line of reloading would be steeper than the unloading stiffness: it then rises with that
//! stiffness up to the envelope. With a large β an unloading line may end beyond the target of the other direction. The force then
//! jumps to the envelope there, as in OpenSees, so the tangent has no bound.

mod path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{fraction, inside, not_negative};
use super::envelope::{self, Envelope, EnvelopePointSpec, Point};
use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;
use path::State;

/// Hysteresis of straight lines with pinching and damage, as the material `Hysteretic` of OpenSees. As a rotational hinge it takes
/// moments in N m and rotations in rad in place of N and m.
///
/// Reloading aims at the largest displacement of earlier cycles. Damage moves this target outwards when the motion returns from
/// the other direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct HystereticSpec {
    /// Two or three corners of the envelope. Beyond the last one the force stays constant, or rises with the last line where that
    /// rises.
    #[schemars(example = [EnvelopePointSpec { disp_m: 0.005, force_n: 1e5 }, EnvelopePointSpec { disp_m: 0.02, force_n: 1.2e5 }])]
    pub positive: Vec<EnvelopePointSpec>,
    /// Corners of the negative direction, as many and as positive numbers. Default: those of the positive direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [EnvelopePointSpec { disp_m: 0.005, force_n: 1e5 }, EnvelopePointSpec { disp_m: 0.02, force_n: 1.2e5 }])]
    pub negative: Option<Vec<EnvelopePointSpec>>,
    /// Pinching of the displacement (`pinchX`), from 0 to 1. With 1 nothing is pinched.
    #[serde(default = "one")]
    #[schemars(example = 0.8)]
    pub pinch_x: f64,
    /// Pinching of the force (`pinchY`), from 0 to 1. With 1 nothing is pinched.
    #[serde(default = "one")]
    #[schemars(example = 0.2)]
    pub pinch_y: f64,
    /// Damage by ductility (`damage1`): share by which the target moves for each unit of μ − 1. It must not be negative.
    #[serde(default)]
    #[schemars(example = 0.01)]
    pub damage_1: f64,
    /// Damage by energy (`damage2`): share by which the target moves, for the energy below both envelopes. It must not be negative.
    #[serde(default)]
    #[schemars(example = 0.02)]
    pub damage_2: f64,
    /// Exponent β of the unloading stiffness, from 0 to 10. The stiffness is divided by μ^β, with the ductility μ.
    #[serde(default)]
    #[schemars(example = 0.3)]
    pub beta: f64,
}

fn one() -> f64 {
    1.0
}

impl HystereticSpec {
    /// # Errors
    /// A parameter outside its domain, or a list of another length than 2 or 3.
    pub(crate) fn build(&self) -> Result<Hysteretic, LawError> {
        let positive = direction("positive", &self.positive)?;
        let negative = match &self.negative {
            Some(given) => direction("negative", given)?,
            None => positive,
        };
        let allowed = (0.0..=10.0).contains(&self.beta);
        let constants = Constants {
            capacity: positive.work() + negative.work(),
            positive,
            negative,
            pinch_x: fraction("pinch_x", self.pinch_x)?,
            pinch_y: fraction("pinch_y", self.pinch_y)?,
            by_ductility: not_negative("damage_1", self.damage_1)?,
            by_energy: not_negative("damage_2", self.damage_2)?,
            beta: inside("beta", self.beta, allowed, "from 0 to 10")?,
        };
        Ok(Hysteretic {
            constants,
            committed: State::VIRGIN,
            trial: State::VIRGIN,
        })
    }

    /// The smaller force of both first corners.
    pub(super) fn yield_force(&self) -> Option<f64> {
        envelope::yield_force(&self.positive, self.negative.as_deref())
    }
}

/// The envelope of one direction. Of two corners the middle between them becomes a third one, as in OpenSees.
fn direction(list: &'static str, given: &[EnvelopePointSpec]) -> Result<Envelope<3>, LawError> {
    let corners = if given.len() == 2 {
        let [first, last] = envelope::corners(list, given)?;
        let middle = Point {
            disp: 0.5 * (first.disp + last.disp),
            force: 0.5 * (first.force + last.force),
        };
        [first, middle, last]
    } else {
        envelope::corners(list, given)?
    };
    let beyond = corners[1].slope_to(corners[2]).max(0.0);
    Ok(Envelope { corners, beyond })
}

/// What does not change in a test.
#[derive(Debug, Clone)]
struct Constants {
    positive: Envelope<3>,
    negative: Envelope<3>,
    /// Work below both envelopes.
    capacity: f64,
    pinch_x: f64,
    pinch_y: f64,
    by_ductility: f64,
    by_energy: f64,
    beta: f64,
}

/// See [`HystereticSpec`].
#[derive(Debug, Clone)]
pub struct Hysteretic {
    constants: Constants,
    committed: State,
    trial: State,
}

state! {
    Hysteretic as "hysteretic" { committed } keeps { constants, trial }
    restored { *trial = *committed; }
}

impl Law for Hysteretic {
    fn steepest_softening(&self) -> f64 {
        let Constants {
            positive, negative, ..
        } = &self.constants;
        positive.steepest_fall().max(negative.steepest_fall())
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
        Tangent::elastic(self.trial.slope(&self.constants))
    }

    /// The stiffer of both first lines.
    fn reference(&self) -> Tangent {
        let Constants {
            positive, negative, ..
        } = &self.constants;
        Tangent::elastic(positive.stiffness().max(negative.stiffness()))
    }

    /// No bound: a path that unloads beyond the other target is steep there.
    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(f64::INFINITY), Some(0.0))
    }
}

#[cfg(test)]
mod tests;
