//! Our own control messages: both ends agree on everything before anything moves.
//!
//! ```text
//! controller                                   specimen
//!   Hello   versions, axes, units, limits,  →
//!           rate, watchdog, sampling, nonce
//!                                            ←   Welcome  what it is, k̂, where it stands, session number, nonce
//!                                                 or Refuse  why not
//!   Arm     last look: from here it moves   →
//!                                            ←   Arm      the same, repeated: armed
//!                                                 or Refuse
//!   command frames                          ⇄   measurement frames
//!   Bye                                     ⇄   Bye
//! ```
//!
//! A message is a bincode enum in the fixed-width little-endian configuration: the bytes are the fields in
//! order, packed; a text or list is its length as u64 and then its content; the variant is a u32 in front.
//! Golden-byte tests pin them, so they do not depend on the crate. The envelope (length, checksum) is the
//! control frame of [`crate::native`]. Nothing here reads more than [`LIMIT`] bytes, or allocates more
//! than that for what a message claims to hold.
//!
//! With a pre-shared key the Hello carries a proof over itself, and the Welcome one over both messages made
//! with the session key; from then on every frame is signed. A Hello can be recorded and sent again, an Arm
//! cannot (it is a frame of the new session): so a Hello, proven or not, must not disturb anything, and a
//! server counts a controller as present only when its first signed frame has come.
//!
//! Not here: sending, waiting, repeating a Hello whose answer was lost, making nonces.

mod agree;
mod codec;
mod layout;

pub use agree::{Terms, Wider, agree, check_welcome, wider};
pub use codec::{LIMIT, decode, encode, prove_hello, prove_welcome, verify_hello, verify_welcome};
pub use layout::layout_hash;

use bincode::{Decode, Encode};

use super::key::{Nonce, Proof};

/// Lowest protocol version that this program speaks.
pub(crate) const LOWEST_VERSION: u16 = 1;
/// Highest protocol version that this program speaks.
pub(crate) const HIGHEST_VERSION: u16 = crate::native::SAYS_LOST;
/// Longest name of an axis or of an end, in bytes.
pub(crate) const NAME_LIMIT: usize = 64;
/// Longest free text, in bytes.
pub const TEXT_LIMIT: usize = 256;

/// A control message. The order of the variants is the wire code and never changes.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub enum Control {
    /// First message, from the controller.
    Hello(Hello),
    /// The specimen takes part.
    Welcome(Welcome),
    /// The specimen does not take part. The connection ends.
    Refuse(Refuse),
    /// From the controller: from here on commands move the specimen. Repeated by the specimen: armed.
    Arm(Arm),
    /// Orderly end of a connection that may or may not have been armed.
    Bye(Bye),
}

impl Control {
    /// In words.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Control::Hello(_) => "hello",
            Control::Welcome(_) => "welcome",
            Control::Refuse(_) => "refuse",
            Control::Arm(_) => "arm",
            Control::Bye(_) => "bye",
        }
    }
}

/// Opening message of the controller.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Hello {
    /// Proof that the controller has the key; zeros without one. Filled by [`prove_hello`].
    pub proof: Proof,
    /// Fresh random bytes.
    pub nonce: Nonce,
    /// Hash of the axes' layout, see [`layout_hash`].
    pub layout: [u8; 32],
    /// Protocol versions that the controller speaks.
    pub versions: Versions,
    /// True if every frame is to be signed.
    pub keyed: bool,
    /// Commands per second as an exact fraction: numerator.
    pub rate_numerator: u64,
    /// Denominator of the rate.
    pub rate_denominator: u64,
    /// The specimen must hold when no command has come for this time, s.
    pub watchdog_s: f64,
    /// When the force is to be sampled.
    pub sampling: Sampling,
    /// The program and its version.
    pub software: String,
    /// Name of the test.
    pub name: String,
    /// The axes, in the order of the vectors, with the limits that the controller keeps.
    pub axes: Vec<Axis>,
}

