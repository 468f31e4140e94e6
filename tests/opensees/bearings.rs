//! Bearings in two directions against the real OpenSees: forces along a path of straight legs.

use std::io::Write;
use std::process::{Command, Stdio};

use gusset_actuator::specimen::SpecimenLaw;
use serde_json::Value;

use crate::programs::python;

/// Our bearing, and that of OpenSees. Its stiffness of the pendulum contains N/R.
const BEARINGS: [(&str, &str); 3] = [
    (
        "bearing.elastomeric = { stiffness_n_per_m = 1.1e6, characteristic_strength_n = 1e3, post_yield_stiffness_n_per_m = 1e5 }",
        "elastomericBearingPlasticity:1.1e6,1e3,0.09090909090909091,0,1",
    ),
    (
        "bearing.elastomeric = { stiffness_n_per_m = 1.1e6, characteristic_strength_n = 1e3, post_yield_stiffness_n_per_m = 1e5, \
         smooth = true }",
        "elastomericBearingBoucWen:1.1e6,1e3,0.09090909090909091,0,1,2,0.5,0.5",
    ),
    (
        "bearing.friction_pendulum = { radius_m = 2, stiffness_n_per_m = 1e6, friction_slow = 0.05, friction_fast = 0.05, rate_s_per_m = 0, \
         largest_axial_force_n = 2e4 }",
        "singleFPBearing:0.05,2.0,1.01e6,2e4",
    ),
];

/// Turning points in mm.
const PATH: [[f64; 2]; 9] = [
    [5.0, 0.0],
    [5.0, 4.0],
    [-2.0, 6.0],
    [-6.0, -1.0],
    [-5.5, -1.0],
    [0.0, -8.0],
    [9.0, 3.0],
    [0.0, 0.0],
    [-9.0, 9.0],
];

/// Steps of OpenSees between two turning points, and between two forces that are compared.
const STEPS: (usize, usize) = (8000, 1000);

/// OpenSees returns to the circle after each step, we follow it exactly: the difference decreases with the step.
#[test]
fn bearings_act_as_in_opensees() {
    let Some(python) = python() else {
        return;
    };
    let mut path = Vec::new();
    let mut from = [0.0; 2];
    for turn in PATH {
        let to = turn.map(|mm| 1e-3 * mm);
        for step in 1..=STEPS.0 {
            let share = step as f64 / STEPS.0 as f64;
            path.push([0, 1].map(|i| from[i] + share * (to[i] - from[i])));
        }
        from = to;
    }
    for (ours, theirs) in BEARINGS {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/opensees/bearing.py");
        let mut child = Command::new(&python)
            .args([script, theirs])
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let text = serde_json::to_string(&path).unwrap();
        // OpenSees reads all before it answers.
        stdin.write_all(text.as_bytes()).unwrap();
        drop(stdin);
        let said = child.wait_with_output().unwrap();
        let told = String::from_utf8_lossy(&said.stdout);
        let line = told.lines().find(|line| line.contains("\"forces\""));
        let found: Value = serde_json::from_str(line.unwrap()).unwrap();
        let wanted: Vec<[f64; 2]> = serde_json::from_value(found["forces"].clone()).unwrap();
        assert_eq!(wanted.len(), path.len());
        let sizes = wanted.iter().flatten().map(|force| force.abs());
        let peak = sizes.fold(0.0, f64::max);

        let law: SpecimenLaw = toml::from_str(ours).unwrap();
        let mut bearing = law.build(2).unwrap();
        for place in (STEPS.1 - 1..path.len()).step_by(STEPS.1) {
            let mut force = [0.0; 2];
            bearing.trial(&path[place], &[0.0; 2], 0.0, &mut force);
            bearing.commit();
            for (found, wanted) in force.iter().zip(wanted[place]) {
                let off = (found - wanted).abs() / peak;
                assert!(off < 5e-4, "{theirs} {place}: {off:e}, {found} {wanted}");
            }
        }
    }
}
