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
    #[serde(skip_serializing_if = "Option::is_none")]
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
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 10)]
    pub warn: Option<u64>,
    /// Number of misses after which the test stops.
    #[serde(skip_serializing_if = "Option::is_none")]
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
    fn entries(&self) -> [(&'static str, CountSpec); 3] {
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
    /// A bound of zero would stop every test at once.
    #[error("{key} is 0, wanted at least 1")]
    ZeroBound {
        /// Which bound.
        key: &'static str,
    },
    /// A number of misses of zero would stop every test at once.
    #[error("misses.{key}.trip is 0, wanted at least 1")]
    ZeroTrip {
        /// Which number.
        key: &'static str,
    },
    /// A window without length, or too long to remember.
    #[error("misses.window_s is {found}, wanted more than 0 and at most 3600")]
    Window {
        /// As written.
        found: f64,
    },
    /// A warning that would come with the end of the test, or after it.
    #[error("misses.{key}.warn is {warn}, wanted less than the {most} after which the test stops")]
    Warning {
        /// Which number.
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
    /// The keys within `[timing]` that lead to the wrong value, for the caret of the diagnostic.
    #[must_use]
    pub fn keys(&self) -> Vec<&'static str> {
        match self {
            Self::Priority { .. } => vec!["priority"],
            Self::Spin { .. } => vec!["spin_us"],
            Self::ZeroBound { key } => vec![key],
            Self::ZeroTrip { key } => vec!["misses", key, "trip"],
            Self::Warning { key, .. } => vec!["misses", key, "warn"],
            Self::Window { .. } => vec!["misses", "window_s"],
            Self::Cpu { .. } => vec!["cpu"],
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
        if self.max_catch_up_ticks == 0 {
            let key = "max_catch_up_ticks";
            return Err(TimingSpecError::ZeroBound { key });
        }
        for (key, levels) in self.misses.entries() {
            if levels.trip == Some(0) {
                return Err(TimingSpecError::ZeroTrip { key });
            }
        }
        let found = self.misses.window_s;
        if !(found > 0.0 && found <= 3600.0) {
            return Err(TimingSpecError::Window { found });
        }
        for (key, levels) in self.misses.entries() {
            if let (Some(warn), Some(most)) = (levels.warn, levels.trip)
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
    fn each_value_outside_its_range_is_named() {
        let wrong = |change: fn(&mut TimingSpec)| {
            let mut spec = TimingSpec::default();
            change(&mut spec);
            spec.check().unwrap_err().keys().join(".")
        };
        assert_eq!(wrong(|s| s.priority = 0), "priority");
        assert_eq!(wrong(|s| s.priority = 99), "priority");
        assert_eq!(wrong(|s| s.spin_us = f64::NAN), "spin_us");
        assert_eq!(wrong(|s| s.spin_us = -1.0), "spin_us");
        assert_eq!(wrong(|s| s.max_catch_up_ticks = 0), "max_catch_up_ticks");
        assert_eq!(
            wrong(|s| s.misses.in_a_row = trip(0)),
            "misses.in_a_row.trip"
        );
        assert_eq!(
            wrong(|s| s.misses.in_total = trip(0)),
            "misses.in_total.trip"
        );
        assert_eq!(
            wrong(|s| s.misses.in_window = trip(0)),
            "misses.in_window.trip"
        );
        assert_eq!(wrong(|s| s.misses.window_s = 0.0), "misses.window_s");
        assert_eq!(
            wrong(|s| s.misses.in_a_row.warn = Some(50)),
            "misses.in_a_row.warn"
        );
        assert_eq!(
            wrong(|s| {
                s.misses.in_window = CountSpec {
                    warn: Some(8),
                    trip: Some(7),
                };
            }),
            "misses.in_window.warn"
        );
        let spec = TimingSpec {
            cpu: Some(7),
            ..TimingSpec::default()
        };
        let error = spec.check_cpu(&[0, 1]).unwrap_err();
        assert_eq!(error.to_string(), "cpu is 7, wanted one of [0, 1]");
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
