//! The command end to end, on the simulated clock.

use crate::common::test_file::TestFile;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{Said, completed, gusset, json, names, say, write};
use crate::link_common::Served;

/// A frame whose bottom storey is a specimen behind an actuator and noisy sensors, with a compensator.
pub const TEST: &str = r#"title = "Frame"

[time]
rate_hz = 512
duration_s = 2
clock = "simulated"

[structure.shear_building]
mass_kg = [1000.0, 900.0]
stiffness_n_per_m = [0, 4e5]

[excitation.ground_acceleration.signal.sine]
amplitude = 1.0
frequency_hz = 2.0

[[specimen]]
name = "storey"
storey = 1
law.linear = { stiffness_n_per_m = 1.2e6, damping_n_s_per_m = 900.0 }

[specimen.limits]
command_disp_m = { trip = [-0.05, 0.05] }
command_vel_m_per_s = { trip = 0.4 }
lag_s = { trip = 0.004 }

[specimen.transfer]
seed = 7
actuator.first_order = { time_constant_s = 0.0123 }
disp_sensor = { noise_rms_m = 5e-6 }
force_sensor = { noise_rms_n = 20.0 }

[specimen.compensation.inverse]
delay_s = 0.0123
"#;

/// Short and quick.
pub const SHORT: [&str; 6] = [
    "--duration",
    "8",
    "--band",
    "0.5,15",
    "--amplitude",
    "0.002",
];

pub fn identify(test: &Path, out: &Path, more: &[&str]) -> Said {
    let mut command = gusset();
    command.arg("identify").arg(test).arg("--out").arg(out);
    command.arg("--json").args(more).output().unwrap().into()
}

/// It must succeed; its JSON.
pub fn identified(test: &Path, out: &Path, more: &[&str]) -> Value {
    let said = identify(test, out, more);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    serde_json::from_str(&said.stdout).unwrap()
}

/// Value and standard error of a parameter of the best model of an axis.
pub fn best(found: &Value, axis: usize, name: &str) -> (f64, f64) {
    let models = &found["axes"][axis]["identification"]["models"];
    let parameters = models[0]["parameters"].as_array().unwrap();
    let parameter = parameters.iter().find(|p| p["name"] == name);
    let parameter = parameter.unwrap_or_else(|| panic!("{name}: {models:#}"));
    (
        parameter["value"].as_f64().unwrap(),
        parameter["std"].as_f64().unwrap(),
    )
}

pub fn near(found: (f64, f64), truth: f64) {
    let (value, std) = found;
    assert!(
        std > 0.0 && (value - truth).abs() < 5.0 * std,
        "{value} ± {std}, wanted {truth}"
    );
}

pub fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_owned();
    (folder, path)
}

#[test]
fn findings_are_true_and_folder_is_a_run() {
    let (_keep, folder) = folder();
    let test = write(&folder, "test.toml", TEST);
    let out = folder.join("out");
    let found = identified(&test, &out, &SHORT);
    near(best(&found, 0, "time_constant_s"), 0.0123);
    near(best(&found, 0, "gain"), 1.0);
    let axis = &found["axes"][0];
    assert_eq!(axis["identification"]["models"][0]["model"], "first_order");
    let specimen = &axis["identification"]["specimen"];
    let pair = |key: &str| {
        let number = |of: &str| specimen[key][of].as_f64().unwrap();
        (number("value"), number("std"))
    };
    near(pair("stiffness"), 1.2e6);
    near(pair("damping"), 900.0);
    let noise = axis["identification"]["noise"]["disp_m"].as_f64().unwrap();
    assert!((noise / 5e-6 - 1.0).abs() < 0.12, "{noise}");
    assert_eq!(json(&out, "identification.json"), found);

    let inside = names(&out);
    for name in [
        "identified.toml",
        "report.html",
        "resolved.toml",
        "samples.bin",
        "summary.json",
    ] {
        assert!(inside.contains(&name.to_owned()), "{inside:?}");
    }
    let pictures = names(&out.join("identification"));
    let wanted = [
        "coherence-1-1.svg",
        "delay-1-1.svg",
        "gain-1-1.svg",
        "index.html",
        "loop-1-1.svg",
    ];
    assert_eq!(pictures, wanted);
    let summary = json(&out, "summary.json");
    assert_eq!(summary["status"], "completed");
    // Nothing is computed, but the specimen was tracked: a lag of T = 12.3 ms up to 1/(2πT) = 13 Hz and less beyond.
    let tracked = &summary["metrics"]["storey"][0];
    let lag = tracked["delay_s"]["value"].as_f64().unwrap();
    assert!(lag > 0.004 && lag < 0.0123 + 0.002, "{tracked}");
    assert!(
        tracked["slope"]["value"].as_f64().unwrap() < 1.0,
        "{tracked}"
    );
    for command in ["replay", "report"] {
        let said = say([command, out.to_str().unwrap()]);
        assert_eq!(said.code, Some(0), "{command}: {}", said.stderr);
    }
}

