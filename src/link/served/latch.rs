//! The latch of a served specimen: a trip that lasts until the operator at this end clears it.
//!
//! The trip stops its own session for good, and the latch refuses every later one. Of a physical specimen the latch is a file
//! beside the served file, or where `--control` says, so that it outlives a crash and a new start. A computed specimen that
//! remembers has its latch in memory, as it has its state. A lost link is not latched: the next session connects
//! again, and the specimen reports its position.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use crate::record::utc::rfc3339;
use crate::rt::wall::Wall;

/// A latched trip.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LatchedTrip {
    /// Name of the specimen.
    pub specimen: String,
    /// Key of the limit, or another name ([`super::Trip::name`]).
    pub what: String,
    /// What happened, with axis, value and bound.
    pub text: String,
    /// When, UTC.
    pub at: String,
}

/// The latch of one served specimen. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Latch(Arc<Mutex<Latched>>);

#[derive(Debug, Default)]
struct Latched {
    trip: Option<LatchedTrip>,
    file: Option<PathBuf>,
    /// Argument of `gusset reset`.
    control: Option<PathBuf>,
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

    /// The latch that is kept in `file`, which `gusset reset CONTROL` clears. A file that cannot be understood counts as a
    /// trip.
    ///
    /// # Errors
    /// The file cannot be read, or its folder cannot be written to.
    pub fn in_file(file: &Path, control: &Path) -> io::Result<Self> {
        let trip = match std::fs::read(file) {
            Ok(bytes) => Some(
                serde_json::from_slice(&bytes).unwrap_or_else(|error| LatchedTrip {
                    specimen: String::new(),
                    what: "unreadable".to_owned(),
                    text: format!("{} cannot be read ({error})", file.display()),
                    at: String::new(),
                }),
            ),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        // A trip must find the place writable: that shows now.
        let draft = draft_of(file);
        File::create(&draft)?;
        std::fs::remove_file(&draft)?;
        Ok(Self(Arc::new(Mutex::new(Latched {
            trip,
            file: Some(file.to_owned()),
            control: Some(control.to_owned()),
        }))))
    }

    /// The trip that is latched.
    #[must_use]
    pub fn trip(&self) -> Option<LatchedTrip> {
        self.latched().trip.clone()
    }

    /// Why no session begins, if a trip is latched, and what its operator does about it.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        let latched = self.latched();
        let trip = latched.trip.as_ref()?;
        // To the second.
        let at = trip
            .at
            .get(..19)
            .map_or_else(String::new, |at| format!(" at {at}Z"));
        let next = next_step(latched.control.as_deref());
        Some(format!(
            "the specimen tripped{at}: {}; no test begins until {next}",
            trip.text
        ))
    }

    /// The operator's next step after a trip of this specimen.
    #[must_use]
    pub fn next_step(&self) -> String {
        next_step(self.latched().control.as_deref())
    }

    /// Latches a trip; the first one stays. The file is there when this returns, and on the disk after [`Latch::settle`].
    pub fn set(&self, specimen: &str, what: &str, text: &str) {
        let mut latched = self.latched();
        if latched.trip.is_some() {
            return;
        }
        let trip = LatchedTrip {
            specimen: specimen.to_owned(),
            what: what.to_owned(),
            text: text.to_owned(),
            at: rfc3339(Wall::now().0),
        };
        if let Some(file) = &latched.file
            && let Err(error) = write(file, &trip)
        {
            tracing::error!(
                "{}: the trip is not kept there ({error}): it is forgotten when this server ends",
                file.display()
            );
        }
        latched.trip = Some(trip);
    }

    /// Brings a latched trip to the disk, for a power cut.
    pub fn settle(&self) {
        let latched = self.latched();
        if let (Some(_), Some(file)) = (&latched.trip, &latched.file) {
            let folder = file.parent().filter(|path| !path.as_os_str().is_empty());
            let folder = folder.unwrap_or(Path::new("."));
            for path in [file.as_path(), folder] {
                // A failure was reported when the file was written.
                let _ = File::open(path).and_then(|file| file.sync_all());
            }
        }
    }

    /// Clears it; what was latched.
    ///
    /// # Errors
    /// The file cannot be removed: the trip stays latched.
    pub fn clear(&self) -> io::Result<Option<LatchedTrip>> {
        let mut latched = self.latched();
        if let Some(file) = &latched.file {
            match std::fs::remove_file(file) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                Ok(()) | Err(_) => {}
            }
        }
        Ok(latched.trip.take())
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

/// Where the file is written before it takes its name.
fn draft_of(file: &Path) -> PathBuf {
    let mut name = file.file_name().unwrap_or_default().to_owned();
    name.push(".new");
    file.with_file_name(name)
}

/// Whole or not at all.
fn write(file: &Path, trip: &LatchedTrip) -> io::Result<()> {
    let draft = draft_of(file);
    let mut text = serde_json::to_vec(trip)?;
    text.push(b'\n');
    File::create(&draft)?.write_all(&text)?;
    std::fs::rename(&draft, file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latched_trip_outlives_the_server_until_it_is_cleared() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("control.latch.json");
        let control = Path::new("runs/gateway");
        let latch = || Latch::in_file(&file, control).unwrap();
        assert_eq!(latch().refusal(), None);
        let first = latch();
        first.set(
            "rig",
            "command_vel_m_per_s",
            "axis 1: 0.5 m/s, allowed 0.1 m/s",
        );
        first.set("rig", "interlock", "later");
        first.settle();
        let refusal = latch().refusal().unwrap();
        for words in ["0.5 m/s, allowed 0.1", "`gusset reset runs/gateway`"] {
            assert!(refusal.contains(words), "{refusal}");
        }
        let again = latch();
        assert_eq!(again.clear().unwrap().unwrap().what, "command_vel_m_per_s");
        assert_eq!(again.clear().unwrap(), None);
        assert_eq!(latch().trip(), None);
    }

    #[test]
    fn a_latch_file_that_cannot_be_understood_is_a_trip() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("control.latch.json");
        for bytes in ["", "{\"specimen\":"] {
            std::fs::write(&file, bytes).unwrap();
            let latch = Latch::in_file(&file, Path::new("x")).unwrap();
            assert_eq!(latch.trip().unwrap().what, "unreadable");
        }
        assert!(Latch::in_file(&folder.path().join("no/such"), Path::new("x")).is_err());
    }
}
