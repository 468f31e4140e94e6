//! Time integration: the family and its companions.
//!
//! What may command a specimen is a type: an [`Integrator`] is explicit in displacement and velocity and asks for the
//! force of a step once; an [`Offline`] method needs the forces of the step that it is making, tries them as often
//! as it likes, and so can only move a structure that is computed. A [`Stepper`] is one of the two.
//!
//! | method | explicit in | may command |
//! |---|---|---|
//! | [`Gui`] | displacement and velocity | yes |
//! | [`KrAlpha`] (KR-α, MKR-α), forces weighted | displacement and velocity | yes |
//! | [`KrAlphaAtState`], forces at the weighted state | displacement and velocity | no: the command would be the weighted state |
//! | [`Newmark`] β = 0, [`CentralDifference`], [`Chang2002`] | displacement | no: the velocity needs the force of the current step |
//! | [`Newmark`] β > 0 | nothing | no: iterates |
//!
//! A method owns its workspace; the [`State`] is a value that can be cloned, kept and handed to another method.
//! Given the residual r\[n\] = F − R_d(v) − R_s(x) − Bᵀ f of step n, [`Integrator::advance`] moves the state to n + 1
//! with one solve: nothing at n + 1 is needed to command n + 1. Forces, loads and accelerations are not computed
//! here ([`crate::model`] does).

mod central_difference;
mod chang_2002;
mod equilibrium;
mod gui;
mod kr_alpha;
mod massless;
mod newmark;
mod offline;
mod peaks;

use std::fmt;
use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::linalg::Aligned;
use gusset_quantity::state;

pub use central_difference::CentralDifference;
pub use chang_2002::Chang2002;
pub use equilibrium::NewtonSettings;
pub use gui::{Gui, GuiError};
pub use kr_alpha::{AlphaWeights, KrAlpha, KrAlphaAtState};
pub use massless::{Massless, MasslessBounds};
pub use newmark::{Newmark, NewmarkBeta};
pub use offline::{
    Explicit, Forces, Loaded, MethodError, Moment, Offline, StepError, Stepper, Tangents,
};
pub use peaks::{Peaks, first_beyond};

/// Displacement and velocity of one step, and what moved them there. One entry per degree of freedom.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// x\[n\] in m.
    pub disp: Aligned,
    /// v\[n\] in m/s as the method carries it: after the first step the backward difference of `disp`.
    pub vel: Aligned,
    /// w\[n − 1\] = M_eff⁻¹ r\[n − 1\] of the last step taken, in m/s²; zeros before the first.
    pub weighted_accel: Aligned,
    /// True once a step has been taken. Another method that takes over the state does not restart it.
    pub begun: bool,
    /// Further state of the method between steps; empty for a method without it.
    pub memory: Vec<f64>,
}

// The length of the memory was fixed by [`Integrator::prepare`].
state! { State as "integration" { disp, vel, weighted_accel, begun, memory } }

impl State {
    /// The state at t = 0; both vectors have one entry per degree of freedom.
    #[must_use]
    pub fn new(disp: Vec<f64>, vel: Vec<f64>) -> Self {
        debug_assert_eq!(disp.len(), vel.len());
        Self {
            weighted_accel: Aligned::zeros(disp.len()),
            disp: disp.into(),
            vel: vel.into(),
            begun: false,
            memory: Vec::new(),
        }
    }

    /// Everything zero, for `dofs` degrees of freedom.
    #[must_use]
    pub fn at_rest(dofs: usize) -> Self {
        Self::new(vec![0.0; dofs], vec![0.0; dofs])
    }

    /// Takes over another state of the same size. Real-time: yes.
    pub fn copy_from(&mut self, other: &Self) {
        self.disp.copy_from_slice(&other.disp);
        self.vel.copy_from_slice(&other.vel);
        self.weighted_accel.copy_from_slice(&other.weighted_accel);
        self.begun = other.begun;
        self.memory.clone_from(&other.memory);
    }
}

/// Explicit in displacement and velocity: both at n + 1 follow from the residual at n alone. All that it remembers from step to
/// step is in the [`State`].
pub trait Integrator: Send + fmt::Debug {
    /// Δt in s.
    fn dt(&self) -> f64;

