//! What an operator says to a running test from another terminal: `gusset hold`, `continue` and `stop`.

mod common;

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use gusset::record::Run;

const GUSSET: &str = env!("CARGO_BIN_EXE_gusset");
/// A test in real time, far longer than anybody waits.
const TEST: &str = "title = \"operator\"\n[time]\nrate_hz = 200\nduration_s = 600\nclock = \"real\"\n[structure.shear_building]\n\
    mass_kg = [2e3]\nstiffness_n_per_m = [3e5]\n[excitation.ground_acceleration.signal.sine]\namplitude = 1\n\
    frequency_hz = 1\n[[specimen]]\nname = \"rig\"\nstorey = 1\nlaw.linear = { stiffness_n_per_m = 1e5 }\n\
    [timing]\nwarmup_ticks = 5\n[safety]\nzero_s = 0.05\n";

fn gusset(args: &[&str]) -> Output {
    Command::new(GUSSET).args(args).output().unwrap()
}

fn begin(home: &Path, more: &str) -> Child {
    let test = home.join("test.toml");
    std::fs::write(&test, format!("{TEST}{more}")).unwrap();
    Command::new(GUSSET)
        .arg("run")
        .arg(&test)
        .arg("--out")
        .arg(home.join("run"))
        .args(["--quiet", "--set", "timing.policy=\"ordinary\""])
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Waits until `done`, with a bound that only a hang meets.
#[expect(clippy::disallowed_methods, reason = "another process is waited for")]
fn until(what: &str, mut done: impl FnMut() -> bool) {
    let began = Instant::now();
    while !done() {
        assert!(began.elapsed() < Duration::from_secs(60), "{what}");
        std::thread::yield_now();
    }
}

fn events(run: &Path) -> String {
    std::fs::read_to_string(run.join("events.jsonl")).unwrap_or_default()
}

fn say(word: &str, run: &Path) -> String {
    let said = gusset(&[word, run.to_str().unwrap()]);
    assert!(said.status.success(), "{said:?}");
    String::from_utf8(said.stdout).unwrap().trim().to_owned()
}

#[test]
fn a_test_holds_goes_on_and_ends_as_it_is_told() {
    let home = tempfile::tempdir().unwrap();
    let run = home.path().join("run");
    let mut test = begin(home.path(), "");
    until("it runs", || events(&run).contains("\"started\""));
    assert_eq!(say("hold", &run), "holding");
    assert_eq!(say("continue", &run), "running");
    assert_eq!(say("stop", &run), "ended");
    assert_eq!(test.wait().unwrap().code(), Some(130));
    assert!(!run.join("control.sock").exists());
    let events = events(&run);
    for phase in ["zeroing", "armed", "running", "holding", "safe"] {
        assert!(events.contains(&format!("\"to\":\"{phase}\"")), "{events}");
    }
    let read = Run::open(&run).unwrap();
    assert!(read.summary().is_some());

    let late = gusset(&["hold", run.to_str().unwrap()]);
    assert_eq!(late.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&late.stderr).contains("this test is over"));
}

#[test]
fn where_nothing_runs_nobody_can_be_told_anything() {
    let home = tempfile::tempdir().unwrap();
    let said = gusset(&["stop", home.path().to_str().unwrap()]);
    assert_eq!(said.status.code(), Some(2));
    let text = String::from_utf8_lossy(&said.stderr);
    assert!(text.contains("no test is running here"), "{text}");
}

const RELATIVE: &str = "confirm = true\n";

#[test]
fn without_a_terminal_nothing_is_confirmed_unless_it_is_said() {
    let home = tempfile::tempdir().unwrap();
    let refused = begin(home.path(), RELATIVE).wait_with_output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let text = String::from_utf8_lossy(&refused.stderr);
    assert!(
        text.contains("--yes") && text.contains("nothing was moved"),
        "{text}"
    );
    assert!(!home.path().join("run").exists());

    let test = home.path().join("test.toml");
    let out = home.path().join("yes");
    let done = gusset(&[
        "run",
        test.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
        "--clock",
        "simulated",
        "--set",
        "time.duration_s=1",
        "--yes",
    ]);
    assert!(done.status.success(), "{done:?}");
    let text = String::from_utf8_lossy(&done.stderr);
    assert!(
        text.contains("specimen \"rig\" axis 1: displacement 0"),
        "{text}"
    );
}
