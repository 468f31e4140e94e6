//! The past values of one axis, and the values of its next command and measurement that are judged.

use super::judge::{COMMAND, Look, MEASUREMENT};
use super::lately::Lately;
use super::sawtooth::Sawtooth;
use super::trips::{GoesOn, Trips};
use super::{AxisLimits, Found};
use crate::catalog::limit::Limit;

/// What is remembered of one axis, SI.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Past {
    /// Commands that left: the last, and the one before.
    pub command: [f64; 2],
    /// Speed of the commands of the last `following_time`: an actuator that comes behind by as much still goes on at it.
    pub speed: Lately,
    measured: f64,
    force: f64,
    /// The force before the first jump beyond its trip level, and that level.
    pub jump: Option<[f64; 2]>,
    /// What was measured as it is held against the command.
    pub stands: f64,
    pub stuck_ticks: u32,
    pub stuck_travel: f64,
    pub sawtooth: Sawtooth,
    /// One bit per quantity that is beyond its warning level.
    pub warned: u32,
    pub trips: Trips,
}

/// Wall time in s to the next command, and that to the last; 0: no other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    pub tick: f64,
    pub before: f64,
}

impl Past {
    /// Keeps the commands and forgets measurements, warnings and trips, for a new session.
    pub fn of_a_session(&self) -> Self {
        Self {
            command: self.command,
            sawtooth: Sawtooth::at_rest(self.command[0]),
            ..Self::default()
        }
    }

    /// The values of the next command that are judged, in the order of [`COMMAND`]. Real-time: yes.
    #[inline]
    pub fn of_command(&self, disp: f64, pace: Pace, aims: bool) -> [f64; COMMAND.len()] {
        const {
            assert!(matches!(
                COMMAND,
                [
                    Limit::CommandDisp,
                    Limit::CommandStep,
                    Limit::CommandVel,
                    Limit::CommandAccel,
                    Limit::Alternation,
                ]
            ));
        }
        let Pace { tick, before } = pace;
        let [last, last_but_one] = self.command;
        let sawtooth = if aims {
            self.sawtooth.ticks
        } else {
            self.sawtooth.after(disp).ticks
        };
        let step = (disp - last).abs();
        let accel = if before == tick || before == 0.0 {
            (disp - 2.0 * last + last_but_one).abs() / (tick * tick)
        } else {
            let change = (disp - last) / tick - (last - last_but_one) / before;
            change.abs() / (0.5 * (tick + before))
        };
        [disp, step, step / tick, accel, f64::from(sawtooth)]
    }

    /// Takes a fresh measurement. Its values that are judged, in the order of [`MEASUREMENT`]. Real-time: yes.
    #[inline]
    pub fn of_measurement(
        &mut self,
        (disp, force, stands): (f64, f64, f64),
        seen_before: bool,
        limits: &AxisLimits,
    ) -> [f64; MEASUREMENT.len()] {
        const {
            assert!(matches!(
                MEASUREMENT,
                [
                    Limit::SensorDisp,
                    Limit::SensorForce,
                    Limit::MeasuredDisp,
                    Limit::MeasuredForce,
                    Limit::FollowingError,
                    Limit::ForceStep,
                    Limit::StuckSensor,
                ]
            ));
        }
        let moved =
            disp.to_bits() != self.measured.to_bits() || force.to_bits() != self.force.to_bits();
        if moved || !seen_before {
            (self.stuck_ticks, self.stuck_travel) = (0, 0.0);
        } else if self.stuck_travel > limits.stuck_travel {
            self.stuck_ticks = self.stuck_ticks.saturating_add(1);
        }
        // The share of motion is taken off, so that both levels get the same.
        let error = (stands - self.command[0]).abs() - limits.following_time * self.speed.largest();
        let change = (force - self.force).abs();
        let allowed = limits.size(Limit::ForceStep).trip;
        if seen_before && change > allowed {
            self.jump.get_or_insert([self.force, allowed]);
        }
        (self.measured, self.force, self.stands) = (disp, force, stands);
        let stuck = f64::from(self.stuck_ticks);
        [disp, force, disp, force, error, change, stuck]
    }

    pub fn look<'a>(
        &'a mut self,
        axis: usize,
        limits: &'a AxisLimits,
        found: &'a mut Found,
    ) -> Look<'a> {
        Look {
            axis,
            limits,
            warned: &mut self.warned,
            trips: &mut self.trips,
            goes_on: GoesOn::default(),
            found,
        }
    }
}
