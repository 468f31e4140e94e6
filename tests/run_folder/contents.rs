//! A run folder has all that the guide promises (guide: run-folder): every file and key, a CSV of the same bits, and a resolved.toml
//! from which the same test runs again, elsewhere.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::engine::prepare;
use crate::common::test_file::TestFile;
use crate::common::{FRAME, PATIENT, completed, copy, json, names, run, same_physics, say, write};
use gusset_quantity::catalog::ending::Cause;
use gusset_record::summary::Status;
use gusset_record::{Run, RunFolder};
use gusset_session::{self as session, Watches};
use serde_json::Value;
use sha2::{Digest, Sha256};
use tempfile::TempDir;

/// The timing quantities: keys of summary.json, timing.json and of the .hgrm files.
const QUANTITIES: [&str; 8] = [
    "wakeup_lateness",
    "command_lateness",
    "round_trip",
    "compute",
    "record",
    "tick_time",
    "slack",
    "miss",
];

/// A test with a record and a matrix to read, in a separate folder, and its run.
struct Archived {
    folder: TempDir,
    test: PathBuf,
    out: PathBuf,
}

/// A name as strong-motion databases give it: points, signs, letters.
const RECORD: &str = "RSN6_IMPVALL.I_I-ELC+180 ü.AT2";

fn archived() -> Archived {
    let folder = tempfile::tempdir().unwrap();
    let values: Vec<String> = (0..60)
        .map(|k| format!("{:.7E}", 0.2 * libm::sin(f64::from(k))))
        .collect();
    let record = format!(
        "PEER\nSomewhere\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 60, DT= .01 SEC\n{}\n",
        values.join(" ")
    );
    fs::create_dir(folder.path().join("in put")).unwrap();
    write(folder.path(), &format!("in put/{RECORD}"), &record);
    let text = FRAME.replace(
        "sine]\namplitude = 3.0\nfrequency_hz = 2.0",
        &format!("file]\npath = \"in put/{RECORD}\""),
    );
    let test = write(folder.path(), "test.toml", &text);
    let out = folder.path().join("runs/one");
    completed(&test, &out, &[]);
    Archived { folder, test, out }
}

fn keys(value: &Value) -> Vec<&str> {
    value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

#[test]
fn folder_has_exactly_the_contracts_files() {
    let Archived {
        test,
        out,
        folder: _kept,
    } = archived();
    let mut expected: Vec<String> = [
        "events.jsonl",
        "inputs",
        "report.html",
        "resolved.toml",
        "samples.bin",
        "samples.json",
        "summary.json",
        "test.toml",
        "timing.hlog",
        "timing.json",
    ]
    .map(str::to_owned)
    .to_vec();
    expected.extend(QUANTITIES.map(|key| format!("{key}.hgrm")));
    expected.sort();
    assert_eq!(names(&out), expected);
    assert_eq!(
        fs::read(out.join("test.toml")).unwrap(),
        fs::read(&test).unwrap()
    );

    let inputs = &json(&out, "summary.json")["inputs"];
    let path = inputs[0]["path"].as_str().unwrap();
    assert_eq!(
        names(&out.join("inputs")),
        [path.strip_prefix("inputs/").unwrap()]
    );
    let copy = fs::read(out.join(path)).unwrap();
    assert_eq!(
        copy,
        fs::read(test.parent().unwrap().join("in put").join(RECORD)).unwrap()
    );
    let digest: String = Sha256::digest(&copy)
        .iter()
        .map(|b| format!("{b:02x}"))
        .collect();
    assert_eq!(inputs[0]["sha256"], digest.as_str());

    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("Frame"));
    // The script that draws the charts names its source in a comment.
    let own = page.replace("http://www.w3.org/", "");
    let own = own.replace(include_str!("../../src/view/assets/uplot.min.js"), "");
    for outside in ["http://", "https://", "src=", "@import"] {
        assert!(!own.contains(outside), "not self-contained: {outside}");
    }
}

