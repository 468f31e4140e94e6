use proptest::prelude::*;

use super::super::{Bilinear, BilinearSpec};
use super::*;

/// Yield at 1 mm, cap at 5 mm and 1320 N, residual force of 360 N from 12.27 mm on.
fn plain(response: HingeResponse) -> ImkSpec {
    ImkSpec {
        response,
        stiffness_n_per_m: 1.2e6,
        yield_force_n: 1200.0,
        capping_ratio: 1.1,
        plastic_disp_m: 4e-3,
        post_capping_disp_m: 10e-3,
        ultimate_disp_m: 20e-3,
        residual_ratio: 0.3,
        strength_lambda_m: 0.0,
        post_capping_lambda_m: 0.0,
        unloading_lambda_m: 0.0,
        reloading_lambda_m: 0.0,
        strength_exponent: 1.0,
        post_capping_exponent: 1.0,
        unloading_exponent: 1.0,
        reloading_exponent: 1.0,
        deterioration_factor: 1.0,
        negative: None,
    }
}

const BOTH: [HingeResponse; 2] = [HingeResponse::Bilinear, HingeResponse::PeakOriented];

/// Forces at the turning points, each leg in `pieces` steps.
fn walk(spec: &ImkSpec, turns: &[f64], pieces: u32) -> Vec<f64> {
    let mut law = spec.build().unwrap();
    let mut from = 0.0;
    let mut forces = Vec::new();
    for turn in turns {
        for i in 1..pieces {
            law.step(
                from + (turn - from) * f64::from(i) / f64::from(pieces),
                0.0,
                0.0,
            );
        }
        forces.push(law.step(*turn, 0.0, 0.0));
        from = *turn;
    }
    forces
}

fn assert_near(found: f64, wanted: f64, about: &str) {
    assert!((found - wanted).abs() < 1e-9, "{about}: {found} {wanted}");
}

#[test]
fn backbone_is_as_described() {
    let negative = NegativeHingeSpec {
        yield_force_n: Some(600.0),
        capping_ratio: Some(1.5),
        plastic_disp_m: Some(2e-3),
        post_capping_disp_m: Some(9e-3),
        ultimate_disp_m: Some(8e-3),
        residual_ratio: Some(0.5),
        deterioration_factor: None,
    };
    for response in BOTH {
        let spec = ImkSpec {
            negative: Some(negative.clone()),
            ..plain(response)
        };
        // Displacement, force and tangent of the line that leads there.
        for (disp, force, tangent) in [
            (0.5e-3, 600.0, 1.2e6),
            (3e-3, 1260.0, 3e4),
            (5e-3, 1320.0, 3e4),
            (8e-3, 924.0, -1.32e5),
            (13e-3, 360.0, 0.0),
            (19e-3, 360.0, 0.0),
            (20e-3, 0.0, 0.0),
            (30e-3, 0.0, 0.0),
            (-0.25e-3, -300.0, 1.2e6),
            (-1.5e-3, -750.0, 1.5e5),
            (-5.5e-3, -600.0, -1e5),
            (-8.5e-3, 0.0, 0.0),
        ] {
            let mut law = spec.build().unwrap();
            assert_near(law.trial(disp, 0.0, 0.0), force, "force");
            let off = law.tangent().stiffness - tangent;
            assert!(off.abs() < 1e-6, "{response:?} {disp}: {off}");
        }
    }
}

/// Up to the cap it is the spring with kinematic hardening.
#[test]
fn sound_hinge_is_the_bilinear_spring() {
    let mut law = plain(HingeResponse::Bilinear).build().unwrap();
    let mut bilinear: Bilinear = BilinearSpec {
        stiffness_n_per_m: 1.2e6,
        yield_force_n: 1200.0,
        post_yield_ratio: 3e4 / 1.2e6,
    }
    .build()
    .unwrap();
    for i in 0..3000 {
        let t = f64::from(i) * 0.1;
        let disp = 3e-3 * libm::sin(t) + 1.9e-3 * libm::sin(3.3 * t);
        let (found, wanted) = (law.step(disp, 0.0, 0.0), bilinear.step(disp, 0.0, 0.0));
        assert_near(found, wanted, "force");
    }
}

