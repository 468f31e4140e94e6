//! Files that a test names: records, matrices, force tables. Read once, remembered for the run folder.
//!
//! A path in a test file is relative to that file. Each input keeps its bytes, its SHA-256 and a name that is unique in
//! the run folder's `inputs/`, so that the folder alone is enough to run the test again. The meaning of the bytes is
//! not decided here.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};
use thiserror::Error;

use super::diagnose::Finding;
use super::document::KeyPath;
use super::input_store::{InputStore, read_input};
use super::suggest;

/// Folder of the run folder that holds the copies.
pub(crate) const INPUTS_FOLDER: &str = "inputs";

/// One file that the test read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Input {
    /// The path as the test file spells it; all spellings if it is named twice.
    pub requested: Vec<String>,
    /// Where it was found.
    pub path: PathBuf,
    /// Unique name of the copy in `inputs/`.
    pub name: String,
    /// SHA-256 of the bytes, in lower-case hexadecimal.
    pub sha256: String,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Why an input could not be read.
#[derive(Debug, Error)]
pub enum InputError {
    /// There is no such file.
    #[error("there is no file {path}")]
    Missing {
        /// Where it was looked for.
        path: PathBuf,
        /// A file of the same folder with a similar name.
        nearest: Option<String>,
    },
    /// The path is a folder.
    #[error("{path} is a folder, not a file")]
    Folder {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// The system refused.
    #[error("cannot read {path}: {source}")]
    Refused {
        /// Where it was looked for.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
}

impl InputError {
    /// The complaint at the key that names the file.
    #[must_use]
    pub fn finding(&self, at: KeyPath) -> Finding {
        let finding = Finding::error(at, self.to_string());
        match self {
            Self::Missing { nearest, .. } => {
                let label = nearest.as_ref().map_or_else(
                    || "no such file".to_owned(),
                    |n| format!("did you mean `{n}`?"),
                );
                finding
                    .label(label)
                    .help("paths are relative to the folder of this file")
            }
            Self::Folder { .. } => finding.label("a file is wanted"),
            Self::Refused { .. } => finding.label("cannot be read"),
        }
    }
}

/// The files that a test has read so far.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    folder: PathBuf,
    files: Vec<Input>,
    /// Bytes that other tests of the same study read before.
    store: Option<Arc<InputStore>>,
}

impl Inputs {
    /// Inputs of a test file that lies in `folder`.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            files: Vec::new(),
            store: None,
        }
    }

    /// Inputs that take their bytes from the store of a study, which keeps those that were read before.
    #[must_use]
    pub fn with_store(mut self, store: Option<Arc<InputStore>>) -> Self {
        for (store, file) in store
            .iter()
            .flat_map(|store| self.files.iter().map(move |f| (store, f)))
        {
            for requested in &file.requested {
                store.keep(self.folder.join(requested), &file.path, &file.bytes);
            }
        }
        self.store = store;
        self
    }

    /// The bytes of the file that the test calls `requested`, read on the first request.
    ///
    /// # Errors
    /// [`InputError`] if it cannot be read.
    pub fn read(&mut self, requested: &str) -> Result<&[u8], InputError> {
        let index = match self.position(requested) {
            Some(index) => index,
            None => self.load(requested)?,
        };
        Ok(&self.files[index].bytes)
    }

    /// Forgets the files that were read.
    pub(super) fn clear(&mut self) {
        self.files.clear();
    }

    /// All files, in the order of their first request.
    #[must_use]
    pub fn files(&self) -> &[Input] {
        &self.files
    }

    /// The path of `requested` in a run folder, if it was read.
    #[must_use]
    pub(crate) fn path_in_run_folder(&self, requested: &str) -> Option<String> {
        let index = self.position(requested)?;
        Some(format!("{INPUTS_FOLDER}/{}", self.files[index].name))
    }

    fn position(&self, requested: &str) -> Option<usize> {
        let spelt = |file: &Input| file.requested.iter().any(|r| r == requested);
        self.files.iter().position(spelt)
    }

    fn load(&mut self, requested: &str) -> Result<usize, InputError> {
        let path = self.folder.join(requested);
        let refused = |source: io::Error| match source.kind() {
            io::ErrorKind::NotFound => InputError::Missing {
                path: path.clone(),
                nearest: similar_name(&path),
            },
            _ => InputError::Refused {
                path: path.clone(),
                source,
            },
        };
        let (real, bytes) = match &self.store {
            Some(store) => {
                let (real, bytes) = store.read(&path).map_err(refused)?;
                (real, bytes.to_vec())
            }
            None => {
                let real = path.canonicalize().map_err(refused)?;
                if real.is_dir() {
                    return Err(InputError::Folder { path });
                }
                (real, Vec::new())
            }
        };
        if let Some(known) = self.files.iter().position(|file| file.path == real) {
            self.files[known].requested.push(requested.to_owned());
            return Ok(known);
        }
        let bytes = match self.store {
            Some(_) => bytes,
            None => read_input(&real).map_err(refused)?,
        };
        self.files.push(Input {
            requested: vec![requested.to_owned()],
            name: self.unique_name(&path),
            sha256: gusset_quantity::text::hex(&Sha256::digest(&bytes)),
            path: real,
            bytes,
        });
        Ok(self.files.len() - 1)
    }

    /// The file's name, made safe, and numbered where another input already uses it.
    fn unique_name(&self, path: &Path) -> String {
        let own = path
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let safe: String = own
            .chars()
            .map(|c| {
                if c.is_alphanumeric() || matches!(c, '.' | '-' | '_' | '+') {
                    c
                } else {
                    '_'
                }
            })
            .collect();
        let (stem, extension) = match safe.rsplit_once('.') {
            Some((stem, extension)) if !stem.is_empty() => {
                (stem.to_owned(), format!(".{extension}"))
            }
            _ => (safe, String::new()),
        };
        // Without regard to case: the folder may be copied to a file system that has none.
        let taken = |name: &str| self.files.iter().any(|f| f.name.eq_ignore_ascii_case(name));
        let first = format!("{stem}{extension}");
        if !taken(&first) {
            return first;
        }
        // Ends: among files.len() + 1 numbered names one is free.
        (2..)
            .map(|n| format!("{stem}-{n}{extension}"))
            .find(|name| !taken(name))
            .unwrap_or(first)
    }
}

