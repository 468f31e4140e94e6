//! Which run continued which: `resumed.json` in the folder of a resumed test names the test before it, the rows of that which
//! count, and their digest.
//!
//! [`Lineage`] walks from a run to the first of its ancestors. Only it reads a chain of `resumed.json`: a folder that names
//! itself, or one whose ancestors name it again, is refused there.

use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::checksum::{read, rows_sha256, same};
use super::replay_error::ReplayError;
use gusset_control::engine::Place;
use gusset_control::port::Port;
use gusset_quantity::frame::AtAxis;
use gusset_record::Run;
use gusset_record::summary::Peak;

/// Name of the file in the folder of a resumed test.
pub(super) const ORIGIN: &str = "resumed.json";

/// How the user resumes a test although a specimen has changed.
pub(super) const ACCEPT: &str = "`--accept-changed \"reason\"` resumes the test all the same";

/// Where another folder may be now: where it was from `folder`, beside that one, or where it was then.
pub(super) fn places(
    folder: &Path,
    near: &Path,
    absolute: &Path,
) -> impl Iterator<Item = PathBuf> + use<> {
    let beside = absolute
        .file_name()
        .map(|name| folder.join("..").join(name));
    let places = [Some(folder.join(near)), beside, Some(absolute.to_owned())];
    places.into_iter().flatten()
}

/// The relative path from one existing folder to another; `None` if they have only the root in common.
pub(super) fn way_from(folder: &Path, to: &Path) -> Option<PathBuf> {
    way_between(&folder.canonicalize().ok()?, &to.canonicalize().ok()?)
}

/// The relative path from one folder to another, both absolute; `None` if they have only the root in common.
fn way_between(from: &Path, to: &Path) -> Option<PathBuf> {
    let pairs = from.components().zip(to.components());
    let common = pairs.take_while(|(one, other)| one == other).count();
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    (common > 1).then(|| up.chain(to.components().skip(common)).collect())
}

/// Position of one axis at the end of a test, and its tolerance, in its own units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kept {
    /// The last command.
    pub command: f64,
    /// Readings of its sensors there.
    pub place: Place,
}

