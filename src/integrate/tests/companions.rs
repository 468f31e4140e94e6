//! The companion methods: order, reductions to the family, equilibrium, numerical damping, refusals.

use super::{scalar, storeys};
use crate::integrate::*;
use crate::law::{BilinearSpec, BiviscousSpec, CubicSpec, Law, Reach};
use crate::linalg::SymMatrix;
use crate::model::{Base, Element, End, Structure};

/// What can be stepped, by name.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    Newmark(NewmarkBeta),
    Central,
    Chang,
    Alpha(AlphaWeights),
    AlphaAtState(AlphaWeights),
    Family(f64),
}

const DIRECT: [Way; 5] = [
    Way::Newmark(NewmarkBeta::Average),
    Way::Newmark(NewmarkBeta::Linear),
    Way::Newmark(NewmarkBeta::Explicit),
    Way::Central,
    Way::Chang,
];

impl Way {
    fn stepper(self, structure: &Structure, dt: f64) -> Stepper {
        let m = structure.mass();
        let (c, k) = (
            structure.reference_damping(),
            structure.reference_stiffness(),
        );
        let newton = NewtonSettings::default();
        let offline = |method: Box<dyn Offline>| Stepper::Offline(method);
        let explicit = |method: Box<dyn Integrator>| Stepper::Explicit(method);
        match self {
            Way::Newmark(member) => offline(Box::new(
                Newmark::new(m, &c, &k, dt, member, newton).unwrap(),
            )),
            Way::Central => offline(Box::new(
                CentralDifference::new(m, &c, &k, dt, newton).unwrap(),
            )),
            Way::Chang => offline(Box::new(Chang2002::new(m, &c, &k, dt, newton).unwrap())),
            Way::AlphaAtState(weights) => offline(Box::new(
                KrAlphaAtState::new(m, &c, &k, dt, weights).unwrap(),
            )),
            Way::Alpha(weights) => {
                explicit(Box::new(KrAlpha::new(m, &c, &k, dt, weights).unwrap()))
            }
            Way::Family(lambda) => {
                let lambda = Lambda::new(lambda).unwrap();
                explicit(Box::new(
                    Gui::new(m, &c, &k, dt, lambda, Start::Published).unwrap(),
                ))
            }
        }
    }
}

/// x, v and M a of every step.
struct Course {
    disp: Vec<Vec<f64>>,
    vel: Vec<Vec<f64>>,
    inertia: Vec<Vec<f64>>,
}

/// Runs `steps` steps of a structure under F(t) = `load`(t, out).
fn course(
    way: Way,
    structure: &mut Structure,
    (dt, steps): (f64, usize),
    mut state: State,
    load: impl Fn(f64, &mut [f64]),
) -> Course {
    let n = structure.dofs();
    let mut found = Course {
        disp: Vec::new(),
        vel: Vec::new(),
        inertia: Vec::new(),
    };
    let mut stepper = way.stepper(structure, dt);
    let at = |step: u64, out: &mut [f64]| {
        load(step as f64 * dt, out);
        Base::default()
    };
    let mut inertia = vec![0.0; n];
    let mut forces = Loaded::new(structure, at);
    forces.residual_into(Moment::at(0), &state.disp, &state.vel, 0.0, &mut inertia);
    forces.commit();
    match &mut stepper {
        Stepper::Offline(method) => {
            method.begin(&state, &inertia);
            for step in 0..=steps {
                found.disp.push(state.disp.to_vec());
                found.vel.push(state.vel.to_vec());
                found.inertia.push(inertia.clone());
                method
                    .step(step as u64 + 1, &mut state, &mut forces, &mut inertia)
                    .unwrap();
            }
        }
        Stepper::Explicit(method) => {
            method.prepare(&mut state);
            let mut reported = vec![0.0; n];
            for step in 0..=steps {
                found.disp.push(state.disp.to_vec());
                found.inertia.push(inertia.clone());
                method.advance(&mut state, &inertia, &mut reported);
                found.vel.push(reported.clone());
                let next = Moment::at(step as u64 + 1);
                forces.residual_into(next, &state.disp, &state.vel, dt, &mut inertia);
                forces.commit();
            }
        }
    }
    found
}

