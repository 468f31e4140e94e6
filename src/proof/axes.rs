//! Actuators beyond the proofs in continuous time: of several axes, the lag is compared with the critical delay of the recursion;
//! in a structure that is too large for a proof the stability is not known.

use super::actuator::Follows;
use super::analysis::{Analysis, Loop};
use super::case::Case;
use gusset_numerics::spectral::delay::{DiscreteLimit, continuous};
use gusset_quantity::finding::{Finding, KeyPath};
use gusset_quantity::units::duration;

/// A warning for each specimen of which an axis lags more than the recursion tolerates of all axes together, and for each
/// declared actuator in a structure that is too large for a proof.
pub(super) fn not_proven(case: &Case<'_>) -> Vec<Finding> {
    if !case.structure {
        return Vec::new();
    }
    let found = case.actuators.iter().filter_map(|actuator| {
        let follows = actuator.follows(case.tick)?;
        let loops = case.analysis.map(|analysis| &analysis.loops);
        let Some(one) = loops.and_then(|loops| loops.get(actuator.number)) else {
            return Some(unknown(actuator.place(), &actuator.name));
        };
        if one.system.rows.nrows() < 2 {
            return None;
        }
        let lag = most_lag(one, follows, case.analysis?)?;
        let critical = critical(one, case)?;
        (lag > critical).then(|| late(actuator.place(), &actuator.name, lag, critical))
    });
    found.collect()
}

/// The critical delay of all axes together by the recursion, s; none where no delay is critical, or the delay is not known.
fn critical(one: &Loop, case: &Case<'_>) -> Option<f64> {
    match one.discrete(case.dt, case.lambda?) {
        Ok(DiscreteLimit::At(delay)) => Some(delay),
        Ok(DiscreteLimit::Beyond(_)) | Err(_) => None,
    }
}

/// The largest remaining lag of an axis in s, at the frequency where the loop would grow; none if an axis has no known lag.
fn most_lag(one: &Loop, follows: Follows<'_>, analysis: &Analysis) -> Option<f64> {
    let grows = continuous(&one.system).ok().flatten();
    let grows = grows.map(|found| found.omega);
    let lowest = || Some(analysis.delayed_modes().first()?.frequency);
    let omega = grows.filter(|omega| omega.is_finite()).or_else(lowest)?;
    let mut most = 0.0;
    for axis in 0..one.system.rows.nrows() {
        most = f64::max(most, follows.left(omega, &one.system, axis)?);
    }
    Some(most)
}

fn late(at: KeyPath, name: &str, lag: f64, critical: f64) -> Finding {
    let text = format!(
        "the actuators of specimen \"{name}\" lag {}, and all of them together may lag {}",
        duration(lag),
        duration(critical)
    );
    Finding::warning(at, text)
        .at_key()
        .label("with several late axes the response may grow")
        .number("lag_s", lag)
        .number("critical_delay_s", critical)
        .help("the critical delay is that of the recursion with all axes equally late")
        .help("compensate the lag with [specimen.compensation]")
}

fn unknown(at: KeyPath, name: &str) -> Finding {
    let text =
        format!("the stability of the loop with the actuators of specimen \"{name}\" is not known");
    Finding::warning(at, text)
        .at_key()
        .label("no proof for a structure of this size")
        .help("`check --rehearse` tries it over everything that is uncertain")
}