/// The server's answer to a Hello.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Welcome {
    /// Proof that the specimen has the key; zeros without one. Filled by [`prove_welcome`].
    pub proof: Proof,
    /// Fresh random bytes.
    pub nonce: Nonce,
    /// Hash of the axes' layout, see [`layout_hash`].
    pub layout: [u8; 32],
    /// Number of the session, random, not zero: every frame carries it from now on.
    pub session: u64,
    /// The version that both speak.
    pub version: u16,
    /// True if every frame is to be signed.
    pub keyed: bool,
    /// Capabilities of the server.
    pub capabilities: Capabilities,
    /// It will hold when no command has come for this time, s.
    pub watchdog_s: f64,
    /// When it will sample the force.
    pub sampling: Sampling,
    /// Estimate k̂ of the initial stiffness, n×n, column by column, agreed force unit per displacement unit.
    /// Empty if it has none.
    pub stiffness: Vec<f64>,
    /// Its position: the command that would not move it, one entry per axis, agreed unit. Empty if it is not known.
    pub standing: Vec<f64>,
    /// The program and its version.
    pub software: String,
    /// Name of the specimen.
    pub name: String,
    /// Its axes, in the order of the vectors, with its own limits.
    pub axes: Vec<Axis>,
}

/// Why the specimen does not take part.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Refuse {
    /// The reason, for programs.
    pub code: RefuseCode,
    /// Versions that the refusing end speaks.
    pub versions: Versions,
    /// The reason, for people.
    pub text: String,
}

/// From here on commands move the specimen.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Arm {
    /// The session that is armed.
    pub session: u64,
    /// Number of the first command that will come.
    pub first_sequence: u64,
    /// Position of the first command, one entry per axis: the specimen refuses if its own differs.
    pub disp: Vec<f64>,
}

/// Orderly end.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Bye {
    /// Why, with the codes of [`crate::native::Cause`].
    pub cause: u32,
    /// For people; may be empty.
    pub text: String,
}

/// A range of protocol versions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub struct Versions {
    /// Lowest.
    pub lowest: u16,
    /// Highest.
    pub highest: u16,
}

impl Versions {
    /// The versions that this program speaks.
    pub const OURS: Versions = Versions {
        lowest: LOWEST_VERSION,
        highest: HIGHEST_VERSION,
    };
}

/// When the force that answers a command is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub enum Sampling {
    /// At once, when the command has come.
    Reply,
    /// After this fraction of the command period, above 0, at most 1.
    Fraction(f64),
}

/// One axis.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Axis {
    /// Its name, unlike all others of the specimen.
    pub name: String,
    /// Unit of displacement.
    pub disp_unit: Unit,
    /// Unit of force.
    pub force_unit: Unit,
    /// Limits, in these units. Infinite where none is set.
    pub limits: Limits,
}

/// Limits of one axis. Infinite where none is set; never NaN.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub struct Limits {
    /// Smallest displacement.
    pub disp_min: f64,
    /// Largest displacement.
    pub disp_max: f64,
    /// Largest speed.
    pub speed_max: f64,
    /// Largest absolute force.
    pub force_max: f64,
}

impl Limits {
    /// No limits: for a simulated specimen.
    pub const NONE: Limits = Limits {
        disp_min: f64::NEG_INFINITY,
        disp_max: f64::INFINITY,
        speed_max: f64::INFINITY,
        force_max: f64::INFINITY,
    };
}

/// A unit on the wire. The order is the wire code and never changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Encode, Decode)]
pub enum Unit {
    /// m
    Metre,
    /// mm
    Millimetre,
    /// rad
    Radian,
    /// N
    Newton,
    /// kN
    Kilonewton,
    /// N·m
    NewtonMetre,
    /// kN·m
    KilonewtonMetre,
}

