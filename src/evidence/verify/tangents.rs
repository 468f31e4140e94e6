//! Changed tangents: Figs. 4 and 5, equations (36) to (41).

use nalgebra::ComplexField as _;
use std::f64::consts::TAU;

use super::drive::{self, Random, margin, transition};
use super::figure::{Axes, Figure, Scale, Series};
use super::stability::circle;
use super::{Check, Effort, Proof};
use gusset_numerics::spectral::{
    Locus, Transfer, alpha, crossing_stiffness, lambda_limit_changed, poles,
};

/// Fig. 4: the loop of (36) to (39) against the program's step with another stiffness than its own.
pub(super) fn closed_loop(effort: Effort) -> Proof {
    let mut random = Random::new(4);
    let (mut series, mut reduced) = (0.0f64, 0.0f64);
    for _ in 0..effort.of(30, 500) {
        let (omega, ratio) = (random.between(0.05, 3.0), random.between(0.0, 0.3));
        let lambda = random.spread(0.5, 30.0);
        let alpha = alpha(omega, ratio, lambda);
        let (c, k0) = (2.0 * ratio * omega, omega * omega);
        let locus = Locus {
            mass: 1.0,
            damping: c,
            stiffness: k0,
            dt: 1.0,
            lambda,
        };
        let kt = random.between(0.0, 0.95) * locus.crossing();
        // G'/(1 + G' k_t) with G' of (38), m = Δt = 1.
        let closed = Transfer {
            numerator: [alpha, 0.0],
            denominator: [1.0, alpha * c - 2.0 + kt * alpha, 1.0 - alpha * c],
        };
        let given = closed.impulse_response(100);
        let size = given.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        // After the impulse: x = α Δt², v = α Δt; from then on free.
        let found = transition((c, k0), (c, kt), 1.0, lambda);
        let Some(step) = found else {
            series = f64::INFINITY;
            continue;
        };
        let mut state = nalgebra::Vector2::new(alpha, alpha);
        for wanted in given.iter().skip(1) {
            series = series.max((state[0] - wanted).abs() / size);
            state = step * state;
        }
        for (a, b) in locus.roots(k0).iter().zip(poles(omega, ratio, lambda)) {
            // A double root is known to √ε.
            reduced = reduced.max((a - b).modulus() / (1.0 + b.modulus()));
        }
    }
    let checks = vec![
        Check::within(
            "(36) to (38): impulse response of the closed loop − that of the program's step with k_t ≠ k_0",
            "equal",
            series,
            1e-9,
        ),
        Check::within(
            "(39) with k_t = k_0: roots − poles of (12)",
            "equal",
            reduced,
            1e-7,
        ),
    ];
    (checks, vec![loop_figure()])
}

/// Response of the loop of Fig. 4 to an impulse, by (36) and by the program.
fn loop_figure() -> Figure {
    let (omega, ratio, lambda, steps) = (1.0, 0.05, 4.0, 40);
    let alpha = alpha(omega, ratio, lambda);
    let (c, k0) = (2.0 * ratio * omega, omega * omega);
    let mut series = Vec::new();
    for grown in [0.3, 1.0, 1.9] {
        let kt = grown * k0;
        let closed = Transfer {
            numerator: [alpha, 0.0],
            denominator: [1.0, alpha * c - 2.0 + kt * alpha, 1.0 - alpha * c],
        };
        let axis = |count: usize| (0..count).map(|i| i as f64).collect::<Vec<_>>();
        let given = closed.impulse_response(steps);
        series.push(Series::line(
            format!("k_t = {grown} k_0, (36)"),
            axis(given.len()),
            given,
        ));
        let mut found = vec![0.0];
        if let Some(step) = transition((c, k0), (c, kt), 1.0, lambda) {
            let mut state = nalgebra::Vector2::new(alpha, alpha);
            for _ in 0..steps {
                found.push(state[0]);
                state = step * state;
            }
        }
        series.push(Series::dots(
            format!("k_t = {grown} k_0, program"),
            axis(found.len()),
            found,
        ));
    }
    // A line and its dots have one colour.
    let (lines, dots): (Vec<_>, Vec<_>) = series
        .into_iter()
        .partition(|s| s.look == gusset_view::report::Look::Line);
    Figure {
        file: "fig-4",
        title: "Fig. 4: the closed loop answers an impulse",
        claim: "Lines: the series of G_cl(z) of (36) to (38); dots: the program's step with α of k_0 and forces of k_t. Ω_0 = 1, ξ = 0.05, λ = 4.",
        across: Scale::fixed("step", "1", 0.0, steps as f64),
        up: Scale::free("x m/Δt²", "1"),
        axes: Axes::Linear,
        series: lines.into_iter().chain(dots).collect(),
    }
}

