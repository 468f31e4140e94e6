//! One peer before it is the client: its bytes are read up to the sizes, and no specimen hears of it.

use std::collections::VecDeque;
use std::net::{SocketAddr, UdpSocket};

use super::dialect::{Machine, Said};
use super::door::{Door, Socket};
use super::host::Host;
use super::news::{End, News, lost};
use crate::link::Transport;
use crate::link::socket::LOOK;
use crate::link::tls::{TlsFault, TlsStream, is_client_hello};
use crate::rt::os::monotonic_ns;
use crate::wire::openfresco::{Sizes, datagrams};

/// Reads of one guest in one look: a talkative one must not hold up the others.
const MOST_READS: u32 = 8;

/// A client that has not said in full what it wants, or waits.
pub(super) struct Guest {
    pub peer: SocketAddr,
    pub line: Line,
    pub machine: Machine,
    pub came_ns: u64,
    pub has_spoken: bool,
}

/// What carries the bytes of a guest.
pub(super) enum Line {
    /// Over TLS, whose handshake is not done.
    Shaking(Box<TlsStream>),
    Open(Box<dyn Transport>),
    /// Datagrams that came through the door and were not read yet.
    Letters(VecDeque<Vec<u8>>),
}

/// The state of a guest after its bytes were read.
pub(super) enum Heard {
    /// No more for now.
    Nothing,
    Ready(Sizes, Vec<Vec<u8>>),
}

impl Guest {
    /// Reads what has arrived from the guest, without waiting.
    pub(super) fn hear(
        &mut self,
        door: &Door,
        host: &mut Host,
        tell: &mut dyn FnMut(&News),
        buffer: &mut [u8],
        limit_s: f64,
    ) -> Result<Heard, End> {
        if let Line::Shaking(session) = &mut self.line
            && session.handshake(LOOK).map_err(End::Tls)?
            && let Line::Shaking(session) =
                std::mem::replace(&mut self.line, Line::Letters(VecDeque::new()))
        {
            self.line = Line::Open(session);
        }
        for _ in 0..MOST_READS {
            let bytes = match &mut self.line {
                Line::Shaking(_) => break,
                Line::Open(link) => match link.recv(buffer, LOOK) {
                    Ok(Some(count)) => buffer.get(..count).unwrap_or_default().to_vec(),
                    Ok(None) => break,
                    Err(fault) => {
                        let end = lost(link.as_ref(), fault);
                        return Err(end.within(self.machine.partial()));
                    }
                },
                Line::Letters(letters) => match letters.pop_front() {
                    Some(letter) => letter,
                    None => break,
                },
            };
            if matches!(door.socket, Socket::Tcp(_)) && is_client_hello(&bytes) {
                return Err(End::SpeaksTls);
            }
            self.has_spoken = true;
            if let Some((sizes, rest)) = self.digest(&bytes, door, host, tell)? {
                let mut early = vec![rest];
                if let Line::Letters(letters) = &mut self.line {
                    early.extend(letters.drain(..));
                }
                return Ok(Heard::Ready(sizes, early));
            }
        }
        if seconds(monotonic_ns(), self.came_ns) <= limit_s {
            return Ok(Heard::Nothing);
        }
        Err(match &self.line {
            Line::Shaking(_) => End::Tls(TlsFault::SlowHandshake),
            Line::Open(_) | Line::Letters(_) => End::NoSizes(limit_s),
        })
    }

    /// Does what some bytes of his say, up to the sizes; those, and what comes behind them.
    fn digest(
        &mut self,
        bytes: &[u8],
        door: &Door,
        host: &mut Host,
        tell: &mut dyn FnMut(&News),
    ) -> Result<Option<(Sizes, Vec<u8>)>, End> {
        let mut rest = bytes;
        while !rest.is_empty() {
            let piece = match door.socket {
                Socket::Tcp(_) => usize::MAX,
                Socket::Udp(_) => self.machine.piece(),
            };
            // Before the sizes no specimen is queried.
            let heard = self.machine.hear(rest, host, &mut || true);
            let heard = heard.map_err(End::Refused)?;
            for part in datagrams(heard.reply, heard.reply.len(), piece) {
                match (&mut self.line, &door.socket) {
                    (Line::Open(link), _) => {
                        let sent = link.send(part);
                        sent.map_err(|fault| lost(link.as_ref(), fault))?;
                    }
                    (Line::Letters(_), Socket::Udp(socket)) => post(socket, part, self.peer)?,
                    (Line::Shaking(_), _) | (Line::Letters(_), Socket::Tcp(_)) => {}
                }
            }
            let used = heard.used;
            match heard.said {
                // No command comes before the sizes.
                Said::Nothing | Said::Reset => {}
                Said::Ready(sizes) => {
                    let rest = rest.get(used..).unwrap_or_default();
                    return Ok(Some((sizes, rest.to_vec())));
                }
                Said::InitLine => tell(&News::InitLine),
                Said::Ignored(code) => tell(&News::Ignored(code)),
                Said::Finished => return Err(End::Finished),
            }
            if used == 0 {
                break;
            }
            rest = rest.get(used..).unwrap_or_default();
        }
        Ok(None)
    }
}

fn post(socket: &UdpSocket, part: &[u8], peer: SocketAddr) -> Result<(), End> {
    match socket.send_to(part, peer) {
        Ok(_) => Ok(()),
        Err(_) => Err(End::Vanished),
    }
}

/// Seconds from one time in ns to another.
pub(super) fn seconds(now: u64, since: u64) -> f64 {
    now.saturating_sub(since) as f64 * 1e-9
}
