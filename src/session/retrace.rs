//! From a run folder back to the experiment, and to the state that its test had after any of its rows.
//!
//! The state of a resumed test begins with that of the interrupted one, which its folder holds ([`super::origin`]). Rows and events are
//! read one after the other: no record is held whole.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex};

use super::checksum::check_inputs;
use super::connect::put_standing;
use super::earlier_rows::may_be_absent;
use super::origin::Origin;
use super::playback::{Comparing, Playback, Recording, Verified, with};
use super::recorded::{Replaced, put_recorded};
use super::replay_error::ReplayError;
use super::row_peaks::earlier_peaks;
use gusset_config::{self as config, ConfigError, Loaded};
use gusset_control::engine::{
    Connected, Control, Ending, Experiment, Resumption, Retraced as Followed, Side,
};
use gusset_control::port::Port;
use gusset_record::{Column, Run};
use gusset_setup::{self as setup, Prepared};

/// Makes the experiment of a test file.
pub(super) type Build<'a> = dyn FnMut(&Loaded) -> Result<Prepared, ConfigError> + 'a;

/// Rebuilds the test of a run folder, with the state of the test that it resumed, if any. No specimen is connected.
pub(super) fn prepared(run: &Run, replaced: Replaced) -> Result<Prepared, ReplayError> {
    let before = state_before(run, replaced)?;
    prepared_from(run, &[], before, false, &mut setup::build)
}

/// The test of a run folder with changed keys, for a resume; its state follows.
pub(super) fn prepared_to_resume(
    run: &Run,
    sets: &[String],
    build: &mut Build<'_>,
) -> Result<Prepared, ReplayError> {
    prepared_from(run, sets, None, true, build)
}

/// The test file of a run folder, with changed keys.
pub(super) fn recorded_file(folder: &Path, sets: &[String]) -> Result<Loaded, ConfigError> {
    let mut loaded = config::load(&folder.join("resolved.toml"), sets)?;
    // Recordings without this key have all damping at rest in C0.
    let share = &mut loaded.file.integrator.rest_damping_share;
    share.get_or_insert(1.0);
    for specimen in &mut loaded.file.specimen {
        // The drill is over: a resumed test is without it.
        specimen.drill = None;
    }
    Ok(loaded)
}

