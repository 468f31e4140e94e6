//! Damping of frames by rule, against closed forms.

use super::*;
use crate::frame::FrameSpec;

const MASS: f64 = 2e3;
const OTHER: f64 = 1e3;
const LINK: f64 = 3e5;
const SPECIMEN: f64 = 2e5;
/// E I of a square of 0.1 m in 20 fibres.
const BENDING: f64 = 2e11 * 1e-4 / 12.0 * (1.0 - 1.0 / 400.0);
/// 12 E I/L³.
const COLUMN: f64 = 12.0 * BENDING / 27.0;

/// C of two columns that sway alone, the first one beside a link and a specimen.
fn damping(rule: &str, column: &str, link: &str, is_specimen_damped: bool) -> [f64; 2] {
    let frame = toml::from_str(&format!(
        "node = [{{ name = 'a', at_m = [0, 0], fixed = ['x', 'y', 'rz'] }}, \
         {{ name = 'b', at_m = [0, 3], mass_kg = {MASS}, fixed = ['y', 'rz'] }}, \
         {{ name = 'c', at_m = [5, 0], fixed = ['x', 'y', 'rz'] }}, \
         {{ name = 'd', at_m = [5, 3], mass_kg = {OTHER}, fixed = ['y', 'rz'] }}]\n\
         member = [{{ nodes = ['a', 'b'], section = 's'{column} }}, \
         {{ nodes = ['c', 'd'], section = 's', kind = 'force_based' }}]\n\
         link = [{{ nodes = ['a', 'b'], direction = 'x', law.linear.stiffness_n_per_m = {LINK}{link} }}]\n\
         material.m.elastic.young_pa = 2e11\n\
         section.s.rectangle = {{ material = 'm', width_m = 0.1, depth_m = 0.1 }}"
    ));
    let specimen = SymMatrix::diagonal(&[SPECIMEN, 0.0]);
    let none = SymMatrix::zeros(2);
    let share = SpecimenShare {
        stiffness_at_rest: &specimen,
        damped_stiffness: if is_specimen_damped { &specimen } else { &none },
        mass: &none,
        mass_in_force: &none,
    };
    let rule: DampingSpec = toml::from_str(rule).unwrap();
    let built = StructureSpec::Frame(frame.unwrap()).build(
        Some(&rule),
        &[],
        Some(share),
        &MatrixFiles::new(),
    );
    let structure = built.unwrap();
    assert_eq!(structure.damping().get(0, 1), 0.0);
    [0, 1].map(|dof| structure.damping().get(dof, dof))
}

#[track_caller]
fn assert_near(found: [f64; 2], expected: [f64; 2]) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }
}

#[test]
fn frame_damps_its_members_alone() {
    let rule = "rayleigh = { mass_coefficient_per_s = 0.4, stiffness_coefficient_s = 2e-3 }";
    let expected = |stiffness: f64| [0.4 * MASS + stiffness, 0.4 * OTHER + 2e-3 * COLUMN];
    let rayleigh = |column, link, specimen| damping(rule, column, link, specimen);
    assert_near(rayleigh("", "", false), expected(2e-3 * COLUMN));
    let link = ", damped = true";
    assert_near(rayleigh("", link, false), expected(2e-3 * (COLUMN + LINK)));
    assert_near(rayleigh("", "", true), expected(2e-3 * (COLUMN + SPECIMEN)));
    let own = ", stiffness_coefficient_s = 5e-3";
    let both = expected(5e-3 * COLUMN + 2e-3 * (LINK + SPECIMEN));
    assert_near(rayleigh(own, link, true), both);
    let own = ", stiffness_coefficient_s = 0";
    assert_near(rayleigh(own, "", false), expected(0.0));
}

/// ω of the whole structure: the first column with link and specimen, then the other one.
#[test]
fn ratios_and_modes_are_those_of_the_whole_frame() {
    let first = ((COLUMN + LINK + SPECIMEN) / MASS).sqrt();
    let second = (COLUMN / OTHER).sqrt();
    let b = 2.0 * 0.03 / (first + second);
    let a = b * first * second;
    let rule = "rayleigh_ratio = { ratio = 0.03, modes = [1, 2] }";
    let expected = [a * MASS + b * COLUMN, a * OTHER + b * COLUMN];
    assert_near(damping(rule, "", "", false), expected);
    let own = ", stiffness_coefficient_s = 1e-3";
    let expected = [a * MASS + 1e-3 * COLUMN, expected[1]];
    assert_near(damping(rule, own, "", false), expected);
    let rule = "modal = { ratios = [0.03] }";
    let expected = [2.0 * 0.03 * first * MASS, 2.0 * 0.03 * second * OTHER];
    assert_near(damping(rule, "", "", false), expected);
}

/// A joint without rotary mass gets no damping, and P-Δ changes none: 3 E I/L³ across the column and E A/L along it.
#[test]
fn damping_of_a_frame_skips_massless_joints_and_axial_loads() {
    let frame = toml::from_str(
        "node = [{ name = 'a', at_m = [0, 0], fixed = ['x', 'y', 'rz'] }, { name = 'b', at_m = [0, 3], mass_kg = 2e3 }]\n\
         member = [{ nodes = ['a', 'b'], section = 's', p_delta = true }]\n\
         load = [{ node = 'b', y_n = -2e5 }]\n\
         section.s.elastic = { young_pa = 2e11, area_m2 = 0.01, inertia_m4 = 1e-5 }",
    );
    let rule: DampingSpec = toml::from_str(
        "rayleigh = { mass_coefficient_per_s = 0.4, stiffness_coefficient_s = 2e-3 }",
    )
    .unwrap();
    let frame: FrameSpec = frame.unwrap();
    let model = frame.model().unwrap();
    let built = |rule| {
        let spec = StructureSpec::Frame(frame.clone());
        spec.build(Some(rule), &[], None, &MatrixFiles::new())
            .unwrap()
    };
    let structure = built(&rule);
    let c = structure.damping();
    let along = 0.4 * MASS + 2e-3 * 2e9 / 3.0;
    // The rotation follows statically: θ = −K₂₁/K₂₂ x, with the axial force in K₁₁ alone.
    let across = 0.4 * MASS + 2e-3 * 3.0 * 2e6 / 27.0;
    assert_near([c.get(0, 0), c.get(1, 1)], [across, along]);
    assert!(c.row_is_zero(2), "{c:?}");
    // With the initial stiffness, the joint is damped by itself.
    let rule = "rayleigh = { mass_coefficient_per_s = 0.4, stiffness_coefficient_s = 2e-3, stiffness_part = 'initial' }";
    let structure = built(&toml::from_str(rule).unwrap());
    let c = structure.damping();
    let across = 0.4 * MASS + 2e-3 * 12.0 * 2e6 / 27.0;
    assert_near([c.get(0, 0), c.get(1, 1)], [across, along]);
    assert_near([c.get(2, 2); 2], [2e-3 * 4.0 * 2e6 / 3.0; 2]);
    let lowered = 12.0 * 2e6 / 27.0 - 2e5 / 3.0;
    assert_near([model.stiffness.get(0, 0); 2], [lowered; 2]);
}
