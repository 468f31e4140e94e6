//! A controller whose loop stalls.

use std::sync::atomic::{AtomicU64, Ordering};

use gusset_quantity::time::{Clock, Nanos, SimClock};

/// A simulated clock that oversleeps, as a page fault or the kernel makes a loop do.
#[derive(Debug)]
pub struct StallingClock {
    clock: SimClock,
    tick_ns: u64,
    /// Number of the wait, from 0, and for how many ticks.
    stalls: Vec<(u64, u64)>,
    waits: AtomicU64,
}

impl StallingClock {
    /// Adds `stalls` to `clock`: number of the wait and length in ticks of `tick_ns`.
    #[must_use]
    pub const fn new(clock: SimClock, tick_ns: u64, stalls: Vec<(u64, u64)>) -> Self {
        Self {
            clock,
            tick_ns,
            stalls,
            waits: AtomicU64::new(0),
        }
    }
}

impl Clock for StallingClock {
    fn now(&self) -> Nanos {
        self.clock.now()
    }

    fn sleep_until(&self, at: Nanos) {
        self.clock.sleep_until(at);
        let wait = self.waits.fetch_add(1, Ordering::Relaxed);
        for (number, ticks) in &self.stalls {
            if *number == wait {
                self.clock.advance(ticks.saturating_mul(self.tick_ns));
            }
        }
    }

    fn is_simulated(&self) -> bool {
        true
    }
}
