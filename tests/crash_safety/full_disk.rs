//! A disk that fills up does not end a test: it runs to its end, whole rows stay whole, and every loss is counted and shouted.

use crate::common::test_file::TestFile;
use std::fs;
use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::Command;

use crate::common::{FRAME, PATIENT, Said, completed, gusset, json, say, write};
use gusset_record::Run;

/// The binary with a limit on its resources: `f` is the size of a file in kB, `n` the number of open files.
fn under_limit(resource: char, most: u32) -> Command {
    let script = format!("ulimit -{resource} {most}; exec \"$0\" \"$@\"");
    let mut command = Command::new("bash");
    command
        .args(["-c", &script])
        .arg(assert_cmd::cargo::cargo_bin!("gusset"));
    command
}

/// `gusset run` under that limit.
fn on_a_full_disk(kilobytes: u32, test: &Path, out: &Path, more: &[&str]) -> Said {
    let mut command = under_limit('f', kilobytes);
    command
        .arg("run")
        .arg(test)
        .arg("--out")
        .arg(out)
        .args(more)
        .output()
        .unwrap()
        .into()
}

/// With six to eight files, one of our libraries panicked while it set up its signals.
#[test]
fn too_few_files_are_refused_early() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let out = folder.path().join("out");
    for files in [6, 7, 8, 16, 63] {
        let mut command = under_limit('n', files);
        command.arg("run").arg(&test).arg("--out").arg(&out);
        let said: Said = command.output().unwrap().into();
        assert_eq!(said.code, Some(2), "{files}: {}", said.stderr);
        assert!(said.stderr.contains("ulimit -n"), "{}", said.stderr);
        assert!(!out.exists());
    }
}

#[test]
fn full_disk_counts_every_lost_row() {
    let folder = tempfile::tempdir().unwrap();
    let text = FRAME.with("time.duration_s = 20");
    let test = write(folder.path(), "test.toml", &text);
    let out = folder.path().join("out");
    let said = on_a_full_disk(64, &test, &out, &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let summary = json(&out, "summary.json");
    assert_eq!(
        (&summary["status"], &summary["steps"]),
        (&"completed".into(), &4000.into())
    );
    let lost = summary["rows_lost"].as_u64().unwrap();
    let run = Run::open(&out).unwrap();
    let length = fs::metadata(out.join("samples.bin")).unwrap().len();
    assert_eq!(length % run.layout().stride() as u64, 0, "whole rows only");
    assert_eq!(length / run.layout().stride() as u64 + lost, 4001);
    assert!(
        said.stderr.contains(&format!("{lost} ROWS")),
        "{}",
        said.stderr
    );
    assert!(said.stderr.contains("too large"), "{}", said.stderr);
    let steps = run.columns(&["step"]).unwrap().remove(0);
    assert!(
        !steps.is_empty()
            && steps
                .iter()
                .enumerate()
                .all(|(row, step)| *step == row as f64)
    );
    let events = fs::read_to_string(out.join("events.jsonl")).unwrap();
    assert!(events.contains("\"rows_lost\""), "{events}");
    let said = say(["report".as_ref(), out.as_os_str()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains(&format!("{lost} rows"))
    );
}

#[test]
fn required_record_stops_at_lost_rows() {
    let folder = tempfile::tempdir().unwrap();
    let text = FRAME.with("time.duration_s = 20");
    let test = write(folder.path(), "test.toml", &text);
    let out = folder.path().join("out");
    let said = on_a_full_disk(64, &test, &out, &["--set", "record.required=true"]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    let summary = json(&out, "summary.json");
    assert_eq!(
        (&summary["status"], &summary["steps"]),
        (&"stopped".into(), &4000.into())
    );
    assert!(
        summary["reason"].as_str().unwrap().contains("rows lost"),
        "{summary}"
    );
}

#[test]
fn disk_without_room_is_reported_early() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let out = folder.path().join("out");
    let said = on_a_full_disk(4, &test, &out, &[]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("samples.json"), "{}", said.stderr);
    assert!(!out.exists());
}

#[test]
fn every_command_reports_the_file_limit() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let out = folder.path().join("out");
    completed(&test, &out, &[]);
    let page = fs::read(out.join("report.html")).unwrap();
    let table = folder.path().join("rows.csv");
    let export = ["export".as_ref(), out.as_os_str(), "--out".as_ref()];
    let export = [&export[..], &[table.as_os_str()]].concat();
    let report = ["report".as_ref(), out.as_os_str()];
    let commands = [&["schema".as_ref()][..], &export, &report];
    for arguments in commands {
        let schema = fs::File::create(folder.path().join("schema.json")).unwrap();
        let mut command = under_limit('f', 8);
        command.args(arguments).stdout(schema);
        let said: Said = command.output().unwrap().into();
        assert_eq!(said.code, Some(2), "{arguments:?}: {}", said.stderr);
        assert!(said.stderr.contains("too large"), "{}", said.stderr);
    }
    assert!(!table.exists());
    assert_eq!(fs::read(out.join("report.html")).unwrap(), page);
}

/// Like a service's output whose reader is gone or asleep.
#[test]
fn unread_socket_holds_up_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let limits = "[specimen.limits]\ncommand_disp_m = { warn = [-1e-6, 1e-6], trip = [-1, 1] }\n";
    let test = write(folder.path(), "test.toml", &format!("{FRAME}{limits}"));
    let (theirs, _unread) = UnixStream::pair().unwrap();
    theirs.set_nonblocking(true).unwrap();
    while (&theirs).write(b".").is_ok() {}
    theirs.set_nonblocking(false).unwrap();
    let out = folder.path().join("out");
    // A test that hangs is ended, and fails.
    let mut command = Command::new("timeout");
    command
        .args(["-s", "KILL", "60"])
        .arg(assert_cmd::cargo::cargo_bin!("gusset"))
        .arg("run")
        .arg(&test)
        .args(["--quiet", "--out"])
        .arg(&out);
    let status = command
        .stderr(std::os::fd::OwnedFd::from(theirs))
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(0));
    assert_eq!(json(&out, "summary.json")["status"], "completed");
    let events = fs::read_to_string(out.join("events.jsonl")).unwrap();
    assert!(events.contains("\"limit_warning\""), "{events}");
}

#[test]
fn unwritable_log_ends_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let full = || fs::File::options().write(true).open("/dev/full").unwrap();
    let out = folder.path().join("out");
    let mut command = gusset();
    command
        .arg("run")
        .arg(&test)
        .arg("--out")
        .arg(&out)
        .args(["--json", "--clock", "real"])
        .args(PATIENT);
    let status = command.stdout(full()).stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(0));
    assert_eq!(json(&out, "summary.json")["status"], "completed");
    assert!(out.join("report.html").exists());
    // The log writes most when the disk is full, and is often on that disk.
    let text = FRAME.with("time.duration_s = 20");
    let test = write(folder.path(), "long.toml", &text);
    let out = folder.path().join("full");
    let mut command = under_limit('f', 64);
    command.arg("run").arg(&test).arg("--out").arg(&out);
    let status = command.stdout(full()).stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(0));
    let summary = json(&out, "summary.json");
    assert!(summary["rows_lost"].as_u64().unwrap() > 0);
    assert_eq!(summary["status"], "completed");
    let status = gusset()
        .args(["check", "none.toml"])
        .stderr(full())
        .status()
        .unwrap();
    assert_eq!(
        status.code(),
        Some(2),
        "a message that cannot be written is no panic"
    );
}
