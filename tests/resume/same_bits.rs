//! A resumed test continues with the same bits as without an interruption, whatever was interrupted.

use super::*;
use crate::common::test_file::TestFile;

#[test]
fn repeated_resumes_give_the_same_bits() {
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
fn resumed_page_shows_its_steps_and_totals() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    // The record is strongest at its beginning. An actuator lags, so that the displacement is measured.
    let actuator = "[specimen.transfer.actuator.first_order]\ntime_constant_s = 1e-3\n";
    let text = frame(200, 1, 3.0, 0.0) + actuator;
    let test = test_in(home.path(), &text);
    let faded: String = (0..1200)
        .map(|k| f64::from(k) * 0.005)
        .map(|t| format!("{t:.3},{:.6}\n", 4.0 * libm::sin(9.0 * t) * libm::exp(-t)))
        .collect();
    write(home.path(), "motion.csv", &format!("t,a\n{faded}"));
    completed(&test, &at("whole"), &[]);
    let made = column(&at("whole"), "step");
    let row = made.iter().rposition(|step| *step == 300.0).unwrap();
    killed(&at("whole"), &at("first"), row + 1);
    let said = go_on(&at("first"), &at("second"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let page = |name: &str| std::fs::read_to_string(at(name).join("report.html")).unwrap();
    let (whole, second) = (page("whole"), page("second"));
    let ground = "<h2>Ground motion</h2>";
    assert_eq!(measures(&second, ground), measures(&whole, ground));
    assert!(measures(&whole, ground).contains("Arias intensity"));
    let steps = steps(&[&at("second")]);
    let (from, to) = (steps.keys().next().unwrap(), steps.keys().last().unwrap());
    let part = format!("of steps {from} to {to} only; the steps before are in before/.");
    assert!(
        second.contains(&format!("<p>This page is {part}")),
        "{part}"
    );
    for heading in ["Response", "Energy"] {
        let told = format!("<h2>{heading}</h2><p class=\"note\">O{}", &part[1..]);
        assert!(second.contains(&told), "{told}");
    }
    assert!(second.contains("another folder"));
    assert!(!whole.contains("page is"));

    // Both tiles show the whole test, and so does the summary.
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
    // The earlier steps are found in a test that resumes a resumed one, too.
    let last = *steps.keys().nth(100).unwrap();
    let row = column(&at("second"), "step");
    let row = row.iter().rposition(|step| *step == last as f64).unwrap();
    killed(&at("second"), &at("cut"), row + 1);
    let said = go_on(&at("cut"), &at("third"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let told = " only; the steps before are in before/.";
    assert!(page("third").contains(told), "{told}");

    for words in ["displacement, DOF 2", "force, storey"] {
        assert_eq!(tile(&second, words), tile(&whole, words));
        assert!(second.contains(&format!("{words}, of the whole test<")));
        assert!(whole.contains(&format!("{words}<")));
    }
    assert!(second.contains(&format!(" {from} to {to}<")), "the lag");
}

/// Killed before a per-step specimen received its known target, or before it answered: it receives that target, and not its last
/// one again. Its limits use the earlier targets, not the position of the pause: its speed does not trip as an acceleration from
/// rest, at neither end.
#[test]
fn per_step_specimen_gets_its_next_target() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let seen = link_common::ONE_AXIS;
    let text = |ticks: u32, specimen: &str| {
        link_common::test_file(600, specimen).with(&format!(
            "time = {{ rate_hz = 100, ticks_per_step = {ticks} }}\n\
             safety = {{ ease_s = 0, resume_within_m = 1 }}"
        ))
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
            // The server restarts its spring, which makes no difference to a spring.
            let said = go_on_with(&first, &second, &["--accept-changed", "a linear spring"]);
            assert_eq!(said.code, Some(0), "{}", said.stderr);
            assert_eq!(steps(&[&first, &second]), steps(&[&whole]), "{ticks} {row}");
            refused(&first, "after step", &[]);
        }
    }
}

/// With a hold ramp the first steps take several ticks: a formula that remembers moves in smaller parts. This one is exact whatever
/// the parts, so that only roundoff differs; others differ by their own error of integration.
#[test]
fn hold_ramp_at_start_keeps_the_response() {
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

/// A test with a compensator that was killed at full pace, in the hold ramp, in the hold and after it: it resumes without a kick,
/// and a replay repeats it to the last bit.
#[test]
fn compensated_test_resumes_from_a_hold() {
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
        let loaded = gusset_config::load(&test, &[]).unwrap_or_else(|e| panic!("{e}"));
        let test = gusset_setup::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
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
        // The hold ramp takes 80 steps.
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
                columns(&first, &["cmd_1_1", "added_1_1"]),
                columns(&second, &["cmd_1_1", "added_1_1"]),
            );
            assert_eq!(
                before[0].last(),
                after[0].first(),
                "it begins where it was left"
            );
            assert_ne!(after[1][0], 0.0, "energy counts over the whole test");
            assert_eq!(before[1].last(), after[1].first());
            let found = jump(&after[0]);
            assert!(found <= bound, "{made} {ticks} {count}: {found} {bound}");
            let found = replay(&at(&second)).unwrap();
            assert!(found.is_exact(), "{made} {count}: {found:?}");
        }
    }
}

