//! The files of a test, archived in its run folder and recorded with their digests.

use super::checksum::sha256;
use super::origin::ORIGIN;
use gusset_record::{Event, FolderError, Layout, RunFolder};
use gusset_setup::Files;

/// Keeps all of it.
pub(super) fn keep(files: &Files, folder: &mut RunFolder) -> Result<(), FolderError> {
    folder.keep(&files.test, &files.resolved, &files.inputs)?;
    if let Some((interrupted, origin)) = &files.origin {
        folder.keep_before(interrupted)?;
        folder.write(ORIGIN, origin.as_bytes())?;
    }
    Ok(())
}

/// The event that records the files of the test, so that a resume can prove that they are unchanged.
pub(super) fn note(files: &Files, layout: &Layout, folder: &RunFolder) -> Event {
    let mut hashes = serde_json::Map::new();
    let mut add = |name: &str, hash: String| {
        hashes.insert(name.to_owned(), hash.into());
    };
    add("test.toml", sha256(&files.test));
    add("resolved.toml", sha256(files.resolved.as_bytes()));
    // A changed name or unit of a column changes the measured quantity.
    add("samples.json", sha256(layout.to_json().as_bytes()));
    for input in folder.inputs() {
        add(&input.path, input.sha256.clone());
    }
    Event::Files {
        sha256: hashes,
        version: env!("CARGO_PKG_VERSION").into(),
    }
}
