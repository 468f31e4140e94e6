//! The brake: how a specimen that moves comes to rest after a stop of the operator.
//!
//! All axes lose their speed in the same ticks, so that the specimen stays on the straight line of its last step.

/// The last commands of a specimen that is stopped, in its own units.
#[derive(Debug)]
pub struct Brake {
    /// The last step of the test, an axis each.
    steps: Vec<f64>,
    ticks: u64,
    /// The tick, from 1; 0 before the first.
    tick: u64,
    tick_s: f64,
}

impl Brake {
    /// From this last step to rest in `ticks` of `tick_s` s.
    pub(super) const fn new(steps: Vec<f64>, ticks: u64, tick_s: f64) -> Self {
        Self {
            steps,
            ticks,
            tick: 0,
            tick_s,
        }
    }

    /// True before its first command.
    #[must_use]
    pub const fn is_new(&self) -> bool {
        self.tick == 0
    }

    /// Advances by a tick; false when the specimen rests.
    pub(super) const fn go_on(&mut self) -> bool {
        self.tick += 1;
        self.tick < self.ticks
    }

    /// The steps of this tick.
    pub(super) fn steps(&self) -> impl Iterator<Item = f64> + '_ {
        let share = 1.0 - self.tick as f64 / self.ticks as f64;
        self.steps.iter().map(move |step| share * step)
    }

    /// Wall time of a tick in s.
    pub(super) const fn tick_s(&self) -> f64 {
        self.tick_s
    }
}
