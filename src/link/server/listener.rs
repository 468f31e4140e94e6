//! The port of an OpenFresco server: who is let in, who is turned away.
//!
//! Invariant: there is one client at a time, and whoever else knocks is turned away without the client noticing:
//! over TCP the stranger's connection is closed, over UDP the client has a socket of its own and the stranger's
//! datagrams are dropped. The port stays bound between clients, so it is offered again at once.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::os::fd::AsFd;

use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::net::sockopt;
use thiserror::Error;

use crate::link::socket::{
    ConnectError, SocketOptions, TcpTransport, UdpTransport, beside, listen_advice, resolve,
};
use crate::link::tls::TlsServer;
use crate::wire::openfresco::Carrier;

/// Why a port cannot be served.
#[derive(Debug, Error)]
pub enum DoorError {
    /// The address means nothing.
    #[error(transparent)]
    Address(#[from] ConnectError),
    /// Somebody else has the port, or it is not ours to have.
    #[error("cannot listen on {address}: {source}{}", listen_advice(source))]
    Bind {
        /// As given.
        address: String,
        /// The system's word.
        source: io::Error,
    },
    /// Other machines could command the specimen, and these protocols prove nobody's identity.
    #[error(
        "{address} can be reached from other machines, and OpenFresco's protocols know no key: name the one machine that \
         may command the specimen (--client ADDRESS), or require certificates (--transport tls)"
    )]
    Open {
        /// Where.
        address: SocketAddr,
    },
    /// The socket failed while nobody was connected.
    #[error("the port failed: {0}")]
    Port(#[from] io::Error),
}

/// A port that is listened on, and who may come in.
#[derive(Debug)]
pub struct Door {
    pub(super) socket: Socket,
    /// Empty: everybody.
    clients: Vec<IpAddr>,
    pub(super) tls: Option<TlsServer>,
}

#[derive(Debug)]
pub(super) enum Socket {
    Tcp(TcpListener),
    /// Never connected itself.
    Udp(UdpSocket),
}

/// Who came to a free port.
#[derive(Debug)]
pub(super) enum Caller {
    /// A connection; nothing has been read from it.
    Stream(TcpStream, SocketAddr),
    /// So many bytes of a first datagram, in the buffer.
    Datagram(usize, SocketAddr),
}

impl Door {
    /// Listens on "host:port"; port 0 lets the system choose. With `clients` (the addresses of one machine), everybody
    /// else is turned away; beyond loopback they must be given.
    ///
    /// # Errors
    /// See [`DoorError`].
    pub fn bind(
        carrier: Carrier,
        address: &str,
        clients: impl IntoIterator<Item = IpAddr>,
    ) -> Result<Self, DoorError> {
        Self::open(carrier, address, clients.into_iter().collect(), None)
    }

    /// The same over TLS. Beyond loopback `clients` must be given, or certificates required of clients.
    ///
    /// # Errors
    /// See [`DoorError`].
    pub fn bind_tls(
        address: &str,
        clients: impl IntoIterator<Item = IpAddr>,
        tls: TlsServer,
    ) -> Result<Self, DoorError> {
        let clients = clients.into_iter().collect();
        Self::open(Carrier::Stream, address, clients, Some(tls))
    }

    fn open(
        carrier: Carrier,
        address: &str,
        clients: Vec<IpAddr>,
        tls: Option<TlsServer>,
    ) -> Result<Self, DoorError> {
        let addresses = resolve(address)?;
        let wrong = |source| DoorError::Bind {
            address: address.to_owned(),
            source,
        };
        let proven =
            !clients.is_empty() || tls.as_ref().is_some_and(TlsServer::requires_certificate);
        if let (false, Some(open)) = (proven, addresses.iter().find(|a| !a.ip().is_loopback())) {
            return Err(DoorError::Open { address: *open });
        }
        let socket = match carrier {
            Carrier::Stream => TcpListener::bind(addresses.as_slice()).map(Socket::Tcp),
            Carrier::Datagrams => UdpSocket::bind(addresses.as_slice()).map(Socket::Udp),
        }
        .map_err(wrong)?;
        match &socket {
            Socket::Tcp(listener) => listener.set_nonblocking(true),
            Socket::Udp(socket) => socket.set_nonblocking(true),
        }
        .map_err(wrong)?;
        Ok(Self {
            socket,
            clients,
            tls,
        })
    }

