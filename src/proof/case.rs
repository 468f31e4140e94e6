//! A test as its verdict sees it: plain values, without its file.

use super::actuator::Actuator;
use super::analysis::Analysis;
use super::kind::Kind;
use gusset_quantity::finding::Finding;

/// The input of a verdict.
#[derive(Debug, Clone)]
pub struct Case<'a> {
    /// Whether the test runs on the real clock.
    pub real_clock: bool,
    /// Δt in s of test time.
    pub dt: f64,
    /// Period of the controller in s of wall time.
    pub tick: f64,
    /// Whether a structure is integrated.
    pub structure: bool,
    /// λ of a member of the family.
    pub lambda: Option<f64>,
    /// The structure with its specimens; none where it is too large.
    pub analysis: Option<&'a Analysis>,
    /// One per specimen, in order.
    pub actuators: Vec<Actuator>,
    /// Findings on the integration: the recursion grows, or nothing is proven.
    pub doubts: &'a [(Kind, Finding)],
    /// Errors that the user accepts.
    pub accepts: Accepts,
}

/// The reasons for which the user accepts errors.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Accepts {
    /// For an unstable loop: `safety.accept_unstable`.
    pub unstable: Option<String>,
    /// For a trip of the rehearsal: `safety.accept_trip`.
    pub trip: Option<String>,
    /// For velocities that are not those of the test: `safety.accept_speed`.
    pub speed: Option<String>,
    /// For a large error of the test: `safety.accept_error`.
    pub error: Option<String>,
}
