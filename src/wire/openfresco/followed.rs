//! The commands of one connection as the server follows them: the last one, and its meaning.

use super::course::{Course, Tracker};
use super::sizes::Counts;
use super::vector::{Response, Signals};
use crate::WireError;

/// The last command and its course.
#[derive(Debug)]
pub(super) struct Followed {
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

    /// True if the last command went back to the start of the client's analysis after a commit.
    pub(super) const fn is_reset(&self) -> bool {
        self.is_reset
    }

    pub(super) const fn counts(&self) -> &Counts {
        self.trial.counts()
    }

    pub(super) fn trial(&self) -> Response<'_> {
        self.trial.response()
    }

    pub(super) fn signals(&self) -> &[f64] {
        self.trial.values()
    }

    /// Time of the last command, if the layout has one.
    pub(super) fn time(&self) -> Option<f64> {
        self.trial.time()
    }

    /// Test time from the last commit to the last command; see [`super::Server::dt`].
    pub(super) fn dt(&self) -> Option<f64> {
        self.tracker.dt(&self.trial)
    }
}
