//! λ beyond its limit and methods outside of their domain: reported with the numbers before anything moves, and refused where a
//! specimen behind a link would move.

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::test_file::TestFile;

/// Two floors of 1000 kg, 4e5 and 1e5 N/m, 10 steps a second: Ω = 2.24 in the second mode, so that λ has a limit.
const TEST: &str = r#"title = "Linear"
[time]
step_s = 0.1
duration_s = 2
clock = "simulated"
[structure.shear_building]
mass_kg = [1000, 1000]
stiffness_n_per_m = [0, 1e5]
[excitation.ground_acceleration.signal.sine]
frequency_hz = 0.5
amplitude = 3.0
"#;

const LAW: &str = "\n[[specimen]]\nname = \"column\"\nstorey = 1\nlaw = { linear = { stiffness_n_per_m = 4e5 } }\n";
const LINK: &str = "\n[[specimen]]\nname = \"column\"\nstorey = 1\nstiffness_n_per_m = 4e5\n[specimen.link]\n\
                    address = \"127.0.0.1:1\"\nconnect_timeout_s = 0.2\n[specimen.limits]\n\
                    command_disp_m = { trip = [-1, 1] }\nmeasured_force_n = { trip = [-1e6, 1e6] }\n";

/// 4Ω²/(Ω² − 4) of the second mode: the paper's limit for a linear system.
fn limit() -> f64 {
    // ω² from (5e5 − 1e3 ω²)(1e5 − 1e3 ω²) = 1e10.
    let half = 300.0f64;
    let square = (half + (half * half - 4e4).sqrt()) * 0.01;
    4.0 * square / (square - 4.0)
}

