//! The handshake of a waiting client, whatever protocol it speaks.
//!
//! A handshake takes bytes and gives replies. It has no socket and no clock, and sends nothing to the specimen. It ends
//! with an [`Opening`], which the data thread turns into a session, or with a [`Failure`]. Each phase of a handshake
//! has a time limit, which the caller keeps.

use std::net::SocketAddr;
use std::time::Duration;

use super::handshake_step::{Failure, Step};
use super::native_handshake::{NativeHandshake, NativeOpening};
use super::openfresco_handshake::{OpenFrescoHandshake, OpenFrescoOpening};
use super::shared::Shared;
use crate::Transport;
use crate::openfresco::End;
use crate::tls::TlsFault;
use gusset_quantity::substructure::LinkFault;

/// The result of a complete handshake.
pub(super) enum Opening {
    Native(Box<NativeOpening>),
    OpenFresco(Box<OpenFrescoOpening>),
}

/// The handshake of one client.
pub(super) enum Handshake {
    Native(NativeHandshake),
    OpenFresco(OpenFrescoHandshake),
}

impl Handshake {
    /// Takes the next bytes of `peer`, or its next datagram. Replies are appended to `replies`, one message each.
    pub(crate) fn take(
        &mut self,
        bytes: &[u8],
        peer: SocketAddr,
        shared: &Shared,
        replies: &mut Vec<Vec<u8>>,
    ) -> Result<Step, Failure> {
        match self {
            Self::Native(native) => native.take(bytes, peer, shared, replies),
            Self::OpenFresco(openfresco) => openfresco.take(bytes, peer, shared, replies),
        }
    }

    /// The number of the present phase, and its time limit. The start of the TLS session is a separate phase.
    pub(crate) fn phase(&self, is_encrypting: bool) -> (u8, Duration) {
        match self {
            Self::Native(native) => native.phase(is_encrypting),
            Self::OpenFresco(openfresco) => (0, openfresco.limit()),
        }
    }

    /// True if the client sent something that its protocol allows.
    pub(crate) const fn has_spoken(&self) -> bool {
        match self {
            Self::Native(native) => native.has_spoken(),
            Self::OpenFresco(openfresco) => openfresco.has_spoken(),
        }
    }

    /// The result, if it is complete.
    pub(crate) fn into_opening(self) -> Option<Opening> {
        match self {
            Self::Native(native) => native.into_opening().map(Box::new).map(Opening::Native),
            Self::OpenFresco(openfresco) => openfresco
                .into_opening()
                .map(Box::new)
                .map(Opening::OpenFresco),
        }
    }

    /// The phase took too long.
    pub(crate) fn timed_out(&self, is_encrypting: bool) -> Failure {
        match self {
            Self::Native(native) => native.timed_out(is_encrypting),
            Self::OpenFresco(_) if is_encrypting => {
                Failure::Ended(End::Tls(TlsFault::SlowHandshake))
            }
            Self::OpenFresco(openfresco) => {
                Failure::Ended(End::NoSizes(openfresco.limit().as_secs_f64()))
            }
        }
    }

    /// The client must make room for another one.
    pub(crate) fn gave_way(&self) -> Failure {
        match self {
            Self::Native(_) => Failure::Malformed {
                text: "it had not armed when more came than may wait: it gave way".to_owned(),
                frame: Vec::new(),
            },
            Self::OpenFresco(_) => Failure::Ended(End::GaveWay),
        }
    }

    /// The client has disconnected.
    pub(crate) const fn left(&self) -> Failure {
        match self {
            Self::Native(_) => Failure::Left,
            Self::OpenFresco(_) => Failure::Ended(End::Vanished),
        }
    }

    /// The server stops.
    pub(crate) const fn stopped(&self) -> Failure {
        match self {
            Self::Native(_) => Failure::Left,
            Self::OpenFresco(_) => Failure::Ended(End::Stopped),
        }
    }

    /// There is no TLS session.
    pub(crate) fn tls_failed(&self, fault: TlsFault, detail: Option<&str>) -> Failure {
        match self {
            Self::Native(_) => Failure::Malformed {
                text: tls_text(fault, detail),
                frame: Vec::new(),
            },
            Self::OpenFresco(_) => Failure::Ended(End::Tls(fault)),
        }
    }

    /// The connection is lost.
    pub(crate) fn link_lost(&self, link: &dyn Transport, fault: LinkFault) -> Failure {
        match (self, link.tls_fault()) {
            (Self::Native(_), Some(fault)) => Failure::Malformed {
                text: tls_text(fault, None),
                frame: Vec::new(),
            },
            (Self::Native(_), None) => Failure::Left,
            (Self::OpenFresco(openfresco), _) => openfresco.link_lost(link, fault),
        }
    }
}

fn tls_text(fault: TlsFault, detail: Option<&str>) -> String {
    let detail = detail.map_or_else(String::new, |detail| format!(" ({detail})"));
    let advice = if fault == TlsFault::NotTls {
        ": its end wants `transport = \"tls\"`"
    } else {
        ""
    };
    format!("TLS: {fault}{detail}{advice}")
}
