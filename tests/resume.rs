//! An interrupted test goes on where its record ends: the same bits as if nothing had happened, from its folder alone, into a
//! folder of its own. What was changed, damaged or moved meanwhile is refused, and nothing of the first run is touched.

mod common;
mod link_common;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use common::killed::{column, killed};
use common::{completed, copy, say, write};
use gusset::control::{Axis, Port};
use gusset::engine::{Operator, Phase};
use gusset::record::{Run, RunFolder};
use gusset::session::{self, Finish, ResumeError, Watches, replay, resume};
use gusset::substructure::{
    Command, Coupling, Freshness, Introduction, LinkFault, Measurement, Retirement, Status,
    Substructure, Unavailable,
};
use gusset::time::Nanos;

/// A frame whose bottom storey is a Bouc–Wen formula and whose upper storey has a yielding element: both remember.
fn frame(rate: u32, ticks: u32, seconds: f64, ease: f64) -> String {
    format!(
        "title = \"Interrupted\"\n[time]\nrate_hz = {rate}\nduration_s = {seconds}\nclock = \"simulated\"\nticks_per_step = \
         {ticks}\n[structure]\nstatic_load_n = [500.0, 200.0]\n[structure.shear_building]\nmass_kg = [1000.0, 900.0]\n\
         stiffness_n_per_m = [0, 2e5]\n[[structure.element]]\nfrom = 1\nto = 2\nlaw.bilinear = {{ stiffness_n_per_m = 2e5, \
         yield_force_n = 800.0, post_yield_ratio = 0.1 }}\n[excitation.ground_acceleration.signal.file]\npath = \
         \"motion.csv\"\nunit = \"m/s2\"\n[timing]\nwarmup_ticks = 4\n[safety]\nramp_s = 0.1\nease_s = {ease}\n[record]\n\
         checkpoint_s = 0.1\n[[specimen]]\nname = \"storey\"\nstorey = 1\n[specimen.law.bouc_wen]\nstiffness_n_per_m = 5e5\n\
         yield_force_n = 1.5e3\npost_yield_ratio = 0.1\nbeta = 0.5\ngamma = 0.5\nexponent = 1.5\n"
    )
}

fn test_in(home: &Path, text: &str) -> PathBuf {
    let line = |k: i32| {
        let t = f64::from(k) * 0.005;
        format!(
            "{t:.3},{:.6}\n",
            4.0 * (9.0 * t).sin() + 2.0 * (23.0 * t).cos()
        )
    };
    write(
        home,
        "motion.csv",
        &format!("t,a\n{}", (0..1200).map(line).collect::<String>()),
    );
    write(home, "test.toml", text)
}

/// Rows that never reached the file of a run.
fn without_rows(run: &Path, rows: std::ops::Range<usize>) {
    let stride = Run::open(run).unwrap().layout().stride();
    let path = run.join("samples.bin");
    let mut bytes = std::fs::read(&path).unwrap();
    let end = (rows.end * stride).min(bytes.len());
    bytes.drain(rows.start * stride..end);
    std::fs::write(path, bytes).unwrap();
}

/// Step → the bits of its row, over runs that follow each other; a step that is there twice is the later one's.
fn steps(runs: &[&Path]) -> BTreeMap<u64, Vec<u64>> {
    let names = [
        "x1",
        "x2",
        "v1",
        "v2",
        "a1",
        "a2",
        "force_1_1",
        "target_1_1",
        "cmd_1_1",
        "ground",
        "time",
    ];
    let mut all = BTreeMap::new();
    for run in runs {
        let run = Run::open(run).unwrap();
        let head = run.columns(&["step", "state"]).unwrap();
        let columns = run.columns(&names).unwrap();
        for row in 0..head[0].len() {
            if head[1][row] == 3.0 {
                let bits = columns.iter().map(|column| column[row].to_bits()).collect();
                all.insert(head[0][row] as u64, bits);
            }
        }
    }
    all
}

fn go_on(from: &Path, out: &Path) -> common::Said {
    say([
        "run",
        "--resume",
        from.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ])
}

fn bytes(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let files = common::names(folder)
        .into_iter()
        .filter(|name| folder.join(name).is_file());
    files
        .map(|name| (name.clone(), std::fs::read(folder.join(name)).unwrap()))
        .collect()
}

