mod closed_forms;
mod poses;

use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;

use super::*;
use Coordinate::{Rx, Ry, Rz, Ux, Uy, Uz};

/// Of strokes: a length of about 2 m is known to a few ε of itself.
const EXACT: f64 = 4e-15;

fn plane(pins: &[([f64; 2], [f64; 2])], coordinates: &[Coordinate]) -> GeometrySpec {
    let pins = pins.iter().map(|(base_m, joint_m)| PlanePins {
        base_m: *base_m,
        joint_m: *joint_m,
        length_m: None,
    });
    GeometrySpec {
        coordinates: Some(coordinates.to_vec()),
        plane: Some(pins.collect()),
        ..GeometrySpec::default()
    }
}

fn space(pins: &[([f64; 3], [f64; 3])], coordinates: &[Coordinate]) -> GeometrySpec {
    let pins = pins.iter().map(|(base_m, joint_m)| SpacePins {
        base_m: *base_m,
        joint_m: *joint_m,
        length_m: None,
    });
    GeometrySpec {
        coordinates: Some(coordinates.to_vec()),
        space: Some(pins.collect()),
        ..GeometrySpec::default()
    }
}

/// One horizontal and two vertical actuators on a beam, with joint offsets.
const THREE: [([f64; 2], [f64; 2]); 3] = [
    ([-1.6, 0.1], [-0.4, 0.15]),
    ([-0.5, -1.2], [-0.5, -0.1]),
    ([0.6, -1.3], [0.5, -0.1]),
];

/// Two along x above each other, two along y above each other.
const FOUR: [([f64; 3], [f64; 3]); 4] = [
    ([-1.5, 0.1, 0.0], [-0.3, 0.0, 0.0]),
    ([0.0, -1.6, 0.05], [0.1, -0.3, 0.0]),
    ([-1.4, 0.0, 0.7], [-0.25, 0.1, 0.7]),
    ([0.1, -1.5, 0.7], [0.0, -0.3, 0.75]),
];

/// A hexapod.
fn six() -> Vec<([f64; 3], [f64; 3])> {
    (0..6)
        .map(|leg| {
            let turn = std::f64::consts::PI / 3.0;
            let side = if leg % 2 == 0 { -0.2 } else { 0.2 };
            let foot = f64::from(leg / 2 * 2) * turn;
            let head = f64::from((leg + 1) / 2 * 2) * turn - turn;
            let at = |angle: f64, radius: f64, height: f64| {
                [radius * libm::cos(angle), radius * libm::sin(angle), height]
            };
            (at(foot + side, 1.0, -1.1), at(head - 0.5 * side, 0.6, 0.0))
        })
        .collect()
}

/// Every form that moves its Jacobian.
fn all() -> Vec<Geometry> {
    [
        plane(&[([-2.0, -0.7], [0.1, 0.2])], &[Ux]),
        plane(&THREE[..2], &[Ux, Uy]),
        plane(&THREE[..2], &[Ux, Rz]),
        plane(&THREE, &[Ux, Uy, Rz]),
        plane(&THREE, &[Uy, Rz]),
        space(&FOUR, &[Ux, Uy, Rx, Ry]),
        space(&FOUR, &[Ux, Uy, Ry]),
        space(&six(), &[Ux, Uy, Uz, Rx, Ry, Rz]),
    ]
    .iter()
    .map(|spec| spec.build(1.0).unwrap())
    .collect()
}

fn placed(geometry: &Geometry, pose: &[f64]) -> Placed {
    let mut placed = geometry.reference();
    geometry.place(pose, &mut placed).unwrap();
    placed
}
