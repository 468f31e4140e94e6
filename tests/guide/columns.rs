//! The page of the columns, from the catalogue.

use std::fmt::Write as _;

use gusset_quantity::catalog::column::{Each, Kind, SERVER, TEST};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::catalog::phase::{Phase, STATES};

const HOLDS: [[&str; 2]; 4] = [
    ["1", "from `hold` until `continue`"],
    ["2", "`continue` since the row before"],
    [
        "4",
        "confirmation of the sensor readings since the row before",
    ],
    [
        "-1",
        "a test that the operator stopped trips on its return move",
    ],
];

const COMMANDS: [[&str; 2]; 7] = [
    ["1", "hold"],
    [
        "2",
        "continue; it takes effect before a hold in the same row",
    ],
    ["4", "confirmation of the sensor readings"],
    ["8", "stop"],
    [
        "16",
        "no command: the test ended because a tick was too late",
    ],
    ["32", "stop while a reply was awaited"],
    [
        "64",
        "stop after which the specimens go back to where their motion began",
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
         `C` a coordinate of a loading unit. All count from 1. `D` is a direction, x, y or z, or the number of a component. Which columns a run has depends on its test file.\n\n\
         ## Columns of a test\n\n| column | unit | meaning | origin | recorded |\n|---|---|---|---|---|\n",
    );
    let first = TEST.iter().take_while(|kind| !kind.is_timing());
    first.for_each(|kind| row(&mut text, kind));
    for quantity in Limit::OF_TEST.iter().filter(|one| !one.is_of_misses()) {
        let (key, words) = (quantity.key(), quantity.words());
        let _ = writeln!(
            text,
            "| `{key}` | 1 | {words} | estimated | if the test can judge this limit |"
        );
    }
    let timing = TEST.iter().filter(|kind| kind.is_timing());
    timing.for_each(|kind| row(&mut text, kind));
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
    text.push_str(
        "\n## The column `operator`\n\nThe values add up.\n\n| value | command |\n|---|---|\n",
    );
    for [value, meaning] in COMMANDS {
        let _ = writeln!(text, "| {value} | {meaning} |");
    }
    text.push_str(
        "\n## The column `cause`\n\n| value | cause | meaning | exit code |\n|---|---|---|---|\n",
    );
    for cause in Cause::ALL {
        let (code, word, exit) = (cause.code(), cause.word(), cause.exit().code());
        let _ = writeln!(
            text,
            "| {code} | `{word}` | {} | {exit} |",
            cause.sentence()
        );
    }
    text.push_str("\n## The column `status_S`\n\nThe flags add up.\n\n| flag | set by | meaning |\n|---|---|---|\n");
    for [flag, by, meaning] in FLAGS {
        let _ = writeln!(text, "| {flag} | {by} | {meaning} |");
    }
    text.push_str(
        "\n## Columns of a server\n\n\
         `gusset serve --out DIR` writes one row per exchange. It has one specimen, so S is 1.\n\n\
         | column | unit | meaning | origin | recorded |\n|---|---|---|---|---|\n",
    );
    SERVER.iter().for_each(|kind| row(&mut text, kind));
    text
}

/// The row of a kind.
fn row(text: &mut String, kind: &Kind) {
    let meaning = kind.meaning.replace("{specimen}", "the specimen");
    let meaning = meaning.trim_end_matches(',');
    let of = if kind.each == Each::Dof {
        " (DOF N)"
    } else {
        ""
    };
    let by = if kind.codes.is_empty() {
        ""
    } else {
        ", by the table below"
    };
    let unit = match kind.unit {
        "specimen unit" => "unit of the axis".to_owned(),
        unit => unit.replace("s2", "s²"),
    };
    let (name, origin, when) = (kind.pattern(), kind.origin.word(), kind.when);
    let _ = writeln!(
        text,
        "| `{name}` | {unit} | {meaning}{of}{by} | {origin} | {when} |"
    );
}
