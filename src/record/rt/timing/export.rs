//! Histograms as others read them: percentiles, JSON, the HdrHistogram percentile file and the V2 interval log.
//!
//! Everything leaves in microseconds, except the interval log, whose encoded histograms are in the recorded unit
//! (nanoseconds), as its format demands. Nothing here runs in the loop.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::time::Duration;

use hdrhistogram::Histogram;
use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{
    IntervalLogWriterBuilder, IntervalLogWriterError, Tag,
};
use serde::{Deserialize, Serialize};

use super::tally::BOUNDS;
use super::{Quantity, Timing};
use crate::in_order::InOrder;
use crate::rt::wall::Wall;

const NS_PER_US: f64 = 1e3;

/// A histogram in seven numbers, in microseconds; all zero when nothing was recorded.
///
/// Each is the largest value of its histogram cell, so at most 0.1 % above the true one (`min`: below).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[expect(
    missing_docs,
    reason = "the names are the keys of the file format and say what they are"
)]
pub struct Percentiles {
    pub count: u64,
    pub min: f64,
    pub p50: f64,
    pub p90: f64,
    pub p99: f64,
    pub p99_9: f64,
    pub max: f64,
}

impl Percentiles {
    /// Percentiles of a histogram of nanoseconds.
    #[must_use]
    pub(crate) fn of(histogram: &Histogram<u64>) -> Self {
        let at = |quantile| histogram.value_at_quantile(quantile) as f64 / NS_PER_US;
        let empty = histogram.is_empty();
        let edge = |ns: u64| if empty { 0.0 } else { ns as f64 / NS_PER_US };
        Self {
            count: histogram.len(),
            min: edge(histogram.min()),
            p50: at(0.5),
            p90: at(0.9),
            p99: at(0.99),
            p99_9: at(0.999),
            max: edge(histogram.max()),
        }
    }
}

/// One timing quantity of `timing.json`, and of `timing` in `summary.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TimingEntry {
    /// Count, extremes and percentiles.
    #[serde(flatten)]
    pub percentiles: Percentiles,
    /// The filled cells of the histogram in rising order: smallest value and first value beyond the cell in µs, and its count. The
    /// summary has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bins: Option<Vec<(f64, f64, u64)>>,
    /// Wake-ups before the edge, counted as lateness zero; of `wakeup_lateness`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub early: Option<u64>,
    /// Ticks that a stall skipped, counted in the histogram; of `wakeup_lateness`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub swallowed: Option<u64>,
    /// By specimen, in the order of the test; of `round_trip`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specimens: Option<InOrder<TimingEntry>>,
}

impl TimingEntry {
    fn of(histogram: &Histogram<u64>, with_bins: bool) -> Self {
        Self {
            percentiles: Percentiles::of(histogram),
            bins: with_bins.then(|| bins(histogram)),
            ..Self::default()
        }
    }
}

/// `timing.json`, and `timing` of `summary.json`: the timing quantities by their keys.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Timings(pub BTreeMap<Quantity, TimingEntry>);

impl Timings {
    /// Percentiles of a quantity; all zero where it was not recorded.
    #[must_use]
    pub fn percentiles(&self, quantity: Quantity) -> Percentiles {
        let entry = self.0.get(&quantity);
        entry.map(|entry| entry.percentiles).unwrap_or_default()
    }

    /// Filled cells of a quantity: both edges in µs and the count; none where they were not kept.
    #[must_use]
    pub fn bins(&self, quantity: Quantity) -> &[(f64, f64, u64)] {
        let entry = self.0.get(&quantity);
        entry
            .and_then(|entry| entry.bins.as_deref())
            .unwrap_or_default()
    }
}

#[cfg(any(test, feature = "test-doubles"))]
impl From<serde_json::Value> for Timings {
    fn from(timings: serde_json::Value) -> Self {
        serde_json::from_value(timings).expect("timings")
    }
}

/// The filled cells of a histogram of nanoseconds, in rising order: both edges in µs and the count.
fn bins(histogram: &Histogram<u64>) -> Vec<(f64, f64, u64)> {
    let us = |ns: u64| ns as f64 / NS_PER_US;
    let cells = histogram.iter_recorded().map(|cell| {
        let value = cell.value_iterated_to();
        (
            us(histogram.lowest_equivalent(value)),
            us(histogram.next_non_equivalent(value)),
            cell.count_at_value(),
        )
    });
    cells.collect()
}

