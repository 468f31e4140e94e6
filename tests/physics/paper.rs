//! Gui, Wang, Jin, Chen, Zhou (2014), examples 4.1 and 4.2, from a test file through the engine: the published values.
//!
//! The reference is the paper's: explicit Newmark with Δt = 1e-4 s, written here in a few lines that share nothing with the
//! program. Example 4.2 runs as a hybrid test: its bottom storey is the specimen. "Unstable" is judged by R, the peak
//! bottom drift over that of the reference (up to 1.05 good, to 3 fluctuating, beyond it unstable).

use crate::common::engine::{distance, prepare, run_with_facts};
use gusset_proof::Kind;
use gusset_setup::Facts;

const STEP: f64 = 0.05;

/// Two storeys on the ground, no damping: masses, initial stiffnesses, θ of (42), from the bottom.
#[derive(Clone, Copy)]
struct Building {
    mass: [f64; 2],
    stiffness: [f64; 2],
    theta: [f64; 2],
    duration: f64,
}

const LINEAR: Building = Building {
    mass: [1e3, 4e3],
    stiffness: [2e6, 1e5],
    theta: [0.0, 0.0],
    duration: 20.0,
};
const SOFTENING: Building = Building {
    mass: [1e3, 6e3],
    stiffness: [1e7, 1e5],
    theta: [-0.1, -0.2],
    duration: 15.0,
};
const HARDENING: Building = Building {
    theta: [1.0, 2.0],
    ..SOFTENING
};

impl Building {
    /// Forces on the floors at displacements x and time t: −m a_g − R(x).
    fn residual(&self, x: [f64; 2], t: f64) -> [f64; 2] {
        let drift = [x[0], x[1] - x[0]];
        let q =
            |i: usize| self.stiffness[i] * drift[i] * (1.0 + self.theta[i] * drift[i].abs().sqrt());
        let ground = 20.0 * libm::sin(t);
        [
            q(1) - q(0) - self.mass[0] * ground,
            -q(1) - self.mass[1] * ground,
        ]
    }

    /// Explicit Newmark (β = 0, γ = ½, no damping) from rest: x at every 0.05 s and the peak drifts over all fine steps.
    fn newmark(&self, dt: f64) -> (Vec<[f64; 2]>, [f64; 2]) {
        let every = (STEP / dt).round() as usize;
        let steps = (self.duration / dt).round() as usize;
        let accel = |x, t| {
            let r = self.residual(x, t);
            [r[0] / self.mass[0], r[1] / self.mass[1]]
        };
        let (mut x, mut v, mut a) = ([0.0; 2], [0.0; 2], accel([0.0; 2], 0.0));
        let (mut history, mut peak) = (vec![x], [0.0f64; 2]);
        for step in 1..=steps {
            for i in 0..2 {
                x[i] += dt * v[i] + 0.5 * dt * dt * a[i];
            }
            let next = accel(x, step as f64 * dt);
            for i in 0..2 {
                v[i] += 0.5 * dt * (a[i] + next[i]);
            }
            a = next;
            peak = [peak[0].max(x[0].abs()), peak[1].max((x[1] - x[0]).abs())];
            if step % every == 0 {
                history.push(x);
            }
        }
        (history, peak)
    }

    /// The test file at λ; the bottom storey is a specimen if it is `hybrid`. `reach` is declared for both storeys.
    fn file(&self, lambda: &str, hybrid: bool, reach: [f64; 2]) -> String {
        let Self {
            mass,
            stiffness,
            theta,
            duration,
        } = self;
        let law = |i: usize| {
            format!(
                "reach_disp_m = {:e}\nlaw = {{ square_root = {{ stiffness_n_per_m = {:e}, \
                 hardening_per_sqrt_m = {} }} }}",
                reach[i], stiffness[i], theta[i]
            )
        };
        let storeys = if hybrid {
            format!(
                "stiffness_n_per_m = [0, 0]\n[[structure.element]]\nfrom = 1\nto = 2\n{}\n\
                 [[specimen]]\nname = \"bottom\"\nstorey = 1\n{}",
                law(1),
                law(0)
            )
        } else {
            format!("stiffness_n_per_m = {stiffness:?}")
        };
        format!(
            "safety.divergence_m = 1e300\n[time]\nstep_s = {STEP}\nduration_s = {duration}\n[integrator]\nlambda = {lambda}\n\
             [excitation.ground_acceleration.signal.sine]\namplitude = 20\n\
             angular_frequency_rad_per_s = 1\n[structure.shear_building]\nmass_kg = {mass:?}\n{storeys}\n"
        )
    }

