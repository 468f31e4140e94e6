//! One verdict: `check` prints it, and `run` obeys it before anything connects.

use std::net::TcpListener;
use std::path::Path;

use assert_cmd::Command;
use gusset_config as config;
use gusset_session::Judged;
use gusset_setup as setup;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::test_file::TestFile;

/// Five storeys; the critical delay of the first one is 4.1103 ms.
const FRAME: &str = r#"title = "Five storeys"
[time]
rate_hz = 1024
duration_s = 8
[structure.shear_building]
mass_kg = [1000, 1000, 1000, 1000, 1000]
stiffness_n_per_m = [0, 1.5e6, 1.5e6, 1.5e6, 1.5e6]
[structure.damping.rayleigh_ratio]
ratio = 0.02
modes = [1, 2]
[excitation.ground_acceleration.signal.sweep]
amplitude = 1.0
from_hz = 0.4
to_hz = 4
duration_s = 4
kind = "linear"
"#;
const SPECIMEN: &str = "\n[[specimen]]\nname = \"first\"\nstorey = 1\nstiffness_n_per_m = 1.5e6\n";
const LAW: &str = "law.linear = { stiffness_n_per_m = 1.5e6 }\n";
const LIMITS: &str = "[specimen.limits]\ncommand_disp_m = { trip = [-0.1, 0.1] }\n\
                      measured_force_n = { trip = [-300e3, 300e3] }\n";
/// Critical delay of the first storey, s.
const CRITICAL_S: f64 = 4.110_315e-3;

fn lag(table: &str, seconds: f64) -> String {
    format!("[specimen.{table}.actuator.first_order]\ntime_constant_s = {seconds}\n")
}

fn linked(port: u16, lag_s: f64) -> String {
    format!(
        "{FRAME}{SPECIMEN}[specimen.link]\naddress = \"127.0.0.1:{port}\"\nconnect_timeout_s = 0.5\n{LIMITS}{}",
        lag("transfer", lag_s)
    )
}

fn simulated(lag_s: f64) -> String {
    let text = format!("{FRAME}{SPECIMEN}{LAW}{}", lag("transfer", lag_s));
    text.with("time.clock = 'simulated'")
}

/// Exit code, standard output as JSON, and messages of a command.
pub struct Said {
    pub code: i32,
    pub json: Value,
    pub stderr: String,
}

/// `gusset COMMAND --json` on a test file of this text in `folder`.
pub fn gusset(folder: &Path, command: &str, text: &str, more: &[&str]) -> Said {
    let file = folder.join("test.toml");
    std::fs::write(&file, text).unwrap();
    let mut process = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    process.env("GUSSET_STATE", folder.join("state"));
    process.arg(command).arg(&file).arg("--json").args(more);
    if command == "run" {
        process.arg("--out").arg(folder.join("out"));
    }
    let output = process.output().unwrap();
    Said {
        code: output.status.code().unwrap(),
        json: serde_json::from_slice(&output.stdout).unwrap_or(Value::Null),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

fn kinds(verdict: &Value) -> Vec<(String, String, String)> {
    let text = |one: &Value, key: &str| one[key].as_str().unwrap().to_owned();
    let findings = verdict["findings"].as_array().unwrap();
    let each = findings
        .iter()
        .map(|one| (text(one, "kind"), text(one, "severity"), text(one, "key")));
    each.collect()
}

fn is(kind: &str, severity: &str, key: &str) -> (String, String, String) {
    (kind.to_owned(), severity.to_owned(), key.to_owned())
}

#[test]
fn late_linked_actuator_is_refused_early() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let port = listener.local_addr().unwrap().port();
    let folder = TempDir::new().unwrap();
    let run = gusset(folder.path(), "run", &linked(port, 0.015), &[]);
    assert_eq!(run.code, 2, "{}", run.stderr);
    assert!(run.stderr.contains("[specimen.compensation]"));
    assert!(run.stderr.contains("accept_unstable"));
    assert!(listener.accept().is_err(), "it connected");
    assert!(!folder.path().join("out").exists());
    let check = gusset(folder.path(), "check", &linked(port, 0.015), &[]);
    assert_eq!(check.code, 1);
    let verdict = &check.json["verdict"];
    assert_eq!(verdict["outcome"], "refused");
    let found = kinds(verdict);
    assert_eq!(found[0], is("unstable", "error", "specimen[0].transfer"));
    let trips = is("rehearsal", "error", "specimen[0].limits.command_disp_m");
    assert!(found.contains(&trips), "{found:?}");
    let numbers = &verdict["findings"][0]["numbers"];
    let critical = numbers["critical_delay_s"].as_f64().unwrap();
    assert!((critical / CRITICAL_S - 1.0).abs() < 1e-6);
}

#[test]
fn accepted_findings_are_in_the_summary() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let accepted =
        "[safety]\naccept_unstable = \"a study of growth\"\naccept_trip = \"it will trip\"\n";
    let text = format!("{}{accepted}", linked(port, 0.015));
    let folder = TempDir::new().unwrap();
    let check = gusset(folder.path(), "check", &text, &[]);
    assert_eq!(check.code, 0, "{}", check.stderr);
    assert_eq!(check.json["verdict"]["outcome"], "accepted");
    assert_eq!(check.json["verdict"]["unstable"], true);
    // The specimen does not reply: the test connected, and the link failed.
    let run = gusset(folder.path(), "run", &text, &[]);
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert_eq!(run.json["accepted"]["accept_unstable"], "a study of growth");
    assert_eq!(run.json["accepted"]["accept_trip"], "it will trip");
    assert_eq!(run.json["verdict"]["outcome"], "accepted");
    // Either reason alone is not enough.
    let one = text.without("safety.accept_trip");
    assert_eq!(gusset(folder.path(), "check", &one, &[]).code, 1);
    for blank in ["  ", "\u{200b}", "\u{2060} ", "\u{fe0f}"] {
        let text = text.with(&format!("safety.accept_unstable = \"{blank}\""));
        let refused = gusset(folder.path(), "check", &text, &[]);
        assert_eq!(refused.code, 2, "{blank:?}");
        assert!(refused.stderr.contains("safety.accept_unstable"));
    }
}

