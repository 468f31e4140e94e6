//! Bytes of the files that many tests of one study read: each file is read once, so all tests have the same bytes.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rustix::fs::OFlags;

/// MiB of the longest file that a test may name: 12 hours of a record at 1 kHz, with 20 bytes to a sample, have room.
const LONGEST_MIB: u64 = 1024;

/// The bytes of the plain file at `path`. A pipe or a device is refused: one may never answer, another never ends.
///
/// # Errors
/// The system refuses, it is no plain file, or it has more than `longest_mib` MiB.
pub(super) fn read_at_most(longest_mib: u64, path: &Path) -> io::Result<Vec<u8>> {
    let longest = longest_mib << 20;
    let too_long = || {
        let reason = format!("more than the {longest_mib} MiB that it may have");
        io::Error::new(io::ErrorKind::FileTooLarge, reason)
    };
    // A pipe without a writer would block the opening.
    let flags = OFlags::NONBLOCK | OFlags::NOCTTY;
    let file = File::options()
        .read(true)
        .custom_flags(flags.bits().cast_signed())
        .open(path)?;
    // The open file, because another one may have the name by now.
    let found = file.metadata()?;
    if !found.is_file() {
        let kind = if found.is_dir() {
            io::ErrorKind::IsADirectory
        } else {
            io::ErrorKind::InvalidInput
        };
        let reason = "it is no plain file: a folder, a pipe or a device cannot be read here";
        return Err(io::Error::new(kind, reason));
    }
    if found.len() > longest {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    file.take(longest + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > longest {
        return Err(too_long());
    }
    Ok(bytes)
}

/// The bytes of a file that a test names.
///
/// # Errors
/// The system refuses, or the file is longer than any record.
pub fn read_input(path: &Path) -> io::Result<Vec<u8>> {
    read_at_most(LONGEST_MIB, path)
}

/// A file: its full path and its bytes.
pub type Stored = (PathBuf, Arc<[u8]>);

/// Files that were read, by the paths that tests gave.
#[derive(Debug, Default)]
pub struct InputStore {
    files: Mutex<BTreeMap<PathBuf, Stored>>,
    is_closed: AtomicBool,
}

impl InputStore {
    /// Full path and bytes of the file at `path`, from the disk on the first request.
    ///
    /// # Errors
    /// The system refuses; or the store is closed, and the file was not read before.
    pub fn read(&self, path: &Path) -> io::Result<Stored> {
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = files.get(path) {
            return Ok(known.clone());
        }
        if self.is_closed.load(Ordering::Relaxed) {
            let text = "it was not among the files of the study when the study was read";
            return Err(io::Error::other(text));
        }
        let real = path.canonicalize()?;
        let bytes: Arc<[u8]> = read_input(&real)?.into();
        files.insert(path.to_owned(), (real.clone(), Arc::clone(&bytes)));
        Ok((real, bytes))
    }

    /// Keeps the bytes of the file at `path`, which was read from `real`.
    pub(super) fn keep(&self, path: PathBuf, real: &Path, bytes: &[u8]) {
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        files
            .entry(path)
            .or_insert_with(|| (real.to_owned(), bytes.into()));
    }

    /// No further file is read from the disk.
    pub fn close(&self) {
        self.is_closed.store(true, Ordering::Relaxed);
    }

    /// Full path and BLAKE3 digest of each file, in the order of the paths.
    #[must_use]
    pub fn digests(&self) -> BTreeMap<PathBuf, String> {
        let files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        let digest = |bytes: &[u8]| blake3::hash(bytes).to_hex().to_string();
        files
            .values()
            .map(|(path, bytes)| (path.clone(), digest(bytes)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn store_keeps_the_first_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
        std::fs::write(&one, "first").unwrap();
        std::fs::write(&other, "other").unwrap();
        let store = InputStore::default();
        assert_eq!(&*store.read(&one).unwrap().1, b"first");
        std::fs::write(&one, "changed").unwrap();
        store.close();
        assert_eq!(&*store.read(&one).unwrap().1, b"first");
        std::fs::remove_file(&one).unwrap();
        assert_eq!(&*store.read(&one).unwrap().1, b"first");
        assert!(store.read(&other).is_err());
        assert_eq!(store.digests().len(), 1);
    }
}
