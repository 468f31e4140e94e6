//! What a test is made of, in its run folder, and on record with its digests.

use super::checksum::sha256;
use super::lineage::{ORIGIN, Origin};
use gusset_record::{Event, FolderError, Layout, RunFolder};
use gusset_setup::Files;

/// Keeps all of it.
pub(super) fn keep(files: &Files, folder: &mut RunFolder) -> Result<(), FolderError> {
    folder.write_test(&files.test)?;
    folder.write_resolved(&files.resolved)?;
    for (path, bytes) in &files.inputs {
        folder.add_input(path, bytes)?;
    }
    if let Some(origin) = &files.origin {
        let near = Origin::text_for(origin, folder.path());
        folder.write_extra(ORIGIN, near.as_ref().unwrap_or(origin).as_bytes())?;
    }
    Ok(())
}

/// What the test is made of, so that whoever goes on with it can prove that it is the same.
pub(super) fn note(files: &Files, layout: &Layout, folder: &RunFolder) -> Event {
    let mut hashes = serde_json::Map::new();
    let mut add = |name: &str, hash: String| {
        hashes.insert(name.to_owned(), hash.into());
    };
    add("test.toml", sha256(&files.test));
    add("resolved.toml", sha256(files.resolved.as_bytes()));
    // Who changes what a column is called, or its unit, changes what was measured.
    add("samples.json", sha256(layout.to_json().as_bytes()));
    for input in folder.inputs() {
        add(&input.path, input.sha256.clone());
    }
    Event::Files {
        sha256: hashes,
        version: env!("CARGO_PKG_VERSION").into(),
    }
}
