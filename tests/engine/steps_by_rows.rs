//! A step that is made some rows at a time against the same step made as a whole, with every kind of load, to the bit.

use gusset_control::engine::{Numerical, Side};
use gusset_control::port::Port;

use crate::common::engine::prepare;

/// The numerical side of a test with a specimen, and the specimen's port, which never measured anything.
fn numerical(structure: &str, excitation: &str) -> (Box<Numerical>, Vec<Port>) {
    let test = prepare(&format!(
        "[time]\nrate_hz = 256\nduration_s = 1\n[integrator]\nlambda = 4\n{structure}\n{excitation}\n\
         [[specimen]]\nname = \"spring\"\nstorey = 1\nlaw.linear = {{ stiffness_n_per_m = 2e4 }}\n"
    ));
    let Side::Structure(numerical) = test.experiment.side else {
        panic!("a structure");
    };
    (numerical, test.experiment.ports)
}

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
    for dofs in [3, 100, 3000] {
        for (kind, load) in loads(dofs).iter().enumerate() {
            let (mut whole, mut ports) = numerical(&chain(dofs), load);
            let (mut by_rows, mut others) = numerical(&chain(dofs), load);
            for step in 0..60 {
                let dt = if step == 0 { 0.0 } else { 1.0 / 256.0 };
                whole.close(step, dt, &mut ports);
                whole.advance(step).unwrap();
                by_rows.make_step(step, dt, &mut others).unwrap();
                whole.output_accel();
                by_rows.output_accel();
                let pairs = [
                    (&whole.state.disp, &by_rows.state.disp),
                    (&whole.state.vel, &by_rows.state.vel),
                    (&whole.inertia, &by_rows.inertia),
                    (&whole.reported_vel, &by_rows.reported_vel),
                    (&whole.accel, &by_rows.accel),
                ];
                for (which, (one, other)) in pairs.into_iter().enumerate() {
                    assert_eq!(bits(one), bits(other), "{dofs} {kind} {step} {which}");
                }
            }
            assert!(
                whole.accel[1].abs() > 1e-6,
                "{dofs} {kind}: {}",
                whole.accel[1]
            );
        }
    }
}
