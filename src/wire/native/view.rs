//! Content of a frame: typed windows over checked bytes.
//!
//! The windows are only made by [`super::Decoder::open`], which has checked lengths and numbers; their getters
//! cannot fail and allocate nothing.

use super::layout::{NO_SEQUENCE, earlier_words};
use crate::WireError;
use crate::bytes::{Word, copy_words, same_length};
use gusset_quantity::catalog::ending;
use gusset_quantity::substructure::{Measurement, Retirement, Status};

/// From this version of the handshake on a gateway says by [`Cause::Lost`] that it lost its specimen.
pub const SAYS_LOST: u16 = 2;

/// Why a test holds, retires or ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Cause {
    /// The test ran to its end.
    Orderly = 0,
    /// A limit or a fault tripped it.
    Tripped = 1,
    /// An operator requested it.
    Operator = 2,
    /// Commands stopped coming.
    Watchdog = 3,
    /// The interlock or emergency stop opened.
    Interlock = 4,
    /// The program ends.
    Shutdown = 5,
    /// A gateway lost the specimen behind it. Understood from version [`SAYS_LOST`] of the handshake on.
    Lost = 6,
}

impl Cause {
    /// All causes, in the order of their codes.
    pub const ALL: [Cause; 7] = [
        Cause::Orderly,
        Cause::Tripped,
        Cause::Operator,
        Cause::Watchdog,
        Cause::Interlock,
        Cause::Shutdown,
        Cause::Lost,
    ];

    /// The code on the wire.
    #[must_use]
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// Why the peer that gives it leaves, in words.
    #[must_use]
    pub const fn why(self) -> &'static str {
        match self {
            Cause::Orderly => "without a reason",
            Cause::Tripped => "it tripped",
            Cause::Operator => "its operator asked for it",
            Cause::Watchdog => "its watchdog tripped",
            Cause::Interlock => "its interlock opened",
            Cause::Shutdown => "its program ends",
            Cause::Lost => "it lost its link to the specimen",
        }
    }

    /// The row of the table of causes for a test that its controller ends so.
    #[must_use]
    pub const fn ending(self) -> ending::Cause {
        match self {
            Cause::Orderly => ending::Cause::Done,
            Cause::Operator => ending::Cause::Operator,
            Cause::Shutdown => ending::Cause::Shutdown,
            // A gateway lost its own controller.
            Cause::Watchdog => ending::Cause::ControllerVanished,
            Cause::Tripped | Cause::Interlock | Cause::Lost => ending::Cause::ControllerTripped,
        }
    }

    /// The cause as a peer that speaks this version of the handshake understands it.
    #[must_use]
    pub const fn for_version(self, version: u16) -> Self {
        match self {
            Cause::Lost if version < SAYS_LOST => Cause::Tripped,
            cause => cause,
        }
    }

    /// The cause with this code.
    ///
    /// # Errors
    /// [`WireError::Code`] for an unknown code.
    pub fn from_code(code: u32) -> Result<Self, WireError> {
        let known = Self::ALL.into_iter().find(|cause| cause.code() == code);
        known.ok_or(WireError::Code {
            field: "cause",
            found: code.into(),
        })
    }
}

impl From<Retirement> for Cause {
    fn from(how: Retirement) -> Self {
        match how {
            Retirement::Orderly => Cause::Orderly,
            Retirement::Operator => Cause::Operator,
            Retirement::Tripped => Cause::Tripped,
            Retirement::Abandoned => Cause::Watchdog,
            Retirement::Shutdown => Cause::Shutdown,
        }
    }
}

/// One frame, checked.
#[derive(Debug, Clone, Copy)]
pub enum Frame<'a> {
    /// Displacement to go to.
    Command(CommandFrame<'a>),
    /// Measured displacement and force.
    Measurement(MeasurementFrame<'a>),
    /// I am here.
    Heartbeat(Heartbeat),
    /// Stay where you are.
    Hold(Notice),
    /// No command will come any more.
    Retire(Notice),
    /// The last frame of its sender.
    Goodbye(Notice),
    /// A control message, still encoded.
    Control(&'a [u8]),
}

/// A sign of life.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heartbeat {
    /// Newest command sent (controller) or in force (specimen).
    pub sequence: u64,
    /// The sender's own time in s.
    pub time: f64,
    /// Flags of the specimen; empty from a controller.
    pub status: Status,
}

/// Hold, retire, goodbye.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Notice {
    /// The last command that counts.
    pub sequence: u64,
    /// Why.
    pub cause: Cause,
}

