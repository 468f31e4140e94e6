//! Percentile files and interval logs.

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
        text.contains("\"max\":0.05,\"bins\":[[0.05,0.051,1]],\"early\":0"),
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
            let read: Histogram<u64> = Deserializer::new().deserialize(&mut &bytes[..]).unwrap();
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
