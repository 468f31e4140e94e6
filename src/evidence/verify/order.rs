//! Section 3.1: "second-order accurate". True of the poles. A trajectory that is started as printed is of first order
//! when it starts with an acceleration, because the first velocity belongs to half a step earlier; it is of second order
//! from rest, and with the corrected first step that the program offers.

use std::f64::consts::TAU;

use super::drive::{Alone, oscillator, transition};
use super::figure::{Axes, Figure, Scale, Series};
use super::{Check, Proof};
use gusset_numerics::integrate::{
    Forces, Integrator, Moment, Newmark, NewmarkBeta, NewtonSettings, Offline, Start, State,
};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::spectral::period_error;

/// One oscillator: m = 1, T = 1 s.
const OMEGA: f64 = TAU;
const RATIO: f64 = 0.05;
const SECONDS: f64 = 3.0;
/// Steps a period.
const STEPS: [usize; 6] = [20, 40, 80, 160, 320, 640];

fn damping() -> f64 {
    2.0 * RATIO * OMEGA
}

fn scalar(value: f64) -> SymMatrix {
    SymMatrix::diagonal(&[value])
}

/// How it is started and driven.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Case {
    /// x(0) = 1.
    Free,
    /// sin ω̄ t from rest: no force, so no acceleration, at t = 0.
    FromRest,
}

impl Case {
    const DRIVEN: f64 = 4.0;

    fn force(self, t: f64) -> f64 {
        match self {
            Self::Free => 0.0,
            Self::FromRest => libm::sin(Self::DRIVEN * t),
        }
    }

    fn start(self) -> f64 {
        if self == Self::Free { 1.0 } else { 0.0 }
    }

    /// The solution of the differential equation.
    fn exact(self, t: f64) -> f64 {
        let (c, k) = (damping(), OMEGA * OMEGA);
        // Steady part P cos p t + Q sin p t.
        let p = Self::DRIVEN;
        let (stiff, viscous) = (k - p * p, c * p);
        let size = stiff * stiff + viscous * viscous;
        let (steady_cos, steady_sin) = match self {
            Self::Free => (0.0, 0.0),
            Self::FromRest => (-viscous / size, stiff / size),
        };
        let damped = OMEGA * (1.0 - RATIO * RATIO).sqrt();
        let a = self.start() - steady_cos;
        let b = (RATIO * OMEGA * a - p * steady_sin) / damped;
        let decay = libm::exp(-RATIO * OMEGA * t);
        decay * (a * libm::cos(damped * t) + b * libm::sin(damped * t))
            + steady_cos * libm::cos(p * t)
            + steady_sin * libm::sin(p * t)
    }
}

/// Largest |x − exact| of the family.
fn family(case: Case, start: Start, lambda: f64, steps: usize) -> Option<f64> {
    let dt = 1.0 / steps as f64;
    let (c, k) = (damping(), OMEGA * OMEGA);
    let mut gui = oscillator((1.0, c, k), dt, lambda, start)?;
    let mut state = State::new(vec![case.start()], vec![0.0]);
    let mut worst = 0.0f64;
    for step in 0..(SECONDS * steps as f64) as usize {
        let t = step as f64 * dt;
        worst = worst.max((state.disp[0] - case.exact(t)).abs());
        let r = [case.force(t) - c * state.vel[0] - k * state.disp[0]];
        gui.advance(&mut state, &r, &mut [0.0]);
    }
    Some(worst)
}

/// Largest |x − exact| of average acceleration.
fn average(case: Case, steps: usize) -> Option<f64> {
    let dt = 1.0 / steps as f64;
    let (m, c, k) = (scalar(1.0), scalar(damping()), scalar(OMEGA * OMEGA));
    let newton = NewtonSettings::default();
    let mut newmark = Newmark::new(&m, &c, &k, dt, NewmarkBeta::Average, newton).ok()?;
    let mut forces = Alone {
        damping: damping(),
        stiffness: OMEGA * OMEGA,
        force: |step| case.force(step * dt),
    };
    let mut state = State::new(vec![case.start()], vec![0.0]);
    let mut r = [0.0];
    forces.residual_into(Moment::at(0), &state.disp, &state.vel, dt, &mut r);
    newmark.begin(&state, &r);
    let mut worst = 0.0f64;
    for step in 1..(SECONDS * steps as f64) as u64 {
        newmark.step(step, &mut state, &mut forces, &mut r).ok()?;
        worst = worst.max((state.disp[0] - case.exact(step as f64 * dt)).abs());
    }
    Some(worst)
}

/// Order between the finest two of `errors`.
fn order(errors: &[f64]) -> f64 {
    match errors {
        [.., coarse, fine] => libm::log2(coarse / fine),
        _ => f64::NAN,
    }
}

