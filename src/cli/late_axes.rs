//! `gusset check`: several axes that are later than all of them may be together.

use super::following::{Follows, decides};
use super::spectrum::Spectrum;
use super::table::duration;
use crate::config::{Facts, Finding, KeyPath, Loaded};
use crate::spectral::delay::{DiscreteLimit, continuous};

/// A warning for each specimen of several axes of which one lags more than all of them together may by the recursion: no proof is
/// made for these.
pub fn late_axes(loaded: &Loaded, facts: &Facts, spectrum: Option<&Spectrum>) -> Vec<Finding> {
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
        let critical = match spectrum?.discrete(&one.name)? {
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
                .label("with several axes late the test may grow")
                .help("the critical delay is that by the recursion, all axes equally late")
        })
    });
    late.collect()
}
