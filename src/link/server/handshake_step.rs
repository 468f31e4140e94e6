//! The steps of a handshake: it continues, it is complete, or it fails.

use std::net::SocketAddr;

use super::ServerEvent;
use super::shared::Shared;
use crate::openfresco::{End, Tally};

/// The result of some bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// More bytes must come.
    More,
    /// The handshake is complete, and the specimen is reserved for this client.
    Complete,
}

/// Why a handshake ended without a test.
pub(super) enum Failure {
    /// The client disconnected.
    Left,
    /// The server refuses a native client, with these last bytes.
    Refused { text: String, frame: Vec<u8> },
    /// The server refuses a native client for bytes or a silence that Gusset does not cause.
    Malformed { text: String, frame: Vec<u8> },
    /// The client of OpenFresco's protocols has disconnected or is refused.
    Ended(End),
}

impl Failure {
    /// Last bytes for the client.
    pub(crate) fn frame(&self) -> &[u8] {
        match self {
            Self::Refused { frame, .. } | Self::Malformed { frame, .. } => frame,
            Self::Left | Self::Ended(_) => &[],
        }
    }

    pub(crate) fn report(self, peer: SocketAddr, shared: &Shared) {
        match self {
            Self::Left => {}
            Self::Refused { text, .. } => shared.tell(ServerEvent::Refused { peer, text }),
            Self::Malformed { text, .. } => shared.complain(peer, text),
            Self::Ended(end) => {
                shared.tell(ServerEvent::ClientLeft(peer, end, Tally::default()));
            }
        }
    }
}
