//! Location of a run folder when its test is over: somebody may have moved or deleted it meanwhile, and another folder may
//! have its name. Also whether the test is over: a test claims its folder by a lock, which ends with the process in any
//! case.

use std::fs::{self, File, TryLockError};
use std::io;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

use super::intact::is_same_file;

/// What became of a folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Whereabouts {
    /// It is where it was made.
    There,
    /// It was moved.
    Moved(PathBuf),
    /// It was deleted, or is where it cannot be reached.
    Gone,
}

/// A hold on a folder, whatever it is called.
#[derive(Debug)]
pub(super) struct Hold(File);

impl Hold {
    /// # Errors
    /// The system refuses.
    pub(crate) fn on(folder: &Path) -> io::Result<Self> {
        File::open(folder).map(Self)
    }

    /// Makes [`is_claimed`] true until this is released or dropped; it denies no access.
    pub(crate) fn claim(&self) {
        // Without locks in the file system, claims are not visible, but recording there is allowed.
        let _who_asks_is_not_told = self.0.try_lock();
    }

    /// Takes the claim back.
    pub(crate) fn release(&self) {
        let _there_may_be_none = self.0.unlock();
    }

    /// True if it is the folder that is found at `place`.
    pub(crate) fn is_at(&self, place: &Path) -> bool {
        let found = fs::metadata(place).and_then(|found| Ok((found, self.0.metadata()?)));
        found.is_ok_and(|(found, held)| is_same_file(&found, &held))
    }

    /// What became of the folder that was at `path`.
    pub(crate) fn find(&self, path: &Path) -> Whereabouts {
        if self.is_at(path) {
            return Whereabouts::There;
        }
        match fs::read_link(format!("/proc/self/fd/{}", self.0.as_raw_fd())) {
            Ok(place) if self.is_at(&place) => Whereabouts::Moved(place),
            Ok(_) | Err(_) => Whereabouts::Gone,
        }
    }
}

/// True if a test that runs has claimed this folder; false also where that cannot be known.
#[must_use]
pub fn is_claimed(folder: &Path) -> bool {
    let asked = File::open(folder).map(|folder| folder.try_lock_shared());
    matches!(asked, Ok(Err(TryLockError::WouldBlock)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folder_is_claimed_until_its_hold_ends() {
        let temp = tempfile::tempdir().unwrap();
        let hold = Hold::on(temp.path()).unwrap();
        assert!(!is_claimed(temp.path()));
        hold.claim();
        assert!(is_claimed(temp.path()));
        assert!(is_claimed(temp.path()), "who asks takes nothing");
        hold.release();
        assert!(!is_claimed(temp.path()));
        hold.claim();
        drop(hold);
        assert!(!is_claimed(temp.path()));
        assert!(!is_claimed(&temp.path().join("none")));
    }

    #[test]
    fn folder_is_found_again_unless_deleted() {
        let temp = tempfile::tempdir().unwrap();
        let (one, two) = (temp.path().join("one"), temp.path().join("two"));
        fs::create_dir(&one).unwrap();
        let hold = Hold::on(&one).unwrap();
        assert_eq!(hold.find(&one), Whereabouts::There);

        fs::rename(&one, &two).unwrap();
        let two = two.canonicalize().unwrap();
        assert_eq!(hold.find(&one), Whereabouts::Moved(two.clone()));
        // Another folder of the old name is not the one.
        fs::create_dir(&one).unwrap();
        assert_eq!(hold.find(&one), Whereabouts::Moved(two.clone()));

        fs::remove_dir(&two).unwrap();
        assert_eq!(hold.find(&one), Whereabouts::Gone);
    }
}
