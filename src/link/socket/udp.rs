//! UDP: datagrams to and from one peer.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use super::{
    ConnectError, Kept, Pause, SocketOptions, Verdict, Wait, ask_busy_poll, resolve, verdict,
};
use crate::Transport;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os::Errno;

/// UDP to one peer: datagrams of everybody else are not seen.
#[derive(Debug)]
pub(crate) struct UdpTransport {
    socket: UdpSocket,
    peer: SocketAddr,
    options: SocketOptions,
    kept: Kept,
    returns: Returns,
}

/// ICMP errors: the network reports a datagram that did not arrive.
#[derive(Debug, Default)]
struct Returns {
    /// A datagram of ours has come back, and that is not reported yet. Reported once, as by the system: a later
    /// datagram may find a listener.
    is_refused: bool,
    /// The frames are signed, and ICMP errors are not: those are counted only.
    signed: bool,
    count: u64,
}

impl Returns {
    /// Errors that a forged ICMP message can cause (icmp(7)).
    const FORGEABLE: [Errno; 7] = [
        Errno::CONNREFUSED,
        Errno::HOSTUNREACH,
        Errno::NETUNREACH,
        Errno::HOSTDOWN,
        Errno::NONET,
        Errno::NOPROTOOPT,
        Errno::PROTO,
    ];

    /// True if the error reports a returned datagram. The system reports it once, before it hands out queued datagrams.
    fn takes(&mut self, error: &io::Error) -> bool {
        if self.signed {
            let is_one = Errno::from_io_error(error).is_some_and(|e| Self::FORGEABLE.contains(&e));
            self.count += u64::from(is_one);
            return is_one;
        }
        let is_one = error.kind() == io::ErrorKind::ConnectionRefused;
        self.is_refused |= is_one;
        is_one
    }
}

/// ICMP errors in a row before a datagram counts as sent and lost.
const MOST_RETURNS: u32 = 4;

impl UdpTransport {
    /// Binds a port of the system's choice and aims it at "host:port" (the first address behind the name). Nothing is
    /// sent: the first answer shows whether a program listens.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub(crate) fn connect(address: &str, options: SocketOptions) -> Result<Self, ConnectError> {
        let addresses = resolve(address)?;
        let mut last = None;
        for peer in addresses {
            let any = if peer.is_ipv4() {
                "0.0.0.0:0"
            } else {
                "[::]:0"
            };
            let socket = UdpSocket::bind(any).and_then(|socket| {
                socket.connect(peer)?;
                Ok(socket)
            });
            match socket {
                Ok(socket) => return Self::from_socket(socket, options),
                Err(error) => {
                    last = Some(ConnectError::connect(address, Duration::ZERO, &error));
                }
            }
        }
        Err(last.unwrap_or_else(|| ConnectError::Address {
            address: address.to_owned(),
            reason: "the name has no address".to_owned(),
        }))
    }

    pub(crate) fn socket(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }

    /// Takes over a socket that is connected to its peer.
    ///
    /// # Errors
    /// [`ConnectError::Socket`], [`ConnectError::Unreachable`] if it has no peer.
    pub(crate) fn from_socket(
        socket: UdpSocket,
        options: SocketOptions,
    ) -> Result<Self, ConnectError> {
        let peer = socket
            .peer_addr()
            .map_err(|error| ConnectError::connect("the peer", Duration::ZERO, &error))?;
        socket.set_nonblocking(true).map_err(|error| {
            ConnectError::socket(&peer.to_string(), "non-blocking mode", &error)
        })?;
        ask_busy_poll(socket.as_fd(), options);
        Ok(Self {
            socket,
            peer,
            options,
            kept: Kept::new(),
            returns: Returns::default(),
        })
    }

    /// The other end.
    #[must_use]
    pub(crate) fn peer(&self) -> SocketAddr {
        self.peer
    }

    /// Changes how waits are spent.
    pub(crate) fn set_wait(&mut self, wait: Wait) {
        self.options.wait = wait;
    }

    /// A datagram leaves whole or not at all.
    fn flush(&mut self) -> Result<(), LinkFault> {
        let Self {
            socket,
            kept,
            returns,
            ..
        } = self;
        let mut tries = 0;
        kept.flush(|bytes| match socket.send(bytes) {
            Err(error) if returns.takes(&error) => {
                tries += 1;
                if tries < MOST_RETURNS {
                    Err(io::ErrorKind::Interrupted.into())
                } else {
                    Ok(bytes.len())
                }
            }
            other => other,
        })
    }
}

impl Transport for UdpTransport {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        self.flush()?;
        if !self.kept.is_empty() {
            // Two datagrams must not become one.
            return Err(LinkFault::Backpressure);
        }
        for _ in 0..MOST_RETURNS {
            match self.socket.send(frame) {
                Ok(_) => return Ok(()),
                // The refusal belongs to an earlier datagram; datagrams that the peer sent before are read first.
                Err(error) if self.returns.takes(&error) => {}
                Err(error) => match verdict(&error) {
                    Verdict::Again => {}
                    Verdict::NotNow => return self.kept.keep(frame),
                    Verdict::Lost(fault) => return Err(fault),
                },
            }
        }
        // The datagram counts as lost: no answer will come.
        Ok(())
    }

    fn trust_only_frames(&mut self) {
        self.returns.signed = true;
    }

    fn unreachable(&self) -> u64 {
        self.returns.count
    }

    /// A buffer that is smaller than the datagram receives its beginning only. Empty datagrams are passed over.
    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let mut pause = Pause::new(self.options.wait, deadline);
        loop {
            self.flush()?;
            match self.socket.recv(buffer) {
                Ok(0) => {
                    if pause.is_over() {
                        return Ok(None);
                    }
                }
                Ok(count) => return Ok(Some(count)),
                Err(error) if self.returns.takes(&error) => {
                    if self.returns.signed && pause.is_over() {
                        return Ok(None);
                    }
                }
                Err(error) => match verdict(&error) {
                    Verdict::Again => {}
                    // Its goodbye may have waited behind the refusal: it is gone when that is read.
                    Verdict::NotNow if std::mem::take(&mut self.returns.is_refused) => {
                        return Err(LinkFault::Closed);
                    }
                    Verdict::NotNow => {
                        if !pause.wait(self.socket.as_fd(), !self.kept.is_empty()) {
                            return Ok(None);
                        }
                    }
                    Verdict::Lost(fault) => return Err(fault),
                },
            }
        }
    }
}
