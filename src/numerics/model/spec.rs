//! The structure as a test file describes it. Plain data; [`super::build`] makes a [`super::Structure`] of it.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::End;
use crate::frame::FrameSpec;
use crate::law::LawSpec;

/// The numerical structure in one of four forms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum StructureSpec {
    /// One mass for each floor, one spring and one dashpot for each storey. Storey 1 connects floor
    /// 1 to the ground.
    ShearBuilding(ShearBuildingSpec),
    /// Mass, stiffness and damping matrices, written here or read from files.
    Matrices(MatricesSpec),
    /// Equal masses in a row, connected by equal springs and dashpots. The base carries mass 1, and
    /// the last mass is free.
    Chain(ChainSpec),
    /// Plane frame: nodes, elastic members, constraints and static loads.
    Frame(FrameSpec),
}

/// Shear building: one mass for each floor, one spring and one dashpot for each storey.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ShearBuildingSpec {
    /// Mass of each floor, from the bottom. 0 is a DOF without mass.
    pub mass_kg: Vec<f64>,
    /// Stiffness of each storey, from the bottom. 0 leaves the storey to elements or to a specimen.
    pub stiffness_n_per_m: Vec<f64>,
    /// Damping of the dashpot in each storey, from the bottom. Default: no dashpots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [2.0e4, 2.0e4, 1.5e4])]
    pub damping_n_s_per_m: Option<Vec<f64>>,
    /// P-Δ effect of the weight of the floors. Default: not included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_delta: Option<PDeltaSpec>,
}

/// P-Δ effect: the weight above a storey lowers its stiffness by weight over height. A damping rule
/// refers to the lowered stiffness. The measured force of a specimen must not include the effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct PDeltaSpec {
    /// Height of each storey, from the bottom.
    #[schemars(example = [3.5, 3.2, 3.2])]
    pub storey_height_m: Vec<f64>,
    /// Vertical load of each floor, from the bottom, with the load of columns that only lean on the
    /// building. Default: mass times 9.80665 m/s².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [9.8e5, 9.8e5, 7.0e5])]
    pub weight_n: Option<Vec<f64>>,
}

/// Symmetric matrices in SI units. Write each matrix here by rows, or name a .csv, .npy or .mtx
/// file.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct MatricesSpec {
    /// Mass matrix by rows. The units are kg, or kg m² for a rotation. A row of zeros is a DOF
    /// without mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<Vec<Vec<f64>>>,
    /// File that contains the mass matrix, relative to the test file. Use it instead of `mass`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"mass.csv")]
    pub mass_file: Option<String>,
    /// Stiffness matrix by rows. The units are N/m, or N m/rad for a rotation. It may be singular.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [[2.0e6, -1.0e6], [-1.0e6, 1.0e6]])]
    pub stiffness: Option<Vec<Vec<f64>>>,
    /// File that contains the stiffness matrix, relative to the test file. Use it instead of
    /// `stiffness`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"stiffness.csv")]
    pub stiffness_file: Option<String>,
    /// Damping matrix by rows. The units are N s/m, or N m s/rad for a rotation. Any symmetric
    /// damping matrix is allowed, also a non-classical one. Default: no damping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [[2000.0, -1000.0], [-1000.0, 1000.0]])]
    pub damping: Option<Vec<Vec<f64>>>,
    /// File that contains the damping matrix, relative to the test file. Use it instead of
    /// `damping`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"damping.csv")]
    pub damping_file: Option<String>,
    /// Influence vector ι: displacement of each DOF for a unit displacement of the base. Default: 1
    /// for each DOF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub influence: Option<Vec<f64>>,
}

/// Chain of equal masses, springs and dashpots. Source: Gui et al. 2014, example 4.3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ChainSpec {
    /// Number of masses.
    #[schemars(range(min = 1))]
    pub dofs: usize,
    /// Each mass.
    pub mass_kg: f64,
    /// Stiffness of each spring, including the spring to the base.
    pub stiffness_n_per_m: f64,
    /// Damping of each dashpot, including the dashpot to the base. Default: no dashpots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping_n_s_per_m: Option<f64>,
    /// Damper between each mass and the inertial frame. It acts on the absolute velocity, so a
    /// ground acceleration is refused. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub absolute_damper: Option<LawSpec>,
}

