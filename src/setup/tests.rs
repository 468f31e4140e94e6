//! The user's view: every mistake of a test file as shown, and the test that a good file makes.

use std::path::Path;

use gusset_config::*;
use test_file::TestFile;

mod certificate;
mod critical_delays;
mod far;
mod hints;
mod idle;
mod keys;
mod nodal;
mod overrides;
mod places;
mod renamed;
mod stability;
#[path = "../../tests/common/test_file.rs"]
mod test_file;
mod values;
mod waits;
mod way;

const GOOD: &str = r#"# three storeys, the lowest in the laboratory
title = "three storeys"

[time]
rate_hz = 1024      # as the controller
duration_s = 20

[structure]
damping = { rayleigh = { mass_coefficient_per_s = 0.1, stiffness_coefficient_s = 0.001 } }
[structure.shear_building]
mass_kg = [1000, 1000, 1000]
stiffness_n_per_m = [0, 1e6, 1e6]

[excitation.ground_acceleration]
signal = { sine = { amplitude = 2.0, frequency_hz = 1.5 } }

[[specimen]]
name = "bottom"
storey = 1
law = { bilinear = { stiffness_n_per_m = 1e6, yield_force_n = 5e3, post_yield_ratio = 0.1 } }
"#;

const PRESCRIBED: &str = r#"
time = { step_s = 0.01, duration_s = 1 }
[[excitation.prescribed_displacement]]
specimen = "damper"
signal = { sine = { amplitude = 0.01, frequency_hz = 1.0 } }
[[specimen]]
name = "damper"
law = { linear = { stiffness_n_per_m = 1e6 } }
"#;

fn read(text: &str, sets: &[&str]) -> Result<Loaded, ConfigError> {
    let sets: Vec<String> = sets.iter().map(|s| (*s).to_owned()).collect();
    parse(Path::new("test.toml"), text.to_owned(), &sets)
}

fn accepted(text: &str, sets: &[&str]) -> Loaded {
    read(text, sets).unwrap_or_else(|error| panic!("{error}"))
}

/// The complaint about `GOOD` with `from` replaced by `to`.
fn complaint(from: &str, to: &str) -> String {
    complaint_of(GOOD, from, to)
}

fn complaint_of(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the test's own replacement {from:?}");
    read(&text.replace(from, to), &[]).unwrap_err().to_string()
}

fn complaint_about_set(arguments: &[&str]) -> String {
    read(GOOD, arguments).unwrap_err().to_string()
}

fn errors(text: &str) -> usize {
    text.matches("error: ").count()
}

#[track_caller]
fn shows(text: &str, part: &str) {
    assert!(text.contains(part), "wanted\n{part}\nin\n{text}");
}
