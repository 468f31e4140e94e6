//! Motions of single supports: mistakes in them, and what `check` says of them.

use crate::common::refusal::refusal;
use crate::common::test_file::TestFile;
use crate::common::{Said, say, write};

const PORTAL: &str = r#"[time]
rate_hz = 256
duration_s = 2
clock = "simulated"

[structure.frame]
node = [
    { name = "A", at_m = [0, 0], fixed = ["x", "y", "rz"] },
    { name = "B", at_m = [0, 3], mass_kg = 20000 },
    { name = "C", at_m = [4, 3], mass_kg = 10000 },
    { name = "D", at_m = [4, 0], fixed = ["x", "y"] },
]
member = [
    { nodes = ["A", "B"], section = "s" },
    { nodes = ["B", "C"], section = "s" },
    { nodes = ["C", "D"], section = "s" },
]
section.s.elastic = { young_pa = 2.1e11, area_m2 = 4e-3, inertia_m4 = 4e-5 }

[[specimen]]
name = "brace"
deformations = [{ node = "C", direction = "x", from = "B" }]
law.linear = { stiffness_n_per_m = 5e5 }

[[excitation.support_motion]]
node = "D"
direction = "x"
signal.sine = { amplitude = 0.01, frequency_hz = 2 }
"#;

fn check(text: &str) -> Said {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", text);
    say([
        "check".into(),
        test.into_os_string(),
        "--no-rehearsal".into(),
    ])
}

#[test]
fn moving_support_is_reported() {
    let said = check(PORTAL);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stdout.contains("motion of a support (sine)"),
        "{}",
        said.stdout
    );
}

#[test]
fn impossible_support_motions_are_refused() {
    let refused = |text: &str, words: &[&str]| refusal(&check(text), words);
    let node = |name: &str| PORTAL.replace("node = \"D\"\n", &format!("node = \"{name}\"\n"));
    refused(
        &node("X"),
        &["no node \"X\"", "A, B, C, D", "support_motion"],
    );
    refused(&node("B").without("specimen"), &["\"B\"", "not fixed in x"]);
    refused(
        &node("D").replace("direction = \"x\"\nsignal", "direction = \"z\"\nsignal"),
        &["no direction z", "upwards"],
    );
    refused(
        &PORTAL.replace("node = \"D\"\n", ""),
        &["`node`", "`nodes`"],
    );
    let column = "{ nodes = [\"C\", \"D\"], section = \"s\" }";
    let p_delta = PORTAL.replace(column, &column.replace(" }", ", p_delta = true }"));
    refused(&p_delta, &["member 3", "\"D\"", "not linear"]);
    let linked = PORTAL.with(
        "structure.frame.link = [{ nodes = [\"B\", \"D\"], direction = \"x\", law.linear = { stiffness_n_per_m = 1e4 } }]",
    );
    refused(&linked, &["link 1", "not linear"]);
    let tied = PORTAL
        .with("structure.frame.constraint = [{ rigid = { master = \"D\", nodes = [\"C\"] } }]");
    refused(&tied, &["\"D\"", "constraint"]);
    refused(
        &PORTAL.replace(", from = \"B\"", ""),
        &["`from` is missing"],
    );
    refused(
        &PORTAL.replace("from = \"B\"", "from = \"D\""),
        &["`specimen[0].deformations[0].from`", "moving support \"D\""],
    );
    let rows = PORTAL
        .without("specimen.0.deformations")
        .with("[specimen]\nrows = [[1, 0, 0, 0, 0, 0, 0]]");
    refused(&rows, &["`deformations` is missing"]);
    let ground = PORTAL.with(
        "excitation.ground_acceleration = { signal.sine = { amplitude = 1, frequency_hz = 1 } }",
    );
    refused(&ground, &["both move the ground"]);
    let element = PORTAL.with("structure.element = [{ from = \"ground\", to = 1, law.linear = { stiffness_n_per_m = 1e4 } }]");
    refused(&element, &["\"ground\" has no single motion", "\"fixed\""]);
    let energy = PORTAL.with("safety.added_energy_share = { trip = 0.2, floor_j = 10.0 }");
    refused(&energy, &["`safety.added_energy_share`", "does not count"]);
    let building = PORTAL
        .without("structure.frame")
        .without("specimen")
        .with("structure.shear_building = { mass_kg = [1000], stiffness_n_per_m = [1e5] }");
    refused(&building, &["needs a `[structure.frame]`"]);
    let lone = PORTAL.without("structure");
    refused(&lone, &["support_motion", "no `[structure]`"]);
}
