//! First command to a moving specimen whose file bounds neither step nor speed nor acceleration of an axis. No declared
//! limit says how far a single command may take it, and the controller may assume another position.

use super::{Trip, USUAL_TICK_S};
use gusset_control::port::ReceivedPort;
use gusset_control::port::limits::{AxisLimits, Hit};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::{AtAxis, AtSpecimen};
use gusset_quantity::substructure::Command;
use gusset_quantity::units::AxisUnits;
use gusset_quantity::units::in_axis_unit;

/// Share of the range that `command_disp_m` allows.
const SHARE: f64 = 0.05;
/// Without a range, in m.
const UNDECLARED_M: f64 = 1e-3;
/// The first command after an Arm may be so far in m from the place that it names: a controller that tries a specimen's direction
/// begins with the first step of that small motion.
const BEGINS_WITHIN_M: f64 = 1e-3;

/// The position before the first commands of a session, by which they are judged. Positions are those of the axes, in their units.
#[derive(Debug, Default)]
pub(super) struct FirstCommand {
    /// Position of the specimen, until the first command of a controller that announced no start has passed.
    pub stands: Option<AtAxis<Vec<f64>>>,
    /// Position of a specimen that moves, for every controller.
    pub leaves: Option<AtAxis<Vec<f64>>>,
    /// For a specimen that moves: the number of the first command of a controller that requested arming, and its announced start.
    pub begins: Option<(u64, AtAxis<Vec<f64>>)>,
    /// Test time of the first command since it was armed.
    goes_on_from: Option<f64>,
    /// A command has moved it since that time passed.
    runs: bool,
}

impl FirstCommand {
    /// The specimen is armed again: a test may continue from another time.
    pub(crate) fn armed(&mut self) {
        (self.goes_on_from, self.runs) = (None, false);
    }

    /// Judges a command of the controller that sends the axes of this port to `place`, in their units. Real-time: yes.
    ///
    /// # Errors
    /// It is not at the start that the controller announced, or too far from the specimen's position.
    pub(crate) fn judge(
        &self,
        command: &Command<'_>,
        place: AtAxis<&[f64]>,
        port: &ReceivedPort,
    ) -> Result<(), Trip> {
        if let Some((number, begins)) = &self.begins
            && command.sequence == *number
            && let Some(axis) = elsewhere(
                in_metres(port, begins.part(Vec::as_slice)),
                in_metres(port, place),
            )
        {
            return Err(Trip::Elsewhere(axis));
        }
        if let Some(leaves) = &self.leaves
            && let Some(hit) = judge(
                port.guard().declared(),
                in_metres(port, leaves.part(Vec::as_slice)),
                in_metres(port, place),
            )
        {
            return Err(Trip::Limit(hit));
        }
        Ok(())
    }

    /// A resumed test begins at its announced speed. The acceleration of its first command that moves is judged from that speed, not
    /// from the rest in which the specimen waited. A motion while test time is constant does not count. Real-time: yes.
    pub(crate) fn take_up_pace(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        port: &mut ReceivedPort,
    ) {
        let from = *self.goes_on_from.get_or_insert(command.time);
        // A test that begins does so at rest.
        let goes_on = from > 0.0 && command.time > from;
        if goes_on && !self.runs && !port.repeats() {
            self.runs = true;
            port.came_with_command(elapsed);
        }
    }

    /// A command of the controller was passed on. Real-time: yes.
    pub(crate) fn passed(&mut self) {
        (self.stands, self.leaves) = (None, None);
    }
}

/// Displacements in m. Real-time: yes.
fn in_metres<'a>(
    port: &'a ReceivedPort,
    disp: AtAxis<&'a [f64]>,
) -> impl Iterator<Item = AtSpecimen<f64>> + Clone + 'a {
    let units = port.guard().units().iter();
    disp.0
        .iter()
        .zip(units)
        .map(|(disp, (metres, _))| AtSpecimen(disp * metres))
}

/// How far in m a first command may take an axis; none where its own limits bound that.
fn farthest(limits: &AxisLimits) -> Option<f64> {
    let own = [Limit::CommandStep, Limit::CommandVel, Limit::CommandAccel];
    if own.iter().any(|limit| limits.get(*limit).trips()) {
        return None;
    }
    let [low, high] = limits.get(Limit::CommandDisp).trip;
    let range = high - low;
    Some(if range < f64::INFINITY {
        SHARE * range
    } else {
        UNDECLARED_M
    })
}

/// The first axis whose wiring check would begin at `start`, farther from the measured position `stands` than a first command may
/// go, in units of the axes.
pub(super) fn begins_elsewhere(
    port: &ReceivedPort,
    [stands, start]: [AtAxis<&[f64]>; 2],
) -> Option<Hit> {
    let bound = |limits: &AxisLimits| {
        let [step, vel] =
            [Limit::CommandStep, Limit::CommandVel].map(|limit| limits.size(limit).trip);
        let own = step.min(vel * USUAL_TICK_S).min(BEGINS_WITHIN_M);
        Some(farthest(limits).unwrap_or(own))
    };
    let [stands, start] = [stands, start].map(|place| in_metres(port, place));
    too_far(port.guard().declared(), stands, start, bound)
}