#[test]
fn twin_checks_runs_and_is_identified_alike() {
    let (_keep, folder) = folder();
    let test = write(&folder, "test.toml", TEST);
    let out = folder.join("out");
    let first = identified(&test, &out, &SHORT);
    let twin = out.join("identified.toml");
    let said = say(["check", twin.to_str().unwrap()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    completed(&twin, &folder.join("again"), &[]);
    // With the identified inverse the twin is where it should be: in the second half of the sweep, 7 to 15 Hz, a lag of
    // 12.3 ms alone would leave half of the motion and more.
    let run = gusset_record::Run::open(&folder.join("again")).unwrap();
    let columns = run.columns(&["target_1_1", "meas_1_1"]).unwrap();
    let half = columns[0].len() / 2;
    let sum = |of: &dyn Fn(usize) -> f64| (half..columns[0].len()).map(of).sum::<f64>();
    let off = sum(&|i| (columns[1][i] - columns[0][i]).powi(2));
    let all = sum(&|i| columns[0][i].powi(2));
    assert!((off / all).sqrt() < 0.02, "{}", (off / all).sqrt());

    // With the command that is written in it.
    let text = std::fs::read_to_string(&twin).unwrap();
    let command = text
        .split("gusset identify identified.toml ")
        .nth(1)
        .unwrap();
    let command = command.split("    ").next().unwrap();
    let flags: Vec<&str> = command.split(' ').collect();
    let second = identified(&twin, &folder.join("second"), &flags);
    let (one, two) = (
        best(&first, 0, "time_constant_s"),
        best(&second, 0, "time_constant_s"),
    );
    near((two.0, two.1), one.0);
    let stiffness = |found: &Value| {
        let stiffness = &found["axes"][0]["identification"]["specimen"]["stiffness"];
        stiffness["value"].as_f64().unwrap()
    };
    assert!((stiffness(&second) / stiffness(&first) - 1.0).abs() < 1e-3);
}

/// The specimen of `TEST` served in `folder`, and a test behind that link with these limits besides the usual ones.
pub fn served(folder: &Path, transport: &str, limits: &str) -> (Served, PathBuf) {
    let (_, specimen) = TEST.split_once("[[specimen]]").unwrap();
    let served = format!("[serve]\n[[specimen]]{specimen}")
        .without("specimen.0.storey")
        .without("specimen.0.limits.lag_s")
        .without("specimen.0.compensation");
    let server = Served::start(folder, &served, &["--transport", transport]);
    let linked = format!(
        "[time]\nrate_hz = 512\nduration_s = 1\nclock = \"simulated\"\n\n[[excitation.prescribed_displacement]]\n\
         specimen = \"rig\"\nsignal.sine = {{ amplitude = 0.001, frequency_hz = 1 }}\n\n[[specimen]]\nname = \"rig\"\n\
         stiffness_n_per_m = 1e6\nlimits = {{ command_disp_m = {{ trip = [-0.05, 0.05] }}, \
         measured_force_n = {{ trip = [-1e5, 1e5] }}{limits} }}\n\
         link = {{ address = \"{}\", transport = \"{transport}\" }}\n",
        server.address
    );
    let test = write(folder, "linked.toml", &linked);
    (server, test)
}

#[test]
fn linked_specimen_is_identified() {
    for transport in ["tcp", "udp"] {
        let (_keep, folder) = folder();
        let (_server, test) = served(&folder, transport, "");
        let found = identified(&test, &folder.join("out"), &SHORT);
        near(best(&found, 0, "time_constant_s"), 0.0123);
        let k = &found["axes"][0]["identification"]["specimen"]["stiffness"];
        near(
            (k["value"].as_f64().unwrap(), k["std"].as_f64().unwrap()),
            1.2e6,
        );
        let said = say([
            "check",
            folder.join("out/identified.toml").to_str().unwrap(),
        ]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
    }
}

/// A lever and a model scale: axes are driven at the specimen, one after the other, and found at both scales.
#[test]
fn axes_move_one_after_the_other() {
    let (_keep, folder) = folder();
    let text = r#"
[time]
rate_hz = 512
duration_s = 1
clock = "simulated"

[structure.shear_building]
mass_kg = [1000.0, 900.0]
stiffness_n_per_m = [1e5, 4e5]

[structure]
initial_displacement_m = [0.001, 0.0]

[[specimen]]
name = "table"
rows = [[1, 0], [0, 1]]
similitude = { length = 4, force = 16, time = 2 }
laws = [{ linear = { stiffness_n_per_m = 2e5 } }, { linear = { stiffness_n_per_m = 5e5 } }]
axis = [{ scale = 2, sign = -1, unit_disp = "mm", unit_force = "kN", offset_m = 0.01 }, {}]
limits.command_disp_m = { trip = [-0.05, 0.05] }
transfer = { delay_s = 0.011, seed = 2, disp_sensor = { noise_rms_m = 2e-6 }, force_sensor = { noise_rms_n = 5.0 } }

[[specimen]]
name = "other"
storey = 1
law.linear.stiffness_n_per_m = 1e5
"#;
    let test = write(&folder, "test.toml", text);
    let out = folder.join("out");
    let found = identified(
        &test,
        &out,
        &[
            "--specimen",
            "table",
            "--duration",
            "6",
            "--band",
            "0.5,12",
            "--motion",
            "noise",
        ],
    );
    let axes = found["axes"].as_array().unwrap();
    assert_eq!(axes.len(), 2);
    for (axis, (k, at_structure)) in [(2e5, 2e5 * 4.0 * 16.0 / 4.0), (5e5, 5e5 * 16.0 / 4.0)]
        .into_iter()
        .enumerate()
    {
        near(best(&found, axis, "delay_s"), 0.011);
        let found = &axes[axis];
        let stiffness = &found["identification"]["specimen"]["stiffness"];
        near(
            (
                stiffness["value"].as_f64().unwrap(),
                stiffness["std"].as_f64().unwrap(),
            ),
            k,
        );
        let there = &found["at_structure"]["stiffness_n_per_m"];
        assert!(
            (there.as_f64().unwrap() / at_structure - 1.0).abs() < 1e-2,
            "{found:#}"
        );
    }
    // 5 % of 40 mm and of 50 mm, at the specimen; while one moves the other stands.
    assert_eq!(axes[0]["amplitude_m"], 0.002);
    assert_eq!(axes[1]["amplitude_m"], 0.0025);
    let run = gusset_record::Run::open(&out).unwrap();
    let columns = run.columns(&["cmd_1_1", "cmd_1_2"]).unwrap();
    let peak =
        |column: &[f64], zero: f64| column.iter().map(|v| (v - zero).abs()).fold(0.0, f64::max);
    assert!(
        (peak(&columns[0], 10.0) / 2.0 - 1.0).abs() < 1e-9,
        "millimetres from the offset"
    );
    assert!((peak(&columns[1], 0.0) / 0.0025 - 1.0).abs() < 1e-9);
    let both = columns[0].iter().zip(&columns[1]);
    let both = both.filter(|(a, b)| (**a - 10.0).abs() > 1e-9 && b.abs() > 1e-12);
    assert_eq!(both.count(), 0);
    assert!(!names(&out).is_empty() && run.layout().index_of("cmd_2_1").is_none());
    let twin = out.join("identified.toml");
    let said = say(["check", twin.to_str().unwrap()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
}

#[test]
fn table_names_numbers_on_the_real_clock() {
    let (_keep, folder) = folder();
    let test = write(&folder, "test.toml", TEST);
    let mut command = gusset();
    let out = folder.join("real");
    command.arg("identify").arg(&test).arg("--out").arg(&out);
    command.args([
        "--clock",
        "real",
        "--duration",
        "4",
        "--band",
        "1,20",
        "--amplitude",
        "0.001",
    ]);
    command.args(crate::common::PATIENT);
    let said: Said = command.output().unwrap().into();
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    for words in [
        "first order",
        "best",
        "stiffness",
        "noise at",
        "identified.toml",
        "over the",
    ] {
        assert!(said.stdout.contains(words), "{words}: {}", said.stdout);
    }
    assert!(said.stderr.contains("left out"), "{}", said.stderr);
    assert!(said.stderr.contains("asked for"), "{}", said.stderr);
    near(
        best(&json(&out, "identification.json"), 0, "time_constant_s"),
        0.0123,
    );
}
