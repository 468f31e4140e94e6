//! Every integration method runs a computed test from a file, and only methods that may command a specimen get one.

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::test_file::TestFile;

const TEST: &str = r#"
title = "Two storeys"

[time]
step_s = 0.01
duration_s = 4
clock = "simulated"

[structure.shear_building]
mass_kg = [1000, 2000]
stiffness_n_per_m = [8e5, 6e5]
damping_n_s_per_m = [900, 700]

[excitation.ground_acceleration.signal.sine]
amplitude = 2.0
frequency_hz = 1.5

[integrator]
"#;

const SPECIMEN: &str = "\n[[specimen]]\nname = \"brace\"\nstorey = 1\nlaw = { linear = { stiffness_n_per_m = 2e5 } }\n";

/// Exit code, stdout as JSON if it is, stderr.
fn gusset(command: &str, text: &str) -> (i32, Value, String) {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("test.toml");
    std::fs::write(&file, text).unwrap();
    let mut process = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    process.arg(command).arg(&file).arg("--json");
    if command == "run" {
        process
            .arg("--quiet")
            .arg("--out")
            .arg(folder.path().join("out"));
    }
    let output = process.output().unwrap();
    (
        output.status.code().unwrap(),
        serde_json::from_slice(&output.stdout).unwrap_or(Value::Null),
        String::from_utf8(output.stderr).unwrap(),
    )
}

fn peak(method: &str) -> f64 {
    let (code, summary, text) = gusset("run", &format!("{TEST}{method}\n"));
    assert_eq!(code, 0, "{method}: {text}");
    assert_eq!(summary["steps"], 400);
    assert!(summary["peak"]["acceleration"][1].as_f64().unwrap() > 0.1);
    summary["peak"]["displacement"][1].as_f64().unwrap()
}

#[test]
fn every_method_finds_the_same_peak() {
    let family = peak("lambda = 4");
    for method in [
        "method = \"newmark_average\"",
        "method = \"newmark_linear\"",
        "method = \"newmark_explicit\"",
        "method = \"central_difference\"",
        "method = \"chang_2002\"",
        "method = \"kr_alpha\"\nrho_infinity = 0.8",
        "method = \"kr_alpha\"\nrho_infinity = 0.8\nweighting = \"state\"",
        "method = \"mkr_alpha\"\nrho_infinity = 0.5",
    ] {
        // Ω of the governing mode is about 0.1: periods differ by some 1e-3, the half step of the start by Δt/T.
        assert!((peak(method) / family - 1.0).abs() < 0.03, "{method}");
    }
    // Equal poles and an equal start, up to β ω̄² Δt² of the load.
    assert!((peak("method = \"newmark_average\"") / family - 1.0).abs() < 0.01);
}

/// That of equilibrium, but where the method itself is not in equilibrium at the ends of steps.
#[test]
fn record_names_its_acceleration() {
    for (method, words) in [
        ("lambda = 4", "from equilibrium"),
        ("method = \"newmark_average\"", "from equilibrium"),
        (
            "method = \"kr_alpha\"\nrho_infinity = 0.8",
            "from equilibrium",
        ),
        (
            "method = \"kr_alpha\"\nrho_infinity = 0.8\nweighting = \"state\"",
            "next step",
        ),
    ] {
        let text = format!("{TEST}{method}\n");
        let read = gusset_config::parse(std::path::Path::new("test.toml"), text, &[]);
        let loaded = read.unwrap_or_else(|error| panic!("{error}"));
        let built = gusset_setup::build(&loaded).unwrap_or_else(|error| panic!("{error}"));
        let columns = built.experiment.columns();
        let column = columns.iter().find(|column| column.name == "a2").unwrap();
        let told = &column.meaning;
        assert!(
            told.starts_with("acceleration") && told.contains(words),
            "{told}"
        );
    }
}