/// Viscous damping by a rule, instead of dashpots or a damping matrix. The stiffness K in the rule
/// is the initial tangent stiffness of the structure with all elements and specimens. A specimen
/// contributes its `stiffness_n_per_m`, otherwise the initial tangent of its law. In a frame, K is
/// that of the members alone, without P-Δ effect, and of links and specimens with `damped = true`.
/// Frequencies and modes are those of the whole structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum DampingSpec {
    /// Rayleigh damping, C = a M + b K, with given coefficients.
    Rayleigh(RayleighSpec),
    /// Rayleigh damping, C = a M + b K, with a given damping ratio at two frequencies or modes.
    RayleighRatio(RayleighRatioSpec),
    /// Damping ratio of each mode.
    Modal(ModalSpec),
}

/// Rayleigh damping with given coefficients, C = a M + b K.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct RayleighSpec {
    /// Coefficient a of the mass matrix.
    #[schemars(example = 0.5)]
    pub mass_coefficient_per_s: f64,
    /// Coefficient b of the stiffness matrix.
    #[schemars(example = 0.0005)]
    pub stiffness_coefficient_s: f64,
    /// Where the part b K acts. Default: "condensed".
    #[serde(default, skip_serializing_if = "StiffnessPart::is_condensed")]
    #[schemars(example = &"initial")]
    pub stiffness_part: StiffnessPart,
}

/// Where the stiffness part of a damping rule acts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StiffnessPart {
    /// On the DOFs with mass. The others follow them, so a joint that yields gets no moment from damping.
    #[default]
    Condensed,
    /// On all DOFs, as OpenSees does with the initial stiffness. A joint that yields is then damped, too.
    Initial,
}

impl StiffnessPart {
    fn is_condensed(&self) -> bool {
        *self == Self::Condensed
    }
}

/// Rayleigh damping with a given ratio at two frequencies, C = a M + b K. Give `first_hz` and
/// `second_hz`, or `modes`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct RayleighRatioSpec {
    /// Damping ratio at both frequencies, as a fraction of critical damping. 0.02 is 2 %.
    pub ratio: f64,
    /// First frequency with this damping ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_hz: Option<f64>,
    /// Second frequency with this damping ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_hz: Option<f64>,
    /// Numbers of the two modes with this damping ratio, from 1. Use it instead of frequencies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub modes: Option<[usize; 2]>,
}

/// Modal damping, C = M Φ diag(2 ξ ω) Φᵀ M.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ModalSpec {
    /// Damping ratio ξ of each mode from the lowest, as a fraction of critical damping. A list with
    /// one number applies to all modes.
    pub ratios: Vec<f64>,
}

/// Spring or damper between two DOFs, or between a DOF and the ground or the inertial frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ElementSpec {
    /// Name of the element in messages and reports. Default: "element" and its number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// First end of the element: a DOF from 1, "ground" or "fixed". The deformation is the
    /// displacement of `to` minus that of `from`.
    pub from: End,
    /// Second end of the element: a DOF from 1, "ground" or "fixed".
    pub to: End,
    /// Force law of the element.
    pub law: LawSpec,
    /// Largest expected size of the deformation. The proof of stability uses it to bound the
    /// tangent stiffness of a hardening law. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_disp_m: Option<f64>,
    /// Largest expected size of the deformation velocity. The proof of stability uses it to bound
    /// the tangent damping of a nonlinear damper. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.5)]
    pub reach_vel_m_per_s: Option<f64>,
    /// Upper bound of the tangent stiffness divided by the initial stiffness, at least 1. It
    /// replaces the bound that the law gives. Default: the bound of the law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.5)]
    pub hardening_ratio: Option<f64>,
    /// Upper bound of the tangent damping divided by the initial damping, at least 1. It replaces
    /// the bound that the law gives. Default: the bound of the law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 2.0)]
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
            "description": "Number of a DOF from 1, \"ground\" (moves with the base) or \"fixed\" (inertial frame, refused with a ground acceleration).",
            "anyOf": [
                { "type": "integer", "minimum": 1 },
                { "type": "string", "enum": ["ground", "fixed"] }
            ]
        })
    }
}
