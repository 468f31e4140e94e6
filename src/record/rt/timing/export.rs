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
mod tests {
    use super::super::{TickStamps, histogram};
    use super::*;
    use gusset_quantity::time::Nanos;
    use hdrhistogram::serialization::Deserializer;
    use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};

    #[test]
    fn percentiles_of_one_to_a_thousand() {
        let mut h = histogram();
        for ns in 1..=1000 {
            h.saturating_record(ns);
        }
        // Below 2048 ns cells are 1 ns wide: exact. Rank of quantile q in n values is ⌈q n⌉.
        let expected = Percentiles {
            count: 1000,
            min: 0.001,
            p50: 0.5,
            p90: 0.9,
            p99: 0.99,
            p99_9: 0.999,
            max: 1.0,
        };
        assert_eq!(Percentiles::of(&h), expected);
    }

    #[test]
    fn large_values_are_good_to_three_digits() {
        let mut h = histogram();
        for ns in [7_700_123, 123_456_789] {
            h.saturating_record(ns);
        }
        let p = Percentiles::of(&h);
        assert!((p.max / 123_456.789 - 1.0).abs() < 1e-3, "{p:?}");
        assert!((p.min / 7_700.123 - 1.0).abs() < 1e-3, "{p:?}");
    }

    #[test]
    fn nothing_recorded_is_all_zero() {
        let p = Percentiles::of(&histogram());
        assert_eq!((p.count, p.min, p.p50, p.max), (0, 0.0, 0.0, 0.0));
    }

    #[test]
    fn json_has_the_firm_keys() {
        let mut timing = Timing::new(&["damper"], true, 0);
        timing.round_trip(0, 20_000);
        timing.tick(&TickStamps {
            woke: Nanos(50),
            ..TickStamps::default()
        });
        let json = serde_json::to_value(timing.summarised()).unwrap();
        let keys: Vec<&str> = json
            .as_object()
            .unwrap()
            .keys()
            .map(String::as_str)
            .collect();
        assert_eq!(
            keys,
            [
                "wakeup_lateness",
                "command_lateness",
                "round_trip",
                "compute",
                "record",
                "tick_time",
                "slack",
                "miss"
            ]
        );
        for (key, value) in json.as_object().unwrap() {
            for number in ["count", "min", "p50", "p90", "p99", "p99_9", "max"] {
                assert!(value[number].is_number(), "{key} {number}");
            }
        }
        assert_eq!(json["wakeup_lateness"]["p50"], 0.05);
        assert_eq!(json["round_trip"]["specimens"]["damper"]["count"], 1);
        let read: Percentiles = serde_json::from_value(json["compute"].clone()).unwrap();
        assert_eq!(read.count, 1);
        let kept = timing.with_bins();
        assert_eq!(kept.bins(Quantity::WakeupLateness), [(0.05, 0.051, 1)]);
        let text = serde_json::to_string(&kept).unwrap();
        assert_eq!(serde_json::from_str::<Timings>(&text).unwrap(), kept);
        assert!(
            text.contains("\"max\":0.05,\"bins\":[[0.05,0.051,1]],\"early\":0,\"swallowed\":0}"),
            "{text}"
        );
    }

    /// Worked by hand from the published algorithm: steps of 10 % up to the half, then of 5 % of the whole; the
    /// last cell is reached at 55 %, and the remaining steps in it are skipped.
    #[test]
    fn percentile_file_of_two_values_is_known() {
        let mut h = histogram();
        h.saturating_record(1000);
        h.saturating_record(2000);
        let mut text = Vec::new();
        write_hgrm(&h, &mut text).unwrap();
        let expected = "       Value     Percentile TotalCount 1/(1-Percentile)

       1.000 0.000000000000          1           1.00
       1.000 0.100000000000          1           1.11
       1.000 0.200000000000          1           1.25
       1.000 0.300000000000          1           1.43
       1.000 0.400000000000          1           1.67
       1.000 0.500000000000          1           2.00
       2.000 0.550000000000          2           2.22
       2.000 1.000000000000          2
#[Mean    =        1.500, StdDeviation   =        0.500]
#[Max     =        2.000, Total count    =            2]
#[Buckets =           24, SubBuckets     =         2048]
";
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }

    #[test]
    fn empty_percentile_file_has_its_frame() {
        let mut text = Vec::new();
        write_hgrm(&histogram(), &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.starts_with("       Value     Percentile"), "{text}");
        assert!(text.contains("Total count    =            0]"), "{text}");
    }

    #[test]
    fn interval_log_returns_every_histogram() {
        let mut timing = Timing::new(&["damper"], true, 0);
        for ns in [50, 60_000, 7_000_000] {
            timing.round_trip(0, ns);
        }
        let mut log = Vec::new();
        let started = Wall(1_700_000_000_000_000_000);
        timing
            .write_interval_log(&mut log, started, Duration::from_secs(30))
            .unwrap();
        let mut tags = Vec::new();
        for entry in IntervalLogIterator::new(&log) {
            if let LogEntry::Interval(interval) = entry.unwrap() {
                assert_eq!(interval.duration(), Duration::from_secs(30));
                let tag = interval.tag().unwrap().as_str().to_owned();
                let bytes = base64(interval.encoded_histogram());
                let read: Histogram<u64> =
                    Deserializer::new().deserialize(&mut &bytes[..]).unwrap();
                let quantity = Quantity::ALL.into_iter().find(|q| q.key() == tag).unwrap();
                assert_eq!(read, timing.histogram(quantity), "{tag}");
                tags.push(tag);
            }
        }
        assert_eq!(tags.len(), Quantity::ALL.len());
    }

    /// A separate decoder, so that the test does not depend on the writer's encoder.
    fn base64(text: &str) -> Vec<u8> {
        let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let (mut out, mut bits, mut held) = (Vec::new(), 0u32, 0);
        for byte in text.bytes().filter(|b| *b != b'=') {
            let digit = alphabet.iter().position(|a| *a == byte).unwrap() as u32;
            bits = bits << 6 | digit;
            held += 6;
            if held >= 8 {
                held -= 8;
                out.push((bits >> held & 0xff) as u8);
            }
        }
        out
    }
}
