//! λ of a test, chosen or requested, and the proof of its stability.

use super::analysis::Attached;
use super::criterion::{LambdaChoice, Parts, StabilityError, StabilityProof, Tangents};
use super::integration::Stability;
use super::kind::Kind;
use super::online::OnlineLimit;
use gusset_numerics::integrate::Lambda;
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::Part;
use gusset_quantity::finding::{Finding, KeyPath};

/// Degrees of freedom up to which the limit of λ is found again and again while a test runs: milliseconds each time.
const MOST_ONLINE: usize = 200;

/// λ and the proof of its stability.
#[derive(Debug)]
pub struct Proven {
    /// λ to use.
    pub lambda: Lambda,
    /// Whether it was requested by number.
    pub by_number: bool,
    /// The proof.
    pub stability: Stability,
    /// Gain bound g.
    pub gain: f64,
    /// K_max, if every tangent has a bound.
    pub stiffness_bound: Option<SymMatrix>,
    /// b·S⁻¹·bᵀ of every axis of every specimen, at the declared bounds; empty where S is not definite.
    pub gains: Vec<Vec<f64>>,
    /// The limit as the tangents of the specimens change it.
    pub online: Option<OnlineLimit>,
    /// The finding on λ, if there is one.
    pub doubt: Option<(Kind, Finding)>,
}

/// The request of the user.
#[derive(Debug, Clone, Copy)]
pub struct Request {
    /// λ; none: chosen automatically.
    pub lambda: Option<Lambda>,
    /// Gain bound g.
    pub gain: f64,
}

/// The specimens in a proof.
#[derive(Debug, Clone, Default)]
pub struct SpecimenShare {
    /// Each specimen in the structure.
    pub attached: Vec<Attached>,
    /// Share of each axis in K_max and C_max.
    pub parts: Vec<Part>,
    /// How much of the damping of each of these axes counts in a sawtooth.
    pub sawtooths: Vec<f64>,
    /// Advice on specimens that burden the proof.
    pub advice: Advice,
}

/// Names of the specimens that burden a proof more than they seem to.
#[derive(Debug, Clone, Default)]
pub struct Advice {
    /// The first that is damped and moves between the steps.
    pub overcounted: Option<String>,
    /// The first with inertia inside its force.
    pub heavy: Option<String>,
}

impl Advice {
    /// Adds the advice to a finding.
    #[must_use]
    pub fn on(&self, mut finding: Finding) -> Finding {
        if let Some(name) = &self.overcounted {
            finding = finding.help(format!(
                "specimen \"{name}\" has damping and moves between the steps: in a sawtooth its damping counts at least twice; \
                 with `prediction_order = 1` in [time] it counts once"
            ));
        }
        if let Some(name) = &self.heavy {
            finding = finding.help(format!(
                "the inertia in the force of specimen \"{name}\" is one step late: its `mass_in_force_kg` reduces the effective \
                 mass of the structure"
            ));
        }
        finding
    }
}

impl Proven {
    /// A requested λ without a proof.
    #[must_use]
    pub const fn without_bound(lambda: Lambda, gain: f64) -> Self {
        Self {
            lambda,
            by_number: true,
            stability: Stability::NoBound,
            gain,
            stiffness_bound: None,
            gains: Vec::new(),
            online: None,
            doubt: None,
        }
    }

    /// Chooses λ, or checks the one that is requested. `parts` are those of structure and specimens.
    ///
    /// # Errors
    /// No λ can be chosen. A requested λ is kept, with a doubt, unless the matrices overflow.
    pub fn of(
        proof: StabilityProof,
        request: Request,
        specimens: SpecimenShare,
        parts: Parts<'_>,
    ) -> Result<Self, StabilityError> {
        let Request { lambda, gain } = request;
        let stiffness_bound = Some(proof.stiffness_bound.clone());
        match (proof.choose_of(lambda, gain, parts), lambda) {
            (Ok(choice), _) => {
                let unstable = (!choice.is_stable()).then(|| unstable(&choice));
                Ok(Self {
                    lambda: choice.lambda,
                    by_number: lambda.is_some(),
                    gains: gains(&proof, choice.lambda, &specimens.attached),
                    stability: Stability::Limit(choice),
                    gain,
                    stiffness_bound,
                    doubt: unstable.map(|found| (Kind::Unstable, specimens.advice.on(found))),
                    online: online(proof, specimens),
                })
            }
            (Err(error @ StabilityError::NoneAdmissible { .. }), Some(lambda)) => {
                let why = error.to_string();
                let finding = Finding::error(lambda_path(), why.clone());
                Ok(Self {
                    stability: Stability::NoLambda(why),
                    stiffness_bound,
                    doubt: Some((Kind::Unstable, specimens.advice.on(finding))),
                    ..Self::without_bound(lambda, gain)
                })
            }
            (Err(error), _) => Err(error),
        }
    }
}

/// The limit as the tangents of the specimens change it, where it is quick to find.
fn online(proof: StabilityProof, specimens: SpecimenShare) -> Option<OnlineLimit> {
    let SpecimenShare {
        parts, sawtooths, ..
    } = specimens;
    let wanted = !parts.is_empty() && proof.mass.n() <= MOST_ONLINE;
    wanted.then_some(OnlineLimit {
        proof,
        axes: parts,
        sawtooths,
    })
}

/// How soft S(λ) is along every axis: the room that is left for tangents beyond their bounds.
fn gains(proof: &StabilityProof, lambda: Lambda, specimens: &[Attached]) -> Vec<Vec<f64>> {
    if specimens.is_empty() {
        return Vec::new();
    }
    let Some((mut stability, mut tangents)) = proof.factor(lambda) else {
        return Vec::new();
    };
    let mut gain = |row: &[(usize, f64)]| {
        let row = match &mut tangents {
            Tangents::Whole => row.to_vec(),
            Tangents::Condensed(_, condensation) => condensation.row(row),
        };
        let mut shape = vec![0.0; proof.mass.n() - proof.massless.len()];
        for (dof, entry) in &row {
            shape[*dof] += entry;
        }
        stability.solve_in_place(&mut shape);
        row.iter().map(|(dof, entry)| entry * shape[*dof]).sum()
    };
    let each = specimens.iter();
    each.map(|specimen| specimen.rows.iter().map(|row| gain(row)).collect())
        .collect()
}

/// The key of λ.
#[must_use]
pub fn lambda_path() -> KeyPath {
    KeyPath::root().key("integrator").key("lambda")
}

fn unstable(choice: &LambdaChoice) -> Finding {
    let limit = choice.limit.unwrap_or(f64::INFINITY);
    let cause = choice
        .governing
        .as_ref()
        .map(|g| format!(", set by {g}"))
        .unwrap_or_default();
    let headline = format!(
        "lambda = {} is above the limit {limit:.4} at the declared stiffness{cause}: the response can grow as a sawtooth of \
         period 2 steps",
        choice.lambda
    );
    Finding::error(lambda_path(), headline)
        .number("lambda", choice.lambda.value())
        .number("lambda_limit", limit)
        .help("`lambda = \"auto\"` chooses a stable one")
}
