//! Tests of a trace by its text. Rows and events are made by hand.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::Value;

use crate::Run;
use crate::export::{Choice, Exported, Extra, Format, Notice, Rows, export};
use crate::folder::tests::recorded;

const NAMES: [&str; 11] = [
    "step",
    "sub_tick",
    "state",
    "time",
    "release_s",
    "wakeup_lateness_s",
    "command_lateness_s",
    "round_trip_s",
    "compute_s",
    "stretched",
    "record_before_s",
];

/// Tick k of a test at 1 kHz, in µs: awake after 10, sent 5 later, answered after 200, ready after `compute`; recording
/// the tick before took `before`.
fn tick(k: u32, compute: f64, before: f64) -> Vec<f64> {
    let t = f64::from(k) * 1e-3;
    let step = f64::from(k);
    vec![
        step,
        0.0,
        3.0,
        t,
        t,
        10e-6,
        15e-6,
        200e-6,
        compute * 1e-6,
        0.0,
        before * 1e-6,
    ]
}

/// Twelve ticks; number 5 computes for 900 µs and ends 120 µs behind its deadline.
fn rows() -> Vec<Vec<f64>> {
    let before = |k: u32| {
        if k == 0 {
            f64::NAN
        } else {
            4.0 + f64::from(k - 1)
        }
    };
    let compute = |k: u32| if k == 5 { 900.0 - 4.0 } else { 100.0 };
    (0..12).map(|k| tick(k, compute(k), before(k))).collect()
}

/// The first edge on the loop's clock, ns.
const EDGE: u64 = 7_000_000_123;

const EVENTS: &str = r#"{"tick":0,"time":0.0,"clock_ns":6999000000,"event":"grid","of":"opening","first_edge_ns":6000000000}
{"tick":0,"time":0.0,"clock_ns":6999000001,"event":"grid","of":"test","first_edge_ns":7000000123}
{"tick":5,"time":0.005,"clock_ns":7006120123,"event":"miss","class":"taken_away","late_ns":120000,"steal_ms":10}
{"tick":9,"time":0.009,"clock_ns":7009500123,"event":"checkpoint"}
"#;

struct Home {
    _kept: tempfile::TempDir,
    run: PathBuf,
    out: PathBuf,
}

fn home(rows: &[Vec<f64>], events: &str) -> Home {
    let kept = tempfile::tempdir().unwrap();
    let run = kept.path().join("run");
    let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    recorded(&run, &NAMES, &rows);
    std::fs::write(run.join("events.jsonl"), events).unwrap();
    let out = kept.path().join("trace.json");
    Home {
        _kept: kept,
        run,
        out,
    }
}

fn traced(home: &Home, from: Option<f64>, to: Option<f64>) -> (Value, Exported) {
    let choice = Choice {
        from,
        to,
        ..Choice::all(Rows::Tick)
    };
    let run = Run::open(&home.run).unwrap();
    let exported = export(&run, Format::Trace, &choice, &Extra::default(), &home.out).unwrap();
    let text = std::fs::read_to_string(&home.out).unwrap();
    (serde_json::from_str(&text).unwrap(), exported)
}

/// A slice: line, name, begin and end in ns, as whole numbers.
type Slice = (u64, String, i64, i64);

fn ns(value: &Value) -> i64 {
    let us = value.as_f64().unwrap();
    let ns = (us * 1e3).round();
    assert!((us * 1e3 - ns).abs() < 1e-3, "{us} µs are no whole ns");
    ns as i64
}

fn slices(trace: &Value) -> Vec<Slice> {
    let events = trace["traceEvents"].as_array().unwrap();
    let slices = events.iter().filter(|event| event["ph"] == "X");
    slices
        .map(|event| {
            let begin = ns(&event["ts"]);
            let name = event["name"].as_str().unwrap().to_owned();
            (
                event["tid"].as_u64().unwrap(),
                name,
                begin,
                begin + ns(&event["dur"]),
            )
        })
        .collect()
}

fn on(trace: &Value, line: u64) -> Vec<(String, i64, i64)> {
    let all = slices(trace).into_iter();
    all.filter(|slice| slice.0 == line)
        .map(|(_, name, begin, end)| (name, begin, end))
        .collect()
}

/// In order of time, and on each line every slice is inside of the one that is open, or behind it.
fn well_formed(trace: &Value) {
    let mut last = f64::NEG_INFINITY;
    for event in trace["traceEvents"].as_array().unwrap() {
        let at = event["ts"].as_f64().unwrap();
        assert!(at >= last.max(0.0), "{event} behind {last}");
        last = at;
    }
    let mut open: BTreeMap<u64, Vec<i64>> = BTreeMap::new();
    for (line, name, begin, end) in slices(trace) {
        assert!(end >= begin);
        let open = open.entry(line).or_default();
        open.retain(|until| *until > begin);
        if let Some(until) = open.last() {
            assert!(
                end <= *until,
                "{name} on line {line} from {begin} to {end} sticks out of {until}"
            );
        }
        open.push(end);
    }
}

