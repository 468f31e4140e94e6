//! The server on simulated time: it waits for a client, serves one session, and is over.
//!
//! The handshake and the session are the same as behind a socket. Time passes here turn by turn, as far as the client's end
//! ([`super::Simulated`]) allows.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;

use super::channel::Channel;
use super::connection::{ClientLink, Connection};
use super::handshake_step::Step;
use super::native_handshake::{Medium, NativeHandshake, Offer};
use super::native_opening::{self, DataThread};
use super::native_session::NativeConversation;
use super::session::Session;
use super::shared::Shared;
use super::wire_end::WireEnd;
use crate::Transport;
use crate::inbox::Inbox;
use gusset_quantity::time::Nanos;
use gusset_wire::native::LARGEST_FRAME;

/// The life of a server on simulated time.
pub(super) enum SimulatedServer {
    /// No client has armed.
    Waiting(Box<WaitingWire>),
    /// A session, and the time until which it waits.
    Serving(Box<Session<NativeConversation>>, Nanos),
    /// The session is over.
    Over(Box<ClientLink>),
    /// Between two of these states.
    Changing,
}

/// The wire of a client that has not armed yet.
pub(super) struct WaitingWire {
    link: ClientLink,
    handshake: NativeHandshake,
    buffer: Vec<u8>,
}

/// A simulated client has no address.
const PEER: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

impl SimulatedServer {
    /// Waits for a client behind this end of a wire.
    pub(crate) fn waiting(offer: Arc<Offer>, end: WireEnd, is_stream: bool) -> Self {
        let inbox = Inbox::new(is_stream);
        Self::Waiting(Box::new(WaitingWire {
            link: ClientLink::from(Connection::Simulated(Box::new(end))),
            handshake: NativeHandshake::new(offer, Medium::Simulated, inbox),
            buffer: vec![0; LARGEST_FRAME + 1],
        }))
    }

    pub(crate) const fn is_over(&self) -> bool {
        matches!(self, Self::Over(_))
    }

    /// The server's end of the wire.
    pub(crate) fn end(&mut self) -> Option<&mut WireEnd> {
        match self {
            Self::Waiting(waiting) => waiting.link.wire_end(),
            Self::Serving(session, _) => session.link().wire_end(),
            Self::Over(link) => link.wire_end(),
            Self::Changing => None,
        }
    }

    /// One turn, up to `limit`.
    pub(crate) fn turn(&mut self, limit: Nanos, offer: &Offer, shared: &Shared) {
        let end = match self {
            Self::Serving(session, until) => {
                match session.listen(*until).and_then(|()| session.turn(shared)) {
                    Ok(next) => {
                        *until = next;
                        return;
                    }
                    Err(end) => Some(end),
                }
            }
            Self::Over(link) => {
                if let Some(end) = link.wire_end() {
                    // Nothing is received any more.
                    end.drop_what_comes(limit);
                }
                return;
            }
            Self::Waiting(_) | Self::Changing => None,
        };
        *self = match (std::mem::replace(self, Self::Changing), end) {
            (Self::Waiting(waiting), _) => waiting.turn(offer, shared),
            (Self::Serving(session, _), Some(end)) => {
                let link = session.finish(end, shared);
                shared.release();
                Self::Over(Box::new(link))
            }
            (other, _) => other,
        };
    }
}

impl WaitingWire {
    /// Receives one frame, and answers it.
    fn turn(mut self: Box<Self>, offer: &Offer, shared: &Shared) -> SimulatedServer {
        let count = match self.link.recv(&mut self.buffer, Nanos(u64::MAX)) {
            Ok(count) => count.unwrap_or(0),
            Err(_) => return SimulatedServer::Over(Box::new(self.link)),
        };
        if count == 0 {
            return SimulatedServer::Waiting(self);
        }
        let frame = self.buffer.get(..count).unwrap_or_default();
        let mut replies = Vec::new();
        let step = self.handshake.take(frame, PEER, shared, &mut replies);
        for reply in replies {
            let _ = self.link.send(&reply);
        }
        match step {
            Ok(Step::Complete) => self.open(offer, shared),
            Ok(Step::More) => SimulatedServer::Waiting(self),
            Err(failure) => {
                if !failure.frame().is_empty() {
                    let _ = self.link.send(failure.frame());
                }
                SimulatedServer::Waiting(self)
            }
        }
    }

    fn open(self, offer: &Offer, shared: &Shared) -> SimulatedServer {
        let Self {
            link, handshake, ..
        } = self;
        let channel = Channel { link, peer: PEER };
        let Some(opening) = handshake.into_opening() else {
            return SimulatedServer::Over(Box::new(channel.link));
        };
        let thread = DataThread {
            cpu: None,
            spin_ns: 0,
        };
        match native_opening::open(channel, opening, &offer.host, thread, shared) {
            Ok(session) => SimulatedServer::Serving(Box::new(session), Nanos(0)),
            Err(channel) => {
                shared.release();
                SimulatedServer::Over(Box::new(channel.link))
            }
        }
    }
}
