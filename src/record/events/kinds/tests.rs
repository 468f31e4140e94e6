//! Every kind of event: its line, its sentence, and what is read back.

use super::super::EventLine;
use super::*;
use gusset_quantity::catalog::event::{EVENTS, Severity};
use gusset_quantity::catalog::limit::{Limit, Scope};
use serde_json::json;

/// A line of every variant, as in run folders. The lines of a server with the name of a test's event come last.
fn examples() -> Vec<Value> {
    let standing = json!({"specimen": 1, "axis": 2, "found": 0.5, "left": 0.25, "within": 0.125});
    let warm_up =
        json!({"ticks": 100, "missed": 2, "in_a_row": 1, "mean_ns": 9000, "longest_ns": 50_000});
    let reached =
        json!({"specimen": 1, "axis": 1, "limit": "measured_force_n", "value": 2.0, "bound": 1.0});
    let of = |name: &str, fields: &Value| {
        let mut line = json!({"event": name});
        let fields = fields.as_object().unwrap().clone();
        line.as_object_mut().unwrap().extend(fields);
        line
    };
    vec![
        json!({"event": "files", "sha256": {"test.toml": "ab"}, "version": "0.2.0"}),
        json!({"event": "warning", "text": "the record is short"}),
        json!({"event": "not_granted", "text": "locked memory"}),
        json!({"event": "live_page", "address": "127.0.0.1:8080"}),
        json!({"event": "connected", "specimen": 1, "peer": "rig 2.1", "measures_disp": false, "standing": "0.5"}),
        json!({"event": "connected", "text": "rig 2.1"}),
        json!({"event": "grid", "of": "opening", "first_edge_ns": 12}),
        json!({"event": "phase", "from": "running", "to": "tripped", "cause": "stale", "specimen": 1}),
        json!({"event": "zeroed", "specimen": 1, "axis": 1, "disp": 0.5, "force": 2.0, "disp_noise_rms": 0.125, "force_noise_rms": 0.5}),
        json!({"event": "initial_force", "specimen": 1, "axis": 1, "of": "noise", "force": 20.0, "most": 10.0}),
        json!({"event": "confirmed"}),
        json!({"event": "probing", "specimen": 1}),
        json!({"event": "probing", "text": "a small motion"}),
        json!({"event": "direction", "specimen": 1, "axis": 1, "disp": 0.5, "force": 2.0}),
        json!({"event": "direction", "text": "axis 1"}),
        json!({"event": "wiring_accepted", "specimen": 1, "axis": 1, "what": "stiffness_differs"}),
        json!({"event": "wiring_accepted", "text": "a softer specimen"}),
        json!({"event": "retraced", "specimen": 1, "what": "complete"}),
        json!({"event": "retraced", "text": "back at the start"}),
        json!({"event": "direction_unknown", "specimen": 1, "axis": 1}),
        json!({"event": "misfit", "specimen": 1, "axis": 1, "what": "wrong_sign"}),
        of("stands", &standing),
        of("moved", &standing),
        json!({"event": "force_changed", "specimen": 1, "axis": 1, "left": 0.5, "found": 2.0, "within": 0.25, "taken_for_drift": true}),
        of("go", &warm_up),
        of("no_go", &warm_up),
        json!({"event": "started"}),
        json!({"event": "checkpoint", "digest": "00ab00ab00ab00ab"}),
        json!({"event": "checkpoint", "digest": "00ab00ab00ab00ab", "sha256": "0f".repeat(32)}),
        json!({"event": "hold_requested"}),
        json!({"event": "continue_requested"}),
        json!({"event": "continue_dropped", "hold": 1, "latest": 2}),
        json!({"event": "stop_requested"}),
        json!({"event": "control_request", "request": "hold", "from": "127.0.0.1:1", "accepted": false, "why": "the test has ended"}),
        json!({"event": "control_refused", "request": "hold", "from": "127.0.0.1:1", "why": "no token", "times": 3}),
        json!({"event": "pace", "from": "correct", "to": "slow_down", "share": 0.5}),
        of("limit_warning", &reached),
        of("limit_trip", &reached),
        json!({"event": "interlock", "specimen": 1}),
        json!({"event": "saturated", "specimen": 1}),
        json!({"event": "geometry", "specimen": 1, "axis": 2, "what": "too_short"}),
        json!({"event": "diverged", "dof": 3}),
        json!({"event": "specimen_holds", "specimen": 1}),
        json!({"event": "specimen_holds", "text": "it holds"}),
        json!({"event": "specimen_holds_on", "specimen": 1}),
        json!({"event": "unsettled", "specimen": 1, "ticks": 4}),
        json!({"event": "unsettled", "text": "4 answers"}),
        json!({"event": "miss", "class": "taken_away", "late_ns": 120_000, "stretched": 1, "steal_ms": 10, "involuntary_switches": 0, "minor_faults": 2, "waited_us": 5}),
        json!({"event": "miss", "class": "ours", "late_ns": 120_000, "stretched": 0}),
        json!({"event": "gap", "late_ns": 120_000, "ticks": 3}),
        json!({"event": "stale", "specimen": 1, "age": 2}),
        json!({"event": "recovered", "specimen": 1, "axis": 1, "age": 2, "force": 0.5}),
        json!({"event": "link", "specimen": 1, "fault": "timeout", "message": "no reply within the time limit"}),
        json!({"event": "link", "specimen": 1, "message": "connection refused"}),
        json!({"event": "link", "text": "the server is gone"}),
        json!({"event": "unacknowledged", "specimen": 1}),
        json!({"event": "last_words", "specimen": 1, "text": "it tripped"}),
        json!({"event": "last_words", "text": "it tripped"}),
        json!({"event": "row_lost"}),
        json!({"event": "rows_lost", "rows_lost": 3, "to_full_queue": 1, "to_file_error": 2}),
        json!({"event": "write_failed", "error": "no space left", "file": "samples.bin", "rows_lost": 3}),
        json!({"event": "write_recovered", "file": "samples.bin", "rows_lost": 3}),
        json!({"event": "record_damaged", "file": "samples.bin", "text": "samples.bin was cut"}),
        json!({"event": "internal_error", "text": "a panic"}),
        json!({"event": "ended"}),
        json!({"event": "controller", "peer": "127.0.0.1:1", "test": "frame", "software": "gusset 0.2.0"}),
        json!({"event": "armed_again", "text": "again"}),
        json!({"event": "ready", "specimen": "column", "remembers": false, "moves": true, "first": 3, "rate": [1000, 1], "start": [0.01],
            "limits": [[null, 0.05, 0.2, null]], "standing": [0.01], "measured": true, "force": [], "at_rest": [[0.01, 4e3]]}),
        json!({"event": "holding", "text": "no command"}),
        json!({"event": "commands_again", "text": "they come"}),
        json!({"event": "limit", "text": "a warning"}),
        json!({"event": "trip", "text": "too far", "what": "measured_force_n", "code": 6, "axis": 1, "unit": "N", "value": 2.0, "bound": 1.0}),
        json!({"event": "trip", "text": "interlock", "what": "interlock", "code": 3}),
        json!({"event": "faults", "text": "played"}),
        json!({"event": "left_aside", "text": "a commit"}),
        json!({"event": "client_without_commits", "text": "none"}),
        json!({"event": "client_reset", "text": "reset"}),
        json!({"event": "late_replies", "text": "late"}),
        json!({"event": "counts", "text": "3 commands"}),
    ]
}

