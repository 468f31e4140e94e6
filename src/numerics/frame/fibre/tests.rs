//! Fibres: what all laws have in common, then sections.

use gusset_quantity::assert_is;
use gusset_quantity::domain::OutOfDomain;
use gusset_quantity::state::{Stateful, TestState};
use proptest::prelude::*;

use super::*;

mod laws;

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

fn materials() -> Vec<(String, MaterialSpec)> {
    let table: toml::Table = MATERIALS.parse().unwrap();
    let spec = |value: toml::Value| value.try_into().unwrap();
    table
        .into_iter()
        .map(|(name, value)| (name, spec(value)))
        .collect()
}

/// One fibre that is a whole section.
struct Single {
    fibres: Fibres,
    young: f64,
}

impl Single {
    fn new(spec: &MaterialSpec) -> Self {
        let material = spec.build().unwrap();
        Self {
            fibres: Fibres::new(1, &[fibre(0.0, 1.0, 0)], &[material]),
            young: material.initial_stiffness(),
        }
    }

    /// Stress and tangent.
    fn trial(&mut self, strain: f64) -> [f64; 2] {
        let mut out = [SectionResponse::default()];
        self.fibres.trial(Lanes::best(), &[[strain, 0.0]], &mut out);
        [out[0].force[0], out[0].stiffness[0][0]]
    }

    fn step(&mut self, strain: f64) -> [f64; 2] {
        let response = self.trial(strain);
        self.fibres.commit();
        response
    }

    fn bits(&mut self, strain: f64) -> [u64; 2] {
        self.trial(strain).map(f64::to_bits)
    }
}

fn fibre(y: f64, area: f64, material: usize) -> Fibre {
    Fibre {
        y,
        z: -0.3 * y,
        area,
        material,
    }
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
        for strain in [-3e-3, 3e-3] {
            assert_eq!(
                fibre.bits(strain),
                Single::new(&spec).bits(strain),
                "{name}"
            );
        }
    }
}

