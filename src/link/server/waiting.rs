//! One waiting client: its connection, its handshake, and the time limit of the present phase.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::os::fd::BorrowedFd;

use super::admission::Candidate;
use super::connection::Connection;
use super::handshake::{Handshake, Opening};
use super::handshake_step::{Failure, Step};
use super::listener::{Listener, Opened};
use super::shared::Shared;
use crate::Transport;
use crate::socket::LOOK;
use crate::tls::TlsStream;
use gusset_record::rt::os::monotonic_ns;

/// Reads from one client in one turn: a talkative client must not delay the others.
const MOST_READS: u32 = 8;
/// Datagrams that are kept for one client.
const MOST_KEPT: usize = 64;
/// Bytes of a stream that are read at once: a handshake takes them whole.
const CHUNK: usize = 4096;

/// How the bytes of a waiting client arrive.
pub(super) enum Route {
    /// A connection whose TLS session is still to come.
    Encrypting(Box<TlsStream>),
    Connected(Connection),
    /// Datagrams of the common socket that the handshake has not taken yet.
    Datagrams(VecDeque<Vec<u8>>),
}

/// A client whose handshake is not complete.
pub(super) struct WaitingClient {
    peer: SocketAddr,
    route: Route,
    handshake: Handshake,
    /// The present phase of the handshake, and its beginning.
    phase: u8,
    since_ns: u64,
}

impl WaitingClient {
    pub(crate) fn new(peer: SocketAddr, route: Route, handshake: Handshake) -> Self {
        let now_ns = monotonic_ns();
        let (phase, _) = handshake.phase(matches!(route, Route::Encrypting(_)));
        Self {
            peer,
            route,
            handshake,
            phase,
            since_ns: now_ns,
        }
    }

    pub(crate) const fn peer(&self) -> SocketAddr {
        self.peer
    }

    pub(crate) fn candidate(&self) -> Candidate {
        Candidate {
            peer: self.peer,
            has_spoken: self.handshake.has_spoken(),
        }
    }

    pub(crate) const fn handshake(&self) -> &Handshake {
        &self.handshake
    }

