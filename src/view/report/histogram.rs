//! Timing histograms as read from `timing.json`: percentiles, and counts regrouped for a logarithmic axis.
//!
//! Invariant: regrouping moves counts between bins and never changes their sum. Percentiles are the recorded ones, not
//! computed again from the regrouped counts.

use gusset_record::rt::timing::{Percentiles, TimingEntry, Timings};

/// One timing quantity: its key, its percentiles, its counts if they were kept.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Timing {
    /// Key, with the specimen's name after it where there is one histogram per specimen.
    pub key: String,
    /// Percentiles.
    pub percentiles: Percentiles,
    /// Upper edge of a bin in µs and its count; empty if only percentiles were kept.
    pub histogram: Vec<(f64, u64)>,
}

/// Keys of the timing histograms in their order, each with a line of explanation (guide: real-time).
pub(super) const KEYS: [(&str, &str, &str); 8] = [
    (
        "wakeup_lateness",
        "Wake-up lateness",
        "from the release of the tick to the first instruction after the wait",
    ),
    (
        "command_lateness",
        "Command lateness",
        "from the release of the tick to the return of the last send",
    ),
    (
        "round_trip",
        "Round trip",
        "from the send to the decoded reply, ticks of a hold included",
    ),
    (
        "compute",
        "Compute",
        "from the last reply to the next command ready",
    ),
    (
        "record",
        "Record",
        "from the next command ready to the row pushed",
    ),
    (
        "tick_time",
        "Tick time",
        "from the first instruction after the wait to the row pushed",
    ),
    (
        "slack",
        "Slack",
        "from the row pushed to the next release, where that is later",
    ),
    (
        "miss",
        "Deadline misses",
        "from the next release to the row pushed, where that is later",
    ),
];

/// Title and explanation of a key.
pub(super) fn words(key: &str) -> (String, &'static str) {
    let (base, rest) = key
        .split_once(" · ")
        .map_or((key, None), |(base, rest)| (base, Some(rest)));
    let known = KEYS.iter().find(|(k, _, _)| *k == base);
    let title = known.map_or_else(
        || base.replace('_', " "),
        |(_, title, _)| (*title).to_owned(),
    );
    let title = rest.map_or_else(|| title.clone(), |rest| format!("{title}, {rest}"));
    (title, known.map_or("", |(_, _, meaning)| meaning))
}

/// Every quantity, in the order of the keys.
pub(super) fn read(timings: Option<&Timings>) -> Vec<Timing> {
    let mut found = Vec::new();
    for (quantity, entry) in timings.iter().flat_map(|timings| &timings.0) {
        let key = quantity.key();
        found.push(timing(key.to_owned(), entry));
        // Round trips are shown once for all specimens and, if there are several, once for each.
        let parts = entry.specimens.iter().flat_map(|parts| &parts.0);
        if parts.clone().nth(1).is_some() {
            found.extend(parts.map(|(part, entry)| timing(format!("{key} · {part}"), entry)));
        }
    }
    found
}

fn timing(key: String, entry: &TimingEntry) -> Timing {
    let bins = entry.bins.iter().flatten();
    Timing {
        key,
        percentiles: entry.percentiles,
        histogram: bins.map(|(_, to, count)| (*to, *count)).collect(),
    }
}

/// Counts in bins of equal width on a logarithmic axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LogBins {
    first: i64,
    /// Counts from the lowest bin upwards.
    pub counts: Vec<u64>,
}

/// Bins per decade: a bin is 12 % wide.
const PER_DECADE: f64 = 20.0;
/// One nanosecond: a recorded zero is shown here.
const SMALLEST_US: f64 = 1e-3;
/// A year: keeps a damaged file from asking for a picture without end.
const LARGEST_US: f64 = 3.2e13;

impl LogBins {
    /// Regroups (upper edge in µs, count); none if nothing was counted.
    pub(crate) fn new(histogram: &[(f64, u64)]) -> Option<Self> {
        // Lateness within one bin of an edge rounds to it: the edge is the largest value of its bin.
        let index = |us: f64| {
            let us = if us.is_nan() {
                LARGEST_US
            } else {
                us.clamp(SMALLEST_US, LARGEST_US)
            };
            libm::floor(libm::log10(us) * PER_DECADE + 1e-9) as i64
        };
        let filled = || {
            histogram
                .iter()
                .filter(|(_, count)| *count > 0)
                .map(|(us, count)| (index(*us), *count))
        };
        let first = filled().map(|(i, _)| i).min()?;
        let last = filled().map(|(i, _)| i).max()?;
        let mut counts = vec![0u64; (last - first) as usize + 1];
        for (i, count) in filled() {
            if let Some(cell) = counts.get_mut((i - first) as usize) {
                *cell = cell.saturating_add(count);
            }
        }
        Some(Self { first, counts })
    }

    /// Lower and upper edge of bin `i` in µs.
    pub(crate) fn edges(&self, i: usize) -> (f64, f64) {
        let at = |k: i64| libm::pow(10.0, k as f64 / PER_DECADE);
        let k = self.first + i as i64;
        (at(k), at(k + 1))
    }

    /// Largest count of any bin.
    pub(crate) fn top(&self) -> u64 {
        self.counts.iter().copied().max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    proptest! {
        #[test]
        fn regrouped_counts_keep_their_sum(
            bins in prop::collection::vec((prop_oneof![9 => 0.0f64..1e7, 1 => Just(f64::NAN)], 0u64..1_000_000), 0..200),
        ) {
            let sum: u64 = bins.iter().map(|b| b.1).sum();
            let regrouped = LogBins::new(&bins).map_or(0, |b| b.counts.iter().sum());
            prop_assert_eq!(sum, regrouped);
        }

        #[test]
        fn value_is_between_the_edges_of_its_bin(us in 0.002f64..1e6) {
            let (lo, hi) = LogBins::new(&[(us, 1)]).unwrap().edges(0);
            prop_assert!(lo <= us * (1.0 + 1e-9) && us < hi * (1.0 + 1e-9), "{lo} {us} {hi}");
        }
    }

    #[test]
    fn nothing_counted_gives_no_bins() {
        assert_eq!(LogBins::new(&[]), None);
        assert_eq!(LogBins::new(&[(3.0, 0)]), None);
    }

    #[test]
    fn timing_keys_keep_their_order() {
        let timings = Timings::from(json!({
            "compute": {"count": 2, "p50": 0.4},
            "wakeup_lateness": {"count": 3, "min": 0.05, "max": 9.0, "bins": [[0.05, 0.1, 2], [8.0, 9.0, 1]]},
            "round_trip": {"count": 5, "specimens": {"column": {"count": 5}}},
            "slack": {"count": 0, "max": 0.0, "bins": []},
            "record": {"count": 4, "bins": [[0.05, 0.051, 4]], "specimens": {"b": {"count": 1}, "a": {"count": 3}}},
        }));
        let found = read(Some(&timings));
        let keys: Vec<_> = found.iter().map(|t| t.key.as_str()).collect();
        assert_eq!(
            keys,
            [
                "wakeup_lateness",
                "round_trip",
                "compute",
                "record",
                "record · b",
                "record · a",
                "slack",
            ]
        );
        assert_eq!(found[0].histogram, [(0.1, 2), (9.0, 1)]);
        assert_eq!(found[3].histogram, [(0.051, 4)]);
        assert_eq!(words("round_trip · column").0, "Round trip, column");
        assert!(read(None).is_empty());
    }
}
