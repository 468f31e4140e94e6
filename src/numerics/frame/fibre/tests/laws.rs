//! Steel and concrete against closed forms.

use super::*;

const STEEL: MenegottoPintoSpec = MenegottoPintoSpec {
    young_pa: 2e11,
    yield_pa: 4e8,
    hardening_ratio: 0.02,
    r0: 18.0,
    cr1: 0.9,
    cr2: 0.2,
    a1: 0.05,
    a2: 1.5,
    a3: 0.1,
    a4: 2.0,
};

/// Stress and tangent on a branch, in yield stresses, at a share of its span.
fn bent(share: f64, exponent: f64) -> [f64; 2] {
    let sum = 1.0 + libm::pow(share, exponent);
    let root = libm::pow(sum, 1.0 / exponent);
    let b = STEEL.hardening_ratio;
    [share * (b + (1.0 - b) / root), b + (1.0 - b) / (root * sum)]
}

#[test]
fn steel_bends_to_its_hardening_lines() {
    let spec = MaterialSpec::MenegottoPinto(STEEL);
    let mut steel = Single::new(&spec);
    for strains in [-15.0, -3.0, -0.9, 0.01, 0.5, 1.0, 1.3, 6.0] {
        let [stress, tangent] = steel.trial(2e-3 * strains);
        let [wanted, slope] = bent(f64::abs(strains), 18.0);
        assert_near(stress, 4e8 * strains.signum() * wanted);
        assert_near(tangent, 2e11 * slope);
    }
    // From 6 yield strains back. The hardening line in compression has moved by a1 (7/(2 a2))^0.8.
    let [from, _] = steel.step(0.012);
    let from = from / 4e8;
    let shift = 1.0 + 0.05 * libm::pow(7.0 / 3.0, 0.8);
    let span = shift + (from - 0.02 * 6.0) / 0.98;
    let plastic = f64::abs(-1.0 - (6.0 - span));
    let exponent = 18.0 * (1.0 - 0.9 * plastic / (0.2 + plastic));
    for distance in [1e-6, 0.3, 2.0, 9.0] {
        let [stress, tangent] = steel.trial(2e-3 * (6.0 - distance));
        let [bend, slope] = bent(distance / span, exponent);
        assert_near(stress, 4e8 * (from - span * bend));
        assert_near(tangent, 2e11 * slope);
    }
    // And forth from −5: range 11, a3 (11/(2 a4))^0.8.
    let [from, _] = steel.step(-0.01);
    let from = from / 4e8;
    let span = 1.0 + 0.1 * libm::pow(11.0 / 4.0, 0.8) - (from + 0.02 * 5.0) / 0.98;
    let plastic = f64::abs(6.0 - (span - 5.0));
    let exponent = 18.0 * (1.0 - 0.9 * plastic / (0.2 + plastic));
    let [bend, slope] = bent(7.0 / span, exponent);
    let [stress, tangent] = steel.trial(2e-3 * 2.0);
    assert_near(stress, 4e8 * (from + span * bend));
    assert_near(tangent, 2e11 * slope);
}

/// Far on the hardening line a branch may begin on its own line, so that its span is rounding alone.
#[test]
fn reversals_without_extent_are_forgotten() {
    for hardening_ratio in [0.0, 0.02, 0.9, 0.99] {
        let spec = MaterialSpec::MenegottoPinto(MenegottoPintoSpec {
            hardening_ratio,
            a1: 0.0,
            a3: 0.0,
            ..STEEL
        });
        let (mut steel, mut plain) = (Single::new(&spec), Single::new(&spec));
        let [most, _] = plain.step(1.0);
        steel.step(1.0);
        for k in 0..100 {
            for strain in [1.0 - f64::EPSILON, 1.0] {
                let [stress, tangent] = steel.step(strain);
                let off = (stress / most - 1.0).abs();
                assert!(off < 1e-12, "{hardening_ratio} {k}: {off:e}");
                assert!((0.0..=2.1e11).contains(&tangent), "{tangent}");
            }
            let ([found, _], [wanted, _]) = (steel.trial(0.99), plain.trial(0.99));
            let off = ((found - wanted) / most).abs();
            assert!(off < 1e-12, "{hardening_ratio} {k}: {off:e}");
        }
    }
}

