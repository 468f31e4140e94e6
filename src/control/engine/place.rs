//! The place of the test in test time.

use super::tick::Tick;
use gusset_quantity::state;

/// The last step that was made, and the farthest tick that was exchanged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// Δt in s.
    dt: f64,
    steps_done: u64,
    farthest: Tick,
}

state! { Place { steps_done, farthest } keeps { dt } }

impl Place {
    /// At t = 0, with steps of `dt`.
    pub(crate) const fn start(dt: f64) -> Self {
        Self {
            dt,
            steps_done: 0,
            farthest: Tick::before_start(0.0),
        }
    }

    /// The last step whose row was made. Real-time: yes.
    #[inline]
    pub(crate) const fn steps_done(&self) -> u64 {
        self.steps_done
    }

    /// A step is made. Real-time: yes.
    #[inline]
    pub(crate) const fn step_done(&mut self, step: u64) {
        self.steps_done = step;
    }

    /// A tick is exchanged. Real-time: yes.
    #[inline]
    pub(crate) fn exchanged(&mut self, tick: &Tick) {
        if tick.time > self.farthest.time {
            self.farthest = *tick;
        }
    }

    /// A tick at the last step. `dt` is the test time that passes for a motion before or after the test.
    pub(crate) fn at_rest(&self, dt: f64) -> Tick {
        Tick::of_step(self.steps_done, self.dt, dt)
    }

    /// Place of an event: the farthest tick, whose step may never end, or the last step. Real-time: yes.
    pub(crate) fn of_event(&self) -> Tick {
        let made = self.at_rest(0.0);
        if self.farthest.time > made.time {
            self.farthest
        } else {
            made
        }
    }
}
