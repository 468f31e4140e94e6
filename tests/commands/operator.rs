//! Operator commands to a running test from another terminal: `gusset hold`, `continue` and `stop`.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use gusset_record::Run;
use rustix::process::{Pid, Signal, kill_process};

const GUSSET: &str = env!("CARGO_BIN_EXE_gusset");
/// A test in real time, longer than these tests last. Before it moves its error is found, which takes as long as some tests of it do.
const TEST: &str = "title = \"operator\"\n[time]\nrate_hz = 200\nduration_s = 120\nclock = \"real\"\n[structure.shear_building]\n\
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
        assert!(began.elapsed() < Duration::from_secs(300), "{what}");
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
fn hold_continue_and_stop_are_obeyed() {
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
    for asked in ["hold", "continue", "stop"] {
        assert!(events.contains(&format!("\"event\":\"{asked}_requested\"")));
    }
    let read = Run::open(&run).unwrap();
    assert!(read.summary().is_some());

    let late = gusset(&["hold", run.to_str().unwrap()]);
    assert_eq!(late.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&late.stderr).contains("is over"));
}

/// The server listens but stays silent: an operator need not wait for its time limit.
#[test]
fn operator_can_end_the_wait_for_a_specimen() {
    let mute = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = mute.local_addr().unwrap();
    for (asked, code) in [
        (None, 130),
        (Some(Signal::INT), 130),
        (Some(Signal::TERM), 143),
        (Some(Signal::USR1), 143),
        (Some(Signal::XCPU), 143),
        (Some(Signal::POWER), 143),
    ] {
        let home = tempfile::tempdir().unwrap();
        let run = home.path().join("run");
        let more = format!(
            "unlimited = \"a test\"\n[[specimen]]\nname = \"mute\"\nstorey = 1\nstiffness_n_per_m = 1e5\n\
             link = {{ address = \"{address}\", connect_timeout_s = 3600 }}\n"
        );
        let mut test = begin(home.path(), &more);
        let _visitor = mute.accept().unwrap();
        until("it can be reached", || run.join("control.sock").exists());
        match asked {
            None => assert_eq!(say("stop", &run), "ended"),
            Some(signal) => send(&test, signal),
        }
        let mut patience = 60_000;
        let status = loop {
            match test.try_wait().unwrap() {
                Some(status) => break status,
                None if patience == 0 => {
                    test.kill().unwrap();
                    panic!("it waits on");
                }
                None => patience -= 1,
            }
            gusset_session::pause(Duration::from_millis(1));
        };
        assert_eq!(status.code(), Some(code), "{asked:?}");
        let summary = Run::open(&run).unwrap().summary().unwrap().clone();
        assert!(
            summary.reason.contains("being connected"),
            "{}",
            summary.reason
        );
    }
}

#[test]
fn commands_without_a_test_are_refused() {
    let home = tempfile::tempdir().unwrap();
    let said = gusset(&["stop", home.path().to_str().unwrap()]);
    assert_eq!(said.status.code(), Some(2));
    let text = String::from_utf8_lossy(&said.stderr);
    assert!(text.contains("no test"), "{text}");
}

const RELATIVE: &str = "confirm = true\n";

#[test]
fn no_terminal_no_confirmation_by_default() {
    let home = tempfile::tempdir().unwrap();
    let refused = begin(home.path(), RELATIVE).wait_with_output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let text = String::from_utf8_lossy(&refused.stderr);
    assert!(
        text.contains("--yes") && text.contains("was moved"),
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
    assert!(text.contains("\"rig\", axis 1"), "{text}");
    let told = events(&out);
    assert!(told.contains("confirmed unseen") && told.contains("\"event\":\"confirmed\""));
}

/// The rows of a run in this state, of one column.
fn of_state(run: &Path, state: f64, column: &str) -> Vec<f64> {
    let columns = Run::open(run).unwrap().columns(&["state", column]).unwrap();
    let rows = columns[0].iter().zip(&columns[1]);
    rows.filter(|(now, _)| **now == state)
        .map(|(_, value)| *value)
        .collect()
}

fn refused(word: &str, run: &Path) -> String {
    let said = gusset(&[word, run.to_str().unwrap()]);
    assert_eq!(said.status.code(), Some(1), "{said:?}");
    assert!(said.stdout.is_empty(), "{said:?}");
    String::from_utf8(said.stderr).unwrap()
}

/// The ramp takes 4 s; the shutdown takes longer than any command waits.
const SLOWLY: &str = "ramp_s = 4\nat_end = \"zero_displacement\"\nexit_speed_m_per_s = 1e-6\n[structure]\n\
    initial_displacement_m = [0.02]\n";

#[test]
fn hold_in_shutdown_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let run = home.path().join("run");
    let mut test = begin(home.path(), SLOWLY);
    until("it ramps", || events(&run).contains("\"to\":\"ramping\""));
    assert_eq!(say("hold", &run), "holding (ramping)");
    assert_eq!(say("hold", &run), "holding (ramping)");
    assert_eq!(say("continue", &run), "ramping");
    until("it runs", || events(&run).contains("\"started\""));
    let rows = || std::fs::metadata(run.join("samples.bin")).map_or(0, |m| m.len());
    let before = rows();
    until("it moves", || rows() > before + 20_000);
    let stop = || {
        Command::new(GUSSET)
            .arg("stop")
            .arg(&run)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    };
    let first = stop();
    until("it leaves", || events(&run).contains("\"to\":\"leaving\""));
    for word in ["hold", "continue"] {
        let text = refused(word, &run);
        assert!(text.contains("shutting down"), "{text}");
    }
    let cut = "ended: the shutdown was cut short, and specimens that were still moving hold where they are\n";
    for (stop, told) in [(first, "ended\n"), (stop(), cut)] {
        let said = stop.wait_with_output().unwrap();
        assert_eq!(said.stdout, told.as_bytes(), "{said:?}");
        assert!(said.status.success(), "{said:?}");
    }
    assert_eq!(test.wait().unwrap().code(), Some(130));
    let ramp = of_state(&run, 5.0, "cmd_1_1");
    let still = ramp.windows(2).filter(|pair| pair[0] == pair[1]).count();
    // From the first hold, once it is confirmed, to the second, and to the end of the test.
    assert!(still > 2, "{still} of {} rows", ramp.len());
}

