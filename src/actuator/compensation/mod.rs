//! Compensators: the command that brings a specimen to the target of the structure in spite of its actuator.
//!
//! One compensator per axis, in m at the specimen. Each tick [`Compensator::observe`] receives the command in force and its
//! measurement, then [`Compensator::predict`] makes the next command from the next target. Where target and measurement are of
//! the same tick, the loop takes the lead of the target first, observes it with the measurement, and regulates last. An adaptive
//! compensator has no feedback loop, so its lead is its command. Before the first target after [`Compensator::reset`] the history
//! is filled with that target, so that startup is a hold and never an extrapolation. Adaptive parameters are bounded in value and
//! in rate. No allocation after construction, no clock.
//!
//! Derivatives are taken along equally spaced targets only. Where test time is stretched, the caller requests the lead at
//! the targets of an undisturbed test and makes the commands between them ([`Compensator::lead`], [`Compensator::stands`]).
//! A feedback loop continues in every tick ([`Compensator::regulate`]). Nothing is learnt then, nor afterwards for as long
//! as measurements are remembered:
//!
//! | kind | lead | of a place at rest | learns | in each tick |
//! |---|---|---|---|---|
//! | none, polynomial, Newton, inverse | extrapolated targets | the place | – | – |
//! | model inverse | a₀ d + a₁ ḋ + … | a₀ d | – | – |
//! | ATS, AMB | the same | a₀ d | at the full pace, three differences and a filter's memory after it | – |
//! | recursive FIR | Σ θ d | Σ θ · d | at the full pace, three spacings and a filter's memory after it | – |
//! | PI with phase lead | the led target | the place | – | PI on the led target |
//!
//! When the whole chain is stable for a specimen of stiffness k_e in a structure, by kind (guide: mathematics-coupling):
//!
//! - no compensation: while the lag is below the critical delay, about 2ξ/(pω) of the governing mode;
//! - polynomial on nodes a delay apart, delay as assumed: the chain is H(θ) = 1 − (1 − e^{−iθ})^{n+1}, θ = ωτ; its added damping
//!   is not negative for θ ≤ π/3 (n = 2) and θ ≤ π/2 (n = 3), slightly negative for n = 1 and everywhere negative near 0 for n =
//!   4; above that a lightly damped higher mode is driven. On nodes a step apart the weights and the effect of noise grow as
//!   (τ/Δt)ⁿ;
//! - Newton form: as the polynomial of order 2 on nodes a step apart, for the family's own v and w;
//! - inverse: as the polynomial of order 1 on nodes a step apart; exact for a first-order lag;
//! - model inverse: while the true actuator's phase stays within the structure's damping of the model's;
//! - adaptive kinds (ATS, AMB, recursive FIR): as the model inverse with their present coefficients, which their bounds keep
//!   near the declared ones;
//! - PI with phase lead: a separate feedback loop; stable if its loop with the actuator is.

mod adaptive;
mod amb;
mod ats;
mod filter;
mod inverse;
mod least_squares;
mod model_inverse;
mod newton;
mod none;
mod pi_lead;
mod polynomial;
mod recursive_fir;
mod spec;

/// The one parameter of a compensator that knows its delay.
const DELAY: &[Parameter] = &[Parameter {
    name: "delay",
    unit: "s",
}];

#[cfg(test)]
mod tests;

use thiserror::Error;

use gusset_quantity::domain::{OutOfDomain, inside, not_negative, positive};
use gusset_quantity::state::Stateful;

pub use amb::AmbSpec;
pub use ats::AtsSpec;
pub use inverse::InverseSpec;
pub use model_inverse::ModelInverseSpec;
pub use newton::NewtonSpec;
pub use none::NoneSpec;
pub use pi_lead::PiLeadSpec;
pub use polynomial::{Nodes, PolynomialSpec};
pub use recursive_fir::RecursiveFirSpec;
pub use spec::CompensationSpec;

/// Longest history in ticks.
pub const LONGEST: usize = 8192;

/// One parameter as listed in the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name of the column's part.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
}

