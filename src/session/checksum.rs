//! SHA-256 of the files of a run: a file that was changed since the test is refused.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use super::replay_error::ReplayError;
use gusset_record::{Checksum, Event, FolderError, Run, keeps_waiting};

pub(super) fn read(path: &Path) -> Result<Vec<u8>, ReplayError> {
    let bytes = if keeps_waiting(path) {
        Err(std::io::Error::other("it is not a file"))
    } else {
        std::fs::read(path)
    };
    bytes.map_err(|source| unreadable(path, source))
}

pub(super) fn sha256(bytes: &[u8]) -> String {
    Checksum::of(bytes).to_string()
}

pub(super) fn unreadable(path: &Path, source: std::io::Error) -> ReplayError {
    ReplayError::Unreadable {
        path: path.to_owned(),
        source,
    }
}

/// SHA-256 of the first `rows` rows of a run, read in pieces.
pub(super) fn rows_sha256(run: &Run, rows: u64) -> Result<String, ReplayError> {
    let path = run.path().join("samples.bin");
    let failed = |source| unreadable(&path, source);
    if keeps_waiting(&path) {
        return Err(failed(std::io::Error::other("it is not a file")));
    }
    let file = File::open(&path).map_err(failed)?;
    let bytes = rows.saturating_mul(run.layout().stride() as u64);
    let mut piece = vec![0; 1 << 16];
    let (mut file, mut digest) = (file.take(bytes), Sha256::new());
    loop {
        match file.read(&mut piece).map_err(failed)? {
            0 => return Ok(Checksum::from(digest).to_string()),
            count => digest.update(piece.get(..count).unwrap_or_default()),
        }
    }
}

/// The files of the test and their SHA-256, from its events; `None` if they do not contain them.
pub(super) fn files_of(run: &Run) -> Result<Option<Vec<(PathBuf, String)>>, FolderError> {
    for line in run.event_lines()? {
        if let Some(Event::Files { sha256, .. }) = line?.map(|line| line.event) {
            let each = sha256.iter().map(|(name, wanted)| {
                let wanted = wanted.as_str().unwrap_or_default();
                (run.path().join(name), wanted.to_owned())
            });
            return Ok(Some(each.collect()));
        }
    }
    Ok(None)
}

/// Checks the files of the test against its events. True if the events contain them.
pub(super) fn check_files(run: &Run) -> Result<bool, ReplayError> {
    let files = files_of(run)?;
    for (path, wanted) in files.iter().flatten() {
        same(path, wanted)?;
    }
    Ok(files.is_some())
}

/// The error that a file of the run was changed after the test, if any. Missing files do not count.
#[must_use]
pub fn altered(run: &Run) -> Option<ReplayError> {
    let files = files_of(run).ok().flatten().unwrap_or_default();
    let errors = files
        .iter()
        .filter_map(|(path, wanted)| same(path, wanted).err());
    let mut changed = errors.filter(|error| matches!(error, ReplayError::Input { .. }));
    changed.next()
}

pub(super) fn check_inputs(run: &Run) -> Result<(), ReplayError> {
    for input in run.summary().map_or(&[][..], |summary| &summary.inputs) {
        same(&run.path().join(&input.path), &input.sha256)?;
    }
    Ok(())
}

/// Checks that a file is unchanged.
pub(super) fn same(path: &Path, wanted: &str) -> Result<(), ReplayError> {
    let found = sha256(&read(path)?);
    if found == wanted {
        return Ok(());
    }
    Err(ReplayError::Input {
        path: path.to_owned(),
        wanted: wanted.to_owned(),
        found,
    })
}
