//! The structure as a test file describes it. Plain data; [`super::build`] makes a [`super::Structure`] of it.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::End;
use crate::law::LawSpec;

/// The numerical structure: one of three forms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum StructureSpec {
    /// One mass per floor, one spring and dashpot per storey; storey 1 stands on the ground.
    ShearBuilding(ShearBuildingSpec),
    /// Mass, stiffness and damping as matrices, inline or from files.
    Matrices(MatricesSpec),
    /// Equal masses in a row joined by equal springs and dashpots: mass 1 is tied to the base, mass n is free.
    Chain(ChainSpec),
}

/// One mass per floor, one spring and dashpot per storey.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ShearBuildingSpec {
    /// Mass of each floor in kg, from the bottom; 0 makes a massless degree of freedom.
    pub mass_kg: Vec<f64>,
    /// Stiffness of each storey in N/m, from the bottom; 0 leaves the storey to elements or a specimen.
    pub stiffness_n_per_m: Vec<f64>,
    /// Dashpot of each storey in N s/m, from the bottom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping_n_s_per_m: Option<Vec<f64>>,
}

/// Symmetric matrices in SI units, each given inline by rows or as the name of a .csv, .npy or .mtx file.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct MatricesSpec {
    /// Mass matrix by rows; a row of zeros is a massless degree of freedom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<Vec<Vec<f64>>>,
    /// File with the mass matrix.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_file: Option<String>,
    /// Stiffness matrix by rows; may be singular.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<Vec<Vec<f64>>>,
    /// File with the stiffness matrix.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness_file: Option<String>,
    /// Damping matrix by rows; need not be diagonal in the modes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<Vec<Vec<f64>>>,
    /// File with the damping matrix.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping_file: Option<String>,
    /// Displacement of each degree of freedom per unit displacement of the base; ones if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub influence: Option<Vec<f64>>,
}

/// Equal masses, springs and dashpots in a row (example 4.3 of Gui et al. 2014).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ChainSpec {
    /// Number of masses.
    #[schemars(range(min = 1))]
    pub dofs: usize,
    /// Each mass in kg.
    pub mass_kg: f64,
    /// Each spring in N/m, the one to the base included.
    pub stiffness_n_per_m: f64,
    /// Each dashpot in N s/m, the one to the base included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping_n_s_per_m: Option<f64>,
    /// A damper between each mass and the inertial frame, acting on absolute velocity; not with a ground acceleration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub absolute_damper: Option<LawSpec>,
}

/// Viscous damping by rule, in place of dashpots or a damping matrix. The stiffness that it refers to is the tangent of
/// the whole structure at rest, elements and specimens included: a specimen with the estimate that is given for it, else
/// with the tangent of its law at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum DampingSpec {
    /// C = a M + b K with both coefficients given.
    Rayleigh(RayleighSpec),
    /// C = a M + b K with a damping ratio at two frequencies or modes.
    RayleighRatio(RayleighRatioSpec),
    /// A damping ratio for each mode.
    Modal(ModalSpec),
}

/// C = a M + b K.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct RayleighSpec {
    /// a in 1/s.
    pub mass_coefficient_per_s: f64,
    /// b in s.
    pub stiffness_coefficient_s: f64,
}

/// C = a M + b K with one ratio at two frequencies: either both frequencies or two modes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct RayleighRatioSpec {
    /// Damping ratio at both, a fraction of critical (0.02 is 2 %).
    pub ratio: f64,
    /// First frequency in Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_hz: Option<f64>,
    /// Second frequency in Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_hz: Option<f64>,
    /// Numbers of two modes, from 1, in place of frequencies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub modes: Option<[usize; 2]>,
}

/// C = M Φ diag(2 ξ ω) Φᵀ M.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ModalSpec {
    /// Damping ratio of each mode from the lowest, fractions of critical; a single number serves all modes.
    pub ratios: Vec<f64>,
}

/// A spring or damper between two degrees of freedom, or one and the ground or the inertial frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ElementSpec {
    /// Name in reports; "element 3" if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Where the deformation is counted from: a degree of freedom from 1, "ground" or "fixed".
    pub from: End,
    /// Where the deformation is counted to: a degree of freedom from 1, "ground" or "fixed".
    pub to: End,
    /// The force.
    pub law: LawSpec,
    /// Largest |deformation| expected in m, for the proof of stability of hardening laws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_disp_m: Option<f64>,
    /// Largest |velocity| expected in m/s, for the proof of stability of dampers with growing tangent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_vel_m_per_s: Option<f64>,
    /// Upper bound of the tangent stiffness over the initial one, at least 1, in place of the law's own bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening_ratio: Option<f64>,
    /// Upper bound of the tangent damping over the initial one, at least 1, in place of the law's own bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping_ratio: Option<f64>,
}

impl Serialize for End {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            End::Dof(dof) => serializer.serialize_u64(*dof as u64 + 1),
            End::Ground => serializer.serialize_str("ground"),
            End::Fixed => serializer.serialize_str("fixed"),
        }
    }
}

impl<'de> Deserialize<'de> for End {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(EndVisitor)
    }
}

struct EndVisitor;

impl Visitor<'_> for EndVisitor {
    type Value = End;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a degree of freedom counted from 1, \"ground\" or \"fixed\"")
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<End, E> {
        u64::try_from(value)
            .map_err(|_| E::invalid_value(de::Unexpected::Signed(value), &self))
            .and_then(|value| self.visit_u64(value))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<End, E> {
        match usize::try_from(value) {
            Ok(dof @ 1..) => Ok(End::Dof(dof - 1)),
            _ => Err(E::invalid_value(de::Unexpected::Unsigned(value), &self)),
        }
    }

    fn visit_str<E: de::Error>(self, value: &str) -> Result<End, E> {
        match value {
            "ground" => Ok(End::Ground),
            "fixed" => Ok(End::Fixed),
            _ => Err(E::invalid_value(de::Unexpected::Str(value), &self)),
        }
    }
}

impl JsonSchema for End {
    fn schema_name() -> Cow<'static, str> {
        "End".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A degree of freedom counted from 1, \"ground\" (moves with the base) or \"fixed\" (the inertial frame, not with a ground acceleration)",
            "anyOf": [
                { "type": "integer", "minimum": 1 },
                { "type": "string", "enum": ["ground", "fixed"] }
            ]
        })
    }
}
