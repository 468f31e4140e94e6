//! A test file changed key by key, instead of text replaced in it.
#![allow(
    dead_code,
    reason = "every test is a separate crate and uses its share"
)]

use toml::{Table, Value};

/// Keys of a test in real time on a busy machine, where no number of misses stops it.
pub const NEVER_LATE: &str = "[timing]
policy = 'ordinary'
misses = { in_a_row.trip = 1000000, in_total.trip = 1000000, in_window.trip = 1000000 }
";

/// A test file as text, from which another one is made.
pub trait TestFile {
    /// This file with the keys of another piece of TOML. Tables merge, `[[specimen]]` adds a specimen, `[specimen.link]` belongs to
    /// the last specimen, and `specimen.0.storey` to the first.
    fn with(&self, keys: &str) -> String;

    /// This file without the key at `path`, which must be there.
    fn without(&self, path: &str) -> String;
}

impl TestFile for str {
    #[track_caller]
    fn with(&self, keys: &str) -> String {
        let mut file = parsed(self);
        merge(&mut file, parsed(keys));
        toml::to_string(&file).unwrap()
    }

    #[track_caller]
    fn without(&self, path: &str) -> String {
        let mut file = parsed(self);
        let mut keys = path.split('.');
        let last = keys.next_back().unwrap();
        let table = keys.fold(&mut file, |at, key| match key.parse::<usize>() {
            Ok(index) => &mut at[index],
            Err(_) => &mut at[key],
        });
        let removed = table.as_table_mut().unwrap().remove(last);
        assert!(removed.is_some(), "no {path}");
        toml::to_string(&file).unwrap()
    }
}

#[track_caller]
fn parsed(text: &str) -> Value {
    let read: Result<Table, _> = text.parse();
    Value::Table(read.unwrap_or_else(|error| panic!("{error}\n{text}")))
}

fn merge(into: &mut Value, from: Value) {
    match (into, from) {
        (Value::Table(into), Value::Table(from)) => {
            for (key, value) in from {
                match into.get_mut(&key) {
                    Some(there) => merge(there, value),
                    None => drop(into.insert(key, value)),
                }
            }
        }
        (Value::Array(into), Value::Table(from)) => {
            for (key, value) in from {
                match key.parse::<usize>() {
                    Ok(index) => merge(&mut into[index], value),
                    Err(_) => merge(
                        into.last_mut().unwrap(),
                        Table::from_iter([(key, value)]).into(),
                    ),
                }
            }
        }
        (Value::Array(into), Value::Array(from)) if from.first().is_some_and(Value::is_table) => {
            into.extend(from);
        }
        (into, from) => *into = from,
    }
}
