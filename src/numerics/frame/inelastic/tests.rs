//! Members that are evaluated against closed forms and against elastic ones.

use crate::frame::FrameSpec;
use crate::linalg::{Lanes, Spd};
use crate::model::{Base, Structure, StructureSpec};
use gusset_quantity::state::{Stateful, TestState};

const E: f64 = 2e11;
const L: f64 = 3.0;
/// Sums over 20 layers of a rectangle of 0.2 m by 0.3 m.
const EA: f64 = E * 0.06;
const EI: f64 = E * 0.2 * 0.027 / 12.0 * (1.0 - 1.0 / 400.0);

/// A cantilever to the right with this member, under a force across its end.
fn cantilever(member: &str) -> FrameSpec {
    toml::from_str(&format!(
        r#"
node = [{{ name = "a", at_m = [0, 0], fixed = ["x", "y", "rz"] }}, {{ name = "b", at_m = [{L}, 0], mass_kg = 1e3 }}]
member = [{{ nodes = ["a", "b"], section = "s", {member} }}]
load = [{{ node = "b", y_n = 1e3 }}]
material.elastic.elastic = {{ young_pa = {E:e} }}
material.steel.menegotto_pinto = {{ young_pa = {E:e}, yield_pa = 250e6, hardening_ratio = 0.02 }}
section.s.rectangle = {{ material = "{}", width_m = 0.2, depth_m = 0.3 }}
hinge.h.bilinear = {{ stiffness_n_per_m = 4e7, yield_force_n = 1e5, post_yield_ratio = 0.1 }}
"#,
        if member.contains("based") { "steel" } else { "elastic" }
    ))
    .unwrap()
}

fn structure(frame: FrameSpec) -> Structure {
    let spec = StructureSpec::Frame(frame);
    spec.build(None, &[], None, &Default::default()).unwrap()
}

/// Displacements of the free end under its load, in small steps: the forces converge at each.
fn settled(frame: FrameSpec, force: f64) -> Vec<f64> {
    let (mut factor, n) = {
        let model = frame.model().unwrap();
        (Spd::factor(&model.stiffness).unwrap(), model.dofs.len())
    };
    let mut structure = structure(frame);
    let mut x = vec![0.0; n];
    for part in 1..=20 {
        for _ in 0..400 {
            let mut r = vec![0.0; n];
            r[1] = force * f64::from(part) / 20.0;
            structure.subtract_trial(&x, &vec![0.0; n], Base::default(), 0.0, &mut r);
            factor.solve_in_place(&mut r);
            x.iter_mut().zip(&r).for_each(|(x, by)| *x += by);
        }
        structure.commit();
    }
    x
}

fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found / expected - 1.0).abs() < tolerance,
        "{found:e} {expected:e}"
    );
}

#[test]
fn virgin_members_are_elastic_ones() {
    let of = |member: &str| cantilever(member).model().unwrap().stiffness;
    let elastic = of("kind = \"elastic\"");
    for kind in ["force_based", "displacement_based"] {
        for points in [2, 3, 5, 10] {
            // Two points of Lobatto integrate no quadratic moment.
            if kind == "force_based" && points == 2 {
                continue;
            }
            let found = of(&format!("kind = \"{kind}\", points = {points}"));
            for (i, j, value) in elastic.entries() {
                assert_near(found.get(i, j), value, 1e-12);
            }
        }
    }
    assert_near(elastic.get(0, 0), EA / L, 1e-12);
}

/// δ = P L³/(3 E I) + P L²/k up to the yield of the hinge at the support, and softer beyond it.
#[test]
fn hinge_turns_in_series_with_its_member() {
    let member = "hinge_start = \"h\"";
    let tip = |force: f64| settled(cantilever(member), force)[1];
    let soft = L * L * L / (3.0 * EI);
    assert_near(tip(2e4), 2e4 * (soft + L * L / 4e7), 1e-9);
    let beyond = 5e4 * L - 1e5;
    let expected = 5e4 * soft + L * (1e5 / 4e7 + beyond / 4e6);
    assert_near(tip(5e4), expected, 1e-9);
}

