//! kill −9 at random instants of the whole life of a test, from the start of the program to its last file.
//!
//! After each kill no whole row is missing or damaged, and the rows equal those of a test without a kill, bit for bit. The folder
//! shows that it is unfinished. Report, export and replay use it as far as it goes.
//!
//! `GUSSET_KILLS=5000 cargo test --test crash_safety kills -- --nocapture` for more of them; `GUSSET_KILL_SEED` for others.

use crate::common::test_file::TestFile;
use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use gusset_record::rt::os::monotonic_ns;
use gusset_record::{End, Run};

use crate::common::{FRAME, PATIENT, completed, gusset, say, write};
use crate::{Dice, note, rest, rows};

fn number(name: &str, usual: u64) -> u64 {
    let given = std::env::var(name);
    given.map_or(usual, |text| text.parse().unwrap())
}

/// Reference: the test without a kill.
struct Whole {
    rows: Vec<Vec<u64>>,
    ns: u64,
}

/// State of the folder after a kill.
#[derive(Debug, PartialEq)]
enum FolderState {
    /// It was killed before it had anything to record.
    Nothing,
    /// Number of whole rows, and the wall time in s that the rows do not cover, if known.
    Unfinished(usize, Option<f64>),
    /// It was over already.
    Finished,
}

/// Kills a run after `delay`: from its start, or on the real clock from its first rows.
fn kill_after(test: &Path, out: &Path, clock: &str, delay: Duration) -> u64 {
    let mut child = gusset()
        .arg("run")
        .arg(test)
        .arg("--out")
        .arg(out)
        .args(["--clock", clock, "--quiet"])
        .args(PATIENT)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let samples = out.join("samples.bin");
    while clock == "real" && fs::metadata(&samples).map_or(0, |file| file.len()) == 0 {
        assert_eq!(child.try_wait().unwrap(), None, "it ends by itself");
        rest(Duration::from_millis(1));
    }
    rest(delay);
    let killed_ns = monotonic_ns();
    child.kill().unwrap();
    child.wait().unwrap();
    killed_ns
}

/// The wall time between the last whole row and the kill.
fn lost(run: &Run, killed_ns: u64) -> Option<f64> {
    let events = run.events().unwrap().to_json();
    let started = events.iter().find(|event| event["event"] == "started")?;
    let first_edge_ns = started["clock_ns"].as_u64()?;
    let release = run.columns(&["release_s"]).unwrap().remove(0);
    let covered = release.last()?;
    Some(killed_ns.saturating_sub(first_edge_ns) as f64 * 1e-9 - covered)
}

fn judge(folder: &Path, out: &Path, killed_ns: u64, whole: &Whole) -> FolderState {
    let command = |word: &str| say([word.as_ref(), out.as_os_str()]);
    let run = match Run::open(out) {
        Ok(run) => run,
        Err(error) => {
            // Nothing was recorded: the command reports this, and nothing breaks.
            assert!(!out.join("samples.json").exists(), "{error}");
            for word in ["report", "replay"] {
                let said = command(word);
                assert_eq!(said.code, Some(2), "{}", said.stderr);
                assert!(said.stderr.starts_with("error: "), "{}", said.stderr);
            }
            return FolderState::Nothing;
        }
    };
    if !out.join("samples.bin").exists() {
        return FolderState::Nothing;
    }
    let (found, end) = rows(&run);
    assert!(matches!(end, End::Clean | End::Torn { .. }), "{end}");
    assert!(found.len() <= whole.rows.len());
    let differs = found.iter().zip(&whole.rows).position(|(a, b)| a != b);
    assert_eq!(differs, None, "first row that is another");
    if let Some(summary) = run.summary() {
        // Whole or not at all: once it is there the test is over, and everything before it is there too.
        assert_eq!(found.len(), whole.rows.len());
        assert_eq!(summary.rows_lost, 0);
        assert!(out.join("timing.json").exists());
        return FolderState::Finished;
    }
    // At most the last line of the log is torn.
    let text = fs::read_to_string(out.join("events.jsonl")).unwrap();
    let unreadable = run.events().unwrap().unreadable;
    assert!(unreadable <= usize::from(!text.ends_with('\n')), "{text}");

    let said = command("report");
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stderr.contains("unfinished"), "{}", said.stderr);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("no summary.json"));
    let csv = folder.join("rows.csv");
    let said = say([
        "export".as_ref(),
        out.as_os_str(),
        "--rate".as_ref(),
        "tick".as_ref(),
        "--out".as_ref(),
        csv.as_os_str(),
    ]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let text = fs::read_to_string(&csv).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#')).count();
    assert_eq!(lines, found.len() + 1, "a header and every whole row");
    let said = command("replay");
    let code = i32::from(end != End::Clean || found.is_empty());
    assert_eq!(said.code, Some(code), "{}{}", said.stdout, said.stderr);
    assert!(
        said.stdout.contains(&format!("{} rows", found.len())),
        "{}",
        said.stdout
    );
    FolderState::Unfinished(found.len(), lost(&run, killed_ns))
}

#[test]
fn kill_costs_only_the_last_instant() {
    let home = tempfile::tempdir().unwrap();
    // Two minutes at 1 kHz: on the simulated clock as many rows as a disk takes in a moment.
    let text = FRAME.with(
        "time = { rate_hz = 1000, duration_s = 120 }\nsafety.zero_s = 0.02\ntiming.policy = 'ordinary'",
    );
    let test = write(home.path(), "test.toml", &text);
    let began = monotonic_ns();
    let out = home.path().join("whole");
    completed(&test, &out, &["--quiet"]);
    let whole = Whole {
        ns: monotonic_ns() - began,
        rows: rows(&Run::open(&out).unwrap()).0,
    };
    assert!(whole.rows.len() > 120_000);

    let (kills, seed) = (number("GUSSET_KILLS", 36), number("GUSSET_KILL_SEED", 1));
    let mut dice = Dice(seed);
    let mut losses = Vec::new();
    let (mut nothing, mut finished, mut unfinished) = (0, 0, 0);
    for kill in 0..kills {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("run");
        // In real time for two of three; on the simulated clock up to a little beyond its end.
        let real = kill % 3 != 0;
        let (clock, longest) = if real {
            ("real", 700_000_000)
        } else {
            ("simulated", whole.ns + whole.ns / 5)
        };
        let delay = Duration::from_nanos(dice.roll() % longest);
        let killed_ns = kill_after(&test, &out, clock, delay);
        let state = judge(folder.path(), &out, killed_ns, &whole);
        note(&format!(
            "kill {kill} of seed {seed}, {clock}, after {delay:?}: {state:?}"
        ));
        match state {
            FolderState::Nothing => nothing += 1,
            FolderState::Finished => finished += 1,
            FolderState::Unfinished(_, lost) => {
                unfinished += 1;
                losses.extend(lost.filter(|_| real));
            }
        }
    }
    losses.sort_by(f64::total_cmp);
    let at = |share: f64| losses[((losses.len() - 1) as f64 * share) as usize];
    note(&format!(
        "{kills} kills: {nothing} before the first file, {unfinished} in mid-test, {finished} after the end; wall time \
         without a row before {} of them: median {:.1} ms, p90 {:.1} ms, largest {:.1} ms",
        losses.len(),
        1e3 * at(0.5),
        1e3 * at(0.9),
        1e3 * at(1.0)
    ));
    assert!(
        unfinished * 2 > kills,
        "the kills came too early or too late"
    );
    // 25 ms are stated, where the writer's thread gets a processor. A busy machine may keep it waiting, but not half of the
    // time for four times as long.
    assert!(at(0.5) < 0.1, "{losses:?}");
}
