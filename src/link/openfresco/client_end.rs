//! What an OpenFresco server has to tell: one line each for whoever watches it.

use std::net::SocketAddr;

use super::dialect::ExchangeFault;
use super::host::HostFault;
use super::tally::Tally;
use crate::catalog::ending::Cause;
use crate::link::Transport;
use crate::link::tls::TlsFault;
use crate::substructure::LinkFault;
use crate::wire::openfresco::Sizes;
/// The end of a test whose link failed.
pub(super) fn lost(link: &dyn Transport, fault: LinkFault) -> End {
    match (link.tls_fault(), fault) {
        (Some(why), _) => End::Tls(why),
        (None, LinkFault::Closed) => End::Vanished,
        (None, fault) => End::Lost(fault),
    }
}

/// How a client's test ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// With the goodbye of the protocol.
    Finished,
    /// The connection was closed without a goodbye.
    Vanished,
    /// The same when only so many bytes of a message had come.
    CutShort(usize),
    /// The connection broke.
    Lost(LinkFault),
    /// Nothing came for so long, in s.
    Silent(f64),
    /// A new client of the same machine came while this one had been silent for so long, in s.
    Replaced(f64),
    /// It connected and sent no sizes for so long, in s.
    NoSizes(f64),
    /// It had not said what it wants when more came than are greeted at a time.
    GaveWay,
    /// There was no TLS session, or it broke.
    Tls(TlsFault),
    /// It speaks TLS, and plain TCP is served.
    SpeaksTls,
    /// Its bytes, or what they ask for, cannot be.
    Refused(ExchangeFault),
    /// The server was told to stop.
    Stopped,
}

impl End {
    /// The same, when so many bytes of a message had come that is not whole.
    pub(super) const fn within(self, partial: usize) -> Self {
        match self {
            Self::Vanished if partial > 0 => Self::CutShort(partial),
            end => end,
        }
    }

    /// Its row in the table of causes, for the summary of the log.
    pub(super) const fn cause(&self) -> Cause {
        match self {
            Self::Finished => Cause::Done,
            Self::Stopped => Cause::Shutdown,
            Self::Refused(ExchangeFault::Host(HostFault::Tripped(trip))) => trip.cause(),
            Self::Refused(ExchangeFault::Host(HostFault::TakenBack { .. })) => Cause::TakenBack,
            Self::Vanished
            | Self::CutShort(_)
            | Self::Tls(_)
            | Self::Lost(_)
            | Self::Silent(_)
            | Self::Replaced(_) => Cause::ControllerVanished,
            Self::SpeaksTls | Self::NoSizes(_) | Self::GaveWay | Self::Refused(_) => {
                Cause::Protocol
            }
        }
    }
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Finished => f.write_str("the client ended the test"),
            Self::Vanished => f.write_str("the client closed the connection without a goodbye"),
            Self::CutShort(bytes) => write!(
                f,
                "the client closed the connection without a goodbye, {bytes} bytes into a message that did not come whole"
            ),
            Self::Lost(fault) => write!(f, "the connection broke: {fault}"),
            Self::Silent(seconds) => write!(f, "the client was silent for {seconds} s"),
            Self::Replaced(seconds) => write!(
                f,
                "the client was silent for more than {seconds} s, and a new client of the same machine takes over"
            ),
            Self::NoSizes(seconds) => write!(
                f,
                "the client sent no sizes within {seconds} s: it is no OpenFresco client, or the wrong dialect is served"
            ),
            Self::GaveWay => f.write_str(
                "the client had sent no sizes when more came than are greeted at a time: it gave way",
            ),
            Self::Tls(TlsFault::NotTls) => {
                f.write_str("TLS: it speaks no TLS, and TLS is served here (--transport tls)")
            }
            Self::Tls(fault) => write!(f, "TLS: {fault}"),
            Self::SpeaksTls => f.write_str(
                "refused: it speaks TLS, and plain TCP is served here (--transport tls)",
            ),
            Self::Refused(fault) => write!(f, "refused: {fault}"),
            Self::Stopped => f.write_str("the server was stopped"),
        }
    }
}

/// What a server has to tell.
#[derive(Debug, Clone, PartialEq)]
pub enum News {
    /// Somebody came to the free port.
    Connected(SocketAddr),
    /// The sizes are agreed: the test may begin.
    Ready(SocketAddr, Sizes),
    /// Something about the specimen or its log, when a test begins.
    Told(SocketAddr, String),
    /// Somebody came while a client is served, and was turned away.
    TurnedAway(SocketAddr),
    /// Somebody came from a machine that may not command the specimen, and was turned away.
    NotAdmitted(SocketAddr),
    /// A datagram that can open no test.
    Stray(SocketAddr, usize),
    /// An action that the dialect does not know: it is not answered, and the client may wait for ever.
    Ignored(f64),
    /// A line of an init file, which nothing is done about.
    InitLine,
    /// The client's test is over; the port is free again.
    Ended(SocketAddr, End, Tally),
}

impl News {
    /// Kinds of news.
    pub(super) const KINDS: usize = 10;

    /// Whom it is about, if it is about one peer.
    pub(super) const fn peer(&self) -> Option<SocketAddr> {
        match self {
            Self::Connected(peer)
            | Self::Ready(peer, _)
            | Self::Told(peer, _)
            | Self::TurnedAway(peer)
            | Self::NotAdmitted(peer)
            | Self::Stray(peer, _)
            | Self::Ended(peer, ..) => Some(*peer),
            Self::Ignored(_) | Self::InitLine => None,
        }
    }

    /// The kind of message; each kind has a quota, because any peer can cause it without end. The end of a test with commands
    /// is a separate kind.
    pub(super) const fn kind(&self) -> usize {
        match self {
            Self::Connected(_) => 0,
            Self::Ready(..) => 1,
            Self::Told(..) => 2,
            Self::TurnedAway(_) => 3,
            Self::NotAdmitted(_) => 4,
            Self::Stray(..) => 5,
            Self::Ignored(_) => 6,
            Self::InitLine => 7,
            Self::Ended(.., tally) if tally.commands == 0 => 8,
            Self::Ended(..) => 9,
        }
    }
}

impl std::fmt::Display for News {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Connected(peer) => write!(f, "{peer} connected"),
            Self::Ready(peer, sizes) => {
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
            Self::Told(_, text) => f.write_str(text),
            Self::TurnedAway(peer) => write!(f, "{peer} was turned away: a client is being served"),
            Self::NotAdmitted(peer) => write!(
                f,
                "{peer} was turned away: it is not the machine that may command the specimen"
            ),
            Self::Stray(peer, bytes) => write!(f, "{peer} sent {bytes} bytes that open no test"),
            Self::Ignored(code) => {
                write!(f, "action {code} is not known here and was not answered")
            }
            Self::InitLine => f.write_str("a line of an init file was received and ignored"),
            Self::Ended(peer, end, tally) => write!(
                f,
                "{peer}: {end}; {} commands, {} steps committed, {} taken back, {} answers",
                tally.commands, tally.commits, tally.taken_back, tally.answers
            ),
        }
    }
}

impl From<HostFault> for End {
    fn from(fault: HostFault) -> Self {
        Self::Refused(fault.into())
    }
}
