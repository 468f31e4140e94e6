//! The stamps that the writer leaves of itself, and those of others that it writes down; nothing where none are wanted.

use crate::record::threads::{Stamper, ThreadLog, What};

/// The file of the stamps, and the writer's own hand.
#[derive(Debug, Default)]
pub(super) struct Stamps(Option<(ThreadLog, Stamper)>);

impl Stamps {
    /// Enters the calling thread on the roll.
    pub(super) fn of(threads: Option<ThreadLog>) -> Self {
        Self(threads.map(|threads| {
            let own = threads.roll().enter();
            (threads, own)
        }))
    }

    /// The clock, where stamps are wanted.
    pub(super) fn now(&self) -> Option<u64> {
        self.0.as_ref().map(|(_, own)| own.now())
    }

    /// Stamps what began then and ends now.
    pub(super) fn since(&mut self, what: What, began_ns: Option<u64>, amount: u64) {
        if let (Some((threads, own)), Some(began_ns)) = (&mut self.0, began_ns) {
            threads.own(own, what, began_ns, own.now(), amount);
        }
    }

    /// Takes what others have left.
    pub(super) fn turn(&mut self, now_ns: u64) {
        if let Some((threads, _)) = &mut self.0 {
            threads.turn(now_ns);
        }
    }

    /// Writes what waits.
    pub(super) fn flush(&mut self, now_ns: u64) {
        if let Some((threads, _)) = &mut self.0 {
            threads.flush(now_ns);
        }
    }

    /// Takes and writes everything; how many stamps were lost in all.
    pub(super) fn finish(&mut self, now_ns: u64) -> u64 {
        self.0
            .as_mut()
            .map_or(0, |(threads, _)| threads.finish(now_ns))
    }
}
