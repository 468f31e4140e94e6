//! The `[timing]` table of a test file: real-time scheduling of the loop, and the response to missed deadlines.
//!
//! The keys and their ranges. The module `rt` and the loop apply them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Scheduling policy of the loop thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// Real-time policy SCHED_FIFO. Only a thread with a higher priority interrupts the loop.
    #[default]
    Fifo,
    /// Normal scheduling, which needs no permission. The loop wakes about 60 µs late, and later on
    /// a busy computer.
    Ordinary,
}

/// Response to a tick that is late by one period or more. No step is ever skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnMiss {
    /// Delay all later ticks by whole periods. The test runs slower for a moment, and the specimen
    /// never receives a burst of commands.
    #[default]
    Stretch,
    /// Run the missed ticks back to back. Only for simulated specimens, because a specimen with
    /// `link` would move faster than the test requires.
    CatchUp,
    /// Stop the test.
    Stop,
}

/// Real-time scheduling of the loop, and its response to missed deadlines. Each key has a default.
/// More: guide, real-time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "snake_case")]
pub struct TimingSpec {
    /// Scheduling policy of the loop: "fifo" or "ordinary".
    #[schemars(example = &"ordinary")]
    pub policy: Policy,
    /// Priority with "fifo", from 1 to 98. Interrupts of a PREEMPT_RT kernel have 50.
    #[schemars(range(min = 1, max = 98))]
    #[schemars(example = 80)]
    pub priority: u8,
    /// Processor core of the loop, from 0. All other threads of Gusset use the other cores, if the
    /// computer has more than one. Default: the last core.
    pub cpu: Option<usize>,
    /// Time before each tick at which the loop stops sleeping and waits actively. 0 only sleeps and
    /// wakes 15 to 50 µs late. At high rates it is shortened to the kernel's real-time budget.
    #[schemars(range(min = 0.0, max = 1e6))]
    #[schemars(example = 100.0)]
    pub spin_us: f64,
    /// If true, all memory of the process is locked in RAM (mlockall).
    #[schemars(example = false)]
    pub lock_memory: bool,
    /// If true, idle cores stay out of deep sleep during the test (/dev/cpu_dma_latency).
    #[schemars(example = false)]
    pub hold_cpu_awake: bool,
    /// If true, the test is refused with exit code 4 unless the system grants all real-time
    /// settings of this table.
    #[schemars(example = true)]
    pub require_realtime: bool,
    /// Response to a tick that is late by one period or more: "stretch", "catch_up" or "stop". A
    /// tick that is late by less does not move the next one.
    #[schemars(example = &"stop")]
    pub on_miss: OnMiss,
    /// Largest number of ticks that run back to back with `on_miss = "catch_up"`. Beyond it, later
    /// ticks are delayed.
    #[schemars(range(min = 1))]
    #[schemars(example = 50)]
    pub max_catch_up_ticks: u64,
    /// Limits of the number of deadline misses.
    pub misses: MissesSpec,
    /// Number of ticks before t = 0 in which the specimens hold. The test starts only if the second
    /// half of them keeps the miss limits. Default: 200, at most 0.5 s, at least 2 ticks. A larger
    /// number must not exceed 600 s.
    #[schemars(example = 500)]
    pub warmup_ticks: Option<u64>,
}

/// Limits of the number of deadline misses. The test stops when a number of misses exceeds its `trip`
/// level, and the controller warns beyond its `warn` level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "snake_case")]
pub struct MissesSpec {
    /// Successive misses. Default of `trip`: 50.
    #[schemars(example = serde_json::json!({"warn": 10, "trip": 20}))]
    pub in_a_row: CountSpec,
    /// All misses of a test. Default of `trip`: one percent of all ticks, at least 100.
    #[schemars(example = serde_json::json!({"warn": 100, "trip": 200}))]
    pub in_total: CountSpec,
    /// Misses within `window_s`. Default of `trip`: ten percent of the ticks in the window, at least
    /// 100.
    #[schemars(example = serde_json::json!({"warn": 50, "trip": 100}))]
    pub in_window: CountSpec,
    /// Wall time over which `in_window` counts, at most 3600 s.
    #[schemars(example = 5.0)]
    pub window_s: f64,
}

/// Levels of a number of deadline misses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "snake_case")]
pub struct CountSpec {
    /// Number of misses beyond which the controller warns. Default: half of `trip`.
    #[schemars(example = 10)]
    pub warn: Option<u64>,
    /// Number of misses after which the test stops.
    #[schemars(range(min = 1))]
    #[schemars(example = 20)]
    pub trip: Option<u64>,
}

/// Default number of successive misses after which a test stops.
const MISSES_IN_A_ROW: u64 = 50;

impl Default for MissesSpec {
    fn default() -> Self {
        Self {
            in_a_row: CountSpec {
                warn: None,
                trip: Some(MISSES_IN_A_ROW),
            },
            in_total: CountSpec::default(),
            in_window: CountSpec::default(),
            window_s: 10.0,
        }
    }
}

