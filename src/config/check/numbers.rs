//! The numbers that a key may have: one table for each table of a file.

use super::rules::{Must, Range};
use crate::link_table::WATCHDOG_MAX_S;
use Must::{AtLeast, AtMost, Be, Positive};

/// Longest time in s in which the specimens hold and nothing happens yet: zeroing, warming up, easing.
pub(super) const STANDING_S: f64 = 600.0;
/// Longest time in s for an answer of one end, a ramp, or a tick.
pub(super) const OWED_S: f64 = 3600.0;

const NOT_NEGATIVE: &str = "must not be negative";
const STANDING: &str = "the specimens hold during this time";
const OWED: &str = "the test waits this long for a missing reply";

pub(super) const NUMBERS_OF_GRAVITY: &[Range] = &[("accel_m_per_s2", Positive)];

pub(super) const NUMBERS_OF_INTEGRATOR: &[Range] = &[
    ("gain_bound newton_tolerance newton_iterations", Positive),
    (
        "newton_iterations",
        // Newton's method needs a handful, or it has none.
        AtMost(
            1e4,
            "",
            "a step that needs more iterations does not converge",
        ),
    ),
    (
        "rest_damping_share",
        Be(is_share, "must be from 0 to 1", "a share"),
    ),
    (
        "rho_infinity",
        Be(
            is_share,
            "must be from 0 to 1",
            "rho_infinity is a spectral radius",
        ),
    ),
];

pub(super) const NUMBERS_OF_SAFETY: &[Range] = &[
    (
        "divergence_m exit_speed_m_per_s resume_within_m resume_within_n added_energy_share.floor_j",
        Positive,
    ),
    (
        "exit_speed_m_per_s",
        // A millimetre in a quarter of an hour.
        AtLeast(
            1e-6,
            " m/s",
            "a slower specimen would not reach its end position",
        ),
    ),
    (
        "zero_s ramp_s ease_s",
        Be(|s| s >= 0.0, NOT_NEGATIVE, "seconds"),
    ),
    ("zero_s ease_s", AtMost(STANDING_S, " s", STANDING)),
    (
        "ramp_s",
        AtMost(
            OWED_S,
            " s",
            "the shortest time of a motion; limits of speed make it longer where needed",
        ),
    ),
];

pub(super) const NUMBERS_OF_TIMING: &[Range] = &[
    (
        "priority",
        Be(
            |found| (1.0..=98.0).contains(&found),
            "must be 1 to 98",
            "a priority of SCHED_FIFO",
        ),
    ),
    (
        "spin_us",
        Be(
            |us| (0.0..=1e6).contains(&us),
            "must be 0 to 1000000",
            "microseconds",
        ),
    ),
    (
        "max_catch_up_ticks misses.in_a_row.trip misses.in_total.trip misses.in_window.trip",
        Be(
            |count| count >= 1.0,
            "must be at least 1",
            "0 would stop every test at once",
        ),
    ),
    (
        "misses.window_s",
        Be(
            |s| s > 0.0 && s <= 3600.0,
            "must be greater than 0 and at most 3600",
            "seconds",
        ),
    ),
];

pub(super) const NUMBERS_OF_RECORD: &[Range] = &[
    ("queue_s checkpoint_s", Positive),
    (
        "queue_s",
        AtMost(600.0, " s", "waiting rows are kept in memory"),
    ),
    (
        "checkpoint_s",
        AtMost(
            OWED_S,
            " s",
            "a resumed test is verified from one checkpoint to the next",
        ),
    ),
];

pub(super) const NUMBERS_OF_CERTIFICATE: &[Range] = &[
    ("tracking_error response_error", Positive),
    (
        "trials",
        Be(|n| n >= 1.0, "must be 1 or greater", "at least one trial"),
    ),
    (
        "trip_probability",
        Be(
            |share| share > 0.0 && share <= 1.0,
            "must be greater than 0 and at most 1",
            "a finite number of trials cannot show a probability of 0",
        ),
    ),
    (
        "trials",
        AtMost(1e6, "", "each trial repeats the whole test"),
    ),
];

pub(super) const NUMBERS_OF_UNCERTAINTY: &[Range] = &[("std std_share", Positive)];