/// Where a resumed test comes from: `resumed.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Origin {
    /// Folder of the interrupted test, from the folder of this one, or absolute.
    pub parent: PathBuf,
    /// Absolute path of that folder when the test was resumed.
    pub parent_absolute: PathBuf,
    /// Rows of it that count.
    pub rows: u64,
    /// SHA-256 of their bytes.
    pub rows_sha256: String,
    /// SHA-256 of its `resolved.toml`.
    pub resolved_sha256: String,
    /// Last step that was made.
    pub step: u64,
    /// Test time of it, s.
    pub time: f64,
    /// End of each axis of each specimen, in its own unit: the last command, the reading there, the force, and the
    /// tolerance. As text, since JSON's numbers need not return to the last bit.
    pub left: Vec<Vec<[String; 4]>>,
    /// Per axis: the displacement reading in the row of the last force, and how far the force may differ. Recordings of earlier
    /// versions lack it: their forces refused nothing.
    #[serde(default)]
    pub left_forces: Vec<Vec<[String; 2]>>,
    /// Per axis: the distance of the commands that the record may have lost. Recordings of earlier versions lack it.
    #[serde(default)]
    pub left_ways: Vec<Vec<String>>,
    /// Largest magnitudes of the test so far, including those after the rows that count. Older files omit them.
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

    /// Its text for the folder of the resumed test: the parent is found from there as long as both are moved together.
    pub(crate) fn text_for(text: &str, folder: &Path) -> Option<String> {
        let mut origin: Self = serde_json::from_str(text).ok()?;
        origin.parent = way_from(folder, &origin.parent_absolute)?;
        serde_json::to_string_pretty(&origin).ok()
    }

    /// The parent's run, wherever both are now. A folder is the parent if its digests match.
    fn parent_from(&self, folder: &Path) -> Result<Run, ReplayError> {
        let mut wrong = None;
        for place in places(folder, &self.parent, &self.parent_absolute) {
            if place.exists() {
                match self.proven(&place) {
                    Ok(run) => return Ok(run),
                    Err(error) => wrong.get_or_insert(error),
                };
            }
        }
        Err(wrong.unwrap_or_else(|| ReplayError::NoParent {
            path: folder.join(ORIGIN),
            parent: self.parent_absolute.clone(),
        }))
    }

    /// The run in a folder, if it is the parent.
    fn proven(&self, parent: &Path) -> Result<Run, ReplayError> {
        let run = Run::open(parent)?;
        same(&parent.join("resolved.toml"), &self.resolved_sha256)?;
        let found = rows_sha256(&run, self.rows)?;
        if found != self.rows_sha256 {
            return Err(ReplayError::Input {
                path: parent.join("samples.bin"),
                wanted: self.rows_sha256.clone(),
                found,
            });
        }
        Ok(run)
    }

    /// End position of one axis.
    pub(crate) fn axis(&self, port: usize, axis: usize) -> Option<Kept> {
        let values = self.left.get(port)?.get(axis)?;
        Some(kept(
            values,
            self.force_of(port, axis),
            self.way_of(port, axis),
        ))
    }

    fn way_of(&self, port: usize, axis: usize) -> Option<&String> {
        self.left_ways.get(port)?.get(axis)
    }

    fn force_of(&self, port: usize, axis: usize) -> Option<&[String; 2]> {
        self.left_forces.get(port)?.get(axis)
    }

    /// Keeps the end positions of the axes of each specimen.
    pub(crate) fn keep(&mut self, left: &[Vec<Kept>]) {
        let words = |axis: &Kept| {
            let Place {
                disp,
                force,
                within,
                ..
            } = axis.place;
            let values = [axis.command, disp, force, within];
            values.map(|value| format!("{value:?}"))
        };
        let forces = |Kept { place, .. }: &Kept| {
            [place.disp_of_force, place.force_within].map(|value| format!("{value:?}"))
        };
        let each = left.iter();
        self.left = each
            .clone()
            .map(|axes| axes.iter().map(words).collect())
            .collect();
        let ways = |axis: &Kept| format!("{:?}", axis.place.way_lost);
        self.left_ways = each
            .clone()
            .map(|axes| axes.iter().map(ways).collect())
            .collect();
        self.left_forces = each.map(|axes| axes.iter().map(forces).collect()).collect();
    }

    /// True if the user has accepted that a specimen changed since the interruption.
    pub(crate) fn accepts_changed(&self) -> bool {
        self.accepted_changed.is_some()
    }

    /// Specimens behind links are at their end positions, wherever the interrupted test was when it was retraced.
    pub(crate) fn put(&self, ports: &mut [Port]) {
        for (port, axes) in ports.iter_mut().zip(&self.left) {
            if port.exchange().is_remote() {
                let commands: Vec<f64> = axes.iter().map(|axis| number(&axis[0])).collect();
                port.stands_at(AtAxis(&commands));
            }
        }
    }

    /// Their end positions.
    pub(crate) fn places(&self) -> Vec<Vec<Place>> {
        let specimen = |(port, axes): (usize, &Vec<[String; 4]>)| {
            let each = axes.iter().enumerate();
            each.map(|(axis, values)| {
                kept(values, self.force_of(port, axis), self.way_of(port, axis)).place
            })
            .collect()
        };
        self.left.iter().enumerate().map(specimen).collect()
    }
}

fn kept(values: &[String; 4], force: Option<&[String; 2]>, way: Option<&String>) -> Kept {
    let [command, disp, left, within] = values.each_ref().map(|value| number(value));
    let [disp_of_force, force_within] = match force {
        Some(force) => force.each_ref().map(|value| number(value)),
        None => [disp, f64::INFINITY],
    };
    Kept {
        command,
        place: Place {
            disp,
            force: left,
            within,
            disp_of_force,
            force_within,
            way_lost: way.map_or(f64::INFINITY, |way| number(way)),
        },
    }
}

