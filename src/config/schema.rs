//! The test file: its tables, their keys, units and defaults.
//!
//! Plain data. What a table means is built elsewhere; what is contradictory is said by [`super::check`]. The comments on
//! the fields are the text of `gusset schema`. Unknown keys are refused everywhere.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::certificate::{CertificateTable, UncertaintyTable};
use super::excitation::ExcitationTable;
use super::safety::SafetyTable;
use super::specimen::SpecimenTable;
use super::timetable::TimeTable;
use super::value::{DofChoice, LambdaValue};
use super::variant;
use crate::model::{DampingSpec, ElementSpec, StructureSpec};
use crate::rt::TimingSpec;

/// One hybrid test, from its structure to its record. SI units; keys of quantities carry the unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TestFile {
    /// Name of the test for the report and for the name of the run folder; no control or other hidden characters. Default: the
    /// file's own name.
    #[serde(default)]
    pub title: String,
    /// Step, duration and clock.
    pub time: TimeTable,
    /// The numerical substructure. Without it the specimens are driven along a prescribed displacement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub structure: Option<StructureTable>,
    /// The time integration.
    #[serde(default)]
    pub integrator: IntegratorTable,
    /// What moves the structure. Without any, it vibrates freely from its initial state.
    #[serde(default)]
    pub excitation: ExcitationTable,
    /// What is commanded and measured, one table each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub specimen: Vec<SpecimenTable>,
    /// Bounds that stop the test.
    #[serde(default)]
    pub safety: SafetyTable,
    /// What is asked of the machine, and what happens when a deadline is missed.
    #[serde(default)]
    pub timing: TimingSpec,
    /// What is recorded.
    #[serde(default)]
    pub record: RecordTable,
    /// What `check --rehearse` runs and allows.
    #[serde(default, skip_serializing_if = "CertificateTable::is_default")]
    pub certificate: CertificateTable,
    /// Numbers of this file that are not known exactly: `check --rehearse` draws them anew for each trial.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub uncertainty: Vec<UncertaintyTable>,
}

/// The numerical substructure: exactly one of `shear_building`, `matrices` and `chain`, and what stands with it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StructureTable {
    /// Floors on storeys, from the ground up.
    #[serde(
        default,
        deserialize_with = "read_shear_building",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "shear_building_schema")]
    pub shear_building: Option<StructureSpec>,
    /// Mass, damping and stiffness as matrices, inline or from files.
    #[serde(
        default,
        deserialize_with = "read_matrices",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "matrices_schema")]
    pub matrices: Option<StructureSpec>,
    /// A chain of equal masses, for large models.
    #[serde(
        default,
        deserialize_with = "read_chain",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "chain_schema")]
    pub chain: Option<StructureSpec>,
    /// Viscous damping by rule, in place of dashpots or a damping matrix in the structure's own table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping: Option<DampingSpec>,
    /// Displacement of every DOF at t = 0 in m, counted from its position under the static load. Default: zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_displacement_m: Option<Vec<f64>>,
    /// Velocity of every DOF at t = 0 in m/s. Default: zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_velocity_m_per_s: Option<Vec<f64>>,
    /// Force on every DOF in N, brought on before t = 0 and held throughout.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_load_n: Option<Vec<f64>>,
    /// Weight as a static load M·ι·g, brought on before t = 0 and held throughout; adds to `static_load_n`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity: Option<GravityTable>,
    /// DOFs of `matrices` that are rotations, from 1: rad in place of m, N m in place of N, recorded and shown as such.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rotations: Vec<usize>,
    /// Nonlinear springs and dampers between two DOFs, or between a DOF and the ground.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub element: Vec<ElementSpec>,
}

impl StructureTable {
    /// The kinds that are given, by key; a checked file has exactly one.
    #[must_use]
    pub fn kinds(&self) -> Vec<(&'static str, &StructureSpec)> {
        [
            ("shear_building", &self.shear_building),
            ("matrices", &self.matrices),
            ("chain", &self.chain),
        ]
        .into_iter()
        .filter_map(|(key, kind)| kind.as_ref().map(|spec| (key, spec)))
        .collect()
    }
}

/// Weight as a static load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GravityTable {
    /// Acceleration g in m/s².
    #[serde(default = "standard_gravity")]
    pub accel_m_per_s2: f64,
    /// Influence vector ι, one number per DOF: which way is down, as the DOF counts it.
    pub influence: Vec<f64>,
}

/// The time integration.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct IntegratorTable {
    /// The method. Only "gui", and "kr_alpha" and "mkr_alpha" with weighted forces, may command a specimen.
    pub method: Method,
    /// λ of the family: a number, `inf`, or "auto" for the largest that is proven stable (at most 11.5).
    pub lambda: LambdaValue,
    /// λ of single storeys ("storey 2"), springs of a chain ("spring 7"), elements or specimens, by name: a number or
    /// `inf`. `lambda` is then that of the rest; with "auto" the largest that is stable together with these.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub lambda_of_element: BTreeMap<String, LambdaValue>,
    /// λ of the lowest modes of the initial structure, in order: numbers or `inf`. `lambda` is then that of all other
    /// modes. For structures of up to 300 degrees of freedom.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lambda_of_mode: Vec<LambdaValue>,
    /// Older form of `safety.accept_unstable`, without a reason.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub allow_unstable_lambda: bool,
    /// Bound on how much a stiff mode amplifies a force error, for "auto". Default: 2 with a specimen, else 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_bound: Option<f64>,
    /// The first step.
    pub start: Start,
    /// ρ∞ of kr_alpha and mkr_alpha, which must have it: spectral radius at infinite frequency, 0 (most damping of high
    /// frequencies) to 1 (none).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rho_infinity: Option<f64>,
    /// What kr_alpha and mkr_alpha weigh. Default: forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighting: Option<Weighting>,
    /// Increment over the largest response at which Newton's iteration ends, for methods that iterate. Default: 1e-10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub newton_tolerance: Option<f64>,
    /// Iterations of one step after which the test stops, for methods that iterate, at most 10000. Default: 50.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 10_000))]
    pub newton_iterations: Option<u32>,
}

