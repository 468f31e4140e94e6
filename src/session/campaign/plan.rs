//! The campaign folder: its plan, and the checks of a worker that opens it.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::perform::{INVALID, errors, perform, why_invalid};
use super::program::Program;
use super::study::{MOST_TASKS, Study};
use super::task::Task;
use super::{CampaignError, at};
use gusset_config::read_text;
use gusset_proof::Errors;
use gusset_record::rt::os;
use gusset_record::{atomic, make_free};

/// Format of the plan and of the parts.
const FORMAT: u64 = 2;
/// Most tasks that are timed at plan time.
const TIMED: u64 = 3;
/// Time of a chunk on one core, s.
const CHUNK_S: f64 = 60.0;
/// Most tasks of a chunk: a worker keeps the results of one.
const MOST_PER_CHUNK: u64 = 10_000;
const PLAN: &str = "plan.json";

/// A planned campaign, as `plan.json` contains it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Format of the folder.
    pub format: u64,
    /// Version of the program that planned it.
    pub gusset: String,
    /// The program that planned it.
    pub program: Program,
    /// Full path of the study file.
    pub study: PathBuf,
    /// Files of the study with their digests (BLAKE3).
    pub files: Vec<(String, String)>,
    /// Number of tasks.
    pub tasks: u64,
    /// Tasks of one chunk; the last chunk may have fewer.
    pub tasks_per_chunk: u64,
    /// Mean wall time of the timed tasks on one core, s.
    pub task_s: f64,
    /// Errors of method and coupling of the timed tasks, with their numbers from 1. Older plans lack them.
    #[serde(default)]
    pub errors: Vec<(u64, Errors)>,
}

impl Plan {
    /// Number of chunks.
    #[must_use]
    pub const fn chunks(&self) -> u64 {
        self.tasks.div_ceil(self.tasks_per_chunk)
    }

    /// Identity of the campaign: a digest of its files, its program and its chunks. Each part repeats it.
    #[must_use]
    pub(crate) fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        let files = self.files.iter().flat_map(|(name, digest)| [name, digest]);
        for text in files.chain([&self.program.digest()]) {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        }
        hasher.update(&self.tasks.to_le_bytes());
        hasher.update(&self.tasks_per_chunk.to_le_bytes());
        hasher.finalize().to_hex()[..32].to_owned()
    }

    /// Tasks of chunk `chunk`, which counts from 1.
    #[must_use]
    pub fn chunk(&self, chunk: u64) -> std::ops::Range<u64> {
        let start = (chunk - 1).saturating_mul(self.tasks_per_chunk);
        start.min(self.tasks)..start.saturating_add(self.tasks_per_chunk).min(self.tasks)
    }

    /// The errors in words, and whether all are known and small.
    pub fn of_errors(&self) -> impl Iterator<Item = (String, bool)> {
        self.errors.iter().map(|(task, errors)| {
            let (mut both, mut known) = (errors.each(), errors.each());
            let is_small = both.all(|(_, error)| errors.is_small(error));
            let is_large = known.any(|(_, one)| one.not_known.is_none() && !errors.is_small(one));
            let mark = if is_large { "LARGE ERROR: " } else { "" };
            (format!("{mark}task {task}: {}", errors.words()), is_small)
        })
    }
}

/// A campaign folder with its study.
#[derive(Debug)]
pub struct Campaign {
    /// The folder.
    pub folder: PathBuf,
    /// Its plan.
    pub plan: Plan,
    /// Its study.
    pub study: Study,
}

