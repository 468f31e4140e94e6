//! A force server that speaks OpenFresco: one client at a time, one test after another, until told to stop.
//!
//! Invariants: no wait is without a limit; a client that has gone (end of stream, a reset, a half-open connection, UDP
//! silence) leaves the specimen at its last committed state and the port free; every message is answered by one
//! write, with acknowledgements not delayed, and nothing is allocated for it once the sizes have come (but over TLS, where
//! encrypting allocates). What is not here: the meaning of bytes (`dialect`), of commands (`host`), and text on a terminal.

use std::net::SocketAddr;

use super::dialect::{ExchangeFault, Machine, Role, Said};
use super::door::{Caller, Door, DoorError, Socket, socket_to, watch_over};
use super::host::{Host, HostFault, Tally};
use super::knock::line_to;
use crate::link::Transport;
use crate::link::rig::{Close, Trip, Visitor};
use crate::link::tls::{TlsFault, is_client_hello};
use crate::rt::os::monotonic_ns;
use crate::substructure::LinkFault;
use crate::time::Nanos;
use crate::wire::openfresco::{Sizes, datagrams};

/// How a server treats its clients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServeSettings {
    /// The program it takes the place of.
    pub role: Role,
    /// From the connection to the sizes, in s: who connects and says nothing must not keep the port.
    pub setup_limit_s: f64,
    /// Silence after which a client counts as gone, in s; none: as long as the connection stands. Over UDP there is
    /// no connection, so there it should be set.
    pub idle_limit_s: Option<f64>,
}

impl ServeSettings {
    /// Silence that a UDP client may keep unless told otherwise, in s.
    pub const UDP_IDLE_S: f64 = 60.0;

    /// The usual limits.
    #[must_use]
    pub const fn new(role: Role, idle_limit_s: Option<f64>) -> Self {
        Self {
            role,
            setup_limit_s: 10.0,
            idle_limit_s,
        }
    }
}

/// How a client's test ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// With the goodbye of the protocol.
    Finished,
    /// The connection was closed without a goodbye.
    Vanished,
    /// The connection broke.
    Lost(LinkFault),
    /// Nothing came for so long, in s.
    Silent(f64),
    /// It connected and sent no sizes for so long, in s.
    NoSizes(f64),
    /// There was no TLS session, or it broke.
    Tls(TlsFault),
    /// It speaks TLS, and plain TCP is served.
    SpeaksTls,
    /// Its bytes, or what they ask for, cannot be.
    Refused(ExchangeFault),
    /// The server was told to stop.
    Stopped,
}

impl End {
    /// As it stands in the summary of the log.
    const fn close(&self) -> Close {
        match self {
            Self::Finished => Close::Completed,
            Self::Stopped => Close::Interrupted,
            Self::Refused(ExchangeFault::Host(
                HostFault::Tripped(
                    Trip::Limit(_) | Trip::NotFinite { .. } | Trip::Interlock | Trip::Saturated,
                )
                | HostFault::TakenBack { .. },
            )) => Close::Stopped,
            Self::Vanished
            | Self::Tls(_)
            | Self::SpeaksTls
            | Self::Lost(_)
            | Self::Silent(_)
            | Self::NoSizes(_)
            | Self::Refused(_) => Close::Failed,
        }
    }
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Finished => f.write_str("the client ended the test"),
            Self::Vanished => f.write_str("the client closed the connection without a goodbye"),
            Self::Lost(fault) => write!(f, "the connection broke: {fault}"),
            Self::Silent(seconds) => write!(f, "the client was silent for {seconds} s"),
            Self::NoSizes(seconds) => write!(
                f,
                "the client sent no sizes within {seconds} s: it is no OpenFresco client, or the wrong dialect is served"
            ),
            Self::Tls(TlsFault::NotTls) => {
                f.write_str("TLS: it speaks no TLS, and TLS is served here (--transport tls)")
            }
            Self::Tls(fault) => write!(f, "TLS: {fault}"),
            Self::SpeaksTls => f.write_str(
                "refused: it speaks TLS, and plain TCP is served here (--transport tls)",
            ),
            Self::Refused(fault) => write!(f, "refused: {fault}"),
            Self::Stopped => f.write_str("the server was told to stop"),
        }
    }
}

/// What a server has to tell.
#[derive(Debug, Clone, PartialEq)]
pub enum News {
    /// Somebody came to the free port.
    Connected(SocketAddr),
    /// The sizes are agreed: the test may begin.
    Ready(SocketAddr, Sizes),
    /// Something about the specimen or its log, when a test begins.
    Told(SocketAddr, String),
    /// Somebody came while a client is served, and was turned away.
    TurnedAway(SocketAddr),
    /// Somebody came from a machine that may not command the specimen, and was turned away.
    NotAdmitted(SocketAddr),
    /// A datagram that can open no test.
    Stray(SocketAddr, usize),
    /// An action that the dialect does not know: it is not answered, and the client may wait for ever.
    Ignored(f64),
    /// A line of an init file, which nothing is done about.
    InitLine,
    /// The client's test is over; the port is free again.
    Ended(SocketAddr, End, Tally),
}

