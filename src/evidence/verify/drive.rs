//! The program's own methods driven over a structure, and what one step of them does.

use nalgebra::{DMatrix, Matrix2};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

use gusset_numerics::integrate::{
    Chang2002, Forces, Gui, Integrator, Lambda, Loaded, MethodError, Moment, Newmark, NewmarkBeta,
    NewtonSettings, Start, State, Stepper, Tangents,
};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::{Base, Structure};
use gusset_proof::StabilityProof;

/// A seeded stream of numbers.
pub(super) struct Random(Pcg64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    /// Uniform from `lo` to `hi`.
    pub(super) fn between(&mut self, lo: f64, hi: f64) -> f64 {
        let unit = (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        lo + (hi - lo) * unit
    }

    /// Uniform in its logarithm.
    pub(super) fn spread(&mut self, lo: f64, hi: f64) -> f64 {
        libm::exp(self.between(libm::log(lo), libm::log(hi)))
    }
}

/// A method by the paper's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Method {
    Family(f64),
    Newmark(NewmarkBeta),
    Chang,
}

impl Method {
    pub(super) fn name(self) -> String {
        match self {
            Self::Family(lambda) if lambda.is_infinite() => "λ = ∞".to_owned(),
            Self::Family(lambda) => format!("λ = {lambda}"),
            Self::Newmark(NewmarkBeta::Average) => "average acceleration".to_owned(),
            Self::Newmark(NewmarkBeta::Linear) => "linear acceleration".to_owned(),
            Self::Newmark(NewmarkBeta::Explicit) => "explicit Newmark".to_owned(),
            Self::Chang => "Chang 2002".to_owned(),
        }
    }

    /// The method for this structure, from its reference stiffness and damping.
    pub(super) fn stepper(self, structure: &Structure, dt: f64) -> Result<Stepper, MethodError> {
        let mass = structure.mass();
        let (damping, stiffness) = (
            structure.reference_damping(),
            structure.reference_stiffness(),
        );
        let newton = NewtonSettings::default();
        Ok(match self {
            Self::Family(lambda) => {
                let lambda = Lambda::new(lambda)?;
                let gui = Gui::new(mass, &damping, &stiffness, dt, lambda, Start::Published)?;
                let method: Box<dyn Integrator> = Box::new(gui);
                method.into()
            }
            Self::Newmark(member) => {
                let newmark = Newmark::new(mass, &damping, &stiffness, dt, member, newton)?;
                Stepper::Offline(Box::new(newmark))
            }
            Self::Chang => {
                let chang = Chang2002::new(mass, &damping, &stiffness, dt, newton)?;
                Stepper::Offline(Box::new(chang))
            }
        })
    }
}

/// A structure on its way, one step at a time.
pub(super) struct Walk<'a, L> {
    pub(super) state: State,
    dt: f64,
    step: u64,
    stepper: Stepper,
    forces: Loaded<'a, L>,
    residual: Vec<f64>,
    reported: Vec<f64>,
    /// False once an offline method has found no equilibrium.
    alive: bool,
}

impl<'a, L: FnMut(u64, &mut [f64]) -> Base> Walk<'a, L> {
    /// From rest. `load` writes F\[n\].
    pub(super) fn new(
        method: Method,
        structure: &'a mut Structure,
        dt: f64,
        load: L,
    ) -> Result<Self, MethodError> {
        let stepper = method.stepper(structure, dt)?;
        Ok(Self::of(stepper, structure, dt, load))
    }

    /// A drive with an existing method.
    pub(super) fn of(mut stepper: Stepper, structure: &'a mut Structure, dt: f64, load: L) -> Self {
        let n = structure.dofs();
        let mut state = State::at_rest(n);
        let mut forces = Loaded::new(structure, load);
        let mut residual = vec![0.0; n];
        forces.residual_into(Moment::at(0), &state.disp, &state.vel, 0.0, &mut residual);
        forces.commit();
        match &mut stepper {
            Stepper::Explicit(explicit) => explicit.integrator.prepare(&mut state),
            Stepper::Offline(method) => method.begin(&state, &residual),
        }
        Self {
            state,
            dt,
            step: 0,
            stepper,
            forces,
            residual,
            reported: vec![0.0; n],
            alive: true,
        }
    }