#[test]
fn reloading_aims_at_earlier_peaks() {
    let spec = plain(HingeResponse::PeakOriented);
    // Peaks of 1260 N at 3 mm; the unloading lines meet zero at 1.95 mm.
    for (path, wanted) in [
        // Toward the yield point of the other direction, and the peak there.
        (vec![3e-3, 0.475e-3], -600.0),
        (vec![3e-3, -3e-3, 0.525e-3], 630.0),
        (vec![3e-3, -3e-3, 4e-3], 1290.0),
        // A partial unloading leads back to where it began, and on to the largest peak.
        (vec![3e-3, -3e-3, 0.525e-3, 0.2e-3, 0.525e-3], 630.0),
        (vec![3e-3, -3e-3, 0.525e-3, 0.2e-3, 1.7625e-3], 945.0),
    ] {
        assert_near(walk(&spec, &path, 1).pop().unwrap(), wanted, "force");
    }
    // The last peak is on a stiffer line than the largest: reloading passes it.
    let path = [3e-3, -3e-3, 1.7625e-3, -1e-3, 1.7625e-3, 3e-3];
    let forces = walk(&spec, &path, 1);
    assert_near(forces[2], 945.0, "last peak");
    assert_near(forces[4], 945.0, "last peak again");
    assert_near(forces[5], 1260.0, "largest peak");
}

/// One excursion to the cap, and the shares that its energy takes from the other direction.
#[test]
fn shares_are_those_of_the_formula() {
    let (stiffness, capacity) = (1.2e6, 1200.0 * 0.06);
    let at_cap = 0.5 * 1200.0 * 1e-3 + 0.5 * (1200.0 + 1320.0) * 4e-3;
    for response in BOTH {
        let spec = ImkSpec {
            strength_lambda_m: 0.06,
            post_capping_lambda_m: 0.06,
            unloading_lambda_m: 0.06,
            reloading_lambda_m: if response == HingeResponse::PeakOriented {
                0.06
            } else {
                0.0
            },
            post_capping_exponent: 1.5,
            unloading_exponent: 1.2,
            reloading_exponent: 1.1,
            deterioration_factor: 0.8,
            residual_ratio: 0.0,
            ..plain(response)
        };
        let share = |spent: f64, c: f64| libm::pow(spent / (capacity - spent), c);
        let dissipated = at_cap - 0.5 * 1320.0 * 1320.0 / stiffness;
        let unloading = stiffness * (1.0 - share(dissipated, 1.2));
        let mut law = spec.build().unwrap();
        law.step(5e-3, 0.0, 0.0);
        assert_near(
            law.step(4.9e-3, 0.0, 0.0),
            1320.0 - unloading * 1e-4,
            "unloading",
        );
        // The softer line gives back more than the elastic energy.
        let spent = at_cap - 0.5 * 1320.0 * 1320.0 / unloading;
        let strength = 1.0 - 0.8 * share(spent, 1.0);
        let (yield_force, hardening) = (1200.0 * strength, 3e4 * strength);
        let softening = match response {
            HingeResponse::Bilinear => -1.32e5 * strength,
            HingeResponse::PeakOriented => -1.32e5,
        };
        let at_zero = (1320.0 + 1.32e5 * 5e-3) * (1.0 - 0.8 * share(spent, 1.5));
        let hardened = |disp: f64| yield_force + hardening * (disp - yield_force / stiffness);
        let cap = (at_zero - hardened(0.0)) / (hardening - softening);
        assert!(cap > 3e-3 && cap < 6e-3, "{cap}");
        if response == HingeResponse::PeakOriented {
            let rest = 5e-3 - 1320.0 / unloading;
            let target = 1e-3 * (1.0 + 0.8 * share(spent, 1.1));
            let slope = hardened(target) / (rest + target);
            assert_near(
                law.trial(0.0, 0.0, 0.0),
                -slope * rest,
                "reloading to the target",
            );
        }
        assert_near(law.trial(-3e-3, 0.0, 0.0), -hardened(3e-3), "hardening");
        let force = law.trial(-6e-3, 0.0, 0.0);
        assert_near(force, -(at_zero + softening * 6e-3), "softening");
    }
}

