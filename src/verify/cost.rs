//! Example 4.3, Table 2 and Fig. 16: the cost of a step of a chain with nonlinear absolute dampers.
//!
//! The text leaves ends, input and duration open. Here: mass 1 hangs on a base that moves as 0.1 sin 2πt m, mass n is
//! free, the dampers act on absolute velocities, and the run starts at rest. Times are those of this machine and are
//! not judged; that every λ is stable, and that all methods agree, is.

use std::f64::consts::TAU;

use super::drive::{Method, Walk, peak};
use super::figure::{Figure, Scale, Series};
use super::{Check, Effort, Proof, number};
use crate::integrate::{Lambda, NewmarkBeta, StabilityProof};
use crate::law::{BiviscousSpec, Reach};
use crate::linalg::SymMatrix;
use crate::model::{Base, Element, End, Structure};
use crate::spectral::lambda_limit;
use crate::time::Clock;

const MASS: f64 = 150.0;
const STIFFNESS: f64 = 2.5e5;
const DAMPING: f64 = 10.0;
const DT: f64 = 0.02;

const METHODS: [Method; 6] = [
    Method::Newmark(NewmarkBeta::Average),
    Method::Chang,
    Method::Newmark(NewmarkBeta::Explicit),
    Method::Family(2.0),
    Method::Family(4.0),
    Method::Family(11.5),
];

/// Table 2: milliseconds per step, methods in the order of [`METHODS`].
const TABLE_2: [(usize, [f64; 6]); 8] = [
    (500, [5.6, 7.2, 6.5, 0.7, 0.9, 0.9]),
    (1000, [30.1, 36.8, 34.6, 4.3, 3.9, 3.5]),
    (1500, [85.8, 100.0, 95.4, 8.2, 7.5, 6.9]),
    (2000, [177.4, 201.9, 195.6, 12.6, 12.0, 11.4]),
    (2500, [310.1, 346.4, 338.6, 18.2, 17.5, 17.0]),
    (3000, [498.3, 553.5, 538.3, 25.3, 24.4, 23.9]),
    (4000, [1058.0, 1149.6, 1128.7, 43.4, 42.4, 41.9]),
    (5000, [1871.2, 2018.8, 1992.0, 65.5, 64.8, 64.3]),
];

/// The damper of Fig. 15: c_a0 = 180, c_ay = 90 N s/m, v_y = 1/3 m/s.
const DAMPER: BiviscousSpec = BiviscousSpec {
    damping_n_s_per_m: 180.0,
    post_yield_damping_n_s_per_m: 90.0,
    yield_velocity_m_per_s: 1.0 / 3.0,
};

fn tridiagonal(n: usize, value: f64) -> SymMatrix {
    let mut entries = vec![(0, 0, value)];
    for i in 1..n {
        entries.extend([(i - 1, i - 1, value), (i - 1, i, -value), (i, i, value)]);
    }
    SymMatrix::from_triplets(n, entries)
}

fn chain(n: usize) -> Option<Structure> {
    let mut dampers = Vec::with_capacity(n);
    for dof in 0..n {
        dampers.push(Element {
            name: format!("absolute damper {}", dof + 1),
            from: End::Fixed,
            to: End::Dof(dof),
            law: Box::new(DAMPER.build().ok()?),
            reach: Reach::default(),
            hardening_ratio: None,
            damping_ratio: None,
        });
    }
    Structure::new(
        SymMatrix::diagonal(&vec![MASS; n]),
        tridiagonal(n, DAMPING),
        tridiagonal(n, STIFFNESS),
        vec![1.0; n],
        dampers,
    )
    .ok()
}

/// Base motion of step n; the base moves the chain through its first spring and dashpot.
fn base(step: u64, out: &mut [f64]) -> Base {
    out.fill(0.0);
    let t = step as f64 * DT;
    Base {
        disp: 0.1 * libm::sin(TAU * t),
        vel: 0.1 * TAU * libm::cos(TAU * t),
    }
}

/// Median time of a step in ms, and displacements of the first mass, over `steps` steps.
fn timed(method: Method, n: usize, steps: usize, clock: &dyn Clock) -> Option<(f64, Vec<f64>)> {
    let mut structure = chain(n)?;
    let mut walk = Walk::new(method, &mut structure, DT, base).ok()?;
    let (mut times, mut first) = (Vec::with_capacity(steps), Vec::with_capacity(steps));
    for _ in 0..steps {
        let start = clock.now();
        walk.step();
        times.push(clock.now().since(start));
        first.push(walk.state.disp.first().copied().unwrap_or(f64::NAN));
    }
    times.sort_unstable();
    let median = times.get(steps / 2).copied().unwrap_or(0);
    Some((median as f64 * 1e-6, first))
}

