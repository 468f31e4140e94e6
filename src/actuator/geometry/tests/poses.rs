//! Poses that are sought: found, singular, out of reach, at random.

use super::*;
use gusset_quantity::assert_is;
use gusset_quantity::state::{Stateful, TestState};

/// From anywhere near, the strokes of the pose that is found are those that were measured, to roundoff of a length: also where
/// the last step was just small enough to be the last.
#[test]
fn pose_is_found_to_roundoff_from_any_start() {
    let geometry = plane(&THREE, &[Ux, Uy, Rz]).build(1.0).unwrap();
    let pose = [0.03, -0.02, 0.05];
    let wanted = *placed(&geometry, &pose).strokes();
    for k in 0..200 {
        let off = 1e-5 * libm::pow(1.04, f64::from(k));
        let mut found = placed(&geometry, &pose.map(|value| value + off));
        geometry.find_for_forces(&wanted, &mut found).unwrap();
        let there = placed(&geometry, &found.pose()[..3]);
        for (stroke, wanted) in there.strokes().iter().zip(&wanted) {
            assert!(
                (stroke - wanted).abs() < 4e-16,
                "{off:e}: {:e}",
                stroke - wanted
            );
        }
    }
}

#[test]
fn restored_place_finds_the_same_poses() {
    for geometry in all() {
        let n = geometry.coordinates().len();
        let pose: Vec<f64> = (0..n).map(|k| 0.01 * (1.0 - 0.3 * k as f64)).collect();
        let mut one = placed(&geometry, &pose);
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        let mut other = geometry.reference();
        state.restore(|visit| other.visit_state(visit)).unwrap();
        assert_eq!(one, other);
        let measured = one.strokes().map(|stroke| stroke * (1.0 + 1e-6));
        for place in [&mut one, &mut other] {
            geometry.find_for_forces(&measured, place).unwrap();
        }
        assert_eq!(one, other);
    }
}

#[test]
fn small_displacements_are_the_limit() {
    for exact in all() {
        let small = exact.small().unwrap();
        assert!(!small.is_exact() && exact.is_exact());
        let n = exact.coordinates().len();
        let mut before = f64::NAN;
        for d in [1e-2, 5e-3, 2.5e-3, 1.25e-3] {
            let pose: Vec<f64> = (0..n).map(|k| d * (1.0 - 0.3 * k as f64)).collect();
            let (one, other) = (placed(&exact, &pose), placed(&small, &pose));
            let error = one.strokes().iter().zip(other.strokes());
            let error = error.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // Second order: half the displacement, a quarter of the difference, up to the third order's share.
            let ratio = before / error;
            assert!(before.is_nan() || (ratio - 4.0).abs() < 0.12, "{ratio}");
            before = error;
        }
    }
}

#[test]
fn larger_model_has_longer_strokes() {
    let (one, ten) = (
        plane(&THREE, &[Ux, Uy, Rz]).build(1.0).unwrap(),
        plane(&THREE, &[Ux, Uy, Rz]).build(10.0).unwrap(),
    );
    let small = placed(&one, &[0.01, -0.02, 0.1]);
    let large = placed(&ten, &[0.1, -0.2, 0.1]);
    for (a, b) in small.strokes().iter().zip(large.strokes()) {
        assert!((10.0 * a - b).abs() < 10.0 * EXACT);
    }
    let matrix = |scale| {
        let spec = GeometrySpec {
            coordinates: Some(vec![Ux, Rz]),
            matrix: Some(vec![vec![1.0, 0.5], vec![1.0, -0.5]]),
            ..GeometrySpec::default()
        };
        spec.build(scale).unwrap()
    };
    let moved = placed(&matrix(10.0), &[0.1, 0.02]);
    assert_eq!(moved.strokes()[..2], [0.1 + 0.1, 0.1 - 0.1]);
}

#[test]
fn singular_pose_is_named() {
    let pair = plane(
        &[([-1.0, 0.0], [0.0; 2]), ([0.0, -1.0], [0.0; 2])],
        &[Ux, Uy],
    );
    let geometry = pair.build(1.0).unwrap();
    let mut placed = geometry.reference();
    let fault = geometry.place(&[-0.5, -0.5], &mut placed).unwrap_err();
    assert_eq!(fault.wrong, Wrong::Singular);
    let text = fault.to_string();
    assert!(
        text.contains("ux = -0.5 m") && text.contains("uy = -0.5 m"),
        "{text}"
    );
    geometry.place(&[-0.49, -0.5], &mut placed).unwrap();
    assert!(placed.independence() < 0.05 && geometry.condition(&placed) > 20.0);
    let fault = geometry.place(&[-1.0, 0.0], &mut placed).unwrap_err();
    assert_eq!(fault.wrong, Wrong::PinsMeet { actuator: 0 });
    // Three lines through one point hold no moment about it.
    let star = [[-1.0, 0.0], [0.5, 0.8], [0.5, -0.8]].map(|base| (base, base.map(|v| 0.3 * v)));
    let refused = plane(&star, &[Ux, Uy, Rz]).build(1.0).unwrap_err();
    assert_is!(refused => GeometryError::Fault(fault) if fault.wrong == Wrong::Singular);
}

