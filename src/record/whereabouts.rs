//! Where a run folder is when its test is over: somebody may have moved or deleted it meanwhile. And whether it is over: a
//! test claims its folder by a lock, which goes with the process however that ends.

use std::fs::{self, File, Metadata, TryLockError};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// What became of a folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Whereabouts {
    /// It is where it was made, and its samples in it.
    There,
    /// It was moved, with its samples.
    Moved(PathBuf),
    /// It, or the samples in it, were deleted.
    Gone,
}

/// A hold on a folder, whatever it is called.
#[derive(Debug)]
pub(super) struct Hold(File);

impl Hold {
    /// # Errors
    /// The system refuses.
    pub fn on(folder: &Path) -> io::Result<Self> {
        File::open(folder).map(Self)
    }

    /// Tells who asks with [`is_claimed`] until this is dropped, and keeps nobody out.
    pub fn claim(&self) {
        // A file system without locks tells less, and is no reason not to record there.
        let _who_asks_is_not_told = self.0.try_lock();
    }

    /// What became of the folder that was at `path`, and of `file` in it.
    pub fn find(&self, path: &Path, file: &str) -> Whereabouts {
        let Ok(held) = self.0.metadata() else {
            return Whereabouts::Gone;
        };
        let is_it = |found: &Metadata| (found.dev(), found.ino()) == (held.dev(), held.ino());
        let is_here = |place: &Path| {
            fs::metadata(place).is_ok_and(|found| is_it(&found)) && place.join(file).exists()
        };
        if is_here(path) {
            return Whereabouts::There;
        }
        match fs::read_link(format!("/proc/self/fd/{}", self.0.as_raw_fd())) {
            Ok(place) if is_here(&place) => Whereabouts::Moved(place),
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
    fn a_folder_is_claimed_until_the_hold_on_it_is_gone() {
        let temp = tempfile::tempdir().unwrap();
        let hold = Hold::on(temp.path()).unwrap();
        assert!(!is_claimed(temp.path()));
        hold.claim();
        assert!(is_claimed(temp.path()));
        assert!(is_claimed(temp.path()), "who asks takes nothing");
        drop(hold);
        assert!(!is_claimed(temp.path()));
        assert!(!is_claimed(&temp.path().join("none")));
    }

    #[test]
    fn a_folder_is_found_again_unless_it_or_its_file_is_gone() {
        let temp = tempfile::tempdir().unwrap();
        let (one, two) = (temp.path().join("one"), temp.path().join("two"));
        fs::create_dir(&one).unwrap();
        fs::write(one.join("rows"), "1").unwrap();
        let hold = Hold::on(&one).unwrap();
        assert_eq!(hold.find(&one, "rows"), Whereabouts::There);

        fs::rename(&one, &two).unwrap();
        let two = two.canonicalize().unwrap();
        assert_eq!(hold.find(&one, "rows"), Whereabouts::Moved(two.clone()));
        // Another folder of the old name is not the one.
        fs::create_dir(&one).unwrap();
        fs::write(one.join("rows"), "2").unwrap();
        assert_eq!(hold.find(&one, "rows"), Whereabouts::Moved(two.clone()));

        fs::remove_file(two.join("rows")).unwrap();
        assert_eq!(hold.find(&one, "rows"), Whereabouts::Gone);
        fs::remove_dir(&two).unwrap();
        assert_eq!(hold.find(&one, "rows"), Whereabouts::Gone);
    }
}
