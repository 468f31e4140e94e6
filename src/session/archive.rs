//! The files of a test, archived in its run folder.

use super::origin::ORIGIN;
use gusset_record::{FolderError, RunFolder};
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
