//! KR-α and MKR-α where every tangent is at its declared bound. Nothing is proven of them beyond their estimates; but
//! whether their recursion grows there can be seen.

use super::method::Initial;
use super::proof::{advised, bounds};
use super::specimens::Specimens;
use super::{Doubt, Site, Stability, path};
use crate::config::{Finding, Method, Severity};
use crate::linalg::{Spd, SymMatrix};
use crate::model::Structure;
use crate::spectral::{AlphaStep, Weights, spectral_radius};

/// Largest structure that is looked at: eigenvalues of six times as many rows.
const LARGEST: usize = 40;
/// Differences of bound and estimate that are roundoff of their sums.
const ROUNDOFF: f64 = 1e-9;

/// The stability of `method`. Growth and missing proofs become doubts of the site.
pub(super) fn judged(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    method: Method,
    initial: &Initial<'_>,
) -> Stability {
    // What was built with its links has been judged.
    if site.trial.is_some() {
        return Stability::NoProof;
    }
    let rho = site.loaded.file.integrator.rho_infinity;
    let rho = rho.unwrap_or(f64::NAN);
    let (weights, name) = match method {
        Method::KrAlpha => (Weights::kr(rho), "kr_alpha"),
        Method::MkrAlpha => (Weights::mkr(rho), "mkr_alpha"),
        _ => return Stability::NoProof,
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
    let late = specimens.late_mass(structure.dofs());
    let covered = covers(initial.stiffness, &bounds.stiffness)
        && covers(initial.damping, &bounds.damping)
        && late.is_none();
    if covered {
        return Stability::NoProof;
    }
    let at = path("integrator").key("method");
    let radius = if structure.dofs() <= LARGEST {
        let step = AlphaStep {
            weights,
            dt: initial.dt,
            mass: structure.mass().to_dense(),
            initial: (initial.damping.to_dense(), initial.stiffness.to_dense()),
            tangent: (bounds.damping.to_dense(), bounds.stiffness.to_dense()),
            late_mass: late.map(|late| late.to_dense()),
        };
        step.recursion().and_then(|step| spectral_radius(&step))
    } else {
        None
    };
    let Some(radius) = radius else {
        let headline = format!(
            "a tangent stiffness can exceed its estimate, or a force contains delayed inertia; {name} has no proof of \
             stability there"
        );
        let help = "`method = \"gui\"` has a proof at the declared bounds";
        let finding = advised(Finding::error(at, headline).help(help), specimens);
        site.doubts.push(Doubt::Unproven(finding));
        return Stability::NoProof;
    };
    let found = Stability::AtBounds(radius);
    if found.grows() {
        let headline = format!(
            "with every tangent at its declared bound, {name} is unstable: the response grows by a factor of {radius:.6} per step"
        );
        let help = "use `method = \"gui\"`, which chooses a stable lambda, or a smaller step, or a larger estimate of a hardening stiffness";
        let finding = Finding::error(at, headline)
            .number("spectral_radius", radius)
            .help(help);
        site.doubts
            .push(Doubt::Unstable(advised(finding, specimens)));
    }
    found
}

/// True if no tangent up to `bound` is beyond the estimate: the method is then as stable as in a linear structure.
fn covers(estimate: &SymMatrix, bound: &SymMatrix) -> bool {
    let left = estimate.plus(-1.0, bound);
    let largest = |matrix: &SymMatrix| matrix.entries().map(|e| e.2.abs()).fold(0.0, f64::max);
    largest(&left) <= ROUNDOFF * largest(estimate)
        || Spd::factor(&left.plus(ROUNDOFF, estimate)).is_ok()
}
