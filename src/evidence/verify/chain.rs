//! The chain of example 4.3: model, load, and the checks that need no clock.
//!
//! The text leaves ends, input and duration open. Here: mass 1 hangs on a base that moves as 0.1 sin 2πt m, mass n is
//! free, the dampers act on absolute velocities, and the run starts at rest.

use std::f64::consts::TAU;

pub(super) use super::dense::DT;
use super::dense::{DAMPER, DAMPING, Dense, MASS, STIFFNESS};
use super::drive::{Method, Walk, peak};
use super::figure::{Axes, Figure, Scale, Series};
use super::{Check, Effort, number};
use gusset_numerics::integrate::{Lambda, NewmarkBeta};
use gusset_numerics::law::{Law, Reach};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::{Base, Element, End, Structure};
use gusset_numerics::spectral::lambda_limit;
use gusset_proof::StabilityProof;

pub(super) const METHODS: [Method; 6] = [
    Method::Newmark(NewmarkBeta::Average),
    Method::Chang,
    Method::Newmark(NewmarkBeta::Explicit),
    Method::Family(2.0),
    Method::Family(4.0),
    Method::Family(11.5),
];

pub(super) fn tridiagonal(n: usize, value: f64) -> SymMatrix {
    let mut entries = vec![(0, 0, value)];
    for i in 1..n {
        entries.extend([(i - 1, i - 1, value), (i - 1, i, -value), (i, i, value)]);
    }
    SymMatrix::from_triplets(n, entries)
}

/// Example 4.3 with `n` masses: equal masses in a row on a base, a nonlinear damper from each to the inertial frame.
/// `None` without a mass.
#[must_use]
pub(crate) fn chain_of_example_4_3(n: usize) -> Option<Structure> {
    let law = DAMPER.build().ok()?;
    let dampers = (0..n).map(|dof| Element {
        name: format!("absolute damper {}", dof + 1),
        from: End::Fixed,
        to: End::Dof(dof),
        law: Box::new(law.clone()),
        reach: Reach::default(),
        hardening_ratio: None,
        damping_ratio: None,
    });
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
pub(super) fn base(dt: f64) -> impl Fn(u64, &mut [f64]) -> Base {
    move |step, out| {
        out.fill(0.0);
        let t = step as f64 * dt;
        Base {
            disp: 0.1 * libm::sin(TAU * t),
            vel: 0.1 * TAU * libm::cos(TAU * t),
        }
    }
}

/// Stability of every λ for this chain.
pub(super) fn limits() -> Vec<Check> {
    let omega = 2.0 * (STIFFNESS / MASS).sqrt() * DT;
    let n = 200;
    let proof = StabilityProof {
        mass: SymMatrix::diagonal(&vec![MASS; n]),
        damping: tridiagonal(n, DAMPING).plus(1.0, &SymMatrix::diagonal(&vec![180.0; n])),
        stiffness: tridiagonal(n, STIFFNESS),
        damping_bound: tridiagonal(n, DAMPING).plus(1.0, &SymMatrix::diagonal(&vec![180.0; n])),
        stiffness_bound: tridiagonal(n, STIFFNESS),
        dt: DT,
        late_mass: None,
        massless: Vec::new(),
    };
    vec![
        Check::holds(
            "bound of the largest Ω of a chain of any length, 2 √(k/m) Δt",
            "(not stated)",
            format!("{}; λ up to {}", number(omega), number(lambda_limit(omega))),
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

/// The damper of Fig. 15, by the program's law.
pub(super) fn damper() -> Vec<Check> {
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

pub(super) fn force_velocity() -> Figure {
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
        axes: Axes::Linear,
        series: vec![Series::line("", v, force)],
    }
}

/// All methods go the same way: what is between them goes with the step.
pub(super) fn agreement(effort: Effort) -> Vec<Check> {
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
pub(super) fn course(method: Method, n: usize, steps: usize, finer: usize) -> Option<Vec<f64>> {
    let mut structure = chain_of_example_4_3(n)?;
    let dt = DT / finer as f64;
    let mut walk = Walk::new(method, &mut structure, dt, base(dt)).ok()?;
    let mut first = Vec::with_capacity(steps);
    for _ in 0..steps {
        for _ in 0..finer {
            walk.step();
        }
        first.push(walk.state.disp.first().copied().unwrap_or(f64::NAN));
    }
    Some(first)
}

/// The program's methods and the dense implementation go the same way, to roundoff and the tolerance of Newton.
pub(super) fn same_equations(effort: Effort) -> Check {
    let (n, steps) = (effort.of(40, 120), 100);
    let apart = |method: Method| -> Option<f64> {
        let mut dense = Dense::new(method, n)?;
        let mut structure = chain_of_example_4_3(n)?;
        let mut walk = Walk::new(method, &mut structure, DT, base(DT)).ok()?;
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
    let found = METHODS.map(|method| apart(method).unwrap_or(f64::INFINITY));
    Check::within(
        &format!(
            "all six methods, {n} masses, {steps} steps: this program − the dense implementation, over peak"
        ),
        "same equations",
        found.into_iter().fold(0.0, f64::max),
        1e-8,
    )
}
