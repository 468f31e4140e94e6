//! One task: a simulated test in this process, without a run folder.

use super::measure::{End, Taker, storeys};
use super::study::Study;
use super::task::Task;
use crate::judged::Judged;
use crate::rehearsal::{Staging, staged};
use crate::unaware::Unaware;
use gusset_config::ConfigError;
use gusset_control::engine::{Ending, Experiment};
use gusset_proof::Errors;
use gusset_quantity::catalog::ending::Cause;
use gusset_setup::{self as setup, Drawn, Trial};

/// Draws of one trial that the file could not be with, before that is an error.
pub(crate) const MOST_ATTEMPTS: u64 = 50;

/// Result of one task.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Performed {
    /// `done`, the cause that stopped the test, or why there is no such test.
    pub ended: String,
    /// Draws before that of this test, which the test file must not have.
    pub attempt: u64,
    /// One value for each measure.
    pub values: Vec<f64>,
}

impl Performed {
    /// How the test ended.
    pub(crate) fn end(&self) -> End {
        let is = |cause: Cause| self.ended == cause.word();
        if is(Cause::Done) {
            End::Whole
        } else if is(Cause::Diverged) || is(Cause::NotFinite) {
            End::Diverged
        } else if self.ended == INVALID {
            End::Invalid
        } else {
            End::Stopped
        }
    }

    /// True if both have equal words and equal bits.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let bits = |one: &Self| one.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let is_alike = self.ended == other.ended && self.attempt == other.attempt;
        is_alike && bits(self) == bits(other)
    }
}

/// Word of a task whose overrides give no valid test.
pub(super) const INVALID: &str = "invalid";

/// Runs a task. Overrides that give no valid test are a result, too.
pub(super) fn perform(study: &Study, task: &Task) -> Performed {
    match experiment(study, task) {
        Ok((experiment, attempt)) => {
            let taker = Taker::new(&study.measures, &experiment);
            let dt = experiment.dt;
            let recorder = Box::new(taker.clone());
            let (outcome, _) = staged(experiment, recorder, Staging::AsItIs);
            let mut result = Performed {
                ended: word(&outcome.ending).to_owned(),
                attempt,
                values: Vec::new(),
            };
            result.values = taker.values(outcome.steps as f64 * dt, result.end());
            result
        }
        Err(_) => Performed {
            ended: INVALID.to_owned(),
            attempt: 0,
            values: vec![f64::NAN; study.measures.len()],
        },
    }
}

/// The word of an ending. A computed specimen whose numbers are not finite is no fault of a link.
fn word(ending: &Ending) -> &'static str {
    match ending.cause() {
        Cause::LinkDiverged => Cause::Diverged.word(),
        Cause::LinkNotFinite => Cause::NotFinite.word(),
        _ => ending.word(),
    }
}

/// The errors of the test of a task without its drawn numbers; none if it has no structure.
pub(super) fn errors(study: &Study, index: u64) -> Option<Errors> {
    let test = &study.loaded.test;
    let design = test.varied(&Task::of(study, index).sets);
    let judged = design.and_then(|design| {
        let prepared = setup::build(&design)?;
        Judged::without_rehearsal(prepared).with_errors()
    });
    let limits = [test.file.safety.error_warn, test.file.safety.error_refuse];
    match judged {
        Ok(judged) => judged.verdict.errors,
        Err(error) => Some(Errors::not_known(&error.to_string(), limits)),
    }
}

/// Why a task has no valid test.
pub(super) fn why_invalid(study: &Study, task: &Task) -> Option<String> {
    experiment(study, task).err().map(|error| error.to_string())
}

/// The test of a task, and the number of impossible draws before it.
fn experiment(study: &Study, task: &Task) -> Result<(Experiment, u64), ConfigError> {
    let test = &study.loaded.test;
    let design = test.varied(&task.sets)?;
    let mut trial = Trial::default();
    if let Some(seed) = task.noise_seed {
        let specimens = 0..design.file.specimen.len() as u64;
        trial.specimens = specimens
            .map(|index| Drawn {
                seed: Some(seed + index),
                ..Drawn::default()
            })
            .collect();
    }
    let (prepared, attempt) = if task.drawn.is_empty() {
        (setup::build_trial(&design, &trial)?, 0)
    } else {
        let lambda = setup::build_rehearsal(&design)?.facts.lambda();
        let controller = Unaware::of(&design, lambda)?;
        let trial = controller.trial(trial);
        let mut attempt = 0;
        loop {
            let drawn = task.clone().attempted(study, attempt).drawn;
            let built = controller.with(&drawn);
            match built.and_then(|drawn| setup::build_trial(&drawn, &trial)) {
                Ok(prepared) => break (prepared, attempt),
                Err(error) if attempt + 1 == MOST_ATTEMPTS => return Err(error),
                Err(_) => attempt += 1,
            }
        }
    };
    let mut experiment = prepared.experiment;
    experiment.opening.confirm = false;
    let storeys = storeys(&study.loaded);
    if storeys > 0 {
        experiment.record_dofs = (0..storeys).collect();
    }
    Ok((experiment, attempt))
}
