//! The `[timing]` table of a test file: real-time scheduling of the loop, and the response to missed deadlines.
//!
//! The keys and their ranges. The module `rt` and the loop apply them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

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
    /// Size of the stack that is touched before the first tick, in kB.
    #[schemars(range(min = 0, max = 1024))]
    #[schemars(example = 512)]
    pub prefault_stack_kb: u32,
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
    /// Number of successive deadline misses after which the test stops.
    #[schemars(range(min = 1))]
    #[schemars(example = 20)]
    pub max_consecutive_misses: u64,
    /// Number of deadline misses after which the test stops. Default: one percent of all ticks, at
    /// least 100.
    #[schemars(range(min = 1))]
    #[schemars(example = 200)]
    pub max_total_misses: Option<u64>,
    /// Number of deadline misses within `miss_window_s` after which the test stops. Default: ten
    /// percent of the ticks in the window, at least 100.
    #[schemars(range(min = 1))]
    #[schemars(example = 100)]
    pub max_misses_in_window: Option<u64>,
    /// Wall time over which `max_misses_in_window` counts, at most 3600 s.
    #[schemars(example = 5.0)]
    pub miss_window_s: f64,
    /// Number of successive deadline misses beyond which the controller warns. Default: half of
    /// `max_consecutive_misses`.
    #[schemars(example = 10)]
    pub warn_consecutive_misses: Option<u64>,
    /// Number of deadline misses beyond which the controller warns. Default: half of
    /// `max_total_misses`.
    #[schemars(example = 100)]
    pub warn_total_misses: Option<u64>,
    /// Number of deadline misses within `miss_window_s` beyond which the controller warns. Default:
    /// half of `max_misses_in_window`.
    #[schemars(example = 50)]
    pub warn_misses_in_window: Option<u64>,
    /// Number of ticks before t = 0 in which the specimens hold. The test starts only if the second
    /// half of them keeps the miss limits. Default: 200, at most 0.5 s, at least 2 ticks. A larger
    /// number must not exceed 600 s.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 500)]
    pub warmup_ticks: Option<u64>,
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
            prefault_stack_kb: 256,
            require_realtime: false,
            on_miss: OnMiss::Stretch,
            max_catch_up_ticks: 100,
            max_consecutive_misses: 50,
            max_total_misses: None,
            max_misses_in_window: None,
            miss_window_s: 10.0,
            warn_consecutive_misses: None,
            warn_total_misses: None,
            warn_misses_in_window: None,
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

/// A value of `[timing]` outside its range.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TimingSpecError {
    /// Outside what SCHED_FIFO takes, or the kernel's own.
    #[error("priority is {found}, wanted 1 to 98")]
    Priority {
        /// As written.
        found: u8,
    },
    /// Negative, not a number, or longer than any tick.
    #[error("spin_us is {found}, wanted 0 to 1000000")]
    Spin {
        /// As written.
        found: f64,
    },
    /// More stack than a thread safely has.
    #[error("prefault_stack_kb is {found}, wanted 0 to 1024")]
    Prefault {
        /// As written.
        found: u32,
    },
    /// A bound of zero would stop every test at once.
    #[error("{key} is 0, wanted at least 1")]
    ZeroBound {
        /// Which bound.
        key: &'static str,
    },
    /// A window without length, or too long to remember.
    #[error("miss_window_s is {found}, wanted more than 0 and at most 3600")]
    Window {
        /// As written.
        found: f64,
    },
    /// A warning that would come with the end of the test, or after it.
    #[error("{key} is {warn}, wanted less than the {most} after which the test stops")]
    Warning {
        /// Which level.
        key: &'static str,
        /// As written.
        warn: u64,
        /// What stops the test.
        most: u64,
    },
    /// The process may not use this processor.
    #[error("cpu is {found}, wanted one of {allowed:?}")]
    Cpu {
        /// As written.
        found: usize,
        /// Processors that the process may use.
        allowed: Vec<usize>,
    },
}

impl TimingSpecError {
    /// The key that is wrong, for the diagnostic's caret.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Priority { .. } => "priority",
            Self::Spin { .. } => "spin_us",
            Self::Prefault { .. } => "prefault_stack_kb",
            Self::ZeroBound { key } | Self::Warning { key, .. } => key,
            Self::Window { .. } => "miss_window_s",
            Self::Cpu { .. } => "cpu",
        }
    }
}

