//! The binary against simulated devices behind a pair of network interfaces.

use std::path::Path;
use std::process::Output;

use super::common::{gusset, json};

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Runs a command beside the simulated devices of a test; none if this kernel gives no network namespace.
fn beside_devices(test: &Path, command: &[&str]) -> Option<Output> {
    let folder = test.parent().unwrap();
    let mut simulate = gusset();
    simulate.args(["bus", "simulate", path(test)]);
    let faults = folder.join("faults.toml");
    if faults.exists() {
        simulate.args(["--faults", path(&faults)]);
    }
    simulate
        .args(["--pair", "--"])
        .args(command)
        .env("GUSSET_STATE", folder.join("state"));
    let said = simulate.output().unwrap();
    let is_refused = String::from_utf8_lossy(&said.stderr).contains("unshare: ");
    (!is_refused).then_some(said)
}

#[test]
fn a_gateway_holds_a_drive_from_client_to_client() {
    const HEAD: &str = r#"
title = "served"
[serve]
listen = "127.0.0.1:4823"
[serve.pace]
rate_hz = 200
ticks_per_step = 40
"#;
    const CLIENT: &str = r#"
title = "client"
[time]
rate_hz = 4
duration_s = 1
clock = "real"
[structure.shear_building]
mass_kg = [2000e3, 18e3]
stiffness_n_per_m = [0, 120e6]
[structure.damping.rayleigh_ratio]
ratio = 0.02
modes = [1, 2]
[excitation.ground_acceleration]
signal.sine = { amplitude = 0.03, frequency_hz = 1.0, duration_s = 0.5 }
[[specimen]]
name = "storey"
storey = 1
stiffness_n_per_m = 10e6
[specimen.limits]
command_disp_m = { trip = [-0.05, 0.05] }
measured_force_n = { trip = [-100e3, 100e3] }
[specimen.link]
address = "127.0.0.1:4823"
coupling = "lockstep"
connect_timeout_s = 60
reply_timeout_s = 60
probe = "none"
"#;
    // Both clients, then the end of the gateway.
    const SCRIPT: &str = r#"
"$0" serve served.toml --out served & served=$!
trap 'kill -TERM $served' EXIT
"$0" run client.toml --yes --out first || exit 9
"$0" run client.toml --yes --out second
kill -INT $served
wait $served
test $? = 130 && trap - EXIT
"#;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let devices = super::text(super::DRIVE, "")
        .replace("rate_hz = 500", "rate_hz = 200")
        .replace(
            "[bus.rig]",
            "[bus.rig]\nwatchdog_s = 6\nstale_ticks = 500\nclock = \"free\"",
        );
    let (_, rest) = devices.split_once("[bus.rig]").unwrap();
    let (bus, specimen) = rest.split_once("storey = 1\n").unwrap();
    let (stiffness, rest) = specimen.split_once("[specimen.law.bilinear]").unwrap();
    let (_, limits) = rest.split_once("[specimen.limits]").unwrap();
    let served = format!("{HEAD}[bus.rig]{bus}{stiffness}[specimen.limits]{limits}");
    for (name, text) in [
        ("test.toml", devices.as_str()),
        ("served.toml", &served),
        ("client.toml", CLIENT),
    ] {
        std::fs::write(at(name), text).unwrap();
    }
    let script = format!("cd {}; {SCRIPT}", path(folder.path()));
    let binary = gusset();
    let program = binary.get_program().to_str().unwrap();
    let Some(said) = beside_devices(&at("test.toml"), &["sh", "-c", &script, program]) else {
        return;
    };
    let errors = String::from_utf8_lossy(&said.stderr);
    assert_eq!(said.status.code(), Some(0), "{errors}");
    let first = json(&at("first"), "summary.json");
    assert_eq!(first["cause"], "done", "{errors}");
    // The drive still stands where the first test left it: the second one, which begins at 0, is refused.
    let second = json(&at("second"), "summary.json");
    assert_ne!(second["cause"], "done");
    let session = json(&at("served"), "test-0001/summary.json");
    assert_eq!(session["cause"], "done");
    assert_eq!(session["peak"]["force"], first["peak"]["force"]);
}

#[test]
fn a_test_runs_over_a_pair_of_interfaces() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("test.toml"), patient()).unwrap();
    let Some(said) = beside_devices(
        &at("test.toml"),
        &[
            "gusset",
            "run",
            path(&at("test.toml")),
            "--out",
            path(&at("run")),
        ],
    ) else {
        return;
    };
    let errors = String::from_utf8_lossy(&said.stderr);
    assert_eq!(said.status.code(), Some(0), "{errors}");
    let summary = json(&at("run"), "summary.json");
    let link = &summary["link"]["storey"];
    assert!(link["received"].as_u64().unwrap() >= 200, "{link}");
}

/// A test on outputs of ±10 V, in real time, for the busy machine of a suite: twice as long per tick, and patient.
fn patient() -> String {
    super::text(super::OUTPUT, "stands_at_m = [0.0]")
        .replace("clock = \"simulated\"", "clock = \"real\"")
        .replace("rate_hz = 500", "rate_hz = 200")
        .replace("[bus.rig]", "[bus.rig]\nwatchdog_s = 6\nstale_ticks = 500")
}

/// The devices do not say that they are simulated, so the outputs stay until an operator says that the axis is unloaded.
#[test]
fn real_devices_are_held_until_the_operator_confirms() {
    // Before the end of the test, `continue` only looks.
    const SCRIPT: &str = r#"
"$0" run test.toml --yes --out run & run=$!
trap 'kill -KILL $run' EXIT
for i in $(seq 1000); do
    sleep 0.3
    "$0" continue run
    [ -f run/summary.json ] && break
done
[ -f run/summary.json ] || exit 9
wait $run
test $? = 0 && trap - EXIT
"#;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("test.toml"), patient()).unwrap();
    std::fs::write(at("faults.toml"), "[[fault]]\nwhat = \"unmarked\"\n").unwrap();
    let script = format!("cd {}; {SCRIPT}", path(folder.path()));
    let binary = gusset();
    let program = binary.get_program().to_str().unwrap();
    let Some(said) = beside_devices(&at("test.toml"), &["sh", "-c", &script, program]) else {
        return;
    };
    let errors = String::from_utf8_lossy(&said.stderr);
    assert_eq!(said.status.code(), Some(0), "{errors}");
    let summary = json(&at("run"), "summary.json");
    assert_eq!(summary["cause"], "done", "{errors}");
}

#[test]
fn a_missing_interface_is_named() {
    let said = gusset()
        .args(["bus", "scan", "gusset-none"])
        .output()
        .unwrap();
    assert_eq!(said.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&said.stderr).contains("gusset-none"));
}

#[test]
fn the_study_runs_on_simulated_devices() {
    let folder = tempfile::tempdir().unwrap();
    let study = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/config/bus/drive-and-servo.toml"
    );
    let out = folder.path().join("run");
    super::common::completed(study.as_ref(), &out, &["--clock", "simulated"]);
    let summary = json(&out, "summary.json");
    for name in ["lower-storey", "upper-storey"] {
        assert_eq!(summary["link"][name]["lost"], 0);
    }
    // A count of the drive is 0.1 µm.
    let run = gusset_record::Run::open(&out).unwrap();
    let columns = run.columns(&["cmd_1_1", "raw_disp_1_1"]).unwrap();
    let each = columns[0].iter().zip(&columns[1]);
    let worst = each
        .map(|(command, disp)| (command - disp).abs())
        .fold(0.0, f64::max);
    assert!(worst < 5e-4, "{worst}");
}
