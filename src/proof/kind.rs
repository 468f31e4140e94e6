//! Subject of a finding of the verdict.

use serde::{Deserialize, Serialize};

/// Subject of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The loop is proven unstable: λ, a delay, or an actuator without sufficient compensation.
    Unstable,
    /// No proof of stability exists for this method.
    Unproven,
    /// Stability or needs are not known: a compensator adapts, a curve is not followed, a rehearsal ran out of its budget.
    Unknown,
    /// The rehearsal diverges, stops early, trips, warns or exceeds a capacity.
    Rehearsal,
    /// A specimen that resists velocity moves at other velocities than those of the test.
    Speed,
    /// Numbers look like those of another unit.
    Units,
    /// The error of the method or of the coupling is large, the actuators take damping from a mode, or the steps do not follow the
    /// excitation.
    Error,
}