#[test]
fn simulated_unstable_test_runs_and_reports() {
    let folder = TempDir::new().unwrap();
    assert_eq!(
        gusset(folder.path(), "check", &simulated(0.015), &[]).code,
        1
    );
    let run = gusset(folder.path(), "run", &simulated(0.015), &[]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert_eq!(run.json["verdict"]["outcome"], "simulated");
    assert_eq!(run.json["verdict"]["unstable"], true);
    assert_eq!(run.json["accepted"], serde_json::json!({}));
    assert!(run.stderr.contains("warning") && run.stderr.contains("unstable"));
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("UNSTABLE"));
    // A stable test has no such finding.
    let other = TempDir::new().unwrap();
    let run = gusset(other.path(), "run", &simulated(0.001), &[]);
    assert_eq!(run.json["verdict"]["outcome"], "clear");
    let page = std::fs::read_to_string(other.path().join("out/report.html")).unwrap();
    assert!(!page.contains("UNSTABLE"));
}

#[test]
fn exit_code_agrees_near_the_critical_delay() {
    let folder = TempDir::new().unwrap();
    for (share, stable) in [
        (0.9, true),
        (0.99, true),
        (1.01, false),
        (1.02, false),
        (1.05, false),
        (1.1, false),
        (1.25, false),
    ] {
        let delay = format!("[specimen.transfer]\ndelay_s = {}\n", share * CRITICAL_S);
        let text = format!("{FRAME}{SPECIMEN}{LAW}{delay}");
        let found = gusset(folder.path(), "check", &text, &["--no-rehearsal"]);
        let following = &found.json["following"][0];
        let roots = following["unstable_roots"].as_u64().unwrap();
        let agreed = (roots == 0, following["possible"] == true, found.code == 0);
        assert_eq!(agreed, (stable, stable, stable), "{share}: {roots} roots");
        assert_eq!(found.json["valid"], stable);
    }
}

#[test]
fn adaptive_compensation_is_a_warning() {
    let folder = TempDir::new().unwrap();
    let ats = "[specimen.compensation.ats]\ndelay_s = 0.015\n";
    let text = format!("{}{ats}", simulated(0.015));
    let check = gusset(folder.path(), "check", &text, &["--no-rehearsal"]);
    assert_eq!(check.code, 0, "{}", check.stderr);
    let found = kinds(&check.json["verdict"]);
    assert_eq!(
        found,
        [is("unknown", "warning", "specimen[0].compensation")]
    );
}

