//! A specimen that changed since the interruption: another force, another place, or a computation that restarts. The test is
//! refused with exit 2, unless the user gives a reason, which is recorded.

use super::rigs::built;
use super::*;

/// A yielding column behind a server at this address.
fn column_at(home: &Path, address: &str, remembers: bool) -> link_common::Served {
    let law = "law.bilinear = { stiffness_n_per_m = 4e5, yield_force_n = 400.0, post_yield_ratio = 0.1 }\n";
    let text = format!("[serve]\nremembers = {remembers}\n[[specimen]]\nname = \"column\"\n{law}");
    link_common::Served::listen(home, &text, address, &[])
}

/// A test of such a column that was killed where the column bears a force near its zero, since it has yielded.
fn killed_test(home: &Path, remembers: bool) -> (link_common::Served, PathBuf) {
    let served = column_at(home, "127.0.0.1:0", remembers);
    let test = link_common::linked(900, &served.address, "watchdog_s = 20\n");
    let test = write(home, "test.toml", &test);
    let (whole, first) = (home.join("whole"), home.join("first"));
    completed(&test, &whole, &[]);
    let (disps, forces) = (
        column(&whole, "raw_disp_1_1"),
        column(&whole, "raw_force_1_1"),
    );
    // More than an elastic column would bear on the way from zero.
    let beyond = |row: &usize| forces[*row].abs() - 4e5 * disps[*row].abs();
    let rows = (50..disps.len()).max_by(|one, other| beyond(one).total_cmp(&beyond(other)));
    let row = rows.unwrap();
    assert!(beyond(&row) > 100.0, "{} {}", disps[row], forces[row]);
    killed(&whole, &first, row + 1);
    (served, first)
}

/// The law restarts at the column's position: the position alone does not show it.
#[test]
fn resume_refuses_a_server_without_state() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let (served, first) = killed_test(home.path(), false);
    let said = go_on(&first, &at("refused"));
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    for word in ["remembers = true", "--accept-changed", "was moved"] {
        assert!(said.stderr.contains(word), "{word}: {}", said.stderr);
    }
    let told = common::json(&at("refused"), "summary.json");
    assert_eq!(told["status"], "stopped");
    assert_eq!(told["accepted"], serde_json::json!({}));
    assert_eq!(column(&at("refused"), "state").len(), 0, "nothing was sent");
    assert!(!at("first/continued.json").exists(), "no run resumed it");

    let said = go_on_with(&first, &at("quiet"), &["--quiet"]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    let errors = said
        .stderr
        .lines()
        .filter(|line| line.starts_with("error: "));
    let errors: Vec<&str> = errors.collect();
    assert_eq!(errors.len(), 1, "{}", said.stderr);
    let is_named = errors[0].contains("REFUSED");
    assert!(
        is_named && errors[0].contains("--accept-changed"),
        "{}",
        said.stderr
    );

    let reason = "the column was replaced by a new one";
    let said = go_on_with(&first, &at("second"), &["--accept-changed", reason]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stderr.contains(reason), "{}", said.stderr);
    let told = common::json(&at("second"), "summary.json");
    assert_eq!(
        told["accepted"],
        serde_json::json!({"accept_changed": reason})
    );
    assert!(told["warnings"].to_string().contains(reason));
    let page = std::fs::read_to_string(at("second/report.html")).unwrap();
    assert!(page.contains(reason));
    let origin = common::json(&at("second"), "resumed.json");
    assert_eq!(origin["accepted_changed"], reason);
    let found = replay(&at("second")).unwrap();
    assert!(found.is_exact(), "{found:?}");
    drop(served);
}

/// Its server keeps its state, and was restarted: its first session holds nothing of the interrupted test.
#[test]
fn resume_refuses_a_restarted_server() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let (mut served, first) = killed_test(home.path(), true);
    served.signal("TERM");
    let served = column_at(home.path(), &served.address, true);
    // Nor does a second attempt, since the first one armed nothing.
    for name in ["refused", "again"] {
        let said = go_on(&first, &at(name));
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        for word in ["restarted", "remembers = true", "--accept-changed"] {
            assert!(said.stderr.contains(word), "{word}: {}", said.stderr);
        }
        assert_eq!(column(&at(name), "state").len(), 0, "nothing was sent");
    }
    drop(served);
}

