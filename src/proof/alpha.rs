//! KR-α and MKR-α where every tangent is at its declared bound.
//!
//! Nothing is proven of these methods beyond their estimates. Whether their recursion grows there can be computed.

use super::criterion::StabilityProof;
use super::integration::Stability;
use super::kind::Kind;
use super::lambda::Advice;
use gusset_numerics::integrate::AlphaWeights;
use gusset_numerics::linalg::{Spd, SymMatrix};
use gusset_numerics::spectral::{AlphaStep, spectral_radius};
use gusset_quantity::finding::{Finding, KeyPath};

/// Largest structure that is examined: eigenvalues of six times as many rows.
const LARGEST: usize = 40;
/// Differences of bound and estimate that are roundoff of their sums.
const ROUNDOFF: f64 = 1e-9;

/// The stability of the method called `name` with these `weights`, and the finding on it, if there is one. K0, C0 and the
/// bounds are those of `proof`.
#[must_use]
pub fn alpha_stability(
    proof: &StabilityProof,
    (weights, name): (AlphaWeights, &str),
    advice: &Advice,
) -> (Stability, Option<(Kind, Finding)>) {
    let covered = covers(&proof.stiffness, &proof.stiffness_bound)
        && covers(&proof.damping, &proof.damping_bound)
        && proof.late_mass.is_none();
    if covered {
        return (Stability::NoProof, None);
    }
    let at = KeyPath::root().key("integrator").key("method");
    let Some(radius) = radius(proof, weights) else {
        let headline = format!(
            "a tangent stiffness can exceed its estimate, or a force contains delayed inertia; {name} has no proof of \
             stability there"
        );
        let help = "`method = \"gui\"` has a proof at the declared bounds";
        let finding = advice.on(Finding::error(at, headline).help(help));
        return (Stability::NoProof, Some((Kind::Unproven, finding)));
    };
    let found = Stability::AtBounds(radius);
    let doubt = found.grows().then(|| {
        let headline = format!(
            "with every tangent at its declared bound, {name} is unstable: the response grows by a factor of {radius:.6} per step"
        );
        let help = "use `method = \"gui\"`, which chooses a stable lambda, or a smaller step, or a larger estimate of a hardening stiffness";
        let finding = Finding::error(at, headline)
            .number("spectral_radius", radius)
            .help(help);
        (Kind::Unstable, advice.on(finding))
    });
    (found, doubt)
}

/// Spectral radius of the recursion at the bounds; none if it is not known.
fn radius(proof: &StabilityProof, weights: AlphaWeights) -> Option<f64> {
    if proof.mass.n() > LARGEST {
        return None;
    }
    let step = AlphaStep {
        weights,
        dt: proof.dt,
        mass: proof.mass.to_dense(),
        initial: (proof.damping.to_dense(), proof.stiffness.to_dense()),
        tangent: (
            proof.damping_bound.to_dense(),
            proof.stiffness_bound.to_dense(),
        ),
        late_mass: proof.late_mass.as_ref().map(SymMatrix::to_dense),
    };
    step.recursion().and_then(|step| spectral_radius(&step))
}

/// True if no tangent up to `bound` is beyond the estimate: the method is then as stable as in a linear structure.
fn covers(estimate: &SymMatrix, bound: &SymMatrix) -> bool {
    let left = estimate.plus(-1.0, bound);
    let largest = |matrix: &SymMatrix| matrix.entries().map(|e| e.2.abs()).fold(0.0, f64::max);
    largest(&left) <= ROUNDOFF * largest(estimate)
        || Spd::factor(&left.plus(ROUNDOFF, estimate)).is_ok()
}