/// The energy of the excursion that ends counts, not that of earlier ones.
#[test]
fn each_excursion_takes_its_share() {
    let spec = ImkSpec {
        strength_lambda_m: 0.1,
        ..plain(HingeResponse::Bilinear)
    };
    let mut law = spec.build().unwrap();
    let (mut disp, mut force, mut energy, mut before) = (0.0, 0.0, 0.0, 0.0);
    let mut kept = [1.0, 1.0];
    for (turn, side) in [(3e-3, 1), (-3e-3, 0), (3e-3, 1), (-3e-3, 0)] {
        let from = disp;
        for i in 1..=10_000 {
            let next = from + (turn - from) * f64::from(i) / 1e4;
            let there = law.step(next, 0.0, 0.0);
            energy += 0.5 * (force + there) * (next - disp);
            if force != 0.0 && force * there <= 0.0 {
                kept[side] *= 1.0 - (energy - before) / (0.1 * 1200.0 - energy);
                before = energy;
            }
            (disp, force) = (next, there);
        }
        // Trapezoids of 0.6 µm err at the few kinks alone, by less than 1e-6 J.
        let wanted = kept[side] * 1260.0 + 3e4 * kept[side] * (1.0 - kept[side]) * 1e-3;
        assert!((force.abs() - wanted).abs() < 0.01, "{force} {wanted}");
    }
    assert!(kept[0] < 0.95, "{kept:?}");
}

/// A yield force below the residual one: the hardening line turns around the cap until the hinge reaches it at the residual force.
/// Once the cap is lower, too, nothing but the residual force is left.
#[test]
fn weak_backbone_keeps_the_residual_force() {
    let spent = 0.6 + 0.5 * (1200.0 + 1680.0) * 4e-3 - 0.5 * 1680.0 * 1680.0 / 1.2e6;
    let lambda = |share: f64| spent * (1.0 + share) / share / 1200.0;
    let turned = ImkSpec {
        capping_ratio: 1.4,
        residual_ratio: 0.5,
        strength_lambda_m: lambda(0.55),
        ..plain(HingeResponse::Bilinear)
    };
    // From 600 N, 0.5 mm beyond zero force at 3.6 mm, to the softening line, which has become flat.
    let level = 1680.0 + 1.68e5 * 5e-3;
    let cap = (level - 540.0 * (1.0 - 5.4e4 / 1.2e6)) / 5.4e4;
    let slope = (level - 600.0) / (cap + 3.1e-3);
    let mut law = turned.build().unwrap();
    law.step(5e-3, 0.0, 0.0);
    assert_near(law.trial(3.1e-3, 0.0, 0.0), -600.0, "arrival");
    let force = law.trial(-15e-3, 0.0, 0.0);
    assert_near(force, -(600.0 + slope * 18.1e-3), "hardening");
    let flat = ImkSpec {
        post_capping_lambda_m: lambda(0.9),
        ..turned
    };
    let mut law = flat.build().unwrap();
    law.step(5e-3, 0.0, 0.0);
    assert_near(law.trial(-15e-3, 0.0, 0.0), -600.0, "flat");
    assert_eq!(law.tangent().stiffness, 0.0);
}

/// The turned line begins at zero force if there is no residual force. That is no end of the backbone.
#[test]
fn turned_line_may_begin_at_zero_force() {
    let spec = ImkSpec {
        capping_ratio: 1.4,
        post_capping_disp_m: 30e-3,
        ultimate_disp_m: 60e-3,
        residual_ratio: 0.0,
        ..plain(HingeResponse::Bilinear)
    };
    for i in 0..50 {
        let far = 18e-3 + f64::from(i) * 1e-5;
        let force = 1680.0 - 5.6e4 * (far - 5e-3);
        let rest = far - force / 1.2e6;
        for turns in [vec![far, -2e-3], vec![far, rest, -2e-3]] {
            let found = walk(&spec, &turns, 1).pop().unwrap();
            let wanted = -1680.0 * (rest + 2e-3) / (rest + 5e-3);
            assert_near(found, wanted, "turned line");
        }
    }
}

