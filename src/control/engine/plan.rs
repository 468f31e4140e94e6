//! What never changes while a test runs.

use super::opening::StartupSettings;
use super::rules::Limits;

/// The constants of a test.
#[derive(Debug)]
pub(super) struct Plan {
    /// Step Δt of test time, in s.
    pub dt: f64,
    /// Number of the last step.
    pub steps: u64,
    /// How the specimens come to where the test begins.
    pub opening: StartupSettings,
    /// Bounds that the loop tolerates.
    pub limits: Limits,
    /// Ticks from one checkpoint to the next, at least.
    pub checkpoint_ticks: u64,
    /// Checkpoints hand the state to the recorder. Of a very large model they have the digest only.
    pub keeps_state: bool,
}
