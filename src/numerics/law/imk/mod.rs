//! Plastic hinge of Ibarra, Medina and Krawinkler, as modified by Lignos and Krawinkler.
//!
//! Sources: Ibarra, Medina & Krawinkler 2005, Earthquake Engng Struct. Dyn. 34, 1489–1511 (backbone, deterioration, peak-oriented
//! response); Lignos & Krawinkler 2011, J. Struct. Eng. 137(11), 1291–1302 (modified backbone, D, Λ).
//! Where they leave a choice, the law follows the materials `IMKBilin` and `IMKPeakOriented` of OpenSees 3.7.1.
//!
//! The force follows straight lines between events: zero force, a peak of an earlier cycle, the backbone, its corners and the
//! ultimate displacement. Each event is solved where it lies on the path ([`path`]). So one step equals any number of partial steps.
//!
//! The law differs from OpenSees in three cases, so that the force jumps only at a failure and the tangent has a bound:
//! * An energy capacity that one excursion uses up fails the hinge, as in Ibarra et al. OpenSees stops the deterioration.
//! * No reloading line is steeper than the elastic stiffness or aims at a passed peak. It keeps the unloading stiffness up to the backbone.
//!   An unloading line that is flatter than the hardening leads back to where it began.
//! * The force on a peak-oriented backbone is never below the residual one.

mod backbone;
mod path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{fraction, inside, not_negative, positive, yield_disp};
use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;
use path::State;

/// Plastic hinge that softens and deteriorates (modified Ibarra–Medina–Krawinkler model). As a rotational hinge it takes
/// moments in N m and rotations in rad in place of N and m. Sources: Ibarra, Medina & Krawinkler 2005; Lignos & Krawinkler 2011.
///
/// The backbone is elastic up to yield, then hardens up to the cap and softens to the residual force. At the ultimate
/// displacement the force drops to zero.
///
/// Each of the four deteriorations has the energy capacity Λ F_y. At an event it takes the share β = (E_i / (Λ F_y − E))^c. E is the
/// energy dissipated until then. E_i is the part of the excursion, which began at zero force. If β reaches 1, the hinge has no
/// force any more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ImkSpec {
    /// Path of reloading after the force was zero.
    #[serde(default)]
    #[schemars(example = &"peak_oriented")]
    pub response: HingeResponse,
    /// Elastic stiffness, greater than 0. It also bounds the tangent.
    #[schemars(example = 5.0e7)]
    pub stiffness_n_per_m: f64,
    /// Effective yield force F_y (moment M_y of a hinge), greater than 0.
    #[schemars(example = 4.0e5)]
    pub yield_force_n: f64,
    /// Force at the cap divided by the yield force (M_c / M_y), from 1 to 100.
    #[schemars(example = 1.1)]
    pub capping_ratio: f64,
    /// Plastic displacement from yield to the cap (θ_p). It must exceed (`capping_ratio` − 1) times the yield displacement.
    #[schemars(example = 0.025)]
    pub plastic_disp_m: f64,
    /// Displacement from the cap to zero force along the softening line (θ_pc), at least 1e-6 times the yield displacement.
    #[schemars(example = 0.2)]
    pub post_capping_disp_m: f64,
    /// Ultimate displacement, measured from zero (θ_u), greater than the yield displacement. There the force drops to zero. With
    /// `bilinear` response the other direction keeps its residual force.
    #[schemars(example = 0.3)]
    pub ultimate_disp_m: f64,
    /// Residual force divided by the yield force (κ), from 0 to less than 1.
    #[serde(default)]
    #[schemars(example = 0.4)]
    pub residual_ratio: f64,
    /// Λ of the strength, in m (rad): energy capacity divided by the yield force, as in OpenSees. It is λ θ_p of Lignos & Krawinkler.
    /// The yield force and the hardening stiffness lose the share β at each excursion. 0 is no deterioration.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub strength_lambda_m: f64,
    /// Λ of the softening line, in m (rad). Its force at zero displacement loses the share β at each excursion. 0 is no deterioration.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub post_capping_lambda_m: f64,
    /// Λ of the unloading stiffness, in m (rad). It loses the share β at each reversal. 0 is no deterioration.
    #[serde(default)]
    #[schemars(example = 2.0)]
    pub unloading_lambda_m: f64,
    /// Λ of the accelerated reloading, in m (rad). The target displacement grows by the share β at each excursion. 0 is no
    /// deterioration. Only with `peak_oriented` response.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub reloading_lambda_m: f64,
    /// Exponent c of the strength, from 1 to 10.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub strength_exponent: f64,
    /// Exponent c of the softening line, from 1 to 10.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub post_capping_exponent: f64,
    /// Exponent c of the unloading stiffness, from 1 to 10.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub unloading_exponent: f64,
    /// Exponent c of the accelerated reloading, from 1 to 10.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub reloading_exponent: f64,
    /// Factor D of the lost shares, from 0 to 1. It does not act on the unloading stiffness. A slab slows the deterioration of a
    /// composite beam in one direction.
    #[serde(default = "one")]
    #[schemars(example = 0.95)]
    pub deterioration_factor: f64,
    /// Values of the negative direction that differ, as positive numbers. Λ stays in units of the positive yield force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub negative: Option<NegativeHingeSpec>,
}