/// The example.
pub(super) fn example(effort: Effort, clock: &dyn Clock) -> Proof {
    let mut checks = limits();
    checks.extend(agreement(effort, clock));
    let sizes: Vec<usize> = match effort {
        Effort::Quick => vec![100, 200, 500],
        Effort::Whole => TABLE_2.iter().map(|row| row.0).collect(),
    };
    let mut measured = Vec::new();
    for &n in &sizes {
        let of_paper = TABLE_2.iter().find(|row| row.0 == n).map(|row| row.1);
        let mut times = [f64::NAN; 6];
        for (time, method) in times.iter_mut().zip(METHODS) {
            let steps = match method {
                Method::Family(_) => 200,
                _ => effort.of(12, 24),
            };
            if let Some((median, _)) = timed(method, n, steps, clock) {
                *time = median;
            }
        }
        let listed = |times: [f64; 6]| times.map(number).join(" | ");
        checks.push(Check::note(
            &format!("Table 2, n = {n}: ms per step, {}", METHODS.map(Method::name).join(" | ")),
            &of_paper.map_or_else(|| "(not in the table)".to_owned(), listed),
            listed(times),
            "timing of this machine, not judged; implicit methods here are sparse, with Newton's iteration",
        ));
        measured.push((n as f64, times));
    }
    let [(first, small), .., (last, large)] = TABLE_2;
    let exponent =
        |k: usize| libm::log(large[k] / small[k]) / libm::log(last as f64 / first as f64);
    checks.push(Check::note(
        "\"the computational times of λ = 2, 4, 11.5 and the number of DOFs are all approximately linear\"",
        "linear",
        format!("printed times grow as n^{:.2}; average acceleration as n^{:.2}", exponent(4), exponent(0)),
        "Table 2 is a dense implementation: three dense products a step against one dense factorisation",
    ));
    (checks, vec![figure(&measured)])
}

/// Stability of every λ for this chain.
fn limits() -> Vec<Check> {
    let omega = 2.0 * (STIFFNESS / MASS).sqrt() * DT;
    let n = 200;
    let proof = StabilityProof {
        mass: SymMatrix::diagonal(&vec![MASS; n]),
        damping: tridiagonal(n, DAMPING).plus(1.0, &SymMatrix::diagonal(&vec![180.0; n])),
        stiffness: tridiagonal(n, STIFFNESS),
        damping_bound: tridiagonal(n, DAMPING).plus(1.0, &SymMatrix::diagonal(&vec![180.0; n])),
        stiffness_bound: tridiagonal(n, STIFFNESS),
        dt: DT,
        apart: None,
    };
    vec![
        Check::holds(
            "bound of the largest Ω of a chain of any length, 2 √(k/m) Δt",
            "(not stated)",
            format!("{}; λ up to {}", number(omega), lambda_limit(omega)),
            "below 2: every λ is stable",
            omega < 2.0,
        ),
        Check::holds(
            "S ⪰ 0 at λ = ∞, n = 200",
            "(not stated)",
            if proof.holds(Lambda::Infinite) {
                "holds"
            } else {
                "does not hold"
            }
            .to_owned(),
            "holds, so every λ is stable",
            proof.holds(Lambda::Infinite),
        ),
    ]
}

/// All methods go the same way.
fn agreement(effort: Effort, clock: &dyn Clock) -> Vec<Check> {
    let n = effort.of(50, 500);
    let steps = effort.of(250, 500);
    let run =
        |method| timed(method, n, steps, clock).map_or_else(|| vec![f64::NAN], |(_, first)| first);
    let reference = run(Method::Newmark(NewmarkBeta::Average));
    let size = peak(&reference);
    let checks = METHODS.into_iter().skip(1).map(|method| {
        let found = run(method);
        let apart = found.iter().zip(&reference).map(|(a, b)| (a - b).abs());
        let apart = if found.len() == reference.len() {
            peak(&apart.collect::<Vec<_>>()) / size
        } else {
            f64::INFINITY
        };
        // The base starts with a kink, 0.1 · 2π m/s at once. A start that is half a step off is worth ω̄ Δt/2, and the
        // front that it sends up the chain disperses differently in each method: a step of the base's motion bounds both.
        Check::within(
            &format!(
                "{} − average acceleration, first mass of {n}, over peak",
                method.name()
            ),
            "same system",
            apart,
            TAU * DT,
        )
    });
    checks.collect()
}

fn figure(measured: &[(f64, [f64; 6])]) -> Figure {
    let mut series = Vec::new();
    for (k, method) in METHODS.into_iter().enumerate() {
        series.push(Series::dots(
            format!("paper: {}", method.name()),
            TABLE_2.iter().map(|row| row.0 as f64).collect(),
            TABLE_2.iter().map(|row| row.1[k]).collect(),
        ));
    }
    for (k, method) in METHODS.into_iter().enumerate() {
        series.push(Series::line(
            method.name(),
            measured.iter().map(|row| row.0).collect(),
            measured.iter().map(|row| row.1[k]).collect(),
        ));
    }
    Figure {
        file: "fig-16",
        title: "Fig. 16: time of a step",
        claim: "Dots are Table 2 (dense, 2014); lines this program on this machine, every method with sparse factors.",
        across: Scale::free("degrees of freedom", "1"),
        up: Scale::free("time of a step (ms)", "1"),
        logarithmic: true,
        square: false,
        series,
    }
}