    /// Its own socket, if it has one.
    pub(crate) fn fd(&self) -> Option<BorrowedFd<'_>> {
        match &self.route {
            Route::Encrypting(tls) => Some(tls.socket()),
            Route::Connected(connection) => connection.fd(),
            Route::Datagrams(_) => None,
        }
    }

    /// Its time limits count from now: its bytes were not read while another client was served.
    pub(crate) fn restart(&mut self) {
        self.since_ns = monotonic_ns();
    }

    /// Keeps a datagram for a later turn; false if its bytes do not arrive in datagrams. Surplus datagrams are dropped. `opens`: it
    /// opens a test; repeated, it needs no second place.
    pub(crate) fn keep(&mut self, datagram: &[u8], opens: bool) -> bool {
        let Route::Datagrams(kept) = &mut self.route else {
            return false;
        };
        let is_repeated = opens && kept.back().is_some_and(|last| last == datagram);
        if !is_repeated && kept.len() < MOST_KEPT {
            kept.push_back(datagram.to_vec());
        }
        true
    }

    /// Reads the received bytes, without waiting, and answers them.
    pub(crate) fn attend(
        &mut self,
        listener: &Listener,
        shared: &Shared,
        buffer: &mut [u8],
    ) -> Result<Step, Failure> {
        if !self.encrypt()? {
            return self.in_time();
        }
        for _ in 0..MOST_READS {
            let bytes = match &mut self.route {
                Route::Encrypting(_) => break,
                Route::Connected(connection) => {
                    let chunk = CHUNK.min(buffer.len());
                    let chunk = buffer.get_mut(..chunk).unwrap_or_default();
                    match connection.recv(chunk, LOOK) {
                        Ok(Some(count)) => chunk.get(..count).unwrap_or_default().to_vec(),
                        Ok(None) => break,
                        Err(fault) => return Err(self.handshake.link_lost(connection, fault)),
                    }
                }
                Route::Datagrams(kept) => match kept.pop_front() {
                    Some(datagram) => datagram,
                    None => break,
                },
            };
            match self.take(&bytes, listener, shared) {
                Ok(Step::More) => {}
                Ok(Step::Complete) => return Ok(Step::Complete),
                Err(failure) => {
                    self.refuse(failure.frame(), listener);
                    return Err(failure);
                }
            }
        }
        self.in_time()
    }

    fn take(
        &mut self,
        bytes: &[u8],
        listener: &Listener,
        shared: &Shared,
    ) -> Result<Step, Failure> {
        let mut replies = Vec::new();
        let step = self
            .handshake
            .take(bytes, self.peer, shared, &mut replies)?;
        for reply in replies {
            match &mut self.route {
                Route::Connected(connection) => {
                    if let Err(fault) = connection.send(&reply) {
                        return Err(self.handshake.link_lost(connection, fault));
                    }
                }
                // The network may lose a datagram; then the client asks again.
                Route::Datagrams(_) => {
                    let _ = listener.send_to(&reply, self.peer);
                }
                Route::Encrypting(_) => {}
            }
        }
        Ok(step)
    }

    /// Continues the start of the TLS session, if the server uses TLS; true once bytes can be read.
    fn encrypt(&mut self) -> Result<bool, Failure> {
        let Route::Encrypting(session) = &mut self.route else {
            return Ok(true);
        };
        match session.handshake(LOOK) {
            Ok(false) => return Ok(false),
            Ok(true) => {}
            Err(fault) => {
                session.close_gently();
                return Err(self.handshake.tls_failed(fault, session.detail()));
            }
        }
        let none = Route::Datagrams(VecDeque::new());
        if let Route::Encrypting(session) = std::mem::replace(&mut self.route, none) {
            self.route = Route::Connected(Connection::Tls(session));
        }
        Ok(true)
    }

    /// Sends the last bytes of a refusal. A client that does not take them sees the connection close.
    fn refuse(&mut self, frame: &[u8], listener: &Listener) {
        match &mut self.route {
            Route::Connected(connection) => {
                if !frame.is_empty() {
                    let _ = connection.send(frame);
                }
                connection.close_gently();
            }
            Route::Datagrams(_) if !frame.is_empty() => {
                let _ = listener.send_to(frame, self.peer);
            }
            Route::Encrypting(_) | Route::Datagrams(_) => {}
        }
    }

    /// Checks the time limit of the phase.
    fn in_time(&mut self) -> Result<Step, Failure> {
        let is_encrypting = matches!(self.route, Route::Encrypting(_));
        let (phase, limit) = self.handshake.phase(is_encrypting);
        let now_ns = monotonic_ns();
        if phase != self.phase {
            (self.phase, self.since_ns) = (phase, now_ns);
        }
        if u128::from(now_ns.saturating_sub(self.since_ns)) <= limit.as_nanos() {
            return Ok(Step::More);
        }
        Err(self.handshake.timed_out(is_encrypting))
    }

    /// Number of datagrams that are kept for later.
    #[cfg(test)]
    pub(crate) fn kept(&self) -> usize {
        match &self.route {
            Route::Datagrams(kept) => kept.len(),
            Route::Encrypting(_) | Route::Connected(_) => 0,
        }
    }

    /// The parts of a client whose handshake is complete.
    pub(crate) fn into_parts(self) -> Option<(SocketAddr, Route, Opening)> {
        Some((self.peer, self.route, self.handshake.into_opening()?))
    }
}

impl From<Opened> for Route {
    fn from(opened: Opened) -> Self {
        match opened {
            Opened::Plain(connection) => Self::Connected(connection),
            Opened::Encrypting(session) => Self::Encrypting(session),
        }
    }
}