#[test]
fn summary_and_timing_have_their_keys() {
    let Archived {
        out, folder: _kept, ..
    } = archived();
    let summary = json(&out, "summary.json");
    for key in [
        "status",
        "reason",
        "steps",
        "dt",
        "lambda",
        "clock",
        "wall_seconds",
        "rate_hz",
        "deadline_misses",
        "stretched_ticks",
        "peak",
        "timing",
        "realtime",
        "link",
        "version",
        "rows_lost",
    ] {
        assert!(summary.get(key).is_some(), "{key}");
    }
    assert_eq!(
        (&summary["status"], &summary["clock"]),
        (&"completed".into(), &"simulated".into())
    );
    assert_eq!(
        (&summary["steps"], &summary["dt"]),
        (&100.into(), &0.005.into())
    );
    assert!(summary["lambda"].as_f64().unwrap() > 0.0);
    for (key, length) in [("displacement", 2), ("velocity", 2), ("acceleration", 2)] {
        let peaks = summary["peak"][key].as_array().unwrap();
        assert!(
            peaks.len() == length && peaks.iter().all(|p| p.as_f64().unwrap() > 0.0),
            "{key}"
        );
    }
    assert!(summary["peak"]["force"]["storey"][0].as_f64().unwrap() > 0.0);
    assert_eq!(
        keys(&summary["link"]["storey"]),
        [
            "sent",
            "received",
            "late",
            "lost",
            "corrupt",
            "duplicates",
            "recovered",
            "missed",
            "unreachable"
        ]
    );
    let timing = json(&out, "timing.json");
    for key in QUANTITIES {
        let entries = [&summary["timing"][key], &timing[key]];
        for entry in entries {
            for part in ["count", "min", "p50", "p90", "p99", "p99_9", "max"] {
                assert!(entry.get(part).is_some(), "{key}.{part}");
            }
        }
        let text = fs::read_to_string(out.join(format!("{key}.hgrm"))).unwrap();
        assert!(
            text.contains("Value") && text.contains("Percentile"),
            "{key}.hgrm"
        );
    }
    assert!(
        timing["round_trip"]["specimens"]["storey"]["count"]
            .as_u64()
            .unwrap()
            >= 101
    );
}

#[test]
fn events_have_tick_test_time_and_wall_time() {
    let Archived {
        out, folder: _kept, ..
    } = archived();
    let text = fs::read_to_string(out.join("events.jsonl")).unwrap();
    let events: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    for event in &events {
        for key in ["tick", "time", "wall", "event"] {
            assert!(event.get(key).is_some(), "{key} of {event}");
        }
        assert!(event["wall"].as_str().unwrap().ends_with('Z'));
    }
    let of = |name: &str| {
        events
            .iter()
            .find(|e| e["event"] == name)
            .unwrap_or_else(|| panic!("no {name}"))
    };
    assert_eq!(
        (&of("started")["tick"], &of("started")["time"]),
        (&0.into(), &0.0.into())
    );
    assert_eq!(
        (&of("ended")["tick"], &of("ended")["time"]),
        (&100.into(), &0.5.into())
    );
    assert_eq!(events.last().unwrap()["event"], "ended");
}

#[test]
fn csv_digits_read_back_to_the_same_bits() {
    let Archived { out, folder, .. } = archived();
    let file = folder.path().join("one.csv");
    let export = |file: &Path| {
        say([
            "export".as_ref(),
            out.as_os_str(),
            "--format".as_ref(),
            "csv".as_ref(),
            "--no-units-line".as_ref(),
            "--out".as_ref(),
            file.as_os_str(),
        ])
    };
    let said = export(&file);
    assert_eq!(
        (said.code, said.stdout.as_str()),
        (Some(0), ""),
        "{}",
        said.stderr
    );
    let text = fs::read_to_string(&file).unwrap();
    let mut lines = text.lines();
    let header = "time,x1,x2,v1,v2,a1,a2,target_1_1,cmd_1_1,meas_1_1,force_1_1,status_1,ground";
    assert_eq!(lines.next(), Some(header));
    let names: Vec<&str> = header.split(',').collect();
    let samples = Run::open(&out).unwrap().columns(&names).unwrap();
    let mut rows = 0;
    for (row, line) in lines.enumerate() {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields.len(), names.len());
        for ((field, column), name) in fields.iter().zip(&samples).zip(&names) {
            let read: f64 = field.parse().unwrap();
            assert_eq!(
                read.to_bits(),
                column[row].to_bits(),
                "{name} of row {row}: {field}"
            );
            let mantissa = field.split(['e', 'E']).next().unwrap();
            let digits = mantissa.chars().filter(char::is_ascii_digit).count();
            assert!(read == 0.0 || digits == 17, "{field} has {digits} digits");
        }
        assert_eq!(fields[0].parse::<f64>().unwrap(), row as f64 * 0.005);
        rows += 1;
    }
    assert_eq!(rows, 101, "t = 0 and 100 steps");
    let again = export(&file);
    assert_eq!(again.code, Some(2), "never over a file that exists");
    assert_eq!(fs::read_to_string(&file).unwrap(), text);
}

