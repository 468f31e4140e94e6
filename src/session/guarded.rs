//! The boundary of the loop's thread: no panic of ours leaves a specimen without its last words.
//!
//! What it does not do: decide what a panic means for the exit code, or write anything.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::connect::Unconnected;
use crate::engine::{Control, Ending, Engine, Outcome, Stop};
use crate::rt::os;
use crate::substructure::Retirement;

/// How the loop's thread ended.
pub(super) struct Ended {
    /// What it left behind; none if the thread died outside of the engine.
    pub outcome: Option<Outcome>,
    /// A panic of our own, in words.
    pub fault: Option<String>,
    /// Why the specimens are not connected, so that the loop never started.
    pub unconnected: Option<Unconnected>,
    /// Wall time of the loop, whatever clock it ran on.
    pub wall_ns: u64,
}

impl Ended {
    /// The end of a test whose loop never ran.
    pub fn without_loop(unconnected: Option<Unconnected>) -> Self {
        Self {
            outcome: None,
            fault: None,
            unconnected,
            wall_ns: 0,
        }
    }
}

/// Whatever happens in the loop, the specimens are retired: a panic is caught here and named.
pub(super) fn run_retired(engine: &mut Engine, control: &Control, real: bool) -> Ended {
    let began = os::monotonic_ns();
    let result = catch_unwind(AssertUnwindSafe(|| engine.run(control)));
    let since = os::monotonic_ns().saturating_sub(began);
    match result {
        Ok(outcome) => Ended {
            // From the first edge; the simulated clock does not know how long it took.
            wall_ns: if real { outcome.wall_ns } else { since },
            outcome: Some(outcome),
            fault: None,
            unconnected: None,
        },
        Err(panic) => {
            let mut fault = panic_text(panic.as_ref());
            // Ends: each call takes at least one specimen off the list, whose goodbye may panic too.
            while let Err(again) =
                catch_unwind(AssertUnwindSafe(|| engine.retire(Retirement::Tripped)))
            {
                let text = panic_text(again.as_ref());
                fault.push_str(&format!("; retiring a specimen failed too: {text}"));
            }
            let close = || engine.conclude(Ending::Stopped(Stop::Internal));
            Ended {
                outcome: catch_unwind(AssertUnwindSafe(close)).ok(),
                fault: Some(fault),
                unconnected: None,
                wall_ns: since,
            }
        }
    }
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "without a message".to_owned())
}
