//! One lasting record for each physical specimen: where a motion began stays on the disk until its regular end, and one process holds it.

#![allow(clippy::disallowed_methods, reason = "other processes are waited for")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};

use crate::link_common::{
    Fake, ONE_AXIS, ONE_AXIS_LAW, Served, UNLIMITED, finish, gusset, moving, signal, summary, write,
};
use crate::waits_for;
use gusset_record::Run;
use gusset_record::lasting::{Kept, LastingError, LastingRecord, SpecimenKey};
use gusset_record::summary::Status as Ended;

/// A slow wiring check: 5 s there and back.
const SLOW: &str = "probe_m = 1e-3\nprobe_ramp_s = 5.0\n";
const NO_CHECK: &str = "probe = \"none\"\n";

/// A test on the real clock, whose specimen is the machine at `address`.
fn test_of(address: &str, steps: u32, link: &str) -> String {
    let duration = f64::from(steps) * 1e-3;
    format!(
        "title = \"machine\"\n[time]\nrate_hz = 1000\nduration_s = {duration}\nclock = \"real\"\n[structure.shear_building]\n\
         mass_kg = [1000]\nstiffness_n_per_m = [1e5]\n[excitation.ground_acceleration.signal.sine]\nfrequency_hz = 2.0\n\
         amplitude = 3.0\n[timing]\nwarmup_ticks = 5\nmisses = {{ in_total = {{ trip = 1000000 }}, in_a_row = {{ trip = 1000000 }}, \
         in_window = {{ trip = 1000000 }} }}\n[safety]\nzero_s = 0\n{UNLIMITED}[[specimen]]\nname = \"column\"\n{ONE_AXIS}\
         [specimen.link]\naddress = \"{address}\"\ncoupling = \"lockstep\"\n{link}"
    )
}

fn gateway_to(address: &str, link: &str) -> String {
    format!(
        "[safety]\n{UNLIMITED}[[specimen]]\nname = \"column\"\nstiffness_n_per_m = 4e5\n[specimen.link]\naddress = \"{address}\"\n\
         {link}"
    )
}

fn command(state: &Path) -> Command {
    let mut command = gusset();
    command.env("GUSSET_STATE", state);
    command
}

/// Exit code and output of a command that ends.
fn said(mut command: Command) -> (i32, String) {
    command.stdin(Stdio::null());
    let output = finish(command);
    let said = [output.stdout, output.stderr].concat();
    (
        output.status.code().unwrap_or(-1),
        String::from_utf8_lossy(&said).into_owned(),
    )
}

fn run_test(state: &Path, test: &Path, out: &str) -> (i32, String) {
    let mut command = command(state);
    let out = test.with_file_name(out);
    command.arg("run").arg(test).arg("--out").arg(out);
    said(command)
}

fn reset(state: &Path, path: &Path, more: &[&str]) -> (i32, String) {
    let mut command = command(state);
    command.arg("reset").arg(path).args(more);
    said(command)
}

/// The records in a folder of states.
fn records(state: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(state).into_iter().flatten();
    let paths = entries.map(|entry| entry.unwrap().path());
    paths
        .filter(|path| path.extension().is_some_and(|end| end == "json"))
        .collect()
}

fn kept(state: &Path) -> Kept {
    let files = records(state);
    assert_eq!(files.len(), 1, "{files:?}");
    serde_json::from_slice(&std::fs::read(&files[0]).unwrap()).unwrap()
}

/// Waits until the specimen has left 0.
fn moves(position: &Arc<Mutex<f64>>) {
    waits_for("it never moved", || *position.lock().unwrap() >= 1e-5);
}

