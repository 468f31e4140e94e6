//! What stands behind a server, whatever the server speaks: a formula, or a specimen across another link, which makes
//! the server a gateway.
//!
//! A [`Station`] is what a server commands: every exchange passes its limits and stands in its log. Behind it is a
//! [`Rig`]. Invariants: what a limit refuses is not passed on. A trip stops its session for good, and the specimen holds at
//! the last command that it was given. The limits' history and the trip are the specimen's: they outlive the session of a
//! specimen that keeps its state ([`Latch`], [`GuardStore`]). However a test ends, the specimen receives
//! the goodbye of its protocol.

mod columns;
mod far;
mod latch;
mod law;
mod log;
mod settings;
mod station;
mod summary;

use std::net::SocketAddr;

use thiserror::Error;

pub use far::{Far, FarBuild, Whereabouts};
pub use latch::{Latch, LatchedTrip};
pub use law::{Law, Memory};
pub use log::LogSettings;
pub use settings::{ProbeSettings, TestEnd};
pub(in crate::link) use station::first_words;
pub use station::{GuardStore, Station};

use crate::catalog::ending::Cause;
use crate::port::limits::Hit;
use crate::substructure::{Command, Introduction, LinkFault, LinkStats, Measurement, Retirement};
use crate::units::compared;
use crate::wire::handshake::{Limits, Sampling};

/// Who commands a specimen, as far as the protocol tells.
#[derive(Debug, Clone)]
pub struct Visitor {
    /// From where.
    pub peer: SocketAddr,
    /// Name of the test; empty if the protocol has none.
    pub test: String,
    /// The program; empty if the protocol does not say.
    pub software: String,
    /// Commands per second: numerator and denominator.
    pub rate: Option<(u64, u64)>,
    /// The specimen must hold when no command has come for so long, s.
    pub watchdog_s: Option<f64>,
    /// When the force is to be sampled.
    pub sampling: Sampling,
    /// Number of the first command.
    pub first_sequence: u64,
    /// Where the first command will be, in the units of the axes; empty if the protocol does not say.
    pub start: Vec<f64>,
    /// The limits that it keeps, in the units of the axes; empty if the protocol has none.
    pub limits: Vec<Limits>,
}

impl Visitor {
    /// A visitor of whom only the address is known.
    #[must_use]
    pub const fn unnamed(peer: SocketAddr) -> Self {
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

/// How a gateway begins to say that the specimen behind it is lost; its controller knows it by these words.
pub(in crate::link) const LOST: &str = "the specimen is lost";

/// Why a specimen is not commanded any more. It stops its session for good, and later ones as [`Latch`] says.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Trip {
    /// A limit was passed.
    #[error("{} ({})", .0, .0.quantity.key())]
    Limit(Hit),
    /// More than the controller had announced that it would ask for, or a force at which it should long have acted.
    #[error("{} ({}, as the controller announced)", .0, .0.quantity.key())]
    Announced(Hit),
    /// A number that is none.
    #[error("axis {}: the {} is not a finite number", axis + 1, if *measured { "measurement" } else { "command" })]
    NotFinite {
        /// Axis, from 0.
        axis: usize,
        /// Whether it was measured, or commanded.
        measured: bool,
    },
    /// The first command is not where the controller had asked to begin.
    #[error("axis {}: the first command is not where the specimen was armed", .0 + 1)]
    Elsewhere(usize),
    /// The specimen says that its interlock is open.
    #[error("the interlock or emergency stop at the specimen is open")]
    Interlock,
    /// The specimen says that it cannot be trusted.
    #[error("the specimen reports a sensor or actuator at the end of its range")]
    Saturated,
    /// The specimen goes on saying that its own watchdog holds it, although commands come.
    #[error(
        "the specimen reported in {0} answers in a row that its own watchdog holds it: commands do not move it"
    )]
    Holds(u64),
    /// The specimen is gone.
    #[error("{}: {}", LOST, .0)]
    Lost(LinkFault),
}

impl Trip {
    /// Its row in the table of causes. Real-time: yes.
    #[must_use]
    pub const fn cause(self) -> Cause {
        match self {
            Self::Limit(_) | Self::Announced(_) => Cause::Limit,
            Self::NotFinite { measured: true, .. } => Cause::MeasuredNotFinite,
            Self::NotFinite { .. } => Cause::CommandNotFinite,
            Self::Elsewhere(_) => Cause::FirstCommandElsewhere,
            Self::Interlock => Cause::Interlock,
            Self::Saturated => Cause::Saturated,
            Self::Holds(_) => Cause::HoldsOn,
            Self::Lost(_) => Cause::SpecimenLost,
        }
    }

