//! The brake: how a specimen that moves comes to rest after a stop of the operator.
//!
//! All axes lose their speed in the same ticks, so that the specimen stays on the straight line of its last step.

/// The last commands of a specimen that is stopped.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Brake {
    ticks: u64,
    /// The tick, from 1; 0 before the first.
    tick: u64,
    tick_s: f64,
}

impl Brake {
    /// To rest in `ticks` of `tick_s` s.
    pub(super) const fn new(ticks: u64, tick_s: f64) -> Self {
        Self {
            ticks,
            tick: 0,
            tick_s,
        }
    }

    /// True before its first command.
    #[must_use]
    pub(crate) const fn is_new(&self) -> bool {
        self.tick == 0
    }

    /// Advances by a tick; false when the specimen rests.
    pub(super) const fn go_on(&mut self) -> bool {
        self.tick += 1;
        self.tick < self.ticks
    }

    /// Share of the last step of the test that this tick moves.
    pub(super) fn share(&self) -> f64 {
        1.0 - self.tick as f64 / self.ticks as f64
    }

    /// Wall time of a tick in s.
    pub(super) const fn tick_s(&self) -> f64 {
        self.tick_s
    }
}
