//! The phase of a test as other threads see it, and why a phase was left. The phases themselves are in
//! [`gusset_quantity::catalog::phase`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

pub use gusset_quantity::catalog::phase::Phase;

/// What can be seen of a test from outside of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Glimpse {
    /// Where in its life it is.
    pub phase: Phase,
    /// The operator wants it held, and it has heard so.
    #[serde(default)]
    pub hold: bool,
    /// For that nothing moves, and nothing will until he goes on: outside of the test itself there is no phase of its own for
    /// it.
    #[serde(default)]
    pub stands: bool,
    /// What the sensors read is known, and the operator is asked to confirm it.
    #[serde(default)]
    pub unconfirmed: bool,
    /// Number of the latest hold, from 1; 0 before the first. Who lets the test go on names it.
    #[serde(default)]
    pub hold_number: u32,
}

impl Glimpse {
    /// A phase in which nobody holds anything, and nobody is asked.
    #[must_use]
    pub const fn of(phase: Phase) -> Self {
        Self {
            phase,
            hold: false,
            stands: false,
            unconfirmed: false,
            hold_number: 0,
        }
    }

    /// True while the operator is to confirm that every axis is unloaded; other confirmations are those of readings.
    #[must_use]
    pub fn awaits_release(self) -> bool {
        self.unconfirmed && self.phase != Phase::Zeroing
    }
}

/// The phase and the hold as they can be seen from outside of the loop: a number that the loop leaves behind.
#[derive(Debug, Clone, Default)]
pub struct PhaseCell(Arc<AtomicU64>);

/// The bits above the phase; the number of the hold has the upper half.
const UNCONFIRMED: u64 = 1 << 5;
const HOLD: u64 = 1 << 6;
const STANDS: u64 = 1 << 7;
const PHASE: u64 = UNCONFIRMED - 1;

impl PhaseCell {
    /// A phase in which nobody holds anything. Real-time: yes.
    pub fn set(&self, phase: Phase) {
        self.show(Glimpse::of(phase));
    }

    /// Shows this. A phase that cannot be held shows no hold, and a test without a hold shows no standing for one. Real-time: yes.
    pub fn show(&self, seen: Glimpse) {
        let hold = seen.hold && seen.phase.can_be_held();
        let flag = |is: bool, bit: u64| if is { bit } else { 0 };
        let flags = flag(hold, HOLD)
            | flag(hold && seen.stands, STANDS)
            | flag(seen.unconfirmed, UNCONFIRMED);
        let number = u64::from(seen.hold_number) << 32;
        let bits = seen.phase as u64 | flags | number;
        self.0.store(bits, Ordering::Relaxed);
    }

    /// The latest.
    #[must_use]
    pub fn glimpse(&self) -> Glimpse {
        let bits = self.0.load(Ordering::Relaxed);
        let code = bits & PHASE;
        let known = Phase::ALL.into_iter().find(|phase| *phase as u64 == code);
        Glimpse {
            phase: known.unwrap_or(Phase::Connected),
            hold: bits & HOLD != 0,
            stands: bits & STANDS != 0,
            unconfirmed: bits & UNCONFIRMED != 0,
            hold_number: (bits >> 32) as u32,
        }
    }

    /// The latest phase.
    #[must_use]
    pub fn get(&self) -> Phase {
        self.glimpse().phase
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown_phase_is_read_back() {
        let cell = PhaseCell::default();
        for phase in Phase::ALL {
            for bits in 0..8_u32 {
                let [hold, stands, unconfirmed] = [1, 2, 4].map(|bit| bits & bit != 0);
                cell.show(Glimpse {
                    phase,
                    hold,
                    stands,
                    unconfirmed,
                    hold_number: u32::MAX - bits,
                });
                let hold = hold && !matches!(phase, Phase::Leaving | Phase::Tripped | Phase::Safe);
                let seen = Glimpse {
                    phase,
                    hold,
                    stands: hold && stands,
                    unconfirmed,
                    hold_number: u32::MAX - bits,
                };
                assert_eq!(cell.glimpse(), seen);
                cell.set(phase);
                assert_eq!(cell.glimpse(), Glimpse::of(phase));
            }
        }
    }
}
