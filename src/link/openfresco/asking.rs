//! The asking dialects as one, and the transports below them: bytes sent and received, without their meaning.

use std::time::Duration;

use super::error::{Lost, RemoteError};
use super::settings::RemoteSettings;
use crate::Transport;
use crate::socket::{ConnectError, SocketOptions, TcpTransport, UdpTransport};
use gusset_quantity::substructure::{Command, LinkFault, Measurement};
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;
use gusset_wire::WireError;
use gusset_wire::openfresco::Peer;
use gusset_wire::openfresco::{
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

/// Result of some bytes.
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
    fn feed(&mut self, bytes: &[u8]) -> Result<(usize, Came), WireError> {
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

    /// The first bytes to send.
    pub(super) fn open(&mut self) -> Result<&[u8], WireError> {
        match self {
            Self::Client(client) => client.open(),
            Self::Shadow(shadow) => shadow.open(),
        }
    }

    /// A command and its request, and the length of each. Real-time: yes.
    pub(super) fn command(&mut self, command: &Command<'_>) -> Result<(&[u8], usize), WireError> {
        match self {
            Self::Client(client) => {
                let message = client.vector_len();
                client.command(command).map(|bytes| (bytes, message))
            }
            Self::Shadow(shadow) => {
                let message = shadow.vector_len();
                shadow.command(command).map(|bytes| (bytes, message))
            }
        }
    }

    /// Real-time: yes.
    pub(super) fn commit(&mut self, time: f64) -> Result<&[u8], WireError> {
        match self {
            Self::Client(client) => client.commit(time),
            Self::Shadow(shadow) => shadow.commit(time),
        }
    }

    /// The final message, and whether the server answers it.
    pub(super) fn die(&mut self) -> Result<(&[u8], bool), WireError> {
        match self {
            Self::Client(client) => client.die().map(|bytes| (bytes, false)),
            Self::Shadow(shadow) => shadow.die().map(|bytes| (bytes, true)),
        }
    }

    /// Real-time: yes.
    pub(super) fn measurement(&self, into: &mut Measurement) -> Result<(), WireError> {
        match self {
            Self::Client(client) => client.measurement(into),
            Self::Shadow(shadow) => shadow.measurement(into),
        }
    }

    /// Feeds all received bytes and sends the requests that follow; returns the last message. Real-time: yes, after the
    /// set-up.
    pub(super) fn digest(
        &mut self,
        link: &mut dyn Transport,
        carrier: Carrier,
        bytes: &[u8],
    ) -> Result<Came, Lost> {
        let mut came = Came::Nothing;
        let mut rest = bytes;
        while !rest.is_empty() {
            let (used, what) = self.feed(rest)?;
            if what != Came::Nothing {
                self.answer_back(link, carrier)?;
                came = what;
            }
            rest = rest.get(used.max(1)..).unwrap_or_default();
        }
        Ok(came)
    }

    fn answer_back(&self, link: &mut dyn Transport, carrier: Carrier) -> Result<(), LinkFault> {
        match self {
            Self::Client(client) => send(link, carrier, client.reply(), client.reply().len()),
            Self::Shadow(shadow) => shadow
                .reply_messages()
                .try_for_each(|message| send(link, carrier, message, message.len())),
        }
    }
}

/// Detects a datagram that came twice or late by the time of the command in the answer. Genuine servers return this time
/// where they support it. These protocols offer no other means.
#[derive(Debug, Default)]
pub(super) struct Echo {
    newest: Option<f64>,
}

impl Echo {
    /// Judges the time of an answer. One that was never a command's, or none, is no echo and proves nothing.
    /// Real-time: yes.
    ///
    /// # Errors
    /// It is the answer to the command before.
    pub(super) fn check(&mut self, commanded: f64, answered: f64) -> Result<(), WireError> {
        if answered == commanded {
            self.newest = Some(commanded).filter(|time| *time != 0.0);
        } else if self.newest == Some(answered) {
            return Err(WireError::Order {
                expected: "the answer to this command",
                found: "the answer to the one before",
            });
        } else {
            self.newest = None;
        }
        Ok(())
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

#[cfg(test)]
mod tests {
    use super::Echo;

    #[test]
    fn echoed_time_reveals_an_old_answer() {
        let mut echo = Echo::default();
        for (commanded, answered) in [(0.0, 0.0), (0.0, 0.0), (0.1, 0.1), (0.1, 0.1), (0.2, 0.2)] {
            echo.check(commanded, answered).unwrap();
        }
        echo.check(0.3, 0.2).unwrap_err();
        // A peer without a time sends zeros; one with a separate clock sends any number.
        for clock in [[0.0; 4], [5.0, 5.1, 5.2, 5.3]] {
            let mut echo = Echo::default();
            for (k, answered) in clock.into_iter().enumerate() {
                echo.check(0.1 * k as f64, answered).unwrap();
            }
        }
    }
}
