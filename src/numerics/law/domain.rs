//! The domains of parameters: every number of a description is checked here before it builds a law.
//!
//! Checks are written as "is inside", so that NaN fails them. Not on the real-time path, except [`declared`].

use super::LawError;
pub(super) use gusset_quantity::domain::{OutOfDomain, finite, inside, not_negative, positive};

/// 0 to 1, both included.
pub(super) fn fraction(name: &'static str, found: f64) -> Result<f64, OutOfDomain> {
    inside(name, found, (0.0..=1.0).contains(&found), "from 0 to 1")
}

/// A value that the user gives, or the tangent at the origin where that is finite and positive.
pub(super) fn reference(
    name: &'static str,
    given: Option<f64>,
    at_origin: f64,
) -> Result<f64, LawError> {
    match given {
        Some(value) => Ok(positive(name, value)?),
        None if at_origin > 0.0 && at_origin.is_finite() => Ok(at_origin),
        None => Err(LawError::ReferenceNeeded { name }),
    }
}

/// Force over stiffness, where that is a number to compute with.
pub(super) fn yield_disp(
    force_name: &'static str,
    force: f64,
    stiffness: f64,
) -> Result<f64, OutOfDomain> {
    let disp = force / stiffness;
    inside(
        force_name,
        force,
        disp.is_normal() && disp < 1e100,
        "in a sane proportion to the stiffness",
    )?;
    Ok(disp)
}

/// A declared reach, if it is one. Real-time: yes.
pub(super) fn declared(reach: Option<f64>) -> Option<f64> {
    reach.filter(|value| *value >= 0.0 && value.is_finite())
}
