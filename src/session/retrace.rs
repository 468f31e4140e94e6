//! From a run folder back to the experiment, and to the state that its test had after any of its rows.
//!
//! A resumed test has its parent's rows before its own ([`super::lineage`]). So the state is made of
//! all its ancestors. Rows and events are read one after the other: no record is held whole.

use std::fs::File;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex};

use sha2::{Digest, Sha256};

use super::borne::borne;
use super::connect::put_standing;
use super::earlier_rows::may_be_absent;
use super::lineage::{Ancestor, Origin, ancestors};
use super::recorded::{Replaced, put_recorded};
use super::replay::ReplayError;
use super::tape::{Comparing, Recording, Tape, Verified, with};
use crate::config::{self, ConfigError, Loaded};
use crate::control::Port;
use crate::engine::{Control, Ending, Engine, Experiment, Resumption, Side};
use crate::record::{Column, Event, FolderError, Run, keeps_waiting};
use crate::setup::{self, Prepared};

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

/// Makes the experiment of a test file.
pub(super) type Build<'a> = dyn FnMut(&Loaded) -> Result<Prepared, ConfigError> + 'a;

pub(super) fn read(path: &Path) -> Result<Vec<u8>, ReplayError> {
    let bytes = if keeps_waiting(path) {
        Err(std::io::Error::other("it is not a file"))
    } else {
        std::fs::read(path)
    };
    bytes.map_err(|source| unreadable(path, source))
}

pub(super) fn sha256(bytes: &[u8]) -> String {
    in_hex(&Sha256::digest(bytes))
}

fn in_hex(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
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
            0 => return Ok(in_hex(&digest.finalize())),
            count => digest.update(piece.get(..count).unwrap_or_default()),
        }
    }
}

/// The test of a run folder, as it was built, with the state of its ancestors if it has any. Nobody is connected.
pub(super) fn prepared(run: &Run, replaced: Replaced, keys: bool) -> Result<Prepared, ReplayError> {
    prepared_by(run, replaced, keys, &mut setup::build)
}

/// The same, built by `build`.
pub(super) fn prepared_by(
    run: &Run,
    replaced: Replaced,
    keys: bool,
    build: &mut Build<'_>,
) -> Result<Prepared, ReplayError> {
    let origin = Origin::of(run.path())?;
    let state = state_of(ancestors(run.path())?, replaced)?;
    prepared_from(run, origin.zip(state), keys, build)
}

/// Builds the test of a run folder, with the state that its ancestors came to, if it has any.
fn prepared_from(
    run: &Run,
    before: Option<(Origin, State)>,
    keys: bool,
    build: &mut Build<'_>,
) -> Result<Prepared, ReplayError> {
    let folder = run.path();
    if run.layout().is_served() {
        return Err(ReplayError::Served(folder.to_owned()));
    }
    check_inputs(run)?;
    let mut loaded = config::load(&folder.join("resolved.toml"), &[])?;
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
    if let Some((origin, state)) = before {
        go_on_from(&mut test.experiment, &origin, state);
    }
    put_standing(run, &mut test.experiment.ports)?;
    Ok(test)
}

/// What a test is made of that goes on: the numerical side, the ports, and the rest.
type State = (Side, Vec<Port>, Resumption);

/// Makes an experiment continue as its `resumed.json` says, with the state that its ancestors came to.
fn go_on_from(experiment: &mut Experiment, origin: &Origin, state: State) {
    let (side, ports, mut resumption) = state;
    resumption.left = origin.places();
    resumption.borne = borne(&origin.peak, &ports);
    resumption.accepts_changed = origin.accepts_changed();
    take_over(experiment, side, ports);
    origin.put(&mut experiment.ports);
    experiment.resume = Some(resumption);
}

/// The state that the ancestors of a test came to, the first of them first; none for a test without any. An ancestor that ended
/// before its first step has changed nothing: the state is that of those before it.
fn state_of(
    mut ancestors: Vec<Ancestor>,
    replaced: Replaced,
) -> Result<Option<State>, ReplayError> {
    let mut state = None;
    let mut next = 0;
    while let Some(Ancestor { run, rows, origin }) = ancestors.get(next) {
        let before = origin.clone().zip(state.take());
        let test = prepared_from(run, before, false, &mut setup::build)?.experiment;
        let traced = follow(run, test, Some(*rows), replaced)?;
        match traced.state {
            Some(reached) => {
                state = Some(reached);
                next += 1;
            }
            None if origin.is_some() && !traced.completed => {
                ancestors.remove(next);
                next = 0;
            }
            None => return Err(ReplayError::Parent(run.path().to_owned())),
        }
    }
    Ok(state)
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
    let experiment = prepared(run, replaced, false)?.experiment;
    let mut traced = follow(run, experiment, until, replaced)?;
    if traced.state.is_none() && !traced.completed {
        traced.state = state_of(ancestors(run.path())?, replaced)?;
        traced.on_its_way_in = traced.state.is_some();
    }
    Ok(traced)
}

/// Follows the rows of a run with an experiment that is prepared for it.
fn follow(
    run: &Run,
    mut experiment: Experiment,
    until: Option<u64>,
    replaced: Replaced,
) -> Result<Retraced, ReplayError> {
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
    let state = if completed { None } else { engine.stand_by() };
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
            on_its_way_in: false,
            rows: tape.row,
            verified: tape.verified,
            trouble,
            completed,
        }
    }))
}

/// The files of the test and their SHA-256, as its events say; none if they do not.
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

/// The recording has the columns that the loop makes, in any order, but for those that earlier versions did not record.
pub(super) fn same_columns(found: &[Column], wanted: &[Column]) -> Result<(), ReplayError> {
    let lacks = |columns: &[Column], name: &str| columns.iter().all(|column| column.name != name);
    let missing = wanted
        .iter()
        .find(|column| lacks(found, &column.name) && !may_be_absent(column));
    let unknown = found.iter().find(|column| lacks(wanted, &column.name));
    if missing.is_none() && unknown.is_none() {
        return Ok(());
    }
    let name = |column: Option<&Column>| column.map(|column| column.name.clone());
    Err(ReplayError::Columns {
        found: name(unknown),
        wanted: name(missing),
    })
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
    fn an_older_recording_may_lack_only_columns_that_later_versions_added() {
        let now = columns(&["step", "operator", "x1", "release_s", "record_before_s"]);
        let same = |names: &[&str]| same_columns(&columns(names), &now).is_ok();
        assert!(same(&[
            "step",
            "operator",
            "x1",
            "release_s",
            "record_before_s"
        ]));
        assert!(same(&["step", "x1", "release_s"]));
        assert!(same(&["x1", "step"]));
        assert!(!same(&["step"]));
        assert!(!same(&["step", "x1", "x2"]));
    }
}
