//! Changed tangents: Figs. 4 and 5, equations (36) to (41), and the exact criterion for many degrees of freedom.

use std::f64::consts::TAU;

use super::drive::{Random, invariants, jury, transition, transition_of};
use super::figure::{Figure, Scale, Series};
use super::stability::circle;
use super::{Check, Effort, Proof};
use crate::integrate::{Lambda, StabilityProof};
use crate::linalg::{SymMatrix, modes};
use crate::spectral::{
    Locus, Transfer, alpha, crossing_stiffness, lambda_limit_changed, poles, spectral_radius,
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
            reduced = reduced.max((a - b).norm() / (1.0 + b.norm()));
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
    (checks, Vec::new())
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
        let found = transition(own, (locus.damping, kt), locus.dt, locus.lambda);
        found.map_or(f64::NAN, |step| jury(invariants(&step)))
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
        .map(|z| (z + 1.0).norm())
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
        logarithmic: false,
        square: true,
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
                let found = transition((c0, omega * omega), now, 1.0, lambda);
                found.map_or(f64::NAN, |step| jury(invariants(&step)))
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

/// Random storeys with grown tangents.
fn storeys(random: &mut Random, n: usize, size: f64) -> SymMatrix {
    let values: Vec<f64> = (0..n).map(|_| size * random.between(0.1, 1.0)).collect();
    let mut entries = Vec::new();
    for (i, &k) in values.iter().enumerate() {
        entries.push((i, i, k));
        if i > 0 {
            entries.extend([(i - 1, i - 1, k), (i - 1, i, -k)]);
        }
    }
    SymMatrix::from_triplets(n, entries)
}

/// λ by the paper's use of (41), mode by mode: instantaneous mode j beside initial mode j.
fn mode_wise(proof: &StabilityProof) -> Option<f64> {
    let initial = modes(&proof.stiffness, &proof.mass).ok()?.frequencies;
    let current = modes(&proof.stiffness_bound, &proof.mass).ok()?.frequencies;
    let pairs = initial.iter().zip(&current);
    let limits = pairs.map(|(w0, wt)| lambda_limit_changed(w0 * proof.dt, wt * proof.dt, 0.0));
    Some(limits.fold(f64::INFINITY, f64::min))
}

/// The criterion S ⪰ 0 against spectral radii of the recursion, and the mode-wise rule beside it.
pub(super) fn criterion(effort: Effort) -> Proof {
    let mut random = Random::new(7);
    let count = effort.of(60, 1000);
    let (mut below, mut above, mut limits, mut wrong) = (0.0f64, f64::INFINITY, 0usize, 0usize);
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    for _ in 0..count {
        let n = 1 + (random.between(0.0, 6.0) as usize).min(5);
        let damping = storeys(&mut random, n, 2.0);
        let grown: Vec<f64> = (0..n).map(|_| random.between(0.0, 0.3)).collect();
        let hardening = random.between(0.3, 3.0);
        let mass: Vec<f64> = (0..n).map(|_| random.between(0.1, 1.0)).collect();
        let proof = StabilityProof {
            mass: SymMatrix::diagonal(&mass),
            damping_bound: damping.plus(1.0, &SymMatrix::diagonal(&grown)),
            damping,
            stiffness: storeys(&mut random, n, 1000.0),
            stiffness_bound: storeys(&mut random, n, 1000.0 * hardening),
            dt: random.between(0.02, 0.5),
            apart: None,
        };
        let radius =
            |lambda: f64| transition_of(&proof, lambda).and_then(|step| spectral_radius(&step));
        match proof.limit(f64::INFINITY, &[]) {
            Ok(Some(limit)) => {
                limits += 1;
                below = below.max(radius(0.99 * limit).unwrap_or(f64::INFINITY) - 1.0);
                above = above.min(radius(1.01 * limit).unwrap_or(0.0) - 1.0);
                let mut undamped = proof.clone();
                undamped.damping_bound = undamped.damping.clone();
                let exact = undamped.limit(f64::INFINITY, &[]).ok().flatten();
                if let (Some(exact), Some(by_modes)) = (exact, mode_wise(&undamped))
                    && by_modes.is_finite()
                {
                    least = least.min(by_modes / exact);
                    most = most.max(by_modes / exact);
                }
            }
            Ok(None) => {
                // Every λ is stable: 1e6 as well as 1.
                let found = [1.0, 1e6, f64::INFINITY].map(radius);
                let stable = |r: Option<f64>| r.is_some_and(|r| r < 1.0 + 1e-7);
                wrong += usize::from(!found.into_iter().all(stable));
                wrong += usize::from(!proof.holds(Lambda::Infinite));
            }
            Err(_) => wrong += 1,
        }
    }
    let of = format!("{limits} random systems with a limit, up to 6 degrees of freedom");
    let checks = vec![
        // Eigenvalues of a matrix that is not symmetric carry √ε.
        Check::within(
            &format!("S ⪰ 0 one per cent below λ_lim: spectral radius − 1, {of}"),
            "stable",
            below.max(0.0),
            1e-7,
        ),
        Check::holds(
            "one per cent above λ_lim: spectral radius − 1",
            "unstable",
            format!("at least {}", super::number(above)),
            "positive",
            above > 0.0,
        ),
        Check::within(
            "systems without a limit that are unstable for some λ",
            "0",
            wrong as f64,
            0.0,
        ),
        Check::note(
            "mode-wise use of (41) over the exact λ_lim",
            "used in example 4.2",
            format!("{least:.3} to {most:.3}"),
            "pairing instantaneous with initial mode j is close where shapes stay alike, and not a proof",
        ),
    ];
    (checks, Vec::new())
}
