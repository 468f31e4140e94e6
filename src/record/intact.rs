//! Checks that a file of a record is unchanged: others may delete, replace, cut or write into it while the test runs.

use std::fs::{self, File, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// True if both are of one file or folder, whatever it is called.
#[must_use]
pub(crate) fn is_same_file(one: &Metadata, other: &Metadata) -> bool {
    (one.dev(), one.ino()) == (other.dev(), other.ino())
}

/// Identity and length of a file, and the number of bytes written into it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    device: u64,
    inode: u64,
    links: u64,
    length: u64,
    written: u64,
}

/// What others did to a file while it was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meddled {
    /// It has no name any more.
    Deleted,
    /// Another has its name.
    Replaced,
    /// It has more or fewer bytes than were written.
    Changed {
        /// Bytes that it has.
        length: u64,
        /// Bytes that were written.
        written: u64,
    },
}

impl std::fmt::Display for Meddled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Deleted => write!(f, "was deleted while the test ran"),
            Self::Replaced => write!(f, "was replaced by another file while the test ran"),
            Self::Changed { length, written } => write!(
                f,
                "was changed by others while the test ran: it has {length} bytes, and {written} were written"
            ),
        }
    }
}

impl Extent {
    /// Extent of an open file, into which `written` bytes were written.
    ///
    /// # Errors
    /// The system refuses.
    pub(crate) fn of(file: &File, written: u64) -> io::Result<Self> {
        let found = file.metadata()?;
        Ok(Self {
            device: found.dev(),
            inode: found.ino(),
            links: found.nlink(),
            length: found.len(),
            written,
        })
    }

    /// Changes that the open file itself shows; it does not show whether its name now belongs to another file.
    #[must_use]
    pub(crate) const fn meddled(&self) -> Option<Meddled> {
        let Self {
            length, written, ..
        } = *self;
        if self.links == 0 {
            Some(Meddled::Deleted)
        } else if length != written {
            Some(Meddled::Changed { length, written })
        } else {
            None
        }
    }

    /// Changes of the file at its path.
    #[must_use]
    pub fn meddled_at(&self, path: &Path) -> Option<Meddled> {
        let Ok(found) = fs::metadata(path) else {
            return Some(Meddled::Deleted);
        };
        if (found.dev(), found.ino()) != (self.device, self.inode) {
            return Some(Meddled::Replaced);
        }
        self.meddled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    #[test]
    fn changes_by_others_are_distinguished() {
        let temp = tempfile::tempdir().unwrap();
        let (path, other) = (temp.path().join("rows"), temp.path().join("other"));
        let mut file = File::create_new(&path).unwrap();
        file.write_all(b"rows").unwrap();
        let seen = |written| {
            let extent = Extent::of(&file, written).unwrap();
            (extent.meddled(), extent.meddled_at(&path))
        };
        assert_eq!(seen(4), (None, None));
        let changed = Some(Meddled::Changed {
            length: 4,
            written: 5,
        });
        assert_eq!(seen(5), (changed, changed));
        fs::rename(&path, &other).unwrap();
        assert_eq!(seen(4), (None, Some(Meddled::Deleted)));
        fs::copy(&other, &path).unwrap();
        assert_eq!(seen(4), (None, Some(Meddled::Replaced)));
        fs::rename(&other, &path).unwrap();
        assert_eq!(seen(4), (None, None));
        fs::write(&other, "rows").unwrap();
        fs::rename(&other, &path).unwrap();
        assert_eq!(seen(4), (Some(Meddled::Deleted), Some(Meddled::Replaced)));
    }
}