/// Its server was restarted, and another test has armed the specimen since.
#[test]
fn resume_refuses_a_changed_force() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let (mut served, first) = killed_test(home.path(), true);
    served.signal("TERM");
    let served = column_at(home.path(), &served.address, true);
    let short = link_common::linked(1, &served.address, "watchdog_s = 20\n");
    let short = write(home.path(), "short.toml", &short);
    completed(&short, &at("short"), &[]);
    let said = go_on(&first, &at("refused"));
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    let told = common::json(&at("refused"), "summary.json");
    assert_eq!(told["status"], "stopped");
    let reason = told["reason"].as_str().unwrap();
    for word in ["cell reads", "resume_within_n", "--accept-changed"] {
        assert!(reason.contains(word), "{word}: {reason}");
    }
    let commands = column(&at("refused"), "cmd_1_1");
    assert!(
        commands.iter().all(|command| *command == commands[0]),
        "nothing was moved"
    );
    let events = Run::open(&at("refused"))
        .unwrap()
        .events()
        .unwrap()
        .to_json();
    let changed = events
        .iter()
        .find(|event| event["event"] == "force_changed")
        .unwrap();
    let number = |key: &str| changed[key].as_f64().unwrap();
    assert!(
        (number("left") - number("found")).abs() > number("within"),
        "{changed}"
    );
    let found = replay(&at("refused")).unwrap();
    assert!(found.is_exact(), "{found:?}");
    for empty in ["", "  ", ".", "1"] {
        let said = go_on_with(&first, &at("empty"), &["--accept-changed", empty]);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        assert!(!at("empty").exists());
    }
    let said = go_on_with(
        &first,
        &at("second"),
        &["--accept-changed", "unloaded by hand"],
    );
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    // The difference is shown in the summary and the page, and not in the events alone.
    let summary = common::json(&at("second"), "summary.json");
    let page = std::fs::read_to_string(at("second/report.html")).unwrap();
    let warnings = summary["warnings"].as_array().unwrap().iter();
    let mut warnings = warnings.map(|text| text.as_str().unwrap());
    let told = warnings.find(|text| text.contains("cell reads"));
    assert!(told.unwrap().contains("BEYOND"), "{told:?}");
    assert!(page.contains("BEYOND"));
    drop(served);
}

/// A spring whose load cell reads `extra` more than its force.
pub struct Cell {
    extra: f64,
    disp: f64,
    sequence: u64,
}

impl Cell {
    pub fn with(extra: f64) -> Self {
        let (disp, sequence) = (0.0, 0);
        Self {
            extra,
            disp,
            sequence,
        }
    }
}

impl Substructure for Cell {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.disp, self.sequence) = (command.disp[0], command.sequence);
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.sequence = self.sequence;
        (into.disp[0], into.force[0]) = (self.disp, 3e5 * self.disp + self.extra);
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

#[test]
fn force_may_differ_by_2_percent_of_peak() {
    for (safety, share, cause) in [
        ("", 0.019, Cause::Done),
        ("", 0.021, Cause::ForceChanged),
        ("", -0.021, Cause::ForceChanged),
        ("resume_within_n = 1e9\n", 0.5, Cause::Done),
        ("resume_within_n = 1e-3\n", 0.001, Cause::ForceChanged),
    ] {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        let text = format!(
            "[time]\nrate_hz = 200\nduration_s = 2\nclock = \"simulated\"\n[structure.shear_building]\nmass_kg = [1000]\n\
             stiffness_n_per_m = [0]\n[excitation.ground_acceleration.signal.sine]\namplitude = 4\nfrequency_hz = 1.4\n\
             [timing]\nwarmup_ticks = 4\n[safety]\nunlimited = \"a spring\"\nzero_s = 0.05\nramp_s = 0.2\nease_s = 0\n{safety}\
             [[specimen]]\nname = \"cell\"\nstorey = 1\nstiffness_n_per_m = 3e5\nlink = {{ address = \"127.0.0.1:9\", \
             coupling = \"lockstep\", probe = \"none\" }}\n"
        );
        let test = write(home.path(), "test.toml", &text);
        let run = |mut test: gusset_setup::Prepared, extra: f64, out: &str| {
            test.experiment.ports[0]
                .put_recording(Box::new(Cell::with(extra)))
                .unwrap();
            test.experiment.ports[0].startup_mut().set_computed(true);
            let folder = RunFolder::create(&at(out)).unwrap();
            let (_says, requests) = crossbeam_channel::bounded(1);
            session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
        };
        let whole = run(built(&test), 0.0, "whole");
        assert_eq!(whole.cause, Cause::Done);
        killed(&at("whole"), &at("first"), 300);
        // What counts is the peak up to the kill.
        let forces = column(&at("first"), "raw_force_1_1");
        let peak = forces
            .iter()
            .fold(0.0, |most: f64, force| most.max(force.abs()));
        let next = resume(&at("first"), None, false).unwrap_or_else(|e| panic!("{e}"));
        let ended = run(next, share * peak, "second");
        assert_eq!(
            ended.cause, cause,
            "{safety} {share}: {}",
            ended.summary.reason
        );
    }
}