#[test]
fn too_short_actuator_is_named_with_pose() {
    let mut spec = plane(&THREE, &[Ux, Uy, Rz]);
    for pins in spec.plane.as_mut().unwrap() {
        pins.length_m = Some([1.0, 1.3]);
    }
    let geometry = spec.build(1.0).unwrap();
    let reach = |pose: &[f64]| geometry.within_reach(&placed(&geometry, pose));
    assert_eq!(reach(&[0.05, 0.0, 0.0]), Ok(()));
    let fault = reach(&[0.2, 0.0, 0.0]).unwrap_err();
    assert_is!(
        fault.wrong
        => Wrong::OutOfReach { actuator: 0, stroke, .. } if (0.19..0.2).contains(stroke)
    );
    assert!(fault.to_string().contains("ux = 0.2 m"), "{fault}");
    spec.plane.as_mut().unwrap()[1].length_m = Some([1.2, 1.3]);
    let refused = spec.build(1.0).unwrap_err();
    assert!(
        matches!(refused, GeometryError::Length { actuator: 2, .. }),
        "{refused}"
    );
}

#[test]
fn invalid_geometry_is_refused() {
    let refused = |spec: &GeometrySpec| spec.build(1.0).unwrap_err();
    assert_is!(refused(&GeometrySpec::default()) => GeometryError::Forms { found: 0 });
    let mut both = plane(&THREE, &[Ux]);
    both.matrix = Some(vec![vec![1.0]]);
    assert_is!(refused(&both) => GeometryError::Forms { found: 2 });
    assert_is!(refused(&plane(&[], &[Ux])) => GeometryError::Count { key: "plane", found: 0 });
    assert_is!(
        refused(&plane(&THREE, &[Ux, Ux]))
        => GeometryError::Coordinates { found, .. } if found.contains("ux")
    );
    assert_is!(
        refused(&plane(&THREE, &[Uz]))
        => GeometryError::Coordinates { found, .. } if found.contains("uz")
    );
    assert_is!(
        refused(&plane(&THREE[..1], &[Ux, Uy]))
        => GeometryError::Coordinates { wanted, .. } if wanted.contains("1 to 1")
    );
    let same = plane(&[([0.1, 0.2], [0.1, 0.2])], &[Ux]);
    assert_is!(refused(&same) => GeometryError::NoLength { actuator: 1 });
    let mut unsaid = plane(&THREE[..2], &[]);
    unsaid.coordinates = None;
    assert_is!(refused(&unsaid) => GeometryError::Unsaid { key: "plane", .. });
    let mut matrix = GeometrySpec {
        coordinates: Some(vec![Ux, Rz]),
        matrix: Some(vec![vec![1.0, 0.5], vec![1.0]]),
        ..GeometrySpec::default()
    };
    assert_is!(refused(&matrix) => GeometryError::Row { row: 2, found: 1, wanted: 2 });
    matrix.matrix = Some(vec![vec![1.0, 0.5], vec![2.0, 1.0]]);
    assert_is!(refused(&matrix) => GeometryError::Fault(fault) if fault.wrong == Wrong::Singular);
    matrix.exact = Some(true);
    assert_is!(refused(&matrix) => GeometryError::ExactMatrix);
    // It cannot push across itself.
    let across = plane(&[([-3.0, 0.0], [0.0; 2])], &[Uy]);
    assert_is!(refused(&across) => GeometryError::Fault(fault) if fault.wrong == Wrong::Singular);
}

#[test]
fn nonsense_ends_in_a_fault() {
    for geometry in all() {
        let mut at = geometry.reference();
        for bad in [f64::NAN, f64::INFINITY, 1e300, -1e300, -50.0] {
            let strokes = [bad; MOST];
            at = geometry.reference();
            assert!(geometry.find(&strokes, &mut at).is_err(), "{bad}");
        }
        assert!(geometry.place(&[f64::NAN; MOST], &mut at).is_err());
    }
}

#[test]
fn nothing_is_allocated_after_construction() {
    let geometries = all();
    let count = allocation_counter::measure(|| {
        for geometry in &geometries {
            let mut at = geometry.reference();
            for k in 0..100 {
                let pose = [1e-3 * f64::from(k); MOST];
                let n = geometry.coordinates().len();
                geometry.place(&pose[..n], &mut at).unwrap();
                let _ = geometry.within_reach(&at);
                let strokes = *at.strokes();
                let mut found = geometry.reference();
                geometry.find(&strokes, &mut found).unwrap();
                let mut out = [0.0; MOST];
                geometry.pose_forces(&found, &strokes, &mut out[..n]);
                geometry.stroke_forces(&found, &strokes[..n], &mut out);
                geometry.stroke_rates(&found, &strokes[..n], &mut out);
                geometry.pose_rates(&found, &strokes, &mut out);
            }
        }
    });
    assert_eq!(count.count_total, 0);
}

/// A pose well inside the range of every geometry of [`all`].
fn pose() -> impl Strategy<Value = Six> {
    proptest::array::uniform6(-0.15f64..0.15)
}

