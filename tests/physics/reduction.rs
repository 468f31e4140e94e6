//! A reduced structure with all modes takes the steps of its model, and with enough modes nearly so.

use crate::common::engine::{Run, distance, prepare, run};
use crate::common::test_file::TestFile;
use gusset_control::engine::{Ending, Side};

/// Masses of a chain of 14, of which some are zero.
const MASSES: [f64; 14] = [
    900.0, 1200.0, 800.0, 0.0, 700.0, 1100.0, 0.0, 1300.0, 600.0, 0.0, 1000.0, 500.0, 900.0, 1400.0,
];

/// M and K of the chain, in the lines of a test file; `filled` gives every direction mass.
fn chain(filled: bool) -> String {
    let n = MASSES.len();
    let row = |entry: &dyn Fn(usize) -> f64| {
        let all: Vec<String> = (0..n).map(|j| format!("{:?}", entry(j))).collect();
        format!("[{}]", all.join(", "))
    };
    let spring = |i: usize| 4e6 * (1.0 + 0.1 * i as f64);
    let stiffness = |i: usize, j: usize| match i.abs_diff(j) {
        0 => spring(i) + if i + 1 < n { spring(i + 1) } else { 0.0 },
        1 => -spring(i.max(j)),
        _ => 0.0,
    };
    let mass = |i: usize| if filled { MASSES[i] + 100.0 } else { MASSES[i] };
    let masses: Vec<String> = (0..n)
        .map(|i| row(&|j| if i == j { mass(i) } else { 0.0 }))
        .collect();
    let springs: Vec<String> = (0..n).map(|i| row(&|j| stiffness(i, j))).collect();
    let dashpots: Vec<String> = (0..n)
        .map(|i| row(&|j| 1e-3 * stiffness(i, j) * if i == 4 && j == 4 { 2.0 } else { 1.0 }))
        .collect();
    let damping = if filled {
        format!("damping = [{}]\n", dashpots.join(", "))
    } else {
        String::new()
    };
    format!(
        "[structure.matrices]\nmass = [{}]\nstiffness = [{}]\n{damping}",
        masses.join(", "),
        springs.join(", ")
    )
}

/// Ground, a force, a weight, an initial state, an element and a specimen.
fn test(filled: bool, damping: &str) -> String {
    let at = |dof: usize, value: f64| {
        let mut all = [0.0; 14];
        all[dof - 1] = value;
        format!("{all:?}")
    };
    format!(
        "[time]\nrate_hz = 512\nduration_s = 3\nclock = \"simulated\"\n\
         [integrator]\nlambda = 4\n\
         [structure]\ninitial_displacement_m = {}\nstatic_load_n = {}\n{damping}\
         {}\n\
         [[structure.element]]\nfrom = \"ground\"\nto = 7\n\
         law.bilinear = {{ stiffness_n_per_m = 2e6, yield_force_n = 4e3, post_yield_ratio = 0.05 }}\n\
         [[excitation.nodal_force]]\ndofs = [3]\nsignal.sine = {{ amplitude = 3e3, frequency_hz = 3.0 }}\n\
         [excitation.ground_acceleration]\nsignal.sine = {{ amplitude = 2.0, frequency_hz = 1.1 }}\n\
         [[specimen]]\nname = \"brace\"\nrows = [{}]\nlaw.linear = {{ stiffness_n_per_m = 1e6 }}\n",
        at(12, 0.01),
        at(3, 2e4),
        chain(filled),
        at(14, 1.0),
    )
}

/// Largest difference of displacements and forces of `kept`, DOFs of the model from 1.
fn difference(reduced: &Run, full: &Run, kept: &[usize], columns: &[&str]) -> f64 {
    assert_eq!(reduced.outcome.ending, Ending::Completed);
    let dofs = kept.iter().enumerate().flat_map(|(place, dof)| {
        let letters = ["x", "v"].into_iter();
        letters.map(move |x| (format!("{x}{}", place + 1), format!("{x}{dof}")))
    });
    let others = columns
        .iter()
        .map(|name| (name.to_string(), name.to_string()));
    let each = dofs.chain(others);
    let each = each.map(|(own, of_full)| distance(&reduced.column(&own), &full.column(&of_full)));
    each.fold(0.0, f64::max)
}

#[test]
fn all_modes_take_the_steps_of_the_model() {
    let rule = "damping.rayleigh_ratio = { ratio = 0.03, modes = [1, 3] }\n";
    let modal = "damping.modal = { ratios = [0.03] }\n";
    for (filled, damping, kept, modes) in [
        (true, "", vec![7, 12, 14], 11),
        // Without mass: 7, which is kept, and 4 and 10, which are not.
        (false, rule, vec![7, 12, 14], 9),
        (false, modal, vec![2, 7, 12, 14], 8),
    ] {
        let full = test(filled, damping);
        let keep = kept.iter().filter(|dof| **dof == 2).collect::<Vec<_>>();
        let reduce = format!("structure.reduce = {{ modes = {modes}, keep = {keep:?} }}");
        let reduced = full.with(&reduce);
        let facts = prepare(&reduced).facts.structure.unwrap();
        assert_eq!(facts.dofs, kept.len() + modes);
        let found = facts.reduction.unwrap();
        assert_eq!((found.named, found.modes), (keep.len(), modes));
        let places: Vec<String> = kept.iter().map(|dof| format!("model DOF {dof}")).collect();
        assert_eq!(facts.places[..kept.len()], places);
        assert_eq!(facts.places[kept.len()], "mode 1");
        let off = difference(&run(&reduced), &run(&full), &kept, &["force_1_1"]);
        assert!(off < 1e-9, "{damping}: {off:e}");
        // With fewer modes the error is small, and is seen.
        let few = full.with(&format!(
            "structure.reduce = {{ modes = 4, keep = {keep:?} }}"
        ));
        let off = difference(&run(&few), &run(&full), &kept, &["force_1_1"]);
        assert!(off > 1e-6, "{damping}: {off:e}");
    }
}