#[test]
fn table_and_variants_of_events_agree() {
    for example in examples() {
        let fields = example.as_object().unwrap();
        let event: Event = serde_json::from_value(example.clone()).unwrap();
        assert!(!matches!(event, Event::Other { .. }), "{example}");
        assert_eq!(&event.fields(), fields);
        assert!(event.row().is_some(), "{example}");
        // Its sentence needs no field that the line does not have.
        let sentence = EventLine::from(example.clone()).sentence();
        let is_silent = event.row().unwrap().severity == Severity::Debug;
        assert!(!sentence.is_empty() || is_silent, "{example}");
        let name = event.name();
        assert!(
            !sentence.starts_with(&format!("{} (", name.replace('_', " "))),
            "{sentence}"
        );
    }
    for row in EVENTS {
        let mut all = examples().into_iter();
        assert!(all.any(|line| line["event"] == row.name), "{}", row.name);
    }
}

#[test]
fn line_of_another_version_keeps_its_fields() {
    let line = json!({"tick": 3, "time": 0.5, "wall": "2025-03-04T09:12:07Z", "clock_ns": 1, "event": "sang", "song": 4});
    let read = EventLine::from(line.clone());
    assert_eq!(
        (read.name(), read.tick, read.time),
        ("sang", Some(3), Some(0.5))
    );
    assert_eq!(Value::Object(read.to_map()), line);
    assert_eq!(read.sentence(), "sang (song 4)");
    // A known event with other fields.
    let read = EventLine::from(json!({"event": "stale", "since": 4}));
    assert!(matches!(read.event, Event::Other { .. }));
    assert_eq!(
        (read.name(), read.sentence().as_str()),
        ("stale", "stale (since 4)")
    );
}