impl TimingSpec {
    /// Checks every range that does not depend on the machine.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn check(&self) -> Result<(), TimingSpecError> {
        if !(1..=98).contains(&self.priority) {
            return Err(TimingSpecError::Priority {
                found: self.priority,
            });
        }
        if !(0.0..=1e6).contains(&self.spin_us) {
            return Err(TimingSpecError::Spin {
                found: self.spin_us,
            });
        }
        if self.prefault_stack_kb > 1024 {
            return Err(TimingSpecError::Prefault {
                found: self.prefault_stack_kb,
            });
        }
        for (key, bound) in [
            ("max_catch_up_ticks", self.max_catch_up_ticks),
            ("max_consecutive_misses", self.max_consecutive_misses),
            ("max_total_misses", self.max_total_misses.unwrap_or(1)),
            (
                "max_misses_in_window",
                self.max_misses_in_window.unwrap_or(1),
            ),
        ] {
            if bound == 0 {
                return Err(TimingSpecError::ZeroBound { key });
            }
        }
        if !(self.miss_window_s > 0.0 && self.miss_window_s <= 3600.0) {
            return Err(TimingSpecError::Window {
                found: self.miss_window_s,
            });
        }
        for (key, warn, most) in [
            (
                "warn_consecutive_misses",
                self.warn_consecutive_misses,
                Some(self.max_consecutive_misses),
            ),
            (
                "warn_total_misses",
                self.warn_total_misses,
                self.max_total_misses,
            ),
            (
                "warn_misses_in_window",
                self.warn_misses_in_window,
                self.max_misses_in_window,
            ),
        ] {
            if let (Some(warn), Some(most)) = (warn, most)
                && warn >= most
            {
                return Err(TimingSpecError::Warning { key, warn, most });
            }
        }
        Ok(())
    }

    /// Checks that the loop's processor is one of `allowed`.
    ///
    /// # Errors
    /// The processor is another one.
    pub fn check_cpu(&self, allowed: &[usize]) -> Result<(), TimingSpecError> {
        match self.cpu {
            Some(found) if !allowed.contains(&found) => {
                let allowed = allowed.to_vec();
                Err(TimingSpecError::Cpu { found, allowed })
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
        self.max_total_misses.unwrap_or((ticks / 100).max(100))
    }

    /// Ticks of `period_s` in the window of misses.
    #[must_use]
    pub fn window_ticks(&self, period_s: f64) -> u64 {
        ((self.miss_window_s / period_s).round() as u64).max(1)
    }

    /// Number of misses that a window of `ticks` ticks may have before the test stops.
    #[must_use]
    pub fn window_bound(&self, ticks: u64) -> u64 {
        self.max_misses_in_window.unwrap_or((ticks / 10).max(100))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_table_is_the_default_and_unknown_keys_are_refused() {
        let empty: TimingSpec = toml::from_str("").unwrap();
        assert_eq!(empty, TimingSpec::default());
        assert_eq!(empty.check(), Ok(()));
        assert_eq!(empty.spin_ns(), 60_000);
        let error = toml::from_str::<TimingSpec>("prority = 3").unwrap_err();
        assert!(
            error.to_string().contains("unknown field `prority`"),
            "{error}"
        );
        assert!(toml::from_str::<TimingSpec>("on_miss = \"skip\"").is_err());
    }

    #[test]
    fn a_written_table_reads_back() {
        let spec = TimingSpec {
            cpu: Some(3),
            on_miss: OnMiss::CatchUp,
            max_total_misses: Some(5),
            ..TimingSpec::default()
        };
        let text = toml::to_string(&spec).unwrap();
        assert!(text.contains("on_miss = \"catch_up\""), "{text}");
        assert_eq!(toml::from_str::<TimingSpec>(&text).unwrap(), spec);
    }

    #[test]
    fn each_value_outside_its_range_is_named() {
        let wrong = |change: fn(&mut TimingSpec)| {
            let mut spec = TimingSpec::default();
            change(&mut spec);
            spec.check().unwrap_err().key()
        };
        assert_eq!(wrong(|s| s.priority = 0), "priority");
        assert_eq!(wrong(|s| s.priority = 99), "priority");
        assert_eq!(wrong(|s| s.spin_us = f64::NAN), "spin_us");
        assert_eq!(wrong(|s| s.spin_us = -1.0), "spin_us");
        assert_eq!(wrong(|s| s.prefault_stack_kb = 4096), "prefault_stack_kb");
        assert_eq!(
            wrong(|s| s.max_consecutive_misses = 0),
            "max_consecutive_misses"
        );
        assert_eq!(wrong(|s| s.max_total_misses = Some(0)), "max_total_misses");
        assert_eq!(
            wrong(|s| s.max_misses_in_window = Some(0)),
            "max_misses_in_window"
        );
        assert_eq!(wrong(|s| s.miss_window_s = 0.0), "miss_window_s");
        assert_eq!(
            wrong(|s| s.warn_consecutive_misses = Some(50)),
            "warn_consecutive_misses"
        );
        assert_eq!(
            wrong(|s| {
                s.max_misses_in_window = Some(7);
                s.warn_misses_in_window = Some(8);
            }),
            "warn_misses_in_window"
        );
        let spec = TimingSpec {
            cpu: Some(7),
            ..TimingSpec::default()
        };
        let error = spec.check_cpu(&[0, 1]).unwrap_err();
        assert_eq!(error.to_string(), "cpu is 7, wanted one of [0, 1]");
    }

    #[test]
    fn the_default_bound_is_one_tick_in_a_hundred_and_at_least_a_hundred() {
        let spec = TimingSpec::default();
        assert_eq!(
            (spec.miss_bound(30), spec.miss_bound(1_000_000)),
            (100, 10_000)
        );
        let own = TimingSpec {
            max_total_misses: Some(3),
            ..spec
        };
        assert_eq!(own.miss_bound(1_000_000), 3);
    }
}