    /// As events spell it: the key of the limit, or the word of the cause.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Limit(hit) | Self::Announced(hit) => hit.quantity.key(),
            _ => self.cause().word(),
        }
    }

    /// Its number in the column `trip` of recorded rows.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::Limit(hit) => hit.quantity as u32 + 1,
            Self::Announced(hit) => hit.quantity as u32 + 101,
            Self::NotFinite { measured, .. } => 50 + measured as u32,
            Self::Elsewhere(_) => 52,
            Self::Interlock => 60,
            Self::Saturated => 61,
            Self::Holds(_) => 62,
            Self::Lost(_) => 70,
        }
    }
}

/// Asked while a specimen is waited for or moved before a test: whether that test is still wanted, and why not.
pub type Wanted<'a> = dyn FnMut() -> Result<(), TestEnd> + 'a;

/// Positions whose difference is this share of the larger are the same.
const SAME: f64 = 1e-9;

/// The first axis (from 0) on which two places are not the same.
fn apart(one: &[f64], other: &[f64]) -> Option<usize> {
    one.iter().zip(other).position(|(one, other)| {
        // Written as "is there", so that NaN is elsewhere.
        let is_there = (one - other).abs() <= SAME * one.abs().max(other.abs());
        !is_there
    })
}

/// Why a test cannot begin at `start`, if the specimen stands elsewhere. `standing` is empty if that is not known.
pub(in crate::link) fn elsewhere(standing: &[f64], start: &[f64]) -> Option<String> {
    let axis = apart(standing, start)?;
    let [stands, first] = compared(*standing.get(axis)?, *start.get(axis)?, "");
    Some(format!(
        "axis {} is at {stands}, but the first command is {first}: a test must begin at the position of the specimen",
        axis + 1
    ))
}

/// Why a test ended, and what its specimen said then, if it did.
pub(in crate::link) fn with_last_words(why: String, said: Option<String>) -> String {
    match said {
        Some(said) => format!("{why}; the specimen said: {said}"),
        None => why,
    }
}

/// Something that answers commands, for one test after another.
pub trait Rig: Send {
    /// Number of axes.
    fn axes(&self) -> usize;

    /// True if commands leave this process: then they are not to be sent in a burst, and cannot be taken back.
    fn is_remote(&self) -> bool {
        false
    }

    /// Gets ready for a controller; nothing moves. May block, within time limits of its own and for as long as the test is
    /// `wanted`.
    ///
    /// # Errors
    /// The specimen cannot take part, or need not.
    fn connect(
        &mut self,
        visitor: &Visitor,
        wanted: &mut Wanted<'_>,
    ) -> Result<Introduction, TestEnd>;

    /// From here on commands come, from this number and this place on. A formula begins anew. May block, for as long as it is
    /// `wanted`: false if it is not any more.
    ///
    /// # Errors
    /// The specimen is not ready, or gone.
    fn arm(
        &mut self,
        sequence: u64,
        start: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault>;

    /// What can be said of the specimen before the first command. Zeros if nothing.
    fn at_rest(&mut self, into: &mut Measurement) {
        into.disp.fill(0.0);
        into.force.fill(0.0);
    }

    /// Takes the place of a command, from the last committed state, and measures. `elapsed` is the test time since the
    /// last commit in s. May block for an answer, for as long as it is `wanted`: false if it is not any more, and then the answer
    /// is still owed. Real-time: yes, as far as the link is.
    ///
    /// # Errors
    /// The specimen is lost.
    fn trial(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, LinkFault>;

    /// The last command is accepted. Real-time: yes.
    ///
    /// # Errors
    /// The specimen is lost.
    fn commit(&mut self) -> Result<(), LinkFault>;

    /// What was not committed is forgotten, by what can forget.
    fn revert(&mut self);

    /// Tangent stiffness, n × n by columns, as far as it is known. Real-time: yes.
    fn tangent(&mut self, stiffness: &mut [f64]);

    /// Nothing to command for now: notices a specimen that has gone. Does not block.
    ///
    /// # Errors
    /// The specimen is lost.
    fn attend(&mut self) -> Result<(), LinkFault> {
        Ok(())
    }

    /// Its controller is held by an operator: see [`crate::substructure::Substructure::pause`].
    ///
    /// # Errors
    /// The specimen is lost.
    fn pause(&mut self) -> Result<(), LinkFault> {
        Ok(())
    }

    /// Its controller ends its test here: see [`crate::substructure::Substructure::halt`].
    ///
    /// # Errors
    /// The specimen is lost.
    fn halt(&mut self) -> Result<(), LinkFault> {
        self.pause()
    }

    /// What went over the link so far.
    fn stats(&self) -> LinkStats {
        LinkStats::default()
    }

    /// More than a fault says about why the specimen was lost.
    fn complaint(&self) -> Option<String> {
        None
    }

    /// Last words of a test. What the specimen answers to them beyond a plain goodbye, in words.
    fn end(&mut self, how: Retirement) -> Option<String>;
}
