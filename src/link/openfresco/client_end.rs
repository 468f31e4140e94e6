//! How the test of an OpenFresco client ends, and why an exchange with it fails.

use thiserror::Error;

use super::host::HostFault;
use crate::Transport;
use crate::tls::TlsFault;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::LinkFault;
use gusset_wire::WireError;

/// Why an exchange fails.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ExchangeFault {
    /// Bytes that the dialect does not allow.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// More targets than one client may send at a time.
    #[error(
        "it sent further targets while the specimen was on its way, and did not wait for the answer: with `serve.pace` a client waits for \
         each answer"
    )]
    TooFarAhead,
    /// The specimen refuses.
    #[error(transparent)]
    Host(#[from] HostFault),
}

/// The end of a test whose link failed.
pub(crate) fn lost(link: &dyn Transport, fault: LinkFault) -> End {
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
    /// The connection was closed after this number of bytes of an incomplete message.
    CutShort(usize),
    /// The connection broke.
    Lost(LinkFault),
    /// Nothing came for so long, in s.
    Silent(f64),
    /// A new client of the same machine came while this one had been silent for so long, in s.
    Replaced(f64),
    /// It connected and sent no sizes for so long, in s.
    NoSizes(f64),
    /// It had sent no request when more clients came than can wait.
    GaveWay,
    /// There was no TLS session, or it broke.
    Tls(TlsFault),
    /// It speaks TLS, and plain TCP is served.
    SpeaksTls,
    /// Its bytes, or its requests, are invalid.
    Refused(ExchangeFault),
    /// The server stops.
    Stopped,
}

impl End {
    /// This end, after a number of bytes of an incomplete message.
    pub(crate) const fn within(self, partial: usize) -> Self {
        match self {
            Self::Vanished if partial > 0 => Self::CutShort(partial),
            end => end,
        }
    }

    /// Its row in the table of causes, for the summary of the log.
    pub(crate) const fn cause(&self) -> Cause {
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

impl From<HostFault> for End {
    fn from(fault: HostFault) -> Self {
        Self::Refused(fault.into())
    }
}

impl From<ExchangeFault> for End {
    fn from(fault: ExchangeFault) -> Self {
        Self::Refused(fault)
    }
}
