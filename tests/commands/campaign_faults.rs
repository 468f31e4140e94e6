//! Faults of a campaign: killed workers, a full disk, wrong clocks, another program. Nothing is lost, double or silently
//! different: the table is equal to that of an undisturbed run, bit for bit.

#![allow(clippy::disallowed_methods, reason = "other processes are waited for")]

use crate::common::test_file::TestFile;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, SystemTime};

use serde_json::Value;

use super::campaign::{campaign, complete, parts, plan, planned, undisturbed};
use crate::common::{FRAME, Said, gusset, say};

/// 10 000 short tests: 100 values of one key times 100 of another.
fn ten_thousand(folder: &Path) -> PathBuf {
    let path = folder.join("many.toml");
    let more = r#"
[[vary]]
key = "structure.damping.rayleigh_ratio.ratio"
linear = { from = 0.01, to = 0.08, count = 100 }
[[vary]]
key = "specimen.0.law.bouc_wen.yield_force_n"
log = { from = 500, to = 5000, count = 100 }
[measure]
residual = true
"#;
    let frame = FRAME.with("time.duration_s = 0.02");
    fs::write(&path, frame + more).unwrap();
    path
}

fn worker(out: &Path, chunk: u64) -> Child {
    let mut work = gusset();
    work.args(["campaign", "work", out.to_str().unwrap(), "--chunk"]);
    work.arg(chunk.to_string())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    work.spawn().unwrap()
}

/// Numbers for the choice of chunks and times; a function of the number before.
fn next(state: &mut u64) -> u64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    *state >> 33
}

/// Two workers at a time, on random chunks, also on the same one. Each is killed after a random time, or finishes before.
#[test]
fn killed_workers_lose_no_task() {
    let folder = tempfile::tempdir().unwrap();
    let study = ten_thousand(folder.path());
    let (out, calm) = (folder.path().join("killed"), folder.path().join("calm"));
    plan(&study, &out, "1000");
    let mut state = 1;
    let mut killed = 0;
    for _ in 0..25 {
        let mut both = [0; 2].map(|_| worker(&out, 1 + next(&mut state) % 10));
        std::thread::sleep(Duration::from_millis(20 + next(&mut state) % 700));
        for one in &mut both {
            killed += u32::from(one.try_wait().unwrap().is_none());
            // SIGKILL: the worker cannot clean up.
            one.kill().unwrap();
            one.wait().unwrap();
        }
    }
    // A slow start is killed as well as work: at least the first rounds are.
    assert!(killed > 0);
    let after = campaign("run", &out, &[]);
    let table = complete(&after, &out);
    assert_eq!(table.iter().filter(|byte| **byte == b'\n').count(), 10_001);
    plan(&study, &calm, "10000");
    assert!(table == complete(&campaign("run", &calm, &[]), &calm));
}

/// The program with no file longer than 1 kB: less than a part or a table needs.
fn on_a_full_disk(arguments: &[&str]) -> Said {
    let mut command = Command::new("bash");
    command.args(["-c", "ulimit -f 1; exec \"$0\" \"$@\""]);
    command
        .arg(assert_cmd::cargo::cargo_bin!("gusset"))
        .args(arguments);
    command.output().unwrap().into()
}

