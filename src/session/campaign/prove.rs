//! Tasks that are computed again, to prove that results of other machines have the bits of this one.

use std::path::Path;

use super::design::is_among;
use super::part::{Line, set_aside};
use super::perform::perform;
use super::plan::Campaign;
use super::task::Task;
use super::work::Stop;
use super::{CampaignError, at};
use gusset_quantity::work::each;
use gusset_record::atomic::random_number;

/// How many tasks are computed again, and the seed of their choice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prove {
    amount: Amount,
    /// A given seed repeats a choice.
    seed: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Amount {
    /// This number of tasks.
    Tasks(u64),
    /// This share of all tasks.
    Share(f64),
}

impl Prove {
    /// Reads `20` or `1%`. Without a seed each collection draws its own.
    #[must_use]
    pub fn parse(text: &str, seed: Option<u64>) -> Option<Self> {
        let amount = match text.strip_suffix('%') {
            Some(percent) => {
                let percent: f64 = percent.trim().parse().ok()?;
                let is_share = (0.0..=100.0).contains(&percent);
                is_share.then_some(Amount::Share(percent / 100.0))?
            }
            None => Amount::Tasks(text.parse().ok()?),
        };
        Some(Self { amount, seed })
    }

    /// Draws the choice. No file of the campaign contains the seed, so a person who changes a row cannot know whether it is
    /// chosen.
    pub(super) fn drawn(self) -> Result<Choice, CampaignError> {
        let seed = self.seed.map_or_else(random_number, Ok);
        let seed = seed.map_err(at(Path::new("/dev/urandom")))?;
        Ok(Choice {
            amount: self.amount,
            seed,
        })
    }
}

/// A drawn choice of tasks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Choice {
    amount: Amount,
    pub seed: u64,
}

impl Choice {
    /// Number of chosen tasks.
    fn count(self, tasks: u64) -> u64 {
        match self.amount {
            Amount::Tasks(count) => count.min(tasks),
            Amount::Share(share) => ((share * tasks as f64).ceil() as u64).min(tasks),
        }
    }

    /// True if the task `index` of `tasks` is chosen.
    pub(crate) fn has(self, index: u64, tasks: u64) -> bool {
        is_among(self.seed, "prove", index, self.count(tasks), tasks)
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
