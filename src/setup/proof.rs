//! λ: asked for by number, or chosen; and the proof that it is stable at the declared bounds.

use super::method::Initial;
use super::specimens::Specimens;
use super::{Doubt, Refused, Site, Stability, path};
use crate::config::{Finding, KeyPath, LambdaValue, Method, Severity};
use crate::integrate::{
    ACCURATE_LAMBDA, Apart, GAIN_HYBRID, GAIN_NUMERICAL, Gui, Lambda, LambdaChoice, OnlineLimit,
    StabilityError, StabilityProof, Start,
};
use crate::linalg::{Spd, SymMatrix};
use crate::model::{ModelError, Part, Structure};

/// λ and what is known of its stability.
pub(super) struct Proven {
    /// λ to use.
    pub lambda: Lambda,
    /// Whether it was asked for by number.
    pub by_number: bool,
    /// What is proven.
    pub stability: Stability,
    /// Gain bound g.
    pub gain: f64,
    /// K_max, if every tangent has a bound.
    pub stiffness_bound: Option<SymMatrix>,
    /// b·S⁻¹·bᵀ of every axis of every specimen, at the declared bounds; empty where S is not definite.
    pub gains: Vec<Vec<f64>>,
    /// The limit as the tangents of the specimens change it.
    pub online: Option<OnlineLimit>,
}

/// Degrees of freedom up to which the limit of λ is found again and again while a test runs: milliseconds each time.
const MOST_ONLINE: usize = 200;

/// Upper bounds of the tangents and who they come from.
pub(super) struct Bounds {
    /// K_max.
    pub stiffness: SymMatrix,
    /// C_max, as it counts in a sawtooth.
    pub damping: SymMatrix,
}

/// Chooses λ, or proves the one that was asked for.
pub(super) fn choose(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    initial: &Initial<'_>,
    apart: Option<&Apart>,
) -> Result<Proven, Refused> {
    let table = &site.loaded.file.integrator;
    let gain = table.gain_bound.unwrap_or(if specimens.is_empty() {
        GAIN_NUMERICAL
    } else {
        GAIN_HYBRID
    });
    let request = match table.lambda {
        LambdaValue::Auto => None,
        LambdaValue::Number(value) => Lambda::new(value).ok(),
        LambdaValue::Infinite => Some(Lambda::Infinite),
    };
    let bounds = match (bounds(site, structure, specimens), request) {
        (Ok(bounds), _) => bounds,
        (Err(finding), None) => {
            let help = "or give `lambda` as a number in [integrator], without a proof of stability";
            return site.refuse((*finding).help(help));
        }
        (Err(finding), Some(lambda)) => {
            let headline = format!("the stability cannot be proven: {}", finding.headline);
            site.warnings.push(Finding {
                headline,
                severity: Severity::Warning,
                ..*finding
            });
            let stiffness_bound = None;
            return Ok(Proven {
                lambda,
                by_number: true,
                stability: Stability::NoBound,
                gain,
                stiffness_bound,
                gains: Vec::new(),
                online: None,
            });
        }
    };
    let proof = StabilityProof {
        mass: structure.mass().clone(),
        damping: initial.damping.clone(),
        stiffness: initial.stiffness.clone(),
        damping_bound: bounds.damping,
        stiffness_bound: bounds.stiffness,
        dt: site.loaded.time.step.value(),
        apart: apart.cloned(),
        late_mass: specimens.late_mass(structure.dofs()),
    };
    let stiffness_bound = Some(proof.stiffness_bound.clone());
    match (
        proof.choose_of(request, gain, &|visit| {
            every_part(structure, specimens, visit);
        }),
        request,
    ) {
        (Ok(choice), _) => {
            if !choice.is_stable() {
                let finding = advised(unstable(&choice), specimens);
                site.doubts.push(Doubt::Unstable(finding));
            }
            let by_number = request.is_some();
            let lambda = choice.lambda;
            Ok(Proven {
                lambda,
                by_number,
                gains: gains(&proof, lambda, specimens),
                stability: Stability::Limit(choice),
                gain,
                stiffness_bound,
                online: online(proof, specimens),
            })
        }
        (Err(error @ StabilityError::Overflow { .. }), _) => {
            let at = largest(structure, specimens);
            site.refuse(Finding::error(at, error.to_string()))
        }
        (Err(error), Some(lambda)) => {
            let why = error.to_string();
            let finding = advised(Finding::error(lambda_path(), why.clone()), specimens);
            site.doubts.push(Doubt::Unstable(finding));
            Ok(Proven {
                lambda,
                by_number: true,
                stability: Stability::NoLambda(why),
                gain,
                stiffness_bound,
                gains: Vec::new(),
                online: None,
            })
        }
        (Err(error), None) => {
            // What no λ can mend is no matter of λ. A direction that the smallest share of K0 leaves without effective
            // mass is without it for every smaller λ too.
            let lambda = Lambda::Finite(ACCURATE_LAMBDA);
            let (mass, start) = (structure.mass(), Start::Published);
            let (damping, stiffness) = (initial.damping, initial.stiffness);
            if let Err(error) = Gui::new(mass, damping, stiffness, proof.dt, lambda, start) {
                let finding = super::structure::not_definite(site, mass, &error);
                return site.refuse(finding);
            }
            let finding = Finding::error(lambda_path(), error.to_string());
            let finding = finding.help(if apart.is_some() {
                "choose a smaller lambda where a separate one is set, a smaller step, or a larger estimate of a hardening stiffness"
            } else {
                "choose a smaller step, or a larger estimate of a hardening stiffness"
            });
            site.refuse(advised(finding, specimens))
        }
    }
}

