//! Matrices, elements and what acts between them.

use super::*;
use gusset_quantity::state::{Stateful, TestState};

#[test]
fn shear_building_has_textbook_matrices() {
    let structure = build(&building(
        &[1.0, 2.0, 3.0],
        &[10.0, 20.0, 30.0],
        Some(&[0.1, 0.2, 0.3]),
    ))
    .unwrap();
    let dense = structure.stiffness().to_dense();
    let expected = [[30.0, -20.0, 0.0], [-20.0, 50.0, -30.0], [0.0, -30.0, 30.0]];
    for (i, row) in expected.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            assert_eq!(dense[(i, j)], *value);
            assert!((structure.damping().get(i, j) - value / 100.0).abs() < 1e-15);
        }
    }
    assert_eq!(structure.ground_load(), [-1.0, -2.0, -3.0]);
    let names: Vec<_> = structure
        .parts()
        .unwrap()
        .into_iter()
        .map(|p| p.name)
        .collect();
    assert_eq!(names, ["storey 1", "storey 2", "storey 3"]);
}

#[test]
fn chain_is_tied_below_and_free_above() {
    let spec = StructureSpec::Chain(ChainSpec {
        dofs: 4,
        mass_kg: 150.0,
        stiffness_n_per_m: 2.5e5,
        damping_n_s_per_m: Some(10.0),
        absolute_damper: None,
    });
    let mut structure = build(&spec).unwrap();
    assert_eq!(structure.stiffness().get(0, 0), 5e5);
    assert_eq!(structure.stiffness().get(3, 3), 2.5e5);
    // Example 4.3 of Gui et al.: at rest under base motion only mass 1 is loaded, F1 = k x_g + c ẋ_g.
    let mut load = [0.0; 4];
    let base = Base {
        disp: 0.01,
        vel: 0.3,
    };
    structure.subtract_internal(&[0.0; 4], &[0.0; 4], base, 0.0, &mut load);
    assert!((load[0] - (2500.0 + 3.0)).abs() < 1e-9);
    assert_eq!(load[1..], [0.0; 3]);
}

#[test]
fn structure_parts_add_up_to_its_bounds() {
    let spec = building(
        &[1.0, 2.0, 3.0],
        &[10.0, 20.0, 30.0],
        Some(&[0.1, 0.2, 0.3]),
    );
    let linear = spec.build(None, &[], None, &MatrixFiles::new()).unwrap();
    let shape = [0.3, -1.0, 2.0];
    let energy: f64 = linear
        .parts()
        .unwrap()
        .iter()
        .map(|p| p.stiffness_bound * p.deformation(&shape) * p.deformation(&shape))
        .sum();
    assert!((energy - linear.bound_stiffness().unwrap().quadratic(&shape)).abs() < 1e-12);
}

#[test]
fn elements_pull_their_ends_together() {
    let mut structure = with_elements(vec![
        element(End::Dof(0), End::Dof(1), 100.0, 0.0, 7.0),
        element(End::Ground, End::Dof(1), 1000.0, 0.0, 0.0),
        element(End::Dof(0), End::Fixed, 5.0, 0.0, 0.0),
    ])
    .unwrap();
    let mut r = [0.0; 2];
    structure.subtract_internal(&[0.1, 0.3], &[1.0, 2.0], Base::default(), 0.0, &mut r);
    // Linear part: K x = (30·0.1 − 10·0.3, −10·0.1 + 10·0.3) = (0, 2). Element 1: 100·0.2 + 7·1 = 27.
    assert!((r[0] - (27.0 - 5.0 * 0.1)).abs() < 1e-12);
    assert!((r[1] - (-2.0 - 27.0 - 300.0)).abs() < 1e-12);
}

#[test]
fn inertial_frame_and_ground_differ() {
    let base = Base {
        disp: 0.5,
        vel: -2.0,
    };
    let force = |end| {
        let mut structure = Structure::new(
            SymMatrix::diagonal(&[1.0]),
            SymMatrix::zeros(1),
            SymMatrix::zeros(1),
            vec![1.0],
            vec![element(end, End::Dof(0), 10.0, 0.0, 3.0)],
        )
        .unwrap();
        let mut r = [0.0];
        // The mass rides on the base.
        structure.subtract_internal(&[0.5], &[-2.0], base, 0.0, &mut r);
        r[0]
    };
    assert_eq!(force(End::Ground), 0.0);
    assert_eq!(force(End::Fixed), -(5.0 - 6.0));
}

