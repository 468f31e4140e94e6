use super::*;

const CORNERS: [(f64, f64); 4] = [(1e-3, 100.0), (3e-3, 130.0), (6e-3, 140.0), (12e-3, 40.0)];

fn list(corners: [(f64, f64); 4]) -> Vec<EnvelopePointSpec> {
    let corner = |(disp_m, force_n)| EnvelopePointSpec { disp_m, force_n };
    corners.map(corner).to_vec()
}

fn plain() -> Pinching4Spec {
    Pinching4Spec {
        positive: list(CORNERS),
        negative: None,
        pinching: PinchSpec {
            r_disp: 0.5,
            r_force: 0.25,
            u_force: 0.05,
        },
        negative_pinching: None,
        g_k: [0.0; 5],
        g_d: [0.0; 5],
        g_f: [0.0; 5],
        g_e: 10.0,
        damage: DamageType::Energy,
    }
}

/// Forces at the displacements in mm, one step each.
fn walk(spec: &Pinching4Spec, path: &[f64]) -> Vec<f64> {
    let mut law = spec.build().unwrap();
    path.iter().map(|d| law.step(1e-3 * d, 0.0, 0.0)).collect()
}

fn assert_near(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
    }
}

#[test]
fn envelope_is_as_described() {
    for (disp, force, tangent) in [
        (0.5, 50.0, 1e5),
        (2.0, 115.0, 1.5e4),
        (9.0, 90.0, -1e5 / 6.0),
        (20.0, 40.0, 0.0),
        (-6.0, -140.0, 1e4 / 3.0),
    ] {
        let mut law = plain().build().unwrap();
        assert_near(&[law.trial(1e-3 * disp, 0.0, 0.0)], &[force]);
        assert!((law.tangent().stiffness - tangent).abs() < 1e-6, "{disp}");
    }
    let law = plain().build().unwrap();
    assert!((law.steepest_softening() - 1e5 / 6.0).abs() < 1e-6);
}

/// Unloading to −7 N (0.05 of 140 N), then to −32.5 N at half of the target displacement, then to the target.
#[test]
fn way_has_three_lines() {
    let mut law = plain().build().unwrap();
    for disp in [3.0, -3.0, 3.0] {
        law.step(1e-3 * disp, 0.0, 0.0);
    }
    let unloaded = 3.0 - 1.37;
    let after: Vec<f64> = [unloaded, -1.5, -2.25, -3.0]
        .iter()
        .map(|d| law.step(1e-3 * d, 0.0, 0.0))
        .collect();
    assert_near(&after, &[-7.0, -32.5, -81.25, -130.0]);
}

/// The strength falls by its damage, at most by the limit, when the motion reverses.
#[test]
fn strength_falls_by_its_damage() {
    let spec = Pinching4Spec {
        g_f: [0.6, 0.0, 1.0, 0.0, 0.4],
        ..plain()
    };
    // Damages are those of the displacement before the excursion that ends: 1 mm, then 3 mm, of 12 mm.
    let forces = walk(&spec, &[3.0, -3.0, 6.0, -6.0]);
    let kept = |disp: f64| 1.0 - 0.6 * disp / 12.0;
    assert_near(
        &forces,
        &[
            130.0,
            -130.0 * kept(1.0),
            140.0 * kept(3.0),
            -140.0 * kept(3.0),
        ],
    );
    let all = Pinching4Spec { g_e: 1e-6, ..spec };
    assert_near(&walk(&all, &[3.0, -3.0]), &[130.0, -78.0]);
}

#[test]
fn cycles_count_the_path() {
    let spec = Pinching4Spec {
        g_d: [0.0, 0.1, 1.0, 1.0, 0.5],
        damage: DamageType::Cycle,
        ..plain()
    };
    // A path of 3 mm over four times 1 mm: the target −1 mm moves to −1.075 mm, where the envelope has −101.125 N. Reloading is no
    // stiffer than 100 N/mm.
    let forces = walk(&spec, &[3.0, -1.0, -1.075]);
    assert_near(&forces, &[130.0, -93.625, -101.125]);
}

#[test]
fn pinching_out_of_its_domain_is_refused() {
    let mut spec = plain();
    spec.pinching.u_force = 0.25;
    assert_eq!(spec.build().unwrap_err().key(), "u_force");
    let mut spec = plain();
    spec.g_k[4] = 1.5;
    assert_eq!(spec.build().unwrap_err().key(), "g_k");
    let mut spec = plain();
    spec.positive.pop();
    assert_eq!(spec.build().unwrap_err().key(), "positive");
}
