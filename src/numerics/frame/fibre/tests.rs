//! Fibres: what all laws have in common, then sections.

use gusset_quantity::state::{Stateful, TestState};
use proptest::prelude::*;

use super::*;

/// One or more of each kind.
const MATERIALS: &str = r#"
elastic = { elastic = { young_pa = 2.1e11 } }
elastic_no_tension = { elastic_no_tension = { young_pa = 3e10 } }
steel = { menegotto_pinto = { young_pa = 2e11, yield_pa = 4.2e8, hardening_ratio = 0.01 } }
steel_plastic = { menegotto_pinto = { young_pa = 2e11, yield_pa = 3e8, hardening_ratio = 0, r0 = 25, cr1 = 0.9 } }
steel_isotropic = { menegotto_pinto = { young_pa = 2e11, yield_pa = 4.2e8, hardening_ratio = 0.02, r0 = 18, a1 = 0.05, a2 = 1.5, a3 = 0.1, a4 = 2 } }
concrete_01 = { concrete_01 = { strength_pa = 3e7, strain_at_strength = 0.002, crushing_strength_pa = 6e6, crushing_strain = 0.01 } }
concrete_01_lost = { concrete_01 = { strength_pa = 3e7, strain_at_strength = 0.002, crushing_strength_pa = 0, crushing_strain = 0.006 } }
concrete_02 = { concrete_02 = { strength_pa = 3e7, strain_at_strength = 0.002, crushing_strength_pa = 6e6, crushing_strain = 0.01, unloading_ratio = 0.1, tensile_strength_pa = 3e6, tension_softening_pa = 1.5e9 } }
concrete_02_lost = { concrete_02 = { strength_pa = 3e7, strain_at_strength = 0.002, crushing_strength_pa = 0, crushing_strain = 0.006, unloading_ratio = 0, tensile_strength_pa = 0, tension_softening_pa = 1e9 } }
"#;

pub(super) fn materials() -> Vec<(String, MaterialSpec)> {
    let table: toml::Table = MATERIALS.parse().unwrap();
    let spec = |value: toml::Value| value.try_into().unwrap();
    table
        .into_iter()
        .map(|(name, value)| (name, spec(value)))
        .collect()
}

/// One fibre that is a whole section.
pub(super) struct Single {
    fibres: Fibres,
    young: f64,
}

impl Single {
    pub(super) fn new(spec: &MaterialSpec) -> Self {
        let material = spec.build().unwrap();
        Self {
            fibres: Fibres::new(1, &[fibre(0.0, 1.0, 0)], &[material]),
            young: material.initial_stiffness(),
        }
    }

    /// Stress and tangent.
    pub(super) fn trial(&mut self, strain: f64) -> [f64; 2] {
        let mut out = [SectionResponse::default()];
        self.fibres.trial(Lanes::best(), &[[strain, 0.0]], &mut out);
        [out[0].force[0], out[0].stiffness[0]]
    }

    pub(super) fn step(&mut self, strain: f64) -> [f64; 2] {
        let response = self.trial(strain);
        self.fibres.commit();
        response
    }

    fn bits(&mut self, strain: f64) -> [u64; 2] {
        self.trial(strain).map(f64::to_bits)
    }
}

fn fibre(y: f64, area: f64, material: usize) -> Fibre {
    Fibre { y, area, material }
}

/// Strains that wander over all branches, ±2 %.
fn path() -> impl Iterator<Item = f64> {
    (0..400).map(|i| {
        let t = f64::from(i);
        1e-4 * t.min(120.0) * (0.7 * libm::sin(0.13 * t) + 0.5 * libm::sin(0.711 * t) - 0.3)
    })
}

#[test]
fn virgin_fibre_has_the_initial_stiffness() {
    for (name, spec) in materials() {
        let mut fibre = Single::new(&spec);
        let [stress, tangent] = fibre.trial(0.0);
        assert_eq!(stress, 0.0, "{name}");
        assert!((tangent / fibre.young - 1.0).abs() < 1e-15, "{name}");
        // No motion is no history.
        fibre.step(0.0);
        assert_eq!(fibre.bits(-1e-3), Single::new(&spec).bits(-1e-3), "{name}");
    }
}

