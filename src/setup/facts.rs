//! Facts about a test before it runs: for `check`, the session and the report.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use gusset_config::{ClockChoice, Method, TimingSpec};
use gusset_motion::{Corrected, Ground, RecordFacts, Scaled};
use gusset_numerics::frame::MemberUse;
use gusset_numerics::integrate::Lambda;
use gusset_numerics::linalg::SymMatrix;
use gusset_proof::{Analysis, LambdaChoice, OnlineLimit, Stability};
use gusset_record::summary::LimitFacts;
use gusset_reduction::{Accuracy, Reduction, ReductionError};

/// Modes of which a reduced model is compared with the full one.
const COMPARED: usize = 6;

/// Facts about a test before it runs.
#[derive(Debug, Clone)]
pub struct Facts {
    /// Its title.
    pub title: String,
    /// `[about]` of its file.
    pub about: Option<serde_json::Value>,
    /// Δt in s of test time.
    pub dt: f64,
    /// Number of steps.
    pub steps: u64,
    /// Requested ticks of the controller per second of wall time.
    pub rate_hz: f64,
    /// Ticks of the controller in one step.
    pub ticks_per_step: u32,
    /// The clock.
    pub clock: ClockChoice,
    /// The structure, if there is one.
    pub structure: Option<StructureFacts>,
    /// Names of the specimens, in order.
    pub specimens: Vec<String>,
    /// Units of displacement and force of each axis of each specimen.
    pub units: Vec<Vec<[&'static str; 2]>>,
    /// Those of them whose displacements and forces are others for the structure, units apart.
    pub scaled: Vec<String>,
    /// Requests of the test to the machine.
    pub timing: TimingSpec,
    /// Whether a lost row or a damaged record makes the test a failed one.
    pub record_required: bool,
    /// Seconds of rows that the queue to the writer holds.
    pub queue_s: f64,
    /// How far each axis may be from its last position when an interrupted test resumes, in m; `None`: as far as the record
    /// allows.
    pub resume_within: Option<f64>,
    /// How far the force of each axis may differ then, in N at the specimen; `None`: as far as the record allows.
    pub resume_within_n: Option<f64>,
    /// Root mean square of the noise that each specimen's load cells are declared to have, in N at the specimen.
    pub force_noise_n: Vec<f64>,
    /// The interrupted test that this test resumes, if any: its folder, and the last step made there.
    pub resumed: Option<(PathBuf, u64)>,
    /// Motions before the test, and their reasons.
    pub announced: Vec<String>,
    /// Specimens behind links that have a law for rehearsals, too, in sentences.
    pub moved: Vec<String>,
    /// Whether an operator must confirm the readings before anything moves.
    pub confirm: bool,
    /// Facts about the records of its motions, in the order of the test file.
    pub records: Vec<RecordFacts>,
    /// Accelerations that became displacements, with the keys of their tables.
    pub corrected: Vec<(String, Corrected)>,
    /// The limits, who checks them, and their consequences.
    pub limits: LimitFacts,
    /// Warnings for the user; the test may run.
    pub warnings: Vec<String>,
    /// Findings that would have refused the test, and that the user has accepted: the name of each override and the reason given.
    pub accepted: BTreeMap<String, String>,
}

impl Facts {
    /// λ in use; none without a structure or with another method than the family.
    #[must_use]
    pub fn lambda(&self) -> Option<f64> {
        let lambda = self.structure.as_ref()?.lambda?;
        Some(lambda.value())
    }
}

/// Facts about the numerical side.
#[derive(Debug, Clone)]
pub struct StructureFacts {
    /// Degrees of freedom.
    pub dofs: usize,
    /// Those of them, from 0, that are rotations: rad and N m.
    pub rotations: Vec<usize>,
    /// Node and direction of each degree of freedom of a frame, such as "A1 x"; empty for other structures.
    pub places: Vec<String>,
    /// The frame under its static loads; none for other structures.
    pub frame: Option<FrameFacts>,
    /// The reduction of the structure; none without it.
    pub reduction: Option<ReductionFacts>,
    /// Damping along the axes of specimens by the damping rule; none without a rule or a specimen.
    pub rule_damping: Option<RuleDamping>,
    /// The integration method.
    pub method: Method,
    /// How M_eff is stored and factored, for the family.
    pub storage: Option<String>,
    /// 1/κ of the matrix that is factored for α, its diagonal scaled to one; `None` for methods without α.
    pub reciprocal_condition: Option<f64>,
    /// λ in use, for the family.
    pub lambda: Option<Lambda>,
    /// Share of the damping at rest that is in C0; none where no element has such a damping.
    pub rest_damping_share: Option<f64>,
    /// Whether λ was asked for by number.
    pub lambda_by_number: bool,
    /// Stability at the declared bounds.
    pub stability: Stability,
    /// Gain bound g of the automatic choice.
    pub gain: f64,
    /// Natural frequencies at the start in rad/s, ascending, as far as they are cheap to find.
    pub frequencies: Vec<f64>,
    /// Largest |ground acceleration| of all components in m/s².
    pub peak_ground_accel: Option<f64>,
    /// The recorded ground accelerations.
    pub grounds: Vec<GroundFacts>,
    /// Result of `[excitation.scaling]`; none without it.
    pub scaled: Option<Scaled>,
    /// Degree of freedom, from 0, and largest force in N of a table of nodal forces.
    pub peak_nodal_force: Option<(usize, f64)>,
    /// Input for the analysis of modes and delays, for structures that are not too large.
    pub analysis: Option<Analysis>,
    /// Why no margin to a critical delay is watched; none where one is.
    pub no_margin: Option<String>,
    /// The limit of λ as the tangents of the specimens change it; none where it takes too long to find.
    pub online_limit: Option<OnlineLimit>,
    /// b·S⁻¹·bᵀ of every axis of every specimen, at the declared bounds; empty without a proof.
    pub(super) gains: Vec<Vec<f64>>,
}

/// A recorded ground acceleration.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundFacts {
    /// End of the name of its column; empty for the only one.
    pub suffix: String,
    /// Largest absolute value in m/s².
    pub peak: f64,
}

