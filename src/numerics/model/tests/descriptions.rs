//! Descriptions: the structures that they give, and the errors of bad ones.

use super::*;
use gusset_quantity::domain::OutOfDomain;

#[test]
fn bad_descriptions_name_key_and_file() {
    let refused = |spec: &StructureSpec| build(spec).unwrap_err();
    assert_is!(
        refused(&building(&[1.0, 1.0], &[1.0], None))
        => BuildError::Length { key: "stiffness_n_per_m", expected: 2, found: 1 }
    );
    assert_is!(
        refused(&building(&[1.0, 1.0], &[1.0, -5.0], None))
        => BuildError::Value { key: "stiffness_n_per_m", place: "storey", number: 2, found: -5.0, .. }
    );
    assert_is!(
        refused(&building(&[f64::NAN, 1.0], &[1.0, 0.0], None))
        => BuildError::Value { key: "mass_kg", place: "floor", number: 1, .. }
    );
    assert_is!(refused(&building(&[0.0, 0.0], &[1.0, 1.0], None)) => BuildError::NoMass);
    assert_is!(refused(&building(&[], &[], None)) => BuildError::Model(ModelError::Empty));
    assert_is!(
        refused(&building(&[1.0], &[1.0], Some(&[1.0, 2.0])))
        => BuildError::Length { key: "damping_n_s_per_m", found: 2, .. }
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
    assert_is!(refused(&chain(0, 1.0, 1.0)) => BuildError::Parameter(OutOfDomain { name: "dofs", found: 0.0, .. }));
    assert_is!(
        refused(&chain(2, 0.0, 1.0))
        => BuildError::Parameter(OutOfDomain { name: "mass_kg", found: 0.0, .. })
    );
    assert_is!(
        refused(&chain(2, 1.0, f64::INFINITY))
        => BuildError::Parameter(OutOfDomain { name: "stiffness_n_per_m", found: f64::INFINITY, .. })
    );

    let rows = |rows: &[&[f64]]| Some(rows.iter().map(|r| r.to_vec()).collect::<Vec<_>>());
    let matrices = |spec| refused(&StructureSpec::Matrices(spec));
    let good = MatricesSpec {
        mass: rows(&[&[1.0, 0.0], &[0.0, 1.0]]),
        stiffness: rows(&[&[2.0, -1.0], &[-1.0, 1.0]]),
        ..MatricesSpec::default()
    };
    assert!(build(&StructureSpec::Matrices(good.clone())).is_ok());
    assert_is!(
        matrices(MatricesSpec { mass: None, ..good.clone() })
        => BuildError::Source { key: "mass", both: false }
    );
    assert_is!(
        matrices(MatricesSpec { mass_file: Some("m.csv".to_owned()), ..good.clone() })
        => BuildError::Source { key: "mass", both: true }
    );
    assert_is!(
        matrices(MatricesSpec { stiffness: rows(&[&[2.0, -1.0], &[-1.0]]), ..good.clone() })
        => BuildError::Ragged { key: "stiffness", row: 2, expected: 2, found: 1 }
    );
    assert_is!(
        matrices(MatricesSpec { stiffness: rows(&[&[2.0, -1.0]]), ..good.clone() })
        => BuildError::Matrix { key, source: MatrixError::NotSquare { rows: 1, columns: 2 } } if key == "stiffness"
    );
    assert_is!(
        matrices(MatricesSpec { damping: rows(&[&[2.0, -1.0], &[-0.5, 1.0]]), ..good.clone() })
        => BuildError::Matrix { key, source: MatrixError::Asymmetric { row: 0, column: 1, here: -1.0, there: -0.5 } } if key == "damping"
    );
    assert_is!(
        matrices(MatricesSpec { stiffness: rows(&[&[2.0]]), ..good.clone() })
        => BuildError::Model(ModelError::Size { what: "stiffness", expected: 2, found: 1 })
    );
    assert_is!(
        matrices(MatricesSpec { damping_file: Some("c.npy".to_owned()), ..good.clone() })
        => BuildError::File { key: "damping_file", file } if file == "c.npy"
    );
    assert_is!(
        matrices(MatricesSpec { influence: Some(vec![1.0]), ..good })
        => BuildError::Model(ModelError::Size { what: "influence", found: 1, .. })
    );
}

#[test]
fn bad_damping_rules_are_explained() {
    let spec = building(&[1.0, 1.0], &[100.0, 100.0], None);
    let refused = |rule| match damped(&spec, rule).unwrap_err() {
        BuildError::Damping(error) => error,
        other => panic!("{other:?}"),
    };
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
    assert_is!(
        refused(ratio(5.0, Some(1.0), Some(2.0), None))
        => DampingError::Parameter(OutOfDomain { name: "ratio", found: 5.0, .. })
    );
    assert_is!(refused(ratio(0.02, Some(1.0), None, None)) => DampingError::WhichFrequencies);
    assert_is!(
        refused(ratio(0.02, Some(1.0), Some(2.0), Some([1, 2])))
        => DampingError::WhichFrequencies
    );
    assert_is!(
        refused(ratio(0.02, Some(1.0), Some(1.0), None))
        => DampingError::Frequencies { first_hz: 1.0, second_hz: 1.0 }
    );
    assert_is!(
        refused(ratio(0.02, Some(f64::NAN), Some(1.0), None))
        => DampingError::Frequencies { second_hz: 1.0, .. }
    );
    assert_is!(
        refused(ratio(0.02, None, None, Some([1, 3])))
        => DampingError::NoSuchMode { mode: 3, available: 2 }
    );
    assert_is!(
        refused(ratio(0.02, None, None, Some([0, 1])))
        => DampingError::NoSuchMode { mode: 0, .. }
    );
    assert_is!(refused(modal(&[0.1, 0.1, 0.1])) => DampingError::Ratios { found: 3, modes: 2 });
    assert_is!(refused(modal(&[])) => DampingError::Ratios { found: 0, .. });
    let given = building(&[1.0], &[1.0], Some(&[0.1]));
    let twice = damped(&given, modal(&[0.1])).unwrap_err();
    assert_is!(twice => BuildError::DampingTwice { given: "damping_n_s_per_m" });
    let long = StructureSpec::Chain(ChainSpec {
        dofs: 301,
        mass_kg: 1.0,
        stiffness_n_per_m: 1.0,
        damping_n_s_per_m: None,
        absolute_damper: None,
    });
    let long = damped(&long, modal(&[0.02])).unwrap_err();
    assert_is!(long => BuildError::Damping(DampingError::TooLarge { n: 301 }));
}

#[test]
fn storeys_are_rows_or_an_error() {
    let spec = building(&[1.0, 1.0, 1.0], &[1.0, 1.0, 1.0], None);
    assert_eq!(spec.storey_row(1).unwrap(), [(0, 1.0)]);
    assert_eq!(spec.storey_row(3).unwrap(), [(1, -1.0), (2, 1.0)]);
    for storey in [0, 4] {
        let refused = spec.storey_row(storey).unwrap_err();
        assert_eq!(refused, BuildError::NoSuchStorey { storey, storeys: 3 });
    }
    let matrices = StructureSpec::Matrices(MatricesSpec::default());
    assert_eq!(matrices.storey_row(1), Err(BuildError::NoStoreys));
}

#[test]
fn structure_is_read_from_matrix_files() {
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
fn toml_descriptions_explain_bad_ends() {
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
            message.contains("\"ground\"") && message.contains("\"fixed\""),
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
    fn rigid_base_motion_changes_no_force(
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

fn leaning(weight_n: Option<&[f64]>, storey_height_m: &[f64]) -> StructureSpec {
    StructureSpec::ShearBuilding(ShearBuildingSpec {
        mass_kg: vec![2e4, 1e4],
        stiffness_n_per_m: vec![3e6, 2e6],
        damping_n_s_per_m: None,
        p_delta: Some(PDeltaSpec {
            storey_height_m: storey_height_m.to_vec(),
            weight_n: weight_n.map(<[f64]>::to_vec),
        }),
    })
}

/// Equilibrium of the leaning columns: each storey carries what is above it, at its drift.
#[test]
fn weight_above_lowers_a_storey() {
    let spec = leaning(Some(&[3e5, 1e5]), &[4.0, 2.5]);
    let structure = build(&spec).unwrap();
    let (first, second) = (3e6 - 4e5 / 4.0, 2e6 - 1e5 / 2.5);
    let k = structure.stiffness();
    assert_eq!(k.get(0, 0), first + second);
    assert_eq!((k.get(0, 1), k.get(1, 1)), (-second, second));
    let own = build(&leaning(None, &[4.0, 2.5])).unwrap();
    let given = build(&leaning(Some(&[2e4 * 9.80665, 1e4 * 9.80665]), &[4.0, 2.5])).unwrap();
    assert_eq!(own.stiffness(), given.stiffness());
}

#[test]
fn wrong_weights_and_heights_are_refused() {
    let refused = |spec: &StructureSpec| build(spec).unwrap_err();
    assert_is!(
        refused(&leaning(None, &[4.0]))
        => BuildError::Length { key: "storey_height_m", expected: 2, found: 1 }
    );
    assert_is!(
        refused(&leaning(None, &[4.0, 0.0]))
        => BuildError::Parameter(OutOfDomain { name: "storey_height_m", found: 0.0, .. })
    );
    assert_is!(
        refused(&leaning(Some(&[1.0, -2.0]), &[4.0, 3.0]))
        => BuildError::Value { key: "weight_n", place: "floor", number: 2, found: -2.0, .. }
    );
}