    /// Displacements of a run until its end, which an overflow may bring early.
    fn run(&self, lambda: &str, hybrid: bool, reach: [f64; 2]) -> (Vec<[f64; 2]>, Facts) {
        let (run, facts) = run_with_facts(&self.file(lambda, hybrid, reach));
        let (x1, x2) = (run.column("x1"), run.column("x2"));
        (x1.into_iter().zip(x2).map(|(a, b)| [a, b]).collect(), facts)
    }
}

fn floor(history: &[[f64; 2]], dof: usize) -> Vec<f64> {
    history.iter().map(|x| x[dof]).collect()
}

/// λ_lim of a test, as `check` would print it.
fn limit(facts: &Facts) -> f64 {
    let structure = facts.structure.as_ref().unwrap();
    structure.choice().unwrap().limit.unwrap()
}

/// Rounded to the digits that the paper prints.
fn printed(value: f64) -> String {
    format!("{value:.2}")
}

/// R of a run that may have ended early because nothing finite was left.
fn ratio(history: &[[f64; 2]], building: &Building, peak: [f64; 2]) -> f64 {
    let steps = (building.duration / STEP).round() as usize;
    let found = history.iter().fold(0.0f64, |peak, x| peak.max(x[0].abs()));
    if history.len() == steps + 1 && found.is_finite() {
        found / peak[0]
    } else {
        f64::INFINITY
    }
}

#[test]
fn example_4_1_has_published_frequencies() {
    let (_, facts) = LINEAR.run("4", false, [1.0; 2]);
    let structure = facts.structure.as_ref().unwrap();
    assert_eq!(structure.frequencies.len(), 2);
    assert_eq!(printed(structure.frequencies[0]), "4.88");
    assert_eq!(printed(structure.frequencies[1]), "45.84");
    assert_eq!(printed(limit(&facts)), "16.77");
}

#[test]
fn example_4_1_is_stable_below_its_limit() {
    let (reference, peak) = LINEAR.newmark(1e-4);
    let error = |lambda: &str| {
        let (history, _) = LINEAR.run(lambda, false, [1.0; 2]);
        assert!(ratio(&history, &LINEAR, peak) <= 1.05, "{lambda}");
        [0, 1].map(|dof| distance(&floor(&history, dof), &floor(&reference, dof)))
    };
    let [two, four, best] = ["2", "4", "11.5"].map(error);
    for dof in 0..2 {
        assert!(
            best[dof] < four[dof] && four[dof] < two[dof],
            "{two:?} {four:?} {best:?}"
        );
    }
    for lambda in ["17", "inf"] {
        let (history, facts) = LINEAR.run(lambda, false, [1.0; 2]);
        assert!(ratio(&history, &LINEAR, peak) > 3.0, "{lambda}");
        let choice = facts.structure.as_ref().unwrap().choice().unwrap();
        assert!(!choice.is_stable(), "{lambda}");
        let doubts = prepare(&LINEAR.file(lambda, false, [1.0; 2])).doubts;
        // The peak of 2.04 g is another finding.
        let kinds: Vec<Kind> = doubts.iter().map(|(kind, _)| *kind).collect();
        assert_eq!(
            kinds.iter().filter(|kind| **kind == Kind::Unstable).count(),
            1
        );
    }
}

