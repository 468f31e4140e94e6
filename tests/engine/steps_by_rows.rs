//! A step that is made some rows at a time against the same step made as a whole, with every kind of load, to the bit.

use crate::common::engine::run;
use gusset_control::engine::Ending;

/// A bound that cannot trip. Its account of energy looks at whole steps, so none is made by rows.
const WHOLE: &str = "[safety.added_energy_share]\ntrip = 1e9\nfloor_j = 1e9\n";

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn every_load_gives_the_whole_steps_bits() {
    let chain = |dofs: usize| {
        format!(
            "[structure.chain]\ndofs = {dofs}\nmass_kg = 150\nstiffness_n_per_m = 2.5e5\ndamping_n_s_per_m = 10\n\
             absolute_damper.bilinear = {{ stiffness_n_per_m = 5e4, yield_force_n = 50, post_yield_ratio = 0.05 }}\n"
        )
    };
    let sine = "signal.sine = { amplitude = 300, frequency_hz = 3 }\n";
    let loads = |dofs: usize| {
        let pattern: Vec<f64> = (0..dofs).map(|i| 1.0 + (i % 7) as f64).collect();
        let base =
            "[excitation.base_displacement]\nsignal.sine = { amplitude = 0.1, frequency_hz = 1 }\n";
        [
            // On every DOF: made row by row. On few: not.
            format!("[[excitation.nodal_force]]\npattern = {pattern:?}\n{sine}"),
            format!("[[excitation.nodal_force]]\ndofs = [2]\n{sine}"),
            base.to_owned(),
        ]
    };
    // Within one block of the factor, and in several.
    for dofs in [3_usize, 100, 3000] {
        // All of a small structure, and some of a large one.
        let shown: Vec<usize> = (1..=dofs).step_by(dofs.div_ceil(60)).collect();
        for (kind, load) in loads(dofs).iter().enumerate() {
            let text = |more: &str| {
                format!(
                    "[time]\nrate_hz = 256\nduration_s = 0.234375\n[integrator]\nlambda = 4\n{}\n{load}\n\
                     [[specimen]]\nname = \"spring\"\nstorey = 1\nlaw.linear = {{ stiffness_n_per_m = 2e4 }}\n\
                     [record]\ndofs = {shown:?}\n{more}",
                    chain(dofs)
                )
            };
            let [by_rows, whole] = ["", WHOLE].map(|more| run(&text(more)));
            assert_eq!(whole.outcome.ending, Ending::Completed);
            assert_eq!(whole.rows.len(), by_rows.rows.len());
            for dof in &shown {
                for name in ["x", "v", "a"].map(|letter| format!("{letter}{dof}")) {
                    let (one, other) = (whole.column(&name), by_rows.column(&name));
                    assert_eq!(one.len(), 61);
                    assert_eq!(bits(&one), bits(&other), "{dofs} {kind} {name}");
                }
            }
            let accel = whole.column("a1");
            assert!(
                accel.iter().any(|accel| accel.abs() > 1e-6),
                "{dofs} {kind}"
            );
        }
    }
}
