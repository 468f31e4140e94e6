//! Whether a test may be carried out: many rehearsals of it, each with other draws of its uncertain values.
//!
//! Every trial is the whole test on the simulated clock with the limits of the test. Beside it runs the same structure with
//! ideal actuators and sensors, the reference of its response. The controller's estimates (k̂, ĉ, λ) stay those of the file:
//! the draws are the truth, which the controller does not know. Nothing connects, nothing moves, and nothing is written. A
//! value without a draw is not judged.

mod course;
mod draw;
mod judgement;
mod proportion;

use std::collections::BTreeMap;
use std::sync::Arc;

pub use course::Errors;
pub use draw::Plan;
pub use judgement::{Certificate, Line};
pub use proportion::interval;

use course::{Course, Reference};

use super::campaign::fractile::fractile;
use super::campaign::perform::MOST_ATTEMPTS;
use super::rehearsal::{AxisNeed, Staging, staged};
use super::unaware::Unaware;
use gusset_config::{ConfigError, Finding, KeyPath, Loaded};
use gusset_control::engine::{Ending, Experiment, Stop, TestLimits};
use gusset_quantity::work::{each, processors};
use gusset_record::rt::os;
use gusset_setup::{self as setup, Trial};

/// Result of one trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Rehearsed {
    /// From 1.
    pub number: u64,
    /// Draws before it that are impossible as a test, a negative mass for example.
    pub impossible: u64,
    /// Where it ended before its last step, in s of test time, and why.
    pub stopped: Option<(f64, Stop)>,
    /// Needs of each axis, specimen by specimen.
    pub needs: Vec<Vec<AxisNeed>>,
    /// Its errors as far as it came.
    pub errors: Errors,
}

/// All trials of a test.
#[derive(Debug, Clone)]
pub struct Trials {
    /// In the order of their numbers.
    pub all: Vec<Rehearsed>,
    /// Wall time, s.
    pub wall_s: f64,
    /// Threads.
    pub threads: usize,
}

/// Values of 5 %, 50 % and 95 % of the trials, and the largest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// 5 %.
    pub low: f64,
    /// Half of them.
    pub middle: f64,
    /// 95 %.
    pub high: f64,
    /// The largest.
    pub worst: f64,
}

impl Band {
    /// Band of these values; `None` without any. Linear between neighbours, so that 95 % of twenty is below the
    /// largest.
    #[must_use]
    pub(crate) fn of(values: &[f64]) -> Option<Self> {
        Some(Self {
            low: fractile(values, 0.05)?,
            middle: fractile(values, 0.5)?,
            high: fractile(values, 0.95)?,
            worst: fractile(values, 1.0)?,
        })
    }
}

impl Trials {
    /// Trials that ended before their last step.
    #[must_use]
    pub fn trips(&self) -> u64 {
        let stopped = self.all.iter().filter(|one| one.stopped.is_some());
        stopped.count() as u64
    }

    /// Share of all draws that are impossible as a test.
    #[must_use]
    pub(crate) fn impossible(&self) -> f64 {
        let impossible: u64 = self.all.iter().map(|one| one.impossible).sum();
        impossible as f64 / (impossible + self.all.len() as u64).max(1) as f64
    }

    /// Number of stopped trials, by reason.
    #[must_use]
    pub fn reasons(&self) -> BTreeMap<String, u64> {
        let mut reasons = BTreeMap::new();
        for (_, stop) in self.all.iter().filter_map(|one| one.stopped.as_ref()) {
            *reasons.entry(reason(stop)).or_default() += 1;
        }
        reasons
    }

    /// Band of a value over the completed trials.
    #[must_use]
    pub fn band(&self, of: impl Fn(&Rehearsed) -> Option<f64>) -> Option<Band> {
        let whole = self.all.iter().filter(|one| one.stopped.is_none());
        Band::of(&whole.filter_map(of).collect::<Vec<f64>>())
    }
}

/// Without the numbers, which differ from trial to trial.
fn reason(stop: &Stop) -> String {
    match stop {
        Stop::Limit { port, hit } => {
            let what = hit.quantity.words();
            format!("specimen {}, {what} beyond its limit", port + 1)
        }
        Stop::TestLimit(hit) => format!("{} beyond its limit", hit.quantity.words()),
        Stop::Diverged { .. } => "the response diverged".to_owned(),
        Stop::Saturated { port } => {
            format!(
                "specimen {}: actuator or sensor at the end of its range",
                port + 1
            )
        }
        other => other.to_string(),
    }
}

