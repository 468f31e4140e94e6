//! Folders that cannot be written: reported before anything moves, or at the end, and never by a panic.

use crate::common::test_file::{NEVER_LATE, TestFile};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use crate::common::{FRAME, Said, write};
use crate::link_common::Running;
use crate::note;

/// The program as an unprivileged user.
fn as_nobody(arguments: &[&std::ffi::OsStr]) -> Option<Said> {
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--regid=65534", "--clear-groups"]);
    command.args(["--inh-caps=-all", "--bounding-set=-all"]);
    command.arg(assert_cmd::cargo::cargo_bin!("gusset"));
    let said: Said = command.args(arguments).output().ok()?.into();
    let dropped = !said.stderr.starts_with("setpriv:");
    dropped.then_some(said)
}

/// Without root there are no privileges to drop.
fn unprivileged(arguments: &[&std::ffi::OsStr]) -> Said {
    as_nobody(arguments).unwrap_or_else(|| crate::common::say(arguments.iter().copied()))
}

#[test]
fn read_only_folder_is_reported_early() {
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let closed = folder.path().join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).unwrap();
    for out in [closed.join("new"), closed.clone()] {
        let said = unprivileged(&[
            "run".as_ref(),
            test.as_os_str(),
            "--out".as_ref(),
            out.as_os_str(),
        ]);
        if said.code == Some(0) {
            return note("SKIPPED: this user may write everywhere");
        }
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        let words = "run folder";
        assert!(said.stderr.contains(words), "{}", said.stderr);
        assert!(said.stderr.contains("Permission denied"), "{}", said.stderr);
    }
    assert_eq!(
        fs::read_dir(&closed).unwrap().count(),
        0,
        "nothing is left behind"
    );
    // Not even root can write there: a file is no folder, and /proc takes none.
    for out in [test.join("below"), Path::new("/proc/gusset").to_owned()] {
        let said = crate::common::run(&test, &out, &[]);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        assert!(said.stderr.contains("run folder"), "{}", said.stderr);
    }
}

/// A long test in real time; the tests do not wait for its end.
fn long() -> String {
    FRAME
        .with("time = { duration_s = 600, clock = 'real' }")
        .with(NEVER_LATE)
}

#[test]
fn folder_moved_mid_test_gets_all_files() {
    let folder = tempfile::tempdir().unwrap();
    let test = Running::start(folder.path(), "run", &long());
    test.moves();
    let out = folder.path().join("run");
    fs::rename(&out, folder.path().join("elsewhere")).unwrap();
    let (code, said) = test.interrupt();
    assert_eq!(code, 130, "{said}");
    assert!(said.contains("moved to"), "{said}");
    assert!(!said.contains("not written: "), "{said}");
    let moved = gusset_record::Run::open(&folder.path().join("elsewhere")).unwrap();
    let warnings = &moved.summary().unwrap().warnings;
    assert!(
        warnings.iter().any(|text| text.contains("moved to")),
        "{warnings:?}"
    );
    assert_eq!(crate::rows(&moved).1, gusset_record::End::Clean);
    assert!(!out.exists());
}

#[test]
fn folder_deleted_mid_test_counts_lost_rows() {
    let folder = tempfile::tempdir().unwrap();
    let test = Running::start(folder.path(), "run", &long());
    test.moves();
    fs::remove_dir_all(folder.path().join("run")).unwrap();
    let (code, said) = test.interrupt();
    assert_eq!(code, 130, "{said}");
    for words in ["ROWS ARE", "DATA LOST", "not written: "] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(!said.contains("panicked"), "{said}");
}