/// The limit as the tangents of the specimens change it, where it is quick to find.
fn online(proof: StabilityProof, specimens: &Specimens) -> Option<OnlineLimit> {
    let parts = specimens.parts();
    let wanted = !parts.is_empty() && proof.mass.n() <= MOST_ONLINE;
    wanted.then(|| OnlineLimit::new(proof, parts).with_sawtooths(specimens.sawtooths()))
}

/// How soft S(λ) is along every axis: the room that is left for tangents beyond their bounds.
fn gains(proof: &StabilityProof, lambda: Lambda, specimens: &Specimens) -> Vec<Vec<f64>> {
    if specimens.is_empty() {
        return Vec::new();
    }
    let Ok(mut stability) = Spd::factor(&proof.matrix(lambda, f64::INFINITY)) else {
        return Vec::new();
    };
    let mut gain = |row: &[(usize, f64)]| {
        let mut shape = vec![0.0; proof.mass.n()];
        for (dof, entry) in row {
            shape[*dof] += entry;
        }
        stability.solve_in_place(&mut shape);
        row.iter().map(|(dof, entry)| entry * shape[*dof]).sum()
    };
    let specimens = specimens.loops();
    specimens
        .map(|specimen| specimen.rows.iter().map(|row| gain(row)).collect())
        .collect()
}

fn lambda_path() -> KeyPath {
    path("integrator").key("lambda")
}

