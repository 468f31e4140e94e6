//! The page of events, from the table of the catalogue.

use std::fmt::Write as _;

use gusset_quantity::catalog::event::{EVENTS, Writer};

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
    table(&mut text, Writer::Test);
    text.push_str(
        "\n## Events of a server\n\n\
         `gusset serve --out DIR` records each controller's test in a folder. Its `events.jsonl` also has these kinds. Where a \
         kind of the first table occurs there, `text` has the details.\n\n\
         | event | meaning | further fields |\n|---|---|---|\n",
    );
    table(&mut text, Writer::Server);
    text
}

/// The rows of the events that this program writes.
fn table(text: &mut String, writer: Writer) {
    for row in EVENTS.iter().filter(|row| row.writer == writer) {
        let _ = writeln!(
            text,
            "| `{}` | {} | {} |",
            row.name, row.meaning, row.fields
        );
    }
}