    /// One step: predict, forces, solve.
    pub(super) fn step(&mut self) {
        self.step += 1;
        match &mut self.stepper {
            Stepper::Explicit(explicit) => {
                explicit
                    .integrator
                    .advance(&mut self.state, &self.residual, &mut self.reported);
                self.forces.residual_into(
                    Moment::at(self.step),
                    &self.state.disp,
                    &self.state.vel,
                    self.dt,
                    &mut self.residual,
                );
                self.forces.commit();
            }
            Stepper::Offline(method) => {
                let made = method.step(
                    self.step,
                    &mut self.state,
                    &mut self.forces,
                    &mut self.residual,
                );
                self.alive &= made.is_ok();
            }
        }
        if !self.alive {
            self.state.disp.fill(f64::NAN);
        }
    }
}

/// Displacement histories of all DOFs from rest, every `every`-th step; NaN once a method has failed.
pub(super) fn histories(
    stepper: Stepper,
    structure: &mut Structure,
    (dt, steps, every): (f64, usize, usize),
    load: impl Fn(f64, &mut [f64]),
) -> Vec<Vec<f64>> {
    let n = structure.dofs();
    let mut found = vec![Vec::with_capacity(steps / every + 1); n];
    let at = |step: u64, out: &mut [f64]| {
        load(step as f64 * dt, out);
        Base::default()
    };
    let mut walk = Walk::of(stepper, structure, dt, at);
    for step in 0..=steps {
        if step % every == 0 {
            for (history, x) in found.iter_mut().zip(&walk.state.disp) {
                history.push(*x);
            }
        }
        if step < steps {
            walk.step();
        }
    }
    found
}

/// Largest absolute value; infinite if one is not a number.
pub(super) fn peak(values: &[f64]) -> f64 {
    let larger = |peak: f64, value: &f64| {
        if value.is_nan() {
            f64::INFINITY
        } else {
            peak.max(value.abs())
        }
    };
    values.iter().fold(0.0, larger)
}

/// The family for one mass in kg with its dashpot and its spring.
pub(super) fn oscillator(
    (mass, damping, stiffness): (f64, f64, f64),
    dt: f64,
    lambda: f64,
    start: Start,
) -> Option<Gui> {
    let scalar = |value| SymMatrix::diagonal(&[value]);
    let (mass, damping, stiffness) = (scalar(mass), scalar(damping), scalar(stiffness));
    let lambda = Lambda::new(lambda).ok()?;
    Gui::new(&mass, &damping, &stiffness, dt, lambda, start).ok()
}

/// Forces on one mass: `force` of the number of the step, less those of dashpot and spring.
pub(super) struct Alone<F> {
    pub(super) damping: f64,
    pub(super) stiffness: f64,
    pub(super) force: F,
}

impl<F: Fn(f64) -> f64> Forces for Alone<F> {
    fn residual_into(&mut self, at: Moment, x: &[f64], v: &[f64], _: f64, residual: &mut [f64]) {
        let force = (self.force)(at.step as f64 - at.back);
        for ((r, x), v) in residual.iter_mut().zip(x).zip(v) {
            *r = force - self.damping * v - self.stiffness * x;
        }
    }

    fn tangents(&self) -> Tangents {
        Tangents {
            stiffness: SymMatrix::diagonal(&[self.stiffness]),
            damping: SymMatrix::diagonal(&[self.damping]),
        }
    }

    fn commit(&mut self) {}
}