/// The first axis of a port that `place`, in its units, would take beyond its bound of displacement. Real-time: yes.
pub(super) fn beyond(port: &ReceivedPort, place: AtAxis<&[f64]>) -> Option<Hit> {
    let mut axes = port
        .guard()
        .declared()
        .iter()
        .zip(in_metres(port, place))
        .enumerate();
    axes.find_map(|(axis, (limits, AtSpecimen(value)))| {
        let [low, high] = limits.get(Limit::CommandDisp).trip;
        let is_within = value >= low && value <= high;
        let bound = if value > high { high } else { low };
        (!is_within).then_some(Hit::trip(axis, Limit::CommandDisp, value, bound))
    })
}

/// The first axis that moves too far from its position. Displacements in m. Real-time: yes.
fn judge(
    limits: &[AxisLimits],
    stands: impl Iterator<Item = AtSpecimen<f64>>,
    disp: impl Iterator<Item = AtSpecimen<f64>>,
) -> Option<Hit> {
    too_far(limits, stands, disp, farthest)
}

/// The first axis that moves farther from its position than its `bound`; `None` bounds nothing. Displacements in m. Real-time:
/// yes.
fn too_far(
    limits: &[AxisLimits],
    stands: impl Iterator<Item = AtSpecimen<f64>>,
    disp: impl Iterator<Item = AtSpecimen<f64>>,
    bound: impl Fn(&AxisLimits) -> Option<f64>,
) -> Option<Hit> {
    let mut axes = limits.iter().zip(stands.zip(disp)).enumerate();
    axes.find_map(|(axis, (limits, (from, to)))| {
        let bound = bound(limits)?;
        let value = (to.0 - from.0).abs();
        let is_near = value <= bound;
        (!is_near).then_some(Hit::trip(axis, Limit::CommandStep, value, bound))
    })
}

/// The first axis (from 0) on which a first command is not at the place of the Arm. Displacements in m. Real-time: yes.
fn elsewhere(
    place: impl Iterator<Item = AtSpecimen<f64>>,
    disp: impl Iterator<Item = AtSpecimen<f64>>,
) -> Option<usize> {
    place.zip(disp).position(|(place, disp)| {
        let is_there = (disp.0 - place.0).abs() <= BEGINS_WITHIN_M;
        !is_there
    })
}

/// Describes this check, one sentence per axis that it judges.
pub(crate) fn words(limits: &[AxisLimits], units: &[AxisUnits]) -> Vec<String> {
    let axes = (1..).zip(limits.iter().zip(units));
    axes.filter_map(|(number, (limits, units))| {
        let bound = farthest(limits)?;
        let why = if limits.get(Limit::CommandDisp).trip.iter().all(|end| end.is_finite()) {
            "a twentieth of the range of `command_disp_m`"
        } else {
            "for no range is declared"
        };
        Some(format!(
            "axis {number}: neither `command_step_m` nor `command_vel_m_per_s` nor `command_accel_m_per_s2` bounds it: a first \
             command may take it {} from where it stands ({why}), and what follows is not judged by its steps",
            in_axis_unit(bound / units.metres, units.disp)
        ))
    })
    .collect()
}

/// Why a first command was too far, if it is judged so.
pub(super) fn why(limits: &[AxisLimits], hit: &Hit) -> Option<&'static str> {
    let is_so = limits.get(hit.axis).and_then(farthest).is_some();
    (is_so && hit.quantity == Limit::CommandStep).then_some(
        "no limit of step, speed or acceleration is given, so a first command may go a twentieth of its range, or 1 mm where none \
         is declared",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_control::port::limits::Range;

    #[test]
    fn note_rounds_distance_in_the_axis_unit() {
        let limits = AxisLimits::NONE.with(Limit::CommandDisp, Range::trip([-0.05, 0.05]));
        let millimetres = AxisUnits {
            metres: 1e-3,
            disp: "mm",
            ..AxisUnits::SI
        };
        assert!(words(&[limits], &[millimetres])[0].contains(" take it 5 mm from"));
        assert!(words(&[limits], &[AxisUnits::SI])[0].contains(" take it 5 mm from"));
    }

    #[test]
    fn every_axis_is_judged_from_its_position() {
        let limits = AxisLimits::NONE.with(Limit::CommandDisp, Range::trip([-0.1, 0.1]));
        let first = |to: [f64; 2]| {
            let hit = judge(
                &[limits; 2],
                [0.0, 0.05].map(AtSpecimen).into_iter(),
                to.map(AtSpecimen).into_iter(),
            );
            hit.map(|hit| hit.axis)
        };
        assert_eq!(first([0.009, 0.041]), None);
        assert_eq!(first([0.011, 0.05]), Some(0));
        assert_eq!(first([0.0, 0.0]), Some(1));
        assert_eq!(first([0.0, f64::NAN]), Some(1));
    }
}
