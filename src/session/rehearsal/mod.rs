//! A test rehearsed on the simulated clock: its needs of each axis, and whether the limits allow them.
//!
//! The experiment is the one that would run, with the same loop, method and λ. A specimen of this process is itself; the
//! declared stand-in ([`StandIn`]) replaces one behind a link. Limits are lifted meanwhile, so that the whole need shows and
//! not only its beginning. They are compared afterwards ([`Rehearsal::findings`]), like the capacity of the rig
//! ([`Rehearsal::beyond_capacity`]). Nothing connects, nothing moves, and nothing is written.
//!
//! Only the loop knows some limited quantities (following error, tangents, added energy …). One more rehearsal tries them, in
//! which every limit holds ([`try_limits`]).
//!
//! A separate rehearsal covers an operator's hold ([`rehearse_hold`]), where the test is fastest.
//!
//! A stand-in cannot show some faults, which are not judged: sensors that stick, late answers, and lag and noise where
//! neither `identified` nor `transfer` declares them.

mod budget;
mod capacity;
mod drift;
mod errors;
mod findings;
mod hold;
mod meter;
mod prompter;
mod speeds;
mod tried;
mod whole;

use std::sync::{Arc, Mutex, PoisonError};

pub use budget::Budget;
pub(crate) use capacity::NEEDS;
pub use capacity::Used;
pub(crate) use drift::large_drift;
pub use errors::errors;
pub(crate) use findings::beyond_declared;
pub use hold::Held;
pub(crate) use hold::rehearse_hold;
pub use meter::{AxisNeed, Extreme};
pub use speeds::Speeds;
pub(crate) use speeds::compare_speeds;
pub(crate) use tried::{Tried, try_limits};
pub use whole::FullRehearsal;

use meter::Meter;
use prompter::Prompter;

use gusset_config::{CapacityTable, ConfigError, Loaded, MatrixValue, SpecimenTable};
use gusset_control::engine::{Connected, Control, Ending, Experiment, Outcome};
use gusset_control::port::Poses;
use gusset_control::port::limits::{AxisLimits, Range};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::substructure::Substructure;
use gusset_quantity::time::SimClock;
use gusset_record::Recorder;
use gusset_record::rt::os;
use gusset_setup as setup;

/// The kind of model in place of a specimen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StandIn {
    /// Its own law: it is a specimen of this process.
    Itself,
    /// The law that the file declares for rehearsals.
    Law,
    /// A linear one, by the declared stiffness and damping.
    Linear,
    /// Nothing: the declared stiffness and damping are 0, so there is no force.
    Nothing,
}

impl StandIn {
    /// For a specimen as configured.
    #[must_use]
    pub(crate) fn of(table: &SpecimenTable) -> Self {
        let known = [&table.stiffness_n_per_m, &table.damping_n_s_per_m];
        let known = known.into_iter().flatten().flat_map(MatrixValue::rows);
        match (&table.link, table.stand_in()) {
            (None, _) => Self::Itself,
            (Some(_), Some(_)) => Self::Law,
            (Some(_), None) if known.flatten().all(|entry| entry == 0.0) => Self::Nothing,
            (Some(_), None) => Self::Linear,
        }
    }

    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Itself => "its own law",
            Self::Law => "its stand-in, because it is behind a link",
            Self::Linear => {
                "a linear spring of its declared stiffness and damping, because it is behind a link; a stand-in `law` that yields would be closer"
            }
            Self::Nothing => {
                "nothing: it is behind a link, its declared stiffness is 0, and it has no stand-in `law`. Its force is unknown"
            }
        }
    }

    /// As files spell it.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::Itself => "law",
            Self::Law => "stand_in",
            Self::Linear => "linear",
            Self::Nothing => "nothing",
        }
    }
}

/// Need of a test for one quantity of one axis, SI at the specimen's scale, and its limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Need {
    /// The quantity.
    pub quantity: Limit,
    /// The extremes that are needed. A size begins at 0.
    pub needed: Extreme,
    /// Levels of the warning, infinite if not set.
    pub warn: [f64; 2],
    /// Levels of the trip, infinite if not set.
    pub trip: [f64; 2],
}

impl Need {
    /// True if the test exceeds `levels`.
    fn exceeds(&self, [low, high]: [f64; 2]) -> bool {
        !(self.needed.low >= low && self.needed.high <= high)
    }

    /// The need as a share of the trip level; infinite where it trips, 0 without a level.
    #[must_use]
    pub fn share(&self) -> f64 {
        match self.margin() {
            _ if self.trips() => f64::INFINITY,
            Some(margin) => 1.0 - margin,
            None => 0.0,
        }
    }

    /// True if the test trips here.
    #[must_use]
    pub fn trips(&self) -> bool {
        self.exceeds(self.trip)
    }

    /// True if the test warns here.
    #[must_use]
    pub fn warns(&self) -> bool {
        self.exceeds(self.warn)
    }

