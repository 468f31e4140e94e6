//! Limits of quantities that only the loop knows: it judges them in a rehearsal in which every limit holds.

use super::findings::short;
use super::prompter::Prompter;
use super::{Budget, Need, Rehearsal, Staging, carry_out_with, expected};
use gusset_config::{ConfigError, Finding, KeyPath, Loaded};
use gusset_control::engine::{Control, Ending, Stop};
use gusset_control::port::limits::AxisLimits;
use gusset_setup as setup;

/// Result of a rehearsal with all limits.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Tried {
    /// No further limit must be tried, none trips, or one trips that is known already.
    Nothing,
    /// This limit, which only the loop knows, trips.
    Trips(Finding),
    /// The budget ended the rehearsal.
    BeyondBudget(Finding),
}

/// Rehearses a test with its limits, within `budget`, if its undisturbed rehearsal is known and met no limit.
///
/// # Errors
/// As [`setup::build`].
pub(crate) fn try_limits(
    loaded: &Loaded,
    undisturbed: &Rehearsal,
    budget: &mut Budget,
) -> Result<Tried, ConfigError> {
    let needs = undisturbed.specimens.iter().flat_map(|needs| &needs.axes);
    if undisturbed.ending != Ending::Completed || needs.flatten().any(Need::trips) {
        return Ok(Tried::Nothing);
    }
    let tables = loaded.file.specimen.iter().zip(&undisturbed.specimens);
    let mut limits = tables.flat_map(|(table, needs)| table.limits_of(needs.found.len()));
    if !limits.any(|spec| is_judged_in_the_loop(&AxisLimits::of(&spec))) {
        return Ok(Tried::Nothing);
    }
    let experiment = setup::build_rehearsal(loaded)?.experiment;
    let (operator, requests) = crossbeam_channel::bounded(1);
    let cost = Budget::cost(&experiment);
    let prompter = Box::new(Prompter::new(
        budget.ticks(cost),
        expected(&experiment),
        operator,
    ));
    let pace = prompter.pace();
    let control = Control::from(requests);
    let tried = carry_out_with(experiment, prompter, Staging::AsItIs, &control);
    budget.spend(pace.ticks(), cost);
    Ok(match tried.ending {
        Ending::Stopped(Stop::Limit { hit, .. }) if hit.quantity.is_of_loop() => {
            tried.end(loaded).map_or(Tried::Nothing, Tried::Trips)
        }
        Ending::Stopped(Stop::Operator) => {
            let text = format!(
                "limits of following error, stuck sensors, tangents, energy, lag and gain were tried for the first {} s only",
                short(tried.time)
            );
            let finding = Finding::warning(KeyPath::root().key("time"), text);
            Tried::BeyondBudget(
                finding
                    .number("rehearsed_s", tried.time)
                    .help("DOFs times ticks are beyond the budget; all other limits were compared"),
            )
        }
        // A specimen without a model has no force, and a limit may need one.
        Ending::Completed | Ending::Stopped(_) => Tried::Nothing,
    })
}

/// True if a quantity that only the loop knows has a trip level.
fn is_judged_in_the_loop(limits: &AxisLimits) -> bool {
    limits
        .levels()
        .any(|(quantity, levels)| quantity.is_of_loop() && levels.trips())
}
