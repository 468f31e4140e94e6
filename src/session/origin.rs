//! Where a resumed test comes from: `resumed.json` in its folder. The folder `before` in it holds the interrupted run, so that the
//! folder of a resumed test needs no other.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::checksum::{check_files, read, rows_sha256};
use super::replay_error::ReplayError;
use gusset_control::engine::Place;
use gusset_control::port::Port;
use gusset_quantity::frame::AtAxis;
use gusset_record::summary::Peak;
use gusset_record::{BEFORE, Run};

/// Name of the file in the folder of a resumed test.
pub(super) const ORIGIN: &str = "resumed.json";

/// How the user resumes a test although a specimen has changed.
pub(super) const ACCEPT: &str = "`--accept-changed \"reason\"` resumes the test all the same";

/// Where another folder may be now: where it was, or beside `folder`.
pub(super) fn places(folder: &Path, other: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let beside = other.file_name().map(|name| folder.join("..").join(name));
    [Some(folder.join(other)), beside].into_iter().flatten()
}

/// Position of one axis at the end of a test, and its tolerance, in its own units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kept {
    /// The last command.
    pub command: f64,
    /// Readings of its sensors there.
    pub place: Place,
}

impl Kept {
    /// As text, since JSON has no infinity.
    pub(crate) fn words(&self) -> [String; 7] {
        let Place {
            disp,
            force,
            within,
            disp_of_force,
            force_within,
            way_lost,
        } = self.place;
        [
            self.command,
            disp,
            force,
            within,
            disp_of_force,
            force_within,
            way_lost,
        ]
        .map(|value| format!("{value:?}"))
    }

    fn of(words: &[String; 7]) -> Self {
        let numbers = words
            .each_ref()
            .map(|word| word.parse().unwrap_or(f64::NAN));
        let [
            command,
            disp,
            force,
            within,
            disp_of_force,
            force_within,
            way_lost,
        ] = numbers;
        let place = Place {
            disp,
            force,
            within,
            disp_of_force,
            force_within,
            way_lost,
        };
        Self { command, place }
    }
}

/// Content of `resumed.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Origin {
    /// Folder of the interrupted test when the test was resumed.
    pub parent: PathBuf,
    /// Rows of it that count.
    pub rows: u64,
    /// SHA-256 of their bytes.
    pub rows_sha256: String,
    /// Last step that was made.
    pub step: u64,
    /// Test time of it, s.
    pub time: f64,
    /// End of each axis of each specimen: see [`Kept::words`].
    #[serde(default)]
    pub places: Vec<Vec<[String; 7]>>,
    /// Largest magnitudes of the test so far, including those after the rows that count.
    #[serde(default)]
    pub peak: Peak,
    /// Why the user has accepted that a specimen changed since the interruption; absent if nothing was accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accepted_changed: Option<String>,
    /// Why the user has widened limits; absent if all are those of the interrupted test.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wider_limits: Option<String>,
}

impl Origin {
    /// That of a run; none if it began at its beginning.
    pub(crate) fn of(folder: &Path) -> Result<Option<Self>, ReplayError> {
        let path = folder.join(ORIGIN);
        if !path.exists() {
            return Ok(None);
        }
        let text = read(&path)?;
        match serde_json::from_slice(&text) {
            Ok(origin) => Ok(Some(origin)),
            Err(source) => Err(ReplayError::Origin { path, source }),
        }
    }

    /// The interrupted run in the folder of the resumed one, unchanged.
    pub(crate) fn before(&self, folder: &Path) -> Result<Run, ReplayError> {
        let path = folder.join(BEFORE);
        if !path.is_dir() {
            return Err(ReplayError::NoBefore {
                path,
                parent: self.parent.clone(),
            });
        }
        let run = Run::open(&path)?;
        check_files(&run)?;
        let found = rows_sha256(&run, self.rows)?;
        if found == self.rows_sha256 {
            return Ok(run);
        }
        Err(ReplayError::Input {
            path: path.join("samples.bin"),
            wanted: self.rows_sha256.clone(),
            found,
        })
    }

    /// The folder of the interrupted test, wherever it is now: the one with its rows.
    pub(crate) fn interrupted(&self, folder: &Path) -> PathBuf {
        let is_it = |place: &PathBuf| {
            let rows = Run::open(place)
                .ok()
                .map(|run| rows_sha256(&run, self.rows));
            rows.is_some_and(|found| found.is_ok_and(|found| found == self.rows_sha256))
        };
        let found = places(folder, &self.parent).find(is_it);
        found.unwrap_or_else(|| self.parent.clone())
    }

    /// End position of one axis.
    pub(crate) fn axis(&self, port: usize, axis: usize) -> Option<Kept> {
        self.places.get(port)?.get(axis).map(Kept::of)
    }

    /// Specimens behind links are at their end positions, wherever the interrupted test was when it was retraced.
    pub(crate) fn put(&self, ports: &mut [Port]) {
        for (port, axes) in ports.iter_mut().zip(&self.places) {
            if port.exchange().is_remote() {
                let commands = axes.iter().map(|axis| Kept::of(axis).command);
                port.stands_at(AtAxis(&commands.collect::<Vec<f64>>()));
            }
        }
    }

    /// Their end positions.
    pub(crate) fn left(&self) -> Vec<Vec<Place>> {
        let each = self.places.iter();
        each.map(|axes| axes.iter().map(|axis| Kept::of(axis).place).collect())
            .collect()
    }
}
