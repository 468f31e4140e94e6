//! The specimen of a server of any protocol: computed in this process, or behind another link. With a link the server is a
//! gateway.
//!
//! A server commands a [`ServedSpecimen`]. It has a [`gusset_control::port::ReceivedPort`], and a
//! [`gusset_control::engine::ReceivedTest`]: the engine waits for the edge of a command, exchanges it, judges it and its answer, keeps
//! the rows and checks the wiring, as in a test whose targets are integrated. Here are the parts that only a server needs:
//! the speed allowance, the limits that the controller announced, the first command, the latch of trips, and the folders of tests.
//! Invariants: a refused command is not passed on. A trip stops its session for good, and the specimen holds at the last command.
//! The limits' history and the trip belong to the specimen and outlive a session. However a test ends, the specimen receives the
//! goodbye of its protocol.

mod announced_limits;
mod client_scale;
mod computed;
mod first_command;
mod guard_store;
mod guarded_specimen;
mod identity;
mod latch;
mod link_maker;
mod paced_exchange;
mod pacing;
mod path_limits;
mod predicted_exchange;
mod readiness;
mod recording;
mod served_specimen;
mod session_record;
mod session_summary;
#[cfg(not(any(test, feature = "test-doubles")))]
mod simulated_pace;
#[cfg(any(test, feature = "test-doubles"))]
pub mod simulated_pace;
mod speed_allowance;
#[cfg(test)]
mod tests;
mod whereabouts;

use std::net::SocketAddr;

use thiserror::Error;

pub use client_scale::AxesBehind;
pub(crate) use client_scale::ClientScale;
pub use computed::{Computed, Memory};
pub(crate) use first_command::words as first_words;
pub use guard_store::GuardStore;
pub use latch::Latch;
pub(crate) use link_maker::Unconnected;
pub use link_maker::{LinkBuild, LinkMaker};
pub use pacing::{MOST_PREDICTED, PaceClock, Pacing, Predicting};
pub use served_specimen::ServedSpecimen;
pub use session_record::{EndedTest, RecordSettings};
pub use whereabouts::Whereabouts;

use gusset_actuator::geometry::Fault;
use gusset_control::engine::Stop;
use gusset_control::port::Ahead;
use gusset_control::port::limits::Hit;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::units::{compared, quantity};
use gusset_wire::handshake::{Limits, Sampling};

/// From one command to the next in s, until it is known.
const USUAL_TICK_S: f64 = 0.01;

/// The controller of a specimen, as far as the protocol names it.
#[derive(Debug, Clone)]
pub struct Controller {
    /// From where.
    pub peer: SocketAddr,
    /// Name of the test; empty if the protocol has none.
    pub test: String,
    /// The program; empty if the protocol does not name it.
    pub software: String,
    /// Commands per second: numerator and denominator.
    pub rate: Option<(u64, u64)>,
    /// The specimen must hold when no command has come for so long, s.
    pub watchdog_s: Option<f64>,
    /// When the force is to be sampled.
    pub sampling: Sampling,
    /// Number of the first command.
    pub first_sequence: u64,
    /// Announced place of the first command, in the units of the axes; empty if the protocol does not announce it.
    pub start: Vec<f64>,
    /// The limits that it keeps, in the units of the axes; empty if the protocol has none.
    pub limits: Vec<Limits>,
}

impl Controller {
    /// A controller of this machine that has no name.
    #[cfg(feature = "test-doubles")]
    #[must_use]
    pub fn nobody() -> Self {
        Self::unnamed(([127, 0, 0, 1], 1).into())
    }

    /// A controller of which only the address is known.
    #[must_use]
    pub(crate) const fn unnamed(peer: SocketAddr) -> Self {
        Self {
            peer,
            test: String::new(),
            software: String::new(),
            rate: None,
            watchdog_s: None,
            sampling: Sampling::Reply,
            first_sequence: 0,
            start: Vec::new(),
            limits: Vec::new(),
        }
    }
}

