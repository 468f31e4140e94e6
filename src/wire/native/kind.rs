//! The kinds of frames and their codes.

use crate::WireError;

/// The kinds of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Kind {
    /// Displacement to go to.
    Command = 1,
    /// A measurement.
    Measurement = 2,
    /// I am here.
    Heartbeat = 3,
    /// Stay where you are; commands may come again. Not a fault: the watchdog rests until then.
    Hold = 4,
    /// No command will come any more; stay where you are. Answered by goodbye.
    Retire = 5,
    /// The last frame of its sender.
    Goodbye = 6,
    /// A control message.
    Control = 16,
}

impl Kind {
    /// All kinds, in the order of their codes.
    pub const ALL: [Kind; 7] = [
        Kind::Command,
        Kind::Measurement,
        Kind::Heartbeat,
        Kind::Hold,
        Kind::Retire,
        Kind::Goodbye,
        Kind::Control,
    ];

    /// The code on the wire.
    #[must_use]
    pub(crate) const fn code(self) -> u8 {
        self as u8
    }

    /// The kind with this code.
    ///
    /// # Errors
    /// [`WireError::Code`] for an unknown code.
    pub(crate) fn from_code(code: u8) -> Result<Self, WireError> {
        let known = Self::ALL.into_iter().find(|kind| kind.code() == code);
        known.ok_or(WireError::Code {
            field: "frame kind",
            found: code.into(),
        })
    }

    /// In words.
    #[must_use]
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Kind::Command => "command",
            Kind::Measurement => "measurement",
            Kind::Heartbeat => "heartbeat",
            Kind::Hold => "hold",
            Kind::Retire => "retire",
            Kind::Goodbye => "goodbye",
            Kind::Control => "control",
        }
    }

    /// True for frames that carry vectors.
    pub(super) const fn has_axes(self) -> bool {
        matches!(self, Kind::Command | Kind::Measurement)
    }
}
