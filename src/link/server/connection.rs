//! What a session's bytes go over, with the faults that are played on it.

use super::wire_end::FarEnd;
use crate::config::fault_script::Script;
use crate::link::fault::FaultyWire;
use crate::link::tls::{TlsFault, TlsStream};
use crate::link::{TcpTransport, Transport, UdpTransport, Wait};
use crate::rt::os;
use crate::substructure::LinkFault;
use crate::time::Nanos;

/// What carries the bytes: the data thread changes how it waits.
pub(super) enum Carried {
    Tcp(TcpTransport),
    Udp(UdpTransport),
    Tls(Box<TlsStream>),
    Simulated(Box<FarEnd>),
}

/// The far end's end of a connection.
pub(super) enum Line {
    Plain(Carried),
    Faulty(Box<FaultyWire<Carried>>),
}

impl Line {
    /// The same, on which `script` is played for a test with ticks of `tick_ns`, whose commands count from `first` on.
    pub fn played(self, script: &Script, tick_ns: u64, first: u64) -> Self {
        match self {
            Line::Plain(carried) => {
                let mut wire = FaultyWire::new(carried, script, tick_ns);
                wire.armed(first);
                Line::Faulty(Box::new(wire))
            }
            Line::Faulty(_) => self,
        }
    }

    /// Commands count from this number on.
    pub fn armed(&mut self, first: u64) {
        if let Line::Faulty(faulty) = self {
            faulty.armed(first);
        }
    }

    /// True if a fault that is played has closed it.
    pub fn is_cut(&self) -> bool {
        match self {
            Line::Plain(_) => false,
            Line::Faulty(faulty) => faulty.is_closed(),
        }
    }

    pub fn set_wait(&mut self, wait: Wait) {
        match self.carried() {
            Carried::Tcp(tcp) => tcp.set_wait(wait),
            Carried::Udp(udp) => udp.set_wait(wait),
            Carried::Tls(tls) => tls.set_wait(wait),
            Carried::Simulated(_) => {}
        }
    }

    /// The simulated end of the wire, if time is simulated.
    pub fn far_end(&mut self) -> Option<&mut FarEnd> {
        match self.carried() {
            Carried::Simulated(end) => Some(end),
            Carried::Tcp(_) | Carried::Udp(_) | Carried::Tls(_) => None,
        }
    }

    fn carried(&mut self) -> &mut Carried {
        match self {
            Line::Plain(carried) => carried,
            Line::Faulty(faulty) => faulty.inner_mut(),
        }
    }
}

impl From<Carried> for Line {
    fn from(carried: Carried) -> Self {
        Line::Plain(carried)
    }
}

impl Transport for Carried {
    fn trust_only_frames(&mut self) {
        if let Carried::Udp(udp) = self {
            udp.trust_only_frames();
        }
    }

    fn unreachable(&self) -> u64 {
        match self {
            Carried::Udp(udp) => udp.unreachable(),
            Carried::Tcp(_) | Carried::Tls(_) | Carried::Simulated(_) => 0,
        }
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        match self {
            Carried::Tcp(tcp) => tcp.send(frame),
            Carried::Udp(udp) => udp.send(frame),
            Carried::Tls(tls) => tls.send(frame),
            Carried::Simulated(end) => end.send(frame),
        }
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        match self {
            Carried::Tcp(tcp) => tcp.recv(buffer, deadline),
            Carried::Udp(udp) => udp.recv(buffer, deadline),
            Carried::Tls(tls) => tls.recv(buffer, deadline),
            Carried::Simulated(end) => end.recv(buffer, deadline),
        }
    }

    fn now(&self) -> Nanos {
        match self {
            Carried::Tcp(_) | Carried::Udp(_) | Carried::Tls(_) => Nanos(os::monotonic_ns()),
            Carried::Simulated(end) => end.now(),
        }
    }

    fn tls_fault(&self) -> Option<TlsFault> {
        match self {
            Carried::Tls(tls) => tls.tls_fault(),
            Carried::Tcp(_) | Carried::Udp(_) | Carried::Simulated(_) => None,
        }
    }
}

impl Transport for Line {
    fn trust_only_frames(&mut self) {
        match self {
            Line::Plain(carried) => carried.trust_only_frames(),
            Line::Faulty(faulty) => faulty.trust_only_frames(),
        }
    }

    fn unreachable(&self) -> u64 {
        match self {
            Line::Plain(carried) => carried.unreachable(),
            Line::Faulty(faulty) => faulty.unreachable(),
        }
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        match self {
            Line::Plain(carried) => carried.send(frame),
            Line::Faulty(faulty) => faulty.send(frame),
        }
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        match self {
            Line::Plain(carried) => carried.recv(buffer, deadline),
            Line::Faulty(faulty) => faulty.recv(buffer, deadline),
        }
    }

    fn now(&self) -> Nanos {
        match self {
            Line::Plain(carried) => carried.now(),
            Line::Faulty(faulty) => faulty.now(),
        }
    }

    fn tls_fault(&self) -> Option<TlsFault> {
        match self {
            Line::Plain(carried) => carried.tls_fault(),
            Line::Faulty(faulty) => faulty.tls_fault(),
        }
    }
}
