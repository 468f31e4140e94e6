//! The Bouc–Wen law against its differential equation, solved independently by a fine Runge–Kutta rule.

use super::*;
use proptest::prelude::*;

fn spec(beta: f64, gamma: f64, exponent: f64) -> BoucWenSpec {
    BoucWenSpec {
        stiffness_n_per_m: 1.19e6,
        yield_force_n: 1190.0,
        post_yield_ratio: 0.1,
        a: 1.0,
        beta,
        gamma,
        exponent,
        hardening_ratio: None,
        degradation: None,
        pinching: None,
    }
}

fn worn(exponent: f64) -> BoucWenSpec {
    BoucWenSpec {
        hardening_ratio: Some(2.0),
        degradation: Some(DegradationSpec {
            strength: 0.05,
            stiffness: 0.02,
        }),
        pinching: Some(PinchingSpec {
            total_slip: 0.8,
            slope: 0.4,
            initiation: 0.2,
            magnitude: 0.2,
            rate: 0.01,
            severity: 0.5,
        }),
        ..spec(0.6, 0.4, exponent)
    }
}

/// Turning points in m: through both signs, small and large reversals, several yield displacements (1 mm).
const PATH: [f64; 9] = [
    2.3e-3, 1.9e-3, -0.4e-3, -5e-3, -4.5e-3, -4.9e-3, 0.7e-3, 0.2e-3, 6e-3,
];

