//! Materials of fibres as a test file describes them. Plain data; [`super::material`] computes with them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Uniaxial material of fibres: stress over strain, tension positive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum MaterialSpec {
    /// Linear elastic material.
    Elastic(YoungSpec),
    /// Material that is elastic in compression and has no stress in tension.
    ElasticNoTension(YoungSpec),
    /// Steel with a curved transition to hardening and Bauschinger effect.
    MenegottoPinto(MenegottoPintoSpec),
    /// Concrete without tensile strength.
    #[serde(rename = "concrete_01")]
    Concrete01(Concrete01Spec),
    /// Concrete with tensile strength.
    #[serde(rename = "concrete_02")]
    Concrete02(Concrete02Spec),
}

/// Elastic modulus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct YoungSpec {
    /// Young's modulus.
    #[schemars(example = 2.1e11)]
    pub young_pa: f64,
}

/// Steel of Menegotto and Pinto (1973) with the isotropic hardening of Filippou, Popov and Bertero
/// (1983): OpenSees' Steel02. Each branch between two reversals bends from the elastic line to the
/// hardening line. Its exponent R decreases with the plastic strain ξ, in yield strains:
/// R = r0 (1 − cr1 ξ/(cr2 + ξ)).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MenegottoPintoSpec {
    /// Young's modulus.
    #[schemars(example = 2.0e11)]
    pub young_pa: f64,
    /// Yield stress.
    #[schemars(example = 4.2e8)]
    pub yield_pa: f64,
    /// Stiffness after yield divided by Young's modulus, from 0 to less than 1.
    #[schemars(example = 0.01)]
    pub hardening_ratio: f64,
    /// Exponent R of the first branch. A larger value makes the transition to yielding sharper.
    /// Default: 20.
    #[serde(default = "first_exponent")]
    #[schemars(example = 18.0)]
    pub r0: f64,
    /// Largest loss of the exponent, as a share of `r0`. Default: 0.925.
    #[serde(default = "exponent_loss")]
    #[schemars(example = 0.925)]
    pub cr1: f64,
    /// Plastic strain, in yield strains, at which half of this loss has occurred. Default: 0.15.
    #[serde(default = "half_loss")]
    #[schemars(example = 0.15)]
    pub cr2: f64,
    /// Isotropic hardening in compression: the hardening line moves outwards by
    /// `a1` (range/(2 a2))^0.8 yield stresses. The range is that of the reversal strains, in yield
    /// strains, at least 2. Default: 0.
    #[serde(default)]
    #[schemars(example = 0.02)]
    pub a1: f64,
    /// Half range, in yield strains, at which the line in compression has moved by `a1`. Default: 1.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub a2: f64,
    /// Isotropic hardening in tension, as `a1` in compression. Default: 0.
    #[serde(default)]
    #[schemars(example = 0.02)]
    pub a3: f64,
    /// Half range, in yield strains, at which the line in tension has moved by `a3`. Default: 1.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub a4: f64,
}

impl MenegottoPintoSpec {
    /// With the usual exponents and without isotropic hardening.
    #[must_use]
    pub fn new(young_pa: f64, yield_pa: f64, hardening_ratio: f64) -> Self {
        Self {
            young_pa,
            yield_pa,
            hardening_ratio,
            r0: first_exponent(),
            cr1: exponent_loss(),
            cr2: half_loss(),
            a1: 0.0,
            a2: one(),
            a3: 0.0,
            a4: one(),
        }
    }
}

fn first_exponent() -> f64 {
    20.0
}

fn exponent_loss() -> f64 {
    0.925
}

fn half_loss() -> f64 {
    0.15
}

fn one() -> f64 {
    1.0
}

/// Concrete of Kent and Park (1971) and Scott, Park and Priestley (1982) with the straight unloading of
/// Karsan and Jirsa (1969): OpenSees' Concrete01. Young's modulus is 2 `strength_pa`/`strain_at_strength`.
/// Strengths and strains of compression are positive numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Concrete01Spec {
    /// Compressive strength.
    #[schemars(example = 3.0e7)]
    pub strength_pa: f64,
    /// Strain at this strength.
    #[schemars(example = 0.002)]
    pub strain_at_strength: f64,
    /// Stress that remains after crushing, less than `strength_pa`.
    #[schemars(example = 6.0e6)]
    pub crushing_strength_pa: f64,
    /// Strain at which this stress is reached, greater than `strain_at_strength`.
    #[schemars(example = 0.01)]
    pub crushing_strain: f64,
}

/// Concrete of Mohd Yassin (1994): OpenSees' Concrete02. In compression it is as `concrete_01`, but
/// unloads along two lines. In tension it softens linearly after cracking.
/// Strengths and strains of compression are positive numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Concrete02Spec {
    /// Compressive strength.
    #[schemars(example = 3.0e7)]
    pub strength_pa: f64,
    /// Strain at this strength.
    #[schemars(example = 0.002)]
    pub strain_at_strength: f64,
    /// Stress that remains after crushing, less than `strength_pa`.
    #[schemars(example = 6.0e6)]
    pub crushing_strength_pa: f64,
    /// Strain at which this stress is reached, greater than `strain_at_strength`.
    #[schemars(example = 0.01)]
    pub crushing_strain: f64,
    /// Slope λ of reloading after crushing divided by Young's modulus, less than 1. It is at least the
    /// secant slope `crushing_strength_pa`/`crushing_strain` divided by Young's modulus, so that
    /// crushed concrete has no stress before it is in tension.
    #[schemars(example = 0.1)]
    pub unloading_ratio: f64,
    /// Tensile strength.
    #[schemars(example = 2.0e6)]
    pub tensile_strength_pa: f64,
    /// Loss of tensile stress per strain after cracking.
    #[schemars(example = 1.5e9)]
    pub tension_softening_pa: f64,
}