#[test]
fn full_disk_stops_a_worker_cleanly() {
    let (_folder, out) = planned();
    let there = out.to_str().unwrap();
    for arguments in [
        &["campaign", "work", there, "--chunk", "1"][..],
        &["campaign", "run", there],
    ] {
        let said = on_a_full_disk(arguments);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        assert!(said.stderr.contains("chunk-000001"), "{}", said.stderr);
        let parts = fs::read_dir(out.join("parts")).unwrap();
        assert_eq!(parts.count(), 0);
    }
    let table = complete(&campaign("run", &out, &[]), &out);
    assert!(table == undisturbed());
    // The old table stays until a new one is whole.
    let said = on_a_full_disk(&["campaign", "collect", there]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(fs::read(out.join("table.csv")).unwrap() == table);
}

/// Hosts with wrong clocks leave files from the past and from the future: no time of a file counts.
#[test]
fn wrong_clocks_of_hosts_do_not_matter() {
    let (_folder, out) = planned();
    let set = |path: &Path, seconds: u64| {
        let file = fs::File::options().write(true).open(path).unwrap();
        let time = SystemTime::UNIX_EPOCH + Duration::from_secs(seconds);
        file.set_modified(time).unwrap();
    };
    set(&out.join("plan.json"), 4_000_000_000);
    for (chunk, seconds) in [(1, 0), (2, 4_000_000_000)] {
        assert!(worker(&out, chunk).wait().unwrap().success());
        let part = parts(&out).pop().unwrap();
        set(&part, seconds);
    }
    let said = campaign("run", &out, &[]);
    assert!(
        said.stderr.contains("14 tests computed, 10"),
        "{}",
        said.stderr
    );
    assert!(complete(&said, &out) == undisturbed());
}

/// A copy of the program that has other sources, as far as it knows.
fn other_program(folder: &Path, plan: &Path) -> PathBuf {
    let plan: Value = serde_json::from_str(&fs::read_to_string(plan).unwrap()).unwrap();
    let sources = plan["program"]["sources"].as_str().unwrap().as_bytes();
    let path = folder.join("other-gusset");
    let mut bytes = fs::read(assert_cmd::cargo::cargo_bin!("gusset")).unwrap();
    let places: Vec<usize> = (0..=bytes.len() - sources.len())
        .filter(|place| bytes[*place..].starts_with(sources))
        .collect();
    assert!(!places.is_empty());
    for place in places {
        bytes[place..place + sources.len()].reverse();
    }
    fs::write(&path, bytes).unwrap();
    let mut rights = fs::metadata(&path).unwrap().permissions();
    std::os::unix::fs::PermissionsExt::set_mode(&mut rights, 0o755);
    fs::set_permissions(&path, rights).unwrap();
    path
}

#[test]
fn different_programs_do_not_mix_results() {
    let (folder, out) = planned();
    let other = other_program(folder.path(), &out.join("plan.json"));
    let with_other = |arguments: &[&str]| -> Said {
        let output = Command::new(&other).args(arguments).output();
        output.unwrap().into()
    };
    let there = out.to_str().unwrap();
    let said = with_other(&["campaign", "work", there, "--chunk", "1"]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("the sources: "), "{}", said.stderr);
    assert!(!said.stderr.contains("the compiler"), "{}", said.stderr);
    assert!(parts(&out).is_empty());
    // A part of the other program that gets into the folder all the same.
    let elsewhere = folder.path().join("elsewhere");
    let study = folder.path().join("study.toml");
    let run = [
        "campaign",
        "run",
        study.to_str().unwrap(),
        "--out",
        elsewhere.to_str().unwrap(),
    ];
    assert_eq!(with_other(&run).code, Some(0));
    complete(&campaign("run", &out, &[]), &out);
    let foreign = &parts(&elsewhere)[0];
    let planted = out.join("parts/chunk-000001-0000000000000000.part");
    fs::copy(foreign, &planted).unwrap();
    let said = campaign("collect", &out, &[]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(
        said.stderr.contains(planted.to_str().unwrap()),
        "{}",
        said.stderr
    );
    fs::remove_file(&planted).unwrap();
    assert!(complete(&campaign("collect", &out, &[]), &out) == undisturbed());
}

/// Ctrl-C ends a campaign after the current tests, with its results written.
#[test]
fn interrupted_run_says_how_to_continue() {
    let folder = tempfile::tempdir().unwrap();
    let study = ten_thousand(folder.path());
    let out = folder.path().join("out");
    plan(&study, &out, "10000");
    let mut run = gusset();
    run.args(["campaign", "run", out.to_str().unwrap(), "--jobs", "1"]);
    let run = run
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    let pid = rustix::process::Pid::from_child(&run);
    // A run that has ended already takes no signal.
    let _ = rustix::process::kill_process(pid, rustix::process::Signal::INT);
    let said: Said = run.wait_with_output().unwrap().into();
    if said.code == Some(130) {
        assert!(said.stderr.contains("campaign run"), "{}", said.stderr);
        let status = say(["campaign", "status", out.to_str().unwrap(), "--json"]);
        let status: Value = serde_json::from_str(&status.stdout).unwrap();
        let done = status["done"].as_u64().unwrap();
        assert!(
            said.stderr.contains(&format!("{done} tests computed")),
            "{}",
            said.stderr
        );
    } else {
        assert_eq!(said.code, Some(0), "{}", said.stderr);
    }
}

/// A record that changes or vanishes during the work: all tasks have the bytes of its beginning. Afterwards a worker refuses it.
#[test]
fn record_changed_midway_changes_no_result() {
    let folder = tempfile::tempdir().unwrap();
    let path = super::campaign::study(folder.path());
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.with("campaign.replicates = 150")).unwrap();
    let out = folder.path().join("out");
    plan(&path, &out, "10000");
    let record = folder.path().join("records/b.csv");
    let bytes = fs::read(&record).unwrap();
    let mut run = gusset();
    run.args(["campaign", "run", out.to_str().unwrap(), "--prove", "0"]);
    let mut run = run
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // After the start of the program the file comes and goes, with other numbers.
    std::thread::sleep(Duration::from_millis(700));
    for _ in 0..20 {
        fs::write(&record, "time,accel\n0,0\n0.1,9\n0.4,0\n").unwrap();
        std::thread::sleep(Duration::from_millis(5));
        fs::remove_file(&record).unwrap();
        std::thread::sleep(Duration::from_millis(5));
        fs::write(&record, &bytes).unwrap();
        if run.try_wait().unwrap().is_some() {
            break;
        }
    }
    let status = run.wait().unwrap();
    // A start while the file was gone is refused; then nothing was computed.
    if status.code() == Some(2) {
        assert!(parts(&out).is_empty());
        return;
    }
    assert_eq!(status.code(), Some(0));
    let said = campaign("collect", &out, &["--prove", "100%"]);
    let table = String::from_utf8(complete(&said, &out)).unwrap();
    assert!(!table.contains("invalid"));
}

/// A file that a value of an axis names belongs to the identity of the tasks.
#[test]
fn a_changed_file_of_an_axis_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    super::campaign::study(folder.path());
    let path = folder.path().join("paths.toml");
    let test = FRAME.split("[excitation").next().unwrap();
    let specimen = FRAME.split("[[specimen]]").nth(1).unwrap();
    let text = format!(
        "{test}[excitation.ground_acceleration.signal.file]\npath = \"records/a.csv\"\nunit = \"m/s2\"\n[[specimen]]{specimen}\n\
         [[vary]]\nkey = \"excitation.ground_acceleration.signal.file.path\"\nvalues = [\"records/a.csv\", \"records/b.csv\"]\n"
    );
    fs::write(&path, text).unwrap();
    let out = folder.path().join("out");
    plan(&path, &out, "1");
    assert!(worker(&out, 1).wait().unwrap().success());
    let record = folder.path().join("records/b.csv");
    let changed = fs::read_to_string(&record).unwrap().replace("0.5", "0.9");
    fs::write(&record, changed).unwrap();
    let said = campaign("run", &out, &[]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("b.csv"), "{}", said.stderr);
}

