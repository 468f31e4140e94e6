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
    pub(crate) const fn from_code(code: u8) -> Result<Self, WireError> {
        Ok(match code {
            1 => Kind::Command,
            2 => Kind::Measurement,
            3 => Kind::Heartbeat,
            4 => Kind::Hold,
            5 => Kind::Retire,
            6 => Kind::Goodbye,
            16 => Kind::Control,
            _ => {
                return Err(WireError::Code {
                    field: "frame kind",
                    found: code as u64,
                });
            }
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
