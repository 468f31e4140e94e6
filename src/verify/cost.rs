//! Example 4.3, Table 2 and Fig. 16: the cost of a step of a chain with nonlinear absolute dampers.
//!
//! The text leaves ends, input and duration open. Here: mass 1 hangs on a base that moves as 0.1 sin 2πt m, mass n is
//! free, the dampers act on absolute velocities, and the run starts at rest. Times are those of this machine and are
//! not judged; that every λ is stable, that all methods agree, and what a dense implementation of each must do in a
//! step, is.

use std::f64::consts::TAU;

use super::dense::{Dense, Way};
use super::drive::{Method, Walk, peak};
use super::figure::{Figure, Scale, Series};
use super::{Check, Effort, Shown, Tabulation, number};
use crate::integrate::{Lambda, NewmarkBeta, StabilityProof};
use crate::law::{BiviscousSpec, Law, Reach};
use crate::linalg::SymMatrix;
use crate::model::{Base, Element, End, Structure};
use crate::spectral::lambda_limit;
use crate::time::Clock;

pub(super) const MASS: f64 = 150.0;
pub(super) const STIFFNESS: f64 = 2.5e5;
pub(super) const DAMPING: f64 = 10.0;
pub(super) const DT: f64 = 0.02;

const METHODS: [Method; 6] = [
    Method::Newmark(NewmarkBeta::Average),
    Method::Chang,
    Method::Newmark(NewmarkBeta::Explicit),
    Method::Family(2.0),
    Method::Family(4.0),
    Method::Family(11.5),
];

