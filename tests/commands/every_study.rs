//! Every study in config/ is a test: it runs to its end on the simulated clock, and its beginning gives the same bits on
//! the real clock. Studies are found by listing the folder.

use std::path::{Path, PathBuf};

use crate::common::{PATIENT, completed, json, same_physics, say};
use gusset_config as config;
use gusset_record::Run;
use gusset_setup as setup;

fn studies() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("config");
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut studies: Vec<_> = entries
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    studies.sort();
    assert!(!studies.is_empty(), "no study found");
    studies
}

/// Calls `with` for every study, and says which failed.
fn for_each_study(with: impl Fn(&Path, &Path)) {
    for study in studies() {
        let folder = tempfile::tempdir().unwrap();
        let run = std::panic::AssertUnwindSafe(|| with(&study, folder.path()));
        let result = std::panic::catch_unwind(run);
        assert!(result.is_ok(), "{} failed: see above", study.display());
    }
}

#[test]
fn every_study_passes_the_check() {
    for_each_study(|study, _| {
        // As an operator types it: tests run in the folder of the crate.
        let study = study.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap();
        let said = say(["check".as_ref(), study.as_os_str()]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        is_short(study, &said.stdout);
    });
}

#[test]
fn check_of_a_two_program_test_is_short() {
    for study in ["config/serve/vrths-case-1.toml"] {
        let said = say(["check", study]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        is_short(Path::new(study), &said.stdout);
        for command in [
            "gusset check --rehearse ",
            "gusset identify ",
            "gusset run ",
        ] {
            assert!(
                said.stdout.contains(&format!("  {command}{study}")),
                "{}",
                said.stdout
            );
        }
    }
}

/// The page fits a terminal of 30 lines and 100 columns; warnings take more lines. It begins with the verdict and ends with
/// the next commands.
#[track_caller]
fn is_short(study: &Path, page: &str) {
    let lines: Vec<&str> = page.trim_end().lines().collect();
    let widest = lines.iter().map(|line| line.chars().count()).max();
    let warnings = lines.iter().position(|line| line.starts_with("test "));
    let warnings = warnings.expect("no line of the test") - 3;
    // At most twelve nodes and twelve members of a frame are listed.
    let head = |name: &str| lines.iter().position(|line| line.starts_with(name));
    let listed = match [head("node "), head("member ")] {
        [Some(nodes), Some(members)] => {
            let rows = lines[members + 1..].iter();
            let rows = rows.take_while(|line| line.starts_with(' ')).count();
            assert!(members - nodes <= 14 && rows <= 13, "{page}");
            members - nodes + 1 + rows
        }
        _ => 0,
    };
    assert!(
        lines.len() <= 32 + warnings + listed && widest <= Some(100),
        "{} lines with {warnings} of warnings, {widest:?} columns:\n{page}",
        lines.len()
    );
    let is_accepted = lines.iter().any(|line| line.starts_with("accepted "));
    let verdict = match warnings {
        0 => " — valid",
        _ if is_accepted => " — valid, with accepted findings",
        _ => " — valid, with findings",
    };
    assert!(lines[1].ends_with(verdict), "{page}");
    let text = std::fs::read_to_string(study).unwrap();
    let needs: &[&str] = match text.contains("[specimen") {
        true => &["needs "],
        false => &[],
    };
    let names = ["test ", "structure ", "excitation ", "rehearsal "];
    for name in names.iter().chain(needs) {
        assert!(
            lines.iter().any(|line| line.starts_with(*name)),
            "no {name}:\n{page}"
        );
    }
    let next = lines.iter().skip_while(|line| **line != "next").skip(1);
    let next: Vec<_> = next.filter(|line| line.starts_with("  gusset ")).collect();
    let file = study.file_name().unwrap().to_str().unwrap();
    assert!(
        next.len() >= 2 && next.iter().all(|line| line.contains(file)),
        "{page}"
    );
    assert!(
        next.iter().any(|line| line.contains("gusset run ")),
        "{page}"
    );
}

#[test]
fn every_study_completes_in_simulated_time() {
    for_each_study(|study, folder| {
        let out = folder.join("out");
        completed(study, &out, &["--clock", "simulated"]);
        let summary = json(&out, "summary.json");
        assert_eq!(
            (&summary["status"], &summary["rows_lost"]),
            (&"completed".into(), &0.into())
        );
        let rows = Run::open(&out)
            .unwrap()
            .columns(&["step", "state"])
            .unwrap();
        assert_eq!(rows[0].last().copied(), summary["steps"].as_f64());
        let moved = summary["peak"].to_string();
        assert!(
            moved.contains("e-") || moved.contains('.'),
            "nothing moved: {moved}"
        );
        assert!(
            std::fs::read_to_string(out.join("report.html"))
                .unwrap()
                .contains("<svg")
        );
    });
}

/// Overrides that leave about a second of wall time of a study. Where a shorter test would not be valid (a path that
/// must come to its end), the whole test runs on a faster grid instead.
fn shortened(study: &Path) -> Vec<String> {
    let loaded = config::load(study, &[]).unwrap();
    let time = loaded.time;
    let per_second = time.period.inverse().value();
    let steps = (per_second.round() as u64).clamp(2, time.steps.max(2));
    let duration = format!("time.duration_s={}", steps as f64 * time.step.value());
    let all = ["timing.warmup_ticks=20".to_owned(), duration];
    let valid = config::load(study, &all).is_ok_and(|loaded| setup::build(&loaded).is_ok());
    let [warm_up, duration] = all;
    if valid {
        return vec![warm_up, duration];
    }
    let seconds = time.steps as f64 * time.step.value();
    vec![
        warm_up,
        format!("time.scale={:.3}", (1.0 / seconds).max(0.001)),
    ]
}

#[test]
fn every_study_is_the_same_on_both_clocks() {
    for_each_study(|study, folder| {
        let sets = shortened(study);
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let (simulated, real) = (folder.join("simulated"), folder.join("real"));
        completed(
            study,
            &simulated,
            &[&sets[..], &["--clock", "simulated"]].concat(),
        );
        completed(
            study,
            &real,
            &[&sets[..], &["--clock", "real"], &PATIENT].concat(),
        );
        assert_eq!(json(&real, "summary.json")["clock"], "real");
        assert_eq!(json(&real, "summary.json")["rows_lost"], 0);
        same_physics(&simulated, &real);
    });
}
