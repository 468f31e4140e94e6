//! From a run folder back to the experiment, and to the state that its test had after any of its rows.
//!
//! A test that went on after an interruption has its parent's rows before its own: `resumed.json` names the parent, the rows
//! that count, and their digest. So the state is made of the whole line of ancestors.

use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::borne::borne;
use super::connect::put_standing;
use super::recorded::{Replaced, put_recorded};
use super::replay::ReplayError;
use super::tape::{Comparing, Recording, Tape, Verified, with};
use crate::config::{self, ConfigError, Loaded, Prepared};
use crate::control::Port;
use crate::engine::{Control, Ending, Engine, Experiment, Place, Resumption, Side};
use crate::record::summary::Peak;
use crate::record::{Column, FolderError, Run, keeps_waiting};

/// Name of the file in the folder of a resumed test.
pub(super) const ORIGIN: &str = "resumed.json";

/// Where a resumed test comes from: `resumed.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Origin {
    /// Folder of the interrupted test, from the folder of this one, or absolute.
    pub parent: PathBuf,
    /// The same, absolute, when the test was resumed.
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
    /// Where the axes of each specimen were left, each in its own unit: the last command, what the sensor reads there, the
    /// force, and how far off it may stand. In words, since JSON's numbers need not come back to the last bit.
    pub left: Vec<Vec<[String; 4]>>,
    /// Largest magnitudes of the test so far, those after the rows that count, too. Older ones do not say.
    #[serde(default)]
    pub peak: Peak,
}

