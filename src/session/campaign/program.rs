//! Identity of the program that computes a campaign: facts of its build, and the results of a fixed test.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::rehearsal::{Staging, staged};
use gusset_config::{ConfigError, parse};
use gusset_record::{Recorder, TimedEvent};
use gusset_setup as setup;

/// Two builds with equal facts and equal results are one program.
#[derive(Debug, Default, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Digest (BLAKE3) of the sources.
    pub sources: String,
    /// Digest (BLAKE3) of `Cargo.lock`.
    pub lock: String,
    /// Features, separated by commas.
    pub features: String,
    /// Platform.
    pub target: String,
    /// Version of the compiler.
    pub compiler: String,
    /// Digest (BLAKE3) of the results of a fixed test on this machine: see [`fixed_test`].
    pub results: String,
}

impl Program {
    const fn parts(&self) -> [(&'static str, &String); 6] {
        [
            ("the sources", &self.sources),
            ("Cargo.lock", &self.lock),
            ("the features", &self.features),
            ("the target", &self.target),
            ("the compiler", &self.compiler),
            ("the results of the fixed test", &self.results),
        ]
    }

    /// One digest of all parts.
    #[must_use]
    pub(crate) fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for (_, text) in self.parts() {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        }
        hasher.finalize().to_hex().to_string()
    }

    /// Names the parts that differ from those of the plan. It is empty for the same program.
    pub(super) fn differences(&self, planned: &Self) -> String {
        let both = planned.parts().into_iter().zip(self.parts());
        let differing = both.filter(|((_, planned), (_, own))| planned != own);
        let words = differing.map(|((name, planned), (_, own))| {
            format!("\n  {name}: {planned:?} in the plan, {own:?} here")
        });
        words.collect()
    }
}

/// Digest of all rows of a fixed test. Its structure, specimen and excitation need most of the functions whose bits could depend
/// on a processor or on a library of the system.
///
/// # Errors
/// [`ConfigError`] if the test is not valid, which is a mistake in Gusset.
pub fn fixed_test() -> Result<String, ConfigError> {
    let name = Path::new("fixed-test.toml");
    let loaded = parse(name, include_str!("fixed-test.toml").to_owned(), &[])?;
    let experiment = setup::build(&loaded)?.experiment;
    let hasher = Arc::new(Mutex::new(blake3::Hasher::new()));
    let columns = experiment.columns();
    let is_physical = columns.iter().map(|column| !column.timing).collect();
    let rows = Box::new(Rows(Arc::clone(&hasher), is_physical));
    let _ = staged(experiment, rows, Staging::AsItIs);
    let hasher = hasher.lock().unwrap_or_else(PoisonError::into_inner);
    Ok(hasher.finalize().to_hex().to_string())
}

/// Digests rows without the columns that depend on wall time.
struct Rows(Arc<Mutex<blake3::Hasher>>, Vec<bool>);

impl Recorder for Rows {
    fn row(&mut self, row: &[f64]) -> bool {
        let mut hasher = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for (value, _) in row.iter().zip(&self.1).filter(|(_, physical)| **physical) {
            hasher.update(&value.to_bits().to_le_bytes());
        }
        true
    }

    fn event(&mut self, _: TimedEvent) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_test_has_equal_bits_everywhere() {
        let expected = "e63328309b0aa6287ebb3df50f9c5d61d4b89b2023ef61d4a71e65397b13260a";
        assert_eq!(fixed_test().unwrap(), expected);
    }

    #[test]
    fn differing_parts_are_named() {
        let text = |text: &str| text.to_owned();
        let one = Program {
            sources: text("1a"),
            lock: text("2b"),
            features: text("hdf5"),
            target: text("x86_64"),
            compiler: text("rustc 1.95"),
            results: text("3c"),
        };
        assert_eq!(one.differences(&one), "");
        let other = Program {
            features: text("parquet"),
            results: text("4d"),
            ..one.clone()
        };
        let words = other.differences(&one);
        assert_eq!(words.lines().count(), 3, "{words}");
        assert!(words.contains("parquet") && words.contains("4d"), "{words}");
        assert_ne!(one.digest(), other.digest());
    }
}
