//! A clock of commands in a replay and in tests: it is that of one thread, and advances by calls only.

use std::cell::Cell;

use super::PaceClock;

thread_local! {
    static NOW_NS: Cell<u64> = const { Cell::new(1_000_000_000) };
}

/// Time passes where paced commands wait for it.
pub const CLOCK: PaceClock = PaceClock {
    now_ns,
    sleep_until_ns: |until| NOW_NS.set(now_ns().max(until)),
};

/// The time of the clock.
pub fn now_ns() -> u64 {
    NOW_NS.get()
}

/// Advances the clock by this time.
#[cfg(any(test, feature = "test-doubles"))]
pub fn pass(ns: u64) {
    NOW_NS.set(now_ns() + ns);
}
