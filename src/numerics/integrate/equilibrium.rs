//! Equilibrium at the end of a step by Newton's iteration: M a + R_d(v_p + θ_v a) + R_s(x_p + θ_x a) = F.
//!
//! Every companion that needs it has this form: Newmark with θ_x = β Δt², θ_v = γ Δt; methods that are explicit in the
//! displacement with θ_x = 0. The matrix M + θ_v C_t + θ_x K_t is factored again only when the tangents have changed.
//! If the iteration with current tangents does not converge (a law that softens below zero, a cycle between two
//! branches) the second half of the iterations uses the initial ones, which approach a yielding law from one side.

use super::State;
use super::gui::check;
use super::offline::{Forces, MethodError, Moment, StepError, Tangents};
use crate::linalg::{Spd, SymMatrix};
use gusset_quantity::domain::positive;
use gusset_quantity::state;

/// Bounds of Newton's iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewtonSettings {
    /// Last increment of displacement (of velocity where the displacement is explicit) over the largest response so
    /// far at which a step counts as converged.
    pub tolerance: f64,
    /// Iterations after which it counts as failed.
    pub iterations: u32,
}

impl Default for NewtonSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            iterations: 50,
        }
    }
}

/// The iteration and its workspace.
#[derive(Debug)]
pub(super) struct Equilibrium {
    /// Δt in s.
    pub(super) dt: f64,
    pub(super) mass: SymMatrix,
    initial: Tangents,
    /// The factor of the initial tangents, kept for when the current ones fail.
    initial_factor: Spd,
    /// The tangents whose factor is at hand, if not the initial ones.
    current: Option<(Tangents, Spd)>,
    disp_share: f64,
    vel_share: f64,
    settings: NewtonSettings,
    /// Largest response so far, in m or m/s.
    largest: f64,
    residual: Vec<f64>,
    inertia: Vec<f64>,
}

// The factor at hand follows from the tangents of the moment.
state! {
    Equilibrium { largest }
    keeps { dt, mass, initial, initial_factor, current, disp_share, vel_share, settings, residual, inertia }
}

impl Equilibrium {
    /// Checks what all methods share. θ_x and θ_v, with the tangents of the start.
    pub(super) fn new(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        (disp_share, vel_share): (f64, f64),
        settings: NewtonSettings,
    ) -> Result<Self, MethodError> {
        check(mass, damping, stiffness, dt)?;
        for (name, found) in [
            ("newton_tolerance", settings.tolerance),
            ("newton_iterations", f64::from(settings.iterations)),
        ] {
            positive(name, found)?;
        }
        let initial = Tangents {
            stiffness: stiffness.clone(),
            damping: damping.clone(),
        };
        let matrix = effective(mass, &initial, disp_share, vel_share);
        let initial_factor = Spd::factor(&matrix).map_err(|source| MethodError::Factor {
            what: "the effective mass of the method",
            source,
        })?;
        Ok(Self {
            dt,
            mass: mass.clone(),
            initial,
            initial_factor,
            current: None,
            disp_share,
            vel_share,
            settings,
            largest: 0.0,
            residual: vec![0.0; mass.n()],
            inertia: vec![0.0; mass.n()],
        })
    }

    /// a from M a = r; zero where there is no mass.
    pub(super) fn initial_accel(&self, residual: &[f64], accel: &mut [f64]) {
        match crate::model::Acceleration::new(&self.mass) {
            Ok(mut operator) => operator.accel_into(residual, accel),
            Err(_) => accel.fill(0.0),
        }
        for a in accel.iter_mut().filter(|a| a.is_nan()) {
            *a = 0.0;
        }
    }

    /// Finds a\[`step`\]. `disp` and `vel` come in as x_p + θ_x a and v_p + θ_v a of the given `accel` and leave in
    /// equilibrium, committed; `inertia` becomes M a.
    pub(super) fn find(
        &mut self,
        step: u64,
        state: &mut State,
        accel: &mut [f64],
        forces: &mut dyn Forces,
        inertia: &mut [f64],
    ) -> Result<(), StepError> {
        let State { disp, vel, .. } = state;
        let mut change = f64::INFINITY;
        for iteration in 0..=self.settings.iterations {
            forces.residual_into(Moment::at(step), disp, vel, self.dt, &mut self.residual);
            self.inertia.fill(0.0);
            self.mass.subtract_product(accel, &mut self.inertia);
            if change <= self.settings.tolerance * self.largest {
                for (out, minus) in inertia.iter_mut().zip(&self.inertia) {
                    *out = -minus;
                }
                forces.commit();
                return Ok(());
            }
            for (r, minus) in self.residual.iter_mut().zip(&self.inertia) {
                *r += minus;
            }
            if iteration == self.settings.iterations {
                break;
            }
            let unbalanced = self.worst();
            if !unbalanced.0.is_finite() {
                return Err(self.failed(step, iteration, unbalanced));
            }
            self.solve(2 * iteration >= self.settings.iterations, forces);
            change = 0.0;
            let rows = disp.iter_mut().zip(vel.iter_mut()).zip(accel.iter_mut());
            for (((x, v), a), delta) in rows.zip(&self.residual) {
                *a += delta;
                *x += self.disp_share * delta;
                *v += self.vel_share * delta;
                let (moved, size) = if self.disp_share > 0.0 {
                    (self.disp_share * delta, *x)
                } else {
                    (self.vel_share * delta, *v)
                };
                // A NaN must not pass for converged.
                if moved.abs() > change || moved.is_nan() {
                    change = moved.abs();
                }
                self.largest = self.largest.max(size.abs());
            }
        }
        Err(self.failed(step, self.settings.iterations, self.worst()))
    }

    /// residual ← (M + θ_v C_t + θ_x K_t)⁻¹ residual.
    fn solve(&mut self, plainly: bool, forces: &dyn Forces) {
        if !plainly {
            let tangents = forces.tangents();
            if let Some((of, factor)) = &mut self.current
                && *of == tangents
            {
                return factor.solve_in_place(&mut self.residual);
            }
            if tangents != self.initial {
                let matrix = effective(&self.mass, &tangents, self.disp_share, self.vel_share);
                if let Ok(mut factor) = Spd::factor(&matrix) {
                    factor.solve_in_place(&mut self.residual);
                    self.current = Some((tangents, factor));
                    return;
                }
            }
        }
        self.initial_factor.solve_in_place(&mut self.residual);
    }

    /// The largest unbalanced force and its degree of freedom.
    fn worst(&self) -> (f64, usize) {
        let sizes = self.residual.iter().map(|r| r.abs()).enumerate();
        sizes.fold((0.0, 0), |worst, (dof, size)| {
            if size > worst.0 || size.is_nan() {
                (size, dof)
            } else {
                worst
            }
        })
    }

    fn failed(&self, step: u64, iterations: u32, (residual, dof): (f64, usize)) -> StepError {
        StepError::NotConverged {
            step,
            iterations,
            residual,
            dof,
        }
    }
}

fn effective(mass: &SymMatrix, tangents: &Tangents, disp_share: f64, vel_share: f64) -> SymMatrix {
    mass.plus(vel_share, &tangents.damping)
        .plus(disp_share, &tangents.stiffness)
}
