//! The test file: its tables, their keys, units and defaults.
//!
//! Plain data. [`super::check`] reports contradictions. The comments on the fields are the text of `gusset schema` and of
//! the configuration reference, so they are written for users. Unknown keys are refused everywhere.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::about_table::AboutTable;
use super::bus_spec::OnBuses;
use super::bus_table::BusTable;
use super::certificate::{CertificateTable, UncertaintyTable};
use super::excitation::ExcitationTable;
use super::safety::SafetyTable;
use super::specimen::{SpecimenTable, link_specimens};
use super::timetable::TimeTable;
use super::timing_table::TimingSpec;
use super::value::{DofChoice, LambdaValue};
use gusset_numerics::frame::{Direction, FrameSpec};
use gusset_numerics::model::{
    ChainSpec, DampingSpec, ElementSpec, MatricesSpec, ShearBuildingSpec, StructureSpec,
};

/// One hybrid test: the structure, its excitation, its specimens, its limits and its record. Values
/// are in SI units unless the key or a unit beside it says otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TestFile {
    /// Name of the test, used in the report and in the name of the run folder. Control characters
    /// and other hidden characters are refused. Default: the name of the file.
    #[serde(default)]
    pub title: String,
    /// Who tests what: for archives and later readers.
    #[serde(default, skip_serializing_if = "AboutTable::is_empty")]
    pub about: AboutTable,
    /// Integration step, duration and clock.
    pub time: TimeTable,
    /// Numerical substructure. Without this table nothing is integrated, and
    /// `excitation.prescribed_displacement` moves the specimens.
    pub structure: Option<StructureTable>,
    /// Time integration.
    #[serde(default)]
    pub integrator: IntegratorTable,
    /// Ground motion, forces or prescribed displacements. Without them the structure vibrates
    /// freely from its initial state.
    #[serde(default)]
    pub excitation: ExcitationTable,
    /// Specimens, one `[[specimen]]` table each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub specimen: Vec<SpecimenTable>,
    /// EtherCAT buses of this computer, one `[bus.NAME]` table each. A test uses at most one. More:
    /// guide, ethercat.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub bus: BTreeMap<String, BusTable>,
    /// Startup, limits of the whole test, and the end position of the specimens.
    #[serde(default)]
    pub safety: SafetyTable,
    /// Real-time scheduling, and the response to missed deadlines.
    #[serde(default)]
    pub timing: TimingSpec,
    /// Contents of the record.
    #[serde(default)]
    pub record: RecordTable,
    /// Number of trials and allowed errors of `gusset check --rehearse`.
    #[serde(default, skip_serializing_if = "CertificateTable::is_default")]
    pub certificate: CertificateTable,
    /// Uncertain values of this file. `gusset check --rehearse` draws new values for each trial.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub uncertainty: Vec<UncertaintyTable>,
}

impl OnBuses for TestFile {
    fn link_specimens(&mut self) {
        link_specimens(&self.bus, &mut self.specimen);
    }
}

