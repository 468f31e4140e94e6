//! A file that appears whole or not at all: written beside its place, then moved there.
//!
//! The temporary name is random and must be new, so a planted symbolic link is never followed.

use std::fs::{File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Text between the name of a file and the number of its temporary file.
const MARK: &str = ".partial-";

/// A file under way. Dropped without [`AtomicFile::commit`], it leaves nothing.
#[derive(Debug)]
pub struct AtomicFile {
    file: File,
    path: PathBuf,
    /// Where the bytes go until then; `None` if `path` is not a plain file (a pipe, a terminal) and is written directly.
    partial: Option<PathBuf>,
}

impl AtomicFile {
    /// Begins a file that will replace what is at `path`.
    ///
    /// # Errors
    /// The system refuses; the folder of `path` must exist.
    pub fn create(path: &Path) -> io::Result<Self> {
        let special = path.metadata().is_ok_and(|found| !found.is_file());
        let (file, partial) = if special {
            (File::options().write(true).open(path)?, None)
        } else {
            let (file, partial) = begun(path)?;
            (file, Some(partial))
        };
        Ok(Self {
            file,
            path: path.to_owned(),
            partial,
        })
    }

    /// Where the bytes go until then.
    #[must_use]
    #[cfg(any(test, feature = "hdf5"))]
    pub(crate) fn path(&self) -> &Path {
        self.partial.as_deref().unwrap_or(&self.path)
    }

    /// Gives up the lock of the temporary file.
    #[cfg(feature = "hdf5")]
    pub(crate) fn unlock(&self) {
        // A file system may have no locks.
        let _there_may_be_none = self.file.unlock();
    }

    /// Syncs the bytes and moves them to their place.
    ///
    /// # Errors
    /// The system refuses; nothing is left then.
    pub fn commit(mut self) -> io::Result<()> {
        if let Some(partial) = &self.partial {
            self.file.sync_all()?;
            std::fs::rename(partial, &self.path)?;
            self.partial = None;
            // The name is on the disk only when its folder is.
            if let Some(folder) = self.path.parent().filter(|f| !f.as_os_str().is_empty()) {
                File::open(folder)?.sync_all()?;
            }
        }
        Ok(())
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(partial) = &self.partial {
            let _it_may_be_gone = std::fs::remove_file(partial);
        }
    }
}

/// A new temporary file for `path`, locked: [`remove_abandoned`] leaves it.
fn begun(path: &Path) -> io::Result<(File, PathBuf)> {
    loop {
        let partial = partial_of(path)?;
        let file = File::create_new(&partial)?;
        // A file system may have no locks; then nothing removes the file either.
        let is_removed = matches!(file.try_lock(), Err(TryLockError::WouldBlock));
        // It may have been removed before it was locked.
        if !is_removed && file.metadata()?.nlink() > 0 {
            return Ok((file, partial));
        }
    }
}

/// A temporary path in the folder of `path`, with a random name.
///
/// # Errors
/// `path` has no name, or the system no random numbers.
pub(super) fn partial_of(path: &Path) -> io::Result<PathBuf> {
    let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let number = random_number()?;
    let partial = format!(".{}{MARK}{number:016x}", name.to_string_lossy());
    Ok(path.with_file_name(partial))
}

/// A random number of the operating system.
///
/// # Errors
/// The system has none.
pub fn random_number() -> io::Result<u64> {
    let mut bytes = [0; 8];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

/// Removes the temporary files of `folder` whose process was killed. A process that still writes its file holds a lock on it.
/// `is_own` judges the name of the file that the temporary one would have become.
///
/// # Errors
/// The folder cannot be read.
pub fn remove_abandoned(folder: &Path, is_own: impl Fn(&str) -> bool) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let becomes = name.strip_prefix('.').and_then(|name| {
            let (name, number) = name.rsplit_once(MARK)?;
            let is_number = number.len() == 16 && number.bytes().all(|b| b.is_ascii_hexdigit());
            is_number.then_some(name)
        });
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if !is_file || !becomes.is_some_and(&is_own) {
            continue;
        }
        // A file system without locks, or a file of another user: it stays.
        let Ok(file) = File::options().write(true).open(entry.path()) else {
            continue;
        };
        if file.try_lock().is_ok() {
            let _it_may_be_gone = std::fs::remove_file(entry.path());
        }
    }
    Ok(())
}

/// Writes `bytes` to `path`, whole or not at all.
///
/// # Errors
/// The system refuses.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes)?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncommitted_file_leaves_the_old_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        write(&path, b"old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        write(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn killed_draft_is_removed_live_one_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut live = AtomicFile::create(&path).unwrap();
        live.write_all(b"new").unwrap();
        // The file of a killed process has no lock.
        let killed = partial_of(&path).unwrap();
        let other = partial_of(&folder.path().join("b.csv")).unwrap();
        std::fs::write(&killed, b"half").unwrap();
        std::fs::write(&other, b"half").unwrap();
        remove_abandoned(folder.path(), |name| name == "a.csv").unwrap();
        assert!(!killed.exists() && other.exists() && live.path().exists());
        live.commit().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    /// Another user of the same folder, `/tmp` for example, must not choose where our bytes go.
    #[test]
    fn planted_link_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let victim = folder.path().join("victim");
        std::fs::write(&victim, b"precious").unwrap();
        // The name that a program of this number could be thought to use.
        let guess = format!(".a.csv.partial-{}", std::process::id());
        std::os::unix::fs::symlink(&victim, folder.path().join(guess)).unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&victim).unwrap(), b"precious");
        assert!(!path.is_symlink());
        let [one, other] = [partial_of(&path).unwrap(), partial_of(&path).unwrap()];
        assert_ne!(one, other);
    }

    #[test]
    fn device_is_written_and_not_replaced() {
        write(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
        assert!(write(Path::new("/"), b"").is_err());
    }
}