/// Warns if a method of bounded stability is beyond its bound at the declared tangents: those of Newmark are stable
/// exactly where the member of the family with their poles is, K0 and C0 following the tangents. Nothing is said here of
/// the others, and nothing where a tangent has no bound.
pub(super) fn warn_of_limit(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    method: Method,
) {
    let (lambda, name) = match method {
        Method::NewmarkLinear => (
            Lambda::Finite(6.0),
            "linear acceleration is stable to Ω = √12",
        ),
        Method::NewmarkExplicit | Method::CentralDifference => {
            (Lambda::Infinite, "this method is stable to Ω = 2")
        }
        Method::Gui
        | Method::NewmarkAverage
        | Method::Chang2002
        | Method::KrAlpha
        | Method::MkrAlpha => return,
    };
    let Ok(bounds) = bounds(site, structure, specimens) else {
        return;
    };
    let proof = StabilityProof {
        mass: structure.mass().clone(),
        damping: bounds.damping.clone(),
        stiffness: bounds.stiffness.clone(),
        damping_bound: bounds.damping,
        stiffness_bound: bounds.stiffness,
        dt: site.loaded.time.step.value(),
        apart: None,
        late_mass: specimens.late_mass(structure.dofs()),
    };
    if !proof.holds(lambda) {
        let headline = format!(
            "{name}, and at the declared stiffness a mode of this structure exceeds it: the response can grow as a sawtooth \
             of period 2 steps"
        );
        site.warnings
            .push(Finding::warning(path("integrator").key("method"), headline));
    }
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

/// With what of the specimens counts for more than it seems to.
pub(super) fn advised(mut finding: Finding, specimens: &Specimens) -> Finding {
    if let Some(name) = specimens.overcounted().first() {
        finding = finding.help(format!(
            "specimen \"{name}\" has damping and moves between the steps: in a sawtooth its damping counts at least twice; \
             with `prediction_order = 1` in [time] it counts once"
        ));
    }
    if let Some(name) = specimens.heavy() {
        finding = finding.help(format!(
            "the inertia in the force of specimen \"{name}\" is one step late: its `mass_in_force_kg` reduces the effective \
             mass of the structure"
        ));
    }
    finding
}

/// The table of what is largest in the proof: the structure, one of its elements or a specimen.
fn largest(structure: &Structure, specimens: &Specimens) -> KeyPath {
    let matrices = [structure.mass(), structure.stiffness(), structure.damping()];
    let entries = matrices.into_iter().flat_map(|matrix| matrix.entries());
    let mut size = entries.fold(0.0, |size: f64, (_, _, value)| size.max(value.abs()));
    let mut at = path("structure");
    let _ = structure.for_each_part(&mut |part| {
        let found = part.stiffness_bound.max(part.damping_bound);
        let index = structure.element_names().position(|name| name == part.name);
        if let Some(index) = index.filter(|_| found > size) {
            (size, at) = (found, path("structure").key("element").index(index));
        }
    });
    for (index, found) in specimens.sizes().enumerate() {
        if found > size {
            (size, at) = (found, path("specimen").index(index));
        }
    }
    at
}

/// Storeys, elements and specimens; those of a structure whose bounds are known.
fn every_part(structure: &Structure, specimens: &Specimens, visit: &mut dyn FnMut(&Part)) {
    // Without bounds there is no proof, and nobody asks.
    let _ = structure.for_each_part(visit);
    specimens.parts().iter().for_each(visit);
}

/// K_max and C_max of the whole, or a finding about whose bound is missing.
pub(super) fn bounds(
    site: &Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
) -> Result<Bounds, Box<Finding>> {
    let n = structure.dofs();
    let own = structure
        .bound_stiffness()
        .and_then(|stiffness| Ok((stiffness, structure.bound_damping()?)));
    let (stiffness, damping) = own.map_err(|error| {
        let at = path("structure").key("element");
        let index = match &error {
            ModelError::NoBound { element, .. } => structure
                .element_names()
                .position(|name| *name == **element),
            _ => None,
        };
        let listed = site
            .loaded
            .file
            .structure
            .as_ref()
            .map_or(0, |table| table.element.len());
        match index.filter(|index| *index < listed) {
            Some(index) => Box::new(Finding::error(at.index(index), error.to_string())),
            None => Box::new(Finding::error(path("structure"), error.to_string())),
        }
    })?;
    let (of_specimens, damping_of_specimens) = specimens.bounds(n).map_err(|index| {
        let name = site
            .loaded
            .file
            .specimen
            .get(index)
            .map_or("", |table| &table.name);
        let text = format!(
            "specimen \"{name}\": the tangent stiffness of its law has no bound unless its range of motion is declared"
        );
        let help = "give the largest motion as `reach_disp_m` (and `reach_vel_m_per_s` for a damper)";
        Box::new(Finding::error(path("specimen").index(index), text).help(help))
    })?;
    let mut infinite = None;
    every_part(structure, specimens, &mut |part| {
        if infinite.is_none()
            && !(part.stiffness_bound.is_finite() && part.damping_bound.is_finite())
        {
            infinite = Some(part.clone());
        }
    });
    if let Some(part) = infinite {
        let text = format!("{}: the tangent has no finite bound", part.name);
        let index = structure.element_names().position(|name| name == part.name);
        let at = match index {
            Some(index) => path("structure").key("element").index(index),
            None => path("specimen"),
        };
        let help = "declare a `damping_ratio`, or `linear_below_m_per_s` for a power damper";
        return Err(Box::new(Finding::error(at, text).help(help)));
    }
    Ok(Bounds {
        stiffness: stiffness.plus(1.0, &of_specimens),
        damping: damping.plus(1.0, &damping_of_specimens),
    })
}
