//! The limits in words. A test compares their names with those in the program.

use std::fmt::Write as _;

/// A limit: key, unit, what is judged, levels, default, who checks.
pub type LimitRow = [&'static str; 6];

const BOTH: &str = "controller, gateway, Gusset server";
const GATEWAY: &str = "controller, gateway";
const CONTROLLER: &str = "controller";

/// Limits of an axis, `[specimen.limits]`.
pub const AXIS_LIMITS: [LimitRow; 17] = [
    [
        "command_disp_m",
        "m",
        "commanded displacement",
        "range",
        "none",
        BOTH,
    ],
    [
        "command_step_m",
        "m",
        "change of the command from one tick to the next",
        "size",
        "none",
        BOTH,
    ],
    [
        "command_vel_m_per_s",
        "m/s",
        "commanded velocity",
        "size",
        "none",
        BOTH,
    ],
    [
        "command_accel_m_per_s2",
        "m/s²",
        "commanded acceleration",
        "size",
        "none",
        GATEWAY,
    ],
    [
        "measured_disp_m",
        "m",
        "measured displacement",
        "range",
        "trips beyond ±1000 m",
        GATEWAY,
    ],
    [
        "measured_force_n",
        "N",
        "measured force; a Gusset server checks 1.25 times the level",
        "range",
        "none",
        BOTH,
    ],
    [
        "following_error_m",
        "m",
        "measured minus commanded displacement",
        "size",
        "none",
        GATEWAY,
    ],
    [
        "force_step_n",
        "N",
        "change of the measured force from one measurement to the next",
        "size",
        "none",
        GATEWAY,
    ],
    [
        "stuck_ticks",
        "ticks",
        "ticks in a row in which the command moves and neither sensor changes",
        "size",
        "none",
        GATEWAY,
    ],
    [
        "sensor_disp_m",
        "m",
        "reading of the displacement sensor, at the end of its range",
        "range",
        "none",
        GATEWAY,
    ],
    [
        "sensor_force_n",
        "N",
        "reading of the load cell, at the end of its range",
        "range",
        "none",
        GATEWAY,
    ],
    [
        "alternating_ticks",
        "ticks",
        "ticks in a row in which the command grows as a sawtooth: the sign of an unstable integration",
        "size",
        "none",
        CONTROLLER,
    ],
    [
        "stiffness_ratio",
        "1",
        "estimated tangent stiffness over its declared upper bound",
        "size",
        "none",
        CONTROLLER,
    ],
    [
        "damping_ratio",
        "1",
        "estimated tangent damping over its declared upper bound",
        "size",
        "none",
        CONTROLLER,
    ],
    [
        "added_energy_j",
        "J",
        "energy that the axis adds to the structure through its tracking error",
        "size",
        "none",
        CONTROLLER,
    ],
    [
        "lag_s",
        "s",
        "estimated lag of the measured displacement behind the target",
        "size",
        "none",
        CONTROLLER,
    ],
    [
        "gain_error",
        "1",
        "difference between 1 and the gain of the measured displacement over the target",
        "size",
        "none",
        CONTROLLER,
    ],
];

/// Limits of the test that are quantities of the loop.
pub const TEST_LIMITS: [LimitRow; 7] = [
    [
        "stability_used",
        "1",
        "stability margin used, from the estimated stiffness and damping",
        "size",
        "warns above 1",
        "`[safety]`",
    ],
    [
        "delay_used",
        "1",
        "lag of a specimen over its critical delay",
        "size",
        "warns above 1",
        "`[safety]`",
    ],
    [
        "step_audit",
        "1",
        "energy error of the integration over the energy turned over",
        "size",
        "warns above 1e-9, trips above 1e-6, up to 64 DOFs",
        "`[safety]`",
    ],
    [
        "added_energy_share",
        "1",
        "energy added by all tracking errors over the energy that the test has taken in",
        "size",
        "none",
        "`[safety]`",
    ],
    [
        "max_consecutive_misses",
        "ticks",
        "deadline misses in a row",
        "count",
        "warns above 25, trips above 50",
        "`[timing]`",
    ],
    [
        "max_misses_in_window",
        "ticks",
        "deadline misses within `miss_window_s`",
        "count",
        "one tick in ten, at least 100",
        "`[timing]`",
    ],
    [
        "max_total_misses",
        "ticks",
        "deadline misses in the whole test",
        "count",
        "one tick in a hundred, at least 100",
        "`[timing]`",
    ],
];

/// Further limits of the test and of links: key, unit, what is judged, default, table.
pub const FURTHER_LIMITS: [[&str; 5]; 6] = [
    [
        "divergence_m",
        "m",
        "displacement of every DOF of the structure",
        "1000 m; with a link on the real clock, a stable loop and a complete rehearsal: ten times the rehearsed peak, at least 0.1 m",
        "safety",
    ],
    [
        "max_stale",
        "ticks",
        "stale measurements in a row",
        "from `max_stale_s`",
        "specimen.link",
    ],
    [
        "max_stale_s",
        "s",
        "time with stale measurements only",
        "0.1 s, at least ten ticks",
        "specimen.link",
    ],
    [
        "watchdog_s",
        "s",
        "time without a command, after which the specimen's own end holds",
        "0.25 s, at least ten ticks",
        "specimen.link",
    ],
    [
        "connect_timeout_s",
        "s",
        "time for the connection and its setup",
        "5 s",
        "specimen.link",
    ],
    [
        "reply_timeout_s",
        "s",
        "time for one reply of a lockstep specimen",
        "5 s",
        "specimen.link",
    ],
];

pub fn limit_table() -> String {
    let mut text = String::from(
        "# Table of limits\n\n\
         This page lists every limit with its unit, what it judges, its default and who checks it.\n\n\
         A limit has a level `warn`, a level `trip`, or both. Beyond `warn` the program writes an event and the test continues. \
         Beyond `trip` the test ends. A *size* is one number: `{ warn = 0.04, trip = 0.05 }`. A *range* has a smallest and a \
         largest value: `{ warn = [-0.04, 0.04], trip = [-0.05, 0.05] }`. How a test ends is in [the limits][limits].\n\n\
         ## Limits of an axis\n\n\
         They are keys of `[specimen.limits]`, and of `limits` in `[[specimen.axis]]`. All are at the specimen's own scale.\n\n\
         | key | unit | what is judged | levels | default | checked by |\n|---|---|---|---|---|---|\n",
    );
    for [key, unit, judged, levels, default, by] in AXIS_LIMITS {
        let _ = writeln!(
            text,
            "| `{key}` | {unit} | {judged} | {levels} | {default} | {by} |"
        );
    }
    text.push_str(
        "\nThe *controller* is `gusset run`. It checks a command before it is sent and every new measurement. A *gateway* is \
         `gusset serve` with a specimen behind a link. A *Gusset server* is any server of the Gusset protocol: the controller \
         announces these limits to it when a test begins.\n\n\
         ## Limits of the test\n\n\
         The controller checks them.\n\n\
         | key | unit | what is judged | levels | default | table |\n|---|---|---|---|---|---|\n",
    );
    for [key, unit, judged, levels, default, table] in TEST_LIMITS {
        let _ = writeln!(
            text,
            "| `{key}` | {unit} | {judged} | {levels} | {default} | {table} |"
        );
    }
    text.push_str(
        "\n## Divergence and waiting times\n\n| key | unit | what is judged | default | table |\n|---|---|---|---|---|\n",
    );
    for [key, unit, judged, default, table] in FURTHER_LIMITS {
        let _ = writeln!(
            text,
            "| `{key}` | {unit} | {judged} | {default} | `[{table}]` |"
        );
    }
    text.push_str(
        "\n## Always checked\n\n\
         These end a test without any key:\n\n\
         - A command, a measurement or a response is not a finite number.\n\
         - An interlock or an emergency stop opens at the specimen, even if it closes again.\n\
         - The specimen reports that a sensor or an actuator is at the end of its range.\n\
         - A link fails.\n\
         - The actuators of a loading unit cannot take the target pose.\n\
         - A tick is late by a whole period, with `timing.on_miss = \"stop\"`.\n\n\
         [limits]: limits.md\n",
    );
    text
}
