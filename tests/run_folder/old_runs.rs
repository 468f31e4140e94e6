//! Run folders that versions 0.1.0 and 0.2.0 wrote are still read, and their tests are repeated or refused with a reason.
//!
//! `defaults` completed with all keys at their defaults. `tripped` was stopped by a limit.
//! `keys` has removed keys at other values, and old names of keys and laws. `held` is of version 0.2.0: its specimen was behind a
//! link, and the operator held, continued and stopped the test.

use std::path::{Path, PathBuf};

use gusset_record::Run;

use crate::common::{Said, json, physics, say};

const FOLDERS: [&str; 4] = ["defaults", "tripped", "keys", "held"];

/// A copy of an old run folder, which a command may change.
fn old(home: &Path, name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/old_runs");
    let copy = home.join(name);
    crate::common::copy(&root.join(name), &copy);
    copy
}

fn on(command: &str, run: &Path, more: &[&str]) -> Said {
    let run = run.to_str().unwrap();
    say([&[command, run][..], more].concat())
}

#[test]
fn old_runs_are_reported_and_exported() {
    let home = tempfile::tempdir().unwrap();
    for name in FOLDERS {
        let run = old(home.path(), name);
        let said = on("report", &run, &[]);
        assert_eq!(said.code, Some(0), "{name}: {}", said.stderr);
        let opened = Run::open(&run).unwrap();
        let summary = opened.summary().unwrap();
        assert!(summary.limits.is_some() && summary.falsified.is_some());
        assert!(opened.timings().unwrap().is_some());
        let page = std::fs::read_to_string(run.join("report.html")).unwrap();
        assert!(!page.contains("cannot be read") && !page.contains("Damaged"));
        assert!(page.contains("elastic") || page.contains("linear") || page.contains("coulomb"));
        for further in [&[][..], &["--with", "absolute-acceleration,storey-drift"]] {
            let out = home.path().join(format!("{name}-{}.csv", further.len()));
            let format = ["--format", "csv", "--out", out.to_str().unwrap()];
            let said = on("export", &run, &[&format[..], further].concat());
            assert_eq!(said.code, Some(0), "{name} {further:?}: {}", said.stderr);
            let lines = std::fs::read_to_string(&out).unwrap().lines().count();
            assert!(lines > 20, "{name}: {lines} lines");
        }
    }
    let said = say(["list", home.path().to_str().unwrap(), "--json"]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    for name in FOLDERS {
        assert!(said.stdout.contains(name), "{}", said.stdout);
    }
}

#[test]
fn old_run_is_replayed_to_the_last_bit() {
    let home = tempfile::tempdir().unwrap();
    for name in ["defaults", "tripped", "held"] {
        let said = on("replay", &old(home.path(), name), &[]);
        assert_eq!(said.code, Some(0), "{name}: {}{}", said.stdout, said.stderr);
    }
}

#[test]
fn removed_key_refuses_the_replay() {
    let home = tempfile::tempdir().unwrap();
    let run = old(home.path(), "keys");
    let replayed = on("replay", &run, &[]);
    // Without its summary the run counts as interrupted.
    std::fs::remove_file(run.join("summary.json")).unwrap();
    let resumed = say(["run", "--resume", run.to_str().unwrap()]);
    for said in [replayed, resumed] {
        assert_ne!(said.code, Some(0), "{}", said.stdout);
        for (key, last) in [
            ("timing.catch_up_remote", "0.1.0"),
            ("timing.prefault_stack_kb", "0.2.0"),
            ("specimen[0].transfer.tell_saturation", "0.2.0"),
            ("specimen[0].limits.alternating_m", "0.2.0"),
        ] {
            let refused = format!("`{key}` was removed");
            let (_, rest) = said.stderr.split_once(&refused).unwrap_or_else(|| {
                panic!("{refused}: {}", said.stderr);
            });
            assert!(rest.contains(&format!("version {last}")), "{rest}");
        }
    }
}

/// The rows of version 0.1.0 hold the forces of the laws `viscous`, `coulomb` and `elastic_plastic`.
#[test]
fn law_under_its_old_name_keeps_the_bits() {
    let home = tempfile::tempdir().unwrap();
    for (name, removed) in [
        ("tripped", &[][..]),
        (
            "keys",
            &[
                "catch_up_remote",
                "prefault_stack_kb",
                "tell_saturation",
                "alternating_m",
            ],
        ),
    ] {
        let before = old(home.path(), name);
        let text = std::fs::read_to_string(before.join("test.toml")).unwrap();
        assert!(text.contains("coulomb") || text.contains("elastic_plastic"));
        let mut text = text
            .replace(", tell_saturation = false", "")
            .replace(", alternating_m = 1e-6", "");
        for key in removed {
            text = text
                .lines()
                .filter(|line| !line.starts_with(key))
                .fold(String::new(), |all, line| all + line + "\n");
        }
        let test = crate::common::write(home.path(), &format!("{name}.toml"), &text);
        let out = home.path().join(format!("{name}-again"));
        let said = crate::common::run(&test, &out, &[]);
        assert_eq!(
            json(&out, "summary.json")["status"],
            json(&before, "summary.json")["status"],
            "{}",
            said.stderr
        );
        assert!(said.stderr.contains("now called"), "{}", said.stderr);
        let again = physics(&out);
        let mut compared = 0;
        for (column, bits) in physics(&before) {
            if let Some((_, other)) = again.iter().find(|(other, _)| *other == column) {
                assert_eq!(&bits, other, "{name}: {column}");
                compared += 1;
            }
        }
        assert!(compared > 15, "{name}: {compared} columns");
    }
}