/// Path of reloading of an [`ImkSpec`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HingeResponse {
    /// With the unloading stiffness up to the backbone. For steel members.
    #[default]
    Bilinear,
    /// Toward the largest displacement of an earlier cycle, through the last one where that is stiffer. For reinforced
    /// concrete members.
    PeakOriented,
}

/// Values of the negative direction, as positive numbers. A missing key has the value of the positive direction.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct NegativeHingeSpec {
    /// Effective yield force, greater than 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 3.0e5)]
    pub yield_force_n: Option<f64>,
    /// Force at the cap divided by the yield force, from 1 to 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.05)]
    pub capping_ratio: Option<f64>,
    /// Plastic displacement from yield to the cap.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.02)]
    pub plastic_disp_m: Option<f64>,
    /// Displacement from the cap to zero force along the softening line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.15)]
    pub post_capping_disp_m: Option<f64>,
    /// Ultimate displacement, measured from zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.2)]
    pub ultimate_disp_m: Option<f64>,
    /// Residual force divided by the yield force, from 0 to less than 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.3)]
    pub residual_ratio: Option<f64>,
    /// Factor D of the lost shares, from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.0)]
    pub deterioration_factor: Option<f64>,
}

fn one() -> f64 {
    1.0
}

impl ImkSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub(crate) fn build(&self) -> Result<Imk, LawError> {
        let stiffness = positive("stiffness_n_per_m", self.stiffness_n_per_m)?;
        let positive = self.direction(&NegativeHingeSpec::default())?;
        let capacity = |name, lambda, exponent_name, exponent: f64| {
            let allowed = (1.0..=10.0).contains(&exponent);
            Ok::<_, LawError>(Capacity {
                energy: not_negative(name, lambda)? * positive.yield_force,
                exponent: inside(exponent_name, exponent, allowed, "from 1 to 10")?,
            })
        };
        let peak_oriented = self.response == HingeResponse::PeakOriented;
        let reloading = capacity(
            "reloading_lambda_m",
            self.reloading_lambda_m,
            "reloading_exponent",
            self.reloading_exponent,
        )?;
        inside(
            "reloading_lambda_m",
            self.reloading_lambda_m,
            peak_oriented || reloading.energy == 0.0,
            "0 unless response = \"peak_oriented\"",
        )?;
        let constants = Constants {
            stiffness,
            peak_oriented,
            strength: capacity(
                "strength_lambda_m",
                self.strength_lambda_m,
                "strength_exponent",
                self.strength_exponent,
            )?,
            post_capping: capacity(
                "post_capping_lambda_m",
                self.post_capping_lambda_m,
                "post_capping_exponent",
                self.post_capping_exponent,
            )?,
            unloading: capacity(
                "unloading_lambda_m",
                self.unloading_lambda_m,
                "unloading_exponent",
                self.unloading_exponent,
            )?,
            reloading,
            negative: match &self.negative {
                Some(given) => self.direction(given)?,
                None => positive,
            },
            positive,
        };
        let committed = State::virgin(&constants);
        Ok(Imk {
            constants,
            committed,
            trial: committed,
        })
    }

    /// The backbone of one direction: what `given` lacks is that of the positive one.
    fn direction(&self, given: &NegativeHingeSpec) -> Result<Direction, LawError> {
        let yield_force = positive(
            "yield_force_n",
            given.yield_force_n.unwrap_or(self.yield_force_n),
        )?;
        let yield_disp = yield_disp("yield_force_n", yield_force, self.stiffness_n_per_m)?;
        let ratio = given.capping_ratio.unwrap_or(self.capping_ratio);
        let allowed = (1.0..=100.0).contains(&ratio);
        let ratio = inside("capping_ratio", ratio, allowed, "from 1 to 100")?;
        let plastic = given.plastic_disp_m.unwrap_or(self.plastic_disp_m);
        let plastic = inside(
            "plastic_disp_m",
            plastic,
            plastic > 0.0 && plastic > (ratio - 1.0) * yield_disp,
            "greater than 0 and than (capping_ratio - 1) times the yield displacement",
        )?;
        let softened = given
            .post_capping_disp_m
            .unwrap_or(self.post_capping_disp_m);
        let softened = inside(
            "post_capping_disp_m",
            softened,
            softened >= 1e-6 * yield_disp,
            "at least 1e-6 times the yield displacement",
        )?;
        let ultimate = given.ultimate_disp_m.unwrap_or(self.ultimate_disp_m);
        let ultimate = inside(
            "ultimate_disp_m",
            ultimate,
            ultimate > yield_disp,
            "greater than the yield displacement",
        )?;
        let residual = given.residual_ratio.unwrap_or(self.residual_ratio);
        let allowed = (0.0..1.0).contains(&residual);
        let residual = inside("residual_ratio", residual, allowed, "from 0 to less than 1")?;
        let factor = given
            .deterioration_factor
            .unwrap_or(self.deterioration_factor);
        Ok(Direction {
            yield_force,
            yield_disp,
            cap_disp: yield_disp + plastic,
            hardening: (ratio - 1.0) * yield_force / plastic,
            softening: -ratio * yield_force / softened,
            residual: residual * yield_force,
            ultimate,
            factor: fraction("deterioration_factor", factor)?,
        })
    }

    /// The smaller yield force of both directions.
    pub(super) const fn yield_force(&self) -> f64 {
        match &self.negative {
            Some(NegativeHingeSpec {
                yield_force_n: Some(other),
                ..
            }) => self.yield_force_n.min(*other),
            _ => self.yield_force_n,
        }
    }
}

