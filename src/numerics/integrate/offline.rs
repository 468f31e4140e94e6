//! Methods that need the forces of the step they are making: the contract between them and a computed structure.
//!
//! A trial starts from the last commit and may be repeated; a step commits once, at the end. Nothing here is on the
//! real-time path, and nothing here can reach a specimen.

use std::fmt;

use thiserror::Error;

use super::{GuiError, Integrator, LambdaError, Massless, State};
use crate::linalg::{NotPositiveDefinite, SymMatrix};
use crate::model::{Base, Structure};
use gusset_quantity::domain::OutOfDomain;
use gusset_quantity::state::{Stateful, Visit};

/// A place in time: step n, moved back by a share of a step. Loads and base motion between steps are weighed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// n.
    pub step: u64,
    /// 0 at n, 1 at n − 1.
    pub back: f64,
}

impl Moment {
    /// Step n itself.
    #[must_use]
    pub const fn at(step: u64) -> Self {
        Self { step, back: 0.0 }
    }
}

/// K_t and C_t, n × n.
#[derive(Debug, Clone, PartialEq)]
pub struct Tangents {
    /// ∂R_s/∂x in N/m.
    pub stiffness: SymMatrix,
    /// ∂R_d/∂v in N s/m.
    pub damping: SymMatrix,
}

/// The forces of one instant. A method may query them any number of times.
pub trait Forces {
    /// residual ← F − R_d(v) − R_s(x) in N: a trial, `dt` seconds after the last commit. Slices have n entries.
    fn residual_into(
        &mut self,
        at: Moment,
        disp: &[f64],
        vel: &[f64],
        dt: f64,
        residual: &mut [f64],
    );

    /// Tangents at the last trial.
    fn tangents(&self) -> Tangents;

    /// Keeps the last trial.
    fn commit(&mut self);
}

/// A method for structures that are computed altogether. Its state is what it remembers from step to step besides the [`State`].
pub trait Offline: Stateful + Send + fmt::Debug {
    /// Δt in s.
    fn dt(&self) -> f64;

    /// True if a is the method's own at the end of a step, where it is not in equilibrium with the forces there.
    fn has_own_accel(&self) -> bool {
        false
    }

    /// Takes r\[0\] = F − R_d − R_s at x\[0\], v\[0\], from which a\[0\] follows.
    fn begin(&mut self, state: &State, residual: &[f64]);

    /// From step `to` − 1, which `state` holds and which is committed, to step `to`; commits it. `inertia` becomes M a
    /// there, in N, one entry per degree of freedom.
    ///
    /// # Errors
    /// [`StepError`]; the state is then unfinished.
    fn step(
        &mut self,
        to: u64,
        state: &mut State,
        forces: &mut dyn Forces,
        inertia: &mut [f64],
    ) -> Result<(), StepError>;
}

/// Why a step could not be taken.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum StepError {
    /// Newton's iteration found no equilibrium.
    #[error(
        "step {step}: no equilibrium in {iterations} iterations: {residual:e} N are unbalanced at degree of freedom {}",
        dof + 1
    )]
    NotConverged {
        /// The step that was being made.
        step: u64,
        /// Iterations made.
        iterations: u32,
        /// Largest unbalanced force, in N.
        residual: f64,
        /// Where, from 0.
        dof: usize,
    },
}