#[test]
fn an_interrupted_test_goes_on_with_the_same_bits_again_and_again() {
    // With one tick a step, and with ticks in between: also in the middle of the way from one target to the next.
    for (rate, ticks, ease) in [(200, 1, 0.0), (100, 5, 0.0)] {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        let test = test_in(home.path(), &frame(rate, ticks, 3.0, ease));
        completed(&test, &at("whole"), &[]);
        let rows = Run::open(&at("whole"))
            .unwrap()
            .columns(&["state"])
            .unwrap()[0]
            .len();
        killed(&at("whole"), &at("first"), rows / 2 + 3);
        let before = bytes(&at("first"));
        let said = go_on(&at("first"), &at("second"));
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        assert!(said.stderr.contains("resumed from"), "{}", said.stderr);
        assert_eq!(bytes(&at("first")), before, "nothing is written over");
        assert_eq!(
            steps(&[&at("first"), &at("second")]),
            steps(&[&at("whole")])
        );
        let second = steps(&[&at("second")]);
        let first = steps(&[&at("first")]);
        assert_eq!(
            second.keys().next().unwrap(),
            &(first.keys().last().unwrap() + 1)
        );

        // Its own interruption, and the proof of all three.
        let rows = Run::open(&at("second"))
            .unwrap()
            .columns(&["state"])
            .unwrap()[0]
            .len();
        killed(&at("second"), &at("third"), rows / 2);
        let said = go_on(&at("third"), &at("fourth"));
        assert!(!said.stderr.contains("checkpoint"), "{}", said.stderr);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        assert_eq!(
            steps(&[&at("first"), &at("third"), &at("fourth")]),
            steps(&[&at("whole")])
        );
        for (before, after) in [("first", "second"), ("third", "fourth")] {
            let command = |name: &str| Run::open(&at(name)).unwrap().columns(&["cmd_1_1"]).unwrap();
            let (before, after) = (command(before), command(after));
            assert_eq!(
                before[0].last(),
                after[0].first(),
                "it begins where it was left"
            );
        }
        let (third, fourth) = (steps(&[&at("third")]), steps(&[&at("fourth")]));
        assert_eq!(
            fourth.keys().next().unwrap(),
            &(third.keys().last().unwrap() + 1)
        );
        for name in ["first", "second", "fourth"] {
            let found = replay(&at(name)).unwrap();
            assert!(found.difference.is_none(), "{name}: {found:?}");
            assert_eq!(found.is_exact(), name != "first", "{name}: {found:?}");
        }
        assert!(at("second/report.html").exists());
        let csv = at("second.csv");
        let said = say([
            "export",
            at("second").to_str().unwrap(),
            "--out",
            csv.to_str().unwrap(),
        ]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        assert!(std::fs::read_to_string(csv).unwrap().lines().count() > second.len());
        let origin = common::json(&at("second"), "resumed.json");
        assert_eq!(origin["step"], *first.keys().last().unwrap());
        let warned = common::json(&at("second"), "summary.json")["warnings"].to_string();
        assert!(warned.contains("resumed from"), "{warned}");
    }
}

/// The list of measures under a heading of a page.
fn measures(page: &str, heading: &str) -> String {
    let (_, section) = page.split_once(heading).unwrap();
    let (_, list) = section.split_once("<dl>").unwrap();
    list.split_once("</dl>").unwrap().0.to_owned()
}

#[test]
fn the_page_of_a_test_that_went_on_says_which_steps_it_is_of_and_what_it_tells_of_the_whole() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    // The record is strongest at its beginning.
    let text = frame(200, 1, 3.0, 0.0);
    let test = test_in(home.path(), &text);
    let faded: String = (0..1200)
        .map(|k| f64::from(k) * 0.005)
        .map(|t| format!("{t:.3},{:.6}\n", 4.0 * (9.0 * t).sin() * (-t).exp()))
        .collect();
    write(home.path(), "motion.csv", &format!("t,a\n{faded}"));
    completed(&test, &at("whole"), &[]);
    killed(&at("whole"), &at("first"), 420);
    let said = go_on(&at("first"), &at("second"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let page = |name: &str| std::fs::read_to_string(at(name).join("report.html")).unwrap();
    let (whole, second) = (page("whole"), page("second"));
    let ground = "<h2>Ground motion</h2>";
    assert_eq!(measures(&second, ground), measures(&whole, ground));
    assert!(measures(&whole, ground).contains("Arias intensity"));
    let steps = steps(&[&at("second")]);
    let (from, to) = (steps.keys().next().unwrap(), steps.keys().last().unwrap());
    let part = format!("of steps {from} to {to} only; the steps before are in ../first.");
    assert!(
        second.contains(&format!("<p>This page is {part}")),
        "{part}"
    );
    for heading in ["Response of the structure", "Specimens", "Energy"] {
        let told = format!("<h2>{heading}</h2>\n<p class=\"note\">O{}", &part[1..]);
        assert!(second.contains(&told), "{told}");
    }
    assert!(
        second.contains("what its nonlinear elements went through before is in another folder")
    );
    assert!(!whole.contains("This page is of"));

    // Both tiles tell of the whole test, and so does the summary.
    let peak = |name: &str| common::json(&at(name), "summary.json")["peak"].clone();
    assert_eq!(peak("second"), peak("whole"));
    let tile = |page: &str, words: &str| {
        let (before, _) = page.split_once(words).unwrap();
        let (_, value) = before.rsplit_once("<b>").unwrap();
        value
            .split_once("</b>")
            .unwrap()
            .0
            .trim_start_matches('\u{2212}')
            .to_owned()
    };
    for words in ["largest displacement, DOF 2", "largest force, storey"] {
        assert_eq!(tile(&second, words), tile(&whole, words));
        assert!(second.contains(&format!("{words}, of the whole test<")));
        assert!(whole.contains(&format!("{words}<")));
    }
    assert!(
        second.contains(&format!(", of steps {from} to {to}<")),
        "the lag"
    );
}

/// Killed before a partner that is commanded once a step was told the target that was known already, or before it answered: it
/// is told that one, and not the last that it had been told. It is judged by the targets before, not by where it was held meanwhile:
/// its speed does not trip as an acceleration from rest, at neither end.
#[test]
fn a_partner_commanded_once_a_step_is_told_its_next_target_after_an_interruption() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let seen = link_common::ONE_AXIS;
    let text = |ticks: u32, specimen: &str| {
        link_common::test_file(600, specimen)
            .replace(
                "rate_hz = 1000",
                &format!("rate_hz = 100\nticks_per_step = {ticks}"),
            )
            .replace(
                "zero_s = 0\n",
                "zero_s = 0\nease_s = 0\nresume_within_m = 1\n",
            )
    };
    let law = "law.linear = { stiffness_n_per_m = 4e5 }\n";
    // Targets are the same whatever the ticks.
    let formula = write(
        home.path(),
        "formula.toml",
        &text(1, &format!("{seen}{law}")),
    );
    completed(&formula, &at("formula"), &[]);
    let targets = column(&at("formula"), "target_1_1");
    let bends = targets.windows(3).map(|d| (d[2] - 2.0 * d[1] + d[0]).abs());
    let accel = 1.2 * bends.fold(0.0, f64::max) / (0.01 * 0.01);
    let limits = format!("[specimen.limits]\ncommand_accel_m_per_s2 = {{ trip = {accel} }}\n");
    let served = text(1, &format!("{seen}{law}{limits}"));
    let served = link_common::Served::start(home.path(), &served, &[]);
    for ticks in [2, 5] {
        let link = format!(
            "{seen}[specimen.link]\naddress = \"{}\"\ncoupling = \"lockstep\"\ncommands = \"every_step\"\nwatchdog_s = 20\n\
             {limits}",
            served.address
        );
        let test = write(home.path(), "paced.toml", &text(ticks, &link));
        let whole = at(&format!("whole-{ticks}"));
        completed(&test, &whole, &[]);
        let rows = Run::open(&whole).unwrap().columns(&["state"]).unwrap()[0].len();
        for row in rows / 2..=rows / 2 + ticks as usize {
            let (first, second) = (
                at(&format!("first-{ticks}-{row}")),
                at(&format!("second-{ticks}-{row}")),
            );
            killed(&whole, &first, row);
            let said = go_on(&first, &second);
            assert_eq!(said.code, Some(0), "{}", said.stderr);
            assert_eq!(steps(&[&first, &second]), steps(&[&whole]), "{ticks} {row}");
            refused(&first, "it went on after step", &[]);
        }
    }
}

/// With easing the first steps are made in several ticks: a formula that remembers goes there in smaller parts. This one is
/// exact whatever the parts, so that only roundoff is different; others differ by their own error of integration.
#[test]
fn an_eased_beginning_changes_the_way_and_not_the_response() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.1));
    completed(&test, &at("whole"), &[]);
    killed(&at("whole"), &at("first"), 300);
    assert_eq!(go_on(&at("first"), &at("second")).code, Some(0));
    let (one, other) = (
        steps(&[&at("first"), &at("second")]),
        steps(&[&at("whole")]),
    );
    let x = |bits: &Vec<u64>| f64::from_bits(bits[0]);
    let size = other.values().map(|b| x(b).abs()).fold(0.0, f64::max);
    let off = one
        .values()
        .zip(other.values())
        .map(|(a, b)| (x(a) - x(b)).abs())
        .fold(0.0, f64::max);
    assert_eq!(one.len(), other.len());
    assert!(off < 1e-9 * size, "{off} of {size}");
    let found = replay(&at("second")).unwrap();
    assert!(found.is_exact(), "{found:?}");
}

