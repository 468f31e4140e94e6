use nalgebra::DVector;
use rand::{RngExt as _, SeedableRng as _, rngs::Xoshiro256PlusPlus};

use super::super::super::spectral_radius;
use super::super::continuous;
use super::*;

/// A chain of storeys with Rayleigh damping; the specimen is one of them, or a part of it.
fn drawn(random: &mut Xoshiro256PlusPlus) -> (Delayed, f64, f64) {
    let n = random.random_range(1..=3);
    let mut between = |low: f64, high: f64| low * libm::pow(high / low, random.random::<f64>());
    let mass = DMatrix::from_diagonal(&DVector::from_fn(n, |_, _| between(300.0, 3000.0)));
    let mut storeys: Vec<f64> = (0..n).map(|_| between(3e5, 3e6)).collect();
    let specimen = between(1e5, 3e6);
    let fastest = between(0.05, 4.0);
    let ratio = between(1e-5, 0.05);
    let by_stiffness = ratio * between(0.1, 1.0);
    let place = random.random_range(0..n);
    if random.random_bool(0.3) {
        storeys[place] = 0.0;
    }
    let row_of = |storey: usize| {
        DMatrix::from_fn(1, n, |_, dof| match dof {
            _ if dof == storey => 1.0,
            _ if dof + 1 == storey => -1.0,
            _ => 0.0,
        })
    };
    let mut stiffness = DMatrix::zeros(n, n);
    for (storey, k) in storeys.iter().enumerate() {
        stiffness += row_of(storey).transpose() * row_of(storey) * *k;
    }
    let rows = row_of(place);
    let whole = &stiffness + rows.transpose() * &rows * specimen;
    let inverse = mass.clone().try_inverse().unwrap();
    let omegas = eigenvalues(&(inverse * &whole)).unwrap();
    let omegas = omegas.iter().map(|square| square.re.sqrt());
    let (low, high) = omegas.fold((f64::INFINITY, 0.0_f64), |(low, high), omega| {
        (low.min(omega), high.max(omega))
    });
    let damps = random.random_bool(0.4);
    let specimen_damping = if damps { ratio * specimen / high } else { 0.0 };
    let system = Delayed {
        damping: &mass * (ratio * low) + &whole * (by_stiffness / high),
        mass,
        stiffness,
        rows,
        specimen_stiffness: DMatrix::from_element(1, 1, specimen),
        specimen_damping: DMatrix::from_element(1, 1, specimen_damping),
        specimen_mass: 0.0,
        weighted: None,
        ticks: Vec::new(),
    };
    let lambda = [2.0, 4.0, if fastest < 2.0 { 11.5 } else { 4.0 }][random.random_range(0..3)];
    (system, fastest / high, lambda)
}

/// Checks every structure against its own recursion, by eigenvalues at delay after delay.
#[test]
fn recursion_is_stable_below_critical_delay() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(20);
    let mut below_the_grid = 0;
    for case in 0..120 {
        let (system, dt, lambda) = drawn(&mut random);
        let hint = continuous(&system).unwrap().map(|found| found.delay);
        let limit = discrete(&system, dt, lambda, hint).unwrap();
        let radius =
            |delay: f64| spectral_radius(&recursion(&system, dt, lambda, delay).unwrap()).unwrap();
        let told = match limit {
            DiscreteLimit::At(delay) => {
                let above = radius(1.003 * delay);
                assert!(above > 1.0, "case {case}: {delay} of {dt}: {above}");
                delay
            }
            DiscreteLimit::Beyond(_) => 12.0 * dt,
        };
        below_the_grid += u32::from(told < 0.25 * dt);
        let fractions = (1..60).map(|part| 0.997 * told * f64::from(part) / 59.0);
        let steps = (1..96).map(|part| 0.125 * dt * f64::from(part));
        for delay in fractions.chain(steps.filter(|delay| *delay < 0.997 * told)) {
            let found = radius(delay);
            // Eigenvalues of the history: n ε^(1/…) stays far below the growth of 3 % of a delay.
            assert!(
                found < 1.0 + 1e-10,
                "case {case}: {told} is reported, but at {delay} it grows by {found} (Δt {dt}, λ {lambda})"
            );
        }
    }
    // The short ones, of lightly damped modes, are among them.
    assert!(below_the_grid > 12, "{below_the_grid}");
}

/// 11.3 Hz at Ω = 0.69 with ξ = 0.07 %: in continuous time 60 µs.
#[test]
fn discrete_limit_is_below_continuous_one() {
    let scalar = |value: f64| DMatrix::from_element(1, 1, value);
    let (mass, specimen) = (547.621_053_729_506_1, 904_973.016_346_698_6);
    let system = Delayed {
        mass: scalar(mass),
        damping: scalar(0.100_060_604_858_398_4 * mass),
        stiffness: scalar(1_853_166.664_501_214_9),
        rows: scalar(1.0),
        specimen_stiffness: scalar(specimen),
        specimen_damping: scalar(0.0),
        specimen_mass: 0.0,
        weighted: None,
        ticks: Vec::new(),
    };
    let expected = continuous(&system).unwrap().unwrap().delay;
    let found = discrete(&system, 0.009_73, 4.0, Some(expected)).unwrap();
    let DiscreteLimit::At(found) = found else {
        panic!("{found:?}");
    };
    // The apparent frequency is lower by Ω²/12 or so, 4 %; and linear interpolation leads.
    assert!((found / expected - 1.0).abs() < 0.15, "{found} {expected}");
}

