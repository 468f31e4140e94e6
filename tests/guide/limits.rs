//! The page of the guide that lists every limit, from the catalogue.

use std::fmt::Write as _;

use gusset_quantity::catalog::limit::{CheckedBy, Judges, Kind, Row, Scope, TABLE};

/// Further limits of the test and of links: key, unit, what is judged, default, table.
pub const FURTHER_LIMITS: [[&str; 5]; 5] = [
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
        "the ticks in 0.1 s, at least ten",
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

/// One limit, and who checks it or which table has its key.
fn line(text: &mut String, row: &Row, last: &str) {
    let unit = match row.unit {
        "m/s2" => "m/s²",
        "×" => "1",
        unit => unit,
    };
    let kind = match row.kind {
        Kind::Range => "range",
        Kind::Size => "size",
        Kind::Count if row.scope() == Scope::Axis => "size",
        Kind::Count => "count",
    };
    let _ = writeln!(
        text,
        "| `{}` | {unit} | {} | {kind} | {} | {last} |",
        row.key, row.judged, row.default
    );
}

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
    for row in TABLE.iter().filter(|row| row.scope() == Scope::Axis) {
        let by = match row.checked_by {
            CheckedBy::Server => "controller, gateway, Gusset server",
            CheckedBy::Gateway => "controller, gateway",
            CheckedBy::Controller => "controller",
        };
        line(&mut text, row, by);
    }
    text.push_str(
        "\nThe *controller* is `gusset run`. It checks a command before it is sent and every new measurement. A *gateway* is \
         `gusset serve` with a specimen behind a link. A *Gusset server* is any server of the Gusset protocol: the controller \
         announces these limits to it when a test begins.\n\n\
         ## Limits of the test\n\n\
         The controller checks them. The limits of deadline misses have these names in events. Their keys are `in_a_row`, \
         `in_window` and `in_total`.\n\n\
         | key | unit | what is judged | levels | default | table |\n|---|---|---|---|---|---|\n",
    );
    for row in TABLE.iter().filter(|row| row.scope() == Scope::Test) {
        let table = if row.judges == Judges::Misses {
            "`[timing.misses]`"
        } else {
            "`[safety]`"
        };
        line(&mut text, row, table);
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
