//! How a server greets: it makes the handshakes of its protocol, and decides what others may do while a client is
//! served.

use std::sync::Arc;
use std::time::Duration;

use super::handshake::Handshake;
use super::native_handshake::{Medium, NativeHandshake, Offer};
use super::openfresco_handshake::OpenFrescoHandshake;
use crate::inbox::Inbox;
use crate::openfresco::{Codec, Nature, ServeSettings};
use gusset_wire::openfresco::Carrier;

/// Treatment of other clients while one is served.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Others {
    /// Each gets an answer of the protocol.
    AreAnswered,
    /// Their connections are closed.
    AreTurnedAway,
    /// They wait until the specimen is free.
    Wait,
}

/// The protocol of a server, as its waiting clients see it.
pub(super) enum Greeter {
    Native {
        offer: Arc<Offer>,
        is_stream: bool,
    },
    OpenFresco {
        settings: ServeSettings,
        carrier: Carrier,
        axes: usize,
        nature: Nature,
    },
}

impl Greeter {
    pub(crate) fn handshake(&self) -> Handshake {
        match self {
            Self::Native { offer, is_stream } => {
                let medium = if *is_stream {
                    Medium::Stream
                } else {
                    Medium::Datagrams
                };
                let inbox = Inbox::new(*is_stream);
                Handshake::Native(NativeHandshake::new(Arc::clone(offer), medium, inbox))
            }
            Self::OpenFresco {
                settings,
                carrier,
                axes,
                ..
            } => Handshake::OpenFresco(openfresco_handshake(settings, *carrier, *axes)),
        }
    }

    pub(crate) const fn others(&self) -> Others {
        match self {
            Self::Native { .. } => Others::AreAnswered,
            Self::OpenFresco {
                nature: Nature::Physical,
                ..
            } => Others::AreTurnedAway,
            Self::OpenFresco { .. } => Others::Wait,
        }
    }

    pub(crate) const fn is_openfresco(&self) -> bool {
        matches!(self, Self::OpenFresco { .. })
    }

    /// True if each frame is signed.
    pub(crate) fn has_key(&self) -> bool {
        matches!(self, Self::Native { offer, .. } if offer.key.is_some())
    }

    /// True if a datagram may be the first one of a client. A separate handshake judges it, so it changes nothing.
    pub(crate) fn allows(&self, datagram: &[u8]) -> bool {
        self.judge(datagram, OpenFrescoHandshake::allows)
    }

    /// True if a datagram opens a test.
    pub(crate) fn opens(&self, datagram: &[u8]) -> bool {
        self.judge(datagram, OpenFrescoHandshake::opens)
    }

    fn judge(&self, datagram: &[u8], rule: fn(OpenFrescoHandshake, &[u8]) -> bool) -> bool {
        match self {
            // The handshake itself reports messages that it does not understand.
            Self::Native { .. } => true,
            Self::OpenFresco {
                settings,
                carrier,
                axes,
                ..
            } => rule(openfresco_handshake(settings, *carrier, *axes), datagram),
        }
    }
}

fn openfresco_handshake(
    settings: &ServeSettings,
    carrier: Carrier,
    axes: usize,
) -> OpenFrescoHandshake {
    let codec = Codec::new(settings.role, settings.signal_order, carrier, axes);
    let limit = Duration::from_secs_f64(settings.setup_limit_s);
    OpenFrescoHandshake::new(codec, carrier, limit)
}
