//! Closed forms against each other and against eigenvalues of amplification matrices.

use std::f64::consts::{PI, TAU};

use gusset_quantity::assert_is;
use nalgebra::{ComplexField as _, DMatrix, Matrix3, Vector2};

use super::delay::{
    Delayed, DiscreteLimit, continuous, critical_lag, discrete, recursion, sdof, sdof_estimate,
};
use super::*;
use crate::integrate::AlphaWeights;

const OMEGAS: [f64; 6] = [0.05, 0.4, 1.3, 1.95, 2.9, 6.0];
const RATIOS: [f64; 4] = [0.0, 0.02, 0.3, 1.2];
const LAMBDAS: [f64; 6] = [0.5, 2.0, 4.0, 6.0, 11.5, f64::INFINITY];

fn of(matrix: Matrix3<f64>) -> Vec<Pole> {
    eigenvalues(&DMatrix::from_fn(3, 3, |i, j| matrix[(i, j)])).unwrap()
}

/// Distance of `pole` from the nearest of `all`.
fn away(pole: Pole, all: &[Pole]) -> f64 {
    all.iter()
        .map(|z| (z - pole).modulus())
        .fold(f64::INFINITY, f64::min)
}

/// Ω̄ of the undamped family: 4 sin²(Ω̄/2) = Ω²/(1 + Ω²/λ). None beyond the linear limit.
fn undamped_apparent(omega: f64, lambda: f64) -> Option<f64> {
    let half = (omega * omega / (1.0 + omega * omega / lambda)).sqrt() / 2.0;
    (half <= 1.0).then(|| 2.0 * libm::asin(half))
}

#[test]
fn poles_are_amplification_eigenvalues() {
    for omega in OMEGAS {
        for ratio in RATIOS {
            for lambda in LAMBDAS {
                let alpha = alpha(omega, ratio, lambda);
                let (a, _) = amplification(3.0, omega, ratio, 0.1, alpha, alpha);
                let of_family = eigenvalues(&DMatrix::from_fn(2, 2, |i, j| a[(i, j)])).unwrap();
                let of_newmark = of(newmark(0.5, 1.0 / lambda, omega, ratio));
                let given = Transfer::new(3.0, omega, ratio, 0.1, alpha, alpha).poles();
                for pole in poles(omega, ratio, lambda) {
                    // A double root is known to √ε; the largest pole here is about Ω².
                    let tolerance = 1e-7 * (1.0 + pole.modulus());
                    assert!(
                        away(pole, &of_family) < tolerance,
                        "{omega} {ratio} {lambda}"
                    );
                    assert!(
                        away(pole, &of_newmark) < tolerance,
                        "{omega} {ratio} {lambda}"
                    );
                    assert!(away(pole, &given) < tolerance, "{omega} {ratio} {lambda}");
                }
            }
        }
    }
}

#[test]
fn table_1_holds_as_printed() {
    for row in Tabulated::ALL {
        for omega in OMEGAS {
            for ratio in RATIOS {
                let ours = poles(omega, ratio, row.lambda());
                for pole in table_1(row, omega, ratio) {
                    assert!(away(pole, &ours) < 1e-7 * (1.0 + pole.modulus()));
                }
            }
        }
    }
}

#[test]
fn poles_satisfy_their_equation_in_order() {
    for omega in OMEGAS {
        for ratio in RATIOS {
            for lambda in LAMBDAS {
                let [a, b, c] = coefficients(omega, ratio, lambda);
                let [first, second] = poles(omega, ratio, lambda);
                for z in [first, second] {
                    let size = a.abs() * z.norm_sqr() + b.abs() * z.modulus() + c.abs();
                    assert!((z * z * a + z * b + c).modulus() < 1e-14 * size);
                }
                assert!(first.modulus() >= second.modulus() && first.im >= 0.0);
                let given = b * b - 4.0 * a * c;
                assert!(
                    (discriminant(omega, ratio, lambda) - given).abs()
                        < 1e-14 * (b * b + 4.0 * (a * c).abs())
                );
            }
        }
    }
}