/// The same for a dense implementation.
const WAYS: [Way; 6] = [
    Way::Average,
    Way::Chang,
    Way::Explicit,
    Way::Family(2.0),
    Way::Family(4.0),
    Way::Family(11.5),
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
pub(super) const DAMPER: BiviscousSpec = BiviscousSpec {
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
pub(super) fn example(effort: Effort, clock: &dyn Clock) -> Shown {
    let mut checks = limits();
    checks.extend(damper());
    checks.extend(agreement(effort));
    checks.push(same_equations(effort));
    let sizes: Vec<usize> = match effort {
        Effort::Quick => vec![100, 200, 500],
        Effort::Whole => TABLE_2.iter().map(|row| row.0).collect(),
    };
    let mut measured = Vec::new();
    for &n in &sizes {
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
        measured.push((n, times));
    }
    let as_published = as_published(effort, clock);
    checks.extend(claims(&as_published));
    let listed = |measured: &[(usize, [f64; 6])]| {
        let row = |(n, times): &(usize, [f64; 6])| {
            let cells = times.iter().map(|time| number((time * 1e4).round() / 1e4));
            std::iter::once(n.to_string()).chain(cells).collect()
        };
        measured.iter().map(row).collect()
    };
    let head: Vec<String> = std::iter::once("DOFs".to_owned())
        .chain(METHODS.map(Method::name))
        .collect();
    let table = |title: &str, rows| Tabulation {
        title: title.to_owned(),
        head: head.clone(),
        rows,
    };
    let dense: Vec<_> = as_published.iter().map(|row| (row.n, row.times)).collect();
    let tables = vec![
        table(
            "Table 2 as printed: ms per step, a computer of 2014",
            listed(&TABLE_2),
        ),
        table(
            "The same equations with full matrices on this machine, one core: ms per step",
            listed(&dense),
        ),
        table(
            "This program on this machine, every method with sparse factors: ms per step",
            listed(&measured),
        ),
    ];
    Shown {
        checks,
        figures: vec![
            force_velocity(),
            published_axes(&dense),
            beside(&dense, &measured),
        ],
        tables,
    }
}

/// The damper of Fig. 15, as the program's law has it.
fn damper() -> Vec<Check> {
    let Ok(mut law) = DAMPER.build() else {
        return vec![Check::near(
            "Fig. 15: force of the damper",
            60.0,
            f64::NAN,
            0.0,
        )];
    };
    let mut force = |v: f64| law.trial(0.0, v, 0.0);
    vec![
        Check::near(
            "Fig. 15: force at v_y = 1/3 m/s, N",
            60.0,
            force(1.0 / 3.0),
            1e-9,
        ),
        Check::near(
            "Fig. 15: slope c_ay beyond v_y, N s/m",
            90.0,
            (force(0.9) - force(0.4)) / 0.5,
            1e-9,
        ),
    ]
}

fn force_velocity() -> Figure {
    let v: Vec<f64> = (-100..=100).map(|i| f64::from(i) / 100.0).collect();
    let force = DAMPER.build().map_or_else(
        |_| vec![f64::NAN; v.len()],
        |mut law| v.iter().map(|&v| law.trial(0.0, v, 0.0)).collect(),
    );
    Figure {
        file: "fig-15",
        title: "Fig. 15: the biviscous damper",
        claim: "c_a0 = 180, c_ay = 90 N s/m, v_y = 1/3 m/s: the program's law.",
        across: Scale::fixed("velocity", "m/s", -1.0, 1.0),
        up: Scale::fixed("force", "N", -150.0, 150.0),
        logarithmic: false,
        square: false,
        series: vec![Series::line("", v, force)],
    }
}

/// One size of a dense implementation.
struct AsPublished {
    n: usize,
    /// ms per step.
    times: [f64; 6],
    /// Factorisations per step.
    factorisations: [f64; 6],
    /// Floating-point operations per step, from what was counted.
    operations: [f64; 6],
}

/// Times and counts of the dense implementation; Table 2 has its sizes up to 5000, which would take hours in double
/// loops of one core.
fn as_published(effort: Effort, clock: &dyn Clock) -> Vec<AsPublished> {
    let sizes = match effort {
        Effort::Quick => [50, 100, 200],
        Effort::Whole => [250, 500, 1000],
    };
    let each = sizes.into_iter().map(|n| {
        let mut row = AsPublished {
            n,
            times: [f64::NAN; 6],
            factorisations: [f64::NAN; 6],
            operations: [f64::NAN; 6],
        };
        for (k, way) in WAYS.into_iter().enumerate() {
            let steps = if matches!(way, Way::Family(_)) { 20 } else { 4 };
            let Some(mut dense) = Dense::new(way, n) else {
                continue;
            };
            let before = (dense.factorisations, dense.products);
            let mut times = Vec::with_capacity(steps);
            for _ in 0..steps {
                let start = clock.now();
                let made = dense.step();
                times.push(clock.now().since(start) as f64 * 1e-6);
                if made.is_none() {
                    times.push(f64::INFINITY);
                }
            }
            times.sort_by(f64::total_cmp);
            row.times[k] = times[times.len() / 2];
            let per_step = |count: usize| count as f64 / steps as f64;
            let (factorisations, products) = (
                per_step(dense.factorisations - before.0),
                per_step(dense.products - before.1),
            );
            let size = n as f64;
            row.factorisations[k] = factorisations;
            row.operations[k] =
                factorisations * size * size * size / 3.0 + products * 2.0 * size * size;
        }
        row
    });
    each.collect()
}

/// What the paper says of Table 2, judged by counts and not by the clock.
fn claims(rows: &[AsPublished]) -> Vec<Check> {
    let [first, .., last] = rows else {
        return Vec::new();
    };
    let listed = |values: [f64; 6]| values.map(number).join(" | ");
    let ratio = |row: &AsPublished| {
        row.operations[0]
            .min(row.operations[1])
            .min(row.operations[2])
            / row.operations[4]
    };
    let grown = ratio(last) / ratio(first);
    let sizes = last.n as f64 / first.n as f64;
    let [(small, of_small), .., (large, of_large)] = TABLE_2;
    let exponent =
        |k: usize| libm::log(of_large[k] / of_small[k]) / libm::log(large as f64 / small as f64);
    let measured = |k: usize| libm::log(last.times[k] / first.times[k]) / libm::log(sizes);
    vec![
        Check::holds(
            &format!(
                "factorisations of an n × n matrix in a step, n = {}: {}",
                last.n,
                METHODS.map(Method::name).join(" | ")
            ),
            "explicit Newmark and Chang 2002 “transform into implicit algorithms”, λ = 2, 4, 11.5 “remain explicit”",
            listed(last.factorisations),
            "counted in a dense implementation: at least 1 for the first three, 0 for the family",
            last.factorisations[..3].iter().all(|f| *f >= 1.0)
                && last.factorisations[3..].iter().all(|f| *f == 0.0),
        ),
        Check::holds(
            &format!(
                "operations of the cheapest of the three over those of λ = 4, n = {} and {}",
                first.n, last.n
            ),
            "ratios grow significantly with the number of DOFs",
            format!("{} and {}", number(ratio(first)), number(ratio(last))),
            &format!("counted; grows at least with half the growth of n ({sizes})"),
            grown >= 0.5 * sizes,
        ),
        Check::note(
            "the same ratio by the clock",
            &format!(
                "{} at n = {small}, {} at {large}",
                number(of_small[2] / of_small[4]),
                number(of_large[2] / of_large[4])
            ),
            format!(
                "{} at n = {}, {} at {}",
                number((first.times[2] / first.times[4]).round()),
                first.n,
                number((last.times[2] / last.times[4]).round()),
                last.n
            ),
            "dense on both sides; times of this machine, not judged",
        ),
        Check::note(
            "“the relationships between the computational times for λ = 2, 4 and 11.5 and the number of DOFs are all approximately linear”",
            "linear",
            format!(
                "printed times of λ = 4 grow as n^{:.2}, of average acceleration as n^{:.2}; dense here as n^{:.2} and n^{:.2}",
                exponent(4),
                exponent(0),
                measured(4),
                measured(0)
            ),
            "not so: three dense products a step against a dense factorisation in every iteration. With sparse factors both are linear",
        ),
    ]
}

/// The program's methods and the dense implementation go the same way, to roundoff and the tolerance of Newton.
fn same_equations(effort: Effort) -> Check {
    let (n, steps) = (effort.of(40, 120), 100);
    let apart = |way: Way, method: Method| -> Option<f64> {
        let mut dense = Dense::new(way, n)?;
        let mut structure = chain(n)?;
        let mut walk = Walk::new(method, &mut structure, DT, base).ok()?;
        let (mut worst, mut largest) = (0.0f64, 0.0f64);
        for _ in 0..steps {
            dense.step()?;
            walk.step();
            for (a, b) in dense.disp.iter().zip(&walk.state.disp) {
                worst = worst.max((a - b).abs());
                largest = largest.max(b.abs());
            }
        }
        Some(worst / largest)
    };
    let found = WAYS.into_iter().zip(METHODS);
    let found = found.map(|(way, method)| apart(way, method).unwrap_or(f64::INFINITY));
    // 1e-10 of the largest response per step is left to Newton; a hundred steps of it.
    Check::within(
        &format!(
            "all six methods, {n} masses, {steps} steps: this program − the dense implementation, over peak"
        ),
        "same equations",
        found.fold(0.0, f64::max),
        1e-8,
    )
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

/// All methods go the same way: what is between them goes with the step.
fn agreement(effort: Effort) -> Vec<Check> {
    let n = effort.of(50, 500);
    let reference = Method::Newmark(NewmarkBeta::Average);
    // First mass at whole multiples of Δt, for a step that is a share of it.
    let run = |method: Method, finer: usize| -> Vec<f64> {
        let found = course(method, n, 250, finer);
        found.unwrap_or_else(|| vec![f64::NAN])
    };
    let references = [1, 4].map(|finer| run(reference, finer));
    let size = peak(&references[1]);
    let checks = METHODS.into_iter().skip(1).map(|method| {
        let gaps = [1, 4].map(|finer| run(method, finer));
        let gaps: Vec<f64> = gaps
            .iter()
            .zip(&references)
            .map(|(found, reference)| {
                let apart = found.iter().zip(reference).map(|(a, b)| (a - b).abs());
                if found.len() == reference.len() {
                    peak(&apart.collect::<Vec<_>>()) / size
                } else {
                    f64::INFINITY
                }
            })
            .collect();
        // The base starts with a kink, 0.1 · 2π m/s at once, whose front every method disperses differently: less
        // than first order in Δt. A quarter of the step must leave less than half of the gap.
        Check::holds(
            &format!("{} − average acceleration, first mass of {n}, over peak: Δt = 0.02 s, 0.005 s", method.name()),
            "same system",
            format!("{}, {}", number(gaps[0]), number(gaps[1])),
            "at most a step of the base's motion (0.126), and less than half of it at a quarter of the step",
            gaps[0] <= TAU * DT && gaps[1] < 0.5 * gaps[0],
        )
    });
    checks.collect()
}

/// First mass at the ends of `steps` steps of Δt, integrated with Δt/`finer`.
fn course(method: Method, n: usize, steps: usize, finer: usize) -> Option<Vec<f64>> {
    let mut structure = chain(n)?;
    let dt = DT / finer as f64;
    let load = move |step: u64, out: &mut [f64]| {
        out.fill(0.0);
        let t = step as f64 * dt;
        Base {
            disp: 0.1 * libm::sin(TAU * t),
            vel: 0.1 * TAU * libm::cos(TAU * t),
        }
    };
    let mut walk = Walk::new(method, &mut structure, dt, load).ok()?;
    let mut first = Vec::with_capacity(steps);
    for _ in 0..steps {
        for _ in 0..finer {
            walk.step();
        }
        first.push(walk.state.disp.first().copied().unwrap_or(f64::NAN));
    }
    Some(first)
}

fn points(name: String, rows: &[(usize, [f64; 6])], k: usize) -> Series {
    Series::dots(
        name,
        rows.iter().map(|row| row.0 as f64).collect(),
        rows.iter().map(|row| row.1[k]).collect(),
    )
}

fn line(name: String, rows: &[(usize, [f64; 6])], k: usize) -> Series {
    Series {
        dots: false,
        ..points(name, rows, k)
    }
}

/// Fig. 16 in the paper's axes.
fn published_axes(dense: &[(usize, [f64; 6])]) -> Figure {
    let series = METHODS.into_iter().enumerate();
    let printed = series
        .clone()
        .map(|(k, method)| line(method.name(), &TABLE_2, k));
    let ours = [0, 4].map(|k| points(format!("{}, dense here", METHODS[k].name()), dense, k));
    Figure {
        file: "fig-16",
        title: "Fig. 16: time of a step, as printed",
        claim: "Lines are Table 2; dots the same equations with full matrices on this machine.",
        across: Scale::fixed("degrees of freedom", "1", 0.0, 5000.0),
        up: Scale::fixed("time of a step (ms)", "1", 0.0, 2100.0),
        logarithmic: false,
        square: false,
        series: printed.chain(ours).collect(),
    }
}

/// The same with the sparse methods, which the paper does not have.
fn beside(dense: &[(usize, [f64; 6])], measured: &[(usize, [f64; 6])]) -> Figure {
    let mut series = Vec::new();
    for k in [0, 4] {
        let name = METHODS[k].name();
        series.push(points(format!("{name}, Table 2"), &TABLE_2, k));
        series.push(line(format!("{name}, dense here"), dense, k));
        series.push(line(format!("{name}, sparse here"), measured, k));
    }
    Figure {
        file: "fig-16-sparse",
        title: "Time of a step with sparse factors",
        claim: "Two methods of Table 2. What it times is the dense algebra: with sparse factors every method is linear in n, and the family keeps a lead of what an iteration costs.",
        across: Scale::free("degrees of freedom", "1"),
        up: Scale::free("time of a step (ms)", "1"),
        logarithmic: true,
        square: false,
        series,
    }
}
