//! The forces that a motion has passed: on its way back a specimen does not leave them.

/// Share of the range of forces that a specimen on its way back may leave it by: the actuator settles, and numbers are rounded.
const RESOLUTION: f64 = 0.01;

/// The smallest and largest force of one axis that were measured.
#[derive(Debug, Clone, Copy)]
pub(super) struct Passed {
    least: f64,
    most: f64,
}

impl Passed {
    /// No force yet.
    pub const NOTHING: Self = Self {
        least: f64::INFINITY,
        most: f64::NEG_INFINITY,
    };

    /// One more force. Real-time: yes.
    pub(crate) const fn take(&mut self, force: f64) {
        self.least = self.least.min(force);
        self.most = self.most.max(force);
    }

    /// False for a force beyond these, with this `noise`; also for NaN. Real-time: yes.
    pub(crate) fn has(self, force: f64, noise: f64) -> bool {
        let slack = noise + RESOLUTION * (self.most - self.least);
        (self.least - slack..=self.most + slack).contains(&force)
    }
}
