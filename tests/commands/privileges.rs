//! Without privileges a test runs and reports which settings it did not get; with `require_realtime` it refuses, and nothing moves.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use crate::common::{FRAME, PATIENT, Said, completed, json, run, write};

#[test]
fn missing_privileges_warn_or_refuse() {
    let folder = tempfile::tempdir().unwrap();
    // Also for an unprivileged user.
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o777)).unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let unprivileged = |out: &Path, more: &[&str]| -> Option<Said> {
        let nobody = [
            "--reuid=65534",
            "--regid=65534",
            "--clear-groups",
            "--inh-caps=-all",
            "--bounding-set=-all",
        ];
        let mut command = Command::new("setpriv");
        command
            .args(nobody)
            .arg(assert_cmd::cargo::cargo_bin!("gusset"));
        command
            .arg("run")
            .arg(&test)
            .arg("--out")
            .arg(out)
            .args(["--clock", "real"])
            .args(PATIENT);
        let said: Said = command.args(more).output().ok()?.into();
        // Without root no process can drop privileges.
        let cannot_drop = said.stderr.starts_with("setpriv:");
        Some(if cannot_drop {
            run(
                &test,
                out,
                &[&["--clock", "real"], &PATIENT[..], more].concat(),
            )
        } else {
            said
        })
    };
    let out = folder.path().join("out");
    let Some(said) = unprivileged(&out, &[]) else {
        return skipped("there is no setpriv to drop privileges with");
    };
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let realtime = &json(&out, "summary.json")["realtime"];
    if realtime["complete"] == true {
        return skipped(
            "privileges could not be dropped, or the machine grants everything to everyone",
        );
    }
    let features = realtime["features"].as_array().unwrap();
    let refused: Vec<_> = features.iter().filter(|f| f["granted"] == false).collect();
    for feature in refused {
        let asked = feature["asked"].as_str().unwrap();
        assert!(
            said.stderr.contains(&format!("not granted: {asked}")),
            "said at the start: {}",
            said.stderr
        );
        assert!(
            feature["reason"].is_string() && feature["advice"].is_string(),
            "{feature}"
        );
    }
    let out = folder.path().join("required");
    let said = unprivileged(&out, &["--set", "timing.require_realtime=true"]).unwrap();
    assert_eq!(said.code, Some(4), "{}", said.stderr);
    assert!(said.stderr.contains("not granted"), "{}", said.stderr);
    assert!(said.stderr.contains("was moved"), "{}", said.stderr);
    assert!(!out.exists(), "a test that never began leaves no folder");
    // The simulated clock needs no such conditions.
    let simulated = [
        "--set",
        "timing.require_realtime=true",
        "--set",
        "time.clock=\"simulated\"",
    ];
    completed(&test, &folder.path().join("simulated"), &simulated);
}

#[expect(
    clippy::disallowed_macros,
    reason = "a test that did not look reports this"
)]
fn skipped(why: &str) {
    eprintln!("SKIPPED: {why}");
}