/// The number in a text; NaN if it has none.
fn number(text: &str) -> f64 {
    text.parse().unwrap_or(f64::NAN)
}

/// One generation of a lineage: the `resumed.json` of a folder, and the run that it names.
#[derive(Debug)]
pub(super) struct Generation {
    /// The folder of the resumed test.
    pub folder: PathBuf,
    /// Content of its `resumed.json`.
    pub origin: Origin,
    /// The test that it continued, if that is found and proven.
    pub parent: Result<Run, ReplayError>,
}

/// The generations of a run, beginning with that of its `resumed.json`. It ends with the first test, with a parent that is not found,
/// or with a folder that was there before.
#[derive(Debug)]
pub(super) struct Lineage {
    next: Option<PathBuf>,
    seen: Vec<PathBuf>,
}

impl Lineage {
    /// From the run in `folder`.
    pub(crate) fn of(folder: &Path) -> Self {
        Self {
            next: Some(folder.to_owned()),
            seen: vec![itself(folder)],
        }
    }

    /// The parent, unless it was there before.
    fn parent(&mut self, folder: &Path, origin: &Origin) -> Result<Run, ReplayError> {
        let run = origin.parent_from(folder)?;
        let itself = itself(run.path());
        if self.seen.contains(&itself) {
            return Err(ReplayError::Circle {
                path: folder.join(ORIGIN),
                parent: run.path().to_owned(),
            });
        }
        self.seen.push(itself);
        Ok(run)
    }
}

/// The canonical path of a folder.
pub(super) fn itself(folder: &Path) -> PathBuf {
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
}

impl Iterator for Lineage {
    type Item = Result<Generation, ReplayError>;

    fn next(&mut self) -> Option<Self::Item> {
        let folder = self.next.take()?;
        let origin = match Origin::of(&folder) {
            Ok(origin) => origin?,
            Err(error) => return Some(Err(error)),
        };
        let parent = self.parent(&folder, &origin);
        self.next = parent.as_ref().ok().map(|run| run.path().to_owned());
        Some(Ok(Generation {
            folder,
            origin,
            parent,
        }))
    }
}

/// A test that was continued.
pub(super) struct Ancestor {
    /// Its run.
    pub run: Run,
    /// Rows of it that count.
    pub rows: u64,
    /// Where it comes from itself, if it was resumed.
    pub origin: Option<Origin>,
}

/// The ancestors of the run in `folder`, the first test first; none if it began at its beginning.
///
/// # Errors
/// One of them is missing, is another than was continued, or continues itself.
pub(super) fn ancestors(folder: &Path) -> Result<Vec<Ancestor>, ReplayError> {
    let mut all: Vec<Ancestor> = Vec::new();
    for generation in Lineage::of(folder) {
        let Generation { origin, parent, .. } = generation?;
        let (run, rows) = (parent?, origin.rows);
        if let Some(child) = all.last_mut() {
            child.origin = Some(origin);
        }
        all.push(Ancestor {
            run,
            rows,
            origin: None,
        });
    }
    all.reverse();
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn path_to_the_parent_is_short() {
        let way = |from: &str, to: &str| way_between(Path::new(from), Path::new(to));
        for (from, to, wanted) in [
            ("/data/runs/two", "/data/runs/one", "../one"),
            (
                "/data/may/two",
                "/data/april/deep/one",
                "../../april/deep/one",
            ),
            ("/data/one/two", "/data/one", ".."),
        ] {
            assert_eq!(way(from, to), Some(PathBuf::from(wanted)), "{from} {to}");
        }
        assert_eq!(way("/data/two", "/other/one"), None);
    }
}
