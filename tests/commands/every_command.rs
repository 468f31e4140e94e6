//! Every command as a lab's script uses it: help with an example, one JSON document on stdout and nothing else there, no privileges
//! needed, and exit code 2 for wrong usage.

use crate::common::test_file::TestFile;
use std::fs;

use crate::common::{FRAME, PATIENT, completed, gusset, json, names, say, write};
use serde_json::Value;

const COMMANDS: [&str; 8] = [
    "run", "check", "import", "jitter", "doctor", "export", "report", "schema",
];

/// All of stdout is one JSON document.
#[track_caller]
fn only_json(arguments: &[&str]) -> Value {
    let said = say(arguments);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    serde_json::from_str(&said.stdout).unwrap_or_else(|e| panic!("{e}:\n{}", said.stdout))
}

#[test]
fn help_of_every_command_shows_an_example() {
    let overview = say(["--help"]);
    assert!(overview.code == Some(0) && overview.stdout.contains("Example"));
    for command in COMMANDS {
        assert!(
            overview.stdout.contains(&format!("\n  {command} ")),
            "{command}"
        );
        let help = say([command, "--help"]);
        assert_eq!((help.code, help.stderr.as_str()), (Some(0), ""));
        let (_, example) = help
            .stdout
            .split_once("Example")
            .unwrap_or_else(|| panic!("{command}: no example"));
        assert!(example.contains(&format!("gusset {command}")), "{example}");
    }
    let version = say(["--version"]);
    assert_eq!(
        version.stdout,
        format!("gusset {}\n", env!("CARGO_PKG_VERSION"))
    );
}

#[test]
fn wrong_usage_exits_with_2() {
    for (arguments, words) in [
        (&["walk"][..], "'walk'"),
        (&["docter"], "'doctor'"),
        (&[], "Usage: gusset"),
        (&["run"], "<TEST>"),
        (
            &["run", "a.toml", "--clock", "sundial"],
            "[possible values: real, simulated]",
        ),
        (
            &["run", "a.toml", "--speed", "9"],
            "unexpected argument '--speed'",
        ),
        (
            &["export", ".", "--format", "xls", "--out", "a"],
            "designsafe]",
        ),
        (&["jitter", "--rate", "0"], "--rate \"0\""),
        (&["jitter", "--rate", "fast"], "--rate \"fast\""),
        (&["jitter", "--duration", "-1"], "--duration"),
        (
            &["jitter", "--model", "chain", "--rates", "256,never"],
            "--rates \"never\"",
        ),
        (&["jitter", "--rates", "256"], "--model"),
        (
            &["jitter", "--rates", "256", "--duration", "0.1"],
            "--rates is for --model",
        ),
        (
            &["jitter", "--quick", "--rate", "256"],
            "--quick is for --model",
        ),
        (
            &["jitter", "--model", "dome"],
            "[possible values: chain, frame]",
        ),
        (&["jitter", "--duration", "nan"], "--duration"),
        (&["jitter", "--priority", "99"], "1..=98"),
        (&["jitter", "--cpu", "4096"], "cpu is 4096"),
        (&["report", "/nowhere/at/all"], "/nowhere/at/all"),
        (&["export", "/", "--out", "/dev/null"], "run folder"),
    ] {
        let said = say(arguments);
        assert_eq!(said.code, Some(2), "{arguments:?}: {}", said.stderr);
        assert!(
            said.stderr.contains(words),
            "{arguments:?}: {}",
            said.stderr
        );
        assert!(
            said.stdout.is_empty() && !said.stderr.contains("panicked"),
            "{arguments:?}"
        );
    }
}

#[test]
fn missing_temporary_folder_is_not_created() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = folder.path().join("nowhere");
    let mut jitter = gusset();
    jitter.args(["jitter", "--rate", "100", "--duration", "0.1"]);
    let said = jitter.env("TMPDIR", &nowhere).output().unwrap();
    assert_eq!(said.status.code(), Some(2));
    let told = String::from_utf8(said.stderr).unwrap();
    assert!(
        told.contains("TMPDIR is ") && told.contains("nowhere"),
        "{told}"
    );
    assert!(!nowhere.exists());
}

