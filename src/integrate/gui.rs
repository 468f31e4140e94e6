//! The Gui-λ family: Gui, Wang, Jin, Chen, Zhou (2014), Development of a family of explicit algorithms for
//! structural dynamics with unconditional stability.
//!
//! With α₁ = α₂ = α, equations (2), (3) and (18), (19) become one solve with
//! M_eff = M + (Δt/2) C0 + (Δt²/λ) K0, factored once:
//!
//! ```text
//! w[n]   = M_eff⁻¹ r[n]          (= α a[n])
//! v[n+1] = v[n] + Δt w[n]
//! x[n+1] = x[n] + Δt v[n+1]
//! ```
//!
//! α and inverses are never formed, so the factor is as sparse as M + C0 + K0 and massless degrees of freedom
//! work. Whether the chosen λ is stable is not asked here but in [`super::StabilityProof`].

use thiserror::Error;

use super::apart::Correction;
use super::{Apart, Integrator, Lambda, LambdaError, Start, State};
use crate::linalg::{NotPositiveDefinite, Spd, Storage, SymMatrix};

/// Why there is no integrator.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum GuiError {
    /// Δt is not a positive number.
    #[error("the step is {found} s, but must be finite and greater than 0")]
    Step {
        /// What was given.
        found: f64,
    },
    /// λ is not a positive number.
    #[error(transparent)]
    Lambda(#[from] LambdaError),
    /// M, C0 and K0 differ in size.
    #[error(
        "mass has {mass} degrees of freedom, damping {damping} and stiffness {stiffness}, but all must agree"
    )]
    Sizes {
        /// Rows of M.
        mass: usize,
        /// Rows of C0.
        damping: usize,
        /// Rows of K0.
        stiffness: usize,
    },
    /// M_eff has a pivot that is not positive: a massless degree of freedom that nothing holds, or a wrong sign.
    #[error("the effective mass M + (Δt/2) C0 + (Δt²/λ) K0 is {0}")]
    EffectiveMass(NotPositiveDefinite),
    /// The modes with a λ of their own and the rest together have no factor.
    #[error("the modes with a lambda of their own leave no effective mass")]
    Modes,
}

/// One member of the family, ready to step.
#[derive(Debug)]
pub struct Gui {
    dt: f64,
    lambda: Lambda,
    start: Start,
    effective_mass: Spd,
    /// What modes with a λ of their own add to the factor.
    correction: Option<Correction>,
}

impl Gui {
    /// Factors M_eff. `damping` and `stiffness` are C0 and K0, specimens' estimates included.
    ///
    /// # Errors
    /// See [`GuiError`].
    pub fn new(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        lambda: Lambda,
        start: Start,
    ) -> Result<Self, GuiError> {
        Self::with_apart(mass, damping, stiffness, dt, lambda, start, None)
    }

    /// The same with a λ of their own for the elements or modes in `apart`, and `lambda` for the rest of K0.
    ///
    /// # Errors
    /// See [`GuiError`].
    pub fn with_apart(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        lambda: Lambda,
        start: Start,
        apart: Option<&Apart>,
    ) -> Result<Self, GuiError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(GuiError::Step { found: dt });
        }
        let lambda = Lambda::new(lambda.value())?;
        if mass.n() != damping.n() || mass.n() != stiffness.n() {
            return Err(GuiError::Sizes {
                mass: mass.n(),
                damping: damping.n(),
                stiffness: stiffness.n(),
            });
        }
        let factored = |matrix: &SymMatrix| Spd::factor(matrix).map_err(GuiError::EffectiveMass);
        let (effective_mass, correction) = match apart {
            Some(apart) if apart.is_of_modes() => {
                let matrix = effective_mass(mass, damping, stiffness, dt, lambda);
                let mut factor = factored(&matrix)?;
                let correction = apart.correction(&mut factor, dt, lambda);
                (factor, Some(correction.ok_or(GuiError::Modes)?))
            }
            Some(apart) => {
                let settled = mass.plus(dt * dt, apart.settled());
                let rest = apart.rest(stiffness);
                let matrix = effective_mass(&settled, damping, &rest, dt, lambda);
                (factored(&matrix)?, None)
            }
            None => {
                let matrix = effective_mass(mass, damping, stiffness, dt, lambda);
                (factored(&matrix)?, None)
            }
        };
        Ok(Self {
            dt,
            lambda,
            start,
            effective_mass,
            correction,
        })
    }

    /// λ in use.
    #[must_use]
    pub fn lambda(&self) -> Lambda {
        self.lambda
    }

    /// How M_eff is stored.
    #[must_use]
    pub fn storage(&self) -> Storage {
        self.effective_mass.storage()
    }
}

/// M_eff = M + (Δt/2) C0 + (Δt²/λ) K0; the last term is absent for λ = ∞.
pub(super) fn effective_mass(
    mass: &SymMatrix,
    damping: &SymMatrix,
    stiffness: &SymMatrix,
    dt: f64,
    lambda: Lambda,
) -> SymMatrix {
    let with_damping = mass.plus(dt / 2.0, damping);
    match lambda {
        Lambda::Finite(value) => with_damping.plus(dt * dt / value, stiffness),
        Lambda::Infinite => with_damping,
    }
}

impl Integrator for Gui {
    fn dt(&self) -> f64 {
        self.dt
    }

    /// Leaves `residual` as it was.
    fn advance(&mut self, state: &mut State, residual: &mut [f64], reported_vel: &mut [f64]) {
        let State {
            disp,
            vel,
            weighted_accel,
            begun,
            memory: _,
        } = state;
        debug_assert_eq!(residual.len(), self.effective_mass.n());
        debug_assert_eq!((disp.len(), vel.len()), (residual.len(), residual.len()));
        weighted_accel.copy_from_slice(residual);
        self.effective_mass.solve_in_place(weighted_accel);
        if let Some(correction) = &mut self.correction {
            correction.apply(weighted_accel);
        }
        let dt = self.dt;
        // Velocity reported for n: v[n] + lead · w[n]; velocity gained on the way to n + 1: gain · w[n].
        let (lead, gain) = match (self.start, *begun) {
            (Start::Published, _) => (0.0, dt),
            (Start::SecondOrder, false) => (0.0, dt / 2.0),
            (Start::SecondOrder, true) => (dt / 2.0, dt),
        };
        let rows = disp
            .iter_mut()
            .zip(vel.iter_mut())
            .zip(weighted_accel.iter());
        for (((x, v), w), reported) in rows.zip(reported_vel) {
            *reported = *v + lead * w;
            *v += gain * w;
            *x += dt * *v;
        }
        *begun = true;
    }
}
