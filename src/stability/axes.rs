//! Specimens with several axes: no proof is made for them. The lag of each axis is compared with the critical delay of the recursion.

use super::following::{Follows, decides};
use crate::config::{Facts, Finding, KeyPath, Loaded};
use crate::spectral::delay::{DiscreteLimit, continuous};
use crate::units::duration;

/// A warning for each specimen with several axes if one axis lags more than the recursion tolerates of all axes together.
pub(super) fn of_several_axes(loaded: &Loaded, facts: &Facts) -> Vec<Finding> {
    let Some(analysis) = facts.structure.as_ref().and_then(|s| s.analysis.as_ref()) else {
        return Vec::new();
    };
    let modes = analysis.delayed_modes();
    let lowest = modes.first().map(|mode| mode.frequency);
    let pairs = analysis.loops.iter().zip(&loaded.file.specimen).enumerate();
    let late = pairs.filter_map(|(number, (one, table))| {
        let transfer = table.believed_transfer(1.0)?;
        let system = &one.system;
        if system.rows.nrows() < 2 {
            return None;
        }
        let critical = match one.discrete(facts.dt, facts.lambda()?) {
            Ok(DiscreteLimit::At(critical)) => critical,
            _ => return None,
        };
        // Where it would grow, as far as that is known.
        let grows = continuous(system).ok().flatten();
        let grows = grows
            .map(|found| found.omega)
            .filter(|omega| omega.is_finite());
        let omega = grows.or(lowest)?;
        let follows = Follows {
            table,
            transfer: &transfer,
            tick: facts.rate_hz.recip(),
        };
        let lags = (0..system.rows.nrows()).map(|axis| follows.left(omega, system, axis));
        let most = lags
            .collect::<Option<Vec<f64>>>()?
            .into_iter()
            .fold(0.0, f64::max);
        (most > critical).then(|| {
            let at = KeyPath::root()
                .key("specimen")
                .index(number)
                .key(decides(table));
            let text = format!(
                "the actuators of {:?} lag {}, and all of them may together lag {}",
                one.name,
                duration(most),
                duration(critical)
            );
            Finding::warning(at, text)
                .at_key()
                .label("with several late axes the test may grow")
                .number("lag_s", most)
                .number("critical_delay_s", critical)
                .help("the critical delay is that of the recursion with all axes equally late")
                .help("give a [specimen.compensation] that makes up for the lag")
        })
    });
    late.collect()
}
