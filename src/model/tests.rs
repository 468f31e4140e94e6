//! Structures against hand-written matrices, rigid-body invariance and modal identities; descriptions against messages.

mod parse;
mod runs;

use proptest::prelude::*;

use super::*;
use crate::law::Tangent;
use crate::linalg::{SymMatrix, modes};

/// f = k d + h d |d| + c v plus a plastic slider that remembers its set: enough memory to see commits.
#[derive(Debug, Clone, Default)]
struct Probe {
    k: f64,
    h: f64,
    c: f64,
    committed: f64,
    trial: f64,
    at: f64,
}

impl Law for Probe {
    fn trial(&mut self, disp: f64, vel: f64, dt: f64) -> f64 {
        self.trial = self.committed + dt;
        self.at = disp;
        self.k * disp + self.h * disp * disp.abs() + self.c * vel + self.committed
    }

    fn commit(&mut self) {
        self.committed = self.trial;
    }

    fn revert(&mut self) {
        self.trial = self.committed;
    }

    fn tangent(&self) -> Tangent {
        Tangent {
            stiffness: self.k + 2.0 * self.h * self.at.abs(),
            damping: self.c,
        }
    }

    fn reference(&self) -> Tangent {
        Tangent {
            stiffness: self.k,
            damping: self.c,
        }
    }

    fn bound(&self, reach: Reach) -> (Option<f64>, Option<f64>) {
        let stiffness = reach.disp.map(|d| self.k + 2.0 * self.h * d);
        (stiffness, Some(self.c))
    }

    fn freeze(&self, out: &mut Vec<f64>) {
        out.push(self.committed);
    }

    fn thaw<'a>(&mut self, from: &'a [f64]) -> &'a [f64] {
        match from.split_first() {
            Some((first, rest)) => {
                self.committed = *first;
                rest
            }
            None => from,
        }
    }
}

fn element(from: End, to: End, k: f64, h: f64, c: f64) -> Element {
    Element {
        name: "probe".to_owned(),
        from,
        to,
        law: Box::new(Probe {
            k,
            h,
            c,
            ..Probe::default()
        }),
        reach: Reach::default(),
        hardening_ratio: None,
        damping_ratio: None,
    }
}

fn building(mass: &[f64], stiffness: &[f64], damping: Option<&[f64]>) -> StructureSpec {
    StructureSpec::ShearBuilding(ShearBuildingSpec {
        mass_kg: mass.to_vec(),
        stiffness_n_per_m: stiffness.to_vec(),
        damping_n_s_per_m: damping.map(<[f64]>::to_vec),
    })
}

fn build(spec: &StructureSpec) -> Result<Structure, BuildError> {
    spec.build(None, &[], None, &MatrixFiles::new())
}

fn with_elements(elements: Vec<Element>) -> Result<Structure, ModelError> {
    let mass = SymMatrix::diagonal(&[2.0, 3.0]);
    let stiffness = SymMatrix::from_triplets(2, [(0, 0, 30.0), (0, 1, -10.0), (1, 1, 10.0)]);
    Structure::new(mass, SymMatrix::zeros(2), stiffness, vec![1.0; 2], elements)
}