#[test]
fn resolved_toml_repeats_the_test_elsewhere() {
    let Archived { out, folder, .. } = archived();
    let resolved = fs::read_to_string(out.join("resolved.toml")).unwrap();
    assert!(resolved.contains("# requested \"auto\""), "{resolved}");
    // The folder is moved, and everything that the first run read is gone.
    let elsewhere = tempfile::tempdir().unwrap();
    let archive = elsewhere.path().join("archive");
    copy(&out, &archive);
    drop(folder);
    let again = elsewhere.path().join("again");
    completed(&archive.join("resolved.toml"), &again, &[]);
    same_physics(&archive, &again);
    let (one, two) = (json(&archive, "summary.json"), json(&again, "summary.json"));
    for key in ["steps", "dt", "lambda", "peak", "rate_hz", "inputs"] {
        assert_eq!(one[key], two[key], "{key}");
    }
    // And the resolved file resolves to itself, except for the comment beside the automatic λ.
    let plain = resolved.replace(" # requested \"auto\"", "");
    assert_eq!(
        fs::read_to_string(again.join("resolved.toml")).unwrap(),
        plain
    );
}

#[test]
fn overrides_are_in_resolved_toml() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let out = folder.path().join("out");
    let sets = [
        "time.duration_s=0.25",
        "integrator.lambda=4",
        "specimen.0.law.bouc_wen.yield_force_n=2e3",
        "safety.divergence_m=0.5",
    ];
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    completed(&test, &out, &sets);
    let resolved: toml::Table = fs::read_to_string(out.join("resolved.toml"))
        .unwrap()
        .parse()
        .unwrap();
    assert_eq!(resolved["time"]["duration_s"].as_float(), Some(0.25));
    assert_eq!(resolved["integrator"]["lambda"].as_float(), Some(4.0));
    let law = &resolved["specimen"][0]["law"]["bouc_wen"];
    assert_eq!(law["yield_force_n"].as_float(), Some(2e3));
    assert_eq!(resolved["safety"]["divergence_m"].as_float(), Some(0.5));
    assert_eq!(
        resolved["timing"]["on_miss"].as_str(),
        Some("stretch"),
        "defaults are there too"
    );
    assert_eq!(fs::read_to_string(out.join("test.toml")).unwrap(), FRAME);
    assert_eq!(json(&out, "summary.json")["steps"], 50);
}

#[test]
fn both_clocks_and_a_repeat_agree() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let at = |name: &str| folder.path().join(name);
    completed(&test, &at("one"), &[]);
    completed(&test, &at("two"), &[]);
    let real = [&["--clock", "real"][..], &PATIENT].concat();
    completed(&test, &at("real"), &real);
    same_physics(&at("one"), &at("two"));
    same_physics(&at("one"), &at("real"));
    assert_eq!(json(&at("real"), "summary.json")["clock"], "real");
    // The specimen did what the law is there for.
    let yielded = json(&at("one"), "summary.json")["peak"]["force"]["storey"][0]
        .as_f64()
        .unwrap();
    assert!(yielded > 1.5e3, "{yielded} N");
    // Exactly the columns that depend on wall time are marked.
    let run = Run::open(&at("real")).unwrap();
    let marked: BTreeMap<&str, bool> = run
        .layout()
        .columns()
        .iter()
        .map(|c| (c.name.as_str(), c.timing))
        .collect();
    let counts = [
        "stretched",
        "misses_",
        "skipped_by_",
        "exchanges_",
        "stale_",
    ];
    for (name, timing) in marked {
        let is_count = counts.iter().any(|count| name.starts_with(count));
        assert_eq!(timing, name.ends_with("_s") || is_count, "{name}");
    }
}

#[test]
fn a_run_is_never_written_over_another() {
    let Archived {
        test,
        out,
        folder: _kept,
    } = archived();
    let before = fs::read(out.join("samples.bin")).unwrap();
    let said = run(&test, &out, &["--set", "time.duration_s=0.1"]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert_eq!(fs::read(out.join("samples.bin")).unwrap(), before);
    assert_eq!(json(&out, "summary.json")["steps"], 100);
}

#[test]
fn run_is_named_after_its_title_and_start() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    for _ in 0..2 {
        let output = crate::common::gusset()
            .current_dir(folder.path())
            .arg("run")
            .arg(&test)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0));
    }
    let names = names(&folder.path().join("runs"));
    assert!(
        names.len() == 2 && names.iter().all(|name| name.starts_with("frame-20")),
        "{names:?}"
    );
}