#[test]
fn rehearsed_trip_is_refused_behind_a_link() {
    let folder = TempDir::new().unwrap();
    let narrow = linked(1, 0.001).with("specimen.limits.command_disp_m.trip = [-0.0005, 0.0005]");
    // A level of the axis does not hide the level of the specimen, which trips.
    let merged = narrow.with("[[specimen.axis]]\nlimits.command_disp_m.warn = [-0.0001, 0.0001]\n");
    let check = gusset(folder.path(), "check", &merged, &[]);
    let found = kinds(&check.json["verdict"]);
    let expected = is("rehearsal", "error", "specimen[0].limits.command_disp_m");
    assert_eq!(found[0], expected, "{}", check.stderr);
    let run = gusset(folder.path(), "run", &narrow, &[]);
    assert_eq!(run.code, 2, "{}", run.stderr);
    let check = gusset(folder.path(), "check", &narrow, &[]);
    assert_eq!(check.code, 1);
    let found = kinds(&check.json["verdict"]);
    assert_eq!(
        found[0],
        is("rehearsal", "error", "specimen[0].limits.command_disp_m")
    );
    let numbers = &check.json["verdict"]["findings"][0]["numbers"];
    assert_eq!(numbers["limit"].as_f64().unwrap().abs(), 0.0005);
    // On the simulated clock nothing moves that can break: it runs, and trips.
    let computed = narrow.with("specimen.link.computed = true\ntime.clock = 'simulated'");
    let check = gusset(folder.path(), "check", &computed, &[]);
    assert_eq!(
        (check.code, &check.json["verdict"]["outcome"]),
        (1, &"simulated".into())
    );
}

#[test]
fn linked_machine_with_unknown_delay_warns() {
    let folder = TempDir::new().unwrap();
    let text = linked(1, 0.001);
    let unknown = text.split("[specimen.transfer").next().unwrap();
    let check = gusset(folder.path(), "check", unknown, &[]);
    assert_eq!(check.code, 0, "{}", check.stderr);
    let found = kinds(&check.json["verdict"]);
    // The stability, and the error of the coupling.
    let places = ["specimen[0].link", "specimen[0]"];
    assert_eq!(found, places.map(|place| is("unknown", "warning", place)));
}

#[test]
fn two_stable_actuators_unstable_together() {
    let both = |lag_s: f64| {
        let specimen = |name: &str, storey: u32| {
            format!(
                "[[specimen]]\nname = \"{name}\"\nstorey = {storey}\nstiffness_n_per_m = 1.5e6\n\
                 [specimen.link]\naddress = \"127.0.0.1:{storey}\"\n{LIMITS}{}",
                lag("transfer", lag_s)
            )
        };
        let text = format!("{FRAME}{}{}", specimen("a", 1), specimen("b", 2));
        text.with(
            "structure.shear_building = { mass_kg = [1000, 1000], stiffness_n_per_m = [0, 0] }",
        )
    };
    let folder = TempDir::new().unwrap();
    let check = |lag_s: f64| gusset(folder.path(), "check", &both(lag_s), &["--no-rehearsal"]);
    let found = check(8.5e-4);
    let each = found.json["following"].as_array().unwrap();
    assert!(
        each.iter().all(|one| one["unstable_roots"] == 0),
        "{each:?}"
    );
    assert_eq!(found.code, 1, "{}", found.stderr);
    assert_eq!(found.json["verdict"]["unstable"], true);
    let unstable = is("unstable", "error", "specimen[0].transfer");
    assert_eq!(kinds(&found.json["verdict"]), [unstable]);
    let run = gusset(folder.path(), "run", &both(8.5e-4), &[]);
    assert_eq!(run.code, 2, "{}", run.stderr);
    let found = check(1e-4);
    assert_eq!((found.code, kinds(&found.json["verdict"])), (0, Vec::new()));
}

/// The divergence bound of a test that is judged, in its loop and in its resolved file.
fn divergence(text: &str) -> (f64, f64, f64) {
    let loaded = config::parse(Path::new("test.toml"), text.to_owned(), &[]).unwrap();
    let judged = Judged::of(setup::build(&loaded).unwrap()).unwrap();
    let resolved: toml::Value = toml::from_str(&judged.test.files.resolved).unwrap();
    let written = resolved["safety"]["divergence_m"].as_float().unwrap();
    let peak = judged
        .rehearsed
        .map_or(0.0, |full| full.rehearsal.peak_disp);
    (judged.test.experiment.limits.divergence, written, peak)
}

