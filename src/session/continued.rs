//! `continued.json` in the folder of an interrupted test names the test that resumed it, so that its specimens do not repeat steps.
//!
//! It is written before anything moves: a test that cannot write it does not begin. At its end the test adds the step that it
//! reached. If it was killed, its own record shows that step. A test that ended before it moved anything as part of the test
//! removes its entry. A resume of such a test is one of the test before it. Where every specimen is a formula, which restarts,
//! nothing is written or read.

use std::fs::File;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::origin::{Origin, places};
use gusset_control::port::Port;
use gusset_quantity::catalog::phase::{NOT_AWAITED, Part};
use gusset_record::summary::Status;
use gusset_record::{
    FolderError, MissingEnd, Run, RunFolder, ToldBy, atomic, is_claimed, read_json,
};
use gusset_setup::Files;

/// Name of the file in the folder of an interrupted test.
const CONTINUED: &str = "continued.json";

/// A test that resumed an interrupted one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Continuation {
    /// Its folder when it began.
    folder: PathBuf,
    /// SHA-256 of the rows before the resume, as in its `resumed.json`.
    rows_sha256: String,
    /// Step after which it resumed.
    after_step: u64,
    /// Last step that it was in, once that is known.
    reached: Option<u64>,
}

/// How far a resumed test came.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    /// It has moved nothing as part of the test.
    None,
    /// Into this step.
    To(u64),
    /// Its record does not show it.
    Unknown,
}

/// An earlier test that already resumed the interrupted one.
#[derive(Debug, Clone, PartialEq)]
pub struct WentOn {
    /// Its folder; where it was, if it is not there any more.
    pub folder: PathBuf,
    /// Step after which it resumed.
    pub after: u64,
    /// Last step that it was in, if that is known.
    pub reached: Option<u64>,
    /// Its present state.
    pub now: Now,
}

/// Present state of a resumed test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Now {
    /// It runs.
    Running,
    /// It reached the last step of the test.
    Complete,
    /// It ended before that.
    Ended,
    /// Its folder is nowhere to be found.
    Gone,
}

impl std::fmt::Display for WentOn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { after, now, .. } = self;
        let folder = self.folder.display();
        if *now == Now::Running {
            return write!(f, "it was resumed and is running now, in {folder}");
        }
        write!(f, "it was resumed after step {after} in {folder}, ")?;
        match (self.reached, now) {
            (_, Now::Complete) => write!(f, "to its end"),
            (Some(step), _) => write!(f, "as far as step {step}"),
            (None, _) => write!(f, "its last step is unknown"),
        }?;
        match now {
            Now::Gone => write!(f, "; that folder is not there any more"),
            Now::Running | Now::Complete | Now::Ended => Ok(()),
        }
    }
}

impl Continuation {
    /// Its folder, wherever both are now.
    fn found(&self, parent: &Path) -> Option<PathBuf> {
        let is_it = |place: &PathBuf| {
            let origin = Origin::of(place).ok().flatten();
            origin.is_some_and(|origin| origin.rows_sha256 == self.rows_sha256)
        };
        places(parent, &self.folder).find(is_it)
    }

    /// Its state as known; `None` if it has moved nothing as part of the test.
    fn told(&self, parent: &Path) -> Option<WentOn> {
        let found = self.found(parent);
        let way = match (self.reached, &found) {
            (Some(step), _) => Way::To(step),
            (None, Some(place)) => way_of(place, self.after_step),
            (None, None) => Way::Unknown,
        };
        let now = match &found {
            Some(place) if is_claimed(place) => Now::Running,
            Some(place) if is_complete(place) => Now::Complete,
            Some(_) => Now::Ended,
            None => Now::Gone,
        };
        (way != Way::None || now == Now::Running).then(|| WentOn {
            folder: found.unwrap_or_else(|| self.folder.clone()),
            after: self.after_step,
            reached: match way {
                Way::To(step) => Some(step),
                Way::None | Way::Unknown => None,
            },
            now,
        })
    }
}

fn is_complete(folder: &Path) -> bool {
    let run = Run::open(folder);
    let summary = run.as_ref().ok().and_then(Run::summary);
    summary.is_some_and(|summary| summary.status == Status::Completed)
}

/// The folder of the interrupted test that a resume of this run continues: its own, or, if it moved nothing as part of the test, that
/// of the test that it resumed.
pub(super) fn interrupted(run: &Run, origin: Option<&Origin>) -> PathBuf {
    let folder = run.path();
    match origin {
        Some(origin) if way_of(folder, origin.step) == Way::None => origin.interrupted(folder),
        _ => folder.to_owned(),
    }
}

/// How far the test in `folder` came, which resumed after step `after`.
fn way_of(folder: &Path, after: u64) -> Way {
    let run = match Run::open(folder) {
        Ok(run) => run,
        Err(FolderError::NoSamples(_)) => return Way::None,
        Err(_) => return Way::Unknown,
    };
    let told = run.summary().map(|summary| summary.steps);
    if let Some(step) = told.filter(|step| *step > after) {
        return Way::To(step);
    }
    match last_step_of(&run) {
        Err(_) => Way::Unknown,
        Ok(Some(step)) => Way::To(step),
        Ok(None) => match MissingEnd::of_run(&run) {
            Some(missing) if missing.told_by != ToldBy::Summary(after) => Way::Unknown,
            _ if run.summary_fault().is_some() => Way::Unknown,
            _ => Way::None,
        },
    }
}

