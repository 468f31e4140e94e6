//! TLS on the thread that asks: a server's data thread, and the handshake of both ends.
//!
//! Encrypting allocates, so this is not for the loop's thread.

use std::net::{Shutdown, SocketAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};

use rustix::net::sockopt;
use rustls::Connection;

use super::RECORD_LIMIT_NS;
use super::session::Session;
use crate::socket::{Pause, SocketOptions, Wait, discard, has_hung_up};
use crate::tls_fault::TlsFault;
use crate::{TcpTransport, Transport};
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;

/// A TLS session on a TCP connection.
pub struct TlsStream {
    pub(super) session: Session,
    stream: TcpStream,
    peer: SocketAddr,
    options: SocketOptions,
    /// A frame waits because the socket takes no bytes.
    waits: bool,
    record_limit_ns: u64,
    fault: Option<TlsFault>,
}

impl std::fmt::Debug for TlsStream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TlsStream")
            .field("peer", &self.peer)
            .field("fault", &self.fault)
            .finish_non_exhaustive()
    }
}

impl TlsStream {
    pub(super) fn new(tcp: TcpTransport, tls: Connection) -> Self {
        Self::over(tcp, Session::new(tls))
    }

    /// A session that has begun elsewhere.
    pub(super) fn over(tcp: TcpTransport, session: Session) -> Self {
        let (stream, peer, options) = tcp.into_parts();
        Self {
            session,
            stream,
            peer,
            options,
            waits: false,
            record_limit_ns: RECORD_LIMIT_NS,
            fault: None,
        }
    }

    /// The other end.
    #[must_use]
    pub(crate) const fn peer(&self) -> SocketAddr {
        self.peer
    }

    /// Changes how waits are spent.
    pub(crate) const fn set_wait(&mut self, wait: Wait) {
        self.options.wait = wait;
    }

    pub(super) const fn set_record_limit(&mut self, limit_ns: u64) {
        self.record_limit_ns = limit_ns;
    }

    pub(super) const fn record_limit_ns(&self) -> u64 {
        self.record_limit_ns
    }

    pub(super) const fn options(&self) -> SocketOptions {
        self.options
    }

    pub(crate) fn socket(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }

    /// Continues the handshake until `until`; true when it is done.
    ///
    /// # Errors
    /// Why there will be no session.
    pub fn handshake(&mut self, until: Nanos) -> Result<bool, TlsFault> {
        let mut pause = Pause::new(Wait::SLEEP, until);
        loop {
            self.push()?;
            if !self.session.is_handshaking() {
                return Ok(true);
            }
            if self.pull()? {
                continue;
            }
            if !pause.wait(self.stream.as_fd(), self.session.wants_write()) {
                return Ok(false);
            }
        }
    }

    pub(super) fn pull(&mut self) -> Result<bool, TlsFault> {
        self.quick_ack();
        let pulled = self.session.pull(&mut &self.stream);
        if matches!(pulled, Ok(true)) {
            self.quick_ack();
        }
        pulled.inspect_err(|fault| self.fault = Some(*fault))
    }

    pub(super) fn push(&mut self) -> Result<(), TlsFault> {
        let pushed = self.session.push(&mut &self.stream);
        self.waits &= self.session.wants_write();
        pushed.inspect_err(|fault| self.fault = Some(*fault))
    }

    pub(super) fn take(&mut self, buffer: &mut [u8]) -> Result<Option<usize>, TlsFault> {
        self.session
            .take(buffer)
            .inspect_err(|fault| self.fault = Some(*fault))
    }

    /// An error once a record has been waiting for its rest for too long.
    pub(super) fn check_record(&mut self) -> Result<(), TlsFault> {
        match self.session.records().waiting() {
            Some((got, of, since))
                if os::monotonic_ns().saturating_sub(since) >= self.record_limit_ns =>
            {
                let fault = TlsFault::Stalled { got, of };
                self.fault = Some(fault);
                Err(fault)
            }
            _ => Ok(()),
        }
    }

    /// Details of the failure of the session, if the TLS library gives them.
    pub(crate) fn detail(&self) -> Option<&str> {
        self.session.detail()
    }

    /// Sends the reason why the session ends, closes the writing half, and reads the bytes that have arrived.
    pub(crate) fn close_gently(&mut self) {
        if self.fault.is_none() && !self.session.is_handshaking() {
            self.say_closed();
        } else {
            let _ = self.session.push(&mut &self.stream);
        }
        let _ = self.stream.shutdown(Shutdown::Write);
        discard(&self.stream);
    }

    pub(super) fn say_closed(&mut self) {
        self.session.say_closed(&mut &self.stream);
    }

    fn quick_ack(&self) {
        if self.options.quick_ack {
            // If the kernel does not support it, acknowledgements are merely slower.
            let _ = sockopt::set_tcp_quickack(&self.stream, true);
        }
    }
}

impl Drop for TlsStream {
    fn drop(&mut self) {
        if self.fault.is_none() {
            self.say_closed();
        }
    }
}

impl Transport for TlsStream {
    fn has_hung_up(&self) -> bool {
        has_hung_up(self.stream.as_fd())
    }

    /// Real-time: no.
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        self.push().map_err(TlsFault::link)?;
        if self.waits {
            return Err(LinkFault::Backpressure);
        }
        self.waits = self.session.wants_write();
        self.session.put(frame).map_err(TlsFault::link)?;
        self.push().map_err(TlsFault::link)?;
        self.waits = self.session.wants_write();
        Ok(())
    }

    /// Real-time: no.
    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let mut pause = Pause::new(self.options.wait, deadline);
        loop {
            if let Some(count) = self.take(buffer).map_err(TlsFault::link)? {
                return Ok(Some(count));
            }
            self.push().map_err(TlsFault::link)?;
            if self.pull().map_err(TlsFault::link)? {
                continue;
            }
            if !pause.wait(self.stream.as_fd(), self.session.wants_write()) {
                self.check_record().map_err(TlsFault::link)?;
                return Ok(None);
            }
        }
    }

    fn tls_fault(&self) -> Option<TlsFault> {
        self.fault.filter(|fault| fault.is_telling())
    }
}