/// Integration methods. Those that need the forces of the step they are making run only tests without a specimen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The Gui-λ family (Gui, Wang, Jin & Chen 2014): explicit, one solve per step; λ = 4 is Chen-Ricles.
    #[default]
    Gui,
    /// Newmark with β = 1/4: average acceleration, iterated to equilibrium.
    NewmarkAverage,
    /// Newmark with β = 1/6: linear acceleration, iterated to equilibrium.
    NewmarkLinear,
    /// Newmark with β = 0: explicit in displacement.
    NewmarkExplicit,
    /// Central differences: explicit in displacement.
    CentralDifference,
    /// Chang 2002: explicit in displacement, unconditionally stable for linear and softening systems.
    #[serde(rename = "chang_2002")]
    Chang2002,
    /// KR-α (Kolay & Ricles 2014): explicit, with numerical damping by `rho_infinity`.
    KrAlpha,
    /// MKR-α (Kolay & Ricles 2019): explicit, with numerical damping by `rho_infinity`.
    MkrAlpha,
}

/// What the α methods weigh between two steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// The forces of both steps. Recorded accelerations follow from equilibrium at the end of the step.
    #[default]
    Forces,
    /// The states, at which the force is then evaluated, as open-source finite-element programs do. Recorded accelerations are
    /// those that the method goes on with.
    State,
}

impl IntegratorTable {
    /// Why this method cannot command a specimen, or nothing if it can.
    #[must_use]
    pub fn why_no_specimen(&self) -> Option<&'static str> {
        match self.method {
            Method::Gui => None,
            Method::KrAlpha | Method::MkrAlpha => {
                (self.weighting == Some(Weighting::State)).then_some(
                    "it evaluates forces at a weighted state, which is not the displacement of any step",
                )
            }
            Method::NewmarkAverage | Method::NewmarkLinear => Some(
                "it is implicit: it would command every iterate of its displacement, and a specimen \
                 cannot take a step back",
            ),
            Method::NewmarkExplicit | Method::CentralDifference | Method::Chang2002 => Some(
                "it is explicit in displacement only: its velocity follows from the force of the same \
                 step, by iteration where damping is nonlinear",
            ),
        }
    }

    /// True for the methods with ρ∞.
    #[must_use]
    pub fn is_alpha(&self) -> bool {
        matches!(self.method, Method::KrAlpha | Method::MkrAlpha)
    }

    /// True for the methods that iterate to equilibrium.
    #[must_use]
    pub fn iterates(&self) -> bool {
        self.method != Method::Gui && !self.is_alpha()
    }
}

/// The first step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// As printed in the paper: half a step off when the initial acceleration is not zero.
    #[default]
    Published,
    /// With a corrected first velocity: displacements of second order from the start.
    SecondOrder,
}

/// What is recorded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordTable {
    /// DOFs whose motion is recorded: "all", or numbers from 1. Default: all up to 64 DOFs, beyond that those of the
    /// specimens and the two ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dofs: Option<DofChoice>,
    /// Seconds of rows that the queue to the writer holds before rows are lost, at most 600.
    pub queue_s: f64,
    /// Whether a lost row makes the test a failed one (exit code 1), and so a record that others deleted or changed while the test
    /// ran, and one whose summary could not be written.
    pub required: bool,
    /// Wall time in s from one checkpoint to the next, at most 3600: a digest of the test's state in the events, against which a test that
    /// goes on after an interruption (`gusset run --resume`) is proven.
    pub checkpoint_s: f64,
}

impl Default for RecordTable {
    fn default() -> Self {
        Self {
            dofs: None,
            queue_s: 4.0,
            required: false,
            checkpoint_s: 1.0,
        }
    }
}

const fn standard_gravity() -> f64 {
    9.806_65
}

fn read_shear_building<'de, D: serde::Deserializer<'de>>(
    d: D,
) -> Result<Option<StructureSpec>, D::Error> {
    variant::read("shear_building", d)
}

fn read_matrices<'de, D: serde::Deserializer<'de>>(
    d: D,
) -> Result<Option<StructureSpec>, D::Error> {
    variant::read("matrices", d)
}

fn read_chain<'de, D: serde::Deserializer<'de>>(d: D) -> Result<Option<StructureSpec>, D::Error> {
    variant::read("chain", d)
}

fn shear_building_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    variant::schema::<StructureSpec>("shear_building", generator)
}

fn matrices_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    variant::schema::<StructureSpec>("matrices", generator)
}

fn chain_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    variant::schema::<StructureSpec>("chain", generator)
}
