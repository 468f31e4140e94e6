//! Findings of a collection.

use std::path::PathBuf;

use serde_json::Value;

use super::fragility::Collapses;
use super::largest::Largest;
use super::measure::End;

/// Findings and files of a collection.
#[derive(Debug, Clone, Default)]
pub struct Collected {
    /// The table.
    pub table: PathBuf,
    /// The report.
    pub report: PathBuf,
    /// Tasks of the campaign.
    pub tasks: u64,
    /// Tasks with a result.
    pub done: u64,
    /// Tasks whose test stopped before its end.
    pub stopped: u64,
    /// Tasks whose structure collapsed: the response diverged, or met the criterion of the study.
    pub collapsed: u64,
    /// Tasks that a limit or a fault stopped before a collapse.
    pub censored: u64,
    /// Tasks whose numbers were drawn again: the test file must not have the first ones.
    pub redrawn: u64,
    /// Tasks whose overrides give no valid test.
    pub invalid: u64,
    /// Why the first of them has none.
    pub invalid_example: Option<String>,
    /// Chunks with missing tasks, the first of them.
    pub open: Vec<u64>,
    /// Names of parts that were cut short.
    pub damaged: Vec<String>,
    /// Tasks that were computed again, with equal bits.
    pub proved: u64,
    /// Seed of their choice.
    pub proof_seed: u64,
    /// Counts of collapses with their curves, for the first points of the design.
    pub fragility: Vec<Collapses>,
    /// Tests with the largest values of each measure with pictures.
    pub largest: Vec<Vec<Largest>>,
    /// Content of `summary.json`.
    pub summary: Value,
}

impl Collected {
    /// True if every task has a result.
    #[must_use]
    pub const fn is_complete(&self) -> bool {
        self.done == self.tasks
    }
}

/// Values of one task for the pictures.
#[derive(Debug, Clone)]
pub(super) struct Shown {
    pub index: u64,
    /// Level of intensity.
    pub level: Option<f64>,
    /// True if the structure has collapsed; none if a limit or a fault stopped the test before.
    pub collapsed: Option<bool>,
    /// How the test ended.
    pub end: End,
    /// Draws before that of the test.
    pub attempt: u64,
    /// The measures with pictures.
    pub values: Vec<f64>,
}
