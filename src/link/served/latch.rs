//! The latch of a served specimen: a trip, or a motion without a regular end, that lasts until the operator at this end clears it.
//!
//! The trip stops its own session for good, and the latch refuses every later one. The latch of a physical specimen is in its
//! lasting record, so that it outlives a crash and a new start. A computed specimen that remembers has its latch in memory,
//! like its state. A lost link is no trip, but the motion that it ended stays recorded.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use gusset_record::lasting::{Kept, LastingRecord, LatchedTrip, Place};
use gusset_record::rt::wall::Wall;
use gusset_record::utc::rfc3339;

/// The latch of one served specimen. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Latch(Arc<Mutex<Latched>>);

#[derive(Debug, Default)]
struct Latched {
    kept: Kept,
    record: Option<LastingRecord>,
    /// Argument of `gusset reset`.
    control: Option<PathBuf>,
    /// A session moves the specimen from the recorded place.
    is_moving: bool,
    /// The record on the disk is an older one: it could not be written.
    is_unwritten: bool,
}

impl Latched {
    /// Writes the record to the disk.
    fn write(&mut self) -> io::Result<()> {
        let Some(record) = &self.record else {
            return Ok(());
        };
        let written = record.write(&self.kept);
        self.is_unwritten = written.is_err();
        if let Err(error) = &written {
            tracing::error!(
                "{}: the record of the specimen is not kept there ({error}): no test begins until it can be written",
                record.file().display()
            );
        }
        written
    }

    /// Repeats a write that failed.
    ///
    /// # Errors
    /// It still cannot.
    fn retry(&mut self) -> Result<(), String> {
        let Some(record) = self.record.as_ref().filter(|_| self.is_unwritten) else {
            return Ok(());
        };
        record.write(&self.kept).map_err(|error| {
            let file = record.file().display();
            format!("{file}: the record of the specimen cannot be written: {error}; no test begins until it can")
        })?;
        self.is_unwritten = false;
        Ok(())
    }
}

impl Latch {
    fn latched(&self) -> MutexGuard<'_, Latched> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A latch in memory, which `gusset reset CONTROL` clears.
    #[must_use]
    pub fn in_memory(control: &Path) -> Self {
        let latch = Self::default();
        latch.latched().control = Some(control.to_owned());
        latch
    }

    /// The latch that is kept in the lasting record of the specimen, which `gusset reset CONTROL` clears.
    ///
    /// # Errors
    /// The record cannot be read.
    pub fn in_record(record: LastingRecord, control: &Path) -> io::Result<Self> {
        Ok(Self(Arc::new(Mutex::new(Latched {
            kept: record.read()?,
            record: Some(record),
            control: Some(control.to_owned()),
            ..Latched::default()
        }))))
    }

    /// The trip that is latched.
    #[must_use]
    pub(crate) fn trip(&self) -> Option<LatchedTrip> {
        self.latched().kept.trip.clone()
    }

    /// The content of the record.
    #[must_use]
    pub fn kept(&self) -> Kept {
        self.latched().kept.clone()
    }

    /// Why no session begins, and the operator's remedy: a trip is latched, a motion has not ended regularly, or the record
    /// cannot be written.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        let mut latched = self.latched();
        let unwritten = latched.retry().err();
        let next = next_step(latched.control.as_deref());
        if let Some(trip) = &latched.kept.trip {
            // To the second.
            let at = trip
                .at
                .get(..19)
                .map_or_else(String::new, |at| format!(" at {at}Z"));
            return Some(format!(
                "the specimen tripped{at}: {}; no test begins until {next}",
                trip.text
            ));
        }
        let place = latched.kept.place.as_ref().filter(|_| !latched.is_moving);
        let place = place.map(|place| format!("{}; no test begins until {next}", place.words()));
        place.or(unwritten)
    }

    /// The operator's next step after a trip of this specimen.
    #[must_use]
    pub(crate) fn next_step(&self) -> String {
        next_step(self.latched().control.as_deref())
    }

    /// Latches a trip; the first one stays. It is on the disk when this returns, if it can be written.
    pub(crate) fn set(&self, specimen: &str, what: &str, text: &str) {
        let mut latched = self.latched();
        if latched.kept.trip.is_some() {
            return;
        }
        latched.kept.trip = Some(LatchedTrip {
            specimen: specimen.to_owned(),
            what: what.to_owned(),
            text: text.to_owned(),
            at: rfc3339(Wall::now().0),
        });
        // The log has the error, and every later session is refused.
        let _ = latched.write();
    }

    /// A session is about to move the specimen from this place, which is on the disk when this returns. Without a lasting record
    /// nothing is kept.
    ///
    /// # Errors
    /// It cannot be written: nothing may move.
    pub(crate) fn begins(&self, place: Place) -> Result<(), String> {
        let mut latched = self.latched();
        if latched.record.is_none() {
            return Ok(());
        }
        latched.kept.place = Some(place);
        if let Err(error) = latched.write() {
            latched.kept.place = None;
            let text =
                format!("where the specimen stands cannot be recorded before it moves: {error}");
            return Err(text);
        }
        latched.is_moving = true;
        Ok(())
    }

    /// The session does not move the specimen any more. The place is forgotten after a regular end, and where the last command
    /// (empty without one) is the place where it began. Without `last`, the link was lost and the position is unknown.
    pub(crate) fn ends(&self, last: Option<&[f64]>, is_regular: bool) {
        let mut latched = self.latched();
        if !std::mem::take(&mut latched.is_moving) {
            return;
        }
        let Some(mut place) = latched.kept.place.take() else {
            return;
        };
        let is_back = last.is_some_and(|last| last.is_empty() || place.is_back(last));
        if !(is_regular || is_back) {
            place.left = last.unwrap_or_default().to_vec();
            latched.kept.place = Some(place);
        }
        let _ = latched.write();
    }

    /// True if a session moves the specimen.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.latched().is_moving
    }

    /// Clears it; returns the earlier record.
    ///
    /// # Errors
    /// A session moves the specimen, or the file cannot be removed. Nothing changes then.
    pub fn clear(&self) -> io::Result<Kept> {
        let mut latched = self.latched();
        if latched.is_moving {
            let text = "a test moves the specimen: end it first, or wait until the server has noticed its end";
            return Err(io::Error::other(text));
        }
        let before = std::mem::take(&mut latched.kept);
        if let Err(error) = latched.write() {
            latched.kept = before;
            return Err(error);
        }
        Ok(before)
    }
}

