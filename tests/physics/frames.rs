//! A frame is its condensed matrices: the same steps, and the same rest under its weight.

use crate::common::engine::{distance, prepare, run};
use crate::common::test_file::TestFile;
use gusset_control::engine::Ending;
use gusset_numerics::frame::FrameSpec;
use gusset_numerics::linalg::{Condensation, SymMatrix};
use gusset_numerics::model::{MatrixFiles, SpecimenShare, StructureSpec};

const STUDY: &str = include_str!("../../config/portal-frame.toml");

fn rows(matrix: &SymMatrix) -> String {
    let n = matrix.n();
    let row = |i: usize| {
        let entries: Vec<String> = (0..n).map(|j| format!("{:e}", matrix.get(i, j))).collect();
        format!("[{}]", entries.join(", "))
    };
    let all: Vec<String> = (0..n).map(row).collect();
    format!("[{}]", all.join(", "))
}

/// The study on the simulated clock, of a few seconds.
fn study() -> String {
    STUDY.with("time.clock = 'simulated'\ntime.duration_s = 6\nintegrator.lambda = 4")
}

#[test]
fn frame_takes_the_steps_of_its_matrices() {
    let frame = study().without("structure.frame.load");
    let table: toml::Table = frame.parse().unwrap();
    let spec: FrameSpec = table["structure"]["frame"].clone().try_into().unwrap();
    let model = spec.model().unwrap();
    let massless: Vec<usize> = (0..model.dofs.len())
        .filter(|dof| model.mass.row_is_zero(*dof))
        .collect();
    let mut held = Condensation::new(&model.stiffness, &massless).unwrap();
    let iota = spec.influence();
    let iota: Vec<f64> = held.kept().iter().map(|dof| iota[*dof]).collect();
    let first = model
        .motion("A1", gusset_numerics::frame::Direction::X)
        .unwrap();
    let row = held.row(first);
    let mut b = vec![0.0; held.kept().len()];
    row.iter().for_each(|(place, share)| b[*place] = *share);
    // Its damping rule refers to its members alone, and its modes are those with the brace.
    let rule = table["structure"]["damping"].clone().try_into().unwrap();
    let brace = SymMatrix::from_triplets(model.dofs.len(), [(first[0].0, first[0].0, 8e6)]);
    let none = SymMatrix::zeros(model.dofs.len());
    let share = SpecimenShare {
        stiffness_at_rest: &brace,
        damped_stiffness: &none,
        mass: &none,
        mass_in_force: &none,
    };
    let spec = StructureSpec::Frame(spec);
    let built = spec.build(Some(&rule), &[], Some(share), &MatrixFiles::new());
    let matrices = frame
        .without("structure.frame")
        .without("specimen.0.deformations");
    let matrices = matrices.without("structure.damping").with(&format!(
        "specimen.0.rows = [{b:?}]\n\
         structure.matrices = {{ mass = {}, damping = {}, stiffness = {}, influence = {iota:?} }}",
        rows(&held.seen_by(&model.mass)),
        rows(&held.seen_by(built.unwrap().damping())),
        rows(&held.complement()),
    ));
    let (whole, condensed) = (run(&frame), run(&matrices));
    assert_eq!(whole.outcome.ending, Ending::Completed);
    for (place, dof) in held.kept().iter().enumerate() {
        for letter in ["x", "v", "a"] {
            let found = whole.column(&format!("{letter}{}", dof + 1));
            let expected = condensed.column(&format!("{letter}{}", place + 1));
            // C1 and C2 hang on columns alone, and move by roundoff.
            let largest = expected.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            if largest > 1e-9 {
                let off = distance(&found, &expected);
                assert!(off < 1e-9, "{letter}{}: {off:e}", dof + 1);
            }
        }
    }
    assert_eq!(
        whole.column("meas_1_1").len(),
        condensed.column("meas_1_1").len()
    );
}

#[test]
fn frame_begins_under_its_weight() {
    let still = study().with("excitation.ground_acceleration.signal.kanai_tajimi.peak = 1e-9");
    let facts = prepare(&still).facts.structure.unwrap();
    let run = run(&still);
    assert_eq!(run.outcome.ending, Ending::Completed);
    let dof = facts
        .places
        .iter()
        .position(|place| place == "C2 y")
        .unwrap();
    let x = run.column(&format!("x{}", dof + 1));
    // N h/(E A) of both columns: 360 kN and 160 kN on 0.0102 m² without fillets.
    let area = 0.24 * 0.24 - 0.23 * (0.24 - 2.0 * 0.017);
    let expected = -(360e3 + 160e3) * 3.5 / (2.1e11 * area);
    assert!((x[0] / expected - 1.0).abs() < 1e-6, "{} {expected}", x[0]);
    let last = x.last().unwrap();
    assert!((last / expected - 1.0).abs() < 1e-6, "{last}");
}

/// A portal on links that harden smoothly: the error of the method falls with the square of the step.
#[test]
fn frame_converges_with_the_second_order() {
    let at = |rate: u32| {
        let text = study().without("specimen").without("structure.frame.load").without("structure.damping").without("excitation").with(&format!(
            "time.rate_hz = {rate}\ntime.duration_s = 2\n\
             excitation.ground_acceleration = {{ signal.sine = {{ amplitude = 3.0, frequency_hz = 1.3 }} }}\n\
             structure.damping = {{ rayleigh = {{ mass_coefficient_per_s = 0.4, stiffness_coefficient_s = 0.0 }} }}\n\
             structure.frame.link = [{{ nodes = [\"A0\", \"B1\"], direction = \"axial\", reach_disp_m = 0.2, \
             law.cubic = {{ stiffness_n_per_m = 4e6, cubic_n_per_m3 = 5e9 }} }}]"
        ));
        let run = run(&text);
        assert_eq!(run.outcome.ending, Ending::Completed);
        let column = run.column("x4");
        let every = (rate / 128) as usize;
        column.into_iter().step_by(every).collect::<Vec<f64>>()
    };
    let exact = at(8192);
    let [coarse, middle, fine] = [128, 256, 512].map(|rate| distance(&at(rate), &exact));
    assert!(fine < 1e-3, "{coarse:e} {middle:e} {fine:e}");
    for ratio in [coarse / middle, middle / fine] {
        assert!(
            (3.6..4.4).contains(&ratio),
            "{coarse:e} {middle:e} {fine:e}"
        );
    }
}
