//! `tools/soak`, for some twenty seconds: memory, descriptors and the grid stay where they are. No timing decides.

use std::process::Command;

use crate::common::json;
use crate::note;

#[test]
fn a_soak_finds_no_growth_and_no_drift() {
    if Command::new("python3").arg("--version").output().is_err() {
        note("SKIPPED: python3 is not installed");
        assert!(std::env::var_os("CI").is_none());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("soak");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/soak");
    let said = Command::new("python3")
        .arg(script)
        .args([
            "--seconds",
            "24",
            "--rate",
            "500",
            "--every",
            "0.5",
            "--replay",
        ])
        .arg("--gusset")
        .arg(assert_cmd::cargo::cargo_bin!("gusset"))
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&said.stdout).into_owned();
    let errors = String::from_utf8_lossy(&said.stderr);
    assert_eq!(said.status.code(), Some(0), "{text}{errors}");
    note(&text);
    let verdict = json(&out, "soak.json");
    assert_eq!(verdict["passed"], true);
    for process in ["controller", "specimen"] {
        let found = &verdict[process];
        assert!(found["samples"].as_u64().unwrap() >= 20, "{verdict}");
        assert!(found["rss_kb_last"].as_f64().unwrap() > 1000.0, "{verdict}");
        assert!(found["descriptors_last"].as_u64().unwrap() > 3, "{verdict}");
    }
    assert_eq!(verdict["steps"], 12_000);
    assert_eq!(verdict["rows_lost"], 0);
    assert!(
        verdict["grid_error_ns"].as_f64().unwrap() <= 1.0,
        "{verdict}"
    );
}
