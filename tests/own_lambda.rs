//! Storeys, elements, specimens and modes with a λ of their own: real in a run, proven in `check`, and refused where they
//! contradict something.

use assert_cmd::Command;
use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use tempfile::TempDir;

const MASS: [f64; 3] = [900.0, 1100.0, 700.0];
const STIFFNESS: [f64; 3] = [2e8, 4e5, 3e5];
const DAMPING: [f64; 3] = [600.0, 500.0, 400.0];
const DT: f64 = 0.02;
const STEPS: usize = 400;

/// Storey 1 is far too stiff for the step (Ω = 9): it alone needs a small λ.
const TEST: &str = r#"
title = "Stiff ground storey"

[time]
step_s = 0.02
duration_s = 8
clock = "simulated"

[structure.shear_building]
mass_kg = [900, 1100, 700]
stiffness_n_per_m = [2e8, 4e5, 3e5]
damping_n_s_per_m = [600, 500, 400]

[excitation.ground_acceleration.signal.sine]
amplitude = 2.0
angular_frequency_rad_per_s = 5

[integrator]
"#;

/// Exit code, stdout, stderr; a run leaves its folder in `folder`.
fn gusset(folder: &TempDir, command: &str, text: &str) -> (i32, String, String) {
    let file = folder.path().join("test.toml");
    std::fs::write(&file, text).unwrap();
    let mut process = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    process.arg(command).arg(&file);
    match command {
        "run" => process
            .arg("--quiet")
            .arg("--out")
            .arg(folder.path().join("out")),
        _ => process.arg("--json"),
    };
    let output = process.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (
        output.status.code().unwrap(),
        text(output.stdout),
        text(output.stderr),
    )
}

/// Displacements of a run, row by row.
fn moved(text: &str) -> Vec<Vec<f64>> {
    let folder = TempDir::new().unwrap();
    let (code, _, said) = gusset(&folder, "run", text);
    assert_eq!(code, 0, "{said}");
    let csv = folder.path().join("all.csv");
    let mut export = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    let from = folder.path().join("out");
    export.args([
        "export",
        from.to_str().unwrap(),
        "--no-units-line",
        "--out",
        csv.to_str().unwrap(),
    ]);
    assert!(export.output().unwrap().status.success());
    let text = std::fs::read_to_string(csv).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = ["x1", "x2", "x3"].map(|name| head.iter().position(|c| *c == name).unwrap());
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            columns.iter().map(|c| cells[*c].parse().unwrap()).collect()
        })
        .collect()
}

/// k b bᵀ of storey `i` from 0.
fn storey(values: [f64; 3], i: usize) -> DMatrix<f64> {
    let mut b = DVector::zeros(3);
    b[i] = 1.0;
    if i > 0 {
        b[i - 1] = -1.0;
    }
    &b * b.transpose() * values[i]
}

fn whole(values: [f64; 3]) -> DMatrix<f64> {
    (0..3).map(|i| storey(values, i)).sum()
}

fn mass() -> DMatrix<f64> {
    DMatrix::from_diagonal(&DVector::from_row_slice(&MASS))
}

/// The recursion with M_eff = M + (Δt/2) C + Δt² K̃, written down with dense matrices.
fn recursion(weighted: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let (m, c, k) = (mass(), whole(DAMPING), whole(STIFFNESS));
    let effective = (&m + &c * (DT / 2.0) + weighted * (DT * DT)).lu();
    let (mut x, mut v) = (DVector::zeros(3), DVector::<f64>::zeros(3));
    let mut rows = Vec::new();
    for step in 0..=STEPS {
        rows.push(x.as_slice().to_vec());
        let ground = 2.0 * libm::sin(5.0 * DT * step as f64);
        let r = &m * DVector::from_element(3, -ground) - &c * &v - &k * &x;
        v += effective.solve(&r).unwrap() * DT;
        x += &v * DT;
    }
    rows
}

/// Two factorisations of matrices of condition about 10³ and 400 steps: roundoff is far below 1e-9 of the peak.
fn same(found: &[Vec<f64>], wanted: &[Vec<f64>]) {
    assert_eq!(found.len(), wanted.len());
    let peak = wanted.iter().flatten().fold(0.0f64, |p, x| p.max(x.abs()));
    assert!(peak > 0.01);
    for (a, b) in found.iter().flatten().zip(wanted.iter().flatten()) {
        assert!((a - b).abs() < 1e-9 * peak, "{a} {b}");
    }
}

