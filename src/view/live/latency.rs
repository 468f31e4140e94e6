//! How late and how long: counts of the timing columns of the rows, for a picture, for percentiles and for Prometheus.

use hdrhistogram::Histogram;
use serde::Serialize;

use gusset_quantity::catalog::column::{COMMAND_LATENESS, COMPUTE, ROUND_TRIP, WAKEUP};

/// The timing columns that are counted.
pub(super) const COLUMNS: [&str; 4] = [
    WAKEUP.name(),
    COMMAND_LATENESS.name(),
    ROUND_TRIP.name(),
    COMPUTE.name(),
];

/// Their other names: the keys of `timing.json`.
pub const KEYS: [&str; 4] = [
    "wakeup_lateness",
    "command_lateness",
    "round_trip",
    "compute",
];

/// Upper ends of the buckets in s; the last bucket has none.
pub const BOUNDS: [f64; 22] = [
    1e-7, 2e-7, 5e-7, 1e-6, 2e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2,
    2e-2, 5e-2, 1e-1, 2e-1, 5e-1, 1.0,
];

/// Values that one stall adds at most.
const MOST_VALUES: u64 = 1024;

/// Ticks in a row that the grid was moved past: the first is a tick less late than this many s, the next two ticks less, and so on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stall {
    pub late_s: f64,
    pub ticks: u64,
}

/// Counts of one quantity.
#[derive(Debug, Clone)]
pub(super) struct Latency {
    buckets: [u64; BOUNDS.len() + 1],
    sum: f64,
    /// In ns, two digits: enough for a picture and a percentile.
    histogram: Option<Histogram<u64>>,
}

/// Counts as displayed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LatencyView {
    /// Key of `timing.json`.
    pub key: &'static str,
    /// How many.
    pub count: u64,
    /// Their sum in s.
    pub sum: f64,
    /// Percentiles and the largest, in s.
    pub p50: f64,
    /// 99 % are below.
    pub p99: f64,
    /// 99.9 % are below.
    pub p99_9: f64,
    /// The largest.
    pub max: f64,
    /// How many in each bucket, the last without an upper end.
    pub buckets: Vec<u64>,
}

impl Latency {
    pub(crate) fn new() -> Self {
        Self {
            buckets: [0; BOUNDS.len() + 1],
            sum: 0.0,
            // Constant bounds that satisfy low ≥ 1, high ≥ 2 low and digits ≤ 5.
            histogram: Histogram::new_with_bounds(1, 10_000_000_000, 2).ok(),
        }
    }

    /// Counts one value in s. NaN is not counted, and an early value counts as late by 0.
    pub fn count(&mut self, seconds: f64) {
        self.count_some(seconds, 1);
    }

    /// Counts the ticks that a stall skipped, as the loop does: beyond [`MOST_VALUES`] neighbours share one value.
    pub(crate) fn swallowed(&mut self, stall: Stall, tick_s: f64) {
        let group = stall.ticks.div_ceil(MOST_VALUES).max(1);
        let mut done = 0;
        while done < stall.ticks {
            let count = group.min(stall.ticks - done);
            let middle = done + count.div_ceil(2);
            self.count_some(stall.late_s - middle as f64 * tick_s, count);
            done += count;
        }
    }

    fn count_some(&mut self, seconds: f64, times: u64) {
        if !seconds.is_finite() {
            return;
        }
        let seconds = seconds.max(0.0);
        let bucket = BOUNDS.partition_point(|bound| *bound < seconds);
        if let Some(count) = self.buckets.get_mut(bucket) {
            *count += times;
        }
        self.sum += seconds * times as f64;
        if let Some(histogram) = &mut self.histogram {
            histogram.saturating_record_n((seconds * 1e9) as u64, times);
        }
    }

    pub(crate) fn view(&self, key: &'static str) -> LatencyView {
        let at = |quantile| {
            let histogram = self.histogram.as_ref().filter(|h| !h.is_empty());
            histogram.map_or(f64::NAN, |h| h.value_at_quantile(quantile) as f64 * 1e-9)
        };
        LatencyView {
            key,
            count: self.buckets.iter().sum(),
            sum: self.sum,
            p50: at(0.5),
            p99: at(0.99),
            p99_9: at(0.999),
            max: at(1.0),
            buckets: self.buckets.to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_falls_into_its_bucket() {
        let mut latency = Latency::new();
        for seconds in [-1.0, 0.0, 1e-7, 1.1e-7, 0.9, 1.0, 1.1, f64::NAN] {
            latency.count(seconds);
        }
        let view = latency.view("compute");
        assert_eq!(view.count, 7, "what is no number is not counted");
        assert_eq!(view.buckets[0], 3, "0, early, and exactly the bound");
        assert_eq!(view.buckets[1], 1);
        assert_eq!(view.buckets[BOUNDS.len() - 1], 2, "0.9 and 1.0");
        assert_eq!(view.buckets[BOUNDS.len()], 1, "beyond the last");
        assert!((view.sum - (1e-7 + 1.1e-7 + 3.0)).abs() < 1e-12);
    }

    #[test]
    fn stall_counts_every_skipped_tick() {
        let mut latency = Latency::new();
        latency.count(3.5e-3);
        let stall = |late_s, ticks| Stall { late_s, ticks };
        latency.swallowed(stall(3.5e-3, 3), 1e-3);
        let view = latency.view("wakeup_lateness");
        assert_eq!(view.count, 4);
        assert!((view.sum - (3.5e-3 + 2.5e-3 + 1.5e-3 + 5e-4)).abs() < 1e-12);
        latency.swallowed(stall(60.0, 60_000), 1e-3);
        assert_eq!(latency.view("wakeup_lateness").count, 60_004);
    }

    #[test]
    fn percentiles_have_two_digits() {
        let mut latency = Latency::new();
        for k in 1..=1000 {
            latency.count(f64::from(k) * 1e-6);
        }
        let view = latency.view("compute");
        for (found, expected) in [
            (view.p50, 500e-6),
            (view.p99, 990e-6),
            (view.p99_9, 999e-6),
            (view.max, 1e-3),
        ] {
            // Two significant digits: cells are at most 1 % wide.
            assert!((found / expected - 1.0).abs() < 0.011, "{found} {expected}");
        }
        assert!(Latency::new().view("compute").p50.is_nan());
    }
}
