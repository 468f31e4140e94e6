//! Limits of what only the loop knows: it judges them in a rehearsal in which every limit holds.

use std::time::Duration;

use super::prompter::Prompter;
use super::{Curtain, Need, Rehearsal, Staging, carry_out_with};
use crate::config::{self, ConfigError, Finding, Loaded};
use crate::control::limits::AxisLimits;
use crate::engine::Control;

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
    let experiment = config::build_rehearsal(loaded)?.experiment;
    let mut limits = experiment.ports.iter().flat_map(|port| port.limits());
    if !limits.any(is_judged_in_the_loop) {
        return Ok(None);
    }
    let (operator, requests) = crossbeam_channel::bounded(1);
    let prompter = Box::new(Prompter::new(budget, operator));
    let control = Control::from(requests);
    let tried = carry_out_with(experiment, prompter, Staging::AsItIs, &control);
    Ok(tried.end(loaded))
}

/// True if there is a trip level for what no command and no measurement says by itself.
fn is_judged_in_the_loop(limits: &AxisLimits) -> bool {
    let all = [
        &limits.following_error,
        &limits.stuck_ticks,
        &limits.alternating_ticks,
        &limits.stiffness_ratio,
        &limits.damping_ratio,
        &limits.added_energy,
        &limits.lag,
        &limits.gain_error,
    ];
    all.iter().any(|bound| bound.trip.is_finite())
}