/// Why a specimen is no longer commanded. It stops its session for good, and later ones as described in [`Latch`].
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Trip {
    /// A limit was passed.
    #[error("{} ({})", .0, .0.quantity.key())]
    Limit(Hit),
    /// The path to a target must exceed a limit in so few commands.
    #[error(
        "the path to the target is too fast. {hit} ({key}): set `ticks_per_step` in `serve.pace` to at least {ticks}, or let the \
         controller take smaller steps",
        key = hit.quantity.key()
    )]
    TooFast {
        /// The limit.
        hit: Hit,
        /// Commands on the path with which no limit is exceeded.
        ticks: u32,
    },
    /// More than the controller had announced that it would ask for, or a force at which it should long have acted.
    #[error("{} ({}, as the controller announced)", .0, .0.quantity.key())]
    Announced(Hit),
    /// The way to rest after a target would lead further than `predict_within_m`.
    #[error(
        "axis {}: at rest after this target it would be {} beyond it, `predict_within_m` in `serve.pace` allows {}: let the controller take \
         smaller steps, or give more `ticks_per_step`",
        .0.axis + 1, quantity(.0.way, "m"), quantity(.0.within, "m")
    )]
    FarAhead(Ahead),
    /// A number is NaN or infinite.
    #[error("{}the {} is not a finite number", of_axis(*axis), if *measured { "measurement" } else { "command" })]
    NotFinite {
        /// Axis, from 0, if it is known.
        axis: Option<usize>,
        /// Whether it was measured, or commanded.
        measured: bool,
    },
    /// The first command is not where the controller had asked to begin.
    #[error("axis {}: the first command is not where the specimen was armed", .0 + 1)]
    Elsewhere(usize),
    /// The actuators cannot have the pose that was commanded, or the strokes that were measured.
    #[error("the loading unit: {0}")]
    Geometry(Fault),
    /// The client iterates, and the specimen does not follow that trial.
    #[error("{0}")]
    Trial(TrialFault),
    /// The specimen reports an open interlock.
    #[error("the interlock or emergency stop at the specimen is open")]
    Interlock,
    /// The specimen reports a saturated sensor or actuator.
    #[error("the specimen reports a sensor or actuator at the end of its range")]
    Saturated,
    /// The specimen keeps reporting that its watchdog holds it, although commands come.
    #[error(
        "the specimen reported in {0} answers in a row that its own watchdog holds it: commands do not move it"
    )]
    Holds(u64),
    /// The specimen is lost.
    #[error("the specimen is lost: {0}")]
    Lost(LinkFault),
}

impl Trip {
    /// Its row in the table of causes. Real-time: yes.
    #[must_use]
    pub const fn cause(self) -> Cause {
        match self {
            Self::Limit(_) | Self::TooFast { .. } | Self::FarAhead(_) | Self::Announced(_) => {
                Cause::Limit
            }
            Self::NotFinite { measured: true, .. } => Cause::MeasuredNotFinite,
            Self::NotFinite { .. } => Cause::CommandNotFinite,
            Self::Elsewhere(_) => Cause::FirstCommandElsewhere,
            Self::Geometry(_) => Cause::Geometry,
            Self::Trial(_) => Cause::ClientIterates,
            Self::Interlock => Cause::Interlock,
            Self::Saturated => Cause::Saturated,
            Self::Holds(_) => Cause::HoldsOn,
            Self::Lost(_) => Cause::SpecimenLost,
        }
    }

    /// As events spell it: the key of the limit, or the word of the cause.
    #[must_use]
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Limit(hit) | Self::TooFast { hit, .. } | Self::Announced(hit) => {
                hit.quantity.key()
            }
            Self::FarAhead(_) => "predict_within_m",
            _ => self.cause().word(),
        }
    }

    /// Its number in the column `trip` of recorded rows.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::Limit(hit) | Self::TooFast { hit, .. } => hit.quantity as u32 + 1,
            Self::Announced(hit) => hit.quantity as u32 + 101,
            Self::NotFinite { measured, .. } => 50 + measured as u32,
            Self::Elsewhere(_) => 52,
            Self::Geometry(_) => 53,
            Self::Trial(_) => 54,
            Self::FarAhead(_) => 55,
            Self::Interlock => 60,
            Self::Saturated => 61,
            Self::Holds(_) => 62,
            Self::Lost(_) => 70,
        }
    }
}

impl From<Stop> for Trip {
    fn from(stop: Stop) -> Self {
        match stop {
            Stop::Limit { hit, .. } => Self::Limit(hit),
            Stop::Geometry { fault, .. } => Self::Geometry(fault),
            Stop::Interlock { .. } => Self::Interlock,
            Stop::Saturated { .. } => Self::Saturated,
            Stop::HoldsOn { answers, .. } => Self::Holds(answers),
            Stop::NotFinite { .. } => Self::NotFinite {
                axis: None,
                measured: false,
            },
            Stop::Link { fault, .. } => fault.into(),
            Stop::Stale { .. } => Self::Lost(LinkFault::Timeout),
            // No other ends an exchange of one specimen.
            _ => Self::Lost(LinkFault::Refused),
        }
    }
}