/// The text of a test with this trip level of its storey.
fn limited(level: &str) -> String {
    frame(200, 1, 2.0, 0.0) + "[specimen.limits]\n" + level + "\n"
}

#[test]
fn resume_accepts_wider_limits() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let wide = limited("measured_force_n = { trip = [-1e5, 1e5] }");
    completed(&test_in(home.path(), &wide), &at("whole"), &[]);
    tripped_in(home.path(), &at("first"));
    let wider = "specimen.0.limits.measured_force_n.trip=[-1e5, 1e5]";
    let reason = "yields later than planned";
    for (more, word) in [
        (vec!["--set", wider], "--reason"),
        (
            vec!["--set", "time.duration_s=3", "--reason", reason],
            "time.duration_s",
        ),
        (
            vec![
                "--set",
                "specimen.0.limits.measured_force_n.trip=[-1e5, 10]",
                "--reason",
                reason,
            ],
            "measured_force_n.trip[1]",
        ),
    ] {
        let more = [&["--after-trip"][..], &more].concat();
        let said = go_on_with(&at("first"), &at("refused"), &more);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        assert!(said.stderr.contains(word), "{word}: {}", said.stderr);
        assert!(!at("refused").exists());
    }
    let more = ["--after-trip", "--set", wider, "--reason", reason];
    let said = go_on_with(&at("first"), &at("second"), &more);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let summary = common::json(&at("second"), "summary.json");
    assert_eq!(
        summary["accepted"],
        serde_json::json!({"wider_limits": reason})
    );
    let warnings = summary["warnings"].to_string();
    assert!(
        warnings.contains("1200") && warnings.contains("100000"),
        "{warnings}"
    );
    let origin = common::json(&at("second"), "resumed.json");
    assert_eq!(origin["wider_limits"], reason);
    let page = std::fs::read_to_string(at("second/report.html")).unwrap();
    assert!(page.contains(reason));
    let resolved = std::fs::read_to_string(at("second/resolved.toml")).unwrap();
    assert!(
        resolved.contains("1e5") || resolved.contains("100000"),
        "{resolved}"
    );
    // The response is that of a test whose limits were wide from the beginning.
    let of_steps = |run: &str| {
        let states = column(&at(run), "state");
        let rows = states.iter().zip(column(&at(run), "x1"));
        let rows = rows.filter(|(state, _)| **state == 3.0);
        rows.map(|(_, x)| x).collect::<Vec<f64>>()
    };
    let (whole, second) = (of_steps("whole"), of_steps("second"));
    assert!(
        whole.ends_with(&second) && second.len() > 100,
        "{}",
        second.len()
    );
    let found = replay(&at("second")).unwrap();
    assert!(found.is_exact(), "{found:?}");
}

