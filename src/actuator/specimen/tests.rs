//! Every specimen that a test file can describe continues from a restored state with the same bits, alone and within every
//! specimen that surrounds it.

use super::*;
use crate::geometry::{Geometry, GeometrySpec, PlanePins};
use gusset_quantity::state::{Stateful, TestState};

const SPECIMENS: [(&str, usize); 5] = [
    (
        "law = { bouc_wen = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1, beta = 0.6, gamma = 0.4, \
         exponent = 1.5, hardening_ratio = 2.0, degradation = { strength = 0.05, stiffness = 0.02 } } }",
        2,
    ),
    (
        "laws = [ { bilinear = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1 } }, \
         { gap = { stiffness_n_per_m = 1e7, gap_m = 2e-3, side = 'compression' } }, \
         { smooth_friction = { slip_force_n = 750.0, reference_velocity_m_per_s = 0.01 } } ]",
        3,
    ),
    (
        "coupled = { stiffness_n_per_m = [[2e6, -1e5], [-1e5, 1e6]], damping_n_s_per_m = [[1e3, 0.0], [0.0, 2e3]] }",
        2,
    ),
    (
        "bearing = { elastomeric = { stiffness_n_per_m = 1e6, characteristic_strength_n = 1e3, post_yield_stiffness_n_per_m = 1e5 } }",
        2,
    ),
    (
        "bearing = { friction_pendulum = { radius_m = 2, stiffness_n_per_m = 1e6, friction_slow = 0.05, friction_fast = 0.08, \
         rate_s_per_m = 20, largest_axial_force_n = 1e5, vertical_stiffness_n_per_m = 1e7 } }",
        3,
    ),
];

fn three_actuators() -> Geometry {
    let spec = GeometrySpec {
        coordinates: None,
        plane: Some(
            [
                ([-1.6, 0.1], [-0.4, 0.15]),
                ([-0.5, -1.2], [-0.5, -0.1]),
                ([0.6, -1.3], [0.5, -0.1]),
            ]
            .map(|(base_m, joint_m)| PlanePins {
                base_m,
                joint_m,
                length_m: None,
            })
            .to_vec(),
        ),
        ..GeometrySpec::default()
    };
    spec.build(1.0).unwrap()
}

/// A specimen within each of those that surround another.
fn within(around: &str, inner: Box<dyn Specimen>) -> Box<dyn Specimen> {
    match around {
        "units" => InUnits::around(inner, &[(1e-3, 1e3)]),
        "mounted" => Mounted::around(inner, &[(1e-3, 40.0)]),
        "stiffened" => Box::new(Stiffened::new(inner, 1.2)),
        "platform" => Box::new(Platform::new(inner, three_actuators(), &[])),
        _ => inner,
    }
}

fn drive(specimen: &mut dyn Specimen, ticks: std::ops::Range<u32>, scale: f64) -> Vec<u64> {
    let n = specimen.axes();
    let (mut disp, mut vel) = (vec![0.0; n], vec![0.0; n]);
    let (mut force, mut measured) = (vec![0.0; n], vec![0.0; n]);
    let mut seen = Vec::new();
    for k in ticks {
        for axis in 0..n {
            let at = f64::from(k) * 0.07 + axis as f64;
            disp[axis] = scale * 5e-3 * libm::sin(at);
            vel[axis] = scale * 0.03 * libm::cos(at);
        }
        measured.copy_from_slice(&disp);
        specimen.trial(&disp, &vel, 0.01, &mut force);
        specimen.measured(&mut measured);
        specimen.commit();
        seen.extend(force.iter().chain(&measured).map(|value| value.to_bits()));
    }
    seen
}

#[test]
fn restored_specimens_have_the_same_bits() {
    for (text, axes) in SPECIMENS {
        let law: SpecimenLaw = toml::from_str(text).unwrap();
        for around in ["", "units", "mounted", "stiffened", "platform"] {
            // A platform in the plane has three coordinates.
            if around == "platform" && axes != 3 {
                continue;
            }
            let scale = if around == "units" { 1e3 } else { 1.0 };
            let build = || within(around, law.build(axes).unwrap());
            let mut one = build();
            drive(one.as_mut(), 0..137, scale);
            // A pending trial is not part of the state.
            one.trial(
                &vec![0.02; axes],
                &vec![0.0; axes],
                0.01,
                &mut vec![0.0; axes],
            );
            let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
            one.revert();
            let mut other = build();
            drive(other.as_mut(), 20..60, scale);
            state.restore(|visit| other.visit_state(visit)).unwrap();
            assert_eq!(
                drive(other.as_mut(), 137..300, scale),
                drive(one.as_mut(), 137..300, scale),
                "{text} {around}"
            );
        }
    }
}