impl std::fmt::Display for News {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Connected(peer) => write!(f, "{peer} connected"),
            Self::Ready(peer, sizes) => {
                let [d, v, a, force, t] = sizes.ctrl().in_order();
                let [dd, dv, da, df, dt] = sizes.daq().in_order();
                write!(
                    f,
                    "{peer} commands {d} displacements, {v} velocities, {a} accelerations, {force} forces, {t} times; \
                     wants {dd} displacements, {dv} velocities, {da} accelerations, {df} forces, {dt} times; \
                     {} doubles a vector",
                    sizes.data_size()
                )
            }
            Self::Told(_, text) => f.write_str(text),
            Self::TurnedAway(peer) => write!(f, "{peer} was turned away: a client is being served"),
            Self::NotAdmitted(peer) => write!(
                f,
                "{peer} was turned away: it is not the machine that may command the specimen"
            ),
            Self::Stray(peer, bytes) => write!(f, "{peer} sent {bytes} bytes that open no test"),
            Self::Ignored(code) => {
                write!(f, "action {code} is not known here and was not answered")
            }
            Self::InitLine => f.write_str("a line of an init file was received and ignored"),
            Self::Ended(peer, end, tally) => write!(
                f,
                "{peer}: {end}; {} commands, {} steps committed, {} taken back, {} answers",
                tally.commands, tally.commits, tally.taken_back, tally.answers
            ),
        }
    }
}

/// The server looks for strangers and for the word to stop this often.
pub(super) const LOOK_NS: u64 = 50_000_000;
/// After the goodbye the client is given so long to close first.
const LINGER_NS: u64 = 500_000_000;
/// Longest chunk that is read at once; no datagram is longer.
const CHUNK: usize = 65_536;

/// Serves until `stop` says so; `tell` hears what happens.
///
/// # Errors
/// [`DoorError::Port`] if the port itself fails. How a client ends is not an error but [`News::Ended`].
pub fn serve_openfresco(
    door: &Door,
    host: &mut Host,
    settings: &ServeSettings,
    stop: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(&News),
) -> Result<(), DoorError> {
    let mut buffer = vec![0; CHUNK];
    let mut waste = vec![0; CHUNK];
    while !stop() {
        let Some(caller) = door.wait(&mut buffer, LOOK_NS)? else {
            continue;
        };
        let (Caller::Stream(_, from) | Caller::Datagram(_, from)) = &caller;
        if !door.admits(*from) {
            tell(&News::NotAdmitted(*from));
            continue;
        }
        let mut machine = Machine::new(settings.role, door.carrier(), host.axes());
        let (peer, end) = match (caller, &door.socket) {
            (Caller::Stream(stream, peer), _) => {
                tell(&News::Connected(peer));
                // A kernel that refuses to watch serves all the same.
                let _ = watch_over(&stream);
                let line = line_to(door, stream, settings, stop, tell, &mut waste);
                let end = match line {
                    Err(end) => end,
                    Ok(mut link) => Attendance {
                        door,
                        peer,
                        settings,
                        stop,
                        tell,
                    }
                    .attend(
                        link.as_mut(),
                        &mut machine,
                        host,
                        &[],
                        (&mut buffer, &mut waste),
                    ),
                };
                (peer, end)
            }
            (Caller::Datagram(count, peer), Socket::Udp(socket)) => {
                let first = buffer.get(..count).unwrap_or_default().to_vec();
                // Judged by a machine of its own: a stranger's datagram must open nothing.
                let mut judge = Machine::new(settings.role, door.carrier(), host.axes());
                if judge.hear(&first, host).is_err() {
                    tell(&News::Stray(peer, count));
                    continue;
                }
                tell(&News::Connected(peer));
                let mut link = socket_to(socket, peer)?;
                let mut early = vec![first];
                // What the peer sent before it had a socket of its own.
                while let Ok((count, from)) = socket.recv_from(&mut buffer) {
                    if from == peer {
                        early.push(buffer.get(..count).unwrap_or_default().to_vec());
                    } else {
                        tell(&News::TurnedAway(from));
                    }
                }
                let attendance = Attendance {
                    door,
                    peer,
                    settings,
                    stop,
                    tell,
                };
                let room = (&mut buffer[..], &mut waste[..]);
                (
                    peer,
                    attendance.attend(&mut link, &mut machine, host, &early, room),
                )
            }
            (Caller::Datagram(..), Socket::Tcp(_)) => continue,
        };
        let tally = if host.has_begun() {
            host.tally()
        } else {
            Tally::default()
        };
        let whole = match end {
            End::Refused(ExchangeFault::Host(fault)) => host.whole(fault),
            end => end.to_string(),
        };
        host.end(end.close(), &whole);
        tell(&News::Ended(peer, end, tally));
    }
    Ok(())
}

