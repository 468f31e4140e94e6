//! The server's end of a simulated wire.

use crate::Transport;
use crate::fault::Queue;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;

/// The server's end of a wire with a constant delay.
#[derive(Debug)]
pub(super) struct WireEnd {
    incoming: Queue,
    outgoing: Queue,
    now: Nanos,
    /// Time does not pass beyond this.
    limit: Nanos,
    delay_ns: u64,
}

impl WireEnd {
    pub(crate) fn new(now: Nanos, delay_ns: u64) -> Self {
        Self {
            incoming: Queue::default(),
            outgoing: Queue::default(),
            now,
            limit: now,
            delay_ns,
        }
    }

    /// The controller sends a frame at `now`.
    pub(crate) fn carry(&mut self, now: Nanos, frame: &[u8]) {
        self.incoming.push(now.plus(self.delay_ns), frame);
    }

    /// Arrival time of the next frame at the controller's end.
    pub(crate) fn next_at(&self) -> Option<Nanos> {
        self.outgoing.next_at()
    }

    /// Copies a frame that has arrived at the controller's end by `at` into `buffer`. Returns its size.
    pub(crate) fn arrived(&mut self, at: Nanos, buffer: &mut [u8]) -> Option<usize> {
        self.outgoing.take(at, buffer)
    }

    /// Lets time pass up to `limit`.
    pub(crate) const fn allow(&mut self, limit: Nanos) {
        self.limit = limit;
    }

    /// Drops every frame that has arrived or is in transit to here, up to `limit`.
    pub(crate) fn drop_what_comes(&mut self, limit: Nanos) {
        self.incoming = Queue::default();
        self.now = self.now.max(limit);
    }

    /// True if something happens here until `limit`, before something arrives at the other end.
    pub(crate) fn is_due(&self, limit: Nanos) -> bool {
        let coming = self.incoming.next_at().is_some_and(|at| at <= limit);
        (self.now < limit || coming) && self.outgoing.next_at().is_none()
    }
}

impl Transport for WireEnd {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        self.outgoing.push(self.now.plus(self.delay_ns), frame);
        Ok(())
    }

    /// Returns before the deadline when the time of the controller's end is reached.
    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let until = deadline.min(self.limit).max(self.now);
        let at = self.incoming.next_at().filter(|at| *at <= until);
        self.now = self.now.max(at.unwrap_or(until));
        Ok(self.incoming.take(until, buffer))
    }

    fn now(&self) -> Nanos {
        self.now
    }
}