/// Numerical substructure. Give exactly one of `shear_building`, `matrices`, `chain` and `frame`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StructureTable {
    /// Shear building: one mass for each floor, one spring and one dashpot for each storey.
    pub shear_building: Option<ShearBuildingSpec>,
    /// Mass, damping and stiffness matrices, written here or read from files.
    pub matrices: Option<MatricesSpec>,
    /// Chain of equal masses, springs and dashpots. Use it to test large models.
    pub chain: Option<ChainSpec>,
    /// Plane frame: nodes, elastic members, constraints and static loads.
    pub frame: Option<FrameSpec>,
    /// Viscous damping by a rule, for example Rayleigh damping. Use it instead of the dashpots or
    /// the damping matrix of the structure.
    pub damping: Option<DampingSpec>,
    /// Displacement of each DOF at t = 0, relative to its position under the static load. The unit
    /// is m, or rad for a rotation. Default: zero.
    #[schemars(example = [0.01, 0.02, 0.03])]
    pub initial_displacement_m: Option<Vec<f64>>,
    /// Velocity of each DOF at t = 0. The unit is m/s, or rad/s for a rotation. Default: zero.
    #[schemars(example = [0.0, 0.0, 0.1])]
    pub initial_velocity_m_per_s: Option<Vec<f64>>,
    /// Constant force on each DOF, in N, or in N m for a rotation. It is applied before t = 0 and
    /// stays constant. Default: none.
    pub static_load_n: Option<Vec<f64>>,
    /// Weight of the structure as a static load, M·ι·g. It is applied before t = 0 and is added to
    /// `static_load_n`. Default: none.
    pub gravity: Option<GravityTable>,
    /// Numbers of the DOFs of `matrices` that are rotations, from 1. Their units are rad and N m in
    /// the file, the record and the report. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rotations: Vec<usize>,
    /// Nonlinear springs and dampers between two DOFs, or between a DOF and the ground.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub element: Vec<ElementSpec>,
    /// Reduction of `matrices` or `frame` to some DOFs and modes, after Craig and Bampton. All DOF
    /// numbers of this file stay those of the full model. Default: no reduction.
    pub reduce: Option<ReduceTable>,
}

/// Reduction of the linear part of a structure. A DOF that a specimen, an element, a link, a member
/// that is not linear, an initial value or `record.dofs` touches is always kept. More: guide, import.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReduceTable {
    /// Number of modes of the other DOFs, with all kept DOFs fixed. 0 is the static condensation of
    /// Guyan.
    #[schemars(example = 20)]
    pub modes: usize,
    /// Further DOFs to keep. For `matrices` these are numbers from 1, for `frame` tables such as
    /// `{ node = "A1", direction = "x" }`. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = [120, 240])]
    pub keep: Vec<KeptDof>,
}

/// A DOF that a reduction keeps: a number from 1, or a node of a frame and a direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum KeptDof {
    /// Number of a DOF of `matrices`, from 1.
    Number(usize),
    /// Motion of a node of `frame`.
    Node(KeptNode),
}

/// Motion of a node that a reduction keeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeptNode {
    /// Name of the node.
    #[schemars(example = &"A1")]
    pub node: String,
    /// Direction of the motion.
    pub direction: Direction,
}

impl StructureTable {
    /// A degree of freedom, from 1, in words: "DOF 2", or "DOF 2 (A1 x)" in a frame. Of a reduced structure this is right for the
    /// file of a run, in which `keep` has all DOFs that are kept.
    #[must_use]
    pub fn dof_in_words(&self, dof: usize) -> String {
        if let Some(reduce) = &self.reduce {
            return format!("DOF {dof} ({})", reduce.place(dof - 1));
        }
        let places = self
            .frame
            .as_ref()
            .map(FrameSpec::places)
            .unwrap_or_default();
        match dof.checked_sub(1).and_then(|place| places.get(place)) {
            Some((node, direction)) => format!("DOF {dof} ({node} {})", direction.word()),
            None => format!("DOF {dof}"),
        }
    }

    /// The DOF of the full model, from 0, that a DOF of the structure is; `None` for a mode of a reduced structure. Right for the file
    /// of a run, as [`Self::dof_in_words`].
    #[must_use]
    pub fn dof_of_model(&self, dof: usize) -> Option<usize> {
        let Some(reduce) = &self.reduce else {
            return Some(dof);
        };
        match reduce.keep.get(dof)? {
            KeptDof::Number(number) => number.checked_sub(1),
            KeptDof::Node(KeptNode { node, direction }) => {
                let places = self.frame.as_ref()?.places();
                places
                    .iter()
                    .position(|place| (&place.0, &place.1) == (node, direction))
            }
        }
    }