/// m = 1, ω = 3, ξ = 0.05.
const OMEGA: f64 = 3.0;
const XI: f64 = 0.05;

fn oscillator() -> Structure {
    linear(scalar(1.0), scalar(2.0 * XI * OMEGA), scalar(OMEGA * OMEGA))
}

fn linear(mass: SymMatrix, damping: SymMatrix, stiffness: SymMatrix) -> Structure {
    let ones = vec![1.0; mass.n()];
    Structure::new(mass, damping, stiffness, ones, Vec::new()).unwrap()
}

/// From rest under F = sin t with m = 1: x(t), v(t).
fn exact(t: f64) -> (f64, f64) {
    let (k, c) = (OMEGA * OMEGA, 2.0 * XI * OMEGA);
    let below = (k - 1.0) * (k - 1.0) + c * c;
    let (p, q) = ((k - 1.0) / below, -c / below);
    let (decay, swing) = (XI * OMEGA, OMEGA * (1.0 - XI * XI).sqrt());
    // x = p sin t + q cos t + e^{−decay t} (a cos + b sin), from rest.
    let a = -q;
    let b = (decay * a - p) / swing;
    let (cos, sin) = (libm::cos(swing * t), libm::sin(swing * t));
    let free = libm::exp(-decay * t);
    let x = p * libm::sin(t) + q * libm::cos(t) + free * (a * cos + b * sin);
    let v = p * libm::cos(t) - q * libm::sin(t)
        + free * ((b * swing - decay * a) * cos - (a * swing + decay * b) * sin);
    (x, v)
}

/// log₂ of the error ratios of x and v between Δt and Δt/2, at t = 10.
fn slopes(way: Way) -> (f64, f64) {
    let errors = |steps: usize| {
        let dt = 10.0 / steps as f64;
        let load = |t: f64, out: &mut [f64]| out[0] = libm::sin(t);
        let found = course(way, &mut oscillator(), (dt, steps), State::at_rest(1), load);
        let largest = |of: fn(&Course, usize) -> f64, exact: fn(f64) -> f64| {
            (0..=steps)
                .map(|i| (of(&found, i) - exact(i as f64 * dt)).abs())
                .fold(0.0, f64::max)
        };
        (
            largest(|c, i| c.disp[i][0], |t| exact(t).0),
            largest(|c, i| c.vel[i][0], |t| exact(t).1),
        )
    };
    let (coarse, fine) = (errors(800), errors(1600));
    (libm::log2(coarse.0 / fine.0), libm::log2(coarse.1 / fine.1))
}

#[test]
fn every_method_has_the_order_it_claims() {
    for way in DIRECT {
        let (disp, vel) = slopes(way);
        assert!(
            (disp - 2.0).abs() < 0.05 && (vel - 2.0).abs() < 0.05,
            "{way:?}: {disp} {vel}"
        );
    }
    for rho in [0.0, 0.5, 0.8, 1.0] {
        for weights in [
            AlphaWeights::kr(rho).unwrap(),
            AlphaWeights::mkr(rho).unwrap(),
        ] {
            for way in [Way::Alpha(weights), Way::AlphaAtState(weights)] {
                // From zero acceleration displacements are of second order, as those of the family are; the velocity
                // belongs to an instant between the steps.
                let (disp, vel) = slopes(way);
                assert!((disp - 2.0).abs() < 0.1, "{way:?}: {disp}");
                assert!(vel > 0.9, "{way:?}: {vel}");
            }
        }
    }
}

