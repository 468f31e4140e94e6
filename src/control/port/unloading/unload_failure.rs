//! Why a way to zero force has ended somewhere else, in words.

/// Why a way to zero force has ended somewhere else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnloadFailure {
    /// Its load cell is at the end of its range.
    Unfelt,
    /// The force has jumped by more than its limit allows, and has not come back.
    Jumped,
    /// It moved as far as the stiffness says, and nearly all of the force is still there.
    DoesNotFollow,
    /// The force is larger than it ever was.
    Grows,
    /// The force was gone at once, in a tick that hardly moved the specimen.
    Fell,
    /// It went three times as far as the stiffness says.
    TooFar,
    /// Without a stiffness nobody knows how far it is, nor which way.
    Unknown,
    /// It was not there after so many s of wall time.
    TooLong {
        /// The time.
        seconds: u32,
    },
}

impl std::fmt::Display for UnloadFailure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Unfelt => "its load cell is out of its range, so it was not led by force",
            Self::Jumped => {
                "its force has jumped and not come back, so it was not led by force: its load cell may be broken, or the \
                 specimen"
            }
            Self::DoesNotFollow => {
                "it was sent as far as its stiffness says, and its force has not followed: its load cell or its actuator may be stuck, \
                 or it is much softer"
            }
            Self::Grows => "its force grew on the way to zero",
            Self::Fell => {
                "its force was gone at once, and not by its motion: its load cell may be dead, or the specimen broken, or it is much \
                 stiffer"
            }
            Self::TooFar => {
                "it went three times as far as its stiffness says, and there is still a force"
            }
            Self::Unknown => "without a stiffness the position of zero force is unknown",
            Self::TooLong { seconds } => {
                return write!(f, "there is still a force after {seconds} s on the way to zero");
            }
        })
    }
}
