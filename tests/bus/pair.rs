//! The binary against simulated devices behind a pair of network interfaces.

use super::common::gusset;

#[test]
fn a_test_runs_over_a_pair_of_interfaces() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = super::text(super::OUTPUT, "stands_at_m = [0.0]");
    // Twice as long per tick, and patient: the machine of a suite is busy.
    let text = text
        .replace("clock = \"simulated\"", "clock = \"real\"")
        .replace("rate_hz = 500", "rate_hz = 200")
        .replace("[bus.rig]", "[bus.rig]\nwatchdog_s = 6\nstale_ticks = 500");
    std::fs::write(at("test.toml"), text).unwrap();
    let mut command = gusset();
    let run = ["--pair", "--", "gusset", "run"];
    command
        .args(["bus", "simulate"])
        .arg(at("test.toml"))
        .args(run);
    command.arg(at("test.toml")).arg("--out").arg(at("run"));
    let said = command.output().unwrap();
    let errors = String::from_utf8_lossy(&said.stderr);
    if errors.contains("unshare: ") {
        let skipped = "SKIPPED: this kernel gives no network namespace";
        assert!(
            std::env::var_os("CI").is_none() || !errors.is_empty(),
            "{skipped}"
        );
        return;
    }
    assert_eq!(said.status.code(), Some(0), "{errors}");
    let summary = super::common::json(&at("run"), "summary.json");
    let link = &summary["link"]["storey"];
    assert!(link["received"].as_u64().unwrap() >= 200, "{link}");
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
    let summary = super::common::json(&out, "summary.json");
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
