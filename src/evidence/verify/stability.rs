//! Fig. 3, equations (27) to (33), and the recommendations of section 3.3.

use std::f64::consts::TAU;

use super::drive::{Random, jury, margin, stepped, transition};
use super::figure::{Axes, Figure, Scale, Series};
use super::{Check, Effort, Proof};
use gusset_numerics::spectral::{
    coefficients, discriminant, omega_limit, poles, spectral_radius, unconditional_lambda,
};
use nalgebra::{ComplexField as _, DMatrix};

/// Points of the unit circle.
pub(super) fn circle() -> Series {
    let angles: Vec<f64> = (0..=180).map(|i| TAU * f64::from(i) / 180.0).collect();
    Series::line(
        "unit circle",
        angles.iter().map(|a| libm::cos(*a)).collect(),
        angles.iter().map(|a| libm::sin(*a)).collect(),
    )
}

/// Spectral radius of a step.
fn radius(omega: f64, ratio: f64, lambda: f64) -> Option<f64> {
    let own = (2.0 * ratio * omega, omega * omega);
    let step = transition(own, own, 1.0, lambda)?;
    spectral_radius(&DMatrix::from_fn(2, 2, |i, j| step[(i, j)]))
}

/// Fig. 3: what runs do whose poles lie in one region or the other.
pub(super) fn regions(effort: Effort) -> Proof {
    let mut random = Random::new(3);
    let (mut inside, mut outside, mut wrong) = ((vec![], vec![]), (vec![], vec![]), 0);
    let wanted = effort.of(100, 1000);
    let mut tries = 0;
    while inside.0.len() + outside.0.len() < 2 * wanted && tries < 100 * wanted {
        tries += 1;
        let lambda = random.spread(1.0, 50.0);
        let (omega, ratio) = (random.between(0.1, 4.0), random.between(0.0, 0.5));
        let [first, second] = poles(omega, ratio, lambda);
        let radius = first.modulus().max(second.modulus());
        // Close to the circle neither growth nor decay shows in the simulated time.
        if (radius - 1.0).abs() < 0.02 {
            continue;
        }
        let own = (2.0 * ratio * omega, omega * omega);
        let Some(step) = transition(own, own, 1.0, lambda) else {
            wrong += 1;
            continue;
        };
        let mut state = nalgebra::Vector2::new(1.0, 0.3);
        for _ in 0..1500 {
            state = step * state;
        }
        let grows = state.norm().is_nan() || state.norm() > 1.0;
        wrong += usize::from(grows != (radius > 1.0));
        let to = if grows { &mut outside } else { &mut inside };
        for pole in [first, second] {
            to.0.push(pole.re);
            to.1.push(pole.im);
        }
    }
    let checks = vec![Check::within(
        "random systems whose run is bounded with a pole outside the unit circle, or grows with none",
        "0",
        wrong as f64,
        0.0,
    )];
    let figure = Figure {
        file: "fig-3",
        title: "Fig. 3: stable and unstable poles in the z plane",
        claim: "Each dot is a pole of a random system, two a system; its colour is what the run did: it grows as soon as one of the two lies outside.",
        across: Scale::fixed("Re z", "1", -2.0, 2.0),
        up: Scale::fixed("Im z", "1", -2.0, 2.0),
        axes: Axes::Square,
        series: vec![
            circle(),
            Series::dots("run grows", outside.0, outside.1),
            Series::dots("run decays", inside.0, inside.1),
        ],
    };
    (checks, vec![figure])
}

/// Equations (27) to (33) against the program's own step.
pub(super) fn linear_limit(effort: Effort) -> Proof {
    let mut random = Random::new(33);
    let count = effort.of(200, 5000);
    let (mut modulus, mut polynomial, mut sign) = (0.0f64, 0.0f64, 0usize);
    let (mut below, mut above, mut any) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let (mut real, mut radii) = (0usize, 0usize);
    for _ in 0..count {
        let (lambda, ratio) = (random.spread(0.2, 200.0), random.between(0.0, 0.9));
        let omega = random.spread(0.01, 20.0);
        let [a1, a2, a3] = coefficients(omega, ratio, lambda);
        let (trace, determinant) = stepped(omega, ratio, lambda);
        polynomial = polynomial.max((trace + a2 / a1).abs() / (1.0 + trace.abs()));
        let quantity = discriminant(omega, ratio, lambda);
        if quantity < 0.0 {
            modulus =
                modulus.max((poles(omega, ratio, lambda)[0].modulus() - (a3 / a1).sqrt()).abs());
            modulus = modulus.max((determinant - a3 / a1).abs());
        }
        // (30): negative exactly where λΩ² − 4Ω² − 4λ < −4λξ².
        let square = omega * omega;
        let left = lambda * square - 4.0 * square - 4.0 * lambda;
        sign += usize::from((quantity < 0.0) != (left < -4.0 * lambda * ratio * ratio));
        // (31), (32): real poles, inside the unit circle exactly where −4λξ² ≤ λΩ² − 4Ω² − 4λ ≤ 0.
        let found = radius(omega, ratio, lambda);
        if quantity >= 0.0 && left.abs() > 1e-6 * lambda {
            real += usize::from(found.is_none_or(|r| (r <= 1.0) != (left <= 0.0)));
        }
        // (33): by the eigenvalues of the program's step, away from the limit by more than their √ε.
        let inside = (lambda - 4.0) * square - 4.0 * lambda;
        if inside.abs() > 1e-3 * lambda && ratio > 1e-3 {
            radii += usize::from(found.is_none_or(|r| (r <= 1.0) != (inside <= 0.0)));
        }
        let lambda = random.spread(4.05, 200.0);
        let limit = omega_limit(lambda);
        below = below.min(jury(stepped(limit * (1.0 - 1e-6), ratio, lambda)));
        above = above.min(-jury(stepped(limit * (1.0 + 1e-6), ratio, lambda)));
        let lambda = random.spread(0.1, 4.0);
        any = any.min(jury(stepped(random.spread(1e-3, 1e4), ratio, lambda)));
    }
    let checks = vec![
        Check::within(
            "(27): coefficients − those of the program's step",
            "equal",
            polynomial,
            1e-12,
        ),
        Check::within("(29): |z| − √(A3/A1) of complex poles", "0", modulus, 1e-12),
        Check::within(
            "(30): systems where the discriminant has another sign",
            "0",
            sign as f64,
            0.0,
        ),
        Check::within(
            "(31), (32): systems with real poles that are otherwise inside or outside the unit circle",
            "0",
            real as f64,
            0.0,
        ),
        Check::within(
            &format!("(33): systems of {count} whose spectral radius says otherwise"),
            "0",
            radii as f64,
            0.0,
        ),
        Check::holds(
            "(33), λ > 4: a millionth below Ω = √(4λ/(λ − 4)), any damping",
            "stable",
            format!("least margin {}", super::number(below)),
            &format!("Jury's conditions, {count} systems"),
            below > 0.0,
        ),
        Check::holds(
            "(33), λ > 4: a millionth above",
            "unstable",
            format!("least excess {}", super::number(above)),
            &format!("Jury's conditions, {count} systems"),
            above > 0.0,
        ),
        Check::holds(
            "(33), λ ≤ 4, Ω up to 10⁴",
            "stable",
            format!("least margin {}", super::number(any)),
            "Jury's conditions, roundoff 1e-12",
            any > -1e-12,
        ),
        Check::near(
            "λ of CR, at Ω → ∞: both poles",
            -1.0,
            poles(1e8, 0.0, 4.0)[0].re,
            1e-7,
        ),
    ];
    (checks, vec![radius_figure()])
}

