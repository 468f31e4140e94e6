//! What a trace shows, judged by its text: rows, events and stamps made by hand.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::record::Run;
use crate::record::export::{Choice, Exported, Extra, Format, Notice, OnlyLoop, Rows, export};
use crate::record::folder::tests::recorded;
use crate::record::summary::ClockKind;
use crate::record::summary::tests::example;
use crate::record::threads::{Roll, ThreadEnd, ThreadLog, What, Who};

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

fn who() -> Who {
    Who {
        name: "gusset-test".to_owned(),
        id: 1042,
    }
}

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

/// Stamps of one thread: what, begin and end in µs from the first edge, amount.
fn stamped(run: &Path, stamps: &[(What, i64, i64, u64)]) {
    let path = run.join("threads.bin");
    let roll = Roll::new(|| 0, who);
    let mut log = ThreadLog::new(std::fs::File::create(path).unwrap(), roll.clone());
    let stamper = roll.enter();
    let at = |us: i64| EDGE.wrapping_add_signed(us * 1000);
    for (what, begin, end, amount) in stamps {
        stamper.pieces(*what, 1, at(*begin), at(*end), *amount);
    }
    assert_eq!(log.finish(0), 0);
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
fn every_phase_of_a_tick_is_a_slice_and_together_they_cover_it() {
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
        // It stands in the row behind: 4 µs and one more with every tick.
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
fn a_miss_lies_over_what_is_behind_the_deadline_and_names_its_cause() {
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
    // Its event stands where the row was handed over.
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
fn a_miss_whose_event_was_lost_is_seen_without_its_cause() {
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
fn other_threads_stand_on_their_lines_to_the_nanosecond_and_only_those_of_the_window() {
    let home = home(&rows(), EVENTS);
    let stamps = [
        (What::WriteRows, -5_000, -4_000, 9),
        (What::Look, 2_990, 3_010, 0),
        (What::WriteRows, 4_020, 4_040, 336),
        (What::WriteEvents, 4_050, 4_060, 70),
        (What::Drain, 4_000, 4_100, 8),
        (What::SyncRows, 4_900, 9_000, 4711),
        (What::Drain, 6_400, 6_410, 2),
    ];
    stamped(&home.run, &stamps);
    let (trace, exported) = traced(&home, Some(0.0029), Some(0.0051));
    well_formed(&trace);
    assert_eq!(exported.notices, [Notice::Unfinished]);
    let slice = |name: &str, from: i64, to: i64| (name.to_owned(), from * 1000, to * 1000);
    // Ticks 3 to 5; the look reaches into the first, the sync out of the last.
    let expected = [
        slice("look at the scheduler", 2_990, 3_010),
        slice("drain", 4_000, 4_100),
        slice("write rows", 4_020, 4_040),
        slice("write events", 4_050, 4_060),
        slice("sync rows", 4_900, 9_000),
    ];
    let of_ticks = on(&trace, 3).into_iter().map(|slice| slice.1);
    assert_eq!(
        (of_ticks.clone().min(), of_ticks.max()),
        (Some(3_000_000), Some(6_111_000))
    );
    // The look began before the first edge of the window; zero is that of the test.
    assert_eq!(on(&trace, 10), expected);
    let events = trace["traceEvents"].as_array().unwrap();
    let named = events
        .iter()
        .find(|e| e["name"] == "thread_name" && e["tid"] == 10);
    let name = named.unwrap()["args"]["name"].as_str().unwrap();
    assert_eq!(name, "gusset-test 1042");
    let rows = events.iter().find(|e| e["name"] == "drain").unwrap();
    assert_eq!(rows["args"]["rows"], 8);
    assert_eq!(trace["otherData"]["other_threads"], "shown");
    assert_eq!(trace["otherData"]["clock_ns_at_zero"], EDGE as f64);
    // The record phase of the last tick of the window stands in a row that is not of it.
    let last = on(&trace, 3).pop().unwrap();
    assert_eq!(last, slice("record", 6_111, 6_120));
}

#[test]
fn rows_before_the_test_stand_before_it_on_the_same_clock() {
    // Three ticks of the opening, 1 s before the test on the same clock; both count from their own first edge.
    let mut all: Vec<Vec<f64>> = (0..3).map(|k| tick(k, 100.0, f64::NAN)).collect();
    for row in &mut all {
        (row[0], row[2], row[3]) = (0.0, 5.0, 0.0);
    }
    all.extend(rows());
    let home = home(&all, EVENTS);
    stamped(&home.run, &[(What::Look, 500, 600, 0)]);
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
    let look = (
        "look at the scheduler".to_owned(),
        apart + 500_000,
        apart + 600_000,
    );
    assert_eq!(on(&trace, 10), [look]);
}

#[test]
fn a_folder_of_an_earlier_version_gives_the_picture_that_it_can() {
    // Neither the column, nor the edge, nor the file.
    let kept = tempfile::tempdir().unwrap();
    let run = kept.path().join("run");
    let short: Vec<Vec<f64>> = rows().into_iter().map(|row| row[..10].to_vec()).collect();
    let short: Vec<&[f64]> = short.iter().map(Vec::as_slice).collect();
    recorded(&run, &NAMES[..10], &short);
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
    let without = Notice::OnlyLoop(OnlyLoop::NotRecorded);
    assert_eq!(exported.notices, [Notice::Unfinished, without]);
    assert_eq!(
        trace["otherData"]["other_threads"],
        "the run has no threads.bin"
    );
    let line = on(&trace, 3);
    let named = |name: &str| line.iter().filter(|slice| slice.0 == name).count();
    assert_eq!(
        (named("record"), named("record, then wait for the edge")),
        (1, 10)
    );
    // The miss knows its own end, and ties the events to the rows.
    assert!(line.contains(&("miss: taken away".to_owned(), 6_000_000, 6_120_000)));
}

#[test]
fn a_file_of_threads_that_is_damaged_torn_or_foreign_is_said_and_never_in_the_way() {
    let home = home(&rows(), EVENTS);
    stamped(
        &home.run,
        &[(What::Look, 100, 110, 0), (What::Look, 200, 210, 0)],
    );
    let path = home.run.join("threads.bin");
    let bytes = std::fs::read(&path).unwrap();
    let mut damaged = bytes.clone();
    *damaged.last_mut().unwrap() ^= 1;
    let cases = [
        (&bytes[..bytes.len() - 5], ThreadEnd::Torn { bytes: 19 }, 1),
        (&damaged, ThreadEnd::Damaged { record: 3 }, 1),
        (
            &b"these are no stamps of any thread"[..],
            ThreadEnd::Foreign,
            0,
        ),
        (&b""[..], ThreadEnd::Clean, 0),
    ];
    for (bytes, end, looks) in cases {
        std::fs::write(&path, bytes).unwrap();
        let (trace, exported) = traced(&home, None, None);
        well_formed(&trace);
        assert_eq!(on(&trace, 10).len(), looks, "{end}");
        let said = exported.notices.contains(&Notice::Threads(end));
        assert_eq!(said, end != ThreadEnd::Clean, "{:?}", exported.notices);
        assert_eq!(on(&trace, 2).len(), 12);
    }
    std::fs::remove_file(&path).unwrap();
    std::fs::create_dir(&path).unwrap();
    let (_, exported) = traced(&home, None, None);
    let unreadable = |notice: &Notice| matches!(notice, Notice::OnlyLoop(OnlyLoop::Unreadable(_)));
    assert!(
        exported.notices.iter().any(unreadable),
        "{:?}",
        exported.notices
    );
}

#[test]
fn stamps_that_were_lost_are_told_where_they_were_lost() {
    let home = home(&rows(), EVENTS);
    let roll = Roll::new(|| 0, who);
    let file = std::fs::File::create(home.run.join("threads.bin")).unwrap();
    let mut log = ThreadLog::new(file, roll.clone());
    let stamper = roll.enter();
    // As many as the queue takes, and seven.
    let mut offered = 0;
    while log.lost() < 7 && offered < 100_000 {
        stamper.pieces(What::Look, 1, EDGE, EDGE + 1, 0);
        offered += 1;
    }
    log.turn(EDGE + 3_500_000);
    assert_eq!(log.finish(EDGE + 3_500_000), 7);
    let (trace, exported) = traced(&home, None, None);
    well_formed(&trace);
    assert!(exported.notices.contains(&Notice::StampsLost(7)));
    assert_eq!(on(&trace, 10).len(), offered - 7);
    let events = trace["traceEvents"].as_array().unwrap();
    let lost = events
        .iter()
        .find(|e| e["name"] == "stamps of threads lost")
        .unwrap();
    assert_eq!(
        (ns(&lost["ts"]), &lost["args"]["stamps"]),
        (3_500_000, &7.into())
    );
}

#[test]
fn on_the_simulated_clock_only_the_loop_is_shown_and_that_is_said() {
    let home = home(&rows(), EVENTS);
    stamped(&home.run, &[(What::Look, 100, 110, 0)]);
    let mut summary = example();
    (summary.clock, summary.rate_hz) = (ClockKind::Simulated, 1000.0);
    (summary.steps, summary.dt) = (11, 0.001);
    summary.rows_lost = 0;
    let text = serde_json::to_string(&summary).unwrap();
    std::fs::write(home.run.join("summary.json"), text).unwrap();
    let (trace, exported) = traced(&home, None, None);
    assert_eq!(exported.notices, [Notice::OnlyLoop(OnlyLoop::Simulated)]);
    assert!(on(&trace, 10).is_empty() && !on(&trace, 3).is_empty());
    let why = trace["otherData"]["other_threads"].as_str().unwrap();
    assert!(why.contains("simulated clock"), "{why}");
}