impl GroundFacts {
    pub(super) fn of(ground: &Ground) -> Self {
        let accel = ground.accel.iter();
        Self {
            suffix: ground.suffix.clone(),
            peak: accel.fold(0.0, |most: f64, value| most.max(value.abs())),
        }
    }
}

/// Facts about the reduction of a structure.
#[derive(Debug, Clone)]
pub struct ReductionFacts {
    /// The reduced model.
    pub reduction: Arc<Reduction>,
    /// Kept DOFs that the file names.
    pub named: usize,
    /// Modes with all kept DOFs fixed.
    pub modes: usize,
    pub(super) at_rest: SymMatrix,
    pub(super) mass: SymMatrix,
    pub(super) grounds: Vec<(String, Vec<f64>)>,
}

impl ReductionFacts {
    /// The lowest modes of both models, at rest.
    ///
    /// # Errors
    /// The full model has a motion without stiffness, or its modes are not found.
    pub fn accuracy(&self) -> Result<Accuracy, ReductionError> {
        let of_reduced = [&self.at_rest, &self.mass];
        (self.reduction).accuracy(of_reduced, &self.grounds, COMPARED)
    }
}

/// Facts about a frame under its static loads.
#[derive(Debug, Clone)]
pub struct FrameFacts {
    /// Mass of all nodes in kg.
    pub mass: f64,
    /// Sum of the static loads that act downwards, in N.
    pub weight: f64,
    /// Its members, in the order of the file.
    pub members: Vec<MemberUse>,
    /// Time that its members take in the worst case, in parts of a tick, measured when the test was built; none if no
    /// member is evaluated in each step.
    pub share_of_tick: Option<f64>,
}

/// Damping that a rule of `[structure.damping]` adds along the axes of specimens.
#[derive(Debug, Clone)]
pub enum RuleDamping {
    /// b·k of each axis of each specimen at rest, with its unit; empty where the rule does not refer to the stiffness of the specimen.
    Stiffness(Vec<Vec<(f64, &'static str)>>),
    /// Modal damping, which belongs to the masses.
    Modal,
}

impl StructureFacts {
    /// A degree of freedom, from 0, in words: "DOF 2 (A1 x)".
    #[must_use]
    pub fn dof(&self, dof: usize) -> String {
        match self.places.get(dof) {
            Some(place) => format!("DOF {} ({place})", dof + 1),
            None => format!("DOF {}", dof + 1),
        }
    }

    /// λ, its limit and the part that governs it, where λ has been judged.
    #[must_use]
    pub const fn choice(&self) -> Option<&LambdaChoice> {
        match &self.stability {
            Stability::Limit(choice) => Some(choice),
            _ => None,
        }
    }
}
