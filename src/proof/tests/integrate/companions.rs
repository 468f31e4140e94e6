//! The companion methods: order, reductions to the family, equilibrium, numerical damping, refusals.

mod linear;
mod nonlinear;
mod restored;

use super::{scalar, storeys};
use gusset_numerics::integrate::*;
use gusset_numerics::law::{BilinearSpec, BiviscousSpec, CubicSpec, Law, Reach};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::{Base, Element, End, Structure};
use gusset_quantity::assert_is;

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
        let explicit = |method: Box<dyn Integrator>| Stepper::from(method);
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
        Stepper::Explicit(Explicit {
            integrator: method, ..
        }) => {
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

fn distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let all = a.iter().flatten().zip(b.iter().flatten());
    all.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn frame() -> Structure {
    linear(
        SymMatrix::diagonal(&[2.0, 1.5, 1.0]),
        storeys(&[3.0, 2.0, 1.0]),
        storeys(&[900.0, 700.0, 400.0]),
    )
}