impl MissesSpec {
    /// The three numbers by key.
    pub(super) fn entries(&self) -> [(&'static str, CountSpec); 3] {
        let in_a_row = CountSpec {
            trip: Some(self.max_in_a_row()),
            ..self.in_a_row
        };
        [
            ("in_a_row", in_a_row),
            ("in_total", self.in_total),
            ("in_window", self.in_window),
        ]
    }

    /// Number of successive misses after which the test stops.
    #[must_use]
    pub fn max_in_a_row(&self) -> u64 {
        self.in_a_row.trip.unwrap_or(MISSES_IN_A_ROW)
    }
}

impl Default for TimingSpec {
    fn default() -> Self {
        Self {
            policy: Policy::Fifo,
            priority: 90,
            cpu: None,
            spin_us: 60.0,
            lock_memory: true,
            hold_cpu_awake: true,
            require_realtime: false,
            on_miss: OnMiss::Stretch,
            max_catch_up_ticks: 100,
            misses: MissesSpec::default(),
            warmup_ticks: None,
        }
    }
}

/// Default number of warm-up ticks.
const WARM_UP_TICKS: u64 = 200;
/// Longest default warm-up, in s.
const WARM_UP_S: f64 = 0.5;

impl TimingSpec {
    /// Warm-up ticks with a period of `period` seconds.
    #[must_use]
    pub fn warmup(&self, period: f64) -> u64 {
        self.warmup_ticks.unwrap_or_else(|| {
            let fit = (WARM_UP_S / period) as u64;
            fit.clamp(2, WARM_UP_TICKS)
        })
    }
}

impl TimingSpec {
    /// Checks that the loop's processor is one of `allowed`.
    ///
    /// # Errors
    /// The processor is another one, in words.
    pub fn check_cpu(&self, allowed: &[usize]) -> Result<(), String> {
        match self.cpu {
            Some(found) if !allowed.contains(&found) => {
                Err(format!("cpu is {found}, wanted one of {allowed:?}"))
            }
            _ => Ok(()),
        }
    }

    /// The spin in nanoseconds.
    #[must_use]
    pub fn spin_ns(&self) -> u64 {
        (self.spin_us * 1e3).round() as u64
    }

    /// Number of misses that a test of `ticks` ticks may have before it stops.
    #[must_use]
    pub fn miss_bound(&self, ticks: u64) -> u64 {
        self.misses.in_total.trip.unwrap_or((ticks / 100).max(100))
    }

    /// Ticks of `period_s` in the window of misses.
    #[must_use]
    pub fn window_ticks(&self, period_s: f64) -> u64 {
        ((self.misses.window_s / period_s).round() as u64).max(1)
    }

    /// Number of misses that a window of `ticks` ticks may have before the test stops.
    #[must_use]
    pub fn window_bound(&self, ticks: u64) -> u64 {
        self.misses.in_window.trip.unwrap_or((ticks / 10).max(100))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trip(trip: u64) -> CountSpec {
        CountSpec {
            warn: None,
            trip: Some(trip),
        }
    }

    #[test]
    fn empty_timing_table_is_the_default() {
        let empty: TimingSpec = toml::from_str("").unwrap();
        assert_eq!(empty, TimingSpec::default());
        assert_eq!(empty.spin_ns(), 60_000);
        let error = toml::from_str::<TimingSpec>("prority = 3").unwrap_err();
        assert!(error.to_string().contains("`prority`"), "{error}");
        assert!(toml::from_str::<TimingSpec>("on_miss = \"skip\"").is_err());
    }

    #[test]
    fn a_written_table_reads_back() {
        let spec = TimingSpec {
            cpu: Some(3),
            on_miss: OnMiss::CatchUp,
            misses: MissesSpec {
                in_total: trip(5),
                ..MissesSpec::default()
            },
            ..TimingSpec::default()
        };
        let text = toml::to_string(&spec).unwrap();
        assert!(text.contains("on_miss = \"catch_up\""), "{text}");
        assert_eq!(toml::from_str::<TimingSpec>(&text).unwrap(), spec);
    }

    #[test]
    fn a_processor_of_others_is_named() {
        let spec = TimingSpec {
            cpu: Some(7),
            ..TimingSpec::default()
        };
        let error = spec.check_cpu(&[0, 1]).unwrap_err();
        assert!(
            error.contains("cpu is 7,") && error.contains("[0, 1]"),
            "{error}"
        );
    }

    #[test]
    fn default_miss_bound_is_one_percent() {
        let spec = TimingSpec::default();
        assert_eq!(
            (spec.miss_bound(30), spec.miss_bound(1_000_000)),
            (100, 10_000)
        );
        let own = TimingSpec {
            misses: MissesSpec {
                in_total: trip(3),
                ..MissesSpec::default()
            },
            ..spec
        };
        assert_eq!(own.miss_bound(1_000_000), 3);
    }
}