#[test]
fn later_resumes_know_wider_limits() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    tripped_in(home.path(), &at("first"));
    let resumes = |from: &str, to: &str, level: &str, reason: &str| {
        let set = format!("specimen.0.limits.measured_force_n.trip=[-{level}, {level}]");
        let mut more = vec!["--after-trip"];
        if !reason.is_empty() {
            more.extend(["--set", &set, "--reason", reason]);
        }
        let said = go_on_with(&at(from), &at(to), &more);
        assert!(at(to).join("summary.json").exists(), "{}", said.stderr);
        let summary = common::json(&at(to), "summary.json");
        let origin = common::json(&at(to), "resumed.json");
        let reasons = summary["accepted"]["wider_limits"].clone();
        assert_eq!(origin["wider_limits"], reasons);
        let found = replay(&at(to)).unwrap();
        assert!(found.is_exact() && found.summary.is_empty(), "{found:?}");
        (said.code, reasons)
    };
    let (code, reasons) = resumes("first", "second", "1300", "yields later");
    assert_ne!(code, Some(0), "it trips once more");
    assert_eq!(reasons, "yields later");
    let (_, reasons) = resumes("second", "third", "", "");
    assert_eq!(reasons, "yields later");
    let (code, reasons) = resumes("third", "fourth", "1e5", "is stronger");
    assert_eq!(code, Some(0));
    assert_eq!(reasons, "yields later; is stronger");
}

#[test]
fn resume_refuses_a_command_beyond_a_limit() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let text = limited("command_disp_m = { trip = [-3e-3, 3e-3] }");
    let said = common::run(&test_in(home.path(), &text), &at("first"), &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    let tripped = Run::open(&at("first")).unwrap().events().unwrap().to_json();
    let trip = tripped
        .iter()
        .find(|event| event["event"] == "limit_trip")
        .unwrap();
    let value = trip["value"].as_f64().unwrap();
    assert!(value.abs() > 3e-3, "{trip}");
    let set = |level: f64| format!("specimen.0.limits.command_disp_m.trip=[-{level}, {level}]");
    let just = set(0.5 * (3e-3 + value.abs()));
    for more in [
        vec!["--after-trip"],
        vec!["--after-trip", "--set", &just, "--reason", "wider"],
    ] {
        let said = go_on_with(&at("first"), &at("refused"), &more);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        assert!(said.stderr.contains("command_disp_m"), "{}", said.stderr);
        let number = format!("{:.3}", 1e3 * value.abs());
        assert!(
            said.stderr.contains(&number[..4]),
            "{number}: {}",
            said.stderr
        );
        assert!(!at("refused").exists());
    }
    let enough = set(1.0);
    let more = ["--after-trip", "--set", &enough, "--reason", "wider"];
    let said = go_on_with(&at("first"), &at("second"), &more);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
}

/// The texts of a run folder decide nothing: a program that reads other texts checks and resumes it alike.
#[test]
fn reworded_run_is_resumed_alike() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name).to_str().unwrap().to_owned();
    tripped_in(home.path(), &home.path().join("first"));
    let reworded = |args: &[&str]| -> common::Said {
        let mut command = common::gusset();
        command.env("GUSSET_REWORD", "1").args(args);
        command.output().unwrap().into()
    };
    let (first, refused, second) = (at("first"), at("refused"), at("second"));
    let wider = "specimen.0.limits.measured_force_n.trip=[-1e5, 1e5]";
    let resumed = ["run", "--resume", &first, "--out"];
    let allowed = ["--after-trip", "--set", wider, "--reason", "yields later"];
    for (args, code) in [
        (vec!["replay", &first], 0),
        (vec!["report", &first], 0),
        ([&resumed[..], &[&refused]].concat(), 2),
        ([&resumed[..], &[&second], &allowed].concat(), 0),
        (vec!["replay", &second], 0),
    ] {
        let said = reworded(&args);
        assert_eq!(said.code, Some(code), "{args:?}: {}", said.stderr);
        // The resume reports how the test ended.
        assert_eq!(said.stderr.contains("reworded"), args.contains(&"--resume"));
    }
    // The cause decides, in any wording.
    let mut summary = common::json(home.path().join("first").as_path(), "summary.json");
    assert_eq!(summary["cause"], "measured_force_n");
    summary["cause"] = "command_disp_m".into();
    std::fs::write(home.path().join("first/summary.json"), summary.to_string()).unwrap();
    assert_eq!(reworded(&["replay", &first]).code, Some(1));
}
