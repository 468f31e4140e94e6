//! `[time]`: step, ticks, duration and clock.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::value::RateValue;
use gusset_quantity::time::Ratio;

/// Integration step, duration and clock. Give exactly one of `step_s` and `rate_hz`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeTable {
    /// Integration step Δt in seconds of test time. Write a fraction in quotes, for example
    /// "1/1024", if a decimal number would not be exact.
    pub step_s: Option<RateValue>,
    /// Integration steps per second of test time: a number, or a fraction "a/b". Use it instead of
    /// `step_s`.
    pub rate_hz: Option<RateValue>,
    /// Length of the test in seconds of test time. It must be a whole number of steps.
    pub duration_s: f64,
    /// Controller ticks in each integration step. With 10, a model with 100 steps per second
    /// commands its specimens 1000 times per second. Use it if the model is too slow for the rate
    /// of the controller.
    #[serde(default = "one_tick")]
    #[schemars(range(min = 1, max = 10_000))]
    #[schemars(example = 4)]
    pub ticks_per_step: u32,
    /// Order of the polynomial between two targets, and of the prediction while the next target is
    /// not known yet. Orders 2 and 3 are smoother. They lower the stable limit of λ if a specimen
    /// has damping, because it counts 2 or 10/3 times.
    #[serde(default = "second")]
    #[schemars(range(min = 1, max = 3))]
    #[schemars(example = 1)]
    pub prediction_order: u32,
    /// Clock of the test. "real" runs in real time, "simulated" as fast as the computer allows.
    #[serde(default)]
    pub clock: ClockChoice,
    /// Seconds of wall time for each second of test time. 10 runs the test ten times slower than
    /// real time. On the real clock a tick must not exceed one hour. A specimen behind a link has
    /// the velocities of the test if this is 1 / `similitude.time`.
    #[serde(default = "one")]
    #[schemars(default = "one")]
    #[schemars(example = 10)]
    pub scale: RateValue,
}

/// Clock of the test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClockChoice {
    /// Real time, on the monotonic clock of the computer. Use it for every physical specimen.
    #[default]
    Real,
    /// As fast as the computer allows. Columns that do not depend on wall time are bit for bit the
    /// same in every run.
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
