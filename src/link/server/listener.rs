//! The port of a server: it binds the address, accepts connections and receives datagrams.
//!
//! One rule holds for every protocol: a port that other machines can reach asks its clients for a proof of identity.
//! The proof is a pre-shared key, a required certificate, or a named machine.
//! Over UDP one socket receives from everybody, and the present client gets a separate socket on the same port.
//! So the datagrams of strangers never reach the data thread.
//! The port stays bound between clients.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::net::sockopt;

use super::connection::Connection;
use super::{ServeError, ServeOptions};
use crate::socket::{SocketOptions, TcpTransport, UdpTransport, beside, resolve};
use crate::tls::{TlsServer, TlsStream};
use gusset_config::Carrier;

/// The proof of identity that a server asks of its clients.
#[derive(Debug, Default)]
pub(super) struct Access {
    /// Clients must have a pre-shared key.
    pub has_key: bool,
    /// Only these addresses may connect; empty: all.
    pub clients: Vec<IpAddr>,
    /// Connections use TLS.
    pub tls: Option<TlsServer>,
    /// Advice to the user if the port is open to other machines.
    pub remedy: &'static str,
}

impl Access {
    fn is_proof(&self) -> bool {
        self.has_key
            || !self.clients.is_empty()
            || self
                .tls
                .as_ref()
                .is_some_and(TlsServer::requires_certificate)
    }
}

/// A new connection, or a datagram in the buffer of the caller.
pub(super) enum Arrival {
    /// A connection from which nothing has been read.
    Stream(TcpStream, SocketAddr),
    /// A datagram with this number of bytes.
    Datagram(usize, SocketAddr),
}

/// A bound port.
pub(super) struct Listener {
    socket: Socket,
    access: Access,
    address: SocketAddr,
}

enum Socket {
    Tcp(TcpListener),
    /// This socket is never connected.
    Udp(UdpSocket),
}

impl Listener {
    /// Binds the address of `options`.
    pub(super) fn bind(options: &ServeOptions, access: Access) -> Result<Self, ServeError> {
        let wrong = |source| ServeError::Listen {
            address: options.listen.clone(),
            source,
        };
        let addresses = resolve(&options.listen)?;
        let open = addresses.iter().find(|a| !a.ip().is_loopback());
        if let (Some(open), false) = (open, access.is_proof()) {
            return Err(ServeError::Open {
                address: *open,
                remedy: access.remedy,
            });
        }
        let socket = match options.carrier {
            Carrier::Tcp | Carrier::Tls => TcpListener::bind(addresses.as_slice())
                .and_then(|listener| {
                    listener.set_nonblocking(true)?;
                    Ok(Socket::Tcp(listener))
                })
                .map_err(wrong)?,
            Carrier::Udp => UdpSocket::bind(addresses.as_slice())
                .and_then(|socket| {
                    socket.set_nonblocking(true)?;
                    Ok(Socket::Udp(socket))
                })
                .map_err(wrong)?,
        };
        let address = match &socket {
            Socket::Tcp(listener) => listener.local_addr(),
            Socket::Udp(socket) => socket.local_addr(),
        }
        .map_err(wrong)?;
        Ok(Self {
            socket,
            access,
            address,
        })
    }

    pub(super) const fn local_addr(&self) -> SocketAddr {
        self.address
    }

    pub(super) const fn is_stream(&self) -> bool {
        matches!(self.socket, Socket::Tcp(_))
    }

    /// True if this machine may command the specimen.
    pub(super) fn admits(&self, peer: SocketAddr) -> bool {
        let peer = peer.ip().to_canonical();
        let is_named = |client: &IpAddr| client.to_canonical() == peer;
        self.access.clients.is_empty() || self.access.clients.iter().any(is_named)
    }

    /// Waits until the port or one of the sockets `others` has something to read, up to a time limit. May return early.
    pub(super) fn wait<'a>(
        &'a self,
        others: impl Iterator<Item = BorrowedFd<'a>>,
        limit: Duration,
    ) {
        let own = match &self.socket {
            Socket::Tcp(listener) => listener.as_fd(),
            Socket::Udp(socket) => socket.as_fd(),
        };
        let fds = std::iter::once(own).chain(others);
        let mut fds: Vec<_> = fds
            .map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN))
            .collect();
        // An error shows again in the read that follows.
        let _ = rustix::event::poll(&mut fds, Some(&timespec(limit)));
    }

    /// The next connection or datagram, without waiting.
    pub(super) fn next(&self, buffer: &mut [u8]) -> io::Result<Option<Arrival>> {
        match &self.socket {
            Socket::Tcp(listener) => {
                let accepted = present(listener.accept())?;
                Ok(accepted.map(|(stream, peer)| Arrival::Stream(stream, peer)))
            }
            Socket::Udp(socket) => {
                let received = present(socket.recv_from(buffer))?;
                Ok(received.map(|(count, peer)| Arrival::Datagram(count, peer)))
            }
        }
    }

    /// A transport over an accepted connection. With TLS, its handshake is still to come.
    pub(super) fn open(&self, stream: TcpStream) -> Result<Opened, String> {
        let options = SocketOptions::default();
        match &self.access.tls {
            None => TcpTransport::from_stream(stream, options)
                .map(|tcp| Opened::Plain(Connection::Tcp(tcp))),
            Some(tls) => tls
                .accept(stream, options)
                .map(|session| Opened::Encrypting(Box::new(session))),
        }
        .map_err(|error| error.to_string())
    }

    /// Sends a datagram from the common socket. The network may lose it, and the peer then asks again.
    pub(super) fn send_to(&self, datagram: &[u8], peer: SocketAddr) -> io::Result<()> {
        match &self.socket {
            Socket::Udp(socket) => socket.send_to(datagram, peer).map(|_| ()),
            Socket::Tcp(_) => Ok(()),
        }
    }

    /// A socket on the same port that receives from `peer` only. From now on the common socket receives from the others.
    pub(super) fn own_socket(&self, peer: SocketAddr) -> Result<Connection, String> {
        let Socket::Udp(socket) = &self.socket else {
            return Err("a stream needs no further socket".to_owned());
        };
        let own = beside(socket, self.address, peer).map_err(|error| error.to_string())?;
        UdpTransport::from_socket(own, SocketOptions::default())
            .map(Connection::Udp)
            .map_err(|error| error.to_string())
    }
}

/// A connection that was accepted.
pub(super) enum Opened {
    Plain(Connection),
    Encrypting(Box<TlsStream>),
}

fn timespec(time: Duration) -> Timespec {
    Timespec {
        tv_sec: i64::try_from(time.as_secs()).unwrap_or(i64::MAX),
        tv_nsec: time.subsec_nanos().into(),
    }
}

/// Passes time without a look at any socket.
pub(super) fn pause(time: Duration) {
    let _ = rustix::event::poll(&mut [], Some(&timespec(time)));
}

/// A non-blocking call that finds nothing is no error; neither is a peer that has already disconnected.
fn present<T>(result: io::Result<T>) -> io::Result<Option<T>> {
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

/// Lets the kernel find a half-open connection: after 10 s of silence it sends three probes, 5 s apart. For protocols that have
/// no sign of life.
pub(super) fn probe_silence(stream: &TcpStream) -> io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, Duration::from_secs(10))?;
    sockopt::set_tcp_keepintvl(stream, Duration::from_secs(5))?;
    sockopt::set_tcp_keepcnt(stream, 3)?;
    sockopt::set_tcp_user_timeout(stream, 20_000)?;
    Ok(())
}
