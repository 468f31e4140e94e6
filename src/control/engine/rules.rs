//! Bounds of what the loop accepts, and its policy for late ticks.

use super::test_limits::TestLimits;

/// What to do about a tick that starts, or leaves the next one to start, a period or more late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnMiss {
    /// Move the grid by whole ticks: the specimen sees slower time, never a burst of commands.
    Stretch,
    /// Keep the grid and run the missed steps back to back; beyond `at_most` of them the grid is moved.
    CatchUp {
        /// Ticks that may run back to back.
        at_most: u64,
    },
    /// End the test cleanly.
    Stop,
}

/// Bounds that the loop tolerates.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// What to do about a tick that starts a period or more late.
    pub on_miss: OnMiss,
    /// Whether a stale force is moved along the estimate k̂ (true) or held (false).
    pub extrapolate_stale: bool,
    /// Stale measurements in a row after which the test stops.
    pub stale_in_a_row: u64,
    /// How long a lockstep partner is waited for, in ns.
    pub reply_timeout_ns: u64,
    /// Ticks before t = 0 in which the specimens hold the first command.
    pub warmup_ticks: u64,
    /// |displacement| in m beyond which the response counts as diverged.
    pub divergence: f64,
    /// What belongs to no specimen alone.
    pub test: TestLimits,
}
