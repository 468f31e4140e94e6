//! Displacements that are made of records of acceleration.

use crate::common::refusal::refusal;
use crate::common::test_file::TestFile;
use crate::common::{Said, say, write};
use serde_json::Value;

/// A specimen that follows a record of acceleration within a stroke.
const TABLE: &str = r#"[time]
rate_hz = 256
duration_s = 12
clock = "simulated"

[[specimen]]
name = "isolator"
law.linear = { stiffness_n_per_m = 1e5 }

[[excitation.prescribed_displacement]]
specimen = "isolator"
signal.file = { path = "a.csv", unit = "g", dt_s = 0.01 }
processing.displacement = { stroke_m = 0.04 }
"#;

fn check(text: &str, options: &[&str]) -> Said {
    let folder = tempfile::tempdir().unwrap();
    let at = |i: u32| {
        let t = 0.01 * f64::from(i);
        0.2 * libm::sin(5.0 * t) * libm::sin(std::f64::consts::PI * t / 10.0) + 0.02
    };
    let lines = (0..=1000).map(|i| format!("{}\n", at(i)));
    write(folder.path(), "a.csv", &lines.collect::<String>());
    let test = write(folder.path(), "test.toml", text);
    let mut arguments = vec!["check".into(), test.into_os_string()];
    arguments.extend(options.iter().map(Into::into));
    say(arguments)
}

#[test]
fn corner_and_losses_are_reported() {
    let base = TABLE
        .without("specimen")
        .without("excitation")
        .with(
            "structure.shear_building = { mass_kg = [1000], stiffness_n_per_m = [1e5] }\n\
             excitation.base_displacement = { signal.file = { path = \"a.csv\", unit = \"g\", dt_s = 0.01 }, \
             processing.displacement = { stroke_m = 0.04 } }",
        );
    for (text, key) in [
        (TABLE, "excitation.prescribed_displacement[0]"),
        (&base, "excitation.base_displacement"),
    ] {
        let said = check(text, &["--json", "--no-rehearsal"]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let found: Value = serde_json::from_str(&said.stdout).unwrap();
        let one = &found["displacements"][0];
        assert_eq!(one["key"], key);
        let of = |key: &str| one[key].as_f64().unwrap();
        assert!(of("peak_m") <= 0.04 && of("peak_m") > 0.0399, "{one}");
        assert!(of("corner_hz") > 0.05 && of("peak_before_m_per_s2") > 1.9);
        let spectrum = one["spectrum"].as_array().unwrap();
        assert!(spectrum.len() >= 5);
        assert!(found["records"][0]["peak_m_per_s2"].is_number());
        for options in [&["--no-rehearsal"][..], &["--no-rehearsal", "--verbose"]] {
            let said = check(text, options);
            let words = said.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
            for part in [key, "corner frequency", "40 mm", "% at 1 s"] {
                assert!(words.contains(part), "no {part:?} in {words}");
            }
        }
    }
}

#[test]
fn wrong_displacements_are_refused() {
    let refused = |text: &str, words: &[&str]| refusal(&check(text, &["--no-rehearsal"]), words);
    refused(&TABLE.replace("0.04", "1e-9"), &["`stroke_m`", "corner"]);
    refused(&TABLE.replace("0.04", "-1"), &["stroke_m", "-1"]);
    refused(&TABLE.replace("\"g\"", "\"mm\""), &["mm", "acceleration"]);
    let sine =
        "excitation.prescribed_displacement.0.signal.sine = { amplitude = 1, frequency_hz = 1 }";
    let sine = TABLE
        .without("excitation.prescribed_displacement.0.signal.file")
        .with(sine);
    refused(&sine, &["displacement", "closed form"]);
    let ground = TABLE.without("specimen").without("excitation").with(
        "structure.shear_building = { mass_kg = [1000], stiffness_n_per_m = [1e5] }\n\
         excitation.ground_acceleration = { signal.file = { path = \"a.csv\", unit = \"g\", dt_s = 0.01 }, \
         processing.displacement = { stroke_m = 0.04 } }",
    );
    refused(&ground, &["displacement", "anything but a displacement"]);
}
