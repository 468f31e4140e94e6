//! Example 4.1 and Fig. 7: a linear structure of two storeys.

use std::f64::consts::TAU;

use super::drive::{Method, peak};
use super::figure::{Axes, Figure, Scale, Series};
use super::storeys::TwoStoreys;
use super::{Check, Proof};
use gusset_numerics::integrate::NewmarkBeta;
use gusset_numerics::spectral::{lambda_limit, period_error};

const STRUCTURE: TwoStoreys = TwoStoreys {
    mass: [1e3, 4e3],
    stiffness: [2e6, 1e5],
    theta: [0.0; 2],
};
const DT: f64 = 0.05;
const FINE: f64 = 1e-4;
/// The paper gives no duration.
const SECONDS: f64 = 20.0;

/// Class of a run by R = its peak bottom drift over that of the reference: good up to 1.05, unstable beyond 3.
pub(super) fn class(ratio: f64) -> &'static str {
    match ratio {
        r if r <= 1.05 => "good",
        r if r <= 3.0 => "fluctuating",
        _ => "unstable",
    }
}

/// One check of how a run behaves.
pub(super) fn behaves(system: &str, lambda: f64, wanted: &str, ratio: f64) -> Check {
    let name = Method::Family(lambda).name();
    Check::holds(
        &format!("{system}{name}: bottom drift over that of the reference"),
        wanted,
        format!("{} (R = {})", class(ratio), super::number(ratio)),
        "R ≤ 1.05 good, ≤ 3 fluctuating, beyond unstable",
        class(ratio) == wanted,
    )
}

/// Root of the mean square of a − b.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len().max(1) as f64).sqrt()
}

/// Largest |a − b|.
fn largest_gap(a: &[f64], b: &[f64]) -> f64 {
    let gaps: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    peak(&gaps)
}

/// Largest |a − b| over the largest |b| so far: for runs that grow.
fn relative(a: &[f64], b: &[f64]) -> f64 {
    let (mut largest, mut worst) = (0.0f64, 0.0f64);
    for (a, b) in a.iter().zip(b) {
        largest = largest.max(b.abs());
        if !(a.is_finite() && b.is_finite()) {
            return f64::INFINITY;
        }
        if largest > 0.0 {
            worst = worst.max((a - b).abs() / largest);
        }
    }
    worst
}

/// The example.
pub(super) fn example() -> Proof {
    let frequencies = STRUCTURE.frequencies(STRUCTURE.stiffness);
    let omegas = frequencies.map(|w| w * DT);
    let exact_limit = STRUCTURE
        .proof(STRUCTURE.stiffness, DT)
        .limit(f64::INFINITY, &[])
        .ok()
        .flatten()
        .unwrap_or(f64::NAN);
    let mut checks = vec![
        Check::near(
            "first natural frequency, rad/s",
            4.88,
            frequencies[0],
            0.005,
        ),
        Check::near(
            "second natural frequency, rad/s",
            45.84,
            frequencies[1],
            0.005,
        ),
        Check::near("Ω of the first mode", 0.24, omegas[0], 0.005),
        Check::near("Ω of the second mode", 2.29, omegas[1], 0.005),
        Check::near("Δt/T of the first mode", 0.039, omegas[0] / TAU, 0.0005),
        Check::near(
            "upper limit of λ by (33)",
            16.77,
            lambda_limit(omegas[1]),
            0.005,
        ),
        Check::near("upper limit of λ by S ⪰ 0", 16.77, exact_limit, 0.005),
    ];
    let every = (DT / FINE + 0.5) as usize;
    let explicit = Method::Newmark(NewmarkBeta::Explicit);
    let average = Method::Newmark(NewmarkBeta::Average);
    let missing = || [vec![f64::NAN], vec![f64::NAN]];
    let run = |method, dt, every| {
        STRUCTURE
            .run(method, dt, SECONDS, every)
            .unwrap_or_else(missing)
    };
    let reference = run(explicit, FINE, every);
    let bottom = peak(&reference[0]);
    let of_family = [2.0, 4.0, 11.5, 17.0, f64::INFINITY]
        .map(|lambda| (lambda, run(Method::Family(lambda), DT, 1)));
    for (lambda, found) in &of_family {
        let wanted = if *lambda < 16.0 { "good" } else { "unstable" };
        // The paper says "stable" and "reliable".
        checks.push(behaves("", *lambda, wanted, peak(&found[0]) / bottom));
    }
    let of = |lambda: f64| {
        let found = of_family.iter().find(|(l, _)| *l == lambda);
        found.map_or_else(missing, |(_, found)| found.clone())
    };
    let [two, four, best] = [2.0, 4.0, 11.5].map(|lambda| {
        let found = of(lambda);
        distance(&found[1], &reference[1]) / peak(&reference[1])
    });
    checks.push(Check::holds(
        "distance of the top storey from the reference (r.m.s. over peak): λ = 2, 4, 11.5",
        "11.5 is almost the exact solution, 2 and 4 are elongated",
        format!(
            "{}, {}, {}",
            super::number(two),
            super::number(four),
            super::number(best)
        ),
        "11.5 nearest, at most a fifth of λ = 4",
        best < 0.2 * four && four < two,
    ));
    for lambda in [2.0, 4.0, 11.5] {
        let error = period_error(omegas[0], 0.0, lambda).unwrap_or(f64::NAN);
        checks.push(Check::note(
            &format!("period error of the first mode at λ = {lambda}"),
            "read from Fig. 2",
            format!("{:+.3} %", 100.0 * error),
            "Ω/Ω̄ − 1",
        ));
    }
    let of_average = run(average, DT, 1);
    // β ω̄² Δt² of the load, ω̄ = 1 rad/s, and the transient it starts: of the order of β Ω² at worst.
    checks.push(Check::within(
        "λ = 4 − average acceleration, top storey, over peak",
        "match each other very well",
        largest_gap(&of(4.0)[1], &of_average[1]) / peak(&of_average[1]),
        omegas[0] * omegas[0] / 4.0,
    ));
    let coarse = run(explicit, DT, 1);
    checks.push(Check::within(
        "λ = ∞ − explicit Newmark, top storey, over the peak so far",
        "identical",
        relative(&of(f64::INFINITY)[1], &coarse[1]),
        1e-9,
    ));
    checks.push(Check::note(
        "duration",
        "not stated",
        format!("{SECONDS} s"),
        "the figure's length",
    ));
    let times: Vec<f64> = (0..reference[1].len()).map(|i| i as f64 * DT).collect();
    let mut series: Vec<Series> = of_family
        .iter()
        .map(|(lambda, found)| {
            Series::line(
                Method::Family(*lambda).name(),
                times.clone(),
                found[1].clone(),
            )
        })
        .collect();
    let [_, top] = of_average;
    series.push(Series::line("average acceleration", times.clone(), top));
    let [_, top] = coarse;
    series.push(Series::line(
        "explicit Newmark, Δt = 0.05 s",
        times.clone(),
        top,
    ));
    let [_, top] = reference;
    let bound = 1.5 * peak(&top);
    series.push(Series::reference(
        "exact: explicit Newmark, Δt = 0.0001 s",
        times,
        top,
    ));
    let figure = Figure {
        file: "fig-7",
        title: "Fig. 7: displacement of the top storey, example 4.1",
        claim: "λ = 17 and ∞ leave the picture; 11.5 lies on the exact curve; 2 and 4 lag behind it.",
        across: Scale::fixed("time", "s", 0.0, SECONDS),
        up: Scale::fixed("displacement", "m", -bound, bound),
        axes: Axes::Linear,
        series,
    };
    (checks, vec![figure])
}
