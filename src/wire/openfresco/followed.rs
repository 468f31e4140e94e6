//! The commands of one connection as the server follows them: the last one, and its meaning.

use super::course::{Course, Tracker};
use super::sizes::Counts;
use super::vector::{Response, Signals};
use crate::WireError;

/// The last command of the client and its course.
#[derive(Debug)]
pub struct Followed {
    trial: Signals,
    incoming: Signals,
    tracker: Tracker,
    is_reset: bool,
}

impl Followed {
    /// Only for set-up: allocates. `implicit`: the client does not commit, a new command accepts the one before.
    pub(super) fn new(ctrl: Counts, implicit: bool) -> Self {
        Self {
            trial: Signals::zeros(ctrl),
            incoming: Signals::zeros(ctrl),
            tracker: Tracker::new(ctrl.disp, implicit),
            is_reset: false,
        }
    }

    /// Takes a new command. Nonsense leaves the last one unchanged. Real-time: yes.
    pub(super) fn command(
        &mut self,
        field: &'static str,
        vector: &[u8],
    ) -> Result<Course, WireError> {
        self.incoming.read(field, vector, 1)?;
        self.is_reset = self.tracker.is_reset(&self.incoming);
        let course = self.tracker.judge(&self.incoming, &self.trial);
        std::mem::swap(&mut self.incoming, &mut self.trial);
        Ok(course)
    }

    /// The last command is accepted at `time`; returns the number of commands since the last commit. Real-time: yes.
    pub(super) fn commit(&mut self, time: Option<f64>) -> u32 {
        self.tracker.commit(&self.trial, time)
    }

    /// True if the last command went back to displacement 0 at time 0 after a commit, as OpenSees does on `reset`.
    #[must_use]
    pub const fn is_reset(&self) -> bool {
        self.is_reset
    }

    pub(super) const fn counts(&self) -> &Counts {
        self.trial.counts()
    }

    /// The last command; zeros before the first.
    #[must_use]
    pub fn trial(&self) -> Response<'_> {
        self.trial.response()
    }

    /// The signals of the last command, by quantity.
    #[must_use]
    pub fn signals(&self) -> &[f64] {
        self.trial.values()
    }

    /// Time of the last command, if the layout has one.
    pub(super) fn time(&self) -> Option<f64> {
        self.trial.time()
    }

    /// Test time from the last commit to the last command: what a rate-dependent specimen integrates over. May be
    /// zero or negative (then nothing is to be integrated); `None` if the client sends no time or has begun a
    /// new one.
    #[must_use]
    pub fn dt(&self) -> Option<f64> {
        self.tracker.dt(&self.trial)
    }
}