#[test]
fn trials_leave_no_trace() {
    for (name, spec) in materials() {
        let (mut disturbed, mut plain) = (Single::new(&spec), Single::new(&spec));
        for strain in path() {
            let wanted = plain.bits(strain);
            disturbed.trial(-2.0 * strain + 1e-3);
            disturbed.fibres.revert();
            // Committing after a revert must change nothing either.
            disturbed.fibres.commit();
            disturbed.trial(strain - 4e-3);
            assert_eq!(disturbed.bits(strain), wanted, "{name} {strain}");
            disturbed.fibres.commit();
            plain.fibres.commit();
        }
    }
}

#[test]
fn restored_fibre_continues_with_equal_bits() {
    for (name, spec) in materials() {
        let mut fibre = Single::new(&spec);
        path().take(237).for_each(|strain| _ = fibre.step(strain));
        // A pending trial is not part of the state.
        fibre.trial(0.03);
        let state = TestState::of(|visit| fibre.fibres.visit_state(visit)).unwrap();
        let mut other = Single::new(&spec);
        path().take(90).for_each(|strain| _ = other.step(strain));
        other.trial(-0.02);
        state
            .restore(|visit| other.fibres.visit_state(visit))
            .unwrap();
        other.fibres.commit();
        for strain in path().skip(237) {
            assert_eq!(other.bits(strain), fibre.bits(strain), "{name} {strain}");
            other.fibres.commit();
            fibre.fibres.commit();
        }
        assert_eq!(other.fibres.demand(0), fibre.fibres.demand(0));
    }
}

/// Each law follows the straight path from its committed strain.
#[test]
fn one_step_equals_partial_steps() {
    for (name, spec) in materials() {
        let (mut whole, mut parts) = (Single::new(&spec), Single::new(&spec));
        let (mut last, mut largest) = (0.0, 0.0_f64);
        for strain in path().step_by(7) {
            for part in [0.11, 0.5, 0.86] {
                parts.step(last + part * (strain - last));
            }
            let [wanted, _] = whole.step(strain);
            let [found, _] = parts.step(strain);
            largest = largest.max(wanted.abs());
            // Rounding at a stiffness of 2e11 Pa and strains of 1e-2 is 1e-16 × 2e9 Pa a step.
            assert!(
                (found - wanted).abs() <= 1e-11 * largest,
                "{name} {strain}: {found} {wanted}"
            );
            last = strain;
        }
    }
}

proptest! {
    #[test]
    fn tangent_is_a_slope_up_to_the_initial_stiffness(
        steps in prop::collection::vec((-6_i32..=6, 1e-6_f64..1.0), 1..60),
    ) {
        for (name, spec) in materials() {
            let mut fibre = Single::new(&spec);
            let mut strain = 0.0;
            for (k, share) in &steps {
                // Steps of all sizes, up to 1 %.
                strain += f64::from(k.signum()) * libm::pow(10.0, f64::from(-k.abs()) / 2.0 - 1.5) * share;
                let [stress, tangent] = fibre.trial(strain);
                prop_assert!(tangent <= fibre.young * (1.0 + 1e-12), "{name} {strain}: {tangent:e}");
                // A secant on the same path, inside of which there may be a kink: it lies between the tangents at its ends.
                let h = 1e-9 * f64::from(if *k == 0 { 1 } else { k.signum() });
                let [further, next] = fibre.trial(strain + h);
                let secant = (further - stress) / h;
                let (low, high) = (tangent.min(next), tangent.max(next));
                // 1e-15 × 1e9 Pa of rounding over 1e-9, and the bend of the curve.
                let rounding = 1e-5 * fibre.young;
                prop_assert!(
                    (low - rounding..=high + rounding).contains(&secant),
                    "{name} {strain}: {secant:e} is not from {low:e} to {high:e}"
                );
                fibre.step(strain);
            }
        }
    }
}
