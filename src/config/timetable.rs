//! `[time]`: step, ticks, duration and clock.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::value::RateValue;
use crate::time::Ratio;

/// Step, duration and clock. Exactly one of `step_s` and `rate_hz` is given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeTable {
    /// Integration step Δt in s of test time: a number, or a fraction "a/b" where a decimal would not be exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_s: Option<RateValue>,
    /// Steps per second of test time: an integer, a number or a fraction "a/b".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<RateValue>,
    /// Length of the test in s of test time, a whole number of steps.
    pub duration_s: f64,
    /// Ticks of the controller in one integration step: with 10 a model of 100 steps per second drives its specimens 1000
    /// times per second, along the way from one target to the next. Ticks per second of wall time are steps per second times
    /// this, over `scale`.
    #[serde(default = "one_tick")]
    #[schemars(range(min = 1, max = 10_000))]
    pub ticks_per_step: u32,
    /// Order of the way between two targets, and of the prediction where the next one is not known yet: 1, 2 or 3.
    /// With 2 and 3 the velocities at the targets are such that damping of a specimen counts 2 and 10/3 times in a sawtooth, which
    /// lowers the limit of λ.
    #[serde(default = "second")]
    #[schemars(range(min = 1, max = 3))]
    pub prediction_order: u32,
    /// The clock that the loop runs on.
    #[serde(default)]
    pub clock: ClockChoice,
    /// Wall seconds per second of test time: 10 runs the same test ten times slower than real time. On the real clock a tick is
    /// an hour long at most.
    #[serde(default = "one")]
    #[schemars(default = "one")]
    pub scale: RateValue,
}

/// Which clock the loop runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClockChoice {
    /// Hard real time on the machine's monotonic clock.
    #[default]
    Real,
    /// As fast as it goes; the same bits in every column that does not depend on wall time.
    Simulated,
}

const fn one() -> RateValue {
    RateValue(Ratio::ONE)
}

const fn one_tick() -> u32 {
    1
}

const fn second() -> u32 {
    2
}