/// Exit code, summary or facts, and messages.
fn gusset(command: &str, text: &str) -> (i32, Value, String) {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("test.toml");
    std::fs::write(&file, text).unwrap();
    let mut process = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    process.arg(command).arg(&file).arg("--json");
    let out = folder.path().join("out");
    if command == "run" {
        process.arg("--quiet").arg("--out").arg(&out);
    }
    let output = process.output().unwrap();
    let code = output.status.code().unwrap();
    if code == 2 {
        assert!(!out.exists(), "nothing is moved, nothing is left");
    }
    (
        code,
        serde_json::from_slice(&output.stdout).unwrap_or(Value::Null),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn linear_model_beyond_its_limit_warns() {
    let (above, below) = (1.01 * limit(), 0.99 * limit());
    let (code, _, said) = gusset(
        "run",
        &format!("{TEST}[integrator]\nlambda = {above}\n{LAW}"),
    );
    assert_eq!(code, 0, "{said}");
    let words = format!(
        "is above the limit {:.4} at the declared stiffness",
        limit()
    );
    assert!(said.contains("warning") && said.contains(&words), "{said}");
    let (_, facts, said) = gusset(
        "check",
        &format!("{TEST}[integrator]\nlambda = {above}\n{LAW}"),
    );
    assert!(said.contains(&words), "{said}");
    assert_eq!(facts["structure"]["stable"], false);
    let found = facts["structure"]["lambda_limit"].as_f64().unwrap();
    assert!((found / limit() - 1.0).abs() < 1e-9);
    let (_, facts, said) = gusset(
        "check",
        &format!("{TEST}[integrator]\nlambda = {below}\n{LAW}"),
    );
    assert!(!said.contains("above the"), "{said}");
    assert_eq!(facts["structure"]["stable"], true);
}

/// Severity and key of the first finding of a verdict.
fn first(facts: &Value) -> (&str, &str) {
    let finding = &facts["verdict"]["findings"][0];
    let text = |key: &str| finding[key].as_str().unwrap();
    (text("severity"), text("key"))
}

#[test]
fn unstable_lambda_behind_a_link_is_refused() {
    let above = 1.01 * limit();
    let keys = format!("time.clock = 'real'\nintegrator.lambda = {above}\n");
    let text = TEST.with(&(keys + LINK));
    let (code, facts, said) = gusset("check", &text);
    assert_eq!(
        (code, first(&facts)),
        (1, ("error", "integrator.lambda")),
        "{said}"
    );
    let numbers = &facts["verdict"]["findings"][0]["numbers"];
    assert_eq!(numbers["lambda"], above);
    assert!((numbers["lambda_limit"].as_f64().unwrap() / limit() - 1.0).abs() < 1e-9);
    let (code, _, said) = gusset("run", &text);
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("accept_unstable"), "{said}");
    // On the simulated clock nothing that moves can break: the test continues to its link, which has no server.
    let simulated = text.with("time.clock = 'simulated'\nspecimen.link.computed = true");
    assert_eq!(gusset("run", &simulated).0, 3);
    let older = text.with("integrator.allow_unstable_lambda = true");
    let newer = format!("{text}[safety]\naccept_unstable = \"a study\"\n");
    for allowed in [older, newer] {
        let (code, facts, said) = gusset("check", &allowed);
        assert_eq!(
            (code, first(&facts)),
            (0, ("accepted", "integrator.lambda")),
            "{said}"
        );
        assert_eq!(facts["verdict"]["outcome"], "accepted");
        // The test then continues to the link, which has no server.
        assert_eq!(gusset("run", &allowed).0, 3);
    }
    // Such a long step has a large error.
    let lambda = 0.99 * limit();
    let stable = text.with(&format!(
        "integrator.lambda = {lambda}\nsafety.accept_error = 'a study'"
    ));
    assert_eq!(gusset("check", &stable).0, 0);
    // Infinity is a λ as any other.
    let infinite = text.with("integrator.lambda = inf");
    assert_eq!(gusset("check", &infinite).0, 1);
    assert_eq!(gusset("run", &infinite).0, 2);
}

#[test]
fn unstable_at_any_lambda_moves_no_link() {
    // A specimen that may turn out stiffer than its estimate; its K0 is nearly zero.
    let text = format!("{TEST}{LINK}").with(
        "time.clock = 'real'\nintegrator.lambda = 4\nspecimen = { stiffness_n_per_m = 1e-6, hardening_bound = 1e12 }",
    );
    let (code, facts, said) = gusset("check", &text);
    assert_eq!(
        (code, first(&facts)),
        (1, ("error", "integrator.lambda")),
        "{said}"
    );
    assert_eq!(gusset("run", &text).0, 2);
}

#[test]
fn implicit_method_refuses_linked_specimen() {
    for (method, reason) in [
        ("newmark_average", "implicit"),
        ("newmark_linear", "implicit"),
        ("newmark_explicit", "explicit"),
        ("central_difference", "explicit"),
        ("chang_2002", "explicit"),
    ] {
        let text = format!("{TEST}[integrator]\nmethod = \"{method}\"\n{LINK}");
        let (code, _, said) = gusset("run", &text);
        assert_eq!(code, 2, "{method}: {said}");
        assert!(
            said.contains("cannot command") && said.contains(reason),
            "{method}: {said}"
        );
    }
}

#[test]
fn method_that_divides_by_mass_needs_it() {
    let massless = TEST
        .with("structure.shear_building = { mass_kg = [0, 1000], stiffness_n_per_m = [4e5, 1e5] }");
    for method in ["newmark_explicit", "central_difference", "chang_2002"] {
        let (code, _, said) = gusset(
            "check",
            &format!("{massless}[integrator]\nmethod = \"{method}\"\n"),
        );
        assert_eq!(code, 2, "{method}: {said}");
        assert!(
            said.contains("freedom 1") && said.contains("mass_kg = [0, 1000]"),
            "{method}: {said}"
        );
    }
    for keys in [
        "lambda = 3.9",
        "method = \"newmark_average\"",
        "method = \"newmark_linear\"",
        "method = \"kr_alpha\"\nrho_infinity = 0.8",
        "method = \"mkr_alpha\"\nrho_infinity = 0.8",
    ] {
        let (code, _, said) = gusset("run", &format!("{massless}[integrator]\n{keys}\n"));
        assert_eq!(code, 0, "{keys}: {said}");
    }
    // A full matrix that is singular without an empty row.
    let singular = TEST.without("structure.shear_building").with(
        "[structure.matrices]\nmass = [[1000, 1000], [1000, 1000]]\nstiffness = [[5e5, -1e5], [-1e5, 1e5]]",
    );
    let (code, _, said) = gusset("check", &singular);
    assert_eq!(code, 2);
    assert!(
        said.contains("positive definite") && said.contains("freedom 2"),
        "{said}"
    );
}

#[test]
fn parameters_out_of_domain_are_refused() {
    for (keys, words) in [
        ("lambda = 0", "greater than"),
        ("lambda = -4", "greater than"),
        ("lambda = nan", "greater than"),
        ("gain_bound = 0", "gain_bound"),
        ("method = \"kr_alpha\"\nrho_infinity = 1.0000001", "0 to 1"),
        ("method = \"kr_alpha\"\nrho_infinity = -0.1", "0 to 1"),
        ("method = \"mkr_alpha\"\nrho_infinity = 2", "0 to 1"),
        (
            "method = \"mkr_alpha\"\nrho_infinity = nan",
            "finite number",
        ),
        (
            "method = \"newmark_average\"\nnewton_tolerance = 0",
            "newton_tolerance",
        ),
        (
            "method = \"newmark_average\"\nnewton_tolerance = -1e-9",
            "newton_tolerance",
        ),
        (
            "method = \"newmark_average\"\nnewton_iterations = -1",
            "newton_iterations",
        ),
    ] {
        let (code, _, said) = gusset("check", &format!("{TEST}[integrator]\n{keys}\n{}", ""));
        assert_eq!(code, 2, "{keys}: {said}");
        assert!(said.contains(words), "{keys}: {said}");
    }
}

#[test]
fn failed_newton_names_step_and_residual() {
    let text = format!(
        "{}[integrator]\nmethod = \"newmark_average\"\nnewton_iterations = 2\n[[structure.element]]\nfrom = 1\nto = 2\n\
         reach_disp_m = 1\nlaw = {{ cubic = {{ stiffness_n_per_m = 1e5, cubic_n_per_m3 = 1e9 }} }}\n",
        TEST.with("structure.shear_building.stiffness_n_per_m = [4e5, 0]")
    );
    let (code, summary, _) = gusset("run", &text);
    assert_eq!(code, 1);
    assert_eq!(summary["status"], "stopped");
    let reason = summary["reason"].as_str().unwrap();
    // "step 3: no equilibrium in 2 iterations: 1.2e4 N are unbalanced at degree of freedom 2"
    let (step, rest) = reason.split_once(" 2 iterations: ").expect(reason);
    let (step, _) = step.rsplit_once(": ").expect(reason);
    let step: u64 = step.rsplit(' ').next().unwrap().parse().unwrap();
    assert_eq!(step, summary["steps"].as_u64().unwrap() + 1, "{reason}");
    let residual: f64 = rest.split(' ').next().unwrap().parse().expect(reason);
    assert!(residual > 0.0 && residual.is_finite());
    let dof: u64 = rest.rsplit(' ').next().unwrap().parse().expect(reason);
    assert!((1..=2).contains(&dof), "{reason}");
}