#[test]
fn the_schema_is_json_schema_of_every_table() {
    let schema = only_json(&["schema"]);
    assert!(
        schema["$schema"]
            .as_str()
            .unwrap()
            .contains("json-schema.org")
    );
    assert_eq!(schema["type"], "object");
    for table in [
        "time",
        "structure",
        "integrator",
        "excitation",
        "specimen",
        "safety",
        "timing",
        "record",
    ] {
        assert!(schema["properties"].get(table).is_some(), "{table}");
    }
    assert_eq!(schema["additionalProperties"], false);
}

#[test]
fn json_prints_one_document_only() {
    let folder = tempfile::tempdir().unwrap();
    // A test with a warning, which must go to stderr.
    let text = format!("{FRAME}[safety]\nexit_speed_m_per_s = 0.01\naccept_error = \"so short\"\n");
    let test = write(folder.path(), "test.toml", &text);
    let test = test.to_str().unwrap();
    let short = "time.duration_s=0.01";
    let said = say(["check", test, "--set", short]);
    assert!(said.stderr.contains("warning: "), "{}", said.stderr);
    let checked = only_json(&["check", test, "--json", "--set", short]);
    assert!(checked.is_object());
    let out = folder.path().join("out");
    let summary = only_json(&[
        "run",
        test,
        "--json",
        "--set",
        short,
        "--out",
        out.to_str().unwrap(),
    ]);
    assert_eq!(
        summary,
        json(&out, "summary.json"),
        "what is printed is what is archived"
    );
}

#[test]
fn topics_are_listed_as_json() {
    let document = only_json(&["verify", "--list", "--json"]);
    let topics = document["topics"].as_array().unwrap();
    assert!(topics.len() > 9);
    for topic in topics {
        assert!(topic["name"].is_string() && topic["title"].is_string());
    }
}

#[test]
fn injected_panic_spares_the_rehearsal() {
    let folder = tempfile::tempdir().unwrap();
    let text = FRAME.with("specimen.drill.panic_at_s = 0.1");
    let test = write(folder.path(), "test.toml", &text);
    let said = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stdout.contains("rehearsal") && !said.stderr.contains("internal error"));
}

#[test]
fn run_summarises_its_test_unless_quiet() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let out = folder.path().join("out");
    let said = completed(&test, &out, &[]);
    assert_eq!(said.stdout, "");
    for word in [
        "Frame — completed",
        "100 steps",
        "peak displacement",
        " DOF 2, relative",
        " DOF 1, absolute",
        "storey drift",
        " in storey 1",
        "force, storey",
        "integrator",
        "report.html",
    ] {
        assert!(said.stderr.contains(word), "{word}: {}", said.stderr);
    }
    for word in ["\u{1b}", "\r"] {
        assert!(
            !said.stderr.contains(word),
            "progress and colour belong to a terminal"
        );
    }
    let said = completed(&test, &folder.path().join("quiet"), &["--quiet"]);
    assert_eq!((said.stdout.as_str(), said.stderr.as_str()), ("", ""));
}

#[test]
fn doctor_names_every_topic_with_advice() {
    let said = say(["doctor"]);
    assert_eq!(
        (said.code, said.stderr.as_str()),
        (Some(0), ""),
        "{}",
        said.stdout
    );
    let findings = only_json(&["doctor", "--json"]);
    let findings = findings.as_array().unwrap();
    assert!(findings.len() > 5);
    for finding in findings {
        let (topic, verdict) = (
            finding["topic"].as_str().unwrap(),
            finding["verdict"].as_str().unwrap(),
        );
        assert!(said.stdout.contains(topic), "{topic}");
        assert!(
            ["good", "fair", "poor", "unknown"].contains(&verdict),
            "{finding}"
        );
        assert!(!finding["found"].as_str().unwrap().is_empty(), "{finding}");
        assert!(
            verdict != "poor" || finding["advice"].is_string(),
            "poor without advice: {finding}"
        );
    }
    // The last entry is the verdict, and the page ends with it.
    let verdict = findings.last().unwrap();
    assert_eq!(verdict["topic"], "verdict");
    let (_, end) = said.stdout.rsplit_once("\nverdict ").unwrap();
    assert!(end.contains(verdict["found"].as_str().unwrap()), "{end}");
    assert!(end.contains("first: ") && end.lines().count() <= 4, "{end}");
}

