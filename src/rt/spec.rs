//! The `[timing]` table of a test file: how the loop is scheduled and what happens when it is late.
//!
//! Only the description and its range checks; who obeys it is [`mod@super::apply`] and the loop.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Scheduling policy of the loop's thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// SCHED_FIFO: runs until it sleeps; only a higher priority interrupts it.
    #[default]
    Fifo,
    /// The ordinary policy: nothing is asked for. Wakes about 60 µs late, and more on a busy machine.
    Ordinary,
}

/// What happens when a tick starts, or leaves the next one to start, one period or more late. No step is ever left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnMiss {
    /// The grid moves by whole ticks: the specimen sees slower time and never a burst of commands.
    #[default]
    Stretch,
    /// The grid stands and the missed ticks run back to back. Refused with a specimen behind a link: it would be driven faster
    /// than the test says.
    CatchUp,
    /// The test ends in an orderly way.
    Stop,
}

/// Real-time scheduling of the loop and its answer to lateness. All keys have defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "snake_case")]
pub struct TimingSpec {
    /// Scheduling policy of the loop: "fifo" or "ordinary".
    pub policy: Policy,
    /// Priority under SCHED_FIFO, 1 to 98 (99 belongs to the kernel). On a PREEMPT_RT kernel interrupts have 50.
    #[schemars(range(min = 1, max = 98))]
    pub priority: u8,
    /// Processor of the loop, from 0. Absent: the last one. Every other thread keeps off it where there are two.
    pub cpu: Option<usize>,
    /// The loop sleeps until this long before each edge and then spins on the clock, in µs. 0: it only sleeps and
    /// wakes 15 to 50 µs late. Shortened where a spin would use up the kernel's real-time budget.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub spin_us: f64,
    /// Keep all memory of the process in RAM (mlockall).
    pub lock_memory: bool,
    /// Keep idle processors out of deep sleep (/dev/cpu_dma_latency) while the test runs.
    pub hold_cpu_awake: bool,
    /// Stack that is touched before the first tick, in kB.
    #[schemars(range(min = 0, max = 1024))]
    pub prefault_stack_kb: u32,
    /// Refuse to start (exit code 4) unless everything asked for above is granted.
    pub require_realtime: bool,
    /// What happens when a tick is late by one period or more: "stretch", "catch_up" or "stop". Late by less, the next
    /// edge stands. "catch_up" is for computed specimens only.
    pub on_miss: OnMiss,
    /// With `on_miss = "catch_up"`: at most this many ticks run back to back; beyond it the grid is moved.
    #[schemars(range(min = 1))]
    pub max_catch_up_ticks: u64,
    /// The test stops after this many deadline misses in a row.
    #[schemars(range(min = 1))]
    pub max_consecutive_misses: u64,
    /// The test stops after this many deadline misses. Absent: one tick in a hundred, and at least 100.
    #[schemars(range(min = 1))]
    pub max_total_misses: Option<u64>,
    /// The test stops after this many deadline misses within `miss_window_s`. Absent: one tick in ten, and at least 100.
    #[schemars(range(min = 1))]
    pub max_misses_in_window: Option<u64>,
    /// Wall time in s over which `max_misses_in_window` counts.
    pub miss_window_s: f64,
    /// More deadline misses in a row than these are warned of. Absent: half of what stops the test; so for the next two.
    pub warn_consecutive_misses: Option<u64>,
    /// More deadline misses in all than these are warned of.
    pub warn_total_misses: Option<u64>,
    /// More deadline misses within `miss_window_s` than these are warned of.
    pub warn_misses_in_window: Option<u64>,
    /// Ticks at the start, in which the specimens hold, whose timing is counted apart and whose misses stop nothing. Absent:
    /// 200, but no longer than 0.5 s, and at least 2. More than 200 may take 600 s at most.
    #[serde(skip_serializing_if = "Option::is_none")]
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

/// Warm-up ticks unless they are asked for by number.
const WARM_UP_TICKS: u64 = 200;
/// Longest time in s that they take unless they are asked for by number.
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
        /// What the process may use.
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

    /// Checks that the loop's processor is one of `allowed` (see [`super::os::process_cpus`]).
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