impl Unit {
    /// Symbol of the unit in the layout text.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Unit::Metre => "m",
            Unit::Millimetre => "mm",
            Unit::Radian => "rad",
            Unit::Newton => "N",
            Unit::Kilonewton => "kN",
            Unit::NewtonMetre => "N*m",
            Unit::KilonewtonMetre => "kN*m",
        }
    }

    /// True if `disp` and `force` belong together: work is displacement times force.
    #[must_use]
    pub(crate) const fn conjugate(disp: Unit, force: Unit) -> bool {
        matches!(
            (disp, force),
            (
                Unit::Metre | Unit::Millimetre,
                Unit::Newton | Unit::Kilonewton
            ) | (Unit::Radian, Unit::NewtonMetre | Unit::KilonewtonMetre)
        )
    }
}

/// Capabilities of a server, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Encode, Decode)]
pub struct Capabilities(pub u32);

impl Capabilities {
    /// It is simulated: nothing breaks.
    pub const SIMULATED: Capabilities = Capabilities(1);
    /// It has an interlock or emergency stop and reports it.
    pub const INTERLOCK: Capabilities = Capabilities(2);
    /// Its displacement is measured and not a copy of the command.
    pub const MEASURES_DISP: Capabilities = Capabilities(4);
    /// It makes use of the commanded velocity.
    pub const USES_VEL: Capabilities = Capabilities(8);
    /// It is in the state in which an earlier test of this process left it, so that an interrupted test can be resumed. In the
    /// first test of its process no specimen has this capability. A machine does not need it: only a computation can be
    /// restarted.
    pub const KEEPS_STATE: Capabilities = Capabilities(16);

    /// True if every bit of `flag` is set.
    #[must_use]
    pub const fn has(self, flag: Capabilities) -> bool {
        self.0 & flag.0 == flag.0
    }

    /// Both.
    #[must_use]
    pub const fn and(self, other: Capabilities) -> Capabilities {
        Capabilities(self.0 | other.0)
    }
}

/// Why a specimen refuses. The order is the wire code and never changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Encode, Decode)]
pub enum RefuseCode {
    /// No version in common.
    Version,
    /// Another number of axes, or other names.
    Axes,
    /// Other units.
    Units,
    /// The layout hash differs although the axes agree: one end computes it wrongly.
    Layout,
    /// Too fast, or not a rate.
    Rate,
    /// A limit of the controller is wider than the specimen's.
    Limits,
    /// The watchdog time is outside what the specimen can keep.
    Watchdog,
    /// It cannot sample at that moment.
    Sampling,
    /// Another controller is connected.
    Busy,
    /// A key is wanted and none is used, or the other way round, or the proof is wrong.
    Key,
    /// It is not ready: interlock open, pumps off.
    NotReady,
    /// Its position differs from the first command.
    Position,
    /// The message made no sense.
    Malformed,
}

impl RefuseCode {
    /// Default reason in words, for a refusal without a text.
    #[must_use]
    pub const fn why(self) -> &'static str {
        match self {
            RefuseCode::Version => "it speaks another version of the protocol",
            RefuseCode::Axes => "it has other axes",
            RefuseCode::Units => "its units are others",
            RefuseCode::Layout => "it computes another hash of the layout",
            RefuseCode::Rate => "this command rate is too high for it, or is no rate",
            RefuseCode::Limits => "a limit of the test is wider than its own",
            RefuseCode::Watchdog => "it cannot keep the watchdog time",
            RefuseCode::Sampling => "it cannot sample at that moment",
            RefuseCode::Busy => "another controller is connected to it",
            RefuseCode::Key => "the key is missing, needless, or another one",
            RefuseCode::NotReady => "it is not ready: its interlock is open, or its pumps are off",
            RefuseCode::Position => "it stands elsewhere than the first command",
            RefuseCode::Malformed => "the message made no sense to it",
        }
    }
}

#[cfg(test)]
mod tests;
