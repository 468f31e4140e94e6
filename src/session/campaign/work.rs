//! Chunks of tasks on the threads of this process.

use std::path::{Path, PathBuf};

use super::part::{Line, Parts, merge, merge_if, names, write};
use super::perform::perform;
use super::plan::{Campaign, Plan, read};
use super::task::Task;
use super::{CampaignError, at};
use gusset_quantity::work::each;
use gusset_record::rt::os;

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
    /// Parts of another campaign. They do not count.
    pub foreign: Vec<PathBuf>,
}

/// Most chunks that a status names.
const MOST_OPEN: usize = 20;

/// Results of a chunk that no part contains yet.
struct Kept<'a> {
    campaign: &'a Campaign,
    /// Identity of the campaign.
    own: &'a str,
    chunk: u64,
    lines: Vec<Line>,
    /// Time of the last part, ns.
    written: u64,
}

/// Computes the chunks `chunks` on `jobs` threads. Finished tasks are omitted. `progress` receives the number of finished tasks
/// of these chunks. Results are written before the return, also when `stop` returns true.
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
    let own = campaign.plan.digest();
    for chunk in chunks {
        if chunk == 0 || chunk > campaign.plan.chunks() {
            return Err(CampaignError::NoChunk {
                found: chunk,
                last: campaign.plan.chunks(),
            });
        }
        let paths = found.remove(&chunk).unwrap_or_default();
        let Parts { lines, .. } = merge(&paths, &own, |index| campaign.identity(chunk, index))?;
        let tasks = campaign.plan.chunk(chunk);
        let pending: Vec<u64> = tasks.filter(|index| !lines.contains_key(index)).collect();
        worked.known += lines.len() as u64;
        progress(worked.known + worked.computed);
        let before = worked.known + worked.computed;
        let mut kept = Kept {
            campaign,
            own: &own,
            chunk,
            lines: Vec::new(),
            written: os::monotonic_ns(),
        };
        let mut done = 0;
        worked.computed += each(
            jobs,
            pending,
            stop,
            &|index| Ok(computed(campaign, index)),
            |line| {
                done += 1;
                progress(before + done);
                kept.take(line)
            },
        )?;
        kept.flush()?;
        if stop() {
            worked.interrupted = true;
            break;
        }
    }
    Ok(worked)
}

/// Computes one task.
fn computed(campaign: &Campaign, index: u64) -> Line {
    let task = Task::of(&campaign.study, index);
    Line {
        index,
        identity: task.identity(&campaign.study, &campaign.plan.program),
        result: perform(&campaign.study, &task),
    }
}

impl Kept<'_> {
    /// Keeps a result, and writes a part if the last one is old.
    fn take(&mut self, line: Line) -> Result<(), CampaignError> {
        self.lines.push(line);
        let now = os::monotonic_ns();
        if now.saturating_sub(self.written) >= FLUSH_NS {
            self.written = now;
            self.flush()?;
        }
        Ok(())
    }

    /// Writes the kept results as a part.
    fn flush(&mut self) -> Result<(), CampaignError> {
        if self.lines.is_empty() {
            return Ok(());
        }
        self.lines.sort_by_key(|line| line.index);
        write(&self.campaign.folder, self.own, self.chunk, &self.lines)?;
        self.lines.clear();
        Ok(())
    }
}

/// Progress of the campaign in `folder`, without its study: parts are compared with the plan, and tasks with their chunk.
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
        foreign: Vec::new(),
        plan,
    };
    let own = status.plan.digest();
    std::fs::read_dir(folder).map_err(at(folder))?;
    let mut found = names(folder)?;
    for chunk in 1..=status.plan.chunks() {
        let paths = found.remove(&chunk).unwrap_or_default();
        let tasks = status.plan.chunk(chunk);
        let parts = merge_if(&paths, &own, |line| tasks.contains(&line.index))?;
        let done = parts.lines.len() as u64;
        let lines = parts.lines.values();
        let invalid = lines.filter(|(line, _)| line.result.ended == super::perform::INVALID);
        status.invalid += invalid.count() as u64;
        status.done += done;
        status.damaged.extend(parts.damaged);
        status.foreign.extend(parts.foreign);
        if done == tasks.end - tasks.start {
            status.chunks_done += 1;
        } else if status.open.len() < MOST_OPEN {
            status.open.push(chunk);
        }
    }
    // Parts of chunks that the plan does not have.
    status.foreign.extend(found.into_values().flatten());
    Ok(status)
}