/// A bar of fibres along an inclined line, and a link beside it: E A/L + k.
#[test]
fn trusses_and_links_act_along_their_line() {
    let frame: FrameSpec = toml::from_str(&format!(
        r#"
node = [{{ name = "a", at_m = [0, 0], fixed = ["x", "y", "rz"] }}, {{ name = "b", at_m = [3, 4], mass_kg = 1e3, fixed = ["rz"] }},
        {{ name = "c", at_m = [6, 0], fixed = ["x", "y", "rz"] }}]
member = [{{ nodes = ["a", "b"], section = "s", kind = "truss" }}]
link = [{{ nodes = ["a", "b"], direction = "axial", law.linear = {{ stiffness_n_per_m = 1e8 }} }},
        {{ nodes = ["c", "b"], direction = "x", law.linear = {{ stiffness_n_per_m = 3e7, damping_n_s_per_m = 2e4 }} }}]
material.steel.elastic = {{ young_pa = {E:e} }}
section.s.fibres = [{{ y_m = 0.1, area_m2 = 2e-3, material = "steel" }}, {{ y_m = -0.1, area_m2 = 2e-3, material = "steel" }}]
"#
    ))
    .unwrap();
    let model = frame.model().unwrap();
    let along = E * 4e-3 / 5.0 + 1e8;
    assert_near(model.stiffness.get(0, 0), 0.36 * along + 3e7, 1e-12);
    assert_near(model.stiffness.get(0, 1), 0.48 * along, 1e-12);
    assert_near(model.stiffness.get(1, 1), 0.64 * along, 1e-12);
    let mut structure = structure(frame);
    assert_eq!(structure.reference_damping().get(0, 0), 2e4);
    let (x, v) = ([1e-4, 0.0], [0.1, 0.0]);
    let mut r = [0.0; 2];
    structure.subtract_internal(&x, &v, Base::default(), 0.01, &mut r);
    assert_near(-r[0], (0.36 * along + 3e7) * 1e-4 + 2e3, 1e-12);
    // A base that moves with the frame deforms nothing.
    let base = Base {
        disp: 1e-4,
        vel: 0.1,
    };
    let mut r = [0.0; 2];
    structure.subtract_internal(&x, &v, base, 0.01, &mut r);
    assert!(r[0].abs() < 1e-6 && r[1].abs() < 1e-6, "{r:?}");
}

/// Motions far into yield: force-based members come to the forces of one with many passes, on the way there and back.
#[test]
fn force_based_member_converges() {
    let mut quick = structure(cantilever("kind = \"force_based\""));
    let mut slow = structure(cantilever("kind = \"force_based\""));
    let still = [0.0; 3];
    let mut largest = 0.0_f64;
    for step in 0..4000 {
        let t = f64::from(step) / 1000.0;
        let y = 0.06 * libm::sin(3.0 * t) * t;
        let x = [1e-4 * libm::sin(5.0 * t), y, 1.4 * y / L];
        let forces = |structure: &mut Structure, passes: u32| {
            let mut r = [0.0; 3];
            for _ in 0..passes {
                r = [0.0; 3];
                structure.subtract_trial(&x, &still, Base::default(), 0.0, &mut r);
            }
            structure.commit();
            r
        };
        let (a, b) = (forces(&mut quick, 2), forces(&mut slow, 30));
        largest = largest.max(b[1].abs());
        assert!(
            (a[1] - b[1]).abs() < 2e-3 * largest.max(1e4),
            "step {step}: {a:?} {b:?}"
        );
    }
    assert!(
        largest > 1.1 * 250e6 * 0.2 * 0.09 / 4.0 / L,
        "it must yield: {largest:e}"
    );
    assert!(quick.members().demands().all(|(_, demand)| demand[0] > 5.0));
}

/// The end of a member of cracking concrete jumps anywhere: the forces along it balance.
#[test]
fn brittle_member_balances_at_large_steps() {
    let column = r#"
node = [{ name = "a", at_m = [0, 0], fixed = ["x", "y", "rz"] }, { name = "b", at_m = [0, 3], mass_kg = 1e3, rotary_mass_kg_m2 = 10 }]
member = [{ nodes = ["a", "b"], section = "s", kind = "force_based" }]
load = []
material.cover.concrete_01 = { strength_pa = 30e6, strain_at_strength = 0.002, crushing_strength_pa = 6e6, crushing_strain = 0.006 }
material.core.concrete_02 = { strength_pa = 36e6, strain_at_strength = 0.0024, crushing_strength_pa = 20e6, crushing_strain = 0.015, unloading_ratio = 0.1, tensile_strength_pa = 2.5e6, tension_softening_pa = 2e9 }
material.bars.menegotto_pinto = { young_pa = 2e11, yield_pa = 500e6, hardening_ratio = 0.01 }
section.s.rc_rectangle = { concrete = "cover", core = "core", steel = "bars", width_m = 0.4, depth_m = 0.4, cover_m = 0.04, top_area_m2 = 1.2e-3, bottom_area_m2 = 1.2e-3 }
"#;
    let mut structure = structure(toml::from_str(column).unwrap());
    let mut seed = 7_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
    };
    let mut far = 0;
    for _ in 0..300 {
        let x = [0.06 * random(), -1e-3 + 1e-3 * random(), 0.02 * random()];
        let mut r = [0.0; 3];
        for _ in 0..2 {
            r = [0.0; 3];
            structure.subtract_trial(&x, &[0.0; 3], Base::default(), 0.0, &mut r);
        }
        far += u32::from(structure.members().unbalance() > 1e-3);
        structure.commit();
        // No section carries more than crushed concrete and yielding bars.
        assert!(r.iter().all(|r| r.abs() < 8e6), "{r:?}");
    }
    assert!(far <= 3, "{far} of 300");
}

