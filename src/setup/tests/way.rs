//! A compensator's effect between two targets is reported where it sees the curvature of that path.

use super::*;

/// Warnings about a specimen with this compensator.
fn told(compensation: &str, sets: &[&str]) -> Vec<String> {
    let text = format!("{PRESCRIBED}\n[specimen.compensation]\n{compensation}\n");
    let loaded = accepted(&text, sets);
    let warnings = loaded.warnings.iter();
    warnings.map(|warning| warning.render(false)).collect()
}

#[test]
fn curvature_jumps_are_reported() {
    let several = "time.ticks_per_step=20";
    let jerks = [
        "amb = {}",
        "ats = { delay_s = 0.01 }",
        "recursive_fir = { delay_s = 0.01 }",
        "polynomial = { order = 2, delay_s = 0.01, nodes = \"step\" }",
        "model_inverse = { coefficients = [1.0, 0.02, 1e-4] }",
    ];
    for compensation in jerks {
        assert_eq!(told(compensation, &[]), [""; 0], "{compensation}");
        let found = told(compensation, &[several]);
        let [one] = found.as_slice() else {
            panic!("{compensation}: {found:?}");
        };
        shows(one, compensation.split(' ').next().unwrap());
        shows(one, "`prediction_order = 3`");
        shows(one, "nodes = \"delay\"");
        // A remedy that is already in use is not advised.
        let cubic = told(compensation, &[several, "time.prediction_order=3"]);
        assert!(
            cubic.len() == 1 && !cubic[0].contains("`prediction_order = 3`"),
            "{cubic:?}"
        );
    }
    let smooth = [
        "polynomial = { order = 3, delay_s = 0.01 }",
        "inverse = { delay_s = 0.01 }",
        "model_inverse = { coefficients = [1.0, 0.02] }",
        "ats = { delay_s = 0.01, order = 1 }",
        "pi_lead = {}",
    ];
    for compensation in smooth {
        assert_eq!(told(compensation, &[several]), [""; 0], "{compensation}");
    }
}