/// Amplitude of the free swing through x\[0\] and x\[1\] of the undamped recursion with trace 2 cos Ω̄.
fn envelope(start: Start, lambda: f64, omega: f64) -> Option<f64> {
    let stiffness = omega * omega;
    let step = transition((0.0, stiffness), (0.0, stiffness), 1.0, lambda)?;
    let cos = step.trace() / 2.0;
    let mut gui = oscillator((1.0, 0.0, stiffness), 1.0, lambda, start)?;
    let mut state = State::new(vec![1.0], vec![0.0]);
    gui.advance(&mut state, &[-stiffness], &mut [0.0]);
    let next = state.disp[0];
    Some(((1.0 + next * next - 2.0 * next * cos) / (1.0 - cos * cos)).sqrt())
}

/// Orders, the zero of the period error, and the overshoot of stiff modes.
pub(super) fn accuracy() -> Proof {
    let errors = |of: &dyn Fn(usize) -> Option<f64>| -> Vec<f64> {
        STEPS
            .iter()
            .map(|&steps| of(steps).unwrap_or(f64::NAN))
            .collect()
    };
    let printed = errors(&|steps| family(Case::Free, Start::Published, 11.5, steps));
    let corrected = errors(&|steps| family(Case::Free, Start::SecondOrder, 11.5, steps));
    let from_rest = errors(&|steps| family(Case::FromRest, Start::Published, 11.5, steps));
    let implicit = errors(&|steps| average(Case::Free, steps));
    let poles: Vec<f64> = [0.02, 0.01]
        .iter()
        .map(|share| period_error(TAU * share, 0.0, 4.0).unwrap_or(f64::NAN))
        .collect();
    let omega = 20.0;
    let overshoot = |start, lambda| envelope(start, lambda, omega).unwrap_or(f64::NAN);
    let checks = vec![
        // The next term of each expansion is of relative size Ω² or Ω at the finest steps: below 0.05.
        Check::near(
            "order of the period error of the poles, λ = 4",
            2.0,
            order(&poles),
            0.01,
        ),
        Check::near(
            "order of the displacement from rest under a sine force, as printed, λ = 11.5",
            2.0,
            order(&from_rest),
            0.05,
        ),
        Check::holds(
            "order of the displacement in free vibration from x(0) = 1, as printed, λ = 11.5",
            "second-order accurate",
            format!("{:.3}", order(&printed)),
            "1 ± 0.05: the paper's statement does not hold here; a[0] ≠ 0, and (2) takes v[0] as that of half a step earlier",
            (order(&printed) - 1.0).abs() < 0.05,
        ),
        Check::near(
            "the same with the corrected first step, start = \"second-order\"",
            2.0,
            order(&corrected),
            0.05,
        ),
        Check::near(
            "average acceleration, the same",
            2.0,
            order(&implicit),
            0.05,
        ),
        Check::within(
            "overshoot of a stiff mode from x(0) = 1 as printed, λ = 4, Ω = 20 − √(1 + Ω²/4) = 10.05",
            "(not in the paper)",
            overshoot(Start::Published, 4.0) - (1.0 + omega * omega / 4.0).sqrt(),
            1e-9,
        ),
        Check::within(
            "the same with the corrected first step − 1: no overshoot",
            "(not in the paper)",
            overshoot(Start::SecondOrder, 4.0) - 1.0,
            1e-9,
        ),
        Check::note(
            "overshoot at λ = 2, Ω = 20",
            "(not in the paper)",
            super::number(overshoot(Start::Published, 2.0)),
            "tends to √(4/(4 − λ)) = 1.414 for Ω → ∞; average acceleration does not overshoot",
        ),
    ];
    let shares: Vec<f64> = STEPS.iter().map(|steps| 1.0 / *steps as f64).collect();
    let line = |name: &str, y: Vec<f64>| Series::line(name, shares.clone(), y);
    let slope = |power: f64, at: f64| -> Vec<f64> {
        shares
            .iter()
            .map(|share| at * libm::pow(share / 0.05, power))
            .collect()
    };
    let figure = Figure {
        file: "order",
        title: "Largest error of the displacement over the step",
        claim: "ξ = 0.05, λ = 11.5, three periods. Only the start as printed, with an acceleration at t = 0, is of first order.",
        across: Scale::free("Δt/T", "1"),
        up: Scale::free("largest |x − exact|", "m"),
        axes: Axes::Logarithmic,
        series: vec![
            line("free vibration, as printed", printed),
            line("free vibration, second-order start", corrected),
            line("sine force from rest, as printed", from_rest),
            line("free vibration, average acceleration", implicit),
            Series::reference("slopes 1 and 2", shares.clone(), slope(1.0, 0.3)),
            Series::reference("", shares.clone(), slope(2.0, 0.003)),
        ],
    };
    (checks, vec![figure])
}