fn next_step(control: Option<&Path>) -> String {
    match control {
        Some(control) => format!(
            "its operator clears it with `gusset reset {}`",
            control.display()
        ),
        None => "its operator restarts its server".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_record::lasting::SpecimenKey;

    fn latch(folder: &Path) -> Latch {
        let key = SpecimenKey::of_file(Path::new("/lab/rig.toml"), "rig");
        let record = LastingRecord::hold(folder, &key).unwrap();
        Latch::in_record(record, Path::new("runs/gateway")).unwrap()
    }

    fn place(began: f64) -> Place {
        Place {
            what: "a test".to_owned(),
            runs: Vec::new(),
            at: "2026-01-02T03:04:05Z".to_owned(),
            units: vec!["mm".to_owned()],
            began: vec![began],
            left: Vec::new(),
        }
    }

    fn file_in(folder: &Path) -> PathBuf {
        let files = std::fs::read_dir(folder).unwrap();
        let mut files = files.map(|entry| entry.unwrap().path());
        files
            .find(|path| path.extension().is_some_and(|end| end == "json"))
            .unwrap()
    }

    #[test]
    fn a_latched_trip_outlives_the_server() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert_eq!(latch(folder).refusal(), None);
        let first = latch(folder);
        first.set(
            "rig",
            "command_vel_m_per_s",
            "axis 1: 0.5 m/s, allowed 0.1 m/s",
        );
        first.set("rig", "interlock", "later");
        drop(first);
        let again = latch(folder);
        let refusal = again.refusal().unwrap();
        for words in ["0.5 m/s, allowed 0.1", "`gusset reset runs/gateway`"] {
            assert!(refusal.contains(words), "{refusal}");
        }
        let cleared = again.clear().unwrap();
        assert_eq!(cleared.trip.unwrap().what, "command_vel_m_per_s");
        assert!(again.clear().unwrap().is_empty());
        drop(again);
        assert_eq!(latch(folder).trip(), None);
    }

    #[test]
    fn unreadable_latch_record_is_a_trip() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        latch(folder).set("rig", "interlock", "open");
        let file = file_in(folder);
        for bytes in ["", "{\"specimen\":"] {
            std::fs::write(&file, bytes).unwrap();
            assert_eq!(latch(folder).trip().unwrap().what, "unreadable");
        }
    }

    #[test]
    fn motion_without_an_end_stays_recorded() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        // Last command, whether the end is regular, and whether the place stays.
        for (last, is_regular, stays) in [
            (Some(3.0), true, false),
            (Some(3.0), false, true),
            (Some(1.0 + 1e-12), false, false),
            (None, false, false),
        ] {
            let session = latch(folder);
            session.begins(place(1.0)).unwrap();
            assert_eq!(session.refusal(), None);
            assert!(session.clear().is_err(), "it moves");
            let last: Vec<f64> = last.into_iter().collect();
            session.ends(Some(&last), is_regular);
            drop(session);
            let after = latch(folder);
            assert_eq!(after.refusal().is_some(), stays);
            let kept = after.clear().unwrap();
            assert_eq!(kept.place.map(|place| place.left), stays.then_some(last));
        }
        // Killed: its last position is unknown.
        latch(folder).begins(place(1.0)).unwrap();
        assert_eq!(latch(folder).kept().place, Some(place(1.0)));
    }

    #[test]
    fn a_trip_that_cannot_be_written_is_kept() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("state");
        std::fs::create_dir(&folder).unwrap();
        let latch = latch(&folder);
        // Also for the superuser.
        std::fs::rename(&folder, parent.path().join("away")).unwrap();
        std::fs::write(&folder, "").unwrap();
        latch.set("rig", "interlock", "open");
        assert!(latch.refusal().unwrap().contains("open"));
        assert!(latch.clear().is_err());
        assert!(latch.begins(place(1.0)).is_err());
        std::fs::remove_file(&folder).unwrap();
        std::fs::rename(parent.path().join("away"), &folder).unwrap();
        // The next look repeats the write that failed.
        assert!(latch.refusal().unwrap().contains("open"));
        let text = std::fs::read_to_string(file_in(&folder)).unwrap();
        assert!(text.contains("interlock"), "{text}");
    }
}
