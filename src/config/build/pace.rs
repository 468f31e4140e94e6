//! How steps and ticks belong together, and what the loop puts up with.

use crate::config::{TestFile, Time};
use crate::engine::{Limits, OnMiss, Pacing};
use crate::rt;

/// Longest wait for a partner that owes a reply.
const REPLY_TIMEOUT_NS: u64 = 5_000_000_000;
/// Stale measurements in a row after which a test stops.
const STALE_IN_A_ROW: u64 = 10;

/// No structure moves as far as this: a response that does is one of the integration.
const DIVERGENCE_M: f64 = 1e3;

/// How steps and ticks of the controller belong together.
pub(super) fn pacing(file: &TestFile, time: Time) -> Pacing {
    let ticks = |seconds: f64| (seconds / time.period.value()).ceil();
    Pacing {
        ticks_per_step: time.ticks_per_step,
        ease_ticks: ticks(file.safety.ease_s) as u32,
        checkpoint_ticks: ticks(file.record.checkpoint_s).max(1.0) as u64,
    }
}

/// What the loop puts up with.
pub(super) fn limits(file: &TestFile, time: Time) -> Limits {
    let timing = &file.timing;
    let ticks = time.steps.saturating_mul(u64::from(time.ticks_per_step));
    Limits {
        on_miss: match timing.on_miss {
            rt::OnMiss::Stretch => OnMiss::Stretch,
            rt::OnMiss::CatchUp => OnMiss::CatchUp {
                at_most: timing.max_catch_up_ticks,
            },
            rt::OnMiss::Stop => OnMiss::Stop,
        },
        misses_in_a_row: timing.max_consecutive_misses,
        misses_in_total: timing.miss_bound(ticks),
        extrapolate_stale: false,
        stale_in_a_row: STALE_IN_A_ROW,
        reply_timeout_ns: REPLY_TIMEOUT_NS,
        warmup_ticks: timing.warmup(time.period.value()),
        divergence: match &file.structure {
            Some(_) => file.safety.divergence_m.unwrap_or(DIVERGENCE_M),
            None => f64::MAX,
        },
        test: super::safety::test_limits(file, &time),
    }
}