impl Origin {
    /// That of a run; none if it began at its beginning.
    pub fn of(folder: &Path) -> Result<Option<Self>, ReplayError> {
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

    /// Its text for the folder of the test that goes on: from there the parent is found as long as both are moved together.
    pub fn text_for(text: &str, folder: &Path) -> Option<String> {
        let mut origin: Self = serde_json::from_str(text).ok()?;
        origin.parent = way_from(folder, &origin.parent_absolute)?;
        serde_json::to_string_pretty(&origin).ok()
    }

    /// The parent's run, wherever both are now. What is there is the one if its digests are.
    pub fn parent_from(&self, folder: &Path) -> Result<Run, ReplayError> {
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

    /// Last command, reading and force of one axis, and how far off it may stand, all in its own unit.
    pub fn axis(&self, port: usize, axis: usize) -> Option<[f64; 4]> {
        let values = self.left.get(port)?.get(axis)?;
        Some(values.each_ref().map(|value| number(value)))
    }

    /// Specimens behind links stand where they were left, wherever the interrupted test was when it was retraced.
    pub fn put(&self, ports: &mut [Port]) {
        for (port, axes) in ports.iter_mut().zip(&self.left) {
            if port.is_remote() {
                let commands: Vec<f64> = axes.iter().map(|axis| number(&axis[0])).collect();
                port.stands_at(&commands);
            }
        }
    }

    /// Where they were left.
    pub fn places(&self) -> Vec<Vec<Place>> {
        let place = |[_, disp, force, within]: &[String; 4]| Place {
            disp: number(disp),
            force: number(force),
            within: number(within),
        };
        let specimen = |axes: &Vec<[String; 4]>| axes.iter().map(place).collect();
        self.left.iter().map(specimen).collect()
    }
}

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

/// The way from one folder to another, which are both there; none where they have nothing in common but the root.
pub(super) fn way_from(folder: &Path, to: &Path) -> Option<PathBuf> {
    way_between(&folder.canonicalize().ok()?, &to.canonicalize().ok()?)
}

/// The way from one folder to another, both absolute; none where they have nothing in common but the root.
fn way_between(from: &Path, to: &Path) -> Option<PathBuf> {
    let pairs = from.components().zip(to.components());
    let common = pairs.take_while(|(one, other)| one == other).count();
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    (common > 1).then(|| up.chain(to.components().skip(common)).collect())
}

/// What is no number is nowhere.
fn number(text: &str) -> f64 {
    text.parse().unwrap_or(f64::NAN)
}

/// Makes the experiment of a test file.
pub(super) type Build<'a> = dyn FnMut(&Loaded) -> Result<Prepared, ConfigError> + 'a;

pub(super) fn read(path: &Path) -> Result<Vec<u8>, ReplayError> {
    let bytes = if keeps_waiting(path) {
        Err(std::io::Error::other("it is not a file"))
    } else {
        std::fs::read(path)
    };
    bytes.map_err(|source| ReplayError::Unreadable {
        path: path.to_owned(),
        source,
    })
}

pub(super) fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of the first `rows` rows of a run.
pub(super) fn rows_sha256(run: &Run, rows: u64) -> Result<String, ReplayError> {
    let bytes = read(&run.path().join("samples.bin"))?;
    let end = usize::try_from(rows)
        .unwrap_or(usize::MAX)
        .saturating_mul(run.layout().stride());
    Ok(sha256(bytes.get(..end).unwrap_or(&bytes)))
}

/// The test of a run folder, as it was built, with the state of its ancestors if it has any. Nobody is connected.
pub(super) fn prepared(run: &Run, replaced: Replaced, keys: bool) -> Result<Prepared, ReplayError> {
    prepared_by(run, replaced, keys, &mut config::build)
}

/// The same, built by `build`.
pub(super) fn prepared_by(
    run: &Run,
    replaced: Replaced,
    keys: bool,
    build: &mut Build<'_>,
) -> Result<Prepared, ReplayError> {
    let folder = run.path();
    if run.layout().is_served() {
        return Err(ReplayError::Served(folder.to_owned()));
    }
    check_inputs(run)?;
    let mut loaded = config::load_resolved(&folder.join("resolved.toml"))?;
    for specimen in &mut loaded.file.specimen {
        // It came, and is over: a test that goes on is without it.
        specimen.drill = None;
    }
    if !keys {
        // No specimen is spoken to: what only a link needs is not asked for.
        for link in loaded
            .file
            .specimen
            .iter_mut()
            .filter_map(|s| s.link.as_mut())
        {
            link.key_file = None;
        }
    }
    let mut test = build(&loaded)?;
    if let Some(origin) = Origin::of(folder)? {
        let (side, ports, mut resumption) = state_before(folder, &origin, replaced)?;
        resumption.left = origin.places();
        resumption.borne = borne(&origin.peak, &ports);
        take_over(&mut test.experiment, side, ports);
        origin.put(&mut test.experiment.ports);
        test.experiment.resume = Some(resumption);
    }
    put_standing(&run.events()?.events, &mut test.experiment.ports);
    Ok(test)
}

/// What a test is made of that goes on: the numerical side, the ports, and the rest.
type State = (Side, Vec<Port>, Resumption);

/// The state that a resumed test in `folder` went on with.
fn state_before(folder: &Path, origin: &Origin, replaced: Replaced) -> Result<State, ReplayError> {
    let before = origin.parent_from(folder)?;
    let traced = retrace(&before, Some(origin.rows), replaced)?;
    let parent = || ReplayError::Parent(before.path().to_owned());
    traced.state.ok_or_else(parent)
}

/// The retraced side and ports in place of new ones; links stay those of the new ones.
pub(super) fn take_over(experiment: &mut Experiment, side: Side, ports: Vec<Port>) {
    experiment.side = side;
    let fresh = std::mem::replace(&mut experiment.ports, ports);
    for (port, fresh) in experiment.ports.iter_mut().zip(fresh) {
        port.go_live(fresh);
    }
}

/// What a run came to when it was retraced.
pub(super) struct Retraced {
    /// The state after its last good row; none if it ended before its first step, or at its last. That of a resumed test which
    /// ended on its way in is the state that it went on with.
    pub state: Option<State>,
    /// It is a resumed test, and did.
    pub on_its_way_in: bool,
    /// Rows that came out again.
    pub rows: u64,
    /// The last checkpoint that did.
    pub verified: Option<Verified>,
    /// What ended it before its time.
    pub trouble: Option<String>,
    /// True if it came to the last step of the test.
    pub completed: bool,
}

/// Follows a run to its end, or through so many rows.
pub(super) fn retrace(
    run: &Run,
    until: Option<u64>,
    replaced: Replaced,
) -> Result<Retraced, ReplayError> {
    let mut experiment = prepared(run, replaced, false)?.experiment;
    same_columns(run.layout().columns(), &experiment.columns())?;
    let (operator, requests) = crossbeam_channel::bounded(4);
    let recording = Recording::of(run)?;
    let tape = Tape::new(recording, run.layout(), &experiment, operator, until, true);
    let tape = Arc::new(Mutex::new(tape));
    put_recorded(&mut experiment, &tape, run.layout(), replaced);
    let recorder = Box::new(Comparing(Arc::clone(&tape)));
    let mut engine = Engine::for_a_replay(experiment, recorder);
    let ending = engine.retrace(&Control::from(requests));
    let completed = ending == Ending::Completed;
    let mut state = if completed { None } else { engine.stand_by() };
    let origin = Origin::of(run.path())?.filter(|_| state.is_none() && !completed);
    if let Some(origin) = &origin {
        state = Some(state_before(run.path(), origin, replaced)?);
    }
    Ok(with(&tape, |tape| {
        let damage = tape.end().filter(|end| {
            use crate::record::End::{Clean, Torn};
            // A kill ends the file in the middle of a row.
            !matches!(end, Clean | Torn { .. })
        });
        let trouble = match (&tape.difference, &ending) {
            (Some(difference), _) => Some(format!(
                "`{}` of row {} (step {}) does not come out again",
                difference.column, difference.row, difference.step
            )),
            _ if tape.short.is_some() => tape.short.take(),
            _ if damage.is_some() && until.is_none() => damage.map(|end| end.to_string()),
            (None, Ending::Stopped(stop)) if !tape.is_over() => {
                Some(format!("the loop stops where the test did not: {stop}"))
            }
            _ => None,
        };
        Retraced {
            state,
            on_its_way_in: origin.is_some(),
            rows: tape.row,
            verified: tape.verified,
            trouble,
            completed,
        }
    }))
}

/// The files of the test and their SHA-256, as its events say; none if they do not.
pub(super) fn files_of(run: &Run) -> Result<Option<Vec<(PathBuf, String)>>, FolderError> {
    let events = run.events()?.events;
    let is_files = |event: &&Value| event.get("event").and_then(Value::as_str) == Some("files");
    let hashes = events.iter().find(is_files);
    let hashes = hashes.and_then(|event| event.get("sha256")?.as_object());
    Ok(hashes.map(|hashes| {
        let each = hashes.iter().map(|(name, wanted)| {
            let wanted = wanted.as_str().unwrap_or_default();
            (run.path().join(name), wanted.to_owned())
        });
        each.collect()
    }))
}

/// The files are those of the test, as far as it says which they were. True if it does.
pub(super) fn check_files(run: &Run) -> Result<bool, ReplayError> {
    let files = files_of(run)?;
    for (path, wanted) in files.iter().flatten() {
        same(path, wanted)?;
    }
    Ok(files.is_some())
}

/// What says that a file of the run was changed after the test, if one was; none of those that are not there.
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

/// A file is what it was.
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

pub(super) fn same_columns(found: &[Column], wanted: &[Column]) -> Result<(), ReplayError> {
    // What depends on wall time is not compared, and stands last: an older recording may have less of it.
    let missing = wanted.get(found.len()..).unwrap_or_default();
    let older = !missing.is_empty() && missing.iter().all(|column| column.timing);
    let longest = if older {
        found.len()
    } else {
        found.len().max(wanted.len())
    };
    let name = |columns: &[Column], index: usize| columns.get(index).map(|c| c.name.clone());
    let differs = (0..longest).find(|&index| name(found, index) != name(wanted, index));
    match differs {
        None => Ok(()),
        Some(index) => Err(ReplayError::Columns {
            found: name(found, index),
            wanted: name(wanted, index),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(names: &[&str]) -> Vec<Column> {
        let column = |name: &&str| Column {
            name: (*name).to_owned(),
            unit: "s".to_owned(),
            meaning: String::new(),
            timing: name.ends_with("_s"),
        };
        names.iter().map(column).collect()
    }

    #[test]
    fn the_way_to_the_parent_is_short_and_stays_on_this_side_of_the_root() {
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

    #[test]
    fn an_older_recording_may_lack_the_last_columns_that_depend_on_wall_time_and_no_other() {
        let now = columns(&["step", "x1", "release_s", "record_before_s"]);
        let same = |names: &[&str]| same_columns(&columns(names), &now).is_ok();
        assert!(same(&["step", "x1", "release_s", "record_before_s"]));
        assert!(same(&["step", "x1", "release_s"]));
        assert!(same(&["step", "x1"]));
        assert!(!same(&["step"]));
        assert!(!same(&["step", "x1", "record_before_s"]));
        assert!(!same(&[
            "step",
            "x1",
            "release_s",
            "record_before_s",
            "more_s"
        ]));
    }
}
