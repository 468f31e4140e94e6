//! report.html: made from the run folder and nothing else, now or years later.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::record::{End, FolderError, Run, atomic};
use crate::report::{IdentifiedAxis, RunData, hero_svg, identified, render};

/// Why there is no report.
#[derive(Debug, Error)]
pub enum PageError {
    /// The run folder cannot be read.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file of it cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// What a run folder's page was written from, and says.
#[derive(Debug)]
pub struct Page {
    /// The file.
    pub path: PathBuf,
    /// Identified stiffness and lag of each axis; none for a test with a structure.
    pub identified: Vec<IdentifiedAxis>,
}

/// Writes report.html into a run folder, finished or not.
///
/// # Errors
/// [`PageError`].
pub fn write_report(folder: &Path) -> Result<Page, PageError> {
    let run = read(folder)?;
    let path = write(&folder.join("report.html"), &render(&run))?;
    Ok(Page {
        path,
        identified: identified(&run),
    })
}

/// Writes the wide picture of a run to `path`.
///
/// # Errors
/// [`PageError`].
pub fn hero(folder: &Path, path: &Path) -> Result<PathBuf, PageError> {
    write(path, &hero_svg(&read(folder)?))
}

fn write(path: &Path, text: &str) -> Result<PathBuf, PageError> {
    match atomic::write(path, text.as_bytes()) {
        Ok(()) => Ok(path.to_owned()),
        Err(source) => Err(PageError::File {
            path: path.to_owned(),
            source,
        }),
    }
}

fn read(folder: &Path) -> Result<RunData, PageError> {
    let run = Run::open(folder)?;
    let at = |name: &str| folder.join(name);
    let columns = run.layout().columns().to_vec();
    let mut journal = run.journal()?;
    let all: Vec<usize> = (0..columns.len()).collect();
    let data = journal.columns(&all).map_err(|source| PageError::File {
        path: at("samples.bin"),
        source,
    })?;
    let unfinished = match (run.summary(), journal.end()) {
        (None, _) => Some("the run has no summary.json: it is still running or was killed".into()),
        (Some(_), Some(end)) if end != End::Clean => Some(end.to_string()),
        (Some(_), _) => None,
    };
    let json = |name: &str| {
        let bytes = std::fs::read(at(name)).ok()?;
        serde_json::from_slice(&bytes).ok()
    };
    let text = |name: &str| std::fs::read_to_string(at(name)).unwrap_or_default();
    let resolved = text("resolved.toml");
    let table: Option<toml::Table> = resolved.parse().ok();
    let title = table.and_then(|table| table.get("title")?.as_str().map(str::to_owned));
    let name = || {
        folder
            .file_name()
            .map(|name| name.to_string_lossy().into_owned())
    };
    Ok(RunData {
        title: title.or_else(name).unwrap_or_else(|| "run".to_owned()),
        columns,
        data,
        summary: json("summary.json"),
        timing: json("timing.json"),
        events: run.events()?.events,
        unfinished,
        resolved,
    })
}
