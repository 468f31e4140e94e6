//! The channel to one client: its connection, and its address for messages.

use std::net::SocketAddr;

use super::connection::ClientLink;
use crate::Transport;
use crate::native::with_words;
use crate::served::TestEnd;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_wire::native;

/// The connection to one client, with its address.
pub(super) struct Channel {
    pub link: ClientLink,
    pub peer: SocketAddr,
}

impl Channel {
    /// The present time on the clock of the connection. Real-time: yes.
    pub(crate) fn now(&self) -> Nanos {
        self.link.now()
    }

    /// Why a native client is lost.
    pub(crate) fn lost(&self, is_stream: bool, fault: LinkFault) -> TestEnd {
        let Self { link, peer } = self;
        match (link.tls_fault(), fault) {
            _ if link.is_cut() => TestEnd::vanished(format_args!(
                "the connection to {peer} is cut: a fault that is played (closed)"
            )),
            (Some(why), _) => TestEnd::vanished(format_args!("{peer}: TLS: {why}")),
            (None, LinkFault::Closed) if !is_stream => TestEnd::vanished(format_args!(
                "{peer} left without a goodbye: its port is closed"
            )),
            (None, LinkFault::Closed) => TestEnd::vanished(format_args!(
                "{peer} closed the connection without a goodbye"
            )),
            (None, fault) => TestEnd::vanished(fault),
        }
    }

    /// A native client has sent no message for `silent_ns`.
    pub(crate) fn silent(&self, silent_ns: u64) -> TestEnd {
        let (peer, seconds) = (self.peer, silent_ns / 1_000_000_000);
        TestEnd::vanished(format_args!("{peer} has been silent for {seconds} s"))
    }
}

/// The client sent a goodbye, with the code of its cause and a text that may be empty.
pub(super) fn said_goodbye(cause: u32, text: &str) -> TestEnd {
    let cause = native::Cause::from_code(cause).ok();
    let why = match cause {
        Some(native::Cause::Orderly) => " at the end of the test",
        Some(cause) => &format!(": {}", cause.why()),
        None => ": for an unknown reason",
    };
    TestEnd::of(
        // A cause of a later version is unknown here. It counts as a trip.
        cause.map_or(Cause::ControllerTripped, native::Cause::ending),
        with_words(format!("the controller said goodbye{why}"), text.trim()),
    )
}
