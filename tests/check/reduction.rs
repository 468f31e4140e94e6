//! `gusset check` of a reduced structure: its size, its errors, its names, and mistakes in `[structure.reduce]`.

use serde_json::Value;
use tempfile::TempDir;

use super::verdict::gusset;
use crate::common::refusal::refused;
use crate::common::test_file::TestFile;
use crate::common::{completed, json, same_physics, say, write};

/// A chain of 60 masses, held at one end, in files.
fn files() -> [(&'static str, String); 2] {
    let head = "%%MatrixMarket matrix coordinate real symmetric\n60 60";
    let masses: String = (1..=60).map(|i| format!("{i} {i} 2000\n")).collect();
    let springs = (1..=60).map(|i| {
        let own = if i < 60 { 8e8 } else { 4e8 };
        let beside = if i > 1 {
            format!("{i} {} -4e8\n", i - 1)
        } else {
            String::new()
        };
        format!("{i} {i} {own}\n{beside}")
    });
    let springs: String = springs.collect();
    [
        ("mass.mtx", format!("{head} 60\n{masses}")),
        ("stiffness.mtx", format!("{head} 119\n{springs}")),
    ]
}

const TEST: &str = r#"[time]
rate_hz = 256
duration_s = 2
clock = "simulated"

[structure.matrices]
mass_file = "mass.mtx"
stiffness_file = "stiffness.mtx"

[structure.damping.modal]
ratios = [0.03]

[structure.reduce]
modes = 8
keep = [30]

[[structure.element]]
from = "ground"
to = 20
law.bilinear = { stiffness_n_per_m = 1e6, yield_force_n = 1e4, post_yield_ratio = 0.1 }

[excitation.ground_acceleration]
signal.sine = { amplitude = 1.0, frequency_hz = 1.5 }

[record]
dofs = [60]
"#;

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, text) in files() {
        write(folder.path(), name, &text);
    }
    folder
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn check_compares_modes_and_transient() {
    let folder = folder();
    let said = gusset(folder.path(), "check", TEST, &[]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let structure = &said.json["structure"];
    let found = &structure["reduction"];
    assert_eq!(found["full_dofs"], 60);
    assert_eq!(found["kept"], serde_json::json!([20, 30, 60]));
    assert_eq!((&found["named"], &found["modes"]), (&1.into(), &8.into()));
    assert_eq!(structure["dofs"], 11);
    assert_eq!(structure["places"][1], "model DOF 30");
    assert_eq!(structure["places"][10], "mode 8");
    let modes = found["lowest_modes"].as_array().unwrap();
    assert_eq!(modes.len(), 6);
    for mode in modes {
        let [full, reduced] =
            ["frequency_rad_per_s", "reduced_frequency_rad_per_s"].map(|key| number(&mode[key]));
        assert!(full > 0.0 && (reduced / full - 1.0).abs() < 2e-2, "{mode}");
        let mass = &mode["effective_masses"][0];
        let [full, reduced] = ["sum", "reduced_sum"].map(|key| number(&mass[key]));
        assert!(full > 0.75 && (reduced - full).abs() < 1e-3, "{mode}");
    }
    // A ratio of modal damping is one of the reduced model.
    for mode in structure["modes"].as_array().unwrap() {
        assert!(
            (number(&mode["damping_ratio"]) - 0.03).abs() < 1e-9,
            "{mode}"
        );
    }
    let error = &said.json["verdict"]["errors"]["reduction"];
    let drift = number(&error["drift"]);
    assert!(drift > 0.0 && drift < 5e-3, "{error}");
    let crude = gusset(
        folder.path(),
        "check",
        &TEST.with("structure.reduce.modes = 0"),
        &[],
    );
    let error = &crude.json["verdict"]["errors"]["reduction"];
    assert!(number(&error["drift"]) > 10.0 * drift, "{error}");
}

#[test]
fn long_test_has_no_known_reduction_error() {
    let folder = folder();
    let long = TEST.with("time.duration_s = 600");
    let said = gusset(folder.path(), "check", &long, &[]);
    let errors = &said.json["verdict"]["errors"];
    assert!(errors["reduction"]["not_known"].is_string(), "{errors}");
    assert!(errors["reduction"]["drift"].is_null(), "{errors}");
}

#[test]
fn run_is_replayed_and_repeated() {
    let folder = folder();
    let test = write(folder.path(), "test.toml", TEST);
    let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
    completed(&test, &one, &[]);
    let replayed = say(["replay".as_ref(), one.as_os_str()]);
    assert_eq!(replayed.code, Some(0), "{}", replayed.stderr);
    let resolved = one.join("resolved.toml");
    let text = std::fs::read_to_string(&resolved).unwrap();
    let table: toml::Table = text.parse().unwrap();
    let keep = table["structure"]["reduce"]["keep"].as_array().unwrap();
    assert_eq!(keep[..], [20, 30, 60].map(toml::Value::Integer));
    completed(&resolved, &other, &[]);
    same_physics(&one, &other);
    let columns = json(&one, "samples.json");
    let columns = columns["columns"].as_array().unwrap();
    assert!(columns.iter().any(|column| column["name"] == "x3"));
    assert!(!columns.iter().any(|column| column["name"] == "x1"));
}

#[test]
fn mistakes_are_refused_where_they_stand() {
    let files = files();
    let files: Vec<(&str, &str)> = files
        .iter()
        .map(|(name, text)| (*name, &text[..]))
        .collect();
    for (right, wrong, under, word) in [
        ("keep = [30]", "keep = [30, 61]", "61", "61"),
        ("modes = 8", "modes = 58", "58", "57"),
        ("modes = 8", "modes = -1", "-1", "modes"),
        (
            "keep = [30]",
            "keep = [{ node = \"A1\", direction = \"x\" }]",
            "{ node = \"A1\", direction = \"x\" }",
            "nodes",
        ),
    ] {
        let text = TEST.replacen(right, wrong, 1);
        refused(&text, &files, wrong, under, &[word]);
    }
    let moved = TEST.replacen("ground_acceleration]", "base_displacement]", 1);
    let line = "[excitation.base_displacement]";
    refused(&moved, &files, line, "base_displacement", &["reduce"]);
    let far = TEST.replacen("to = 20", "to = 61", 1);
    let line = "[[structure.element]]";
    refused(&far, &files, line, line, &["61", "60"]);
    // Nothing holds the third of three masses.
    let loose = "[time]\nrate_hz = 256\nduration_s = 2\nclock = \"simulated\"\n\
        [structure.matrices]\nmass = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]\n\
        stiffness = [[1e3, 0, 0], [0, 1e3, 0], [0, 0, 0]]\n\
        [structure.reduce]\nmodes = 1\nkeep = [1]\n";
    let line = "[structure.reduce]";
    refused(loose, &[], line, line, &["DOF 3"]);
    let building = "[time]\nrate_hz = 256\nduration_s = 2\nclock = \"simulated\"\n\
        [structure.shear_building]\nmass_kg = [1.0, 1.0]\nstiffness_n_per_m = [1e3, 1e3]\n\
        [structure.reduce]\nmodes = 1\n";
    refused(building, &[], line, "reduce", &["matrices", "frame"]);
}

#[test]
fn unknown_node_is_refused() {
    let frame = include_str!("../../config/portal-frame.toml");
    let last = "[structure.reduce]\nmodes = 1\nkeep = [{ node = \"A9\", direction = \"x\" }]\n";
    let text = format!("{frame}\n{last}");
    let line = "keep = [{ node = \"A9\", direction = \"x\" }]";
    refused(
        &text,
        &[],
        line,
        "{ node = \"A9\", direction = \"x\" }",
        &["A9", "A1"],
    );
}
