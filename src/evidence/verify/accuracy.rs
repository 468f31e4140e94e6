//! Figs. 1 and 2: amplitude decay and period elongation.

use std::f64::consts::TAU;

use super::drive::oscillator;
use super::figure::{Axes, Figure, Scale, Series};
use super::{Check, Proof};
use gusset_numerics::integrate::{Integrator, Start, State};
use gusset_numerics::spectral::{
    Apparent, amplitude_decay as decay_of, apparent, chang, newmark, omega_limit, period_error,
    principal, quadratic, zero_period_error_lambda,
};

const LAMBDAS: [f64; 7] = [1.0, 2.0, 4.0, 6.0, 11.5, 20.0, f64::INFINITY];
/// Δt/T of the figures.
const LAST: f64 = 0.4;
const POINTS: usize = 200;

fn places() -> Vec<f64> {
    (1..=POINTS)
        .map(|i| LAST * i as f64 / POINTS as f64)
        .collect()
}

fn name(lambda: f64) -> String {
    format!("λ = {}", super::number(lambda).replace("inf", "∞"))
}

/// What each comparison method swings like at Ω, and the λ it shares poles with.
type Companion = (&'static str, f64, fn(f64) -> Option<Apparent>);
const COMPANIONS: [Companion; 4] = [
    ("average acceleration", 4.0, |omega| {
        principal(&newmark(0.5, 0.25, omega, 0.0), omega)
    }),
    ("linear acceleration", 6.0, |omega| {
        principal(&newmark(0.5, 1.0 / 6.0, omega, 0.0), omega)
    }),
    ("explicit Newmark", f64::INFINITY, |omega| {
        principal(&newmark(0.5, 0.0, omega, 0.0), omega)
    }),
    ("Chang 2002", 4.0, |omega| {
        principal(&chang(omega, 0.0), omega)
    }),
];

/// Fig. 1.
pub(super) fn amplitude_decay() -> Proof {
    let x = places();
    let mut series = Vec::new();
    let mut largest = 0.0f64;
    for lambda in LAMBDAS {
        let decay = |share: &f64| {
            apparent(TAU * share, 0.0, lambda).map_or(f64::NAN, |found| decay_of(found.ratio))
        };
        let y: Vec<f64> = x.iter().map(decay).collect();
        largest = y.iter().fold(largest, |a, b| a.max(b.abs()));
        series.push(Series::line(name(lambda), x.clone(), y));
    }
    let mut of_companions = 0.0f64;
    for (name, _, swings) in COMPANIONS {
        let decay =
            |share: &f64| swings(TAU * share).map_or(f64::NAN, |found| decay_of(found.ratio));
        let y: Vec<f64> = x.iter().map(decay).collect();
        of_companions = y.iter().fold(of_companions, |a, b| a.max(b.abs()));
        series.push(Series::dots(
            name,
            x.iter().copied().step_by(10).collect(),
            y.into_iter().step_by(10).collect(),
        ));
    }
    let checks = vec![
        Check::within(
            "AD of every member, 0 < Δt/T ≤ 0.4, where poles are complex",
            "0",
            largest,
            1e-12,
        ),
        Check::within(
            "AD of a run of the program from x(0) = 1, poles read off three samples",
            "0",
            of_runs(&x).0,
            1e-9,
        ),
        // Eigenvalues of 3 × 3 matrices with a zero beside them.
        Check::within(
            "AD of the Newmark and Chang methods",
            "0",
            of_companions,
            1e-9,
        ),
        Check::note(
            "(25)",
            "Ω̄ = arctan(ε/σ)/√(1 − ξ̄²)",
            "angle in four quadrants".to_owned(),
            "arctan(ε/σ) fails for σ < 0; AD of (21) is taken at the numerical period, which is not a point of the grid",
        ),
    ];
    let figure = Figure {
        file: "fig-1",
        title: "Fig. 1: amplitude decay",
        claim: "All curves and dots lie on zero: no member of the family has numerical damping, nor have the others.",
        across: Scale::fixed("Δt/T", "1", 0.0, LAST),
        up: Scale::fixed("amplitude decay AD", "1", -0.1, 0.5),
        axes: Axes::Linear,
        series,
    };
    (checks, vec![figure])
}

/// From free vibrations that the program computes: largest |AD|, and largest |PE − that of (26)|. Two poles follow from
/// four consecutive samples of x\[i+1\] = trace x\[i\] − determinant x\[i−1\].
fn of_runs(shares: &[f64]) -> (f64, f64) {
    let (mut decay, mut period) = (0.0f64, 0.0f64);
    for lambda in LAMBDAS {
        for share in shares.iter().step_by(5) {
            let omega = TAU * share;
            // Near the limit both poles meet and the samples lose them.
            if omega > 0.98 * omega_limit(lambda) {
                continue;
            }
            let swing = free_vibration(omega, lambda).and_then(|[a, b, c, d]| {
                let size = b * b - a * c;
                let (trace, determinant) = ((b * c - a * d) / size, (c * c - b * d) / size);
                let [pole, _] = quadratic(1.0, -trace, determinant);
                Apparent::of(pole)
            });
            let (Some(swing), Some(wanted)) = (swing, period_error(omega, 0.0, lambda)) else {
                return (f64::INFINITY, f64::INFINITY);
            };
            decay = decay.max(decay_of(swing.ratio).abs());
            period = period.max((omega / swing.omega - 1.0 - wanted).abs());
        }
    }
    (decay, period)
}

/// Four samples in a row of the program's free vibration from x(0) = 1, about a quarter of a swing in.
fn free_vibration(omega: f64, lambda: f64) -> Option<[f64; 4]> {
    let mut gui = oscillator((1.0, 0.0, omega * omega), 1.0, lambda, Start::Published)?;
    let mut state = State::new(vec![1.0], vec![0.0]);
    let mut samples = vec![1.0];
    for _ in 0..4 {
        let r = [-omega * omega * state.disp[0]];
        gui.advance(&mut state, &r, &mut [0.0]);
        samples.push(state.disp[0]);
    }
    <[f64; 4]>::try_from(samples.get(1..)?).ok()
}

/// Largest |PE| for 0 < Δt/T ≤ `last`.
fn worst(lambda: f64, last: f64) -> f64 {
    let errors = (1..=400).map(|i| {
        let omega = TAU * last * f64::from(i) / 400.0;
        period_error(omega, 0.0, lambda).map_or(f64::INFINITY, f64::abs)
    });
    errors.fold(0.0, f64::max)
}

/// The λ with the smallest [`worst`] up to `last`, by a fine walk.
fn minimax(last: f64) -> f64 {
    let candidates = (0..=800).map(|i| 8.0 + f64::from(i) * 0.005);
    let best = candidates.map(|lambda| (lambda, worst(lambda, last)));
    best.min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(f64::NAN, |found| found.0)
}

/// Δt/T beyond which λ = `one` has a smaller |PE| than λ = `other`.
fn better_beyond(one: f64, other: f64) -> f64 {
    let size = |lambda: f64, share: f64| {
        period_error(TAU * share, 0.0, lambda).map_or(f64::INFINITY, f64::abs)
    };
    let mut shares = (1..4000).map(|i| f64::from(i) * 1e-4);
    shares
        .find(|&share| size(one, share) < size(other, share))
        .unwrap_or(f64::NAN)
}

/// Fig. 2.
pub(super) fn period_elongation() -> Proof {
    let x = places();
    let mut series = Vec::new();
    for lambda in LAMBDAS {
        let error = |share: &f64| period_error(TAU * share, 0.0, lambda).unwrap_or(f64::NAN);
        series.push(Series::line(
            name(lambda),
            x.clone(),
            x.iter().map(error).collect(),
        ));
    }
    let mut checks = Vec::new();
    let falls = x.iter().all(|share| {
        let errors: Vec<f64> = LAMBDAS
            .iter()
            .filter_map(|&lambda| period_error(TAU * share, 0.0, lambda))
            .collect();
        errors.windows(2).all(|pair| pair[1] < pair[0])
    });
    checks.push(Check::holds(
        "PE at a given Δt/T as λ grows",
        "decreases",
        if falls { "decreases" } else { "does not" }.to_owned(),
        "every λ of the figure, 200 values of Δt/T",
        falls,
    ));
    let grows = LAMBDAS
        .iter()
        .filter(|&&lambda| lambda != 11.5)
        .all(|&lambda| {
            let sizes: Vec<f64> = x
                .iter()
                .filter_map(|share| period_error(TAU * share, 0.0, lambda))
                .map(f64::abs)
                .collect();
            sizes.windows(2).all(|pair| pair[1] > pair[0])
        });
    checks.push(Check::holds(
        "|PE| at a given λ as Δt/T grows",
        "increases",
        if grows { "increases" } else { "does not" }.to_owned(),
        "every λ of the figure but 11.5, whose PE changes its sign",
        grows,
    ));
    for (name, lambda, swings) in COMPANIONS {
        let most = x
            .iter()
            .filter(|share| TAU * **share < 0.999 * omega_limit(lambda))
            .map(|share| {
                let omega = TAU * share;
                let found = swings(omega).map(|found| omega / found.omega - 1.0);
                let given = period_error(omega, 0.0, lambda);
                found
                    .zip(given)
                    .map_or(f64::INFINITY, |(a, b)| (a - b).abs())
            })
            .fold(0.0, f64::max);
        let what = format!("PE of {name} − PE of λ = {}", super::number(lambda));
        checks.push(Check::within(&what, "exactly the same", most, 1e-9));
    }
    checks.push(Check::within(
        "PE read off runs of the program from x(0) = 1 − (26)",
        "(26)",
        of_runs(&x).1,
        1e-6,
    ));
    checks.push(Check::near(
        "λ of least largest |PE| for 0 < Δt/T ≤ 0.16",
        11.5,
        minimax(0.16),
        0.1,
    ));
    checks.push(Check::near(
        "λ of zero period error for Δt → 0",
        12.0,
        zero_period_error_lambda(1e-3),
        1e-3,
    ));
    let (low, high) = (better_beyond(11.5, 12.0), better_beyond(10.0, 11.5));
    checks.push(Check::note(
        "\"the period error of λ = 11.5 is approximately the least for any Δt/T\"",
        "λ = 11.5",
        format!(
            "λ = 12 is better below Δt/T = {low:.3}, λ = 10 above {high:.3}; least over Δt/T ≤ 0.25: λ = {:.2}",
            minimax(0.25)
        ),
        "11.5 is the compromise for Δt/T up to 0.16; the exact λ falls as Δt/T grows",
    ));
    for (name, _, swings) in COMPANIONS {
        let error = |share: &f64| {
            let omega = TAU * share;
            swings(omega).map_or(f64::NAN, |found| omega / found.omega - 1.0)
        };
        let some: Vec<f64> = x.iter().copied().skip(9).step_by(10).collect();
        let y = some.iter().map(error).collect();
        series.push(Series::dots(name, some, y));
    }
    let figure = Figure {
        file: "fig-2",
        title: "Fig. 2: period elongation",
        claim: "PE is signed: it falls through zero as λ grows. λ = 11.5 stays nearest to zero as a compromise up to Δt/T = 0.16; 12 is better below 0.10, a smaller λ above 0.24. Curves end where the poles become real.",
        across: Scale::fixed("Δt/T", "1", 0.0, LAST),
        up: Scale::fixed("period elongation PE", "1", -0.4, 1.0),
        axes: Axes::Linear,
        series,
    };
    (checks, vec![figure])
}