/// Step of the last row in which the run moved something as part of the test; none without such a row. The rows are read one
/// after the other.
fn last_step_of(run: &Run) -> Result<Option<u64>, FolderError> {
    let place = |name: &str| {
        let place = run.layout().index_of(name);
        place.ok_or_else(|| FolderError::NoColumn(name.to_owned()))
    };
    let places = [place("state")?, place("step")?];
    // In the second state the operator ended the test while a command was unanswered.
    let is_of_test = |state: f64| Part::of(state) == Some(Part::Test) || state == NOT_AWAITED;
    let path = run.path().join("samples.bin");
    let io = |source| FolderError::Io {
        path: path.clone(),
        source,
    };
    let (mut journal, mut last) = (run.journal()?, None);
    while let Some(row) = journal.next_row().map_err(io)? {
        let [state, step] = places.map(|place| row.values.get(place).copied());
        if let (Some(state), Some(step)) = (state, step)
            && is_of_test(state)
        {
            last = Some(step as u64);
        }
    }
    Ok(last)
}

/// The last test that resumed the one in `folder`; `None` if no test did.
///
/// # Errors
/// The entry of its folder cannot be read.
pub(super) fn last_of(folder: &Path) -> Result<Option<WentOn>, FolderError> {
    let all = read(folder)?;
    Ok(all.iter().rev().find_map(|one| one.told(folder)))
}

fn read(folder: &Path) -> Result<Vec<Continuation>, FolderError> {
    Ok(read_json(&folder.join(CONTINUED))?.unwrap_or_default())
}

/// Changes the entries of a folder; a lock keeps other processes out.
fn change<R>(
    folder: &Path,
    how: impl FnOnce(&mut Vec<Continuation>) -> R,
) -> Result<R, FolderError> {
    let io = |path: &Path| {
        let path = path.to_owned();
        |source| FolderError::Io { path, source }
    };
    // Not the folder: another process that claims it would meet the lock.
    let path = folder.join("events.jsonl");
    let held = File::open(&path).map_err(io(&path))?;
    // A file system without locks keeps no other process out; the change is still made there.
    let _nobody_else = held.lock();
    let before = read(folder)?;
    let mut all = before.clone();
    let result = how(&mut all);
    let path = folder.join(CONTINUED);
    if all.is_empty() && !before.is_empty() {
        std::fs::remove_file(&path).map_err(io(&path))?;
    } else if all != before {
        let source = |source| FolderError::Damaged {
            path: path.clone(),
            source,
        };
        let mut text = serde_json::to_string_pretty(&all).map_err(source)?;
        text.push('\n');
        atomic::write(&path, text.as_bytes()).map_err(io(&path))?;
    }
    Ok(result)
}

/// The entry of a resumed test in the folder of the interrupted one.
#[derive(Debug)]
pub(super) struct Word {
    said_in: PathBuf,
    own: Continuation,
}

impl Word {
    /// Records that the test of these files resumes in `folder`; none if each of its specimens restarts.
    pub(crate) fn say(
        files: &Files,
        ports: &[Port],
        folder: &Path,
    ) -> Result<Option<Self>, Unsaid> {
        let origin = files.origin.as_ref();
        let origin = origin.map(|(_, text)| serde_json::from_str::<Origin>(text));
        let restart = ports.iter().all(|port| port.exchange().is_formula());
        let Some(Ok(origin)) = origin.filter(|_| !restart) else {
            return Ok(None);
        };
        let own = Continuation {
            folder: std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()),
            rows_sha256: origin.rows_sha256,
            after_step: origin.step,
            reached: None,
        };
        let parent = origin.parent;
        let other = change(&parent, |all| {
            // Earlier content of the own folder is gone.
            let others = all.iter().filter(|one| one.folder != own.folder);
            let other = others.rev().find_map(|one| one.told(&parent));
            if other.is_none() {
                *all = vec![own.clone()];
            }
            other
        });
        match other.map_err(Unsaid::Folder)? {
            None => Ok(Some(Self {
                said_in: parent,
                own,
            })),
            Some(other) => Err(Unsaid::Resumed {
                folder: parent,
                other,
            }),
        }
    }

    /// Nothing has moved.
    pub(crate) fn take_back(self) {
        let _what_is_not_taken_back_names_a_folder_that_is_gone = self.end_as(Way::None);
    }

    /// The test is over, and recorded in its folder as far as it came, if that is still there.
    pub(crate) fn end(self, folder: &RunFolder) -> Result<(), FolderError> {
        let is_there = folder.is_there();
        let way = is_there.then(|| way_of(folder.path(), self.own.after_step));
        self.end_as(way.unwrap_or(Way::Unknown))
    }

    fn end_as(self, way: Way) -> Result<(), FolderError> {
        change(&self.said_in, |all| match way {
            Way::None => all.retain(|one| *one != self.own),
            Way::To(step) => {
                for own in all.iter_mut().filter(|one| **one == self.own) {
                    own.reached = Some(step);
                }
            }
            Way::Unknown => {}
        })
    }
}

/// Why a resumed test cannot record this.
#[derive(Debug, thiserror::Error)]
pub enum Unsaid {
    /// The folder refuses.
    #[error(
        "the folder of the interrupted run must record that this run resumes it; otherwise it could be resumed twice, and the \
         specimens would repeat steps: {0}; make the folder writable, or resume a copy of it"
    )]
    Folder(FolderError),
    /// Another test has resumed it.
    #[error("{}: {other}", folder.display())]
    Resumed {
        /// The folder of the interrupted test.
        folder: PathBuf,
        /// The other.
        other: WentOn,
    },
}
