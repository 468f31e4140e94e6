//! The place of a tick in the test.

use gusset_quantity::state;

/// Place of a tick in the test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Step of the integration, from 0 at t = 0.
    pub step: u64,
    /// Tick within the step, from 0.
    pub sub_tick: u64,
    /// Test time in s.
    pub time: f64,
    /// Test time since the tick before: 0 at step 0 and in a hold.
    pub dt: f64,
}

state! { Tick { step, sub_tick, time, dt } }

impl Tick {
    /// A tick before t = 0, with `dt` of test time since the last.
    #[must_use]
    pub(crate) const fn before_start(dt: f64) -> Self {
        Self::of_step(0, 0.0, dt)
    }

    /// The tick of a whole step, where a step has `step_s` of test time and `dt` has passed since the last. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn of_step(step: u64, step_s: f64, dt: f64) -> Self {
        Self {
            step,
            sub_tick: 0,
            time: step as f64 * step_s,
            dt,
        }
    }

    /// The step as an index into series on the step grid.
    #[inline]
    #[must_use]
    pub(crate) fn index(&self) -> usize {
        usize::try_from(self.step).unwrap_or(usize::MAX)
    }
}