/// Reason why the method does not suit this structure.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MethodError {
    /// Step or matrices do not suit any method.
    #[error(transparent)]
    Gui(#[from] GuiError),
    /// λ is not a positive number.
    #[error(transparent)]
    Lambda(#[from] LambdaError),
    /// The spectral radius at infinite frequency, or a bound of Newton's iteration.
    #[error(transparent)]
    Parameter(#[from] OutOfDomain),
    /// A method that divides by the mass meets a degree of freedom without one.
    #[error("degree of freedom {} has no mass, and this method divides by it", dof + 1)]
    Massless {
        /// From 0.
        dof: usize,
    },
    /// A matrix that must be factored cannot be.
    #[error("{what} is {source}")]
    Factor {
        /// The matrix.
        what: &'static str,
        /// Place of the failure.
        source: NotPositiveDefinite,
    },
}

/// Refuses degrees of freedom without mass.
pub(super) fn check_mass(mass: &SymMatrix) -> Result<(), MethodError> {
    match (0..mass.n()).find(|&dof| mass.row_is_zero(dof)) {
        Some(dof) => Err(MethodError::Massless { dof }),
        None => Ok(()),
    }
}

/// One way to move a structure, and whether a specimen may hang on it.
#[derive(Debug)]
pub enum Stepper {
    /// May command a specimen.
    Explicit(Explicit),
    /// May not.
    Offline(Box<dyn Offline>),
}

impl Stateful for Stepper {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        match self {
            Self::Explicit(explicit) => visit.configured(&mut explicit.massless),
            Self::Offline(method) => method.visit_state(visit),
        }
    }
}

impl From<Box<dyn Integrator>> for Stepper {
    fn from(integrator: Box<dyn Integrator>) -> Self {
        Self::Explicit(Explicit {
            integrator,
            massless: None,
        })
    }
}

/// An explicit method, and what moves the degrees of freedom without mass.
#[derive(Debug)]
pub struct Explicit {
    /// The method.
    pub integrator: Box<dyn Integrator>,
    /// `None` where every degree of freedom has mass, or the method moves those without mass itself.
    pub massless: Option<Box<Massless>>,
}

impl Explicit {
    /// `state` at step n, whose r this is, goes to n + 1; see [`Integrator::advance`] and [`Massless::work`]. Real-time: yes, if `load`
    /// is.
    pub fn advance(
        &mut self,
        structure: &mut Structure,
        state: &mut State,
        residual: &[f64],
        reported_vel: &mut [f64],
        load: &mut dyn FnMut(u8, &mut [f64]) -> Base,
    ) {
        self.advance_masses(state, residual, reported_vel);
        if let Some(massless) = &mut self.massless {
            massless.begin(structure, state, residual, load);
            let mut budget = usize::MAX;
            massless.work(structure, state, &mut budget);
        }
    }

    /// [`Explicit::advance`] without the rows without mass: they stay until [`Massless::begin`] and [`Massless::work`]. Real-time: yes.
    pub fn advance_masses(
        &mut self,
        state: &mut State,
        residual: &[f64],
        reported_vel: &mut [f64],
    ) {
        if let Some(massless) = &mut self.massless {
            massless.before(state);
        }
        self.integrator.advance(state, residual, reported_vel);
        if let Some(massless) = &mut self.massless {
            massless.report(reported_vel);
        }
    }
}

impl From<Box<dyn Offline>> for Stepper {
    fn from(method: Box<dyn Offline>) -> Self {
        Self::Offline(method)
    }
}

/// A structure and its load as [`Forces`]. `load` writes F\[n\] over its second argument and returns the base motion of
/// step n.
pub struct Loaded<'a, L> {
    structure: &'a mut Structure,
    load: L,
    before: Vec<f64>,
}

impl<'a, L: FnMut(u64, &mut [f64]) -> Base> Loaded<'a, L> {
    /// Joins the two.
    pub fn new(structure: &'a mut Structure, load: L) -> Self {
        Self {
            structure,
            load,
            before: Vec::new(),
        }
    }
}

impl<L> fmt::Debug for Loaded<'_, L> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Loaded")
            .field("structure", &self.structure)
            .finish_non_exhaustive()
    }
}

impl<L: FnMut(u64, &mut [f64]) -> Base> Forces for Loaded<'_, L> {
    fn residual_into(
        &mut self,
        at: Moment,
        disp: &[f64],
        vel: &[f64],
        dt: f64,
        residual: &mut [f64],
    ) {
        let mut base = (self.load)(at.step, residual);
        if at.back > 0.0 {
            self.before.resize(residual.len(), 0.0);
            let old = (self.load)(at.step.saturating_sub(1), &mut self.before);
            let weigh = |new: f64, old: f64| (1.0 - at.back) * new + at.back * old;
            base = Base {
                disp: weigh(base.disp, old.disp),
                vel: weigh(base.vel, old.vel),
            };
            for (new, old) in residual.iter_mut().zip(&self.before) {
                *new = weigh(*new, *old);
            }
        }
        self.structure.subtract_trial(disp, vel, base, dt, residual);
    }

    fn tangents(&self) -> Tangents {
        Tangents {
            stiffness: self.structure.tangent_stiffness(),
            damping: self.structure.tangent_damping(),
        }
    }

    fn commit(&mut self) {
        self.structure.commit();
    }
}
