//! Tasks that are computed again, to prove that results of other machines have the bits of this one.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use super::CampaignError;
use super::design::bits;
use super::part::Line;
use super::perform::perform;
use super::plan::Campaign;
use super::task::Task;

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

    /// The chosen tasks: a function of the seed of the study.
    pub(super) fn chosen(self, campaign: &Campaign) -> BTreeSet<u64> {
        let tasks = campaign.plan.tasks;
        let wanted = match self {
            Self::Tasks(count) => count.min(tasks),
            Self::Share(share) => (share * tasks as f64).ceil() as u64,
        };
        if wanted >= tasks {
            return (0..tasks).collect();
        }
        let seed = campaign.study.loaded.study.campaign.seed;
        let mut chosen = BTreeSet::new();
        let mut number = 0;
        while (chosen.len() as u64) < wanted {
            chosen.insert(bits(seed, "prove", number) % tasks);
            number += 1;
        }
        chosen
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
    let next = AtomicUsize::new(0);
    let wrong: Mutex<Option<CampaignError>> = Mutex::new(None);
    let one = || {
        while let Some((line, part)) = lines.get(next.fetch_add(1, Ordering::Relaxed)) {
            let task = Task::of(&campaign.study, line.index);
            if !perform(&campaign.study, &task).is_same(&line.result) {
                let mut wrong = wrong.lock().unwrap_or_else(PoisonError::into_inner);
                wrong.get_or_insert(CampaignError::Conflict {
                    task: line.index + 1,
                    one: part.clone(),
                    other: "this machine".to_owned(),
                });
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..jobs.clamp(1, lines.len().max(1)) {
            scope.spawn(one);
        }
        one();
    });
    let wrong = wrong.into_inner().unwrap_or_else(PoisonError::into_inner);
    wrong.map_or(Ok(()), Err)
}