/// A test on the simulated clock whose folder is changed by others at its last tick, when rows are in the file.
fn meddled(meddle: fn(&Path), is_required: bool) -> session::Finished {
    let home = tempfile::tempdir().unwrap();
    let mut text = FRAME.with("time.duration_s = 20");
    if is_required {
        text.push_str("[record]\nrequired = true\n");
    }
    let path = home.path().join("run");
    let folder = RunFolder::create(&path).unwrap();
    let watches = Watches {
        after_last_tick: Some(Box::new(move || {
            // The writer brings them there by itself.
            while fs::metadata(path.join("samples.bin")).map_or(0, |file| file.len()) < 10_000 {
                session::pause(std::time::Duration::from_millis(1));
            }
            meddle(&path);
        })),
        ..Watches::default()
    };
    let nobody = crossbeam_channel::never();
    session::run(prepare(&text), folder, nobody, watches, &mut |_| {}).unwrap()
}

/// Without its final event a run counts as killed.
#[test]
fn required_record_without_summary_stops() {
    // No written file replaces a folder with content.
    let occupy = |run: &Path| fs::create_dir_all(run.join("summary.json/other")).unwrap();
    for (is_required, wanted) in [(false, Cause::Done), (true, Cause::RecordDamaged)] {
        let finished = meddled(occupy, is_required);
        assert_eq!(finished.cause, wanted, "{}", finished.summary.reason);
        let unwritten = finished.unwritten.join("\n");
        assert!(unwritten.contains("summary.json"), "{unwritten}");
        let summary = finished.summary;
        assert_eq!(summary.status == Status::Stopped, is_required);
        let reason = summary.reason;
        let says = reason.contains("summary.json") && reason.ends_with(", and [record] required");
        assert_eq!(says, is_required, "{reason}");
    }
}

#[test]
fn changed_record_of_a_running_test_is_lost() {
    /// The change, its warnings, and the least and the most of 4001 rows that it costs.
    type Case = (fn(&Path), &'static [&'static str], [u64; 2]);
    let cases: [Case; 7] = [
        (|_| {}, &[], [0, 0]),
        (
            |run| {
                let file = fs::File::options()
                    .write(true)
                    .open(run.join("samples.bin"));
                file.unwrap().set_len(100).unwrap();
            },
            &["samples.bin was changed by others while the test ran"],
            [1, 4001],
        ),
        (
            |run| drop(fs::File::create(run.join("samples.bin")).unwrap()),
            &["samples.bin was changed by others while the test ran"],
            [1, 4001],
        ),
        (
            |run| {
                fs::copy(run.join("samples.bin"), run.join("x")).unwrap();
                fs::rename(run.join("x"), run.join("samples.bin")).unwrap();
            },
            &["samples.bin was replaced by another file while the test ran"],
            // Possibly all rows were in the copy.
            [0, 4001],
        ),
        (
            |run| fs::remove_file(run.join("samples.bin")).unwrap(),
            &["samples.bin was deleted while the test ran"],
            [4001, 4001],
        ),
        (
            |run| fs::remove_file(run.join("events.jsonl")).unwrap(),
            &["events.jsonl was deleted while the test ran"],
            [0, 0],
        ),
        (
            |run| {
                fs::remove_file(run.join("samples.json")).unwrap();
                fs::remove_file(run.join("test.toml")).unwrap();
            },
            &[
                "samples.json was deleted while the test ran",
                "test.toml was deleted while the test ran",
            ],
            [4001, 4001],
        ),
    ];
    for (meddle, said, [least, most]) in cases {
        let finished = meddled(meddle, false);
        let summary = &finished.summary;
        assert_eq!(finished.cause, Cause::Done, "{said:?}");
        assert_eq!(summary.steps, 4000);
        let lost = summary.rows_lost;
        assert!((least..=most).contains(&lost), "{said:?}: {lost} lost");
        for text in said {
            let told = summary.warnings.iter().any(|told| told.starts_with(text));
            assert!(told, "{text}: {:?}", summary.warnings);
        }
        let is_whole = said.is_empty();
        let told = |text: &String| text.contains("test ran");
        assert_eq!(summary.warnings.iter().any(told), !is_whole);

        let finished = meddled(meddle, true);
        let wanted = if is_whole {
            Cause::Done
        } else {
            Cause::RecordDamaged
        };
        assert_eq!(finished.cause, wanted, "{said:?}");
        let reason = &finished.summary.reason;
        assert_eq!(reason.contains("[record] required"), !is_whole, "{reason}");
    }
}