/// Spectral radius of the program's step over Ω, with the limits of (33) on it.
fn radius_figure() -> Figure {
    const RATIO: f64 = 0.05;
    let omegas: Vec<f64> = (1..=400).map(|i| 6.0 * f64::from(i) / 400.0).collect();
    let lambdas = [2.0, 4.0, 6.0, 11.5, f64::INFINITY];
    let mut series: Vec<Series> = lambdas
        .iter()
        .map(|&lambda| {
            let y = omegas
                .iter()
                .map(|&omega| radius(omega, RATIO, lambda).unwrap_or(f64::NAN));
            let name = format!("λ = {}", super::number(lambda));
            Series::line(name, omegas.clone(), y.collect())
        })
        .collect();
    let limits: Vec<f64> = lambdas.iter().map(|&lambda| omega_limit(lambda)).collect();
    let limits: Vec<f64> = limits.into_iter().filter(|limit| *limit < 6.0).collect();
    series.push(Series::dots(
        "√(4λ/(λ − 4)), (33)",
        limits.clone(),
        vec![1.0; limits.len()],
    ));
    Figure {
        file: "eq-33",
        title: "Equation (33): spectral radius over Ω",
        claim: "ξ = 0.05, eigenvalues of the program's step. A curve passes one where (33) says; λ = 2 and 4 never do.",
        across: Scale::fixed("Ω = ω Δt", "1", 0.0, 6.0),
        up: Scale::fixed("spectral radius", "1", 0.6, 1.6),
        axes: Axes::Linear,
        series,
    }
}

/// Section 3.3.
pub(super) fn recommendations(effort: Effort) -> Proof {
    let mut random = Random::new(41);
    let (mut four, mut more, mut softer) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let (mut hard, mut too_hard) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..effort.of(200, 5000) {
        let (omega, ratio) = (random.spread(1e-2, 1e3), random.between(0.0, 0.5));
        let own = (2.0 * ratio * omega, omega * omega);
        let at = |lambda: f64, stiffer: f64| margin(own, (own.0, own.1 * stiffer), 1.0, lambda);
        four = four.min(at(4.0, 1.0));
        softer = softer.min(at(4.0, random.between(0.0, 1.0)));
        more = more.min(at(4.02, 1.0));
        hard = hard.min(at(unconditional_lambda(1.2), 1.44));
        too_hard = too_hard.min(at(2.79, 1.44));
    }
    let judge = |what, paper, margin: f64, stable: bool| {
        // Ω up to 10³: 1/(Ω²) of the margin is left at λ = 4, roundoff 1e-12.
        let holds = if stable {
            margin > -1e-12
        } else {
            margin < -1e-6
        };
        let found = format!("least margin {}", super::number(margin));
        Check::holds(
            what,
            paper,
            found,
            "Jury's conditions, random Ω up to 10³",
            holds,
        )
    };
    let checks = vec![
        judge("λ = 4, linear, any Ω", "unconditionally stable", four, true),
        judge(
            "λ = 4, softening, any Ω",
            "unconditionally stable",
            softer,
            true,
        ),
        judge(
            "λ = 4.02, linear",
            "not unconditionally stable",
            more,
            false,
        ),
        judge(
            "λ = 4/1.44, ω_t = 1.2 ω_0, any Ω",
            "unconditionally stable",
            hard,
            true,
        ),
        judge(
            "λ = 2.79, ω_t = 1.2 ω_0",
            "not unconditionally stable",
            too_hard,
            false,
        ),
        Check::near("λ for ω_t = 1.2 ω_0", 2.77, unconditional_lambda(1.2), 0.01),
        Check::note(
            "λ for ω_t = 1.2 ω_0",
            "2.77",
            super::number(unconditional_lambda(1.2)),
            "4/1.44 = 2.7777…; the printed value is truncated, which is the safe side",
        ),
    ];
    (checks, Vec::new())
}
