//! Where nothing is to be told of an axis: each quantity against the tighter of its two levels, at one comparison.
//!
//! It only says when a closer look is not needed; what is beyond a level, and which, [`super::Watch`] looks up. Invariant:
//! of what is commanded and measured nothing is calm that is not a finite number.

use super::{AxisLimits, Bound, Estimated, Range};

/// The tighter levels of one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Calm {
    command_disp: [f64; 2],
    command_step: f64,
    command_vel: f64,
    command_accel: f64,
    alternating_ticks: f64,
    measured_disp: [f64; 2],
    measured_force: [f64; 2],
    following_error: f64,
    force_step: f64,
    stuck_ticks: f64,
    stiffness_ratio: f64,
    damping_ratio: f64,
    added_energy: f64,
}

/// What is judged of a command: it and its differences, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asked {
    /// Displacement.
    pub disp: f64,
    /// Size of its change.
    pub step: f64,
    /// The same over wall time.
    pub vel: f64,
    /// Size of its second difference over wall time squared.
    pub accel: f64,
    /// Turns of a growing sawtooth.
    pub alternating: f64,
}

/// What is judged of a measurement, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Displacement as the sensor reads it.
    pub disp: f64,
    /// Force as the load cell reads it.
    pub force: f64,
    /// Size of the following error beyond the share of motion; less than 0 within that.
    pub error: f64,
    /// Size of the change of the force.
    pub jump: f64,
    /// Measurements in a row that were the same to the last bit.
    pub stuck: f64,
}

impl Bound {
    /// The largest size of which there is nothing to tell; nothing is beyond a level that is not a number.
    const fn calm(self) -> f64 {
        self.warn.min(self.trip).min(f64::MAX)
    }
}

impl Range {
    /// The values of which there is nothing to tell.
    const fn calm(&self) -> [f64; 2] {
        let finite = [f64::MIN, f64::MAX];
        both(both(self.warn, self.trip), finite)
    }
}

/// What is inside of both.
const fn both([low, high]: [f64; 2], [other_low, other_high]: [f64; 2]) -> [f64; 2] {
    [higher(low, other_low), lower(high, other_high)]
}

/// An end that is not a number stays: nothing is inside of it.
const fn lower(a: f64, b: f64) -> f64 {
    if a < b || a.is_nan() { a } else { b }
}

const fn higher(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

#[inline]
fn within(value: f64, [low, high]: [f64; 2]) -> bool {
    value >= low && value <= high
}

impl Calm {
    pub const fn of(limits: &AxisLimits) -> Self {
        Self {
            command_disp: limits.command_disp.calm(),
            command_step: limits.command_step.calm(),
            command_vel: limits.command_vel.calm(),
            command_accel: limits.command_accel.calm(),
            alternating_ticks: limits.alternating_ticks.calm(),
            measured_disp: both(limits.measured_range().calm(), limits.sensor_disp.calm()),
            measured_force: both(limits.measured_force.calm(), limits.sensor_force.calm()),
            following_error: limits.following_error.calm(),
            force_step: limits.force_step.calm(),
            stuck_ticks: limits.stuck_ticks.calm(),
            stiffness_ratio: limits.stiffness_ratio.calm(),
            damping_ratio: limits.damping_ratio.calm(),
            added_energy: limits.added_energy.calm(),
        }
    }

    /// Real-time: yes.
    #[inline]
    pub fn covers_command(&self, asked: &Asked) -> bool {
        within(asked.disp, self.command_disp)
            && asked.step <= self.command_step
            && asked.vel <= self.command_vel
            && asked.accel <= self.command_accel
            && asked.alternating <= self.alternating_ticks
    }

    /// Real-time: yes.
    #[inline]
    pub fn covers_measurement(&self, seen: &Seen) -> bool {
        within(seen.disp, self.measured_disp)
            && within(seen.force, self.measured_force)
            && seen.error.abs() <= self.following_error
            && seen.jump <= self.force_step
            && seen.stuck <= self.stuck_ticks
    }

    /// Estimates that are not known are no finding: written so that what is not a number is passed over. Real-time: yes.
    #[inline]
    pub fn covers_estimates(&self, found: &Estimated) -> bool {
        !(found.stiffness_ratio > self.stiffness_ratio
            || found.damping_ratio > self.damping_ratio
            || found.added_energy > self.added_energy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Numbers of all kinds, and few enough of the ordinary ones that they meet their bounds exactly.
    fn any_number() -> impl Strategy<Value = f64> {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -0.0];
        prop_oneof![
            4 => (-3..=3).prop_map(f64::from),
            1 => prop::sample::select(odd.to_vec()),
        ]
    }

    fn any_range() -> impl Strategy<Value = Range> {
        let ends = || [any_number(), any_number()];
        (ends(), ends()).prop_map(|(warn, trip)| Range { warn, trip })
    }

    fn any_bound() -> impl Strategy<Value = Bound> {
        (any_number(), any_number()).prop_map(|(warn, trip)| Bound { warn, trip })
    }

    proptest! {
        #[test]
        fn of_what_is_calm_the_closer_look_tells_nothing(
            ranges in [any_range(), any_range(), any_range(), any_range(), any_range()],
            bounds in prop::array::uniform9(any_bound()),
            values in prop::array::uniform8(any_number()),
        ) {
            let [command_disp, measured_disp, measured_force, sensor_disp, sensor_force] = ranges;
            let [command_step, command_vel, command_accel, alternating_ticks, following_error, ..] = bounds;
            let [.., force_step, stuck_ticks, stiffness_ratio, added_energy] = bounds;
            let limits = AxisLimits {
                command_disp,
                command_step,
                command_vel,
                command_accel,
                alternating_ticks,
                measured_disp,
                measured_force,
                sensor_disp,
                sensor_force,
                following_error,
                force_step,
                stuck_ticks,
                stiffness_ratio,
                added_energy,
                ..AxisLimits::NONE
            };
            let calm = Calm::of(&limits);
            let [disp, force, error, a, b, c, ratio, energy] = values;
            // These are sizes.
            let [a, b, c] = [a.abs(), b.abs(), c.abs()];
            let asked = Asked { disp, step: a, vel: b, accel: c, alternating: a };
            if calm.covers_command(&asked) {
                prop_assert_eq!(command_disp.judge(disp), None);
                prop_assert_eq!(command_step.judge(a), None);
                prop_assert_eq!(command_vel.judge(b), None);
                prop_assert_eq!(command_accel.judge(c), None);
                prop_assert_eq!(alternating_ticks.judge(a), None);
            }
            let seen = Seen { disp, force, error, jump: a, stuck: b };
            if calm.covers_measurement(&seen) {
                for range in [measured_disp, sensor_disp] {
                    prop_assert_eq!(range.judge(disp), None);
                }
                for range in [measured_force, sensor_force] {
                    prop_assert_eq!(range.judge(force), None);
                }
                prop_assert_eq!(following_error.judge(error), None);
                prop_assert_eq!(force_step.judge(a), None);
                prop_assert_eq!(stuck_ticks.judge(b), None);
            }
            let found = Estimated { stiffness_ratio: ratio, damping_ratio: ratio, added_energy: energy };
            if calm.covers_estimates(&found) {
                // What is not finite is not judged there.
                let judged = |bound: Bound, value: f64| bound.judge(value).filter(|_| value.is_finite());
                prop_assert_eq!(judged(stiffness_ratio, ratio), None);
                prop_assert_eq!(judged(added_energy, energy), None);
            }
        }
    }
}
