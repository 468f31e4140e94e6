//! The verdict in `summary.json` and `check --json`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::errors::Errors;
use super::kind::Kind;

/// What follows from a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// No finding is an error.
    Clear,
    /// Every error was accepted by the user.
    Accepted,
    /// There are errors, and the test moves nothing but simulated specimens: it may run.
    Simulated,
    /// There are errors, and the test would move a specimen behind a link: it is refused.
    Refused,
}

/// A verdict in files: `verdict` of `summary.json` and of `check --json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordedVerdict {
    /// What follows from it.
    pub outcome: Outcome,
    /// Whether the loop is proven unstable.
    pub unstable: bool,
    /// Whether a specimen behind a link would move.
    pub behind_link: bool,
    /// Errors of the test; absent where they were not computed, and without a structure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors: Option<Errors>,
    /// Its findings.
    pub findings: Vec<RecordedFinding>,
}

/// One finding in files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordedFinding {
    /// Its subject.
    pub kind: Kind,
    /// "error", "accepted" or "warning".
    pub severity: String,
    /// Path of the key in the test file.
    pub key: String,
    /// The finding in words.
    #[serde(deserialize_with = "gusset_quantity::text::words")]
    pub text: String,
    /// The numbers that it states, SI; null for one that is not finite.
    pub numbers: BTreeMap<String, Option<f64>>,
    /// Allowed values and advice.
    pub help: Vec<String>,
}

impl RecordedVerdict {
    /// Says first that the loop is unstable, why, and whether the user accepted it. None if the loop is not unstable.
    #[must_use]
    pub fn headline(&self) -> Option<String> {
        let found = self.findings.iter();
        let mut found = found.filter(|one| one.kind == Kind::Unstable && one.severity != "warning");
        let first = found.next().filter(|_| self.unstable)?;
        let more = match found.count() {
            0 => String::new(),
            count => format!(" (and {count} more)"),
        };
        let accepted = match self.outcome {
            Outcome::Accepted => "; the user accepted this",
            _ => "",
        };
        Some(format!("UNSTABLE: {}{more}{accepted}", first.text))
    }
}
