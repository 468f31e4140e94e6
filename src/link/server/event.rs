//! The events of a server: one line of text each, for the operator.
//!
//! Both protocols report through one type. Each kind of event has a quota, because a peer can cause it without end.

use std::net::SocketAddr;

use crate::openfresco::{End, Tally};
use gusset_wire::openfresco::Sizes;

/// An event of a server.
#[derive(Debug, Clone, PartialEq)]
pub enum ServerEvent {
    /// A client connected to a server of OpenFresco's protocols.
    Connected(SocketAddr),
    /// A client introduced itself and was welcomed.
    Hello {
        /// Address of the client.
        peer: SocketAddr,
        /// Its program.
        software: String,
        /// The name of its test.
        test: String,
    },
    /// A client of OpenFresco's protocols named the sizes of its vectors: its test may begin.
    Sizes(SocketAddr, Sizes),
    /// The server refused a client, and sent it the reason if the protocol can.
    Refused {
        /// Address of the client.
        peer: SocketAddr,
        /// The reason.
        text: String,
    },
    /// The server closed a connection while another client commands the specimen.
    TurnedAway(SocketAddr),
    /// The server closed a connection from a machine that may not command the specimen.
    NotAdmitted(SocketAddr),
    /// A datagram with this number of bytes opens no test.
    Stray(SocketAddr, usize),
    /// The client sent an action that the dialect does not know. The server does not answer it.
    UnknownAction(f64),
    /// The client sent a line of an initialisation file, which the server ignores.
    InitLine,
    /// A remark about the specimen or its log.
    Told {
        /// The remark.
        text: String,
    },
    /// Commands move the specimen from now on.
    Armed {
        /// Address of the client.
        peer: SocketAddr,
        /// The name of its test.
        test: String,
    },
    /// The specimen holds from now on, and the client receives an open interlock.
    Tripped {
        /// The command at which it happened.
        sequence: u64,
        /// The reason.
        text: String,
    },
    /// No command arrives; the specimen holds.
    Holding {
        /// The newest command.
        sequence: Option<u64>,
        /// Time since the last message of the client, s.
        silent_s: f64,
    },
    /// Commands arrive again.
    Resumed {
        /// The first of them.
        sequence: u64,
    },
    /// The test of a native client is over.
    Ended {
        /// The reason.
        text: String,
        /// Number of new commands, with those that were not passed on after a trip.
        commands: u64,
        /// Number of commands that never arrived.
        missed: u32,
        /// Number of frames that failed a check.
        corrupt: u64,
        /// The link to the specimen is lost, so its position is unknown here.
        is_lost: bool,
        /// The specimen is computed, and the next test finds it in its initial state.
        starts_anew: bool,
    },
    /// The test of a client of OpenFresco's protocols is over, or its handshake failed.
    ClientLeft(SocketAddr, End, Tally),
}

impl ServerEvent {
    /// Number of quotas. The last one is for refused bytes of strangers.
    pub(super) const KINDS: usize = 16;
    /// The quota of peers that are refused for malformed bytes.
    pub(super) const STRANGERS: usize = Self::KINDS - 1;

    /// The quota of this event. The end of a test with commands has a separate one.
    pub(super) const fn kind(&self) -> usize {
        match self {
            Self::Hello { .. } => 0,
            Self::Refused { .. } => 1,
            Self::Armed { .. } => 2,
            Self::Told { .. } => 3,
            Self::Ended { .. } => 4,
            Self::Tripped { .. } => 5,
            Self::Holding { .. } => 6,
            Self::Resumed { .. } => 7,
            Self::Connected(_) => 8,
            Self::Sizes(..) => 9,
            Self::TurnedAway(_) | Self::NotAdmitted(_) => 10,
            Self::Stray(..) => 11,
            Self::UnknownAction(_) => 12,
            Self::InitLine => 13,
            Self::ClientLeft(.., tally) if tally.commands == 0 => 14,
            Self::ClientLeft(..) => 4,
        }
    }
}

impl std::fmt::Display for ServerEvent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Connected(peer) => write!(f, "{peer} connected"),
            Self::Hello {
                peer,
                software,
                test,
            } => write!(f, "{peer}: hello of {software} for \"{test}\""),
            Self::Sizes(peer, sizes) => write_sizes(f, *peer, sizes),
            Self::Refused { peer, text } => write!(f, "{peer}: refused: {text}"),
            Self::TurnedAway(peer) => write!(f, "{peer} was turned away: a client is being served"),
            Self::NotAdmitted(peer) => write!(
                f,
                "{peer} was turned away: it is not the machine that may command the specimen"
            ),
            Self::Stray(peer, bytes) => write!(f, "{peer} sent {bytes} bytes that open no test"),
            Self::UnknownAction(code) => {
                write!(f, "action {code} is not known here and was not answered")
            }
            Self::InitLine => f.write_str("a line of an init file was received and ignored"),
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
            Self::Ended {
                text,
                commands,
                missed,
                corrupt,
                is_lost,
                starts_anew,
            } => {
                let position = position_after(*is_lost, *starts_anew);
                write!(
                    f,
                    "test over: {text}; {commands} commands, {missed} missed, {corrupt} frames corrupt; {position}"
                )
            }
            Self::ClientLeft(peer, end, tally) => write!(
                f,
                "{peer}: {end}; {} commands, {} steps committed, {} taken back, {} answers",
                tally.commands, tally.commits, tally.taken_back, tally.answers
            ),
        }
    }
}

fn write_sizes(
    f: &mut std::fmt::Formatter<'_>,
    peer: SocketAddr,
    sizes: &Sizes,
) -> std::fmt::Result {
    let [d, v, a, force, t] = sizes.ctrl().in_order();
    let [dd, dv, da, df, dt] = sizes.daq().in_order();
    write!(
        f,
        "{peer} commands {d} displacements, {v} velocities, {a} accelerations, {force} forces, {t} times; \
         wants {dd} displacements, {dv} velocities, {da} accelerations, {df} forces, {dt} times; \
         {} doubles a vector",
        sizes.data_size()
    )
}

const fn position_after(is_lost: bool, starts_anew: bool) -> &'static str {
    match (is_lost, starts_anew) {
        (true, _) => "only the server of the specimen knows its position",
        (false, true) => {
            "the specimen stays where it is until the next test, which finds it as new: it cannot resume this one \
             (`[serve] remembers`)"
        }
        (false, false) => "the specimen stays where it is",
    }
}