    /// Margin to the nearer trip level, as a share of the larger of the two: 0.2 where 80 % are needed, negative beyond the
    /// level; `None` without a trip level.
    #[must_use]
    pub fn margin(&self) -> Option<f64> {
        let [low, high] = self.trip;
        let sizes = [low, high].map(|level| if level.is_finite() { level.abs() } else { 0.0 });
        let scale = sizes[0].max(sizes[1]);
        let below = low.is_finite().then(|| (self.needed.low - low) / scale);
        let above = high.is_finite().then(|| (high - self.needed.high) / scale);
        match (below, above) {
            (Some(below), Some(above)) => Some(below.min(above)),
            (one, other) => one.or(other),
        }
    }
}

/// Needs of a test for one specimen.
#[derive(Debug, Clone, PartialEq)]
pub struct Needs {
    /// Its name.
    pub name: String,
    /// The model of the specimen.
    pub stand_in: StandIn,
    /// Per axis.
    pub axes: Vec<Vec<Need>>,
    /// All that was found of each axis, limited or not.
    pub found: Vec<AxisNeed>,
    /// Extremes of its platform's pose, if the axes are the actuators of one.
    pub poses: Option<Poses>,
    /// Ticks in which the actuator–specimen iteration did not converge.
    pub unsettled: u64,
    /// Capacity of its rig, if declared.
    pub capacity: Option<CapacityTable>,
}

/// Result of a rehearsal.
#[derive(Debug, Clone, PartialEq)]
pub struct Rehearsal {
    /// Test time that was rehearsed, s.
    pub time: f64,
    /// How it ended there. The only operator is the budget: see [`Rehearsal::is_out_of_budget`].
    pub ending: Ending,
    /// Largest displacement of any DOF of the structure, m or rad; 0 without a structure.
    pub peak_disp: f64,
    /// Largest displacement of each DOF, m or rad.
    pub peaks: Vec<f64>,
    /// Wall time that it took, s.
    pub wall_s: f64,
    /// Average wall time of a tick, s; `None` with too few ticks.
    pub tick_s: Option<f64>,
    /// One entry per specimen.
    pub specimens: Vec<Needs>,
    /// Name of each corotational member that went beyond its declared tension or rotation, with its largest ones in N and rad.
    pub beyond_declared: Vec<(String, [f64; 2])>,
}

impl Rehearsal {
    /// True if its budget was used up before the last step.
    #[must_use]
    pub(crate) fn is_out_of_budget(&self) -> bool {
        self.ending.cause() == Cause::Operator
    }
}

/// Rehearses a test within `budget`. `experiment` is used if it has neither links nor fault injection; otherwise the test is
/// built once more without them.
///
/// # Errors
/// As [`setup::build`].
pub fn rehearse(
    loaded: &Loaded,
    experiment: Option<Experiment>,
    budget: &mut Budget,
) -> Result<Rehearsal, ConfigError> {
    let only_in_the_test = |s: &SpecimenTable| s.link.is_some() || s.drill.is_some();
    let usable = !loaded.file.specimen.iter().any(only_in_the_test);
    let experiment = match experiment.filter(|_| usable) {
        Some(experiment) => experiment,
        None => setup::build_rehearsal(loaded)?.experiment,
    };
    let mut rehearsal = carry_out(experiment, budget);
    name_stand_ins(&mut rehearsal.specimens, loaded);
    Ok(rehearsal)
}

/// Names the model of each specimen; without a model no force is shown.
fn name_stand_ins(specimens: &mut [Needs], loaded: &Loaded) {
    for (needs, table) in specimens.iter_mut().zip(&loaded.file.specimen) {
        needs.stand_in = StandIn::of(table);
        needs.capacity = table.capacity;
        if needs.stand_in == StandIn::Nothing {
            for axis in &mut needs.axes {
                axis.retain(|need| !need.quantity.is_of_force());
            }
        }
    }
}

/// Treatment of the limits of a rehearsed test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Staging {
    /// They hold.
    AsItIs,
    /// They are lifted, so that the whole need is seen.
    WithoutLimits,
}

/// Carries an experiment out on the simulated clock, and keeps its needs of each axis, specimen by specimen. Its ports must
/// not lead to a link.
#[must_use]
pub(crate) fn staged(
    experiment: Experiment,
    recorder: Box<dyn Recorder>,
    staging: Staging,
) -> (Outcome, Vec<Vec<AxisNeed>>) {
    let (_nobody_speaks, requests) = crossbeam_channel::bounded(1);
    let (outcome, needs, _) = staged_with(experiment, recorder, staging, &Control::from(requests));
    (outcome, needs)
}

