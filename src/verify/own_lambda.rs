//! Beyond the paper: a λ of their own for elements and modes. What it gains at the same guarantee of stability, shown on
//! the systems of example 4.2, and the proof of it against random systems.

use std::f64::consts::TAU;

use super::criterion::random_system;
use super::drive::{Method, Random, peak, solved, transition_of};
use super::figure::{Figure, Scale, Series};
use super::linear::{class, distance};
use super::storeys::TwoStoreys;
use super::{Check, Effort, Proof, number};
use crate::integrate::{Apart, Gui, Lambda, NewmarkBeta, Start};
use crate::linalg::{Modes, Storage, SymMatrix, modes};
use crate::spectral::{Apparent, eigenvalues, spectral_radius};
use crate::stability::{StabilityError, StabilityProof};

const STRUCTURE: TwoStoreys = TwoStoreys {
    mass: [1e3, 6e3],
    stiffness: [1e7, 1e5],
    theta: [0.0, 0.0],
};
const DT: f64 = 0.05;
const SECONDS: f64 = 15.0;
/// What the paper recommends for linear and softening systems, and the λ of least period error.
const STABLE: f64 = 4.0;
const ACCURATE: f64 = 11.5;

/// The share of storey `i` (from 0) of matrices of storeys.
fn storey(stiffness: &SymMatrix, i: usize) -> SymMatrix {
    let n = stiffness.n();
    let k = match i {
        0 => stiffness.row(0).map(|(_, k)| k).sum::<f64>(),
        _ => -stiffness.get(i - 1, i),
    };
    let entries = match i {
        0 => vec![(0, 0, k)],
        _ => vec![(i - 1, i - 1, k), (i - 1, i, -k), (i, i, k)],
    };
    SymMatrix::from_triplets(n, entries)
}

/// Period error of the mode nearest to `frequency` by the eigenvalues of the program's step.
fn period_error(proof: &StabilityProof, lambda: f64, frequency: f64) -> Option<f64> {
    let step = transition_of(proof, lambda)?;
    let wanted = frequency * proof.dt;
    let found = eigenvalues(&step)?.into_iter().filter_map(Apparent::of);
    let nearest = found.min_by(|a, b| {
        (a.omega - wanted)
            .abs()
            .total_cmp(&(b.omega - wanted).abs())
    })?;
    Some(wanted / nearest.omega - 1.0)
}

fn shapes() -> Option<Modes> {
    let stiffness = TwoStoreys::matrix(STRUCTURE.stiffness);
    modes(&stiffness, &SymMatrix::diagonal(&STRUCTURE.mass)).ok()
}

/// λ = 11.5 for the soft upper storey, and for the first mode: the rest stays at the λ that is asked for.
fn both() -> Option<[Apart; 2]> {
    let stiffness = TwoStoreys::matrix(STRUCTURE.stiffness);
    let lambda = Lambda::Finite(ACCURATE);
    Some([
        Apart::elements(2, &[(storey(&stiffness, 1), lambda)]),
        Apart::modes(&shapes()?, &SymMatrix::diagonal(&STRUCTURE.mass), &[lambda]),
    ])
}

/// Gain and proof.
pub(super) fn extensions(effort: Effort) -> Proof {
    let mut checks = random_systems(effort);
    let mut figures = Vec::new();
    if let Some(both) = both() {
        gain(&both, &mut checks, &mut figures);
        periods(&both, &mut checks, &mut figures);
    }
    (checks, figures)
}