#[test]
fn doctor_works_without_privileges() {
    let mut command = std::process::Command::new("setpriv");
    let nobody = [
        "--reuid=65534",
        "--regid=65534",
        "--clear-groups",
        "--inh-caps=-all",
        "--bounding-set=-all",
    ];
    command
        .args(nobody)
        .arg(assert_cmd::cargo::cargo_bin!("gusset"))
        .args(["doctor", "--json"]);
    let said = match command.output() {
        Ok(output) if !output.stderr.starts_with(b"setpriv:") => crate::common::Said::from(output),
        // Without the right to drop privileges, or without a tool for it, the test runs the command unchanged.
        _ => say(["doctor", "--json"]),
    };
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        serde_json::from_str::<Value>(&said.stdout)
            .unwrap()
            .is_array()
    );
}

#[test]
fn jitter_prints_the_timing_keys_as_json() {
    let found = only_json(&["jitter", "--rate", "500", "--duration", "0.3", "--json"]);
    assert_eq!(
        (&found["rate_hz"], &found["ticks"]),
        (&500.0.into(), &151.into())
    );
    for quantity in [
        "wakeup_lateness",
        "command_lateness",
        "compute",
        "record",
        "tick_time",
        "slack",
        "miss",
    ] {
        for part in ["count", "min", "p50", "p90", "p99", "p99_9", "max"] {
            assert!(
                found["timing"][quantity].get(part).is_some(),
                "timing.{quantity}.{part}"
            );
        }
    }
    assert!(
        found["timing"]["wakeup_lateness"]["count"]
            .as_u64()
            .unwrap()
            >= 151
    );
    for key in [
        "deadline_misses",
        "miss_classes",
        "realtime",
        "wall_seconds",
    ] {
        assert!(found.get(key).is_some(), "{key}");
    }
    let verdict = &found["verdict"];
    assert_eq!(verdict["rate_hz"], 500.0);
    assert_eq!(verdict["misses"], found["deadline_misses"]);
    // So short a measurement proves no rate; a miss forbids one if all real-time rights were granted.
    let missed = found["deadline_misses"] != 0;
    let forbidden = missed && verdict["granted"] == true;
    assert_eq!(verdict["fit"].as_bool(), forbidden.then_some(false));
    assert_eq!(
        (&verdict["loaded"], &verdict["complete"]),
        (&false.into(), &true.into())
    );
    assert_eq!(verdict["seconds"], found["wall_seconds"]);
    assert!(!verdict["reservations"].as_array().unwrap().is_empty() || forbidden);
    let words = verdict["text"].as_str().unwrap();
    let word = if forbidden { "no" } else { "not known" };
    assert!(words.contains(&format!("500 Hz: {word}, ")), "{words}");
}

#[test]
fn jitter_writes_its_files_to_given_path() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("jitter");
    let arguments = [
        "jitter",
        "--rate",
        "1000/3",
        "--duration",
        "0.3",
        "--out",
        out.to_str().unwrap(),
    ];
    let said = say(arguments);
    assert_eq!(
        (said.code, said.stdout.as_str()),
        (Some(0), ""),
        "{}",
        said.stderr
    );
    assert!(
        said.stderr.contains("wakeup lateness") && said.stderr.contains("deadline misses"),
        "{}",
        said.stderr
    );
    assert!(said.stderr.contains("\nverdict "), "{}", said.stderr);
    let found = names(&out);
    for name in [
        "timing.json",
        "jitter.svg",
        "wakeup_lateness.hgrm",
        "tick_time.hgrm",
        "summary.json",
    ] {
        assert!(found.iter().any(|n| n == name), "{name}: {found:?}");
    }
    let picture = fs::read_to_string(out.join("jitter.svg")).unwrap();
    assert!(picture.contains("<svg") && picture.trim_end().ends_with("</svg>"));
    assert!(json(&out, "timing.json")["wakeup_lateness"]["p50"].is_number());
    let again = say(arguments);
    assert_eq!(again.code, Some(2), "never over what is there");
}