#[test]
fn linear_free_vibration_obeys_the_recursion_of_the_family() {
    // A1 x[i+2] + A2 x[i+1] + A3 x[i] = 0, equation (27), with λ = 4, 6, ∞, ∞ and 4.
    for (way, lambda) in DIRECT
        .into_iter()
        .zip([4.0, 6.0, f64::INFINITY, f64::INFINITY, 4.0])
    {
        for omega in [0.3, 1.5] {
            let dt = omega / OMEGA;
            let state = State::new(vec![1.0], vec![-2.0]);
            let found = course(way, &mut oscillator(), (dt, 50), state, |_, f| f[0] = 0.0);
            let added = omega * omega / lambda;
            let a = [
                1.0 + omega * XI + added,
                omega * omega - 2.0 * added - 2.0,
                1.0 - omega * XI + added,
            ];
            for x in found.disp.windows(3) {
                let sum = a[0] * x[2][0] + a[1] * x[1][0] + a[2] * x[0][0];
                // Convergence to 1e-10 of the response, a few steps deep.
                assert!(sum.abs() < 1e-9, "{way:?}, Ω = {omega}: {sum}");
            }
        }
    }
}

fn frame() -> Structure {
    linear(
        SymMatrix::diagonal(&[2.0, 1.5, 1.0]),
        storeys(&[3.0, 2.0, 1.0]),
        storeys(&[900.0, 700.0, 400.0]),
    )
}

fn shake(t: f64, out: &mut [f64]) {
    for (i, f) in out.iter_mut().enumerate() {
        *f = (i + 1) as f64 * libm::sin(5.0 * t);
    }
}

fn distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let all = a.iter().flatten().zip(b.iter().flatten());
    all.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn methods_reduce_to_each_other_where_they_should() {
    let run = |way| course(way, &mut frame(), (0.05, 400), State::at_rest(3), shake);
    let size = distance(&run(Way::Family(4.0)).disp, &vec![vec![0.0; 3]; 401]);
    let kr = |rho| AlphaWeights::kr(rho).unwrap();
    let mkr = |rho| AlphaWeights::mkr(rho).unwrap();
    for (one, other) in [
        (Way::Alpha(kr(1.0)), Way::Family(4.0)),
        (Way::Alpha(mkr(1.0)), Way::Family(2.0)),
        (Way::AlphaAtState(kr(0.6)), Way::Alpha(kr(0.6))),
        (Way::AlphaAtState(mkr(0.0)), Way::Alpha(mkr(0.0))),
        (
            Way::Newmark(NewmarkBeta::Explicit),
            Way::Family(f64::INFINITY),
        ),
        (Way::Central, Way::Newmark(NewmarkBeta::Explicit)),
    ] {
        let apart = distance(&run(one).disp, &run(other).disp);
        // Roundoff of 400 steps; Newton ends within 1e-10 of the response.
        assert!(
            apart < 1e-8 * size,
            "{one:?} and {other:?}: {apart} of {size}"
        );
    }
    // The printed form, with α1 and α3 as dense matrices, against the one solve.
    let weights = kr(0.6);
    let dense = printed(weights, &frame(), 0.05, 400);
    let apart = distance(&run(Way::Alpha(weights)).disp, &dense);
    assert!(apart < 1e-11 * size, "{apart}");
}