/// ζ and ε by the classical Runge–Kutta rule, straight from the definition in the module's text.
fn runge_kutta(spec: &BoucWenSpec, turns: &[f64], steps_per_yield: f64) -> Vec<f64> {
    let yield_disp = spec.yield_force_n / spec.stiffness_n_per_m;
    let rate = |s: f64, [zeta, energy]: [f64; 2]| {
        let (strength, stiffness) = spec
            .degradation
            .as_ref()
            .map_or((0.0, 0.0), |d| (d.strength, d.stiffness));
        let (nu, eta) = (1.0 + strength * energy, 1.0 + stiffness * energy);
        let pinch = spec.pinching.as_ref().map_or(1.0, |p| {
            let one = p.total_slip * (1.0 - libm::exp(-p.slope * energy));
            let two = (p.magnitude + p.rate * energy) * (p.severity + one);
            let ultimate = libm::pow(
                spec.a / (nu * (spec.beta + spec.gamma)),
                1.0 / spec.exponent,
            );
            1.0 - one * libm::exp(-(zeta * s - p.initiation * ultimate).powi(2) / two.powi(2))
        });
        let shape = spec.beta * (s * zeta).signum() + spec.gamma;
        let dzeta = pinch / eta * (spec.a - nu * libm::pow(zeta.abs(), spec.exponent) * shape);
        [dzeta, zeta]
    };
    let mut state = [0.0, 0.0];
    let mut disp = 0.0;
    let mut forces = Vec::new();
    for turn in turns {
        let travel = (turn - disp) / yield_disp;
        let count = (travel.abs() * steps_per_yield).ceil();
        let (h, s) = (travel / count, travel.signum());
        let ahead = |z: [f64; 2], k: [f64; 2], by: f64| [z[0] + by * k[0], z[1] + by * k[1]];
        for _ in 0..count as usize {
            let k1 = rate(s, state);
            let k2 = rate(s, ahead(state, k1, 0.5 * h));
            let k3 = rate(s, ahead(state, k2, 0.5 * h));
            let k4 = rate(s, ahead(state, k3, h));
            for i in 0..2 {
                state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
        disp = *turn;
        forces.push(
            spec.post_yield_ratio * spec.stiffness_n_per_m * disp
                + (1.0 - spec.post_yield_ratio) * spec.yield_force_n * state[0],
        );
    }
    forces
}

/// Forces at the turning points, each leg in `pieces` steps.
fn walk(spec: &BoucWenSpec, turns: &[f64], pieces: u32) -> Vec<f64> {
    let mut law = spec.build().unwrap();
    let mut from = 0.0;
    let mut forces = Vec::new();
    for turn in turns {
        let mut force = 0.0;
        for i in 1..=pieces {
            let share = f64::from(i) / f64::from(pieces);
            let disp = if i == pieces {
                *turn
            } else {
                from + (turn - from) * share
            };
            force = law.trial(disp, 0.0, 0.0);
            law.commit();
        }
        from = *turn;
        forces.push(force);
    }
    forces
}

fn farthest(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// Error bound of the fine Runge–Kutta rule itself, in N, at h = 1/4000 of the yield displacement: (n h)⁴ on the
/// smooth stretches, and at each of the 4 sign changes of ζ, where β |ζ|ⁿ has a kink, one step's β hⁿ⁺¹/(n + 1).
fn doubt(spec: &BoucWenSpec) -> f64 {
    let (n, h) = (spec.exponent, 1.0 / FINE);
    let kinks = 4.0 * spec.beta * libm::pow(h, n + 1.0) / (n + 1.0);
    spec.yield_force_n * ((1.0 + n).powi(4) * h.powi(4) + kinks)
}

/// Steps per yield displacement.
const FINE: f64 = 4000.0;

#[test]
fn unworn_law_solves_its_equation() {
    for (beta, gamma) in [(0.5, 0.5), (0.9, 0.1), (0.1, 0.9), (1.4, -0.4), (0.5, 0.0)] {
        for exponent in [1.0, 1.5, 2.0, 2.5, 7.0] {
            let spec = spec(beta, gamma, exponent);
            let wanted = runge_kutta(&spec, &PATH, FINE);
            let off = farthest(&walk(&spec, &PATH, 1), &wanted);
            assert!(off < doubt(&spec), "{beta} {gamma} {exponent}: {off:e}");
        }
    }
}

#[test]
fn worn_laws_solve_their_equation() {
    for exponent in [1.0, 1.5, 2.0, 3.0] {
        let spec = worn(exponent);
        let wanted = runge_kutta(&spec, &PATH, FINE);
        let off = farthest(&walk(&spec, &PATH, 1), &wanted);
        assert!(off < doubt(&spec), "{exponent}: {off:e}");
    }
}

#[test]
fn worn_integrator_without_wear_is_exact() {
    // Two ways through one equation: extrapolation with rates of wear zero, and the closed forms.
    for exponent in [1.0, 1.5, 2.0, 2.5] {
        for (beta, gamma) in [(0.6, 0.4), (0.2, 0.8), (1.4, -0.4)] {
            let exact = spec(beta, gamma, exponent);
            let numeric = BoucWenSpec {
                hardening_ratio: Some(10.0),
                degradation: Some(DegradationSpec {
                    strength: 0.0,
                    stiffness: 0.0,
                }),
                ..exact.clone()
            };
            let off = farthest(&walk(&exact, &PATH, 1), &walk(&numeric, &PATH, 1));
            // 1e-13 per inner step, some tens of them, of 1190 N.
            assert!(off < 1190.0 * 2e-12, "{exponent} {beta} {gamma}: {off:e}");
        }
    }
}

#[test]
fn one_step_equals_many_partial_steps() {
    for exponent in [1.0, 1.5, 2.0, 2.5, 7.0, 40.0] {
        for (beta, gamma) in [(0.5, 0.5), (0.9, 0.1), (0.1, 0.9), (1.4, -0.4)] {
            let spec = spec(beta, gamma, exponent);
            let whole = walk(&spec, &PATH, 1);
            for pieces in [2, 7, 333] {
                // Each piece rounds ζ by a few 1e-16, the dividing of the path too; errors do not grow along it.
                let off = farthest(&whole, &walk(&spec, &PATH, pieces));
                assert!(
                    off < 1190.0 * 1e-12,
                    "{exponent} {beta} {gamma} {pieces}: {off:e}"
                );
            }
        }
    }
    for exponent in [1.0, 2.0, 2.5] {
        let whole = walk(&worn(exponent), &PATH, 1);
        for pieces in [2, 7, 333] {
            let off = farthest(&whole, &walk(&worn(exponent), &PATH, pieces));
            assert!(off < 1190.0 * 2e-12, "{exponent} {pieces}: {off:e}");
        }
    }
}

#[test]
fn long_worn_step_equals_many_short_ones() {
    // Steps of many yield displacements (1 mm each), as an isolator at a coarse rate or a trial of an iteration makes them.
    let paths = [3.0, 6.0, 7.0, 10.0, 15.0, 30.0]
        .into_iter()
        .flat_map(|far| {
            [
                vec![far * 1e-3],
                vec![far * 1e-3, -0.7e-3 * far, 0.3e-3 * far],
            ]
        });
    let paths: Vec<Vec<f64>> = paths.collect();
    let wears = [(0.01, 0.0), (0.2, 0.0), (0.0, 0.0), (0.05, 0.1)];
    for exponent in [1.0, 1.6, 2.0, 3.0, 5.0] {
        for (beta, gamma) in [(0.5, 0.5), (1.0, 3.0), (2.0, 6.0), (0.9, 0.1)] {
            for (strength, stiffness) in wears {
                let spec = BoucWenSpec {
                    hardening_ratio: Some(10.0),
                    degradation: Some(DegradationSpec {
                        strength,
                        stiffness,
                    }),
                    ..spec(beta, gamma, exponent)
                };
                for path in &paths {
                    let off = farthest(&walk(&spec, path, 1), &walk(&spec, path, 640));
                    assert!(
                        off < 1190.0 * 1e-9,
                        "{exponent} {beta} {gamma} {strength} {stiffness} {path:?}: {off:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn force_saturates_at_yield_and_slope() {
    for exponent in [1.0, 2.0, 2.5] {
        // From the virgin state far out: ζ = 1, F = α k x + (1 − α) F_y.
        let mut law = spec(0.5, 0.5, exponent).build().unwrap();
        let force = law.trial(0.1, 0.0, 0.0);
        assert!((force - (0.1 * 1.19e6 * 0.1 + 0.9 * 1190.0)).abs() < 1e-9);
        assert!((law.tangent().stiffness - 0.1 * 1.19e6).abs() < 1e-6);
        law.commit();
        // Turned round, the tangent is the largest there is: k (α + (1 − α) 2β/(β + γ)) = k for β = γ.
        law.trial(0.1 - 1e-12, 0.0, 0.0);
        assert!((law.tangent().stiffness / 1.19e6 - 1.0).abs() < 1e-8);
    }
}

#[test]
fn hardening_ratio_is_as_documented() {
    let bound = |spec: BoucWenSpec| spec.build().unwrap().bound(Reach::default()).0.unwrap();
    let k = 1.19e6;
    // a + (1 − a) max(1, 2β/(β + γ)): 0.1 + 0.9 · 1.8 and 1.
    assert!((bound(spec(0.9, 0.1, 2.0)) / k - 1.72).abs() < 1e-14);
    assert!((bound(spec(0.1, 0.9, 2.0)) / k - 1.0).abs() < 1e-14);
    let missing = BoucWenSpec {
        hardening_ratio: None,
        ..worn(2.0)
    };
    let wanted = LawError::BoundNeeded {
        law: "bouc_wen",
        name: "hardening_ratio",
    };
    assert_eq!(missing.build().unwrap_err(), wanted);
    assert!((bound(worn(2.0)) / k - 2.0).abs() < 1e-14);
}

#[test]
fn degradation_weakens_pinching_narrows() {
    let cycles: Vec<f64> = [4e-3, -4e-3].into_iter().cycle().take(12).collect();
    let mut tired = worn(2.0);
    tired.pinching = None;
    let forces = walk(&tired, &cycles, 40);
    assert!(
        forces[10] < forces[2] && forces[2] < forces[0],
        "{forces:?}"
    );
    let mut narrow = worn(2.0);
    narrow.degradation = None;
    let (mut law, mut plain) = (
        narrow.build().unwrap(),
        spec(0.6, 0.4, 2.0).build().unwrap(),
    );
    // Reloading after some cycles: the pinched law carries less on the way through zero.
    for turn in &cycles {
        law.trial(*turn, 0.0, 0.0);
        law.commit();
        plain.trial(*turn, 0.0, 0.0);
        plain.commit();
    }
    assert!(law.trial(0.0, 0.0, 0.0) < 0.8 * plain.trial(0.0, 0.0, 0.0));
}

#[test]
fn worn_step_beyond_all_bounds_is_nan() {
    let mut law = worn(2.0).build().unwrap();
    assert!(law.trial(1e9, 0.0, 0.0).is_nan());
    law.revert();
    assert!(law.trial(0.001, 0.0, 0.0).is_finite());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_secant_exceeds_the_declared_bound(
        beta in 0.05..2.0f64,
        share in -0.9..5.0f64,
        exponent in prop_oneof![Just(1.0), Just(2.0), 1.0..6.0f64],
        turns in prop::collection::vec(-8e-3..8e-3f64, 1..8),
    ) {
        let spec = spec(beta, share * beta, exponent);
        let mut law = spec.build().unwrap();
        let bound = law.bound(Reach::default()).0.unwrap();
        let mut last = (0.0, 0.0);
        for turn in turns {
            let from: f64 = last.0;
            for i in 1..=50 {
                let disp = from + (turn - from) * f64::from(i) / 50.0;
                let force = law.trial(disp, 0.0, 0.0);
                // Forces of some 1e4 N at most are rounded by 1e-11 N.
                prop_assert!((force - last.1) * (disp - last.0).signum() <= bound * (disp - last.0).abs() * (1.0 + 1e-9) + 1e-10);
                prop_assert!(law.tangent().stiffness <= bound * (1.0 + 1e-12));
                law.commit();
                last = (disp, force);
            }
        }
    }
}

/// The linear branches n = 1 against their exponentials, from zero to where they saturate, and across zero.
#[test]
fn linear_branches_are_exponentials() {
    let saturating = Branch::new(1.0, 1.0, 1.0);
    let steepening = Branch::new(1.0, -0.2, 1.0);
    for z in [
        0.0,
        1e-300,
        1e-9,
        0.3,
        0.999_999,
        1.0 - f64::EPSILON,
        1.0,
        1.5,
    ] {
        for tau in [1e-300, 1e-12, 0.01, 0.7, 3.0, 50.0, 1e4] {
            let end = saturating.grow(z, tau);
            let exact = if z >= 1.0 {
                z
            } else {
                z - (1.0 - z) * libm::expm1(-tau)
            };
            assert!(
                (end - exact).abs() <= 4.0 * f64::EPSILON * exact,
                "{z} {tau}: {end} {exact}"
            );
            assert!(end >= z && (end <= 1.0 || z > 1.0), "{z} {tau}: {end}");
            if z == 0.0 {
                continue;
            }
            // 5 u: u' = 0.2 (1 + u), backwards.
            let (left, rest) = steepening.shrink(z, tau);
            let time = 5.0 * libm::log1p(0.2 * z);
            if rest > 0.0 {
                assert_eq!(left, 0.0);
                assert!(
                    (rest - (tau - time)).abs() <= 8.0 * f64::EPSILON * tau,
                    "{z} {tau}: {rest}"
                );
            } else {
                let again = steepening.grow(left, tau);
                assert!(
                    (again - z).abs() <= 16.0 * f64::EPSILON * (z + tau),
                    "{z} {tau}: {again}"
                );
            }
            assert_eq!(
                rest > 0.0,
                left == 0.0 && tau > time,
                "{z} {tau}: {left} {rest} {time}"
            );
        }
    }
}
