//! The columns in words. A test compares their names with those in the program.

use std::fmt::Write as _;

use gusset::catalog::phase::{Phase, STATES};

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
        "judged_NAME_S_A",
        "of the limit",
        "value that limit NAME judged in this tick, where the limit has a level",
        "controller",
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
    // A row never has the first phase and the last one.
    let never = [Phase::Connected, Phase::Safe].map(Phase::state);
    for state in STATES.iter().filter(|state| !never.contains(state)) {
        let _ = writeln!(text, "| {} | {} |", state.code, state.sentence);
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
