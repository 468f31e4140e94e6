//! λ of a test file: requested by number, or chosen, with its proof at the declared bounds.

use super::method::Initial;
use super::specimens::Specimens;
use super::{Refused, Site, path};
use gusset_config::{Finding, LambdaValue, Method, Severity};
use gusset_numerics::integrate::{
    AlphaWeights, Gui, GuiError, Lambda, Massless, MasslessBounds, Start,
};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::{ModelError, Part, Structure};
use gusset_proof::{
    ACCURATE_LAMBDA, GAIN_HYBRID, GAIN_NUMERICAL, Proven, Request, Stability, StabilityError,
    StabilityProof, alpha_stability, lambda_path,
};
use gusset_quantity::finding::KeyPath;

/// Upper bounds of the tangents.
struct Bounds {
    /// K_max.
    stiffness: SymMatrix,
    /// C_max, as it counts in a sawtooth.
    damping: SymMatrix,
}

/// Shares of the damping at rest that are tried.
const SHARES: [f64; 5] = [0.0, 0.0625, 0.125, 0.25, 0.5];
/// Share of the damping at rest by which the proof must hold beyond its bound, so that small motions do not alternate.
const MARGIN: f64 = 0.25;

/// C0 with a share of the damping that acts around rest only, and this share; none without such damping. It is the given share, or
/// the least one with which λ is proven as with all of it. The estimates of the specimens have the same share.
pub(super) fn damping(
    site: &Site<'_>,
    structure: &Structure,
    specimens: &mut Specimens,
    stiffness: &SymMatrix,
) -> (SymMatrix, Option<f64>) {
    let table = &site.loaded.file.integrator;
    let n = structure.dofs();
    let full = structure
        .reference_damping()
        .plus(1.0, &specimens.damping(n));
    let at_rest = structure
        .rest_damping()
        .plus(1.0, &specimens.rest_damping(n));
    if table.method != Method::Gui || at_rest.is_zero() {
        return (full, None);
    }
    let with = |share: f64| full.plus(share - 1.0, &at_rest);
    let given = table.rest_damping_share;
    let share = given.unwrap_or_else(|| {
        let request = (&full, &at_rest, stiffness);
        let is_proven = share_is_proven(site, structure, specimens, request);
        let proven = SHARES.into_iter().find(|share| is_proven(&with(*share)));
        proven.unwrap_or(1.0)
    });
    specimens.keep_rest_damping(share);
    (with(share), Some(share))
}

/// Whether λ is proven with a C0 as with all of the damping at rest, and beyond it.
fn share_is_proven(
    site: &Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    (full, at_rest, stiffness): (&SymMatrix, &SymMatrix, &SymMatrix),
) -> impl Fn(&SymMatrix) -> bool {
    let table = &site.loaded.file.integrator;
    let gain = table.gain_bound.unwrap_or(if specimens.is_empty() {
        GAIN_NUMERICAL
    } else {
        GAIN_HYBRID
    });
    let limit = move |damping: &SymMatrix, margin: f64| {
        let mut bounds = bounds(site, structure, specimens).ok()?;
        bounds.damping = bounds.damping.plus(margin, at_rest);
        let initial = Initial {
            damping,
            stiffness,
            dt: site.loaded.time.step.value(),
        };
        let late_mass = specimens.late_mass(structure.dofs());
        let proof = bounds.proof(Method::Gui, structure, &initial, late_mass);
        let limit = proof.limit(gain, &[]).ok()?;
        Some(limit.unwrap_or(f64::INFINITY))
    };
    let lambda = match table.lambda {
        LambdaValue::Auto => limit(full, 0.0).map(|limit| limit.min(ACCURATE_LAMBDA)),
        LambdaValue::Number(value) => Some(value),
        LambdaValue::Infinite => Some(f64::INFINITY),
    };
    move |damping: &SymMatrix| {
        let limit = limit(damping, MARGIN);
        limit
            .zip(lambda)
            .is_some_and(|(limit, lambda)| limit >= lambda)
    }
}

/// Chooses λ, or proves the one that was asked for.
pub(super) fn choose(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    initial: &Initial<'_>,
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
            return Ok(Proven::without_bound(lambda, gain));
        }
    };
    let late_mass = specimens.late_mass(structure.dofs());
    let proof = bounds.proof(Method::Gui, structure, initial, late_mass);
    let wanted = Request {
        lambda: request,
        gain,
    };
    let share = specimens.share();
    match Proven::of(proof, wanted, share, &|visit| {
        every_part(structure, specimens, visit);
    }) {
        Ok(mut proven) => {
            site.doubts.extend(proven.doubt.take());
            Ok(proven)
        }
        Err(error @ StabilityError::Overflow { .. }) => {
            let at = largest(structure, specimens);
            site.refuse(Finding::error(at, error.to_string()))
        }
        Err(error) => {
            // Where no λ helps, the structure is at fault. A direction that the smallest share of K0 leaves without effective
            // mass lacks it for every smaller λ too.
            let lambda = Lambda::Finite(ACCURATE_LAMBDA);
            let (mass, start) = (structure.mass(), Start::Published);
            let (damping, stiffness) = (initial.damping, initial.stiffness);
            if let Err(error) = Gui::new(mass, damping, stiffness, initial.dt, lambda, start) {
                let finding = super::structure::not_definite(site, mass, &error);
                return site.refuse(finding);
            }
            let finding = Finding::error(lambda_path(), error.to_string());
            let help = "choose a smaller step, or a larger estimate of a hardening stiffness";
            let finding = finding.help(help);
            site.refuse(specimens.advice().on(finding))
        }
    }
}

