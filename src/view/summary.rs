//! `summary.json` of any version. The writer's own type is [`gusset_record::Summary`].

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::lenient;
use super::limits::LimitsView;
use super::timing::Timings;
use gusset_proof::RecordedVerdict;
use gusset_quantity::catalog::ending::Status;
use gusset_record::MissClasses;
use gusset_record::summary::{ClockKind, Lambda, LinkCounts, Peak};

/// How far a test came, and its losses.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Progress {
    /// Steps of integration.
    #[serde(deserialize_with = "lenient::field")]
    pub steps: Option<u64>,
    /// Δt in s of test time.
    #[serde(deserialize_with = "lenient::field")]
    pub dt: Option<f64>,
    /// Wall time of the loop in s.
    #[serde(deserialize_with = "lenient::field")]
    pub wall_seconds: Option<f64>,
    /// Ticks per second of wall time that were asked for.
    #[serde(deserialize_with = "lenient::field")]
    pub rate_hz: Option<f64>,
    /// Deadline misses, warm-up not counted.
    #[serde(deserialize_with = "lenient::field")]
    pub deadline_misses: Option<u64>,
    /// Deadline misses by class.
    #[serde(deserialize_with = "lenient::field")]
    pub miss_classes: Option<MissClasses>,
    /// Whole ticks by which the grid was moved.
    #[serde(deserialize_with = "lenient::field")]
    pub stretched_ticks: u64,
    /// Rows that did not reach the disk.
    #[serde(deserialize_with = "lenient::field")]
    pub rows_lost: u64,
}

/// Something that was asked of the operating system.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Feature {
    /// Its name.
    #[serde(alias = "name", deserialize_with = "lenient::field")]
    pub want: Option<String>,
    /// The request in words.
    #[serde(deserialize_with = "lenient::field")]
    pub asked: Option<String>,
    /// Whether it was granted.
    #[serde(deserialize_with = "lenient::field")]
    pub granted: bool,
    /// Why not.
    #[serde(deserialize_with = "lenient::field")]
    pub reason: Option<String>,
    /// How to obtain it.
    #[serde(deserialize_with = "lenient::field")]
    pub advice: Option<String>,
}

/// Requests to the operating system.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Realtime {
    /// Present in the record of a server.
    #[serde(deserialize_with = "lenient::field")]
    pub role: Option<String>,
    /// Processor of the loop.
    #[serde(deserialize_with = "lenient::field")]
    pub cpu: Option<u64>,
    /// Every request.
    #[serde(deserialize_with = "lenient::items")]
    pub features: Vec<Feature>,
}

/// Remarks for people, beside the numbers.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Remarks {
    /// Warnings of the run.
    #[serde(deserialize_with = "lenient::items")]
    pub warnings: Vec<String>,
    /// Findings that the user accepted: override and reason.
    #[serde(deserialize_with = "lenient::entries")]
    pub accepted: BTreeMap<String, String>,
    /// The verdict of `check` on the test.
    #[serde(deserialize_with = "lenient::field")]
    pub verdict: Option<RecordedVerdict>,
}

/// `summary.json`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct SummaryView {
    /// How the run ended, in the word of the file.
    #[serde(deserialize_with = "lenient::field")]
    pub status: Option<String>,
    /// Why, in words.
    #[serde(deserialize_with = "lenient::field")]
    pub reason: Option<String>,
    /// Version of the program.
    #[serde(deserialize_with = "lenient::field")]
    pub version: Option<String>,
    /// Which clock.
    #[serde(deserialize_with = "lenient::field")]
    pub clock: Option<ClockKind>,
    /// λ as used.
    #[serde(deserialize_with = "lenient::field")]
    pub lambda: Option<Lambda>,
    /// Steps, times and losses.
    #[serde(flatten)]
    pub progress: Progress,
    /// Largest magnitudes of the whole test.
    #[serde(deserialize_with = "lenient::field")]
    pub peak: Option<Peak>,
    /// Percentiles of the loop's timing.
    #[serde(deserialize_with = "lenient::field")]
    pub timing: Timings,
    /// Requests to the operating system.
    #[serde(deserialize_with = "lenient::field")]
    pub realtime: Realtime,
    /// Traffic by specimen.
    #[serde(deserialize_with = "lenient::entries")]
    pub link: BTreeMap<String, LinkCounts>,
    /// Limits of the test.
    #[serde(deserialize_with = "lenient::field")]
    pub limits: Option<LimitsView>,
    /// The machine, by topic.
    #[serde(deserialize_with = "lenient::entries")]
    pub machine: BTreeMap<String, String>,
    /// End position of each specimen, by name.
    #[serde(deserialize_with = "lenient::entries")]
    pub left: BTreeMap<String, String>,
    /// Warnings, accepted findings and verdict.
    #[serde(flatten)]
    pub remarks: Remarks,
}

impl SummaryView {
    /// How the run ended, if this version knows the word.
    #[must_use]
    pub(crate) fn ending(&self) -> Option<Status> {
        Status::of_word(self.status.as_deref()?)
    }

    /// True on the simulated clock.
    #[must_use]
    pub(crate) fn is_simulated(&self) -> bool {
        self.clock == Some(ClockKind::Simulated)
    }
}

impl From<Value> for SummaryView {
    /// Reads a summary of any version.
    fn from(value: Value) -> Self {
        Self::deserialize(value).unwrap_or_default()
    }
}
