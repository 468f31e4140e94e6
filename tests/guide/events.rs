//! The events in words. A test compares their names with those in the program.

use std::fmt::Write as _;

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
        "The warm-up kept the limits of `[timing]`: the test begins.",
        "`ticks`: judged; `missed`, `in_a_row`: misses; `mean_ns`, `longest_ns`: duration of a tick",
    ],
    [
        "no_go",
        "The warm-up did not keep the limits of `[timing]`: the test does not begin.",
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
