//! Several components of a ground acceleration: their common factor, and mistakes in them.

use crate::common::refusal::{pictured, refusal};
use crate::common::test_file::TestFile;
use crate::common::{Said, say, write};
use gusset_motion::STANDARD_GRAVITY;
use gusset_motion::metrics::pair::{PairMeasure, pair_spectrum};
use serde_json::Value;

/// A plan of one storey, with a record in x and one in y.
const PLAN: &str = r#"[time]
rate_hz = 200
duration_s = 4
clock = "simulated"

[structure.matrices]
mass = [[4000, 0, 0], [0, 4000, 0], [0, 0, 26000]]
stiffness = [[4e5, 0, 1.6e5], [0, 6e5, 3.6e5], [1.6e5, 3.6e5, 4e6]]

[[excitation.ground_acceleration]]
direction = "x"
influence = [1, 0, 0]
signal.file = { path = "a.csv", unit = "g", dt_s = 0.01 }

[[excitation.ground_acceleration]]
direction = "y"
influence = [0, 1, 0]
signal.file = { path = "b.csv", unit = "g", dt_s = 0.01 }
"#;

fn record(phase: f64) -> Vec<f64> {
    let at = |i: u32| {
        let t = 0.01 * f64::from(i);
        0.2 * libm::sin(7.0 * t + phase) * libm::sin(std::f64::consts::PI * t / 4.0)
    };
    (0..=400).map(at).collect()
}

fn check(text: &str, options: &[&str]) -> Said {
    let folder = tempfile::tempdir().unwrap();
    for (name, phase) in [("a.csv", 0.0), ("b.csv", 1.1)] {
        let lines = record(phase).into_iter().map(|value| format!("{value}\n"));
        write(folder.path(), name, &lines.collect::<String>());
    }
    write(folder.path(), "target.csv", "0.1,0.8\n0.5,0.8\n4.0,0.1\n");
    let test = write(folder.path(), "test.toml", text);
    let mut arguments = vec!["check".into(), test.into_os_string()];
    arguments.extend(options.iter().map(Into::into));
    say(arguments)
}