/// A command.
#[derive(Debug, Clone, Copy)]
pub struct CommandFrame<'a> {
    /// Number of the command.
    pub sequence: u64,
    /// Test time that the displacement belongs to, in s.
    pub time: f64,
    /// Test time since the previous command, in s.
    pub dt: f64,
    pub(super) disp: &'a [Word],
    pub(super) vel: &'a [Word],
}

impl CommandFrame<'_> {
    /// Copies displacement and velocity out. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Count`] if a slice has not one entry per axis.
    pub fn read(&self, disp: &mut [f64], vel: &mut [f64]) -> Result<(), WireError> {
        // All of it or nothing.
        same_length("commanded velocity", vel.len(), self.vel.len())?;
        copy_words("commanded displacement", self.disp, disp)?;
        copy_words("commanded velocity", self.vel, vel)
    }
}

/// A measurement, and the forces of the four before it.
#[derive(Debug, Clone, Copy)]
pub struct MeasurementFrame<'a> {
    /// Newest command that was in force when this was sampled.
    pub sequence: u64,
    /// The specimen's own time of sampling in s.
    pub time: f64,
    /// Time from the arrival of the command to the sampling, in s.
    pub sampled_after: f64,
    /// Flags of the specimen.
    pub status: Status,
    /// Commands that never arrived at the specimen.
    pub missed: u32,
    pub(super) disp: &'a [Word],
    pub(super) force: &'a [Word],
    /// For each of the earlier ones, newest first, its sequence and its forces.
    pub(super) earlier: &'a [Word],
}

/// The force that belonged to an earlier command.
#[derive(Debug, Clone, Copy)]
pub struct Earlier<'a> {
    /// The command that was in force.
    pub sequence: u64,
    pub(super) force: &'a [Word],
}

impl Earlier<'_> {
    /// Copies the force out. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Count`] if the slice has not one entry per axis.
    pub fn read(&self, force: &mut [f64]) -> Result<(), WireError> {
        copy_words("earlier force", self.force, force)
    }
}

impl<'a> MeasurementFrame<'a> {
    /// Fills a measurement. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Count`] if a vector has not one entry per axis.
    pub fn read(&self, into: &mut Measurement) -> Result<(), WireError> {
        copy_words("measured displacement", self.disp, &mut into.disp)?;
        copy_words("measured force", self.force, &mut into.force)?;
        into.sequence = self.sequence;
        into.time = self.time;
        into.status = self.status;
        Ok(())
    }

    /// The earlier measurements, newest first. Real-time: yes.
    pub fn earlier(&self) -> impl Iterator<Item = Earlier<'a>> + use<'a> {
        let entries = self.earlier.chunks_exact(earlier_words(self.force.len()));
        entries.filter_map(|entry| {
            let (sequence, force) = entry.split_first()?;
            let sequence = u64::from_le_bytes(*sequence);
            (sequence != NO_SEQUENCE).then_some(Earlier { sequence, force })
        })
    }

    /// The force that was measured while `sequence` was the newest command, if this frame knows it: its own, or
    /// one of the earlier ones. This is how a lost reply costs nothing. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Count`] if the slice has not one entry per axis.
    #[cfg(test)]
    pub(crate) fn force_of(&self, sequence: u64, force: &mut [f64]) -> Result<bool, WireError> {
        if sequence == self.sequence {
            copy_words("measured force", self.force, force)?;
            return Ok(true);
        }
        match self.earlier().find(|entry| entry.sequence == sequence) {
            Some(entry) => entry.read(force).map(|()| true),
            None => Ok(false),
        }
    }
}
