//! Stability of the integration itself, without any delay.

use super::analysis::Analysis;
use super::bound::growing;
use super::criterion::LambdaChoice;

/// What is known of the stability of an integration with every tangent up to its declared bound.
#[derive(Debug, Clone, PartialEq)]
pub enum Stability {
    /// λ, its limit and what governs it.
    Limit(LambdaChoice),
    /// No λ is stable there, for this reason.
    NoLambda(String),
    /// Nothing is proven: a tangent has no declared bound.
    NoBound,
    /// No proof is made for this method.
    NoProof,
    /// Nor for this one; but this is its spectral radius where every tangent is at its declared bound.
    AtBounds(f64),
}

impl Stability {
    /// Growth in a step that is no roundoff: where three poles meet they carry its cube root.
    const GROWTH: f64 = 1e-5;

    /// True if the recursion is known to grow at the declared bounds, for a method without a proof.
    #[must_use]
    pub fn grows(&self) -> bool {
        matches!(self, Self::AtBounds(radius) if *radius > 1.0 + Self::GROWTH)
    }
}

/// What grows in continuous time whatever λ is, in words, if anything does.
#[must_use]
pub fn grows(analysis: Option<&Analysis>) -> Option<String> {
    let growth = analysis?.growth()?;
    Some(format!("UNSTABLE: {}", growing(growth)))
}

/// Whether the integration is stable; none where that is not known.
#[must_use]
pub fn is_stable(stability: &Stability, analysis: Option<&Analysis>) -> Option<bool> {
    if grows(analysis).is_some() {
        return Some(false);
    }
    match stability {
        Stability::Limit(choice) => Some(choice.is_stable()),
        Stability::NoLambda(_) => Some(false),
        found => found.grows().then_some(false),
    }
}