/// A test with a compensator that was killed at full pace, in the ease of a hold, in the hold and behind it: it goes on without a
/// kick, and what it then is comes out again to the last bit.
#[test]
fn a_compensated_test_that_was_killed_in_a_hold_goes_on_without_a_kick() {
    for (ticks, made) in [
        (1, "model_inverse = { coefficients = [1.0, 0.02, 1e-4] }"),
        (4, "ats = { delay_s = 0.02 }"),
    ] {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        let text = format!(
            "{}[specimen.compensation]\n{made}\n",
            frame(400, ticks, 2.0, 0.2)
        );
        let test = test_in(home.path(), &text);
        let loaded = gusset::config::load(&test, &[]).unwrap_or_else(|e| panic!("{e}"));
        let test = gusset::config::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
        let folder = RunFolder::create(&at("whole")).unwrap();
        let mut words = vec![Operator::Continue; 500 * ticks as usize];
        words.extend(vec![Operator::Hold; 150 * ticks as usize]);
        words.push(Operator::Continue);
        let (says, requests) = crossbeam_channel::bounded(words.len());
        for word in words {
            says.send(word).unwrap();
        }
        session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap();
        assert!(replay(&at("whole")).unwrap().is_exact());
        let columns =
            |name: &str, names: &[&str]| Run::open(&at(name)).unwrap().columns(names).unwrap();
        let jump = |commands: &[f64]| {
            let steps = commands.windows(2).map(|w| (w[1] - w[0]).abs());
            steps.fold(0.0, f64::max)
        };
        let whole = columns("whole", &["state", "cmd_1_1", "target_1_1"]);
        let lead = whole[1].iter().zip(&whole[2]).map(|(c, d)| (c - d).abs());
        let lead = lead.fold(0.0, f64::max);
        let usual = jump(&whole[1]);
        // Easing takes 80 steps.
        let bound = 1.02 * usual + lead / (80.0 * f64::from(ticks));
        assert!(lead > 5.0 * bound, "{lead} {bound}");
        let holds = |row: &usize| whole[0][*row] == Phase::Holding.code();
        let begins = (0..whole[0].len()).find(holds).unwrap();
        for (count, row) in [
            begins / 2,
            begins - 20 * ticks as usize,
            begins + 9,
            begins + 200 * ticks as usize,
        ]
        .into_iter()
        .enumerate()
        {
            let (first, second) = (format!("first-{count}"), format!("second-{count}"));
            killed(&at("whole"), &at(&first), row);
            let said = go_on(&at(&first), &at(&second));
            assert_eq!(said.code, Some(0), "{}", said.stderr);
            let (before, after) = (
                columns(&first, &["cmd_1_1"]),
                columns(&second, &["cmd_1_1"]),
            );
            assert_eq!(
                before[0].last(),
                after[0].first(),
                "it begins where it was left"
            );
            let found = jump(&after[0]);
            assert!(found <= bound, "{made} {ticks} {count}: {found} {bound}");
            let found = replay(&at(&second)).unwrap();
            assert!(found.is_exact(), "{made} {count}: {found:?}");
        }
    }
}

#[test]
#[expect(clippy::disallowed_methods, reason = "another process is waited for")]
fn a_killed_test_goes_on() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 3.0, 0.0));
    completed(&test, &at("whole"), &[]);
    let mut running = common::gusset()
        .args([
            "run",
            test.to_str().unwrap(),
            "--out",
            at("first").to_str().unwrap(),
            "--clock",
            "real",
        ])
        .args(["--quiet", "--set", "timing.policy=\"ordinary\""])
        .args(common::PATIENT)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let began = Instant::now();
    let enough =
        |rows: u64| std::fs::metadata(at("first/samples.bin")).is_ok_and(|m| m.len() > rows * 300);
    while !enough(200) {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "nothing is recorded"
        );
        std::thread::yield_now();
    }
    let said = go_on(&at("first"), &at("too-early"));
    assert_eq!(said.code, Some(2), "it still runs: {}", said.stderr);
    assert!(
        said.stderr.contains("this test is running"),
        "{}",
        said.stderr
    );
    // It runs, whatever became of its socket.
    std::fs::remove_file(at("first/control.sock")).unwrap();
    let said = go_on(&at("first"), &at("too-early"));
    assert_eq!(said.code, Some(2), "it still runs: {}", said.stderr);
    let silent = "the test does not answer (there is no control.sock)";
    assert!(said.stderr.contains(silent), "{}", said.stderr);
    running.kill().unwrap();
    running.wait().unwrap();
    assert!(!at("first/summary.json").exists());
    let said = go_on(&at("first"), &at("second"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert_eq!(
        steps(&[&at("first"), &at("second")]),
        steps(&[&at("whole")])
    );
}

fn refused(from: &Path, word: &str, more: &[&str]) {
    let out = from.with_extension("out");
    let mut args = vec![
        "run",
        "--resume",
        from.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    args.extend(more);
    let said = say(args);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains(word), "{word}: {}", said.stderr);
    assert!(!out.exists(), "nothing began");
}

#[test]
fn what_was_changed_or_is_complete_is_refused_and_damage_goes_back_to_a_checkpoint() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.0));
    completed(&test, &at("whole"), &[]);
    refused(&at("whole"), "this test is complete", &[]);
    let fresh = |name: &str| {
        killed(&at("whole"), &at(name), 300);
        at(name)
    };
    for file in ["test.toml", "resolved.toml", "inputs/motion.csv"] {
        let run = fresh(&format!("changed-{}", file.len()));
        let text = std::fs::read_to_string(run.join(file)).unwrap();
        std::fs::write(run.join(file), format!("{text} ")).unwrap();
        refused(&run, "was changed", &[]);
    }
    let run = fresh("another");
    let other = write(home.path(), "other.toml", &frame(200, 1, 2.5, 0.0));
    refused(
        &run,
        "is not the test that was interrupted",
        &[other.to_str().unwrap()],
    );
    let run = fresh("nameless");
    std::fs::write(run.join("events.jsonl"), "").unwrap();
    refused(&run, "do not say which files", &[]);
    let run = at("early");
    killed(&at("whole"), &run, 1);
    refused(&run, "before its first step", &[]);

    // One bit of row 250 is wrong: everything before it stands, and the last checkpoint before it is where it goes on.
    let run = fresh("damaged");
    let stride = Run::open(&run).unwrap().layout().stride();
    let mut rows = std::fs::read(run.join("samples.bin")).unwrap();
    rows[250 * stride + 20] ^= 1;
    std::fs::write(run.join("samples.bin"), &rows).unwrap();
    let said = go_on(&run, &at("after"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stderr.contains("the last checkpoint before that"),
        "{}",
        said.stderr
    );
    let mut parts = steps(&[&run]);
    let after = steps(&[&at("after")]);
    let begins = *after.keys().next().unwrap();
    assert!((140..=170).contains(&begins), "{begins}");
    parts.retain(|step, _| *step < begins);
    parts.extend(after);
    assert_eq!(parts, steps(&[&at("whole")]));

    let run = fresh("worse");
    let mut rows = std::fs::read(run.join("samples.bin")).unwrap();
    let states = Run::open(&run).unwrap().columns(&["state"]).unwrap();
    let first = states[0].iter().position(|s| *s == 3.0).unwrap();
    rows[(first + 3) * stride + 20] ^= 1;
    std::fs::write(run.join("samples.bin"), &rows).unwrap();
    refused(&run, "no checkpoint before it", &[]);
}

