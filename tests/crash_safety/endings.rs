//! Whatever ends a test, the specimen is retired, the folder shows the cause, and the exit code shows how it ended.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::common::test_file::TestFile;
use crate::common::{FRAME, PATIENT, Said, completed, json, run, say, write};
use gusset_record::Run;

/// A test that lasts longer than this file may, on the real clock.
fn long(folder: &Path) -> std::path::PathBuf {
    let text = FRAME.with("time = { duration_s = 600, rate_hz = 1000, clock = 'real' }");
    write(folder, "test.toml", &text)
}

/// The binary with `hang_up` as its setting for SIGHUP, whatever the setting of these tests.
fn gusset_that_is(hang_up: &str) -> Command {
    let mut command = Command::new("env");
    command
        .arg(hang_up)
        .arg(assert_cmd::cargo::cargo_bin!("gusset"))
        .env("GUSSET_STATE", crate::common::state_folder())
        .stdin(Stdio::null());
    command
}

/// A running test, or server; killed if the test of it fails.
struct Running(Option<Child>);

impl Running {
    fn start(test: &Path, out: &Path) -> Self {
        let mut command = gusset_that_is("--default-signal=HUP");
        command
            .arg("run")
            .arg(test)
            .arg("--out")
            .arg(out)
            .args(PATIENT);
        Self::of(command)
    }

    fn of(mut command: Command) -> Self {
        let child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self(Some(child))
    }

    fn child(&mut self) -> &mut Child {
        self.0.as_mut().unwrap()
    }

    /// Waits until `rows` rows are in the file.
    fn until_rows(&mut self, out: &Path, rows: u64) {
        loop {
            let stride = fs::read_to_string(out.join("samples.json"))
                .ok()
                .and_then(|text| {
                    serde_json::from_str::<serde_json::Value>(&text).ok()?["stride"].as_u64()
                });
            let length = fs::metadata(out.join("samples.bin")).map_or(0, |file| file.len());
            if stride.is_some_and(|stride| length >= rows * stride) {
                return;
            }
            let ended = self.child().try_wait().unwrap();
            assert!(ended.is_none(), "the test ended by itself: {ended:?}");
            std::thread::park_timeout(Duration::from_millis(2));
        }
    }

    fn signal(&mut self, name: &str) -> Said {
        let id = self.child().id().to_string();
        assert!(
            Command::new("kill")
                .args(["-s", name, &id])
                .status()
                .unwrap()
                .success()
        );
        self.0.take().unwrap().wait_with_output().unwrap().into()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(mut child) = self.0.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

#[track_caller]
fn interrupted(signal: &str, code: i32) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut running = Running::start(&long(folder.path()), &out);
    running.until_rows(&out, 200);
    let said = running.signal(signal);
    assert_eq!(said.code, Some(code), "{}", said.stderr);
    assert!(said.stderr.contains("interrupted"), "{}", said.stderr);
    let summary = json(&out, "summary.json");
    assert_eq!(
        (&summary["status"], &summary["cause"]),
        (&"interrupted".into(), &"operator".into())
    );
    let rows = Run::open(&out)
        .unwrap()
        .columns(&["step"])
        .unwrap()
        .remove(0);
    assert_eq!(
        summary["steps"].as_f64(),
        rows.last().copied(),
        "every step made is in the file"
    );
    assert_eq!(summary["rows_lost"], 0);
    assert!(
        fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains("Interrupted: ")
    );
    let events = fs::read_to_string(out.join("events.jsonl")).unwrap();
    assert!(
        events.contains("\"stop_requested\"") && events.contains("\"ended\""),
        "{events}"
    );
    assert!(out.join("timing.json").exists() && out.join("compute.hgrm").exists());
}

#[test]
fn ctrl_c_ends_cleanly_with_130() {
    interrupted("INT", 130);
}

#[test]
fn ctrl_c_works_while_a_slow_test_waits() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let text = FRAME.with("time = { clock = 'real', scale = 8000 }");
    let test = write(
        folder.path(),
        "test.toml",
        &format!("{text}[timing]\nwarmup_ticks = 0\n"),
    );
    let mut running = Running::start(&test, &out);
    // Row 0 is made; row 1 is due in 40 s.
    running.until_rows(&out, 1);
    let said = running.signal("INT");
    assert_eq!(said.code, Some(130), "{}", said.stderr);
    let summary = json(&out, "summary.json");
    assert_eq!(summary["status"], "interrupted");
    let wall = summary["wall_seconds"].as_f64().unwrap();
    assert!(wall < 39.0, "it waited for the edge: {wall} s");
}

#[test]
fn sigquit_ends_the_test_cleanly() {
    interrupted("QUIT", 130);
}

#[test]
fn sigterm_and_lost_terminal_exit_with_143() {
    interrupted("TERM", 143);
    interrupted("HUP", 143);
}

/// Signals that a process ignores, from the system: bit n − 1 for signal n.
fn ignored(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    u64::from_str_radix(mask.unwrap().trim(), 16).unwrap()
}

