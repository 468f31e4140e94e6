//! The findings of a check, and the two kinds of rules that make most of them.

use std::sync::LazyLock;

use serde::Serialize;

use crate::certificate::value_at;
use crate::diagnose::Finding;
use crate::document::{KeyPath, Segment};
use crate::echo::number;
use crate::schema::TestFile;
use crate::steps::not_positive;
use crate::suggest::listed;
use Must::{AtLeast, AtMost, Be, Positive};
use gusset_quantity::text::is_hidden;

/// Keys of one table, separated by blanks (`*`: all keys), when they have no effect, and why.
pub(super) type Idle<When> = (&'static str, When, &'static str);
/// Keys of one table, separated by blanks, and what their numbers must be.
pub(super) type Range = (&'static str, Must);

/// The allowed numbers of a key. Other checks report infinity and NaN.
#[derive(Debug, Clone, Copy)]
pub(super) enum Must {
    /// Greater than zero.
    Positive,
    /// At most this number, with its unit and the reason.
    AtMost(f64, &'static str, &'static str),
    /// Zero, or at least this number, with its unit and the reason.
    AtLeast(f64, &'static str, &'static str),
    /// Inside a range, in words, with a label.
    Be(fn(f64) -> bool, &'static str, &'static str),
}

/// The least test file that has every table with defaults.
const LEAST: &str = "
time = { rate_hz = 1, duration_s = 1 }
[[excitation.prescribed_displacement]]
specimen = \"\"
signal = { sine = { amplitude = 0.0, frequency_hz = 1.0 } }
[[specimen]]
name = \"\"
transfer = {}
compensation = { ats = {} }
limits = {}
axis = [{ limits = {} }]
link = { address = \"\", openfresco = {} }
bus = { bus = \"\", axis = [] }
";

/// The default of every key that has one.
pub(super) static USUAL: LazyLock<toml::Value> = LazyLock::new(|| {
    let least = toml::from_str::<TestFile>(LEAST).ok();
    let values = least.and_then(|file| toml::Value::try_from(file).ok());
    values.unwrap_or_else(|| toml::Value::Table(toml::Table::new()))
});

/// The findings about a file so far.
#[derive(Debug)]
pub(super) struct Findings {
    pub list: Vec<Finding>,
    /// The file with every default.
    pub values: toml::Value,
}

impl Findings {
    /// No finding yet about this file.
    pub(super) fn of(file: &impl Serialize) -> Self {
        let mut list = Vec::new();
        let values = toml::Value::try_from(file).unwrap_or_else(|error| {
            let text = format!("the file cannot be written with its defaults: {error}");
            list.push(Finding::error(KeyPath::root(), text));
            toml::Value::Table(toml::Table::new())
        });
        Self { list, values }
    }

    pub(super) fn push(&mut self, finding: Finding) {
        self.list.push(finding);
    }

    /// The value at `path` in the file or by default.
    pub(super) fn value(&self, path: &KeyPath) -> Option<&toml::Value> {
        value_at(&self.values, path)
    }

    /// The places of these keys of the table at `at` whose values are not their defaults; `*` means all keys.
    pub(super) fn given(&self, at: &KeyPath, keys: &str) -> Vec<KeyPath> {
        let all = || match self.value(at) {
            Some(toml::Value::Table(table)) => table.keys().map(|key| at.key(key)).collect(),
            _ => Vec::new(),
        };
        let mut places: Vec<KeyPath> = match keys {
            "*" => all(),
            keys => keys.split_whitespace().map(|key| at.under(key)).collect(),
        };
        places.retain(|place| {
            let segments = place.segments().iter();
            let usual: KeyPath = segments
                .map(|segment| match segment {
                    Segment::Index(_) => Segment::Index(0),
                    key => key.clone(),
                })
                .collect();
            let value = self.value(place);
            value.is_some() && value != value_at(&USUAL, &usual)
        });
        places
    }

    /// A text that is shown to people holds nothing that a terminal would obey.
    pub(super) fn printable(&mut self, at: &KeyPath, text: Option<&str>) {
        if let Some(c) = text.and_then(|text| text.chars().find(|c| is_hidden(*c))) {
            let headline = format!("`{at}` contains a character that cannot be printed");
            let finding = Finding::error(at.clone(), headline);
            self.push(finding.label(format!("{}", c.escape_unicode())));
        }
    }

    /// The user's reasons in `[safety]` must have content, in characters that can be printed.
    pub(super) fn reasons(&mut self, keys: &str) {
        for at in self.given(&KeyPath::root().key("safety"), keys) {
            let reason = self.value(&at).and_then(toml::Value::as_str);
            let Some(reason) = reason.map(str::to_owned) else {
                continue;
            };
            self.printable(&at, Some(&reason));
            if !gusset_quantity::text::is_reason(&reason) {
                let headline = format!("`{at}` gives no reason");
                let label = "write a reason in words, which the summary repeats";
                self.push(Finding::error(at, headline).label(label));
            }
        }
    }

    /// Numbers from 1, none twice.
    pub(super) fn dofs(&mut self, at: &KeyPath, dofs: &[usize]) {
        if dofs.is_empty() {
            self.push(
                Finding::error(at.clone(), format!("`{at}` is empty"))
                    .label("at least one DOF is needed"),
            );
        }
        for (index, dof) in dofs.iter().enumerate() {
            let here = at.index(index);
            if *dof == 0 {
                self.push(
                    Finding::error(here, "there is no DOF 0").label("DOFs are counted from 1"),
                );
            } else if let Some(before) = dofs[..index].iter().position(|d| d == dof) {
                let finding =
                    Finding::error(here, format!("DOF {dof} is listed twice")).label("again here");
                self.push(finding.beside(at.index(before), "first here"));
            }
        }
    }

    /// Exactly one of these keys of the table at `at` is given.
    pub(super) fn exactly_one(&mut self, at: &KeyPath, allowed: &[&str], why: &str) {
        let is_given = |key: &&&str| self.value(&at.key(key)).is_some();
        let given: Vec<&str> = allowed.iter().filter(is_given).copied().collect();
        let headline = format!("`{at}` must have exactly one of {}", listed(allowed, "and"));
        let finding = match given.as_slice() {
            [_] => return,
            [] => Finding::error(at.clone(), headline).label("has none of them"),
            [first, second, ..] => Finding::error(at.key(second), headline)
                .at_key()
                .label(format!("`{second}` is given"))
                .beside(at.key(first), format!("and so is `{first}`")),
        };
        self.push(finding.help(why));
    }

    /// Warns of each of these keys of the table at `at` that is given: it has no effect.
    pub(super) fn no_effect(&mut self, at: &KeyPath, keys: &str, why: &str) {
        for key in self.given(at, keys) {
            let headline = format!("`{key}` has no effect");
            self.push(Finding::warning(key, headline).at_key().label(why));
        }
    }

    /// Warns of the keys of the table at `at` that have no effect; `holds` judges a condition.
    pub(super) fn idle<When>(
        &mut self,
        at: &KeyPath,
        rules: &[Idle<When>],
        holds: impl Fn(&When) -> bool,
    ) {
        for (keys, when, why) in rules {
            if !self.given(at, keys).is_empty() && holds(when) {
                self.no_effect(at, keys, why);
            }
        }
    }

    /// Refuses the numbers of the table at `at` that are out of their ranges.
    pub(super) fn numbers(&mut self, at: &KeyPath, ranges: &[Range]) {
        for (keys, must) in ranges {
            for key in keys.split_whitespace() {
                let at = at.under(key);
                let found = match self.value(&at) {
                    Some(toml::Value::Float(value)) => *value,
                    Some(toml::Value::Integer(value)) => *value as f64,
                    _ => continue,
                };
                if found.is_finite()
                    && let Some(finding) = must.refuse(at, found)
                {
                    self.push(finding);
                }
            }
        }
    }
}

impl Must {
    /// The finding for a number that is something else.
    fn refuse(self, at: KeyPath, found: f64) -> Option<Finding> {
        let (headline, label, help) = match self {
            Positive => return (found <= 0.0).then(|| not_positive(at, found)),
            AtMost(most, unit, why) if found > most => (
                format!("`{at}` must be at most {}{unit}", number(most)),
                format!("found {}", number(found)),
                Some(why),
            ),
            AtLeast(least, unit, why) if found > 0.0 && found < least => (
                format!("`{at}` must be at least {}{unit}", number(least)),
                format!("found {}", number(found)),
                Some(why),
            ),
            Be(is_allowed, words, label) if !is_allowed(found) => (
                format!("`{at}` is {}, but {words}", number(found)),
                label.to_owned(),
                None,
            ),
            _ => return None,
        };
        let finding = Finding::error(at, headline).label(label);
        Some(help.into_iter().fold(finding, Finding::help))
    }
}
