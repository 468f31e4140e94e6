//! Central differences: x⁺ = 2 x − x⁻ + Δt² a, v = (x⁺ − x⁻)/(2 Δt), equilibrium at t.
//!
//! Since v\[n\] = (x\[n\] − x\[n−1\])/Δt + ½ Δt a\[n\], the damping of step n holds a\[n\]: solved with M + ½ Δt C_t, by Newton's
//! iteration where damping is nonlinear. x\[−1\] = x − Δt v + ½ Δt² a. Stable for Ω ≤ 2.

use super::State;
use super::equilibrium::{Equilibrium, NewtonSettings};
use super::offline::{Forces, MethodError, Offline, StepError, check_mass};
use crate::linalg::SymMatrix;
use gusset_quantity::state;

/// Central differences, ready to step.
#[derive(Debug)]
pub struct CentralDifference {
    equilibrium: Equilibrium,
    accel: Vec<f64>,
    before: Vec<f64>,
}

state! { CentralDifference as "central_difference" { accel, before, equilibrium } }

impl CentralDifference {
    /// `damping` and `stiffness` are the tangents of the start.
    ///
    /// # Errors
    /// See [`MethodError`]. Every degree of freedom needs a mass.
    pub fn new(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        newton: NewtonSettings,
    ) -> Result<Self, MethodError> {
        check_mass(mass)?;
        Ok(Self {
            equilibrium: Equilibrium::new(mass, damping, stiffness, dt, (0.0, dt / 2.0), newton)?,
            accel: vec![0.0; mass.n()],
            before: vec![0.0; mass.n()],
        })
    }
}

impl Offline for CentralDifference {
    fn dt(&self) -> f64 {
        self.equilibrium.dt
    }

    fn begin(&mut self, state: &State, residual: &[f64]) {
        self.equilibrium.initial_accel(residual, &mut self.accel);
        let dt = self.equilibrium.dt;
        let rows = state.disp.iter().zip(&state.vel).zip(&self.accel);
        for (before, ((x, v), a)) in self.before.iter_mut().zip(rows) {
            *before = x - dt * v + dt * dt / 2.0 * a;
        }
    }

    fn step(
        &mut self,
        to: u64,
        state: &mut State,
        forces: &mut dyn Forces,
        inertia: &mut [f64],
    ) -> Result<(), StepError> {
        let dt = self.equilibrium.dt;
        let rows = state.disp.iter_mut().zip(&mut state.vel);
        for (((x, v), a), before) in rows.zip(&self.accel).zip(&mut self.before) {
            let next = 2.0 * *x - *before + dt * dt * a;
            *before = *x;
            *v = (next - *x) / dt + dt / 2.0 * a;
            *x = next;
        }
        state.begun = true;
        let accel = &mut self.accel;
        self.equilibrium.find(to, state, accel, forces, inertia)
    }
}
