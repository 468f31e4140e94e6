use super::*;

fn list(corners: &[(f64, f64)]) -> Vec<EnvelopePointSpec> {
    let corner = |(disp_m, force_n): &(f64, f64)| EnvelopePointSpec {
        disp_m: *disp_m,
        force_n: *force_n,
    };
    corners.iter().map(corner).collect()
}

/// Yield at 1 mm, peak at 4 mm, and 60 N from 10 mm on.
fn plain() -> HystereticSpec {
    HystereticSpec {
        positive: list(&[(1e-3, 100.0), (4e-3, 130.0), (10e-3, 60.0)]),
        negative: None,
        pinch_x: 1.0,
        pinch_y: 1.0,
        damage_1: 0.0,
        damage_2: 0.0,
        beta: 0.0,
    }
}

/// Forces at the displacements in mm, one step each.
fn walk(spec: &HystereticSpec, path: &[f64]) -> Vec<f64> {
    let mut law = spec.build().unwrap();
    path.iter().map(|d| law.step(1e-3 * d, 0.0, 0.0)).collect()
}

fn assert_near(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
    }
}

#[test]
fn envelope_is_as_described() {
    for (disp, force, tangent) in [
        (0.5, 50.0, 1e5),
        (2.0, 110.0, 1e4),
        (7.0, 95.0, -7e4 / 6.0),
        (12.0, 60.0, 0.0),
        (-4.0, -130.0, 1e4),
    ] {
        let mut law = plain().build().unwrap();
        assert_near(&[law.trial(1e-3 * disp, 0.0, 0.0)], &[force]);
        assert!((law.tangent().stiffness - tangent).abs() < 1e-6, "{disp}");
    }
    let law = plain().build().unwrap();
    assert!((law.steepest_softening() - 7e4 / 6.0).abs() < 1e-6);
    assert_eq!(law.bound(Reach::default()).0, Some(f64::INFINITY));
    // Two corners: the last line continues.
    let mut two = plain();
    two.positive.truncate(2);
    assert_near(&walk(&two, &[8.0]), &[170.0]);
}

#[test]
fn reloading_is_pinched_and_aims_at_peaks() {
    let spec = HystereticSpec {
        pinch_x: 0.8,
        pinch_y: 0.2,
        ..plain()
    };
    // Unloaded at 2.7 mm; towards −100 N at −1 mm, over −20 N at 0.8 of the way to −0.2 mm.
    let rest = 4.0 - 1.3;
    let bend = rest + 0.8 * (-0.2 - rest);
    let forces = walk(&spec, &[4.0, rest, bend, 0.5 * (bend - 1.0), -1.0, -4.0]);
    assert_near(&forces, &[130.0, 0.0, -20.0, -60.0, -100.0, -130.0]);
    // A partial unloading returns to the line of reloading.
    let forces = walk(
        &spec,
        &[4.0, 0.5 * (bend - 1.0), bend - 0.5, 0.5 * (bend - 1.0)],
    );
    assert_near(&forces[3..], &[-60.0]);
}

/// The target moves by the share of (μ − 1) and of the energy over that below both envelopes.
#[test]
fn damage_moves_the_target() {
    let below = 0.5 * 100.0 + 0.5 * 230.0 * 3.0 + 0.5 * 190.0 * 6.0;
    let spec = HystereticSpec {
        damage_1: 0.02,
        damage_2: 0.1,
        ..plain()
    };
    // To 4 mm, over zero force at 2.7 mm to −100 N at −1 mm and −130 N at −4 mm, and back to zero force.
    let spent =
        0.5 * 100.0 + 0.5 * 230.0 * 3.0 - 0.5 * 130.0 * 1.3 + 0.5 * 100.0 * 3.7 + 0.5 * 230.0 * 3.0
            - 0.5 * 130.0 * 1.3;
    let target = 4.0 * (1.0 + 0.02 * 3.0 + 0.1 * spent / (2.0 * below));
    let at_target = 130.0 - 70.0 / 6.0 * (target - 4.0);
    let slope = at_target / (target + 2.7);
    let forces = walk(&spec, &[4.0, -4.0, 0.0, 4.0, target]);
    assert_near(
        &forces,
        &[130.0, -130.0, 2.7 * slope, 6.7 * slope, at_target],
    );
}

/// Under damage without end the force fades, and stays a number.
#[test]
fn endless_damage_leaves_a_number() {
    let spec = HystereticSpec {
        damage_1: 0.5,
        damage_2: 0.5,
        ..plain()
    };
    let path: Vec<f64> = (0..4000)
        .map(|i| if i % 2 == 0 { 4.0 } else { -4.0 })
        .collect();
    let forces = walk(&spec, &path);
    assert!(forces.iter().all(|force| force.abs() <= 131.0));
}

#[test]
fn unloading_softens_with_ductility() {
    let spec = HystereticSpec {
        beta: 0.5,
        ..plain()
    };
    // μ = 4 halves the stiffness.
    assert_near(
        &walk(&spec, &[4.0, 3.0, 2.0, 3.0, 4.0]),
        &[130.0, 80.0, 30.0, 80.0, 130.0],
    );
}

#[test]
fn corners_out_of_order_are_refused() {
    let refused = |positive: &[(f64, f64)]| {
        let spec = HystereticSpec {
            positive: list(positive),
            ..plain()
        };
        spec.build().unwrap_err().key()
    };
    assert_eq!(refused(&[(1e-3, 100.0)]), "positive");
    assert_eq!(refused(&[(1e-3, 100.0), (1e-3, 130.0)]), "disp_m");
    assert_eq!(refused(&[(1e-3, 100.0), (2e-3, 300.0)]), "force_n");
    assert_eq!(refused(&[(1e-3, 100.0), (2e-3, -1.0)]), "force_n");
}
