//! Relation between steps and ticks, and the limits of the loop.

use toml_edit::{DocumentMut, Item};

use super::Prepared;
use gusset_config::{self as config, DIVERGENCE_M, Policy, TestFile, Time, TimingSpec};
use gusset_control::engine::{Limits, OnMiss, Pacing};
use gusset_record::rt::RtPlan;

/// Longest wait for the reply of a specimen.
const REPLY_TIMEOUT_NS: u64 = 5_000_000_000;
/// Stale measurements in a row after which a test stops.
const STALE_IN_A_ROW: u64 = 10;

/// Gives a test this divergence bound in m, in the loop, in its list of limits and in its `resolved.toml`.
pub fn set_divergence(test: &mut Prepared, bound: f64) {
    test.experiment.limits.divergence = bound;
    let limits = &mut test.facts.limits.test;
    for limit in limits
        .iter_mut()
        .filter(|limit| limit.key == "divergence_m")
    {
        limit.trip = vec![bound];
    }
    if let Ok(mut document) = test.files.resolved.parse::<DocumentMut>()
        && let Some(safety) = document.get_mut("safety").and_then(Item::as_table_like_mut)
    {
        safety.insert("divergence_m", toml_edit::value(bound));
        test.files.resolved = document.to_string();
    }
}

/// How steps and ticks of the controller belong together.
pub(super) fn pacing(file: &TestFile, time: Time) -> Pacing {
    let ticks = |seconds: f64| (seconds / time.period.value()).ceil();
    Pacing {
        ticks_per_step: time.ticks_per_step,
        ease_ticks: ticks(file.safety.ease_s) as u32,
        checkpoint_ticks: ticks(file.record.checkpoint_s).max(1.0) as u64,
    }
}

/// Faults that the loop tolerates.
pub(super) fn limits(file: &TestFile, time: Time) -> Limits {
    let timing = &file.timing;
    Limits {
        on_miss: match timing.on_miss {
            config::OnMiss::Stretch => OnMiss::Stretch,
            config::OnMiss::CatchUp => OnMiss::CatchUp {
                at_most: timing.max_catch_up_ticks,
            },
            config::OnMiss::Stop => OnMiss::Stop,
        },
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

/// Requests of a `[timing]` table to the operating system, for ticks of `period_ns`.
#[must_use]
pub fn rt_plan(spec: &TimingSpec, period_ns: u64) -> RtPlan {
    RtPlan {
        fifo_priority: (spec.policy == Policy::Fifo).then_some(spec.priority),
        cpu: spec.cpu,
        lock_memory: spec.lock_memory,
        hold_cpu_awake: spec.hold_cpu_awake,
        spin_ns: spec.spin_ns(),
        period_ns,
        require: spec.require_realtime,
    }
}