proptest! {
    /// s(q) = s has the q that it was made of, from the reference pose, to the roundoff of lengths through J⁻¹.
    #[test]
    fn pose_and_strokes_invert_each_other(pose in pose(), which in 0usize..8) {
        let geometry = all().swap_remove(which);
        let n = geometry.coordinates().len();
        let there = placed(&geometry, &pose[..n]);
        let mut back = geometry.reference();
        geometry.find(there.strokes(), &mut back).unwrap();
        let bound = EXACT * geometry.condition(&there) * 10.0;
        for (found, given) in back.pose()[..n].iter().zip(&pose) {
            prop_assert!((found - given).abs() < bound, "{:?} {bound}", back.pose());
        }
        // From where the measurement is expected it is the same pose to the last digits, and its strokes are those given.
        let mut near = placed(&geometry, &pose.map(|v| v + 1e-4)[..n]);
        geometry.find(there.strokes(), &mut near).unwrap();
        for (found, given) in near.pose()[..n].iter().zip(&pose) {
            prop_assert!((found - given).abs() < bound);
        }
    }

    /// Central differences have an error of h²/6 times a third derivative below 100 /m², and ε·2 m/h.
    #[test]
    fn jacobian_matches_central_differences(pose in pose(), which in 0usize..8) {
        let geometry = all().swap_remove(which);
        let n = geometry.coordinates().len();
        let here = placed(&geometry, &pose[..n]);
        let h = 1e-5;
        for column in 0..n {
            let moved = |by: f64| {
                let mut pose = pose;
                pose[column] += by;
                placed(&geometry, &pose[..n])
            };
            let (ahead, behind) = (moved(h), moved(-h));
            for actuator in 0..geometry.actuators() {
                let slope = (ahead.strokes()[actuator] - behind.strokes()[actuator]) / (2.0 * h);
                let error = (here.slope(actuator, column) - slope).abs();
                prop_assert!(error < 3e-9, "{error} of {actuator}, {column}");
            }
        }
    }

    /// The work of the actuators along any small motion is that of the platform: f·δs = F·δq, with δs from the strokes
    /// themselves; and with the velocities of both sides exactly.
    #[test]
    fn work_is_equal_on_both_sides(
        pose in pose(), way in pose(), forces in proptest::array::uniform6(-1e4f64..1e4), which in 0usize..8,
    ) {
        let geometry = all().swap_remove(which);
        let (n, m) = (geometry.coordinates().len(), geometry.actuators());
        let here = placed(&geometry, &pose[..n]);
        let mut of_pose = [0.0; MOST];
        geometry.pose_forces(&here, &forces[..m], &mut of_pose[..n]);
        let mut speeds = [0.0; MOST];
        geometry.stroke_rates(&here, &way[..n], &mut speeds[..m]);
        let work = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (far, near) = (work(&forces[..m], &speeds[..m]), work(&of_pose[..n], &way[..n]));
        let scale = 1e4 * 0.15 * (n * m) as f64;
        prop_assert!((far - near).abs() <= 8.0 * f64::EPSILON * scale, "{far} {near}");
        let h = 1e-5;
        let moved = |by: f64| {
            let mut pose = pose;
            for (pose, way) in pose.iter_mut().zip(way) {
                *pose += by * way;
            }
            placed(&geometry, &pose[..n])
        };
        let (ahead, behind) = (moved(h), moved(-h));
        let strokes: Vec<f64> = (0..m)
            .map(|i| (ahead.strokes()[i] - behind.strokes()[i]) / (2.0 * h))
            .collect();
        let along = work(&forces[..m], &strokes);
        prop_assert!((along - near).abs() < 3e-9 * 1e4 * m as f64, "{along} {near}");
    }

    /// Actuator forces in balance with the platform's give the platform's back, and velocities go there and back.
    #[test]
    fn forces_and_velocities_convert_both_ways(
        pose in pose(), rates in pose(), forces in proptest::array::uniform6(-1e4f64..1e4), which in 0usize..8,
    ) {
        let geometry = all().swap_remove(which);
        let (n, m) = (geometry.coordinates().len(), geometry.actuators());
        let here = placed(&geometry, &pose[..n]);
        let worse = geometry.condition(&here);
        let (mut there, mut back) = ([0.0; MOST], [0.0; MOST]);
        geometry.stroke_forces(&here, &forces[..n], &mut there[..m]);
        geometry.pose_forces(&here, &there[..m], &mut back[..n]);
        for k in 0..n {
            // Normal equations: the square of the condition.
            prop_assert!((back[k] - forces[k]).abs() < 1e4 * worse * worse * 1e-14, "{worse}");
        }
        let (mut there, mut back) = ([0.0; MOST], [0.0; MOST]);
        geometry.stroke_rates(&here, &rates[..n], &mut there[..m]);
        geometry.pose_rates(&here, &there[..m], &mut back[..n]);
        for k in 0..n {
            prop_assert!((back[k] - rates[k]).abs() < 0.15 * worse * worse * 1e-14);
        }
    }
}
