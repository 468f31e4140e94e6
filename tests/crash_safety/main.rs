//! Whatever ends a test: nothing is lost but the last instant that is stated, the specimen is safe, the summary is honest.
//!
//! The real program, killed, stopped, deprived of its peer or of its disk.

#[path = "../common/mod.rs"]
mod common;
#[path = "../link_common/mod.rs"]
mod link_common;

mod endings;
mod folders;
mod full_disk;
mod kills;
mod panic_in_every_maneuver;
mod panicking_specimen;
mod soak;
mod two_processes;
mod ways_out;

use std::io::Write;
use std::path::Path;
use std::time::Duration;

use gusset_record::{End, Run};

/// Prints a line for readers of the test log.
fn note(text: &str) {
    let _nobody_reads = writeln!(std::io::stderr(), "{text}");
}

/// Pauses this thread.
fn rest(time: Duration) {
    gusset_session::pause(time);
}

/// Numbers that look random and are the same every time: splitmix64 (Steele, Lea, Flood 2014).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

/// The values of all whole rows by bits, those that depend on wall time left out; and how they end. No row is missing.
fn rows(run: &Run) -> (Vec<Vec<u64>>, End) {
    let kept: Vec<usize> = run
        .layout()
        .columns()
        .iter()
        .enumerate()
        .filter_map(|(index, column)| (!column.timing).then_some(index))
        .collect();
    let mut journal = run.journal().unwrap();
    let mut rows = Vec::new();
    while let Some(row) = journal.next_row().unwrap() {
        assert_eq!(row.sequence, rows.len() as u64, "a row is missing");
        rows.push(
            kept.iter()
                .map(|index| row.values[*index].to_bits())
                .collect(),
        );
    }
    (rows, journal.end().unwrap())
}

/// Every file of a finished test is there, its rows are whole, every command is replayed bit for bit, and it tripped or not.
fn is_whole(folder: &Path, name: &str, tripped: bool) {
    let out = folder.join(name);
    for file in [
        "summary.json",
        "timing.json",
        "report.html",
        "resolved.toml",
    ] {
        assert!(out.join(file).exists(), "{file}");
    }
    let run = Run::open(&out).unwrap();
    let (rows, end) = rows(&run);
    assert_eq!(end, End::Clean);
    assert!(!rows.is_empty());
    let states: Vec<String> = run
        .events()
        .unwrap()
        .to_json()
        .iter()
        .filter(|event| event["event"] == "phase")
        .map(|event| event["to"].as_str().unwrap().to_owned())
        .collect();
    let has = |state: &str| states.iter().any(|s| s == state);
    assert_eq!(has("tripped"), tripped, "{states:?}");
    assert_eq!(states.last().map(String::as_str), Some("safe"));
    let replayed = common::say(["replay".as_ref(), out.as_os_str()]);
    assert_eq!(
        replayed.code,
        Some(0),
        "{}{}",
        replayed.stdout,
        replayed.stderr
    );
}
