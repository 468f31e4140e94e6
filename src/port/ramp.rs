//! The ramp of a port before and after the test: along half a cosine from where it was sent last to the command that stands ready.

use crate::catalog::limit::Limit;
use std::f64::consts::{FRAC_PI_2, PI};

use super::Port;
use super::opening::SAME;
use crate::geometry::MOST;

/// Time of a ramp in s that nothing else bounds.
pub const UNBOUNDED_RAMP_S: f64 = 1.0;

/// Where the last ramp began, and where it goes, in the specimen's units.
#[derive(Debug)]
pub(super) struct Ramp {
    from: Vec<f64>,
    to: Vec<f64>,
}

impl Ramp {
    /// For `axes` axes; none yet.
    pub fn new(axes: usize) -> Self {
        Self {
            from: vec![0.0; axes],
            to: vec![0.0; axes],
        }
    }
}

impl Port {
    /// Shortest time in s of wall time for the ramp that was begun, from the last command to the next, in ticks of `tick` s: `shortest`, or
    /// longer where it would be faster than `share` of a limit of speed or of the change in one tick, or would want more
    /// acceleration than the way out does; 0 if they are the same. Where no limit bounds its speed, a specimen that says
    /// where it stands is given a second at least: it does not jump.
    #[must_use]
    pub fn ramp_time(&self, share: f64, tick: f64, shortest: f64) -> f64 {
        self.way_time(share, tick, shortest, UNBOUNDED_RAMP_S)
    }

    /// The same for one part of a way: where no such limit bounds it, a specimen that says where it stands is given
    /// `unbounded` s at least, and any other `shortest`.
    #[must_use]
    pub fn way_time(&self, share: f64, tick: f64, shortest: f64, unbounded: f64) -> f64 {
        let unbounded = if self.standing.is_some() {
            unbounded
        } else {
            shortest
        };
        self.time_of_way(share, tick, shortest, unbounded)
    }

    fn time_of_way(&self, share: f64, tick: f64, shortest: f64, unbounded: f64) -> f64 {
        let mut time: f64 = 0.0;
        let axes = self.sent.iter().zip(&self.command).zip(self.limits());
        for (axis, ((from, to), limits)) in axes.enumerate() {
            // Along poses it may be faster than along the chord, or go there and back.
            let distance = (to - from).abs().max(self.steepest(axis));
            // What the static load left of roundoff is no way to go.
            if distance > SAME * from.abs().max(to.abs()) {
                let distance = distance * self.guard.metres_of(axis);
                // Both bound the same.
                let speed = share
                    * limits
                        .size(Limit::CommandVel)
                        .lower()
                        .min(limits.size(Limit::CommandStep).lower() / tick);
                let shortest = if speed < f64::INFINITY {
                    shortest
                } else {
                    shortest.max(unbounded)
                };
                let least = self.cosine_time(axis, distance, speed);
                time = time.max(shortest).max(least);
            }
        }
        time
    }

    /// The command that stands ready is where the ramp goes; the last one is where it begins.
    pub fn begin_ramp(&mut self) {
        self.ramp.from.copy_from_slice(&self.sent);
        self.ramp.to.copy_from_slice(&self.command);
        if let Some(posed) = &mut self.posed {
            let mut strokes = [[0.0; MOST]; 2];
            for (strokes, commands) in strokes.iter_mut().zip([&self.sent, &self.command]) {
                for (stroke, (axis, command)) in
                    strokes.iter_mut().zip(self.axes.iter().zip(commands))
                {
                    *stroke = axis.deformation(*command);
                }
            }
            let [from, to] = &strokes;
            posed.begin_way([from, to]);
        }
    }

    /// The next command is at this share (0 … 1) of a ramp that takes `seconds` of test time. A loading unit goes from pose to pose.
    pub fn ramp_to(&mut self, share: f64, seconds: f64) {
        let way = 0.5 * (1.0 - libm::cos(PI * share));
        let rate = FRAC_PI_2 * libm::sin(PI * share) / seconds;
        let ends = self.ramp.from.iter().zip(&self.ramp.to);
        let commands = self.command.iter_mut().zip(&mut self.command_vel);
        for (((command, vel), (from, to)), axis) in commands.zip(ends).zip(&self.axes) {
            // The end is met to the last bit.
            *command = if share < 1.0 {
                from + way * (to - from)
            } else {
                *to
            };
            *vel = rate * (to - from) * axis.vel_gain / axis.disp_gain;
        }
        let posed = self.posed.as_mut().filter(|_| share < 1.0);
        let Some(bends) = posed.and_then(|posed| posed.bends(way)) else {
            return;
        };
        let commands = self.command.iter_mut().zip(&mut self.command_vel);
        for (((command, vel), axis), (bend, slope)) in commands.zip(&self.axes).zip(bends) {
            *command += axis.disp_gain * bend;
            *vel += rate * slope * axis.vel_gain;
        }
    }
}
