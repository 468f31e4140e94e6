//! Summaries of the runs below a folder, to help a user find one.

use std::fs;
use std::path::{Path, PathBuf};

use super::filed::filed;
use super::folder::{FolderError, at};
use super::run::Run;
use super::summary::{Status, Summary};
use super::whereabouts::is_claimed;

/// Deepest subfolder that is searched: `runs/gateway/test-0001` is two below `runs`.
const DEEPEST: usize = 4;

/// Longest `resolved.toml` that is read for a title, in bytes.
const LONGEST_TEST: u64 = 64 << 20;

/// How a listed run is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum State {
    /// It ended, and its summary says how.
    Ended(Status),
    /// Its process still writes.
    Running,
    /// It has no summary, and no process writes it: it was killed.
    Unfinished,
    /// A file of it cannot be read.
    Damaged(String),
}

impl State {
    /// One word for people and for JSON.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Ended(status) => status.word(),
            Self::Running => "running",
            Self::Unfinished => "unfinished",
            Self::Damaged(_) => "damaged",
        }
    }
}

/// The largest value of a run, and where it occurred.
#[derive(Debug, Clone, PartialEq)]
pub enum Peak {
    /// Displacement in m of a degree of freedom, from 1.
    Displacement {
        /// Size, m.
        metres: f64,
        /// The degree of freedom, from 1.
        dof: usize,
    },
    /// Force in N of a specimen: for tests without a structure.
    Force {
        /// Size, N.
        newtons: f64,
        /// Name of the specimen.
        specimen: String,
    },
}

/// One run in short.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed {
    /// Its folder.
    pub folder: PathBuf,
    /// Title of the test; the name of the folder if the files have none.
    pub title: String,
    /// UTC of its first event, as RFC 3339; none if there is no event.
    pub started: Option<String>,
    /// How it is.
    pub state: State,
    /// Why it ended so, in words.
    pub reason: Option<String>,
    /// Steps of integration done; known after its end.
    pub steps: Option<u64>,
    /// Length of a step, s.
    pub dt: Option<f64>,
    /// Its largest displacement, or force without a structure.
    pub peak: Option<Peak>,
    /// The verdict proved its loop unstable.
    pub unstable: bool,
    /// Findings of its verdict.
    pub findings: usize,
    /// Who tested what, when, where and by which program; known after its end.
    pub filed: Vec<(&'static str, String)>,
}

/// Every run at and below `folder`, newest first. A folder that cannot be read is listed as damaged.
///
/// # Errors
/// [`FolderError::Missing`], [`FolderError::NotAFolder`], or the system refuses `folder` itself.
pub fn listed(folder: &Path) -> Result<Vec<Listed>, FolderError> {
    if !folder.exists() {
        return Err(FolderError::Missing(folder.to_owned()));
    }
    if !folder.is_dir() {
        return Err(FolderError::NotAFolder(folder.to_owned()));
    }
    fs::read_dir(folder).map_err(at(folder))?;
    let mut runs = Vec::new();
    search(folder, 0, &mut runs);
    runs.sort_by(|a: &Listed, b| b.started.cmp(&a.started).then(a.folder.cmp(&b.folder)));
    Ok(runs)
}

/// True if the folder holds the files that every run begins with.
fn is_run(folder: &Path) -> bool {
    ["events.jsonl", "samples.json"]
        .iter()
        .any(|name| folder.join(name).exists())
}

fn search(folder: &Path, depth: usize, runs: &mut Vec<Listed>) {
    if is_run(folder) {
        runs.push(look_at(folder));
        return;
    }
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    // Links are not followed: they may lead in circles.
    let below = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
    if depth < DEEPEST {
        below.for_each(|entry| search(&entry.path(), depth + 1, runs));
    }
}

fn look_at(folder: &Path) -> Listed {
    let name = folder.file_name().map(|name| name.to_string_lossy());
    let title = title(folder).or_else(|| name.map(std::borrow::Cow::into_owned));
    let mut listed = Listed {
        folder: folder.to_owned(),
        title: title.unwrap_or_default(),
        started: None,
        state: State::Unfinished,
        reason: None,
        steps: None,
        dt: None,
        peak: None,
        unstable: false,
        findings: 0,
        filed: Vec::new(),
    };
    let run = match Run::open(folder) {
        Ok(run) => run,
        // A run that has just begun has no columns yet.
        Err(FolderError::NoSamples(_) | FolderError::Foreign(_)) if is_claimed(folder) => {
            listed.state = State::Running;
            return listed;
        }
        Err(error) => {
            listed.state = State::Damaged(error.to_string());
            return listed;
        }
    };
    listed.started = started(&run);
    listed.filed = filed(&run);
    listed.state = match (run.summary(), run.summary_fault()) {
        (Some(summary), _) => State::Ended(summary.status),
        (None, Some(fault)) => State::Damaged(format!("summary.json: {fault}")),
        (None, None) if is_claimed(folder) => State::Running,
        (None, None) => State::Unfinished,
    };
    if let Some(summary) = run.summary() {
        listed.reason = Some(summary.reason.clone());
        listed.steps = Some(summary.steps);
        listed.dt = Some(summary.dt);
        listed.peak = peak(summary);
        if let Some(verdict) = &summary.verdict {
            listed.unstable = verdict.unstable;
            listed.findings = verdict.findings.len();
        }
    }
    listed
}

/// The time of the first event that can be read.
fn started(run: &Run) -> Option<String> {
    let mut events = run
        .event_lines()
        .ok()?
        .filter_map(|line| line.ok().flatten());
    events.next()?.wall
}

/// The title in the files of the test.
fn title(folder: &Path) -> Option<String> {
    ["resolved.toml", "test.toml"].into_iter().find_map(|name| {
        let path = folder.join(name);
        let found = path.metadata().ok()?;
        if !found.is_file() || found.len() > LONGEST_TEST {
            return None;
        }
        let table: toml::Table = fs::read_to_string(&path).ok()?.parse().ok()?;
        let title = table.get("title")?.as_str()?.trim().to_owned();
        (!title.is_empty()).then_some(title)
    })
}

/// The largest displacement of the structure; without a structure the largest force of a specimen.
fn peak(summary: &Summary) -> Option<Peak> {
    let turns = |dof: usize| summary.peak.rotations.contains(&dof);
    let moves = summary.peak.displacement.iter().enumerate();
    let moves = moves.filter_map(|(index, value)| Some((index + 1, (*value)?)));
    let largest = moves
        .filter(|(dof, _)| !turns(*dof))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((dof, metres)) = largest {
        return Some(Peak::Displacement { metres, dof });
    }
    let forces = summary.peak.force.iter();
    let forces = forces.flat_map(|(name, axes)| axes.iter().flatten().map(move |f| (name, *f)));
    let (specimen, newtons) = forces.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Peak::Force {
        newtons,
        specimen: specimen.clone(),
    })
}