#[test]
fn companion_summary_has_no_lambda() {
    let text = format!("{TEST}method = \"chang_2002\"\n");
    let (_, summary, _) = gusset("run", &text);
    assert!(summary["lambda"].is_null(), "{summary}");
    let (code, facts, _) = gusset("check", &text);
    assert_eq!(code, 0);
    assert_eq!(facts["structure"]["method"], "chang_2002");
    assert!(facts["structure"]["lambda"].is_null());
}

#[test]
fn implicit_method_is_refused_a_specimen() {
    for (method, reason) in [
        ("method = \"newmark_average\"", "implicit"),
        ("method = \"central_difference\"", "explicit"),
        (
            "method = \"kr_alpha\"\nrho_infinity = 1\nweighting = \"state\"",
            "weighted state",
        ),
    ] {
        let (code, _, text) = gusset("check", &format!("{TEST}{method}\n{SPECIMEN}"));
        assert_eq!(code, 2, "{method}");
        assert!(
            text.contains("cannot command") && text.contains(reason),
            "{text}"
        );
    }
    for method in [
        "method = \"kr_alpha\"\nrho_infinity = 0.7",
        "method = \"mkr_alpha\"\nrho_infinity = 0.7",
    ] {
        let (code, summary, text) = gusset("run", &format!("{TEST}{method}\n{SPECIMEN}"));
        assert_eq!(code, 0, "{method}: {text}");
        assert!(summary["peak"]["force"]["brace"][0].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn unsupported_keys_of_a_method_are_named() {
    for (keys, words) in [
        ("method = \"kr_alpha\"", "needs `rho_infinity`"),
        ("method = \"kr_alpha\"\nrho_infinity = 1.5", "is 1.5,"),
        (
            "method = \"newmark_linear\"\nlambda = 4",
            "`integrator.lambda`",
        ),
        ("rho_infinity = 0.5", "`integrator.rho_infinity`"),
        (
            "method = \"chang_2002\"\nnewton_iterations = 0",
            "newton_iterations",
        ),
        ("method = \"newmark\"", "newmark_average"),
    ] {
        let (code, _, text) = gusset("check", &format!("{TEST}{keys}\n"));
        assert_eq!(code, 2, "{keys}");
        assert!(text.contains(words), "{keys}: {text}");
    }
    let real = TEST.with("time.clock = 'real'\nintegrator.method = 'newmark_average'");
    let (code, _, text) = gusset("check", &real);
    assert_eq!(code, 2);
    assert!(text.contains("real clock"), "{text}");
    // Ω = 2.9 in the second mode: beyond the explicit member, within none of the others.
    let coarse = TEST.with("time.step_s = 0.08\nintegrator.method = 'newmark_explicit'");
    let (code, facts, _) = gusset("check", &coarse);
    assert_eq!(code, 0);
    let warning = facts["warnings"][0].as_str().unwrap();
    assert!(warning.contains("stable to Ω = 2"), "{warning}");
}

#[test]
fn test_without_equilibrium_keeps_its_rows() {
    let element = "\n[[structure.element]]\nfrom = \"ground\"\nto = 1\nreach_disp_m = 0.1\n\
                   law = { cubic = { stiffness_n_per_m = 1e5, cubic_n_per_m3 = 1e9 } }\n";
    let text = format!("{TEST}method = \"newmark_average\"\nnewton_iterations = 2\n{element}");
    let (code, summary, _) = gusset("run", &text);
    assert_eq!(code, 1);
    assert_eq!(summary["status"], "stopped");
    let reason = summary["reason"].as_str().unwrap();
    assert!(
        reason.contains("2 iterations") && reason.contains("of freedom"),
        "{reason}"
    );
    assert!(summary["steps"].as_u64().unwrap() < 400);
}

/// A floor of a ton on a specimen behind a link, 20 steps a second: Ω = 5, of which half more is declared.
const HARDENING: &str = r#"
[time]
step_s = 0.05
duration_s = 2
clock = "simulated"

[structure.shear_building]
mass_kg = [1e3, 6e3]
stiffness_n_per_m = [0, 1e5]
damping_n_s_per_m = [0, 1e3]

[excitation.ground_acceleration.signal.sine]
amplitude = 2.0
frequency_hz = 0.5

[[specimen]]
name = "s"
storey = 1
stiffness_n_per_m = 1e7
hardening_bound = 1.5
link = { address = "127.0.0.1:1", connect_timeout_s = 0.2 }
limits = { command_disp_m = { trip = [-1, 1] }, measured_force_n = { trip = [-1e7, 1e7] } }
"#;

#[test]
fn growing_alpha_method_moves_no_link() {
    let method = "integrator = { method = 'kr_alpha', rho_infinity = 1 }";
    let grows = "the response grows by a factor of";
    let hardening = HARDENING.with("time.clock = 'real'");
    let light = hardening.without("specimen.0.hardening_bound").with(
        "specimen = { mass_in_force_kg = 60, stiffness_n_per_m = 1e4 }\n\
         structure.shear_building.mass_kg = [20, 6e3]",
    );
    for text in [&hardening, &light] {
        // The refusal of the equivalent linear method of the family, λ = 4.
        let (code, _, said) = gusset("check", &text.with("integrator.lambda = 4"));
        assert_eq!(code, 1, "{said}");
        for (command, refused) in [("check", 1), ("run", 2)] {
            let (code, _, said) = gusset(command, &text.with(method));
            assert_eq!(code, refused, "{said}");
            assert!(said.contains(grows), "{said}");
        }
        let allowed = text
            .with(method)
            .with("integrator.allow_unstable_lambda = true");
        let (code, facts, said) = gusset("check", &allowed);
        assert_eq!(code, 0, "{said}");
        assert!(said.contains(grows), "{said}");
        assert_eq!(facts["structure"]["stable"], false);
        assert!(
            facts["structure"]["spectral_radius_at_bounds"]
                .as_f64()
                .unwrap()
                > 1.0
        );
    }
    // A law of this program moves nothing that can break: the test runs, and `check` exits with 1.
    let (before, _) = HARDENING.split_once("stiffness_n_per_m = 1e7").unwrap();
    let law = "reach_disp_m = 1.0\nlaw.square_root = { stiffness_n_per_m = 1e7, hardening_per_sqrt_m = 0.5 }\n";
    let (code, found, said) = gusset("check", &format!("{before}{law}").with(method));
    assert_eq!(
        (code, &found["verdict"]["outcome"]),
        (1, &"simulated".into())
    );
    assert!(said.contains(grows), "{said}");
}

#[test]
fn check_states_what_is_known_of_alpha() {
    let look = |text: &str| {
        let folder = TempDir::new().unwrap();
        let file = folder.path().join("test.toml");
        std::fs::write(&file, text).unwrap();
        let mut process = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
        let output = process
            .args(["check", "--no-rehearsal", "--verbose"])
            .arg(&file)
            .output()
            .unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    };
    let method = "method = \"mkr_alpha\"\nrho_infinity = 0.5\n";
    // At its estimates, and half beyond them where the step is short enough.
    let linear = look(&format!("{TEST}{method}{SPECIMEN}"));
    let short = HARDENING.with("time.step_s = 0.001");
    let hardening = look(&format!("{short}[integrator]\n{method}"));
    for text in [&linear, &hardening] {
        assert!(text.contains("no proof"), "{text}");
        assert!(text.contains("continuous time"), "{text}");
        assert!(
            !text.contains("UNSTABLE") && !text.contains("recursion"),
            "{text}"
        );
    }
    assert!(
        hardening.contains("radius is 0.99") && hardening.contains("not grow"),
        "{hardening}"
    );
    let average = look(&format!("{TEST}method = \"newmark_average\"\n"));
    assert!(average.contains("no proof"), "{average}");
}
