//! Plastic hinges against the real OpenSees: forces along cyclic paths.

use std::process::Command;

use gusset_numerics::law::LawSpec;
use serde_json::{Value, json};

use crate::programs::python;

/// Hinges of steel and concrete members: yield at 8 and 6 mrad. The second is a composite beam.
const HINGES: [&str; 3] = [
    "imk = { stiffness_n_per_m = 5e7, yield_force_n = 4e5, capping_ratio = 1.1, plastic_disp_m = 0.025, post_capping_disp_m = 0.1, \
     ultimate_disp_m = 0.4, residual_ratio = 0.4, strength_lambda_m = 0.9, post_capping_lambda_m = 0.8, unloading_lambda_m = 1.4 }",
    "imk = { stiffness_n_per_m = 5e7, yield_force_n = 4e5, capping_ratio = 1.2, plastic_disp_m = 0.03, post_capping_disp_m = 0.12, \
     ultimate_disp_m = 0.11, residual_ratio = 0.3, strength_lambda_m = 0.8, post_capping_lambda_m = 0.7, unloading_lambda_m = 1.0, \
     strength_exponent = 1.2, deterioration_factor = 0.9, negative = { yield_force_n = 3e5, capping_ratio = 1.05, \
     plastic_disp_m = 0.02, post_capping_disp_m = 0.08, ultimate_disp_m = 0.15, residual_ratio = 0.2, deterioration_factor = 1.0 } }",
    "imk = { response = \"peak_oriented\", stiffness_n_per_m = 5e7, yield_force_n = 3e5, capping_ratio = 1.15, plastic_disp_m = 0.03, \
     post_capping_disp_m = 0.1, ultimate_disp_m = 0.2, residual_ratio = 0.2, strength_lambda_m = 0.6, post_capping_lambda_m = 0.8, \
     unloading_lambda_m = 1.0, reloading_lambda_m = 0.5, unloading_exponent = 1.1 }",
];

/// Turning points: growing cycles past the cap to the residual force, cycles on one side, and partial cycles, with failure at the end.
const PATHS: [&[f64]; 3] = [
    &[
        0.005, -0.005, 0.0123, -0.0124, 0.0201, -0.0203, 0.0304, -0.0307, 0.0452, -0.0449, 0.0703,
        -0.0708, 0.0954, -0.0957,
    ],
    &[
        0.0201, 0.0042, 0.0306, 0.0007, 0.0511, 0.0093, 0.0704, -0.0012, 0.1009, 0.03,
    ],
    &[
        -0.0153, -0.0081, -0.0167, 0.0207, 0.0121, 0.0298, 0.0243, -0.0251, 0.0102, -0.0404,
        0.0602, 0.0503, -0.0907, 0.1201, -0.1, 0.2102, 0.1, -0.21,
    ],
];

/// Steps between two turning points, and between two forces that are compared.
const STEPS: (usize, usize) = (4000, 200);

/// OpenSees notices an event at the end of its step, we where it lies: the difference decreases with the step.
#[test]
fn hinges_yield_and_fail_as_in_opensees() {
    let Some(python) = python() else {
        return;
    };
    let mut cases = Vec::new();
    for hinge in HINGES {
        let law: LawSpec = toml::from_str(hinge).unwrap();
        for turns in PATHS {
            let law_of_opensees = &serde_json::to_value(&law).unwrap()["imk"];
            let case = json!({ "law": law_of_opensees, "turns": turns, "steps": STEPS.0, "each": STEPS.1 });
            cases.push((law.clone(), turns, case));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cases.json");
    let text: Vec<&Value> = cases.iter().map(|(.., case)| case).collect();
    std::fs::write(&file, serde_json::to_string(&text).unwrap()).unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/opensees/hinge.py");
    let said = Command::new(&python)
        .arg(script)
        .arg(&file)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&said.stdout).into_owned();
    let lines: Vec<&str> = told.lines().filter(|line| line.starts_with('{')).collect();
    assert_eq!(
        lines.len(),
        cases.len(),
        "{told}{}",
        String::from_utf8_lossy(&said.stderr)
    );

    for ((law, turns, _), line) in cases.iter().zip(lines) {
        let theirs: Value = serde_json::from_str(line).unwrap();
        let theirs: Vec<f64> = serde_json::from_value(theirs["force"].clone()).unwrap();
        let mut hinge = law.build().unwrap();
        let (mut ours, mut from) = (Vec::new(), 0.0);
        for turn in *turns {
            for step in (STEPS.1..=STEPS.0).step_by(STEPS.1) {
                let disp = from + (turn - from) * step as f64 / STEPS.0 as f64;
                ours.push(hinge.step(disp, 0.0, 0.0));
            }
            from = *turn;
        }
        assert_eq!(ours.len(), theirs.len());
        let peak = theirs.iter().fold(0.0, |most: f64, f| most.max(f.abs()));
        for (place, (a, b)) in ours.iter().zip(&theirs).enumerate() {
            let off = (a - b).abs() / peak;
            assert!(off < 1e-5, "{law:?} {turns:?} {place}: {off:e}, {a} {b}");
        }
    }
}