fn in_background(mut command: Command) -> Child {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn a_run_killed_in_its_check_needs_a_reset() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, state) = (folder.path(), folder.path().join("state"));
    let (address, position) = Fake::machine();
    let slow = write(folder, "slow.toml", &test_of(&address, 20, SLOW));
    let mut first = command(&state);
    first
        .arg("run")
        .arg(&slow)
        .arg("--out")
        .arg(folder.join("first"));
    let mut first = in_background(first);
    moves(&position);
    let recorded = kept(&state).place.unwrap();
    assert_eq!((recorded.began, recorded.left), (vec![0.0], vec![]));
    first.kill().unwrap();
    first.wait().unwrap();
    let stands = *position.lock().unwrap();
    assert!(stands > 0.0);

    let quick = write(folder, "quick.toml", &test_of(&address, 20, NO_CHECK));
    let (code, words) = run_test(&state, &quick, "refused");
    assert_eq!(code, 2, "{words}");
    assert!(words.contains("gusset reset"), "{words}");
    assert_eq!(summary(folder, "refused").status, Ended::Stopped);
    assert_eq!(*position.lock().unwrap(), stands, "nothing moved");

    let (code, words) = reset(&state, &quick, &[]);
    assert_eq!(code, 2, "it needs a confirmation: {words}");
    let (code, words) = reset(&state, &folder.join("refused"), &["--yes"]);
    assert_eq!(code, 0, "{words}");
    assert!(words.contains("reports the position"), "{words}");
    assert_eq!(records(&state).len(), 0);
    let (code, words) = run_test(&state, &quick, "second");
    assert_eq!(code, 0, "{words}");
    assert_eq!(records(&state).len(), 0, "removed at the regular end");
}

#[test]
fn gateway_killed_in_its_check_needs_reset() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, state) = (folder.path(), folder.path().join("state"));
    let (address, position) = Fake::machine();
    let file = write(folder, "gateway.toml", &gateway_to(&address, SLOW));
    let mut first = Served::serves(&file, "127.0.0.1:0", &[]);
    let own = folder.join("of the client");
    let test = write(folder, "test.toml", &test_of(&first.address, 20, NO_CHECK));
    let mut client = command(&own);
    client
        .arg("run")
        .arg(&test)
        .arg("--out")
        .arg(folder.join("client"));
    let mut client = in_background(client);
    moves(&position);
    assert_eq!(kept(&state).place.unwrap().began, [0.0]);
    first.kill();
    client.wait().unwrap();
    drop(first);

    let file = write(folder, "again.toml", &gateway_to(&address, NO_CHECK));
    let next = Served::serves(&file, "127.0.0.1:0", &[]);
    next.hears("has not ended regularly");
    let test = write(folder, "test.toml", &test_of(&next.address, 20, NO_CHECK));
    let (code, words) = run_test(&folder.join("own"), &test, "refused");
    assert_eq!(code, 3, "{words}");
    // The record also refuses a test that connects directly.
    let direct = write(folder, "direct.toml", &test_of(&address, 20, NO_CHECK));
    let (code, words) = run_test(&state, &direct, "direct");
    assert_eq!(code, 2, "{words}");
    assert!(words.contains("is held by process"), "{words}");
    let (code, words) = reset(&state, &file, &["--yes"]);
    assert_eq!(code, 0, "{words}");
    assert!(words.contains("reports the position"), "{words}");
    // The operator moves it to the start of the test.
    *position.lock().unwrap() = 0.0;
    let (code, words) = run_test(&folder.join("own"), &test, "second");
    assert_eq!(code, 0, "{words}");
    next.hears("test over");
    assert_eq!(records(&state).len(), 0);
}

#[test]
fn operator_who_stops_a_run_leaves_a_record() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, state) = (folder.path(), folder.path().join("state"));
    let (address, position) = Fake::machine();
    let test = write(folder, "test.toml", &test_of(&address, 60_000, NO_CHECK));
    let mut first = command(&state);
    first
        .arg("run")
        .arg(&test)
        .arg("--out")
        .arg(folder.join("first"));
    let mut first = in_background(first);
    moves(&position);
    signal(first.id(), "INT");
    assert_eq!(first.wait().unwrap().code(), Some(130));
    let place = kept(&state).place.unwrap();
    assert_eq!(place.left, [*position.lock().unwrap()]);
    assert_eq!(place.units, ["m"]);
    let (code, words) = run_test(&state, &test, "refused");
    assert_eq!(code, 2, "{words}");
    // The interrupted test recorded the last position of the specimen.
    let mut resumed = command(&state);
    resumed.arg("run").arg("--resume").arg(folder.join("first"));
    resumed.arg("--out").arg(folder.join("resumed"));
    let mut child = in_background(resumed);
    waits_for("it was not taken over", || {
        kept(&state).place.unwrap().runs.len() >= 2
    });
    assert_eq!(kept(&state).place.unwrap().began, [0.0]);
    signal(child.id(), "KILL");
    child.wait().unwrap();
}