impl Bounds {
    /// The proof at these bounds, K0 and C0 being those of M_eff.
    fn proof(
        self,
        method: Method,
        structure: &Structure,
        initial: &Initial<'_>,
        late_mass: Option<SymMatrix>,
    ) -> StabilityProof {
        StabilityProof {
            mass: structure.mass().clone(),
            damping: initial.damping.clone(),
            stiffness: initial.stiffness.clone(),
            damping_bound: self.damping,
            stiffness_bound: self.stiffness,
            dt: initial.dt,
            late_mass,
            massless: super::structure::followed(method, structure),
        }
    }
}

/// What moves the degrees of freedom without mass, if there are any. Refuses a specimen on them.
pub(super) fn massless(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    dt: f64,
) -> Result<Option<Massless>, Refused> {
    let rows = structure.massless();
    if rows.is_empty() {
        return Ok(None);
    }
    for (index, attached) in specimens.attached().iter().enumerate() {
        let mut entries = attached.rows.iter().flatten();
        let on = |(dof, b): &&(usize, f64)| *b != 0.0 && rows.binary_search(dof).is_ok();
        if let Some((dof, _)) = entries.find(on) {
            let text = format!(
                "specimen \"{}\" moves with DOF {}, which has no mass: its force comes a step too late there",
                attached.name,
                dof + 1
            );
            let at = path("specimen").index(index);
            let help = "give this DOF the mass that it has; a law that is only computed can be a `[[structure.element]]`";
            return site.refuse(Finding::error(at, text).help(help));
        }
    }
    let bounds = match bounds(site, structure, specimens) {
        Ok(bounds) => bounds,
        Err(finding) => {
            let help = "degrees of freedom without mass follow by the bounds of all tangents";
            return site.refuse((*finding).help(help));
        }
    };
    let bounds = MasslessBounds {
        stiffness: bounds.stiffness,
        damping: bounds.damping,
    };
    Massless::new(structure, bounds, dt).or_else(|error| {
        let error = GuiError::EffectiveMass(error);
        let finding = super::structure::not_definite(site, structure.mass(), &error);
        site.refuse(finding)
    })
}

/// The stability of KR-α and MKR-α at the declared bounds. Growth and missing proofs become doubts of the site.
pub(super) fn of_alpha(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    method: Method,
    initial: &Initial<'_>,
) -> Stability {
    // A trial is judged already: with its links.
    if site.trial.is_some() {
        return Stability::NoProof;
    }
    let rho = site.loaded.file.integrator.rho_infinity;
    let rho = rho.unwrap_or(f64::NAN);
    let weighted = match method {
        Method::KrAlpha => AlphaWeights::kr(rho).map(|weights| (weights, "kr_alpha")),
        Method::MkrAlpha => AlphaWeights::mkr(rho).map(|weights| (weights, "mkr_alpha")),
        _ => return Stability::NoProof,
    };
    // A ρ that is refused is a mistake of the method.
    let Ok(weighted) = weighted else {
        return Stability::NoProof;
    };
    let bounds = match bounds(site, structure, specimens) {
        Ok(bounds) => bounds,
        Err(finding) => {
            site.warnings.push(Finding {
                headline: format!("stability is unknown: {}", finding.headline),
                severity: Severity::Warning,
                ..*finding
            });
            return Stability::NoBound;
        }
    };
    let late_mass = specimens.late_mass(structure.dofs());
    let proof = bounds.proof(method, structure, initial, late_mass);
    let (stability, doubt) = alpha_stability(&proof, weighted, &specimens.advice());
    site.doubts.extend(doubt);
    stability
}

/// Warns if a method of bounded stability is beyond its bound at the declared tangents: those of Newmark are stable
/// exactly where the member of the family with their poles is, K0 and C0 following the tangents. It judges no other
/// method, and no tangent without a bound.
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
    // The estimates follow the tangents.
    let (damping, stiffness) = (bounds.damping.clone(), bounds.stiffness.clone());
    let initial = Initial {
        damping: &damping,
        stiffness: &stiffness,
        dt: site.loaded.time.step.value(),
    };
    let late_mass = specimens.late_mass(structure.dofs());
    let proof = bounds.proof(method, structure, &initial, late_mass);
    if !proof.holds(lambda) {
        let headline = format!(
            "{name}, and at the declared stiffness a mode of this structure exceeds it: the response can grow as a sawtooth \
             of period 2 steps"
        );
        site.warnings
            .push(Finding::warning(path("integrator").key("method"), headline));
    }
}

/// The table of the largest part in the proof: the structure, one of its elements or a specimen.
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
    // Without bounds there is no proof, and this is never called.
    let _ = structure.for_each_part(visit);
    specimens.parts().iter().for_each(visit);
}

/// K_max and C_max of the whole, or a finding about whose bound is missing.
fn bounds(
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
        let help = "declare a `damping_ratio`, or `linear_below_m_per_s` for a power damper; or give `integrator.lambda` as a number, without a proof";
        return Err(Box::new(Finding::error(at, text).help(help)));
    }
    Ok(Bounds {
        stiffness: stiffness.plus(1.0, &of_specimens),
        damping: damping.plus(1.0, &damping_of_specimens),
    })
}
