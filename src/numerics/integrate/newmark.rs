//! Newmark's family with γ = 1/2 (Newmark 1959): average acceleration, linear acceleration, and the explicit one.
//!
//! ```text
//! x⁺ = x + Δt v + Δt² [(½ − β) a + β a⁺],   v⁺ = v + ½ Δt (a + a⁺),   equilibrium at t⁺
//! ```
//!
//! Stiffness and damping may be nonlinear; equilibrium is found by Newton's iteration. With β = 0 the displacement is
//! explicit and only the damping is iterated on.

use super::State;
use super::equilibrium::{Equilibrium, NewtonSettings};
use super::offline::{Forces, MethodError, Offline, StepError, check_mass};
use crate::linalg::SymMatrix;
use gusset_quantity::state;

/// Member of the family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NewmarkBeta {
    /// β = 1/4.
    Average,
    /// β = 1/6: stable for Ω ≤ √12.
    Linear,
    /// β = 0: stable for Ω ≤ 2.
    Explicit,
}

impl NewmarkBeta {
    /// β.
    #[must_use]
    pub const fn value(self) -> f64 {
        match self {
            Self::Average => 0.25,
            Self::Linear => 1.0 / 6.0,
            Self::Explicit => 0.0,
        }
    }
}

/// One member, ready to step.
#[derive(Debug)]
pub struct Newmark {
    beta: f64,
    equilibrium: Equilibrium,
    accel: Vec<f64>,
}

state! { Newmark as "newmark" { accel, equilibrium } keeps { beta } }

impl Newmark {
    /// `damping` and `stiffness` are the tangents at the start; the method queries the current ones as it proceeds.
    ///
    /// # Errors
    /// See [`MethodError`]. The explicit member needs a mass at every degree of freedom.
    pub fn new(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        member: NewmarkBeta,
        newton: NewtonSettings,
    ) -> Result<Self, MethodError> {
        if member == NewmarkBeta::Explicit {
            check_mass(mass)?;
        }
        let beta = member.value();
        let shares = (beta * dt * dt, dt / 2.0);
        Ok(Self {
            beta,
            equilibrium: Equilibrium::new(mass, damping, stiffness, dt, shares, newton)?,
            accel: vec![0.0; mass.n()],
        })
    }
}

impl Offline for Newmark {
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
        let (dt, beta) = (self.equilibrium.dt, self.beta);
        let rows = state.disp.iter_mut().zip(&mut state.vel);
        for ((x, v), a) in rows.zip(&mut self.accel) {
            if beta > 0.0 {
                // Starts from x⁺ = x, with the a⁺ that gives it.
                let next = -(*v / dt + (0.5 - beta) * *a) / beta;
                *v += dt / 2.0 * (*a + next);
                *a = next;
            } else {
                *x += dt * *v + dt * dt / 2.0 * *a;
                *v += dt * *a;
            }
        }
        state.begun = true;
        let accel = &mut self.accel;
        self.equilibrium.find(to, state, accel, forces, inertia)
    }
}
