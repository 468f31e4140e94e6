//! Stability: every proof about λ, delay and tracking, and the verdict on a test.
//!
//! [`StabilityProof`] proves λ: S(λ) ⪰ 0 at the declared bounds of all tangents (Gui et al. 2014, equations 33 and 41).
//! [`Analysis`] holds the structure at rest. Its loops give the critical delay of each specimen, in continuous time by the
//! frequency of unit gain and by the spectral radius of the recursion. [`Following`] counts the roots of a loop with a declared
//! actuator and compensation by the winding number of its determinant. [`Verdict`] collects the findings: severity, kind,
//! configuration key, numbers, advice.
//! Not proven: compensation that adapts or feeds back, tangents beyond their declared bounds, structures above the stated
//! sizes, and KR-α beyond its estimates. Such cases are findings of kind [`Kind::Unknown`] or [`Kind::Unproven`].
//! Begin reading with [`Verdict`].
//! Inputs are plain values. Nothing here reads a file, a clock or a thread.

mod actuator;
mod alpha;
mod analysis;
mod axes;
mod bound;
mod case;
mod criterion;
mod critical;
mod curves;
mod errors;
mod following;
mod integration;
mod kind;
mod lambda;
mod online;
mod recorded;
mod roots;
mod spectrum;
mod state;
mod tables;
mod together;
mod verdict;

pub use actuator::{Actuator, Machine};
pub use alpha::alpha_stability;
pub use analysis::{Analysis, AtRest, Attached, DelayedMode, Loop, Matrices, ModeFacts};
pub use bound::{DelayBound, DelayBounds, DelayCondition, INERTIA, growing};
pub use case::{Accepts, Case};
pub use criterion::{
    ACCURATE_LAMBDA, GAIN_HYBRID, GAIN_NUMERICAL, Governing, LambdaChoice, Parts, Place,
    StabilityError, StabilityProof,
};
pub use critical::CriticalDelay;
pub use curves::{Curve, Diagram, diagrams};
pub use errors::{AddedDamping, DriftError, Errors, TestError, added_damping, per_cent};
pub use following::Following;
pub use integration::{Stability, grows, is_stable};
pub use kind::Kind;
pub use lambda::{Advice, Proven, Request, SpecimenShare, lambda_path};
pub use online::OnlineLimit;
pub use recorded::{Outcome, RecordedFinding, RecordedVerdict};
pub use spectrum::{CriticalDelays, Spectrum};
pub use verdict::{Judgement, Verdict};

#[cfg(test)]
mod tests;
