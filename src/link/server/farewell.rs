//! The last frames of a session over datagrams, which the network may lose.
//!
//! A controller repeats its retire until it receives the answer. The server repeats that answer for a while after the
//! session, also while the next client is served.

use std::net::SocketAddr;

use crate::Transport;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;
use gusset_wire::native::{Kind, LARGEST_FRAME, peek};

/// The server repeats the answer for this time after the session. A controller waits for less time.
const AGAIN_NS: u64 = 500_000_000;

/// The last frames of a session, with the address of its client and the time.
#[derive(Debug, Clone)]
pub(super) struct Farewell {
    peer: SocketAddr,
    frames: Vec<Vec<u8>>,
    at: u64,
}

impl Farewell {
    /// The frames of a session that ends now.
    pub(crate) fn new(peer: SocketAddr, frames: Vec<Vec<u8>>) -> Self {
        let at = os::monotonic_ns();
        Self { peer, frames, at }
    }

    /// The frames that answer a datagram that arrived at `now`: none unless it is a retire of that session. The frames are the
    /// same bit for bit, so a peer that forges the address of the controller learns nothing new.
    pub(crate) fn again(&self, peer: SocketAddr, datagram: &[u8], now: u64) -> &[Vec<u8>] {
        let session = |frame: &[u8]| peek(frame).map(|seen| seen.session);
        let ours = self.frames.first().and_then(|frame| session(frame));
        let asks = peek(datagram)
            .is_some_and(|seen| seen.kind == Kind::Retire && Some(seen.session) == ours);
        let in_time = now.saturating_sub(self.at) <= AGAIN_NS;
        if asks && in_time && peer == self.peer {
            &self.frames
        } else {
            &[]
        }
    }

    /// Answers the datagrams that arrived on the session's own link while its records were closed.
    pub(crate) fn answers(&self, link: &mut impl Transport) {
        if self.frames.is_empty() {
            return;
        }
        let mut buffer = vec![0; LARGEST_FRAME + 1];
        while let Ok(Some(count)) = link.recv(&mut buffer, Nanos(0)) {
            let datagram = buffer.get(..count).unwrap_or_default();
            for frame in self.again(self.peer, datagram, os::monotonic_ns()) {
                // A client that does not receive it asks again.
                let _ = link.send(frame);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_wire::Side;
    use gusset_wire::native::{Cause, Encoder, Notice};

    #[test]
    fn repeated_retire_is_answered_for_a_while() {
        let cause = Cause::Orderly;
        let notice = Notice { sequence: 7, cause };
        let frame = |side: Side, session: u64| {
            let mut out = vec![0; LARGEST_FRAME];
            let mut encoder = Encoder::new(side, 1, session, None).unwrap();
            let length = match side {
                Side::Specimen => encoder.goodbye(notice, &mut out),
                Side::Controller => encoder.retire(notice, &mut out),
            };
            out.truncate(length.unwrap());
            out
        };
        let (peer, other) = (([127, 0, 0, 1], 1).into(), ([127, 0, 0, 1], 2).into());
        let goodbye = frame(Side::Specimen, 5);
        let farewell = Farewell::new(peer, vec![goodbye.clone()]);
        let retire = frame(Side::Controller, 5);
        let at = |ms: u64| farewell.at + ms * 1_000_000;
        for (from, datagram, now, is_answered) in [
            (peer, &retire, at(400), true),
            (peer, &retire, at(600), false),
            (other, &retire, at(1), false),
            (peer, &frame(Side::Controller, 6), at(1), false),
            (peer, &goodbye, at(1), false),
            (peer, &b"retire".to_vec(), at(1), false),
        ] {
            let again = farewell.again(from, datagram, now);
            assert_eq!(again.len(), usize::from(is_answered));
        }
        let silent = Farewell::new(peer, Vec::new());
        assert!(silent.again(peer, &retire, silent.at).is_empty());
    }
}