/// Initial backbone of one direction, in positive numbers.
#[derive(Debug, Clone, Copy)]
struct Direction {
    yield_force: f64,
    yield_disp: f64,
    cap_disp: f64,
    /// Slope between yield and cap, at least 0.
    hardening: f64,
    /// Slope beyond the cap, less than 0.
    softening: f64,
    /// Force that remains beyond the softening line.
    residual: f64,
    /// Displacement at which the force is lost.
    ultimate: f64,
    /// D.
    factor: f64,
}

/// What does not change in a test.
#[derive(Debug, Clone)]
struct Constants {
    stiffness: f64,
    peak_oriented: bool,
    positive: Direction,
    negative: Direction,
    strength: Capacity,
    post_capping: Capacity,
    unloading: Capacity,
    reloading: Capacity,
}

/// Energy that a mode of deterioration can take.
#[derive(Debug, Clone, Copy)]
struct Capacity {
    /// E_t = Λ F_y in J; 0 without deterioration.
    energy: f64,
    /// c.
    exponent: f64,
}

impl Capacity {
    /// β after an excursion that dissipated `spent` of all the `dissipated` energy; none if the capacity is used up. Real-time: yes.
    fn lost_share(&self, spent: f64, dissipated: f64) -> Option<f64> {
        if self.energy == 0.0 {
            return Some(0.0);
        }
        let left = self.energy - dissipated;
        let share = libm::pow(spent.max(0.0) / left, self.exponent);
        (left > 0.0 && share < 1.0).then_some(share)
    }
}

/// See [`ImkSpec`].
#[derive(Debug, Clone)]
pub struct Imk {
    constants: Constants,
    committed: State,
    trial: State,
}

state! {
    Imk as "imk" { committed } keeps { constants, trial }
    restored { *trial = *committed; }
}

impl Law for Imk {
    fn steepest_softening(&self) -> f64 {
        let directions = [&self.constants.positive, &self.constants.negative];
        directions
            .into_iter()
            .fold(0.0, |most, direction| f64::max(most, -direction.softening))
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

    fn reference(&self) -> Tangent {
        Tangent::elastic(self.constants.stiffness)
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(self.constants.stiffness), Some(0.0))
    }
}

#[cfg(test)]
mod tests;