/// A part of the same study under another size of chunks: it would give rows twice.
#[test]
fn a_part_of_other_chunks_is_refused() {
    let (folder, out) = planned();
    complete(&campaign("run", &out, &[]), &out);
    let other = folder.path().join("other");
    plan(&folder.path().join("study.toml"), &other, "3");
    let part = &parts(&out)[0];
    fs::create_dir_all(other.join("parts")).unwrap();
    fs::copy(part, other.join("parts").join(part.file_name().unwrap())).unwrap();
    let said = campaign("run", &other, &[]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("chunk-000001"), "{}", said.stderr);
}

/// The command of the first time continues a campaign, and a folder of another study is refused.
#[test]
fn the_same_command_continues_a_campaign() {
    let (folder, out) = planned();
    assert!(worker(&out, 1).wait().unwrap().success());
    let study = folder.path().join("study.toml");
    let there = ["--out", out.to_str().unwrap()];
    let said = campaign("run", &study, &there);
    assert!(
        said.stderr.contains("19 tests computed, 5"),
        "{}",
        said.stderr
    );
    assert!(complete(&said, &out) == undisturbed());
    let other = folder.path().join("other.toml");
    fs::copy(&study, &other).unwrap();
    let said = campaign("run", &other, &there);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("--out"), "{}", said.stderr);
}

