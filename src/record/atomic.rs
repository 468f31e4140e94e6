//! A file that appears whole or not at all: written beside its place, then moved there.
//!
//! The temporary name is random and must be new, so a planted symbolic link is never followed.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

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
        let partial = (!special).then(|| partial_of(path)).transpose()?;
        let file = match &partial {
            Some(partial) => File::create_new(partial)?,
            None => File::options().write(true).open(path)?,
        };
        Ok(Self {
            file,
            path: path.to_owned(),
            partial,
        })
    }

    /// Where the bytes go until then.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.partial.as_deref().unwrap_or(&self.path)
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

/// A temporary path in the folder of `path`, with a random name.
///
/// # Errors
/// `path` has no name, or the system no random numbers.
pub(super) fn partial_of(path: &Path) -> io::Result<PathBuf> {
    let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let mut bytes = [0; 8];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    let number = u64::from_le_bytes(bytes);
    let partial = format!(".{}.partial-{number:016x}", name.to_string_lossy());
    Ok(path.with_file_name(partial))
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
    fn a_file_that_is_not_committed_leaves_the_old_one_and_nothing_else() {
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

    /// Another user of the same folder, `/tmp` for example, must not choose where our bytes go.
    #[test]
    fn a_link_that_was_put_under_the_name_beside_is_not_followed() {
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
    fn a_device_is_written_to_and_not_replaced() {
        write(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
        assert!(write(Path::new("/"), b"").is_err());
    }
}
