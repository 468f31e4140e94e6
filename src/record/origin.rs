//! Where a run comes from: its time, its machine and its program.

use std::path::Path;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use super::rt::wall::Wall;
use super::utc::{local, rfc3339};

/// A build of this program.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Build {
    /// Its version.
    pub version: String,
    /// Commit of its sources, or "unknown".
    pub commit: String,
    /// Its features, with commas between them.
    pub features: String,
    /// The platform for which it was built.
    pub target: String,
    /// The compiler.
    pub compiler: String,
}

/// The program that runs, as its `main` says it.
static BUILD: OnceLock<Build> = OnceLock::new();

/// Says which program runs, once.
pub fn introduce(build: Build) {
    let _it_may_be_known = BUILD.set(build);
}

/// Where a run comes from.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Origin {
    /// UTC at which it began, as RFC 3339.
    pub began: String,
    /// This instant on the clock of the laboratory, with its distance from UTC and its time zone.
    pub began_local: String,
    /// Name of the machine.
    pub host: String,
    /// Its folder, as an absolute path.
    pub folder: String,
    /// The program that made it.
    pub program: Build,
}

impl Origin {
    /// The origin of the run in `folder`, which began then on this machine and is made by this program.
    #[must_use]
    pub fn new(began: Wall, folder: &Path) -> Self {
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let program = BUILD.get().cloned();
        Self {
            began: rfc3339(began.0),
            began_local: local(began.0),
            host: rustix::system::uname()
                .nodename()
                .to_string_lossy()
                .into_owned(),
            folder: folder.display().to_string(),
            program: program.unwrap_or_else(|| Build {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                ..Build::default()
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origin_is_of_this_machine() {
        let origin = Origin::new(Wall(1_772_366_400_000_000_000), Path::new("runs/a"));
        assert_eq!(origin.began, "2026-03-01T12:00:00.000000000Z");
        assert!(
            origin.began_local.starts_with("2026-03-01")
                || origin.began_local.starts_with("2026-02-28")
        );
        assert!(Path::new(&origin.folder).is_absolute() && !origin.host.is_empty());
    }
}