/// Builds the test of a run folder, with the state of the test that it resumed, if any.
fn prepared_from(
    run: &Run,
    sets: &[String],
    before: Option<(Origin, State)>,
    keys: bool,
    build: &mut Build<'_>,
) -> Result<Prepared, ReplayError> {
    let folder = run.path();
    if run.layout().is_served() {
        return Err(ReplayError::Served(folder.to_owned()));
    }
    check_inputs(run)?;
    let mut loaded = recorded_file(folder, sets)?;
    if !keys {
        // No specimen is connected: the needs of a link are not checked.
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

/// State of a test that is resumed: the numerical side, the ports, and the rest.
type State = (Side, Vec<Port>, Resumption);

/// Makes an experiment continue from its `resumed.json`, with the state of the interrupted test.
pub(super) fn go_on_from(experiment: &mut Experiment, origin: &Origin, state: State) {
    let (side, ports, mut resumption) = state;
    resumption.left = origin.left();
    resumption.earlier = earlier_peaks(&origin.peak, &ports);
    resumption.accepts_changed = origin.accepted_changed.is_some();
    take_over(experiment, side, ports);
    origin.put(&mut experiment.ports);
    experiment.resume = Some(resumption);
}

/// Where a test comes from, and the state of the interrupted test after its last row that counts; none for a test that began at its
/// beginning.
fn state_before(run: &Run, replaced: Replaced) -> Result<Option<(Origin, State)>, ReplayError> {
    let Some(origin) = Origin::of(run.path())? else {
        return Ok(None);
    };
    let (before, rows) = (origin.before(run.path())?, Some(origin.rows));
    let traced = match retrace_from_state(&before, rows, replaced)? {
        Some(traced) => traced,
        None => {
            let test = prepared(&before, replaced)?.experiment;
            follow(&before, test, rows, replaced)?
        }
    };
    let state = traced.state;
    let state = state.ok_or_else(|| ReplayError::Parent(before.path().to_owned()))?;
    Ok(Some((origin, state)))
}

/// The retraced side and ports in place of new ones; links stay those of the new ones.
fn take_over(experiment: &mut Experiment, side: Side, ports: Vec<Port>) {
    experiment.side = side;
    let fresh = std::mem::replace(&mut experiment.ports, ports);
    for (port, fresh) in experiment.ports.iter_mut().zip(fresh) {
        port.go_live(fresh);
    }
}

/// Result of retracing a run.
pub(super) struct Retraced {
    /// The state after its last good row; `None` if it ended before its first step, or at its last. For a resumed test that
    /// ended during startup, it is the state with which it resumed.
    pub state: Option<State>,
    /// It is a resumed test, and did.
    pub on_its_way_in: bool,
    /// Rows that were reproduced.
    pub rows: u64,
    /// The last checkpoint that did.
    pub verified: Option<Verified>,
    /// Cause that ended it before its time.
    pub trouble: Option<String>,
    /// True if it reached the last step of the test.
    pub completed: bool,
    /// Step and rows of the state that was restored; none if all rows were retraced.
    pub restored: Option<(u64, u64)>,
}

/// True if a specimen of the test is behind a link.
fn has_link(run: &Run) -> Result<bool, ReplayError> {
    if run.layout().is_served() {
        return Ok(false);
    }
    let loaded = config::load(&run.path().join("resolved.toml"), &[])?;
    let mut specimens = loaded.file.specimen.iter();
    Ok(specimens.any(|specimen| specimen.link.is_some()))
}

/// Follows a run to its end, or through its first `until` rows. A specimen behind a link remembers everything that happened to it, so all
/// rows of its test are followed. Otherwise the newest kept state replaces the rows before it.
pub(super) fn retrace(
    run: &Run,
    until: Option<u64>,
    replaced: Replaced,
) -> Result<Retraced, ReplayError> {
    if !has_link(run)?
        && let Some(traced) = retrace_from_state(run, until, replaced)?
    {
        return Ok(traced);
    }
    let experiment = prepared(run, replaced)?.experiment;
    let mut traced = follow(run, experiment, until, replaced)?;
    if traced.state.is_none() && !traced.completed {
        traced.state = state_before(run, replaced)?.map(|(_, state)| state);
        traced.on_its_way_in = traced.state.is_some();
    }
    Ok(traced)
}

/// Follows a run from the newest state that it kept. `None` without a state before its last row, or if anything is wrong with
/// the rows after it: then all rows must be followed.
fn retrace_from_state(
    run: &Run,
    until: Option<u64>,
    replaced: Replaced,
) -> Result<Option<Retraced>, ReplayError> {
    let (kept, _faults) = run.usable_state(until.unwrap_or(u64::MAX))?;
    let Some(kept) = kept else {
        return Ok(None);
    };
    // The state contains everything from the interrupted test.
    let experiment = prepared_from(run, &[], None, false, &mut setup::build)?.experiment;
    let rows = kept.rows..until.unwrap_or(u64::MAX);
    let (test, playback, control) = recorded_test(run, experiment, rows, replaced)?;
    let Ok(followed) = test.retrace_from(&kept.state, &control) else {
        return Ok(None);
    };
    let traced = Retraced {
        restored: Some((kept.step, kept.rows)),
        ..judged(followed, &playback, until)
    };
    let is_whole = traced.trouble.is_none() && (traced.completed || traced.state.is_some());
    Ok(Some(traced).filter(|_| is_whole))
}

/// Follows the rows of a run with an experiment that is prepared for it.
fn follow(
    run: &Run,
    experiment: Experiment,
    until: Option<u64>,
    replaced: Replaced,
) -> Result<Retraced, ReplayError> {
    let rows = 0..until.unwrap_or(u64::MAX);
    let (test, playback, control) = recorded_test(run, experiment, rows, replaced)?;
    Ok(judged(test.retrace(&control), &playback, until))
}

/// A test whose specimens are replaced by these rows of a run.
fn recorded_test(
    run: &Run,
    mut experiment: Experiment,
    rows: Range<u64>,
    replaced: Replaced,
) -> Result<(Connected, Arc<Mutex<Playback>>, Control), ReplayError> {
    same_columns(run.layout().columns(), &experiment.columns())?;
    let (operator, requests) = crossbeam_channel::bounded(4);
    let recording = Recording::of(run)?;
    let playback = Playback::new(
        recording,
        run.layout(),
        &(&experiment).into(),
        operator,
        rows,
        true,
    );
    let playback = Arc::new(Mutex::new(playback));
    put_recorded(&mut experiment, &playback, run.layout(), replaced)?;
    let recorder = Box::new(Comparing(Arc::clone(&playback)));
    let test = Connected::for_a_replay(experiment, recorder);
    Ok((test, playback, Control::from(requests)))
}

/// Compares a retraced test with its record.
fn judged(followed: Followed, playback: &Arc<Mutex<Playback>>, until: Option<u64>) -> Retraced {
    let Followed { ending, state } = followed;
    let completed = ending == Ending::Completed;
    let state = state.filter(|_| !completed);
    with(playback, |playback| {
        let damage = playback.end().filter(|end| {
            use gusset_record::End::{Clean, Torn};
            // A kill ends the file in the middle of a row.
            !matches!(end, Clean | Torn { .. })
        });
        let trouble = match (&playback.difference, &ending) {
            (Some(difference), _) => Some(format!(
                "`{}` of row {} (step {}) does not come out again",
                difference.column, difference.row, difference.step
            )),
            _ if playback.short.is_some() => playback.short.take(),
            _ if damage.is_some() && until.is_none() => damage.map(|end| end.to_string()),
            (None, Ending::Stopped(stop)) if !playback.is_over() => {
                Some(format!("the loop stops where the test did not: {stop}"))
            }
            _ => None,
        };
        Retraced {
            state,
            on_its_way_in: false,
            rows: playback.row,
            verified: playback.verified,
            trouble,
            completed,
            restored: None,
        }
    })
}

/// State files of a run that are of no use, and why.
pub(super) fn unusable_states(run: &Run) -> Result<Vec<String>, ReplayError> {
    let (_, faults) = run.usable_state(u64::MAX)?;
    let text = |(name, fault)| format!("{name}: {fault}; it is not used");
    Ok(faults.into_iter().map(text).collect())
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
    fn older_recording_may_lack_newer_columns() {
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
