//! The variables of a MATLAB file of any level.

use std::collections::BTreeSet;

use super::columns::Columns;
use super::metadata;

/// Names of the variables that are no columns.
const OWN: [&str; 4] = ["units", "meanings", "summary", "metadata"];
/// Most letters of a name in MATLAB.
pub(super) const LONGEST_NAME: usize = 63;

/// The variables of a file of any level, without the values of the columns.
pub(super) struct Content {
    /// Names of the columns.
    pub names: Vec<String>,
    /// Structs of texts.
    pub structs: Vec<(&'static str, Vec<(String, String)>)>,
    /// The text of summary.json.
    pub summary: String,
}

impl Content {
    pub(crate) fn of(columns: &Columns) -> Self {
        let mut names: Vec<String> = Vec::new();
        let mut known = BTreeSet::new();
        for name in columns.plan.names(&OWN) {
            let mut name = identifier(&name);
            while !known.insert(name.clone()) {
                name.push('_');
            }
            names.push(name);
        }
        let described = || names.iter().zip(&columns.plan.columns);
        let units = described().map(|(name, c)| (name.clone(), c.column.unit.clone()));
        let meanings = described().map(|(name, c)| (name.clone(), c.column.meaning.clone()));
        let of_run = metadata(&columns.run).into_iter();
        let of_run = of_run.filter(|(key, _)| *key != "summary");
        let of_run = of_run.map(|(key, value)| (key.to_owned(), value));
        let [of_units, of_meanings, _, of_metadata] = OWN;
        Self {
            structs: vec![
                (of_units, units.collect()),
                (of_meanings, meanings.collect()),
                (of_metadata, of_run.collect()),
            ],
            summary: columns.text("summary.json"),
            names,
        }
    }
}

/// A name of MATLAB: letters, digits and underscores, a letter first.
fn identifier(name: &str) -> String {
    let is_begun = name.starts_with(|c: char| c.is_ascii_alphabetic());
    let letters = name.chars().map(|c| match c {
        c if c.is_ascii_alphanumeric() => c,
        _ => '_',
    });
    let begin = (!is_begun).then_some('x');
    begin
        .into_iter()
        .chain(letters)
        .take(LONGEST_NAME)
        .collect()
}