impl From<LinkFault> for Trip {
    fn from(fault: LinkFault) -> Self {
        match fault {
            // The link is there: it is the specimen that cannot be trusted.
            LinkFault::NotFinite => Self::NotFinite {
                axis: None,
                measured: true,
            },
            fault => Self::Lost(fault),
        }
    }
}

/// The beginning of a message about an axis, if it is known.
fn of_axis(axis: Option<usize>) -> String {
    axis.map_or_else(String::new, |axis| format!("axis {}: ", axis + 1))
}

/// A trial of an iterating client that a specimen does not follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialFault {
    /// The displacement that is farthest from the first target of the step, from 0.
    pub signal: usize,
    /// That distance, in m or rad at the client's scale.
    pub distance: f64,
    /// The distance that the file allows, if it allows any.
    pub within: Option<f64>,
}

impl std::fmt::Display for TrialFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let distance = quantity(self.distance, "m");
        let signal = self.signal + 1;
        write!(
            f,
            "the client iterates: displacement {signal} of a new trial is {distance} from the first one of this step, "
        )?;
        match self.within {
            Some(within) => write!(
                f,
                "and `iterates_within_m` allows {}",
                quantity(within, "m")
            )?,
            None => f.write_str("and a physical specimen follows one target in each step")?,
        }
        f.write_str(
            ". In OpenSees use algorithm Linear with NewmarkExplicit, HHTExplicit, KRAlphaExplicit or AlphaOS, or set \
             `iterates_within_m` in [serve.openfresco]",
        )
    }
}

/// Why a test is over, or does not begin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TestEnd {
    /// The row of the table of causes.
    pub cause: Cause,
    /// In words.
    pub text: String,
    /// Nothing moves any more, not even back from a wiring check.
    pub is_at_once: bool,
}

impl TestEnd {
    /// For a row of the table of causes.
    #[must_use]
    pub(crate) const fn of(cause: Cause, text: String) -> Self {
        Self {
            cause,
            text,
            is_at_once: false,
        }
    }

    /// The specimen was lost, or the test cannot be served.
    #[must_use]
    pub(crate) fn failed(text: impl ToString) -> Self {
        Self::of(Cause::Protocol, text.to_string())
    }

    /// The controller is lost without a goodbye.
    #[must_use]
    pub(crate) fn vanished(text: impl ToString) -> Self {
        Self::of(Cause::ControllerVanished, text.to_string())
    }

    /// The operator of this server ends it.
    #[must_use]
    pub(crate) fn told_to_stop() -> Self {
        Self::of(Cause::Shutdown, "the server was stopped".to_owned())
    }

    /// The operator of this server ends it for the second time.
    #[must_use]
    pub(crate) fn told_to_stop_at_once() -> Self {
        Self {
            is_at_once: true,
            ..Self::told_to_stop()
        }
    }
}

impl From<String> for TestEnd {
    fn from(text: String) -> Self {
        Self::failed(text)
    }
}

/// Largest rounding error of a converted position, in units of an axis. No sensor resolves it.
pub(crate) const ROUNDING: f64 = 1e-9;

/// Called while the server waits for a specimen or moves it before a test: whether that test is still wanted, and why
/// not.
pub type Wanted<'a> = dyn FnMut() -> Result<(), TestEnd> + 'a;

/// Positions whose difference is this share of the larger are the same.
const SAME: f64 = 1e-9;

/// The first axis (from 0) on which two places are not the same; `rounding` is the rounding error of a conversion.
fn apart(one: &[f64], other: &[f64], rounding: f64) -> Option<usize> {
    one.iter().zip(other).position(|(one, other)| {
        // Written as "is there", so that NaN is elsewhere.
        let is_there = (one - other).abs() <= (SAME * one.abs().max(other.abs())).max(rounding);
        !is_there
    })
}

/// Why a test cannot begin at `start`, if the specimen is elsewhere. `standing` is empty if that is not known.
pub(crate) fn elsewhere(standing: &[f64], start: &[f64]) -> Option<String> {
    elsewhere_by(standing, start, 0.0)
}

/// Compares places of which one was converted, with a rounding error of `rounding`.
fn elsewhere_by(standing: &[f64], start: &[f64], rounding: f64) -> Option<String> {
    let axis = apart(standing, start, rounding)?;
    let [stands, first] = compared(*standing.get(axis)?, *start.get(axis)?, "");
    Some(format!(
        "axis {} is at {stands}, but the first command is {first}: a test must begin at the position of the specimen",
        axis + 1
    ))
}

/// Why a test ended, and its specimen's final message, if any.
pub(crate) fn with_last_words(why: String, said: Option<String>) -> String {
    match said {
        Some(said) => format!("{why}; the specimen said: {said}"),
        None => why,
    }
}
