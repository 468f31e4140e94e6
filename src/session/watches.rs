//! Additions of a caller to a session: guards round the ticks, observers of the rows, helpers of the test.

use super::SpecimenRecords;
use gusset_control::engine::Watch;
use gusset_record::Onlooker;

/// Hooks of a caller round the ticks, on the loop's own thread and on the others.
#[derive(Default)]
pub struct Watches {
    /// Called when the warm-up is over.
    pub before_first_tick: Option<Watch>,
    /// Called when the last tick is over.
    pub after_last_tick: Option<Watch>,
    /// Looks at the rows on the writer's thread.
    pub onlooker: Option<Box<dyn Onlooker>>,
    /// Called when the caller's thread has been moved off the loop's processor and before anything moves: a thread that
    /// is started here stays off it, too.
    pub when_placed: Option<Attendance>,
    /// The lasting records of the specimens; without them nothing outlives the run folder.
    pub specimen_records: Option<SpecimenRecords>,
}

/// Starts a helper that accompanies a test.
pub type Attendance = Box<dyn FnOnce() -> std::io::Result<()>>;

impl std::fmt::Debug for Watches {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Watches")
    }
}
