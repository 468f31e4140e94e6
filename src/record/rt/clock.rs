//! The real clock: sleeps until shortly before the edge, then spins on the clock to the edge.
//!
//! Invariant: [`Clock::sleep_until`] never returns early, and time has one source, CLOCK_MONOTONIC, which the sleep
//! also uses. A sleeping thread wakes 15 to 50 µs late; a spinning one sees the edge within 0.1 µs.
//! [`super::throttle`] limits the spin.

use gusset_quantity::time::{Clock, Nanos};

use super::os;

/// Default spin before an edge: covers the usual wake-up latency of a sleeping thread.
pub const USUAL_SPIN_NS: u64 = 60_000;

/// CLOCK_MONOTONIC as a [`Clock`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MonotonicClock {
    /// The spin before each edge in ns.
    pub(super) spin_ns: u64,
}

impl MonotonicClock {
    /// A clock that spins the last `spin_ns` before each edge; 0 only sleeps.
    #[must_use]
    pub const fn new(spin_ns: u64) -> Self {
        Self { spin_ns }
    }
}

impl Default for MonotonicClock {
    fn default() -> Self {
        Self::new(USUAL_SPIN_NS)
    }
}

impl Clock for MonotonicClock {
    #[inline]
    fn now(&self) -> Nanos {
        Nanos(os::monotonic_ns())
    }

    fn sleep_until(&self, at: Nanos) {
        let spin_from = at.minus(self.spin_ns);
        if os::monotonic_ns() < spin_from.0 {
            os::sleep_until_ns(spin_from.0);
        }
        while os::monotonic_ns() < at.0 {
            std::hint::spin_loop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::time::{Ratio, Schedule};

    #[test]
    fn no_edge_of_a_schedule_is_met_early() {
        for spin_ns in [0, 20_000, USUAL_SPIN_NS, 10_000_000] {
            let clock = MonotonicClock::new(spin_ns);
            let schedule = Schedule::new(clock.now(), Ratio::new(1, 4096).unwrap());
            for k in 0..20 {
                clock.sleep_until(schedule.tick(k));
                assert!(clock.now() >= schedule.tick(k));
            }
        }
    }

    #[test]
    fn past_time_returns_and_clock_never_falls() {
        let clock = MonotonicClock::default();
        let before = clock.now();
        clock.sleep_until(Nanos(0));
        clock.sleep_until(before);
        assert!(clock.now() >= before);
        assert!(!clock.is_simulated());
    }

    #[test]
    fn waiting_allocates_nothing() {
        let clock = MonotonicClock::default();
        let info = allocation_counter::measure(|| {
            let start = clock.now();
            for k in 1..5 {
                clock.sleep_until(start.plus(k * 100_000));
            }
        });
        assert_eq!(info.count_total, 0);
    }
}