/// Without a summary the events prove that the test went further, as after a disk that filled up: what it did to its specimens
/// then is not done to them a second time, and whoever reads the record is told.
#[test]
fn a_record_without_a_summary_that_ends_before_its_events_is_refused_and_told_of() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.0));
    completed(&test, &at("whole"), &[]);
    let rows = column(&at("whole"), "time").len();
    let ended = |name: &str, lost: usize| {
        copy(&at("whole"), &at(name));
        std::fs::remove_file(at(name).join("summary.json")).unwrap();
        without_rows(&at(name), rows - lost..rows);
        at(name)
    };
    let short = ended("short", 100);
    let missing = "there are events up to 2 s, but the rows end at 1.5 s";
    refused(&short, missing, &[]);
    refused(&short, missing, &["--back-to-step", "300"]);
    let csv = at("short.csv");
    for (command, code, more) in [
        ("report", 0, None),
        ("replay", 1, None),
        ("export", 0, Some(["--out", csv.to_str().unwrap()])),
    ] {
        let mut args = vec![command, short.to_str().unwrap()];
        args.extend(more.into_iter().flatten());
        let said = say(args);
        assert_eq!(said.code, Some(code), "{command}: {}", said.stderr);
        let told = format!("{}{}", said.stdout, said.stderr);
        assert!(told.contains(missing), "{command}: {told}");
    }
    let page = std::fs::read_to_string(short.join("report.html")).unwrap();
    assert!(page.contains("re are events up to 2 s"), "it says so, too");
    // All of it is there: only its summary was not written any more.
    refused(&ended("closing", 0), "this test is complete", &[]);
}