    /// What carries the bytes.
    #[must_use]
    pub const fn carrier(&self) -> Carrier {
        match self.socket {
            Socket::Tcp(_) => Carrier::Stream,
            Socket::Udp(_) => Carrier::Datagrams,
        }
    }

    /// Where it listens.
    ///
    /// # Errors
    /// The system's word.
    pub fn local_addr(&self) -> io::Result<SocketAddr> {
        match &self.socket {
            Socket::Tcp(listener) => listener.local_addr(),
            Socket::Udp(socket) => socket.local_addr(),
        }
    }

    /// True for who may command the specimen.
    pub(super) fn admits(&self, caller: SocketAddr) -> bool {
        let caller = caller.ip().to_canonical();
        let named = |client: &IpAddr| client.to_canonical() == caller;
        self.clients.is_empty() || self.clients.iter().any(named)
    }

    /// Waits up to `wait_ns` for somebody. May return `None` early.
    pub(super) fn wait(&self, buffer: &mut [u8], wait_ns: u64) -> io::Result<Option<Caller>> {
        let fd = match &self.socket {
            Socket::Tcp(listener) => listener.as_fd(),
            Socket::Udp(socket) => socket.as_fd(),
        };
        let time = Timespec {
            tv_sec: (wait_ns / 1_000_000_000) as i64,
            tv_nsec: (wait_ns % 1_000_000_000) as i64,
        };
        let mut fds = [PollFd::new(&fd, PollFlags::IN)];
        match rustix::event::poll(&mut fds, Some(&time)) {
            Ok(0) | Err(rustix::io::Errno::INTR) => return Ok(None),
            Ok(_) => {}
            Err(error) => return Err(error.into()),
        }
        match &self.socket {
            Socket::Tcp(listener) => {
                Ok(gone(listener.accept())?.map(|(stream, from)| Caller::Stream(stream, from)))
            }
            Socket::Udp(socket) => {
                Ok(gone(socket.recv_from(buffer))?
                    .map(|(count, from)| Caller::Datagram(count, from)))
            }
        }
    }

    /// Turns away whoever knocks while a client is served; calls `refused` with each of them.
    pub(super) fn turn_away(&self, buffer: &mut [u8], refused: &mut dyn FnMut(SocketAddr)) {
        // Bounded: a flood of strangers must not keep the client waiting.
        for _ in 0..8 {
            let from = match &self.socket {
                Socket::Tcp(listener) => listener.accept().map(|(_, from)| from),
                Socket::Udp(socket) => socket.recv_from(buffer).map(|(_, from)| from),
            };
            match from {
                Ok(from) => refused(from),
                Err(_) => return,
            }
        }
    }
}

/// What a non-blocking call does not bring is nobody's fault; what a stranger's hasty end brings neither.
fn gone<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    use io::ErrorKind::{
        ConnectionAborted, ConnectionRefused, ConnectionReset, Interrupted, WouldBlock,
    };
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) => match error.kind() {
            WouldBlock | Interrupted | ConnectionAborted | ConnectionRefused | ConnectionReset => {
                Ok(None)
            }
            _ => Err(error),
        },
    }
}

/// Half-open connections show after this long: 10 s of silence, then three probes 5 s apart.
pub(super) fn watch_over(stream: &TcpStream) -> io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, std::time::Duration::from_secs(10))?;
    sockopt::set_tcp_keepintvl(stream, std::time::Duration::from_secs(5))?;
    sockopt::set_tcp_keepcnt(stream, 3)?;
    sockopt::set_tcp_user_timeout(stream, 20_000)?;
    Ok(())
}

/// Our end of a TCP connection.
pub(super) fn stream_to(stream: TcpStream) -> Result<TcpTransport, ConnectError> {
    TcpTransport::from_stream(stream, SocketOptions::default())
}

/// A socket on the same port that hears only `peer`, beside `door`, which from now on hears only the others.
pub(super) fn socket_to(door: &UdpSocket, peer: SocketAddr) -> Result<UdpTransport, DoorError> {
    let own = beside(door, door.local_addr()?, peer)?;
    Ok(UdpTransport::from_socket(own, SocketOptions::default())?)
}
