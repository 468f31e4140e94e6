//! The connection to one client, with the faults that are played on it.
//!
//! A [`Connection`] carries bytes over TCP, UDP, TLS or a simulated wire. A [`ClientLink`] adds the faults of a script.

use std::os::fd::BorrowedFd;

use super::wire_end::WireEnd;
use crate::fault::FaultyWire;
use crate::tls::{TlsFault, TlsStream};
use crate::{TcpTransport, Transport, UdpTransport, Wait};
use gusset_config::fault_script::Script;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;

/// The transport of a connection.
pub(super) enum Connection {
    Tcp(TcpTransport),
    Udp(UdpTransport),
    Tls(Box<TlsStream>),
    Simulated(Box<WireEnd>),
}

impl Connection {
    /// The socket, if there is one.
    pub(crate) fn fd(&self) -> Option<BorrowedFd<'_>> {
        match self {
            Connection::Tcp(tcp) => Some(tcp.socket()),
            Connection::Udp(udp) => Some(udp.socket()),
            Connection::Tls(tls) => Some(tls.socket()),
            Connection::Simulated(_) => None,
        }
    }

    /// Closes the writing half and reads the bytes that have arrived. Otherwise the close could destroy our last bytes.
    pub(crate) fn close_gently(&mut self) {
        match self {
            Connection::Tcp(tcp) => tcp.close_gently(),
            Connection::Tls(tls) => tls.close_gently(),
            Connection::Udp(_) | Connection::Simulated(_) => {}
        }
    }
}

/// The connection to a client, with or without faults.
pub(super) enum ClientLink {
    Plain(Connection),
    Faulty(Box<FaultyWire<Connection>>),
}

impl ClientLink {
    /// Plays `script` on this link. The ticks of the test have a length of `tick_ns`; its first command has the number `first`.
    pub(crate) fn played(self, script: &Script, tick_ns: u64, first: u64) -> Self {
        match self {
            ClientLink::Plain(connection) => {
                let mut wire = FaultyWire::new(connection, script, tick_ns);
                wire.armed(first);
                ClientLink::Faulty(Box::new(wire))
            }
            ClientLink::Faulty(_) => self,
        }
    }

    /// The first command of the test has this number.
    pub(crate) fn armed(&mut self, first: u64) {
        if let ClientLink::Faulty(faulty) = self {
            faulty.armed(first);
        }
    }

    /// True if a fault of the script has closed the link.
    pub(crate) fn is_cut(&self) -> bool {
        match self {
            ClientLink::Plain(_) => false,
            ClientLink::Faulty(faulty) => faulty.is_closed(),
        }
    }

    pub(crate) fn set_wait(&mut self, wait: Wait) {
        match self.connection() {
            Connection::Tcp(tcp) => tcp.set_wait(wait),
            Connection::Udp(udp) => udp.set_wait(wait),
            Connection::Tls(tls) => tls.set_wait(wait),
            Connection::Simulated(_) => {}
        }
    }

    /// The simulated end of the wire, if time is simulated.
    pub(crate) fn wire_end(&mut self) -> Option<&mut WireEnd> {
        match self.connection() {
            Connection::Simulated(end) => Some(end),
            Connection::Tcp(_) | Connection::Udp(_) | Connection::Tls(_) => None,
        }
    }

    fn connection(&mut self) -> &mut Connection {
        match self {
            ClientLink::Plain(connection) => connection,
            ClientLink::Faulty(faulty) => faulty.inner_mut(),
        }
    }
}

impl From<Connection> for ClientLink {
    fn from(connection: Connection) -> Self {
        ClientLink::Plain(connection)
    }
}

impl Transport for Connection {
    fn has_hung_up(&self) -> bool {
        match self {
            Connection::Tcp(tcp) => tcp.has_hung_up(),
            Connection::Tls(tls) => tls.has_hung_up(),
            Connection::Udp(_) | Connection::Simulated(_) => false,
        }
    }

    fn trust_only_frames(&mut self) {
        if let Connection::Udp(udp) = self {
            udp.trust_only_frames();
        }
    }

    fn unreachable(&self) -> u64 {
        match self {
            Connection::Udp(udp) => udp.unreachable(),
            Connection::Tcp(_) | Connection::Tls(_) | Connection::Simulated(_) => 0,
        }
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        match self {
            Connection::Tcp(tcp) => tcp.send(frame),
            Connection::Udp(udp) => udp.send(frame),
            Connection::Tls(tls) => tls.send(frame),
            Connection::Simulated(end) => end.send(frame),
        }
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        match self {
            Connection::Tcp(tcp) => tcp.recv(buffer, deadline),
            Connection::Udp(udp) => udp.recv(buffer, deadline),
            Connection::Tls(tls) => tls.recv(buffer, deadline),
            Connection::Simulated(end) => end.recv(buffer, deadline),
        }
    }

    fn now(&self) -> Nanos {
        match self {
            Connection::Tcp(_) | Connection::Udp(_) | Connection::Tls(_) => {
                Nanos(os::monotonic_ns())
            }
            Connection::Simulated(end) => end.now(),
        }
    }

    fn tls_fault(&self) -> Option<TlsFault> {
        match self {
            Connection::Tls(tls) => tls.tls_fault(),
            Connection::Tcp(_) | Connection::Udp(_) | Connection::Simulated(_) => None,
        }
    }
}

impl Transport for ClientLink {
    fn has_hung_up(&self) -> bool {
        match self {
            ClientLink::Plain(connection) => connection.has_hung_up(),
            ClientLink::Faulty(faulty) => faulty.has_hung_up(),
        }
    }

    fn trust_only_frames(&mut self) {
        match self {
            ClientLink::Plain(connection) => connection.trust_only_frames(),
            ClientLink::Faulty(faulty) => faulty.trust_only_frames(),
        }
    }

    fn unreachable(&self) -> u64 {
        match self {
            ClientLink::Plain(connection) => connection.unreachable(),
            ClientLink::Faulty(faulty) => faulty.unreachable(),
        }
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        match self {
            ClientLink::Plain(connection) => connection.send(frame),
            ClientLink::Faulty(faulty) => faulty.send(frame),
        }
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        match self {
            ClientLink::Plain(connection) => connection.recv(buffer, deadline),
            ClientLink::Faulty(faulty) => faulty.recv(buffer, deadline),
        }
    }

    fn now(&self) -> Nanos {
        match self {
            ClientLink::Plain(connection) => connection.now(),
            ClientLink::Faulty(faulty) => faulty.now(),
        }
    }

    fn tls_fault(&self) -> Option<TlsFault> {
        match self {
            ClientLink::Plain(connection) => connection.tls_fault(),
            ClientLink::Faulty(faulty) => faulty.tls_fault(),
        }
    }
}