fn staged_with(
    mut experiment: Experiment,
    recorder: Box<dyn Recorder>,
    staging: Staging,
    control: &Control,
) -> (Outcome, Vec<Vec<AxisNeed>>, Vec<Option<Poses>>) {
    let per_step = experiment.pacing.ticks_per_step;
    let period = experiment.period.value();
    let mut books = Vec::with_capacity(experiment.ports.len());
    let ports = experiment.ports.drain(..).map(|mut port| {
        let book = Arc::new(Mutex::new(Vec::new()));
        books.push(Arc::clone(&book));
        // A per-step partner has a whole step for each command.
        let ticks = if port.path().is_per_step() {
            per_step
        } else {
            1
        };
        let tick = f64::from(ticks) * period;
        let meter = |inner, units: &[(f64, f64)]| -> Box<dyn Substructure> {
            Box::new(Meter::new(inner, units, tick, book))
        };
        if staging == Staging::WithoutLimits {
            port.guard_mut().open_all();
        }
        port.watched(meter)
    });
    experiment.ports = ports.collect();
    let test = Connected::new(experiment, Box::new(SimClock::new()), recorder);
    let retired = test.run(control);
    let poses = retired.poses();
    let taken = |book: &Arc<Mutex<Vec<AxisNeed>>>| {
        std::mem::take(&mut *book.lock().unwrap_or_else(PoisonError::into_inner))
    };
    let needs = books.iter().map(taken).collect();
    (retired.into_outcome(), needs, poses)
}

/// Ticks that an experiment makes from its warm-up to its last step, if nothing stops it.
fn expected(experiment: &Experiment) -> u64 {
    let per_step = u64::from(experiment.pacing.ticks_per_step);
    experiment.limits.warmup_ticks + experiment.steps.saturating_mul(per_step)
}

/// Rehearses an experiment; its ports must not lead to a link.
#[must_use]
pub fn carry_out(experiment: Experiment, budget: &mut Budget) -> Rehearsal {
    let (operator, requests) = crossbeam_channel::bounded(1);
    let cost = Budget::cost(&experiment);
    let prompter = Prompter::new(budget.ticks(cost), expected(&experiment), operator);
    let pace = prompter.pace();
    let control = Control::from(requests);
    let lifted = Staging::WithoutLimits;
    let rehearsal = carry_out_with(experiment, Box::new(prompter), lifted, &control);
    budget.spend(pace.ticks(), cost);
    Rehearsal {
        tick_s: pace.tick_s(),
        ..rehearsal
    }
}

fn carry_out_with(
    mut experiment: Experiment,
    prompter: Box<dyn Recorder>,
    staging: Staging,
    control: &Control,
) -> Rehearsal {
    let began = os::monotonic_ns();
    let dt = experiment.dt;
    // No operator can confirm the reading of a formula.
    experiment.opening.confirm = false;
    experiment.record_dofs.clear();
    let ports = experiment.ports.iter();
    let known: Vec<_> = ports
        .map(|port| (port.name().to_owned(), port.guard().declared().to_vec()))
        .collect();
    let (mut outcome, needs, poses) = staged_with(experiment, prompter, staging, control);
    let seen = needs.into_iter().zip(poses);
    let counts = outcome.ports.iter().map(|port| port.2.unsettled);
    let specimens = known.into_iter().zip(seen).zip(counts).map(
        |(((name, limits), (found, poses)), unsettled)| {
            let axes = found.iter().zip(&limits);
            Needs {
                name,
                stand_in: StandIn::Itself,
                axes: axes.map(|(need, limits)| compared(need, limits)).collect(),
                found,
                poses,
                unsettled,
                capacity: None,
            }
        },
    );
    Rehearsal {
        time: outcome.steps as f64 * dt,
        ending: outcome.ending,
        beyond_declared: std::mem::take(&mut outcome.beyond_declared),
        specimens: specimens.collect(),
        peak_disp: outcome
            .peaks
            .disp
            .iter()
            .fold(0.0, |most, value| value.abs().max(most)),
        peaks: outcome.peaks.disp,
        wall_s: os::monotonic_ns().saturating_sub(began) as f64 * 1e-9,
        tick_s: None,
    }
}

/// The needs of one axis beside its limits. The readings of sensors are shown only where they are limited by themselves.
fn compared(need: &AxisNeed, limits: &AxisLimits) -> Vec<Need> {
    let all = [
        (Limit::CommandDisp, need.command),
        (Limit::CommandStep, need.step),
        (Limit::CommandVel, need.vel),
        (Limit::CommandAccel, need.accel),
        (Limit::MeasuredDisp, need.measured),
        (Limit::SensorDisp, need.measured),
        (Limit::MeasuredForce, need.force),
        (Limit::SensorForce, need.force),
        (Limit::ForceStep, need.force_step),
    ];
    let all = all.map(|(quantity, needed)| {
        let Range { warn, trip } = limits.get(quantity);
        Need {
            quantity,
            needed,
            warn,
            trip,
        }
    });
    let shown = |need: &Need| {
        let always = matches!(
            need.quantity,
            Limit::CommandDisp | Limit::CommandVel | Limit::CommandAccel | Limit::MeasuredForce
        );
        let limited = [need.warn, need.trip];
        always || limited.iter().flatten().any(|level| level.is_finite())
    };
    all.into_iter().filter(shown).collect()
}