#[test]
fn every_call_commits_once() {
    let make = || {
        with_elements(vec![
            element(End::Ground, End::Dof(0), 1.0, 0.0, 0.0),
            element(End::Dof(0), End::Dof(1), 1.0, 0.0, 0.0),
        ])
        .unwrap()
    };
    let call = |structure: &mut Structure| {
        let mut r = [0.0; 2];
        structure.subtract_internal(&[0.0; 2], &[0.0; 2], Base::default(), 0.25, &mut r);
        r
    };
    let mut structure = make();
    // The probe adds its committed time to the force: 0 at the first call, 0.25 at the second.
    assert_eq!(call(&mut structure), [0.0, 0.0]);
    assert_eq!(call(&mut structure), [0.0, -0.25]);
    let state = TestState::of(|visit| structure.visit_state(visit)).unwrap();
    assert_eq!(state.words(), [0.5_f64.to_bits(); 2]);
    let mut other = make();
    state.restore(|visit| other.visit_state(visit)).unwrap();
    assert_eq!(call(&mut other), call(&mut structure));
    // Asking for the stiffness at rest forgets its trial.
    let before = call(&mut structure);
    let _ = structure.stiffness_at_rest();
    assert_eq!(call(&mut structure)[1], before[1] - 0.25);
}

#[test]
fn tangents_and_bounds_enter_the_matrices() {
    let mut hard = element(End::Dof(0), End::Dof(1), 100.0, 50.0, 7.0);
    hard.reach.disp = Some(0.4);
    let mut structure = with_elements(vec![hard]).unwrap();
    let mut r = [0.0; 2];
    structure.subtract_internal(&[0.0, 0.2], &[0.0; 2], Base::default(), 0.0, &mut r);
    let added = |m: &SymMatrix| m.plus(-1.0, structure.stiffness()).get(0, 1);
    assert_eq!(added(&structure.reference_stiffness()), -100.0);
    assert!((added(&structure.tangent_stiffness()) + 120.0).abs() < 1e-12);
    assert!((added(&structure.bound_stiffness().unwrap()) + 140.0).abs() < 1e-12);
    assert_eq!(structure.reference_damping().get(0, 0), 7.0);
    assert_eq!(structure.tangent_damping().get(0, 1), -7.0);
    assert_eq!(structure.bound_damping().unwrap().get(1, 1), 7.0);
    let part = &structure.parts().unwrap()[0];
    assert_eq!(
        (part.stiffness_bound, part.damping, part.damping_bound),
        (140.0, 7.0, 7.0)
    );
    assert_eq!(part.row, [(0, -1.0), (1, 1.0)]);
}

#[test]
fn missing_reach_is_named_or_ratio_serves() {
    let open = element(End::Ground, End::Dof(1), 100.0, 50.0, 7.0);
    let refused = with_elements(vec![open])
        .unwrap()
        .bound_stiffness()
        .unwrap_err();
    assert_is!(refused => ModelError::NoBound { tangent: "stiffness", key: "reach_disp_m", .. });
    let mut declared = element(End::Ground, End::Dof(1), 100.0, 50.0, 7.0);
    declared.hardening_ratio = Some(1.5);
    declared.damping_ratio = Some(2.0);
    let structure = with_elements(vec![declared]).unwrap();
    assert_eq!(structure.bound_stiffness().unwrap().get(1, 1), 160.0);
    assert_eq!(structure.bound_damping().unwrap().get(1, 1), 14.0);
}

#[test]
fn elements_that_fit_nowhere_are_refused() {
    let refused = |e: Element| with_elements(vec![e]).unwrap_err();
    assert_is!(
        refused(element(End::Ground, End::Dof(2), 1.0, 0.0, 0.0))
        => ModelError::NoSuchDof { dof: 2, dofs: 2, .. }
    );
    assert_is!(
        refused(element(End::Dof(1), End::Dof(1), 1.0, 0.0, 0.0))
        => ModelError::Ends { from: End::Dof(1), to: End::Dof(1), .. }
    );
    assert_is!(
        refused(element(End::Ground, End::Fixed, 1.0, 0.0, 0.0))
        => ModelError::Ends { from: End::Ground, to: End::Fixed, .. }
    );
    let mut bad = element(End::Ground, End::Dof(0), 1.0, 0.0, 0.0);
    bad.hardening_ratio = Some(0.5);
    assert_is!(refused(bad) => ModelError::Declared { key: "hardening_ratio", found: 0.5, .. });
    let mut bad = element(End::Ground, End::Dof(0), 1.0, 0.0, 0.0);
    bad.reach.disp = Some(f64::NAN);
    assert_is!(
        refused(bad)
        => ModelError::Declared { element, key: "reach_disp_m", .. } if element == "probe"
    );
}

