//! All actuators of a test together: a loop may be unstable although it tolerates each actuator alone.

use super::actuator::{Actuator, Follows};
use super::analysis::Loop;
use super::case::Case;
use super::kind::Kind;
use super::roots::roots;
use gusset_numerics::spectral::delay::Delayed;
use gusset_quantity::finding::{Finding, KeyPath};

/// The finding on all actuators together; none for a single axis, and where the loop is stable.
pub(super) fn together(case: &Case<'_>) -> Option<(Kind, Finding)> {
    let pairs = case.analysis?.loops.iter().zip(&case.actuators);
    let actuated: Vec<(&Loop, &Actuator, Follows<'_>)> = pairs
        .filter_map(|(one, actuator)| Some((one, actuator, actuator.follows(case.tick)?)))
        .collect();
    let axes = actuated.iter().map(|(one, ..)| one.system.rows.nrows());
    if axes.sum::<usize>() < 2 {
        return None;
    }
    let roots = |of: fn(&Loop) -> &Delayed| {
        let each = actuated.iter().map(|(one, _, follows)| (of(one), *follows));
        roots(&each.collect::<Vec<_>>())
    };
    let at_rest = roots(|one| &one.system);
    let has_closed = actuated.iter().any(|(one, ..)| one.closed.is_some());
    let closed = if has_closed {
        roots(|one| one.closed.as_ref().unwrap_or(&one.system))
    } else {
        at_rest
    };
    let names = actuated.iter().map(|(one, ..)| format!("\"{}\"", one.name));
    let names = names.collect::<Vec<_>>().join(" and ");
    let (_, first, _) = actuated.first()?;
    finding(first.place(), &names, at_rest, closed)
}

fn finding(
    at: KeyPath,
    names: &str,
    at_rest: Option<u32>,
    closed: Option<u32>,
) -> Option<(Kind, Finding)> {
    let is_unstable = |roots: Option<u32>| roots.is_some_and(|roots| roots > 0);
    match (at_rest, closed) {
        (Some(0), Some(0)) => None,
        _ if is_unstable(at_rest) && closed != Some(0) => {
            let text =
                format!("the loop is unstable with the actuators of specimen {names} together");
            let roots = f64::from(at_rest.unwrap_or_default());
            let finding = Finding::error(at, text)
                .at_key()
                .label("each actuator alone may be tolerated")
                .number("unstable_roots", roots)
                .help("compensate the lag of every actuator with [specimen.compensation]");
            Some((Kind::Unstable, finding))
        }
        _ => {
            let text = format!(
                "the stability of the loop with the actuators of specimen {names} together is not known"
            );
            let label = if is_unstable(at_rest) || is_unstable(closed) {
                "unstable either at rest, or with closed gaps and dampers at their reference"
            } else {
                "no proof: a compensation adapts or feeds back, or the curve cannot be followed"
            };
            let finding = Finding::warning(at, text).at_key().label(label);
            let help = "`check --rehearse` tries it over everything that is uncertain";
            Some((Kind::Unknown, finding.help(help)))
        }
    }
}