#[test]
fn a_run_with_lambdas_of_storeys_is_the_recursion_with_them() {
    let found = moved(&format!(
        "{TEST}lambda = 8\nlambda_of_element = {{ \"storey 1\" = 3.5, \"storey 3\" = inf }}\n"
    ));
    let weighted = storey(STIFFNESS, 0) / 3.5 + storey(STIFFNESS, 1) / 8.0;
    same(&found, &recursion(&weighted));
}

#[test]
fn a_run_with_lambdas_of_modes_is_the_recursion_with_them() {
    let found = moved(&format!("{TEST}lambda = 3\nlambda_of_mode = [11.5, 6]\n"));
    // Modes by the symmetric form M^−½ K M^−½.
    let root = DMatrix::from_diagonal(&DVector::from_row_slice(&MASS.map(f64::sqrt)));
    let inverse = root.clone().try_inverse().unwrap();
    let eigen = (&inverse * whole(STIFFNESS) * &inverse).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let mut weighted = DMatrix::zeros(3, 3);
    for (j, lambda) in order.into_iter().zip([11.5, 6.0, 3.0]) {
        let u = &root * eigen.eigenvectors.column(j);
        weighted += &u * u.transpose() * (eigen.eigenvalues[j] / lambda);
    }
    same(&found, &recursion(&weighted));
}

#[test]
fn a_specimen_has_a_lambda_of_its_own_by_its_name() {
    let hybrid = TEST.replace("[2e8, 4e5, 3e5]", "[0, 4e5, 3e5]");
    let specimen = "\n[[specimen]]\nname = \"wall\"\nstorey = 1\nlaw = { linear = { stiffness_n_per_m = 2e8 } }\n";
    let found = moved(&format!(
        "{hybrid}lambda = 8\nlambda_of_element = {{ wall = 3.5 }}\n{specimen}"
    ));
    let rest = storey(STIFFNESS, 1) + storey(STIFFNESS, 2);
    same(
        &found,
        &recursion(&(storey(STIFFNESS, 0) / 3.5 + rest / 8.0)),
    );
}

fn check(keys: &str) -> Value {
    let folder = TempDir::new().unwrap();
    let (code, text, said) = gusset(&folder, "check", &format!("{TEST}{keys}\n"));
    let found: Value = serde_json::from_str(&text).unwrap();
    let unstable = found["verdict"]["unstable"] == true;
    assert_eq!(code, i32::from(unstable), "{said}");
    found
}

#[test]
fn check_proves_the_rest_beside_what_is_given_and_shows_what_is_gained() {
    let plain = check("lambda = \"auto\"");
    let own = check("lambda = 11.5\nlambda_of_element = { \"storey 1\" = 3 }");
    let (plain, own) = (&plain["structure"], &own["structure"]);
    // One λ for all must be small, for the sake of one storey.
    assert!(plain["lambda"].as_f64().unwrap() < 4.0, "{plain}");
    assert_eq!(own["lambda_apart"]["storey 1"], 3.0);
    assert_eq!(
        (&own["stable"], &own["lambda_limit"]),
        (&Value::Bool(true), &Value::Null)
    );
    let error = |of: &Value, mode: usize| of["modes"][mode]["period_error"].as_f64().unwrap().abs();
    for mode in 0..2 {
        assert!(error(own, mode) < 0.1 * error(plain, mode), "{plain} {own}");
    }
    // The poles are those of the recursion: λ_1 for the ground storey, as an independent eigenvalue problem says.
    let weighted =
        storey(STIFFNESS, 0) / 3.0 + (storey(STIFFNESS, 1) + storey(STIFFNESS, 2)) / 11.5;
    let effective = (mass() + whole(DAMPING) * (DT / 2.0) + weighted * (DT * DT)).lu();
    let (c, k) = (
        effective.solve(&whole(DAMPING)).unwrap() * DT,
        effective.solve(&whole(STIFFNESS)).unwrap() * (DT * DT),
    );
    let mut step = DMatrix::zeros(6, 6);
    let one = DMatrix::identity(3, 3);
    step.view_mut((0, 0), (3, 3)).copy_from(&(&one - &k));
    step.view_mut((0, 3), (3, 3)).copy_from(&(&one - &c));
    step.view_mut((3, 0), (3, 3)).copy_from(&(-&k));
    step.view_mut((3, 3), (3, 3)).copy_from(&(&one - &c));
    let mut swings: Vec<f64> = step
        .complex_eigenvalues()
        .iter()
        .filter(|z| z.im > 0.0)
        .map(|z| z.ln().norm())
        .collect();
    swings.sort_by(f64::total_cmp);
    for (mode, wanted) in swings.iter().take(2).enumerate() {
        let found = own["modes"][mode]["apparent_omega"].as_f64().unwrap();
        assert!((found / wanted - 1.0).abs() < 1e-9, "{found} {wanted}");
    }
    // By modes: the first two at 11.5 keep their share, the stiff one takes a λ that is stable.
    let by_mode = check("lambda_of_mode = [11.5, 11.5]");
    let by_mode = &by_mode["structure"];
    assert_eq!(by_mode["lambda_apart"]["mode 2"], 11.5);
    assert_eq!(by_mode["stable"], true);
    assert!(error(by_mode, 0) < 0.1 * error(plain, 0));
}

