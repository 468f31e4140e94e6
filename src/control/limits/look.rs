//! Values against their limits: what is new of what is found.

use super::calm::{Asked, Seen};
use super::trips::{GoesOn, Trips, Verdict};
use super::{AxisLimits, Bound, Found, Hit, Level, Quantity, Range};

/// One axis, what was warned of on it and what has tripped, and what is found.
pub(super) struct Look<'a> {
    pub axis: usize,
    pub warned: &'a mut u32,
    pub trips: &'a mut Trips,
    /// Of what is measured on the way out.
    pub goes_on: GoesOn,
    pub found: &'a mut Found,
}

impl Look<'_> {
    /// A command; `sent` have left before it, and differences need something to differ from.
    #[cold]
    pub fn at_command(&mut self, asked: &Asked, limits: &AxisLimits, sent: u8) {
        self.at(Quantity::CommandDisp, asked.disp, &limits.command_disp);
        if sent >= 1 {
            self.at(Quantity::CommandStep, asked.step, &limits.command_step);
            self.at(Quantity::CommandVel, asked.vel, &limits.command_vel);
        }
        if sent >= 2 {
            self.at(Quantity::CommandAccel, asked.accel, &limits.command_accel);
        }
        let sawtooth = &limits.alternating_ticks;
        self.at(Quantity::Alternation, asked.alternating, sawtooth);
    }

    /// A measurement, and whether there was one before it.
    #[cold]
    pub fn at_measurement(&mut self, seen: &Seen, limits: &AxisLimits, seen_before: bool) {
        // A sensor at the end of its range comes first: what it reads is not what is.
        self.at(Quantity::SensorDisp, seen.disp, &limits.sensor_disp);
        self.at(Quantity::SensorForce, seen.force, &limits.sensor_force);
        self.at(Quantity::MeasuredDisp, seen.disp, &limits.measured_range());
        self.at(Quantity::MeasuredForce, seen.force, &limits.measured_force);
        self.at(
            Quantity::FollowingError,
            seen.error,
            &limits.following_error,
        );
        if seen_before {
            self.at(Quantity::ForceStep, seen.jump, &limits.force_step);
            self.at(Quantity::StuckSensor, seen.stuck, &limits.stuck_ticks);
        }
    }

    /// What is known of some quantities.
    pub fn at_known<const N: usize>(&mut self, values: [(Quantity, f64, Bound); N]) {
        for (quantity, value, bound) in values {
            if value.is_finite() {
                self.at(quantity, value, &bound);
            }
        }
    }

    /// Judges `value`; keeps every trip, and every warning that is new.
    fn at(&mut self, quantity: Quantity, value: f64, limit: &impl Limit) {
        let bit = quantity.bit();
        let Some((level, bound)) = limit.judge(value) else {
            *self.warned &= !bit;
            return;
        };
        let hit = Hit {
            axis: self.axis,
            quantity,
            level,
            value,
            bound,
        };
        match level {
            Level::Trip => match self.trips.judge(&hit, self.goes_on) {
                Verdict::Trips if self.found.trip.is_none() => self.found.trip = Some(hit),
                Verdict::Trips | Verdict::Told => {
                    self.trips.tell(quantity);
                    self.found.more = true;
                }
                Verdict::Excused => {}
            },
            Level::Warning if *self.warned & bit == 0 => {
                *self.warned |= bit;
                if self.found.warning.is_none() {
                    self.found.warning = Some(hit);
                } else {
                    self.trips.tell_warning(&hit);
                    self.found.more = true;
                }
            }
            Level::Warning => {}
        }
    }
}

/// What a value is judged by.
trait Limit {
    /// What `value` is beyond, and the bound. Real-time: yes.
    fn judge(&self, value: f64) -> Option<(Level, f64)>;
}

impl Limit for Bound {
    fn judge(&self, value: f64) -> Option<(Level, f64)> {
        Bound::judge(*self, value)
    }
}

impl Limit for Range {
    fn judge(&self, value: f64) -> Option<(Level, f64)> {
        Range::judge(self, value)
    }
}
