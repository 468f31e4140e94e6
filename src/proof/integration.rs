//! Stability of the integration itself, without any delay.

use super::analysis::Analysis;
use super::bound::growing;
use super::criterion::LambdaChoice;

/// The stability of an integration with every tangent up to its declared bound.
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
    /// No proof is made for this method. This is its spectral radius where every tangent is at its declared bound.
    AtBounds(f64),
}

impl Stability {
    /// Growth in a step that is no roundoff: where three poles meet they carry its cube root.
    const GROWTH: f64 = 1e-5;

    /// The largest λ that is stable: infinite if every λ is, 0 if none is; none if it is not known.
    #[must_use]
    pub fn lambda_limit(&self) -> Option<f64> {
        match self {
            Self::Limit(choice) => Some(choice.limit.unwrap_or(f64::INFINITY)),
            Self::NoLambda(_) => Some(0.0),
            Self::NoBound | Self::NoProof | Self::AtBounds(_) => None,
        }
    }

    /// True if the recursion is known to grow at the declared bounds, for a method without a proof.
    #[must_use]
    pub fn grows(&self) -> bool {
        matches!(self, Self::AtBounds(radius) if *radius > 1.0 + Self::GROWTH)
    }
}

/// The growth in continuous time, which no λ changes, in words; none if nothing grows.
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