/// After a first signal the wiring check returns to its start, and the run folder replays.
#[test]
fn signal_returns_a_wiring_check() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, state) = (folder.path(), folder.path().join("state"));
    let (address, position) = Fake::machine();
    let check = "probe_m = 1e-3\nprobe_ramp_s = 0.5\n";
    let test = write(folder, "test.toml", &test_of(&address, 20, check));
    for (kind, exit) in [("INT", 130), ("TERM", 143)] {
        let out = folder.join(kind);
        let mut run = command(&state);
        run.arg("run").arg(&test).arg("--out").arg(&out);
        let mut run = in_background(run);
        moves(&position);
        signal(run.id(), kind);
        assert_eq!(run.wait().unwrap().code(), Some(exit));
        assert_eq!(*position.lock().unwrap(), 0.0, "{kind}");
        assert_eq!(records(&state).len(), 0, "{kind}");
        let mut replay = command(&state);
        replay.arg("replay").arg(&out);
        let (code, words) = said(replay);
        assert_eq!(code, 0, "{words}");
    }
}

/// How a session of the sequence below ends.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Ends {
    Itself,
    Signals(&'static [&'static str]),
    Stop,
    Trip,
}

const ENDS: [Ends; 7] = [
    Ends::Itself,
    Ends::Signals(&["INT"]),
    Ends::Signals(&["TERM"]),
    Ends::Signals(&["INT", "INT"]),
    Ends::Signals(&["KILL"]),
    Ends::Stop,
    Ends::Trip,
];

/// 50 tests and identifications end in any maneuver. After each the specimen is where it began or the end was regular; otherwise
/// the next test is refused and moves nothing.
#[test]
fn no_ending_of_a_run_is_unseen() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, state) = (folder.path(), folder.path().join("state"));
    let (address, position) = Fake::machine();
    let stands = || *position.lock().unwrap();
    let link = "probe_m = 1e-3\nprobe_ramp_s = 0.05\n";
    let limits = "[specimen.limits]\ncommand_disp_m = { trip = [-0.05, 0.05] }\ncommand_accel_m_per_s2 = { trip = 200 }\n\
                  measured_force_n = { trip = [-LOAD, LOAD] }\n";
    let file = |name: &str, load: &str| {
        let text = test_of(&address, 120, link);
        write(folder, name, &(text + &limits.replace("LOAD", load)))
    };
    let (sound, weak) = (file("sound.toml", "2e4"), file("weak.toml", "450"));
    let mut seed = 7_u64;
    let mut random = |below: u64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) % below
    };
    let mut refusals = 0;
    for session in 0..50 {
        let end = ENDS[random(ENDS.len() as u64) as usize];
        let identifies = end != Ends::Trip && random(3) == 0;
        let test = if end == Ends::Trip { &weak } else { &sound };
        let out = folder.join(format!("session-{session}"));
        let mut one = command(&state);
        if identifies {
            one.arg("identify").arg(test).args(["--duration", "0.3"]);
        } else {
            one.arg("run").arg(test);
        }
        one.arg("--out").arg(&out);
        let began = stands();
        let mut child = in_background(one);
        // However slowly the program starts.
        waits_for("it neither moves nor ends", || {
            !records(&state).is_empty() || child.try_wait().unwrap().is_some()
        });
        std::thread::sleep(std::time::Duration::from_millis(random(700)));
        match end {
            Ends::Itself | Ends::Trip => {}
            Ends::Signals(signals) => {
                for kind in signals {
                    if child.try_wait().unwrap().is_none() {
                        signal(child.id(), kind);
                    }
                }
            }
            Ends::Stop => {
                let mut stop = command(&state);
                stop.arg("stop").arg(&out);
                // It may be over, or not have begun.
                let _ = said(stop);
            }
        }
        let code = child.wait().unwrap().code();
        // The last command of a killed one may still be on its way.
        std::thread::sleep(std::time::Duration::from_millis(50));
        let is_back = (stands() - began).abs() < 1e-9;
        let is_refused = !records(&state).is_empty();
        // A signal may come after the end of the test.
        let summary = Run::open(&out).ok().and_then(|run| run.summary().cloned());
        let is_over = summary.is_some_and(|summary| summary.status == Ended::Completed);
        let is_regular = code == Some(0) || (code.is_none() && is_over);
        assert!(
            is_regular || is_back || is_refused,
            "{session}: {end:?} {code:?}"
        );
        // The last command of a killed one is unknown, and its record may be forgotten later than its summary is written.
        let is_known = code == Some(0) || (is_back && code.is_some());
        assert!(!(is_known && is_refused), "{session}: {end:?} {code:?}");
        if is_refused {
            refusals += 1;
            let here = stands();
            let (code, words) = run_test(&state, &sound, &format!("refused-{session}"));
            assert_eq!(code, 2, "{session}: {words}");
            assert_eq!(stands(), here, "{session}: nothing moved");
            assert_eq!(kept(&state).place.unwrap().began, [began]);
            let (code, words) = reset(&state, &sound, &["--yes"]);
            assert_eq!(code, 0, "{words}");
        }
        // Its operator moves it to where a test begins.
        *position.lock().unwrap() = 0.0;
    }
    assert!((5..45).contains(&refusals), "{refusals}");
}