    /// Makes room in `state` for the method's memory, so that no step allocates.
    fn prepare(&self, state: &mut State) {
        let _ = state;
    }

    /// One solve. `residual` is r\[n\] in N. On return `state` is at n + 1 and `reported_vel`
    /// holds the velocity to report for step **n**. All slices have one entry per degree of freedom.
    /// Real-time: yes.
    fn advance(&mut self, state: &mut State, residual: &[f64], reported_vel: &mut [f64]);

    /// [`Integrator::advance`] with a residual that is made here, some rows at a time where the method can move them at once.
    /// The bits are those of `forces` for all rows and [`Integrator::advance`], and `residual` holds r\[n\] afterwards.
    /// `reported_vel` may change places with the velocities of the state. Real-time: yes.
    fn step(
        &mut self,
        state: &mut State,
        forces: &mut dyn RowForces,
        residual: &mut [f64],
        reported_vel: &mut Aligned,
    ) {
        fill_all(forces, &state.disp, &state.vel, residual);
        self.advance(state, residual, reported_vel);
    }
}

/// Rows that are made at a time where nothing moves meanwhile: their vectors stay in the nearest cache.
const NEAR: usize = 1024;

/// residual ← r of all rows. Real-time: yes, if `forces` is.
fn fill_all(forces: &mut dyn RowForces, disp: &[f64], vel: &[f64], residual: &mut [f64]) {
    let n = residual.len();
    let near = if forces.reach() < n { NEAR } else { n };
    let mut first = 0;
    while first < n {
        let rows = first..(first + near).min(n);
        first = rows.end;
        forces.fill(rows, disp, vel, residual);
    }
}

/// What makes the residual r = F − R of a step, row by row.
pub trait RowForces {
    /// Number of rows above the requested ones whose displacements are needed, too.
    fn reach(&self) -> usize;

    /// residual\[rows\] ← r of these rows; all slices are whole. In one step rows are requested in ascending order, each
    /// once; displacements of rows further above than [`RowForces::reach`] may belong to the next step already.
    /// Real-time: yes.
    fn fill(&mut self, rows: Range<usize>, disp: &[f64], vel: &[f64], residual: &mut [f64]);
}

/// How the first step is taken (Gui et al. 2014, eqs. (2), (3), against a start of second order).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// The equations as printed: displacement is of first order in Δt unless the test starts with zero
    /// acceleration.
    #[default]
    Published,
    /// The first step uses v\[0\] − (Δt/2) w\[0\]: displacement and reported velocity are of second order for linear
    /// systems.
    SecondOrder,
}

/// The parameter of the family: Newmark's γ = 1/2, β = 1/λ. λ = 4 is Chen–Ricles, ∞ explicit Newmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lambda {
    /// A positive number.
    Finite(f64),
    /// λ = ∞: K0 does not enter M_eff.
    Infinite,
}

/// A number that cannot be λ.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("lambda is {found}, but must be greater than 0 (inf is allowed)")]
pub struct LambdaError {
    /// The given value.
    pub found: f64,
}

impl Lambda {
    /// λ from a number, infinity included.
    ///
    /// # Errors
    /// [`LambdaError`] for zero, negative numbers and NaN.
    pub fn new(value: f64) -> Result<Self, LambdaError> {
        if value == f64::INFINITY {
            Ok(Lambda::Infinite)
        } else if value > 0.0 {
            Ok(Lambda::Finite(value))
        } else {
            Err(LambdaError { found: value })
        }
    }

    /// λ as a number, infinity included.
    #[must_use]
    pub fn value(self) -> f64 {
        match self {
            Lambda::Finite(value) => value,
            Lambda::Infinite => f64::INFINITY,
        }
    }

    /// 1/λ, 0 for λ = ∞.
    #[must_use]
    pub fn inverse(self) -> f64 {
        match self {
            Lambda::Finite(value) => 1.0 / value,
            Lambda::Infinite => 0.0,
        }
    }
}

impl fmt::Display for Lambda {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Lambda::Finite(value) => write!(f, "{value}"),
            Lambda::Infinite => f.write_str("inf"),
        }
    }
}
