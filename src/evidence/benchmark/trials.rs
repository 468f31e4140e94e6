//! The table of the benchmark: each case with each compensator and wiring, over the nominal plant or drawn ones.

use super::{
    Criteria, FORCE_LIMIT_N, Frame, Plant, QUANTUM, RATE_HZ, Setup, Wiring, reference, run,
};
use gusset_actuator::compensation::{CompensationError, CompensationSpec, ModelInverseSpec};

/// Controllers of the table, tuned to this plant (lag 24 ms).
const CONTROLLERS: [(&str, &str); 11] = [
    ("none", "none = {}"),
    (
        "polynomial-1",
        "polynomial = { order = 1, delay_s = 0.024 }",
    ),
    (
        "polynomial-2",
        "polynomial = { order = 2, delay_s = 0.024 }",
    ),
    (
        "polynomial-3",
        "polynomial = { order = 3, delay_s = 0.024 }",
    ),
    ("newton", "newton = { delay_s = 0.024 }"),
    ("inverse", "inverse = { delay_s = 0.026 }"),
    ("model-inverse", ""),
    ("pi-lead", "pi_lead = {}"),
    ("ats", "ats = { start = [1.0, 0.0249, 1.07e-4] }"),
    ("amb", "amb = {}"),
    ("recursive-fir", "recursive_fir = { delay_s = 0.024 }"),
];

/// One row of the table before it is computed.
#[derive(Debug)]
pub struct Job<'a> {
    case: usize,
    frame: Frame,
    linear: [Vec<f64>; 3],
    controller: &'a str,
    spec: &'a CompensationSpec,
    wiring: Wiring,
}

/// One line of the table.
#[derive(Debug)]
pub struct Line {
    /// Case, from 1.
    pub case: usize,
    /// Name of the compensator.
    pub controller: String,
    /// How the two sides are joined.
    pub wiring: Wiring,
    /// Criteria of the nominal plant, or the mean over the drawn plants.
    pub criteria: Criteria,
    /// The largest value of each criterion.
    pub worst: Criteria,
    /// Ticks at the limit of force.
    pub saturated: usize,
}

/// What all rows have in common.
#[derive(Debug, Clone, Copy)]
pub struct Trials<'a> {
    /// Plants drawn from the published uncertainty; 0: the nominal plant.
    pub plants: u64,
    /// Noise of the sensors.
    pub noise: bool,
    /// Converters of 18 bits.
    pub quantisation: bool,
    /// Additional delay of the force in ticks.
    pub late: usize,
    /// Seed of noise and plants.
    pub seed: u64,
    /// Ground acceleration at every tick, m/s².
    pub ground: &'a [f64],
}

/// All rows of a table; none if there is no such case.
#[must_use]
pub fn jobs<'a>(
    cases: &[usize],
    controllers: &'a [(String, CompensationSpec)],
    wirings: &[Wiring],
    ground: &[f64],
) -> Option<Vec<Job<'a>>> {
    let mut jobs = Vec::new();
    for case in cases.iter().copied() {
        let frame = Frame::case(case)?;
        let linear = reference(&frame, ground);
        for (controller, spec) in controllers {
            for wiring in wirings.iter().copied() {
                jobs.push(Job {
                    case,
                    frame,
                    linear: linear.clone(),
                    controller,
                    spec,
                    wiring,
                });
            }
        }
    }
    Some(jobs)
}

impl Trials<'_> {
    /// Computes one row; `one_more` is called after each test.
    ///
    /// # Errors
    /// The compensator cannot be built.
    pub fn line(&self, job: &Job<'_>, one_more: &dyn Fn()) -> Result<Line, CompensationError> {
        let plants = if self.plants == 0 {
            0..1
        } else {
            1..self.plants + 1
        };
        let mut all = Vec::new();
        let mut saturated = 0;
        for number in plants {
            let mut controller = job.spec.build(1.0 / RATE_HZ)?;
            controller.reset(0.0);
            let setup = Setup {
                frame: &job.frame,
                plant: Plant::drawn(self.seed, number),
                wiring: job.wiring,
                noise: self.noise.then_some(self.seed + number),
                quantum: if self.quantisation { QUANTUM } else { 0.0 },
                ground: self.ground,
                late: self.late,
                force_limit: FORCE_LIMIT_N,
            };
            let outcome = run(&setup, controller.as_mut());
            one_more();
            saturated += outcome.saturated;
            all.push(Criteria::of(&outcome.histories, &job.linear, 1.0 / RATE_HZ));
        }
        let (criteria, worst) = mean_and_worst(&all);
        Ok(Line {
            case: job.case,
            controller: job.controller.to_owned(),
            wiring: job.wiring,
            criteria,
            worst,
            saturated,
        })
    }
}

fn mean_and_worst(all: &[Criteria]) -> (Criteria, Criteria) {
    let count = all.len() as f64;
    let mut criteria = Criteria {
        j: [0.0; 9],
        delay_ms: 0.0,
    };
    let mut worst = criteria;
    for one in all {
        for ((mean, worst), value) in criteria.j.iter_mut().zip(&mut worst.j).zip(one.j) {
            *mean += value / count;
            *worst = if value > *worst || value.is_nan() {
                value
            } else {
                *worst
            };
        }
        criteria.delay_ms += one.delay_ms / count;
        // A lead is as bad as a lag. An unknown delay is the worst.
        if one.delay_ms.is_nan() || one.delay_ms.abs() > worst.delay_ms.abs() {
            worst.delay_ms = one.delay_ms;
        }
    }
    (criteria, worst)
}

/// The controllers that are requested: one by name, one in the words of `[specimen.compensation]`, or all.
///
/// # Errors
/// There is no such controller, in words.
pub fn controllers(asked: Option<&str>) -> Result<Vec<(String, CompensationSpec)>, String> {
    let known = || {
        CONTROLLERS.iter().map(|(name, text)| {
            let spec = if text.is_empty() {
                model_inverse()
            } else {
                toml::from_str(text).map_err(|error| error.to_string())?
            };
            Ok(((*name).to_owned(), spec))
        })
    };
    let Some(asked) = asked else {
        return known().collect();
    };
    if CONTROLLERS.iter().any(|(name, _)| *name == asked) {
        return known()
            .filter(|one: &Result<_, String>| one.as_ref().is_ok_and(|(name, _)| name == asked))
            .collect();
    }
    let spec: CompensationSpec = toml::from_str(asked).map_err(|error| {
        let names: Vec<_> = CONTROLLERS.iter().map(|(name, _)| *name).collect();
        format!(
            "--controller {asked:?}: use one of {}, or a table as in [specimen.compensation]; as a table: {}",
            names.join(", "),
            error.message()
        )
    })?;
    spec.build(1.0 / RATE_HZ)
        .map_err(|error| format!("--controller: {error}"))?;
    Ok(vec![(asked.to_owned(), spec)])
}

/// The first four coefficients of the nominal plant's own polynomial, over its gain.
fn model_inverse() -> CompensationSpec {
    let plant = Plant::default();
    let mut rising = plant.servo.characteristic(plant.stiffness, plant.damping);
    rising.reverse();
    let gain = plant.servo.gain * plant.servo.valve_gain;
    let coefficients = rising.iter().take(4).map(|c| c / gain).collect();
    CompensationSpec::ModelInverse(ModelInverseSpec { coefficients })
}
