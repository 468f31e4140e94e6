//! Limits, events and columns in words. Tests compare the names with those in the program.

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
        "measured force",
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
        "ten times the rehearsed peak, at least 0.1 m, with a specimen behind a link; else 1000 m",
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

/// An event: name, meaning, its own fields.
pub type EventRow = [&'static str; 3];

/// Events of a test.
pub const TEST_EVENTS: &[EventRow] = &[
    [
        "files",
        "The input files and the version of the program.",
        "`sha256`: hash by file name; `version`",
    ],
    ["warning", "A warning before the test.", "`text`"],
    [
        "not_granted",
        "The operating system refused a real-time setting.",
        "`text`",
    ],
    ["live_page", "The live page is served.", "`address`"],
    [
        "connected",
        "A specimen behind a link is connected.",
        "`specimen`, `name`, `peer`; `measures_disp` false: it repeats the command instead of measuring; `standing`: the position that it reports",
    ],
    [
        "grid",
        "A grid of ticks begins. Wall times of the rows count from its first edge.",
        "`of`: `opening`, `directions` or `test`; `first_edge_ns`: ns of the loop's clock",
    ],
    [
        "phase",
        "The test enters another phase.",
        "`from`, `to`; `cause`: `done`, `operator`, or what stopped it; `specimen`, `name` if one specimen is the cause",
    ],
    [
        "zeroed",
        "A sensor's zero was read.",
        "`specimen`, `name`, `axis`; `disp`, `force`: means; `disp_noise_rms`, `force_noise_rms`; all in the axis' own units",
    ],
    [
        "initial_force",
        "An axis carries a force at the start that its displacement does not explain.",
        "`specimen`, `name`, `axis`; `force` in N; `most`: allowed, in N; `of`: the reference for the allowed force",
    ],
    [
        "confirmed",
        "The operator confirmed the sensor readings.",
        "",
    ],
    [
        "probing",
        "The wiring check moves the specimen by a small motion.",
        "`specimen`, `name`",
    ],
    [
        "direction",
        "Result of the wiring check for one axis.",
        "`specimen`, `name`, `axis`; `disp` in m, `force` in N: changes of the measured values",
    ],
    [
        "direction_unknown",
        "The wiring check found no direction.",
        "`specimen`, `name`, `axis`",
    ],
    [
        "misfit",
        "A wiring fault: the specimen is not armed.",
        "`specimen`, `name`, `axis`; `what`: the fault in one word",
    ],
    [
        "stands",
        "Resume: an axis stands where the interrupted test left it.",
        "`specimen`, `name`, `axis`; `found`, `left`, `within`: position, earlier position, allowed difference, in the axis' unit",
    ],
    [
        "moved",
        "Resume: an axis does not stand where the interrupted test left it.",
        "as `stands`",
    ],
    [
        "force_changed",
        "Resume: a load cell reads another force than at the interruption.",
        "`specimen`, `name`, `axis`; `left`: expected, `found`, `within`: allowed difference, in the axis' unit; `taken_for_drift`: true if the zero was corrected",
    ],
    [
        "go",
        "The warm-up met its deadlines: the test begins.",
        "`ticks`: judged; `missed`, `in_a_row`: misses; `mean_ns`, `longest_ns`: duration of a tick",
    ],
    [
        "no_go",
        "The warm-up did not meet its deadlines: the test does not begin.",
        "as `go`",
    ],
    ["started", "The first command of the test is sent.", ""],
    [
        "checkpoint",
        "A digest of the test's state after a step, for `gusset run --resume`.",
        "`digest`: 16 hexadecimal digits",
    ],
    ["hold_requested", "The operator asked for a hold.", ""],
    [
        "continue_requested",
        "The operator let a held test go on.",
        "",
    ],
    [
        "continue_dropped",
        "A continue command named an earlier hold and had no effect.",
        "`hold`: the number it named; `latest`: the number of the latest hold",
    ],
    [
        "stop_requested",
        "The operator asked for the end of the test.",
        "",
    ],
    [
        "control_request",
        "The live page received a request.",
        "`request`, `from`: address, `accepted`; `why` if it was refused",
    ],
    [
        "control_refused",
        "The live page refused a request without the control token.",
        "`request`, `from`, `why`; `times`: how often",
    ],
    [
        "pace",
        "The pace of the commands between two targets changed.",
        "`from`, `to`; `share`: part of the step that was made",
    ],
    [
        "limit_warning",
        "A value is beyond the `warn` level of a limit.",
        "`limit`: its key; `value`, `bound` in SI units; `specimen`, `name`, `axis` for a limit of an axis",
    ],
    [
        "limit_trip",
        "A value is beyond the `trip` level of a limit: the test ends.",
        "as `limit_warning`",
    ],
    [
        "interlock",
        "The interlock of a specimen is open.",
        "`specimen`, `name`",
    ],
    [
        "saturated",
        "A sensor or an actuator is at the end of its range.",
        "`specimen`, `name`",
    ],
    [
        "geometry",
        "The actuators of a loading unit cannot take a pose, or their strokes have no pose.",
        "`specimen`, `name`; `axis` if one actuator is the cause; `what`: the fault in one word",
    ],
    [
        "diverged",
        "A displacement is beyond `safety.divergence_m` or not finite.",
        "`dof`: from 1",
    ],
    [
        "specimen_holds",
        "The specimen reports that its own watchdog holds it.",
        "`specimen`, `name`",
    ],
    [
        "specimen_holds_on",
        "The specimen still reports that its own watchdog holds it.",
        "`specimen`, `name`",
    ],
    [
        "unsettled",
        "The actuator–specimen iteration of a simulated actuator did not converge.",
        "`specimen`, `name`; `ticks`: how many so far",
    ],
    [
        "miss",
        "A deadline was missed.",
        "`class`: cause; `late_ns`; `stretched`: whole ticks by which the grid moved; `steal_ms`, `involuntary_switches`, `minor_faults`: counters of the system meanwhile",
    ],
    [
        "gap",
        "No command was sent for a time outside of the steps of the test.",
        "`late_ns`; `ticks`: ticks without a command",
    ],
    [
        "stale",
        "A measurement is stale.",
        "`specimen`, `name`; `age`: commands since the one that it answers",
    ],
    [
        "recovered",
        "A missing measurement arrived within the history of a later one.",
        "`specimen`, `name`, `axis`; `age` in commands; `force` in N",
    ],
    [
        "link",
        "A link failed.",
        "`specimen`, `name`; `fault`: in one word; `message`",
    ],
    [
        "unacknowledged",
        "A specimen did not acknowledge the end of the test.",
        "`specimen`, `name`",
    ],
    [
        "last_words",
        "A message with which the specimen's end closed the link.",
        "`specimen`; `text`",
    ],
    [
        "row_lost",
        "The queue to the writer was full: one row is lost.",
        "",
    ],
    [
        "rows_lost",
        "Rows are missing from `samples.bin`.",
        "`rows_lost`; `to_full_queue`, `to_file_error`: by cause",
    ],
    [
        "write_failed",
        "A file of the run folder cannot be written. The program tries again.",
        "`file`, `error`, `rows_lost`",
    ],
    [
        "write_recovered",
        "A file of the run folder can be written again.",
        "`file`, `rows_lost`",
    ],
    [
        "record_damaged",
        "Another program changed or deleted a file of the run folder.",
        "`file`, `text`",
    ],
    ["internal_error", "A fault of the program itself.", "`text`"],
    [
        "ended",
        "The test has ended and every specimen is in its end state.",
        "",
    ],
];

/// Events that only the record of `gusset serve` has.
pub const SERVER_EVENTS: &[EventRow] = &[
    [
        "controller",
        "A controller begins a test.",
        "`peer`: address; `test`: title; `software`",
    ],
    [
        "armed_again",
        "The controller begins the test again.",
        "`text`",
    ],
    [
        "holding",
        "No command has come for the time of the watchdog: the specimen holds.",
        "`text`",
    ],
    [
        "commands_again",
        "Commands come again after a pause.",
        "`text`",
    ],
    [
        "limit",
        "A command or a measurement is beyond a `warn` level.",
        "`text`",
    ],
    [
        "trip",
        "A limit or a fault ends the controller's test and latches.",
        "`text`; `what`: name of the cause; `code`: as in the column `trip`; `axis`, `value`, `bound`, `unit` for a limit",
    ],
    ["faults", "A fault script is played.", "`text`"],
    [
        "left_aside",
        "A message of the controller had no effect.",
        "`text`",
    ],
    [
        "client_without_commits",
        "An OpenFresco client sends no commits.",
        "`text`",
    ],
    [
        "client_reset",
        "An OpenFresco client reset its state.",
        "`text`",
    ],
    [
        "counts",
        "Counts of messages at the end of the controller's test.",
        "`text`",
    ],
];

pub fn events() -> String {
    let mut text = String::from(
        "# Events\n\n\
         This page lists every kind of line in `events.jsonl`.\n\n\
         Each line of the file is one JSON object. Every line has these fields:\n\n\
         | field | unit | meaning |\n|---|---|---|\n\
         | `tick` | 1 | step of the test, as in the column `step`; null before the first one |\n\
         | `time` | s | test time |\n\
         | `wall` | – | UTC with nanoseconds |\n\
         | `clock_ns` | ns | the loop's clock; null on the simulated clock where it is not known |\n\
         | `event` | – | kind of the event, from the tables below |\n\n\
         `specimen` and `axis` count from 1, as in the names of the columns. `name` is the name of the specimen.\n\n\
         ## Events of a test\n\n| event | meaning | further fields |\n|---|---|---|\n",
    );
    for [name, meaning, fields] in TEST_EVENTS {
        let _ = writeln!(text, "| `{name}` | {meaning} | {fields} |");
    }
    text.push_str(
        "\n## Events of a server\n\n\
         `gusset serve --out DIR` records each controller's test in a folder. Its `events.jsonl` also has these kinds. Where a \
         kind of the first table occurs there, `text` has the details.\n\n\
         | event | meaning | further fields |\n|---|---|---|\n",
    );
    for [name, meaning, fields] in SERVER_EVENTS {
        let _ = writeln!(text, "| `{name}` | {meaning} | {fields} |");
    }
    text
}

/// A column: name with placeholders, unit, meaning, origin.
pub type ColumnRow = [&'static str; 4];

/// Columns of a test. `N` is a DOF, `S` a specimen, `A` an axis and `C` a coordinate, each from 1; `NAME` is a parameter.
pub const TEST_COLUMNS: &[ColumnRow] = &[
    ["step", "1", "integration step, 0 at t = 0", "loop"],
    ["sub_tick", "1", "tick within the step, from 0", "loop"],
    [
        "state",
        "1",
        "phase of the test, by the table below",
        "loop",
    ],
    [
        "hold",
        "1",
        "requests of the operator, by the table below",
        "operator",
    ],
    ["time", "s", "test time", "loop"],
    [
        "ground",
        "m/s² or m",
        "acceleration of the ground, or displacement of the base",
        "excitation",
    ],
    [
        "xN",
        "m or rad",
        "displacement or rotation of DOF N",
        "integrator",
    ],
    ["vN", "m/s or rad/s", "velocity of DOF N", "integrator"],
    [
        "aN",
        "m/s² or rad/s²",
        "acceleration of DOF N, from equilibrium at the end of the step",
        "integrator",
    ],
    [
        "target_S_A",
        "m",
        "target: the deformation B·x, or the stroke for the pose B·x",
        "integrator",
    ],
    [
        "cmd_S_A",
        "unit of the axis",
        "command that was sent",
        "controller",
    ],
    [
        "meas_S_A",
        "m",
        "measured displacement at the structure's scale",
        "measured",
    ],
    [
        "force_S_A",
        "N",
        "restoring force that entered equilibrium",
        "measured",
    ],
    [
        "raw_disp_S_A",
        "unit of the axis",
        "measured displacement as received",
        "measured",
    ],
    [
        "raw_force_S_A",
        "unit of the axis",
        "measured force as received",
        "measured",
    ],
    [
        "kt_S_A",
        "N/m",
        "estimated tangent stiffness; the declared one until the axis has moved",
        "estimated",
    ],
    [
        "added_S_A",
        "J",
        "energy that the axis has added to the structure through its tracking error",
        "estimated",
    ],
    [
        "ct_S_A",
        "N s/m",
        "estimated tangent damping, where damping is declared",
        "estimated",
    ],
    [
        "lag_S_A",
        "s",
        "estimated lag of the measured displacement behind the target",
        "estimated",
    ],
    [
        "gain_S_A",
        "1",
        "estimated gain of the measured displacement over the target",
        "estimated",
    ],
    [
        "stiffness_S_A",
        "N/m",
        "stiffness fitted over the last seconds of motion",
        "estimated",
    ],
    [
        "false_c_S_A",
        "N s/m",
        "damping that the lag adds, negative if it takes energy out of the damping",
        "estimated",
    ],
    [
        "margin_S_A",
        "s",
        "critical delay minus lag; the test grows below 0",
        "estimated",
    ],
    [
        "comp_NAME_S_A",
        "of the parameter",
        "parameter NAME of the compensator",
        "controller",
    ],
    [
        "pose_S_C",
        "m or rad",
        "target pose B·x of a loading unit",
        "integrator",
    ],
    [
        "pose_meas_S_C",
        "m or rad",
        "pose from the measured strokes",
        "measured",
    ],
    [
        "pose_force_S_C",
        "N or N m",
        "force that entered equilibrium, in the coordinate",
        "measured",
    ],
    [
        "seq_S",
        "1",
        "number of the newest command in force when the specimen was sampled",
        "measured",
    ],
    [
        "status_S",
        "1",
        "status flags, by the table below",
        "measured",
    ],
    ["stability_used", "1", "stability margin used", "estimated"],
    [
        "delay_used",
        "1",
        "largest lag over the critical delay",
        "estimated",
    ],
    [
        "step_audit",
        "1",
        "relative energy error of the integration",
        "integrator",
    ],
    [
        "added_energy_share",
        "1",
        "energy added by tracking errors over the energy that the test has taken in",
        "estimated",
    ],
    [
        "release_s",
        "s",
        "wall time from the first edge to the edge of this tick",
        "clock",
    ],
    [
        "wakeup_lateness_s",
        "s",
        "from the edge to the first instruction after waiting",
        "clock",
    ],
    [
        "command_lateness_s",
        "s",
        "from the edge to the end of the last send",
        "clock",
    ],
    [
        "round_trip_s",
        "s",
        "from the last send to the last decoded reply",
        "clock",
    ],
    [
        "compute_s",
        "s",
        "from the last decoded reply to the next command",
        "clock",
    ],
    [
        "stretched",
        "1",
        "whole ticks by which the grid has moved so far",
        "clock",
    ],
    [
        "record_before_s",
        "s",
        "for the tick before: from the next command to the row handed over",
        "clock",
    ],
];

/// Columns of the record of `gusset serve`.
pub const SERVER_COLUMNS: &[ColumnRow] = &[
    ["step", "1", "number of the exchange, from 0", "server"],
    ["sub_tick", "1", "always 0", "server"],
    [
        "state",
        "1",
        "2 before the test, 3 running, 8 command not passed on",
        "server",
    ],
    ["time", "s", "test time of the command", "controller"],
    [
        "elapsed",
        "s",
        "test time since the command before, or since the last commit",
        "controller",
    ],
    [
        "command",
        "1",
        "the controller's number of the command",
        "controller",
    ],
    ["commits", "1", "commands accepted so far", "server"],
    [
        "trip",
        "1",
        "cause of a trip: 0 none; 1 to 11 a limit; 50, 51 not finite; 52 wrong first command; 60 interlock; 61 saturated; 62 watchdog; 70 specimen lost",
        "server",
    ],
    [
        "received_s",
        "s",
        "wall time from the start of the test to the command",
        "clock",
    ],
    [
        "round_trip_s",
        "s",
        "from the command to the specimen's answer",
        "clock",
    ],
    [
        "target_1_A",
        "m or rad",
        "displacement that the controller asks for",
        "controller",
    ],
    [
        "cmd_1_A",
        "unit of the axis",
        "command that was passed on; NaN if none was",
        "server",
    ],
    ["meas_1_A", "m or rad", "measured displacement", "measured"],
    ["force_1_A", "N or N m", "measured force", "measured"],
    [
        "raw_disp_1_A",
        "unit of the axis",
        "measured displacement as received",
        "measured",
    ],
    [
        "raw_force_1_A",
        "unit of the axis",
        "measured force as received",
        "measured",
    ],
    [
        "vel_1_A",
        "unit of the axis per s",
        "velocity that came with the command",
        "controller",
    ],
    [
        "status_1",
        "1",
        "status flags that the controller received; 262144 if nothing was measured",
        "server",
    ],
];

const STATES: [[&str; 2]; 14] = [
    ["1", "static load: settling"],
    ["2", "wiring check"],
    ["3", "running"],
    ["4", "zeroing"],
    ["5", "ramp to the start position"],
    ["6", "hold"],
    ["7", "return move at the end"],
    ["8", "tripped"],
    ["10", "warm-up, recorded where needed"],
    ["11", "between two steps: towards a known target"],
    ["12", "between two steps: along the prediction"],
    ["13", "between two steps: slowing down"],
    ["14", "ended because a tick was too late"],
    ["15", "ended by the operator while a reply was awaited"],
];

const HOLDS: [[&str; 2]; 4] = [
    ["1", "the operator asks for a hold"],
    ["2", "the operator lets the test go on"],
    ["4", "the operator confirms the sensor readings"],
    [
        "-1",
        "a test that the operator stopped trips on its return move",
    ],
];

const FLAGS: [[&str; 3]; 9] = [
    ["1", "specimen", "interlock open"],
    ["2", "specimen", "holding by its own watchdog"],
    [
        "4",
        "specimen",
        "a sensor or an actuator at the end of its range",
    ],
    ["8", "simulated actuator", "iteration not converged"],
    ["65536", "loop", "link lost"],
    ["131072", "loop", "before the last command was sent"],
    ["262144", "loop", "stale: no new measurement"],
    ["524288", "loop", "reply not waited for"],
    [
        "1048576",
        "loop",
        "with 2: it held until its last command came",
    ],
];

pub fn columns() -> String {
    let mut text = String::from(
        "# Columns\n\n\
         This page lists every column of the recorded samples.\n\n\
         `samples.json` in the run folder lists the columns of a run in their order, with name, unit and meaning. \
         `gusset export` writes the same columns. In the names below `N` is a degree of freedom, `S` a specimen, `A` an axis and \
         `C` a coordinate of a loading unit. All count from 1. Which columns a run has depends on its test file.\n\n\
         ## Columns of a test\n\n| column | unit | meaning | origin |\n|---|---|---|---|\n",
    );
    for [name, unit, meaning, origin] in TEST_COLUMNS {
        let _ = writeln!(text, "| `{name}` | {unit} | {meaning} | {origin} |");
    }
    text.push_str("\n## The column `state`\n\n| value | phase |\n|---|---|\n");
    for [value, meaning] in STATES {
        let _ = writeln!(text, "| {value} | {meaning} |");
    }
    text.push_str(
        "\n## The column `hold`\n\nThe values add up.\n\n| value | meaning |\n|---|---|\n",
    );
    for [value, meaning] in HOLDS {
        let _ = writeln!(text, "| {value} | {meaning} |");
    }
    text.push_str("\n## The column `status_S`\n\nThe flags add up.\n\n| flag | set by | meaning |\n|---|---|---|\n");
    for [flag, by, meaning] in FLAGS {
        let _ = writeln!(text, "| {flag} | {by} | {meaning} |");
    }
    text.push_str(
        "\n## Columns of a server\n\n\
         `gusset serve --out DIR` writes one row per exchange.\n\n\
         | column | unit | meaning | origin |\n|---|---|---|---|\n",
    );
    for [name, unit, meaning, origin] in SERVER_COLUMNS {
        let _ = writeln!(text, "| `{name}` | {unit} | {meaning} | {origin} |");
    }
    text
}
