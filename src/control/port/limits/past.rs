//! The past values of one axis, and the values of its next command and measurement that are judged.

use super::judge::{AxisJudge, COMMAND, MEASUREMENT, RECORDED};
use super::lately::Lately;
use super::sawtooth::Sawtooth;
use super::trips::{GoesOn, Trips};
use super::{AxisLimits, Found};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::state;

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
    /// The values of the next command, of those in [`RECORDED`].
    pub ready: [f64; 4],
    /// The values that were judged in this tick, in the order of [`RECORDED`]; NaN where nothing was judged.
    pub judged: [f64; RECORDED.len()],
    /// One bit per quantity that is beyond its warning level.
    pub warned: u32,
    pub trips: Trips,
}

// The values judged in this tick are no state: it is over.
state! {
    Past {
        command, speed, measured, force, jump, stands, stuck_ticks, stuck_travel, sawtooth, ready, warned, trips
    }
    keeps { judged }
}

/// Wall time in s to the next command, and that to the last; 0: no other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    pub tick: f64,
    pub before: f64,
}

impl Past {
    /// Nothing was commanded, measured or judged yet.
    pub(crate) fn new() -> Self {
        Self {
            ready: [f64::NAN; 4],
            judged: [f64::NAN; RECORDED.len()],
            ..Self::default()
        }
    }

    /// Keeps the commands and forgets measurements, warnings and trips, for a new session.
    pub(crate) fn of_a_session(&self) -> Self {
        Self {
            command: self.command,
            sawtooth: Sawtooth::at_rest(self.command[0]),
            ..Self::new()
        }
    }

    /// Nothing was judged in this tick yet. Real-time: yes.
    #[inline]
    pub(crate) fn begin_tick(&mut self) {
        self.judged = [f64::NAN; RECORDED.len()];
    }

    /// The next command is sent, and its values become those of this tick. Real-time: yes.
    #[inline]
    pub(crate) fn note_sent(&mut self) {
        const {
            assert!(matches!(
                RECORDED,
                [
                    Limit::CommandStep,
                    Limit::CommandVel,
                    Limit::CommandAccel,
                    Limit::FollowingError,
                    Limit::ForceStep,
                    Limit::StuckSensor,
                    Limit::Alternation,
                ]
            ));
        }
        let [step, vel, accel, sawtooth] = self.ready;
        let [_, _, _, error, change, stuck, _] = self.judged;
        self.judged = [step, vel, accel, error, change, stuck, sawtooth];
        self.ready = [f64::NAN; 4];
    }

    /// The values of the next command that are judged, in the order of [`COMMAND`]; `sent` commands have left before it.
    /// Real-time: yes.
    #[inline]
    pub(crate) fn of_command(
        &mut self,
        disp: f64,
        pace: Pace,
        aims: bool,
        sent: u8,
    ) -> [f64; COMMAND.len()] {
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
        let (vel, sawtooth) = (step / tick, f64::from(sawtooth));
        let known = |value: f64, from: u8| if sent >= from { value } else { f64::NAN };
        self.ready = [known(step, 1), known(vel, 1), known(accel, 2), sawtooth];
        [disp, step, vel, accel, sawtooth]
    }

    /// Takes a fresh measurement. Its values that are judged, in the order of [`MEASUREMENT`]. Real-time: yes.
    #[inline]
    pub(crate) fn of_measurement(
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
        let [step, vel, accel, _, _, _, sawtooth] = self.judged;
        let known = |value: f64| if seen_before { value } else { f64::NAN };
        self.judged = [
            step,
            vel,
            accel,
            error,
            known(change),
            known(stuck),
            sawtooth,
        ];
        [disp, force, disp, force, error, change, stuck]
    }

    pub(crate) fn judge<'a>(
        &'a mut self,
        axis: usize,
        limits: &'a AxisLimits,
        found: &'a mut Found,
    ) -> AxisJudge<'a> {
        AxisJudge {
            axis,
            limits,
            warned: &mut self.warned,
            trips: &mut self.trips,
            goes_on: GoesOn::default(),
            found,
        }
    }
}