/// What `advance` of the family does to the states (x, Δt v) of one degree of freedom whose α was made with c0, k0 and
/// whose forces have c, k; m = 1.
pub(super) fn transition(
    (c0, k0): (f64, f64),
    (c, k): (f64, f64),
    dt: f64,
    lambda: f64,
) -> Option<Matrix2<f64>> {
    let scalar = |value| SymMatrix::diagonal(&[value]);
    let found = transition_of(
        &StabilityProof {
            mass: scalar(1.0),
            damping: scalar(c0),
            stiffness: scalar(k0),
            damping_bound: scalar(c),
            stiffness_bound: scalar(k),
            dt,
            late_mass: None,
            massless: Vec::new(),
        },
        lambda,
    )?;
    Some(Matrix2::from_fn(|i, j| found[(i, j)]))
}

/// What `advance` does to the states (x, Δt v) with the tangents frozen at the bounds of `proof`.
pub(super) fn transition_of(proof: &StabilityProof, lambda: f64) -> Option<DMatrix<f64>> {
    let n = proof.mass.n();
    let lambda = Lambda::new(lambda).ok()?;
    let mut gui = Gui::new(
        &proof.mass,
        &proof.damping,
        &proof.stiffness,
        proof.dt,
        lambda,
        Start::Published,
    )
    .ok()?;
    let mut step = DMatrix::zeros(2 * n, 2 * n);
    let (mut r, mut reported) = (vec![0.0; n], vec![0.0; n]);
    for j in 0..2 * n {
        let mut state = State::at_rest(n);
        if j < n {
            state.disp[j] = 1.0;
        } else {
            state.vel[j - n] = 1.0 / proof.dt;
        }
        r.fill(0.0);
        proof.stiffness_bound.subtract_product(&state.disp, &mut r);
        proof.damping_bound.subtract_product(&state.vel, &mut r);
        gui.advance(&mut state, &r, &mut reported);
        for i in 0..n {
            step[(i, j)] = state.disp[i];
            step[(n + i, j)] = state.vel[i] * proof.dt;
        }
    }
    Some(step)
}

/// w = M_eff⁻¹ r for the residual r, by the program's step.
pub(super) fn solved(proof: &StabilityProof, lambda: f64, residual: &[f64]) -> Option<Vec<f64>> {
    let (n, lambda) = (proof.mass.n(), Lambda::new(lambda).ok()?);
    let (m, c, k) = (&proof.mass, &proof.damping, &proof.stiffness);
    let mut gui = Gui::new(m, c, k, proof.dt, lambda, Start::Published).ok()?;
    let mut state = State::at_rest(n);
    gui.advance(&mut state, residual, &mut vec![0.0; n]);
    Some(state.weighted_accel.to_vec())
}

/// Trace and determinant: minus the sum, and the product, of the poles.
pub(super) fn invariants(step: &Matrix2<f64>) -> (f64, f64) {
    (step.trace(), step.determinant())
}

/// How far both roots of z² − trace z + determinant are inside the unit circle, by Jury's conditions: negative outside.
pub(super) fn jury((trace, determinant): (f64, f64)) -> f64 {
    (1.0 + trace + determinant)
        .min(1.0 - trace + determinant)
        .min(1.0 - determinant)
}

/// Trace and determinant of a step with Ω = `omega`, ξ = `ratio` and unchanged tangents.
pub(super) fn stepped(omega: f64, ratio: f64, lambda: f64) -> (f64, f64) {
    let own = (2.0 * ratio * omega, omega * omega);
    let found = transition(own, own, 1.0, lambda);
    found.map_or((f64::NAN, f64::NAN), |step| invariants(&step))
}

/// Margin of [`jury`] of the step of [`transition`].
pub(super) fn margin(initial: (f64, f64), now: (f64, f64), dt: f64, lambda: f64) -> f64 {
    let found = transition(initial, now, dt, lambda);
    found.map_or(f64::NAN, |step| jury(invariants(&step)))
}