#[test]
fn bits_are_equal_on_all_lanes_and_after_a_restart() {
    for member in [
        "kind = \"force_based\"",
        "kind = \"displacement_based\"",
        "hinge_start = \"h\", hinge_end = \"h\"",
    ] {
        let course = |lanes: Lanes, saved: Option<u32>| {
            let mut structure = structure(cantilever(member));
            structure.set_lanes(lanes);
            let mut bits = Vec::new();
            for step in 0..300 {
                let t = f64::from(step) / 100.0;
                let y = 0.05 * libm::sin(4.0 * t) * t;
                let x = [1e-4 * libm::sin(7.0 * t), y, 0.4 * y];
                if saved == Some(step) {
                    let state = TestState::of(|visit| structure.visit_state(visit)).unwrap();
                    // A way that is not gone.
                    let mut r = [0.0; 3];
                    structure.subtract_internal(
                        &[0.01; 3],
                        &[0.0; 3],
                        Base::default(),
                        0.01,
                        &mut r,
                    );
                    state.restore(|visit| structure.visit_state(visit)).unwrap();
                }
                let mut r = [0.0; 3];
                structure.subtract_internal(&x, &[0.0; 3], Base::default(), 0.01, &mut r);
                bits.extend(r.map(f64::to_bits));
            }
            bits
        };
        let plain = course(Lanes::Portable, None);
        assert!(plain == course(Lanes::Portable, Some(170)), "{member}");
        for lanes in Lanes::available() {
            assert!(plain == course(lanes, None), "{member}, {lanes}");
        }
    }
}

/// Displacements under the static loads of a frame, found with the first stiffness in ten parts.
fn at_rest(frame: FrameSpec) -> (crate::frame::FrameModel, Vec<f64>) {
    let model = frame.model().unwrap();
    let mut factor = Spd::factor(&model.stiffness).unwrap();
    let n = model.dofs.len();
    let (mut structure, mut x) = (structure(frame), vec![0.0; n]);
    for part in 1..=10 {
        for _ in 0..100 {
            let mut r: Vec<f64> = model
                .load
                .iter()
                .map(|f| f * f64::from(part) / 10.0)
                .collect();
            structure.subtract_trial(&x, &vec![0.0; n], Base::default(), 0.0, &mut r);
            factor.solve_in_place(&mut r);
            x.iter_mut().zip(&r).for_each(|(x, by)| *x += by);
        }
        structure.commit();
    }
    (model, x)
}