/// KR-α as printed, with inverses.
fn printed(weights: AlphaWeights, frame: &Structure, dt: f64, steps: usize) -> Vec<Vec<f64>> {
    use nalgebra::{DMatrix, DVector};
    let (m, c, k) = (
        frame.mass().to_dense(),
        frame.damping().to_dense(),
        frame.stiffness().to_dense(),
    );
    let AlphaWeights {
        alpha_m,
        alpha_f,
        gamma,
        beta,
    } = weights;
    let inverse = (&m + &c * (gamma * dt) + &k * (beta * dt * dt))
        .try_inverse()
        .unwrap();
    let alpha_1 = &inverse * &m;
    let alpha_3 =
        &inverse * (&m * alpha_m + &c * (alpha_f * gamma * dt) + &k * (alpha_f * beta * dt * dt));
    let rest = (&m * (DMatrix::identity(3, 3) - &alpha_3))
        .try_inverse()
        .unwrap();
    let force = |step: usize| {
        let mut f = [0.0; 3];
        shake(step as f64 * dt, &mut f);
        DVector::from_row_slice(&f)
    };
    let (mut x, mut v) = (DVector::zeros(3), DVector::zeros(3));
    let mut r = force(0) - &c * &v - &k * &x;
    let mut a = m.clone().try_inverse().unwrap() * &r;
    let mut disps = Vec::new();
    for step in 0..=steps {
        disps.push(x.as_slice().to_vec());
        let gained = &alpha_1 * &a;
        x += &v * dt + &gained * ((0.5 + gamma) * dt * dt);
        v += gained * dt;
        let next = force(step + 1) - &c * &v - &k * &x;
        a = &rest * (&next * (1.0 - alpha_f) + &r * alpha_f - &m * (&alpha_3 * &a));
        r = next;
    }
    disps
}

fn element(name: &str, from: End, to: End, law: Box<dyn Law>) -> Element {
    Element {
        name: name.to_owned(),
        from,
        to,
        law,
        reach: Reach::default(),
        hardening_ratio: None,
        damping_ratio: None,
    }
}

/// Two masses: a cubic spring to the ground, a yielding one between them, a biviscous damper on the upper one.
fn nonlinear() -> Structure {
    let cubic = CubicSpec {
        stiffness_n_per_m: 200.0,
        cubic_n_per_m3: 4e5,
        reference_stiffness_n_per_m: None,
    };
    let yielding: BilinearSpec =
        toml::from_str("stiffness_n_per_m = 300.0\nyield_force_n = 2.0\npost_yield_ratio = 0.1")
            .unwrap();
    let damper = BiviscousSpec {
        damping_n_s_per_m: 4.0,
        post_yield_damping_n_s_per_m: 1.0,
        yield_velocity_m_per_s: 0.05,
    };
    Structure::new(
        SymMatrix::diagonal(&[1.0, 2.0]),
        storeys(&[0.5, 0.2]),
        SymMatrix::zeros(2),
        vec![1.0; 2],
        vec![
            element(
                "a",
                End::Ground,
                End::Dof(0),
                Box::new(cubic.build().unwrap()),
            ),
            element(
                "b",
                End::Dof(0),
                End::Dof(1),
                Box::new(yielding.build().unwrap()),
            ),
            element(
                "c",
                End::Ground,
                End::Dof(1),
                Box::new(damper.build().unwrap()),
            ),
        ],
    )
    .unwrap()
}

fn push(t: f64, out: &mut [f64]) {
    out[0] = 2.0 * libm::sin(3.0 * t);
    out[1] = 4.0 * libm::sin(7.0 * t);
}

