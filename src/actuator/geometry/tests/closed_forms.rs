//! Strokes and forces against closed forms.

use super::*;

#[test]
fn one_actuator_is_a_square_root() {
    let geometry = plane(&[([-3.0, -4.0], [0.0, 0.0])], &[Ux, Uy]);
    assert!(geometry.build(1.0).is_err(), "one cannot hold two");
    let geometry = plane(&[([-3.0, -4.0], [0.0, 0.0])], &[Ux])
        .build(1.0)
        .unwrap();
    for u in [-0.7, -1e-9, 0.0, 1e-12, 0.3, 2.0f64] {
        let found = placed(&geometry, &[u]);
        let exact = ((3.0 + u) * (3.0 + u) + 16.0).sqrt() - 5.0;
        assert!((found.strokes()[0] - exact).abs() < 1e-15 * 8.0);
        assert!((found.slope(0, 0) - (3.0 + u) / (5.0 + exact)).abs() < 1e-15);
    }
    // Where √ − 5 has lost every digit: 0.6 u of a displacement far below ε·5.
    let tiny = placed(&geometry, &[1e-18]);
    assert!((tiny.strokes()[0] / 6e-19 - 1.0).abs() < 1e-15);
}

#[test]
fn two_actuators_meet_at_two_circles() {
    let (a, b) = ([-3.0, 0.0], [1.0, -2.0]);
    let geometry = plane(&[(a, [0.0; 2]), (b, [0.0; 2])], &[Ux, Uy]);
    let geometry = geometry.build(1.0).unwrap();
    for (s, t) in [(0.2, -0.3), (-0.5, 0.1), (0.0, 0.0), (1e-7, 1e-9)] {
        let mut found = geometry.reference();
        geometry.find(&[s, t], &mut found).unwrap();
        // Circles of radius r about a and q about b, the intersection on the side of the origin.
        let (r, q) = (3.0 + s, 5.0f64.sqrt() + t);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let d = (dx * dx + dy * dy).sqrt();
        let along = (r * r - q * q + d * d) / (2.0 * d);
        let aside = (r * r - along * along).sqrt();
        let x = a[0] + (along * dx - aside * dy) / d;
        let y = a[1] + (along * dy + aside * dx) / d;
        // The circles' own rounding, a few ε of 10 m².
        assert!(
            (found.pose()[0] - x).abs() < 2e-14,
            "{} {x}",
            found.pose()[0]
        );
        assert!((found.pose()[1] - y).abs() < 2e-14);
    }
}

#[test]
fn three_actuators_match_complex_numbers() {
    let geometry = plane(&THREE, &[Ux, Uy, Rz]).build(1.0).unwrap();
    for pose in [[0.1, -0.05, 0.2], [-0.3, 0.2, -0.4], [1e-3, 1e-3, 1e-3f64]] {
        let found = placed(&geometry, &pose);
        for (index, (base, joint)) in THREE.iter().enumerate() {
            // |p + e^{iθ} a − b| − |a − b|
            let (s, c) = libm::sincos(pose[2]);
            let x = pose[0] + c * joint[0] - s * joint[1] - base[0];
            let y = pose[1] + s * joint[0] + c * joint[1] - base[1];
            let rest = libm::hypot(joint[0] - base[0], joint[1] - base[1]);
            assert!((found.strokes()[index] - (libm::hypot(x, y) - rest)).abs() < EXACT);
            assert!((geometry.length(index).unwrap() - rest).abs() < EXACT);
        }
    }
}

#[test]
fn platform_turns_about_its_rotation_vector() {
    let geometry = space(&six(), &[Ux, Uy, Uz, Rx, Ry, Rz]).build(1.0).unwrap();
    // On both sides of where the series end (θ² = 1e-3), and at right angles.
    for turn in [
        [0.0, 0.0, 0.0],
        [0.01, -0.02, 0.015],
        [0.018, 0.018, -0.018],
        [0.019, 0.019, -0.019],
        [0.3, -0.2, 0.5],
        [std::f64::consts::FRAC_PI_2, 0.0, 0.0],
    ] {
        let pose = [0.02, -0.03, 0.05, turn[0], turn[1], turn[2]];
        let found = placed(&geometry, &pose);
        let rotation = Rotation3::new(Vector3::from(turn));
        for (index, (base, joint)) in six().iter().enumerate() {
            let (base, joint) = (Vector3::from(*base), Vector3::from(*joint));
            let arm = rotation * joint + Vector3::new(0.02, -0.03, 0.05) - base;
            let exact = arm.norm() - (joint - base).norm();
            assert!((found.strokes()[index] - exact).abs() < EXACT, "{turn:?}");
        }
    }
}