#[test]
fn a_shear_building_has_the_matrices_of_the_textbook() {
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
fn a_chain_is_tied_to_the_base_below_and_free_above() {
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
fn the_parts_of_a_structure_add_up_to_its_bounds() {
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
fn the_frame_at_rest_feels_the_base_and_the_ground_does_not() {
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
fn every_call_commits_once_and_states_freeze_and_thaw() {
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
    let mut frozen = Vec::new();
    structure.freeze(&mut frozen);
    assert_eq!(frozen, [0.5, 0.5]);
    let mut other = make();
    frozen.push(9.0);
    assert_eq!(other.thaw(&frozen), [9.0]);
    assert_eq!(call(&mut other), call(&mut structure));
    // Asking for the stiffness at rest forgets its trial.
    let before = call(&mut structure);
    let _ = structure.stiffness_at_rest();
    assert_eq!(call(&mut structure)[1], before[1] - 0.25);
}

#[test]
fn tangents_references_and_bounds_enter_the_matrices() {
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
fn a_bound_that_needs_a_reach_names_its_element_and_a_declared_ratio_serves_instead() {
    let open = element(End::Ground, End::Dof(1), 100.0, 50.0, 7.0);
    let text = with_elements(vec![open])
        .unwrap()
        .bound_stiffness()
        .unwrap_err()
        .to_string();
    assert_eq!(
        text,
        "probe: the tangent stiffness has no bound unless reach_disp_m (or hardening_ratio) is given"
    );
    let mut declared = element(End::Ground, End::Dof(1), 100.0, 50.0, 7.0);
    declared.hardening_ratio = Some(1.5);
    declared.damping_ratio = Some(2.0);
    let structure = with_elements(vec![declared]).unwrap();
    assert_eq!(structure.bound_stiffness().unwrap().get(1, 1), 160.0);
    assert_eq!(structure.bound_damping().unwrap().get(1, 1), 14.0);
}

#[test]
fn elements_that_fit_nowhere_are_refused() {
    let text = |e: Element| with_elements(vec![e]).unwrap_err().to_string();
    assert_eq!(
        text(element(End::Ground, End::Dof(2), 1.0, 0.0, 0.0)),
        "probe: degree of freedom 3 does not exist, the structure has 2"
    );
    assert!(
        text(element(End::Dof(1), End::Dof(1), 1.0, 0.0, 0.0))
            .contains("between degree of freedom 2 and degree of freedom 2")
    );
    assert!(
        text(element(End::Ground, End::Fixed, 1.0, 0.0, 0.0)).contains("between ground and fixed")
    );
    let mut bad = element(End::Ground, End::Dof(0), 1.0, 0.0, 0.0);
    bad.hardening_ratio = Some(0.5);
    assert_eq!(
        text(bad),
        "probe: hardening_ratio is 0.5, but must be finite and at least 1"
    );
    let mut bad = element(End::Ground, End::Dof(0), 1.0, 0.0, 0.0);
    bad.reach.disp = Some(f64::NAN);
    assert_eq!(
        text(bad),
        "probe: reach_disp_m is NaN, but must be finite and greater than 0"
    );
}

#[test]
fn matrices_that_make_no_structure_are_refused() {
    let two = || SymMatrix::diagonal(&[1.0, 1.0]);
    let new = |m, c, k, i| {
        Structure::new(m, c, k, i, Vec::new())
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        new(two(), two(), SymMatrix::zeros(3), vec![1.0; 2]),
        "stiffness has 3 degrees of freedom, but the mass matrix has 2"
    );
    assert_eq!(
        new(
            SymMatrix::diagonal(&[1.0, -2.0]),
            two(),
            two(),
            vec![1.0; 2]
        ),
        "mass of degree of freedom 2 is -2 kg, but must not be negative"
    );
    assert!(
        new(
            two(),
            two(),
            SymMatrix::diagonal(&[1.0, f64::INFINITY]),
            vec![1.0; 2]
        )
        .contains("stiffness: entry (2, 2) is inf")
    );
    assert!(
        new(two(), two(), two(), vec![1.0, f64::NAN])
            .contains("influence of degree of freedom 2 is NaN")
    );
    assert!(new(two(), two(), two(), vec![1.0]).contains("influence has 1"));
    assert!(
        new(
            SymMatrix::zeros(0),
            SymMatrix::zeros(0),
            SymMatrix::zeros(0),
            vec![]
        )
        .contains("at least one")
    );
    let indefinite = SymMatrix::from_triplets(2, [(0, 0, 1.0), (0, 1, 2.0), (1, 1, 1.0)]);
    assert!(
        new(indefinite, two(), two(), vec![1.0; 2])
            .contains("mass matrix is not positive definite")
    );
    let coupled = SymMatrix::from_triplets(2, [(0, 0, 1.0), (0, 1, 0.1)]);
    assert!(
        new(coupled, two(), two(), vec![1.0; 2]).contains("mass matrix is not positive definite")
    );
}

#[test]
fn accelerations_are_missing_where_there_is_no_mass() {
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
fn the_internal_force_allocates_nothing() {
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

fn damped(spec: &StructureSpec, rule: DampingSpec) -> Result<Structure, BuildError> {
    spec.build(Some(&rule), &[], None, &MatrixFiles::new())
}

/// φᵀ C φ / (2 ω) of every mode: its damping ratio.
fn ratios(structure: &Structure) -> Vec<f64> {
    let found = modes(structure.stiffness(), structure.mass()).unwrap();
    let of = |(j, w): (usize, &f64)| {
        structure
            .damping()
            .quadratic(found.shapes.column(j).as_slice())
            / (2.0 * w)
    };
    found.frequencies.iter().enumerate().map(of).collect()
}

#[test]
fn rayleigh_and_modal_damping_give_the_ratios_asked_for() {
    let spec = building(&[1e3, 2e3, 1.5e3], &[3e6, 2e6, 1e6], None);
    let by_modes = DampingSpec::RayleighRatio(RayleighRatioSpec {
        ratio: 0.03,
        first_hz: None,
        second_hz: None,
        modes: Some([1, 3]),
    });
    let structure = damped(&spec, by_modes).unwrap();
    let found = ratios(&structure);
    assert!((found[0] - 0.03).abs() < 1e-13 && (found[2] - 0.03).abs() < 1e-13);
    assert!(found[1] < 0.03);
    let hertz: Vec<f64> = modes(structure.stiffness(), structure.mass())
        .unwrap()
        .frequencies
        .iter()
        .map(|w| w / (2.0 * std::f64::consts::PI))
        .collect();
    let by_hertz = DampingSpec::RayleighRatio(RayleighRatioSpec {
        ratio: 0.03,
        first_hz: Some(hertz[2]),
        second_hz: Some(hertz[0]),
        modes: None,
    });
    let again = ratios(&damped(&spec, by_hertz).unwrap());
    assert!((again[1] - found[1]).abs() < 1e-13);

    let modal = |ratios: &[f64]| {
        DampingSpec::Modal(ModalSpec {
            ratios: ratios.to_vec(),
        })
    };
    let found = ratios(&damped(&spec, modal(&[0.01, 0.05, 0.2])).unwrap());
    for (found, asked) in found.iter().zip([0.01, 0.05, 0.2]) {
        assert!((found - asked).abs() < 1e-12);
    }
    assert!(
        ratios(&damped(&spec, modal(&[0.04])).unwrap())
            .iter()
            .all(|r| (r - 0.04).abs() < 1e-12)
    );

    let coefficients = DampingSpec::Rayleigh(RayleighSpec {
        mass_coefficient_per_s: 0.5,
        stiffness_coefficient_s: 1e-3,
    });
    let structure = damped(&spec, coefficients).unwrap();
    assert_eq!(structure.damping().get(0, 0), 0.5 * 1e3 + 1e-3 * 5e6);
    assert_eq!(structure.damping().get(0, 1), -2e3);
}

#[test]
fn damping_by_rule_acts_against_the_moving_base_too() {
    // C = 0.5 M: a base velocity of 2 loads each mass with 0.5 m · 2.
    let rule = DampingSpec::Rayleigh(RayleighSpec {
        mass_coefficient_per_s: 0.5,
        stiffness_coefficient_s: 0.0,
    });
    let mut structure = damped(&building(&[3.0, 4.0], &[10.0, 10.0], None), rule).unwrap();
    let base = Base {
        disp: 0.0,
        vel: 2.0,
    };
    let mut r = [0.0; 2];
    structure.subtract_internal(&[0.0; 2], &[0.0; 2], base, 0.0, &mut r);
    assert_eq!(r, [3.0, 4.0]);
}

#[test]
fn damping_by_rule_counts_elements_at_rest_and_specimens() {
    // Storey 1 left to an element, storey 2 to a specimen: the same C as the complete building.
    let rule = DampingSpec::Rayleigh(RayleighSpec {
        mass_coefficient_per_s: 0.0,
        stiffness_coefficient_s: 0.01,
    });
    let whole = damped(
        &building(&[1.0; 3], &[300.0, 200.0, 100.0], None),
        rule.clone(),
    )
    .unwrap();
    let spring = ElementSpec {
        name: None,
        from: End::Ground,
        to: End::Dof(0),
        law: toml::from_str("linear = { stiffness_n_per_m = 300.0 }").unwrap(),
        reach_disp_m: None,
        reach_vel_m_per_s: None,
        hardening_ratio: None,
        damping_ratio: None,
    };
    let specimen = SymMatrix::from_triplets(3, [(0, 0, 200.0), (0, 1, -200.0), (1, 1, 200.0)]);
    let share = SpecimenShare {
        stiffness_at_rest: &specimen,
        mass: &SymMatrix::from_triplets(3, [(1, 1, 0.25)]),
    };
    let parted = building(&[1.0, 0.75, 1.0], &[0.0, 0.0, 100.0], None)
        .build(Some(&rule), &[spring], Some(share), &MatrixFiles::new())
        .unwrap();
    assert_eq!(parted.mass(), whole.mass());
    assert_eq!(parted.damping(), whole.damping());
    assert_eq!(
        parted.reference_stiffness().plus(1.0, &specimen),
        whole.reference_stiffness()
    );
    assert_eq!(parted.element_names().collect::<Vec<_>>(), ["element 1"]);
}

#[test]
fn bad_descriptions_are_named_by_storey_key_and_file() {
    let text = |spec: &StructureSpec| build(spec).unwrap_err().to_string();
    assert_eq!(
        text(&building(&[1.0, 1.0], &[1.0], None)),
        "stiffness_n_per_m has 1 entries, but mass_kg has 2"
    );
    assert_eq!(
        text(&building(&[1.0, 1.0], &[1.0, -5.0], None)),
        "stiffness_n_per_m of storey 2 is -5, but must be finite and not negative"
    );
    assert_eq!(
        text(&building(&[f64::NAN, 1.0], &[1.0, 0.0], None)),
        "mass_kg of floor 1 is NaN, but must be finite and not negative"
    );
    assert!(text(&building(&[0.0, 0.0], &[1.0, 1.0], None)).contains("every mass is zero"));
    assert!(text(&building(&[], &[], None)).contains("at least one degree of freedom"));
    assert!(
        text(&building(&[1.0], &[1.0], Some(&[1.0, 2.0])))
            .contains("damping_n_s_per_m has 2 entries")
    );
    let chain = |dofs, mass_kg, stiffness_n_per_m| {
        StructureSpec::Chain(ChainSpec {
            dofs,
            mass_kg,
            stiffness_n_per_m,
            damping_n_s_per_m: None,
            absolute_damper: None,
        })
    };
    assert_eq!(
        text(&chain(0, 1.0, 1.0)),
        "dofs is 0, but must be 1 to 1000000"
    );
    assert_eq!(
        text(&chain(2, 0.0, 1.0)),
        "mass_kg is 0, but must be finite and greater than 0"
    );
    assert!(text(&chain(2, 1.0, f64::INFINITY)).contains("stiffness_n_per_m is inf"));

    let rows = |rows: &[&[f64]]| Some(rows.iter().map(|r| r.to_vec()).collect::<Vec<_>>());
    let matrices = |spec| text(&StructureSpec::Matrices(spec));
    let good = MatricesSpec {
        mass: rows(&[&[1.0, 0.0], &[0.0, 1.0]]),
        stiffness: rows(&[&[2.0, -1.0], &[-1.0, 1.0]]),
        ..MatricesSpec::default()
    };
    assert!(build(&StructureSpec::Matrices(good.clone())).is_ok());
    assert_eq!(
        matrices(MatricesSpec {
            mass: None,
            ..good.clone()
        }),
        "give mass either inline or as mass_file"
    );
    assert_eq!(
        matrices(MatricesSpec {
            mass_file: Some("m.csv".to_owned()),
            ..good.clone()
        }),
        "give mass either inline or as mass_file, not both"
    );
    assert_eq!(
        matrices(MatricesSpec {
            stiffness: rows(&[&[2.0, -1.0], &[-1.0]]),
            ..good.clone()
        }),
        "stiffness: row 2 has 1 entries, but row 1 has 2"
    );
    assert_eq!(
        matrices(MatricesSpec {
            stiffness: rows(&[&[2.0, -1.0]]),
            ..good.clone()
        }),
        "stiffness: must be square, but is 1 by 2"
    );
    assert_eq!(
        matrices(MatricesSpec {
            damping: rows(&[&[2.0, -1.0], &[-0.5, 1.0]]),
            ..good.clone()
        }),
        "damping: must be symmetric, but entry (1, 2) is -1 and entry (2, 1) is -0.5"
    );
    assert_eq!(
        matrices(MatricesSpec {
            stiffness: rows(&[&[2.0]]),
            ..good.clone()
        }),
        "stiffness has 1 degrees of freedom, but the mass matrix has 2"
    );
    assert_eq!(
        matrices(MatricesSpec {
            damping_file: Some("c.npy".to_owned()),
            ..good.clone()
        }),
        "damping_file: the file c.npy was not read"
    );
    assert!(
        matrices(MatricesSpec {
            influence: Some(vec![1.0]),
            ..good
        })
        .contains("influence has 1")
    );
}

#[test]
fn bad_damping_rules_are_explained() {
    let spec = building(&[1.0, 1.0], &[100.0, 100.0], None);
    let text = |rule| damped(&spec, rule).unwrap_err().to_string();
    let ratio = |ratio, first_hz, second_hz, modes| {
        DampingSpec::RayleighRatio(RayleighRatioSpec {
            ratio,
            first_hz,
            second_hz,
            modes,
        })
    };
    let modal = |ratios: &[f64]| {
        DampingSpec::Modal(ModalSpec {
            ratios: ratios.to_vec(),
        })
    };
    assert_eq!(
        text(ratio(5.0, Some(1.0), Some(2.0), None)),
        "damping: ratio is 5, but must be a fraction of critical from 0 to below 1"
    );
    assert!(
        text(ratio(0.02, Some(1.0), None, None))
            .contains("either first_hz and second_hz, or modes")
    );
    assert!(text(ratio(0.02, Some(1.0), Some(2.0), Some([1, 2]))).contains("either"));
    assert!(text(ratio(0.02, Some(1.0), Some(1.0), None)).contains("must be different"));
    assert!(
        text(ratio(0.02, Some(f64::NAN), Some(1.0), None))
            .contains("must be different and greater than 0")
    );
    assert!(text(ratio(0.02, None, None, Some([1, 3]))).contains("mode 3 does not exist"));
    assert!(text(ratio(0.02, None, None, Some([0, 1]))).contains("mode 0 does not exist"));
    assert!(text(modal(&[0.1, 0.1, 0.1])).contains("3 damping ratios for 2 modes"));
    assert!(text(modal(&[])).contains("0 damping ratios"));
    let given = building(&[1.0], &[1.0], Some(&[0.1]));
    let twice = damped(&given, modal(&[0.1])).unwrap_err().to_string();
    assert_eq!(
        twice,
        "damping is given twice: as damping_n_s_per_m and by a rule; remove one"
    );
    let long = StructureSpec::Chain(ChainSpec {
        dofs: 301,
        mass_kg: 1.0,
        stiffness_n_per_m: 1.0,
        damping_n_s_per_m: None,
        absolute_damper: None,
    });
    let text = damped(&long, modal(&[0.02])).unwrap_err().to_string();
    assert!(
        text.contains("301 degrees of freedom are beyond the limit of 300"),
        "{text}"
    );
}

#[test]
fn storeys_are_rows_and_what_is_no_storey_is_an_error() {
    let spec = building(&[1.0, 1.0, 1.0], &[1.0, 1.0, 1.0], None);
    assert_eq!(spec.storey_row(1).unwrap(), [(0, 1.0)]);
    assert_eq!(spec.storey_row(3).unwrap(), [(1, -1.0), (2, 1.0)]);
    for storey in [0, 4] {
        assert_eq!(
            spec.storey_row(storey).unwrap_err().to_string(),
            format!("storey {storey} does not exist, the structure has storeys 1 to 3")
        );
    }
    let matrices = StructureSpec::Matrices(MatricesSpec::default());
    assert!(
        matrices
            .storey_row(1)
            .unwrap_err()
            .to_string()
            .contains("has no storeys")
    );
}

#[test]
fn a_structure_comes_from_matrix_files() {
    let spec = StructureSpec::Matrices(MatricesSpec {
        mass_file: Some("m.csv".to_owned()),
        stiffness_file: Some("k.mtx".to_owned()),
        ..MatricesSpec::default()
    });
    assert_eq!(spec.files(), ["m.csv", "k.mtx"]);
    let mut files = MatrixFiles::new();
    let k = b"%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 30\n2 1 -10\n2 2 10\n";
    files.insert(
        "m.csv".to_owned(),
        parse_matrix("m.csv", b"2,0\n0,3\n").unwrap(),
    );
    files.insert("k.mtx".to_owned(), parse_matrix("k.mtx", k).unwrap());
    let structure = spec.build(None, &[], None, &files).unwrap();
    assert_eq!(spec.dofs(&files).unwrap(), 2);
    assert_eq!(structure.mass().get(1, 1), 3.0);
    assert_eq!(structure.stiffness().get(0, 1), -10.0);
}

#[test]
fn descriptions_are_read_from_toml_and_bad_ends_are_explained() {
    let spec: StructureSpec =
        toml::from_str("[shear_building]\nmass_kg = [1.0]\nstiffness_n_per_m = [2.0]\n").unwrap();
    assert_eq!(spec, building(&[1.0], &[2.0], None));
    let text = "from = \"ground\"\nto = 2\nlaw = { linear = { stiffness_n_per_m = 5.0 } }\n";
    let element: ElementSpec = toml::from_str(text).unwrap();
    assert_eq!((element.from, element.to), (End::Ground, End::Dof(1)));
    let back: ElementSpec = toml::from_str(&toml::to_string(&element).unwrap()).unwrap();
    assert_eq!(back, element);
    for bad in ["0", "-3", "\"sky\"", "1.5"] {
        let text = text.replace("2", bad);
        let message = toml::from_str::<ElementSpec>(&text)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("a degree of freedom counted from 1, \"ground\" or \"fixed\""),
            "{message}"
        );
    }
    let unknown = toml::from_str::<StructureSpec>("[chain]\ndofs = 2\nmass = 3\n").unwrap_err();
    assert!(unknown.to_string().contains("mass_kg"));
    let rule: DampingSpec =
        toml::from_str("[rayleigh_ratio]\nratio = 0.02\nmodes = [1, 2]\n").unwrap();
    assert!(matches!(rule, DampingSpec::RayleighRatio(r) if r.modes == Some([1, 2])));
    let schema = serde_json::to_string(&schemars::schema_for!(ElementSpec)).unwrap();
    assert!(schema.contains("\"ground\"") && schema.contains("\"minimum\":1"));
}

proptest! {
    #[test]
    fn a_base_that_carries_everything_along_changes_no_internal_force(
        x in proptest::collection::vec(-1.0f64..1.0, 3),
        v in proptest::collection::vec(-1.0f64..1.0, 3),
        disp in -5.0f64..5.0,
        vel in -5.0f64..5.0,
    ) {
        // Absolute coordinates x + ι x_g under a moving base against relative coordinates: no Fixed end here.
        let spec = building(&[1.0, 0.0, 3.0], &[10.0, 20.0, 30.0], Some(&[0.1, 0.2, 0.3]));
        let linear = build(&spec).unwrap();
        let make = || Structure::new(
            linear.mass().clone(),
            linear.damping().clone(),
            linear.stiffness().clone(),
            vec![1.0; 3],
            vec![
                element(End::Ground, End::Dof(2), 7.0, 3.0, 1.0),
                element(End::Dof(1), End::Dof(0), 7.0, 3.0, 1.0),
                element(End::Dof(1), End::Ground, 2.0, 0.0, 1.0),
            ],
        ).unwrap();
        let moved = |u: &[f64], by: f64| u.iter().map(|u| u + by).collect::<Vec<_>>();
        let (mut relative, mut absolute) = ([0.0; 3], [0.0; 3]);
        make().subtract_internal(&x, &v, Base::default(), 0.0, &mut relative);
        make().subtract_internal(&moved(&x, disp), &moved(&v, vel), Base { disp, vel }, 0.0, &mut absolute);
        for (a, b) in relative.iter().zip(&absolute) {
            prop_assert!((a - b).abs() < 1e-11);
        }
    }
}
