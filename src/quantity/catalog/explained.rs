//! The meaning of a name that a file of a run has: an event, a cause, a column, a phase or a limit.
//!
//! The command `gusset guide NAME` prints it with the page of the guide that explains its table.

use super::column::{Each, SERVER, TEST};
use super::ending::Cause;
use super::limit::TABLE;
use super::phase::STATES;
use super::{column, ending, event, limit, phase};

/// A name with its meaning.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Explained {
    /// Kind of the name: "event", "column", …
    pub kind: &'static str,
    /// The name; of a column with letters in place of its numbers.
    pub name: String,
    /// Meaning in one sentence, with the unit where it has one.
    pub meaning: String,
    /// Page of the guide with the whole table.
    pub page: &'static str,
}

/// Every meaning of a name in the tables. A column is found by its name with numbers, such as `target_1_1`.
#[must_use]
pub fn explain(name: &str) -> Vec<Explained> {
    let mut found = Vec::new();
    let mut add = |kind, name: String, meaning: String, page| {
        let one = Explained {
            kind,
            name,
            meaning,
            page,
        };
        if !found.contains(&one) {
            found.push(one);
        }
    };
    if let Some(row) = event::find(name) {
        add(
            "event",
            row.name.to_owned(),
            row.meaning.to_owned(),
            event::PAGE,
        );
    }
    for cause in Cause::ALL.iter().filter(|cause| cause.word() == name) {
        let meaning = format!("{} Exit code {}.", cause.sentence(), cause.exit().code());
        add("cause", name.to_owned(), meaning, ending::PAGE);
    }
    for row in TABLE.iter().filter(|row| row.key == name) {
        let meaning = format!("{}, in {}", row.words, row.unit);
        add("limit", name.to_owned(), meaning, limit::PAGE);
    }
    for state in STATES.iter().filter(|state| state.word == name) {
        let meaning = format!("{}; {} in the column `state`", state.sentence, state.code);
        add("phase", name.to_owned(), meaning, phase::PAGE);
    }
    for (kind, table) in [("column", TEST), ("column of a server", SERVER)] {
        for one in table.iter().filter(|one| one.fits(name)) {
            let meaning = match one.each {
                Each::Test | Each::Dof | Each::Member => one.told(""),
                _ => one.told("the specimen"),
            };
            add(
                kind,
                one.pattern(),
                format!("{meaning} (unit: {})", one.unit),
                column::PAGE,
            );
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_of_the_tables_is_explained() {
        let pages =
            |name: &str| -> Vec<&str> { explain(name).iter().map(|one| one.page).collect() };
        for row in event::EVENTS {
            assert!(pages(row.name).contains(&event::PAGE), "{}", row.name);
        }
        for cause in Cause::ALL {
            assert!(
                pages(cause.word()).contains(&ending::PAGE),
                "{}",
                cause.word()
            );
        }
        for row in &TABLE {
            assert!(pages(row.key).contains(&limit::PAGE), "{}", row.key);
        }
        for state in STATES {
            assert!(pages(state.word).contains(&phase::PAGE), "{}", state.word);
        }
        for name in [
            "x12",
            "target_1_2",
            "comp_gain_2_1",
            "time",
            "seq_1",
            "commits",
        ] {
            assert!(pages(name).contains(&column::PAGE), "{name}");
        }
        assert_eq!(explain("no_such_name"), []);
    }
}
