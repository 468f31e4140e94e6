//! Example 4.3, Table 2 and Fig. 16: the cost of a step of a chain with nonlinear absolute dampers.
//!
//! Times are those of this machine and have no verdict. The work of a dense implementation of each method in a step
//! has one.

use super::chain::{
    DT, METHODS, agreement, base, chain_of_example_4_3, damper, force_velocity, limits,
    same_equations,
};
use super::dense::Dense;
use super::drive::{Method, Walk};
use super::figure::{Axes, Figure, Scale, Series};
use super::{Check, Effort, Shown, Tabulation, number};
use gusset_quantity::time::Clock;
use gusset_view::report::Look;

/// Table 2 of Gui et al. (2014): n, then milliseconds per step as printed, for average acceleration, Chang 2002, explicit
/// Newmark, λ = 2, 4, 11.5 (a 2014 PC).
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

/// Median time of a step in ms, and displacements of the first mass, over `steps` steps.
fn timed(method: Method, n: usize, steps: usize, clock: &dyn Clock) -> Option<(f64, Vec<f64>)> {
    let mut structure = chain_of_example_4_3(n)?;
    let mut walk = Walk::new(method, &mut structure, DT, base(DT)).ok()?;
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
    let listed = |measured: &[(usize, [f64; 6])], decimals: usize| {
        let row = |(n, times): &(usize, [f64; 6])| {
            let cells = times.iter().map(|time| format!("{time:.decimals$}"));
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
            listed(&TABLE_2, 1),
        ),
        table(
            "The equations with full matrices on this machine, one core: ms per step",
            listed(&dense, 2),
        ),
        table(
            "This program on this machine, every method with sparse factors: ms per step",
            listed(&measured, 4),
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
        for (k, method) in METHODS.into_iter().enumerate() {
            let steps = if matches!(method, Method::Family(_)) {
                20
            } else {
                4
            };
            let Some(mut dense) = Dense::new(method, n) else {
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

/// The paper's statements about Table 2, judged by counts and not by the clock.
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
            "explicit Newmark and Chang 2002 become implicit here, λ = 2, 4, 11.5 stay explicit",
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
            format!("{:.1} and {:.1}", ratio(first), ratio(last)),
            &format!("counted; grows at least with half the growth of n ({sizes})"),
            grown >= 0.5 * sizes,
        ),
        Check::note(
            "the same ratio by the clock",
            &format!(
                "{:.1} at n = {small}, {:.1} at {large}",
                of_small[2] / of_small[4],
                of_large[2] / of_large[4]
            ),
            format!(
                "{:.0} at n = {}, {:.0} at {}",
                first.times[2] / first.times[4],
                first.n,
                last.times[2] / last.times[4],
                last.n
            ),
            "dense on both sides; times of this machine, not judged",
        ),
        Check::note(
            "time grows about in proportion to the number of DOFs for λ = 2, 4 and 11.5",
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

fn points(name: String, rows: &[(usize, [f64; 6])], k: usize) -> Series {
    Series::dots(
        name,
        rows.iter().map(|row| row.0 as f64).collect(),
        rows.iter().map(|row| row.1[k]).collect(),
    )
}

fn line(name: String, rows: &[(usize, [f64; 6])], k: usize) -> Series {
    Series {
        look: Look::Line,
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
        up: Scale::fixed("time of a step", "ms", 0.0, 2100.0),
        axes: Axes::Linear,
        series: printed.chain(ours).collect(),
    }
}

/// The comparison with the sparse methods, which the paper does not contain.
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
        up: Scale::free("time of a step", "ms"),
        axes: Axes::Logarithmic,
        series,
    }
}
