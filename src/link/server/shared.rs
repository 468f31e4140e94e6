//! The state that the threads of one server share.
//!
//! One thread receives clients, one thread serves them, and the thread of the caller reports events.
//! The specimen has at most one client. While a client is served, [`Occupancy`] names it.
//! No thread waits for another one here: a lock is held for a few instructions only.
//! The exchange of a command takes no lock unless it reports an event.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crossbeam_channel::Sender;

use super::ServerEvent;
use super::farewell::Farewell;
use crate::quota::{Allowance, Quota};
use gusset_record::rt::os;

/// The use of the specimen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Occupancy {
    /// No client commands the specimen.
    #[default]
    Free,
    /// This client commands it.
    Served(SocketAddr),
    /// The test of the last client is over, and its records are being closed.
    Closing,
}

/// The shared state of one server.
pub(super) struct Shared {
    stop: AtomicBool,
    stop_at_once: AtomicBool,
    occupancy: Mutex<Occupancy>,
    /// Time at which a client of the same machine last asked for the specimen, ns.
    successor_ns: AtomicU64,
    events: Sender<ServerEvent>,
    quotas: Mutex<[Quota; ServerEvent::KINDS]>,
    /// The last frames of the session before, for a client that did not receive them.
    farewell: Mutex<Option<Farewell>>,
}

impl Shared {
    pub(super) fn new(events: Sender<ServerEvent>) -> Self {
        Self {
            stop: AtomicBool::new(false),
            stop_at_once: AtomicBool::new(false),
            occupancy: Mutex::default(),
            successor_ns: AtomicU64::new(0),
            events,
            quotas: Mutex::default(),
            farewell: Mutex::default(),
        }
    }

    /// Ends the server.
    pub(super) fn stop(&self) {
        self.stop.store(true, Ordering::Release);
    }

    /// Ends the server, and the return of a wiring check.
    pub(super) fn stop_at_once(&self) {
        self.stop_at_once.store(true, Ordering::Release);
        self.stop();
    }

    /// True once nothing may move any more. Real-time: yes.
    pub(super) fn is_stopped_at_once(&self) -> bool {
        self.stop_at_once.load(Ordering::Acquire)
    }

    /// True once the server must end. Real-time: yes.
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Reserves the specimen for one client; false if it is not free.
    pub(super) fn reserve(&self, client: SocketAddr) -> bool {
        let mut occupancy = lock(&self.occupancy);
        let is_free = *occupancy == Occupancy::Free;
        if is_free {
            *occupancy = Occupancy::Served(client);
            self.successor_ns.store(0, Ordering::Release);
        }
        is_free
    }

    /// The client has disconnected; its records are still open.
    pub(super) fn close(&self) {
        *lock(&self.occupancy) = Occupancy::Closing;
    }

    /// The specimen is free again.
    pub(super) fn release(&self) {
        *lock(&self.occupancy) = Occupancy::Free;
    }

    pub(super) fn occupancy(&self) -> Occupancy {
        *lock(&self.occupancy)
    }

    /// A client of the same machine as the present one asks for the specimen.
    pub(super) fn succeed(&self, now_ns: u64) {
        self.successor_ns.store(now_ns, Ordering::Release);
    }

    /// True if another client of the same machine asked for the specimen after this time.
    pub(super) fn has_successor(&self, since_ns: u64) -> bool {
        self.successor_ns.load(Ordering::Acquire) > since_ns
    }

    /// Keeps the last frames of a session.
    pub(super) fn part(&self, farewell: Farewell) {
        *lock(&self.farewell) = Some(farewell);
    }

    /// The last frames of the session before, if this datagram asks for them.
    pub(super) fn last_frames(&self, peer: SocketAddr, datagram: &[u8]) -> Vec<Vec<u8>> {
        let farewell = lock(&self.farewell);
        let frames = farewell
            .as_ref()
            .map(|farewell| farewell.again(peer, datagram, os::monotonic_ns()));
        frames.unwrap_or_default().to_vec()
    }

    /// Reports an event, within the quota of its kind.
    pub(super) fn tell(&self, event: ServerEvent) {
        self.tell_at_most(event.kind(), event);
    }

    /// Reports a peer that was refused for malformed bytes.
    pub(super) fn complain(&self, peer: SocketAddr, text: String) {
        self.tell_at_most(ServerEvent::STRANGERS, ServerEvent::Refused { peer, text });
    }

    fn tell_at_most(&self, kind: usize, event: ServerEvent) {
        let now_ns = os::monotonic_ns();
        let allowance = lock(&self.quotas)
            .get_mut(kind)
            .map(|quota| quota.take(now_ns));
        let Some(Allowance { is_told, notice }) = allowance else {
            return;
        };
        // The receiver is closed only when the server ends.
        if is_told {
            let _ = self.events.send(event);
        }
        if let Some(text) = notice {
            let _ = self.events.send(ServerEvent::Told { text });
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
