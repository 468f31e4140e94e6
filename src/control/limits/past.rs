//! What is remembered of one axis, and what its next command and its next measurement are judged by.

use super::calm::{Asked, Seen};
use super::lately::Lately;
use super::look::Look;
use super::sawtooth::Sawtooth;
use super::trips::{GoesOn, Trips};
use super::{AxisLimits, Found};

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

    /// What the next command is judged by. Real-time: yes.
    #[inline]
    pub fn asked(&self, disp: f64, pace: Pace, aims: bool, limits: &AxisLimits) -> Asked {
        let Pace { tick, before } = pace;
        let [last, last_but_one] = self.command;
        let sawtooth = if aims {
            self.sawtooth.ticks
        } else {
            self.sawtooth.after(disp, limits.alternating_floor).ticks
        };
        let step = (disp - last).abs();
        Asked {
            disp,
            step,
            vel: step / tick,
            accel: if before == tick || before == 0.0 {
                (disp - 2.0 * last + last_but_one).abs() / (tick * tick)
            } else {
                let change = (disp - last) / tick - (last - last_but_one) / before;
                change.abs() / (0.5 * (tick + before))
            },
            alternating: f64::from(sawtooth),
        }
    }

    /// Takes a fresh measurement; what it is judged by. Real-time: yes.
    #[inline]
    pub fn seen(
        &mut self,
        (disp, force, stands): (f64, f64, f64),
        seen_before: bool,
        limits: &AxisLimits,
    ) -> Seen {
        let moved =
            disp.to_bits() != self.measured.to_bits() || force.to_bits() != self.force.to_bits();
        if moved || !seen_before {
            (self.stuck_ticks, self.stuck_travel) = (0, 0.0);
        } else if self.stuck_travel > limits.stuck_travel {
            self.stuck_ticks = self.stuck_ticks.saturating_add(1);
        }
        let error = (stands - self.command[0]).abs();
        let seen = Seen {
            disp,
            force,
            // The share of motion is taken off, so that both levels get the same.
            error: error - limits.following_time * self.speed.largest(),
            jump: (force - self.force).abs(),
            stuck: f64::from(self.stuck_ticks),
        };
        if seen_before && seen.jump > limits.force_step.trip {
            let from = [self.force, limits.force_step.trip];
            self.jump.get_or_insert(from);
        }
        (self.measured, self.force, self.stands) = (disp, force, stands);
        seen
    }

    pub fn look<'a>(&'a mut self, axis: usize, found: &'a mut Found) -> Look<'a> {
        Look {
            axis,
            warned: &mut self.warned,
            trips: &mut self.trips,
            goes_on: GoesOn::default(),
            found,
        }
    }
}
