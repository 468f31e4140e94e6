//! The domain of a number that a user gives: each check names the key, the number and what is allowed.
//!
//! A check says what is inside, so that NaN fails it.

use thiserror::Error;

/// A number outside its domain.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{name} is {found}, but must be {allowed}")]
pub struct OutOfDomain {
    /// The key, as the test file spells it.
    pub name: &'static str,
    /// The value given.
    pub found: f64,
    /// The domain, in words.
    pub allowed: &'static str,
}

/// `found`, if it is finite and `is_inside` holds.
pub fn inside(
    name: &'static str,
    found: f64,
    is_inside: bool,
    allowed: &'static str,
) -> Result<f64, OutOfDomain> {
    if is_inside && found.is_finite() {
        Ok(found)
    } else {
        Err(OutOfDomain {
            name,
            found,
            allowed,
        })
    }
}

/// `found`, if it is finite.
pub fn finite(name: &'static str, found: f64) -> Result<f64, OutOfDomain> {
    inside(name, found, true, "finite")
}

/// `found`, if it is finite and greater than 0.
pub fn positive(name: &'static str, found: f64) -> Result<f64, OutOfDomain> {
    inside(name, found, found > 0.0, "finite and greater than 0")
}

/// `found`, if it is finite and at least 0.
pub fn not_negative(name: &'static str, found: f64) -> Result<f64, OutOfDomain> {
    inside(name, found, found >= 0.0, "finite and not negative")
}