/// Like a machine that schedules none of the process's threads for a while.
fn send(to: &Child, signal: Signal) {
    let pid = Pid::from_raw(i32::try_from(to.id()).unwrap()).unwrap();
    kill_process(pid, signal).unwrap();
}

#[test]
fn unresponsive_test_is_retried() {
    let home = tempfile::tempdir().unwrap();
    let run = home.path().join("run");
    let mut test = begin(home.path(), "");
    until("it runs", || events(&run).contains("\"started\""));
    for (word, then) in [("hold", "holding\n"), ("stop", "ended\n")] {
        send(&test, Signal::STOP);
        let mut told = Command::new(GUSSET)
            .arg(word)
            .arg(&run)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut first = String::new();
        let mut words = BufReader::new(told.stderr.take().unwrap());
        words.read_line(&mut first).unwrap();
        assert!(
            first.contains("not answer") && first.contains("60 s"),
            "{first}"
        );
        assert!(told.try_wait().unwrap().is_none(), "{word} gave up");
        if word == "stop" {
            let next = home.path().join("next");
            let [run, next] = [&run, &next].map(|path| path.to_str().unwrap());
            let resumed = gusset(&["run", "--resume", run, "--out", next]);
            assert_eq!(resumed.status.code(), Some(2), "{resumed:?}");
            let text = String::from_utf8_lossy(&resumed.stderr);
            assert!(text.contains("nothing says"), "{text}");
        }
        send(&test, Signal::CONT);
        let said = told.wait_with_output().unwrap();
        assert!(said.status.success(), "{said:?}");
        assert_eq!(String::from_utf8(said.stdout).unwrap(), then);
    }
    assert_eq!(test.wait().unwrap().code(), Some(130));
    let events = events(&run);
    let asked = events.matches("\"event\":\"stop_requested\"").count();
    assert_eq!(
        asked, 1,
        "requests in the socket are not repeated: {events}"
    );
}

/// The fate of the first test's folder when two tests use one path.
#[derive(Debug, Clone, Copy)]
enum Fate {
    Moved,
    Deleted,
    /// It is a link, which now leads to another folder.
    Relinked,
}

#[test]
fn removed_folder_ends_only_its_own_test() {
    for fate in [Fate::Moved, Fate::Deleted, Fate::Relinked] {
        let home = tempfile::tempdir().unwrap();
        let place = |name: &str| home.path().join(name);
        let run = place("run");
        let lead_to = |name: &str| {
            std::fs::create_dir(place(name)).unwrap();
            std::os::unix::fs::symlink(place(name), &run).unwrap();
        };
        if matches!(fate, Fate::Relinked) {
            lead_to("old");
        }
        let mut first = begin(home.path(), "");
        until("it runs", || events(&run).contains("\"started\""));
        match fate {
            Fate::Moved => std::fs::rename(&run, place("old")).unwrap(),
            Fate::Deleted => std::fs::remove_dir_all(&run).unwrap(),
            Fate::Relinked => {
                std::fs::remove_file(&run).unwrap();
                lead_to("new");
            }
        }
        let mut second = begin(home.path(), "");
        until("it runs", || events(&run).contains("\"started\""));

        send(&first, Signal::INT);
        let mut ended = None;
        until("the first ends", || {
            ended = first.try_wait().unwrap();
            ended.is_some()
        });
        assert_eq!(ended.unwrap().code(), Some(130), "{fate:?}");
        let mut said = String::new();
        let mut words = first.stderr.take().unwrap();
        std::io::Read::read_to_string(&mut words, &mut said).unwrap();
        match fate {
            Fate::Deleted => {
                let deleted = "the run folder was deleted while the test ran";
                for words in [deleted, "ROWS ARE", "summary.json"] {
                    assert!(said.contains(words), "{words}: {said}");
                }
            }
            Fate::Moved | Fate::Relinked => {
                assert!(said.contains("moved to"), "{said}");
                assert!(Run::open(&place("old")).unwrap().summary().is_some());
                assert!(place("old").join("report.html").exists());
                assert!(!place("old").join("control.sock").exists());
            }
        }
        for name in [
            "summary.json",
            "timing.json",
            "tick_time.hgrm",
            "report.html",
        ] {
            assert!(!run.join(name).exists(), "{fate:?}: {name}");
        }
        assert_eq!(say("hold", &run), "holding", "{fate:?}");
        assert_eq!(say("stop", &run), "ended", "{fate:?}");
        assert_eq!(second.wait().unwrap().code(), Some(130));
        assert!(run.join("report.html").exists());
    }
}