/// One client from its connection to its end.
struct Attendance<'a> {
    door: &'a Door,
    peer: SocketAddr,
    settings: &'a ServeSettings,
    stop: &'a dyn Fn() -> bool,
    tell: &'a mut dyn FnMut(&News),
}

impl Attendance<'_> {
    fn attend(
        mut self,
        link: &mut dyn Transport,
        machine: &mut Machine,
        host: &mut Host,
        early: &[Vec<u8>],
        (buffer, waste): (&mut [u8], &mut [u8]),
    ) -> End {
        let connected = monotonic_ns();
        let (mut heard_at, mut look_at) = (connected, connected + LOOK_NS);
        let mut ready = false;
        for datagram in early {
            match self.take(datagram, link, machine, host, &mut ready) {
                Ok(false) => {}
                Ok(true) => return self.linger(link, buffer),
                Err(end) => return end,
            }
        }
        let mut last_stranger = None;
        loop {
            match link.recv(buffer, Nanos(look_at)) {
                Ok(Some(count)) => {
                    heard_at = monotonic_ns();
                    let bytes = buffer.get(..count).unwrap_or_default();
                    match self.take(bytes, link, machine, host, &mut ready) {
                        Ok(false) => {}
                        Ok(true) => return self.linger(link, buffer),
                        Err(end) => return end,
                    }
                }
                Ok(None) => {}
                Err(fault) => return lost(link, fault),
            }
            let now = monotonic_ns();
            if now < look_at {
                continue;
            }
            look_at = now + LOOK_NS;
            let tell = &mut *self.tell;
            self.door.turn_away(waste, &mut |from| {
                if last_stranger != Some(from) {
                    tell(&News::TurnedAway(from));
                }
                last_stranger = Some(from);
            });
            if (self.stop)() {
                return End::Stopped;
            }
            if let Err(fault) = host.attend() {
                return fault.into();
            }
            let limit = self.settings.setup_limit_s;
            if !ready && seconds(now, connected) > limit {
                return End::NoSizes(limit);
            }
            if let Some(limit) = self.settings.idle_limit_s
                && seconds(now, heard_at) > limit
            {
                return End::Silent(limit);
            }
        }
    }

    /// Does what some bytes say; true at the goodbye. Real-time: yes, after the sizes.
    fn take(
        &mut self,
        bytes: &[u8],
        link: &mut dyn Transport,
        machine: &mut Machine,
        host: &mut Host,
        ready: &mut bool,
    ) -> Result<bool, End> {
        if !*ready && matches!(self.door.socket, Socket::Tcp(_)) && is_client_hello(bytes) {
            return Err(End::SpeaksTls);
        }
        let mut rest = bytes;
        while !rest.is_empty() {
            let piece = match self.door.socket {
                Socket::Tcp(_) => usize::MAX,
                Socket::Udp(_) => machine.piece(),
            };
            let heard = machine.hear(rest, host).map_err(End::Refused)?;
            for part in datagrams(heard.reply, heard.reply.len(), piece) {
                if let Err(fault) = link.send(part) {
                    return Err(lost(link, fault));
                }
            }
            match heard.said {
                Said::Nothing => {}
                Said::Ready(sizes) => {
                    *ready = true;
                    (self.tell)(&News::Ready(self.peer, sizes));
                    if host.has_begun() {
                        continue;
                    }
                    // Only now: a stranger who merely connects must not make a specimen move.
                    let begun = host.begin(&Visitor::unnamed(self.peer));
                    let told = begun.map_err(|text| {
                        (self.tell)(&News::Told(self.peer, text));
                        End::from(HostFault::Unavailable)
                    })?;
                    for text in told {
                        (self.tell)(&News::Told(self.peer, text));
                    }
                }
                Said::InitLine => (self.tell)(&News::InitLine),
                Said::Ignored(code) => (self.tell)(&News::Ignored(code)),
                Said::Finished => return Ok(true),
            }
            if heard.used == 0 {
                break;
            }
            rest = rest.get(heard.used..).unwrap_or_default();
        }
        Ok(false)
    }

    /// Lets the client close first, so that its last answer is not torn away by a reset.
    fn linger(self, link: &mut dyn Transport, buffer: &mut [u8]) -> End {
        if matches!(self.door.socket, Socket::Tcp(_)) {
            let until = Nanos(monotonic_ns() + LINGER_NS);
            while let Ok(Some(_)) = link.recv(buffer, until) {}
        }
        End::Finished
    }
}

impl From<HostFault> for End {
    fn from(fault: HostFault) -> Self {
        Self::Refused(fault.into())
    }
}

fn lost(link: &dyn Transport, fault: LinkFault) -> End {
    match (link.tls_fault(), fault) {
        (Some(why), _) => End::Tls(why),
        (None, LinkFault::Closed) => End::Vanished,
        (None, fault) => End::Lost(fault),
    }
}

fn seconds(now: u64, since: u64) -> f64 {
    now.saturating_sub(since) as f64 * 1e-9
}