/// Fig. 5.
pub(super) fn root_locus() -> Proof {
    let locus = Locus {
        mass: 1.0,
        damping: 2.0 * 0.02 * TAU,
        stiffness: TAU * TAU,
        dt: 0.5,
        lambda: 1.0,
    };
    let crossing = locus.crossing();
    let ratio = crossing / locus.stiffness;
    // Where the program's own step becomes unstable.
    let margin = |kt: f64| {
        let own = (locus.damping, locus.stiffness);
        margin(own, (locus.damping, kt), locus.dt, locus.lambda)
    };
    let (mut low, mut high) = (locus.stiffness, 100.0 * locus.stiffness);
    for _ in 0..80 {
        let middle = (low + high) / 2.0;
        if margin(middle) >= 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let at_crossing = locus.roots(crossing);
    let away = at_crossing
        .iter()
        .map(|z| (z + 1.0).modulus())
        .fold(f64::INFINITY, f64::min);
    let checks = vec![
        Check::within(
            "distance of a branch from z = −1 at the stiffness of (40)",
            "crosses the unit circle at z = −1",
            away,
            1e-12,
        ),
        Check::near(
            "k_t/k_0 at the crossing: (40) against 4/λ + 4/Ω0²",
            crossing_stiffness(TAU * locus.dt, 1.0),
            ratio,
            1e-12,
        ),
        Check::near(
            "k_t/k_0 at which the program's step becomes unstable",
            ratio,
            low / locus.stiffness,
            1e-9,
        ),
        Check::holds(
            "k_t = 100 k_0",
            "stable only for a finite range of k_t",
            format!("margin {}", super::number(margin(100.0 * locus.stiffness))),
            "Jury's conditions",
            margin(100.0 * locus.stiffness) < 0.0,
        ),
    ];
    // The gain on a logarithmic walk, finer towards the double root, which the branches leave with infinite speed.
    let viscous = locus.alpha() * locus.damping * locus.dt;
    let per_stiffness = locus.alpha() * locus.dt * locus.dt;
    let double = (2.0 * (1.0 - viscous).sqrt() - viscous + 2.0) / per_stiffness;
    let walk = (0..=600).map(|i| locus.stiffness * libm::pow(10.0, -4.0 + f64::from(i) * 0.01));
    let near = (0..=80).map(|i| libm::pow(10.0, -0.1 * f64::from(i)));
    let near = near.flat_map(|share| [double * (1.0 - share), double * (1.0 + share)]);
    let mut gains: Vec<f64> = walk.chain(near).collect();
    gains.sort_by(f64::total_cmp);
    let mut branches = [(vec![], vec![]), (vec![], vec![])];
    for gain in std::iter::once(0.0).chain(gains) {
        for (branch, root) in branches.iter_mut().zip(locus.roots(gain)) {
            branch.0.push(root.re);
            branch.1.push(root.im);
        }
    }
    let [first, second] = branches;
    let figure = Figure {
        file: "fig-5",
        title: "Fig. 5: root locus",
        claim: "ξ = 0.02, ω = 2π rad/s, Δt = 0.5 s, λ = 1. One branch leaves the unit circle through z = −1: the instability is a sawtooth of two steps.",
        across: Scale::fixed("Re z", "1", -2.0, 2.0),
        up: Scale::fixed("Im z", "1", -2.0, 2.0),
        axes: Axes::Square,
        series: vec![
            circle(),
            Series::line("larger modulus", first.0, first.1),
            Series::line("smaller modulus", second.0, second.1),
            Series::dots("crossing", vec![-1.0], vec![0.0]),
        ],
    };
    (checks, vec![figure])
}

/// Equations (40) and (41).
pub(super) fn changed_tangents(effort: Effort) -> Proof {
    let mut random = Random::new(40);
    let count = effort.of(200, 5000);
    let mut margins = [[f64::INFINITY; 2]; 2];
    let mut same = 0.0f64;
    for _ in 0..count {
        let (omega, ratio) = (random.spread(0.2, 20.0), random.between(0.0, 0.4));
        let c0 = 2.0 * ratio * omega;
        for (changed, margin) in margins.iter_mut().enumerate() {
            let grown = if changed == 1 {
                random.between(0.0, 2.0)
            } else {
                0.0
            };
            // Ω_t so that a limit exists.
            let omega_t = (4.0 + random.spread(0.01, 400.0)).sqrt();
            let limit = lambda_limit_changed(omega, omega_t, 2.0 * grown);
            let at = |lambda: f64| {
                let now = (c0 + grown, omega_t * omega_t);
                drive::margin((c0, omega * omega), now, 1.0, lambda)
            };
            margin[0] = margin[0].min(at(limit * (1.0 - 1e-6)));
            margin[1] = margin[1].min(-at(limit * (1.0 + 1e-6)));
            // (40) says the same of k_t.
            if changed == 0 {
                let locus = Locus {
                    mass: 1.0,
                    damping: c0,
                    stiffness: omega * omega,
                    dt: 1.0,
                    lambda: limit,
                };
                same = same.max((locus.crossing() / (omega_t * omega_t) - 1.0).abs());
            }
        }
    }
    let judge = |what, paper, margin: f64| {
        let found = format!("least margin {}", super::number(margin));
        let how = format!("Jury's conditions, {count} systems, a millionth off the limit");
        Check::holds(what, paper, found, &how, margin > 0.0)
    };
    let checks = vec![
        Check::within("(40) and (41): limits apart", "equivalent", same, 1e-9),
        judge("(41), below the limit", "stable", margins[0][0]),
        judge("(41), above the limit", "unstable", margins[0][1]),
        judge(
            "below λ (Ω_t² − 4 + 2Δt(c_t − c_0)/m) = 4Ω0², damping grown too",
            "(not in the paper)",
            margins[1][0],
        ),
        judge("above it", "(not in the paper)", margins[1][1]),
        Check::note(
            "damping in (41)",
            "drops out",
            "only if it does not change".to_owned(),
            "a grown tangent damping lowers the limit: the extended form above",
        ),
    ];
    (checks, Vec::new())
}
