//! What a caller adds to a session: guards round the ticks, who looks at the rows, who attends the test.

use crate::engine::Watch;
use crate::record::Onlooker;
use crate::record::threads::{Roll, Who};
use crate::rt::os;

/// What a caller may put round the ticks, on the loop's own thread and on the others.
#[derive(Default)]
pub struct Watches {
    /// Called when the warm-up is over.
    pub before_first_tick: Option<Watch>,
    /// Called when the last tick is over.
    pub after_last_tick: Option<Watch>,
    /// Looks at the rows on the writer's thread.
    pub onlooker: Option<Box<dyn Onlooker>>,
    /// Called when the caller's thread has been put off the loop's processor and before anything moves: a thread that is
    /// started here stays off it, too.
    pub when_placed: Option<Attendance>,
    /// The roll on which the caller's threads stand; a new one if there is none.
    pub roll: Option<Roll>,
}

/// An empty roll for the threads of this program.
#[must_use]
pub fn roll() -> Roll {
    Roll::new(os::monotonic_ns, || Who {
        name: os::thread_name(),
        id: os::thread_id(),
    })
}

/// Starts whoever attends a test.
pub type Attendance = Box<dyn FnOnce() -> std::io::Result<()>>;

impl std::fmt::Debug for Watches {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Watches")
    }
}