/// The portal of reinforced concrete of OpenSees' examples, RCFrameGravity: its published vertical displacement of node 3 is −0.0183736 in.
#[test]
fn concrete_portal_settles_as_published() {
    const INCH: f64 = 0.0254;
    const KIP: f64 = 4_448.221_615_260_5;
    const KSI: f64 = KIP / (INCH * INCH);
    let mut fibres = Vec::new();
    let mut strip = |[bottom, top]: [f64; 2], width: f64, count: usize, material: &str| {
        let each = (top - bottom) / count as f64;
        for i in 0..count {
            let y = (bottom + (i as f64 + 0.5) * each) * INCH;
            let area = each * width * INCH * INCH;
            fibres.push(format!(
                "{{ y_m = {y:e}, area_m2 = {area:e}, material = \"{material}\" }}"
            ));
        }
    };
    strip([-10.5, 10.5], 12.0, 10, "core");
    strip([-10.5, 10.5], 3.0, 10, "cover");
    strip([-12.0, -10.5], 15.0, 2, "cover");
    strip([10.5, 12.0], 15.0, 2, "cover");
    for (y, bars) in [(10.5, 3.0), (0.0, 2.0), (-10.5, 3.0)] {
        let area = 0.6 * bars * INCH * INCH;
        fibres.push(format!(
            "{{ y_m = {:e}, area_m2 = {area:e}, material = \"steel\" }}",
            y * INCH
        ));
    }
    let concrete = |strength: f64, strain: f64, crushing: f64, last: f64| {
        format!(
            "{{ strength_pa = {:e}, strain_at_strength = {strain}, crushing_strength_pa = {:e}, crushing_strain = {last} }}",
            strength * KSI,
            crushing * KSI
        )
    };
    let frame: FrameSpec = toml::from_str(&format!(
        r#"
node = [{{ name = "1", at_m = [0, 0], fixed = ["x", "y", "rz"] }}, {{ name = "2", at_m = [{w}, 0], fixed = ["x", "y", "rz"] }},
        {{ name = "3", at_m = [0, {h}], mass_kg = 1 }}, {{ name = "4", at_m = [{w}, {h}], mass_kg = 1 }}]
member = [{{ nodes = ["1", "3"], section = "column", kind = "force_based", p_delta = true }},
          {{ nodes = ["2", "4"], section = "column", kind = "force_based", p_delta = true }},
          {{ nodes = ["3", "4"], section = "beam" }}]
load = [{{ node = "3", y_n = {p:e} }}, {{ node = "4", y_n = {p:e} }}]
material.core.concrete_01 = {}
material.cover.concrete_01 = {}
material.steel.menegotto_pinto = {{ young_pa = {:e}, yield_pa = {:e}, hardening_ratio = 0.01 }}
section.beam.elastic = {{ young_pa = {:e}, area_m2 = {:e}, inertia_m4 = {:e} }}
section.column.fibres = [{}]
"#,
        concrete(6.0, 0.004, 5.0, 0.014),
        concrete(5.0, 0.002, 0.0, 0.006),
        30_000.0 * KSI,
        60.0 * KSI,
        4030.0 * KSI,
        360.0 * INCH.powi(2),
        8640.0 * INCH.powi(4),
        fibres.join(", "),
        w = 360.0 * INCH,
        h = 144.0 * INCH,
        p = -180.0 * KIP,
    ))
    .unwrap();
    let (model, x) = at_rest(frame);
    let [(dof, _)] = model.motion("3", crate::frame::Direction::Y).unwrap() else {
        panic!("a free direction");
    };
    // The last published digit.
    assert!(
        (x[*dof] / INCH + 0.018_373_6).abs() < 2e-7,
        "{:.9}",
        x[*dof] / INCH
    );
}

/// A cantilever under N and F across its end: F (tan(k L)/k − L)/N with k = √(N/(E I)). Chords are straight, so that the error
/// falls with the square of their number.
#[test]
fn chords_come_to_the_beam_column() {
    let (n, f) = (1.0e6, 1e3);
    let k = (n / EI).sqrt();
    let expected = f / n * (libm::tan(k * L) / k - L);
    let off = |count: usize| {
        let node = |i: usize| {
            let (y, more) = (
                L * i as f64 / count as f64,
                ["fixed = [\"x\", \"y\", \"rz\"]", "mass_kg = 1"],
            );
            format!(
                "{{ name = \"{i}\", at_m = [0, {y}], {} }}",
                more[usize::from(i > 0)]
            )
        };
        let member = |i: usize| {
            format!(
                "{{ nodes = [\"{}\", \"{}\"], section = \"s\", kind = \"displacement_based\", p_delta = true }}",
                i - 1,
                i
            )
        };
        let list = |from: usize, of: &dyn Fn(usize) -> String| {
            (from..=count).map(of).collect::<Vec<_>>().join(", ")
        };
        let frame = toml::from_str(&format!(
            "node = [{}]\nmember = [{}]\nload = [{{ node = \"{count}\", x_n = {f}, y_n = {:e} }}]\nmaterial.m.elastic = {{ young_pa = {E:e} }}\n\
             section.s.rectangle = {{ material = \"m\", width_m = 0.2, depth_m = 0.3 }}\n",
            list(0, &node),
            list(1, &member),
            -n,
        ))
        .unwrap();
        let (model, x) = at_rest(frame);
        let motion = model
            .motion(&count.to_string(), crate::frame::Direction::X)
            .unwrap();
        (x[motion[0].0] / expected - 1.0).abs()
    };
    let (four, eight, sixteen) = (off(4), off(8), off(16));
    assert!(sixteen < 1e-4, "{four:e} {eight:e} {sixteen:e}");
    assert!((four / eight - 4.0).abs() < 0.2 && (eight / sixteen - 4.0).abs() < 0.2);
}

#[test]
fn a_step_allocates_nothing() {
    for member in [
        "kind = \"force_based\"",
        "hinge_start = \"h\"",
        "kind = \"displacement_based\"",
    ] {
        let mut structure = structure(cantilever(member));
        let mut r = [0.0; 3];
        let counted = allocation_counter::measure(|| {
            for step in 0..50 {
                let y = 0.002 * f64::from(step);
                structure.subtract_internal(
                    &[1e-5, y, 0.4 * y],
                    &[0.0; 3],
                    Base::default(),
                    0.01,
                    &mut r,
                );
            }
        });
        assert_eq!(counted.count_total, 0, "{member}");
    }
}
