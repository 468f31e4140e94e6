//! Chang's explicit method (J. Eng. Mech. 128:935, 2002), unconditionally stable for linear and softening systems.
//!
//! ```text
//! D = M + ½ Δt C0 + ¼ Δt² K0
//! x⁺ = x + D⁻¹ (M + ½ Δt C0) Δt v + ½ D⁻¹ M Δt² a,   v⁺ = v + ½ Δt (a + a⁺)
//! ```
//!
//! Explicit in the displacement alone: a⁺ comes from M + ½ Δt C_t, by Newton's iteration where damping is nonlinear.

use super::State;
use super::equilibrium::{Equilibrium, NewtonSettings};
use super::offline::{Forces, MethodError, Offline, StepError, check_mass};
use crate::linalg::{Spd, SymMatrix};
use gusset_quantity::state;

/// The method, ready to step.
#[derive(Debug)]
pub struct Chang2002 {
    /// M + ½ Δt C0.
    damped_mass: SymMatrix,
    /// D.
    factor: Spd,
    equilibrium: Equilibrium,
    accel: Vec<f64>,
    gained: Vec<f64>,
}

state! { Chang2002 as "chang_2002" { accel, equilibrium } keeps { damped_mass, factor, gained } }

impl Chang2002 {
    /// `damping` and `stiffness` are C0 and K0.
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
        let equilibrium = Equilibrium::new(mass, damping, stiffness, dt, (0.0, dt / 2.0), newton)?;
        let damped_mass = mass.plus(dt / 2.0, damping);
        let matrix = damped_mass.plus(dt * dt / 4.0, stiffness);
        let factor = Spd::factor(&matrix).map_err(|source| MethodError::Factor {
            what: "the effective mass M + (Δt/2) C0 + (Δt²/4) K0",
            source,
        })?;
        Ok(Self {
            damped_mass,
            factor,
            equilibrium,
            accel: vec![0.0; mass.n()],
            gained: vec![0.0; mass.n()],
        })
    }
}

impl Offline for Chang2002 {
    fn dt(&self) -> f64 {
        self.equilibrium.dt
    }

    fn begin(&mut self, _state: &State, residual: &[f64]) {
        self.equilibrium.initial_accel(residual, &mut self.accel);
    }

    fn step(
        &mut self,
        to: u64,
        state: &mut State,
        forces: &mut dyn Forces,
        inertia: &mut [f64],
    ) -> Result<(), StepError> {
        let dt = self.equilibrium.dt;
        // −D (x⁺ − x)/Δt: products subtract. `inertia` is free until the end of the step.
        self.gained.fill(0.0);
        self.damped_mass
            .subtract_product(&state.vel, &mut self.gained);
        inertia.fill(0.0);
        self.equilibrium.mass.subtract_product(&self.accel, inertia);
        for (gained, minus) in self.gained.iter_mut().zip(inertia.iter()) {
            *gained += dt / 2.0 * minus;
        }
        self.factor.solve_in_place(&mut self.gained);
        let rows = state.disp.iter_mut().zip(&mut state.vel);
        for (((x, v), a), gained) in rows.zip(&self.accel).zip(&self.gained) {
            *x -= dt * gained;
            *v += dt * a;
        }
        state.begun = true;
        let accel = &mut self.accel;
        self.equilibrium.find(to, state, accel, forces, inertia)
    }
}