#[test]
fn impulse_response_matches_the_recursion() {
    // α1 ≠ α2 as well: equation (11) is general.
    for (alpha_1, alpha_2) in [(0.8, 0.8), (0.8, 0.6)] {
        let (mass, omega, ratio, dt) = (2.0, 0.7, 0.05, 0.01);
        let transfer = Transfer::new(mass, omega, ratio, dt, alpha_1, alpha_2);
        let (a, b) = amplification(mass, omega, ratio, dt, alpha_1, alpha_2);
        let series = transfer.impulse_response(200);
        let mut state = Vector2::new(0.0, 0.0);
        for (step, given) in series.iter().enumerate() {
            // Two hundred steps of a double sum.
            assert!((state[0] - given).abs() < 1e-9 * dt * dt, "{step}");
            state = a * state + b * if step == 0 { 1.0 } else { 0.0 };
        }
        // G(z) = Σ x[i] z⁻ⁱ outside of the unit circle.
        let z = Pole::new(1.3, 0.4);
        let mut power = Pole::new(1.0, 0.0);
        let mut sum = Pole::new(0.0, 0.0);
        for x in &series {
            sum += power * *x;
            power /= z;
        }
        assert!((sum - transfer.at(z)).modulus() < 1e-12 * sum.modulus());
    }
}

#[test]
fn apparent_quantities_have_closed_forms() {
    for lambda in LAMBDAS {
        for omega in [0.05, 0.4, 1.3, 1.9] {
            let found = apparent(omega, 0.0, lambda).unwrap();
            let exact = undamped_apparent(omega, lambda).unwrap();
            // |z| = 1 to roundoff, divided by Ω̄.
            let roundoff = 4.0 * f64::EPSILON / omega;
            assert!((found.omega - exact).abs() < 1e-13 && found.ratio.abs() < roundoff);
            assert!(amplitude_decay(found.ratio).abs() < 7.0 * roundoff);
        }
        // PE ≈ Ω² (1/(2λ) − 1/24); the next term is of order Ω⁴.
        let small = 1e-2;
        let expected = small * small * (0.5 / lambda - 1.0 / 24.0);
        let found = period_error(small, 0.0, lambda).unwrap();
        assert!((found - expected).abs() < small.powi(4));
        // Small Ω: the damping is what it should be, to second order.
        let damped = apparent(small, 0.05, lambda).unwrap();
        assert!((damped.ratio - 0.05).abs() < 0.05 * small);
    }
    // Beyond a quarter turn per step the four-quadrant angle is needed.
    let stiff = apparent(6.0, 0.0, 4.0).unwrap();
    assert!(stiff.omega > PI / 2.0 && stiff.omega < PI);
    assert_eq!(apparent(6.0, 0.0, 6.0), None);
}

#[test]
fn period_error_falls_as_lambda_grows() {
    for omega in [0.1, 0.5, 1.0, 1.8] {
        let errors: Vec<f64> = LAMBDAS
            .iter()
            .map(|&lambda| period_error(omega, 0.0, lambda).unwrap())
            .collect();
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{omega}");
        let zero = zero_period_error_lambda(omega);
        assert!(period_error(omega, 0.0, zero).unwrap().abs() < 1e-12);
    }
    assert!((zero_period_error_lambda(1e-6) - 12.0).abs() < 1e-9);
    // Both sides of the switch to the series.
    let (below, above) = (0.009_99, 0.010_01);
    let slope = zero_period_error_lambda(below) - zero_period_error_lambda(above);
    assert!(slope > 0.0 && slope < 1e-4);
}

#[test]
fn bounds_are_at_spectral_radius_one() {
    for lambda in [4.5, 6.0, 11.5, 100.0, f64::INFINITY] {
        let limit = omega_limit(lambda);
        for ratio in [0.0, 0.1, 0.6] {
            let radius = |omega: f64| poles(omega, ratio, lambda)[0].modulus();
            assert!(radius(0.999 * limit) <= 1.0 + 1e-12 && radius(1.001 * limit) > 1.0);
        }
        if lambda.is_finite() {
            assert!((lambda_limit(limit) / lambda - 1.0).abs() < 1e-12);
        }
    }
    assert_eq!(omega_limit(4.0), f64::INFINITY);
    assert_eq!(lambda_limit(2.0), f64::INFINITY);
    assert!((unconditional_lambda(1.2) - 4.0 / 1.44).abs() < 1e-15);
    assert_eq!(unconditional_lambda(0.5), 4.0);
}

