//! Descriptions: the structures that they give, and the errors of bad ones.

use super::*;

#[test]
fn bad_descriptions_name_key_and_file() {
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
fn storeys_are_rows_or_an_error() {
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
