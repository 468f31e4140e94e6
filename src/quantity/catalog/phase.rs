//! The phases of a test, and every number that the column `state` holds.
//!
//! [`STATES`] is the table: the index of a state is its code. Most states are a [`Phase`] of the test, three are a
//! [`Stage`] between two steps, and two mark the row of a trip that no other column explains. A code never changes its
//! meaning, because old records hold it. [`Phase::may_become`] says which phase may follow which:
//!
//! ```text
//! Connected → Probing → Zeroing → Ramping → Settling → Ramping → Armed → Running ⇄ Holding → Leaving → Safe
//!      from anywhere: → Tripped → Leaving → Safe
//! ```
//!
//! A test leaves out the phases that it does not need. Every change is an event with its cause.

use serde::{Deserialize, Serialize};

/// Phase of a test. The numbers are codes of [`STATES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Phase {
    /// Every specimen is connected; nothing has moved.
    Connected = 0,
    /// The static load is applied; test time is stopped.
    Settling = 1,
    /// The loop runs while the specimens hold the first command.
    Armed = 10,
    /// A small motion checks how each specimen is wired.
    Probing = 2,
    /// The test runs.
    Running = 3,
    /// The loop reads the sensors while the specimens hold, and the operator confirms the offsets.
    Zeroing = 4,
    /// The specimens move to the position where the test begins.
    Ramping = 5,
    /// Test time is stopped and the specimens hold.
    Holding = 6,
    /// The specimens move to their end position.
    Leaving = 7,
    /// A limit or a fault has ended the test. Latched.
    Tripped = 8,
    /// The last command remains in force; every connection is closed.
    Safe = 9,
}

/// Stage of the motion between two steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Stage {
    /// The next target is known: the command goes there.
    Correct = 11,
    /// The next target is unknown: the command follows the prediction.
    Predict = 12,
    /// The next target is still unknown, or the operator wants a hold: the command slows down to rest.
    SlowDown = 13,
}

crate::state! { enum Stage { Correct, Predict, SlowDown } }

/// State of the row that ended a test for missed deadlines. Only the clock knows the cause, so the row must contain
/// it.
pub const GIVEN_UP: f64 = 14.0;
/// State of the row in which the operator ended the test while a reply was awaited.
pub const NOT_AWAITED: f64 = 15.0;

/// Part of a test that a row belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Before the first tick of the test.
    Startup,
    /// The test itself, held or not.
    Test,
    /// The row of a trip.
    Trip,
    /// After the test.
    Shutdown,
}

impl Part {
    /// The part of a row with this number in the column `state`; none for a number that is no code.
    #[must_use]
    pub fn of(state: f64) -> Option<Self> {
        State::of(state).map(|state| state.part)
    }

    /// True if a row with this number in the column `state` belongs to this part.
    #[must_use]
    pub fn has(self, state: f64) -> bool {
        Self::of(state) == Some(self)
    }
}

/// A value of the column `state`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct State {
    /// Number in the column.
    pub code: u8,
    /// Spelling in files.
    pub word: &'static str,
    /// Part of the test.
    pub part: Part,
    /// Meaning, for people.
    pub sentence: &'static str,
}

impl State {
    /// The state with this number; none for a number that is no code.
    #[must_use]
    pub(crate) fn of(code: f64) -> Option<&'static Self> {
        STATES.iter().find(|state| f64::from(state.code) == code)
    }
}

const fn state(code: u8, word: &'static str, part: Part, sentence: &'static str) -> State {
    State {
        code,
        word,
        part,
        sentence,
    }
}

/// Page of the guide with this table.
pub const PAGE: &str = "columns";