/// The limit of the rest is the edge of the unit disc, and M_eff is what it is said to be.
fn random_systems(effort: Effort) -> Vec<Check> {
    let mut random = Random::new(34);
    let count = effort.of(60, 1000);
    let (mut below, mut above, mut wrong, mut solve) = (0.0f64, f64::INFINITY, 0usize, 0.0f64);
    let mut limits = 0usize;
    for trial in 0..count {
        let mut proof = random_system(&mut random, true);
        let n = proof.mass.n();
        let which = (random.between(0.0, n as f64) as usize).min(n - 1);
        let own = Lambda::Finite(random.spread(0.3, 8.0));
        let of_modes = trial % 2 == 1;
        let apart = if of_modes {
            let Ok(shapes) = modes(&proof.stiffness, &proof.mass) else {
                wrong += 1;
                continue;
            };
            Apart::modes(&shapes, &proof.mass, &vec![own; which + 1])
        } else {
            Apart::elements(n, &[(storey(&proof.stiffness, which), own)])
        };
        let rest = random.spread(0.5, 20.0);
        let weighted = apart
            .weighted(&proof.stiffness, Lambda::Finite(rest))
            .to_dense();
        proof.apart = Some(apart);
        solve = solve.max(dense_solve(&proof, rest, &weighted).unwrap_or(f64::INFINITY));
        let radius = |lambda: f64| {
            let found = transition_of(&proof, lambda).and_then(|step| spectral_radius(&step));
            found.unwrap_or(f64::NAN)
        };
        match proof.limit(f64::INFINITY, &[]) {
            Ok(Some(limit)) => {
                limits += 1;
                below = below.max(radius(0.99 * limit) - 1.0);
                above = above.min(radius(1.01 * limit) - 1.0);
            }
            Ok(None) => {
                wrong += usize::from(!(radius(1.0) < 1.0 + 1e-7 && radius(1e6) < 1.0 + 1e-7));
            }
            // What has its own λ is unstable whatever the rest does.
            Err(StabilityError::NoneAdmissible { .. } | StabilityError::Overflow { .. }) => {
                wrong += usize::from(!(radius(1e-3) > 1.0 && radius(1e3) > 1.0));
            }
        }
    }
    let of = format!("{limits} random systems with a limit of the rest");
    vec![
        Check::within(
            "w of the program (sparse factor, low-rank correction) − M_eff⁻¹ r with a dense M + (Δt/2) C0 + Δt² K̃",
            "(not in the paper)",
            solve,
            1e-9,
        ),
        Check::within(
            &format!("one per cent below the limit of the rest: spectral radius − 1, {of}"),
            "(not in the paper)",
            below.max(0.0),
            1e-7,
        ),
        Check::holds(
            "one per cent above it",
            "(not in the paper)",
            format!("at least {}", number(above)),
            "positive: the proof is also exact for parts with a separate λ",
            above > 0.0,
        ),
        Check::within(
            "systems said to have no limit, or none that is stable, and which are otherwise",
            "(not in the paper)",
            wrong as f64,
            0.0,
        ),
    ]
}

fn dense_solve(
    proof: &StabilityProof,
    lambda: f64,
    weighted: &nalgebra::DMatrix<f64>,
) -> Option<f64> {
    let n = proof.mass.n();
    let residual: Vec<f64> = (0..n).map(|i| 1.0 + i as f64).collect();
    let dt = proof.dt;
    let matrix =
        proof.mass.to_dense() + proof.damping.to_dense() * (dt / 2.0) + weighted * (dt * dt);
    let wanted = matrix
        .lu()
        .solve(&nalgebra::DVector::from_vec(residual.clone()))?;
    let found = solved(proof, lambda, &residual)?;
    let gaps = found.iter().zip(wanted.iter()).map(|(a, b)| (a - b).abs());
    Some(gaps.fold(0.0, f64::max) / wanted.amax())
}

