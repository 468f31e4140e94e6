//! Damping by rule.

use super::*;

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
fn damping_rules_give_the_requested_ratios() {
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
        stiffness_part: StiffnessPart::Condensed,
    });
    let structure = damped(&spec, coefficients).unwrap();
    assert_eq!(structure.damping().get(0, 0), 0.5 * 1e3 + 1e-3 * 5e6);
    assert_eq!(structure.damping().get(0, 1), -2e3);
}

#[test]
fn rule_damping_acts_against_a_moving_base() {
    // C = 0.5 M: a base velocity of 2 loads each mass with 0.5 m · 2.
    let rule = DampingSpec::Rayleigh(RayleighSpec {
        mass_coefficient_per_s: 0.5,
        stiffness_coefficient_s: 0.0,
        stiffness_part: StiffnessPart::Condensed,
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
fn rule_damping_counts_elements_at_rest() {
    // Storey 1 left to an element, storey 2 to a specimen: the same C as the complete building.
    let rule = DampingSpec::Rayleigh(RayleighSpec {
        mass_coefficient_per_s: 0.0,
        stiffness_coefficient_s: 0.01,
        stiffness_part: StiffnessPart::Condensed,
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
        damped_stiffness: &SymMatrix::zeros(3),
        mass: &SymMatrix::from_triplets(3, [(1, 1, 0.25)]),
        mass_in_force: &SymMatrix::zeros(3),
    };
    let parted = building(&[1.0, 0.75, 1.0], &[0.0, 0.0, 100.0], None)
        .build(
            Some(&rule),
            std::slice::from_ref(&spring),
            Some(share),
            &MatrixFiles::new(),
        )
        .unwrap();
    assert_eq!(parted.mass(), whole.mass());
    assert_eq!(parted.damping(), whole.damping());
    assert_eq!(
        parted.reference_stiffness().plus(1.0, &specimen),
        whole.reference_stiffness()
    );
    assert_eq!(parted.element_names().collect::<Vec<_>>(), ["element 1"]);

    // Mass whose inertia is in the measured force moves as well: the requested ratios are those of the whole.
    let heavy = SpecimenShare {
        mass: &SymMatrix::zeros(3),
        mass_in_force: &SymMatrix::from_triplets(3, [(1, 1, 0.25)]),
        ..share
    };
    let spring = ElementSpec {
        law: toml::from_str("linear = { stiffness_n_per_m = 300.0 }").unwrap(),
        ..spring
    };
    let late = building(&[1.0, 0.75, 1.0], &[0.0, 0.0, 100.0], None)
        .build(Some(&rule), &[spring], Some(heavy), &MatrixFiles::new())
        .unwrap();
    assert_eq!(late.damping(), whole.damping());
    assert_ne!(late.mass(), whole.mass());
}