#[test]
fn root_locus_leaves_circle_at_minus_one() {
    let locus = Locus {
        mass: 2.0,
        damping: 2.0 * 0.02 * TAU * 2.0,
        stiffness: 2.0 * TAU * TAU,
        dt: 0.5,
        lambda: 1.0,
    };
    let omega = TAU * locus.dt;
    // With k_t = k_0 it is equation (12).
    let own = locus.roots(locus.stiffness);
    for pole in poles(omega, 0.02, 1.0) {
        assert!(away(pole, &own) < 1e-13);
    }
    let crossing = locus.crossing();
    let ratio = crossing_stiffness(omega, 1.0);
    assert!((crossing / locus.stiffness / ratio - 1.0).abs() < 1e-14);
    assert!(away(Pole::new(-1.0, 0.0), &locus.roots(crossing)) < 1e-13);
    assert!(locus.roots(0.999 * crossing)[0].modulus() <= 1.0);
    assert!(locus.roots(1.001 * crossing)[0].modulus() > 1.0);
    // Equivalent to (41): λ_limit at Ω_t of the crossing is λ.
    let limit = lambda_limit_changed(omega, omega * ratio.sqrt(), 0.0);
    assert!((limit - 1.0).abs() < 1e-13);
}

#[test]
fn companions_have_their_stated_poles() {
    for omega in OMEGAS {
        for ratio in [0.0, 0.05] {
            let four = poles(omega, ratio, 4.0);
            let two = poles(omega, ratio, 2.0);
            let of_chang = of(chang(omega, ratio));
            let kr = of(alpha_method(AlphaWeights::kr(1.0).unwrap(), omega, ratio));
            let mkr = of(alpha_method(AlphaWeights::mkr(1.0).unwrap(), omega, ratio));
            for k in 0..2 {
                // Chang's displacement has the poles of average acceleration.
                assert!(away(four[k], &of_chang) < 1e-6, "{omega} {ratio}");
                assert!(away(four[k], &kr) < 1e-6, "{omega} {ratio}");
                assert!(away(two[k], &mkr) < 1e-6, "{omega} {ratio}");
            }
        }
    }
    for rho in [0.0, 0.5, 0.9] {
        // Stiff: KR-α has the spectral radius ρ, MKR-α the poles ± iρ and −ρ. The error is of order 1/Ω² = 1e-10, of
        // which a triple root makes 5e-4; the acceleration in units of Ω² keeps the matrix well scaled.
        let stiff = 1e5;
        let scaled = |matrix: Matrix3<f64>| {
            let unit = [1.0, 1.0, stiff * stiff];
            of(Matrix3::from_fn(|i, j| matrix[(i, j)] * unit[j] / unit[i]))
        };
        let kr = scaled(alpha_method(AlphaWeights::kr(rho).unwrap(), stiff, 0.0));
        let radius = kr.iter().map(|z| z.modulus()).fold(0.0, f64::max);
        assert!((radius - rho).abs() < 1e-3, "{rho}: {radius}");
        let mkr = scaled(alpha_method(AlphaWeights::mkr(rho).unwrap(), stiff, 0.0));
        for pole in [
            Pole::new(0.0, rho),
            Pole::new(0.0, -rho),
            Pole::new(-rho, 0.0),
        ] {
            assert!(away(pole, &mkr) < 1e-3, "{rho}");
        }
    }
    // ρ < 1 damps, and more so the stiffer the mode.
    let damping = |omega: f64| {
        principal(
            &alpha_method(AlphaWeights::kr(0.5).unwrap(), omega, 0.0),
            omega,
        )
        .unwrap()
        .ratio
    };
    assert!(damping(0.1) > 0.0 && damping(1.0) > 10.0 * damping(0.1));
}

/// One degree of freedom with ω = 2π, the share `share` of its stiffness delayed.
fn one(ratio: f64, share: f64) -> Delayed {
    let scalar = |value: f64| DMatrix::from_element(1, 1, value);
    Delayed {
        mass: scalar(2.0),
        damping: scalar(2.0 * ratio * TAU * 2.0),
        stiffness: scalar(2.0 * TAU * TAU * (1.0 - share)),
        rows: scalar(1.0),
        specimen_stiffness: scalar(2.0 * TAU * TAU * share),
        specimen_damping: scalar(0.0),
        specimen_mass: 0.0,
        weighted: None,
        ticks: Vec::new(),
    }
}

fn at(limit: DiscreteLimit) -> f64 {
    match limit {
        DiscreteLimit::At(delay) => delay,
        DiscreteLimit::Beyond(delay) => panic!("stable up to {delay} s"),
    }
}

