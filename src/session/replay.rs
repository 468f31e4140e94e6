//! A recorded test once more: its measurements pass through the same loop, and every number must be reproduced bit for
//! bit.
//!
//! The folder alone is enough: `resolved.toml` and the copies of its inputs make the experiment; a reader of the recorded
//! rows replaces each specimen. Every decision of the running test is a column, so holds and stale measurements happen again
//! in the same rows. The simulated clock keeps time; columns that depend on the wall clock are not compared.

#[cfg(any(test, feature = "test-doubles"))]
use std::io::Read;
use std::path::Path;
use std::sync::{Arc, Mutex};

use super::agreement::{
    SummaryDifference, is_of_an_earlier_version, may_trip_after_its_rows, with_loop, with_served,
};
use super::checksum::check_files;
use super::playback::{Comparing, Course, Difference, Playback, Recording, with};
use super::recorded::{Replaced, put_recorded};
use super::replay_error::ReplayError;
use super::retrace::{prepared, same_columns};
use super::served_replay;
use super::summary::peak;
use gusset_control::engine::{Connected, Control, Ending, Experiment, Outcome};
use gusset_record::{End, Layout, MissingEnd, Run};

/// Result of a replay.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// Rows that are the same.
    pub rows: u64,
    /// Columns that were compared.
    pub columns: usize,
    /// Test time of the last of them, s.
    pub time: f64,
    /// The first that is not.
    pub difference: Option<Difference>,
    /// Cause that ends the proof before the end of the test; `None` if all of it is proven.
    pub short: Option<String>,
    /// The recording lists its files, and they are unchanged.
    pub files_proven: bool,
    /// Keys of the summary that differ from the result of the loop; empty for a run without a summary, or one that is not proven
    /// to its end.
    pub summary: Vec<SummaryDifference>,
    /// The summary is of an earlier version: its differences prove nothing.
    pub is_of_an_earlier_version: bool,
}

impl Replay {
    /// The findings of a playback.
    fn of(playback: &mut Playback, layout: &Layout) -> Self {
        Self {
            rows: playback.row,
            columns: layout.columns().iter().filter(|c| !c.timing).count(),
            time: playback.time,
            difference: playback.difference.take(),
            short: None,
            files_proven: false,
            summary: Vec::new(),
            is_of_an_earlier_version: false,
        }
    }

    /// True if every recorded number was reproduced, and the summary agrees with the loop.
    #[must_use]
    pub const fn is_exact(&self) -> bool {
        let summary_agrees = self.summary.is_empty() || self.is_of_an_earlier_version;
        self.difference.is_none() && self.short.is_none() && summary_agrees
    }
}

/// Runs the recording in `folder` through the loop again.
///
/// # Errors
/// See [`ReplayError`]. A number that differs is no error but [`Replay::difference`].
pub fn replay(folder: &Path) -> Result<Replay, ReplayError> {
    let run = Run::open(folder)?;
    if run.layout().is_served() {
        return replay_served(&run);
    }
    let test = prepared(&run, Replaced::All)?;
    let files_proven = check_files(&run)?;
    let recording = Recording::of(&run)?;
    let (steps, has_specimens) = (test.experiment.steps, !test.experiment.ports.is_empty());
    let (mut found, mut outcome, mut ran_out) =
        follow(test.experiment, run.layout(), recording, false)?;
    if found.is_exact() {
        found.short = missing_end(&run, &found);
    }
    if let Some(summary) = run.summary().filter(|_| found.is_exact()) {
        if ran_out && has_specimens && may_trip_after_its_rows(&run)? {
            // The command beyond the limit never left, and its tick has no row.
            let test = prepared(&run, Replaced::All)?.experiment;
            let next = follow(test, run.layout(), Recording::of(&run)?, true)?;
            if next.0.is_exact() && !next.2 {
                (outcome, ran_out) = (next.1, false);
            }
        }
        let outcome = (&outcome, &peak(&outcome, &test.facts));
        let required = test.facts.record_required;
        found.summary = with_loop(&run, summary, outcome, ran_out, (required, steps))?;
        found.is_of_an_earlier_version = is_of_an_earlier_version(run.events()?.events.iter());
    }
    found.files_proven = files_proven;
    Ok(found)
}

/// Runs the targets of a controller through its server's specimen again.
fn replay_served(run: &Run) -> Result<Replay, ReplayError> {
    let files_proven = check_files(run)?;
    let served_replay::Followed {
        playback,
        served,
        newest,
    } = served_replay::follow(run, Recording::of(run)?)?;
    let mut found = with(&playback, |playback| {
        let end = playback.end().filter(|end| *end != End::Clean);
        let short = playback.short.take();
        Replay {
            short: short.or_else(|| end.map(|end| end.to_string())),
            files_proven,
            ..Replay::of(playback, run.layout())
        }
    });
    if found.is_exact() {
        let missing = newest.filter(|exchange| *exchange >= found.rows);
        found.short = missing.map(|exchange| {
            format!("the rows end before exchange {exchange}, which the events name")
        });
    }
    if let Some(summary) = run.summary().filter(|_| found.is_exact()) {
        found.summary = with_served(summary, &served);
    }
    Ok(found)
}

/// The record may be longer than its proven part: too few rows may be whole.
fn missing_end(run: &Run, found: &Replay) -> Option<String> {
    if found.rows == 0 {
        return Some("there are no rows to be compared".to_owned());
    }
    let end = MissingEnd::of(run, Some(found.time))?;
    Some(end.to_string())
}

/// Runs recorded rows through a new loop: `experiment` is the test, `samples` are its records in `layout`.
///
/// # Errors
/// [`ReplayError::Columns`]. A number that differs is no error but [`Replay::difference`].
#[cfg(any(test, feature = "test-doubles"))]
pub fn replay_rows(
    experiment: Experiment,
    layout: &Layout,
    samples: Box<dyn Read + Send>,
) -> Result<Replay, ReplayError> {
    follow(
        experiment,
        layout,
        Recording::without_checkpoints(samples, layout),
        false,
    )
    .map(|(found, ..)| found)
}

fn follow(
    mut experiment: Experiment,
    layout: &Layout,
    recording: Recording,
    goes_on: bool,
) -> Result<(Replay, Outcome, bool), ReplayError> {
    same_columns(layout.columns(), &experiment.columns())?;
    let (operator, requests) = crossbeam_channel::bounded(4);
    let course = Course::from(&experiment);
    let mut playback = Playback::new(recording, layout, &course, operator, 0..u64::MAX, false);
    playback.goes_on = goes_on;
    let playback = Arc::new(Mutex::new(playback));
    put_recorded(&mut experiment, &playback, layout, Replaced::All)?;
    let recorder = Box::new(Comparing(Arc::clone(&playback)));
    let test = Connected::for_a_replay(experiment, recorder);
    let outcome = test.run(&Control::from(requests)).into_outcome();
    let (found, ran_out) = with(&playback, |playback| {
        let left = !playback.is_over() && playback.difference.is_none();
        let short = match (playback.end(), &outcome.ending) {
            _ if playback.short.is_some() => playback.short.take(),
            _ if left => Some(match outcome.ending {
                Ending::Stopped(stop) => format!("the replay stops where the test did not: {stop}"),
                Ending::Completed => "the test continued after the end of the replay".to_owned(),
            }),
            (Some(End::Clean) | None, _) => None,
            (Some(end), _) => Some(end.to_string()),
        };
        let found = Replay {
            short,
            ..Replay::of(playback, layout)
        };
        (found, playback.ran_out)
    });
    Ok((found, outcome, ran_out))
}
