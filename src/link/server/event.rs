//! What a server has to tell: one line each for whoever watches it.

use std::net::SocketAddr;

/// What a server hears and does.
#[derive(Debug, Clone, PartialEq)]
pub enum Heard {
    /// A controller introduced itself and was welcomed.
    Hello {
        /// From where.
        peer: SocketAddr,
        /// Its program.
        software: String,
        /// The name of its test.
        test: String,
    },
    /// Somebody was turned away.
    Refused {
        /// From where.
        peer: SocketAddr,
        /// Why.
        text: String,
    },
    /// Something about the specimen or its log, when a test begins.
    Told {
        /// In words.
        text: String,
    },
    /// From here on the specimen holds, and the controller is told that the interlock is open.
    Tripped {
        /// The command at which it happened.
        sequence: u64,
        /// Why.
        text: String,
    },
    /// From here on commands move the specimen.
    Armed {
        /// From where.
        peer: SocketAddr,
        /// The name of its test.
        test: String,
    },
    /// Commands stopped coming; the specimen holds.
    Holding {
        /// Newest command.
        sequence: Option<u64>,
        /// Since the last word of the controller, s.
        silent_s: f64,
    },
    /// Commands come again.
    Resumed {
        /// The first of them.
        sequence: u64,
    },
    /// What the machine refused to the data thread.
    NotGranted {
        /// What, and why.
        text: String,
    },
    /// A test is over; a specimen that is not lost stays where it is.
    Ended {
        /// Why.
        text: String,
        /// New commands, with those that a trip has kept back.
        commands: u64,
        /// Commands that never arrived.
        missed: u32,
        /// Frames that failed a check.
        corrupt: u64,
        /// Its link is gone, and with it what is known of it.
        is_lost: bool,
        /// It is computed, and the next test finds it as new.
        starts_anew: bool,
    },
}

impl std::fmt::Display for Heard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Hello {
                peer,
                software,
                test,
            } => write!(f, "{peer}: hello of {software} for \"{test}\""),
            Self::Refused { peer, text } => write!(f, "{peer}: refused: {text}"),
            Self::Told { text } => f.write_str(text),
            Self::Tripped { sequence, text } => {
                write!(
                    f,
                    "TRIPPED at command {sequence}: {text}; the specimen holds"
                )
            }
            Self::Armed { peer, test } => write!(f, "{peer}: armed for \"{test}\""),
            Self::Holding { sequence, silent_s } => {
                write!(f, "HOLDING: no command received for {silent_s:.3} s")?;
                sequence.map_or(Ok(()), |k| write!(f, ", last command {k}"))
            }
            Self::Resumed { sequence } => write!(f, "commands come again, from {sequence}"),
            Self::NotGranted { text } => write!(f, "not granted: {text}"),
            Self::Ended {
                text,
                commands,
                missed,
                corrupt,
                is_lost,
                starts_anew,
            } => {
                let stands = match (is_lost, starts_anew) {
                    (true, _) => "only the server of the specimen knows its position",
                    (false, true) => {
                        "the specimen stays where it is until the next test, which finds it as new: it cannot resume this one \
                         (`[serve] remembers`)"
                    }
                    (false, false) => "the specimen stays where it is",
                };
                write!(
                    f,
                    "test over: {text}; {commands} commands, {missed} missed, {corrupt} frames corrupt; {stands}"
                )
            }
        }
    }
}