fn similar_name(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let names: Vec<String> = std::fs::read_dir(path.parent()?)
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    suggest::nearest(wanted, &names).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::super::input_store::read_at_most;
    use super::*;

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("b")).unwrap();
        std::fs::write(folder.path().join("elcentro.at2"), "abc").unwrap();
        std::fs::write(folder.path().join("b/ElCentro.at2"), "other").unwrap();
        folder
    }

    #[test]
    fn input_keeps_bytes_and_a_unique_name() {
        let folder = folder();
        let mut inputs = Inputs::new(folder.path());
        assert_eq!(inputs.read("elcentro.at2").unwrap(), b"abc");
        assert_eq!(inputs.read("b/ElCentro.at2").unwrap(), b"other");
        // FIPS 180-2, appendix B.1: the digest of "abc".
        let digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(inputs.files()[0].sha256, digest);
        assert_eq!(
            inputs.path_in_run_folder("elcentro.at2").unwrap(),
            "inputs/elcentro.at2"
        );
        assert_eq!(
            inputs.path_in_run_folder("b/ElCentro.at2").unwrap(),
            "inputs/ElCentro-2.at2"
        );
        assert_eq!(inputs.path_in_run_folder("unread.csv"), None);
    }

    #[test]
    fn two_spellings_of_one_file_are_one_input() {
        let folder = folder();
        let mut inputs = Inputs::new(folder.path());
        inputs.read("elcentro.at2").unwrap();
        inputs.read("b/../elcentro.at2").unwrap();
        assert_eq!(inputs.files().len(), 1);
        assert_eq!(
            inputs.path_in_run_folder("b/../elcentro.at2").unwrap(),
            "inputs/elcentro.at2"
        );
    }

    #[test]
    fn missing_file_suggests_a_neighbour() {
        let folder = folder();
        let mut inputs = Inputs::new(folder.path());
        let error = inputs.read("elcntro.at2").unwrap_err();
        assert!(error.to_string().contains("no file"), "{error}");
        let finding = error.finding(KeyPath::root().key("file"));
        assert!(finding.label.contains("`elcentro.at2`"));
        assert!(inputs.read("b").unwrap_err().to_string().contains("folder"));
    }

    #[test]
    fn only_a_plain_short_file_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let kind = |path: &Path| read_at_most(1, path).unwrap_err().kind();
        assert_eq!(kind(Path::new("/dev/zero")), io::ErrorKind::InvalidInput);
        assert_eq!(kind(folder.path()), io::ErrorKind::IsADirectory);
        // A pipe without a writer would block for ever.
        let pipe = folder.path().join("pipe");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, mode).unwrap();
        assert_eq!(kind(&pipe), io::ErrorKind::InvalidInput);
        let full = folder.path().join("full");
        std::fs::write(&full, vec![b'1'; 1 << 20]).unwrap();
        assert_eq!(read_at_most(1, &full).unwrap().len(), 1 << 20);
        // A file of holes is refused by its length.
        let long = std::fs::File::create(folder.path().join("long")).unwrap();
        long.set_len(1 << 40).unwrap();
        let long = folder.path().join("long");
        assert_eq!(kind(&long), io::ErrorKind::FileTooLarge);
    }
}