/// Plans the campaign of the study at `study` in the new folder `out`. At most three tasks are timed. A chunk has
/// `tasks_per_chunk` tasks, or as many as take a minute. Workers must be the same `program`.
///
/// # Errors
/// [`CampaignError`]: the study is wrong, the first task has no valid test, or the folder is not free.
pub fn plan(
    study: &Path,
    out: &Path,
    tasks_per_chunk: Option<u64>,
    program: &Program,
) -> Result<Campaign, CampaignError> {
    let path = fs::canonicalize(study).map_err(at(study))?;
    if let Some(tasks) = tasks_per_chunk.filter(|tasks| *tasks > MOST_PER_CHUNK) {
        return Err(CampaignError::Other(format!(
            "--tasks-per-chunk {tasks}: a chunk has at most {MOST_PER_CHUNK} tasks"
        )));
    }
    let expanded = Study::load(study)?;
    make_free(out)?;
    let tried = tried(&expanded);
    let task_s = timed(&expanded, &tried)?;
    let errors_of = |index: u64| Some((index + 1, errors(&expanded, index)?));
    let per_chunk = (CHUNK_S / task_s.max(1e-9)).clamp(1.0, MOST_PER_CHUNK as f64);
    let plan = Plan {
        format: FORMAT,
        gusset: env!("CARGO_PKG_VERSION").to_owned(),
        program: program.clone(),
        study: path,
        files: expanded.files.clone(),
        tasks: expanded.tasks,
        tasks_per_chunk: tasks_per_chunk.unwrap_or(per_chunk as u64).max(1),
        task_s,
        errors: tried.into_iter().filter_map(errors_of).collect(),
    };
    let write = |name: &str, bytes: &[u8]| {
        let path = out.join(name);
        atomic::write(&path, bytes).map_err(at(&path))
    };
    write("study.toml", expanded.loaded.text.as_bytes())?;
    write("test.toml", expanded.loaded.test.text.as_bytes())?;
    let text = serde_json::to_string_pretty(&plan).unwrap_or_default();
    write(PLAN, (text + "\n").as_bytes())?;
    Ok(Campaign {
        folder: out.to_owned(),
        plan,
        study: expanded,
    })
}

/// The first, the middle and the last task.
fn tried(study: &Study) -> Vec<u64> {
    let mut indices = vec![0, study.tasks / 2, study.tasks - 1];
    indices.dedup();
    indices.truncate(TIMED as usize);
    indices
}

/// Mean wall time of the tried tasks, s.
fn timed(study: &Study, indices: &[u64]) -> Result<f64, CampaignError> {
    let began = os::monotonic_ns();
    let mut invalid = 0;
    for index in indices {
        let task = Task::of(study, *index);
        if perform(study, &task).ended == INVALID {
            invalid += 1;
            if invalid == indices.len() {
                let why = why_invalid(study, &task).unwrap_or_default();
                let text = format!("the timed tasks of this study have no valid test: {why}");
                return Err(CampaignError::Other(text));
            }
        }
    }
    let passed = os::monotonic_ns().saturating_sub(began) as f64 * 1e-9;
    Ok(passed / indices.len() as f64)
}

impl Campaign {
    /// Opens a campaign folder and checks that `program`, study, test and inputs are those of the plan.
    ///
    /// # Errors
    /// [`CampaignError`]: there is no plan, or something has changed.
    pub fn open(folder: &Path, program: &Program) -> Result<Self, CampaignError> {
        let path = folder.join(PLAN);
        let plan = read(&path, folder)?;
        let differences = program.differences(&plan.program);
        if !differences.is_empty() {
            return Err(CampaignError::Program { path, differences });
        }
        let study = Study::load(&plan.study)?;
        let new = study.files.iter().find(|file| !plan.files.contains(file));
        if let Some((name, _)) = new {
            return Err(CampaignError::Changed(name.clone()));
        }
        // A record may be missing.
        if study.files != plan.files || study.tasks != plan.tasks {
            return Err(CampaignError::Changed(plan.study.display().to_string()));
        }
        Ok(Self {
            folder: folder.to_owned(),
            plan,
            study,
        })
    }

    /// Identity of the task `index`; none if it is not of chunk `chunk`.
    #[must_use]
    pub(crate) fn identity(&self, chunk: u64, index: u64) -> Option<String> {
        let is_there = self.plan.chunk(chunk).contains(&index);
        is_there.then(|| {
            let task = Task::of(&self.study, index);
            task.identity(&self.study, &self.plan.program)
        })
    }
}

/// The plan at `path`.
pub(super) fn read(path: &Path, folder: &Path) -> Result<Plan, CampaignError> {
    if !path.exists() {
        return Err(CampaignError::NoPlan(folder.to_owned()));
    }
    let text = read_text(path)?;
    let damaged = || {
        CampaignError::Other(format!(
            "{} is damaged: plan the campaign again",
            path.display()
        ))
    };
    let value: serde_json::Value = serde_json::from_str(&text).map_err(|_| damaged())?;
    let found = value.get("format").and_then(serde_json::Value::as_u64);
    let found = found.ok_or_else(damaged)?;
    if found != FORMAT {
        return Err(CampaignError::Version {
            path: path.to_owned(),
            found,
            wanted: FORMAT,
        });
    }
    let plan: Plan = serde_json::from_value(value).map_err(|_| damaged())?;
    let is_sound = (1..=MOST_TASKS).contains(&plan.tasks)
        && (1..=MOST_PER_CHUNK).contains(&plan.tasks_per_chunk);
    if is_sound { Ok(plan) } else { Err(damaged()) }
}
