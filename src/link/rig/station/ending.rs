//! How a controller's test at a station ends: its books are closed, and the specimen hears the last word.

use super::{Station, Trip};
use crate::catalog::ending::Cause;
use crate::catalog::event::Remark;
use crate::substructure::LinkStats;

impl Station {
    /// What came of the controller: commands, those that never arrived, and frames that failed a check.
    pub fn counted(&mut self, commands: u64, missed: u32, corrupt: u64) {
        let text = format!("{commands} commands, {missed} missed, {corrupt} frames corrupt");
        self.note(Remark::Counts, &text);
        if !self.rig.is_remote() {
            self.link = LinkStats {
                missed: missed.into(),
                corrupt,
                ..LinkStats::default()
            };
        }
    }

    /// The specimen hears the last word of this test, once, before the books are closed: what it answers beyond a plain goodbye is
    /// for its controller, too.
    pub fn dismiss(&mut self, cause: Cause) -> Option<String> {
        if std::mem::replace(&mut self.is_dismissed, true) {
            return None;
        }
        if self.rig.is_remote() {
            self.link = self.rig.stats();
        }
        let told = self.tripped.map(|trip| self.whole(trip));
        let said = self.rig.end(cause.into())?;
        // The trip said so already, or it says what the trip said.
        if told.is_some_and(|told| told.contains(&said) || said.ends_with(&told)) {
            return None;
        }
        let text = format!("the specimen reported after the test: {said}");
        match &mut self.log {
            Some(log) => log.warn(Remark::LastWords, &text),
            None => self.note(Remark::LastWords, &text),
        }
        Some(said)
    }

    /// The controller's test is over: last words to the specimen, and the log is closed. Nothing if there is no test.
    pub fn end(&mut self, cause: Cause, text: &str) {
        if !std::mem::take(&mut self.begun) {
            return;
        }
        if self.unsettled > 0 {
            let text = format!(
                "the actuator–specimen iteration did not converge in {} answers, which are not exact",
                self.unsettled
            );
            self.note(Remark::Unsettled, &text);
        }
        // A trip is why it ended, whatever else was said about it, and who says it again says nothing else.
        let why = self.tripped.map(|trip| match trip {
            Trip::Lost(_) => self.whole(trip),
            _ => trip.to_string(),
        });
        let cause = self.tripped.map_or(cause, Trip::cause);
        let text = match why {
            Some(why) if !text.contains(&why) => format!("{why}; {text}"),
            _ => text.to_owned(),
        };
        self.dismiss(cause);
        if self.is_lasting() {
            self.store.take_back(self.guard.clone());
            self.latch.settle();
        }
        if let Some(log) = self.log.take() {
            log.close(cause, &text, &self.link, self.commits);
        }
    }
}

impl Drop for Station {
    fn drop(&mut self) {
        self.end(Cause::Internal, "internal error: the test was dropped");
    }
}
