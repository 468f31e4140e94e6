//! The live page: an operator's view and buttons, in a real browser, with a running test.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Stdio};

use serde_json::Value;

use super::stage::{assert_quiet, installed, visit};
use crate::common::{FRAME, PATIENT, gusset, json, write};

/// Ends with the test function, whatever happens.
pub struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts a test with its page into `home/run`; returns its output after that, its address and its control token.
pub fn start(home: &Path, text: &str) -> (Running, BufReader<ChildStderr>, [String; 2]) {
    let mut child = gusset()
        .arg("run")
        .arg(write(home, "test.toml", text))
        .args([
            "--out",
            home.join("run").to_str().unwrap(),
            "--live",
            "127.0.0.1:0",
        ])
        .args(["--set", "timing.policy=\"ordinary\""])
        .args(PATIENT)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let running = Running(child);
    let mut after = |start: &str| {
        let mut lines = String::new();
        // Findings of the verdict come before.
        loop {
            let begun = lines.len();
            assert!(
                said.read_line(&mut lines).unwrap() > 0,
                "{start:?}: {lines}"
            );
            if let Some(rest) = lines[begun..].strip_prefix(start) {
                return rest.trim().to_owned();
            }
        }
    };
    let address = after("live page: ");
    let token = after("control token (HOLD, CONTINUE, CONFIRM, STOP on the page): ");
    (running, said, [address, token])
}

/// Waits for the end of a test; returns its exit code and its output.
pub fn finish(mut running: Running, mut said: BufReader<ChildStderr>) -> (Option<i32>, String) {
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    (running.0.wait().unwrap().code(), rest)
}

#[test]
fn operator_holds_continues_and_stops() {
    if installed().is_none() {
        return;
    }
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let text = FRAME
        .replace("duration_s = 0.5", "duration_s = 3600")
        .replace("clock = \"simulated\"", "clock = \"real\"")
        .replace(
            "name = \"storey\"",
            "name = \"storey\"\nlimits = { command_disp_m = { warn = [-0.05, 0.05], trip = [-0.5, 0.5] }, \
             measured_force_n = { trip = [-9e4, 9e4] }, command_vel_m_per_s = { trip = 5 } }",
        );
    let folder = home.join("run");
    let (running, said, [address, token]) = start(home, &text);
    // The screenshots stay where a person finds them.
    let shots = std::env::var_os("GUSSET_SCREENSHOTS").map_or(home.to_owned(), PathBuf::from);
    let shots = shots.to_str().unwrap();
    let found = visit("live.mjs", &[&address, &token, shots]).unwrap();
    let (code, rest) = finish(running, said);
    assert_eq!(code, Some(130), "{rest}\n{found:#}");

    assert_quiet(&found);
    assert_eq!(found["title"], "Frame · Gusset");
    let drawn = |plots: &Value| {
        let shares: Vec<f64> = serde_json::from_value(plots.clone()).unwrap();
        // Response, ground, displacement, error, force, loop, histogram.
        assert_eq!(shares.len(), 7, "{found:#}");
        assert!(
            shares.iter().all(|share| *share > 0.01),
            "an empty plot: {found:#}"
        );
    };
    drawn(&found["plots"]);
    drawn(&found["second"]["plots"]);
    drawn(&found["reloaded"]["plots"]);
    for seen in [&found["clipped"], &found["second"]["clipped"]] {
        assert_eq!(*seen, serde_json::json!([]), "{found:#}");
    }
    assert_eq!(
        found["bars"], 8,
        "three of the axis, five of the test, margins included"
    );
    // Whatever the moment: near its crossing of zero it is shown in µm.
    let value = found["value"].as_str().unwrap();
    assert!(
        ["mm", "µm", "nm", "0 m"]
            .iter()
            .any(|unit| value.ends_with(unit)),
        "{found:#}"
    );

    assert!(
        found["tokenless"]
            .as_str()
            .unwrap()
            .contains("needs the control token")
    );
    assert_eq!(found["wrong"], 401);
    assert!(
        found["refusal"]
            .as_str()
            .unwrap()
            .contains("missing or wrong"),
        "{found:#}"
    );
    assert_eq!(
        found["after_refusal"], "running",
        "a wrong token holds nothing"
    );
    let expected = found["expected"].as_array().unwrap();
    assert_eq!(expected.len(), 2, "{found:#}");
    let refused = |line: &Value| line.as_str().unwrap().contains("401");
    assert!(expected.iter().all(refused), "{found:#}");

    assert_eq!(
        found["held"][0], found["held"][1],
        "time and command do not change"
    );
    for bins in [&found["second"]["bins"], &found["reloaded"]["bins"]] {
        assert!(bins.as_u64().unwrap() > 100, "the past is there: {found:#}");
    }
    assert!(
        found["reloaded"]["token"].as_u64().unwrap() > 10,
        "the tab remembers"
    );
    assert!(!found["in_address"].as_str().unwrap().contains(&token));
    assert_eq!(found["went_on"], true);
    assert!(
        found["lost"]["alarm"]
            .as_str()
            .unwrap()
            .contains("old data")
    );
    assert_eq!(found["lost"]["phase"], "dead");
    assert_eq!(found["lost"]["dead"], "dead");
    let asked = found["asked"].as_str().unwrap();
    assert!(asked.contains("specimen stays where it is"), "{asked}");
    assert_eq!(found["unasked"], true, "a wrong token is reported first");
    assert_eq!(found["kept_running"], "running", "STOP asks first");
    let outcome = found["outcome"].as_str().unwrap();
    assert!(
        outcome.contains("interrupted") && outcome.contains("report.html"),
        "{outcome}"
    );
    assert_eq!(found["second_outcome"], "interrupted");
    assert_eq!(
        found["alarm_after"], false,
        "a test that is over is no lost connection"
    );
    assert_eq!(json(&folder, "summary.json")["status"], "interrupted");
}

#[test]
fn trip_is_shown_and_stop_freezes() {
    if installed().is_none() {
        return;
    }
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let text = FRAME
        .replace("duration_s = 0.5", "duration_s = 3600")
        .replace("clock = \"simulated\"", "clock = \"real\"")
        .replace(
            "name = \"storey\"",
            "name = \"storey\"\nlimits = { command_disp_m = { warn = [-0.002, 0.002], trip = [-0.003, 0.003] } }",
        )
        + "\n[safety]\non_trip = \"zero_displacement\"\nexit_speed_m_per_s = 1e-5\n";
    let (running, said, [address, token]) = start(home, &text);
    let shots = std::env::var_os("GUSSET_SCREENSHOTS").map_or(home.to_owned(), PathBuf::from);
    let shots = shots.to_str().unwrap();
    let found = visit("tripped.mjs", &[&address, &token, shots]).unwrap();
    let (code, rest) = finish(running, said);
    assert_eq!(code, Some(1), "{rest}\n{found:#}");
    assert_quiet(&found);
    assert_eq!(found["phase"], "tripped");
    assert_eq!(found["lines"], 1);
    let alarm = found["alarm"].as_str().unwrap();
    let why = "TRIPPED: storey, axis 1: commanded displacement";
    assert!(alarm.starts_with(why), "{alarm}");
    assert_eq!(found["bars"], serde_json::json!(["commanded displacement"]));
    assert_eq!(found["warned"], 0, "{found:#}");
    assert_eq!(found["asked"], "FREEZE");
    let outcome = found["outcome"].as_str().unwrap();
    assert!(outcome.contains("stopped"), "{outcome}");
    assert_eq!(found["tripped_after"], 1);
}