#[test]
fn specimen_has_one_record_and_one_holder() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (address, _) = Fake::machine();
    let file = write(folder, "one.toml", &gateway_to(&address, NO_CHECK));
    let port = address.rsplit(':').next().unwrap();
    let by_name = gateway_to(&format!("localhost:{port}"), NO_CHECK);
    let other = write(folder, "other.toml", &by_name);
    let control = |name: &str| folder.join(name).display().to_string();
    let one = control("one.sock");
    let _first = Served::serves(&file, "127.0.0.1:0", &["--control", &one]);
    let mut second = command(&folder.join("state"));
    second
        .arg("serve")
        .arg(&other)
        .args(["--listen", "127.0.0.1:0"]);
    second.args(["--control", &control("two.sock")]);
    let (code, words) = said(second);
    assert_eq!(code, 2, "{words}");
    assert!(words.contains("is held by process"), "{words}");
}

#[test]
fn special_file_is_no_record() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let key_of = |address| SpecimenKey::of_link("gusset", address);
    let key = key_of("127.0.0.1:4823").unwrap();
    assert_eq!(key, key_of("localhost:4823").unwrap());
    assert_ne!(key, key_of("127.0.0.1:4824").unwrap());
    // Its record may have another name.
    let unresolved = key_of("rig.invalid:4823");
    assert!(matches!(unresolved, Err(LastingError::Unresolved { .. })));
    let file = LastingRecord::hold(folder, &key).unwrap().file().to_owned();
    let precious = folder.join("precious");
    std::fs::write(&precious, "precious").unwrap();
    for place in [file.clone(), file.with_extension("lock")] {
        let _ = std::fs::remove_file(&place);
        std::os::unix::fs::symlink(&precious, &place).unwrap();
        let refused = LastingRecord::hold(folder, &key);
        assert!(matches!(refused, Err(LastingError::File { .. })));
        std::fs::remove_file(&place).unwrap();
        assert!(
            Command::new("mkfifo")
                .arg(&place)
                .status()
                .unwrap()
                .success()
        );
        let refused = LastingRecord::hold(folder, &key);
        assert!(matches!(refused, Err(LastingError::File { .. })));
        std::fs::remove_file(&place).unwrap();
    }
    assert_eq!(std::fs::read(&precious).unwrap(), b"precious");
    let held = LastingRecord::hold(folder, &key).unwrap();
    let second = LastingRecord::hold(folder, &key);
    let ours = Some(std::process::id());
    assert!(matches!(second, Err(LastingError::Held { pid, .. }) if pid == ours));
    drop(held);
    LastingRecord::hold(folder, &key).unwrap();
}

#[test]
fn a_latch_of_an_earlier_version_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let file = write(folder, "rig.toml", &moving());
    write(folder, "rig.control.latch.json", "{}");
    let mut serve = command(&folder.join("state"));
    serve
        .arg("serve")
        .arg(&file)
        .args(["--protocol", "openfresco"]);
    let (code, words) = said(serve);
    assert_eq!(code, 2, "{words}");
    assert!(words.contains("rig.control.latch.json"), "{words}");
}

#[test]
fn a_simulated_specimen_has_no_record() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, state) = (folder.path(), folder.path().join("own"));
    let law = format!("[[specimen]]\nname = \"column\"\n{ONE_AXIS_LAW}");
    let served = Served::start(folder, &law, &[]);
    let test = write(
        folder,
        "test.toml",
        &test_of(&served.address, 60_000, NO_CHECK),
    );
    let mut first = command(&state);
    first
        .arg("run")
        .arg(&test)
        .arg("--out")
        .arg(folder.join("first"));
    let mut first = in_background(first);
    let samples = folder.join("first/samples.bin");
    waits_for("it records nothing", || {
        std::fs::metadata(&samples).map_or(0, |found| found.len()) >= 50_000
    });
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(!state.exists() && !folder.join("state").exists());
}
