//! Step and length of a test, exact: a duration is a whole number of steps, or it is refused.

use super::diagnose::Finding;
use super::document::KeyPath;
use super::echo;
use super::link_table::LinkSpec;
use super::timetable::{ClockChoice, TimeTable};
use gusset_quantity::time::Ratio;

/// Step and length of a test, exact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Time {
    /// Δt in s of test time.
    pub step: Ratio,
    /// Wall seconds from one tick of the controller to the next: scale · Δt / `ticks_per_step`.
    pub period: Ratio,
    /// Ticks of the controller in one step.
    pub ticks_per_step: u32,
    /// Number of steps; t = 0 not counted.
    pub steps: u64,
    /// The clock.
    pub clock: ClockChoice,
}

/// Relative error within which a duration counts as a whole number of steps.
const WHOLE: f64 = 1e-9;
/// Most ticks of one step.
const MOST_TICKS: u32 = 10_000;
/// Step numbers are recorded as doubles, which count exactly up to here (2^53).
const MOST_STEPS: f64 = 9_007_199_254_740_992.0;

/// Most ticks a second of wall time: on the real clock beyond any machine, on the simulated one the resolution of its count.
const fn highest_hz(clock: ClockChoice) -> f64 {
    match clock {
        ClockChoice::Real => 1e6,
        ClockChoice::Simulated => 1e9,
    }
}

impl Time {
    /// Wall seconds from one command over this link to the next.
    pub fn between_commands_s(&self, link: &LinkSpec) -> f64 {
        self.period.value() * f64::from(self.ticks_between_commands(link))
    }

    /// Ticks from one command over this link to the next.
    pub fn ticks_between_commands(&self, link: &LinkSpec) -> u32 {
        if link.is_per_step() {
            self.ticks_per_step
        } else {
            1
        }
    }

    /// The time of a test.
    ///
    /// # Errors
    /// Errors of the table: both or neither of step and rate, or a duration that is no whole number of steps.
    pub fn of(table: &TimeTable) -> Result<Self, Box<Finding>> {
        let time = KeyPath::root().key("time");
        let step = match (table.step_s, table.rate_hz) {
            (Some(step), None) => step.0,
            (None, Some(rate)) => rate.0.inverse(),
            (Some(step), Some(rate)) => {
                let same = if step.0.inverse() == rate.0 {
                    "they agree today, but only one of them can be changed tomorrow".to_owned()
                } else {
                    format!(
                        "a step of {} s is {} Hz",
                        number(step.0),
                        number(step.0.inverse())
                    )
                };
                return Err(Box::new(
                    Finding::error(time.key("rate_hz"), "both `step_s` and `rate_hz` are given")
                        .at_key()
                        .label("one of them must go")
                        .beside(time.key("step_s"), "the step is given here")
                        .help(format!("they say the same thing twice: {same}")),
                ));
            }
            (None, None) => {
                return Err(Box::new(
                    Finding::error(time, "neither `step_s` nor `rate_hz` is given")
                        .label("one of the two is needed")
                        .help("for example `rate_hz = 1024` or `step_s = 0.01`"),
                ));
            }
        };
        let ticks = table.ticks_per_step;
        if !(1..=MOST_TICKS).contains(&ticks) {
            let text = format!("`ticks_per_step` is {ticks}");
            return Err(Box::new(
                Finding::error(time.key("ticks_per_step"), text)
                    .label(format!("must be 1 to {MOST_TICKS}"))
                    .help("the controller commands its specimens so often in each step of the integration"),
            ));
        }
        if !(1..=3).contains(&table.prediction_order) {
            let text = format!("`prediction_order` is {}", table.prediction_order);
            return Err(Box::new(
                Finding::error(time.key("prediction_order"), text).label("must be 1, 2 or 3"),
            ));
        }
        let share = Ratio::new(1, u64::from(ticks)).and_then(|tick| tick.times(table.scale.0));
        let period = share.and_then(|share| step.times(share)).map_err(|error| {
            Finding::error(time.key("scale"), format!("scale · step {error}"))
                .label(format!("{} times {} s, over {ticks}", table.scale.0, step))
        })?;
        let highest = highest_hz(table.clock);
        let rate = period.inverse().value();
        if rate > highest * (1.0 + WHOLE) {
            let key = if table.rate_hz.is_some() {
                "rate_hz"
            } else {
                "step_s"
            };
            let text = format!(
                "a tick every {:e} s of wall time is too fast",
                period.value()
            );
            let clock = match table.clock {
                ClockChoice::Real => "real",
                ClockChoice::Simulated => "simulated",
            };
            return Err(Box::new(
                Finding::error(time.key(key), text)
                    .label(format!("{rate:e} Hz"))
                    .help(format!("at most {highest:e} Hz on the {clock} clock")),
            ));
        }
        Ok(Self {
            step,
            period,
            ticks_per_step: ticks,
            steps: whole_steps(table.duration_s, step, time.key("duration_s"))?,
            clock: table.clock,
        })
    }
}

fn whole_steps(duration: f64, step: Ratio, at: KeyPath) -> Result<u64, Box<Finding>> {
    if !(duration > 0.0 && duration.is_finite()) {
        return Err(Box::new(not_positive(at, duration)));
    }
    let (numerator, denominator) = step.terms();
    let steps = duration * denominator as f64 / numerator as f64;
    let whole = steps.round();
    if whole > MOST_STEPS {
        return Err(Box::new(
            Finding::error(at, format!("a test of {duration:e} s has {steps:e} steps"))
                .label("at most 2^53 steps can be counted"),
        ));
    }
    if whole >= 1.0 && (steps - whole).abs() <= WHOLE * whole {
        return Ok(whole as u64);
    }
    let spelt = |n: u64| {
        let exact = Ratio::new(n, 1).and_then(|n| n.times(step));
        let seconds = exact.map_or(n as f64 * step.value(), Ratio::value);
        format!("{seconds} s ({n} step{})", if n == 1 { "" } else { "s" })
    };
    let (below, above) = (steps.floor() as u64, steps.floor() as u64 + 1);
    let nearest = if below == 0 {
        format!("the shortest duration that fits is {}", spelt(1))
    } else {
        format!(
            "the nearest durations that fit are {} and {}",
            spelt(below),
            spelt(above)
        )
    };
    Err(Box::new(
        Finding::error(at, "the duration is not a whole number of steps")
            .label(format!(
                "{duration} s are {} steps of {} s",
                twelve_digits(steps),
                number(step)
            ))
            .help(nearest),
    ))
}

/// Without the last digits of a double, which are noise of the division.
fn twelve_digits(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// A ratio as a person would write it: a decimal where that is exact.
fn number(ratio: Ratio) -> String {
    let value = ratio.value();
    if Ratio::from_decimal(value) == Ok(ratio) {
        value.to_string()
    } else {
        ratio.to_string()
    }
}

/// The complaint about a number that must be greater than zero.
pub(super) fn not_positive(at: KeyPath, found: f64) -> Finding {
    let headline = format!("`{at}` must be greater than zero");
    Finding::error(at, headline).label(format!("found {}", echo::number(found)))
}