pub(super) const NUMBERS_OF_SPECIMEN: &[Range] = &[
    (
        "reach_disp_m reach_vel_m_per_s similitude.length similitude.force similitude.time drill.panic_at_s \
         identified.gain identified.stiffness_n_per_m capacity.stroke_m capacity.velocity_m_per_s capacity.force_n \
         capacity.power_w",
        Positive,
    ),
    (
        "mass_in_force_kg",
        Be(
            |kg| kg >= 0.0,
            "a mass is not negative",
            "must be zero or greater",
        ),
    ),
    (
        "identified.delay_s identified.delay_std_s identified.gain_std identified.stiffness_std_n_per_m \
         identified.noise_disp_m identified.noise_force_n",
        Be(|found| found >= 0.0, "must be 0 or greater", "negative"),
    ),
    (
        "hardening_bound",
        Be(
            |factor| factor >= 1.0,
            "must be 1 or greater",
            "a factor on the initial tangent stiffness",
        ),
    ),
];

pub(super) const NUMBERS_OF_AXIS: &[Range] = &[("scale", Positive)];

pub(super) const NUMBERS_OF_LINK: &[Range] = &[
    (
        "connect_timeout_s reply_timeout_s watchdog_s sample_after probe_m probe_ramp_s",
        Positive,
    ),
    (
        "sample_after",
        Be(
            |part| part <= 1.0,
            "must be inside the tick",
            "a fraction of the tick, at most 1",
        ),
    ),
    (
        "max_stale",
        Be(
            |count| count >= 1.0,
            "must be 1 or greater",
            "`on_stale = \"stop\"` stops at the first stale measurement",
        ),
    ),
    (
        "spin_us",
        Be(|us| us >= 0.0, NOT_NEGATIVE, "must be zero or greater"),
    ),
    (
        "connect_timeout_s reply_timeout_s",
        AtMost(OWED_S, " s", OWED),
    ),
    (
        "watchdog_s",
        AtMost(
            WATCHDOG_MAX_S,
            " s",
            "the server holds after this time without a command",
        ),
    ),
    (
        "probe_ramp_s",
        AtMost(STANDING_S, " s", "the time of the motion in each direction"),
    ),
    // As in `[timing]`.
    (
        "spin_us",
        AtMost(1e6, " µs", "a busy loop occupies a processor"),
    ),
];

pub(super) const NUMBERS_OF_BUS: &[Range] = &[
    ("watchdog_s", Positive),
    (
        "watchdog_s",
        AtMost(
            6.5,
            " s",
            "the devices stop after this time without outputs",
        ),
    ),
    (
        "stale_ticks",
        Be(
            |ticks| (1.0..=1000.0).contains(&ticks),
            "must be from 1 to 1000",
            "successive ticks without a valid exchange",
        ),
    ),
];

pub(super) const NUMBERS_OF_SPECIMEN_ON_BUS: &[Range] = &[
    (
        "connect_timeout_s sample_after probe_m probe_ramp_s",
        Positive,
    ),
    (
        "sample_after",
        Be(
            |part| part <= 0.85,
            "must be at most 0.85: the loop takes the reply by then",
            "a fraction of the tick: the inputs must arrive before it ends",
        ),
    ),
    ("connect_timeout_s", AtMost(OWED_S, " s", OWED)),
    (
        "probe_ramp_s",
        AtMost(STANDING_S, " s", "the time of the motion in each direction"),
    ),
];

pub(super) const NUMBERS_OF_AXIS_ON_BUS: &[Range] = &[(
    "command.m_per_count drive.m_per_count force.n_per_count disp.m_per_count",
    Be(
        |scale| scale != 0.0,
        "must not be 0",
        "the value of one count",
    ),
)];

pub(super) const NUMBERS_OF_SERVE: &[Range] = &[
    (
        "openfresco.idle_timeout_s openfresco.step_s openfresco.iterates_within_m",
        Positive,
    ),
    (
        "openfresco.idle_timeout_s",
        AtMost(
            86_400.0,
            " s",
            "as long as a client that is gone keeps the specimen to itself",
        ),
    ),
    (
        "pace.rate_hz",
        Be(
            |hz| (1.0..=1e4).contains(&hz),
            "must be from 1 to 10000",
            "commands per second",
        ),
    ),
    (
        "pace.ticks_per_step",
        Be(
            |ticks| ticks >= 2.0,
            "must be at least 2",
            "commands for each target",
        ),
    ),
    (
        "pace.prediction_order",
        Be(
            |order| order <= 3.0,
            "must be 0, 1, 2 or 3",
            "order of the polynomial",
        ),
    ),
];

fn is_share(value: f64) -> bool {
    (0.0..=1.0).contains(&value)
}