#[test]
fn divergence_follows_from_the_rehearsal() {
    let (bound, written, peak) = divergence(&linked(1, 0.001));
    assert!(peak > 0.001, "{peak}");
    assert_eq!((bound, written), ((10.0 * peak).max(0.1), bound));
    let weak =
        linked(1, 0.001).with("excitation.ground_acceleration.signal.sweep.amplitude = 0.01");
    assert_eq!(divergence(&weak).0, 0.1);
    let given = linked(1, 0.001).with("safety.divergence_m = 0.7");
    assert_eq!(divergence(&given).0, 0.7);
    assert_eq!(divergence(&simulated(0.001)).0, 1000.0);
    assert_eq!(divergence(&simulated(0.001)).1, 1000.0);
    // An older resolved file has none, and meant 1 km.
    let older = config::parse(Path::new("resolved.toml"), linked(1, 0.001), &[]).unwrap();
    assert_eq!(older.file.safety.divergence_m, Some(1000.0));
    // An unstable loop has no meaningful peak.
    assert_eq!(divergence(&linked(1, 0.015)).0, 1000.0);
}

#[test]
fn diverging_row_is_recorded_with_its_key() {
    let folder = TempDir::new().unwrap();
    let text = format!("{}[safety]\ndivergence_m = 0.05\n", simulated(0.015));
    let run = gusset(folder.path(), "run", &text, &[]);
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert!(
        run.json["reason"]
            .as_str()
            .unwrap()
            .contains("`safety.divergence_m`")
    );
    let peak = run.json["peak"]["displacement"].as_array().unwrap();
    let peak = peak.iter().filter_map(Value::as_f64).fold(0.0, f64::max);
    assert!(peak > 0.05, "{peak}");
    let out = folder.path().join("out");
    let csv = folder.path().join("rows.csv");
    let mut export = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    export
        .arg("export")
        .arg(&out)
        .args(["--format", "csv", "--rate", "tick", "--out"]);
    assert!(export.arg(&csv).output().unwrap().status.success());
    let text = std::fs::read_to_string(csv).unwrap();
    let last = text.lines().last().unwrap();
    let largest = last
        .split(',')
        .skip(1)
        .take(5)
        .map(|cell| cell.parse().unwrap_or(0.0_f64).abs());
    assert_eq!(largest.fold(0.0, f64::max), peak);
    let mut replay = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    assert!(
        replay
            .arg("replay")
            .arg(&out)
            .output()
            .unwrap()
            .status
            .success()
    );
}

#[test]
fn implausible_structures_are_warned_about() {
    let folder = TempDir::new().unwrap();
    let doubled = simulated(0.001)
        .with("structure.shear_building.stiffness_n_per_m = [1e6, 1.5e6, 1.5e6, 1.5e6, 1.5e6]");
    let check = gusset(folder.path(), "check", &doubled, &["--no-rehearsal"]);
    assert_eq!(check.code, 0);
    assert!(check.stderr.contains("specimen.storey") || check.stderr.contains("storey = 1"));
    assert_eq!(check.json["warnings"].as_array().unwrap().len(), 1);
    let tonnes = simulated(0.0).without("specimen.0.transfer").with(
        "specimen = { stiffness_n_per_m = 1.5e9, law.linear.stiffness_n_per_m = 1.5e9 }\n[structure.shear_building]\n\
         mass_kg = [1, 1, 1, 1, 1]\nstiffness_n_per_m = [0, 1.5e9, 1.5e9, 1.5e9, 1.5e9]\n",
    );
    let check = gusset(folder.path(), "check", &tonnes, &["--no-rehearsal"]);
    assert!(check.stderr.contains("first period"), "{}", check.stderr);
    let check = gusset(
        folder.path(),
        "check",
        &simulated(0.001),
        &["--no-rehearsal"],
    );
    assert_eq!(check.json["warnings"], serde_json::json!([]));
}