#[test]
fn nan_is_null_in_the_file() {
    let reached = LimitReached {
        port: Some(0),
        axis: Some(0),
        limit: "command_disp_m".into(),
        value: f64::NAN,
        bound: 0.1,
    };
    let fields = Event::LimitTrip(reached).fields();
    assert_eq!(fields["value"], Value::Null);
    match serde_json::from_value(Value::Object(fields)).unwrap() {
        Event::LimitTrip(read) => assert!(read.value.is_nan() && read.port == Some(0)),
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_limit_survives_its_events() {
    for limit in Limit::OF_AXIS.into_iter().chain(Limit::OF_TEST) {
        let reached = LimitReached {
            port: Some(1),
            axis: Some(0),
            limit: limit.key().into(),
            value: 3.0,
            bound: 2.0,
        };
        let is_of_test = limit.scope() == Scope::Test;
        assert_eq!(reached.is_of_test(), is_of_test, "{limit:?}");
        for event in [
            Event::LimitWarning(reached.clone()),
            Event::LimitTrip(reached.clone()),
        ] {
            let fields = event.fields();
            assert_eq!(fields["limit"], limit.key());
            let read = EventLine::from(Value::Object(fields));
            assert_eq!(read.event, event);
            let sentence = read.sentence();
            let unit = match limit.shown_unit() {
                "1" => "",
                unit => unit,
            };
            let found = format!("{} is 3 {unit}", limit.key());
            assert!(sentence.contains(found.trim_end()), "{sentence}");
        }
    }
}

#[test]
fn sentence_names_specimen_and_rounds() {
    let sentence = |line: Value| EventLine::from(line).sentence();
    let trip = json!({"event": "limit_trip", "specimen": 1, "name": "column", "axis": 2, "limit": "measured_force_n", "value": 70_043.014_535, "bound": 7e4});
    assert_eq!(
        sentence(trip),
        "specimen \"column\", axis 2: TRIP: measured_force_n is 70.04 kN, allowed 70 kN"
    );
    let late =
        json!({"event": "limit_trip", "limit": "on_miss", "value": 0.0206, "bound": 1.0 / 1024.0});
    let words = sentence(late);
    for part in ["TRIP: ", "20.6 ms", "976.6 µs", "`timing.on_miss"] {
        assert!(words.contains(part), "no {part:?} in {words}");
    }
    let refused =
        json!({"event": "link", "specimen": 1, "name": "column", "message": "connection refused"});
    assert_eq!(
        sentence(refused),
        "specimen \"column\": could not be connected: connection refused"
    );
}

#[test]
fn only_what_ends_a_test_is_a_trip() {
    let latched = |line: Value| EventLine::from(line).event.latched().map(Word::into_owned);
    let link = |fault: &str| json!({"event": "link", "specimen": 1, "fault": fault});
    assert_eq!(latched(link("closed")), None);
    assert_eq!(latched(link("not_finite")).as_deref(), Some("not_finite"));
    assert_eq!(
        latched(json!({"event": "interlock", "specimen": 1})).as_deref(),
        Some("interlock")
    );
    let trip = json!({"event": "limit_trip", "limit": "measured_force_n"});
    assert_eq!(latched(trip).as_deref(), Some("measured_force_n"));
    assert_eq!(
        latched(json!({"event": "stale", "specimen": 1, "age": 2})),
        None
    );
}