impl Timing {
    /// The percentiles of each quantity, for `summary.json`.
    #[must_use]
    pub fn summarised(&self) -> Timings {
        self.timings(false)
    }

    /// Each quantity with its histogram, for `timing.json`.
    #[must_use]
    pub fn with_bins(&self) -> Timings {
        self.timings(true)
    }

    fn timings(&self, with_bins: bool) -> Timings {
        let entry = |quantity: Quantity| {
            let of_wakeups = |count: u64| (quantity == Quantity::WakeupLateness).then_some(count);
            let specimens = || {
                let each = self.round_trips();
                let each = each.map(|(name, histogram)| {
                    (name.to_owned(), TimingEntry::of(&histogram, with_bins))
                });
                InOrder(each.collect())
            };
            TimingEntry {
                early: of_wakeups(self.counts().early_wakeups),
                swallowed: of_wakeups(self.counts().swallowed),
                specimens: (quantity == Quantity::RoundTrip).then(specimens),
                ..TimingEntry::of(&self.histogram(quantity), with_bins)
            }
        };
        Timings(
            Quantity::ALL
                .map(|quantity| (quantity, entry(quantity)))
                .into(),
        )
    }

    /// Writes all quantities as one V2 interval log, tagged by key, over `duration` from `started`.
    ///
    /// # Errors
    /// The writer's.
    pub fn write_interval_log(
        &self,
        out: &mut impl Write,
        started: Wall,
        duration: Duration,
    ) -> io::Result<()> {
        let mut serializer = V2DeflateSerializer::new();
        let mut log = IntervalLogWriterBuilder::new()
            .add_comment("[recorded in nanoseconds, interval maxima in microseconds]")
            .with_start_time(started.system_time())
            .with_base_time(started.system_time())
            .with_max_value_divisor(NS_PER_US)
            .begin_log_with(out, &mut serializer)?;
        for quantity in Quantity::ALL {
            let histogram = self.histogram(quantity);
            log.write_histogram(
                &histogram,
                Duration::ZERO,
                duration,
                Tag::new(quantity.key()),
            )
            .map_err(|error| match error {
                IntervalLogWriterError::IoError(error) => error,
                IntervalLogWriterError::SerializeError(error) => {
                    io::Error::other(error.to_string())
                }
            })?;
        }
        Ok(())
    }
}

/// Writes a histogram of nanoseconds as an HdrHistogram percentile file (`.hgrm`), values in microseconds.
///
/// The format of HdrHistogram's `outputPercentileDistribution` with five steps per halving, as its plotters read.
///
/// # Errors
/// The writer's.
pub fn write_hgrm(histogram: &Histogram<u64>, out: &mut impl Write) -> io::Result<()> {
    let us = |ns: f64| ns / NS_PER_US;
    let digits = usize::from(BOUNDS.2);
    writeln!(
        out,
        "{:>12} {:>14} {:>10} {:>14}\n",
        "Value", "Percentile", "TotalCount", "1/(1-Percentile)"
    )?;
    let mut total = 0;
    for step in histogram.iter_quantiles(5) {
        total += step.count_since_last_iteration();
        let value = us(step.value_iterated_to() as f64);
        let quantile = step.quantile_iterated_to();
        write!(out, "{value:12.digits$} {quantile:14.12} {total:10}")?;
        if quantile < 1.0 {
            write!(out, " {:14.2}", 1.0 / (1.0 - quantile))?;
        }
        writeln!(out)?;
    }
    let max = if histogram.is_empty() {
        0
    } else {
        histogram.max()
    };
    writeln!(
        out,
        "#[Mean    = {:12.digits$}, StdDeviation   = {:12.digits$}]",
        us(histogram.mean()),
        us(histogram.stdev())
    )?;
    writeln!(
        out,
        "#[Max     = {:12.digits$}, Total count    = {:12}]",
        us(max as f64),
        histogram.len()
    )?;
    writeln!(
        out,
        "#[Buckets = {:12}, SubBuckets     = {:12}]",
        histogram.buckets(),
        sub_buckets()
    )
}

/// Cells of the finest range: the power of two that resolves 2·10^digits values.
const fn sub_buckets() -> u64 {
    (2 * 10u64.pow(BOUNDS.2 as u32)).next_power_of_two()
}

#[cfg(test)]
mod tests;
