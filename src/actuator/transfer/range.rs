//! Refuses a number of a description that is out of its range.

use super::TransferError;

pub(super) fn positive(name: &'static str, found: f64) -> Result<f64, TransferError> {
    inside(name, found, found > 0.0, "finite and greater than 0")
}

pub(super) fn not_negative(name: &'static str, found: f64) -> Result<f64, TransferError> {
    inside(name, found, found >= 0.0, "finite and not negative")
}

pub(super) fn finite(name: &'static str, found: f64) -> Result<f64, TransferError> {
    inside(name, found, true, "finite")
}

fn inside(
    name: &'static str,
    found: f64,
    is_inside: bool,
    allowed: &'static str,
) -> Result<f64, TransferError> {
    if is_inside && found.is_finite() {
        Ok(found)
    } else {
        Err(TransferError::Parameter {
            name,
            found,
            allowed,
        })
    }
}
