//! The sample specimens for programmers of the far end, in Python (TCP) and C (UDP), take part in a hybrid test with the real
//! program. The test takes the same course as with an in-process spring.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::link_common::relay::{Fates, Relay};
use crate::link_common::{ONE_AXIS, columns, linked, run, summary, test_file};

const STEPS: u32 = 300;
const SPRING: &str = "[specimen.law.linear]\nstiffness_n_per_m = 4e5\n";

struct Peer(Child, String);

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(command: &mut Command) -> Peer {
    let mut child = command
        .args(["0", "4e5"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    let address = line
        .trim()
        .strip_prefix("listening on ")
        .unwrap()
        .to_owned();
    Peer(child, address)
}

fn tool(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tools")
        .join(name)
}

/// Reports when the machine has no Python or C compiler; the pipeline has both.
fn is_there(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        let words = format!("SKIPPED: {program} is not installed\n");
        std::io::Write::write_all(&mut std::io::stderr(), words.as_bytes()).unwrap();
        assert!(std::env::var_os("CI").is_none(), "{words}");
    }
    found
}

fn same_course(folder: &Path, address: &str, transport: &str) {
    let local = test_file(STEPS, &format!("{ONE_AXIS}{SPRING}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    for name in ["first", "second"] {
        let keys = format!("transport = \"{transport}\"\nwatchdog_s = 20");
        let (code, said) = run(folder, name, &linked(STEPS, address, &keys));
        assert_eq!(code, 0, "{said}");
        assert_eq!(course(folder, "local", ""), course(folder, name, ""));
    }
}

/// Columns that depend on the startup ramp of a specimen that keeps the last test's end position: its messages were counted, and it
/// showed its stiffness.
const KNOWS_OF_IT: [&str; 3] = ["seq_1", "kt_1_1", "stability_used"];

/// The values of a run from its first step on, by bits.
fn course(folder: &Path, name: &str, without: &str) -> Vec<(String, Vec<u64>)> {
    let all = columns(folder, name, without);
    let state = all.iter().find(|(name, _)| name == "state").unwrap();
    let runs: Vec<bool> = state.1.iter().map(|bits| *bits == 3f64.to_bits()).collect();
    let kept = all
        .iter()
        .filter(|(name, _)| !KNOWS_OF_IT.contains(&name.as_str()));
    let kept = kept.map(|(name, values)| {
        let values = values.iter().zip(&runs).filter(|(_, runs)| **runs);
        (name.clone(), values.map(|(bits, _)| *bits).collect())
    });
    kept.collect()
}

#[test]
fn the_python_specimen_is_a_spring_over_tcp() {
    if !is_there("python3") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let peer = start(Command::new("python3").arg(tool("specimen.py")));
    same_course(folder.path(), &peer.1, "tcp");
}

#[test]
fn c_specimen_is_a_spring_over_bad_udp() {
    if !is_there("cc") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("specimen");
    let made = Command::new("cc")
        .args(["-O1", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&program)
        .arg(tool("specimen.c"))
        .arg("-lm")
        .output()
        .unwrap();
    assert!(made.status.success(), "{made:?}");
    let peer = start(&mut Command::new(&program));
    same_course(folder.path(), &peer.1, "udp");
    let fates = Fates {
        lost: 5,
        twice: 5,
        damaged: 3,
        overtaken: 3,
        ..Fates::default()
    };
    let relay = Relay::start(&peer.1, 3, fates);
    let keys = "transport = \"udp\"\nwatchdog_s = 0.02";
    let (code, said) = run(folder.path(), "bad", &linked(STEPS, &relay.address, keys));
    assert_eq!(code, 0, "{said}");
    assert_eq!(
        course(folder.path(), "local", "status"),
        course(folder.path(), "bad", "status")
    );
    let link = summary(folder.path(), "bad").link["column"];
    assert!(link.corrupt > 0, "{link:?}");
    let peer = start(&mut Command::new(&program));
    holds_beyond_the_force(folder.path(), &peer.1, "udp");
}

/// The controller announces 1 mN. The first measurement that is not zero is far beyond, so its status is an interlock.
fn holds_beyond_the_force(folder: &Path, address: &str, transport: &str) {
    let keys = format!("transport = \"{transport}\"\nwatchdog_s = 20");
    let limits = "[specimen.limits]\nmeasured_force_n = { trip = [-1e-3, 1e-3] }\n";
    let text = linked(STEPS, address, &keys)
        .replace("[specimen.link]", &format!("{limits}[specimen.link]"));
    let (code, said) = run(folder, "limited", &text);
    assert_eq!(code, 1, "{said}");
    let all = columns(folder, "limited", "");
    let status = all.iter().find(|(name, _)| name == "status_1").unwrap();
    let interlock = f64::from(gusset_quantity::substructure::Status::INTERLOCK.0);
    let last = f64::from_bits(*status.1.last().unwrap());
    assert_eq!(last % (2.0 * interlock), interlock, "{last}");
}

#[test]
fn python_specimen_holds_beyond_the_force() {
    if !is_there("python3") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let peer = start(Command::new("python3").arg(tool("specimen.py")));
    holds_beyond_the_force(folder.path(), &peer.1, "tcp");
}