/// All states, each at the place of its code.
pub const STATES: [State; 16] = [
    state(0, "connected", Part::Startup, "connected"),
    state(1, "settling", Part::Startup, "static load: settling"),
    state(2, "probing", Part::Startup, "wiring check"),
    state(3, "running", Part::Test, "running"),
    state(4, "zeroing", Part::Startup, "zeroing"),
    state(5, "ramping", Part::Startup, "ramp to the start position"),
    state(6, "holding", Part::Test, "hold"),
    state(7, "leaving", Part::Shutdown, "return move at the end"),
    state(8, "tripped", Part::Trip, "tripped"),
    state(9, "safe", Part::Shutdown, "connections closed"),
    state(10, "armed", Part::Startup, "warm-up, recorded where needed"),
    state(
        11,
        "correct",
        Part::Test,
        "between two steps: towards a known target",
    ),
    state(
        12,
        "predict",
        Part::Test,
        "between two steps: along the prediction",
    ),
    state(
        13,
        "slow_down",
        Part::Test,
        "between two steps: slowing down",
    ),
    state(
        14,
        "given_up",
        Part::Trip,
        "ended because a tick was too late",
    ),
    state(
        15,
        "not_awaited",
        Part::Trip,
        "ended by the operator while a reply was awaited",
    ),
];

impl Phase {
    /// All phases.
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
            // Latched: no way leads from a trip back into the test.
            (Tripped, next) => matches!(next, Leaving | Safe),
            (Leaving, next) => matches!(next, Tripped | Safe),
            (Safe, _) => false,
            // The operator may end the test in any phase, and any phase may trip.
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
        matches!(self.state().part, Part::Startup)
    }

    /// True if the loop obeys a hold of the operator: the shutdown and a trip do not wait. Real-time: yes.
    #[must_use]
    pub const fn can_be_held(self) -> bool {
        matches!(self.state().part, Part::Startup | Part::Test)
    }

    /// Row of the table. Real-time: yes.
    #[must_use]
    pub const fn state(self) -> &'static State {
        &STATES[self as usize]
    }

    /// Number in the column `state`. Real-time: yes.
    #[must_use]
    pub const fn code(self) -> f64 {
        self as u8 as f64
    }

    /// Spelling in files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        self.state().word
    }
}

impl Stage {
    /// All stages.
    pub const ALL: [Stage; 3] = [Stage::Correct, Stage::Predict, Stage::SlowDown];

    /// Number in the column `state`. Real-time: yes.
    #[must_use]
    pub const fn code(self) -> f64 {
        self as u8 as f64
    }

    /// Spelling in files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        STATES[self as usize].word
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_order_is_its_code() {
        for (place, state) in STATES.iter().enumerate() {
            assert_eq!(usize::from(state.code), place);
            let same = STATES.iter().filter(|other| other.word == state.word);
            assert_eq!(same.count(), 1, "{}", state.word);
        }
        assert_eq!(Part::of(f64::NAN), None);
        assert_eq!(Part::of(16.0), None);
        assert_eq!(Part::of(2.5), None);
    }

    #[test]
    fn every_state_is_one_phase_stage_or_mark() {
        let phases = Phase::ALL.map(|phase| (phase.code(), phase.word()));
        let stages = Stage::ALL.map(|stage| (stage.code(), stage.word()));
        let marks = [(GIVEN_UP, "given_up"), (NOT_AWAITED, "not_awaited")];
        let mut all = [&phases[..], &stages, &marks].concat();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let table = STATES.map(|state| (f64::from(state.code), state.word));
        assert_eq!(all, table);
    }

    #[test]
    fn files_spell_phases_as_the_table_does() {
        for phase in Phase::ALL {
            let word = serde_json::to_value(phase).unwrap();
            assert_eq!(word, phase.word());
        }
    }

    #[test]
    fn every_phase_can_trip_without_return() {
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
    fn only_armed_and_holding_lead_to_running() {
        let before: Vec<Phase> = Phase::ALL
            .into_iter()
            .filter(|phase| phase.may_become(Phase::Running))
            .collect();
        assert_eq!(before, [Phase::Armed, Phase::Holding]);
    }

    #[test]
    fn every_phase_but_the_first_can_be_reached() {
        for next in Phase::ALL {
            let reached = Phase::ALL.into_iter().any(|phase| phase.may_become(next));
            assert_eq!(reached, next != Phase::Connected);
        }
    }
}
