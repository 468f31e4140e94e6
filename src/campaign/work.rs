//! Chunks of tasks on the threads of this process.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use super::part::{Line, Parts, merge, names, write};
use super::perform::perform;
use super::plan::{Campaign, Plan, read};
use super::task::Task;
use super::{CampaignError, at};
use crate::rt::os;

/// Results are written at least this often, in ns.
const FLUSH_NS: u64 = 15_000_000_000;

/// Tells whether a worker should stop.
pub type Stop<'a> = dyn Fn() -> bool + Sync + 'a;

/// Counts of a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Worked {
    /// Tasks that it computed.
    pub computed: u64,
    /// Tasks that were done before.
    pub known: u64,
    /// True if it was asked to stop before its end.
    pub interrupted: bool,
}

/// Progress of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// The plan.
    pub plan: Plan,
    /// Tasks with a result.
    pub done: u64,
    /// Tasks with a result whose overrides give no valid test.
    pub invalid: u64,
    /// Chunks without a missing task.
    pub chunks_done: u64,
    /// Numbers of the first chunks with missing tasks.
    pub open: Vec<u64>,
    /// Names of parts that were cut short.
    pub damaged: Vec<String>,
}

/// Most chunks that a status names.
const MOST_OPEN: usize = 20;

/// The results of one task under way, shared by threads.
struct Bench<'a> {
    campaign: &'a Campaign,
    chunk: u64,
    pending: Vec<u64>,
    next: AtomicU64,
    rows: Mutex<(Vec<Line>, u64)>,
    error: Mutex<Option<CampaignError>>,
}

/// Computes the chunks `chunks` on `jobs` threads. Tasks that are done are left out. `progress` receives the number of tasks of
/// these chunks that are done. Results are written before the return, also when `stop` returns true.
///
/// # Errors
/// [`CampaignError`]: a part belongs to another campaign, two results differ, or the system refuses a file.
pub fn work(
    campaign: &Campaign,
    chunks: impl Iterator<Item = u64>,
    jobs: usize,
    stop: &Stop<'_>,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Worked, CampaignError> {
    let mut worked = Worked::default();
    let mut found = names(&campaign.folder)?;
    for chunk in chunks {
        if chunk == 0 || chunk > campaign.plan.chunks() {
            return Err(CampaignError::NoChunk {
                found: chunk,
                last: campaign.plan.chunks(),
            });
        }
        let paths = found.remove(&chunk).unwrap_or_default();
        let Parts { lines, .. } = merge(&paths, |index| campaign.identity(index))?;
        let tasks = campaign.plan.chunk(chunk);
        let pending: Vec<u64> = tasks.filter(|index| !lines.contains_key(index)).collect();
        worked.known += lines.len() as u64;
        progress(worked.known + worked.computed);
        let before = worked.known + worked.computed;
        let bench = Bench {
            campaign,
            chunk,
            pending,
            next: AtomicU64::new(0),
            rows: Mutex::new((Vec::new(), os::monotonic_ns())),
            error: Mutex::new(None),
        };
        worked.computed += bench.compute(jobs, stop, &|done| progress(before + done))?;
        if stop() {
            worked.interrupted = true;
            break;
        }
    }
    Ok(worked)
}

impl Bench<'_> {
    /// Computes all pending tasks and returns their number.
    fn compute(
        &self,
        jobs: usize,
        stop: &Stop<'_>,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<u64, CampaignError> {
        let done = AtomicU64::new(0);
        let one = || {
            while !stop() && !self.has_failed() {
                let place = self.next.fetch_add(1, Ordering::Relaxed);
                let Some(index) = self.pending.get(place as usize) else {
                    return;
                };
                if let Err(error) = self.take(*index) {
                    let mut first = self.error.lock().unwrap_or_else(PoisonError::into_inner);
                    first.get_or_insert(error);
                }
                progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            }
        };
        let jobs = jobs.clamp(1, self.pending.len().max(1));
        std::thread::scope(|scope| {
            for _ in 1..jobs {
                scope.spawn(one);
            }
            one();
        });
        let mut error = self.error.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(error) = error.take() {
            return Err(error);
        }
        let mut rows = self.rows.lock().unwrap_or_else(PoisonError::into_inner);
        self.flush(&mut rows.0)?;
        Ok(done.into_inner())
    }

    fn has_failed(&self) -> bool {
        let error = self.error.lock().unwrap_or_else(PoisonError::into_inner);
        error.is_some()
    }

    /// Computes one task and keeps its result.
    fn take(&self, index: u64) -> Result<(), CampaignError> {
        let Campaign { study, plan, .. } = self.campaign;
        let task = Task::of(study, index);
        let line = Line {
            index,
            identity: task.identity(study, &plan.executable),
            result: perform(study, &task),
        };
        let mut rows = self.rows.lock().unwrap_or_else(PoisonError::into_inner);
        rows.0.push(line);
        let now = os::monotonic_ns();
        if now.saturating_sub(rows.1) >= FLUSH_NS {
            rows.1 = now;
            self.flush(&mut rows.0)?;
        }
        Ok(())
    }

    /// Writes the kept results as a part.
    fn flush(&self, rows: &mut Vec<Line>) -> Result<(), CampaignError> {
        if rows.is_empty() {
            return Ok(());
        }
        rows.sort_by_key(|line| line.index);
        write(&self.campaign.folder, self.chunk, rows)?;
        rows.clear();
        Ok(())
    }
}

/// Progress of the campaign in `folder`. Identities are not checked.
///
/// # Errors
/// [`CampaignError`]: there is no plan, or the system refuses a file.
pub fn status(folder: &Path) -> Result<Status, CampaignError> {
    let plan = read(&folder.join("plan.json"), folder)?;
    let mut status = Status {
        done: 0,
        invalid: 0,
        chunks_done: 0,
        open: Vec::new(),
        damaged: Vec::new(),
        plan,
    };
    std::fs::read_dir(folder).map_err(at(folder))?;
    let mut found = names(folder)?;
    for chunk in 1..=status.plan.chunks() {
        let paths = found.remove(&chunk).unwrap_or_default();
        let parts = super::part::unchecked(&paths)?;
        let tasks = status.plan.chunk(chunk);
        let done = parts.lines.keys().filter(|index| tasks.contains(index));
        let done = done.count() as u64;
        let lines = parts.lines.values();
        let invalid = lines.filter(|(line, _)| line.result.ended == super::perform::INVALID);
        status.invalid += invalid.count() as u64;
        status.done += done;
        status.damaged.extend(parts.damaged);
        if done == tasks.end - tasks.start {
            status.chunks_done += 1;
        } else if status.open.len() < MOST_OPEN {
            status.open.push(chunk);
        }
    }
    Ok(status)
}