/// A specimen that reports its own command seems to follow perfectly: its link cannot show the delay.
#[test]
fn force_only_link_needs_no_identification() {
    let folder = TempDir::new().unwrap();
    let text = |link: &str| {
        format!("{FRAME}{SPECIMEN}[specimen.link]\naddress = \"127.0.0.1:1\"\n{link}{LIMITS}")
    };
    let element = "protocol = \"openfresco\"\nstands_at_m = [0]\n";
    let laboratory = "as the laboratory measured it";
    for (link, points) in [(element, true), ("", false)] {
        let check = gusset(folder.path(), "check", &text(link), &["--no-rehearsal"]);
        let said = &check.stderr;
        assert!(said.contains("[specimen.identified]"), "{said}");
        assert_eq!(said.contains(laboratory), points, "{said}");
        assert_eq!(said.contains("identify` measures"), !points, "{said}");
    }
}

#[test]
fn gateway_obeys_the_verdict_of_a_test_file() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let port = listener.local_addr().unwrap().port();
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("test.toml");
    std::fs::write(&file, linked(port, 0.015)).unwrap();
    let mut serve = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    serve.env("GUSSET_STATE", folder.path().join("state"));
    serve.arg("serve").arg(&file);
    serve.args(["--listen", "127.0.0.1:0"]);
    serve.timeout(std::time::Duration::from_secs(120));
    let output = serve.output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("accept_unstable"), "{stderr}");
    assert!(output.stdout.is_empty(), "it listened");
    assert!(listener.accept().is_err(), "it connected");
}