fn structure(text: &str) -> Value {
    let said = check(text, &["--json", "--no-rehearsal"]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let found: Value = serde_json::from_str(&said.stdout).unwrap();
    found["structure"].clone()
}

#[test]
fn factor_and_measure_are_reported() {
    let scaling =
        "excitation.scaling = { target = \"rotd50\", period_s = 0.8, value = 0.5, unit = \"g\" }";
    let found = structure(&PLAN.with(scaling));
    let [x, y] = [0.0, 1.1].map(|phase| {
        let record = record(phase).into_iter();
        record.map(|a| a * STANDARD_GRAVITY).collect::<Vec<f64>>()
    });
    let before = pair_spectrum(PairMeasure::RotD50, [&x, &y], 0.01, &[0.8], 0.05)[0];
    let scaling = &found["scaling"];
    let near = |found: &Value, wanted: f64| {
        let found = found.as_f64().unwrap();
        assert!((found / wanted - 1.0).abs() < 1e-12, "{found} {wanted}");
    };
    near(&scaling["before_m_per_s2"][0], before);
    near(&scaling["after_m_per_s2"][0], 0.5 * STANDARD_GRAVITY);
    near(&scaling["factor"], 0.5 * STANDARD_GRAVITY / before);
    assert_eq!(scaling["target"], "rotd50");
    let peak = |values: &[f64]| values.iter().fold(0.0_f64, |most, a| most.max(a.abs()));
    let factor = scaling["factor"].as_f64().unwrap();
    for (ground, (name, own)) in found["grounds"]
        .as_array()
        .unwrap()
        .iter()
        .zip([("x", x), ("y", y)])
    {
        assert_eq!(ground["column"], format!("ground_{name}"));
        near(&ground["peak_m_per_s2"], factor * peak(&own));
    }
    let largest = found["peak_ground_acceleration_m_per_s2"].as_f64().unwrap();
    assert_eq!(
        largest,
        found["grounds"]
            .as_array()
            .unwrap()
            .iter()
            .map(|g| g["peak_m_per_s2"].as_f64().unwrap())
            .fold(0.0, f64::max)
    );
}

#[test]
fn spectrum_is_reported_in_words() {
    let scaling = "excitation.scaling = { target = \"geometric_mean\", spectrum_file = \"target.csv\", periods_s = [0.2, 1.5], unit = \"g\" }";
    let text = PLAN.with(scaling);
    let found = structure(&text);
    let of = |key: &str| found["scaling"][key].as_f64().unwrap();
    assert!(of("misfit_after") < of("misfit_before"));
    assert_eq!(found["scaling"]["periods_s"].as_array().unwrap().len(), 64);
    for options in [&["--no-rehearsal"][..], &["--no-rehearsal", "--verbose"]] {
        let said = check(&text, options);
        let words = said.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
        for part in [
            "scaling",
            "factor",
            "geometric mean",
            "target.csv",
            "before",
            "after",
        ] {
            assert!(words.contains(part), "no {part:?} in {words}");
        }
    }
}

#[test]
fn single_table_keeps_its_overrides() {
    let single = PLAN.replacen(
        "[[excitation.ground_acceleration]]",
        "[excitation.ground_acceleration]",
        1,
    );
    let single = single.split_once("\n[[").unwrap().0.to_owned();
    let set = "excitation.ground_acceleration.processing.scale_factor=2";
    let said = check(&single, &["--json", "--no-rehearsal", "--set", set]);
    let found: Value = serde_json::from_str(&said.stdout).unwrap();
    let doubled = &found["structure"]["grounds"][0];
    assert_eq!(doubled["column"], "ground");
    let plain = structure(&single)["grounds"][0]["peak_m_per_s2"]
        .as_f64()
        .unwrap();
    assert_eq!(doubled["peak_m_per_s2"].as_f64().unwrap(), 2.0 * plain);
    let set = "excitation.ground_acceleration.1.processing.scale_factor=2";
    let said = check(PLAN, &["--json", "--no-rehearsal", "--set", set]);
    let found: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(found["structure"]["grounds"].as_array().unwrap().len(), 2);
}

#[test]
fn wrong_components_are_refused() {
    let refused = |text: &str, words: &[&str]| refusal(&check(text, &["--no-rehearsal"]), words);
    let second = "excitation.ground_acceleration[1]";
    let bare = PLAN.replace("direction = \"y\"\ninfluence = [0, 1, 0]\n", "");
    refused(&bare, &[second, "neither `direction` nor `influence`"]);
    let unknown = PLAN.replace("influence = [0, 1, 0]\n", "");
    refused(&unknown, &["direction y", "`influence` is missing"]);
    let short = PLAN.replace("[0, 1, 0]", "[0, 1]");
    refused(&short, &["2 entries", "3 DOFs"]);
    let same = PLAN.replace("direction = \"y\"", "direction = \"x\"");
    refused(&same, &[second, "another `influence`"]);
    let turned = PLAN.with("excitation.incident_angle_deg = 30");
    let others = turned.replace("direction = \"y\"", "direction = \"z\"");
    refused(&others, &["incident_angle_deg", "1 in x, 0 in y, 1 others"]);
    let scaled = |keys: &str| {
        PLAN.with(&format!(
            "excitation.scaling = {{ target = \"rotd100\", unit = \"g\", {keys} }}"
        ))
    };
    refused(
        &scaled("period_s = 1.0"),
        &["`period_s` and `value`, or `spectrum_file`"],
    );
    refused(
        &scaled("value = 0.4, period_s = 1.0, periods_s = [1, 2]"),
        &["`periods_s` needs `spectrum_file`"],
    );
    refused(
        &scaled("spectrum_file = \"target.csv\", periods_s = [0.05, 1.0]"),
        &["target.csv", "from 0.1 s to 4 s"],
    );
    refused(&scaled("spectrum_file = \"a.csv\""), &["a.csv", "two"]);
    refused(&scaled("value = -1, period_s = 1.0"), &["value", "-1"]);
    let value = "value = 0.4, period_s = 1.0";
    refused(
        &scaled(value)
            .replace("\"g\", v", "\"mm\", v")
            .replace("unit = \"g\"\nv", "unit = \"mm\"\nv"),
        &["unit"],
    );
    let third = scaled(value).replace("direction = \"y\"", "direction = \"z\"");
    refused(&third, &["two horizontal components", "found 1"]);
    let both = scaled(value).with(
        "excitation.ground_acceleration.0.processing.target_peak = { value = 1, unit = \"g\" }",
    );
    refused(
        &both,
        &[
            "`excitation.ground_acceleration[0].processing.target_peak`",
            "both scale",
        ],
    );
    let word = PLAN.replace("direction = \"y\"", "direction = \"up\"");
    refused(&word, &["\"up\"", "`x`, `y`"]);
    let key = PLAN.replace("direction = \"y\"", "directoin = \"y\"");
    refused(&key, &["directoin", "`direction`"]);
}

#[test]
fn key_of_a_component_is_pictured() {
    let text = PLAN.replace("direction = \"y\"", "direction = 2");
    let said = check(&text, &[]);
    pictured(
        &said.stderr,
        &text,
        "direction = 2",
        "2",
        &["excitation.ground_acceleration[1].direction"],
    );
}
