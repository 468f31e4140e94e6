//! TCP: a stream of bytes without Nagle's pause and without delayed acknowledgements.
//!
//! An end that still has Nagle's algorithm on sends its second small message when the first is acknowledged, and the
//! kernel puts that off by 40 ms in the hope of an answer that could carry it. So, before each wait that follows bytes
//! which nothing of ours has answered, TCP_QUICKACK sends the acknowledgement at once (the kernel forgets the setting by
//! itself). Where an answer is sent, it carries the acknowledgement: another packet would only cost both ends a third of
//! the round trip.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use rustix::net::sockopt;

use super::{
    ConnectError, Kept, LOOK, Pause, SocketOptions, Verdict, Wait, ask_busy_poll, has_hung_up,
    resolve, verdict,
};
use crate::Transport;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use std::io;

/// A TCP connection.
#[derive(Debug)]
pub(crate) struct TcpTransport {
    stream: TcpStream,
    peer: SocketAddr,
    options: SocketOptions,
    kept: Kept,
    /// Bytes have come and nothing has been sent since.
    owes_ack: bool,
}

impl TcpTransport {
    /// Connects to "host:port" within `limit`; every address behind the name is tried.
    ///
    /// # Errors
    /// Why the last of them failed.
    pub(crate) fn connect(
        address: &str,
        limit: Duration,
        options: SocketOptions,
    ) -> Result<Self, ConnectError> {
        let addresses = resolve(address)?;
        let share = (limit / u32::try_from(addresses.len()).unwrap_or(1).max(1))
            .max(Duration::from_millis(1));
        let mut last = None;
        for peer in &addresses {
            match TcpStream::connect_timeout(peer, share) {
                Ok(stream) => return Self::from_stream(stream, options),
                Err(error) => last = Some(ConnectError::connect(address, limit, &error)),
            }
        }
        Err(last.unwrap_or_else(|| ConnectError::Address {
            address: address.to_owned(),
            reason: "the name has no address".to_owned(),
        }))
    }

    /// Takes over a connection: of a listener, for instance.
    ///
    /// # Errors
    /// [`ConnectError::Socket`], [`ConnectError::Unreachable`] if it is already closed.
    pub(crate) fn from_stream(
        stream: TcpStream,
        options: SocketOptions,
    ) -> Result<Self, ConnectError> {
        let peer = stream
            .peer_addr()
            .map_err(|error| ConnectError::connect("the peer", Duration::ZERO, &error))?;
        let name = peer.to_string();
        let wrong = |what| move |error: io::Error| (what, error);
        stream
            .set_nonblocking(true)
            .map_err(wrong("non-blocking mode"))
            .and_then(|()| stream.set_nodelay(true).map_err(wrong("TCP_NODELAY")))
            .map_err(|(what, error)| ConnectError::socket(&name, what, &error))?;
        ask_busy_poll(stream.as_fd(), options);
        Ok(Self {
            stream,
            peer,
            options,
            kept: Kept::new(),
            // Another reader may have read from it before.
            owes_ack: true,
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

    pub(crate) fn socket(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }

    /// Closes the writing half, and reads the received bytes: unread data would turn the close into a reset.
    pub(crate) fn close_gently(&mut self) {
        let _ = self.flush();
        let _ = self.stream.shutdown(Shutdown::Write);
        discard(&self.stream);
    }

    /// The bare socket, its peer and its options, for another transport over it.
    pub(crate) fn into_parts(self) -> (TcpStream, SocketAddr, SocketOptions) {
        (self.stream, self.peer, self.options)
    }

    fn acknowledge(&mut self) {
        if std::mem::take(&mut self.owes_ack) && self.options.quick_ack {
            // If the kernel does not support it, acknowledgements are merely slower.
            let _ = sockopt::set_tcp_quickack(&self.stream, true);
        }
    }

    fn flush(&mut self) -> Result<(), LinkFault> {
        let stream = &mut self.stream;
        self.kept.flush(|bytes| stream.write(bytes))
    }
}

/// Reads and drops received bytes on a non-blocking connection. Bounded: a peer that floods gets the reset.
pub(crate) fn discard(mut stream: &TcpStream) {
    let mut waste = [0; 4096];
    for _ in 0..64 {
        if !matches!(stream.read(&mut waste), Ok(1..)) {
            return;
        }
    }
}

impl Transport for TcpTransport {
    fn has_hung_up(&self) -> bool {
        has_hung_up(self.stream.as_fd())
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        self.flush()?;
        if !self.kept.is_empty() {
            return self.kept.keep(frame);
        }
        let mut rest = frame;
        while !rest.is_empty() {
            match self.stream.write(rest) {
                Ok(0) => return Err(LinkFault::Closed),
                Ok(taken) => {
                    rest = rest.get(taken..).unwrap_or_default();
                    self.owes_ack = false;
                }
                Err(error) => match verdict(&error) {
                    Verdict::Again => {}
                    Verdict::NotNow => return self.kept.keep(rest),
                    Verdict::Lost(fault) => return Err(fault),
                },
            }
        }
        Ok(())
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let mut pause = Pause::new(self.options.wait, deadline);
        loop {
            self.flush()?;
            match self.stream.read(buffer) {
                Ok(0) if buffer.is_empty() => return Ok(Some(0)),
                Ok(0) => return Err(LinkFault::Closed),
                Ok(count) => {
                    self.owes_ack = true;
                    return Ok(Some(count));
                }
                Err(error) => match verdict(&error) {
                    Verdict::Again => {}
                    Verdict::NotNow => {
                        // After a mere look an answer may follow.
                        if deadline != LOOK {
                            self.acknowledge();
                        }
                        if !pause.wait(self.stream.as_fd(), !self.kept.is_empty()) {
                            return Ok(None);
                        }
                    }
                    Verdict::Lost(fault) => return Err(fault),
                },
            }
        }
    }
}
