//! Verdicts: may this test move its specimens?
//!
//! A [`Verdict`] is a list of findings. Each finding has a kind, a severity, a configuration key, numbers and advice. The loop
//! may be unstable because of λ, of a delay, or of an actuator without sufficient compensation. [`Following`] proves that for
//! each specimen behind a declared actuator. The session adds the findings of a rehearsal. `check` prints the verdict, and
//! every command that moves a specimen obeys it before anything connects. Nothing here moves, reads a file or knows a clock.

mod axes;
mod bound;
mod following;
mod integration;
mod together;
mod verdict;

pub use bound::{DelayBound, DelayBounds, DelayCondition};
pub use following::Following;
pub use integration::{grows, is_stable};
pub use verdict::{Judgement, Verdict};

use crate::units::duration;

/// What grows in continuous time with nothing delayed.
#[must_use]
pub fn growing(per_second: f64) -> String {
    format!(
        "it grows by a factor e in {} of continuous time",
        duration(per_second.recip())
    )
}

/// What grows in the recursion with nothing delayed.
#[must_use]
pub fn diverging(radius: f64) -> String {
    format!("it grows by a factor {radius:.6} in a step of the recursion at this Δt and λ")
}

/// Why any delay is too long.
pub const INERTIA: &str = "the inertia inside the specimen's force is as much as the mass that it acts on, and with any delay, \
     however short, it grows";
