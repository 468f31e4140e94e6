//! How a test begins, as data.

/// How a test begins.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StartupSettings {
    /// Ticks over which each sensor is averaged while the specimens hold; 0: not at all.
    pub zero_ticks: u32,
    /// Whether the operator must confirm the offsets.
    pub confirm: bool,
    /// Shortest time of a ramp in s of wall time.
    pub ramp_s: f64,
    /// Whether a resumed test takes the change of a relative load cell for drift of its zero.
    pub takes_force_drift: bool,
    /// Of each axis of each specimen: the largest force that it may bear before the test moves it, without a warning.
    pub initial_forces: Vec<Vec<InitialForce>>,
}

/// The largest force that an axis may bear before the test moves it, without a warning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InitialForce {
    /// The reference: `yield_force_n` of the stand-in, `measured_force_n` of the limits, or `noise` if neither is known.
    pub of: &'static str,
    /// 1 % of the reference, N at the specimen.
    pub most_n: f64,
}

impl StartupSettings {
    /// True if nothing moves at once: the first command is where the specimen stands.
    #[must_use]
    pub(crate) fn is_gentle(&self) -> bool {
        self.zero_ticks > 0 || self.ramp_s > 0.0
    }
}
