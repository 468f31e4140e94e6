//! Notes: events from outside the loop, on their way to `events.jsonl` and the log.

use super::events::Event;
use gusset_quantity::catalog::event::Severity;

/// Position of a test in its steps.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Position {
    /// Step of the test, as in the column `step` of a row and in the loop's own events.
    pub tick: Option<u64>,
    /// Its test time in s.
    pub time: Option<f64>,
}

/// An event from outside the loop: a state change, a warning, what the system granted.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// What happened.
    pub event: Event,
    /// Its own severity, if it has one.
    pub(super) severity: Option<Severity>,
    /// Position and time at which it was made; `None` for a note that takes those of its writing.
    pub(super) made: Option<(Position, u64)>,
}

impl Note {
    /// A note as grave as the table of events says.
    #[must_use]
    pub const fn new(event: Event) -> Self {
        Self {
            event,
            severity: None,
            made: None,
        }
    }

    /// The note with another severity: the level of its line in the log.
    #[must_use]
    pub const fn at(mut self, severity: Severity) -> Self {
        self.severity = Some(severity);
        self
    }

    /// The note as made there, and then: CLOCK_MONOTONIC in ns.
    #[must_use]
    pub const fn made_at(mut self, position: Position, monotonic_ns: u64) -> Self {
        self.made = Some((position, monotonic_ns));
        self
    }
}

impl From<Event> for Note {
    fn from(event: Event) -> Self {
        Self::new(event)
    }
}