    /// True if a static load acts before t = 0.
    #[must_use]
    pub fn has_static_load(&self) -> bool {
        let of_frame = self
            .frame
            .as_ref()
            .is_some_and(|frame| !frame.load.is_empty());
        self.static_load_n.is_some() || self.gravity.is_some() || of_frame
    }

    /// The kind that is given, with its key; a checked file has exactly one.
    #[must_use]
    pub fn kind(&self) -> Option<(&'static str, StructureSpec)> {
        let building = self
            .shear_building
            .clone()
            .map(StructureSpec::ShearBuilding);
        let matrices = || self.matrices.clone().map(StructureSpec::Matrices);
        let chain = || self.chain.clone().map(StructureSpec::Chain);
        let building = building.map(|spec| ("shear_building", spec));
        building
            .or_else(|| Some(("matrices", matrices()?)))
            .or_else(|| Some(("chain", chain()?)))
            .or_else(|| Some(("frame", StructureSpec::Frame(self.frame.clone()?))))
    }
}

impl ReduceTable {
    /// A degree of freedom of the reduced structure, from 0, where `keep` has all kept ones in their order: "A1 x", "model DOF 12",
    /// "mode 3" or "shape 1".
    #[must_use]
    pub fn place(&self, dof: usize) -> String {
        match self.keep.get(dof) {
            Some(KeptDof::Number(number)) => format!("model DOF {number}"),
            Some(KeptDof::Node(KeptNode { node, direction })) => {
                format!("{node} {}", direction.word())
            }
            None => match dof - self.keep.len() {
                mode if mode < self.modes => format!("mode {}", mode + 1),
                shape => format!("shape {}", shape - self.modes + 1),
            },
        }
    }
}

/// Weight of the structure as a static load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GravityTable {
    /// Acceleration of gravity g.
    #[serde(default = "standard_gravity")]
    #[schemars(example = 9.81)]
    pub accel_m_per_s2: f64,
    /// Influence vector ι, one number for each DOF. It is the direction of gravity in the DOFs: −1
    /// for a vertical DOF that is positive upwards.
    #[schemars(example = [0.0, -1.0, 0.0])]
    pub influence: Vec<f64>,
}

/// Time integration.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct IntegratorTable {
    /// Integration method. A specimen needs "gui", or "kr_alpha" or "mkr_alpha" with `weighting =
    /// "forces"`. Use the other methods to compare purely numerical tests. More: guide,
    /// mathematics-integrator.
    #[schemars(example = &"kr_alpha")]
    pub method: Method,
    /// Parameter λ of the Gui-λ family: a number, `inf` or "auto". "auto" takes the largest λ that
    /// is proven stable, at most 11.5. λ = 4 is the Chen–Ricles method.
    pub lambda: LambdaValue,
    /// Older form of `safety.accept_unstable`, without a reason. Use `safety.accept_unstable` in
    /// new files. Default: false.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub allow_unstable_lambda: bool,
    /// Largest allowed amplification of a force error by a stiff mode. It limits the λ that `lambda
    /// = "auto"` chooses. Default: 2 with a specimen, 10 without.
    #[schemars(example = 2.0)]
    pub gain_bound: Option<f64>,
    /// Share of the damping at rest of `smooth_friction` and `power_damper` laws that enters the
    /// initial damping, from 0 to 1. This damping acts around rest only, so a smaller share is more
    /// accurate. Default: the least share for which the proof of stability holds.
    #[schemars(example = 0.25)]
    pub rest_damping_share: Option<f64>,
    /// First step of the Gui-λ family. "second-order" is more accurate if the initial acceleration
    /// is not zero.
    #[schemars(example = &"second-order")]
    pub start: Start,
    /// Spectral radius ρ∞ at infinite frequency, from 0 (strongest damping of high frequencies) to
    /// 1 (none). "kr_alpha" and "mkr_alpha" require it. Source: Kolay & Ricles 2014 and 2019.
    #[schemars(example = 0.9)]
    pub rho_infinity: Option<f64>,
    /// Quantity that "kr_alpha" and "mkr_alpha" average between two steps. Default: "forces".
    #[schemars(example = &"forces")]
    pub weighting: Option<Weighting>,
    /// Convergence tolerance of Newton's iteration: the increment divided by the largest response.
    /// Only for the Newmark methods, "central_difference" and "chang_2002". Default: 1e-10.
    #[schemars(example = 1e-10)]
    pub newton_tolerance: Option<f64>,
    /// Maximum number of Newton iterations in a step. The test stops if the iteration does not
    /// converge. Only for the methods with `newton_tolerance`. Default: 50.
    #[schemars(range(min = 1, max = 10_000))]
    #[schemars(example = 50)]
    pub newton_iterations: Option<u32>,
}

