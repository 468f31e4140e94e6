//! Runs a test on the loop's thread.
//!
//! The life cycle of the engine catches a panic and retires every specimen. The exit code is decided elsewhere.

use super::connect::Unconnected;
use gusset_control::engine::{Connected, Control, Outcome};
use gusset_record::rt::os;

/// How the loop's thread ended.
pub(super) struct Ended {
    /// Its outcome; `None` if the thread died outside of the engine.
    pub outcome: Option<Outcome>,
    /// A panic of the program, in words.
    pub fault: Option<String>,
    /// Why the specimens are not connected, so that the loop never started.
    pub unconnected: Option<Unconnected>,
    /// Wall time of the loop, whatever clock it ran on.
    pub wall_ns: u64,
}

impl Ended {
    /// The end of a test whose loop never ran.
    pub(crate) fn without_loop(unconnected: Option<Unconnected>) -> Self {
        Self {
            outcome: None,
            fault: None,
            unconnected,
            wall_ns: 0,
        }
    }
}

/// Runs a test to its end; `real`: on the real clock.
pub(super) fn run_to_the_end(test: Connected, control: &Control, real: bool) -> Ended {
    let began = os::monotonic_ns();
    let retired = test.run(control);
    let since = os::monotonic_ns().saturating_sub(began);
    // From the first edge; the simulated clock does not know how long it took.
    let from_first_edge = retired.outcome.as_ref().map(|outcome| outcome.pace.wall_ns);
    let is_timed = real && retired.fault.is_none();
    Ended {
        wall_ns: from_first_edge.filter(|_| is_timed).unwrap_or(since),
        outcome: retired.outcome,
        fault: retired.fault,
        unconnected: None,
    }
}
