//! Stability of the integration itself, without any delay.

use super::growing;
use crate::setup::{Stability, StructureFacts};

/// What grows in continuous time whatever λ is, in words, if anything does.
#[must_use]
pub fn grows(structure: &StructureFacts) -> Option<String> {
    let growth = structure.analysis.as_ref()?.growth()?;
    Some(format!("UNSTABLE: {}", growing(growth)))
}

/// Whether the integration is stable; none where that is not known.
#[must_use]
pub fn is_stable(structure: &StructureFacts) -> Option<bool> {
    if grows(structure).is_some() {
        return Some(false);
    }
    match &structure.stability {
        Stability::Limit(choice) => Some(choice.is_stable()),
        Stability::NoLambda(_) => Some(false),
        found => found.grows().then_some(false),
    }
}
