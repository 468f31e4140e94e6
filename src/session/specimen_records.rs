//! The lasting records of the specimens that a test moves: the position of each before the first motion, until the regular
//! end.
//!
//! A record is written after the specimens are connected and before the loop starts, and again when the loop has ended. The loop
//! itself does not use it.

use std::path::{Path, PathBuf};

use super::guarded::Ended;
use gusset_control::engine::EndPosition;
use gusset_control::port::Port;
use gusset_quantity::catalog::ending::Cause;
use gusset_record::lasting::{
    Kept, LastingError, LastingRecord, Place, SpecimenKey, is_same, state_folder,
};
use gusset_record::rt::wall::Wall;
use gusset_record::utc::rfc3339;
use gusset_setup::Facts;

/// The lasting records of a test that its caller knows.
#[derive(Debug, Clone)]
pub struct SpecimenRecords {
    /// Protocol family and address of each specimen, in order; `None` for a computed one.
    pub links: Vec<Option<(&'static str, String)>>,
    /// Command that moves the specimens.
    pub what: &'static str,
}

/// A record that is held while the test runs.
#[derive(Debug)]
struct HeldRecord {
    port: usize,
    record: LastingRecord,
    /// Its content before the test.
    before: Kept,
    place: Place,
}

/// The records that are held while the test runs.
#[derive(Debug, Default)]
pub(super) struct HeldRecords(Vec<HeldRecord>);

impl SpecimenRecords {
    /// Holds the record of each specimen in `moving`, and writes its position. Nothing has moved yet.
    ///
    /// # Errors
    /// A specimen must not be moved; the reason in words.
    pub(super) fn begin(
        &self,
        ports: &[Port],
        moving: &[usize],
        facts: &Facts,
        run: &Path,
    ) -> Result<HeldRecords, String> {
        let mut held = Vec::new();
        for &index in moving {
            let (Some(port), Some(Some(link))) = (ports.get(index), self.links.get(index)) else {
                continue;
            };
            let begun = self.begin_one((index, port), link, facts, run);
            held.push(begun.map_err(|text| format!("specimen \"{}\": {text}", port.name()))?);
        }
        for (number, one) in held.iter().enumerate() {
            let kept = Kept {
                trip: None,
                place: Some(one.place.clone()),
            };
            if let Err(error) = one.record.write(&kept) {
                for earlier in held.iter().take(number) {
                    let _ = earlier.record.write(&earlier.before);
                }
                let file = one.record.file().display();
                return Err(format!(
                    "{file}: where the specimen stands cannot be recorded before it moves: {error}"
                ));
            }
        }
        Ok(HeldRecords(held))
    }

    fn begin_one(
        &self,
        (index, port): (usize, &Port),
        (family, address): &(&'static str, String),
        facts: &Facts,
        run: &Path,
    ) -> Result<HeldRecord, String> {
        let told = |error: LastingError| error.to_string();
        let key = SpecimenKey::of_link(family, address).map_err(told)?;
        let record = LastingRecord::hold(&state_folder().map_err(told)?, &key).map_err(told)?;
        let before = record.read().map_err(|error| error.to_string())?;
        let (reset, run) = (run.display(), itself(run));
        let standing = port.startup().standing().unwrap_or_default();
        let resumed = facts.resumed.as_ref().map(|(folder, _)| itself(folder));
        let goes_on = before.place.as_ref().filter(|place| {
            let resumed = resumed.as_ref();
            before.trip.is_none() && resumed.is_some_and(|folder| place.runs.contains(folder))
        });
        if !before.is_empty() && goes_on.is_none() {
            let words = before.words(&standing).join("; ");
            return Err(format!(
                "{words}. Look at the specimen, then `gusset reset {reset}`"
            ));
        }
        let mut runs = goes_on.map_or_else(Vec::new, |place| place.runs.clone());
        runs.push(run.clone());
        let units = facts.units.get(index).into_iter().flatten();
        let place = Place {
            what: format!("{} into {}", self.what, run.display()),
            runs,
            at: rfc3339(Wall::now().0),
            units: units.map(|[disp, _]| (*disp).to_owned()).collect(),
            began: goes_on.map_or_else(|| standing.to_vec(), |place| place.began.clone()),
            left: Vec::new(),
        };
        Ok(HeldRecord {
            port: index,
            record,
            before,
            place,
        })
    }
}

impl HeldRecords {
    /// The loop has ended. A place is forgotten after a regular end, and where the last command is the place where the specimen
    /// began; else it stays, with the last command. Returns the records that could not be written, in words.
    pub(crate) fn end(self, ended: &Ended) -> Vec<String> {
        let mut unwritten = Vec::new();
        for HeldRecord {
            port,
            record,
            before,
            mut place,
        } in self.0
        {
            let outcome = ended.outcome.as_ref();
            let is_regular = outcome.is_some_and(|outcome| {
                outcome.ending.cause() == Cause::Done && outcome.unfinished.is_none()
            });
            let last = outcome.and_then(|outcome| outcome.last_commands.get(port));
            let is_lost = outcome.is_none_or(|outcome| {
                // The position of a specimen that is lost, or has not answered its last command, is unknown.
                matches!(outcome.left.get(port), Some(EndPosition::Lost) | None)
                    || outcome.unheard.contains(&port)
            });
            let kept = match last {
                _ if is_regular => Kept::default(),
                // Nothing moved: no command has left.
                Some(last) if last.is_empty() => before,
                Some(last) if !is_lost && place.is_back(last) => Kept::default(),
                Some(last) if !is_lost && is_left(&before, last) => before,
                last => {
                    place.left = last.cloned().unwrap_or_default();
                    Kept {
                        trip: None,
                        place: Some(place),
                    }
                }
            };
            if let Err(error) = record.write(&kept) {
                unwritten.push(format!("{}: {error}", record.file().display()));
            }
        }
        unwritten
    }
}

/// True if the specimen is at the end position of an earlier test.
fn is_left(before: &Kept, last: &[f64]) -> bool {
    let place = before.place.as_ref();
    place.is_some_and(|place| is_same(&place.left, last))
}

/// The canonical path of a folder.
fn itself(folder: &Path) -> PathBuf {
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
}