#[test]
fn slices_of_phases_cover_the_tick() {
    let home = home(&rows(), EVENTS);
    let (trace, _) = traced(&home, None, None);
    well_formed(&trace);
    let all = on(&trace, 3);
    let phases: Vec<_> = all
        .iter()
        .filter(|(name, ..)| !name.starts_with("miss"))
        .collect();
    let of = |k: i64| -> Vec<(&str, i64)> {
        let begin = k * 1_000_000;
        let inside = phases
            .iter()
            .filter(|(_, at, _)| (begin..begin + 1_000_000).contains(at));
        inside
            .map(|(name, at, end)| (name.as_str(), end - at))
            .collect()
    };
    let expected = [
        ("wake up", 10_000),
        ("send", 5_000),
        ("wait for replies", 200_000),
        ("compute", 100_000),
        // It is in the row behind: 4 µs and one more with every tick.
        ("record", 6_000),
        ("wait for the edge", 679_000),
    ];
    assert_eq!(of(2), expected);
    // Without a gap and without an overlap, from the first edge to the last command.
    let mut until = 0;
    for (name, begin, end) in &phases {
        assert_eq!(*begin, until, "{name}");
        until = *end;
    }
    assert_eq!(
        until, 11_315_000,
        "of the last tick nothing behind its command is known"
    );
    let of_last: Vec<&str> = of(11).iter().map(|(name, _)| *name).collect();
    assert_eq!(of_last, ["wake up", "send", "wait for replies", "compute"]);
}

#[test]
fn miss_covers_the_time_after_its_deadline() {
    let home = home(&rows(), EVENTS);
    let (trace, _) = traced(&home, None, None);
    let line = on(&trace, 3);
    let place = line
        .iter()
        .position(|(name, ..)| name.starts_with("miss"))
        .unwrap();
    let slice = |name: &str, from: i64, to: i64| (name.to_owned(), from, to);
    let expected = [
        slice("compute", 5_215_000, 6_000_000),
        slice("miss: taken away", 6_000_000, 6_120_000),
        slice("compute", 6_000_000, 6_111_000),
        slice("record", 6_111_000, 6_120_000),
        slice("wake up", 6_120_000, 6_120_000),
    ];
    assert_eq!(line[place - 1..place + 4], expected);
    let events = trace["traceEvents"].as_array().unwrap();
    let miss = events
        .iter()
        .find(|e| e["name"] == "miss: taken away")
        .unwrap();
    assert_eq!(
        (&miss["args"]["late_us"], &miss["args"]["steal_ms"]),
        (&120.0.into(), &10.into())
    );
    // Its event lies where the row was handed over.
    let instant = events
        .iter()
        .find(|e| e["name"] == "deadline missed")
        .unwrap();
    assert_eq!(
        (ns(&instant["ts"]), &instant["tid"]),
        (6_120_000, &4.into())
    );
    assert_eq!(
        line.iter()
            .filter(|(name, ..)| name.starts_with("miss"))
            .count(),
        1
    );
}

#[test]
fn miss_without_an_event_has_no_cause() {
    let kept: Vec<&str> = EVENTS
        .lines()
        .filter(|line| !line.contains("\"miss\""))
        .collect();
    let home = home(&rows(), &kept.join("\n"));
    let (trace, _) = traced(&home, None, None);
    well_formed(&trace);
    let missed = ("miss: cause not recorded".to_owned(), 6_000_000, 6_120_000);
    assert!(on(&trace, 3).contains(&missed));
}

#[test]
fn startup_rows_precede_the_test() {
    // Three ticks of the opening, 1 s before the test on the same clock; both count from their own first edge.
    let mut all: Vec<Vec<f64>> = (0..3).map(|k| tick(k, 100.0, f64::NAN)).collect();
    for row in &mut all {
        (row[0], row[2], row[3]) = (0.0, 5.0, 0.0);
    }
    all.extend(rows());
    let home = home(&all, EVENTS);
    let (trace, _) = traced(&home, None, None);
    well_formed(&trace);
    let waked: Vec<i64> = on(&trace, 3)
        .into_iter()
        .filter(|(name, ..)| name == "wake up")
        .map(|(_, at, _)| at)
        .collect();
    let apart = 1_000_000_123;
    assert_eq!(waked[..3], [0, 1_000_000, 2_000_000]);
    assert_eq!(waked[3..5], [apart, apart + 1_000_000]);
    assert_eq!(waked.len(), 15);
}

#[test]
fn older_folder_gives_a_partial_picture() {
    // Neither the column nor the edge, and a file of other threads that no version reads any more.
    let kept = tempfile::tempdir().unwrap();
    let run = kept.path().join("run");
    let short: Vec<Vec<f64>> = rows().into_iter().map(|row| row[..10].to_vec()).collect();
    let short: Vec<&[f64]> = short.iter().map(Vec::as_slice).collect();
    recorded(&run, &NAMES[..10], &short);
    std::fs::write(run.join("threads.bin"), "gusset-threads").unwrap();
    let told: Vec<&str> = EVENTS
        .lines()
        .filter(|line| !line.contains("\"grid\""))
        .collect();
    std::fs::write(run.join("events.jsonl"), told.join("\n")).unwrap();
    let out = kept.path().join("trace.json");
    let home = Home {
        _kept: kept,
        run,
        out,
    };
    let (trace, exported) = traced(&home, None, None);
    well_formed(&trace);
    assert_eq!(exported.notices, [Notice::Unfinished]);
    let line = on(&trace, 3);
    let named = |name: &str| line.iter().filter(|slice| slice.0 == name).count();
    assert_eq!(
        (named("record"), named("record, then wait for the edge")),
        (1, 10)
    );
    // The miss knows when it ended, and ties the events to the rows.
    assert!(line.contains(&("miss: taken away".to_owned(), 6_000_000, 6_120_000)));
}

#[test]
fn window_ends_with_the_last_record_phase() {
    let home = home(&rows(), EVENTS);
    let (trace, exported) = traced(&home, Some(0.0029), Some(0.0051));
    well_formed(&trace);
    assert_eq!(exported.notices, [Notice::Unfinished]);
    let slices = on(&trace, 3);
    assert_eq!(slices.first().unwrap().1, 3_000_000);
    assert_eq!(trace["otherData"]["clock_ns_at_zero"], EDGE as f64);
    let record = ("record".to_owned(), 6_111_000, 6_120_000);
    assert_eq!(slices.last(), Some(&record));
}