/// Makes commands of targets. All motions in m, m/s and m/s²; every method is on the real-time path.
pub trait Compensator: Stateful + Send + std::fmt::Debug {
    /// The command for the target `disp`, a tick after the last; `vel` and `accel` are the integrator's own: vel = ∇disp/Δt
    /// belongs to t − Δt/2, and accel = ∇vel/Δt.
    fn predict(&mut self, disp: f64, vel: f64, accel: f64) -> f64 {
        let led = self.lead(disp, vel, accel);
        self.regulate(led)
    }

    /// The target led ahead: the command of a compensator without a feedback loop. Targets are equally spaced in time.
    fn lead(&mut self, disp: f64, vel: f64, accel: f64) -> f64;

    /// The command for a target that is ahead already, in every tick of wall time.
    fn regulate(&mut self, led: f64) -> f64 {
        led
    }

    /// The lead of a target that has always been at `disp`, by the present parameters: in proportion to it.
    fn stands(&self, disp: f64) -> f64 {
        disp
    }

    /// The last target of [`Compensator::lead`] was predicted; its final value is `disp`.
    fn amend(&mut self, disp: f64) {
        let _ = disp;
    }

    /// Takes the measurement made while `command` was in force. Called before the next `predict`, once a tick. It is not called
    /// in a tick without a fresh measurement. The ticks that are missing are noticed before the next measured one. If there are
    /// too many, nothing is learnt for as long as measurements are remembered.
    fn observe(&mut self, command: f64, measured: f64) {
        let _ = (command, measured);
    }

    /// Like `observe`, but learns nothing.
    fn notice(&mut self, command: f64, measured: f64) {
        let _ = (command, measured);
    }

    /// Ticks for which a measurement that was noticed is remembered.
    fn memory(&self) -> u32 {
        0
    }

    /// Forgets the past: everything has always been at `disp`. Learnt parameters return to their start.
    fn reset(&mut self, disp: f64);

    /// Names of the values of [`Compensator::parameters`].
    fn names(&self) -> &'static [Parameter] {
        &[]
    }

    /// The parameters of the moment.
    fn parameters(&self) -> &[f64] {
        &[]
    }

    /// Bounds of each parameter; empty where nothing adapts.
    #[cfg(test)]
    fn bounds(&self) -> &[(f64, f64)] {
        &[]
    }
}

/// Errors in a compensator's description.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum CompensationError {
    /// A number outside its domain.
    #[error(transparent)]
    Parameter(#[from] OutOfDomain),
    /// A list of the wrong length.
    #[error("{name} has {found} entries, but must have {wanted}")]
    Length {
        /// Key.
        name: &'static str,
        /// Entries given.
        found: usize,
        /// Expected entries.
        wanted: usize,
    },
    /// A bound that holds nothing, or not the start.
    #[error("coefficient {index} begins at {start}, outside its bounds {lower} to {upper}")]
    Bounds {
        /// From 0.
        index: usize,
        /// Where it begins.
        start: f64,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// Nothing to begin with.
    #[error(
        "`delay_s` is missing: the delay to begin with, or the coefficients themselves (`start`)"
    )]
    NoDelay,
    /// The history of targets is too short.
    #[error("{name} asks for {ticks:.0} ticks of history, but there are at most {LONGEST}")]
    History {
        /// Key.
        name: &'static str,
        /// Ticks needed.
        ticks: f64,
    },
    /// More derivatives than the inverse of a causal model has.
    #[error(
        "{found} coefficients: the inverse of a model with more than three poles takes derivatives that no target has"
    )]
    NonCausal {
        /// How many were given.
        found: usize,
    },
}

impl CompensationError {
    /// The configuration key to point at.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Parameter(OutOfDomain { name, .. })
            | Self::Length { name, .. }
            | Self::History { name, .. } => name,
            Self::Bounds { .. } => "lower",
            Self::NoDelay => "delay_s",
            Self::NonCausal { .. } => "coefficients",
        }
    }
}

fn history(name: &'static str, ticks: f64) -> Result<usize, CompensationError> {
    if ticks <= LONGEST as f64 {
        Ok(ticks.ceil() as usize)
    } else {
        Err(CompensationError::History { name, ticks })
    }
}