#[test]
fn nonlinear_systems_converge_to_one_answer_and_stay_in_equilibrium() {
    let run = |way, steps: usize| {
        let dt = 2.0 / steps as f64;
        course(way, &mut nonlinear(), (dt, steps), State::at_rest(2), push)
    };
    let fine = run(Way::Newmark(NewmarkBeta::Average), 16_000);
    let sampled: Vec<_> = fine.disp.iter().step_by(40).cloned().collect();
    let size = distance(&sampled, &vec![vec![0.0; 2]; sampled.len()]);
    let drift = |x: &Vec<f64>| (x[1] - x[0]).abs();
    let most = fine.disp.iter().map(drift).fold(0.0, f64::max);
    assert!(most > 3.0 * 2.0 / 300.0, "the spring must yield: {most}");
    let kr = AlphaWeights::kr(0.8).unwrap();
    for way in DIRECT
        .into_iter()
        .chain([Way::Alpha(kr), Way::AlphaAtState(kr)])
    {
        let apart = distance(&run(way, 400).disp, &sampled);
        // Kinks of the laws cost order, and nonlinear damping costs the α methods one more; a wrong force shows at 1.
        let bound = if matches!(way, Way::Alpha(_) | Way::AlphaAtState(_)) {
            0.03
        } else {
            0.01
        };
        assert!(apart < bound * size, "{way:?}: {apart} of {size}");
    }
    // M a + R = F at every step, checked against a structure that walks the same path by itself.
    let dt = 2.0 / 400.0;
    let found = run(Way::Newmark(NewmarkBeta::Average), 400);
    let mut alone = nonlinear();
    let motion = found.disp.iter().zip(&found.vel).zip(&found.inertia);
    for (step, ((x, v), inertia)) in motion.enumerate() {
        let mut r = [0.0; 2];
        push(step as f64 * dt, &mut r);
        let since = if step == 0 { 0.0 } else { dt };
        alone.subtract_internal(x, v, Base::default(), since, &mut r);
        for (r, inertia) in r.iter().zip(inertia) {
            // Newton stops within 1e-10 of the response, times M/(β Δt²).
            assert!((r - inertia).abs() < 1e-4, "step {step}: {r} {inertia}");
        }
    }
}

#[test]
fn only_the_alpha_methods_damp_what_is_too_fast_for_the_step() {
    // Ω = 1e4: the first steps overshoot, later ones shrink by ρ a step, or not at all. The undamped ones turn by
    // π − 4/Ω a step, so that forty steps stay near a peak.
    let dt = 1e4;
    let stiff = || linear(scalar(1.0), scalar(0.0), scalar(1.0));
    let tail = |way| {
        let state = State::new(vec![1.0], vec![0.0]);
        let found = course(way, &mut stiff(), (dt, 40), state, |_, f| f[0] = 0.0);
        let largest = |range: std::ops::Range<usize>| {
            found.disp[range]
                .iter()
                .map(|x| x[0].abs())
                .fold(0.0, f64::max)
        };
        largest(36..41) / largest(6..11)
    };
    for rho in [0.3, 0.7] {
        for weights in [
            AlphaWeights::kr(rho).unwrap(),
            AlphaWeights::mkr(rho).unwrap(),
        ] {
            let shrunk = tail(Way::Alpha(weights));
            // ρ³⁰; multiple roots multiply by a polynomial of the step.
            assert!(shrunk < 100.0 * rho.powi(30), "{rho}: {shrunk}");
        }
    }
    assert!(tail(Way::Newmark(NewmarkBeta::Average)) > 0.9);
    assert!(tail(Way::Alpha(AlphaWeights::kr(1.0).unwrap())) > 0.9);
}

#[test]
fn a_massless_joint_follows_statically_where_nothing_divides_by_the_mass() {
    let joint = || {
        linear(
            SymMatrix::diagonal(&[1.0, 0.0, 2.0]),
            SymMatrix::zeros(3),
            storeys(&[40.0, 60.0, 80.0]),
        )
    };
    let load = |t: f64, f: &mut [f64]| f.copy_from_slice(&[0.0, 0.0, libm::sin(t)]);
    for way in [
        Way::Newmark(NewmarkBeta::Average),
        Way::Alpha(AlphaWeights::kr(0.7).unwrap()),
    ] {
        let found = course(way, &mut joint(), (0.02, 300), State::at_rest(3), load);
        for x in &found.disp[5..] {
            // The joint divides its neighbours' distance as 1/60 to 1/80, up to the inertia of one step.
            let expected = (60.0 * x[0] + 80.0 * x[2]) / 140.0;
            assert!((x[1] - expected).abs() < 2e-3 * 0.05, "{way:?}: {x:?}");
        }
    }
    let (m, c, k) = (
        SymMatrix::diagonal(&[1.0, 0.0]),
        SymMatrix::zeros(2),
        storeys(&[1.0, 1.0]),
    );
    let newton = NewtonSettings::default();
    for refused in [
        Newmark::new(&m, &c, &k, 0.1, NewmarkBeta::Explicit, newton).err(),
        CentralDifference::new(&m, &c, &k, 0.1, newton).err(),
        Chang2002::new(&m, &c, &k, 0.1, newton).err(),
    ] {
        let text = refused.unwrap().to_string();
        assert!(text.contains("degree of freedom 2 has no mass"), "{text}");
    }
}