/// Three axes that are alike, each between the ground and a separate mass: the critical delay of one is that of all. On the
/// history of their commands, an iteration without an exceptional shift stalls.
#[test]
fn alike_axes_share_a_critical_delay() {
    let alike = |axes: usize, damps: bool| {
        let all = |value: f64| DMatrix::identity(axes, axes) * value;
        Delayed {
            mass: all(1000.0),
            damping: all(600.0),
            stiffness: all(5e5),
            rows: all(1.0),
            specimen_stiffness: all(1e6),
            specimen_damping: all(if damps { 200.0 } else { 0.0 }),
            specimen_mass: 0.0,
            weighted: None,
            ticks: Vec::new(),
        }
    };
    for dt in [1e-4, 2e-4, 5e-3] {
        for damps in [false, true] {
            let found = |axes| match discrete(&alike(axes, damps), dt, 4.0, None) {
                Ok(DiscreteLimit::At(delay)) => delay,
                other => panic!("{axes} {dt} {damps}: {other:?}"),
            };
            let (one, three) = (found(1), found(3));
            // For several axes it is the delay at which they grow by more than roundoff, which is a little longer.
            assert!(
                (three / one - 1.0).abs() < 1e-4,
                "{dt} {damps}: {three} {one}"
            );
        }
    }
}

/// A path of ten ticks a step, computed by the recursion itself. Simulated tick by tick, the response grows above the critical
/// delay and decays below it.
#[test]
fn delay_between_targets_is_that_of_ticks() {
    // Weights of a cubic from target to target whose slopes are backward differences of second order.
    let ticks = 10;
    let weights = |back: usize| {
        let u = 1.0 - back as f64 / ticks as f64;
        let (s, t) = (u * u, u * u * u);
        let [at_start, at_end] = [1.0 - 3.0 * s + 2.0 * t, 3.0 * s - 2.0 * t];
        let [leaves, arrives] = [u - 2.0 * s + t, t - s];
        let slopes = [[1.5, -2.0, 0.5, 0.0, 0.0], [0.0, 1.5, -2.0, 0.5, 0.0]];
        let [rise, fall] = [6.0 * (u - s), 1.0 - 4.0 * u + 3.0 * s];
        let end = 3.0 * s - 2.0 * u;
        let of = |[a, b, c, d]: [f64; 4]| {
            let places = [[1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0]];
            std::array::from_fn(|i| {
                a * places[1][i] + b * places[0][i] + c * slopes[1][i] + d * slopes[0][i]
            })
        };
        super::super::Weights {
            disp: of([at_start, at_end, leaves, arrives]),
            slope: of([-rise, rise, fall, end]),
        }
    };
    let scalar = |value: f64| DMatrix::from_element(1, 1, value);
    for (damping_of_specimen, dt) in [(0.0, 0.02), (2000.0, 0.02), (0.0, 0.04), (2000.0, 0.04)] {
        let (mass, k, ke, c) = (1000.0, 1e5, 2e5, 400.0);
        let mut system = Delayed {
            mass: scalar(mass),
            damping: scalar(c),
            stiffness: scalar(k),
            rows: scalar(1.0),
            specimen_stiffness: scalar(ke),
            specimen_damping: scalar(damping_of_specimen),
            specimen_mass: 0.0,
            weighted: None,
            ticks: Vec::new(),
        };
        let once = discrete(&system, dt, 4.0, None).unwrap();
        system.ticks = (0..ticks).map(weights).collect();
        let limit = discrete(&system, dt, 4.0, None).unwrap();
        let DiscreteLimit::At(critical) = limit else {
            panic!("{limit:?}");
        };
        assert_ne!(once, limit);
        let effective = mass + 0.5 * dt * (c + damping_of_specimen) + 0.25 * dt * dt * (k + ke);
        let grows = |delay: f64| {
            let back = delay / dt * ticks as f64;
            let (whole, share) = (back.floor() as usize, back - back.floor());
            // Targets; commands of ticks and their velocities.
            let (mut targets, mut ways) = (vec![0.0; 8], vec![[0.0; 2]; 400]);
            let (mut x, mut v) = (1.0, 0.0);
            let (mut early, mut late) = (0.0_f64, 0.0_f64);
            let steps = 4000;
            for step in 0..steps {
                targets.push(x);
                let newest: Vec<f64> = targets.iter().rev().take(5).copied().collect();
                for back in (0..ticks).rev() {
                    let way = weights(back);
                    let sum = |of: [f64; 5]| of.iter().zip(&newest).map(|(a, b)| a * b).sum();
                    ways.push([sum(way.disp), sum(way.slope) / dt]);
                }
                let at = |back: usize| ways[ways.len() - 1 - back];
                let (a, b) = (at(whole), at(whole + 1));
                let [d, vel] = [0, 1].map(|i| a[i] * (1.0 - share) + b[i] * share);
                let force = k * x + c * v + ke * d + damping_of_specimen * vel;
                v -= dt * force / effective;
                x += dt * v;
                match step {
                    _ if step > steps - 200 => late = late.max(x.abs()),
                    _ if (400..600).contains(&step) => early = early.max(x.abs()),
                    _ => {}
                }
            }
            late > early
        };
        assert!(
            !grows(0.985 * critical),
            "{dt} {damping_of_specimen} {critical}"
        );
        assert!(
            grows(1.015 * critical),
            "{dt} {damping_of_specimen} {critical}"
        );
    }
}
