//! A path to a target is judged by the limits of the axes before anything moves.

use super::Trip;
use super::pacing::{AllowedAccel, FASTEST, HARDEST, Pacing};
use gusset_control::port::ReceivedPort;
use gusset_control::port::limits::{AxisLimits, Hit};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtAxis;

/// The distance of each axis in m from one place to the other, with its limits. Places are in the units of the axes.
fn distances<'a>(
    port: &'a ReceivedPort,
    [AtAxis(from), AtAxis(to)]: [AtAxis<&'a [f64]>; 2],
) -> impl Iterator<Item = (&'a AxisLimits, f64)> {
    let ends = from.iter().zip(to).zip(port.guard().units());
    let distances = ends.map(|((from, to), (metres, _))| (to - from).abs() * metres);
    port.guard().declared().iter().zip(distances)
}

/// The acceleration in 1/s² of a motion over a distance of 1 that the axes allow between these places. Real-time: yes.
pub(super) fn allowed_accel(port: &ReceivedPort, ends: [AtAxis<&[f64]>; 2]) -> AllowedAccel {
    let axes = distances(port, ends).filter(|(_, distance)| *distance > 0.0);
    let mut allowed = AllowedAccel {
        largest: f64::INFINITY,
        is_declared: true,
    };
    for (limits, distance) in axes {
        let declared = limits.size(Limit::CommandAccel).trip;
        allowed.largest = allowed.largest.min(declared / distance);
        allowed.is_declared &= declared < f64::INFINITY;
    }
    allowed
}

/// Judges a path from rest to rest between two places of the axes, without any compensation. Real-time: yes.
///
/// # Errors
/// It must exceed a limit of speed, step or acceleration.
pub(super) fn judge(
    port: &ReceivedPort,
    ends: [AtAxis<&[f64]>; 2],
    pacing: Pacing,
) -> Result<(), Trip> {
    let (seconds, period_s) = (pacing.motion_s(), pacing.period_s());
    let mut first = None;
    let mut ticks: f64 = 0.0;
    for (axis, (limits, distance)) in distances(port, ends).enumerate() {
        let speed = FASTEST * distance / seconds;
        let accel = HARDEST * distance / (seconds * seconds);
        for (quantity, value) in [
            (Limit::CommandVel, speed),
            (Limit::CommandStep, speed * period_s),
            (Limit::CommandAccel, accel),
        ] {
            let bound = limits.size(quantity).trip;
            let is_within = value <= bound;
            if is_within {
                continue;
            }
            first.get_or_insert(Hit::trip(axis, quantity, value, bound));
            let excess = value / bound;
            let longer = match quantity {
                Limit::CommandAccel => excess.sqrt(),
                _ => excess,
            };
            ticks = ticks.max((f64::from(pacing.ticks) * longer).ceil());
        }
    }
    first.map_or(Ok(()), |hit| {
        let ticks = ticks as u32;
        Err(Trip::TooFast { hit, ticks })
    })
}