#[test]
fn what_finds_no_equilibrium_says_step_residual_and_place() {
    let mut structure = nonlinear();
    let newton = NewtonSettings {
        iterations: 1,
        ..NewtonSettings::default()
    };
    let (c, k) = (
        structure.reference_damping(),
        structure.reference_stiffness(),
    );
    let mass = structure.mass().clone();
    let mut method = Newmark::new(&mass, &c, &k, 0.01, NewmarkBeta::Average, newton).unwrap();
    let mut state = State::at_rest(2);
    let mut forces = Loaded::new(&mut structure, |step, out: &mut [f64]| {
        push(step as f64 * 0.01, out);
        Base::default()
    });
    method.begin(&state, &[0.0; 2]);
    let failed = method
        .step(1, &mut state, &mut forces, &mut [0.0; 2])
        .unwrap_err();
    let StepError::NotConverged {
        step,
        iterations,
        residual,
        ..
    } = failed;
    assert_eq!((step, iterations), (1, 1));
    assert!(residual.is_finite());
    let text = failed.to_string();
    assert!(
        text.starts_with("step 1: no equilibrium in 1 iterations")
            && text.contains("degree of freedom")
    );
}

#[test]
fn parameters_outside_their_range_are_refused_with_numbers() {
    for rho in [-0.1, 1.1, f64::NAN] {
        for refused in [AlphaWeights::kr(rho), AlphaWeights::mkr(rho)] {
            let text = refused.unwrap_err().to_string();
            assert!(text.starts_with("rho_infinity is") && text.ends_with("from 0 to 1"));
        }
    }
    let one = scalar(1.0);
    for dt in [0.0, f64::NAN] {
        let refused = Chang2002::new(&one, &one, &one, dt, NewtonSettings::default());
        assert!(matches!(refused, Err(MethodError::Step { .. })));
    }
    let lax = NewtonSettings {
        tolerance: f64::NAN,
        iterations: 5,
    };
    let refused = CentralDifference::new(&one, &one, &one, 0.1, lax);
    assert!(matches!(refused, Err(MethodError::Newton { .. })));
    let refused = KrAlpha::new(
        &one,
        &SymMatrix::zeros(2),
        &one,
        0.1,
        AlphaWeights::kr(0.5).unwrap(),
    );
    assert!(matches!(refused, Err(MethodError::Sizes { .. })));
}

#[test]
fn an_alpha_step_allocates_nothing_and_does_not_depend_on_who_stepped_before() {
    let structure = frame();
    let weights = AlphaWeights::kr(0.5).unwrap();
    let make = || {
        KrAlpha::new(
            structure.mass(),
            structure.damping(),
            structure.stiffness(),
            0.01,
            weights,
        )
        .unwrap()
    };
    let (mut method, mut state) = (make(), State::at_rest(3));
    method.prepare(&mut state);
    let (r, mut reported) = ([1.0, -2.0, 0.5], [0.0; 3]);
    let counted = allocation_counter::measure(|| {
        for _ in 0..100 {
            method.advance(&mut state, &r, &mut reported);
        }
    });
    assert_eq!(counted.count_total, 0);
    // The memory is the state's: another instance goes on with the same bits.
    let mut other = make();
    let mut copy = state.clone();
    method.advance(&mut state, &r, &mut reported);
    other.advance(&mut copy, &r, &mut reported);
    assert_eq!(state, copy);
}