#[test]
fn invalid_matrices_are_refused() {
    let two = || SymMatrix::diagonal(&[1.0, 1.0]);
    let new = |m, c, k, i| Structure::new(m, c, k, i, Vec::new()).unwrap_err();
    assert_is!(
        new(two(), two(), SymMatrix::zeros(3), vec![1.0; 2])
        => ModelError::Size { what: "stiffness", expected: 2, found: 3 }
    );
    assert_is!(
        new(SymMatrix::diagonal(&[1.0, -2.0]), two(), two(), vec![1.0; 2])
        => ModelError::NegativeMass { dof: 1, found: -2.0 }
    );
    assert_is!(
        new(two(), two(), SymMatrix::diagonal(&[1.0, f64::INFINITY]), vec![1.0; 2])
        => ModelError::Entry { what: "stiffness", source: MatrixError::NotFinite { row: 1, column: 1, .. } }
    );
    assert_is!(
        new(two(), two(), two(), vec![1.0, f64::NAN])
        => ModelError::Influence { dof: 1, .. }
    );
    assert_is!(
        new(two(), two(), two(), vec![1.0])
        => ModelError::Size { what: "influence", found: 1, .. }
    );
    assert_is!(
        new(SymMatrix::zeros(0), SymMatrix::zeros(0), SymMatrix::zeros(0), vec![])
        => ModelError::Empty
    );
    let indefinite = SymMatrix::from_triplets(2, [(0, 0, 1.0), (0, 1, 2.0), (1, 1, 1.0)]);
    assert_is!(new(indefinite, two(), two(), vec![1.0; 2]) => ModelError::Mass(_));
    let coupled = SymMatrix::from_triplets(2, [(0, 0, 1.0), (0, 1, 0.1)]);
    assert_is!(new(coupled, two(), two(), vec![1.0; 2]) => ModelError::Mass(_));
}

#[test]
fn massless_dofs_have_no_acceleration() {
    let mut out = [0.0; 3];
    let mut diagonal = Acceleration::new(&SymMatrix::diagonal(&[2.0, 0.0, 4.0])).unwrap();
    diagonal.accel_into(&[1.0, 1.0, 1.0], &mut out);
    assert_eq!((out[0], out[1].is_nan(), out[2]), (0.5, true, 0.25));
    // [[2, 1], [1, 3]]⁻¹ (3, 4) = (1, 1)
    let full = SymMatrix::from_triplets(3, [(0, 0, 2.0), (0, 2, 1.0), (2, 2, 3.0)]);
    let mut full = Acceleration::new(&full).unwrap();
    full.accel_into(&[3.0, 9.0, 4.0], &mut out);
    assert!((out[0] - 1.0).abs() < 1e-15 && out[1].is_nan() && (out[2] - 1.0).abs() < 1e-15);
}

#[test]
fn internal_force_allocates_nothing() {
    let n = 200;
    let elements: Vec<Element> = (0..n)
        .map(|i| element(End::Fixed, End::Dof(i), 3.0, 1.0, 0.1))
        .collect();
    let chain = build(&StructureSpec::Chain(ChainSpec {
        dofs: n,
        mass_kg: 1.0,
        stiffness_n_per_m: 1.0,
        damping_n_s_per_m: None,
        absolute_damper: None,
    }))
    .unwrap();
    let mut structure = Structure::new(
        chain.mass().clone(),
        chain.damping().clone(),
        chain.stiffness().clone(),
        vec![1.0; n],
        elements,
    )
    .unwrap();
    let full = SymMatrix::from_triplets(
        n,
        (0..n)
            .map(|i| (i, i, 2.0))
            .chain((2..n).map(|i| (i - 2, i, 0.5))),
    );
    let mut accelerations = [
        Acceleration::new(chain.mass()).unwrap(),
        Acceleration::new(&full).unwrap(),
    ];
    let (x, v) = (vec![0.1; n], vec![0.2; n]);
    let (mut r, mut a) = (vec![0.0; n], vec![0.0; n]);
    let base = Base {
        disp: 0.1,
        vel: 0.2,
    };
    let counted = allocation_counter::measure(|| {
        structure.subtract_internal(&x, &v, base, 0.01, &mut r);
        for acceleration in &mut accelerations {
            acceleration.accel_into(&r, &mut a);
        }
    });
    assert_eq!(counted.count_total, 0);
}