/// Integration method. Methods that iterate, or that need the force of the current step, cannot
/// command a specimen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Gui-λ family: explicit, one linear solve for each step. λ = 4 is the Chen–Ricles method.
    /// Source: Gui, Wang, Jin & Chen 2014.
    #[default]
    Gui,
    /// Newmark's method with β = 1/4: constant average acceleration, iterated to equilibrium.
    NewmarkAverage,
    /// Newmark's method with β = 1/6: linear acceleration, iterated to equilibrium.
    NewmarkLinear,
    /// Newmark's method with β = 0: explicit in displacement.
    NewmarkExplicit,
    /// Central difference method: explicit in displacement.
    CentralDifference,
    /// Method of Chang 2002: explicit in displacement, unconditionally stable for linear and
    /// softening systems.
    #[serde(rename = "chang_2002")]
    Chang2002,
    /// KR-α method: explicit, with numerical damping by `rho_infinity`. Source: Kolay & Ricles
    /// 2014.
    KrAlpha,
    /// MKR-α method: explicit, with numerical damping by `rho_infinity`. Source: Kolay & Ricles
    /// 2019.
    MkrAlpha,
}

/// Quantity that the α methods average between two steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Average the forces of both steps. Recorded accelerations satisfy equilibrium at the end of
    /// the step.
    #[default]
    Forces,
    /// Average the states and evaluate the force there, as open-source finite-element programs do.
    /// Recorded accelerations are the internal accelerations of the method. A specimen cannot use
    /// it.
    State,
}

impl IntegratorTable {
    /// Why this method cannot command a specimen, or nothing if it can.
    #[must_use]
    pub(crate) fn why_no_specimen(&self) -> Option<&'static str> {
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
    pub(crate) fn is_alpha(&self) -> bool {
        matches!(self.method, Method::KrAlpha | Method::MkrAlpha)
    }
}

/// First step of the Gui-λ family.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// First step as published. Displacements are of first order in Δt if the initial acceleration
    /// is not zero.
    #[default]
    Published,
    /// First step with a corrected velocity. Displacements are of second order in Δt from the
    /// start.
    SecondOrder,
}

/// Contents of the record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordTable {
    /// DOFs whose motion is recorded: "all", or a list of numbers from 1. Default: all DOFs of a
    /// model with up to 64. For larger models: the first, the last and those of the specimens.
    #[schemars(example = &"all")]
    pub dofs: Option<DofChoice>,
    /// Length of the queue between the loop and the writer, in seconds of rows, at most 600. If the
    /// disk stalls longer than that, rows are lost.
    #[schemars(example = 8.0)]
    pub queue_s: f64,
    /// If true, an incomplete record makes the run fail with exit code 1. Examples are a lost row,
    /// a changed file, or a summary that cannot be written.
    pub required: bool,
    /// Wall time between two checkpoints, at most 3600 s. A checkpoint keeps the state of the test
    /// and a digest of it; above 10 000 DOFs the digest only. Without a `link`, `gusset run
    /// --resume` continues from the newest state. With one it compares every checkpoint.
    #[schemars(example = 2.0)]
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
