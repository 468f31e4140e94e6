//! The real HyperQueue runs a campaign: its server, a worker and its Python client from the package `hyperqueue`. The package has
//! no command `hq`, so `tools/hyperqueue/run.py` submits the job file of `gusset campaign submit`.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::campaign::{campaign, complete, planned, undisturbed};
use crate::common::Said;

/// Python with HyperQueue. Without it a test says SKIPPED, and fails where CI=true.
fn python() -> Option<PathBuf> {
    let made = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/hyperqueue-venv/bin/python");
    let python = std::env::var_os("GUSSET_HYPERQUEUE_PYTHON").map_or(made, PathBuf::from);
    if python.exists() {
        return Some(python);
    }
    let text = "SKIPPED: HyperQueue is not installed; `tools/test` installs it\n";
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{text}");
    // The test harness hides what a test prints.
    let _ = std::io::stderr().write_all(text.as_bytes());
    None
}

/// HyperQueue listens on all interfaces. Where the system permits it, it runs in a network that has only the loopback.
const ALONE: [&str; 7] = [
    "--map-root-user",
    "--net",
    "--uts",
    "sh",
    "-c",
    "ip link set lo up && hostname localhost && exec \"$@\"",
    "sh",
];

/// Runs a job file on a cluster of two cores.
fn run(python: &Path, file: &Path) -> Said {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/hyperqueue/run.py");
    let can_be_alone = Command::new("unshare").args(ALONE).arg("true").output();
    let mut command = if can_be_alone.is_ok_and(|output| output.status.success()) {
        let mut command = Command::new("unshare");
        command.args(ALONE).arg(python);
        command
    } else {
        Command::new(python)
    };
    command.arg(script).arg(file).args(["--local", "2"]);
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    command.current_dir("/").output().unwrap().into()
}

#[test]
fn hyperqueue_gives_the_local_table() {
    let Some(python) = python() else {
        return;
    };
    let (folder, out) = planned();
    let submit = || {
        // The command hq is missing, and the file stays.
        let said = campaign(
            "submit",
            &out,
            &["--engine", "hyperqueue", "--tasks-per-job", "6"],
        );
        assert_eq!(said.code, Some(2), "{}", said.stderr);
    };
    let done = campaign("work", &out, &["--chunk", "3"]);
    assert_eq!(done.code, Some(0), "{}", done.stderr);
    submit();
    let file = out.join("hyperqueue.toml");
    // A worker refuses a changed study. The client then shows which tasks failed.
    let study = folder.path().join("study.toml");
    let text = fs::read_to_string(&study).unwrap();
    fs::write(&study, format!("# changed\n{text}")).unwrap();
    let said = run(&python, &file);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    for task in ["task 1:", "task 4:"] {
        assert!(said.stderr.contains(task), "{}", said.stderr);
    }
    fs::write(&study, text).unwrap();
    let said = run(&python, &file);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    // Chunks 1 and 2, chunks 4 and 5: two tasks, each with its log.
    let logs = fs::read_dir(out.join("logs")).unwrap();
    assert_eq!(logs.count(), 2);
    let said = campaign("collect", &out, &["--prove", "100%"]);
    assert!(complete(&said, &out) == undisturbed());
}