/// Where rows are missing between others, a formula is made anew from the checkpoint before them. A rig remembers.
#[test]
fn a_gap_in_the_record_is_gone_back_over_with_a_rig_only_for_who_names_the_step() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = two_rigs(home.path(), "[record]\ncheckpoint_s = 0.1");
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let rigs = || places.each_ref().map(|place| Rig::boxed(place, None));
    let whole = run_rigs(built(&test), rigs(), &at("whole"), None);
    assert_eq!(whole.finish, Finish::Completed);
    killed(&at("whole"), &at("first"), 380);
    killed(&at("whole"), &at("gap"), 380);
    without_rows(&at("gap"), 200..260);
    let again = |from: &str, back_to| resume(&at(from), None, &[], back_to);
    let refusal = again("gap", None).err().unwrap();
    let ResumeError::Back { step, again_s, .. } = &refusal else {
        panic!("{refusal}");
    };
    let text = refusal.to_string();
    let named = format!("`--back-to-step {step}`");
    assert!(text.contains("row 200 was lost"), "{text}");
    assert!(
        text.contains(&named) && text.contains("one, other"),
        "{text}"
    );
    assert!((0.9..1.1).contains(again_s), "{text}");
    for (from, named) in [("gap", step + 1), ("first", *step)] {
        let other = again(from, Some(named)).err().unwrap();
        assert!(matches!(other, ResumeError::AnotherStep { .. }), "{other}");
    }
    let next = again("gap", Some(*step)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(next.experiment.resume.map(|from| from.step()), Some(*step));
    assert!(again("first", None).is_ok(), "nothing is missing there");
    let said = say([
        "run",
        "--resume",
        at("gap").to_str().unwrap(),
        "--out",
        at("out").to_str().unwrap(),
    ]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains(&named), "{}", said.stderr);

    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.0));
    completed(&test, &at("formula"), &[]);
    killed(&at("formula"), &at("anew"), 380);
    without_rows(&at("anew"), 200..260);
    let said = go_on(&at("anew"), &at("after"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let note = "the last checkpoint before that";
    assert!(said.stderr.contains(note), "{}", said.stderr);
}

/// A test and those that it goes on with are moved together, or one by one to another place; without them it says what is missing.
#[test]
fn a_test_that_went_on_is_replayed_and_goes_on_wherever_it_was_moved_with_those_before_it() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.0));
    completed(&test, &at("whole"), &[]);
    killed(&at("whole"), &at("here/first"), 200);
    assert_eq!(go_on(&at("here/first"), &at("here/second")).code, Some(0));
    killed(&at("here/second"), &at("here/third"), 120);
    let said = go_on(&at("here/third"), &at("here/deep/fourth"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let origin = common::json(&at("here/deep/fourth"), "resumed.json");
    assert_eq!(origin["parent"], "../../third");

    std::fs::rename(at("here"), at("there")).unwrap();
    let said = go_on(&at("there/third"), &at("there/fifth"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    for name in ["there/second", "there/deep/fourth", "there/fifth"] {
        let found = replay(&at(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(found.is_exact(), "{name}: {found:?}");
    }
    // Side by side is enough, and another test of that name is not the one.
    std::fs::rename(at("there/deep/fourth"), at("there/fourth")).unwrap();
    copy(&at("whole"), &at("third"));
    assert!(replay(&at("there/fourth")).unwrap().is_exact());
    copy(&at("there/second"), &at("alone/second"));
    let lost = replay(&at("alone/second")).unwrap_err().to_string();
    for word in [
        "alone/second/resumed.json",
        "here/first",
        "neither there nor beside",
    ] {
        assert!(lost.contains(word), "{lost}");
    }
    copy(&at("there/third"), &at("alone/first"));
    let other = replay(&at("alone/second")).unwrap_err().to_string();
    assert!(other.contains("was changed"), "{other}");
}

/// A spring behind a link of the test's own, whose sensor reads `off` more than where it was told to go.
struct Far {
    off: f64,
    damping: f64,
    disp: f64,
    vel: f64,
    sequence: u64,
}

impl Substructure for Far {
    fn axes(&self) -> usize {
        1
    }
    fn coupling(&self) -> Coupling {
        Coupling::Lockstep
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.disp, self.sequence) = (command.disp[0], command.sequence);
        self.vel = command.vel[0];
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.sequence = self.sequence;
        (into.disp[0], into.force[0]) = (
            self.disp + self.off,
            3e5 * self.disp + self.damping * self.vel,
        );
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

#[test]
fn a_specimen_that_does_not_stand_where_it_was_left_is_refused_and_nothing_moves() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let law = frame(200, 1, 2.0, 0.0);
    let linked = law
        .split("[specimen.law")
        .next()
        .unwrap()
        .replace(
            "[safety]\n",
            "[safety]\nunlimited = \"a spring\"\non_trip = \"zero_displacement\"\nexit_speed_m_per_s = 0.01\n",
        )
        + "stiffness_n_per_m = 5e5\nlink = { address = \"127.0.0.1:9\", coupling = \"lockstep\" }\n";
    let test = test_in(home.path(), &linked);
    let far = |off: f64| -> Port {
        let far = Far {
            off,
            damping: 0.0,
            disp: 0.0,
            vel: 0.0,
            sequence: 0,
        };
        Port::new(
            "far",
            vec![Axis::plain(vec![(0, 1.0)])],
            Box::new(far),
            2,
            vec![5e5],
        )
        .unwrap()
    };
    let under = |mut test: gusset::config::Prepared, off: f64, out: &str, words: Vec<Operator>| {
        test.experiment.ports[0].go_live(far(off));
        test.experiment.ports[0].computed = true;
        let folder = RunFolder::create(&at(out)).unwrap();
        let (says, requests) = crossbeam_channel::bounded(words.len() + 1);
        for word in words {
            says.send(word).unwrap();
        }
        session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
    };
    let conclude = |test, off, out: &str| under(test, off, out, Vec::new());
    let loaded = gusset::config::load(&test, &[]).unwrap_or_else(|e| panic!("{e}"));
    let whole = gusset::config::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(conclude(whole, 0.0, "whole").finish, Finish::Completed);
    killed(&at("whole"), &at("first"), 400);
    let again = || resume(&at("first"), None, &[], None).unwrap_or_else(|e| panic!("{e}"));
    let ended = conclude(again(), 0.0, "second");
    assert_eq!(ended.finish, Finish::Completed, "{}", ended.summary.reason);
    assert_eq!(
        steps(&[&at("first"), &at("second")]),
        steps(&[&at("whole")])
    );
    let found = replay(&at("second")).unwrap();
    assert!(found.is_exact(), "{found:?}");

    killed(&at("whole"), &at("other"), 400);
    let again = || resume(&at("other"), None, &[], None).unwrap_or_else(|e| panic!("{e}"));
    let ended = conclude(again(), 0.05, "moved");
    assert_eq!(ended.finish, Finish::Stopped);
    assert!(
        ended.summary.reason.contains("was left at"),
        "{}",
        ended.summary.reason
    );
    let commands = Run::open(&at("moved"))
        .unwrap()
        .columns(&["cmd_1_1"])
        .unwrap();
    let left = Run::open(&at("first"))
        .unwrap()
        .columns(&["cmd_1_1"])
        .unwrap();
    assert!(
        commands[0].iter().all(|c| Some(c) == left[0].last()),
        "nothing moved"
    );

    // Of one that was ended in order everything is known: a tenth of a millimetre is somewhere else.
    let mut words = vec![Operator::Continue; 300];
    words.push(Operator::Stop);
    let whole = gusset::config::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
    let ended = under(whole, 0.0, "stopped", words);
    assert_eq!(ended.finish, Finish::Interrupted);
    let again = || resume(&at("stopped"), None, &[], None).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        conclude(again(), 1e-4, "aside").finish,
        Finish::Stopped,
        "it was moved by 0.1 mm"
    );
    let told = std::fs::read_to_string(at("aside").join("events.jsonl")).unwrap();
    assert!(told.contains("\"event\":\"stands\"") && told.contains("\"event\":\"moved\""));
    assert_eq!(conclude(again(), 0.0, "there").finish, Finish::Completed);
}

#[test]
fn a_test_that_had_tripped_goes_on_only_for_who_names_the_trip() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    // One specimen whose force comes to its limit in the middle of the test.
    let text = frame(200, 1, 2.0, 0.0)
        + "[specimen.limits]\nmeasured_force_n = { trip = [-1.2e3, 1.2e3] }\n";
    let test = test_in(home.path(), &text);
    let said = common::run(&test, &at("first"), &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    let wanted = "say `--after-trip measured_force_n` if it may go on";
    refused(&at("first"), wanted, &[]);
    refused(&at("first"), wanted, &["--yes"]);
    refused(
        &at("first"),
        "no \"interlock\" ended this test",
        &["--after-trip", "interlock"],
    );
    let (first, second) = (at("first"), at("second"));
    let said = say([
        "run",
        "--resume",
        first.to_str().unwrap(),
        "--out",
        second.to_str().unwrap(),
        "--after-trip",
        "measured_force_n",
    ]);
    // The rows say so, too, should the event have been lost with the process.
    let unsaid = at("unsaid");
    copy(&first, &unsaid);
    std::fs::remove_file(unsaid.join("summary.json")).unwrap();
    let events = std::fs::read_to_string(unsaid.join("events.jsonl")).unwrap();
    let torn = events.find("limit_trip").unwrap();
    std::fs::write(unsaid.join("events.jsonl"), &events[..torn]).unwrap();
    let unknown = "say `--after-trip unknown` if it may go on";
    refused(&unsaid, unknown, &[]);
    // A measurement that is stale for once ends no test.
    let rows = Run::open(&unsaid).unwrap().columns(&["state"]).unwrap()[0].len();
    let stale = f64::from(Status::STALE.0);
    common::change(&unsaid, rows as u64 - 1, "status_1", stale);
    refused(&unsaid, unknown, &[]);
    // It trips at once again, or does not: it is told either way.
    assert!(matches!(said.code, Some(0 | 1)), "{}", said.stderr);
    assert!(said.stderr.contains("IT HAD TRIPPED"), "{}", said.stderr);
    let summary = common::json(&second, "summary.json");
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("IT HAD TRIPPED"), "{warnings}");
    // What was done to the specimen in steps without a row is not known.
    let samples = std::fs::File::options()
        .write(true)
        .open(first.join("samples.bin"))
        .unwrap();
    let length = samples.metadata().unwrap().len();
    samples.set_len(length / 2).unwrap();
    let named = ["--after-trip", "measured_force_n"];
    refused(&first, "but the rows end at", &named);
}

/// What ceased to be a number is latched as any other trip, whoever computed it.
#[test]
fn a_test_that_ended_with_no_finite_number_goes_on_only_for_who_says_so() {
    let home = tempfile::tempdir().unwrap();
    let text = "[time]\nrate_hz = 100\nduration_s = 0.5\nclock = \"simulated\"\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"spring\"\n\
        signal.sine = { amplitude = 100, frequency_hz = 1 }\n[[specimen]]\nname = \"spring\"\n\
        law.cubic = { stiffness_n_per_m = 1e3, cubic_n_per_m3 = 1e304 }\n";
    let test = write(home.path(), "test.toml", text);
    let first = home.path().join("first");
    let said = common::run(&test, &first, &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    refused(&first, "say `--after-trip diverged` if it may go on", &[]);
}

/// A damper's force is gone when a killed test goes on: that is no drift of its load cell, and the response is that of a test
/// which was never interrupted. Who knows better says so before the test.
#[test]
fn a_force_that_was_lost_at_rest_is_told_and_not_taken_for_drift() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let far = || {
        let far = Far {
            off: 0.0,
            damping: 2e4,
            disp: 0.0,
            vel: 0.0,
            sequence: 0,
        };
        let axes = vec![Axis::plain(vec![(0, 1.0)])];
        Port::new("far", axes, Box::new(far), 2, vec![5e5]).unwrap()
    };
    let conclude = |mut test: gusset::config::Prepared, out: &str| {
        test.experiment.ports[0].go_live(far());
        test.experiment.ports[0].computed = true;
        let (ask, requests) = crossbeam_channel::bounded(100);
        for _ in 0..100 {
            ask.send(Operator::Confirm).unwrap();
        }
        let folder = RunFolder::create(&at(out)).unwrap();
        session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
    };
    let takes_it = "resume_takes_force_drift = true\n";
    for (zero, takes, key) in [
        ("relative", false, ""),
        ("relative", true, takes_it),
        ("absolute", false, ""),
    ] {
        let [whole, first, second] =
            ["whole", "first", "second"].map(|n| format!("{n}-{zero}-{takes}"));
        let safety = format!("[safety]\nunlimited = \"a damper\"\n{key}");
        let law = frame(200, 1, 2.0, 0.0).replace("[safety]\n", &safety);
        let linked = law.split("[specimen.law").next().unwrap().to_owned()
            + &format!(
                "stiffness_n_per_m = 5e5\nlink = {{ address = \"127.0.0.1:9\", coupling = \"lockstep\" }}\n\
                 [[specimen.axis]]\nzero_force = \"{zero}\"\n"
            );
        let test = test_in(home.path(), &linked);
        let loaded = gusset::config::load(&test, &[]).unwrap_or_else(|e| panic!("{e}"));
        let built = gusset::config::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(conclude(built, &whole).finish, Finish::Completed);
        killed(&at(&whole), &at(&first), 400);
        let next = resume(&at(&first), None, &[], None).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(conclude(next, &second).finish, Finish::Completed);
        let same = steps(&[&at(&first), &at(&second)]) == steps(&[&at(&whole)]);
        assert_eq!(same, !takes);
        let events = Run::open(&at(&second)).unwrap().events().unwrap().events;
        let told = events
            .iter()
            .find(|e| e["event"] == "force_changed")
            .unwrap();
        let [left, found] = ["left", "found"].map(|key| told[key].as_f64().unwrap());
        assert!((left - found).abs() > 1.0, "{left} {found}");
        assert_eq!(told["taken_for_drift"], takes);
    }
}

/// How the link of a rig ends, after so many commands.
#[derive(Debug, Clone, Copy, PartialEq)]
enum End {
    Closed,
    NotANumber,
    Panic,
}

/// A spring that says where it stands, and stays there when nobody is connected.
struct Rig {
    place: Arc<Mutex<f64>>,
    ends: Option<(u32, End)>,
    told: u32,
    sequence: u64,
}

impl Rig {
    fn boxed(place: &Arc<Mutex<f64>>, ends: Option<(u32, End)>) -> Box<dyn Substructure> {
        Box::new(Self {
            place: Arc::clone(place),
            ends,
            told: 0,
            sequence: 0,
        })
    }
}

impl Substructure for Rig {
    fn axes(&self) -> usize {
        1
    }
    fn coupling(&self) -> Coupling {
        Coupling::Lockstep
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction {
            standing: vec![*self.place.lock().unwrap()],
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        *self.place.lock().unwrap() = command.disp[0];
        (self.sequence, self.told) = (command.sequence, self.told + 1);
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let disp = *self.place.lock().unwrap();
        let end = self.ends.filter(|(at, _)| self.told >= *at);
        let force = match end.map(|(_, end)| end) {
            None => 3e5 * disp,
            Some(End::Closed) => return Err(LinkFault::Closed),
            Some(End::NotANumber) => f64::NAN,
            Some(End::Panic) => panic!("the loop is at fault"),
        };
        into.sequence = self.sequence;
        (into.disp[0], into.force[0]) = (disp, force);
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

/// Two storeys, each a rig behind a link. 10 ticks of reading, 4 of warm-up, a ramp of 40 where it is one.
fn two_rigs(home: &Path, safety: &str) -> PathBuf {
    let rig = |name: &str, storey: u32| {
        format!(
            "[[specimen]]\nname = \"{name}\"\nstorey = {storey}\nstiffness_n_per_m = 3e5\nlink = {{ address = \
             \"127.0.0.1:9\", coupling = \"lockstep\", probe = \"none\" }}\n"
        )
    };
    let text = format!(
        "[time]\nrate_hz = 200\nduration_s = 2\nclock = \"simulated\"\n[structure.shear_building]\nmass_kg = [1000, 900]\n\
         stiffness_n_per_m = [0, 0]\n[excitation.ground_acceleration.signal.sine]\namplitude = 4\nfrequency_hz = 1.4\n\
         [timing]\nwarmup_ticks = 4\n[safety]\nunlimited = \"springs\"\nzero_s = 0.05\nramp_s = 0.2\nease_s = 0\n{safety}\n\
         {}{}",
        rig("one", 1),
        rig("other", 2)
    );
    write(home, "test.toml", &text)
}

/// Runs it with these rigs, and an operator who asks for the end after so many ticks.
fn run_rigs(
    mut test: gusset::config::Prepared,
    rigs: [Box<dyn Substructure>; 2],
    out: &Path,
    stops_after: Option<usize>,
) -> session::Finished {
    for (port, rig) in test.experiment.ports.iter_mut().zip(rigs) {
        port.put_recording(rig);
        port.computed = true;
    }
    let ticks = stops_after.unwrap_or(0);
    let (says, requests) = crossbeam_channel::bounded(ticks + 1);
    for _ in 0..ticks {
        says.send(Operator::Continue).unwrap();
    }
    if stops_after.is_some() {
        says.send(Operator::Stop).unwrap();
    }
    let folder = RunFolder::create(out).unwrap();
    session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
}

fn built(test: &Path) -> gusset::config::Prepared {
    let loaded = gusset::config::load(test, &[]).unwrap_or_else(|e| panic!("{e}"));
    gusset::config::build(&loaded).unwrap_or_else(|e| panic!("{e}"))
}

/// Where two rigs stand, whoever put them there.
fn put(places: &[Arc<Mutex<f64>>; 2], to: [f64; 2]) {
    for (place, to) in places.iter().zip(to) {
        *place.lock().unwrap() = to;
    }
}

/// The other specimen was sent its command in the tick in which the link of the one was lost: it stands there, and on record.
/// After a panic of our own it may stand there.
#[test]
fn who_is_well_when_a_link_is_lost_stands_where_the_record_ends_and_the_test_can_go_on() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = two_rigs(home.path(), "");
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let put = |to: [f64; 2]| put(&places, to);
    let rigs = |ends| [Rig::boxed(&places[0], ends), Rig::boxed(&places[1], None)];
    let whole = run_rigs(built(&test), rigs(None), &at("whole"), None);
    assert_eq!(whole.finish, Finish::Completed);
    for (end, finish, after) in [
        (End::Closed, Finish::LinkFailed, None),
        (End::NotANumber, Finish::LinkFailed, Some("not_finite")),
        (End::Panic, Finish::Panicked, None),
    ] {
        let [first, second] = ["first", "second"].map(|name| at(&format!("{name}-{end:?}")));
        put([0.0; 2]);
        let ended = run_rigs(built(&test), rigs(Some((180, end))), &first, None);
        assert_eq!(ended.finish, finish, "{}", ended.summary.reason);
        assert_eq!(ended.summary.left["other"], "stayed");
        let stands = [0, 1].map(|rig: usize| *places[rig].lock().unwrap());
        let (commands, states) = (column(&first, "cmd_2_1"), column(&first, "state"));
        if end == End::Panic {
            assert_ne!(commands.last(), Some(&stands[1]));
        } else {
            assert_eq!(commands.last(), Some(&stands[1]), "{end:?}");
            assert_eq!(states.last(), Some(&Phase::Tripped.code()));
            let found = replay(&first).unwrap();
            assert!(found.is_exact(), "{end:?}: {found:?}");
            assert_eq!(found.rows, states.len() as u64);
        }
        let again = || {
            let after: Vec<String> = after.iter().map(|trip: &&str| (*trip).to_owned()).collect();
            resume(&first, None, &after, None).unwrap_or_else(|e| panic!("{e}"))
        };
        // Further than any record can lack.
        put([stands[0], stands[1] + 0.5]);
        let moved = run_rigs(again(), rigs(None), &at(&format!("moved-{end:?}")), None);
        assert_eq!(moved.finish, Finish::Stopped, "{}", moved.summary.reason);
        put(stands);
        let ended = run_rigs(again(), rigs(None), &second, None);
        assert_eq!(ended.finish, Finish::Completed, "{}", ended.summary.reason);
        assert_eq!(steps(&[&first, &second]), steps(&[&at("whole")]), "{end:?}");
        let found = replay(&second).unwrap();
        assert!(found.is_exact(), "{end:?}: {found:?}");
    }
}

/// Already on the way out: a link that is lost there ends it for both, and both stand where the record ends.
#[test]
fn a_link_that_is_lost_on_the_way_out_leaves_the_last_commands_on_record() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let leaves = "at_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.01\n";
    let test = two_rigs(home.path(), leaves);
    // In its first tick, and later.
    for (name, ticks) in [("first", 0), ("later", 7)] {
        let places: [Arc<Mutex<f64>>; 2] = Default::default();
        let ends = Some((151 + ticks, End::Closed));
        let rigs = [Rig::boxed(&places[0], ends), Rig::boxed(&places[1], None)];
        let ended = run_rigs(built(&test), rigs, &at(name), Some(150));
        assert_eq!(ended.finish, Finish::LinkFailed, "{}", ended.summary.reason);
        let leaving = column(&at(name), "state");
        let leaving = leaving
            .iter()
            .filter(|state| **state == Phase::Leaving.code());
        assert_eq!(leaving.count(), ticks as usize);
        for (rig, place) in (1..).zip(&places) {
            let commands = column(&at(name), &format!("cmd_{rig}_1"));
            assert_eq!(commands.last(), Some(&*place.lock().unwrap()));
        }
        let found = replay(&at(name)).unwrap();
        assert!(found.is_exact(), "{name}: {found:?}");
        assert_eq!(found.rows, column(&at(name), "state").len() as u64);
    }
}

/// Killed, stopped or refused before its first step, a test that goes on is no dead end: its specimens stand where it left them,
/// and the state is that of the test before it.
#[test]
fn a_test_that_ended_on_its_way_in_to_where_it_was_to_go_on_can_go_on() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let leaves = "at_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.05\n";
    let test = two_rigs(home.path(), leaves);
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let put = |to: [f64; 2]| put(&places, to);
    let rigs = || places.each_ref().map(|place| Rig::boxed(place, None));
    let again = |from: &str| resume(&at(from), None, &[], None).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        run_rigs(built(&test), rigs(), &at("whole"), None).finish,
        Finish::Completed
    );
    put([0.0; 2]);
    let ended = run_rigs(built(&test), rigs(), &at("first"), Some(190));
    assert_eq!(ended.finish, Finish::Interrupted);
    assert_eq!(ended.summary.left["one"], "reached");
    // The same interruption of other specimens, since each goes on once.
    for name in ["same", "third"] {
        copy(&at("first"), &at(name));
    }
    let goes_on = |from: &str, to: &str| {
        let ended = run_rigs(again(from), rigs(), &at(to), None);
        assert_eq!(
            ended.finish,
            Finish::Completed,
            "{from}: {}",
            ended.summary.reason
        );
        assert_eq!(
            steps(&[&at("first"), &at(to)]),
            steps(&[&at("whole")]),
            "{from}"
        );
        let found = replay(&at(to)).unwrap();
        assert!(found.is_exact(), "{from}: {found:?}");
        let warned = ended.summary.warnings.join("; ");
        assert_eq!(
            warned.contains("ended on its way in"),
            from != "first",
            "{warned}"
        );
        let again = resume(&at(from), None, &[], None).err().unwrap();
        assert!(matches!(again, ResumeError::WentOn { .. }), "{again}");
    };
    goes_on("first", "second");

    // It is killed while it reads, at the beginning of its ramp and in the middle, with a tick that is not on record.
    let states = column(&at("second"), "state");
    let commands = ["cmd_1_1", "cmd_2_1"].map(|name| column(&at("second"), name));
    let ramps = states
        .iter()
        .position(|state| *state == Phase::Ramping.code());
    let ramps = ramps.unwrap();
    assert!(commands[0][ramps + 20].abs() > 1e-4);
    for row in [ramps - 5, ramps, ramps + 1, ramps + 20] {
        let (cut, on) = (format!("cut-{row}"), format!("on-{row}"));
        killed(&at("second"), &at(&cut), row);
        put(commands.each_ref().map(|column| column[row]));
        goes_on(&cut, &on);
    }

    // The operator ends it there: it is led out, and what goes on after that is killed in its ramp, too.
    put([0.0; 2]);
    let ended = run_rigs(again("same"), rigs(), &at("ended"), Some(35));
    assert_eq!(ended.finish, Finish::Interrupted);
    assert_eq!(ended.summary.left["one"], "reached");
    let stands = *places[0].lock().unwrap();
    assert_eq!(column(&at("ended"), "cmd_1_1").last(), Some(&stands));
    goes_on("ended", "after-that");
    // By that the test went on with which that one did, too.
    let went_on = resume(&at("same"), None, &[], None)
        .err()
        .unwrap()
        .to_string();
    assert!(went_on.contains("after-that, to its end"), "{went_on}");
    killed(&at("after-that"), &at("cut-again"), ramps + 20);
    put(commands.each_ref().map(|column| column[ramps + 20]));
    goes_on("cut-again", "at-last");

    // Somebody has moved it: refused, and that is no way around being refused.
    for (from, to) in [("third", "refused"), ("refused", "refused-again")] {
        put([5e-3, 0.0]);
        let ended = run_rigs(again(from), rigs(), &at(to), None);
        assert_eq!(ended.finish, Finish::Stopped, "{}", ended.summary.reason);
        assert!(ended.summary.reason.contains("was left at"));
    }
    put([0.0; 2]);
    goes_on("refused-again", "put-back");
    put([0.5, 0.0]);
    killed(&at("second"), &at("cut-anew"), ramps - 5);
    let ended = run_rigs(again("cut-anew"), rigs(), &at("aside"), None);
    assert_eq!(ended.finish, Finish::Stopped, "{}", ended.summary.reason);
}

/// What specimens that remember went through once they do not go through again: neither after an end nor after a kill of the test
/// that led them, wherever its folder is, nor if they came back near to where they were. What was refused has led them nowhere.
#[test]
fn the_same_interruption_is_gone_on_with_once() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = two_rigs(home.path(), "");
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let put = |to: [f64; 2]| put(&places, to);
    let rigs = || places.each_ref().map(|place| Rig::boxed(place, None));
    let ended = run_rigs(built(&test), rigs(), &at("first"), Some(190));
    assert_eq!(ended.finish, Finish::Interrupted);
    let stands = [0, 1].map(|rig: usize| *places[rig].lock().unwrap());
    let mark = at("first/continued.json");
    let again = |back_to| resume(&at("first"), None, &[], back_to);
    let next = || again(None).unwrap_or_else(|e| panic!("{e}"));

    put([stands[0], stands[1] + 0.5]);
    let ended = run_rigs(next(), rigs(), &at("refused"), None);
    assert_eq!(ended.finish, Finish::Stopped, "{}", ended.summary.reason);
    std::fs::remove_dir_all(at("refused")).unwrap();
    assert!(!mark.exists(), "it takes its word back");
    put(stands);
    // What cannot say that it goes on does not begin.
    let partial = format!("first/.continued.json.partial-{}", std::process::id());
    std::fs::create_dir(at(&partial)).unwrap();
    let folder = RunFolder::create(&at("unsaid")).unwrap();
    let (_says, requests) = crossbeam_channel::bounded(1);
    let unsaid = session::run(next(), folder, requests, Watches::default(), &mut |_| {});
    let unsaid = unsaid.unwrap_err().to_string();
    let told = "must say that this one goes on with it";
    assert!(unsaid.contains(told), "{unsaid}");
    assert!(!at("unsaid").exists() && !mark.exists());
    std::fs::remove_dir(at(&partial)).unwrap();

    let step = next().experiment.resume.unwrap().step();
    let ended = run_rigs(next(), rigs(), &at("second"), Some(100));
    assert_eq!(ended.finish, Finish::Interrupted);
    let reached = ended.summary.steps;
    assert!(reached > step + 10);
    put(stands);
    let refusal = |folder: &str, words: &[&str]| {
        let refused = resume(&at(folder), None, &[], None).err().unwrap();
        assert!(matches!(refused, ResumeError::WentOn { .. }), "{refused}");
        let text = refused.to_string();
        for word in words {
            assert!(text.contains(word), "{word}: {text}");
        }
    };
    let after = format!("it went on after step {step} in");
    let far = format!("second, as far as step {reached}");
    let allowed = format!("say `--back-to-step {step}`");
    refusal("first", &[&after, &far, &allowed, "--resume"]);
    let found = replay(&at("first")).unwrap();
    assert!(found.is_exact(), "{found:?}");
    for command in ["report", "stop"] {
        let said = say([command, at("first").to_str().unwrap()]);
        assert!(
            matches!(said.code, Some(0 | 2)),
            "{command}: {}",
            said.stderr
        );
    }
    // It ended a while ago, and may be gone: what was said of it still holds.
    copy(&at("first"), &at("kept/first"));
    std::fs::rename(at("second"), at("elsewhere")).unwrap();
    let gone = "is not there any more";
    refusal("first", &[&after, &far, &allowed, gone]);
    // Moved together they find each other.
    copy(&at("elsewhere"), &at("kept/second"));
    refusal("kept/first", &[&after, "kept/"]);

    // A kill leaves no word of how far it came but its own record.
    let said = std::fs::read_to_string(&mark).unwrap();
    let unknown = said.replace(&format!("\"reached\": {reached}"), "\"reached\": null");
    assert_ne!(said, unknown);
    std::fs::write(&mark, unknown).unwrap();
    refusal("first", &[&after, "nobody knows how far", gone]);
    let states = column(&at("elsewhere"), "state");
    let begins = states
        .iter()
        .position(|state| *state == Phase::Running.code());
    let begins = begins.unwrap();
    for (row, has_led) in [(begins - 1, false), (begins, false), (begins + 1, true)] {
        let _ = std::fs::remove_dir_all(at("second"));
        killed(&at("elsewhere"), &at("second"), row);
        assert_eq!(again(None).is_err(), has_led, "{row}");
    }
    refusal("first", &["second, as far as step", "--resume"]);

    // Who names the step leads them through it once more.
    let other = again(Some(step + 1)).err().unwrap();
    assert!(matches!(other, ResumeError::AnotherStep { .. }), "{other}");
    let next = again(Some(step)).unwrap_or_else(|e| panic!("{e}"));
    let warned = next.facts.warnings.join("; ");
    assert!(warned.contains("led once more"), "{warned}");
    let ended = run_rigs(next, rigs(), &at("once-more"), None);
    assert_eq!(ended.finish, Finish::Completed, "{}", ended.summary.reason);
    refusal("first", &["once-more, to its end", &allowed]);
}
