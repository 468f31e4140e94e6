//! The columns of a server's rows: one row per exchange. Those that `gusset export` and `gusset report` know have their names.

use crate::record::{COMMITS, Column};
use crate::units::AxisUnits;

pub(super) const HEAD: [(&str, &str, &str, bool); 10] = [
    ("step", "1", "number of the exchange, from 0", false),
    ("sub_tick", "1", "always 0: one row per exchange", false),
    (
        "state",
        "1",
        "2 = before the test: which way round it is wired is tried, or what it resists where it stands, 3 = running, 8 = not passed on, at a trip before it left or after one",
        false,
    ),
    ("time", "s", "test time of the command", false),
    (
        "elapsed",
        "s",
        "test time since the command before, or since the last commit",
        false,
    ),
    (
        "command",
        "1",
        "the controller's number of the command",
        false,
    ),
    (COMMITS, "1", "commands accepted so far", false),
    (
        "trip",
        "1",
        "0 = none; a limit: 1 command_disp, 2 command_step, 3 command_vel, 4 command_accel, 5 measured_disp, \
         6 measured_force, 7 following_error, 8 force_step, 9 stuck_sensor, 10 sensor_disp, 11 sensor_force; \
         50 command and 51 measurement not finite; 52 first command not where it was armed; 60 interlock, 61 saturated, 62 held by its own watchdog, 70 specimen lost",
        false,
    ),
    (
        "received_s",
        "s",
        "wall time from the start of the test to the command",
        true,
    ),
    (
        "round_trip_s",
        "s",
        "from the command to the specimen's answer",
        true,
    ),
];

pub(super) const AXIS: [(&str, &str); 7] = [
    ("target", "displacement that the controller asks for, in m"),
    (
        "cmd",
        "command sent to the specimen, in the unit of the axis; no command was sent where the state is 8",
    ),
    ("meas", "measured displacement, in m"),
    ("force", "measured force, in N"),
    ("raw_disp", "measured displacement in the unit of the axis"),
    ("raw_force", "measured force in the unit of the axis"),
    (
        "vel",
        "velocity that came with the command, in units of the axis per s",
    ),
];

pub(super) fn columns(units: &[AxisUnits], name: &str) -> Vec<Column> {
    let mut columns = Vec::new();
    let mut add = |name: String, unit: &str, meaning: String, timing| {
        columns.push(Column {
            name,
            unit: unit.to_owned(),
            meaning,
            timing,
        });
    };
    for (name, unit, meaning, timing) in HEAD {
        add(name.to_owned(), unit, meaning.to_owned(), timing);
    }
    for (axis, units) in (1..).zip(units) {
        for (kind, meaning) in AXIS {
            // A rotation stays one, and a moment too: there is nothing to bring into metres.
            let turns = units.disp == "rad";
            let unit = match kind {
                "target" | "meas" if turns => "rad",
                "force" if turns => "N m",
                "target" | "meas" => "m",
                "force" => "N",
                "raw_force" => units.force,
                _ => units.disp,
            };
            let meaning = format!("{meaning}; specimen \"{name}\", axis {axis}");
            add(format!("{kind}_1_{axis}"), unit, meaning, false);
        }
    }
    add(
        "status_1".to_owned(),
        "1",
        format!(
            "status flags as they went to the controller, and 262144 where nothing was measured, for the command was not passed on; \
             specimen \"{name}\""
        ),
        false,
    );
    columns
}