#[test]
fn plane_agrees_with_space() {
    let flat = plane(&THREE, &[Ux, Uy, Rz]).build(1.0).unwrap();
    let lifted = THREE.map(|(b, j)| ([b[0], b[1], 0.0], [j[0], j[1], 0.0]));
    let solid = space(&lifted, &[Ux, Uy, Rz]).build(1.0).unwrap();
    for pose in [[0.1, -0.05, 0.2], [-0.2, 0.1, 1e-2], [0.0, 0.0, -1.0]] {
        let (flat, solid) = (placed(&flat, &pose), placed(&solid, &pose));
        for actuator in 0..3 {
            assert!((flat.strokes()[actuator] - solid.strokes()[actuator]).abs() < EXACT);
            for column in 0..3 {
                let both = (flat.slope(actuator, column), solid.slope(actuator, column));
                assert!((both.0 - both.1).abs() < EXACT, "{both:?}");
            }
        }
    }
}

#[test]
fn plane_forces_are_resultant_and_moment() {
    let geometry = plane(&THREE, &[Ux, Uy, Rz]).build(1.0).unwrap();
    let pose = [0.1, -0.2, 0.3f64];
    let placed = placed(&geometry, &pose);
    let given = [1000.0, -700.0, 350.0];
    let mut found = [0.0; 3];
    geometry.pose_forces(&placed, &given, &mut found);
    let mut resultant = [0.0; 3];
    for ((base, joint), force) in THREE.iter().zip(given) {
        let (s, c) = libm::sincos(pose[2]);
        let arm = [c * joint[0] - s * joint[1], s * joint[0] + c * joint[1]];
        let way = [pose[0] + arm[0] - base[0], pose[1] + arm[1] - base[1]];
        let length = libm::hypot(way[0], way[1]);
        let pull = [force * way[0] / length, force * way[1] / length];
        resultant[0] += pull[0];
        resultant[1] += pull[1];
        resultant[2] += arm[0] * pull[1] - arm[1] * pull[0];
    }
    for (found, exact) in found.iter().zip(resultant) {
        // Products of 1e3 and three terms.
        assert!((found - exact).abs() < 1e-11, "{found} {exact}");
    }
}

#[test]
fn moments_at_rest_are_arms_times_forces() {
    let coordinates = [Ux, Uy, Rx, Ry];
    let geometry = space(&FOUR, &coordinates).build(1.0).unwrap();
    let placed = geometry.reference();
    for (index, (base, joint)) in FOUR.iter().enumerate() {
        let joint = Vector3::from(*joint);
        let e = (joint - Vector3::from(*base)).normalize();
        let moment = joint.cross(&e);
        for (column, exact) in [e.x, e.y, moment.x, moment.y].into_iter().enumerate() {
            assert!((placed.slope(index, column) - exact).abs() < EXACT);
        }
    }
}

#[test]
fn extra_actuators_agree_in_the_mean() {
    // Two side by side push one storey: their difference is split.
    let pair = plane(
        &[([-2.0, 0.5], [0.0, 0.5]), ([-2.0, -0.5], [0.0, -0.5])],
        &[Ux],
    );
    let geometry = pair.build(1.0).unwrap();
    let mut found = geometry.reference();
    geometry.find(&[0.013, 0.011], &mut found).unwrap();
    assert!((found.pose()[0] - 0.012).abs() < 1e-16);
    let mut forces = [0.0; 2];
    geometry.stroke_forces(&found, &[500.0], &mut forces);
    assert!(forces.iter().all(|force| (force - 250.0).abs() < 1e-12));
    let mut whole = [0.0];
    geometry.pose_forces(&found, &[300.0, 100.0], &mut whole);
    assert!((whole[0] - 400.0).abs() < 1e-12);
}
