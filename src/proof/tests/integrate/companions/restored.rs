//! Every method continues from a restored state with the same bits.

use super::nonlinear::nonlinear;
use super::*;
use gusset_quantity::state::{Stateful, TestState, Visit};

const DT: f64 = 0.01;

/// A structure that is stepped, and everything that the next step depends on.
struct Test {
    structure: Structure,
    stepper: Stepper,
    state: State,
    inertia: Vec<f64>,
}

fn load(step: u64, out: &mut [f64]) -> Base {
    out[0] = 3.0 * libm::sin(0.05 * step as f64);
    out[1] = 6.0 * libm::sin(0.021 * step as f64);
    Base::default()
}

impl Test {
    fn new(way: Way) -> Self {
        let mut structure = nonlinear();
        let mut stepper = way.stepper(&structure, DT);
        let mut state = State::new(vec![0.002, 0.0], vec![0.0, 0.1]);
        let mut inertia = vec![0.0; 2];
        let mut forces = Loaded::new(&mut structure, load);
        forces.residual_into(Moment::at(0), &state.disp, &state.vel, 0.0, &mut inertia);
        forces.commit();
        match &mut stepper {
            Stepper::Offline(method) => method.begin(&state, &inertia),
            Stepper::Explicit(explicit) => explicit.integrator.prepare(&mut state),
        }
        Self {
            structure,
            stepper,
            state,
            inertia,
        }
    }

    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.structure.visit_state(visit);
        self.stepper.visit_state(visit);
        self.state.visit_state(visit);
        visit.numbers(&mut self.inertia);
    }

    /// Takes the step after `step`; returns all observable values.
    fn step(&mut self, step: u64) -> Vec<u64> {
        let mut reported = vec![0.0; 2];
        let mut forces = Loaded::new(&mut self.structure, load);
        let (state, inertia) = (&mut self.state, &mut self.inertia);
        match &mut self.stepper {
            Stepper::Offline(method) => {
                method.step(step + 1, state, &mut forces, inertia).unwrap();
            }
            Stepper::Explicit(explicit) => {
                explicit.integrator.advance(state, inertia, &mut reported);
                let next = Moment::at(step + 1);
                forces.residual_into(next, &state.disp, &state.vel, DT, inertia);
                forces.commit();
            }
        }
        let seen = state.disp.iter().chain(&*state.vel).chain(&self.inertia);
        seen.chain(&reported).map(|value| value.to_bits()).collect()
    }
}

#[test]
fn restored_methods_have_equal_bits() {
    let kr = |rho| AlphaWeights::kr(rho).unwrap();
    let more = [
        Way::Alpha(kr(0.5)),
        Way::AlphaAtState(kr(0.5)),
        Way::Alpha(AlphaWeights::mkr(0.25).unwrap()),
        Way::Family(4.0),
        Way::Family(f64::INFINITY),
    ];
    for way in DIRECT.into_iter().chain(more) {
        let mut one = Test::new(way);
        for taken in [0, 1, 57, 301] {
            let mut one = Test::new(way);
            for step in 0..taken {
                one.step(step);
            }
            let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
            let mut other = Test::new(way);
            for step in 0..5 {
                other.step(step);
            }
            state.restore(|visit| other.visit_state(visit)).unwrap();
            for step in taken..taken + 150 {
                assert_eq!(one.step(step), other.step(step), "{way:?} {taken} {step}");
            }
        }
        let (first, later) = (one.step(0), one.step(1));
        assert_ne!(first, later, "{way:?}: it moves");
    }
}

/// The state of a method does not fit another method, although both have the same number of values.
#[test]
fn state_of_another_method_is_refused() {
    let mut one = Test::new(Way::Newmark(NewmarkBeta::Average));
    let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
    let mut other = Test::new(Way::Chang);
    assert!(state.restore(|visit| other.visit_state(visit)).is_err());
}