/// Runs `trials` rehearsals of a test on all processors; `lambda` is the one of the test. After each rehearsal `progress`
/// receives how many are done.
///
/// # Errors
/// The test cannot be built, or not with the draws.
pub(crate) fn carry_out(
    loaded: &Loaded,
    plan: &Plan,
    lambda: Option<f64>,
    trials: u64,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Trials, ConfigError> {
    let began = os::monotonic_ns();
    let fixed = Unaware::of(loaded, lambda)?;
    let shared = if plan.has_one_reference() {
        let trial = fixed.trial(Trial::default());
        Some(reference(&fixed.with(&[])?, &trial)?)
    } else {
        None
    };
    let threads = processors().min(usize::try_from(trials).unwrap_or(usize::MAX));
    let mut all = Vec::new();
    each(
        threads,
        1..=trials,
        &|| false,
        &|number| trial(loaded, &fixed, plan, number, shared.as_ref()),
        |found: Rehearsed| {
            all.push(found);
            progress(all.len() as u64);
            Ok(())
        },
    )?;
    all.sort_by_key(|one| one.number);
    Ok(Trials {
        all,
        wall_s: os::monotonic_ns().saturating_sub(began) as f64 * 1e-9,
        threads,
    })
}

/// One trial: the test with its draws, and its reference unless all trials share one.
fn trial(
    loaded: &Loaded,
    fixed: &Unaware<'_>,
    plan: &Plan,
    number: u64,
    shared: Option<&Arc<Reference>>,
) -> Result<Rehearsed, ConfigError> {
    let mut attempt = 0;
    let (drawn, trial, prepared) = loop {
        let (sets, trial) = plan.draw(number, attempt);
        let trial = fixed.trial(trial);
        let made = fixed.with(&sets).and_then(|drawn| {
            let prepared = setup::build_trial(&drawn, &trial)?;
            Ok((drawn, prepared))
        });
        attempt += 1;
        match made {
            Ok((drawn, prepared)) => break (drawn, trial, prepared),
            Err(error) if attempt == MOST_ATTEMPTS || plan.numbers.is_empty() => {
                let text = format!("trial {number} cannot be drawn: {error}");
                let finding = Finding::error(KeyPath::root().key("uncertainty"), text);
                return Err(loaded.refuse([finding]));
            }
            Err(_) => {}
        }
    };
    let reference = match shared {
        Some(shared) => Arc::clone(shared),
        None => reference(&drawn, &trial)?,
    };
    let mut experiment = prepared.experiment;
    experiment.opening.confirm = false;
    let dofs = experiment.record_dofs.clone();
    let course = Course::of(&experiment, Some(reference), false);
    let (outcome, needs) = staged(experiment, Box::new(course.clone()), Staging::AsItIs);
    Ok(Rehearsed {
        number,
        impossible: attempt - 1,
        stopped: match outcome.ending {
            Ending::Completed => None,
            Ending::Stopped(stop) => Some((outcome.steps as f64 * drawn.time.step.value(), stop)),
        },
        needs,
        errors: course.errors(&dofs),
    })
}

/// The reference: the test with ideal actuators and sensors, and without limits.
fn reference(drawn: &Loaded, trial: &Trial) -> Result<Arc<Reference>, ConfigError> {
    let mut ideal = drawn.clone();
    for table in &mut ideal.file.specimen {
        table.transfer = None;
        table.identified = None;
        table.compensation = None;
    }
    let trial = Trial {
        ideal: true,
        ..trial.clone()
    };
    let mut experiment: Experiment = setup::build_trial(&ideal, &trial)?.experiment;
    experiment.opening.confirm = false;
    experiment.limits.divergence = f64::MAX;
    experiment.limits.test = TestLimits::NONE;
    let course = Course::of(&experiment, None, true);
    let _its_needs = staged(experiment, Box::new(course.clone()), Staging::WithoutLimits);
    Ok(Arc::new(course.kept().unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_is_that_of_its_trials() {
        let band = Band::of(&(0..=100).map(f64::from).collect::<Vec<f64>>()).unwrap();
        assert_eq!(
            (band.low, band.middle, band.high, band.worst),
            (5.0, 50.0, 95.0, 100.0)
        );
        let one = Band::of(&[3.0]).unwrap();
        assert_eq!((one.low, one.high), (3.0, 3.0));
        assert!(Band::of(&[]).is_none());
    }
}
