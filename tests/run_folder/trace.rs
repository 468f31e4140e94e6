//! The trace of a run: made by hand, and on the real clock.

use std::fs;

use gusset_record::Run;
use serde_json::Value;

use crate::common::{FRAME, PATIENT, completed, json, write};
use crate::exports::export;
use crate::readers::{by_hand, row};

pub fn phases(trace: &Value) -> Vec<&Value> {
    let events = trace["traceEvents"].as_array().unwrap();
    events.iter().filter(|event| event["ph"] == "X").collect()
}

/// Every number of the trace follows from the columns of `row`, and the moment of the miss from the event alone.
#[test]
fn trace_shows_every_phase_event_and_miss() {
    let temp = tempfile::tempdir().unwrap();
    let run = temp.path().join("run");
    // Tick 5 computes 1.9 ms: the edges of ticks 6 and 7 pass meanwhile.
    by_hand(
        &run,
        (0..10).map(|k| {
            let mut row = row(k);
            if k == 5 {
                row[10] = 1.9e-3;
            }
            row
        }),
    );
    // The loop's clock showed 7 s at the first edge. The miss was seen 1.25 ms behind its deadline, 6 ms after it.
    let events = [
        r#"{"tick":2,"time":0.002,"wall":"","clock_ns":7002500000,"event":"limit","specimen":1}"#,
        r#"{"tick":5,"time":0.005,"wall":"","clock_ns":7007250000,"event":"miss","class":"ours","late_ns":1250000}"#,
        r#"{"tick":9,"time":0.009,"wall":"","clock_ns":null,"event":"note"}"#,
        r#"{"tick":9,"time":"#,
    ];
    fs::write(run.join("events.jsonl"), events.join("\n")).unwrap();
    let said = export(&run, "trace", &temp.path().join("trace.json"), &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let trace = json(temp.path(), "trace.json");
    let all = trace["traceEvents"].as_array().unwrap();
    let mut last = 0.0;
    for event in all {
        let at = event["ts"].as_f64().unwrap();
        assert!(at >= last, "{event} after {last}");
        assert_eq!(event["pid"], 1);
        last = at;
    }
    let named = |event: &&&Value| event["ph"] == "M" && event["name"] == "thread_name";
    let threads: Vec<&Value> = all
        .iter()
        .filter(|e| named(&e))
        .map(|e| &e["args"]["name"])
        .collect();
    assert_eq!(threads, ["grid", "loop", "events"]);

    let slices = phases(&trace);
    let of = |name: &str| -> Vec<(f64, f64)> {
        let number = |event: &Value, key: &str| event[key].as_f64().unwrap();
        let found = slices.iter().filter(|event| event["name"] == name);
        found
            .map(|event| (number(event, "ts"), number(event, "dur")))
            .collect()
    };
    let close =
        |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-6 && (b - d).abs() < 1e-6;
    for k in 0..10_u32 {
        let (edge, index) = (f64::from(k) * 1e3, k as usize);
        assert!(close(of(&format!("step {k}"))[0], (edge, 1000.0)), "{k}");
        // Ticks 6 and 7 were due before the loop was done with tick 5 at 7215 µs.
        let begin = if k == 6 || k == 7 { continue } else { edge };
        // The time behind the deadline is a separate slice.
        let compute = if k == 5 { 685.0 } else { 100.0 };
        for (name, at, length) in [
            ("wake up", 0.0, 10.0),
            ("send", 10.0, 5.0),
            ("wait for replies", 15.0, 300.0),
            ("compute", 315.0, compute),
        ] {
            let parts = usize::from(name == "compute" && k > 5);
            let found = of(name)[index + parts];
            assert!(
                close(found, (begin + at, length)),
                "{name} of {k}: {found:?}"
            );
        }
    }
    assert!(close(of("miss: ours")[0], (6000.0, 1250.0)));
    assert!(close(of("compute")[6], (6000.0, 1215.0)));
    assert!(close(of("record")[0], (7215.0, 35.0)));
    // Slices of one line never overlap.
    let on_loop = slices.iter().filter(|event| {
        let name = event["name"].as_str().unwrap();
        event["tid"] == 3 && !name.starts_with("miss")
    });
    let mut until = 0.0;
    for slice in on_loop {
        let (at, length) = (
            slice["ts"].as_f64().unwrap(),
            slice["dur"].as_f64().unwrap(),
        );
        assert!(at >= until - 1e-3, "{slice} begins before {until}");
        until = at + length;
    }
    let instants: Vec<&Value> = all.iter().filter(|event| event["ph"] == "i").collect();
    let shown = |event: &Value| {
        let text = |key: &str| event[key].as_str().unwrap().to_owned();
        (text("name"), text("s"), event["ts"].as_f64().unwrap())
    };
    let expected = [
        ("limit", "t", 2500.0),
        ("deadline missed", "t", 7250.0),
        ("note", "t", 9000.0),
    ];
    let expected = expected.map(|(name, scope, at)| (name.to_owned(), scope.to_owned(), at));
    assert_eq!(
        instants
            .iter()
            .map(|event| shown(event))
            .collect::<Vec<_>>(),
        expected
    );
    assert_eq!(instants[1]["args"]["class"], "ours");
}

/// A second on the real clock. How long anything took decides nothing.
#[test]
fn real_clock_trace_shows_every_phase() {
    let temp = tempfile::tempdir().unwrap();
    let text = FRAME.replace("duration_s = 0.5", "duration_s = 1");
    let test = write(temp.path(), "test.toml", &text);
    let run = temp.path().join("run");
    let mut more = vec!["--clock", "real", "--set", "safety.zero_s=0.05"];
    more.extend(PATIENT);
    completed(&test, &run, &more);
    assert!(!run.join("threads.bin").exists());

    let opened = Run::open(&run).unwrap();
    let columns = opened.columns(&["release_s", "state"]).unwrap();
    let rows = columns[0].len();
    let events = opened.events().unwrap().to_json();
    let edge = |of: &str| {
        let mut lines = events.iter().filter(|e| e["event"] == "grid");
        lines.find(|e| e["of"] == of).unwrap()["first_edge_ns"]
            .as_u64()
            .unwrap()
    };
    let (opening, tested) = (edge("opening"), edge("test"));
    assert!(opening < tested);

    let record = opened.columns(&["record_before_s"]).unwrap().remove(0);
    let begun = columns[1].iter().position(|state| *state == 3.0).unwrap();
    assert!(
        record[..=begun].iter().all(|s| s.is_nan()),
        "earlier times are unknown"
    );
    assert!(record[begun + 1..].iter().all(|s| *s > 0.0));
    // Equal to the reading of the histogram, which has three digits.
    let largest = record.iter().copied().fold(0.0, f64::max) * 1e6;
    let summary = json(&run, "summary.json");
    let highest = summary["timing"]["record"]["max"].as_f64().unwrap();
    assert!(largest <= highest * 1.001, "{largest} {highest}");

    let out = temp.path().join("trace.json");
    let said = export(&run, "trace", &out, &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(!said.stderr.contains("warning"), "{}", said.stderr);
    let trace = json(temp.path(), "trace.json");
    assert_eq!(trace["otherData"]["clock_ns_at_zero"], opening as f64);
    let slices = phases(&trace);
    let count = |name: &str| slices.iter().filter(|slice| slice["name"] == name).count();
    assert_eq!(
        count("record"),
        rows - begun - 1,
        "one for every row but the last"
    );
    // The phases of the loop follow each other without a gap, from the first tick to the last.
    let mut until = 0.0;
    for slice in &slices {
        let name = slice["name"].as_str().unwrap();
        if slice["tid"] == 3 && !name.starts_with("miss") {
            let at = slice["ts"].as_f64().unwrap();
            assert!((at - until).abs() < 1.5e-3, "{name} at {at}, not {until}");
            until = at + slice["dur"].as_f64().unwrap();
        }
    }
}