#[test]
fn three_ways_to_the_critical_delay_agree() {
    for (ratio, share) in [(0.02, 0.5), (0.02, 1.0), (0.05, 0.3), (0.1, 0.9)] {
        let closed = sdof(ratio, share, TAU).unwrap();
        let system = one(ratio, share);
        let found = continuous(&system).unwrap().unwrap();
        assert!((found.delay / closed - 1.0).abs() < 1e-9, "{ratio} {share}");
        // Step of a hundredth of the period: a few parts in 10⁴, plus the cut of linear interpolation.
        let dt = 0.002;
        let stepped = at(discrete(&system, dt, 4.0, Some(closed)).unwrap());
        assert!(
            (stepped / closed - 1.0).abs() < 5e-3,
            "{ratio} {share}: {stepped} {closed}"
        );
        let finer = at(discrete(&system, dt / 2.0, 4.0, Some(closed)).unwrap());
        assert!((finer / closed - 1.0).abs() < (stepped / closed - 1.0).abs());
        // And the estimate is an estimate.
        assert!((sdof_estimate(ratio, share, TAU) / closed - 1.0).abs() < 0.2);
    }
    // Enough damping and a small share: no delay is unstable.
    assert_eq!(sdof(0.3, 0.2, TAU), None);
    assert_eq!(continuous(&one(0.3, 0.2)).unwrap(), None);
}

/// m s² + c s + k with c = 2 ξ ω m has its poles at −ξ ω ± …: a mode with negative damping grows with |ξ| ω. A mode without
/// negative damping, or without stiffness, does not.
#[test]
fn growth_without_delay_has_its_rate() {
    let growth = one(-0.02, 0.5).growth().unwrap();
    assert!((growth / (0.02 * TAU) - 1.0).abs() < 1e-9, "{growth}");
    for ratio in [0.0, 0.02, 1.5] {
        assert_eq!(one(ratio, 0.5).growth(), None, "{ratio}");
    }
    let mut free = one(0.0, 1.0);
    free.specimen_stiffness.fill(0.0);
    assert_eq!(free.growth(), None);
    // Under P-Δ it falls with √(g/l).
    free.stiffness.fill(-2.0 * 9.0);
    assert!((free.growth().unwrap() / 3.0 - 1.0).abs() < 1e-9);
}

#[test]
fn frame_is_singular_at_its_critical_delay() {
    // Three storeys, the middle one delayed; det(−ω²M + iωC + K_n + k_e e^{−iωτ} b bᵀ) = 0.
    let storeys = |k: [f64; 3]| {
        DMatrix::from_row_slice(
            3,
            3,
            &[
                k[0] + k[1],
                -k[1],
                0.0,
                -k[1],
                k[1] + k[2],
                -k[2],
                0.0,
                -k[2],
                k[2],
            ],
        )
    };
    let system = Delayed {
        mass: DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![2e3, 2e3, 1.5e3])),
        damping: storeys([4e3, 3e3, 2e3]),
        stiffness: storeys([2e6, 0.0, 1e6]),
        rows: DMatrix::from_row_slice(1, 3, &[-1.0, 1.0, 0.0]),
        specimen_stiffness: DMatrix::from_element(1, 1, 1.5e6),
        specimen_damping: DMatrix::from_element(1, 1, 0.0),
        specimen_mass: 0.0,
        weighted: None,
        ticks: Vec::new(),
    };
    let found = continuous(&system).unwrap().unwrap();
    let turn = nalgebra::ComplexField::exp(Pole::new(0.0, -found.omega * found.delay));
    let matrix = DMatrix::from_fn(3, 3, |i, j| {
        Pole::new(
            system.stiffness[(i, j)] - found.omega * found.omega * system.mass[(i, j)],
            found.omega * system.damping[(i, j)],
        ) + turn * (1.5e6 * system.rows[(0, i)] * system.rows[(0, j)])
    });
    let size = matrix.norm();
    assert!(matrix.determinant().modulus() < 1e-9 * size.powi(3));
    let stepped = at(discrete(&system, 2e-4, 11.5, Some(found.delay)).unwrap());
    assert!(
        (stepped / found.delay - 1.0).abs() < 5e-3,
        "{stepped} {found:?}"
    );
    // No smaller delay is unstable, by the recursion itself.
    let radius =
        |delay: f64| spectral_radius(&recursion(&system, 2e-4, 11.5, delay).unwrap()).unwrap();
    assert!((1..20).all(|k| radius(0.049 * f64::from(k) * stepped) <= 1.0 + 1e-9));
    assert!(radius(1.02 * stepped) > 1.0);
}