/// The transfer functions of Newmark (γ = ½, β = 1/λ) and of λ differ by (β z² + (1 − 2β) z + β)/z, so Newmark's
/// displacement is β x[i+1] + (1 − 2β) x[i] + β x[i−1] of ours: to roundoff, from rest with F[0] = 0. Average
/// acceleration is implicit; here its 2 × 2 system is solved at every step.
#[test]
fn lambda_4_is_average_acceleration() {
    let (ours, _) = LINEAR.run("4", false, [1.0; 2]);
    let Building {
        mass, stiffness, ..
    } = LINEAR;
    let (beta, dt) = (0.25, STEP);
    let k = [
        [stiffness[0] + stiffness[1], -stiffness[1]],
        [-stiffness[1], stiffness[1]],
    ];
    let lhs = [
        [mass[0] + beta * dt * dt * k[0][0], beta * dt * dt * k[0][1]],
        [beta * dt * dt * k[1][0], mass[1] + beta * dt * dt * k[1][1]],
    ];
    let determinant = lhs[0][0] * lhs[1][1] - lhs[0][1] * lhs[1][0];
    let (mut x, mut v, mut a) = ([0.0f64; 2], [0.0f64; 2], [0.0f64; 2]);
    let mut newmark = vec![x];
    for step in 1..ours.len() {
        let ground = 20.0 * libm::sin(step as f64 * dt);
        let predicted = [0, 1].map(|i| x[i] + dt * v[i] + dt * dt * (0.5 - beta) * a[i]);
        let rhs =
            [0, 1].map(|i| -mass[i] * ground - k[i][0] * predicted[0] - k[i][1] * predicted[1]);
        let next = [
            (rhs[0] * lhs[1][1] - rhs[1] * lhs[0][1]) / determinant,
            (rhs[1] * lhs[0][0] - rhs[0] * lhs[1][0]) / determinant,
        ];
        for i in 0..2 {
            x[i] = predicted[i] + beta * dt * dt * next[i];
            v[i] += 0.5 * dt * (a[i] + next[i]);
            a[i] = next[i];
        }
        newmark.push(x);
    }
    for dof in 0..2 {
        let smoothed: Vec<f64> = ours
            .windows(3)
            .map(|w| beta * w[2][dof] + (1.0 - 2.0 * beta) * w[1][dof] + beta * w[0][dof])
            .collect();
        let newmark = &floor(&newmark, dof)[1..ours.len() - 1];
        // 400 steps of a dozen roundings each, in a system without damping: they add up.
        let found = distance(&smoothed, newmark);
        assert!(found < 400.0 * 12.0 * f64::EPSILON, "{found:e}");
        // To the eye the same, as the paper says: β ω² Δt² of the second mode, which is but a small part of it.
        assert!(distance(&floor(&ours, dof)[1..ours.len() - 1], newmark) < 0.05);
    }
}

/// λ = ∞ gives explicit Newmark's displacements at the same step, also while both diverge: roundings are compared with the
/// size that the response has reached.
#[test]
fn lambda_inf_is_explicit_newmark() {
    let (ours, _) = LINEAR.run("inf", false, [1.0; 2]);
    let (newmark, _) = LINEAR.newmark(STEP);
    let mut size = 0.0f64;
    for (step, (a, b)) in ours.iter().zip(&newmark).enumerate() {
        size = b.iter().fold(size, |size, x| size.max(x.abs()));
        for dof in 0..2 {
            let allowed = size * 12.0 * f64::EPSILON * (step + 1) as f64;
            assert!(
                (a[dof] - b[dof]).abs() <= allowed,
                "step {step}: {a:?} {b:?}"
            );
        }
    }
    assert!(size > 1e6, "both diverge: {size:e}");
}

fn classes(building: &Building, expected: &[(&str, std::ops::RangeInclusive<f64>)]) {
    let (_, peak) = building.newmark(1e-4);
    for (lambda, range) in expected {
        let (history, _) = building.run(lambda, true, peak);
        let found = ratio(&history, building, peak);
        assert!(range.contains(&found), "lambda = {lambda}: R = {found}");
    }
}

/// R above 3 or not finite; "up to 1.05" and "to 3" include their ends, "above" does not.
const ABOVE_3: std::ops::RangeInclusive<f64> = 3.000_000_1..=f64::INFINITY;

#[test]
fn example_4_2_softening_breaks_down_there() {
    let (_, facts) = SOFTENING.run("4", true, [1.0; 2]);
    let structure = facts.structure.as_ref().unwrap();
    assert_eq!(printed(structure.frequencies[0]), "4.06");
    assert_eq!(printed(structure.frequencies[1]), "100.50");
    assert_eq!(printed(limit(&facts)), "4.75");
    classes(
        &SOFTENING,
        &[
            ("2", 0.0..=1.05),
            ("4", 0.0..=1.05),
            ("4.7", 0.0..=1.05),
            ("4.8", 1.05..=3.0),
            ("4.9", ABOVE_3),
            ("11.5", ABOVE_3),
        ],
    );
}

/// The least limit over the run is that at the largest drifts of the reference: they come at almost the same time, and the
/// second mode is that of the bottom storey (k1 = 100 k2).
#[test]
fn example_4_2_hardening_breaks_down_there() {
    let (_, peak) = HARDENING.newmark(1e-4);
    let (_, facts) = HARDENING.run("3.7", true, peak);
    assert_eq!(printed(limit(&facts)), "3.79");
    classes(
        &HARDENING,
        &[
            ("1.2", 0.0..=1.05),
            ("3.7", 0.0..=1.05),
            ("3.9", ABOVE_3),
            ("4", ABOVE_3),
            ("11.5", ABOVE_3),
        ],
    );
}
