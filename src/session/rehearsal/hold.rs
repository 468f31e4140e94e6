//! Needs of an operator's hold, rehearsed where the test is fastest: there the commands must stop from the greatest velocity,
//! and return to it.

use super::prompter::Prompter;
use super::{Budget, Need, Needs, Rehearsal, Staging, carry_out_with, expected, name_stand_ins};
use gusset_config::{ConfigError, Loaded};
use gusset_control::engine::{Control, Operator};
use gusset_quantity::catalog::limit::Limit;
use gusset_record::{Recorder, TimedEvent};
use gusset_setup as setup;

/// A hold that was rehearsed.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// Test time at which it was asked for, s.
    pub at: f64,
    /// The axis that is fastest there: specimen and axis, from 0.
    pub fastest: (usize, usize),
    /// Test time after which the test had its pace again, s.
    pub until: f64,
    /// Needs of the test up to then.
    pub specimens: Vec<Needs>,
}

impl Held {
    /// Its needs of the fastest axis that depend on the pace.
    pub fn needs(&self) -> impl Iterator<Item = &Need> {
        let (specimen, axis) = self.fastest;
        let axis = self
            .specimens
            .get(specimen)
            .and_then(|needs| needs.axes.get(axis));
        let needs = axis.into_iter().flatten();
        needs.filter(|need| depends_on_pace(need.quantity) && self.holds(need))
    }

    /// True if `need` was met in this hold, and not before or after it.
    #[must_use]
    pub(crate) fn holds(&self, need: &Need) -> bool {
        let (_, at) = need.needed.farther_from(need.trip, need.warn);
        (self.at..=self.until).contains(&at)
    }
}

/// Rehearses a hold of a test whose undisturbed rehearsal is known, within `budget`. `None` where there is nothing to
/// compare it with, nothing moves, or the budget does not suffice.
///
/// # Errors
/// As [`setup::build`].
pub(crate) fn rehearse_hold(
    loaded: &Loaded,
    undisturbed: &Rehearsal,
    budget: &mut Budget,
) -> Result<Option<Held>, ConfigError> {
    let Some((fastest, at)) = fastest(undisturbed) else {
        return Ok(None);
    };
    let mut experiment = setup::build_rehearsal(loaded)?.experiment;
    let columns = experiment.columns();
    let Some(time) = columns.iter().position(|column| column.name == "time") else {
        return Ok(None);
    };
    let eases = u64::from(experiment.pacing.ease_ticks);
    let per_step = u64::from(experiment.pacing.ticks_per_step);
    let dt = experiment.dt;
    let asked = ((at / dt).floor() as u64).saturating_sub(1).max(1);
    // Both hold ramps take the test time of one, and a step that has begun is completed.
    let recovered = asked + eases.div_ceil(per_step) + STEPS_AFTER;
    experiment.steps = experiment.steps.min(recovered);
    let (operator, requests) = crossbeam_channel::bounded(2);
    let cost = Budget::cost(&experiment);
    let prompter = Prompter::new(budget.ticks(cost), expected(&experiment), operator);
    let pace = prompter.pace();
    let holding = Holding {
        prompter,
        time,
        from: asked as f64 * dt,
        rows: 0,
        until_row: eases + TICKS_AT_REST,
    };
    let (control, lifted) = (Control::from(requests), Staging::WithoutLimits);
    let found = carry_out_with(experiment, Box::new(holding), lifted, &control);
    budget.spend(pace.ticks(), cost);
    if found.time < at {
        return Ok(None);
    }
    let mut specimens = found.specimens;
    name_stand_ins(&mut specimens, loaded);
    Ok(Some(Held {
        at: asked as f64 * dt,
        fastest,
        until: found.time,
        specimens,
    }))
}

/// Steps after a hold in which its disturbance shows.
const STEPS_AFTER: u64 = 64;
/// Ticks at rest before the test continues.
const TICKS_AT_REST: u64 = 16;

/// Place and time at which the axes with a limited range are fastest.
fn fastest(undisturbed: &Rehearsal) -> Option<((usize, usize), f64)> {
    let specimens = undisturbed.specimens.iter().enumerate();
    let axes = specimens.flat_map(|(specimen, needs)| {
        let limited = |axis: &[Need]| {
            let levels = axis.iter().filter(|need| depends_on_pace(need.quantity));
            levels
                .flat_map(|need| [need.warn, need.trip])
                .flatten()
                .any(f64::is_finite)
        };
        let axes = needs.found.iter().zip(&needs.axes).enumerate();
        axes.filter(move |(_, (_, levels))| limited(levels))
            .map(move |(axis, (found, _))| ((specimen, axis), found.vel))
    });
    // Motions before the test are not held in this way.
    axes.filter(|(_, vel)| vel.high > 0.0 && vel.high_at > 0.0)
        .max_by(|(_, one), (_, other)| one.high.total_cmp(&other.high))
        .map(|(place, vel)| (place, vel.high_at))
}

/// True for a quantity that depends on the pace.
pub(super) const fn depends_on_pace(quantity: Limit) -> bool {
    matches!(
        quantity,
        Limit::CommandStep | Limit::CommandVel | Limit::CommandAccel | Limit::ForceStep
    )
}

/// Requests a hold at a moment, and continues the test when it has come to rest.
struct Holding {
    prompter: Prompter,
    /// Column of test time.
    time: usize,
    /// Test time, s.
    from: f64,
    /// Rows since then.
    rows: u64,
    until_row: u64,
}

impl Recorder for Holding {
    fn row(&mut self, row: &[f64]) -> bool {
        if row.get(self.time).is_some_and(|time| *time >= self.from) {
            let request = match self.rows {
                0 => Some(Operator::Hold),
                rows if rows == self.until_row => Some(Operator::Continue),
                _ => None,
            };
            if let Some(request) = request {
                self.prompter.ask(request);
            }
            self.rows += 1;
        }
        self.prompter.row(row)
    }

    fn event(&mut self, event: TimedEvent) -> bool {
        self.prompter.event(event)
    }
}
