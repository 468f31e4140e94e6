//! `limits` of `summary.json`.

use serde::Deserialize;

use super::lenient;

/// One limit and how it was checked.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct LimitView {
    /// Its key in the test file.
    pub key: String,
    /// Unit of its values; "in …" for a count in a window.
    pub unit: String,
    /// Warning levels.
    #[serde(deserialize_with = "lenient::items")]
    pub warn: Vec<f64>,
    /// Trip levels.
    #[serde(deserialize_with = "lenient::items")]
    pub trip: Vec<f64>,
    /// Whether the server of the specimen checks it, too.
    pub also_at_the_specimen: bool,
    /// When and how it is checked, where that needs words.
    #[serde(deserialize_with = "lenient::field")]
    pub judged: Option<String>,
}

/// The limits of one specimen.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct SpecimenLimitsView {
    /// Its name.
    #[serde(deserialize_with = "lenient::field")]
    pub name: String,
    /// Limits of each axis.
    #[serde(deserialize_with = "lenient::items")]
    pub axes: Vec<Vec<LimitView>>,
    /// The program that checks them.
    #[serde(deserialize_with = "lenient::field")]
    pub checked_by: Option<String>,
    /// Treatment of a missing measurement.
    #[serde(deserialize_with = "lenient::field")]
    pub stale: Option<String>,
    /// Reaction of its watchdog.
    #[serde(deserialize_with = "lenient::field")]
    pub watchdog: Option<String>,
    /// How its wiring was checked.
    #[serde(deserialize_with = "lenient::field")]
    pub direction: Option<String>,
    /// The ends of a simulated actuator.
    #[serde(deserialize_with = "lenient::field")]
    pub ends: Option<String>,
    /// Where it moves at the end, m.
    #[serde(deserialize_with = "lenient::items")]
    pub safe_disp_m: Vec<f64>,
}

/// All limits of a test, and their consequences.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct LimitsView {
    /// By specimen.
    #[serde(deserialize_with = "lenient::items")]
    pub specimens: Vec<SpecimenLimitsView>,
    /// Limits of the test as a whole.
    #[serde(deserialize_with = "lenient::items")]
    pub test: Vec<LimitView>,
    /// Causes that end every test.
    #[serde(deserialize_with = "lenient::items")]
    pub always: Vec<String>,
    /// Quantities without a limit.
    #[serde(deserialize_with = "lenient::field")]
    pub unlimited: Option<String>,
    /// The startup.
    #[serde(deserialize_with = "lenient::field")]
    pub way_in: Option<String>,
    /// Effect of a late tick.
    #[serde(deserialize_with = "lenient::field")]
    pub on_miss: Option<String>,
    /// Effect of a trip.
    #[serde(deserialize_with = "lenient::field")]
    pub on_trip: Option<String>,
    /// Where the specimens are at the end.
    #[serde(deserialize_with = "lenient::field")]
    pub at_end: Option<String>,
}