#[test]
fn largest_model_search_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("frontier");
    let said = say([
        "jitter",
        "--model",
        "chain",
        "--rates",
        "2000",
        "--quick",
        "--json",
        "--out",
        out.to_str().unwrap(),
    ]);
    // On a machine that is busy enough no size keeps its deadlines: that is an answer too.
    let found: serde_json::Value = serde_json::from_str(&said.stdout).expect(&said.stderr);
    let points = found["frontier"].as_array().unwrap();
    assert_eq!(
        said.code,
        Some(i32::from(points.is_empty())),
        "{}",
        said.stderr
    );
    for point in points {
        assert!(point["dofs"].as_u64().unwrap() >= 2);
        assert!(point["kept"].as_f64().unwrap() >= 0.9999);
        assert_eq!(point["ticks"], 1001);
    }
    assert_eq!(names(&out), ["frontier.csv", "frontier.svg"]);
    let table = fs::read_to_string(out.join("frontier.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + points.len());
    let picture = fs::read_to_string(out.join("frontier.svg")).unwrap();
    assert!(picture.contains("Table 2") && picture.contains("GPU"));
}

#[test]
fn report_is_rewritten_from_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let out = folder.path().join("out");
    completed(&test, &out, &[]);
    let page = fs::read(out.join("report.html")).unwrap();
    fs::remove_file(out.join("report.html")).unwrap();
    fs::remove_file(&test).unwrap();
    let moved = folder.path().join("moved");
    fs::rename(&out, &moved).unwrap();
    let picture = folder.path().join("hero.svg");
    let mut command = gusset();
    command
        .arg("report")
        .arg(&moved)
        .arg("--picture")
        .arg(&picture);
    assert_eq!(command.output().unwrap().status.code(), Some(0));
    assert!(
        fs::read(moved.join("report.html")).unwrap() == page,
        "the same page from the same folder"
    );
    assert!(fs::read_to_string(&picture).unwrap().contains("<svg"));
}

/// The benchmark's first case without a compensator, and with these arguments.
fn benchmark(arguments: &[&str]) -> crate::common::Said {
    let case = ["benchmark", "vrths", "--case", "1", "--controller", "none"];
    say(case.iter().chain(arguments))
}

#[test]
fn benchmark_record_needs_its_step_option() {
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("record.csv");
    fs::write(&record, "a\n0.0\n0.5\n-0.5\n0.0\n").unwrap();
    let said = benchmark(&["--unit", "g", "--record", record.to_str().unwrap()]);
    assert_ne!(said.code, Some(0));
    assert!(said.stderr.contains("give --record-dt"), "{}", said.stderr);
    assert!(!said.stderr.contains("dt_s"), "{}", said.stderr);
}

#[test]
fn record_options_need_a_record() {
    for (key, value) in [("--scale", "3"), ("--unit", "g"), ("--record-dt", "0.02")] {
        let said = benchmark(&[key, value]);
        assert_eq!(said.code, Some(2), "{key}: {}", said.stderr);
        assert!(
            said.stderr.contains("--record <FILE>"),
            "{key}: {}",
            said.stderr
        );
    }
    let said = say([
        "benchmark",
        "vrths",
        "--record",
        "none.AT2",
        "--scale",
        "nan",
    ]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("finite number"), "{}", said.stderr);
}

