//! Tasks that are computed again, to prove that results of other machines have the bits of this one.

use super::CampaignError;
use super::design::is_among;
use super::part::Line;
use super::perform::perform;
use super::plan::Campaign;
use super::task::Task;
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

/// Computes the tasks of `lines` again, on `jobs` threads. Each line has the name of its part.
///
/// # Errors
/// [`CampaignError::Conflict`] at the first task whose bits differ.
pub(super) fn prove(
    campaign: &Campaign,
    lines: &[(Line, String)],
    jobs: usize,
) -> Result<(), CampaignError> {
    let check = |(line, part): &(Line, String)| {
        let task = Task::of(&campaign.study, line.index);
        if perform(&campaign.study, &task).is_same(&line.result) {
            return Ok(());
        }
        Err(CampaignError::Conflict {
            task: line.index + 1,
            one: part.clone(),
            other: "this machine".to_owned(),
        })
    };
    each(jobs, lines, &|| false, &check, |()| Ok(())).map(drop)
}
