//! Cost of a loading unit in a tick: the strokes of a pose with the Jacobian, the measured pose by Newton from there, and
//! the forces of the platform.
//!
//! Run with `cargo bench --bench geometry`. Poses differ from tick to tick, and the measured one from the target by the lag of
//! an actuator, a hundredth of the amplitude.

use divan::{Bencher, black_box};
use gusset_actuator::geometry::{Coordinate, Geometry, GeometrySpec, PlanePins, SpacePins};

fn main() {
    divan::main();
}

fn plane(exact: bool) -> Geometry {
    let pins = |base_m, joint_m| PlanePins {
        base_m,
        joint_m,
        length_m: None,
    };
    GeometrySpec {
        plane: Some(vec![
            pins([-1.6, 0.1], [-0.4, 0.15]),
            pins([-0.5, -1.2], [-0.5, -0.1]),
            pins([0.6, -1.3], [0.5, -0.1]),
        ]),
        exact: Some(exact),
        ..GeometrySpec::default()
    }
    .build(1.0)
    .expect("a geometry")
}

fn space() -> Geometry {
    let pins = |base_m, joint_m| SpacePins {
        base_m,
        joint_m,
        length_m: None,
    };
    GeometrySpec {
        coordinates: Some(vec![
            Coordinate::Ux,
            Coordinate::Uy,
            Coordinate::Rx,
            Coordinate::Ry,
        ]),
        space: Some(vec![
            pins([-1.5, 0.1, 0.0], [-0.3, 0.0, 0.0]),
            pins([0.0, -1.6, 0.05], [0.1, -0.3, 0.0]),
            pins([-1.4, 0.0, 0.7], [-0.25, 0.1, 0.7]),
            pins([0.1, -1.5, 0.7], [0.0, -0.3, 0.75]),
        ]),
        ..GeometrySpec::default()
    }
    .build(1.0)
    .expect("a geometry")
}

/// One tick after the other.
fn ticks(bencher: Bencher<'_, '_>, geometry: &Geometry) {
    let n = geometry.coordinates().len();
    let (mut aim, mut found) = (geometry.reference(), geometry.reference());
    let mut step = 0u32;
    bencher.bench_local(|| {
        step = (step + 1) % 1000;
        let t = f64::from(step) * 1e-3;
        let pose = [0.02 * t, -0.01 * t, 0.03 * t, 0.01 * t, 0.0, 0.0];
        let mut forces = [0.0; 6];
        let mut rates = [0.0; 6];
        if geometry.place(black_box(&pose[..n]), &mut aim).is_err()
            || geometry.within_reach(&aim).is_err()
        {
            return forces;
        }
        geometry.stroke_rates(&aim, &pose, &mut rates);
        let lagging = aim.strokes().map(|stroke| 0.99 * stroke);
        found = aim;
        if geometry
            .find_for_forces(black_box(&lagging), &mut found)
            .is_ok()
        {
            geometry.pose_forces(&found, &lagging, &mut forces[..n]);
        }
        black_box(forces)
    });
}

#[divan::bench]
fn three_actuators_exact(bencher: Bencher<'_, '_>) {
    ticks(bencher, &plane(true));
}

#[divan::bench]
fn three_actuators_small(bencher: Bencher<'_, '_>) {
    ticks(bencher, &plane(false));
}

#[divan::bench]
fn four_actuators_in_space(bencher: Bencher<'_, '_>) {
    ticks(bencher, &space());
}