/// Where a target would need a line steeper than the elastic one, or lies behind, the unloading line leads to the backbone.
#[test]
fn reloading_is_never_steeper_than_elastic() {
    let spent = 0.6 + 0.5 * (1200.0 + 1260.0) * 2e-3 - 0.5 * 1260.0 * 1260.0 / 1.2e6;
    for share in [0.7, 0.8] {
        let spec = ImkSpec {
            unloading_lambda_m: spent * (1.0 + share) / share / 1200.0,
            ..plain(HingeResponse::PeakOriented)
        };
        let stiffness = 1.2e6 * (1.0 - share);
        let rest = -3e-3 + 1260.0 / stiffness;
        assert!(rest > 0.0);
        let mut law = spec.build().unwrap();
        law.step(-3e-3, 0.0, 0.0);
        let disp = rest + 0.9e-3;
        assert_near(
            law.step(disp, 0.0, 0.0),
            0.9e-3 * stiffness,
            "unloading line",
        );
        let off = law.tangent().stiffness - stiffness;
        assert!(off.abs() < 1e-6, "{off}");
        assert_near(law.step(8e-3, 0.0, 0.0), 924.0, "backbone");
    }
}

#[test]
fn used_up_capacity_leaves_no_force() {
    for response in BOTH {
        for (strength, unloading) in [(5e-3, 0.0), (0.0, 5e-3)] {
            let spec = ImkSpec {
                strength_lambda_m: strength,
                unloading_lambda_m: unloading,
                ..plain(response)
            };
            // 5.6 J of 6 J: β is above 1.
            let forces = walk(&spec, &[5e-3, -1e-3, 5e-3, -5e-3], 1);
            assert_eq!(forces[1..], [0.0; 3], "{response:?} {strength}");
        }
    }
}

/// With bilinear response the other direction keeps its residual force until its own ultimate displacement.
#[test]
fn ultimate_displacement_ends_a_direction() {
    let path = [21e-3, 19e-3, -5e-3, 5e-3, 25e-3, -18e-3, -20e-3, 1e-3];
    let wanted = [0.0, -360.0, -360.0, 0.0, 0.0, -360.0, 0.0, 0.0];
    for (found, wanted) in walk(&plain(HingeResponse::Bilinear), &path, 1)
        .into_iter()
        .zip(wanted)
    {
        assert_near(found, wanted, "bilinear");
    }
    let forces = walk(&plain(HingeResponse::PeakOriented), &path, 1);
    assert_eq!(forces, [0.0; 8]);
}

/// OpenSees' IMKBilin unloads with half of the elastic stiffness once a residual force was reached.
#[test]
fn residual_force_halves_the_unloading_stiffness() {
    let mut law = plain(HingeResponse::Bilinear).build().unwrap();
    law.step(15e-3, 0.0, 0.0);
    assert_near(law.trial(14.8e-3, 0.0, 0.0), 240.0, "force");
    assert_eq!(law.tangent().stiffness, 0.6e6);
}

