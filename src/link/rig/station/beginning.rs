//! How a controller's test at a station begins: the latch, the guard of the specimen and the log, and then the specimen.

use super::announced::Announced;
use super::guard::SpecimenGuard;
use super::{Station, TestEnd};
use crate::catalog::ending::{Cause, Status};
use crate::catalog::event::Remark;
use crate::link::rig::log::Log;
use crate::link::rig::{Visitor, Wanted, with_last_words};
use crate::substructure::{LinkStats, Measurement};

impl Station {
    /// Gets everything ready for a controller's test: log, connection, direction, arming. Returns what whoever watches
    /// should know. May block and move what is to be tried, for as long as the test is `wanted`.
    ///
    /// # Errors
    /// Why there is no test. A specimen that was reached is informed and holds where it is.
    pub fn begin(
        &mut self,
        visitor: &Visitor,
        wanted: &mut Wanted<'_>,
    ) -> Result<Vec<String>, TestEnd> {
        self.end(Cause::Protocol, "another controller came");
        if let Some(refusal) = self.latch.refusal() {
            return Err(TestEnd::failed(refusal));
        }
        self.borrow_guard(visitor)?;
        // The specimen is not connected yet.
        (self.begun, self.is_dismissed) = (true, true);
        self.tripped = None;
        self.announced = Announced::by(visitor, &self.units);
        self.begins = None;
        self.commits = 0;
        self.unsettled = 0;
        self.holding = 0;
        self.link = LinkStats::default();
        self.measured = Measurement::zeros(self.units.len());
        self.sound = Measurement::zeros(self.units.len());
        if let Err(text) = self.open_log(visitor) {
            self.end(Cause::Protocol, &text);
            return Err(text.into());
        }
        self.is_dismissed = false;
        match self.get_ready(visitor, wanted) {
            Ok(told) => Ok(told),
            Err(TestEnd { cause, text }) => {
                // Its own reason is one for its controller, too.
                let said = self.dismiss(cause);
                let text = with_last_words(text, said);
                let over = TestEnd { cause, text };
                if over.cause.status() == Status::Failed {
                    self.note(Remark::Link, &over.text);
                }
                self.end(over.cause, &over.text);
                Err(over)
            }
        }
    }

    fn open_log(&mut self, visitor: &Visitor) -> Result<(), String> {
        let Some(settings) = &self.keeping else {
            return Ok(());
        };
        let log = Log::open(settings, &self.name, &self.units, visitor, self.away_from);
        let mut log = log.map_err(|text| format!("the log cannot be kept: {text}"))?;
        if let Some(words) = &self.played {
            log.warn(Remark::Faults, words);
        }
        self.log = Some(log);
        Ok(())
    }

    /// A session begins with the guard of the specimen, or with a new one where the specimen is new, too.
    fn borrow_guard(&mut self, visitor: &Visitor) -> Result<(), TestEnd> {
        let new = SpecimenGuard::new(self.guard.limits.clone(), self.moves);
        if self.is_lasting() {
            let lent = self.store.lend(|| new);
            self.guard = lent.ok_or_else(|| TestEnd::failed("another session has the specimen"))?;
            self.guard.begin(visitor.rate);
        } else {
            self.guard = new;
            self.guard.begin(visitor.rate);
        }
        Ok(())
    }
}
