//! The life cycle of a test as a table: which phase may follow which.
//!
//! ```text
//! Connected → Probing → Zeroing → Ramping → Settling → Ramping → Armed → Running ⇄ Holding → Leaving → Safe
//!      from anywhere: → Tripped → Leaving → Safe
//! ```
//!
//! Phases that a test has no use for are left out. Every change is an event with its cause.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

/// Where in its life a test is. The numbers stand in the column `state`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Phase {
    /// Every specimen has agreed; nothing has moved.
    Connected = 0,
    /// The static load is being brought on; test time stands still.
    Settling = 1,
    /// The loop lives, the specimens hold the first command.
    Armed = 10,
    /// A specimen is moved a little and back, to see which way round it is wired.
    Probing = 2,
    /// The test runs.
    Running = 3,
    /// Sensors are read while the specimens hold, and the offsets confirmed.
    Zeroing = 4,
    /// The specimens are moved to where the test begins.
    Ramping = 5,
    /// Test time stands still, the specimens hold.
    Holding = 6,
    /// The specimens are moved to where they are to be left.
    Leaving = 7,
    /// A limit, a fault or an alarm has ended the test. Latched.
    Tripped = 8,
    /// The last command stands; every specimen has been told goodbye.
    Safe = 9,
}

impl Phase {
    /// All of them.
    pub const ALL: [Phase; 11] = [
        Phase::Connected,
        Phase::Probing,
        Phase::Settling,
        Phase::Armed,
        Phase::Running,
        Phase::Zeroing,
        Phase::Ramping,
        Phase::Holding,
        Phase::Leaving,
        Phase::Tripped,
        Phase::Safe,
    ];

    /// True if `next` may follow.
    #[must_use]
    pub const fn may_become(self, next: Phase) -> bool {
        use Phase::{
            Armed, Connected, Holding, Leaving, Probing, Ramping, Running, Safe, Settling, Tripped,
            Zeroing,
        };
        match (self, next) {
            // Latched: from a trip there is no way back into the test.
            (Tripped, next) => matches!(next, Leaving | Safe),
            (Leaving, next) => matches!(next, Tripped | Safe),
            (Safe, _) => false,
            // An operator may end it anywhere, and anything may trip.
            (_, Tripped | Leaving | Safe) => true,
            (Connected, next) => {
                matches!(next, Probing | Zeroing | Ramping | Settling | Armed)
            }
            (Probing, next) => matches!(next, Zeroing | Ramping | Settling | Armed),
            (Zeroing, next) => matches!(next, Ramping | Settling | Armed),
            (Ramping, next) => matches!(next, Settling | Armed),
            (Settling, next) => matches!(next, Ramping | Armed),
            (Armed, next) => matches!(next, Running),
            (Running, next) => matches!(next, Holding),
            (Holding, next) => matches!(next, Running),
        }
    }

    /// True of everything before the first tick of the test. Real-time: yes.
    #[must_use]
    pub const fn is_on_the_way_in(self) -> bool {
        use Phase::{Armed, Connected, Probing, Ramping, Settling, Zeroing};
        matches!(
            self,
            Connected | Probing | Zeroing | Ramping | Settling | Armed
        )
    }

    /// True if an operator's hold is heard: neither the way out nor what comes after a trip stands still for it.
    #[must_use]
    pub const fn can_be_held(self) -> bool {
        !matches!(self, Phase::Leaving | Phase::Tripped | Phase::Safe)
    }

    /// As the column `state` has it.
    #[must_use]
    pub const fn code(self) -> f64 {
        self as u8 as f64
    }

    /// As the files spell it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Phase::Connected => "connected",
            Phase::Settling => "settling",
            Phase::Probing => "probing",
            Phase::Armed => "armed",
            Phase::Running => "running",
            Phase::Zeroing => "zeroing",
            Phase::Ramping => "ramping",
            Phase::Holding => "holding",
            Phase::Leaving => "leaving",
            Phase::Tripped => "tripped",
            Phase::Safe => "safe",
        }
    }
}

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

    /// What can be seen from now on. Where no hold is heard there is none; without one nothing stands for it. Nothing is to be
    /// confirmed but where the sensors are read. Real-time: yes.
    pub fn show(&self, seen: Glimpse) {
        let hold = seen.hold && seen.phase.can_be_held();
        let flag = |is: bool, bit: u64| if is { bit } else { 0 };
        let flags = flag(hold, HOLD)
            | flag(hold && seen.stands, STANDS)
            | flag(
                seen.unconfirmed && seen.phase == Phase::Zeroing,
                UNCONFIRMED,
            );
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
    fn everything_can_trip_and_nothing_comes_back_from_a_trip() {
        for phase in Phase::ALL {
            let over = phase == Phase::Safe;
            let latched = phase == Phase::Tripped;
            assert_eq!(phase.may_become(Phase::Tripped), !over && !latched);
            assert_eq!(phase.may_become(Phase::Safe), !over);
            assert!(!Phase::Safe.may_become(phase));
            let back = Phase::Tripped.may_become(phase);
            assert_eq!(back, matches!(phase, Phase::Leaving | Phase::Safe));
        }
    }

    #[test]
    fn the_test_begins_only_from_armed_and_goes_on_only_from_a_hold() {
        let before: Vec<Phase> = Phase::ALL
            .into_iter()
            .filter(|phase| phase.may_become(Phase::Running))
            .collect();
        assert_eq!(before, [Phase::Armed, Phase::Holding]);
    }

    #[test]
    fn what_is_shown_is_seen_and_no_hold_where_none_is_heard() {
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
                    unconfirmed: unconfirmed && phase == Phase::Zeroing,
                    hold_number: u32::MAX - bits,
                };
                assert_eq!(cell.glimpse(), seen);
                cell.set(phase);
                assert_eq!(cell.glimpse(), Glimpse::of(phase));
            }
        }
    }

    #[test]
    fn every_phase_can_be_reached_and_codes_are_unlike() {
        for next in Phase::ALL {
            let reached = Phase::ALL.into_iter().any(|phase| phase.may_become(next));
            assert_eq!(reached, next != Phase::Connected);
        }
        let mut codes: Vec<u8> = Phase::ALL.into_iter().map(|phase| phase as u8).collect();
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes.len(), Phase::ALL.len());
    }
}
