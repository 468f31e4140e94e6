//! Tasks that are computed again, to prove that results of other machines have the bits of this one.

use super::CampaignError;
use super::design::is_among;
use super::part::{Line, set_aside};
use super::perform::perform;
use super::plan::Campaign;
use super::task::Task;
use super::work::Stop;
use crate::work::each;

/// How many tasks are computed again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Prove {
    /// This number of tasks.
    Tasks(u64),
    /// This share of all tasks.
    Share(f64),
}

impl Prove {
    /// Reads `20` or `1%`.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        match text.strip_suffix('%') {
            Some(percent) => {
                let percent: f64 = percent.trim().parse().ok()?;
                let is_share = (0.0..=100.0).contains(&percent);
                is_share.then_some(Self::Share(percent / 100.0))
            }
            None => text.parse().ok().map(Self::Tasks),
        }
    }

    /// Number of chosen tasks.
    pub(super) fn count(self, tasks: u64) -> u64 {
        match self {
            Self::Tasks(count) => count.min(tasks),
            Self::Share(share) => ((share * tasks as f64).ceil() as u64).min(tasks),
        }
    }

    /// True if the task `index` is chosen: a function of the seed of the study.
    pub(super) fn chooses(self, campaign: &Campaign, index: u64) -> bool {
        let tasks = campaign.plan.tasks;
        let seed = campaign.study.loaded.study.campaign.seed;
        is_among(seed, "prove", index, self.count(tasks), tasks)
    }
}

/// Computes the tasks of `lines` again, on `jobs` threads, until `stop` returns true. Each line has the name of its part. A part with
/// a wrong number is renamed: it does not count any more, and its tasks are computed again.
///
/// # Errors
/// [`CampaignError::Refuted`] at the first task whose bits differ.
pub(super) fn prove(
    campaign: &Campaign,
    lines: &[(Line, String)],
    jobs: usize,
    stop: &Stop<'_>,
) -> Result<(), CampaignError> {
    let check = |(line, part): &(Line, String)| {
        let task = Task::of(&campaign.study, line.index);
        if perform(&campaign.study, &task).is_same(&line.result) {
            return Ok(());
        }
        set_aside(&campaign.folder, part)?;
        Err(CampaignError::Refuted {
            task: line.index + 1,
            part: part.clone(),
            folder: campaign.folder.clone(),
        })
    };
    each(jobs, lines, stop, &check, |()| Ok(())).map(drop)
}
