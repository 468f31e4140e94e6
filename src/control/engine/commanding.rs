//! Numbers and rules of the exchanges with the specimens.

use crate::port::Port;
use gusset_quantity::state;

/// When specimens that can take their time are commanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Commanding {
    /// At every tick, as all others: before and after the test.
    EveryTick,
    /// Once a step: in the test.
    EveryStep,
}

/// Whether recordings in place of specimens have replies to the exchanges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Recordings {
    Reply,
    /// They lack the rows of the warm-up.
    AreSilent,
}

/// Numbers and rules of the exchanges.
#[derive(Debug, Clone, Copy)]
pub(super) struct Exchanges {
    sequence: u64,
    pub commanding: Commanding,
    pub recordings: Recordings,
}

// The rules belong to the maneuver.
state! { Exchanges { sequence } keeps { commanding, recordings } }

impl Exchanges {
    /// The first exchange is number 0.
    pub(crate) const fn new() -> Self {
        Self {
            sequence: 0,
            commanding: Commanding::EveryTick,
            recordings: Recordings::Reply,
        }
    }

    /// Number of the next exchange. Real-time: yes.
    #[inline]
    pub(crate) const fn sequence(&self) -> u64 {
        self.sequence
    }

    /// A resumed test continues at this number.
    pub(crate) const fn continue_at(&mut self, sequence: u64) {
        self.sequence = sequence;
    }

    /// The exchange is accepted. Real-time: yes.
    #[inline]
    pub(crate) const fn count(&mut self) {
        self.sequence += 1;
    }

    /// True if a specimen is commanded once a step now. Real-time: yes.
    #[inline]
    pub(crate) fn is_by_steps(&self, port: &Port) -> bool {
        self.commanding == Commanding::EveryStep && port.path().is_per_step()
    }
}
