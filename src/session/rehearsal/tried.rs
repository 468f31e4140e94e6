//! Limits of what only the loop knows: it judges them in a rehearsal in which every limit holds.

use std::time::Duration;

use super::findings::short;
use super::prompter::Prompter;
use super::{Curtain, Need, Rehearsal, Staging, carry_out_with};
use crate::config::{self, ConfigError, Finding, KeyPath, Loaded};
use crate::control::limits::AxisLimits;
use crate::engine::{Control, Stop};

/// Rehearses a test whose undisturbed rehearsal is known and met no limit, for at most `budget` of wall time, with its limits. What
/// stops it, if anything does; none where no limit is left to be tried, or another one would stop it.
///
/// # Errors
/// As [`config::build`].
pub fn try_limits(
    loaded: &Loaded,
    undisturbed: &Rehearsal,
    budget: Duration,
) -> Result<Option<Finding>, ConfigError> {
    let needs = undisturbed.specimens.iter().flat_map(|needs| &needs.axes);
    if undisturbed.curtain != Curtain::Completed || needs.flatten().any(Need::trips) {
        return Ok(None);
    }
    let tables = loaded.file.specimen.iter().zip(&undisturbed.specimens);
    let mut limits = tables.flat_map(|(table, needs)| table.limits_of(needs.found.len()));
    if !limits.any(|spec| is_judged_in_the_loop(&spec.limits())) {
        return Ok(None);
    }
    let experiment = config::build_rehearsal(loaded)?.experiment;
    let (operator, requests) = crossbeam_channel::bounded(1);
    let prompter = Box::new(Prompter::new(budget, operator));
    let control = Control::from(requests);
    let tried = carry_out_with(experiment, prompter, Staging::AsItIs, &control);
    Ok(match tried.curtain {
        Curtain::Stopped(Stop::Limit { hit, .. }) if hit.quantity.is_of_loop() => {
            tried.end(loaded)
        }
        Curtain::OutOfTime => Some(
            Finding::warning(
                KeyPath::root(),
                format!(
                    "limits of what only the loop knows were tried for the first {} s of the test only",
                    short(tried.time)
                ),
            )
            .help("following error, stuck sensors, tangents, energy, lag, gain; all others were compared"),
        ),
        // Where nothing stands for a specimen it has no force, and a limit may want one.
        Curtain::Completed | Curtain::Stopped(_) => None,
    })
}

/// True if there is a trip level for what only the loop knows.
fn is_judged_in_the_loop(limits: &AxisLimits) -> bool {
    let levels = limits.levels();
    levels
        .iter()
        .any(|(quantity, levels)| quantity.is_of_loop() && levels.trips())
}