#[test]
fn log_level_selects_messages_on_stderr() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let test = test.to_str().unwrap();
    let run = |out: &str, before: &[&str], variable: Option<&str>| {
        let mut command = gusset();
        let out = folder.path().join(out);
        command.args(before).args(["run", test, "--json"]);
        command.args(["--set", "time.duration_s=0.05", "--out"]);
        command.arg(out).env_remove("GUSSET_LOG");
        if let Some(level) = variable {
            command.env("GUSSET_LOG", level);
        }
        let said = crate::common::Said::from(command.output().unwrap());
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let summary: Value = serde_json::from_str(&said.stdout).unwrap();
        assert_eq!(summary["status"], "completed");
        said.stderr.contains(" INFO ")
    };
    assert!(!run("default", &[], None));
    assert!(run("option", &["--log", "info"], None));
    assert!(run("variable", &[], Some("info")));
    assert!(!run("both", &["--log", "error"], Some("info")));
    assert!(!run("unknown", &[], Some("gusset=info")));
    let wrong = say(["--log", "loud", "schema"]);
    assert_eq!(wrong.code, Some(2));
}

/// The closing summary of a run: its lines from the blank line before the title on.
fn closing(stderr: &str) -> Vec<&str> {
    let lines: Vec<_> = stderr.lines().collect();
    let title = lines.iter().rposition(|line| line.contains(" — "));
    lines[title.expect("a title") - 1..].to_vec()
}

#[test]
fn summary_has_at_most_twenty_lines() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config");
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    let three = home.join("three.toml");
    // More specimens than the short form has rows for.
    let text = FRAME
        .replace(
            "[1000.0, 900.0]",
            "[1000.0, 900.0, 900.0, 900.0, 900.0, 900.0, 900.0]",
        )
        .replace("[0, 4e5]", "[0, 4e5, 4e5, 4e5, 4e5, 4e5, 4e5]")
        + &(2..8)
            .map(|storey| {
                format!(
                    "[[specimen]]\nname = \"s{storey}\"\nstorey = {storey}\n\
                     law.linear = {{ stiffness_n_per_m = 1e5 }}\n"
                )
            })
            .collect::<String>();
    std::fs::write(&three, text).unwrap();
    let real = ["--clock", "real", "--set", "timing.policy=\"ordinary\""];
    let simulated = ["--clock", "simulated"];
    for (name, test, clock) in [
        ("many", three, &simulated[..]),
        ("rotations", root.join("three-actuators.toml"), &simulated),
        ("real", write(home, "test.toml", FRAME), &real),
    ] {
        let said = completed(&test, &home.join(name), &[clock, &PATIENT].concat()).stderr;
        let short = closing(&said);
        assert!(short.len() <= 20, "{} lines: {short:#?}", short.len());
        let has = |lines: &[&str], row: &str| lines.iter().any(|line| line.starts_with(row));
        let mut rows = vec![
            "verdict ",
            "peak displacement ",
            "peak force, ",
            "tracking, ",
            "report ",
        ];
        if name == "real" {
            rows.extend(["wakeup lateness ", "deadline misses "]);
        }
        for row in rows {
            assert!(has(&short, row), "{row}: {short:#?}");
        }
        let report = short.iter().find_map(|line| line.strip_prefix("report "));
        assert!(std::path::Path::new(report.unwrap().trim()).exists());
    }
}

/// The worked example of the guide's page on limits.
#[test]
fn limits_by_the_rule_of_the_guide_hold() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut arguments = vec!["--clock".to_owned(), "simulated".to_owned()];
    for (key, warn, trip) in [
        ("command_disp_m", "[-0.033,0.033]", "[-0.039,0.039]"),
        ("command_vel_m_per_s", "0.26", "0.31"),
        ("measured_force_n", "[-161e3,161e3]", "[-190e3,190e3]"),
        ("following_error_m", "0.0038", "0.0057"),
    ] {
        for (level, value) in [("warn", warn), ("trip", trip)] {
            let set = format!("specimen.0.limits.{key}.{level}={value}");
            arguments.extend(["--set".to_owned(), set]);
        }
    }
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    completed(&root.join("config/frame-bouc-wen.toml"), &out, &arguments);
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    // The needs of the example are the largest values of the test.
    for largest in ["29.8", "235", "146"] {
        let is_there = report
            .split("<th>largest value</th>")
            .nth(1)
            .is_some_and(|table| table.contains(largest));
        assert!(is_there, "{largest}");
    }
    let events = std::fs::read_to_string(out.join("events.jsonl")).unwrap();
    assert!(!events.contains("limit_warning"), "{events}");
}