#[test]
#[expect(clippy::disallowed_methods, reason = "another process is waited for")]
fn killed_test_resumes() {
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
    assert!(said.stderr.contains("is running"), "{}", said.stderr);
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

/// A resumed test needs no other folder: it is replayed, reported and resumed alone, wherever it is.
#[test]
fn resumed_test_stands_on_its_own() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.0));
    completed(&test, &at("whole"), &[]);
    killed(&at("whole"), &at("here/first"), 200);
    let first = steps(&[&at("here/first")]);
    assert_eq!(go_on(&at("here/first"), &at("here/second")).code, Some(0));
    killed(&at("here/second"), &at("here/third"), 120);
    let said = go_on(&at("here/third"), &at("here/fourth"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let origin = common::json(&at("here/fourth"), "resumed.json");
    assert_eq!(origin["parent"], at("here/third").to_str().unwrap());

    std::fs::create_dir(at("there")).unwrap();
    for name in ["second", "fourth"] {
        std::fs::rename(at("here").join(name), at("there").join(name)).unwrap();
    }
    std::fs::remove_dir_all(at("here")).unwrap();
    for name in ["there/second", "there/fourth", "there/fourth/before"] {
        let found = replay(&at(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let is_whole = name != "there/fourth/before";
        assert_eq!(found.is_exact(), is_whole, "{name}: {found:?}");
        assert!(found.difference.is_none(), "{name}: {found:?}");
    }
    let said = say(["report", at("there/fourth").to_str().unwrap()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let before = at("there/fourth/before");
    let parts = [&before.join("before"), &before, &at("there/fourth")];
    let all = steps(&parts.map(PathBuf::as_path));
    assert_eq!(all, steps(&[&at("whole")]));
    assert_eq!(steps(&[&before.join("before")]), first);
    killed(&at("there/fourth"), &at("fifth"), 120);
    let said = go_on(&at("fifth"), &at("sixth"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(replay(&at("sixth")).unwrap().is_exact());

    // Another test is not the one, and without it the message names both folders.
    let before = at("sixth/before");
    let changed = before.join("before/samples.bin");
    let rows = std::fs::read(&changed).unwrap();
    std::fs::remove_file(&changed).unwrap();
    std::fs::write(&changed, &rows[8..]).unwrap();
    let other = replay(&at("sixth")).unwrap_err();
    assert!(matches!(other, ReplayError::Input { .. }), "{other}");
    std::fs::remove_dir_all(&before).unwrap();
    let lost = replay(&at("sixth")).unwrap_err();
    let ReplayError::NoBefore { path, parent } = lost else {
        panic!("{lost}");
    };
    assert_eq!((path, parent), (before, at("fifth")));
}

/// It was ended while it moved, and is at rest now: its commands are not checked against its former speed.
#[test]
fn test_ended_at_speed_resumes_in_its_limit() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let text = "[time]\nrate_hz = 100\nduration_s = 6\nclock = \"simulated\"\n[structure.shear_building]\n\
        mass_kg = [5e3]\nstiffness_n_per_m = [0]\n[excitation.ground_acceleration.signal.sine]\namplitude = 1.0\n\
        frequency_hz = 2\n[[specimen]]\nname = \"a\"\nstorey = 1\nlaw.linear = { stiffness_n_per_m = 3e6 }\n\
        [specimen.limits]\ncommand_accel_m_per_s2 = { trip = 2.0 }\n";
    let test = test_in(home.path(), text);
    completed(&test, &at("whole"), &[]);
    let whole = Run::open(&at("whole")).unwrap();
    let commands = whole.columns(&["cmd_1_1"]).unwrap().remove(0);
    let step = |row: &usize| (commands[*row] - commands[*row - 1]).abs();
    let fastest = (1..commands.len()).max_by(|a, b| step(a).total_cmp(&step(b)));
    let fastest = fastest.unwrap();
    assert!(step(&fastest) * 100.0 * 100.0 > 2.0, "a stop at once trips");
    killed(&at("whole"), &at("first"), fastest);
    let said = go_on(&at("first"), &at("second"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let found = replay(&at("second")).unwrap();
    assert!(found.is_exact(), "{found:?}");
}