#[test]
fn what_is_given_too_large_is_said_to_leave_no_stable_rest() {
    let folder = TempDir::new().unwrap();
    let text = format!("{TEST}lambda_of_element = {{ \"storey 1\" = 11.5 }}\n");
    let (code, _, said) = gusset(&folder, "check", &text);
    assert_eq!(code, 2, "{said}");
    assert!(
        said.contains("no lambda is stable")
            && said.contains("a smaller lambda where a separate one is set"),
        "{said}"
    );
    // Asked for by number it is a warning, with the same words, before anything runs.
    let facts = check("lambda = 3\nlambda_of_element = { \"storey 1\" = 11.5 }");
    assert!(
        facts["warnings"][0]
            .as_str()
            .unwrap()
            .contains("no lambda is stable")
    );
}

#[test]
fn mistakes_are_shown_where_they_stand() {
    for (keys, words) in [
        (
            "lambda_of_element = { \"storey 4\" = 3 }",
            "no part \"storey 4\"",
        ),
        (
            "lambda_of_element = { \"story 2\" = 3 }",
            "did you mean \"storey 2\"?",
        ),
        (
            "lambda_of_element = { \"storey 2\" = 0 }",
            "greater than zero",
        ),
        (
            "lambda_of_element = { \"storey 2\" = -1 }",
            "greater than zero",
        ),
        (
            "lambda_of_element = { \"storey 2\" = \"auto\" }",
            "by name must be a number",
        ),
        (
            "lambda_of_mode = [4, 4, 4, 4]",
            "4 modes have a lambda, but the structure has 3",
        ),
        ("lambda_of_mode = [\"auto\"]", "by name must be a number"),
        ("lambda_of_mode = [nan]", "greater than zero"),
        (
            "lambda_of_mode = [4]\nlambda_of_element = { \"storey 2\" = 3 }",
            "cannot be used together",
        ),
        (
            "method = \"chang_2002\"\nlambda_of_mode = [4]",
            "`integrator.lambda_of_mode` has no effect",
        ),
        (
            "method = \"newmark_average\"\nlambda_of_element = { \"storey 2\" = 3 }",
            "`integrator.lambda_of_element` has no effect",
        ),
    ] {
        let folder = TempDir::new().unwrap();
        let (code, _, said) = gusset(&folder, "check", &format!("{TEST}{keys}\n"));
        assert_eq!(code, 2, "{keys}: {said}");
        assert!(said.contains(words), "{keys}: {said}");
    }
    let folder = TempDir::new().unwrap();
    let empty = TEST.replace("[2e8, 4e5, 3e5]", "[2e8, 0, 3e5]");
    let text = format!("{empty}lambda = 4\nlambda_of_element = {{ \"storey 2\" = 3 }}\n");
    let (_, _, said) = gusset(&folder, "check", &text);
    assert!(said.contains("has no initial stiffness"), "{said}");
    let folder = TempDir::new().unwrap();
    let chain = "[time]\nstep_s = 0.01\nduration_s = 1\nclock = \"simulated\"\n[structure.chain]\ndofs = 301\nmass_kg = 1\n\
                 stiffness_n_per_m = 100\n[integrator]\nlambda_of_mode = [4]\n";
    let (code, _, said) = gusset(&folder, "check", chain);
    assert_eq!(code, 2);
    assert!(said.contains("the limit is 300"), "{said}");
}
