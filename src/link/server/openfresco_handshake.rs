//! The handshake of OpenFresco's protocols: everything up to the sizes of the vectors.

use std::net::SocketAddr;
use std::time::Duration;

use super::ServerEvent;
use super::handshake_step::{Failure, Step};
use super::shared::Shared;
use crate::Transport;
use crate::openfresco::{Codec, End, Request, lost};
use crate::tls::is_client_hello;
use gusset_quantity::substructure::LinkFault;
use gusset_wire::openfresco::{Carrier, Sizes, datagrams};

/// A client that has named its sizes.
pub(super) struct OpenFrescoOpening {
    pub codec: Codec,
    pub sizes: Sizes,
    /// Bytes that came after the sizes, in the pieces in which they came.
    pub early: Vec<Vec<u8>>,
}

/// The handshake of one client.
pub(super) struct OpenFrescoHandshake {
    codec: Codec,
    carrier: Carrier,
    limit: Duration,
    has_spoken: bool,
    found: Option<(Sizes, Vec<u8>)>,
}

impl OpenFrescoHandshake {
    pub(crate) fn new(codec: Codec, carrier: Carrier, limit: Duration) -> Self {
        Self {
            codec,
            carrier,
            limit,
            has_spoken: false,
            found: None,
        }
    }

    pub(crate) const fn limit(&self) -> Duration {
        self.limit
    }

    pub(crate) const fn has_spoken(&self) -> bool {
        self.has_spoken
    }

    pub(crate) fn into_opening(self) -> Option<OpenFrescoOpening> {
        let (sizes, rest) = self.found?;
        Some(OpenFrescoOpening {
            codec: self.codec,
            sizes,
            early: vec![rest],
        })
    }

    pub(crate) fn link_lost(&self, link: &dyn Transport, fault: LinkFault) -> Failure {
        Failure::Ended(lost(link, fault).within(self.codec.inbox().partial()))
    }

    /// True if a datagram opens a test: a new handshake answers it, or finds the sizes in it.
    pub(crate) fn opens(mut self, datagram: &[u8]) -> bool {
        self.codec.feed(datagram).is_ok_and(|(_, request)| {
            matches!(request, Request::Sizes(_))
                || (request == Request::Reply && !self.codec.reply().is_empty())
        })
    }

    /// True if a datagram may be the first one of a client.
    pub(crate) fn allows(mut self, datagram: &[u8]) -> bool {
        self.codec.feed(datagram).is_ok()
    }

    pub(crate) fn take(
        &mut self,
        bytes: &[u8],
        peer: SocketAddr,
        shared: &Shared,
        replies: &mut Vec<Vec<u8>>,
    ) -> Result<Step, Failure> {
        if self.carrier == Carrier::Stream && is_client_hello(bytes) {
            return Err(Failure::Ended(End::SpeaksTls));
        }
        self.has_spoken = true;
        let mut rest = bytes;
        while !rest.is_empty() {
            let (used, request) = self
                .codec
                .feed(rest)
                .map_err(|error| Failure::Ended(End::Refused(error.into())))?;
            rest = rest.get(used..).unwrap_or_default();
            match request {
                Request::Reply => {
                    let reply = self.codec.reply();
                    let piece = match self.carrier {
                        Carrier::Stream => usize::MAX,
                        Carrier::Datagrams => self.codec.inbox().piece(),
                    };
                    replies.extend(datagrams(reply, reply.len(), piece).map(<[u8]>::to_vec));
                }
                Request::Sizes(sizes) => {
                    if !shared.reserve(peer) {
                        return Err(Failure::Ended(End::GaveWay));
                    }
                    self.found = Some((sizes, rest.to_vec()));
                    return Ok(Step::Complete);
                }
                Request::InitLine => shared.tell(ServerEvent::InitLine),
                Request::Unknown(code) => shared.tell(ServerEvent::UnknownAction(code)),
                Request::Goodbye => return Err(Failure::Ended(End::Finished)),
                // The codec passes no other message before the sizes.
                Request::More
                | Request::Command(_)
                | Request::Commit
                | Request::Read
                | Request::Matrix(_)
                | Request::Switch(_) => {}
            }
            if used == 0 {
                break;
            }
        }
        Ok(Step::More)
    }
}