/// A damper behind a link under a mass on a spring; `keys` end its table.
fn damper(scale: f64, keys: &str) -> String {
    format!(
        "title = \"damper\"\n[time]\nrate_hz = 200\nduration_s = 5\nscale = {scale}\n\
         [structure.matrices]\nmass = [[40e3]]\nstiffness = [[5e6]]\ndamping = [[8e3]]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 1.0\nfrequency_hz = 1.3\n\
         [[specimen]]\nname = \"damper\"\nrows = [[1]]\nstiffness_n_per_m = 0\n{keys}\n{LIMITS}\
         [specimen.link]\naddress = \"127.0.0.1:1\"\ncomputed = true\nconnect_timeout_s = 0.5\n"
    )
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn damper_at_another_speed_is_refused() {
    const DAMPING: &str = "damping_n_s_per_m = 6e4";
    let folder = TempDir::new().unwrap();
    let slow = damper(10.0, DAMPING);
    let check = gusset(folder.path(), "check", &slow, &[]);
    assert_eq!(check.code, 1, "{}", check.stderr);
    let verdict = &check.json["verdict"];
    assert_eq!(verdict["outcome"], "refused");
    let places = [("speed", "time.scale"), ("error", "specimen[0]")];
    let found = |severity: &str| places.map(|(kind, place)| is(kind, severity, place));
    assert_eq!(kinds(verdict), found("error"));
    let numbers = &verdict["findings"][0]["numbers"];
    assert_eq!(numbers["speed_ratio"], 0.1);
    assert_eq!(numbers["consistent_scale"], 1.0);
    // A damper alone: c times the largest velocity, at both speeds.
    let speeds = &check.json["rehearsal"]["speeds"][0];
    for place in ["laboratory", "test"] {
        let peak = &speeds[place][0];
        let (force, vel) = (number(&peak["force_n"]), number(&peak["velocity_m_per_s"]));
        assert!((force / (6e4 * vel) - 1.0).abs() < 1e-6, "{place}: {peak}");
    }
    // The structure is 5 times less damped by the specimen, but its velocity is a tenth.
    let force = |place: &str| number(&speeds[place][0]["force_n"]);
    let share = force("laboratory") / force("test");
    assert!((0.1..0.2).contains(&share), "{share}");
    let run = gusset(folder.path(), "run", &slow, &[]);
    assert_eq!(run.code, 2, "{}", run.stderr);
    assert!(run.stderr.contains("accept_speed"));

    let accepted = format!("{slow}[safety]\naccept_speed = \"its force is small\"\n");
    let check = gusset(folder.path(), "check", &accepted, &[]);
    // The error that follows needs its own reason.
    assert_eq!(check.code, 1);
    let accepted = format!("{accepted}accept_error = \"its force is small\"\n");
    let check = gusset(folder.path(), "check", &accepted, &[]);
    assert_eq!(check.code, 0);
    assert_eq!(kinds(&check.json["verdict"]), found("accepted"));
}

#[test]
fn specimens_with_the_right_speed_are_clear() {
    let folder = TempDir::new().unwrap();
    let outcome = |text: &str| {
        let check = gusset(folder.path(), "check", text, &[]);
        assert_eq!(check.json["rehearsal"]["speeds"], serde_json::json!([]));
        kinds(&check.json["verdict"])
    };
    let damped = "damping_n_s_per_m = 6e4";
    assert_eq!(outcome(&damper(1.0, damped)), []);
    let similar = format!("{damped}\nsimilitude.time = 0.1");
    assert_eq!(outcome(&damper(10.0, &similar)), []);
    // Without a stand-in, no error is known.
    let unknown = ["integrator", "specimen[0]"].map(|place| is("unknown", "warning", place));
    assert_eq!(outcome(&damper(10.0, "")), unknown);
    let elastic =
        "law.bilinear = { stiffness_n_per_m = 1e6, yield_force_n = 1e4, post_yield_ratio = 0.1 }";
    assert_eq!(outcome(&damper(10.0, elastic)), []);
    // A law alone counts, and so does a damper that is only faster than meant.
    let law = "law.smooth_friction = { slip_force_n = 1e3, reference_velocity_m_per_s = 0.01 }";
    for (scale, keys) in [(10.0, law), (0.5, damped)] {
        let check = gusset(
            folder.path(),
            "check",
            &damper(scale, keys),
            &["--no-rehearsal"],
        );
        assert_eq!(
            kinds(&check.json["verdict"]),
            [is("speed", "error", "time.scale")]
        );
    }
}

/// A file whose masses are in t, one stiffness in kN/mm, and the record in a unit other than declared.
#[test]
fn numbers_in_another_unit_are_findings() {
    let folder = TempDir::new().unwrap();
    let values: String = (0..400)
        .map(|k| format!("{}\n", 3.2 * libm::sin(0.11 * f64::from(k))))
        .collect();
    std::fs::write(folder.path().join("motion.txt"), values).unwrap();
    let text = "[time]\nrate_hz = 1024\nduration_s = 20\nclock = \"simulated\"\n\
                [structure.shear_building]\nmass_kg = [30, 30, 30, 25]\n\
                stiffness_n_per_m = [0, 35e6, 30e6, 25e6]\n\
                [excitation.ground_acceleration]\n\
                signal.file = { path = \"motion.txt\", dt_s = 0.02, unit = \"g\" }\n\
                processing = { zero_tail = true }\n\
                [[specimen]]\nname = \"storey1\"\nstorey = 1\n\
                law.bilinear = { stiffness_n_per_m = 40, yield_force_n = 320e3, post_yield_ratio = 0.05 }\n";
    let check = gusset(folder.path(), "check", text, &[]);
    assert_eq!(check.code, 0, "{}", check.stderr);
    let verdict = &check.json["verdict"];
    let drift = is("units", "warning", "structure.shear_building");
    let findings = verdict["findings"].as_array().unwrap();
    assert_eq!(
        kinds(verdict).iter().filter(|one| one.0 == "units").count(),
        4
    );
    let of = |key: &str| {
        let mut found = findings.iter();
        found.find_map(|one| one["numbers"][key].as_f64()).unwrap()
    };
    // sqrt(115 kg / 40 N/m) · 2π, for the building above hardly bends.
    assert!((of("period_s") - 10.654).abs() < 0.01);
    assert_eq!(of("least_n_per_m"), 40.0);
    assert_eq!(of("most_n_per_m"), 35e6);
    assert!((of("peak_g") - 3.2).abs() < 0.01);
    assert!((of("peak_g_in_likely_unit") - 3.2 / 9.80665).abs() < 0.001);
    assert!(of("drift_m") > 1.0);
    assert!(kinds(verdict).contains(&drift) || check.stderr.contains("storey1"));

    let right = text.with(
        "structure.shear_building.mass_kg = [30e3, 30e3, 30e3, 25e3]\nspecimen.law.bilinear.stiffness_n_per_m = 40e6\n\
         excitation.ground_acceleration.signal.file.unit = 'm/s2'\n",
    );
    let check = gusset(folder.path(), "check", &right, &[]);
    assert_eq!(kinds(&check.json["verdict"]), []);
}
