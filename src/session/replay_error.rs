//! Why a run folder cannot be replayed or resumed.

use std::path::PathBuf;

use thiserror::Error;

use gusset_config::ConfigError;
use gusset_control::port::PortError;
use gusset_record::FolderError;

/// Why a folder cannot be replayed.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// It is no run folder, or a damaged one.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Its configuration is not one of this program.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Its rows do not fit the specimens of the test.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A server wrote it: its commands came from elsewhere.
    #[error("{}: a server recorded this test, whose commands came from its controller: only the run folder of that controller can go on", .0.display())]
    Served(PathBuf),
    /// A server wrote it, and its controller's test never began, or an earlier version wrote it.
    #[error("{}: its events have no `ready`: the controller's test ended before its first command, or an earlier version recorded it", .0.display())]
    NeverBegan(PathBuf),
    /// The specimen of a server cannot be made again.
    #[error("{}: {}", .0.display(), .1)]
    Host(PathBuf, String),
    /// A copy of an input differs from the file that the test read.
    #[error("{} was changed: its SHA-256 is {found}, but the test had {wanted}", path.display())]
    Input {
        /// The copy.
        path: PathBuf,
        /// SHA-256 in the summary.
        wanted: String,
        /// SHA-256 of the file.
        found: String,
    },
    /// A copy of an input cannot be read.
    #[error("{}: {source}", path.display())]
    Unreadable {
        /// The copy.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// `resumed.json` is damaged.
    #[error("{} is damaged: {source}", path.display())]
    Origin {
        /// The file.
        path: PathBuf,
        /// The mistake.
        source: serde_json::Error,
    },
    /// The folder lacks the interrupted test that this one resumed.
    #[error("{} is missing: it holds the interrupted run that this run resumed. Copy {} there", path.display(), parent.display())]
    NoBefore {
        /// Where it must be.
        path: PathBuf,
        /// Where the interrupted test was.
        parent: PathBuf,
    },
    /// The interrupted test that this one resumed does not replay identically.
    #[error("the interrupted run {}, which this run resumed, does not replay identically", .0.display())]
    Parent(PathBuf),
    /// The columns are not those of the configuration.
    #[error("the samples have {}, but the configuration makes {}", found.as_deref().unwrap_or("no such column"), wanted.as_deref().unwrap_or("no such column"))]
    Columns {
        /// First column that differs, as recorded.
        found: Option<String>,
        /// As it should be.
        wanted: Option<String>,
    },
}