/// `nohup` works for every command. A file at its size limit ends none, and Ctrl-Z and a terminal's rules for background processes
/// stop none.
#[test]
fn ignored_hang_up_stays_ignored() {
    const HUNG_UP: u64 = 1;
    const FILE_SIZE: u64 = 1 << 24;
    const STOPS: u64 = 0b111 << 19;
    const ALWAYS: u64 = FILE_SIZE | STOPS;
    let folder = tempfile::tempdir().unwrap();
    let test = long(folder.path());
    let cases = [
        ("--default-signal=HUP", ALWAYS),
        ("--ignore-signal=HUP", ALWAYS | HUNG_UP),
    ];
    for (hang_up, wanted) in cases {
        let of_interest = |running: &mut Running| {
            let found = ignored(running.child().id());
            found & (ALWAYS | HUNG_UP)
        };
        for protocol in ["gusset", "openfresco"] {
            let mut command = gusset_that_is(hang_up);
            command.arg("serve").arg(&test);
            command.args(["--specimen", "storey", "--listen", "127.0.0.1:0"]);
            command.args(["--protocol", protocol]);
            let mut served = Running::of(command);
            let mut line = String::new();
            let mut said = BufReader::new(served.child().stdout.take().unwrap());
            said.read_line(&mut line).unwrap();
            assert!(line.starts_with("listening on"), "{line}");
            assert_eq!(of_interest(&mut served), wanted, "{protocol}");
        }
        let out = folder.path().join(format!("out-{wanted}"));
        let mut command = gusset_that_is(hang_up);
        command.arg("run").arg(&test).arg("--out").arg(&out);
        command.args(PATIENT);
        let mut running = Running::of(command);
        running.until_rows(&out, 1);
        assert_eq!(of_interest(&mut running), wanted);
    }
}

#[test]
fn killed_run_is_readable_and_unfinished() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut running = Running::start(&long(folder.path()), &out);
    running.until_rows(&out, 300);
    assert_eq!(running.signal("KILL").code, None);
    let run = Run::open(&out).unwrap();
    assert!(run.summary().is_none());
    let steps = run.columns(&["step"]).unwrap().remove(0);
    // Every row seen in the file before the kill is in it afterwards.
    assert!(steps.len() >= 300, "{} rows", steps.len());
    assert!(
        steps
            .iter()
            .enumerate()
            .all(|(row, step)| *step == row as f64)
    );
    // A kill in the middle of a write leaves a part of a row.
    let samples = out.join("samples.bin");
    let bytes = fs::read(&samples).unwrap();
    fs::write(&samples, &bytes[..steps.len() * run.layout().stride() - 5]).unwrap();
    let file = folder.path().join("out.csv");
    let said = say([
        "export".as_ref(),
        out.as_os_str(),
        "--no-units-line".as_ref(),
        "--out".as_ref(),
        file.as_os_str(),
    ]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stderr.contains("unfinished (no summary.json)"),
        "{}",
        said.stderr
    );
    assert_eq!(
        fs::read_to_string(file).unwrap().lines().count(),
        steps.len(),
        "a header and all but the torn row"
    );
    let said = say(["report".as_ref(), out.as_os_str()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stderr.contains("unfinished (no summary.json)"),
        "{}",
        said.stderr
    );
    assert!(
        fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains("no summary.json")
    );
}

/// Example 4.1 of Gui et al. (2014): λ = 17 is above the limit of 16.77.
const EXAMPLE: &str = r#"[time]
step_s = 0.05
duration_s = 200
clock = "simulated"
[structure.shear_building]
mass_kg = [1e3, 4e3]
stiffness_n_per_m = [2e6, 1e5]
[integrator]
lambda = 17
[excitation.ground_acceleration.signal.sine]
amplitude = 20
frequency_hz = 0.15915494309189535
[safety]
divergence_m = 50
"#;

#[test]
fn divergence_stops_the_test_names_the_dof() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", EXAMPLE);
    let out = folder.path().join("out");
    let said = run(&test, &out, &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    // The published limit, to its four digits.
    let limit = said.stderr.split("is above the limit ").nth(1).unwrap();
    let limit: f64 = limit.split(' ').next().unwrap().parse().unwrap();
    assert!((limit - 16.77).abs() < 0.005, "{}", said.stderr);
    let summary = json(&out, "summary.json");
    assert_eq!(summary["status"], "stopped");
    let reason = summary["reason"].as_str().unwrap();
    // The sawtooth is that of the stiff bottom storey, whose floor is DOF 1.
    assert!(
        reason.contains("DOF 1 ") && reason.contains("`safety.divergence_m`"),
        "{reason}"
    );
    let steps = summary["steps"].as_u64().unwrap();
    assert!((1..4000).contains(&steps), "{steps}");
    let events = fs::read_to_string(out.join("events.jsonl")).unwrap();
    assert!(
        events.contains("\"diverged\"") && events.contains("\"dof\":1"),
        "{events}"
    );
    assert!(
        fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains("diverged")
    );
    // A stable λ carries the same test to its end.
    completed(
        &test,
        &folder.path().join("stable"),
        &["--set", "integrator.lambda=11.5"],
    );
}

/// No link is there to fail: a computation that diverged is a test that stopped, not a peer that was lost.
#[test]
fn nonfinite_force_stops_the_test_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let text = "[time]\nrate_hz = 100\nduration_s = 0.5\nclock = \"simulated\"\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"spring\"\n\
        signal.sine = { amplitude = 100, frequency_hz = 1 }\n[[specimen]]\nname = \"spring\"\n\
        law.cubic = { stiffness_n_per_m = 1e3, cubic_n_per_m3 = 1e304 }\n";
    let test = write(folder.path(), "test.toml", text);
    let said = run(&test, &out, &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    let summary = json(&out, "summary.json");
    assert_eq!(summary["status"], "stopped");
    let reason = summary["reason"].as_str().unwrap();
    for words in ["specimen \"spring\"", "computed here", "diverged"] {
        assert!(reason.contains(words), "{words}: {reason}");
    }
    // The record contains only the finite forces from before.
    let run = Run::open(&out).unwrap();
    let force = run.columns(&["force_1_1"]).unwrap().remove(0);
    assert!(!force.is_empty() && force.iter().all(|f| f.is_finite()));
    let events = fs::read_to_string(out.join("events.jsonl")).unwrap();
    assert!(events.contains("\"diverged\""), "{events}");
}
