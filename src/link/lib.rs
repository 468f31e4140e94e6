//! Links: a protocol and a transport joined to a [`Substructure`](gusset_quantity::substructure::Substructure), and the far end
//! that hosts specimens.
//!
//! [`gusset_wire`] handles bytes without sockets; a [`Transport`] handles sockets without their meaning. On the loop's
//! thread there are plain non-blocking sockets and a wait with a deadline; an asynchronous runtime only serves work
//! without a deadline.
//!
//! `native` and `openfresco` are the clients, `server` and `served` the far end: a session of the first and the specimen behind it.
//! `fault` plays the faults of a script on any of them. This member knows no structure and no test. Begin reading with `native`.

pub mod announce;
pub mod fault;
mod inbox;
pub mod native;
pub mod openfresco;
mod quota;
pub mod secret;
pub mod served;
pub mod server;
pub mod socket;
pub mod tls;
mod tls_fault;

pub use native::{NativeLink, NativeSetup};
pub use server::Simulated;
pub use socket::{ConnectError, SocketOptions, Wait};
pub(crate) use socket::{TcpTransport, UdpTransport};

use self::tls::TlsFault;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;

/// Moves bytes. Streams and datagrams look the same from above: a datagram is a chunk that happens to hold whole
/// frames.
pub trait Transport: Send {
    /// Hands `frame` over whole; never blocks. Bytes that the system does not take at once are kept and flushed in
    /// [`Transport::recv`]; a second full buffer is [`LinkFault::Backpressure`]. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault>;

    /// Waits for bytes until `deadline`; `None` if it passed. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault>;

    /// True if the other end has closed its side of a connection, also while bytes of it have not been read. Real-time: yes.
    fn has_hung_up(&self) -> bool {
        false
    }

    /// Every frame is signed from here on. ICMP errors are not signed, so an attacker can forge them: the transport counts them
    /// and stays open.
    fn trust_only_frames(&mut self) {}

    /// Number of ICMP errors since then. Real-time: yes.
    fn unreachable(&self) -> u64 {
        0
    }

    /// The present on the clock of its deadlines: CLOCK_MONOTONIC, unless time itself is simulated. Real-time: yes.
    fn now(&self) -> Nanos {
        Nanos(os::monotonic_ns())
    }

    /// True if time is simulated: then a wait takes no wall time.
    fn is_simulated(&self) -> bool {
        false
    }

    /// Fault that ended a TLS session or delays it, where it is more than the [`LinkFault`] shows. Real-time: yes.
    fn tls_fault(&self) -> Option<TlsFault> {
        None
    }
}