/// Any hinge, and a path that takes it through yield, cap, residual and ultimate displacements.
fn hinges() -> impl Strategy<Value = (ImkSpec, Vec<f64>)> {
    let shape = (
        1.0..1.4f64,
        2e-3..8e-3f64,
        5e-3..30e-3f64,
        10e-3..60e-3f64,
        0.0..0.5f64,
    );
    let lambda = || prop_oneof![Just(0.0), 0.05..1.0f64];
    let lambdas = (lambda(), lambda(), lambda(), lambda());
    let exponents = (1.0..2.0f64, 1.0..2.0f64, 1.0..2.0f64, 1.0..2.0f64);
    let negative = prop::option::of((0.5..1.5f64, 0.0..0.5f64, 0.5..1.0f64));
    let turns = prop::collection::vec((-1.0..1.0f64, 2e-3..25e-3f64), 1..24);
    (any::<bool>(), shape, lambdas, exponents, negative, turns).prop_map(
        |(peaks, shape, lambdas, exponents, negative, turns)| {
            let spec = ImkSpec {
                response: BOTH[usize::from(peaks)],
                capping_ratio: shape.0,
                plastic_disp_m: shape.1,
                post_capping_disp_m: shape.2,
                ultimate_disp_m: shape.3,
                residual_ratio: shape.4,
                strength_lambda_m: lambdas.0,
                post_capping_lambda_m: lambdas.1,
                unloading_lambda_m: lambdas.2,
                reloading_lambda_m: if peaks { lambdas.3 } else { 0.0 },
                strength_exponent: exponents.0,
                post_capping_exponent: exponents.1,
                unloading_exponent: exponents.2,
                reloading_exponent: exponents.3,
                negative: negative.map(|(weaker, residual, factor)| NegativeHingeSpec {
                    yield_force_n: Some(1200.0 * weaker),
                    residual_ratio: Some(residual),
                    deterioration_factor: Some(factor),
                    ..NegativeHingeSpec::default()
                }),
                ..plain(HingeResponse::Bilinear)
            };
            (spec, turns.into_iter().map(|(x, by)| x * by).collect())
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn one_step_equals_many_partial_steps((spec, turns) in hinges()) {
        let whole = walk(&spec, &turns, 1);
        let lambdas = spec.strength_lambda_m + spec.post_capping_lambda_m
            + spec.unloading_lambda_m + spec.reloading_lambda_m;
        // Rounding of the energy grows where a capacity is nearly used up.
        let share = if lambdas == 0.0 { 1e-12 } else { 1e-9 };
        for pieces in [2, 7, 97] {
            for (a, b) in whole.iter().zip(walk(&spec, &turns, pieces)) {
                prop_assert!((a - b).abs() < 1200.0 * share, "{} {} {}", pieces, a, b);
            }
        }
    }

    /// The force only jumps to zero.
    #[test]
    fn no_line_is_steeper_than_the_elastic_one((spec, turns) in hinges()) {
        let mut law = spec.build().unwrap();
        let (stiffness, most) = (spec.stiffness_n_per_m, 1.5 * 1.4 * 1200.0);
        let (mut disp, mut force) = (0.0, 0.0);
        for turn in turns {
            let from = disp;
            for i in 1..=100 {
                let next = from + (turn - from) * f64::from(i) / 100.0;
                let there = law.step(next, 0.0, 0.0);
                prop_assert!(there.abs() <= most, "{}", there);
                prop_assert!(law.tangent().stiffness <= stiffness);
                let steepest = (next - disp).abs() * stiffness + 1e-9;
                let rise = (there - force) * (next - disp).signum();
                prop_assert!(there == 0.0 || rise <= steepest, "{} {} {}", next, force, there);
                (disp, force) = (next, there);
            }
        }
    }
}

#[test]
fn values_that_make_no_hinge_are_refused() {
    let peaks = plain(HingeResponse::PeakOriented);
    assert!(
        ImkSpec {
            reloading_lambda_m: 1.0,
            ..peaks.clone()
        }
        .build()
        .is_ok()
    );
    let refused = |key: &str, change: fn(&mut ImkSpec)| {
        let mut spec = plain(HingeResponse::Bilinear);
        change(&mut spec);
        assert_eq!(spec.build().unwrap_err().key(), key);
    };
    refused("capping_ratio", |s| s.capping_ratio = 0.99);
    refused("plastic_disp_m", |s| s.plastic_disp_m = 0.1e-3);
    refused("post_capping_disp_m", |s| s.post_capping_disp_m = 1e-10);
    refused("ultimate_disp_m", |s| s.ultimate_disp_m = 1e-3);
    refused("residual_ratio", |s| s.residual_ratio = 1.0);
    refused("deterioration_factor", |s| s.deterioration_factor = 1.1);
    refused("strength_exponent", |s| s.strength_exponent = 0.9);
    refused("reloading_lambda_m", |s| s.reloading_lambda_m = 1.0);
    refused("ultimate_disp_m", |s| {
        s.negative = Some(NegativeHingeSpec {
            ultimate_disp_m: Some(0.5e-3),
            ..NegativeHingeSpec::default()
        });
    });
}
