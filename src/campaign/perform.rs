//! One task: a simulated test in this process, without a run folder.

use super::measure::{Taker, storeys};
use super::study::Study;
use super::task::Task;
use crate::config::ConfigError;
use crate::engine::{Ending, Experiment};
use crate::session::rehearsal::{Staging, staged};
use crate::session::unaware::Unaware;
use crate::setup::{self, Drawn, Trial};

/// Result of one task.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Performed {
    /// `done`, the cause that stopped the test, or why there is no such test.
    pub ended: String,
    /// One value for each measure.
    pub values: Vec<f64>,
}

impl Performed {
    /// True if both have equal words and equal bits.
    pub fn is_same(&self, other: &Self) -> bool {
        let bits = |one: &Self| one.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        self.ended == other.ended && bits(self) == bits(other)
    }
}

/// Word of a task whose overrides give no valid test.
pub(super) const INVALID: &str = "invalid";

/// Runs a task. Overrides that give no valid test are a result, too.
pub(super) fn perform(study: &Study, task: &Task) -> Performed {
    match experiment(study, task) {
        Ok(experiment) => {
            let taker = Taker::new(&study.measures, &experiment);
            let dt = experiment.dt;
            let recorder = Box::new(taker.clone());
            let (outcome, _) = staged(experiment, recorder, Staging::AsItIs);
            let completed = outcome.ending == Ending::Completed;
            Performed {
                ended: outcome.ending.word().to_owned(),
                values: taker.values(outcome.steps as f64 * dt, completed),
            }
        }
        Err(_) => Performed {
            ended: INVALID.to_owned(),
            values: vec![f64::NAN; study.measures.len()],
        },
    }
}

/// Why a task has no valid test.
pub(super) fn why_invalid(study: &Study, task: &Task) -> Option<String> {
    experiment(study, task).err().map(|error| error.to_string())
}

fn experiment(study: &Study, task: &Task) -> Result<Experiment, ConfigError> {
    let test = &study.loaded.test;
    let design = test.varied(&task.sets)?;
    let mut trial = Trial::default();
    let drawn = if task.drawn.is_empty() {
        design
    } else {
        let lambda = setup::build_rehearsal(&design)?.facts.lambda();
        let controller = Unaware::of(&design, lambda)?;
        trial = controller.trial(trial);
        controller.with(&task.drawn)?
    };
    if let Some(seed) = task.noise_seed {
        let specimens = 0..drawn.file.specimen.len() as u64;
        trial.specimens = specimens
            .map(|index| Drawn {
                seed: Some(seed + index),
                ..Drawn::default()
            })
            .collect();
    }
    let mut experiment = setup::build_trial(&drawn, &trial)?.experiment;
    experiment.opening.confirm = false;
    let storeys = storeys(&study.loaded);
    if storeys > 0 {
        experiment.record_dofs = (0..storeys).collect();
    }
    Ok(experiment)
}