#[test]
fn ground_loads_the_whole_model() {
    let [ground, still] = [2.0, 0.0].map(|amplitude| {
        let keys = format!(
            "structure.reduce.modes = 0\nexcitation.ground_acceleration.signal.sine.amplitude = {amplitude}"
        );
        let prepared = prepare(&test(true, "").with(&keys));
        let reduction = prepared.facts.structure.unwrap().reduction.unwrap().reduction;
        let Side::Structure(numerical) = prepared.experiment.side else {
            panic!("no structure");
        };
        let mut load = vec![0.0; 3];
        numerical.excitation.load_into(100, &mut load);
        (load, reduction)
    });
    let accel = 2.0 * libm::sin(std::f64::consts::TAU * 1.1 * 100.0 / 512.0);
    let expected = ground.1.ground_load(&[1.0; 14]);
    for ((load, still), expected) in ground.0.iter().zip(&still.0).zip(expected) {
        let off = (load - still) / (accel * expected) - 1.0;
        assert!(off.abs() < 1e-9, "{off:e}");
    }
}

/// A bay of storeys whose columns yield in the lowest one and are elastic above.
fn frame(storeys: usize) -> String {
    let mut text = "[time]\nrate_hz = 512\nduration_s = 3\nclock = \"simulated\"\n\
         [integrator]\nlambda = 4\n\
         [structure.damping.rayleigh_ratio]\nratio = 0.02\nmodes = [1, 2]\n\
         [structure.frame.material.steel.menegotto_pinto]\n\
         young_pa = 2e11\nyield_pa = 355e6\nhardening_ratio = 0.01\n\
         [structure.frame.section]\n\
         column.i_shape = { material = \"steel\", depth_m = 0.3, flange_width_m = 0.3, flange_thickness_m = 0.019, web_thickness_m = 0.011 }\n\
         beam.elastic = { young_pa = 2e11, area_m2 = 0.012, inertia_m4 = 3e-4 }\n\
         above.elastic = { young_pa = 2e11, area_m2 = 0.0149, inertia_m4 = 2.5e-4 }\n"
        .to_owned();
    for storey in 0..=storeys {
        for (name, x) in [("A", 0), ("B", 6)] {
            let rest = match storey {
                0 => "fixed = [\"x\", \"y\", \"rz\"]",
                _ => "mass_kg = 30e3",
            };
            let y = 3.5 * storey as f64;
            text.push_str(&format!(
                "[[structure.frame.node]]\nname = \"{name}{storey}\"\nat_m = [{x}, {y}]\n{rest}\n"
            ));
            if storey > 0 {
                text.push_str(&format!(
                    "[[structure.frame.load]]\nnode = \"{name}{storey}\"\ny_n = -2e5\n\
                     [[structure.frame.member]]\nnodes = [\"{name}{}\", \"{name}{storey}\"]\n{}\n",
                    storey - 1,
                    match storey {
                        1 => "section = \"column\"\nkind = \"force_based\"\nrecord = true",
                        _ => "section = \"above\"",
                    }
                ));
            }
        }
        if storey > 0 {
            text.push_str(&format!(
                "[[structure.frame.member]]\nnodes = [\"A{storey}\", \"B{storey}\"]\nsection = \"beam\"\n"
            ));
        }
    }
    text + "[excitation.ground_acceleration]\nsignal.ricker = { amplitude = 9.0, frequency_hz = 1.5 }\n"
}

#[test]
fn frame_that_yields_below_is_reduced_above() {
    let full = frame(4);
    let reduced = |modes: usize| {
        full.with(&format!(
            "structure.reduce = {{ modes = {modes}, keep = [{{ node = \"A4\", direction = \"x\" }}] }}"
        ))
    };
    let facts = prepare(&reduced(6)).facts.structure.unwrap();
    let kept = ["A1 x", "A1 y", "A1 rz", "B1 x", "B1 y", "B1 rz", "A4 x"];
    assert_eq!(facts.places[..7], kept);
    // The rotations of A1 and B1 have no mass: the rest of their shapes moves by itself.
    assert_eq!(facts.places[13..], ["shape 1", "shape 2"]);
    assert_eq!(facts.rotations, [2, 5]);
    let whole = run(&full);
    // It yields: the base moment is beyond the elastic one.
    let rotation = whole.column("rotation_start_1");
    let largest = rotation.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    assert!(largest > 5e-3, "{largest}");
    let model = [1, 2, 3, 4, 5, 6, 19];
    let off = |modes: usize| difference(&run(&reduced(modes)), &whole, &model, &[]);
    let (few, enough, all) = (off(2), off(8), off(11));
    assert!(few > 1e-2 && enough < 1e-3, "{few:e} {enough:e}");
    // The search for the balance of rows without mass takes other steps.
    assert!(all < 1e-3, "{all:e}");
}