/// A system of example 4.2 with one λ, and with two: errors of the top storey (r.m.s. over peak) and behaviour of the
/// bottom one.
struct Gain {
    /// By run: one λ, elements, modes, 11.5 for everything.
    errors: [f64; 4],
    classes: [&'static str; 4],
    runs: [[Vec<f64>; 2]; 4],
    reference: [Vec<f64>; 2],
}

fn compare(theta: [f64; 2], stable: f64, [element, mode]: &[Apart; 2]) -> Gain {
    let structure = TwoStoreys { theta, ..STRUCTURE };
    let missing = || [vec![f64::NAN], vec![f64::NAN]];
    let every = (DT / 1e-4 + 0.5) as usize;
    let explicit = Method::Newmark(NewmarkBeta::Explicit);
    let reference = structure.run(explicit, 1e-4, SECONDS, every);
    let reference = reference.unwrap_or_else(missing);
    let plain = |lambda| structure.run(Method::Family(lambda), DT, SECONDS, 1);
    let apart = |apart| structure.run_apart(apart, stable, DT, SECONDS);
    let runs = [plain(stable), apart(element), apart(mode), plain(ACCURATE)];
    let runs = runs.map(|found| found.unwrap_or_else(missing));
    let (top, bottom) = (peak(&reference[1]), peak(&reference[0]));
    Gain {
        errors: [0, 1, 2, 3].map(|k: usize| distance(&runs[k][1], &reference[1]) / top),
        classes: [0, 1, 2, 3].map(|k: usize| class(peak(&runs[k][0]) / bottom)),
        runs,
        reference,
    }
}

/// What the runs are called.
const NAMES: [&str; 4] = [
    "λ = 4",
    "λ = 11.5 for the upper storey, 4 for the rest",
    "λ = 11.5 for the first mode, 4 for the rest",
    "λ = 11.5",
];

fn gain(both: &[Apart; 2], checks: &mut Vec<Check>, figures: &mut Vec<Figure>) {
    let soft = compare([-0.1, -0.2], STABLE, both);
    for index in [1, 2] {
        checks.push(Check::holds(
            &format!("softening system of example 4.2, top storey: {}", NAMES[index]),
            "(not in the paper)",
            format!(
                "{} of the peak off the reference (r.m.s.), against {} at λ = 4, which the paper recommends",
                number(soft.errors[index]),
                number(soft.errors[0])
            ),
            "at most a quarter, and good (R ≤ 1.05) in the bottom storey",
            4.0 * soft.errors[index] <= soft.errors[0] && soft.classes[index] == "good",
        ));
    }
    checks.push(Check::holds(
        "the same at λ = 11.5 for everything",
        "numerical instability",
        soft.classes[3].to_owned(),
        "unstable: one λ for all cannot give this gain",
        soft.classes[3] == "unstable",
    ));
    let hard = compare([1.0, 2.0], 3.7, both);
    checks.push(Check::note(
        "hardening system, 3.7 for the rest: error with one λ; 11.5 for the upper storey; 11.5 for the first mode",
        "(not in the paper)",
        [0, 1, 2].map(|k: usize| number(hard.errors[k])).join("; "),
        "nothing is gained: with a tangent that has left K0 the period error is about Ω0²/(2λ) − Ω_t²/24, zero at λ = \
         12 (ω_0/ω_t)², and that is 3.6 at the peaks of this run",
    ));
    let storage = |apart: &Apart| {
        let (m, none) = (SymMatrix::diagonal(&STRUCTURE.mass), SymMatrix::zeros(2));
        let k = TwoStoreys::matrix(STRUCTURE.stiffness);
        let (lambda, start) = (Lambda::Finite(STABLE), Start::Published);
        let gui = Gui::with_apart(&m, &none, &k, DT, lambda, start, Some(apart));
        gui.ok().map(|gui| gui.storage())
    };
    let kept: Vec<_> = both.iter().map(storage).collect();
    let words = kept
        .iter()
        .map(|found| found.map_or_else(String::new, |s| s.to_string()));
    checks.push(Check::holds(
        "storage of the factor with either",
        "(not in the paper)",
        words.collect::<Vec<_>>().join(", "),
        "tridiagonal as without: no dense inverse",
        kept.iter()
            .all(|found| *found == Some(Storage::Tridiagonal)),
    ));
    let times: Vec<f64> = (0..soft.reference[1].len())
        .map(|i| i as f64 * DT)
        .collect();
    let series = NAMES.iter().zip(&soft.runs).take(3).map(|(name, found)| {
        let gaps = found[1].iter().zip(&soft.reference[1]).map(|(a, b)| a - b);
        Series::line(*name, times.clone(), gaps.collect())
    });
    figures.push(Figure {
        file: "own-lambda-error",
        title: "Error of the top storey, softening system of example 4.2",
        claim: "Displacement less that of the reference. The stiff bottom storey keeps λ = 4, and with it the unconditional stability.",
        across: Scale::fixed("time", "s", 0.0, SECONDS),
        up: Scale::free("error", "m"),
        logarithmic: false,
        square: false,
        series: series.collect(),
    });
}

/// Period error of the first mode of the linear system over the step.
fn periods([element, mode]: &[Apart; 2], checks: &mut Vec<Check>, figures: &mut Vec<Figure>) {
    let first = STRUCTURE.frequencies(STRUCTURE.stiffness)[0];
    let error = |apart: Option<&Apart>, lambda: f64, share: f64| {
        let mut proof = STRUCTURE.proof(STRUCTURE.stiffness, TAU * share / first);
        proof.apart = apart.cloned();
        period_error(&proof, lambda, first).unwrap_or(f64::NAN)
    };
    let at = |apart| error(apart, STABLE, DT * first / TAU);
    let (plain, by_element, by_mode) = (at(None), at(Some(element)), at(Some(mode)));
    checks.push(Check::holds(
        "period error of the first mode at Δt = 0.05 s: λ = 4; with 11.5 for the upper storey; with 11.5 for the mode",
        "(not in the paper)",
        [plain, by_element, by_mode].map(|e| format!("{:+.4} %", 100.0 * e)).join("; "),
        "the last two at most a tenth of the first",
        by_element.abs() < 0.1 * plain.abs() && by_mode.abs() < 0.1 * plain.abs(),
    ));
    let shares: Vec<f64> = (1..=120).map(|i| 0.3 * f64::from(i) / 120.0).collect();
    let line = |name: &str, apart: Option<&Apart>, lambda: f64| {
        let y = shares
            .iter()
            .map(|share| 100.0 * error(apart, lambda, *share));
        Series::line(name, shares.clone(), y.collect())
    };
    figures.push(Figure {
        file: "own-lambda-period",
        title: "Period error of the first mode",
        claim: "The linear system of example 4.2, by the eigenvalues of the program's step. λ = 11.5 for everything is unstable beyond Δt/T = 0.016 and only shown for comparison.",
        across: Scale::fixed("Δt/T of the first mode", "1", 0.0, 0.3),
        up: Scale::free("period error", "%"),
        logarithmic: false,
        square: false,
        series: vec![
            line(NAMES[0], None, STABLE),
            line(NAMES[1], Some(element), STABLE),
            line(NAMES[2], Some(mode), STABLE),
            Series {
                reference: true,
                ..line(NAMES[3], None, ACCURATE)
            },
        ],
    });
}
