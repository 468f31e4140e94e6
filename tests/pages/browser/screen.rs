//! The live page on a screen: everything is visible without scrolling, and the keyboard is enough to operate the test.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::live::{finish, start};
use super::stage::{assert_quiet, installed, visit};
use crate::common::FRAME;

/// The findings of `screen.mjs` on the page of a test; the exit code of the test is 130.
fn seen(text: &str, more: &[&str]) -> Option<Value> {
    installed()?;
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let (running, said, [address, token]) = start(home, text);
    let shots = std::env::var_os("GUSSET_SCREENSHOTS").map_or(home.to_owned(), PathBuf::from);
    let arguments = [&[&address, &token, shots.to_str().unwrap()][..], more].concat();
    let found = visit("screen.mjs", &arguments)?;
    let (code, rest) = finish(running, said);
    assert_eq!(code, Some(130), "{rest}\n{found:#}");
    assert_quiet(&found);
    assert_eq!(found["faults"], json!([]), "{found:#}");
    assert_eq!(found["running"], json!(["running", "running"]));
    assert_eq!(found["ended"][0], "ended");
    assert_eq!(
        found["dialog"],
        json!([true, "sure-not", "sure-stop"]),
        "the harmless answer has the focus first"
    );
    assert_eq!(found["after"], json!({ "operate": false, "alarm": false }));
    assert!(found["path"].as_str().unwrap().ends_with("report.html"));
    assert_eq!(found["closed"], false);
    let told = &found["told"];
    assert_eq!(told["unnamed"], json!([]), "{told:#}");
    assert_eq!(
        (&told["phase"], &told["alarm"], &told["meters"]),
        (&json!("polite"), &json!("alert"), &json!(0))
    );
    Some(found)
}

fn has(found: &Value, label: &str) -> bool {
    let labels = found["labels"].as_array().unwrap();
    labels
        .iter()
        .any(|one| one.as_str().unwrap().starts_with(label))
}

#[test]
fn keyboard_operates_the_test_on_one_screen() {
    // The storey above is stiff: both DOFs move alike.
    let text = FRAME
        .replace("duration_s = 0.5", "duration_s = 3600")
        .replace("clock = \"simulated\"", "clock = \"real\"")
        .replace("[0, 4e5]", "[0, 4e9]")
        + "[specimen.transfer]\nstroke_m = 0.2\nforce_limit_n = 9e4\n";
    let Some(found) = seen(&text, &[]) else {
        return;
    };
    assert_eq!(found["before"], json!(["waiting", false]));
    assert_eq!(found["held"], json!(["holding", "holding"]));
    assert_eq!(found["order"], json!(["token", "hold", "continue", "stop"]));
    assert_ne!(found["outline"], "none", "the focus is visible");
    for dof in found["inked"].as_array().unwrap() {
        assert!(dof.as_u64().unwrap() > 300, "a DOF is hidden: {found:#}");
    }
    assert_eq!(found["without"][0], "false");
    assert!(found["without"][1].as_u64().unwrap() < 20, "{found:#}");
    let drawings = found["reduced"].as_f64().unwrap();
    assert!(drawings <= 7.0, "{drawings} drawings in 3 s");
    assert_eq!(found["corners"], json!([0, 0, 1, 1, 3, 1.2]));
    for label in [
        "deadline misses, last 10 s",
        "stability margin used",
        "actuator stroke ±200 mm",
        "actuator force ±90.0 kN",
    ] {
        assert!(has(&found, label), "{label}: {found:#}");
    }
    assert_eq!(found["report"], json!([true, "Frame"]));
}

#[test]
fn several_specimens_fit_on_one_screen() {
    let text = include_str!("../../../config/two-specimens.toml")
        .replace("duration_s = 12\n", "duration_s = 3600\n")
        .replace("rate_hz = 1000", "rate_hz = 200");
    let Some(found) = seen(&text, &["look"]) else {
        return;
    };
    assert_eq!(found["loops"], 2);
    assert!(has(&found, "column") && has(&found, "brace"), "{found:#}");
    assert_eq!(found["report"][1], "Four storeys, two specimens");
}