/// A block of elastic lanes leaves the powers out. A lane that bends makes the block compute them.
#[test]
fn powers_left_out_change_no_bit() {
    let spec = named("steel_isotropic").build().unwrap();
    let respond = |far: f64| {
        let layout = [fibre(0.0, 1.0, 0), fibre(far, 0.0, 0)];
        let mut steel = Fibres::new(1, &layout, &[spec]);
        let mut bits = Vec::new();
        for k in 0..400 {
            let mut out = [SectionResponse::default()];
            let strain = 4e-4 * libm::sin(0.05 * f64::from(k));
            steel.trial(Lanes::best(), &[[strain, 1.0]], &mut out);
            steel.commit();
            bits.push((out[0].force[0].to_bits(), out[0].stiffness[0][0].to_bits()));
        }
        bits
    };
    assert!(respond(0.0) == respond(0.05));
}

#[test]
fn concrete_follows_its_envelope_and_unloads() {
    for name in ["concrete_01", "concrete_02"] {
        let mut concrete = Single::new(&named(name));
        for (strain, stress, tangent) in [
            (0.0005, 3e7 * 0.25 * 1.75, 3e10 * 0.75),
            (0.002, 3e7, -2.4e7 / 0.008),
            (0.006, 1.8e7, -2.4e7 / 0.008),
            (0.01, 6e6, 0.0),
            (0.02, 6e6, 0.0),
        ] {
            let [found, slope] = concrete.trial(-strain);
            assert_near(found, -stress);
            assert_near(slope, tangent);
        }
    }
    // Karsan and Jirsa: from 1.5 times the strain at the strength to 0.145 × 1.5² + 0.13 × 1.5 times.
    let mut concrete = Single::new(&named("concrete_01"));
    let [peak, _] = concrete.step(-0.003);
    let end = 0.002 * (0.145 * 2.25 + 0.13 * 1.5);
    let slope = peak / (end - 0.003);
    let [stress, tangent] = concrete.step(-0.002);
    assert_near(stress, -slope * (0.002 - end));
    assert_near(tangent, slope);
    for strain in [-0.9 * end, 0.0, 0.01] {
        assert_eq!(concrete.step(strain), [0.0; 2]);
    }
    assert_near(concrete.step(-0.0025)[0], -slope * (0.0025 - end));
    assert_near(concrete.step(-0.003)[0], peak);
    // Beyond twice that strain along a line, and beyond crushing to the same residual strain as at crushing.
    for strain in [0.008, 0.02] {
        concrete.step(-strain);
        let ratio: f64 = f64::min(strain / 0.002, 5.0);
        let end = 0.002 * (0.707 * (ratio - 2.0) + 0.834);
        assert_eq!(concrete.trial(-0.999 * end)[0], 0.0);
        assert!(concrete.trial(-1.001 * end)[0] < 0.0);
    }
}

#[test]
fn concrete_cracks_and_softens() {
    let mut concrete = Single::new(&named("concrete_02"));
    let young = 3e10;
    // Focal point: the line with λ E through the crushing point meets the elastic line there.
    let focus = (6e6 - 0.1 * young * 0.01) / (young * 0.9);
    let [peak, _] = concrete.step(-0.004);
    let slope = (-peak - young * focus) / (0.004 - focus);
    let end = 0.004 + peak / slope;
    // Elastic, then with half of the slope to its end, back elastic, then with the slope.
    assert_near(concrete.step(-0.0039)[0], peak + young * 0.0001);
    let [stress, tangent] = concrete.step(-0.001 - 0.5 * end);
    assert_near(stress, -0.5 * slope * (0.001 - 0.5 * end));
    assert_near(tangent, 0.5 * slope);
    let [further, tangent] = concrete.trial(-0.001 - 0.5 * end + 1e-6);
    assert_near(further, stress + 0.5 * slope * 1e-6);
    assert_near(tangent, 0.5 * slope);
    assert_near(
        concrete.trial(-0.001 - 0.5 * end - 1e-6)[0],
        stress - young * 1e-6,
    );
    let [stress, tangent] = concrete.step(-0.0035);
    assert_near(stress, -slope * (0.0035 - end));
    assert_near(tangent, slope);
    // In tension from there: elastic to 3 MPa, 1.5 GPa of loss, secant, and open without stress.
    let opened = |opening: f64| opening - end;
    assert_near(concrete.step(opened(5e-5))[0], 1.5e6);
    assert_near(concrete.step(opened(1e-4))[0], 3e6);
    let softened = 3e6 - 1.5e9 * 4e-4;
    assert_near(concrete.step(opened(5e-4))[0], softened);
    let [stress, tangent] = concrete.step(opened(2e-4));
    assert_near(stress, softened * 0.4);
    assert_near(tangent, softened / 5e-4);
    assert_eq!(concrete.step(opened(2.2e-3)), [0.0; 2]);
    assert_eq!(concrete.step(opened(1e-3)), [0.0; 2]);
    let [stress, _] = concrete.step(-0.0035);
    assert_near(stress, -slope * (0.0035 - end));
}
