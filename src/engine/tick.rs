//! Where in the test a tick stands.

/// Place of a tick in the test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Step of the integration, from 0 at t = 0.
    pub step: u64,
    /// Tick within the step, from 0.
    pub sub_tick: u64,
    /// Test time in s.
    pub time: f64,
    /// Test time since the last accepted step: 0 at step 0.
    pub dt: f64,
}

impl Tick {
    /// The step as an index into series on the step grid.
    #[must_use]
    pub fn index(&self) -> usize {
        usize::try_from(self.step).unwrap_or(usize::MAX)
    }
}
