//! The asking dialects as one, and the transports below them: what is sent and heard, without its meaning.

use std::time::Duration;

use super::error::RemoteError;
use super::settings::{Peer, RemoteSettings};
use crate::link::Transport;
use crate::link::socket::{ConnectError, SocketOptions, TcpTransport, UdpTransport};
use crate::rt::os;
use crate::substructure::LinkFault;
use crate::time::Nanos;
use crate::wire::WireError;
use crate::wire::openfresco::{
    Asked, Carrier, Client, ClientDialect, ClientEvent, ClientSettings, DATAGRAM_LIMIT, Shadow,
    ShadowEvent, ShadowSettings, datagrams,
};

/// Pause between two attempts to connect.
const AGAIN_NS: u64 = 20_000_000;

#[derive(Debug)]
pub(super) enum Asking {
    Client(Client),
    Shadow(Shadow),
}

/// What came of some bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Came {
    Nothing,
    /// A step of the set-up; there may be something to send.
    Greeted,
    /// Commands may follow.
    Ready,
    Signals,
    Matrix,
    Farewell,
}

impl Asking {
    pub(super) fn feed(&mut self, bytes: &[u8]) -> Result<(usize, Came), WireError> {
        Ok(match self {
            Self::Client(client) => {
                let (used, event) = client.feed(bytes)?;
                let came = match event {
                    ClientEvent::NeedMore => Came::Nothing,
                    ClientEvent::Greeted => Came::Ready,
                    ClientEvent::Answer(Asked::Signals) => Came::Signals,
                    ClientEvent::Answer(Asked::Matrix(_)) => Came::Matrix,
                };
                (used, came)
            }
            Self::Shadow(shadow) => {
                let (used, event) = shadow.feed(bytes)?;
                let came = match event {
                    ShadowEvent::NeedMore => Came::Nothing,
                    ShadowEvent::Greeted => Came::Greeted,
                    ShadowEvent::Ready { .. } => Came::Ready,
                    ShadowEvent::Answer => Came::Signals,
                    ShadowEvent::Finished => Came::Farewell,
                };
                (used, came)
            }
        })
    }

    pub(super) fn answer_back(
        &self,
        link: &mut dyn Transport,
        carrier: Carrier,
    ) -> Result<(), LinkFault> {
        match self {
            Self::Client(client) => send(link, carrier, client.reply(), client.reply().len()),
            Self::Shadow(shadow) => shadow
                .reply_messages()
                .try_for_each(|message| send(link, carrier, message, message.len())),
        }
    }
}

/// A stream takes all in one write, datagrams leave message by message. Real-time: yes.
pub(super) fn send(
    link: &mut dyn Transport,
    carrier: Carrier,
    bytes: &[u8],
    message: usize,
) -> Result<(), LinkFault> {
    match carrier {
        Carrier::Stream if bytes.is_empty() => Ok(()),
        Carrier::Stream => link.send(bytes),
        Carrier::Datagrams => {
            datagrams(bytes, message, DATAGRAM_LIMIT).try_for_each(|part| link.send(part))
        }
    }
}

pub(super) fn machine(settings: &RemoteSettings) -> Result<Asking, WireError> {
    let sizes = settings.sizes()?;
    let dialect = match settings.peer {
        Peer::Element | Peer::Site => ClientDialect::Application,
        Peer::Adapter => ClientDialect::Adapter,
        Peer::Actor => {
            return Ok(Asking::Shadow(Shadow::new(ShadowSettings {
                carrier: settings.carrier,
                sizes,
                site: settings.site,
                version: settings.version,
                greeting: settings.greeting,
            })?));
        }
    };
    Ok(Asking::Client(Client::new(ClientSettings {
        dialect,
        carrier: settings.carrier,
        sizes,
        greeting: settings.greeting,
    })?))
}

pub(super) fn transport(
    settings: &RemoteSettings,
    until: Nanos,
) -> Result<Box<dyn Transport>, RemoteError> {
    let options = SocketOptions {
        wait: settings.wait,
        ..SocketOptions::default()
    };
    if settings.carrier == Carrier::Datagrams {
        return Ok(Box::new(UdpTransport::connect(&settings.address, options)?));
    }
    // A command and its request leave in one write; the one before them may still wait.
    let largest = settings
        .sizes()
        .map_or(0, |sizes| 4 * 8 * sizes.data_size());
    loop {
        let left = until.since(Nanos(os::monotonic_ns()));
        let limit = Duration::from_nanos(left.max(1_000_000));
        let address = &settings.address;
        let link = match &settings.tls {
            None => TcpTransport::connect(address, limit, options)
                .map(|link| Box::new(link) as Box<dyn Transport>),
            Some(tls) => tls
                .connect(address, limit, options, largest)
                .map(|link| Box::new(link) as Box<dyn Transport>),
        };
        match link {
            Ok(link) => return Ok(link),
            Err(ConnectError::Refused { .. }) if left > AGAIN_NS => pause(),
            Err(error) => return Err(error.into()),
        }
    }
}

pub(super) fn pause() {
    os::sleep_until_ns(os::monotonic_ns() + AGAIN_NS);
}