#[test]
fn large_inertia_in_force_allows_no_delay() {
    let mut system = one(0.05, 0.5);
    for (share, bears) in [(0.99, true), (1.0, false), (1.5, false)] {
        (system.specimen_mass, system.mass[(0, 0)]) = (1.2 * share, 1.2);
        let found = continuous(&system).unwrap().unwrap();
        assert_eq!(found.delay > 0.0, bears, "{share}: {found:?}");
    }
}

#[test]
fn inertia_of_the_specimen_is_delayed() {
    let mut system = one(0.02, 0.5);
    (system.specimen_mass, system.mass[(0, 0)]) = (0.4, 1.6);
    let found = continuous(&system).unwrap().unwrap();
    // −ω²·1.6 + iω c + k_n + (k_e − ω²·0.4) e^{−iωτ} = 0.
    let (omega, c, k) = (found.omega, 0.08 * TAU, TAU * TAU);
    let turn = nalgebra::ComplexField::exp(Pole::new(0.0, -omega * found.delay));
    let sum = Pole::new(k - 1.6 * omega * omega, omega * c) + turn * (k - 0.4 * omega * omega);
    assert!(sum.modulus() < 1e-9 * k, "{sum}");
    assert!((found.delay / sdof(0.02, 0.5, TAU).unwrap() - 1.0).abs() > 0.01);
    // The inertia is a second difference, one step old: an error of first order in the step.
    let stepped = at(discrete(&system, 0.001, 4.0, Some(found.delay)).unwrap());
    let finer = at(discrete(&system, 0.0005, 4.0, Some(found.delay)).unwrap());
    let (coarse, fine) = (stepped / found.delay - 1.0, finer / found.delay - 1.0);
    assert!(
        coarse.abs() < 0.05 && (fine / coarse - 0.5).abs() < 0.1,
        "{coarse} {fine} {found:?}"
    );
    // The recursion with its history of commands says the same.
    let radius =
        |delay: f64| spectral_radius(&recursion(&system, 0.001, 4.0, delay).unwrap()).unwrap();
    assert!(radius(0.999 * stepped) < 1.0 && radius(1.001 * stepped) > 1.0);
}

#[test]
fn damping_of_the_specimen_is_delayed() {
    let mut system = one(0.02, 0.5);
    let without = continuous(&system).unwrap().unwrap().delay;
    system.specimen_damping[(0, 0)] = 1.0;
    let with = continuous(&system).unwrap().unwrap().delay;
    let stepped = at(discrete(&system, 0.001, 4.0, Some(with)).unwrap());
    assert!(
        with > without && (stepped / with - 1.0).abs() < 5e-3,
        "{with} {stepped}"
    );

    // Routh: (m s² + c s + k_n)(T s + 1) + k_e has a pair on the axis at T_cr.
    let (m, c, kn, ke) = (2.0, 1.0, 30.0, 40.0);
    let lag = critical_lag(m, c, kn, ke).unwrap();
    let (a3, a2, a1, a0) = (m * lag, m + c * lag, c + kn * lag, kn + ke);
    assert!((a2 * a1 - a3 * a0).abs() < 1e-12 * a2 * a1);
    let free = critical_lag(m, c, 0.0, ke).unwrap();
    assert!((free - m * c / (m * ke - c * c)).abs() < 1e-15);
}

#[test]
fn missing_delay_analysis_has_a_reason() {
    let mut system = one(0.02, 0.5);
    let wrong = discrete(&system, 0.0, 4.0, None).unwrap_err();
    assert_is!(wrong => delay::DelayError::Parameter { name: "dt", found: 0.0 });
    // λ = 100 at Ω = 2.6: unstable before any delay.
    let early = discrete(&system, 2.6 / TAU, 100.0, None).unwrap_err();
    assert_is!(early => delay::DelayError::Unstable { .. });
    system.mass[(0, 0)] = 0.0;
    assert_eq!(continuous(&system), Err(delay::DelayError::Massless));
    let wrong = discrete(&system, 0.01, 4.0, None).unwrap_err();
    assert_is!(wrong => delay::DelayError::Massless);
    // Undamped: no delay is stable.
    let limit = at(discrete(&one(0.0, 0.5), 0.01, 4.0, None).unwrap());
    assert!(limit < 1e-5);
}
