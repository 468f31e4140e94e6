//! `timing.json`, and `timing` of `summary.json`: percentiles and counts of each timing quantity, in µs.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::lenient;

/// Count, extremes and percentiles of one timing quantity, in µs, by the keys of `timing.json`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Percentiles {
    /// Number of recorded values.
    pub count: u64,
    /// Smallest.
    pub min: Option<f64>,
    /// Median.
    pub p50: Option<f64>,
    /// Exceeded by one in ten.
    pub p90: Option<f64>,
    /// Exceeded by one in a hundred.
    pub p99: Option<f64>,
    /// Exceeded by one in a thousand.
    pub p99_9: Option<f64>,
    /// Largest.
    pub max: Option<f64>,
}

/// One timing quantity.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
pub struct TimingEntry {
    /// Number of recorded values.
    count: u64,
    #[serde(flatten)]
    percentiles: Percentiles,
    /// Upper edge of each bin and its count.
    #[serde(default, alias = "bins", deserialize_with = "bins")]
    pub histogram: Vec<(f64, u64)>,
    /// Round trips by specimen.
    #[serde(default, deserialize_with = "lenient::entries")]
    pub specimens: BTreeMap<String, TimingEntry>,
}

impl TimingEntry {
    /// Count and percentiles; of nothing that was counted only the count.
    #[must_use]
    pub(crate) fn percentiles(&self) -> Percentiles {
        match self.count {
            0 => Percentiles::default(),
            count => Percentiles {
                count,
                ..self.percentiles
            },
        }
    }
}

/// Every timing quantity by its key.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Timings(pub BTreeMap<String, TimingEntry>);

impl<'de> Deserialize<'de> for Timings {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        lenient::entries(deserializer).map(Self)
    }
}

impl From<Value> for Timings {
    /// Reads a file of any version.
    fn from(value: Value) -> Self {
        Self::deserialize(value).unwrap_or_default()
    }
}

/// Bins as upper edge and count, or as both edges and count.
fn bins<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<(f64, u64)>, D::Error> {
    let bins: Vec<Vec<f64>> = lenient::items(deserializer)?;
    let pair = |bin: Vec<f64>| match bin[..] {
        [.., upper, count] => Some((upper, count as u64)),
        _ => None,
    };
    Ok(bins.into_iter().filter_map(pair).collect())
}