#[test]
fn no_number_gives_no_number() {
    for (name, spec) in materials() {
        let mut fibre = Single::new(&spec);
        for strain in path().take(60) {
            assert!(fibre.trial(f64::NAN)[0].is_nan(), "{name}");
            fibre.step(strain);
        }
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
        assert_eq!(other.fibres.demand(0), fibre.fibres.demand(0), "{name}");
        other.fibres.commit();
        for strain in path().skip(237) {
            assert_eq!(other.bits(strain), fibre.bits(strain), "{name} {strain}");
            other.fibres.commit();
            fibre.fibres.commit();
        }
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
    #![proptest_config(ProptestConfig::with_cases(48))]
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
                // The secant of a short step may cross a kink: it lies between the tangents at its ends.
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

fn named(name: &str) -> MaterialSpec {
    let found = materials().into_iter().find(|(known, _)| known == name);
    found.unwrap().1
}

fn assert_near(found: f64, wanted: f64) {
    assert!(
        (found - wanted).abs() <= 1e-12 * wanted.abs(),
        "{found} {wanted}"
    );
}

#[test]
fn section_sums_its_fibres() {
    // A rectangle of 0.3 m × 0.5 m in strips: N = E A ε, M = E I κ less the own inertia of the strips.
    let count = 20;
    let height = 0.5 / f64::from(count);
    let strip = |k| fibre((f64::from(k) + 0.5) * height - 0.25, 0.3 * height, 0);
    let layout: Vec<Fibre> = (0..count).map(strip).collect();
    let [elastic, steel] = ["elastic", "steel"].map(|name| named(name).build().unwrap());
    let mut fibres = Fibres::new(3, &layout, &[elastic]);
    let strains = [[1e-4, 0.0], [0.0, 2e-3], [-3e-4, -1e-3]];
    let mut out = [SectionResponse::default(); 3];
    fibres.trial(Lanes::best(), &strains, &mut out);
    let axial = 2.1e11 * 0.15;
    let bending = 2.1e11 * 0.3 * (0.125 - 0.5 * height * height) / 12.0;
    for ([strain, curvature], out) in strains.into_iter().zip(out) {
        assert!((out.force[0] - axial * strain).abs() < 1e-9 * axial * 1e-3);
        assert!((out.force[1] - bending * curvature).abs() < 1e-9 * bending * 1e-3);
        assert_eq!(out.stiffness, fibres.initial_stiffness());
        assert_near(out.stiffness[0][0], axial);
        assert!(out.stiffness[0][1].abs() < 1e-12 * axial);
        assert_near(out.stiffness[1][1], bending);
    }
    // An eccentric bar of another material: the sign of the coupling, and its yielding.
    let layout = [
        fibre(0.1, 0.02, 0),
        fibre(-0.2, 0.01, 1),
        fibre(0.1, 0.01, 0),
    ];
    let mut fibres = Fibres::new(2, &layout, &[elastic, steel]);
    let young = [2.1e11, 2e11];
    let [[ea, eay], [_, eayy]] = fibres.initial_stiffness();
    assert_near(ea, young[0] * 0.03 + young[1] * 0.01);
    assert_near(eay, -(young[0] * 0.03 * 0.1 - young[1] * 0.01 * 0.2));
    assert_near(eayy, young[0] * 0.03 * 0.01 + young[1] * 0.01 * 0.04);
    let mut out = [SectionResponse::default(); 2];
    fibres.trial(Lanes::best(), &[[0.0; 2], [0.0, 1e-4]], &mut out);
    assert_eq!(out[0].force, [0.0; 2]);
    assert_near(out[1].force[0], eay * 1e-4);
    assert_near(out[1].force[1], eayy * 1e-4);
    // In space z = −0.3 y: both bendings act as one.
    let mut out = [SectionResponse::default()];
    fibres.trial(Lanes::best(), &[[0.0, 1e-4, 0.0]], &mut out);
    assert_near(out[0].force[0], eay * 1e-4);
    assert_near(out[0].force[1], eayy * 1e-4);
    assert_near(out[0].force[2], 0.3 * eayy * 1e-4);
    let turned = out[0];
    fibres.trial(Lanes::best(), &[[0.0, 0.0, 1e-4]], &mut out);
    assert_near(out[0].force[0], 0.3 * eay * 1e-4);
    assert_near(out[0].force[2], 0.09 * eayy * 1e-4);
    assert_near(turned.stiffness[1][2], 0.3 * eayy);
    assert_eq!(turned.stiffness[2][1], turned.stiffness[1][2]);
}

#[test]
fn demand_is_the_largest_strain_committed() {
    let known = |name: &str| named(name).build().unwrap();
    let materials = ["steel", "concrete_01", "concrete_02", "elastic"].map(known);
    assert_near(materials[0].yield_strain().unwrap(), 2.1e-3);
    assert_eq!(materials[1].yield_strain(), Some(0.002));
    assert_eq!(materials[2].yield_strain(), Some(0.002));
    assert_eq!(materials[3].yield_strain(), None);
    for (material, wanted) in materials.into_iter().zip([3.0, 2.0, 2.0, 0.0]) {
        // No lane but those of fibres counts.
        let mut fibres = Fibres::new(2, &[fibre(0.1, 1.0, 0)], &[material]);
        let mut out = [SectionResponse::default(); 2];
        let scale = material.yield_strain().unwrap_or(0.002);
        for [strain, curvature] in [[-2.0, 0.0], [1.0, -20.0], [-4.0, -30.0]] {
            fibres.trial(
                Lanes::best(),
                &[[0.0; 2], [scale * strain, scale * curvature]],
                &mut out,
            );
            fibres.commit();
            fibres.trial(Lanes::best(), &[[0.1; 2]; 2], &mut out);
        }
        assert_eq!(fibres.demand(0), 0.0);
        assert!(
            (fibres.demand(1) - wanted).abs() < 1e-12,
            "{}",
            fibres.demand(1)
        );
    }
}

/// A section of all materials, on each instruction set, without allocation.
#[test]
fn all_lanes_give_equal_bits() {
    let all: Vec<Material> = materials()
        .iter()
        .map(|(_, spec)| spec.build().unwrap())
        .collect();
    let place = |k: usize| 0.01 * (k as f64 - 50.0);
    let layout: Vec<Fibre> = (0..101)
        .map(|k| fibre(place(k), 1e-3, k % all.len()))
        .collect();
    let mut found: Vec<Vec<u64>> = Vec::new();
    for lanes in Lanes::available() {
        let mut fibres = Fibres::new(2, &layout, &all);
        let mut bits = Vec::with_capacity(12_000);
        let strains: Vec<f64> = path().collect();
        let used = allocation_counter::measure(|| {
            for strain in strains {
                let mut out = [SectionResponse::default(); 2];
                fibres.trial(
                    lanes,
                    &[[strain, 0.0], [0.3 * strain, 2.0 * strain]],
                    &mut out,
                );
                fibres.revert();
                fibres.trial(
                    lanes,
                    &[[strain, 0.0], [0.3 * strain, 2.0 * strain]],
                    &mut out,
                );
                let mut in_space = [SectionResponse::default(); 2];
                let strains = [[strain, 0.0, strain], [0.3 * strain, 2.0 * strain, -strain]];
                fibres.trial(lanes, &strains, &mut in_space);
                for one in in_space {
                    bits.extend(one.force.map(f64::to_bits));
                }
                fibres.commit();
                for one in out {
                    bits.extend(
                        one.force
                            .iter()
                            .chain(one.stiffness.iter().flatten())
                            .map(|x| x.to_bits()),
                    );
                }
            }
        });
        assert_eq!(used.count_total, 0);
        bits.extend([fibres.demand(0), fibres.demand(1)].map(f64::to_bits));
        found.push(bits);
    }
    assert!(found.iter().all(|bits| *bits == found[0]));
}

#[test]
fn mistakes_name_their_key() {
    for (name, key, value) in [
        ("elastic", "young_pa", 0.0),
        ("elastic_no_tension", "young_pa", f64::NAN),
        ("steel", "young_pa", -2e11),
        ("steel", "yield_pa", 3e11),
        ("steel", "hardening_ratio", 1.0),
        ("steel", "r0", f64::INFINITY),
        ("steel", "cr1", 0.996),
        ("steel", "cr2", 0.0),
        ("steel", "a1", -0.1),
        ("steel", "a2", 0.0),
        ("steel", "a3", -0.1),
        ("steel", "a4", 0.0),
        ("concrete_01", "strength_pa", -3e7),
        ("concrete_01", "strain_at_strength", -0.002),
        ("concrete_01", "crushing_strength_pa", 3e7),
        ("concrete_02", "crushing_strain", 0.002),
        ("concrete_02", "unloading_ratio", 1.0),
        ("concrete_02", "unloading_ratio", 0.0199),
        ("concrete_02", "tensile_strength_pa", -1.0),
        ("concrete_02", "tension_softening_pa", 0.0),
    ] {
        let mut table = toml::Table::try_from(named(name)).unwrap();
        let (_, spec) = table.iter_mut().next().unwrap();
        spec[key] = toml::Value::Float(value);
        let spec: MaterialSpec = table.try_into().unwrap();
        let Err(OutOfDomain { name, found, .. }) = spec.stresses(&[0.0]) else {
            panic!("{key} = {value} passes");
        };
        assert_eq!((name, found.to_bits()), (key, value.to_bits()));
    }
    let strain = named("steel").stresses(&[0.0, f64::NAN]);
    assert_is!(strain => Err(OutOfDomain { name: "strain", .. }));
}