/// The program, killed after a minute: one that hangs has no exit code 2.
fn soon(arguments: &[&str]) -> Said {
    let mut command = Command::new("timeout");
    command
        .args(["--signal=KILL", "60"])
        .arg(assert_cmd::cargo::cargo_bin!("gusset"))
        .args(arguments);
    command.output().unwrap().into()
}

/// Plan, parts, study, test and records are plain files: a pipe would block, and a device never ends.
#[test]
fn special_file_is_refused() {
    type Put = fn(&Path);
    let pipe: Put = |path| {
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, path, mode).unwrap();
    };
    let device: Put = |path| std::os::unix::fs::symlink("/dev/zero", path).unwrap();
    let (folder, out) = planned();
    complete(&campaign("run", &out, &[]), &out);
    let there = out.to_str().unwrap();
    let part = parts(&out)[0].clone();
    let of_study = |name: &str| folder.path().join(name);
    for (path, commands) in [
        (out.join("plan.json"), &["status", "collect"][..]),
        (part, &["status", "collect"]),
        (of_study("study.toml"), &["collect"]),
        (of_study("frame.toml"), &["collect"]),
        (of_study("records/a.csv"), &["collect"]),
    ] {
        let bytes = fs::read(&path).unwrap();
        for put in [pipe, device] {
            fs::remove_file(&path).unwrap();
            put(&path);
            for command in commands {
                let said = soon(&["campaign", command, there]);
                // A record that is no file is left out of its folder: the study has changed.
                assert_eq!(said.code, Some(2), "{}: {}", path.display(), said.stderr);
            }
        }
        fs::remove_file(&path).unwrap();
        fs::write(&path, bytes).unwrap();
    }
    assert!(complete(&campaign("collect", &out, &[]), &out) == undisturbed());
}

/// A status names a part of another campaign, and does not count its tasks.
#[test]
fn a_status_counts_only_its_own_parts() {
    let (folder, out) = planned();
    let study = folder.path().join("study.toml");
    let text = fs::read_to_string(&study).unwrap();
    let other = folder.path().join("other.toml");
    fs::write(&other, text.with("campaign.seed = 9")).unwrap();
    let elsewhere = folder.path().join("elsewhere");
    plan(&other, &elsewhere, "5");
    assert!(worker(&elsewhere, 1).wait().unwrap().success());
    assert!(worker(&out, 2).wait().unwrap().success());
    let foreign = &parts(&elsewhere)[0];
    let planted = out.join("parts").join(foreign.file_name().unwrap());
    fs::copy(foreign, &planted).unwrap();
    let said = campaign("status", &out, &["--json"]);
    let status: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!((said.code, &status["done"]), (Some(1), &5.into()));
    assert_eq!(status["foreign_parts"], serde_json::json!([planted]));
    assert!(
        campaign("status", &out, &[])
            .stderr
            .contains(planted.to_str().unwrap())
    );
}

/// A killed program leaves its temporary file. The next collection removes it, but not that of a program that still runs.
#[test]
fn leftovers_of_killed_collects_are_removed() {
    let (_folder, out) = planned();
    let table = complete(&campaign("run", &out, &[]), &out);
    let draft = |name: &str| out.join(format!("{name}.partial-0123456789abcdef"));
    let leftovers = [
        draft(".table.partial.csv"),
        draft(".table.partial.parquet"),
        draft(".summary.json"),
        draft(".report.html"),
        draft("parts/.chunk-000001-0123456789abcdef.part"),
    ];
    for path in &leftovers {
        fs::write(path, "half").unwrap();
    }
    let running = out.join(".table.partial.csv.partial-fedcba9876543210");
    let held = fs::File::create(&running).unwrap();
    held.lock().unwrap();
    let own = draft(".notes.txt");
    fs::write(&own, "of the user").unwrap();
    assert!(complete(&campaign("collect", &out, &[]), &out) == table);
    assert!(leftovers.iter().all(|path| !path.exists()));
    assert!(running.exists() && own.exists());
}
